"""Every sentence of advice is listed with the scene or the action in which somebody followed it and it helped.

A sentence of advice says what to change. A requirement ("... is needed") is none: the rule that refuses is its reason.
Members of verification/cases/hard_family.py are scenes of growth to their end.
"""
import ast
import math
import random
import re
import tomllib
from pathlib import Path

import pytest

from repro.cli import main
from repro.errors import SimulationError
from repro.march.simulation import simulate
from repro.model import meshing
from repro.preflight import memory, numbers, simplifications
from repro.runs import machine
from repro.scene import SceneError, load_scene, parse_scene
from tests.shell import refusal, run_python

#: Tests that follow several sentences.
FOLDERS = "tests/test_advice.py::test_a_run_starts_if_the_advice_about_its_folder_is_followed"
PAIRS = "tests/test_scene_refusals.py::test_the_key_that_was_set_is_named"
ENTRIES = "tests/test_scene_refusals.py::test_a_wrong_entry_is_refused"
PACKAGES = "tests/test_advice.py::test_packages_to_install_are_those_that_the_project_names"
MEMORY = "tests/test_advice.py::test_a_smaller_refinement_helps_against_a_lack_of_memory"
DRAWN = "tests/test_advice.py::test_the_advice_of_check_is_accepted_and_helps"
FITS = "tests/test_advice.py::test_the_advice_against_a_lack_of_memory_is_accepted_and_helps"
THRESHOLDS = "tests/test_check.py::test_warnings_are_exactly_where_a_simplification_fails"
RAGGED = "tests/test_ragged_outlines.py::test_presets_agree_on_a_ragged_outline_or_a_warning_names_what_resolves_it"
SPLINES = "tests/test_odd_outlines.py::test_a_spline_that_is_no_outline_is_refused_before_anything_is_written"
STRESS_FREE = "the 18 pores of the family that fold, see docs/design.md"
SIGNALS = "tests/test_names.py::test_every_signal_stops_every_command_and_saves"
LONGER = "tests/test_longer.py::test_the_command_makes_a_run_longer"
LOCKS = "tests/test_folder.py::test_a_killed_run_leaves_no_lock_that_counts"
SWEEPS = "tests/test_sweep.py::test_a_folder_of_another_run_is_refused"

