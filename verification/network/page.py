"""The page `docs/network.md`, from the records of the laws, of ten throats as whole runs, and of a sweep."""

import json
from collections.abc import Sequence

import numpy as np

from reference import gold_flow
from repro.network.own import FACTOR
from repro.network.resistance import share_range
from repro.network.throats import added_resistance
from repro.network.uptakes import FAST, UPTAKE_BOUND
from repro.results import read_table
from verification.evidence.writing import table
from verification.network import histories, law, own, runs, throats, timed, uptakes
from verification.network.law import RATIO

#: Areas over W^2 that the page lists, before contact and after it.
PAGE_SHARES = ((0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.3, 1.4, 1.5), (1.6, 1.75, 2.0, 2.5, 3.0, 4.0, 4.5))


def text() -> str:
    """The page."""
    parts = (TITLE, _limits(), DEFINITION, _values(), _fit(), _judged(), _range_of_table(), UPTAKE, _fit_of_uptake(),
             _judged_uptake(), _example(), _own(), _throats(), _laws_apart(), _sweep())
    return "\n\n".join(part for part in parts if part) + "\n"


TITLE = "# A law for networks\n\nMade by `python -m verification.network`."

DEFINITION = """\
For models of networks, `repro.added_resistance(area, width, spanned, viscosity_ratio)` computes the head loss that an
aggregate of area A adds to a pore of width W.

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned)

r W is the length of empty pore with the resistance that the aggregate adds. Stokes flow is linear and has no length
scale, so r depends neither on u_ave nor on W. The position of the aggregate has no effect at 1.5 W or more from the
pore's ends. Before contact r hardly depends on lambda until the film is thin. For a body that spans the pore, r is
nearly proportional to lambda - 1: a plug with straight ends has exactly (lambda - 1) A / W^2, and rounded ends reduce
it."""

UPTAKE = """## Uptake

`repro.uptake(area, width, velocity, acceptor, donor)` computes the uptake of both substrates and the growth of the
area, with the kinetics of Table 1. It uses the rates (7)-(10) at one concentration of each substrate in the aggregate.
That concentration is below the supply because the inflow is limited and because diffusion to the aggregate needs a
difference; `repro/network/uptakes.py` has the equations. The range is A / W^2 to 4.5, widths of 40 to 150 um, and up
to 10 m/d and 20 mg/L."""


OWN = """## With one's own kinetics

`repro.uptake(area, width, velocity, scene="mine.toml")` and `repro.added_resistance(area, width, scene="mine.toml")`
use the kinetics, the diffusivities, the supplies and lambda of a scene. `repro network-law mine.toml`, or the first
call, computes their table once: half a minute to some minutes in `fast` on one core, with a bar (`progress=True` in
Python).

- The uptake is solved for 60 half-discs in pores of half to twice the scene's width, and for three states of each shape
  that the run of the scene grows, at 0.0001 to 10 m/d and 1 to 100 % of the scene's supplies. The constants of the law
  are fitted to them, and the rule above gives the bound. The law has these ranges; A / W^2 extends to that of the
  run's plugs, or to 1.51 if no shape of the run touches both walls. States that the elements do not resolve are left
  out, with a warning.
- The resistance is multiplied by the ratio of r of the grown shapes to r of the law, and the bounds include both.
- The table is JSON with a checksum in `~/.cache/dupin2001-repro`, or in that folder of `XDG_CACHE_HOME`. Its name is
  a hash of the scene, the code and the versions of the packages. If the file is damaged or has another origin, it is
  computed again.
- Scenes need a flow, both substrates, one viscous aggregate between two walls, and Monod's law or first order. Erosion
  and detachment count only in the run that grows the shapes.

1000 throats take about 110 evaluations of the rates, each for all throats: about 30 ms.
The example for OpenPNM takes a scene as its argument: `python docs/howto/openpnm_network.py mine.toml`.

Two scenes, with slower and faster uptake than Table 1's (`verification/network/own.py`), are judged with states of
another seed: by their own law, and by the constants and the bound of Table 1 with the kinetics of the scene. Both
bounds hold for both scenes. So the constants of Table 1, which describe transport, are useful for other kinetics; this
is no proof for a third scene. Few states are plugs. If they do not determine the constants of plugs, the law
interpolates."""


