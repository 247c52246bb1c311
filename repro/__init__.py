"""Pore-scale biological clogging by the growth of an aggregate: Dupin, Kitanidis & McCarty (2001), reproduced.

Where the paper is in the code:

    section                   equations   module
    2    coupling                         repro.march.coupling, repro.model.pore; repro.march.simulation chooses the scheme
         steps by their error             repro.march.stepping, repro.march.midpoint (second order in time; not in the paper)
    2    geometry, 2.3.3, 3.1             repro.fem.geometry, repro.fem.mesh, repro.model.shape
    2.1  flow, 3.2            (1)-(6)     repro.model.flow
    2.2  kinetics             (7)-(10)    repro.model.kinetics
    2.2  substrates, 3.3      (7)-(13)    repro.model.transport (quasi-steady), repro.model.gear (the paper's transient scheme)
    2.3  growth, 3.4          (14)-(29)   repro.model.growth
    2.3.2 fluid forces        (20), (22)  repro.model.traction
    3.4  reprojection         (30)-(34)   repro.fem.reprojection
    3.5  mesh motion          (35)        repro.model.mesh_motion, repro.model.remeshing
    Table 1                               repro.scene, repro.scenes
    all of it on curved triangles         repro.curved, with modules of the same names; repro.curved.fields has the
                                          order of velocity and substrates: quadratic or cubic

and what is around it:

    scenes                                repro.scene (keys, defaults, sources), repro.scene.units, repro.scene.reading,
                                          repro.scene.rules, repro.scene.files, repro.scene.text (repro scene)
    what a run will be                    repro.check, of repro.check.modelled, repro.check.numbers, repro.check.simplifications,
                                          repro.check.cost (repro check)
    one loop of steps, and their length   repro.march.loop, repro.march.pace
    runs and results                      repro.run.running, repro.run.recorder, repro.results, repro.results.names, repro.results.netcdf,
                                          repro.results.tables (NumPy arrays), repro.timing, repro.run.machine
    runs that lose nothing                repro.run.checkpoint, repro.run.stored, repro.run.folder, repro.run.interrupts
    pages that show and compare runs      repro.report
    many pores                            repro.sweep
    linear algebra                        repro.fem.assembly, repro.fem.linear, repro.fem.newton, repro.run.cache
    command line                          repro.cli, repro.cli, repro.run.progress

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

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repro.errors import SimulationError
    from repro.march.loop import PoreEnd
    from repro.march.simulation import simulate
    from repro.results.tables import Results, solve
    from repro.run.running import resume, run
    from repro.scene import Scene, SceneError, load_scene
else:
    #: The module of each public name, imported when it is first asked for: the solver takes half a second.
    _MODULES = {"PoreEnd": "march.loop", "Results": "results.tables", "Scene": "scene", "SceneError": "scene",
                "SimulationError": "errors", "load_scene": "scene", "resume": "run.running", "run": "run.running",
                "simulate": "march.simulation", "solve": "results.tables"}

    def __getattr__(name: str):
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})

    class _Package(ModuleType):
        """``repro.run`` is the function, though there is a room of that name: importing it does not take its place."""

        def __setattr__(self, name, value):
            if not (name in _MODULES and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

    sys.modules[__name__].__class__ = _Package

__all__ = ["PoreEnd", "Results", "Scene", "SceneError", "SimulationError", "load_scene", "resume", "run", "simulate",
           "solve"]
