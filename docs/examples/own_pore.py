# %% [markdown]
# # A pore of your own, with a supply that stops
#
# A scene is a TOML file or a dict. Each section that is present switches its physics on. Here the supply of the
# acceptor stops after 12 h: a table of times and values takes the place of a value.

# %%
import matplotlib.pyplot as plt

import repro

scene = repro.load_scene({
    "pore": {"width": "40 um", "length": "400 um"},
    "aggregate": {"radius": "6 um"},
    "flow": {"mean_velocity": "2 m/day"},
    "substrates": {
        "acceptor": {"supply": [["0 h", "8 mg/L"], ["12 h", "0.1 mg/L"]]},
        "donor": {"supply": "6 mg/L"},
    },
    "growth": {"end": "20 h"},
})

# %% [markdown]
# `check` predicts the model, the mesh and the cost, and warns if a simplification does not hold.

# %%
print(repro.check(scene))

# %%
results = repro.solve(scene)
area = results["aggregate_area_um2"]
print(f"area: {area[0]:.0f} um2 at t = 0, {area[-1]:.0f} um2 at {results.time[-1]:g} h")

# %% [markdown]
# Growth nearly stops with the supply.

# %% mystnb={"image": {"alt": "area of the aggregate against time; growth nearly stops at 12 h"}}
axes = results.plot("aggregate_area")
axes.axvline(12, linestyle=":", color="gray")
plt.show()

before = results.time <= 12
growth_before = area[before][-1] / area[before][0]
growth_after = area[-1] / area[before][-1]
print(f"growth by a factor of {growth_before:.2f} in the first 12 h and of {growth_after:.3f} in the last 8 h")
assert growth_after < 1.2 < growth_before
