"""Imports and disk accesses that all runs of a sweep share.

The server that forks the process of each run imports this module.
"""

import gc

import meshio

from repro import results
from repro.runs.machine import conditions
from repro.scene import load_scene
from repro.sweeps import single_run

results.provenance(load_scene("flow_only"))
conditions()
gc.freeze()  # the collector skips imported objects, so that no process copies them

__all__ = ["meshio", "single_run"]
