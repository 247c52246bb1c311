"""Ends of the model within a run (section 5). They are not failures.

Each end is an event with a margin: zero at the event and positive after it.

    detachment    traction that a wall must bear / growth.bonding_strength - 1
    tearing       largest tensile stress / growth.tensile_strength - 1
    fold          Biot's limit / least elastic stretch of the free surface - 1
    pore's end    1 - distance to the end / element of the fluid, for each end of the pore
    meeting       1 - film / growth.minimum_film, for the film between two aggregates, between a
                  welded one and a wall that it does not touch, between two parts of a surface, or
                  behind thicker water at a wall that the surface touches
    eroded        growth.minimum_film / thickness, or over the contact with its wall, - 1

The largest margin is tested at t = 0, at the end of each step, and on both sides of a jump of the
scene's tables. At a jump the aggregate takes its new equilibrium at once. If the largest margin is
positive, shorter steps from the same start locate its zero (:func:`locate`). This is the first of
all ends in the step. The run ends with that state, because the model has no law for what follows. A
margin that becomes positive and negative again within one step is not detected.

With growth.after_detachment = "continue", an aggregate leaves the pore if it detaches from its only
wall or if erosion has worn it down, and the run continues. The run still ends if one of two touched
walls cannot hold the aggregate, or if erosion removes a contact surface: the model has no law for a
surface that becomes free.

With growth.meeting = "weld", two aggregates that meet join (:mod:`repro.model.welding`), and the
run continues. The run also continues if a welded aggregate touches a wall that its group does not
touch yet. If a weld or such a contact would enclose water, or if :attr:`repro.Scene.without_weld`
gives a reason, the run ends, and its message says why.

With growth.until = "steady", a run also ends after a step in which the aggregates hardly change
(:func:`steadiness`). This end is not located.

Two ends have no margin and are not located: a step without a smooth equilibrium, if the surface can
crease (a fold, :mod:`repro.march.folding`), and a contact surface that erosion removes within a
step (:mod:`repro.march.eroding`). With growth.new_biomass = "stress_free" strain does not
accumulate, so the fold in the table is not tested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf

import numpy as np

from repro.errors import RunEnd, StageError
from repro.fem import welds
from repro.fem.outline import Outline
from repro.fem.sizing import ACROSS_PORE
from repro.march.folding import Fold, fold_message, most_compressed
from repro.march.state import Compression, StepResult
from repro.model import adhesion, contact_lines
from repro.model.adhesion import Loading, Peak
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.scene import Pore as Channel
from repro.scene import Scene, Stated, TimeTables

#: An end is located if its margin is positive and at most CLOSE. The relative error of its time is
#: CLOSE / (d ln(stress) / d ln(t)). The least numerics.tolerance of a preset is 2.5e-4.
CLOSE = 1e-4
#: A margin jumps if it rises by more than CLOSE within this part of the time, or this time (h).
SAME_MOMENT = 1e-5
SHORTEST_MOMENT = 1e-8
#: A trial divides the interval. Each part is at least this fraction of the interval.
LEAST_PART = 0.02
#: No mesh is generated if the aggregate is nearer than this to an end of the pore (elements of the
#: fluid).
LEAST_ELEMENTS = 0.1


class PoreEnd(RunEnd):
    """The aggregate has reached an end of the pore.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure: the message names the end of the pore and the time (h). The aggregate is then one
    element of the fluid from that end.

    Examples
    --------
    >>> import repro
    >>> changes = ['pore.length="120 um"', 'aggregate.radius="9 um"', 'aggregate.position="-50 um"']
    >>> try:
    ...     for report in repro.simulate(repro.load_scene("base", changes)):
    ...         pass
    ... except repro.PoreEnd as end:
    ...     print(end)
    the aggregate reaches the pore's upstream end at t = 0 h
    """


class Meeting(RunEnd):
    """Two aggregates meet: the film between them is thinner than ``growth.minimum_film``.

    With ``growth.meeting = "weld"``, the default, two aggregates join instead, and the run
    continues, unless the weld would enclose water. Two aggregates on opposite walls enclose none.
    Two on one wall enclose none if they meet at this wall. A run also ends if a surface touches
    itself so that water is enclosed, if welded aggregates touch in a second place, if a surface
    touches a wall in a second place, and if a welded aggregate reaches a wall that another one
    touches already.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure: the message names the time (h), the aggregates and the coordinates (um).

    Examples
    --------
    >>> import repro
    >>> changes = ['aggregate=[{radius="18 um"}, {radius="18 um", wall="upper"}]',
    ...            'pore.width="50 um"', "numerics.preset=fast", "growth.meeting=end"]
    >>> try:
    ...     times = [report.pore.time for report in repro.simulate("base", changes)]
    ... except repro.Meeting as end:
    ...     print(str(end)[:23])
    aggregates 1 and 2 meet
    """


class Detachment(RunEnd):
    """The aggregate detaches from a wall, tears, or is eroded.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure. The message names the time (h), the coordinates (um), the stress there and the exceeded
    strength. After erosion it names the remaining thickness or contact length (um). The scene needs
    ``growth.bonding_strength``, ``growth.tensile_strength`` or ``[growth.erosion]``.

    Examples
    --------
    >>> import repro
    >>> changes = ["growth.wall=bonded", 'growth.bonding_strength="1 kPa"', "numerics.preset=fast"]
    >>> reports = repro.simulate(repro.load_scene("base", changes))
    >>> try:
    ...     times = [report.pore.time for report in reports]
    ... except repro.Detachment as end:
    ...     print(str(end)[:25])
    the aggregate detaches at
    """


class Steady(RunEnd):
    """The aggregates are steady: they change by less than ``growth.steady_tolerance``.

    :func:`repro.simulate` raises it after the last Report if ``growth.until = "steady"``. It is an
    end of the model, not a failure: the message names the time (h) and the largest change (1/h).

    Examples
    --------
    >>> import repro
    >>> changes = ["growth.until=steady", 'growth.steady_tolerance="1 1/h"', "numerics.preset=fast"]
    >>> try:
    ...     times = [report.pore.time for report in repro.simulate("base", changes)]
    ... except repro.Steady as end:
    ...     print(str(end)[:25])
    the aggregates are steady
    """


@dataclass(frozen=True)
class Event:
    """An end of a run in one state: its margin, and the exception that reports it.

    leaves: index of the aggregate that leaves the pore if growth.after_detachment = "continue";
    None if the run ends. joins: indices of two aggregates that join, so that the run continues;
    lands: index of a welded aggregate and number of the wall that it joins, so that the run
    continues; None if the run ends.
    """

    margin: float
    end: RunEnd
    leaves: int | None = None
    joins: tuple[int, int] | None = None
    lands: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Reached:
    """A step, the solution at its end, and the event with the largest margin at its end."""

    step: StepResult
    solved: Solved
    event: Event

    @property
    def time(self) -> float:
        """Time (h) of the end of the step."""
        return self.step.pore.time

    def unlocated(self, after: float, reason: str) -> Reached:
        """The same, with a message that the event is not located, and the reason.

        after: h, the last time before the event.
        """
        end = self.event.end
        text = f"{end}; it may happen earlier, after t = {after:g} h, since {reason}"
        return replace(self, event=replace(self.event, end=type(end)(text)))

    @property
    def joins(self) -> tuple[int, int] | None:
        """Indices of two aggregates that join at the end of the step; None if none join."""
        return self.event.joins if self.event.margin > 0 else None

    @property
    def lands(self) -> tuple[int, int] | None:
        """Index of a welded aggregate and number of the wall that it joins; None if none does."""
        return self.event.lands if self.event.margin > 0 else None

    def leaves(self, continues: bool) -> int | None:
        """Index of the aggregate that leaves the pore at the end of the step; None if none leaves.

        continues: is growth.after_detachment = "continue"?
        """
        return self.event.leaves if continues and self.event.margin > 0 else None


@dataclass(frozen=True, eq=False)
class Strength:
    """A strength of an aggregate.

    key: of [growth]; stress: MPa, the largest stress that it withstands; stated: the key's value as
    the scene states it.
    """

    key: str
    stress: float
    stated: Stated

    @classmethod
    def of(cls, scene: Scene, key: str) -> Strength | None:
        """The strength of a key; None if the scene does not have it."""
        stress = getattr(scene.growing.growth, key)
        return None if stress is None else cls(key, stress, scene.stated("growth", key))


@dataclass(frozen=True, eq=False)
class Ends:
    """Data from which the ends of a run follow.

    bonding, tensile: None if the scene does not have the strength; tables: of the scene over time;
    a state is steady only after their last time; without_weld: as :attr:`repro.Scene.without_weld`.
    """

    channel: Channel
    loading: Loading
    bonding: Strength | None
    tensile: Strength | None
    tables: TimeTables
    without_weld: str

    @classmethod
    def of(cls, scene: Scene) -> Ends:
        """The ends of a scene with growth."""
        return cls(scene.pore, Loading.of(scene), Strength.of(scene, "bonding_strength"),
                   Strength.of(scene, "tensile_strength"), scene.time_tables, scene.without_weld)


def nearest_end(ends: Ends, pore: Pore, solved: Solved, start: Pore | None = None) -> Event:
    """The event with the largest margin in a state; start: state before the last step, if any."""
    events = list(_events(ends, pore, solved))
    if start is not None and ends.loading.growth.until_steady:
        events.append(steadiness(ends, start, pore))
    return max(events, key=lambda event: event.margin)


def steadiness(ends: Ends, start: Pore, pore: Pore) -> Event:
    """The event of a steady state after a step from ``start`` to ``pore``.

    Its margin is CLOSE if area, thickness and length of each aggregate change by less than the
    tolerance in the mean over the step, and -1 otherwise. The step must start after the last time
    of the tables, and no aggregate may leave in the step.
    """
    tolerance = ends.loading.growth.steady_tolerance
    change = inf
    if len(pore.bodies) == len(start.bodies) and ends.tables.corner(start.time) == inf:
        ratios = np.array([_extents(after) for after in pore.outlines]) / np.array(
            [_extents(before) for before in start.outlines])
        change = float(np.abs(np.log(ratios)).max(initial=0.0)) / (pore.time - start.time)
    end = Steady(f"the aggregates are steady at t = {pore.time:g} h: their area, thickness and "
                 f"length change by at most {change:.2g} per h, relative to their values; "
                 f"growth.steady_tolerance is {tolerance:g} 1/h")
    return Event(CLOSE if change < tolerance else -1.0, end)


def _extents(outline: Outline) -> tuple[float, float, float]:
    """Area (um2), thickness and length (um)."""
    return outline.area, outline.thickness, outline.downstream - outline.upstream


def _events(ends: Ends, pore: Pore, solved: Solved) -> Iterator[Event]:
    """All ends that the scene models."""
    for side in ("upstream", "downstream"):
        nearest = pore.name_of(farthest(pore, side)) if pore.bodies else ""
        end = PoreEnd(f"{nearest} reaches the pore's {side} end at t = {pore.time:g} h")
        yield Event(1 - elements_to_end(ends.channel, pore, side), end)
    if pore.accumulates and pore.biot > 0:
        compression = most_compressed(Compression(), pore)
        fold = Fold(fold_message(f"at t = {pore.time:g} h", compression))
        yield Event(pore.biot / compression.stretch - 1, fold)
    yield from _meetings(ends, pore)
    if ends.loading.growth.erosion:
        yield from _eroded(ends.loading.growth.minimum_film, pore)
    if ends.bonding is not None:
        peaks = adhesion.wall_peaks(ends.loading, pore, solved)
        for number, (body, peak) in enumerate(zip(pore.bodies, peaks)):
            leaves = None if body.spans else number
            yield _detachment(ends.bonding, pore, number, peak, "detaches", "its wall must bear",
                              leaves)
    if ends.tensile is not None:
        for number, peak in enumerate(adhesion.tensile_peaks(ends.loading, pore, solved)):
            yield _detachment(ends.tensile, pore, number, peak, "tears", "its tensile stress is")


def _eroded(least: float, pore: Pore) -> Iterator[Event]:
    """The events of all aggregates that erosion wears down; least: um, growth.minimum_film."""
    for number, (body, outline) in enumerate(zip(pore.bodies, pore.outlines)):
        own, *_ = body.seat.walls(pore.mesh.walls)
        extent = min(outline.thickness, outline.contact_length(own))
        end = Detachment(f"{pore.name_of(number)} is eroded at t = {pore.time:g} h: its thickness "
                         f"or contact is {extent:.4g} um, below growth.minimum_film")
        yield Event(least / extent - 1, end, None if body.spans else number)


def _meetings(ends: Ends, pore: Pore) -> Iterator[Event]:
    """The events of all pairs of aggregates, and of all surfaces that touch themselves."""
    least = ends.loading.growth.minimum_film
    thicker = 1 + ends.loading.numerics.tolerance
    for pair, film, (x, y) in _films(pore):
        thin = thicker * film
        reason = ends.without_weld or _reason_against_weld(pore, pair, thin)
        end = Meeting(f"{_names(pore, pair)} meet at t = {pore.time:g} h: near x = {x:.4g}, "
                      f"y = {y:.4g} um the film between them is {_closes(film, least)}; {reason}")
        yield Event(1 - film / least, end, joins=None if reason else pair)
    for group in pore.groups:
        around = welds.around([pore.outlines[number] for number in group])
        yield from _mouths(least, thicker * least, pore, group, around)
        yield from _second_contacts(ends, pore, group, around)
        if len(group) > 1:
            yield from _further_contacts(least, pore, group)


def _mouths(least: float, thick: float, pore: Pore, group: tuple[int, ...],
            around: Outline) -> Iterator[Event]:
    """The events of the films of a surface with itself that separate water from the pore.

    least: um, growth.minimum_film; thick: um, slightly larger than ``least``: water behind the film
    that is thinner than this counts as a part of the film; group: indices of the aggregates with
    this surface; around: their outline.
    """
    for diameter in (thick, 2 * thick):  # the second one finds a film before it is too thin
        film, (x, y) = around.mouth(diameter)
        if film < inf:
            surface = (f"{_names(pore, group)} touch in a second place" if len(group) > 1 else
                       f"{pore.name_of(group[0])}'s surface touches itself")
            end = Meeting(f"{surface} at t = {pore.time:g} h: near x = {x:.4g}, y = {y:.4g} um "
                          f"the film is {_closes(film, least)}; this would enclose water")
            yield Event(1 - film / least, end)
            return


def _second_contacts(ends: Ends, pore: Pore, group: tuple[int, ...],
                     around: Outline) -> Iterator[Event]:
    """The events of a surface that touches a wall again beyond a valley, and encloses its water.

    group, around: as for :func:`_mouths`.
    """
    least = ends.loading.growth.minimum_film
    for wall, film, (x, y) in contact_lines.second_contacts(
            around, pore.mesh.walls, least, ends.loading.numerics.tolerance):
        subject = (f"{_names(pore, group)} touch" if len(group) > 1 else
                   f"{pore.name_of(group[0])} touches")
        end = Meeting(f"{subject} the wall y = {wall.y:g} um in a second place "
                      f"at t = {pore.time:g} h: near x = {x:.4g}, y = {y:.4g} um the film is "
                      f"{_closes(film, least)}; this would enclose water")
        yield Event(1 - film / least, end)


def _reason_against_weld(pore: Pore, pair: tuple[int, int], thin: float) -> str:
    """Why two aggregates that meet do not join; empty if they join.

    thin: um; two aggregates meet at a wall if the film between them there is at most as thick. A
    weld must not enclose water. So the groups of the two have no wall in common, or the two meet at
    the only common wall.
    """
    first, second = pair
    if pore.group_of(first) == pore.group_of(second):
        return "this would enclose water beside a weld"
    walls = pore.common_walls(pair)
    if len(walls) > 1 or walls and _between_lines(pore, pair, walls[0]) > thin:
        return "this would enclose water between them and a wall"
    return ""


def _between_lines(pore: Pore, pair: tuple[int, int], wall: int) -> float:
    """Distance (um) between the contact surfaces of two aggregates with a wall; infinite if they do
    not both touch it."""
    along = [outline.points[outline.touches(wall), 0]
             for outline in (pore.outlines[number] for number in pair)]
    if not all(map(len, along)):
        return inf
    first, second = along
    return float(max(first.min() - second.max(), second.min() - first.max()))


def _further_contacts(least: float, pore: Pore, group: tuple[int, ...]) -> Iterator[Event]:
    """The events of welded aggregates that reach a further wall.

    The run ends if their group touches this wall already. group: their indices; least: um,
    growth.minimum_film.
    """
    for number in group:
        outline = pore.outlines[number]
        others = _names(pore, tuple(other for other in group if other != number))
        for wall in outline.untouched(pore.mesh.walls):
            film, x = outline.nearest(wall)
            end = Meeting(f"{pore.name_of(number)} touches the wall y = {wall.y:g} um at "
                          f"t = {pore.time:g} h: near x = {x:.4g} um the film is "
                          f"{_closes(film, least)}; it is welded to {others}, and this would "
                          "enclose water beside a weld")
            encloses = wall.number in pore.walls_of(group)
            yield Event(1 - film / least, end, lands=None if encloses else (number, wall.number))


def _films(pore: Pore) -> Iterator[tuple[tuple[int, int], float, np.ndarray]]:
    """For each two aggregates that are not welded to each other: their indices, the least film (um)
    and its coordinates (2,) um."""
    for pair in combinations(range(len(pore.bodies)), 2):
        if pair not in pore.welds:
            one, other = (pore.outlines[number] for number in pair)
            yield pair, *one.film(other)


def _closes(film: float, least: float) -> str:
    """The thickness of a film (um) and the least one (um), in messages."""
    return f"{film:.3g} um, and it closes below growth.minimum_film, {least:g} um"


def _names(pore: Pore, numbers: tuple[int, ...]) -> str:
    """Names of aggregates in messages."""
    names = " and ".join(pore.bodies[number].name for number in numbers)
    return f"aggregate{'s' * (len(numbers) > 1)} {names}"


def _detachment(strength: Strength, pore: Pore, number: int, peak: Peak, verb: str, subject: str,
                leaves: int | None = None) -> Event:
    """The event of a strength; its message gives the stress in the unit that the scene uses."""
    stated = strength.stated
    ratio = peak.value / strength.stress
    end = Detachment(f"{pore.name_of(number)} {verb} at t = {pore.time:g} h: near x = "
                     f"{peak.x:.4g}, y = {peak.y:.4g} um {subject} {ratio * stated.number:.3g} "
                     f"{stated.unit}, in the mean over pore.width / 20; growth.{strength.key} is "
                     f"{stated.text}")
    return Event(ratio - 1, end, leaves)


def farthest(pore: Pore, side: str) -> int:
    """Index of the aggregate that is nearest to an end of the pore."""
    return int(np.argmax(_tips(pore, side)))


def elements_to_end(channel: Channel, pore: Pore, side: str) -> float:
    """Distance of the nearest aggregate from an end of the pore, over the fluid's element size."""
    tip = max(_tips(pore, side), default=-inf)
    return (channel.length / 2 - tip) * ACROSS_PORE / channel.width