def _limits() -> str:
    """What the tests of the law do not show."""
    resistance, _ = runs.laws_at_the_runs()
    outside = ~resistance.holds
    factor = (resistance.run / resistance.law)[outside]
    least, most = _widest(runs.compared())
    return f"""\
**The tests of this law are weak.** In whole runs of ten throats r of {int(outside.sum())} of {outside.size} states is
outside the bounds: it is {factor.min():.2f} to {factor.max():.2f} times that of the law, because the aggregates grew in
slow flow. No throat of these runs is spanned, and the bounds of the flow reach from {least:+.0f} to {most:+.0f} %. So
the runs say little about the law near contact and after it. The shapes below, with which the law is judged, have
velocities and supplies in the range of its fit."""


def _values() -> str:
    """The law at one lambda."""
    head = f"At lambda = {RATIO:g}, with the bounds of shapes of the same area:"
    return "\n\n".join((head, _markdown_table(False), _markdown_table(True)))


def _fit() -> str:
    """The shapes behind the law."""
    fit = law.read(unseen=False)
    grown = int(fit["grown"].sum())
    return f"""\
The table, `repro/network/resistance.csv`, has r of half-discs and, after contact, the mean of the plugs grown in
several runs. The law was fitted to {len(fit["grown"])} shapes. Its bounds are the smallest and the largest ratio of a
computed resistance to the law among them. {grown} shapes were grown, in pores of 40 to 150 um at 0.5 to 6 m/d and W^2
/ 2500 (W in um) to 20 mg/L of both substrates. The others were drawn: half-discs, bodies from 1 % thinner to 3 %
thicker than a half-disc that lean by up to 5 %, and plugs with ends of other lengths. Each grown plug is compared with
the mean of the other runs. With less substrate, diffusion limits growth, the aggregate is thicker before contact, and r
exceeds the bounds: near contact r doubles if the thickness rises by about 5 %."""


def _judged() -> str:
    """The law with shapes that are not in its fit."""
    check = law.judged(law.read(unseen=True))
    worst = 100 * np.expm1(np.abs(check.apart))
    return f"""\
The law is judged with {check.count} shapes that are not in the fit. Their sizes, outlines, places, widths, velocities,
supplies and lambdas are drawn at random. {check.inside} are within the bounds; half of them are
within {np.median(worst):.1f} % of the law, and the worst is {worst.max():.0f} % from it."""


def _range_of_table() -> str:
    """Where the law holds."""
    discs, plugs = ([100 * (gold_flow.added(name, "traction").length / gold_flow.added(name, "laplacian").length - 1)
                     for name in gold_flow.outlines() if name.startswith(kind)] for kind in ("half-disc", "wide, "))
    return f"""\
The table has A / W^2 from {_range(False)} before contact and from {_range(True)} after it, and lambda from 100 to
10 000. Thinner bodies follow half-discs, an empty pore adds nothing, and plugs of 1.41 to 1.6 have a wider lower bound.
Without `spanned` the area decides whether the aggregate touches both walls; from 1.41 to 1.6 the bounds include both
cases. Outside the table the function raises `ValueError` with the index of the throat; with `outside="nan"` that
throat has no result. The law holds for the paper's viscous aggregate with its own condition on the surface [E2]. With
continuous traction NGSolve changes r of half-discs 0.88 and 0.96 W thick by {_list(discs, "+.1f")} %, and that of three
plugs grown in Wide, of 1.6 to 3.1 W^2, by {_list(plugs, "+.1f")} %. Shorter plugs than those of the law change by
more, a straight one of 0.25 W by -45 % [E2]."""


def _fit_of_uptake() -> str:
    """The states behind the law of uptake."""
    seen = uptakes.read(uptakes.FIT)
    return f"""\
`python -m verification.network uptake` solves states drawn by a seed, and fits the constants of the law to them:
{_numbers(seen)}. Shapes do not change in a state; velocities are
{uptakes.VELOCITIES[0]:g} to {uptakes.VELOCITIES[1]:g} m/d,
supplies {uptakes.SUPPLIES[0]:g} to {uptakes.SUPPLIES[1]:g} mg/L.
The bound is {FACTOR:g} times the largest error of the fit, {100 * UPTAKE_BOUND:.3g} %; before contact it is
larger for a thick body in a fast flow, by a factor of 1 + {FAST:g} (Pe A / W^2)^2. We wrote this rule before we solved
the states below. The factor is from an earlier fit. Its bound was 5 %, and 7 % after one of 50 states had an error of
5.9 %.\
"""


