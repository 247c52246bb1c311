"""Cost and effect of each choice of the paper: ``python -m verification.audit`` prints the table and writes
``verification/report/audit.json``.

The audit changes one of the paper's choices (:mod:`verification.switches`) at a time. It compares base in the paper's
preset at 19.2 h with the changed run, at the same element size and step. ``effect`` is the difference of two complete
runs. Runs that remesh at different times have different meshes, which affect the velocity ten times more than the
shape. The audit therefore moves the default's mesh to the last shape of the changed run and solves there. The row
"mesh" gives the remaining mesh effect; ``resolved`` names the quantities that change by more than twice as much. The
full pore needs meshes of its own, so it is compared in the converged solution: in the paper's preset two meshes change
the velocity by -0.05 to -0.23 %, and the effect is under 0.01 %.
``one_state`` has no mesh effect: it solves flow, substrates and the next shape with both choices in the default's
state at 19.2 h. ``cost_ratio`` compares processor times, medians of alternating runs.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from time import process_time

from repro.march.simulation import simulate
from verification import switches
from verification.claims import runs
from verification.claims.runs import BASE, PLATES, UPDATE
from verification.evidence.checks import columns
from verification.evidence.results import machine
from verification.evidence.writing import save, table
from verification.switches import CHOICES, PLOTTED, Course, Switch, state

RECORD = Path(__file__).parent / "report" / "audit.json"
#: Alternating runs, whose median processor times are compared.
REPEATS = 3
#: Times (h) at which the audit reports the lean of an uneven seed.
TIMES = (0.4, 4.8, 9.6, 14.4, PLOTTED)
METHOD = (f"base, preset paper, at {PLOTTED:g} h in steps of {60 * UPDATE:g} min; "
          "effect: difference of two complete runs, relative, effluents over the supply, with flow and substrates of "
          "both last shapes on the default's mesh (extent: on their own meshes, in the converged solution); one_state: "
          "both choices in the default's last state, with the shape after one more step; resolved: changes by more "
          "than twice the effect of meshes of the same fineness (extent: of coarser meshes); cost_ratio: processor "
          f"time, median of {REPEATS} alternating runs (mesh, theta after a remesh, symmetry: one run each)")


def main() -> int:
    """Entry point."""
    noise = mesh()
    rows = [noise, *(measured(switch, cost(switch.run)) for switch in CHOICES.values()), drift(), *symmetry()]
    rows = [{**row, "resolved": resolved(row["effect"], row.get("noise", noise["effect"]))} for row in rows]
    record = {"machine": machine(), "method": METHOD, "rows": rows}
    save(record, RECORD)
    print(*blocks(record), sep="\n\n")
    return 0


def mesh() -> dict:
    """Largest effect of the mesh on each quantity, for element sizes within 2.5 %."""
    effects = columns([switches.effect_of_runs(state(BASE), state(switch.run)) for switch in switches.FINENESS])
    mesh_switch = Switch("mesh", "refinement 1", "refinement 0.975 to 0.995", "",
                         note="no choice: the difference of runs on meshes of the same fineness; "
                         "less than twice this difference is not resolved")
    return row(mesh_switch, cost(switches.FINENESS[-1].run, 1),
               {name: max(column, key=abs) for name, column in effects.items()})


def measured(switch: Switch, ratio: float) -> dict:
    """Compute the row of a choice that a scene can name; ratio: its cost."""
    print(f"{switch.choice}: {switch.alternative}", file=sys.stderr, flush=True)
    if not switch.meshes:
        effects, noise = switches.converged(switch)
        return {**row(switch, ratio, effects), "noise": noise}
    default, alternative = state(BASE), state(switch.run)
    measured_row = row(switch, ratio, switches.effect_of_runs(default, alternative))
    return {**measured_row, "one_state": switches.one_state(default, alternative.scene) if switch.state else {}}


def cost(run: tuple[str, ...], repeats: int = REPEATS) -> float:
    """Processor time of a run over that of base, medians of alternating runs."""
    default, alternative = map(median, zip(*((seconds(PLATES), seconds(run)) for _ in range(repeats))))
    return alternative / default


def seconds(run: tuple[str, ...]) -> float:
    """Processor time of a run."""
    scene, start = runs.load_packaged(*run), process_time()
    for _ in simulate(scene):
        pass
    return process_time() - start


def drift() -> dict:
    """Compare theta = J X / X_m with theta = J after a remesh: the drift of (28) [E7]."""
    alternative = switches.course(BASE, switches.restarting_as_j)
    drifts = {name: float(columns["drift"].max()) for name, columns in
              (("default", switches.run_columns(BASE)), ("alternative", alternative.columns))}
    note = f"drift, max |X / X_m - 1| over the run: {drifts['default']:.2g} against {drifts['alternative']:.2g} [E7]"
    drift_row = _marched(alternative, Switch("theta after a remesh (28)", "J X / X_m", "J", "", note=note))
    return {**drift_row, "drift": drifts}


def symmetry() -> list[dict]:
    """Compare a half-disc with seeds that have one tip 1 % farther out and the other 1 % farther in."""
    rows = []
    for word, bulge in (("upstream", -switches.BULGE), ("downstream", switches.BULGE)):
        alternative = switches.course(BASE, switches.step_of_paper, bulge)
        lean = switches.near(alternative.columns, "lean", TIMES)
        default = switches.near(switches.run_columns(BASE), "lean", TIMES)
        shifts = ", ".join(f"{100 * value:+.2f} % at {time:g} h" for value, time in zip(lean - default, TIMES))
        rows.append(_marched(alternative, Switch(
            "symmetry of the seed", "half-disc", f"1 % longer {word}", "",
            note=f"R (1 + 0.01 cos 3 phi), the same area; the middle between the tips shifts by {shifts}")))
    return rows


def _marched(alternative: Course, switch: Switch) -> dict:
    return row(switch, alternative.seconds / seconds(PLATES), switches.effect_of_runs(state(BASE), alternative.plotted))


def row(switch: Switch, ratio: float, effects: dict[str, float]) -> dict:
    """A row of the record."""
    return {"choice": switch.choice, "default": switch.default, "alternative": switch.alternative, "cost_ratio": ratio,
            "effect": effects, "one_state": {}, "note": switch.note}


def resolved(effects: dict[str, float], noise: dict[str, float]) -> list[str]:
    """Names of the quantities that change by more than twice the effect of the mesh."""
    return [name for name, value in effects.items() if abs(value) > 2 * abs(noise[name])]


#: Header of the table.
HEAD = ("choice", "default", "alternative", "cost", "velocity", "area", "acceptor out", "largest change",
        "in one state", "note")


def blocks(record: dict) -> Iterator[str]:
    """Yield the table: per choice its cost, its effects over the runs, and the largest effects of both kinds."""
    yield "## What the paper's choices cost and change"
    yield f"{record['method']}."
    yield table(HEAD, map(_choice, record["rows"]))


def _choice(row: dict) -> tuple[str, ...]:
    effect = row["effect"]
    changes = (_change(effect[name]) for name in ("velocity", "area", "acceptor leaving"))
    return (row["choice"], row["default"], row["alternative"], f"{row['cost_ratio']:.2f}", *changes, _largest(effect),
            _largest(row["one_state"]), row["note"])


def _largest(effects: dict[str, float]) -> str:
    name = max(effects, key=lambda name: abs(effects[name]), default="")
    return f"{_change(effects[name])} ({name})" if name else ""


def _change(value: float) -> str:
    return f"{100 * value:+.2g} %"


if __name__ == "__main__":
    sys.exit(main())
