"""Element sizes that grow with the distance from the aggregate, against one size everywhere."""

from __future__ import annotations

from repro.model import pore
from repro.scene import parse_scene
from verification.case import Outcome, at_most, case

SCHEMES = {"paper": {"preset": "paper"}, "accurate": {"preset": "accurate"},
           "cubic": {"preset": "accurate", "elements": "cubic"}}


@case("flow-graded", kind="property",
      norm="relative difference of the loss; nodes over those of graded sizes; largest over least edge",
      claim="With one element size everywhere the loss of a half-disc is that of sizes which grow with the distance "
            "from it, for more than twice the nodes, on straight triangles and on curved ones of order 2 and 3",
      mutants=("gradation-ignored", "gradation-not-passed"))
def graded() -> Outcome:
    checks = []
    for name, numerics in SCHEMES.items():
        (loss, nodes), (even, many) = (_half_disc(numerics, gradation) for gradation in (0.25, 0.0))
        checks += [at_most(f"loss, {name}", abs(loss / even - 1), 5e-3 if name == "paper" else 1e-3,
                           "errors near the aggregate rule: those of the preset's elements there"),
                   at_most(f"nodes, {name}", nodes / many, 0.5, "half")]
    return Outcome(tuple(checks))


def _half_disc(numerics: dict[str, str], gradation: float) -> tuple[float, int]:
    """Loss of the pore and nodes of its mesh."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": "10 um"},
              "flow": {"mean_velocity": "2.9 m/day"}, "numerics": {**numerics, "gradation": gradation}}
    scene = parse_scene(tables, "half disc", "half_disc.toml")
    now = pore.seeded(scene)
    return pore.solve(scene, now).flow.head_loss, len(now.mesh.points)
