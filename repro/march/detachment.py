"""Detachment of the aggregate (section 5): an end of the model, not a failure.

See :mod:`repro.model.adhesion`. Each step tests the state at its end. The run ends with a
detachment, because the model has no law for detached pieces.
"""

from __future__ import annotations

from repro.errors import RunEnd
from repro.model import adhesion
from repro.model.adhesion import Peak
from repro.model.pore import Pore, Solved
from repro.scene import Scene, scene_tables


class Detachment(RunEnd):
    """The aggregate detaches from a wall, or tears.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure: the message names the time (h), the place (um), the stress there and the strength that
    it exceeds. It needs ``growth.bonding_strength`` or ``growth.tensile_strength``.

    Examples
    --------
    >>> import repro
    >>> changes = ["growth.wall=bonded", 'growth.bonding_strength="1 kPa"', "numerics.preset=fast"]
    >>> reports = repro.simulate(repro.load_scene("base", changes))
    >>> try:
    ...     times = [report.pore.time for report in reports]
    ... except repro.Detachment as end:
    ...     print(str(end)[:25])
    the aggregate detaches at
    """


def detachment(scene: Scene, pore: Pore, solved: Solved) -> Detachment | None:
    """Detachment of a pore at the end of a step; None if no strength is exceeded."""
    growth = scene.growing.growth
    if growth.bonding_strength is not None:
        peak = adhesion.wall_peak(scene, pore, solved)
        if peak.value > growth.bonding_strength:
            return _ended(scene, pore, "detaches", peak, "its wall must bear", "bonding_strength")
    if growth.tensile_strength is not None:
        peak = adhesion.tensile_peak(scene, pore)
        if peak.value > growth.tensile_strength:
            return _ended(scene, pore, "tears", peak, "its tensile stress is", "tensile_strength")
    return None


def _ended(scene: Scene, pore: Pore, verb: str, peak: Peak, subject: str, key: str) -> Detachment:
    """The end of a run; the message has the stress in the unit of the strength in the scene."""
    strength = scene_tables(scene)["growth"][key]
    number, _, unit = strength.partition(" ")
    stress = peak.value / getattr(scene.growing.growth, key) * float(number)
    return Detachment(f"the aggregate {verb} at t = {pore.time:g} h: near x = {peak.x:.4g}, y = "
                      f"{peak.y:.4g} um {subject} {stress:.3g} {unit}, in the mean over "
                      f"pore.width / 20; growth.{key} is {strength}")
