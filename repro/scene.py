"""What a scene says: its sections are the physics that runs, its defaults are Table 1 of the paper.

A scene is a TOML file, or the name of a packaged one, with units in its values. The dataclasses below are the only
place where its keys, defaults, units and accepted ranges are written down; reading, checking and writing go through
them. Their floats are in the units of the package (`repro.units`): um, h, mg/L, head in um, MPa, rad. A section that a
scene leaves out is None and its physics is not run, but for `pore`, `numerics` and `output`, which have defaults, and
`kinetics`, which comes with substrates and aggregate.
"""
import hashlib
import json
import os
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from repro.units import (
    ACUTE,
    FRACTION,
    NON_NEGATIVE,
    POSITIVE_FRACTION,
    UP_TO_1,
    UP_TO_20,
    Place,
    SceneError,
    choice,
    number,
    quantity,
    read_table,
    required,
    section,
    shown,
    times,
    write_table,
)

_UNSTEADY = ', or numerics.transport = "gear": nothing is supplied, so that no state is steady'
MOST_STEPS = 100_000  # shape updates of a run
SHORTEST_STEP = 1e-6  # h: times are told apart to 1e-9 h
Rules = Iterator[tuple[bool, str, str]]  # (is it broken, the key to name, what is accepted)


@dataclass(frozen=True)
class Pore:
    """The channel `0 <= y <= width` (um); Table 1: L_pore, W_pore."""

    width: float = quantity("100 um", "um")
    length: float = quantity("600 um", "um")


@dataclass(frozen=True)
class Aggregate:
    """The seed, a half-disc on the lower wall (um); Table 1: R_0."""

    radius: float = quantity("5 um", "um")


@dataclass(frozen=True)
class Flow:
    """Section 2.1, (1)-(6): driven by `head` (um, whole pore) or `mean_velocity` (um/h), the other is None."""

    head: float | None = quantity("1e-3 cm", "um", default=None)
    mean_velocity: float | None = quantity("2.9 m/day", "um/h", NON_NEGATIVE, default=None)
    viscosity_ratio: float = number(2.0e3)  # lambda
    kinematic_viscosity: float = quantity("0.01003 cm^2/s", "um^2/h")  # nu_water
    gravity: float = quantity("9.81 m/s^2", "um/h^2")  # g
    density: float = quantity("998 mg/cm^3", "mg/L")  # rho


@dataclass(frozen=True, kw_only=True)
class Substrate:
    """A substrate of section 2.2: supply (10 K_s in section 4), K_s (mg/L), D in water and in biomass (um^2/h)."""

    supply: float = quantity("10 mg/L", "mg/L", NON_NEGATIVE)
    half_saturation: float = quantity("1.0 mg/L", "mg/L")
    diffusivity: float = required("2.32 cm^2/day", "um^2/h")
    diffusivity_in_aggregate: float = required("1.85 cm^2/day", "um^2/h")


@dataclass(frozen=True, kw_only=True)
class Acceptor(Substrate):
    """The electron acceptor, oxygen: C_A, K_sA, D_A."""

    diffusivity: float = quantity("2.32 cm^2/day", "um^2/h")
    diffusivity_in_aggregate: float = quantity("1.85 cm^2/day", "um^2/h")


@dataclass(frozen=True, kw_only=True)
class Donor(Substrate):
    """The electron donor, phenol: C_D, K_sD, D_D."""

    diffusivity: float = quantity("1.01 cm^2/day", "um^2/h")
    diffusivity_in_aggregate: float = quantity("0.81 cm^2/day", "um^2/h")


@dataclass(frozen=True)
class Substrates:
    """Section 2.2, (7)-(8). `boundary`: without flow the pore's ends hold the supply, or let nothing pass."""

    acceptor: Substrate = section(Acceptor)
    donor: Substrate = section(Donor)
    boundary: str = choice("open", "closed")


@dataclass(frozen=True)
class Kinetics:
    """Dual Monod kinetics, (7)-(10), with Table 1's symbols (rates in 1/h, density in mg/L, the others in mg/mg)."""

    maximum_utilization_rate: float = quantity("9.3 1/day", "1/h", NON_NEGATIVE)  # k
    yield_coefficient: float = number(0.61, POSITIVE_FRACTION)  # Y
    decay_coefficient: float = quantity("0.12 1/day", "1/h", NON_NEGATIVE)  # b
    degradable_fraction: float = number(0.8, FRACTION)  # f_d
    decay_oxygen_demand: float = number(1.42)  # d_c
    acceptor_to_donor_ratio: float = number(1.52)  # F as printed, where COD - Y d_c = 1.5138 [E1]
    maximum_density: float = quantity("30000 mg/L", "mg/L")  # X_m


