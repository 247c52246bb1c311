"""The keys of a scene: its sections are the physics that runs, its defaults Table 1 of the paper.

A scene is a TOML file or the name of a packaged scene, with units in its values. The dataclasses
below are the only definition of its keys, defaults, units, accepted ranges and sources; reading,
checking, writing and `repro scene` use them. Their floats are in the units of the package
(`repro.scene.units`): um, h, mg/L, head in um, MPa, rad. A section that a scene leaves out is None,
and its physics does not run. Exceptions are `pore`, `numerics` and `output`, which have defaults,
and `kinetics`, which comes with substrates and aggregate. [En] are the ambiguities of
`reference/ERRATA.md`.
"""
import hashlib
import json
from collections.abc import Collection, Sequence
from copy import deepcopy
from dataclasses import MISSING, asdict, dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

from repro.scene import bodies
from repro.scene.arguments import Overrides, typed
from repro.scene.files import key_of, leave_out, override, read_tables
from repro.scene.former import with_former
from repro.scene.needed import MissingError, needed
from repro.scene.reading import Place, dotted, entries, read_table, toml, write_table
from repro.scene.rules import rules
from repro.scene.time_table import TimeTable, TimeTables, at_largest, at_time, time_tables
from repro.scene.units import (
    ACUTE,
    BELOW_1,
    EITHER_SIGN,
    NON_NEGATIVE,
    NOT_IN_PAPER,
    PORE_WIDTH,
    WORD,
    Drawn,
    Flag,
    Points,
    Refused,
    SceneError,
    Share,
    Stated,
    Times,
    choice,
    from_0_to,
    number,
    quantity,
    scene_key,
    section,
    sections,
    timed_quantity,
    units_of,
    up_to,
)
from repro.schemes import CURVED, PAPER, PRINTED, Scheme

STEADY = "0.001 1/h"
LAMBDA = 2000.0  # Table 1
RATIO = 1.52  # F, mg/mg, Table 1


@dataclass(frozen=True)
class Pore:
    """The channel `0 <= y <= width` (um), or the half of one below a plane of symmetry.

    `depth` (um) is that of the whole pore, across the plane; the model is plane.
    """

    width: float = quantity("100 um", "um", PORE_WIDTH, about="W_pore, from wall to wall",
                            source="Table 1 (typically 100 um; 50 um in section 4)")
    length: float = quantity("600 um", "um", about="L_pore, from end to end", source="Table 1")
    upper_wall: str = choice(
        "no slip", "symmetry",
        about="The upper wall: like the lower one, or the middle of a pore of twice the width, "
              "with the mirror image of the aggregate beyond it")
    depth: float | None = quantity(
        "10 um", "um", default=None,
        about="Depth across the plane, for flow.rate and for columns of totals; results per depth "
              "do not need it")

    @property
    def whole_width(self) -> float:
        """Width (um), with its mirror image beyond a plane of symmetry."""
        return self.width * (2.0 if self.upper_wall == "symmetry" else 1.0)


@dataclass(frozen=True)
class Aggregate:
    """A seed on a wall (um): a half-disc, or a body with an `outline`.

    `outline`: the points (x, y) of its free surface and of its contact with the opposite wall, from
    the upstream end on its own wall to the downstream one; `position` is added to x. With it
    `radius` is None. `inert_fraction`: X_I / (X_A + X_I) of all of it at t = 0.
    """

    radius: float | None = quantity(
        "5 um", "um", default=None, stated='default "5 um" without outline',
        about="R_0 of the seed, a half-disc on its wall; either this or outline",
        source="Table 1")
    position: float = quantity(
        "0 um", "um", EITHER_SIGN,
        about="x of the middle of the half-disc, or what is added to x of the points of outline; 0 "
              "is the middle of the pore")
    outline: tuple[tuple[float, float], ...] | None = scene_key(
        Points(),
        about="The seed's surface instead of a half-disc, y from the lower wall: both ends on the "
        "seed's wall (y = 0 on the lower one), the upstream one first; points on the other wall "
        "(y = pore.width) are contact with it")
    smooth: bool = scene_key(
        Flag(), about="A spline through the points of outline, or straight lines")
    inert_fraction: float = number(
        0.0, BELOW_1,
        about="Share of X_I in the biomass at t = 0, where X_A + X_I = X_m")
    wall: str = choice(
        "lower", "upper", about="The wall on which the seed sits")
    name: str | None = scene_key(
        WORD,
        about="Name of the aggregate among several: in keys such as aggregate.upstream.radius, in "
              "columns and messages; by default its number, from 1")

    def __post_init__(self):
        if self.radius is None and self.outline is None:
            object.__setattr__(self, "radius", 5.0)  # um, Table 1

    def height(self, width: float) -> float:
        """Distance (um) of its highest point from its wall, in a pore of a width (um)."""
        if self.outline is None:
            return needed(self.radius, "a radius")
        levels = [y for _, y in self.outline]
        return max(levels) if self.wall == "lower" else width - min(levels)


