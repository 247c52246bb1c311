"""Scenes: their keys and units, and how a file is read, checked and written.

    keys        dataclasses of a scene: default, unit, range and source of every key
    units       quantities with units
    time_table  values over time
    exact       the units that scenes use, as exact fractions
    bodies      the aggregates of a scene by name or number
    former      keys and choices of earlier versions
    reading     conversion of TOML tables to dataclasses and back
    rules       constraints between keys
    needed      optional sections that a stage requires
    files       TOML files, packaged scenes, ``--set``
    text        a scene as a TOML text that explains every key
    packaged    the packaged scenes
"""

from repro.scene.files import packaged_scenes
from repro.scene.former import without_former
from repro.scene.keys import (
    FINER,
    KEYS,
    NOT_IN_PAPER,
    PRESETS,
    Acceptor,
    Aggregate,
    Donor,
    Erosion,
    Flow,
    Growth,
    Kinetics,
    Numerics,
    Output,
    Pore,
    Scene,
    Source,
    Substrate,
    Substrates,
    label,
    load_scene,
    load_tables,
    parse_scene,
    scene_hash,
    scene_tables,
)
from repro.scene.needed import MissingError, needed
from repro.scene.time_table import TimeTables, at_largest, at_time
from repro.scene.units import SceneError, Stated
