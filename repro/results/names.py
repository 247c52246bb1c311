"""What the columns and arrays of a run's files are called in words, and their units.

A name ends in its unit (``conductivity_m_per_d``, ``aggregate_area_um2``); a name that ends in none
is a pure number.
"""

from __future__ import annotations

import re

#: Endings of names: the unit as UDUNITS (and so CF) writes it, and as a reader does.
ENDINGS = {"_m_per_d": ("m d-1", "m/day"), "_mg_per_L": ("mg L-1", "mg/L"),
           "_pg_per_m": ("pg m-1", "pg/m"), "_um2": ("um2", "um²"), "_um": ("um", "um"),
           "_cm": ("cm", "cm"), "_h": ("h", "h"), "_MPa": ("MPa", "MPa")}

#: Everything that is a pure number.
PURE = {"inert_fraction", "biomass_density_min", "biomass_density_max", "acceptor_balance",
        "donor_balance", "biomass_balance", "oxygen_demand_balance", "nodes", "remeshed", "contact",
        "region", "theta", "J", "active_biomass", "inert_biomass"}

#: Pure numbers that stand for yes (1) and no (0).
YES_NO = {"remeshed", "contact"}

_WORDS = {
    "time_h": "simulated time since the start of the run",
    "mean_velocity_m_per_d": "mean velocity",
    "head_loss_cm": "head loss over the whole pore",
    "conductivity_m_per_d": "hydraulic conductivity of the pore",
    "effluent_acceptor_mg_per_L": "acceptor leaving (flux-averaged)",
    "effluent_donor_mg_per_L": "donor leaving (flux-averaged)",
    "inlet_acceptor_mg_per_L": "acceptor at the inlet of the meshed part",
    "inlet_donor_mg_per_L": "donor at the inlet of the meshed part",
    "aggregate_area_um2": "area of the aggregate",
    "thickness_um": "thickness of the aggregate",
    "upstream_um": "upstream end of the aggregate",
    "downstream_um": "downstream end of the aggregate",
    "meshed_length_um": "length of the meshed part",
    "inert_fraction": "inert part of the biomass",
    "biomass_density_min": "least biomass density over X_m",
    "biomass_density_max": "largest biomass density over X_m",
    "acceptor_min_mg_per_L": "least acceptor concentration",
    "donor_min_mg_per_L": "least donor concentration",
    "acceptor_balance": "relative defect of the acceptor's balance",
    "donor_balance": "relative defect of the donor's balance",
    "biomass_balance": "relative defect of the biomass's balance",
    "oxygen_demand_balance": "biomass made less Y donor - (acceptor - F donor) / d_c, relative",
    "nodes": "nodes of the mesh",
    "remeshed": "mesh made anew",
    "contact": "contact with the opposite wall",
    "velocity_m_per_d": "velocity",
    "head_cm": "head",
    "acceptor_mg_per_L": "acceptor",
    "donor_mg_per_L": "donor",
    "active_biomass": "active biomass over X_m",
    "inert_biomass": "inert biomass over X_m",
    "displacement_um": "displacement since t = 0",
    "position_t0_um": "position at t = 0",
    "pressure_MPa": "pressure P of the aggregate",
    "theta": "expansion theta",
    "J": "volume ratio J",
    "stress_xx_MPa": "stress xx",
    "stress_yy_MPa": "stress yy",
    "stress_zz_MPa": "stress zz",
    "stress_xy_MPa": "stress xy",
    "largest_principal_stress_MPa": "largest principal stress",
    "region": "aggregate (1) or fluid (0)",
}


def words(name: str) -> str:
    """A name in words, without its unit."""
    return _WORDS.get(name) or re.sub("_", " ", name.removesuffix(_ending(name)))


def udunits(name: str) -> str:
    """Its unit as UDUNITS writes it, "1" for a pure number."""
    return ENDINGS.get(_ending(name), ("1", ""))[0]


def unit(name: str) -> str:
    """Its unit as a reader writes it, empty for a pure number."""
    return ENDINGS.get(_ending(name), ("1", ""))[1]


def with_unit(name: str) -> str:
    """Words and unit: "mean velocity (m/day)"."""
    return f"{words(name)} ({unit(name)})" if unit(name) else words(name)


def _ending(name: str) -> str:
    """The ending that is a unit, the longest one; empty where there is none."""
    return max((ending for ending in ENDINGS if name.endswith(ending)), key=len, default="")