@dataclass(frozen=True)
class Flow:
    """Section 2.1, (1)-(6): driven by `head` (um, whole pore) or `mean_velocity` (um/h).

    The other one is None; a `rate` (um^3/h) gives the mean velocity. A table of the scene is a
    TimeTable here, and a number in the scene that `Scene.at` returns. The aggregate has a
    `viscosity_ratio` or a `permeability` (um^2); the other one is None.
    """

    head: float | None = timed_quantity(
        "1e-3 cm", "um", default=None, source="(6), section 4",
        about="Head lost over the whole pore; either this, mean_velocity or rate")
    mean_velocity: float | None = timed_quantity(
        "2.9 m/day", "um/h", NON_NEGATIVE, default=None, source="(3), section 4",
        about="u_ave, mean over the width; either this, head or rate")
    rate: float | None = timed_quantity(
        "0.1 uL/min", "um^3/h", NON_NEGATIVE, default=None,
        about="Flow through the whole pore, of width and pore.depth, with the mirror image beyond "
              "a plane of symmetry; either this, head or mean_velocity")
    viscosity_ratio: float | None = number(
        LAMBDA, source="2.1, Table 1", stated="default 2000 without permeability",
        default=None, about="lambda, viscosity of the aggregate over that of water")
    permeability: float | None = quantity(
        "1e-15 m^2", "um^2", default=None, source="Section 5, without a value",
        about="Of the aggregate, whose drag then slows the water in it instead of a viscosity; at "
        "least 1e-11 pore.width^2")
    kinematic_viscosity: float = quantity("0.01003 cm^2/s", "um^2/h", about="nu of water",
                                          source="(1), Table 1")
    gravity: float = quantity("9.81 m/s^2", "um/h^2", about="g, the acceleration of gravity",
                              source="(1), Table 1")
    density: float = quantity("998 mg/cm^3", "mg/L", source="Table 1 [E19]",
                              about="rho of water; only growth.fluid_forces needs it")

    def __post_init__(self):
        if self.viscosity_ratio is None and self.permeability is None:
            object.__setattr__(self, "viscosity_ratio", LAMBDA)

    @property
    def driving_head(self) -> float:
        """`head` of a flow that has no `mean_velocity`."""
        return needed(self.head, "flow.head")


@dataclass(frozen=True, kw_only=True)
class Substrate:
    """A substrate of section 2.2: supply and K_s (mg/L), D in water and in biomass (um^2/h).

    A Fraction for D in biomass is a share of D in water. A `supply` given as a table is a TimeTable
    here, and a number in the scene that `Scene.at` returns.
    """

    supply: float = timed_quantity("10 mg/L", "mg/L", NON_NEGATIVE,
                                   source="(11), section 4 (10 K_s)",
                           about="C_supply of the water that comes in, and of all water at t = 0")
    half_saturation: float = quantity(
        "1.0 mg/L", "mg/L", about="K_s of Monod's law", source="(7)-(10), Table 1")
    diffusivity: float  # a key of Acceptor and of Donor
    diffusivity_in_aggregate: float

    def __post_init__(self):
        inside = self.diffusivity_in_aggregate
        if isinstance(inside, Fraction):
            inside = float(inside * Fraction(self.diffusivity))
            object.__setattr__(self, "diffusivity_in_aggregate", inside)


@dataclass(frozen=True, kw_only=True)
class Acceptor(Substrate):
    """The electron acceptor, oxygen: C_A, K_sA, D_A."""

    diffusivity: float = quantity(
        "2.32 cm^2/day", "um^2/h", about="D_A in water", source="(7), Table 1")
    diffusivity_in_aggregate: float = scene_key(
        Share("um^2/h", "1.85 cm^2/day", of="diffusivity"), about="D_A in the aggregate",
        source="2.2 (80 % of that in water), Table 1")


@dataclass(frozen=True, kw_only=True)
class Donor(Substrate):
    """The electron donor, phenol: C_D, K_sD, D_D; K_i (mg/L) of Haldane's law."""

    diffusivity: float = quantity(
        "1.01 cm^2/day", "um^2/h", about="D_D in water", source="(8), Table 1")
    diffusivity_in_aggregate: float = scene_key(
        Share("um^2/h", "0.81 cm^2/day", of="diffusivity"), about="D_D in the aggregate",
        source="2.2 (80 % of that in water), Table 1")
    inhibition_constant: float = quantity(
        "100 mg/L", "mg/L", about="K_i of Haldane's law, with kinetics.law = \"Haldane\"")


