"""Coupled runs with elements of every order: decay, contact, options.

Ledgers, symmetry, growth in closed form and orders in time are cases of the stage coupling.
"""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from repro.fem.outline import BOTTOM, TOP
from repro.march.simulation import simulate
from repro.model import contact, pore
from repro.scene import load_scene
from tests.strategies import ORDERS, scene

EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def elements(order):
    """The paper's scheme with elements of an order, fewer of them the higher it is."""
    return {"elements": ORDERS[order], "refinement": {1: 1.0, 2: 0.4, 3: 0.3}[order]}


def sets(order):
    """The same for a packaged scene."""
    return ('numerics.preset="paper"', *(f"numerics.{key}={value}" for key, value in elements(order).items()))


def run(made):
    """All instants of a scene."""
    return list(simulate(made))


#: Schemes and orders of elements, the midpoint rule with those of the size of preset fast.
WAYS = [(time, order) for time in ("updates", "midpoint") for order in ORDERS]


@pytest.fixture(scope="module", params=WAYS, ids=lambda way: f"{way[0]}-{way[1]}")
def touching(request):
    """An aggregate 0.1 um short of the film that closes, under a constant velocity: the scene, and its steps through
    contact."""
    time, order = request.param
    numerics = elements(order)
    if time == "midpoint":
        numerics |= {"preset": "fast", "refinement": 0.5 if order == 1 else 0.2}
    radius, growth = "17.9 um", {"end": "1 h"}
    if (time, order) == ("midpoint", 1):  # a film of 2 um would thin out the straight triangles beside it
        radius, growth = "18.9 um", {"end": "1 h", "minimum_film": "1 um"}
    made = scene(radius, "20 um", velocity="2.9 m/day", growth=growth, numerics=numerics)
    return made, [instant for instant in run(made) if instant.ledgers or instant.pore.time == 0]


def test_contact_closes_the_film_and_the_run_goes_on(touching):
    """Nodes of contact lie on the walls to the last bit, middles with their corners; one of them is fixed at the top;
    flow is forced through the plug. That ledgers close and the fluid splits is the case coupling-contact."""
    made, found = touching
    states = [instant.pore.contact for instant in found]
    assert states == sorted(states) and not states[0] and sum(states) >= 2
    for instant in found[states.index(True):]:
        outline = instant.pore.outline
        top = outline.wall == TOP
        assert (outline.points[top, 1] == 20.0).all()
        assert (outline.points[outline.wall == BOTTOM, 1] == 0.0).all()
        assert outline.thickness == pytest.approx(20.0, rel=1e-15 if outline.geometry == 1 else 1e-14)
        assert outline.fixed[top].sum() == 1 and not instant.pore.mesh.turned_over().any()
        assert instant.solved.concentrations.acceptor.min() > 0
        if made.numerics.time == "updates":
            assert instant.solved.flow.conductivity < 0.5 * found[0].solved.flow.conductivity
        if outline.geometry == 2:
            middles = np.flatnonzero(top[1::2]) * 2 + 1
            assert not outline.fixed[1::2].any()
            assert (top[middles - 1] & top[(middles + 1) % len(top)]).all()
    assert found[states.index(True)].remeshes >= 1


OPTIONS = {
    "interface": ("numerics.interface=traction",),
    "inlet": ("numerics.inlet=mean",),
    "fixed point": ("numerics.fixed_point=rechosen",),
    "stress-free": ("growth.new_biomass=stress_free",),
    "gear": ("numerics.transport=gear",),
    "forces": ("growth.fluid_forces=included",),
    "all": ("numerics.interface=traction", "numerics.inlet=mean", "numerics.fixed_point=rechosen",
            "growth.fluid_forces=included"),
}


def lost_at_the_inlet(instant):
    """(supplied - out - consumed) / supplied of both substrates that (11) with u_ave loses [E4]."""
    problem, state = instant.solved.problem, instant.solved.concentrations
    lost = []
    for k, field in enumerate((state.acceptor, state.donor)):
        enters = np.split(problem.source, 2)[k] / problem.both[k].supply
        lost.append((enters - problem.inflow) @ field / instant.solved.fluxes[k].supplied)
    return lost


def through_contact(order, *changes):
    """From before contact with the opposite wall to after it: the scene and its run."""
    made = load_scene("base", [*sets(order), 'aggregate.radius="17.9 um"', 'pore.width="20 um"', *changes,
                               'growth.end="0.4 h"', "flow.head=1e-2 cm"])
    return made, run(made)


def of_the_last(found):
    """What an option may change."""
    last = found[-1]
    return [last.pore.outline.upstream, last.solved.flow.mean_velocity, last.pore.mass, last.solved.fluxes[0].supplied]


@cache
def without_options(order):
    """The same of a run without options."""
    return of_the_last(through_contact(order)[1])


@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_works_with_elements_of_every_order(name):
    """Order 1, 2 and 3 agree on the area to 1 %, and on the velocity before contact to 3 %; balances close, but for
    what the printed inlet loses; each makes a difference, but which point is fixed of what grows evenly."""
    areas, speeds = [], []
    for order in ORDERS:
        made, found = through_contact(order, *OPTIONS[name])
        assert name == "fixed point" or of_the_last(found) != without_options(order)
        assert found[-1].pore.contact and not found[0].pore.contact
        areas.append([instant.pore.outline.area for instant in found])
        speeds.append(found[0].solved.flow.mean_velocity)
        for instant in found:
            for row in instant.ledgers:
                assert abs(row.biomass_before + row.biomass_made - row.biomass_after) < 1e-10 * row.biomass_after
            lost = [0.0, 0.0] if made.numerics.inlet == "local" else lost_at_the_inlet(instant)
            for flux, share in zip(instant.solved.fluxes, lost):
                rest = (flux.supplied - flux.out - flux.consumed) / flux.supplied
                assert rest == pytest.approx(share, abs=1e-6 if made.numerics.transport == "gear" else 1e-9)
    assert areas[0] == pytest.approx(areas[2], rel=1e-2) and areas[1] == pytest.approx(areas[2], rel=1e-2)
    assert speeds == pytest.approx([speeds[2]] * 3, rel=3e-2)


@EVERY_ORDER
def test_the_fixed_point_is_kept_or_chosen_anew(order):
    """Of an aggregate whose fixed point is beside the middle: "kept" it keeps its x to the last bit, "rechosen" the
    middle does [E20]."""
    made = scene("10 um", velocity="2.9 m/day", growth={"end": "1 h"}, numerics=elements(order))
    now = pore.seeded(made)
    x, middle = now.outline.points[:, 0], int(np.flatnonzero(now.fixed)[0])
    aside = middle + 2 * now.mesh.geometry
    beside = replace(now, fixed=np.arange(len(x)) == aside)
    for word, stays, goes in (("kept", aside, middle), ("rechosen", middle, aside)):
        said = replace(made, numerics=replace(made.numerics, fixed_point=word))
        found = contact.expand(said, beside, 1.2 * now.theta).pore
        assert np.flatnonzero(found.fixed).tolist() == [stays]
        after = found.outline.points[:, 0]
        assert after[stays] == x[stays] and abs(after[goes] - x[goes]) > 0.05
