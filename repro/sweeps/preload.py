"""What the process imports that forks a process for each run, and what each run looks for on the
disk."""

import gc

from repro import results
from repro.runs.machine import conditions
from repro.scene import load_scene
from repro.sweeps import task

results.provenance(load_scene("flow_only"))
conditions()
gc.freeze()  # the collector passes over what is imported, so that no process copies it

__all__ = ["task"]
