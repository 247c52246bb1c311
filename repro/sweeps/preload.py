"""The imports and the look-ups on the disk that all runs of a sweep share.

The process that forks a process for each run imports this module.
"""

import gc

import meshio

from repro import results
from repro.runs.machine import conditions
from repro.scene import load_scene
from repro.sweeps import task

results.provenance(load_scene("flow_only"))
conditions()
gc.freeze()  # the collector passes over what is imported, so that no process copies it

__all__ = ["meshio", "task"]
