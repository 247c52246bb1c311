"""Runs in folders, and a strict parser for their pages."""

import base64
import hashlib
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from repro import results
from repro.cli import main
from repro.results.files import read_sealed
from repro.runs import execution
from repro.scene import scene_hash

NODE = shutil.which("node")
VOID = {"meta", "input", "br", "link", "img", "hr"}
FAST = 'numerics.preset="fast"'
HOSTILE = "<script>pwned=1<!--\"'&<img src=x onerror=pwned=1>.toml"

#: {chart: {label of a line: column}}, from the labels that a reader sees.
CHARTS = {
    "Conductivity": {"conductivity": "conductivity_m_per_d"},
    "Mean velocity": {"mean velocity": "mean_velocity_m_per_d"},
    "Head loss": {"head loss": "head_loss_cm"},
    "Effluents": {"acceptor": "effluent_acceptor_mg_per_L", "donor": "effluent_donor_mg_per_L"},
    "Inlet of the meshed part": {"acceptor": "inlet_acceptor_mg_per_L", "donor": "inlet_donor_mg_per_L"},
    "Least concentrations": {"acceptor": "acceptor_min_mg_per_L", "donor": "donor_min_mg_per_L"},
    "Concentrations above the supply": {"acceptor": "acceptor_overshoot_mg_per_L",
                                        "donor": "donor_overshoot_mg_per_L"},
    "Area of the aggregate": {"area": "aggregate_area_um2"},
    "Extent of the aggregate": {"thickness": "thickness_um", "upstream end": "upstream_um",
                                "downstream end": "downstream_um"},
    "Inert part of the biomass": {"inert part": "inert_fraction"},
    "Biomass density": {"least": "biomass_density_min", "largest": "biomass_density_max"},
    "Stress that could detach the aggregate": {"wall traction": "wall_traction_max_MPa",
                                               "tensile stress": "tensile_stress_max_MPa"},
    "Force of the fluid on the aggregate": {"force x": "fluid_force_x_uN_per_m", "force y": "fluid_force_y_uN_per_m"},
    "Defects of the balances": {"acceptor": "acceptor_balance", "donor": "donor_balance",
                                "biomass": "biomass_balance", "oxygen demand": "oxygen_demand_balance"},
    "Mesh": {"nodes": "nodes"},
}
AXES = {"Conductivity": "(m/day)", "Mean velocity": "(m/day)", "Head loss": "(cm)", "Effluents": "(mg/L)",
         "Inlet of the meshed part": "(mg/L)", "Least concentrations": "(mg/L)",
         "Concentrations above the supply": "(mg/L)", "Area of the aggregate": "(um²)",
         "Extent of the aggregate": "(um)", "Stress that could detach the aggregate": "(MPa)",
         "Force of the fluid on the aggregate": "(uN/m)", "Defects of the balances": "relative defect"}
LEDGERS = {f"Ledger: {name}": {"supplied": f"{name}_supplied_pg_per_m", "leaving": f"{name}_out_pg_per_m",
                               "taken up": f"{name}_consumed_pg_per_m", "stored": f"{name}_stored_pg_per_m",
                               "unmet": f"{name}_unmet_pg_per_m"}
           for name in ("acceptor", "donor")}


#: Columns and arrays without a unit.
PURE = """inert_fraction biomass_density_min biomass_density_max surface_stretch_min surface_stretch
acceptor_balance donor_balance biomass_balance oxygen_demand_balance nodes remeshed contact region theta J
active_biomass inert_biomass""".split()


#: Finished runs of scenes that several tests use.
CACHED_RUNS = TemporaryDirectory(prefix="whole-")


def cached_run(scene):
    """Return the folder of a scene's run, which is computed once. Tests that change the folder copy it."""
    folder = Path(CACHED_RUNS.name) / f"{scene.name}-{scene_hash(scene)}"
    if not folder.exists():
        execution.run(scene, folder)
    return folder


class Page(HTMLParser):
    """A strict parser: every tag is closed in its turn. `outside` are addresses, `texts` the visible text."""

    def __init__(self, text):
        super().__init__()
        self.open: list[str] = []
        self.outside = []
        self.tags = []
        self.texts = []
        self.scripts = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.outside += [value for name, value in attributes if name in ("src", "href", "action", "xlink:href", "data")]
        assert not [name for name, _ in attributes if name.startswith("on") or name == "style"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)
        if self.open and self.open[-1] in ("script", "style"):
            self.scripts.append((self.open[-1], self.tags[-1][1], data))

    def attribute(self, tag, name):
        return [attributes[name] for tag_name, attributes in self.tags if tag_name == tag and name in attributes]


def check_alone(text):
    """Parse a page; check that it loads nothing else and that its policy allows only its own scripts and styles."""
    page = Page(text)
    assert not re.search(r"@import|url\(|://", text)
    policy = next(rules for rules in page.attribute("meta", "content") if "-src" in rules)
    assert policy.startswith("default-src 'none'; ") and "unsafe" not in policy
    assert policy.endswith("; base-uri 'none'; form-action 'none'")
    for kind, attributes, content in page.scripts:
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        (allowed,) = re.findall(f"{kind}-src ([^;]*)", policy)
        assert attributes.get("type") == "application/json" or f"'sha256-{digest}'" in allowed.split()
    return page


def run(tmp_path, scene, *sets, status=0, options=()):
    """Execute `repro run SCENE --set ...` with further options, check its exit status, and return its folder."""
    out = tmp_path / "run"
    assert main(["run", str(scene), "--out", str(out), *(part for entry in sets for part in ("--set", entry)),
                 *options]) == status
    return out


def text_of(out):
    return (out / "report.html").read_text(encoding="utf-8")


def first_group(pattern, text):
    """Return the group of the first match of a pattern."""
    match = re.search(pattern, text)
    assert match, pattern
    return match[1]


def page_data(out):
    """Return the data of the page's script."""
    return json.loads(first_group('<script type="application/json" id="fields">(.*?)</script>', text_of(out)))


def evaluate(page, expression, fragment="", width=1200):
    """Return the value of a JavaScript expression after the scripts of a page, which Node runs without a browser."""
    script = Path(__file__).with_name("page.js")
    command = [NODE, script, page, fragment, str(width)]
    return json.loads(subprocess.run(command, input=expression, stdout=subprocess.PIPE, text=True, check=True).stdout)


def decode_numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def make_hostile(out):
    """Put markup and scripts into the files of a run."""
    record = read_sealed(out / "run.json")
    record |= {"scene": HOSTILE, "status": "failed: </script><script>pwned=1</script>", "extra": {HOSTILE: [HOSTILE]}}
    record["tables"][HOSTILE] = {HOSTILE: HOSTILE}
    record["versions"][HOSTILE] = HOSTILE
    record["warnings"] = [{"key": HOSTILE, "text": HOSTILE}]
    record["wall_time_by_stage_s"][HOSTILE] = 0.1
    record["newton_iterations"][HOSTILE] = HOSTILE
    results.write_sealed(out / "run.json", record | {"sha256": {}})
    lines = (out / "timeseries.csv").read_text().splitlines()
    columns = [lines[0] + ',"' + HOSTILE.replace('"', '""') + '"', *(line + ",1" for line in lines[1:])]
    results.write_text(out / "timeseries.csv", "\n".join(columns) + "\n")
    return out
