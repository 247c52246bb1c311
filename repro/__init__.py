"""Pore-scale biological clogging by the growth of an aggregate: Dupin, Kitanidis & McCarty (2001), reproduced.

Where the paper is in the code:

    section                   equations   module
    2    coupling                         repro.coupling, repro.pore; repro.simulation chooses the scheme
         steps by their error             repro.stepping, repro.midpoint (second order in time; not in the paper)
    2    geometry, 2.3.3, 3.1             repro.geometry, repro.mesh, repro.shape
    2.1  flow, 3.2            (1)-(6)     repro.flow
    2.2  kinetics             (7)-(10)    repro.kinetics
    2.2  substrates, 3.3      (7)-(13)    repro.transport (quasi-steady), repro.gear (the paper's transient scheme)
    2.3  growth, 3.4          (14)-(29)   repro.growth
    2.3.2 fluid forces        (20), (22)  repro.traction
    3.4  reprojection         (30)-(34)   repro.reprojection
    3.5  mesh motion          (35)        repro.mesh_motion, repro.remeshing
    Table 1                               repro.scene, repro.scenes
    all of it on curved triangles         repro.curved, with modules of the same names; repro.curved.fields has the
                                          order of velocity and substrates: quadratic or cubic

and what is around it:

    scenes                                repro.scene (keys, defaults, sources), repro.units, repro.reading,
                                          repro.rules, repro.scene_files, repro.scene_text (repro scene)
    what a run will be                    repro.check, of repro.modelled, repro.numbers, repro.simplifications,
                                          repro.cost (repro check)
    one loop of steps, and their length   repro.loop, repro.pace
    runs and results                      repro.running, repro.recorder, repro.results, repro.names, repro.netcdf,
                                          repro.tables (NumPy arrays), repro.timing, repro.machine
    runs that lose nothing                repro.checkpoint, repro.stored, repro.folder, repro.interrupts
    pages that show and compare runs      repro.report
    many pores                            repro.sweep
    linear algebra                        repro.assembly, repro.linear, repro.newton, repro.cache
    command line                          repro.cli, repro.commands, repro.progress

Ten lines of use; ``repro/tutorial.md`` has more:

    from repro import load_scene, simulate, solve

    scene = load_scene("base", ['growth.end="5 h"'])
    found = solve(scene)                                    # rows of timeseries.csv, as NumPy arrays
    print(found["conductivity_m_per_d"], found.units["conductivity_m_per_d"], found.fields(5.0).keys())

    for instant in simulate(scene):                         # or step by step, with all that is known
        pore, flow = instant.pore, instant.solved.flow      # um, h, mg/L: see the docstrings
        print(pore.time, 24e-6 * flow.mean_velocity, pore.outline.thickness)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repro.coupling import PoreEnd
    from repro.errors import SimulationError
    from repro.running import resume, run
    from repro.scene import Scene, load_scene
    from repro.simulation import simulate
    from repro.tables import Results, solve
    from repro.units import SceneError
else:
    #: The module of each public name, imported when it is first asked for: the solver takes half a second.
    _MODULES = {"PoreEnd": "coupling", "Results": "tables", "Scene": "scene", "SceneError": "units",
                "SimulationError": "errors", "load_scene": "scene", "resume": "running", "run": "running",
                "simulate": "simulation", "solve": "tables"}

    def __getattr__(name: str):
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})

__all__ = ["PoreEnd", "Results", "Scene", "SceneError", "SimulationError", "load_scene", "resume", "run", "simulate",
           "solve"]
