"""C26, C35: what the fluid does to the aggregate, and how much of it goes through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from repro.fem.mesh import gradients
from repro.fem.transfer import interpolate
from verification.claims import Finding, at_least, at_most, claim
from verification.claims.levels import WIDE_FINE
from verification.claims.restored import Body, bodies, body, body_of, in_plane, polygon, stress
from verification.claims.runs import BASE, WIDE, history, scene

PLOTTED, UPDATE = 19.2, 0.2
PASCAL = 1e6  # in a MPa
#: "Small against": a tenth.
SMALL = 0.1


def touching() -> tuple[Body, Body]:
    """Wide's last state that leaves a film to the opposite wall, and its first in contact."""
    found = history(*WIDE)
    return tuple(body_of(found.scene, each) for each in found.contact)


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


@claim("C26", "2.3.3", "fluid forces are small against the forces of growth", fine=WIDE_FINE)
def fluid_forces() -> Finding:
    """Range of rho g phi plus the largest viscous shear on the interface, against growth's shear stress and stiffness.

    From the flow fields. A uniform pressure does nothing to an incompressible body, so its range counts; uniform growth
    causes P but no shear in the plane [E11], so growth's shear stress in the plane is what to compare with; the
    stiffness tells whether the shape would change.
    """
    film, end = touching()[0], bodies(WIDE)[-1]
    chosen = {"base, 19.2 h": forces(body(BASE, PLOTTED)), f"wide, {film.pore.time:.2f} h, a film left": forces(film),
              f"wide, {end.pore.time:g} h, a plug": forces(end)}
    checks = [at_most(f"{name}: {what}", "neglected", value, SMALL, "small: a tenth") for name, found in chosen.items()
              for what, value in (("fluid's over growth's stress", found.against_growth),
                                  ("strain that the fluid would cause", found.strain))]
    last = list(chosen.values())[-1]
    reason = (f"it holds in base, and in wide while a film of fluid is left; then the constant mean velocity is driven "
              f"through the plug by a head of {last.head:.3g} Pa, where growth's shear stress is {last.growth:.3g} Pa "
              f"and the stiffness has fallen as theta^(-2/3) to {last.stiffness:.3g} Pa")
    return Finding(tuple(checks), reason=reason, note=lambda: _told(chosen))


def _told(chosen: dict[str, Forces]) -> str:
    early, touched = forces(body(BASE, UPDATE)), touching()[1].pore.time
    over = next((f"from {each.pore.time:g} h on" for each in bodies(WIDE) if each.pore.time >= touched
                 and max(forces(each).strain, forces(each).against_growth) > SMALL), "never")
    return ("In Pa: " + "; ".join(f"{name}: {found.told}" for name, found in chosen.items())
            + f". All of it is small against mu_L = {PASCAL * scene(*BASE).growth.shear_modulus:g} Pa. In base at "
            f"{UPDATE} h, when growth has hardly begun, the first ratio is {early.against_growth:.2g}, but the strain "
            f"{early.strain:.1g}. In wide, in whole hours, one of the two exceeds a tenth {over}.")


def forces(found: Body) -> Forces:
    """Of an aggregate."""
    head, shear = interface_forces(found.scene.flow, found)
    modulus = found.scene.growth.shear_modulus
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
    """First and last corner (e,) of each interface edge, counterclockwise, and the corners (e, 3) of the fluid triangle
    beyond it."""
    loop, chosen = found.grid.straight.loop, found.outline.corners.interface_edges()
    first, last = loop[chosen], np.roll(loop, -1)[chosen]
    beyond = {}
    for triangle in found.grid.triangles[~found.grid.biomass]:
        a, b, c = map(int, triangle)
        beyond |= {(a, b): triangle, (b, c): triangle, (c, a): triangle}
    return first, last, np.array([beyond[int(b), int(a)] for a, b in zip(first, last)])


@claim("C35", "Fig 5", "the fluid flows around the aggregate, through it once it spans the pore", fine=WIDE_FINE)
def crossing() -> Finding:
    """Share of the flux that crosses x = 0 inside the aggregate: base at 19.2 h, wide at its contact and its end."""
    film, touched = touching()
    last = bodies(WIDE)[-1]
    through = "all of it; 5 % for the flux of u through a plug of stabilised linear triangles"
    checks = (at_most("base, 19.2 h: share through the aggregate (%)", "around", inside(body(BASE, PLOTTED)), 5,
                      "all but a few percent"),
              *(at_least(f"wide, {each.pore.time:.2f} h: share through the aggregate (%)", "through", inside(each), 95,
                         through) for each in (touched, last)))
    half = next(each for each in bodies(WIDE) if each.pore.time > touched.pore.time - 5 and inside(each) > 50)
    left = half.grid.width - half.outline.thickness
    return Finding(checks, note="It does not wait for contact, since lambda is finite: in wide, in whole hours, more "
                   f"than half of the flux crosses the aggregate from {half.pore.time:g} h on, when a film of "
                   f"{max(left, 0.0):.1f} um is left, and {inside(film):.2g} % in the last shape that leaves one.",
                   reason="at contact some of the flux still goes beside it")


def inside(found: Body) -> float:
    """Flux of u_x over the part of x = 0 that is in the aggregate, in percent of u_ave W."""
    mean, parts = found.solved.flow.mean_velocity * 24e-6, 1000
    line = shapely.LineString([(0.0, -1.0), (0.0, found.grid.width + 1.0)])
    height = shapely.intersection(polygon(found.outline), line).length
    y = (np.arange(parts) + 0.5) / parts * height
    speed = interpolate(found.grid.points, found.triangles, found.node("velocity_m_per_d")[:, :1],
                        np.column_stack([np.zeros(parts), y]))
    return 100 * float(speed.mean() * height) / (mean * found.grid.width)
