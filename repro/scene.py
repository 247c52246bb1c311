"""What a scene says: its sections are the physics that runs, its defaults are Table 1 of the paper.

A scene is a TOML file, or the name of a packaged one, with units in its values. The dataclasses below are the only place where its
keys, defaults, units and accepted ranges are written down; reading, checking and writing go through them. Their floats are in the
units of the package (`repro.units`): um, h, mg/L, head in um, MPa, rad. A section that a scene leaves out is None and its physics is
not run, but for `pore`, `numerics` and `output`, which have defaults, and `kinetics`, which comes with substrates and aggregate.
"""
import difflib
import hashlib
import json
import os
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import partial
from importlib import resources
from pathlib import Path

from repro.units import (
    ACUTE,
    FRACTION,
    NON_NEGATIVE,
    POSITIVE,
    POSITIVE_FRACTION,
    Choice,
    Number,
    Quantity,
    Range,
    Times,
    shown,
    to_internal,
)


class SceneError(ValueError):
    """A scene that cannot be run; its message is one line naming file, key, value and what is accepted."""

    def __init__(self, message: str):
        super().__init__("".join(letter if letter.isprintable() else " " for letter in message))


def _quantity(text: str, unit: str, accepts: Range = POSITIVE, **default) -> Field:
    """A value with a unit: `text` is its default, or only an example where another default is given."""
    default = default or {"default_factory": partial(to_internal, text, unit)}
    return field(metadata={"kind": Quantity(unit, text, accepts)}, **default)


def _number(default: float, accepts: Range = POSITIVE) -> Field:
    return field(default=default, metadata={"kind": Number(default, accepts)})


def _choice(*words: str) -> Field:
    """One of the words, the first by default."""
    return field(default=words[0], metadata={"kind": Choice(words)})


def _section(section: type, **default) -> Field:
    default = default or {"default_factory": section}
    return field(metadata={"section": section}, **default)


@dataclass(frozen=True)
class Pore:
    """The channel `0 <= y <= width` (um); Table 1: L_pore, W_pore."""

    width: float = _quantity("100 um", "um")
    length: float = _quantity("600 um", "um")


@dataclass(frozen=True)
class Aggregate:
    """The seed, a half-disc on the lower wall (um); Table 1: R_0."""

    radius: float = _quantity("5 um", "um")


@dataclass(frozen=True)
class Flow:
    """Section 2.1, (1)-(6): driven by `head` (um, over the whole pore) or by `mean_velocity` (um/h), the other is None."""

    head: float | None = _quantity("1e-3 cm", "um", default=None)
    mean_velocity: float | None = _quantity("2.9 m/day", "um/h", NON_NEGATIVE, default=None)
    viscosity_ratio: float = _number(2.0e3)  # lambda
    kinematic_viscosity: float = _quantity("0.01003 cm^2/s", "um^2/h")  # nu_water
    gravity: float = _quantity("9.81 m/s^2", "um/h^2")  # g
    density: float = _quantity("998 mg/cm^3", "mg/L")  # rho


@dataclass(frozen=True, kw_only=True)
class Substrate:
    """One substrate of section 2.2; Table 1: K_s (mg/L), D in water and in biomass (um^2/h). Supply of section 4: 10 K_s (mg/L)."""

    supply: float = _quantity("10 mg/L", "mg/L", NON_NEGATIVE)
    half_saturation: float = _quantity("1.0 mg/L", "mg/L")
    diffusivity: float
    diffusivity_in_aggregate: float


@dataclass(frozen=True, kw_only=True)
class Acceptor(Substrate):
    """The electron acceptor, oxygen: C_A, K_sA, D_A."""

    diffusivity: float = _quantity("2.32 cm^2/day", "um^2/h")
    diffusivity_in_aggregate: float = _quantity("1.85 cm^2/day", "um^2/h")


@dataclass(frozen=True, kw_only=True)
class Donor(Substrate):
    """The electron donor, phenol: C_D, K_sD, D_D."""

    diffusivity: float = _quantity("1.01 cm^2/day", "um^2/h")
    diffusivity_in_aggregate: float = _quantity("0.81 cm^2/day", "um^2/h")


@dataclass(frozen=True)
class Substrates:
    """Section 2.2, (7)-(8). `boundary` is what the pore's ends do when nothing flows: hold the supply, or let nothing pass."""

    acceptor: Substrate = _section(Acceptor)
    donor: Substrate = _section(Donor)
    boundary: str = _choice("open", "closed")


@dataclass(frozen=True)
class Kinetics:
    """Dual Monod kinetics, (7)-(10), and Table 1's symbol of each constant (rates in 1/h, density in mg/L, the others mg/mg)."""

    maximum_utilization_rate: float = _quantity("9.3 1/day", "1/h", NON_NEGATIVE)  # k
    yield_coefficient: float = _number(0.61, POSITIVE_FRACTION)  # Y
    decay_coefficient: float = _quantity("0.12 1/day", "1/h", NON_NEGATIVE)  # b
    degradable_fraction: float = _number(0.8, FRACTION)  # f_d
    decay_oxygen_demand: float = _number(1.42)  # d_c
    acceptor_to_donor_ratio: float = _number(1.52)  # F as printed, where COD - Y d_c = 1.5138 [E1]
    maximum_density: float = _quantity("30000 mg/L", "mg/L")  # X_m