#: {file of repro: {part of its advice: the test that follows it, or the scene in which it was followed}}.
FOLLOWED = {
    "cli/check.py": {"continues the run": SIGNALS},
    "cli/run.py": {"or --resume DIR": SIGNALS, "--resume continues the run": SIGNALS, "makes a run longer": LONGER,
                   "try a smaller numerics.refinement": MEMORY},
    "cli/sweep.py": {"continues the sweep": SIGNALS},
    "fem/linear.py": {"pip install": PACKAGES},
    "scene/needed.py": {"pip install": PACKAGES},
    "scene/former.py": {"leave it out": "tests/test_former.py::test_the_advice_is_accepted"},
    "march/folding.py": {'growth.new_biomass = "stress_free" does': STRESS_FREE},
    "march/state.py": {"try a smaller numerics.refinement": MEMORY},
    "march/updates.py": {"try a shorter growth.time_step":
                         "tests/test_advice.py::test_a_shorter_step_helps_where_the_aggregate_passes_the_opposite_wall"},
    "model/advice.py": {
        "try smooth = false": SPLINES,
        "try a larger numerics.refinement":
            "tests/test_advice.py::test_an_unresolved_front_gets_advice_once_and_it_helps",
        'numerics.preset = "paper"':
            "tests/test_advice.py::test_an_unresolved_front_gets_advice_once_and_it_helps",
        "leave numerics.solver out": PACKAGES,
        'growth.wall = "sliding" is another model': "base: it stops at 14 h on a bonded wall, not on a sliding one"},
    "model/closing_by_lines.py": {"no setting helps": "member 61 of the hard family, without advice"},
    "model/contact.py": {
        'growth.shear_modulus, or growth.fluid_forces = "neglected"': "two drawn scenes of soft bodies in fast flow"},
    "model/gear.py": {"try numerics.transport = ":
                      "tests/test_advice.py::test_profiles_at_rest_help_where_those_in_time_do_not_settle"},
    "model/growth.py": {"try a larger growth.shear_modulus": "members 151 and 171 of the hard family"},
    "model/solving.py": {"leave [flow] out": "tests/test_transport.py::test_too_slow_a_flow_is_refused"},
    "model/meshing.py": {
        "no mesh resolves the boundary layers":
            "tests/test_check.py::test_extreme_peclet_numbers_are_refused_by_their_keys"},
    "preflight/memory.py": {
        "try smooth = false": SPLINES, "needs at most half of them": FITS,
        "no numerics.refinement that resolves": FITS},
    "preflight/resolved.py": {"resolves the flow": RAGGED, "does not resolve the flow": RAGGED},
    "preflight/simplifications.py": {
        "would resolve it": DRAWN, "no refinement up to": DRAWN, "keeps their ratio": DRAWN, "integrates them": DRAWN,
        "models it": DRAWN, "refine by themselves": THRESHOLDS, "replace F by": THRESHOLDS,
        "adds the forces": THRESHOLDS, "computes the traction": DRAWN, "choose a shorter one": THRESHOLDS,
        '"stress_free" avoids this': STRESS_FREE},
    "runs/execution.py": {
        "--resume makes a run longer": LONGER, "give a later one": LONGER, "run another scene": FOLDERS,
        "give a new folder": FOLDERS,
        "with --force": "tests/test_resume.py::test_every_bit_of_a_finished_run_is_checked",
        "try a smaller numerics.refinement": MEMORY},
    "runs/folder.py": {
        "move the folder away": FOLDERS, "give a new folder": FOLDERS, "move the files": FOLDERS,
        "so no run has written it; move it away": FOLDERS, "{}: no run has written it; move it away": FOLDERS,
        "give another folder": FOLDERS, "wait for its end": LOCKS,
        "if no process writes there, remove": "tests/test_names.py::test_a_folder_that_is_locked_elsewhere_is_refused",
        "and use --resume": "tests/test_folder.py::test_foreign_files_are_not_replaced",
        "use --resume": "tests/test_machine.py::test_a_limit_of_file_sizes_ends_a_run_in_one_line",
        "repeat the command": "tests/test_machine.py::test_a_limit_of_file_sizes_ends_a_run_in_one_line"},
    "runs/integrity.py": {"or --force": "tests/test_resume.py::"
                          "test_a_run_of_unknown_status_is_neither_resumed_nor_repeated"},
    "runs/machine.py": {"leave the key out": PACKAGES},
    "runs/recorder.py": {"continues the run": SIGNALS},
    "scene/rules.py": {"removes it": PAIRS},
    "scene/text.py": {"remove it to set the key":
                      "tests/test_scene_text.py::test_every_key_may_be_made_active_at_once"},
    "scene/units.py": {"give milligrams": ENTRIES, "give mg/L": ENTRIES},
    "sweeps/design.py": {"leave :{} out":
                         "tests/test_sweep_design.py::test_each_stratum_of_each_range_has_one_value"},
    "sweeps/folder.py": {"so not of this sweep; move it away": SWEEPS, "not of a run; move it away": SWEEPS,
                         "of another scene; move it away": SWEEPS},
}
#: What a sentence of advice contains. A requirement ("... is needed") is no advice: the rule that refuses explains it.
ADVISES = re.compile(r"""
    (^|[;:,(]\ ?)(and\ |or\ )?(try|give|choose|replace|leave|remove|use|repeat|move|wait|run(?!\ \{))\s
    | \b(try|helps?|avoids|resolves?|adds\ the|computes\ the|keeps\ their|integrates\ them|models\ it|by\ themselves)\b
    | \b(is\ another\ model|removes\ it|makes\ a\ run|continues\ the\ (run|sweep)|pip\ install)\b
    | \b(needs\ at\ most|or\ --resume)\b | \ does$""", re.VERBOSE)
#: Arguments of functions and fields that hold texts of the manual.
MANUAL = {"about", "description", "epilog", "help", "source"}
ROOT = Path(__file__).parents[1]


