"""Compare a run with a finer one of the same scene: is the mesh fine enough?

The finer run has the next preset. ``exact`` and the presets of the paper's scheme have none: their
elements and steps are divided. A key of [numerics] that is already as fine as the next preset is
refined by the same factor. So are elements that boundary layers make nearly as small as those of
the next preset.
"""

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from time import process_time

import numpy as np

from repro import results
from repro.errors import RunEnd, SimulationError, StageError
from repro.march.simulation import steps
from repro.model.meshing import MOST_REFINED, resolution
from repro.polling import OutOfTime, poll, within
from repro.preflight import COMPARISON_TIME
from repro.preflight.checked import WIDTH
from repro.preflight.memory import require_memory, require_outline
from repro.results import names
from repro.scene import FINER, PRESETS, Scene, SceneError, Source, label, load_scene
from repro.scene.arguments import Overrides, typed

#: Divides the elements of a scene without a finer preset. It has FACTOR^2 times the nodes.
FACTOR = 1.5
#: What a finer key of [numerics] is multiplied by. The error of a midpoint step of length h, which
#: the tolerance limits, is of order h^2.
FACTORS = {"refinement": FACTOR, "tolerance": FACTOR**-2, "contact_elements": FACTOR}
#: Intervals between rows, if the scene requests no times.
INTERVALS = 24


@dataclass(frozen=True)
class Difference:
    """Largest difference of a column between both runs.

    difference: in %, or in um for a coordinate; time: h, where it is; own, finer: both values then,
    in the unit of the column's name.
    """

    column: str
    difference: float
    unit: str
    time: float
    own: float
    finer: float


@dataclass(frozen=True)
class FinerComparison:
    """Result of :func:`error`; ``print`` shows it.

    own, finer: what is solved, in words; time: h, of the last common row; rows: number of common
    rows; stopped: why it compares no later rows, empty at the end of the scene; seconds: processor
    time of both runs; limit: its limit.
    """

    scene: str
    own: str
    finer: str
    time: float
    rows: int
    stopped: str
    seconds: float
    limit: float
    differences: list[Difference]

    @property
    def sentence(self) -> str:
        """A sentence that a paper may quote."""
        answers = [each for each in self.differences if each.column in names.ANSWER]
        changes = [f"the {names.words(each.column)} changes by at most {each.difference:.2g} "
                   f"{each.unit}" for each in answers or self.differences]
        span = f"From t = 0 to {self.time:.4g} h" if self.time else "At t = 0"
        return (f"{span}, {', '.join(changes)} if the numerics change from {self.own} to "
                f"{self.finer}.")

    def tables(self) -> dict:
        """Return the result as a dict for JSON."""
        return {**asdict(self), "sentence": self.sentence}

    def __str__(self) -> str:
        reason = self.stopped or "the end of the scene"
        heading = (f"{self.scene}: {self.own} compared with {self.finer}, {self.rows} common rows "
                   f"to t = {self.time:.4g} h: {reason} ({self.seconds:.2g} s of processor time, "
                   f"at most {self.limit:g} s)")
        lines = [f"  {each.column:34}{f'{each.difference:.2g} {each.unit}':>12}{each.time:>10.4g}"
                 f"{each.own:>12.5g}{each.finer:>12.5g}" for each in self.differences]
        return "\n".join([*textwrap.wrap(heading, WIDTH, subsequent_indent="  "), "",
                          f"{'Largest difference':48}{'at t (h)':>10}{'own':>12}{'finer':>12}",
                          *lines, "",
                          *textwrap.wrap(self.sentence, WIDTH), "",
                          "This is the change of the results, and no bound of their error."])


@typed
def error(scene: Source, overrides: Overrides = (), *, unset: Sequence[str] = (),
          limit: float = COMPARISON_TIME) -> FinerComparison:
    """Compare a run of a scene with a finer run, to see whether its mesh is fine enough.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A loaded scene, a TOML file, the name of a packaged scene, or a dict of tables.
    overrides : sequence of str or dict, optional
        Changes of the scene, as for :func:`repro.load_scene`.
    unset : sequence of str, optional
        Keys or sections of the scene to leave out.
    limit : float, optional
        Processor time (s) of both runs together. They are compared as far as they come.

    Returns
    -------
    FinerComparison
        The largest difference of each column over the common rows, in % (um for coordinates), with
        its time (h), and a sentence that a paper may quote. ``print`` shows it.

    Raises
    ------
    SceneError
        If the scene is not accepted, if there is no common row, as after a failure at t = 0, or if
        the finer run would need more than the free memory.

    Notes
    -----
    The runs have the presets ``sketch`` and ``fast``, ``fast`` and ``accurate``, or ``accurate``
    and ``exact``. For the other presets the finer run has elements of 2/3 the size, and a tolerance
    or a ``growth.time_step`` smaller in proportion to the expected error. In fast flow the boundary
    layers set the size of the elements; there the finer run has 2/3 of it. Rows are at the scene's
    requested times, or at 25 evenly spaced ones. A difference is relative to the value of the finer
    run in the same row. For columns that may be negative, and where that value is zero, it is
    relative to the largest value of both runs.

    Examples
    --------
    >>> import repro
    >>> compared = repro.error("base", {"growth.end": "0.1 h", "numerics.preset": "sketch"})
    >>> compared.time, compared.rows, compared.stopped
    (0.1, 25, '')
    """
    loaded = load_scene(scene, overrides, unset=unset)
    return compare_with_finer(loaded, label(scene), limit, lambda _: None)