@dataclass(frozen=True)
class Substrates:
    """Section 2.2, (7)-(8).

    `acceptor`, `donor`: both by default; with one of them alone the other is None, and does not
    limit. `boundary`: without flow the pore's ends hold the supply, or let nothing pass.
    """

    acceptor: Acceptor | None = section(
        Acceptor, default=None, source="(7), Table 1",
        about="The electron acceptor, oxygen; left out beside [substrates.donor]: it does not "
              "limit")
    donor: Donor | None = section(
        Donor, default=None, source="(8), Table 1",
        about="The electron donor, phenol; left out beside [substrates.acceptor]: it does not "
              "limit")
    boundary: str = choice(
        "open", "closed",
        about="Without [flow] the pore's ends hold the supply, or let nothing pass")

    def __post_init__(self):
        if self.acceptor is None and self.donor is None:
            object.__setattr__(self, "acceptor", Acceptor())
            object.__setattr__(self, "donor", Donor())

    @property
    def modelled(self) -> dict[str, Substrate]:
        """The substrates by their names, the acceptor first."""
        pair = {"acceptor": self.acceptor, "donor": self.donor}
        return {name: substrate for name, substrate in pair.items() if substrate is not None}

    @property
    def slowest(self) -> float:
        """The smallest diffusivity (um^2/h)."""
        return min(min(kind.diffusivity, kind.diffusivity_in_aggregate)
                   for kind in self.modelled.values())

    @property
    def places(self) -> slice:
        """The places of the substrates in (acceptor, donor)."""
        return slice(int(self.acceptor is None), 1 + int(self.donor is not None))


@dataclass(frozen=True)
class Kinetics:
    """Kinetics, (7)-(10), with Table 1's symbols.

    Rates are in 1/h, the density in mg/L, the others in mg/mg. `law` names the law of uptake.
    """

    law: str = choice(
        "dual Monod", "Haldane", "first order", "zero order", source="(7)-(10) have dual Monod",
        about="m of each substrate: C / (C + K_s); for the donor C / (K_s + C + C^2 / K_i); "
              "C / K_s; or 1 where there is any")
    decay: str = choice(
        "with acceptor", "unlimited", source="(9)-(10) have m_A",
        about="Decay in proportion to m_A, none without acceptor; or b everywhere, whose oxygen "
              "demand is met in proportion to m_A")
    maximum_utilization_rate: float = quantity(
        "9.3 1/day", "1/h", NON_NEGATIVE, source="(7)-(9), Table 1",
        about="k, mg of donor per mg of active biomass and time")
    yield_coefficient: float = number(
        0.61, up_to(1), about="Y, mg of biomass per mg of donor", source="(9), Table 1")
    decay_coefficient: float = quantity(
        "0.12 1/day", "1/h", NON_NEGATIVE, about="b, decay of active biomass",
        source="(9)-(10), Table 1")
    degradable_fraction: float = number(
        0.8, from_0_to(1), about="f_d; the part 1 - f_d of decayed biomass stays, inert",
        source="(7), (10), Table 1")
    decay_oxygen_demand: float = number(
        1.42, about="d_c, mg of acceptor per mg of biomass that degrades",
        source="(7) [E3], Table 1")
    donor_oxygen_demand: float | None = number(
        2.38, default=None, source="(7), Table 1 [E1]",
        about="COD, mg of acceptor per mg of donor oxidised; acceptor_to_donor_ratio follows")
    acceptor_to_donor_ratio: float = number(
        RATIO, default=None, stated=f"default {RATIO}, or COD - Y d_c where COD is given",
        about="F, mg of acceptor per mg of donor",
        source="(7), Table 1 as printed, where COD - Y d_c is 1.5138 [E1]")
    maximum_density: float = quantity(
        "30000 mg/L", "mg/L", about="X_m, mass of biomass per volume of aggregate",
        source="(28), Table 1")

    def __post_init__(self):
        if self.acceptor_to_donor_ratio is None:
            implied = self.implied_ratio
            object.__setattr__(self, "acceptor_to_donor_ratio",
                               RATIO if implied is None else implied)

    @property
    def implied_ratio(self) -> float | None:
        """F = COD - Y d_c (mg/mg) by (7); None if the scene has no COD."""
        if self.donor_oxygen_demand is None:
            return None
        return self.donor_oxygen_demand - self.yield_coefficient * self.decay_oxygen_demand


@dataclass(frozen=True)
class Erosion:
    """Speed (um/h) at which free surfaces recede along their normal; the law needs its keys."""

    law: str = choice(
        "constant", "thickness squared", "shear",
        about="speed; thickness_coefficient z^2, with the distance z from the wall of the seed; "
              "or shear_coefficient max(tau - critical_shear, 0), with the shear tau of the water")
    speed: float | None = quantity(
        "0.1 um/h", "um/h", default=None, about="Of the law \"constant\"")
    thickness_coefficient: float | None = quantity(
        "0.01 1/um/h", "1/um/h", default=None,
        about="Of the law \"thickness squared\" (Wanner and Gujer 1986, Xavier et al. 2005)")
    shear_coefficient: float | None = quantity(
        "1 um/h/Pa", "um/h/MPa", default=None,
        about="Of the law \"shear\"")
    critical_shear: float = quantity(
        "0 Pa", "MPa", NON_NEGATIVE,
        about="Shear up to which a surface stays, with the law \"shear\"")