def _judged_uptake() -> str:
    """The law of uptake with other states."""
    new = uptakes.read(uptakes.NEW)
    apart, bounds = uptakes.judged()
    worst_state = (apart / bounds).argmax()
    return f"""Another seed draws {len(bounds)} other states: {_numbers(new)}.
{int((apart <= bounds).sum())} are within the bound; half of them are within {100 * np.median(apart):.2g} % of the law.
The worst differs by {100 * apart[worst_state]:.1f} % from it, with a bound of {100 * bounds[worst_state]:.0f} %."""


def _own() -> str:
    """The laws with other kinetics."""
    record = json.loads(own.RECORD.read_text(encoding="utf-8"))
    return OWN + "\n\n" + table(
        ["scene", "law", "bound, at least", "states within the bound", "median error", "worst error"],
        [[name, title, f"{100 * law['bound']:.3g} %", f"{law['within']} of {law['states']}",
          f"{100 * law['median']:.2g} %", f"{100 * law['worst']:.3g} %"]
         for name, scene in record.items()
         for title, law in (("of the scene", scene["own"]), ("constants of Table 1", scene["table_1"]))])


def _example() -> str:
    """The example of a network, with its step and with half of it."""
    ratios = histories.flow_ratios()
    step, half = histories.STEPS
    change = abs(ratios[half] - ratios[step])
    return f"""\
`make network` runs `docs/howto/openpnm_network.py`: 100 throats in OpenPNM with both laws, over 48 h. Its flow falls to
{ratios[step]:.3g} of the first; a step of {half:g} h instead of {step:g} h changes this by {change:.1g}.
Until then no aggregate spans its throat."""


def _throats() -> str:
    """Ten throats as whole runs, against the law."""
    compared = runs.compared()
    area, flow, *uptake = np.nanmax(100 * np.abs(compared.error), axis=(0, 1))
    verdict = "all bounds hold" if compared.holds.all() else "the bounds do not hold for all of them"
    return f"""## Ten throats as whole runs

This test says little about the law after contact, as the page says first.

`python -m verification.network throats` runs ten throats of this network in the preset `fast`, with the head loss and
the supplies that they have in the example. `verification/network/throats.py` has the rule that chooses them, and the
bounds of the law over a history: those of resistance and uptake, compounded over the growth. Both were written before
the runs.
The law is advanced in steps of 6 min. Errors of the law relative to the run at 48 h, with the bounds of the error:

{_errors(compared)}

{int(compared.holds.sum())} of {compared.holds.size} values at {_list(throats.TIMES)} h are within the bounds:
{verdict}. Over these times the error of the area is {area:.2g} % at most, that of the flow {flow:.2g} %, that of
the uptakes {max(uptake):.2g} %. The last column is the error of the area in the example; its step of
{histories.STEPS[0]:g} h adds to the error."""


def _widest(compared: runs.Comparison) -> tuple[float, float]:
    """The widest bounds (%) of the error of the flow at the last time."""
    least, most, run = (values[:, -1, 1] for values in (compared.least, compared.most, compared.run))
    law = compared.law[:, -1, 1]
    return float(100 * (law / most - 1).min()), float(100 * (law / least - 1).max())


def _errors(compared: runs.Comparison) -> str:
    """A table of the errors at the last time."""
    head = ("throat", "width (um)", "A / W^2", "area", "flow", "acceptor uptake", "donor uptake", "area in the example")
    widths = {one.number: one.width for one in histories.read()}
    rows = []
    sides = np.array([compared.law, compared.least, compared.most, compared.run])
    for k, number in enumerate(compared.number.tolist()):
        errors = [_error(*values) for values in sides[:, k, -1].T]
        share = compared.run[k, -1, 0] / widths[number]**2
        rows.append((number, f"{widths[number]:.1f}", f"{share:.2f}", *errors,
                     f"{100 * compared.example_error[k, -1]:+.1f} %"))
    return table(head, rows)


def _error(value: float, least: float, most: float, run: float) -> str:
    """The error of the law in percent, and its bounds."""
    error, low, high = (100 * (value / other - 1) for other in (run, most, least))
    return f"{error:+.2f} % ({low:+.0f} to {high:+.0f})"


