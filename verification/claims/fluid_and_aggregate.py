"""C26, C35: what the fluid does to the aggregate, and how much of it goes through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from repro.fem.mesh import gradients
from repro.fem.transfer import interpolate
from verification.claims import Finding, at_least, at_most, claim
from verification.claims.levels import WIDE_SIZES
from verification.claims.restored import Body, body, in_plane, stress
from verification.claims.runs import BASE, WIDE, at, scene, series

PLOTTED, UPDATE = 19.2, 0.2
PASCAL = 1e6  # in a MPa
#: "Small against": a tenth.
SMALL = 0.1


def contact_time() -> float:
    """First time (h) at which wide touches the opposite wall."""
    return float(series(*WIDE)["time_h"][series(*WIDE)["contact"] == 1][0])


def last_film() -> float:
    """Last time (h) before that: the shape that still leaves a film."""
    return float(series(*WIDE)["time_h"][series(*WIDE)["contact"] == 0][-1])


@dataclass(frozen=True)
class Forces:
    """In one geometry, in Pa.

    head: range of the fluid's pressure over the interface; shear: largest viscous stress along it; growth: largest
    in-plane shear stress in the aggregate; stiffness: least modulus mu_L J^(-2/3) against a further deformation;
    pressure: largest |P|.
    """

    head: float
    shear: float
    growth: float
    stiffness: float
    pressure: float

    @property
    def against_growth(self) -> float:
        """The fluid's over growth's stress."""
        return (self.head + self.shear) / self.growth

    @property
    def strain(self) -> float:
        """About the strain that the fluid would cause."""
        return (self.head + self.shear) / self.stiffness

    @property
    def told(self) -> str:
        """In words."""
        return (f"range of the fluid's pressure {self.head:.2g}, its shear {self.shear:.2g}, growth's shear "
                f"{self.growth:.3g}, |P| {self.pressure:.3g}, stiffness {self.stiffness:.3g}")


@claim("C26", "2.3.3", "fluid forces are small against the forces of growth", "python -m verification.claims C26",
       (BASE, WIDE), sizes=WIDE_SIZES)
def fluid_forces() -> Finding:
    """Range of rho g phi plus the largest viscous shear on the interface, against growth's shear stress and stiffness.

    From the flow fields. A uniform pressure does nothing to an incompressible body, so its range counts; uniform growth
    causes P but no shear in the plane [E11], so growth's shear stress in the plane is what to compare with; the
    stiffness tells whether the shape would change.
    """
    last, before = float(series(*WIDE)["time_h"][-1]), last_film()
    chosen = {f"{run[0]}, {time:g} h": forces(run, time)
              for run, time in ((BASE, PLOTTED), (WIDE, before), (WIDE, last))}
    checks = [at_most(f"{name}: {what}", "neglected", value, SMALL, "small: a tenth") for name, found in chosen.items()
              for what, value in (("fluid's over growth's stress", found.against_growth),
                                  ("strain that the fluid would cause", found.strain))]
    end = chosen[f"wide, {last:g} h"]
    reason = (f"it holds while a film of fluid is left; then the constant mean velocity is driven through the plug by "
              f"a head of {end.head:.3g} Pa, where growth's shear stress is {end.growth:.3g} Pa and the stiffness has "
              f"fallen as theta^(-2/3) to {end.stiffness:.3g} Pa")
    return Finding(tuple(checks), reason=reason, note=lambda: _told(chosen))


def _told(chosen: dict[str, Forces]) -> str:
    early, hours = forces(BASE, UPDATE), series(*WIDE)["time_h"]
    over = next((f"from {time:g} h on" for time in hours[hours >= contact_time()]
                 if max(forces(WIDE, time).strain, forces(WIDE, time).against_growth) > SMALL), "never")
    return ("In Pa: " + "; ".join(f"{name}: {found.told}" for name, found in chosen.items())
            + f". All of it is small against mu_L = {PASCAL * scene(*BASE).growth.shear_modulus:g} Pa. In base at "
            f"{UPDATE} h, when growth has hardly begun, the first ratio is {early.against_growth:.2g}, but the strain "
            f"{early.strain:.1g}. In wide one of the two exceeds a tenth {over}.")


def forces(run: tuple[str, ...], time: float) -> Forces:
    """Of a run at a time (h)."""
    said, found = scene(*run), body(run, time)
    head, shear = interface_forces(said.flow, found)
    modulus = said.growth.shear_modulus
    return Forces(float(np.ptp(head)), float(np.abs(shear).max()),
                  PASCAL * modulus * float(in_plane(stress(found, modulus)).max()),
                  PASCAL * modulus * float((found.cell("J") ** (-2 / 3)).min()),
                  PASCAL * float(np.abs(found.node("pressure_MPa")).max()))


def interface_forces(drive, found: Body) -> tuple[np.ndarray, np.ndarray]:
    """(e,) fluid pressure rho g phi and viscous shear rho nu n.(grad u + grad u^T).s on each interface edge, Pa."""
    density, gravity = 1e-3 * drive.density, 1e-6 / 3600**2 * drive.gravity  # kg/m3, m/s2
    viscosity = density * 1e-12 / 3600 * drive.kinematic_viscosity  # Pa s
    first, last, beyond = interface(found)
    pressure = density * gravity * 1e-2 * found.node("head_cm")
    velocity = found.node("velocity_m_per_d")[:, :2] / 86400
    slope = np.einsum("tai,tak->tik", velocity[beyond], 1e6 * gradients(found.grid.points, beyond))
    edge = found.grid.points[last] - found.grid.points[first]
    s = edge / np.linalg.norm(edge, axis=1)[:, None]
    n = np.column_stack([s[:, 1], -s[:, 0]])
    shear = viscosity * np.einsum("ei,eik,ek->e", n, slope + np.swapaxes(slope, 1, 2), s)
    return 0.5 * (pressure[first] + pressure[last]), shear


def interface(found: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and last node (e,) of each interface edge, counterclockwise, and the fluid triangle (e, 3) beyond it."""
    loop, chosen = found.grid.loop, found.outline.interface_edges()
    first, last = loop[chosen], np.roll(loop, -1)[chosen]
    beyond = {}
    for triangle in found.grid.triangles[~found.grid.biomass]:
        a, b, c = map(int, triangle)
        beyond |= {(a, b): triangle, (b, c): triangle, (c, a): triangle}
    return first, last, np.array([beyond[int(b), int(a)] for a, b in zip(first, last)])


