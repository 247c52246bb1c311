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
# Conductivity falls because the film above the aggregate becomes thin. `plot` draws it with the thickness and the
# effluents. Both substrates stay above their half-saturation of 1 mg/L, so uptake is fast in the complete aggregate.

# %% mystnb={"image": {"alt": "conductivity, thickness and effluents of base against time"}}
results.plot()
plt.show()

# %% [markdown]
# The fields of a time are NumPy arrays over the mesh. Their names end with their units.

# %%
fields = results.fields(results.time[-1])
x = fields["places_um"][:, 0]
acceptor = fields["acceptor_mg_per_L"]
print(f"least acceptor: {acceptor.min():.2g} mg/L at x = {x[acceptor.argmin()]:.0f} um")
assert acceptor.min() > 1

# %% [markdown]
# With the name of a field, `plot` draws the field over the pore at a reported time, and `results.animate` makes a film
# of all times.

# %% mystnb={"image": {"alt": "the acceptor in the pore at 15.2 h, with the outline of the aggregate"}}
results.plot("acceptor", time=15.2)
plt.show()