def _laws_apart() -> str:
    """Both laws at the area and the velocity of the runs, without the error of the growth."""
    resistance, uptake = runs.laws_at_the_runs()
    factor = (resistance.run / resistance.law)[~resistance.holds]
    outside = "" if resistance.holds.all() else (
        f" In the other states r is {factor.min():.2f} to {factor.max():.2f} times that of the law. Their\nA / W^2 is "
        f"{resistance.share[~resistance.holds].min():.2f} or more, and {_range_words(resistance)} the range of "
        "velocities and supplies of the\nshapes behind the law: there the law of resistance does not hold. "
        + _controls())
    counts = [f"{int(one.holds.sum())} of {one.holds.size}" for one in (uptake, resistance)]
    return f"""\
Here the laws are compared with the runs at the area and the velocity of each run. {counts[0]} uptakes are within the
bound of their law, and {counts[1]} values of r.{outside}"""


def _controls() -> str:
    """The cause: aggregates of the same area grown at other velocities."""
    columns = read_table(runs.CONTROLS)
    history, *constant = zip(*(columns[name] for name in runs.CONTROL_COLUMNS))
    words = "; ".join(f"{speed:g} m/d: {factor:.2f} and {thickness:.3f}" for speed, _, factor, thickness in constant)
    return (f"The cause is slow flow. Aggregates then\ngrow upstream, towards the supply, and are thinner. Throat "
            f"{runs.CONTROL} at A / W^2 = {history[1]:.2f} has {history[2]:.2f} times the r\nof the law and "
            f"{history[3]:.3f} times the thickness of the half-disc. Grown from the same seed at\na "
            f"constant velocity, to A / W^2 = {runs.CONTROL_SHARE:g} at most, it has these two ratios:\n{words}.")


def _range_words(resistance: runs.Judgement) -> str:
    """Describe whether the states outside of the bounds have conditions outside of the range."""
    inside = int(resistance.in_range[~resistance.holds].sum())
    return "all of them have left" if inside == 0 else f"all but {inside} of them have left"


def _sweep() -> str:
    """The time of a sweep of all throats; nothing without a record."""
    record = timed.read()
    if not record:
        return ""
    seconds = {(way["way"], way["workers"]): way["seconds"] for way in record["ways"]}
    pool = [seconds[timed.POOL, workers] for workers in (1, 2)]
    dask = [seconds[timed.DASK, workers] for workers in (1, 2)]
    failed = sum(way["unfinished"] for way in record["ways"])
    alike = "all ways give the same table" if record["equal"] else "the tables differ"
    rows = ((way["way"], way["workers"], f"{way['seconds']:.0f}", f"{record['runs'] / way['seconds']:.2f}",
             f"{seconds[way['way'], 1] / way['seconds']:.2f}", f"{way['load']:.1f}") for way in record["ways"])
    head = ("runs made by", "workers", "s", "runs/s", "times faster than one worker", "load")
    return f"""## A sweep of all throats

`python -m verification.network sweep` makes whole runs of all {record["runs"]} throats
over {record["hours"]:g} h, in `fast` with files and page, on the process pool and on a
Dask scheduler with workers on the same machine:

{table(head, rows)}

Two workers are {pool[0] / pool[1]:.2f} times faster than one on the process pool, and {dask[0] / dask[1]:.2f} times
on Dask. Dask takes {dask[1] / pool[1]:.2f} times as long as the pool with two workers. Runs that failed: {failed};
{alike}. The machine has {record["machine"]["cores"]} cores. The load
is the mean number of processes that used or awaited a core in the last minute of a sweep. A load above the number of
workers by more than two shows that other work disturbed the times. The throats without flow
have a head loss of {runs.LEAST_HEAD:g} um."""


def _list(numbers: Sequence[float], form: str = "g") -> str:
    return ", ".join(f"{number:{form}}" for number in numbers[:-1]) + f" and {numbers[-1]:{form}}"


def _numbers(states: dict[str, np.ndarray]) -> str:
    """The numbers of states of each kind."""
    grown, spanned = states["grown"] == 1, states["spanned"] == 1
    return f"{(~grown).sum()} half-discs, {grown.sum()} grown shapes, {spanned.sum()} of them in contact"


def _range(spanned: bool) -> str:
    low, high = share_range(spanned)
    return f"{low:.3g} to {high:.3g}"


def _markdown_table(spanned: bool) -> str:
    """A table in Markdown."""
    shares = np.array(PAGE_SHARES[spanned])
    head = (f"A / W^2, {'touching both walls' if spanned else 'before contact'}", "r", "least", "most")
    rows = zip(shares, *added_resistance(shares, 1.0, spanned, RATIO))
    return table(head, ("{:g} {:.3g} {:.3g} {:.3g}".format(*row).split() for row in rows))
