"""Draw permeability.png: K / K0 of `wide` in pores of two lengths, of a layer, and of laws of the Darcy scale.

Run it from the top of the repository. It takes about two minutes.
"""
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import repro
from reference import layered_channel

axes = plt.figure(figsize=(6.4, 4.4), layout="constrained").add_subplot()
for length, colour in ((600, "C0"), (1200, "C1")):
    results = repro.solve("wide", {"numerics.preset": "fast", "pore.length": f"{length} um"})
    permeability = results.permeability()
    print(f"{length} um: {permeability}\n")
    biomass = permeability.columns["biomass_per_pore_volume"]
    label = f"one aggregate in {length} um of pore"
    axes.semilogy(biomass, permeability.columns["relative_permeability"], ".", color=colour, label=label)
    axes.semilogy(biomass, permeability.columns["vandevivere"], color=colour, lw=1, label="Vandevivere, fitted to it")
share = np.linspace(0, 0.6, 200)
layer = [12 / layered_channel.gradient(1.0, part, 2000.0) for part in share]
axes.semilogy(share, layer, "k", label="uniform layer on one wall")
axes.semilogy(share, permeability.fits["clement"].relative(share), "k--", label="Clement et al.")
axes.set(xlabel="biomass per pore volume", ylabel="K / K0", xlim=(0, 0.6), ylim=(5e-4, 1.5))
axes.legend(frameon=False, fontsize="small", loc=(0.47, 0.34))
axes.grid(alpha=0.3)
axes.figure.savefig(Path(__file__).with_suffix(".png"), dpi=130)
