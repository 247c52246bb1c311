"""What a run leaves: ``timeseries.csv``, ``ledger.csv``, ``run.json``, and fields as ``.vtu``.

Every file appears whole or not at all: it is written beside its place and moved there. Names carry
units; what a scene does not model is an empty field. The package's units (um, h, mg/L) become those
of the names here and nowhere else.
"""

from __future__ import annotations

import csv
import io
import json
import os
import platform
from functools import cache
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from repro.march.loop import Instant, Ledger
from repro.model import biomass, growth
from repro.model.pore import Pore, Solved
from repro.results import vtu
from repro.results.vtu import Cells, Grid
from repro.scene import Kinetics, Scene, scene_hash, scene_tables

#: Of um/h.
M_PER_D = 24e-6
#: Of um.
CM = 1e-4

COLUMNS = """time_h mean_velocity_m_per_d head_loss_cm conductivity_m_per_d
effluent_acceptor_mg_per_L effluent_donor_mg_per_L inlet_acceptor_mg_per_L inlet_donor_mg_per_L
aggregate_area_um2 thickness_um upstream_um downstream_um meshed_length_um inert_fraction
biomass_density_min biomass_density_max acceptor_min_mg_per_L donor_min_mg_per_L acceptor_balance
donor_balance biomass_balance oxygen_demand_balance nodes remeshed contact""".split()

LEDGER_COLUMNS = """start_h end_h acceptor_supplied_pg_per_m acceptor_out_pg_per_m
acceptor_consumed_pg_per_m acceptor_stored_pg_per_m donor_supplied_pg_per_m donor_out_pg_per_m
donor_consumed_pg_per_m donor_stored_pg_per_m biomass_before_pg_per_m biomass_made_pg_per_m
biomass_after_pg_per_m oxygen_demand_balance""".split()

PACKAGES = ("numpy", "scipy", "scikit-fem", "meshio", "mmgpy", "shapely", "pint")


def row(scene: Scene, instant: Instant) -> dict[str, float | None]:
    """One row of ``timeseries.csv``: the geometry at its time, and flow and substrates in it."""
    pore = instant.pore
    first, last = pore.mesh.ends
    found: dict[str, float | None] = dict.fromkeys(COLUMNS)
    found.update(time_h=pore.time, meshed_length_um=last - first, nodes=len(pore.mesh.points),
                 remeshed=int(instant.remeshes > 0), contact=int(pore.contact))
    found.update(_flow_columns(instant))
    found.update(_substrate_columns(instant))
    found.update(_transient_columns(scene, instant))
    found.update(_aggregate_columns(scene, instant))
    return found


def _flow_columns(instant: Instant) -> dict[str, float]:
    flow = instant.solved.flow
    if flow is None:
        return {}
    return {"mean_velocity_m_per_d": M_PER_D * flow.mean_velocity,
            "head_loss_cm": CM * flow.head_loss,
            "conductivity_m_per_d": M_PER_D * flow.conductivity}


def _substrate_columns(instant: Instant) -> dict[str, float]:
    state = instant.solved.concentrations
    found: dict[str, float] = {}
    if state is None:
        return found
    fields = {"acceptor": state.acceptor, "donor": state.donor}
    for (name, field), flux in zip(fields.items(), instant.solved.fluxes):
        found[f"{name}_min_mg_per_L"] = float(field.min())
        found[f"inlet_{name}_mg_per_L"] = flux.inlet
        found[f"effluent_{name}_mg_per_L"] = flux.effluent
        found[f"{name}_balance"] = _defect(flux.supplied, flux.out, flux.consumed)
    return found


