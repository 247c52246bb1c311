"""The inputs of base and wide: those that Table 1 prints with so many digits, and those that are taken as exact."""

from __future__ import annotations

from dataclasses import dataclass, replace

from repro.scene import Scene, needed


@dataclass(frozen=True)
class Input:
    """name: as the paper has it; paths: keys of the scene that go with it, in proportion; value: as printed; half: half
    a unit of its last digit, zero where it is taken as exact; only: the scene it belongs to, where not to both."""

    name: str
    paths: tuple[str, ...]
    value: float
    half: float = 0.0
    only: str = ""

    @property
    def rounding(self) -> float:
        """The half unit over the value."""
        return self.half / self.value


def _of(substrate: str, *keys: str) -> tuple[str, ...]:
    return tuple(f"substrates.{substrate}.{key}" for key in keys)


#: The supply is printed as 10 K_s, and goes with K_s.
ROUNDED = (
    Input("k", ("kinetics.maximum_utilization_rate",), 9.3, 0.05),
    Input("Y", ("kinetics.yield_coefficient",), 0.61, 0.005),
    Input("b", ("kinetics.decay_coefficient",), 0.12, 0.005),
    Input("f_d", ("kinetics.degradable_fraction",), 0.8, 0.05),
    Input("d_c", ("kinetics.decay_oxygen_demand",), 1.42, 0.005),
    Input("F", ("kinetics.acceptor_to_donor_ratio",), 1.52, 0.005),
    Input("K_sA", _of("acceptor", "half_saturation", "supply"), 1.0, 0.05),
    Input("K_sD", _of("donor", "half_saturation", "supply"), 1.0, 0.05),
    Input("D_a", _of("acceptor", "diffusivity"), 2.32, 0.005),
    Input("D_fa", _of("acceptor", "diffusivity_in_aggregate"), 1.85, 0.005),
    Input("D_d", _of("donor", "diffusivity"), 1.01, 0.005),
    Input("D_fd", _of("donor", "diffusivity_in_aggregate"), 0.81, 0.005),
)
EXACT = (
    Input("X_m", ("kinetics.maximum_density",), 30000.0),
    Input("R_0", ("aggregate.radius",), 5.0),
    Input("W_pore", ("pore.width",), 50.0),
    Input("L_pore", ("pore.length",), 600.0),
    Input("head", ("flow.head",), 1e-3, only="base"),
    Input("u_ave", ("flow.mean_velocity",), 2.9, only="wide"),
    Input("supply of acceptor", _of("acceptor", "supply"), 10.0),
    Input("supply of donor", _of("donor", "supply"), 10.0),
    Input("lambda", ("flow.viscosity_ratio",), 2000.0),
    Input("mu_L", ("growth.shear_modulus",), 0.01),
    Input("film", ("growth.minimum_film",), 2.0),
    Input("contact angle", ("growth.minimum_contact_angle",), 16.7),
    Input("time step", ("growth.time_step",), 12.0),
)
INPUTS = ROUNDED + EXACT
BY_NAME = {each.name: each for each in INPUTS}


def changed(said: Scene, factors: dict[str, float]) -> Scene:
    """A scene with some inputs, by name, times factors."""
    for name, factor in factors.items():
        for path in BY_NAME[name].paths:
            said = _scaled(said, path.split("."), factor)
    return said


def _scaled(node, keys: list[str], factor: float):
    first, *rest = keys
    part = needed(getattr(node, first), ".".join(keys))
    return replace(node, **{first: _scaled(part, rest, factor) if rest else factor * part})


def factors_of(values: dict[str, float]) -> dict[str, float]:
    """Values of inputs, in the paper's units, over those printed."""
    return {name: value / BY_NAME[name].value for name, value in values.items()}