@dataclass(frozen=True)
class Growth:
    """Sections 2.3 and 3.4, (14)-(29), to the time `end` (h) in shape updates of `time_step` (h)."""

    end: float = required("19.4 h", "h", NON_NEGATIVE)
    time_step: float = quantity("12 min", "h")  # Delta t
    shear_modulus: float = quantity("0.01 MPa", "MPa")  # mu_L, MPa
    minimum_contact_angle: float = quantity("16.7 deg", "rad", ACUTE)  # rad
    minimum_film: float = quantity("2 um", "um")  # distance to the opposite wall at which contact is made, um
    fluid_forces: str = choice("neglected", "included")  # the fluid's traction in (20) and (22), see 2.3.3
    new_biomass: str = choice("stressed", "stress_free")  # total strain since t = 0 (2.3), or section 5's alternative


@dataclass(frozen=True)
class Numerics:
    """Section 3: how it is solved. [En] are the ambiguities of `reference/ERRATA.md`."""

    preset: str = choice("fast", "accurate", "paper")  # the defaults of what follows: see PRESETS
    elements: str = choice("linear", "quadratic")  # 3.2-3.4, or Taylor-Hood on curved triangles
    time: str = choice("updates", "midpoint")  # every growth.time_step, or as numerics.tolerance allows
    tolerance: float = number(0.01, UP_TO_1)  # of a midpoint step: change of the growth rate, times the step
    transport: str = choice("quasi_steady", "gear")  # 3.3
    transfer: str = choice("conserving", "linear", "bounded")  # of X_A and X_I at a remesh [E8]
    extent: str = choice("central", "full")  # 3.1
    interface: str = choice("laplacian", "traction")  # [E2]
    inlet: str = choice("local", "mean")  # u_x(y) or u_ave in (11) [E4]
    fixed_point: str = choice("kept", "rechosen")  # of a contact surface, 2.3.3
    solver: str = choice("superlu", "pardiso")  # of linear systems; the second needs the package pypardiso
    ordering: str = choice("degree", "metis")  # of nodes before SuperLU; the second needs the package pymetis
    refinement: float = number(1.0, UP_TO_20)  # element sizes are divided by it
    jacobian: str = choice("fresh", "reused")  # of Newton's methods: in every step, or while it does enough
    flow_element: str = choice("stabilised", "bubble")  # 3.2, or linear velocities with a bubble (MINI)
    flow_stabilisation: float = number(100.0)  # 3.2: tau = h^2 / (flow_stabilisation nu) [E13]
    mesh_compressibility: float = number(1.0)  # gamma of (35) [E13]


#: What each preset changes of the defaults above: about 1 %, about 0.1 % (see `make bench`), the paper's own scheme.
PRESETS = {
    "fast": {"elements": "quadratic", "time": "midpoint", "refinement": 0.2, "tolerance": 0.0075, "jacobian": "reused"},
    "accurate": {"elements": "quadratic", "time": "midpoint", "refinement": 0.45, "tolerance": 0.001,
                 "jacobian": "reused"},
    "paper": {},
}
#: What quadratic elements have one way of, and what that is.
QUADRATIC = {"time": "midpoint", "transport": "quasi_steady", "transfer": "conserving", "interface": "laplacian",
             "inlet": "local", "fixed_point": "kept", "flow_element": "stabilised"}


@dataclass(frozen=True)
class Output:
    """Times (h) of the rows and fields wanted, ascending; None: every shape update. `timeseries`: the table is always
    written as timeseries.csv; "netcdf" writes timeseries.nc besides, which needs the package xarray."""

    times: tuple[float, ...] | None = times()
    timeseries: str = choice("csv", "netcdf")


