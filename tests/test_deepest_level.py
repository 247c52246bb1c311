"""Elements halved to resolve a front, at every level up to the deepest."""
from dataclasses import replace

import numpy as np
import pytest

from repro import load_scene
from repro.errors import Unresolved
from repro.model import pore, remeshing

#: A dense aggregate of 20 um that exhausts its supply in a front as thin as the root of the half saturation.
DENSE = ["numerics.preset=fast", "aggregate.radius=20 um", "kinetics.maximum_density=400 g/L"]
#: Half saturations (mg/L), factors by which their front refines the elements at the aggregate, and times (h).
LEVELS = [(0.1, 1, 0.0), (0.03, 2, 0.0), (0.01, 4, 0.0), (0.01, 4, 0.5)]


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


@pytest.mark.parametrize("half, level, time", LEVELS)
def test_elements_are_halved_as_often_as_a_front_needs(half, level, time):
    """At t = 0 the mesh is that of the seed, later it is a new one. Elements twice as large do not resolve the front.
    Effluents agree with those of elements as small everywhere."""
    scene = fronted(half)
    first = replace(pore.seeded(scene), time=time)
    graded, solved = remeshing.solve_graded(scene, first)
    assert round(np.log2(at_rim(first) / at_rim(graded))) == np.log2(level)
    assert within_bounds(graded, solved) and graded.mass == pytest.approx(first.mass, rel=1e-3)
    if level > 1:
        with pytest.raises(Unresolved):
            pore.solve(scene, pore.seeded(scene, level / 2))
    if (level, time) == (4, 0.0):
        fine = fronted(half, "numerics.refinement=0.8")
        expected = [flux.effluent for flux in pore.solve(fine, pore.seeded(fine)).fluxes]
        assert [flux.effluent for flux in solved.fluxes] == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("time", [0.0, 0.5])
@pytest.mark.parametrize("least, excerpt", [(0.3, "= 0.3 resolves"), (0.31, "= 0.4 resolves"), (0.41, "= 0.6 resolves"),
                                            (0.61, "numerics.refinement up to 0.6 does not resolve it")])
def test_a_refinement_is_advised_that_resolves_the_state(monkeypatch, least, excerpt, time):
    """It is the first of 1.5, 2 and 3 times the refinement of the scene, 0.2, that resolves the front."""
    def solve(scene, *arguments):
        if scene.numerics.refinement < least:
            raise Unresolved("the mesh is too coarse")
        return exact(scene, *arguments)

    exact = pore.solve
    monkeypatch.setattr(remeshing, "solve", solve)
    scene = load_scene("base", ["numerics.preset=fast", "aggregate.radius=20 um"])
    error = remeshing.advise(scene, replace(pore.seeded(scene), time=time), Unresolved("too coarse"))
    assert excerpt in str(error)
