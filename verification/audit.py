"""What each choice costs and what it changes: ``python -m verification.audit`` prints the table and writes
``verification/report/audit.json``.

The paper's modelling and numerical choices (:mod:`verification.switches`), one changed at a time: base in the paper's
preset at 19.2 h against the same run with the change, at the same element size and step. ``effect`` is the difference
of two whole runs. Two runs that remesh at different moments differ by what two meshes differ by, in velocity ten times
more than in shape: so the other run's last shape is solved in on the default's mesh, brought to that shape. What is
left of two meshes is the row "mesh"; ``resolved`` names the quantities that change by more than twice that. Runs of
which each needs meshes of its own, the full pore's, are compared in the converged solution: in the paper's preset two
meshes make -0.05 to -0.23 % of the velocity of an effect under 0.01 %.
``one_state`` is free of it: both choices in the state of the default at 19.2 h, flow and substrates solved in it and
the shape of one step more. ``cost_ratio`` is of processor time, the median of runs in turn, made for that alone.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from time import process_time

from repro.march.simulation import simulate
from verification import switches
from verification.bench.record import machine
from verification.claims import runs
from verification.claims.runs import BASE, PLATES, UPDATE
from verification.evidence.checks import columns
from verification.evidence.writing import Block, plain, save, table
from verification.switches import CHOICES, PLOTTED, Course, Switch, state

RECORD = Path(__file__).parent / "report" / "audit.json"
#: Runs in turn of which the processor times are the medians.
REPEATS = 3
#: Times (h) at which the lean of an uneven seed is told.
TIMES = (0.4, 4.8, 9.6, 14.4, PLOTTED)
METHOD = (f"base, preset paper, at {PLOTTED:g} h in steps of {60 * UPDATE:g} min; "
          "effect: difference of two whole runs, relative, effluents over the supply, flow and substrates of both last "
          "shapes on the default's mesh (extent: of the converged solution, as they are); one_state: both choices in "
          "the default's last state, with the shape of one step more; resolved: changes by more than twice what meshes "
          "of the same fineness do (extent: what coarser ones do); cost_ratio: processor time, median of "
          f"{REPEATS} runs in turn (mesh, theta after a remesh, symmetry: one run each)")


def main() -> int:
    """Entry point."""
    noise = mesh()
    rows = [noise, *(measured(switch, cost(switch.run)) for switch in CHOICES.values()), drift(), *symmetry()]
    rows = [{**row, "resolved": resolved(row["effect"], row.get("noise", noise["effect"]))} for row in rows]
    record = {"machine": machine(), "method": METHOD, "rows": rows}
    save(record, RECORD)
    print(plain(blocks(record)))
    return 0


def mesh() -> dict:
    """What runs differ by on meshes of the same fineness to 2.5 %: the largest of each quantity."""
    effects = columns([switches.whole_run(state(BASE), state(switch.run)) for switch in switches.FINENESS])
    told = Switch("mesh", "refinement 1", "refinement 0.975 to 0.995", "", note="no choice: what runs on meshes of the "
                  "same fineness differ by; less than twice that is not resolved")
    return row(told, cost(switches.FINENESS[-1].run, 1),
               {name: max(column, key=abs) for name, column in effects.items()})


def measured(switch: Switch, ratio: float) -> dict:
    """The row of a choice that a scene can name, at a cost."""
    print(f"{switch.choice}: {switch.alternative}", file=sys.stderr, flush=True)
    if not switch.meshes:
        effects, noise = switches.converged(switch)
        return {**row(switch, ratio, effects), "noise": noise}
    default, other = state(BASE), state(switch.run)
    told = row(switch, ratio, switches.whole_run(default, other))
    return {**told, "one_state": switches.one_state(default, other.scene) if switch.state else {}}


def cost(run: tuple[str, ...], repeats: int = REPEATS) -> float:
    """The ratio of the processor times of a run and of base, medians of runs in turn."""
    default, other = map(median, zip(*((seconds(PLATES), seconds(run)) for _ in range(repeats))))
    return other / default


def seconds(run: tuple[str, ...]) -> float:
    """Processor time of a run."""
    said, start = runs.scene(*run), process_time()
    for _ in simulate(said):
        pass
    return process_time() - start


def drift() -> dict:
    """theta restarting at a remesh as J X / X_m against J: the drift of (28) [E7]."""
    other = switches.course(BASE, switches.restarting_as_j)
    drifts = {name: float(found["drift"].max()) for name, found in
              (("default", switches.told(BASE)), ("alternative", other.columns))}
    note = f"drift, max |X / X_m - 1| over the run: {drifts['default']:.2g} against {drifts['alternative']:.2g} [E7]"
    told = _marched(other, Switch("theta after a remesh (28)", "J X / X_m", "J", "", note=note))
    return {**told, "drift": drifts}


def symmetry() -> list[dict]:
    """A half-disc against one whose downstream tip, or upstream tip, reaches out by 1 %, the other tip less by that."""
    rows = []
    for word, bulge in (("upstream", -switches.BULGE), ("downstream", switches.BULGE)):
        other = switches.course(BASE, switches.as_it_is, bulge)
        ours, theirs = (switches.near(found, "lean", TIMES) for found in (other.columns, switches.told(BASE)))
        off = ", ".join(f"{100 * value:+.2f} % at {time:g} h" for value, time in zip(ours - theirs, TIMES))
        rows.append(_marched(other, Switch(
            "symmetry of the seed", "half-disc", f"1 % longer {word}", "",
            note=f"R (1 + 0.01 cos 3 phi), area as before; the middle between the tips is off by {off}")))
    return rows


def _marched(other: Course, switch: Switch) -> dict:
    return row(switch, other.seconds / seconds(PLATES), switches.whole_run(state(BASE), other.plotted))


def row(switch: Switch, ratio: float, effects: dict[str, float]) -> dict:
    """A row of the record."""
    return {"choice": switch.choice, "default": switch.default, "alternative": switch.alternative, "cost_ratio": ratio,
            "effect": effects, "one_state": {}, "note": switch.note}


def resolved(effects: dict[str, float], noise: dict[str, float]) -> list[str]:
    """Names of the quantities that change by more than twice what meshes of the same fineness make of them."""
    return [name for name, value in effects.items() if abs(value) > 2 * abs(noise[name])]


#: Of the table.
HEAD = ("choice", "default", "alternative", "cost", "velocity", "area", "acceptor out", "largest change",
        "in one state", "note")


def blocks(record: dict) -> Iterator[Block]:
    """A choice a line: its cost, its effects over the runs, and the largest there and in one state."""
    yield Block("heading", "What the paper's choices cost and change")
    yield Block("text", f"{record['method']}.")
    yield table(HEAD, map(_choice, record["rows"]))


def _choice(row: dict) -> tuple[str, ...]:
    effect = row["effect"]
    changes = (_change(effect[name]) for name in ("velocity", "area", "acceptor leaving"))
    return (row["choice"], row["default"], row["alternative"], f"{row['cost_ratio']:.2f}", *changes, _told(effect),
            _told(row["one_state"]), row["note"])


def _told(effects: dict[str, float]) -> str:
    name = max(effects, key=lambda name: abs(effects[name]), default="")
    return f"{_change(effects[name])} ({name})" if name else ""


def _change(value: float) -> str:
    return f"{100 * value:+.2g} %"


if __name__ == "__main__":
    sys.exit(main())