def _tips(pore: Pore, side: str) -> list[float]:
    """Signed distance (um) of each aggregate's tip from the middle of the pore towards an end."""
    return [-outline.upstream if side == "upstream" else outline.downstream
            for outline in pore.outlines]


def refuse_outside(channel: Channel, previous: Pore, expanded: Pore) -> None:
    """Raise PoreEnd if a shape is too close to an end of the pore for a mesh, and Meeting if two
    aggregates overlap.

    The step from ``previous`` is then too long: the event lies within it.
    """
    for pair, film, _ in _films(expanded):
        if film == 0:
            raise Meeting(f"{_names(expanded, pair)} meet in the step from t = {previous.time:g} h")
    for side in ("upstream", "downstream"):
        if elements_to_end(channel, expanded, side) < LEAST_ELEMENTS:
            nearest = expanded.name_of(farthest(expanded, side))
            raise PoreEnd(f"{nearest} reaches the pore's {side} end in the step from "
                          f"t = {previous.time:g} h")


def locate(reach: Callable[[float], Reached], start: float, margin: float,
           passed: Reached) -> Reached:
    """Locate the first event in a step, by the Illinois variant of regula falsi.

    Parameters
    ----------
    reach : callable
        reach(time) makes a shorter step from the same start to a time (h).
    start, margin : float
        Start of the step (h), and the largest margin there, which is not positive.
    passed : Reached
        The full step, at whose end the largest margin is positive.

    Returns
    -------
    Reached
        The step to the event. Its margin is positive and at most CLOSE, unless the margin jumps
        there. A margin that is lower in a later trial shows the noise of different meshes. The
        search stops when the margin is below the largest such fall, or if a shorter step fails. The
        result is then the shortest step that has passed the event, and the message says so.
    """
    low, high = margin - CLOSE / 2, passed.event.margin - CLOSE / 2
    side = 0
    close = CLOSE
    below, above = -inf, inf  # margins of the trials that are nearest to the event
    while passed.event.margin > close:
        interval = passed.time - start
        if interval <= max(SAME_MOMENT * passed.time, SHORTEST_MOMENT):
            break
        part = min(max(low / (low - high), LEAST_PART), 1 - LEAST_PART)
        try:
            trial = reach(start + part * interval)
        except (RunEnd, StageError, FloatingPointError) as error:
            return passed.unlocated(start, f"a shorter step fails: {error}")
        found = trial.event.margin
        value = found - CLOSE / 2
        close = max(close, below - found, found - above)
        if found > 0:
            passed, high, above = trial, value, found
            low *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            start, low, below = trial.time, value, found
            high *= 0.5 if side < 0 else 1.0
            side = -1
    if CLOSE < passed.event.margin <= close:
        return passed.unlocated(start, f"its margin varies by {close:.1g} from mesh to mesh")
    return passed