@dataclass(frozen=True)
class Growth:
    """Sections 2.3 and 3.4, (14)-(29), to the time `end` (h), updates every `time_step` (h)."""

    end: float = quantity(
        "19.4 h", "h", NON_NEGATIVE, default=MISSING, about="Time at which the run ends",
        source="Section 4")
    time_step: float = quantity(
        "12 min", "h", source="Section 2, Table 1",
        about="Delta t between shape updates; the first step of the midpoint rule")
    shear_modulus: float = quantity(
        "0.01 MPa", "MPa", source="(14)-(24), Table 1",
        about="mu_L; it scales the stresses and, without fluid_forces, moves nothing")
    minimum_contact_angle: float = quantity(
        "16.7 deg", "rad", ACUTE, source="2.3.3, Table 1",
        about="A wedge of fluid beside a contact surface closes under this angle")
    minimum_film: float = quantity(
        "2 um", "um", source="2.3.3, Table 1",
        about="A film of fluid to the opposite wall closes when it is thinner than this")
    fluid_forces: str = choice(
        "neglected", "included", source="(20), (22), 2.3.3; section 5",
        about="The fluid's traction on a viscous aggregate, or its drag within a permeable one")
    wall: str = choice(
        "sliding", "bonded", source="2.3.3",
        about="Biomass on the walls of the seeds slides along them, or keeps its place there")
    bonding_strength: float | None = quantity(
        "1e-3 MPa", "MPa", default=None, source="Section 5, without a value",
        about="The run ends if the traction of a wall exceeds it, in the mean over "
              "pore.width / 20")
    tensile_strength: float | None = quantity(
        "0.01 MPa", "MPa", default=None, source="Section 5, without a value",
        about="The run ends if the largest tensile stress exceeds it, in the mean within "
              "pore.width / 20")
    after_detachment: str = choice(
        "end", "continue", source="Section 5, without a model",
        about="An aggregate whose traction exceeds bonding_strength ends the run, or leaves the "
              "pore if it touches one wall alone")
    new_biomass: str = choice(
        "stressed", "stress_free", source="2.3, section 5",
        about="Strain counts from t = 0 (2.3), or new biomass has no stress (section 5)")
    energy: str = choice(
        "neo-Hookean", "Gent", source="(17); section 5 calls others straightforward",
        about="Elastic energy of the aggregate; Gent's stiffens towards limiting_invariant")
    limiting_invariant: float = number(
        100.0, source=NOT_IN_PAPER + "; about that of rubber (Gent 1996)",
        about="J_m of Gent's energy, with energy = \"Gent\": J^(-2/3) tr C stays below 3 + J_m")
    meeting: str = choice(
        "weld", "end", source="Section 5, without a model",
        about="If two aggregates meet, they join and move together (weld), or the run ends (end). "
              "They join only if this encloses no water, on sliding walls, with curved elements, "
              "without erosion. Otherwise the run ends")
    until: str = choice(
        "end", "steady",
        about="The run goes on to end, or ends early if the aggregates are steady")
    steady_tolerance: float = quantity(
        STEADY, "1/h",
        about="They are if area, thickness and length of each change by less than this part of "
              "themselves per time, in the mean over a step")
    erosion: Erosion | None = section(
        Erosion, default=None,
        about="The water erodes the aggregates' free surfaces; left out: nothing is eroded")

    @property
    def bonded(self) -> bool:
        """Whether biomass keeps its place on the wall of its seed."""
        return self.wall == "bonded"

    @property
    def continues(self) -> bool:
        """Whether an aggregate that detaches leaves the pore, and the run goes on."""
        return self.after_detachment == "continue"

    @property
    def until_steady(self) -> bool:
        """Whether the run ends early if the aggregates are steady."""
        return self.until == "steady"

    @property
    def has_fluid_forces(self) -> bool:
        """Whether the fluid's forces act on the aggregate."""
        return self.fluid_forces == "included"


