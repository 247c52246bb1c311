"""Pore-scale biological clogging by the growth of an aggregate: Dupin, Kitanidis & McCarty (2001), reproduced.

Where the paper is in the code:

    section                   equations   module
    2    coupling                         repro.coupling, repro.pore
    2    geometry, 2.3.3, 3.1             repro.geometry, repro.mesh
    2.1  flow, 3.2            (1)-(6)     repro.flow
    2.2  kinetics             (7)-(10)    repro.kinetics
    2.2  substrates, 3.3      (7)-(13)    repro.transport (quasi-steady), repro.gear (the paper's transient scheme)
    2.3  growth, 3.4          (14)-(29)   repro.growth
    3.4  reprojection         (30)-(34)   repro.reprojection
    3.5  mesh motion          (35)        repro.mesh_motion
    Table 1                               repro.scene, repro.scenes

Ten lines of use:

    from repro import load_scene, simulate

    scene = load_scene("base", ['growth.end="5 h"'])
    for instant in simulate(scene):
        pore, flow = instant.pore, instant.solved.flow      # um, h, mg/L: see the docstrings
        print(pore.time, 24e-6 * flow.mean_velocity, pore.outline.thickness)
"""

from repro.coupling import PoreEnd
from repro.running import run
from repro.scene import Scene, load_scene
from repro.simulation import simulate

__all__ = ["PoreEnd", "Scene", "load_scene", "run", "simulate"]