def _transient_columns(scene: Scene, instant: Instant) -> dict[str, float]:
    """The transient scheme's substrate balances, storage included: the worst since the last row."""
    if scene.numerics.transport != "gear" or instant.solved.concentrations is None:
        return {}
    problem = instant.solved.problem
    found = {}
    for k, name in enumerate(("acceptor", "donor")):
        room = problem.both[k].supply * float(problem.space.at.dx.sum())
        steps = [_defect(step.supplied[k], step.out[k] + step.stored[k], step.consumed[k], room)
                 for step in instant.ledgers]
        found[f"{name}_balance"] = max(steps, key=abs, default=0.0)
    return found


def _defect(supplied: float, out: float, consumed: float, room: float = 0.0) -> float:
    """(in - out - consumed) over the largest of what comes in, what is consumed, and, in the
    transient, what the meshed part holds at the concentration of the supply."""
    scale = max(abs(supplied), consumed, room)
    return (supplied - out - consumed) / scale if scale else 0.0


def _aggregate_columns(scene: Scene, instant: Instant) -> dict[str, float]:
    pore = instant.pore
    outline = pore.outline
    if outline is None:
        return {}
    found = {"aggregate_area_um2": outline.area, "thickness_um": outline.thickness,
             "upstream_um": outline.upstream, "downstream_um": outline.downstream}
    if scene.kinetics:
        names = ("inert_fraction", "biomass_density_min", "biomass_density_max")
        found.update(zip(names, pore.composition(scene.kinetics.maximum_density)))
    if scene.growth:
        defects = [(step.biomass_after - step.biomass_before - step.biomass_made)
                   / step.biomass_after for step in instant.ledgers]
        found["biomass_balance"] = max(defects, key=abs, default=0.0)
        demands = [oxygen_demand_balance(scene.kinetics, ledger) for ledger in instant.ledgers]
        found["oxygen_demand_balance"] = max(demands, key=abs, default=0.0)
    return found


def oxygen_demand_balance(kinetics: Kinetics, ledger: Ledger) -> float:
    """Defect of a step's ledger by (7)-(10): biomass made less Y donor - (acceptor - F donor) /
    d_c, of what was consumed, over the larger of the two terms. The first is what the donor makes,
    the second what decays."""
    acceptor, donor = ledger.consumed
    grown = kinetics.yield_coefficient * donor
    decayed = (acceptor - kinetics.acceptor_to_donor_ratio * donor) / kinetics.decay_oxygen_demand
    scale = max(abs(grown), abs(decayed))
    return (ledger.biomass_made - grown + decayed) / scale if scale else 0.0


def ledger_row(scene: Scene, ledger: Ledger) -> list[float]:
    """One row of ``ledger.csv``: a step's balances per metre of depth; 1 um2 mg/L is 1 pg/m."""
    parts = (ledger.supplied, ledger.out, ledger.consumed, ledger.stored)
    substrates = [part[which] for which in (0, 1) for part in parts]
    return [ledger.start, ledger.end, *substrates, ledger.biomass_before, ledger.biomass_made,
            ledger.biomass_after, oxygen_demand_balance(scene.kinetics, ledger)]


def fields(scene: Scene, pore: Pore, solved: Solved) -> Grid:
    """The fields of an instant, at nodes or in triangles, named with their units.

    Places are in um. In the fluid there is no biomass, stress or pressure P (zero), theta and J are
    1, and places have not moved. Stress and P are those of the strain since t = 0: a scene whose
    new biomass is born stress-free has none to tell.
    """
    mesh = pore.mesh
    space = pore.space
    points: dict[str, np.ndarray] = {}
    cells = {"region": mesh.biomass.astype(float)}
    if solved.flow:
        points["velocity_m_per_d"] = _three(M_PER_D * space.to_mesh(solved.flow.velocity))
        points["head_cm"] = CM * mesh.with_middles(solved.flow.head[: mesh.corners])
    if solved.concentrations:
        points["acceptor_mg_per_L"] = space.to_mesh(solved.concentrations.acceptor)
        points["donor_mg_per_L"] = space.to_mesh(solved.concentrations.donor)
    if scene.kinetics:
        whole = space.reaction.dx * scene.kinetics.maximum_density
        points["active_biomass"] = biomass.at_nodes(space, pore.active / whole)
        points["inert_biomass"] = biomass.at_nodes(space, pore.inert / whole)
    if scene.growth:
        _add_mechanics(scene, pore, points, cells)
    kind = "triangle" if mesh.geometry == 1 else "triangle6"
    return Grid(_three(mesh.points), [Cells(kind, mesh.cells)], points,
                {name: [value] for name, value in cells.items()})