@dataclass(frozen=True)
class Growth:
    """Sections 2.3 and 3.4, (14)-(29), to the time `end` (h) in shape updates of `time_step` (h)."""

    end: float = field(metadata={"kind": Quantity("h", "19.4 h", NON_NEGATIVE)})
    time_step: float = _quantity("12 min", "h")  # Delta t
    shear_modulus: float = _quantity("0.01 MPa", "MPa")  # mu_L, MPa
    minimum_contact_angle: float = _quantity("16.7 deg", "rad", ACUTE)  # rad
    minimum_film: float = _quantity("2 um", "um")  # distance to the opposite wall at which contact is made, um
    new_biomass: str = _choice("stressed", "stress_free")  # total strain since t = 0 (2.3), or section 5's alternative


@dataclass(frozen=True)
class Numerics:
    """Section 3: how it is solved. [En] are the ambiguities of `reference/ERRATA.md`."""

    preset: str = _choice("paper")
    transport: str = _choice("quasi_steady", "gear")  # 3.3
    transfer: str = _choice("conserving", "linear")  # of X_A and X_I at a remesh [E8]
    extent: str = _choice("central", "full")  # 3.1
    interface: str = _choice("laplacian", "traction")  # [E2]
    inlet: str = _choice("local", "mean")  # u_x(y) or u_ave in (11) [E4]
    fixed_point: str = _choice("kept", "rechosen")  # of a contact surface, 2.3.3
    refinement: float = _number(1.0)  # element sizes are divided by it
    flow_stabilisation: float = _number(100.0)  # 3.2: tau = h^2 / (flow_stabilisation nu) [E13]
    mesh_compressibility: float = _number(1.0)  # gamma of (35) [E13]


@dataclass(frozen=True)
class Output:
    """Times (h) of the rows and fields wanted, ascending; None: every shape update."""

    times: tuple[float, ...] | None = field(default=None, metadata={"kind": Times()})


@dataclass(frozen=True)
class Scene:
    """A scene read and checked. `kinetics` is there if and only if there are both substrates and an aggregate."""

    name: str
    pore: Pore = _section(Pore)
    aggregate: Aggregate | None = _section(Aggregate, default=None)
    flow: Flow | None = _section(Flow, default=None)
    substrates: Substrates | None = _section(Substrates, default=None)
    kinetics: Kinetics | None = _section(Kinetics, default=None)
    growth: Growth | None = _section(Growth, default=None)
    numerics: Numerics = _section(Numerics)
    output: Output = _section(Output)


def packaged_scenes() -> tuple[str, ...]:
    """The names of the scenes that come with the package."""
    return tuple(sorted(path.name.removesuffix(".toml") for path in _folder().iterdir() if path.name.endswith(".toml")))


