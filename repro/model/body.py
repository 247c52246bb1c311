"""One aggregate of a pore: its contact, its biomass, its expansion and its reference.

Places of nodes and pressures are fields of the mesh, which a pore has once. The aggregate's nodes,
triangles and loop are those of its region in the mesh (:class:`repro.fem.mesh.Region`). Both lists
have the same order.
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

    wall: (M,) contact of each node of its loop; fixed: (M,) its x is constrained; active, inert:
    X_A, X_I, (r, q) um2 mg/L at its points of the reaction; theta: (t, q) expansion since t = 0 in
    its triangles; solid: the aggregate as it was at t = 0; configuration: from which strain counts;
    line_speeds: (2, 2) um/h, speeds of the contact lines, None if unknown. A row has the lines of
    one wall, the lower wall first: the line where a free surface begins along the loop, then the
    line where one ends. seat: where its seed sat; name: in messages. origin_known: False once
    present places have replaced places at t = 0 that fold. This happens only if strain does not
    count from t = 0.
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
        """(n, 2) um, its nodes in the shape from which strain counts."""
        return self.configuration.unstrained(self.solid)

    @property
    def strained(self) -> tuple[Solid, np.ndarray]:
        """The aggregate in that shape, and its expansion (t, q) since then."""
        return self.configuration.strained(self.solid, self.theta)

    @property
    def mass(self) -> float:
        """X_A + X_I, integrated over the aggregate, um2 mg/L."""
        return float(self.active.sum() + self.inert.sum())

    @property
    def spans(self) -> bool:
        """Does it touch both walls, or its own one and another aggregate?"""
        return bool(np.ptp(self.wall[self.wall != FREE]) > 0)