def _add_mechanics(scene: Scene, pore: Pore, points: dict[str, np.ndarray],
                   cells: dict[str, np.ndarray]) -> None:
    mesh = pore.mesh
    body = pore.body
    modulus = scene.growth.shear_modulus
    points["displacement_um"] = _three(mesh.points - pore.origin)
    points["position_t0_um"] = _three(pore.origin)
    strained = body.strained(mesh.points[mesh.body])
    values = {"theta": pore.theta, "J": strained.J}
    if scene.growth.new_biomass == "stressed":
        points["pressure_MPa"] = modulus * mesh.with_middles(pore.pressure)
        pressure = pore.pressure[mesh.triangles[mesh.biomass]] @ body.shape.table.linear.T
        stress = modulus * growth.cauchy(strained.F, pressure)
        names = ("stress_xx_MPa", "stress_yy_MPa", "stress_zz_MPa", "stress_xy_MPa")
        values |= dict(zip(names, np.moveaxis(stress, -1, 0)))
        values["largest_principal_stress_MPa"] = growth.largest_principal(stress)
    for name, value in values.items():
        cells[name] = np.full(len(mesh.cells), 1.0 if name in ("theta", "J") else 0.0)
        cells[name][mesh.biomass] = (value * body.at.dx).sum(axis=1) / body.at.dx.sum(axis=1)


def _three(plane: np.ndarray) -> np.ndarray:
    """(N, 3) vectors from plane ones (N, 2)."""
    return np.column_stack([plane, np.zeros(len(plane))])


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8", newline="")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def write_fields(path: Path, content: Grid) -> None:
    """Write a ``.vtu`` file whole or not at all."""
    beside = path.with_name(f".part-{path.name}")
    try:
        vtu.write(beside, content)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def write_index(path: Path, entries: list[tuple[float, str]]) -> None:
    """Write the ``.pvd`` index of fields: (time in h, file name) pairs."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for time, name in entries:
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part="0", file=name)
    ElementTree.indent(root)
    content = ElementTree.tostring(root, encoding="unicode")
    write_text(path, f'<?xml version="1.0"?>\n{content}\n')


def write_table(path: Path, columns: list[str], rows: list[list]) -> None:
    """Write a CSV table; None is an empty field, floats keep every digit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for line in rows:
        writer.writerow([_shown(value) for value in line])
    write_text(path, text.getvalue())


def _shown(value: object) -> object:
    """A value as a CSV file has it."""
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else value


def read_table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a CSV table that a run has written; an empty field is not-a-number."""
    with path.open(encoding="utf-8", newline="") as lines:
        reader = csv.DictReader(lines)
        rows = list(reader)
    found = {}
    for name in reader.fieldnames or ():
        found[name] = np.array([float(row[name] or "nan") for row in rows])
    return found


def provenance(scene: Scene) -> dict:
    """The scene as read, its hash, and the versions that its numbers come from."""
    versions = {"dupin2001-repro": version("dupin2001-repro"),
                "python": platform.python_version()}
    versions |= {name: version(name) for name in PACKAGES}
    return {"scene": scene.name, "hash": scene_hash(scene), "tables": scene_tables(scene),
            "versions": versions}


@cache
def version(package: str) -> str:
    """The version of an installed package, which is looked for on the disk once."""
    return metadata.version(package)


def write_json(path: Path, content: dict) -> None:
    """Write a JSON file; not-a-number is refused."""
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")
