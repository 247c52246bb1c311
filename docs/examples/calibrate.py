# %% [markdown]
# # Calibrate a parameter to a measured curve
#
# The measured curve here is made data: a run with a known utilization rate k, and noise of 1 % on its conductivity.
# SciPy estimates k from this curve. The true value must lie in the interval.

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

import repro

TRUE_RATE = 9.3                    # 1/day
TIMES = np.arange(2.0, 17.0, 2.0)  # h
NOISE = 0.01
SCENE = ["numerics.preset=fast", 'growth.end="16 h"', f'output.times={[f"{time:g} h" for time in TIMES]}']


# %%
def conductivity(rate: float) -> np.ndarray:
    """(T,) m/day, the conductivity of base at TIMES with a utilization rate (1/day)."""
    results = repro.solve("base", [*SCENE, f'kinetics.maximum_utilization_rate="{rate!r} 1/day"'])
    return np.interp(TIMES, results.time, results["conductivity_m_per_d"])


rng = np.random.default_rng(2001)
measured = conductivity(TRUE_RATE) * (1 + NOISE * rng.standard_normal(len(TIMES)))

# %% [markdown]
# The residuals are differences of logarithms, over the noise. Their Jacobian comes from finite differences with a step
# far above the error between two runs. It gives the standard error of k.

# %%
def residuals(rate: np.ndarray) -> np.ndarray:
    """Differences of the logarithms, over the noise."""
    return np.log(conductivity(float(rate[0])) / measured) / NOISE


fit = least_squares(residuals, [8.0], diff_step=0.01)
error = float(np.linalg.inv(fit.jac.T @ fit.jac)[0, 0] ** 0.5)
low, high = fit.x[0] - 2 * error, fit.x[0] + 2 * error
print(f"k = {fit.x[0]:.3f} 1/day, between {low:.3f} and {high:.3f} (two standard errors), after {fit.nfev} fits")
assert low < TRUE_RATE < high

# %% mystnb={"image": {"alt": "made data and the fitted curve of conductivity against time"}}
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(TIMES, measured, "k.", label="made data")
axes.plot(TIMES, conductivity(float(fit.x[0])), label=f"k = {fit.x[0]:.2f} 1/day")
axes.set(xlabel="time (h)", ylabel="conductivity (m/day)")
axes.legend()
plt.show()