def load_scene(source: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """The scene in a TOML file or of a packaged name, after the overrides "KEY=VALUE" of --set; SceneError if it is not accepted."""
    file = str(source)
    tables = _tables(file)
    for override in overrides:
        _override(tables, override, file)
    return parse_scene(tables, Path(file).stem, file)


def parse_scene(tables: dict, name: str, file: str) -> Scene:
    """The scene that TOML `tables` describe, called `name`; SceneError, naming `file`, if it is not accepted."""
    if "substrates" in tables and "aggregate" in tables:
        tables = {"kinetics": {}, **tables}
    scene = _read(Scene, tables, _Place(file), name=name)
    for broken, key, wanted in _rules(scene):
        if broken:
            raise _Place(file, key).refuse(_at(tables, key, _at(scene_tables(scene), key, MISSING)), wanted)
    return scene


def scene_tables(scene: Scene) -> dict:
    """The scene as TOML tables with every default spelt out; `parse_scene` reads an equal scene back, to the last bit."""
    return _write(scene)


def scene_hash(scene: Scene) -> str:
    """16 hexadecimal digits that stand for all that a scene says but its name."""
    canonical = json.dumps(scene_tables(scene), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class _Place:
    """A key of a file, to be named in a message."""

    file: str
    key: str = ""

    def below(self, key: str) -> "_Place":
        key = key if len(key) <= 60 else key[:57] + "..."
        return _Place(self.file, f"{self.key}.{key}" if self.key else key)

    def refuse(self, value: object, wanted: str) -> SceneError:
        stated = f"{self.key} is missing" if value is MISSING else f"{self.key} = {shown(value)}"
        return SceneError(f"{self.file}: {stated}: {wanted}")


def _read(section: type, table: object, place: _Place, **given):
    """The section that a table describes."""
    entries = _entries(section)
    if not isinstance(table, dict):
        raise place.refuse(table, f"a table [{place.key}] is needed, with the keys {', '.join(entries)}")
    for key in table:
        if key not in entries:
            raise place.below(key).refuse(table[key], _instead(key, list(entries), place.key))
    for key, entry in entries.items():
        if key not in table and entry.default is MISSING and entry.default_factory is MISSING:
            raise place.below(key).refuse(MISSING, entry.metadata["kind"].wanted)
    return section(**given, **{key: _read_entry(entries[key], table[key], place.below(key)) for key in table})


def _read_entry(entry: Field, value: object, place: _Place):
    if "section" in entry.metadata:
        return _read(entry.metadata["section"], value, place)
    kind = entry.metadata["kind"]
    try:
        return kind.read(value)
    except (ValueError, OverflowError):
        raise place.refuse(value, kind.wanted) from None


def _write(section) -> dict:
    """The table of a section; what is None is left out."""
    stated = {key: getattr(section, key) for key in _entries(type(section))}
    return {key: _write_entry(section, key, value) for key, value in stated.items() if value is not None}


def _write_entry(section, key: str, value):
    kind = _entries(type(section))[key].metadata.get("kind")
    return kind.write(value) if kind else _write(value)


def _entries(section: type) -> dict[str, Field]:
    """The keys of a section."""
    return {entry.name: entry for entry in fields(section) if entry.metadata}


def _instead(key: str, keys: list[str], section: str) -> str:
    near = difflib.get_close_matches(key[:60], keys, n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"there is no such key; {f'[{section}]' if section else 'a scene'} takes {', '.join(keys)}{hint}"


def _at(tables: dict, key: str, default: object) -> object:
    """The value at a dotted key."""
    for part in key.split("."):
        if part not in tables:
            return default
        tables = tables[part]
    return tables


def _rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    """What concerns several keys: (is it broken, the key to name, what is accepted)."""
    yield from _seed_rules(scene)
    yield from _flow_rules(scene)
    yield from _substrate_rules(scene)
    yield from _growth_rules(scene)
    yield from _output_rules(scene)


def _seed_rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    if scene.aggregate:
        radius, pore = scene.aggregate.radius, scene.pore
        wanted = f"less than pore.width ({pore.width:g} um) and half of pore.length ({pore.length:g} um) is needed"
        yield radius >= pore.width or 2 * radius >= pore.length, "aggregate.radius", wanted


def _flow_rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    if scene.flow:
        head, velocity = scene.flow.head, scene.flow.mean_velocity
        neither = 'it or flow.mean_velocity is needed, such as head = "1e-3 cm" or mean_velocity = "2.9 m/day"'
        yield head is None and velocity is None, "flow.head", neither
        both = head is not None and velocity is not None
        yield both, "flow.mean_velocity", f"flow.head ({head} um) is given too; either is accepted, not both"
        still = velocity == 0 and scene.substrates is not None and scene.numerics.transport == "quasi_steady"
        wanted = 'greater than zero is needed, or numerics.transport = "gear": nothing is supplied, so no state is steady'
        yield still, "flow.mean_velocity", wanted


def _substrate_rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    partners = scene.substrates and scene.aggregate
    yield bool(scene.kinetics and not partners), "kinetics", "[aggregate] and [substrates] are needed with it"
    if scene.substrates:
        closed, key = scene.substrates.boundary == "closed", "substrates.boundary"
        yield closed and scene.flow is not None, key, '"open" is needed with [flow]'
        steady = scene.numerics.transport == "quasi_steady"
        wanted = '"open" is needed, or numerics.transport = "gear": nothing is supplied, so no state is steady'
        yield closed and steady, key, wanted


def _growth_rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    if scene.growth:
        partners = scene.substrates and scene.aggregate
        yield not partners, "growth", "[aggregate] and [substrates] are needed with it"
        film, width = scene.growth.minimum_film, scene.pore.width
        yield film >= width, "growth.minimum_film", f"less than pore.width ({width:g} um) is needed"


def _output_rules(scene: Scene) -> Iterator[tuple[bool, str, str]]:
    last, times = scene.growth.end if scene.growth else 0.0, scene.output.times or ()
    wanted = f"none after growth.end ({last:g} h)" if scene.growth else 'only "0 h" without [growth], where nothing changes'
    yield any(time > last for time in times), "output.times", f"{wanted} is accepted"


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
    place = _Place(file)
    for part in path[:-1]:
        tables, place = tables.setdefault(part, {}), place.below(part)
        if not isinstance(tables, dict):
            raise place.refuse(tables, f"a value, so that --set {shown(override)} is not possible")
    tables[path[-1]] = _toml_value(text.strip())


def _toml_value(text: str) -> object:
    """The TOML value that a text is, or the text itself."""
    try:
        read = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return read["value"] if list(read) == ["value"] else text
