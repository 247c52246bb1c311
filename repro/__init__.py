"""Biological clogging of a pore by a growing aggregate: Dupin, Kitanidis & McCarty (2001).

Ten lines of use; ``docs/tutorial.md`` of the repository has more:

    import repro

    scene = repro.load_scene("base", {"growth.end": "5 h"})  # a packaged scene, a file or a dict
    print(scene)                                             # its TOML, every key with its unit
    print(repro.check(scene))                                # expected model, mesh and cost
    results = repro.solve(scene)                             # rows of timeseries.csv, as arrays
    print(results["conductivity_m_per_d"], results.units["conductivity_m_per_d"])
    results = repro.run(scene, "runs/base")                  # the same as files, and a page
    repro.load_run("runs/base").plot("acceptor", time=3)     # and .plot(), .animate(), .to_pandas()
    repro.sweep(scene, ["pore.width=50 um, 60 um"], "sweep")

Functions; every argument after these is given by its name:

    load_scene(scene, overrides)            a scene: sections, keys, units
    check(scene, overrides)                 its model, mesh, numbers, warnings and cost
    error(scene, overrides)                 its change on a finer mesh, column by column
    solve(scene, overrides)                 Results in memory
    run(scene, folder, overrides)           the same Results, written to a folder
    resume(folder, overrides)               continue a run, or extend it to a later end
    load_run(folder)                        Results of a run in a folder
    compare(folders, file)                  a page that compares runs
    sweep(scene, vary, folder, overrides)   runs with varied keys or own points, tables and page
    simulate(scene, overrides)              the full state at every row, in um, h, mg/L
    added_resistance(area, width, spanned)  resistance of an aggregate in a throat
    uptake(area, width, velocity, acceptor, donor)  of both substrates by an aggregate in a throat

Errors: ``SceneError`` (a scene is refused), ``OutputError`` (a folder or file is refused),
``SimulationError`` (a stage fails), ``TypeError`` (an argument is refused). ``PoreEnd``,
``Fold``, ``Meeting``, ``Detachment`` and ``Steady`` are ends of the model, which only ``simulate``
raises.

Sections of the paper and their modules, which name the equations that they solve:

    section                    equations    module
    Table 1, 2.1-2.3                        repro.scene: keys with unit, default, range and source
    3.2-3.4  finite elements                repro.fem.elements, .space, .assembly, .linear, .newton
    3.1  mesh                               repro.fem.outline, .sizing, .mesher, .mesh, .division
    2.1, 2.3.3  walls                       repro.fem.walls, .welds (of aggregates)
    3.5  transfer to a new mesh             repro.fem.transfer
    2.1, 3.2  flow             (1)-(6)      repro.model.flow, .interface, .resistance, .brinkman
    2.2  kinetics              (7)-(10)     repro.model.uptake_law, .kinetics
    2.2  substrates            (7)-(13)     repro.model.transport, .substrates
    2.2, 3.3  in time          (7)-(13)     repro.model.transport_in_time, .gear
    2.3, 3.4  growth           (14)-(27)    repro.model.growth, .solid, .configuration
    2.3  energies              (17)         repro.model.energies
    3.4  biomass               (28)-(34)    repro.model.biomass, .growing
    2.3.2  fluid forces        (20), (22)   repro.model.traction, .support (along a wall)
    2.3, 3.4  shape in contact              repro.model.contact, .mechanics (one equilibrium)
    2.3.3  closing of films                 repro.model.closing_by_nodes, .closing_by_lines
           contact lines                    repro.model.contact_lines, .contact_newton
         welds (not the paper's)            repro.model.welding
    5    adhesion, tearing                  repro.model.adhesion
         erosion (not the paper's)          repro.model.erosion
         receding outlines                  repro.fem.recession
         limits of the surface              repro.model.surface
    3.5  mesh motion           (35)         repro.model.mesh_motion
    3.1, 3.5  first mesh, remeshing         repro.model.meshing, .remeshing, .grading
    2    state of the pore                  repro.model.pore, .body, .stages (the parts of a step)
    2    flow and substrates in it          repro.model.solving
         both schemes, as printed           repro.schemes
    2    coupling, 3.3                      repro.march.updates (the paper's shape updates)
         error control (not the paper's)    repro.march.midpoint, .stepping, .step_control
         steps with erosion                 repro.march.eroding
         ends of the model                  repro.march.ends, .folding
         the loop of both                   repro.march.loop, .state, .simulation
    4, 5  results, laws for networks        repro.results, .columns, .arrays, .tables, repro.network

Data flow:

    repro.schemes     the paper's scheme and the curved one, side by side
    repro.scene       reads, checks and converts a .toml file to a Scene in um, h, mg/L, or refuses
                      it in one line (.files, .reading, .units, .rules; .text)
    repro.model.meshing  makes the Pore at t = 0 from the Scene: outline, mesh, masses
    repro.march       advances the Pore step by step, and yields Reports: pore, flow, substrates,
                      ledgers
    repro.results     makes rows and fields from Reports, in the units that their names end in
    repro.preflight   predicts a run: dimensionless numbers, warnings, cost (repro check)
    repro.report      pages that show and compare runs (repro compare)
    repro.runs        a run on the disk: folder, recorder, checkpoints, provenance (repro run)
    repro.network     the laws for throats, of Table 1 or of a scene
    repro.sweeps      many scenes at once (repro sweep)
    repro.cli         the command line

A package imports only from packages above it in this list, with repro.fem before repro.model. All
of them may import repro.errors and repro.timing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repro.errors import OutputError as OutputError
    from repro.errors import SimulationError as SimulationError
    from repro.march.ends import Detachment as Detachment
    from repro.march.ends import Meeting as Meeting
    from repro.march.ends import PoreEnd as PoreEnd
    from repro.march.ends import Steady as Steady
    from repro.march.folding import Fold as Fold
    from repro.march.simulation import simulate
    from repro.network.throats import added_resistance, uptake
    from repro.preflight.checked import check
    from repro.preflight.refined import error
    from repro.report import compare
    from repro.results.tables import Results, solve
    from repro.runs.scripts import load_run, resume, run
    from repro.scene import Scene, load_scene
    from repro.scene import SceneError as SceneError
    from repro.sweeps.driver import sweep

    __version__: str
else:
    #: The module of each public name, imported on first use: importing the solver takes half a
    #: second.
    _MODULES = {name: module for module, names in {
        "errors": "OutputError SimulationError", "scene": "Scene SceneError load_scene",
        "march.ends": "Detachment Meeting PoreEnd Steady", "march.folding": "Fold",
        "march.simulation": "simulate", "results.tables": "Results solve",
        "preflight.checked": "check", "preflight.refined": "error", "report": "compare",
        "network.throats": "added_resistance uptake", "runs.scripts": "load_run resume run",
        "sweeps.driver": "sweep"}.items() for name in names.split()}

    def __getattr__(name: str):
        if name == "__version__":
            return import_module("importlib.metadata").version("dupin2001-repro")
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted(_MODULES)

#: ``help`` lists these; errors are in the text above, so that functions come before them.
__all__ = ["Results", "Scene", "added_resistance", "check", "compare", "error", "load_run",
           "load_scene", "resume", "run", "simulate", "solve", "sweep", "uptake"]
