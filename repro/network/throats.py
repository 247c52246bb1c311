"""The public laws for networks: of Table 1's kinetics, or of those of a scene."""

import numpy as np
from numpy.typing import ArrayLike

from repro.network import resistance, uptakes
from repro.network.resistance import AddedResistance
from repro.network.uptakes import Uptake
from repro.scene import Source, load_scene
from repro.scene.keys import LAMBDA


def added_resistance(area: ArrayLike, width: ArrayLike, spanned: ArrayLike | None = None,
                     viscosity_ratio: float | None = None, *, outside: str = "raise",
                     scene: Source | None = None, progress: bool = False) -> AddedResistance:
    """Resistance that aggregates add to pores, as a length of empty pore over W.

    Parameters
    ----------
    area : array_like
        Areas of the aggregates, in any unit of area and of any shape; zero in an empty pore.
    width : array_like
        Widths of the pores, in the square root of that unit. Its shape broadcasts with the areas.
    spanned : array_like of bool, optional
        True if the aggregate touches both walls. Its shape broadcasts with the areas. By default
        the area decides: an aggregate of more than 1.51 width^2 touches both walls. From 1.41 to
        1.6 width^2 the bounds then include shapes with contact and without it.
    viscosity_ratio : float, optional
        Viscosity of the aggregates over that of water, lambda, without unit: 2000 by default, or
        that of the scene.
    outside : {"raise", "nan"}
        A pore outside the law's range raises an error with its index, or its results are
        not-a-number.
    scene : Scene, str, path or dict, optional
        A scene whose lambda and whose grown shapes count: r follows the shapes of its run, and the
        bounds include those with it and those without. The first call for a scene computes its
        table, as for :func:`uptake`.
    progress : bool, optional
        Show a bar while the table is computed, by ``tqdm.auto``.

    Returns
    -------
    AddedResistance
        Arrays of the broadcast shape, without unit.

    Raises
    ------
    ValueError
        If a width is not positive, or area / width^2 or viscosity_ratio is outside the law's range:
        0 to 1.5 before contact, 1.41 to 4.5 after it, lambda 100 to 10 000. With a scene, also if
        the area exceeds those of :func:`uptake`, or if the law does not hold for the scene.

    Notes
    -----
    The head loss of a pore is 12 nu u_ave / (g W^2) (L + length W), with the viscous aggregate of
    2.1 and the paper's condition on its surface [E2], at least 1.5 W from the pore's ends.

    Examples
    --------
    >>> import repro
    >>> added = repro.added_resistance([0.0, 500.0, 4000.0, 9000.0], 50.0)
    >>> bool((added.least <= added.length).all() and (added.length <= added.most).all())
    True
    """
    shapes, largest, ratio = None, np.inf, LAMBDA
    if scene is not None:
        from repro.network import own  # it solves states: other laws do not need the solver

        laws = own.tabulated(load_scene(scene), progress)
        shapes, largest, ratio = laws.shapes, laws.uptake.share, laws.viscosity_ratio
    ratio = ratio if viscosity_ratio is None else float(viscosity_ratio)
    return resistance.resistance(area, width, spanned, ratio, outside, shapes=shapes,
                                 largest=largest)


def uptake(area: ArrayLike, width: ArrayLike, velocity: ArrayLike,
           acceptor: ArrayLike | None = None, donor: ArrayLike | None = None, *,
           outside: str = "raise", scene: Source | None = None, progress: bool = False) -> Uptake:
    """Uptake of both substrates by aggregates in throats, and the growth that follows from it.

    Parameters
    ----------
    area : array_like
        Areas of the aggregates, um^2, of any shape; zero in an empty throat.
    width : array_like
        Widths of the throats, um. Its shape broadcasts with the areas.
    velocity : array_like
        Mean velocities in the throats, m/d. Its shape broadcasts with the areas.
    acceptor, donor : array_like
        Supplies: concentrations in the water that enters the throats, mg/L. Their shapes broadcast
        with the areas. By default they are those of the scene, at its first time.
    outside : {"raise", "nan"}
        As for :func:`added_resistance`.
    scene : Scene, str, path or dict, optional
        A scene whose kinetics, diffusivities and supplies replace those of Table 1. The first call
        for a scene solves some hundred states, in a minute or two, and keeps the result in the
        user's cache folder, as ``repro network-law`` does. A loaded Scene is faster than a file.
    progress : bool, optional
        Show a bar while the states are solved, by ``tqdm.auto``.

    Returns
    -------
    Uptake
        Arrays of the broadcast shape.

    Raises
    ------
    ValueError
        If a throat is outside the law's range: area / width^2 to 4.5, width 40 to 150 um, velocity
        to 10 m/d, supplies to 20 mg/L. With a scene: area / width^2 to that of the half-discs, or
        of the plugs that the scene grows; width from half to twice that of its pore; supplies to
        its own. Also if no supply is given, or if the law does not hold for the scene.
    SceneError, SimulationError
        If the scene is refused, or if a stage of one of its states fails.

    Notes
    -----
    Without a scene, the kinetics and diffusivities are those of Table 1. X_A = X_m, and profiles
    are steady. The effluent of a throat has the supply less uptake / (velocity width).

    Examples
    --------
    >>> import repro
    >>> taken = repro.uptake([0.0, 500.0, 4000.0], 50.0, 1.0, 8.0, 5.0)
    >>> bool(taken.growth[0] == 0 and (taken.growth[1:] > 0).all())
    True
    """
    law = uptakes.table_1()
    if scene is not None:
        from repro.network import own

        scene = load_scene(scene)
        law = own.tabulated(scene, progress).uptake
        supplied = scene.at(0.0).substrates.modelled.values()
        acceptor, donor = (kind.supply if supply is None else supply
                           for kind, supply in zip(supplied, (acceptor, donor)))
    if acceptor is None or donor is None:
        raise ValueError("uptake: acceptor and donor, or a scene with their supplies, are needed")
    return uptakes.uptake(law, area, width, velocity, acceptor, donor, outside)
