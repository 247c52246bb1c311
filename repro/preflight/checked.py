"""A scene before it is run: model, first mesh, numbers, simplifications that fail, and cost."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from repro.errors import SimulationError
from repro.fem.linear import Method
from repro.march.loop import stopping
from repro.model import pore
from repro.preflight import cost
from repro.preflight.cost import Cost
from repro.preflight.memory import first_nodes, require_memory, require_outline
from repro.preflight.modelled import modelled
from repro.preflight.numbers import Number, judged
from repro.preflight.resolved import unresolved
from repro.preflight.simplifications import Warned, unmet, warnings
from repro.scene import Scene, Source, label, load_scene
from repro.scene.units import SceneError

WIDTH = 110
#: Meshes of more nodes are not made for a check: their nodes are estimated.
MOST_MESHED = 20_000
#: Nodes per triangle, by the geometry of the triangles.
PER_TRIANGLE = {1: 0.5, 2: 2.0}


@dataclass(frozen=True)
class Checked:
    """modelled: (section, words); nodes, triangles: of the first mesh, six nodes to a curved
    triangle; estimated: are these two estimates, since the mesh is too large to be made here?"""

    scene: str
    modelled: list[tuple[str, str]]
    nodes: int
    triangles: int
    numbers: list[Number]
    warnings: list[Warned]
    cost: Cost
    estimated: bool = False

    def __str__(self) -> str:
        return report(self)

    def __repr__(self) -> str:
        return (f"<Check of {self.scene}: it can be run, {len(self.warnings)} warnings, "
                f"{self.nodes} nodes at t = 0>")

    def tables(self) -> dict:
        """For JSON."""
        return {**asdict(self), "modelled": dict(self.modelled)}


def check(scene: Source, file: str = "") -> Checked:
    """What is to be told of a scene before it is run; ``print`` shows it. Raises SceneError, naming
    ``file`` or the scene, where it is not accepted, its first state or step fails, or a run of it
    is refused for want of memory."""
    file = file or label(scene)
    scene = load_scene(scene)
    scarce: list[str] = []
    require_outline(scene)
    require_memory(scene, scarce.append)
    estimated = first_nodes(scene) > MOST_MESHED
    try:
        with stopping(0.0):
            Method(scene.numerics.solver, scene.numerics.ordering).checked()
            nodes, triangles = _mesh_size(scene, estimated)
        trial = cost.tried(scene, nodes)
        flow = trial.first.solved.flow
        most, found = judged(scene, flow.mean_velocity if flow else None)
        told = [*warnings(most, found), *unresolved(scene),
                *unmet(scene, trial.worst, " in the first steps"),
                *(Warned("numerics.refinement", text) for text in scarce)]
        return Checked(scene.name, modelled(scene), nodes, triangles, found, told,
                       cost.expected(scene, trial, nodes), estimated)
    except (SimulationError, ArithmeticError) as error:
        raise SceneError(f"{file}: it cannot be run: {error}") from error


def _mesh_size(scene: Scene, estimated: bool) -> tuple[int, int]:
    """Nodes and triangles of the first mesh."""
    if estimated:
        nodes = round(first_nodes(scene))
        return nodes, round(nodes / PER_TRIANGLE[scene.numerics.geometry])
    mesh = pore.seeded(scene).mesh
    return len(mesh.points), len(mesh.biomass)


def report(found: Checked) -> str:
    """The whole in words."""
    lines = [f"{found.scene}: can be run", "", "What is modelled"]
    for section, words in found.modelled:
        lines += _item(section, words)
    about = "about " if found.estimated else ""
    lines += ["", f"Mesh at t = 0: {about}{found.nodes} nodes, {found.triangles} triangles", ""]
    lines += _cost(found.cost)
    if found.numbers:
        lines += ["", *_numbers(found.numbers)]
    lines += ["", *_warnings(found.warnings)]
    return "\n".join(lines)


def _item(name: str, words: str) -> list[str]:
    return textwrap.wrap(words, WIDTH, initial_indent=f"  {name:12}", subsequent_indent=" " * 14)


def _cost(expected: Cost) -> Iterator[str]:
    steps = f"{expected.steps} steps" if expected.steps else "no step"
    yield (f"Cost, roughly: {_seconds(expected.seconds)} ({steps}), writing not counted; "
           f"{expected.memory:.0f} MB besides the program")
    how = ("The first state and steps were made and timed just now, times the steps expected; one "
           f"in contact with the opposite wall counts {cost.IN_CONTACT:g} times. Right within a "
           "factor of three in the paper's pores.")
    yield from textwrap.wrap(how, WIDTH, initial_indent="  ", subsequent_indent="  ")


def _seconds(value: float) -> str:
    """Two digits, and three of a hundred seconds."""
    if value < 120:
        return f"{value:.2g} s" if value < 99.5 else f"{value:.0f} s"
    return f"{value / 60:.0f} min" if value < 7200 else f"{value / 3600:.0f} h"


def _numbers(found: list[Number]) -> Iterator[str]:
    later = any(number.end is not None for number in found)
    yield f"Numbers{'':23}{'t = 0':>9}{'at end, at most' if later else '':>17}".rstrip()
    for number in found:
        end = "" if number.end is None else f"{number.end:.2g}"
        yield f"  {number.name:28}{number.start:>9.2g}{end:>17}".rstrip()
    definitions = {number.name.partition(",")[0]: number.definition for number in found}
    for name, definition in definitions.items():
        yield from textwrap.wrap(f"{name} = {definition}", WIDTH, initial_indent="    ",
                                 subsequent_indent="      ")


def _warnings(found: list[Warned]) -> Iterator[str]:
    if not found:
        yield "No simplification that is checked is out of its range."
    for warned in found:
        yield from textwrap.wrap(f"WARNING {warned.key}: {warned.text}.", WIDTH + 2,
                                 subsequent_indent="  ")