@claim("C35", "Fig 5", "the fluid flows around the aggregate, through it once it spans the pore",
       "python -m verification.claims C35", (BASE, WIDE), sizes=WIDE_SIZES)
def crossing() -> Finding:
    """Share of the flux that crosses x = 0 inside the aggregate: base at 19.2 h, wide at its contact and its end."""
    first, last = contact_time(), float(series(*WIDE)["time_h"][-1])
    through = "all of it; 5 % for the flux of u through a plug of stabilised linear triangles"
    checks = (at_most("base, 19.2 h: share through the aggregate (%)", "around", inside(BASE, PLOTTED), 5,
                      "all but a few percent"),
              *(at_least(f"wide, {time:g} h: share through the aggregate (%)", "through", inside(WIDE, time), 95,
                         through) for time in (first, last)))
    hours = series(*WIDE)["time_h"]
    half = next(float(time) for time in hours[hours > first - 3] if inside(WIDE, float(time)) > 50)
    film = scene(*WIDE).pore.width - at(WIDE, half)["thickness_um"]
    return Finding(checks, note="It does not wait for contact, since lambda is finite: in wide more than half of the "
                   f"flux crosses the aggregate from {half:g} h on, when a film of {film:.1f} um is left, and "
                   f"{inside(WIDE, last_film()):.2g} % in the last shape that leaves one.")


def inside(run: tuple[str, ...], time: float) -> float:
    """Flux of u_x over the part of x = 0 that is in the aggregate, in percent of u_ave W."""
    found, mean, parts = body(run, time), at(run, time)["mean_velocity_m_per_d"], 1000
    line = shapely.LineString([(0.0, -1.0), (0.0, found.grid.width + 1.0)])
    height = shapely.intersection(shapely.Polygon(found.outline.points), line).length
    y = (np.arange(parts) + 0.5) / parts * height
    speed = interpolate(found.grid.points, found.triangles, found.node("velocity_m_per_d")[:, :1],
                        np.column_stack([np.zeros(parts), y]))
    return 100 * float(speed.mean() * height) / (mean * found.grid.width)
