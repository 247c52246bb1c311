# %% [markdown]
# # A sweep and its table
#
# A sweep runs a scene with several values of its keys on all cores. An interrupted sweep continues where it stopped.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import pandas

import repro

folder = Path(tempfile.mkdtemp()) / "sweep"
vary = ["flow.head=0.5e-3 cm, 1e-3 cm, 2e-3 cm", "pore.width=40 um, 60 um"]
swept = repro.sweep("base", vary, folder, ['numerics.preset="fast"', 'growth.end="12 h"'])
print(len(swept.runs), "runs,", len(swept.failed), "failed")

# %% [markdown]
# `runs.csv` has a row for each run with the values at its end, and `table.csv` a row for each run and time. A few
# columns of `runs.csv`:

# %%
columns = ["flow.head_cm", "pore.width_um", "conductivity_m_per_d", "effluent_acceptor_mg_per_L"]
print(pandas.read_csv(folder / "runs.csv")[columns].to_string(index=False))

# %% [markdown]
# A higher head supplies more of the acceptor, so a smaller share of it is consumed. The conductivity hardly depends on
# the head.

# %% mystnb={"image": {"alt": "effluent acceptor of six runs against time"}}
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
for run, path in zip(swept.runs, swept.paths):
    repro.load_run(path).plot("effluent_acceptor", ax=axes)
    axes.lines[-1].set_label(swept.label(run))
axes.set_title("", loc="left")
axes.legend(fontsize="small")
plt.show()
assert not swept.failed
