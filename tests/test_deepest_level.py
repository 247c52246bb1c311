"""Elements halved to resolve a front, at every level up to the deepest."""
import re
from dataclasses import replace

import numpy as np
import pytest

from repro import load_scene
from repro.errors import Unresolved
from repro.march.simulation import simulate
from repro.model import grading, solving
from repro.model.meshing import seeded
from repro.preflight import simplifications
from repro.preflight.numbers import Sizes

#: A dense aggregate of 20 um that exhausts its supply in a front as thin as the root of the half saturation.
DENSE = ["numerics.preset=fast", "aggregate.radius=20 um", "kinetics.maximum_density=400 g/L"]
#: Half saturations (mg/L), factors by which their front may refine the elements at the aggregate, and times (h).
#: The last bit of the mesh decides whether factor 2 or 4 resolves the thinnest front.
LEVELS = [(0.1, (1,), 0.0), (0.0175, (2,), 0.0), pytest.param(0.01, (2, 4), 0.0, marks=pytest.mark.thorough),
          (0.01, (2, 4), 0.5)]


def fronted(half, *changes):
    """Return a scene with a front."""
    halves = [f"substrates.{name}.half_saturation={half} mg/L" for name in ("acceptor", "donor")]
    return load_scene("base", [*DENSE, *halves, *changes])


def at_rim(graded):
    """Return the longest edge (um) between aggregate and fluid."""
    outline = graded.boundary.corners
    return outline.edge_lengths()[outline.interface_edges()].max()


def within_bounds(graded, solved):
    """Return whether concentrations lie between zero and the supply, to the stated accuracy."""
    state = solved.concentrations
    fields = np.stack([state.acceptor, state.donor])
    return fields.min() >= -0.01 and fields.max() <= 10.2


@pytest.mark.parametrize("half, levels, time", LEVELS)
def test_elements_are_halved_as_often_as_a_front_needs(half, levels, time):
    """At t = 0 the mesh is that of the seed, later it is a new one. Elements twice as large do not resolve the front.
    Effluents agree with those of elements as small everywhere."""
    scene = fronted(half)
    first = replace(seeded(scene), time=time)
    graded, solved = grading.solve_graded(scene, first)
    level = 2 ** round(np.log2(at_rim(first) / at_rim(graded)))
    assert level in levels
    assert within_bounds(graded, solved) and graded.mass == pytest.approx(first.mass, rel=1e-3)
    if level > 1 and time == 0:
        with pytest.raises(Unresolved):
            solving.solve(scene, seeded(scene, level / 2))
    if half == 0.01 and time == 0:
        fine = fronted(half, "numerics.refinement=0.8")
        expected = [flux.effluent for flux in solving.solve(fine, seeded(fine)).fluxes]
        assert [flux.effluent for flux in solved.fluxes] == pytest.approx(expected, rel=5e-3)


def test_growth_by_uptake_of_zero_order_runs_past_sharp_fronts():
    """With K_s / 100000 this pore stopped at 0.9 h. The biomass made differs from that of elements half as large by
    less than the loss that `check` states, which its advised refinement brings below a per cent."""
    pore_of = {"pore": {"width": "70.34 um", "length": "1688 um"}, "aggregate": {"radius": "21.23 um"},
               "flow": {"mean_velocity": "0.072 m/day"}, "growth": {"end": "3 h", "new_biomass": "stress_free"},
               "substrates": {"acceptor": {"supply": "0.758 mg/L"}, "donor": {"supply": "3.77 mg/L"}},
               "kinetics": {"law": "zero order"}, "numerics": {"preset": "fast"}, "output": {"times": ["3 h"]}}
    scene = load_scene(pore_of)
    grown = Sizes(3.0, 32 * np.pi, 25.0, 25.0, False, 50.0)
    warned = [w.text for w in widened_fronts(scene, grown)]
    pattern = r"acceptor .* ([\d.]+) % too small; numerics\.refinement = ([\d.]+) would"
    lost, advised = re.search(pattern, warned[0]).groups()
    assert len(warned) == 1 and float(lost) > 1
    assert widened_fronts(load_scene(scene, [f"numerics.refinement={advised}"]), grown) == []
    finer = load_scene(scene, [f"numerics.refinement={2 * scene.numerics.refinement}"])
    made, expected = (last.pore.mass - first.pore.mass for first, *_, last in map(list, map(simulate, (scene, finer))))
    assert made == pytest.approx(expected, rel=float(lost) / 100) and made > 0


def widened_fronts(scene, sizes=None):
    """The warnings of fronts of zero order."""
    found = simplifications.find_warnings(scene, scene.flow.mean_velocity, sizes)
    return [caveat for caveat in found if "widen the front" in caveat.text]
