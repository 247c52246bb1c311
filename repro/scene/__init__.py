"""What a scene says: its keys, their units, how a file is read, checked and written.

    keys      the dataclasses of a scene: default, unit, range, source of every key
    units     quantities with units
    course    values over time
    exact     the units that scenes use, as exact fractions
    reading   tables of a TOML file into dataclasses, and back
    rules     what keys ask of each other
    needed    sections that the physics at hand cannot be without
    files     TOML files, packaged scenes, ``--set``
    text      a scene as a TOML text with every key explained
    packaged  the packaged scenes
"""

from repro.scene.files import packaged_scenes
from repro.scene.keys import (
    KEYS,
    OURS,
    PRESETS,
    Acceptor,
    Aggregate,
    Donor,
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
from repro.scene.units import SceneError

__all__ = ["KEYS", "OURS", "PRESETS", "Acceptor", "Aggregate", "Donor", "Flow", "Growth",
           "Kinetics", "MissingError", "Numerics", "Output", "Pore", "Scene", "SceneError",
           "Source", "Substrate", "Substrates", "label", "load_scene", "load_tables", "needed",
           "packaged_scenes", "parse_scene", "scene_hash", "scene_tables"]
