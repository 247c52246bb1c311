"""Check a scene before it is run: model, first mesh, numbers, simplifications, cost, outlook."""

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

from repro.errors import SimulationError, printable
from repro.fem.linear import Method
from repro.march.state import stopping
from repro.model.meshing import seeded
from repro.polling import poll
from repro.preflight import cost
from repro.preflight.cost import Cost
from repro.preflight.memory import first_nodes, require_memory, require_outline
from repro.preflight.modelled import describe_model
from repro.preflight.numbers import Number, evaluate_at_largest, reached
from repro.preflight.outlook import LIMIT, CoarseRun, Outlook
from repro.preflight.resolved import find_unresolved_flow
from repro.preflight.simplifications import Caveat, find_warnings, warn_missed_tolerance
from repro.scene import Scene, Source, label, load_scene
from repro.scene.arguments import Overrides, typed
from repro.scene.units import SceneError

WIDTH = 110
#: Largest mesh (nodes) that a check generates. For a larger one it estimates the nodes.
MOST_MESHED = 20_000


@dataclass(frozen=True)
class SceneCheck:
    """Result of :func:`check`; ``print`` shows it.

    modelled: (section, words); nodes, triangles: of the first mesh, with six nodes for each curved
    triangle; estimated: True if these numbers are estimates because the mesh is too large to make;
    outlook: of a coarse run, None if none was made.
    """

    scene: str
    modelled: list[tuple[str, str]]
    nodes: int
    triangles: int
    numbers: list[Number]
    warnings: list[Caveat]
    cost: Cost
    estimated: bool = False
    outlook: Outlook | None = None

    def __str__(self) -> str:
        lines = [f"{printable(self.scene)}: can be run", "", "Model"]
        for section, words in self.modelled:
            lines += textwrap.wrap(words, WIDTH, initial_indent=f"  {section:12}",
                                   subsequent_indent=" " * 14)
        nodes = f"about {self.nodes}" if self.estimated else f"{self.nodes}"
        lines += ["", f"Mesh at t = 0: {nodes} nodes, {self.triangles} triangles", ""]
        outlook = self.outlook
        lines += _cost(self.cost)
        if outlook:
            heading = f"Outlook of a coarse run (preset sketch, {outlook.seconds:.1f} s)"
            reason = outlook.stopped or "the end of the run"
            lines += ["", *textwrap.wrap(f"{heading}: to t = {outlook.time:.4g} h: {reason}", WIDTH,
                                         subsequent_indent="  ")]
        if outlook and outlook.contact is not None:
            lines += [f"  contact with the opposite wall from t = {outlook.contact:.3g} h on"]
        if self.numbers:
            lines += ["", *_numbers(self.numbers, outlook)]
        lines += [""] if self.warnings else ["", "All checked simplifications hold."]
        for caveat in self.warnings:
            lines += textwrap.wrap(f"WARNING {caveat.key}: {caveat.text}.", WIDTH + 2,
                                   subsequent_indent="  ")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return (f"<Check of {printable(self.scene)}: it can be run, {len(self.warnings)} warnings, "
                f"{self.nodes} nodes at t = 0>")

    def tables(self) -> dict:
        """Return the result as a dict for JSON."""
        return {**asdict(self), "modelled": dict(self.modelled)}


@typed
def check(scene: Source, overrides: Overrides = (), *, unset: Sequence[str] = (),
          run: bool = True) -> SceneCheck:
    """Check a scene before it is run, and run it coarsely for a few seconds.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A loaded scene, a TOML file, the name of a packaged scene, or a dict of tables.
    overrides : sequence of str or dict, optional
        Changes of the scene, as for :func:`repro.load_scene`.
    unset : sequence of str, optional
        Keys or sections of the scene to leave out.
    run : bool, optional
        Make the first steps of a scene with growth, and run it with the preset ``sketch`` for at
        most 5 s of wall time.

    Returns
    -------
    SceneCheck
        The model in words, the size of the first mesh, the dimensionless numbers, a warning for
        each simplification that does not hold, the cost (s, MB), and the outlook: the simulated
        time (h) at which the coarse run stopped, the reason, and the time of contact. ``print``
        shows it.

    Raises
    ------
    SceneError
        If the scene is not accepted, if its first state or its first steps fail, or if a run would
        need more than the free memory.

    Examples
    --------
    >>> import repro
    >>> repro.check("flow_only").warnings
    []
    """
    return examine(load_scene(scene, overrides, unset=unset), label(scene), run, lambda _: None)