def texts(node):
    """Every text in a syntax tree with {} in place of values, except docstrings and the manual."""
    if isinstance(node, ast.JoinedStr):
        yield "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif not isinstance(node, ast.keyword) or node.arg not in MANUAL:
        for child in ast.iter_child_nodes(node):
            if not (isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)):
                yield from texts(child)


def test_every_sentence_of_advice_was_followed():
    """Each sentence has a row, each row has a sentence, and the tests of the rows exist."""
    unlisted, unused = [], {(file, part) for file, rows in FOLLOWED.items() for part in rows}
    for path in (ROOT / "repro").rglob("*.py"):
        file = path.relative_to(ROOT / "repro").as_posix()
        for text in texts(ast.parse(path.read_text(encoding="utf-8"))):
            if ADVISES.search(text) and " " in text:
                parts = {part for part in FOLLOWED.get(file, ()) if part in text}
                unused -= {(file, part) for part in parts}
                unlisted += [] if parts else [(file, text)]
    assert not unlisted and not unused
    for place in {place for rows in FOLLOWED.values() for place in rows.values() if "::" in place}:
        module, _, name = place.partition("::")
        assert f"def {name}(" in (ROOT / module).read_text(encoding="utf-8"), place


def test_packages_to_install_are_those_that_the_project_names():
    """They are optional dependencies. A scene without the keys that need them can be run."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    named = {re.match(r"[\w-]+", entry)[0] for entries in extras.values() for entry in entries}
    assert named >= {"pypardiso", "matplotlib", "pillow", "xarray", "distributed"}
    scene = load_scene("base", ["numerics.solver=pardiso"])
    machine.require_packages(load_scene(scene, unset=["numerics.solver"]))


@pytest.mark.parametrize("name, content, options, advice", [
    ("thesis.tex", "mine", [], "which is not of a run; give a new folder"),
    ("run.json", '{"files": "thesis.tex"}', ["--force"], "lists no files of a run; move the folder away"),
    ("report.html", None, ["--force"], "it is not a regular file, so no run has written it; move it away"),
    ("fields/fields_0099.vtu", "mine", ["--force"], "no run has written it; move it away"),
    ("fields", "mine", ["--force"], "move the files of the run into one"),
])
def test_a_run_starts_if_the_advice_about_its_folder_is_followed(tmp_path, capsys, name, content, options, advice):
    """The folder contains a foreign file or, for the last three, a run with a foreign file in place of its own."""
    path = tmp_path / "run" / name
    path.parent.mkdir(parents=True)
    command = ["run", "flow_only", "--quiet", "--out"]
    if "folder" not in advice:
        assert main([*command, str(tmp_path / "run")]) == 0
    if path.exists():
        path.rename(tmp_path / "own")
    path.mkdir() if content is None else path.write_text(content)
    assert advice in refusal(tmp_path, capsys, *command, tmp_path / "run", *options)
    if "give a new folder" in advice:
        assert main([*command, str(tmp_path / "new")]) == 0
    path.rename(tmp_path / "elsewhere")
    assert main([*command, str(tmp_path / "run"), *options]) == 0


@pytest.mark.thorough
def test_a_smaller_refinement_helps_against_a_lack_of_memory():
    """A process may use 100 MB more than the program."""
    code = """
import resource, scipy.sparse.linalg, repro.march.simulation as simulation, repro
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 100 * 2**20,) * 2)
for refinement in (4, 0.3):
    scene = repro.load_scene("base", ["numerics.preset=fast", "growth.end=0 h", f"numerics.refinement={refinement}"])
    try:
        print(len(list(simulation.simulate(scene))))
    except repro.SimulationError as error:
        print(error)
