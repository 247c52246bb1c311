# %% [markdown]
# # A sweep and its table
#
# A sweep runs a scene with several values of its keys on all cores. An interrupted sweep continues where it stopped.

# %%
import csv
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import repro

folder = Path(tempfile.mkdtemp()) / "sweep"
swept = repro.sweep("base", ["flow.head=0.5e-3 cm, 1e-3 cm, 2e-3 cm", "pore.width=40 um, 50 um"], folder,
                    ['numerics.preset="fast"', 'growth.end="12 h"'])
print(swept)

# %% [markdown]
# `runs.csv` has a row for each run, and `table.csv` a row for each run and time.

# %%
with (folder / "runs.csv").open() as file:
    rows = list(csv.DictReader(file))
print(", ".join(rows[0]))

# %%
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
for run, path in zip(swept.runs, swept.paths):
    repro.load_run(path).plot("conductivity", ax=axes)
    axes.lines[-1].set_label(swept.label(run))
axes.set(title="", yscale="log")
axes.legend(fontsize="small")
plt.show()
assert not swept.failed
