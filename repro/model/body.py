"""One aggregate of a pore: its contact, its biomass, its expansion and its reference.

All aggregates of a pore share one mesh. The positions of nodes and the pressure are fields on this
mesh, not data of a body. The nodes, triangles and loop of a body are those of its region
(:class:`repro.fem.mesh.Region`). A pore's list of bodies and its mesh's list of regions have the
same order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.fem.brief import brief
from repro.fem.walls import FREE, Seat
from repro.model.configuration import FromStart, ReferenceConfiguration
from repro.model.solid import Solid


@brief
@dataclass(frozen=True, eq=False)
class Body:
    """One aggregate at one time.

    wall: (M,) number of the wall that each node of its loop touches or of its weld, or FREE; fixed:
    (M,) True where x is constrained; active, inert: X_A, X_I, (r, q) um2 mg/L at its points of the
    reaction; theta: (t, q) expansion since t = 0 in its triangles; solid: the aggregate at t = 0;
    configuration: the one from which strain counts; line_speeds: (2, 2, 2) um/h, speeds of the
    contact lines in the first and the second half of the last step, None if unknown. Each row is
    one wall, the lower wall first. Its first line is where a free surface begins along the loop,
    its second line where a free surface ends. seat: position of its seed; name: in messages.
    origin_known: False after present positions have replaced positions at t = 0 that fold. This
    happens only if strain does not count from t = 0.
    """

    wall: np.ndarray
    fixed: np.ndarray
    active: np.ndarray
    inert: np.ndarray
    theta: np.ndarray
    solid: Solid
    configuration: ReferenceConfiguration = FromStart()
    line_speeds: np.ndarray | None = None
    origin_known: bool = True
    seat: Seat = Seat()
    name: str = "1"

    @property
    def reference(self) -> np.ndarray:
        """(n, 2) um, positions of its nodes at t = 0."""
        return self.solid.reference

    @property
    def unstrained(self) -> np.ndarray:
        """(n, 2) um, positions of its nodes in the configuration from which strain counts."""
        return self.configuration.unstrained(self.solid)

    @property
    def strained(self) -> tuple[Solid, np.ndarray]:
        """The aggregate in the configuration from which strain counts, and the expansion (t, q)
        since then."""
        return self.configuration.strained(self.solid, self.theta)

    @property
    def mass(self) -> float:
        """X_A + X_I, integrated over the aggregate, um2 mg/L."""
        return float(self.active.sum() + self.inert.sum())

    @property
    def spans(self) -> bool:
        """Does it touch both walls, or the wall of its seed and another aggregate?"""
        return bool(np.ptp(self.wall[self.wall != FREE]) > 0)