"""
    refused, rows = run_python(code).stdout.splitlines()
    assert refused.endswith("; try a smaller numerics.refinement") and rows == "1"


@pytest.mark.parametrize("refinement, half_saturation", [(0.2, 1e-4), (0.367, 2e-4)])
def test_profiles_at_rest_help_where_those_in_time_do_not_settle(refinement, half_saturation):
    """First-order uptake exhausts the donor within an element. A larger refinement does not help: refinements of 1 and
    1.5 fail in these scenes, too."""
    scene = load_scene("base", [
        "numerics.preset=paper", f"numerics.refinement={refinement}", "numerics.transport=gear",
        "aggregate.radius=30 um", "growth.time_step=0.1 h", "growth.end=0.1 h", "kinetics.law=first order",
        "flow.mean_velocity=0.659 m/day", "kinetics.maximum_utilization_rate=100 1/day",
        "substrates.acceptor.supply=7.45 mg/L", "substrates.acceptor.half_saturation=1.56 mg/L",
        "substrates.donor.supply=1.31 mg/L", f"substrates.donor.half_saturation={half_saturation} mg/L"],
        unset=["flow.head"])
    with pytest.raises(SimulationError, match='the donor .*; try numerics.transport = "quasi_steady"'):
        list(simulate(scene))
    assert [*simulate(load_scene(scene, ["numerics.transport=quasi_steady"]))][-1].pore.time == 0.1


#: {pattern of a warning: the settings that it advises}.
ADVICE = {
    r"numerics\.refinement = ([\d.e+]+) would resolve it": "numerics.refinement={}",
    r'"gear" with numerics\.preset = "paper" integrates': ("numerics.preset=paper", "numerics.transport=gear"),
    r'"included" models it$': "growth.fluid_forces=included",
    r'"included" with growth\.new_biomass = "stressed"': (
        "growth.new_biomass=stressed", "growth.fluid_forces=included"),
    r'growth\.wall = "bonded" computes': "growth.wall=bonded",
    r'or numerics\.preset = "fast"': "numerics.preset=fast",
    r'"80 %" keeps their ratio': "substrates.{key}=80 %",
}
NO_SETTING = ("no refinement up to 20",)


PRESETS = ("fast", "accurate", "exact", "paper")


def drawn(seed, preset):
    """Draw changes of base that span orders of magnitude."""
    draw = random.Random(seed)

    def between(least, most):
        return math.exp(draw.uniform(math.log(least), math.log(most)))

    width = between(10, 5e5)
    changes = [f"pore.width={width} um", f"pore.length={6 * width} um", f"aggregate.radius={0.1 * width} um",
               f"flow.mean_velocity={between(1e-3, 1e3)} m/day",
               f"numerics.preset={preset}",
               f"substrates.acceptor.half_saturation={between(1e-4, 10)} mg/L",
               f"growth.end={between(0.5, 100)} h", f"growth.time_step={between(0.05, 0.5)} h",
               f"growth.shear_modulus={between(1e-6, 1e-2)} MPa"]
    if draw.random() < 0.3:
        changes.append(f"substrates.donor.diffusivity={between(0.1, 3)} cm^2/day")
    if draw.random() < 0.3 and preset != "paper":
        changes += [f"flow.permeability={between(1e-11, 1e-7) * width**2} um^2"]
    elif draw.random() < 0.3:
        changes.append("growth.new_biomass=stress_free")
    if draw.random() < 0.6 and "growth.new_biomass=stress_free" not in changes:
        changes.append("growth.fluid_forces=included")
    return changes


def warnings(changes):
    scene = load_scene("base", changes, unset=["flow.head"])
    width = scene.pore.width
    plug = numbers.Sizes(scene.growth.end, 3 * width**2, width, 1.5 * width, True, 3 * width)
    return simplifications.find_warnings(scene, meshing.fastest(scene.flow, scene.pore), plug)


def setting(warned):
    """Return the overrides that a warning advises, or none."""
    for pattern, templates in ADVICE.items():
        if match := re.search(pattern, warned.text):
            entries = (templates,) if isinstance(templates, str) else templates
            key = warned.key.removeprefix("substrates.")
            return [entry.format(*match.groups(), key=key) for entry in entries]
    return []


@pytest.mark.parametrize("preset", [
    pytest.param(preset, marks=pytest.mark.thorough if preset in ("accurate", "exact") else ()) for preset in PRESETS])
def test_the_advice_of_check_is_accepted_and_helps(preset):
    """In 30 scenes the advice of a warning silences it; every kind of advice occurs, and so does its absence."""
    kinds = set()
    for seed in range(30):
        changes = drawn(seed, preset)
        for warned in warnings(changes):
            more = setting(warned)
            if not more:
                kinds |= {text for text in NO_SETTING if text in warned.text}
                continue
            kinds.add(more[-1].partition("=")[0])
            start = warned.text[:40]
            assert not any(again.key == warned.key and again.text.startswith(start)
                           for again in warnings([*changes, *more])), (seed, warned)
    assert kinds >= {"no refinement up to 20", "numerics.refinement", "numerics.transport", "growth.fluid_forces",
                     "growth.wall"}


@pytest.mark.parametrize("preset", PRESETS)
def test_the_advice_against_a_lack_of_memory_is_accepted_and_helps(monkeypatch, preset):
    """In 20 scenes the refusal names a refinement that is accepted without a warning, or states that there is none; a
    quarter of the scene's refinement then does not fit either."""
    outcomes = set()
    for seed in range(20):
        scene = load_scene("base", [*drawn(seed, preset), "numerics.refinement=5"], unset=["flow.head"])
        try:
            free = memory.expected_bytes(scene) / random.Random(seed).choice((1.1, 3, 30))
        except ArithmeticError:  # the run itself reports it
            continue
        monkeypatch.setattr(memory, "free_bytes", lambda free=free: free)
        with pytest.raises(SceneError) as refused:
            memory.require_memory(scene, pytest.fail)
        named = re.search(r"numerics\.refinement = ([\d.]+) needs at most half", str(refused.value))
        outcomes.add(bool(named))
        tried = float(named[1]) if named else 0.25 * scene.numerics.refinement
        coarser = load_scene(scene, [f"numerics.refinement={tried!r}"])
        if named:
            memory.require_memory(coarser, pytest.fail)
        else:
            assert memory.expected_bytes(coarser) > 0.49 * free and "no numerics.refinement" in str(refused.value)
    assert outcomes == {True, False}