@dataclass(frozen=True)
class Scene:
    """A scene read and checked. `kinetics` is there if and only if there are both substrates and an aggregate."""

    name: str
    pore: Pore = section(Pore)
    aggregate: Aggregate | None = section(Aggregate, default=None)
    flow: Flow | None = section(Flow, default=None)
    substrates: Substrates | None = section(Substrates, default=None)
    kinetics: Kinetics | None = section(Kinetics, default=None)
    growth: Growth | None = section(Growth, default=None)
    numerics: Numerics = section(Numerics)
    output: Output = section(Output)


def packaged_scenes() -> tuple[str, ...]:
    """The names of the scenes that come with the package."""
    return tuple(sorted(path.name.removesuffix(".toml") for path in _folder().iterdir() if path.name.endswith(".toml")))


def load_scene(source: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """The scene in a TOML file or of a packaged name, with the "KEY=VALUE" of --set; SceneError if not accepted."""
    file = str(source)
    tables = _tables(file)
    for override in overrides:
        _override(tables, override, file)
    return parse_scene(tables, Path(file).stem, file)


def parse_scene(tables: dict, name: str, file: str) -> Scene:
    """The scene that TOML `tables` describe, called `name`; SceneError, naming `file`, if it is not accepted."""
    if "substrates" in tables and "aggregate" in tables:
        tables = {"kinetics": {}, **tables}
    scene = read_table(Scene, _with_preset(tables), Place(file), name=name)
    for broken, key, wanted in _rules(scene):
        if broken:
            raise Place(file, key).refuse(_at(tables, key, _at(scene_tables(scene), key, MISSING)), wanted)
    return scene


def _with_preset(tables: dict) -> dict:
    """The tables with the defaults of the preset that they name, "fast" where they name none."""
    given = tables.get("numerics", {})
    named = given.get("preset", "fast") if isinstance(given, dict) else None
    if not isinstance(named, str) or named not in PRESETS:
        return tables  # what is wrong is told when it is read
    return {**tables, "numerics": {"preset": named, **PRESETS[named], **given}}


def scene_tables(scene: Scene) -> dict:
    """The scene as TOML tables with every default spelt out; `parse_scene` reads an equal scene back, bit by bit."""
    return write_table(scene)


def scene_hash(scene: Scene) -> str:
    """16 hexadecimal digits that stand for all that a scene says but its name."""
    canonical = json.dumps(scene_tables(scene), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def _at(tables: dict, key: str, default: object) -> object:
    """The value at a dotted key."""
    for part in key.split("."):
        if part not in tables:
            return default
        tables = tables[part]
    return tables


def _rules(scene: Scene) -> Rules:
    """What concerns several keys."""
    if scene.aggregate:
        yield from _seed_rules(scene.aggregate.radius, scene.pore)
    if scene.flow:
        yield from _flow_rules(scene, scene.flow.head, scene.flow.mean_velocity)
    if scene.substrates:
        yield from _boundary_rules(scene)
    yield from _growth_rules(scene)
    yield from _numerics_rules(scene)
    yield from _output_rules(scene)


def _seed_rules(radius: float, pore: Pore) -> Rules:
    wanted = f"less than pore.width ({pore.width:g} um) and half of pore.length ({pore.length:g} um) is needed"
    yield radius >= pore.width or 2 * radius >= pore.length, "aggregate.radius", wanted
    wanted = f"a thousandth of pore.width ({pore.width:g} um) or more is needed"
    yield radius < pore.width / 1000, "aggregate.radius", wanted


def _flow_rules(scene: Scene, head: float | None, velocity: float | None) -> Rules:
    wanted = 'it or flow.mean_velocity is needed, such as head = "1e-3 cm" or mean_velocity = "2.9 m/day"'
    yield head is None and velocity is None, "flow.head", wanted
    wanted = f"flow.head ({head} um) is given too; one of them is accepted, not both"
    yield head is not None and velocity is not None, "flow.mean_velocity", wanted
    wanted = f"greater than zero is needed{_UNSTEADY}"
    yield velocity == 0 and scene.substrates is not None and _steady(scene), "flow.mean_velocity", wanted


def _boundary_rules(scene: Scene) -> Rules:
    closed = scene.substrates.boundary == "closed"
    yield closed and scene.flow is not None, "substrates.boundary", '"open" is needed with [flow]'
    yield closed and _steady(scene), "substrates.boundary", f'"open" is needed{_UNSTEADY}'


def _growth_rules(scene: Scene) -> Rules:
    alone, wanted = not (scene.substrates and scene.aggregate), "[aggregate] and [substrates] are needed with it"
    yield alone and scene.kinetics is not None, "kinetics", wanted
    yield alone and scene.growth is not None, "growth", wanted
    if scene.growth:
        wanted = f"growth.end ({scene.growth.end:g} h) over {MOST_STEPS} or more is needed"
        yield scene.growth.time_step < SHORTEST_STEP, "growth.time_step", f"{SHORTEST_STEP:g} h or more is needed"
        yield scene.growth.end > MOST_STEPS * scene.growth.time_step, "growth.time_step", wanted
    if scene.growth and scene.growth.fluid_forces == "included":
        yield from _force_rules(scene)
    film, width = scene.growth.minimum_film if scene.growth else 0.0, scene.pore.width
    yield film >= width, "growth.minimum_film", f"less than pore.width ({width:g} um) is needed"


def _force_rules(scene: Scene) -> Rules:
    wanted = '"neglected" is needed without [flow]'
    yield scene.flow is None, "growth.fluid_forces", wanted
    wanted = '"neglected" is needed with numerics.elements = "quadratic"; preset = "paper" has the other'
    yield scene.numerics.elements == "quadratic", "growth.fluid_forces", wanted
    wanted = '"neglected" is needed with growth.new_biomass = "stress_free", which would yield at every update'
    yield scene.growth.new_biomass == "stress_free", "growth.fluid_forces", wanted


def _numerics_rules(scene: Scene) -> Rules:
    numerics = scene.numerics
    if numerics.elements == "quadratic":
        for key, only in QUADRATIC.items():
            wanted = f'"{only}" is needed with numerics.elements = "quadratic"; preset = "paper" has the others'
            yield getattr(numerics, key) != only, f"numerics.{key}", wanted
        stress_free = scene.growth is not None and scene.growth.new_biomass == "stress_free"
        yield stress_free, "growth.new_biomass", '"stressed" is needed with numerics.elements = "quadratic"'
    gear = numerics.time == "midpoint" and numerics.transport == "gear"
    yield gear, "numerics.transport", '"quasi_steady" is needed with numerics.time = "midpoint"'


def _output_rules(scene: Scene) -> Rules:
    end = scene.growth.end if scene.growth else 0.0
    wanted = f"growth.end is {end:g} h" if scene.growth else "there is no [growth]"
    yield max(scene.output.times or (0.0,)) > end, "output.times", f"none after {end:g} h is accepted: {wanted}"
    missing = scene.output.timeseries == "netcdf" and find_spec("xarray") is None
    yield missing, "output.timeseries", '"csv" is needed, or the package xarray: pip install xarray'


def _steady(scene: Scene) -> bool:
    return scene.numerics.transport == "quasi_steady"


def _folder():
    return resources.files("repro").joinpath("scenes")


def _tables(file: str) -> dict:
    """The tables of a packaged scene or of a file."""
    try:
        return tomllib.loads(_content(file).decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: not UTF-8 text (at byte {error.start + 1}); a scene is a TOML file") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{file}: not TOML: {error}") from None


def _content(file: str) -> bytes:
    names = packaged_scenes()
    if file in names:
        return _folder().joinpath(f"{file}.toml").read_bytes()
    if not os.path.isfile(file):
        found = "a directory, not" if os.path.isdir(file) else "neither a file nor"
        raise SceneError(f"{file}: {found} a packaged scene ({', '.join(names)})")
    try:
        return Path(file).read_bytes()
    except OSError as error:
        raise SceneError(f"{file}: cannot be read ({error.strerror})") from None


def _override(tables: dict, override: str, file: str) -> None:
    """Set one "KEY=VALUE" in the tables."""
    key, equals, text = override.partition("=")
    path = [part.strip() for part in key.split(".")]
    if not equals or not all(path):
        raise SceneError(f'{file}: --set {shown(override)}: KEY=VALUE is needed, such as pore.width="50 um"')
    place = Place(file)
    for part in path[:-1]:
        tables, place = tables.setdefault(part, {}), place.below(part)
        if not isinstance(tables, dict):
            raise place.refuse(tables, f"it takes no keys, so that --set {shown(override)} is not accepted")
    tables[path[-1]] = _toml_value(text.strip())


def _toml_value(text: str) -> object:
    """The TOML value that a text is, or the text itself."""
    try:
        read = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return read["value"] if list(read) == ["value"] else text