@dataclass(frozen=True)
class Numerics:
    """Section 3: how it is solved."""

    preset: str = choice(
        "fast", "accurate", "exact", "paper", "as_printed", "sketch",
        source="Section 3 is \"paper\"",
        about="Defaults of this section. fast errs by about 1 % until contact, accurate by about "
              "0.1 %, exact by less than 0.01 %. paper is the paper's scheme, and conserves mass; "
              "as_printed does not [E4, E8]. sketch errs by about 1 % until contact. Errors grow "
              "after contact, those of sketch to 18 % in narrow pores")
    tolerance: float = number(0.01, up_to(1),
                              about="Largest error of a midpoint step: change of the growth rate "
                                    "times the step")
    transport: str = choice(
        "quasi_steady", "gear", source="2.2; 3.3 has gear",
        about="Substrates at rest in each shape, or the transient predictor-corrector scheme")
    extent: str | None = choice(
        "central", "full", default=None, source="3.1",
        stated='default "central", or "full" where there are substrates and nothing flows, at '
               'times or ever: (26) and (12), which stand for the rest of the pore, need a flow',
        about="Mesh the part around the aggregate, or the whole pore")
    interface: str = choice("laplacian", "traction", source="(1) [E2]",
                            about="What of the flow is continuous across the interface")
    solver: str = choice("superlu", "pardiso",
                         about="Solver of linear systems; the second needs the package pypardiso")
    refinement: float = number(
        1.0, up_to(20), source="3.1 [E13]", about="Divides the element sizes")
    gradation: float = number(
        0.25, from_0_to(1), source="3.1 [E13]",
        about="Growth of element sizes with distance from an aggregate, twice as fast in contact "
              "with contact_elements; 0: one size everywhere")
    contact_elements: float = number(
        0.0, from_0_to(100),
        about="Elements to growth.minimum_film beside the contact lines with the opposite wall, "
              "2 at least with a permeable aggregate; 0: as large as elsewhere on the interface")
    exchanged: Scheme | None = None  # no key: ``repro.simulate(..., scheme=...)``

    @property
    def whole_pore(self) -> bool:
        """Whether a mesh covers the whole pore."""
        return self.extent == "full"

    @property
    def scheme(self) -> Scheme:
        """The scheme: ``exchanged``, or the one of the preset."""
        return self.exchanged or SCHEMES[self.preset]


#: The scheme of each preset.
SCHEMES = {"fast": CURVED, "accurate": CURVED, "exact": CURVED, "paper": PAPER,
           "as_printed": PRINTED, "sketch": CURVED}
#: Changes of each preset to the defaults above: until contact errors of about 1 %, of about 0.1 %,
#: under 0.01 % (see `make bench`); the paper's own scheme; the scheme as printed, with transient
#: substrates (3.3); the coarse run of `repro check`.
PRESETS: dict[str, dict[str, Any]] = {
    "fast": {"refinement": 0.2, "tolerance": 0.0075, "contact_elements": 3.0},
    "accurate": {"refinement": 0.45, "tolerance": 0.001, "contact_elements": 8.0},
    "exact": {"refinement": 0.7, "tolerance": 0.00025, "contact_elements": 30.0},
    "paper": {},
    "as_printed": {"transport": "gear"},
    "sketch": {"refinement": 0.05, "tolerance": 0.01},
}
#: The next finer preset of a preset, if there is one.
FINER = {"sketch": "fast", "fast": "accurate", "accurate": "exact"}


@dataclass(frozen=True)
class Output:
    """Times (h) of the requested rows and fields, ascending, and their interval.

    Both None: every step and, with midpoint, every growth.time_step times a power of two that gives
    24 or more.
    """

    times: tuple[float, ...] | None = scene_key(
        Times(),
        source="Figures 4-6",
        about="Times of the requested rows and fields; they change no step. Without it: every "
        "step, with midpoint also every 1/4, 1/2, 1, 2, 4 ... growth.time_step, so that there are "
        "24 rows or more after t = 0")
    every: float = quantity(
        "1 h", "h", default=None,
        about="Interval of rows and fields from t = 0 on, with a last one at growth.end; times "
        "adds others")

    def requested(self, end: float) -> tuple[float, ...] | None:
        """Return the requested times (h), ascending, to the time `end`; None: every step."""
        if self.every is None:
            return self.times
        count = ceil(end / self.every - 1e-9)
        intervals = (round(number * self.every, 12) for number in range(count))
        return tuple(sorted({*intervals, end, *(self.times or ())}))


class GrowingSections(NamedTuple):
    """The sections that a scene with [growth] has; none of them is optional."""

    substrates: Substrates
    kinetics: Kinetics
    growth: Growth


