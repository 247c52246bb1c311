"""The choices that a scene can name: what the paper does, what else may be done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """choice: what is chosen; default, alternative: in words; changes: KEY=VALUE of the alternative; state: can both
    be compared in one state; meshes: are the default's meshes good for both; note: what the reader must know."""

    choice: str
    default: str
    alternative: str
    changes: tuple[str, ...]
    state: bool = True
    note: str = ""
    meshes: bool = True


F_EXACT = "COD - Y d_c = 2.38 - 0.61 x 1.42; Table 1 prints 1.52 [E1]"
CHOICES = (
    Choice("transport in time", "quasi-steady", "transient (Gear)", ('numerics.transport="gear"',), True, "3.3"),
    Choice("extent", "central part (3.1)", "full pore", ('numerics.extent="full"',), False,
           "the inlet and the outlet 1.5 W away or less, against the pore's ends; on two meshes", False),
    Choice("interface", "Laplacian form", "traction form", ('numerics.interface="traction"',), True, "[E2]"),
    Choice("fluid forces", "neglected", "included", ('growth.fluid_forces="included"',), True, "(20), (22), C26"),
    Choice("inlet condition (11)", "u_x(y)", "u_ave", ('numerics.inlet="mean"',), True, "[E4]"),
    Choice("acceptor to donor ratio F", "1.52", "1.5138", ("kinetics.acceptor_to_donor_ratio=1.5138",), True, F_EXACT),
    Choice("transfer at a remesh", "conserving", "linear", ('numerics.transfer="linear"',), False, "[E8]"),
    Choice("transfer at a remesh", "conserving", "bounded", ('numerics.transfer="bounded"',), False,
           "the projection limited by flux-corrected transport"),
    Choice("new biomass", "stressed", "stress-free", ('growth.new_biomass="stress_free"',), True, "section 5"),
    Choice("flow element", "stabilised (c = 100)", "bubble (MINI)", ('numerics.flow_element="bubble"',), True,
           "the same unknowns; tau is the same to 7 % where triangles are equilateral"),
    Choice("fixed point", "kept", "rechosen", ('numerics.fixed_point="rechosen"',), True,
           "2.3.3; the same node throughout base, whose contact surface stays even about it"),
)
