# %% [markdown]
# # The paper's pore
#
# Section 4 of the paper follows one aggregate in a pore of 50 um until it nearly plugs it. The preset `fast` repeats
# that run within a second, with an error of about 1 %.

# %%
import matplotlib.pyplot as plt
import numpy as np

import repro

results = repro.solve("base", ['numerics.preset="fast"'])
print(f"{len(results.time)} rows from {results.time[0]:g} to {results.time[-1]:g} h")

# %% [markdown]
# The paper prints the mean velocity at t = 0 (2.9 m/day) and at 19.4 h (1.5 m/day). Its state "at 19.4 h" has the shape
# of 19.2 h ([E12](../../reference/ERRATA.md)).

# %%
velocity = results["mean_velocity_m_per_d"]
at_19_2_h = np.interp(19.2, results.time, velocity)
print(f"t = 0: {velocity[0]:.2f} m/day; in the shape of 19.2 h: {at_19_2_h:.2f} m/day")
assert round(velocity[0], 1) == 2.9
assert round(at_19_2_h, 1) == 1.5

# %% [markdown]
# Conductivity falls because the film above the aggregate becomes thin. The donor limits growth less than the acceptor,
# which is nearly used up behind the aggregate.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(results.time, results["conductivity_m_per_d"] / results["conductivity_m_per_d"][0])
left.set(xlabel="time (h)", ylabel="conductivity over its first value", ylim=(0, 1.05))
for substrate in ("acceptor", "donor"):
    right.plot(results.time, results[f"effluent_{substrate}_mg_per_L"], label=substrate)
right.set(xlabel="time (h)", ylabel="effluent (mg/L)")
right.legend()
plt.show()

# %% [markdown]
# Fields are NumPy arrays over the mesh of a reported time. The names of the arrays end with their units.

# %%
fields = results.fields(results.time[-1])
x, y = fields["places_um"].T
figure, axes = plt.subplots(figsize=(9, 2.2), layout="constrained")
levels = axes.tricontourf(x, y, fields["triangles"][:, :3], fields["acceptor_mg_per_L"], levels=20)
axes.set(aspect="equal", xlabel="x (um)", ylabel="y (um)")
figure.colorbar(levels, label="acceptor (mg/L)")
plt.show()