@dataclass(frozen=True)
class Scene:
    """A scene, read and checked: one attribute for each section of its TOML file.

    :func:`load_scene` makes it. ``str(scene)`` is its TOML text with all keys and units.

    Parameters
    ----------
    name : str
        Name in messages and reports.
    pore : Pore
        The channel; lengths in um.
    aggregates : tuple of Aggregate
        The colonies on the walls. Empty: a clean channel.
    flow : Flow, optional
        Head (um) or mean velocity (um/h). None: pure diffusion.
    substrates : Substrates, optional
        Acceptor and donor; mg/L and um2/h. None: no transport.
    kinetics : Kinetics, optional
        Uptake, growth and decay; 1/h and mg/L. Present if and only if ``substrates`` and
        ``aggregates`` are.
    growth : Growth, optional
        Duration and mechanics of growth; h, MPa, um. None: only the state at t = 0.
    numerics : Numerics
        Discretisation and solvers.
    output : Output
        Times (h) of rows and fields.
    units : dict of str
        The units of the scene's text by dotted key, for its display.

    Examples
    --------
    >>> import repro
    >>> scene = repro.load_scene("base", ['growth.end="1 h"'])
    >>> scene.pore.width, scene.growth.end
    (50.0, 1.0)
    """

    name: str
    pore: Pore = section(Pore, about="The channel", source="Section 2, Figure 1")
    aggregates: tuple[Aggregate, ...] = sections(
        Aggregate, "aggregate", source="Section 4",
        about="A colony of biomass on a wall, or several as [[aggregate]]; left out: a clean "
              "channel")
    flow: Flow | None = section(
        Flow, default=None,
        about="Stokes flow through pore and aggregate; left out: pure diffusion",
        source="2.1, (1)-(6), and 3.2")
    substrates: Substrates | None = section(
        Substrates, default=None,
        about="Acceptor and donor, carried, diffusing and taken up; left out: none",
        source="2.2, (7)-(13), and 3.3")
    kinetics: Kinetics | None = section(
        Kinetics, default=None,
        about="Uptake, growth and decay; comes with [aggregate] and [substrates]",
        source="2.2, (7)-(10)")
    growth: Growth | None = section(
        Growth, default=None, source="2.3, 3.4, (14)-(35)",
        about="The aggregate grows as a neo-Hookean body and moves; left out: the state at t = 0 "
              "alone")
    numerics: Numerics = section(Numerics, about="How it is solved", source="Section 3")
    output: Output = section(Output, about="What is written")
    units: dict[str, str] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.numerics.extent is None:
            extent = "full" if self.stagnant else "central"
            object.__setattr__(self, "numerics", replace(self.numerics, extent=extent))

    @property
    def aggregate(self) -> Aggregate | None:
        """The only aggregate; None in a clean channel. Raises ValueError if there are several."""
        if len(self.aggregates) > 1:
            raise ValueError(f"the scene has {len(self.aggregates)} aggregates; "
                             "scene.aggregates has them")
        return next(iter(self.aggregates), None)

    @property
    def labels(self) -> list[str]:
        """The name of each aggregate, or its number from 1."""
        return bodies.labels([seed.name for seed in self.aggregates])

    @property
    def aggregate_keys(self) -> list[str]:
        """The dotted key of each aggregate, such as "aggregate.2"; "aggregate" of the only one."""
        return bodies.dotted_keys([seed.name for seed in self.aggregates])

    @property
    def growing(self) -> GrowingSections:
        """The sections of growth. Raises MissingError if there is no [growth]."""
        if self.substrates is None or self.kinetics is None or self.growth is None:
            raise MissingError("[substrates], [kinetics] and [growth] are needed here")
        return GrowingSections(self.substrates, self.kinetics, self.growth)

    @property
    def without_weld(self) -> str:
        """Why all aggregates that meet end the run; empty if some can join."""
        growth = self.growing.growth
        scheme = self.numerics.scheme
        reasons = {
            'growth.meeting is "end"': growth.meeting == "end",
            "a weld needs the curved elements and the midpoint rule of the preset fast":
                not (scheme.controls_error and scheme.follows_layers),
            'growth.wall is "bonded"': growth.bonded,
            "the aggregates erode": growth.erosion is not None}
        return next((reason for reason, applies in reasons.items() if applies), "")

    @property
    def stagnant(self) -> bool:
        """Whether there are substrates without flow, at any time."""
        if self.substrates is None or self.flow is None:
            return self.substrates is not None
        velocity = self.flow.mean_velocity if self.flow.rate is None else self.flow.rate
        return 0 in velocity.values if isinstance(velocity, TimeTable) else velocity == 0

    @cached_property
    def time_tables(self) -> TimeTables:
        """All tables over time."""
        return TimeTables(time_tables(self))

    def at(self, time: float) -> "Scene":
        """Return the scene with the values of its tables at a time (h), after a jump then."""
        return at_time(self, time) if self.time_tables.tables else self

    @cached_property
    def largest(self) -> "Scene":
        """The scene with the largest value of each table."""
        return at_largest(self)

    @property
    def requested_times(self) -> tuple[float, ...] | None:
        """The times (h) of rows by [output], ascending; None: every step."""
        return self.output.requested(self.growth.end if self.growth else 0.0)

    def reporting(self, *times: float) -> "Scene":
        """Return the scene with rows at these times (h) alone."""
        return replace(self, output=replace(self.output, every=None, times=times))

    def stated(self, section: str, key: str) -> Stated:
        """Return the value of a key of a section, a quantity, in the unit of the scene's text.

        The section of an aggregate is its dotted key, as in ``aggregate_keys``.
        """
        keys = self.aggregate_keys
        part = self.aggregates[keys.index(section)] if section in keys else getattr(self, section)
        kind = entries(type(part))[key].metadata["kind"]
        place = bodies.numbered(keys, section)
        return kind.stated(getattr(part, key),
                           self.units.get(f"{place}.{key}", kind.usual_unit))

    def __str__(self) -> str:
        """TOML text with all keys and units; it parses to an equal scene."""
        return toml(scene_tables(self))

    def __repr__(self) -> str:
        sections = [key for key, entry in entries(Scene).items()
                    if getattr(self, entry.name) not in (None, ())]
        return f"<Scene {self.name}: {', '.join(sections)}; hash {scene_hash(self)}>"