def compare_with_finer(scene: Scene, file: str, limit: float,
                       report: Callable[[float], None]) -> FinerComparison:
    """Compare the runs of a loaded scene, as :func:`error` does.

    file: its name in messages; report: receives each time (h) that both runs have reached.
    """
    if not limit > 0:
        raise SceneError(f"--limit {limit:g}: a number of seconds, more than zero, is needed")
    finer = refine(scene)
    require_outline(scene)
    require_memory(finer, lambda _: None)
    own, other = _Run("own", scene), _Run("finer", finer)
    begun = process_time()
    stopped = _advance_both(own, other, limit, report)
    times = [time for time in own.rows if time in other.rows]
    if not times:
        raise SceneError(f"{file}: no row to compare: {stopped}")
    differences = []
    for name in own.rows[times[0]]:
        values = np.array([(time, own.rows[time][name], other.rows[time][name]) for time in times],
                          float)
        values = values[np.isfinite(values).all(axis=1)]
        if len(values) and name not in names.NOT_COMPARED:
            differences.append(_largest(name, *values.T))
    return FinerComparison(scene.name, _describe(scene), _describe(finer), times[-1], len(times),
                           stopped, process_time() - begun, limit, differences)


def refine(scene: Scene) -> Scene:
    """Return the scene with finer numerics, and the same times of rows."""
    numerics = scene.numerics
    preset = FINER.get(numerics.preset, numerics.preset)
    refined = {}
    for key, factor in FACTORS.items():
        own = getattr(numerics, key)
        following = PRESETS[preset].get(key, own)
        refined[key] = following if (following - own) * (factor - 1) > 0 else own * factor
    refined["refinement"] = min(max(refined["refinement"], FACTOR * resolution(scene)),
                                MOST_REFINED)
    finer = replace(scene, numerics=replace(numerics, preset=preset, **refined))
    if scene.growth and not numerics.scheme.controls_error:
        step = scene.growth.time_step / FACTOR**2  # the error of an update is of order time_step
        finer = replace(finer, growth=replace(scene.growth, time_step=step))
    return finer


def _describe(scene: Scene) -> str:
    """Preset and numbers of a scene that the finer one changes."""
    numerics = scene.numerics
    step = ""
    if scene.growth:
        step = f", tolerance {numerics.tolerance:.3g}" if numerics.scheme.controls_error else \
            f", time step {scene.growth.time_step:.3g} h"
    return f"{numerics.preset} (refinement {resolution(scene):.3g}{step})"


class _Run:
    """A run, step by step, with rows at the scene's requested times, or at evenly spaced ones.

    time: h, that it has reached; rows: columns by time (h).
    """

    def __init__(self, name: str, scene: Scene):
        self.name = name
        self.time = -1.0
        self.rows: dict[float, dict[str, float | None]] = {}
        self.stopped: str | None = None
        if scene.growth:
            even = np.linspace(0.0, scene.growth.end, INTERVALS + 1).tolist()
            scene = scene.reporting(*(scene.requested_times or even))
        self._steps = self._advance(scene)

    def _advance(self, scene: Scene) -> Iterator[None]:
        for state, row in steps(scene):
            if row:
                self.rows[row.pore.time] = results.row(scene, row)
            self.time = state.pore.time
            yield

    def step(self) -> None:
        """Make a step; ``stopped`` is why there is no other one, empty at the scene's end."""
        try:
            next(self._steps)
        except StopIteration:
            self.stopped = ""
        except RunEnd as end:
            self.stopped = f"the {self.name} run ends: {end}"
        except (SimulationError, StageError, ArithmeticError) as failure:
            self.stopped = f"the {self.name} run fails: {failure.__cause__ or failure}"


def _advance_both(own: _Run, finer: _Run, limit: float, report: Callable[[float], None]) -> str:
    """Advance the run that is behind until it stops; return why it stops, "" at the end."""
    try:
        with within(limit, process_time):
            while (behind := min(own, finer, key=lambda run: run.time)).stopped is None:
                poll()
                behind.step()
                report(max(0.0, min(own.time, finer.time)))
    except OutOfTime:
        return f"the {limit:g} s are over"
    return "; ".join(filter(None, (own.stopped, finer.stopped)))


def _largest(name: str, times: np.ndarray, own: np.ndarray, finer: np.ndarray) -> Difference:
    quantity = names.known(name)
    change, unit = np.abs(own - finer), "um"
    if not name.endswith(names.COORDINATES):
        unit = "%"
        scale = np.abs(finer)
        largest = max(np.abs(own).max(), scale.max()) or 1.0
        signed = quantity is not None and quantity.signed
        change = 100 * change / np.where((scale == 0) | signed, largest, scale)
    k = int(change.argmax())
    difference, time, first, second = (float(each[k]) for each in (change, times, own, finer))
    return Difference(name, difference, unit, time, first, second)
