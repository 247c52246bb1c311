# %% [markdown]
# # A network of pores
#
# `added_resistance` returns the resistance that an aggregate adds to a throat of a pore network, as a length of empty
# throat. [A law for networks](../network.md) describes its basis and range.
#
# This example has a square lattice of throats with random widths. Aggregates grow in a tenth of them, and the network
# loses conductance.

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

import repro

rng = np.random.default_rng(2001)
SIDE = 12
nodes = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
throats = np.vstack([
    np.column_stack([nodes[:, :-1].ravel(), nodes[:, 1:].ravel()]),
    np.column_stack([nodes[:-1].ravel(), nodes[1:].ravel()]),
])
width = rng.uniform(40, 80, len(throats))          # um
LENGTH = 600.0                                     # um
seeded = rng.random(len(throats)) < 0.1


# %%
def conductance_of(area: np.ndarray) -> np.ndarray:
    """(K,) um, conductance of throats with aggregates of an area (um^2), over g / (12 nu)."""
    length = np.full(len(throats), LENGTH)
    grown = area > 0
    added = repro.added_resistance(area[grown], width[grown], spanned=np.zeros(grown.sum(), bool),
                                   viscosity_ratio=2000)
    length[grown] += added.length * width[grown]
    return width**3 / length


def flow_through(conductance: np.ndarray) -> float:
    """The flow between left and right side of the lattice at a unit difference of head."""
    first, second = throats.T
    rows = np.concatenate([first, second, first, second])
    columns = np.concatenate([first, second, second, first])
    values = np.concatenate([conductance, conductance, -conductance, -conductance])
    matrix = coo_array((values, (rows, columns)), shape=(nodes.size, nodes.size)).tocsr()
    head = np.zeros(nodes.size)
    head[nodes[:, 0]] = 1.0
    free = nodes[:, 1:-1].ravel()
    head[free] = spsolve(matrix[free][:, free].tocsc(), -(matrix @ head)[free])
    return float((matrix @ head)[nodes[:, 0]].sum())


# %% mystnb={"image": {"alt": "flow through the network, which falls as the aggregates grow"}}
clean = flow_through(conductance_of(np.zeros(len(throats))))
shares = np.linspace(0.01, 1.5, 30)                # area over width^2, before contact
flows = np.array([flow_through(conductance_of(np.where(seeded, share * width**2, 0.0))) for share in shares])

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(shares, flows / clean)
axes.set(xlabel="area of each aggregate over width squared", ylabel="flow over that of the clean network")
plt.show()
assert (np.diff(flows) < 0).all()