#: Keys added after hashes of scenes were recorded, with their defaults as tables write them.
LATER: dict[str, dict[str, object]] = {
    "pore": {"upper_wall": "no slip"},
    "aggregate": {"position": "0.0 um", "wall": "lower", "smooth": False, "inert_fraction": 0.0},
    "growth": {"wall": "sliding", "energy": "neo-Hookean", "limiting_invariant": 100.0,
               "after_detachment": "end", "meeting": "weld", "until": "end",
               "steady_tolerance": STEADY},
    "numerics": {"contact_elements": 0.0},
    "substrates.donor": {"inhibition_constant": "100.0 mg/L"},
    "kinetics": {"law": "dual Monod", "decay": "with acceptor"},
}
#: A scene, or its source: a file, a packaged name, a dict of tables.
Source = Scene | str | Path | dict
KEYS = tuple(dotted(Scene))  # every dotted key of a scene, its sections among them


@typed
def load_scene(scene: Source, overrides: Overrides = (), *, unset: Sequence[str] = (),
               scheme: Scheme | None = None) -> Scene:
    """Load a scene, with changes.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A TOML file, the name of a packaged scene, a dict of tables like those of a file, or a
        loaded scene. Lists of a dict may be tuples or arrays, its numbers scalars of NumPy.
    overrides : sequence of str or dict, optional
        Changes: texts "KEY=VALUE", like those of ``--set``, with values in TOML with units; or a
        dict of values by dotted keys, among them values of NumPy and quantities of pint.
    unset : sequence of str, optional
        Dotted keys or sections to leave out, like those of ``--unset``; before ``overrides``.
    scheme : repro.schemes.Scheme, optional
        Another scheme than that of the preset, for :func:`repro.simulate` and :func:`repro.solve`.

    Returns
    -------
    Scene
        The checked scene, with values in um, h, mg/L, MPa and rad.

    Raises
    ------
    SceneError
        If the scene is not accepted: names the file, key, value and accepted values.
    TypeError
        If an argument has a wrong type: names the argument.

    Examples
    --------
    >>> import repro
    >>> scene = repro.load_scene("base", ['pore.width="60 um"'], unset=["flow"])
    >>> scene.pore.width, scene.flow
    (60.0, None)
    """
    if isinstance(scene, Scene):
        scheme = scheme or scene.numerics.exchanged
        if scheme is scene.numerics.exchanged and not (overrides or unset):
            return scene
    file = label(scene)
    tables = load_tables(scene, overrides, unset)
    changed = [key_of(entry) for entry in overrides]
    return parse_scene(tables, Path(file).stem, file, changed, scheme)


def label(source: Source) -> str:
    """Name of a scene in messages: that of its file, or its own."""
    if isinstance(source, Scene):
        return source.name
    return "scene" if isinstance(source, dict) else str(source)


def load_tables(source: Source, overrides: Collection[str] = (), unset: Sequence[str] = ()) -> dict:
    """Load the tables of a scene without checks, and apply --unset and then --set."""
    file = label(source)
    if isinstance(source, Scene):
        tables = scene_tables(source)
        if "numerics.preset" in map(key_of, overrides):
            of_preset = Numerics(source.numerics.preset, **PRESETS[source.numerics.preset])
            tables["numerics"] = {  # another preset sets the other keys
                key: value for key, value in write_table(source.numerics).items()
                if getattr(source.numerics, key) != getattr(of_preset, key)}
    else:
        tables = deepcopy(source) if isinstance(source, dict) else read_tables(file)
    tables = bodies.single(tables)
    for key in unset:
        leave_out(tables, key, file, KEYS)
    tables = bodies.remaining(tables) if unset else tables
    for entry in overrides:
        override(tables, entry, file, KEYS)
    return bodies.single(tables)