@pytest.mark.parametrize("radius, start, remedy, end", [
    (20, "t = 0 h", "preset=paper", 1), *(pytest.param(*case, marks=pytest.mark.thorough) for case in (
        (20, "t = 0 h", "refinement=0.6", 0), (12, r"t = [12]\.\d+ h", "preset=paper", 3)))])
def test_an_unresolved_front_gets_advice_once_and_it_helps(radius, start, remedy, end):
    """This includes a front within a step, which first tries the mesh of its start. With three times the refinement the
    first scene has a row, and with linear elements both reach their end."""
    supply, half_saturation = {20: ("0.15 mg/L", "1e-5 mg/L"), 12: ("0.2 mg/L", "3e-6 mg/L")}[radius]
    substrate = {"supply": supply, "half_saturation": half_saturation}
    scene = parse_scene({
        "pore": {"width": "100 um", "length": "600 um"}, "aggregate": {"radius": f"{radius} um"},
        "flow": {"mean_velocity": "2.9 m/day"}, "substrates": {"acceptor": substrate, "donor": substrate},
        "kinetics": {}, "growth": {"end": f"{end or 1} h"}}, "front", "front.toml")
    with pytest.raises(SimulationError, match=f"from {start}, in transport: .*; try a larger numerics.ref") as stopped:
        list(simulate(scene))
    assert str(stopped.value).count("numerics.refinement") == 1
    helped = simulate(load_scene(scene, [f"numerics.{remedy}"]))
    assert (next(helped) if end == 0 else [*helped][-1]).pore.time == end


def test_a_shorter_step_helps_where_the_aggregate_passes_the_opposite_wall():
    """A step of 5 h ends 0.3 um beyond the wall. Steps of 1 h, with the smaller supply of larger shapes, end below."""
    scene = load_scene("base", ["numerics.preset=paper", "numerics.refinement=0.3", "aggregate.radius=15 um",
                                "kinetics.maximum_utilization_rate=52 1/day", "growth.time_step=5 h",
                                "growth.end=5 h"])
    with pytest.raises(SimulationError, match="in growth: .* passes the opposite wall by 0.3.* try a shorter"):
        list(simulate(scene))
    last = list(simulate(load_scene(scene, ["growth.time_step=1 h"])))[-1].pore
    assert last.time == 5 and last.boundary.thickness < 50