def examine(scene: Scene, file: str, run: bool, report: Callable[[float], None]) -> SceneCheck:
    """Check a loaded scene, as :func:`check` does.

    file: its name in messages; report: receives each time (h) that the coarse run reaches.
    """
    memory_warnings: list[str] = []
    require_outline(scene)
    require_memory(scene, memory_warnings.append)
    estimated = first_nodes(scene) > MOST_MESHED
    try:
        with stopping(0.0):
            Method(scene.numerics.solver).checked()
            nodes, triangles = _mesh_size(scene, estimated)
            poll()
        trial = cost.run_trial(scene, nodes, run)
        flow = trial.first.solved.flow
        velocity = flow.mean_velocity if flow else None
        poll()
        unresolved = [*find_unresolved_flow(scene)]
        coarse = CoarseRun(scene) if run and scene.growth else None
        outlook = coarse.run(report, LIMIT) if coarse else None
        end = reached(coarse.pore) if coarse and coarse.pore else None
        caveats = [*find_warnings(scene, velocity, end), *unresolved,
                   *warn_missed_tolerance(scene, trial.worst, " in the first steps"),
                   *(Caveat("numerics.refinement", text) for text in memory_warnings),
                   *(coarse.warnings.values() if coarse else ())]
        _, computed = evaluate_at_largest(scene, velocity, end)
        estimate = cost.estimate_cost(scene, trial, nodes, coarse)
        return SceneCheck(scene.name, describe_model(scene), nodes, triangles, computed, caveats,
                          estimate, estimated, outlook)
    except (SimulationError, ArithmeticError) as error:
        raise SceneError(f"{file}: it cannot be run: {error}") from error


def _mesh_size(scene: Scene, estimated: bool) -> tuple[int, int]:
    """Nodes and triangles of the first mesh."""
    if estimated:
        nodes = round(first_nodes(scene))
        return nodes, round(2 * nodes / scene.numerics.scheme.order**2)
    mesh = seeded(scene).mesh
    return len(mesh.points), len(mesh.biomass)


def _cost(estimate: Cost) -> Iterator[str]:
    memory = f"{estimate.memory:.0f} MB in addition to the program"
    if estimate.steps is None:
        yield f"Cost, roughly: {memory}"
        return
    steps = f"{estimate.steps} steps" if estimate.steps else "no step"
    yield (f"Cost, roughly: {duration(estimate.seconds)} ({steps}) without writing files; "
           f"{memory}")
    yield "  The estimate is right within a factor of three in the paper's pores."


def duration(value: float) -> str:
    """Write a time with two digits, or three from 99.5 s to 120 s."""
    if value < 120:
        return f"{value:.2g} s" if value < 99.5 else f"{value:.0f} s"
    return f"{value / 60:.0f} min" if value < 7200 else f"{value / 3600:.0f} h"


def _numbers(computed: list[Number], outlook: Outlook | None) -> Iterator[str]:
    later = f"at {outlook.time:.4g} h" if outlook else ""
    yield f"Numbers{'':23}{'t = 0':>9}{later:>17}".rstrip()
    for number in computed:
        end = "" if number.end is None else f"{number.end:.2g}"
        yield f"  {number.name:28}{number.start:>9.2g}{end:>17}".rstrip()
    definitions = {number.name.partition(",")[0]: number.definition for number in computed}
    for name, definition in definitions.items():
        yield from textwrap.wrap(f"{name} = {definition}", WIDTH, initial_indent="    ",
                                 subsequent_indent="      ")