def parse_scene(tables: dict, name: str, file: str, changed: Sequence[str] = (),
                scheme: Scheme | None = None) -> Scene:
    """Parse and check TOML `tables` as a scene called `name`.

    changed: dotted keys that were set last, for example by --set. If keys contradict each other,
    the error names one of these. scheme: another one than that of the preset. Raises SceneError,
    naming `file`, if the scene is not accepted.
    """
    if not tables:
        sections = ", ".join(f"[{key}]" for key in entries(Scene))
        raise SceneError(f"{file}: an empty scene: one section or more is needed of {sections}")
    tables = bodies.single(tables)
    if "substrates" in tables and "aggregate" in tables:
        tables = {"kinetics": {}, **tables}
    text = name.encode(errors="backslashreplace").decode()  # bytes in the name of a file
    numerics = tables.get("numerics", {})
    preset = numerics.get("preset", "fast") if isinstance(numerics, dict) else None
    of_preset = tables
    if isinstance(preset, str) and preset in PRESETS:  # else read_table reports the error
        of_preset = {**tables, "numerics": {"preset": preset, **PRESETS[preset], **numerics}}
    scene = read_table(Scene, of_preset, Place(file, known=KEYS), name=text,
                       units=units_of(tables))
    if scheme is not None and scheme != scene.numerics.scheme:
        scene = replace(scene, numerics=replace(scene.numerics, exchanged=scheme))
    scene = _with_files(scene, file)
    for broken, requirement in rules(scene):
        if broken:
            key = _to_name(list(requirement), tables, changed)
            value = _at(tables, key, _at(scene_tables(scene), key, MISSING))
            raise Place(file, key).refuse(value, requirement[key])
    if scene.flow is None or scene.flow.rate is None:
        return scene
    area = scene.pore.whole_width * scene.pore.depth
    rate = scene.flow.rate
    velocity = rate / area if not isinstance(rate, TimeTable) else replace(
        rate, values=tuple(value / area for value in rate.values))
    return replace(scene, flow=replace(scene.flow, mean_velocity=velocity))


def _with_files(scene: Scene, file: str) -> Scene:
    """Read the outlines that are files. Raises SceneError, naming the scene's ``file``."""
    seeds = list(scene.aggregates)
    for k, (key, seed) in enumerate(zip(scene.aggregate_keys, seeds)):
        if isinstance(seed.outline, Drawn):
            from repro.scene.drawn import points_of  # a scene without files does not load it

            try:
                points = points_of(seed.outline, seed.wall, scene.pore.width)
            except Refused as error:
                outline = Place(file, f"{key}.outline")
                raise outline.refuse(asdict(seed.outline), str(error)) from None
            seeds[k] = replace(seed, outline=points)
    return replace(scene, aggregates=tuple(seeds))


def _to_name(keys: list[str], tables: dict, changed: Sequence[str]) -> str:
    """Choose the contradicting key to name: the first changed one, else the first in a table."""
    changed = [bodies.canonical(tables, key) for key in changed]
    for key in keys:
        if any(_within(key, other) or _within(other, key) for other in changed):
            return key
    return next((key for key in keys if _at(tables, key, MISSING) is not MISSING), keys[0])


def _within(key: str, section: str) -> bool:
    return f"{key}.".startswith(f"{section}.")


def _as_given(scene: Scene) -> Scene:
    """Return the scene without the mean velocity of its flow rate."""
    if scene.flow is None or scene.flow.rate is None:
        return scene
    return replace(scene, flow=replace(scene.flow, mean_velocity=None))


def scene_tables(scene: Scene) -> dict:
    """Write the scene as TOML tables with all defaults, in the units of its text.

    `parse_scene` reads them back as an equal scene, bit by bit.
    """
    return write_table(_as_given(scene), scene.units)


def scene_hash(scene: Scene) -> str:
    """Hash (16 hexadecimal digits) of all values of a scene, without its name.

    A key of `LATER` counts if it differs from its default, and a scene counts as earlier versions
    wrote it, so that recorded hashes stay valid. A scheme counts if it is not that of the preset.
    """
    written = with_former(write_table(_as_given(scene)))
    tables = {key: _without_later(key, table) for key, table in written.items()}
    if scene.numerics.exchanged is not None:
        tables["scheme"] = asdict(scene.numerics.exchanged)
    canonical = json.dumps(tables, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def _without_later(section: str, table: Any) -> Any:
    """Remove the keys of `LATER` that have their default from the table or tables of a section."""
    if isinstance(table, list):
        return [_without_later(section, each) for each in table]
    later = LATER.get(section, {})
    return {key: _without_later(f"{section}.{key}", value) if isinstance(value, dict) else value
            for key, value in table.items() if key not in later or value != later[key]}


def _at(tables: dict, key: str, default: object) -> object:
    """Return the value at a dotted key."""
    for part in bodies.path_of(tables, key):
        if not isinstance(part, int) and part not in tables:
            return default
        tables = tables[part]
    return tables
