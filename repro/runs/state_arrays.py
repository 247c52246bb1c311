"""Convert the state of a run to plain data and arrays, and back.

The checksum of a checkpoint guarantees that its numbers are unchanged. This module only checks that
they belong to the scene.
"""

from dataclasses import asdict, astuple
from typing import Any

from repro.errors import CheckpointError
from repro.fem.linear import Method
from repro.fem.mesh import Mesh, Region
from repro.fem.space import Space
from repro.fem.walls import Seat
from repro.march.balance import Ledger
from repro.march.state import Compression, RestartState
from repro.march.step_control import StepControl
from repro.model.body import Body
from repro.model.configuration import configuration_of
from repro.model.energies import energy_of
from repro.model.meshing import walls_of
from repro.model.pore import Pore
from repro.model.solid import material
from repro.runs.checkpoint import Arrays
from repro.scene import Scene, scene_hash

#: Arrays of an aggregate, by the names of their fields. Those of the second aggregate end in _2,
#: and so on.
OF_BODY = ("wall", "fixed", "active", "inert", "theta")


def pack_state(scene: Scene, state: RestartState) -> tuple[dict, Arrays]:
    """Convert a state to values for JSON, and arrays."""
    pore = state.pore
    guess = pore.concentrations
    arrays = {"points": pore.mesh.points, "cells": pore.mesh.cells,
              "region": pore.mesh.topology.region, "pressure": pore.pressure}
    for number, (body, loop) in enumerate(zip(pore.bodies, pore.mesh.topology.loops)):
        of_body = {"loop": loop, **_body_arrays(body)}
        arrays |= {f"{name}{_ending(number)}": array for name, array in of_body.items()}
    if guess:
        fields = {"acceptor": guess.acceptor, "donor": guess.donor}
        arrays |= {name: field for name, field in fields.items() if field is not None}
    plain = {"scene": scene_hash(scene), "time_h": pore.time, "pace": asdict(state.step_control),
             "ends_um": [float(x) for x in pore.mesh.ends], "front": float(pore.front),
             "guess": guess.iterations if guess else None, "remeshes": int(state.remeshes),
             "iterations": state.iterations, "row_h": float(state.row),
             "ledgers": list(map(astuple, state.ledgers)),
             "origin_known": all(body.origin_known for body in pore.bodies),
             "seats": [astuple(body.seat) for body in pore.bodies],
             "names": [body.name for body in pore.bodies],
             "compression": astuple(state.compression)}
    return plain, arrays


def _ending(number: int) -> str:
    """Ending of the names of an aggregate's arrays, by its number from zero."""
    return f"_{number + 1}" if number else ""


def _body_arrays(body: Body) -> Arrays:
    """Arrays of an aggregate."""
    arrays = {name: getattr(body, name) for name in OF_BODY}
    arrays["reference"] = body.reference
    if not body.configuration.accumulates:
        arrays["last"] = body.unstrained
    if body.line_speeds is not None:
        arrays["line_speeds"] = body.line_speeds
    return arrays


def unpack_state(scene: Scene, plain: dict, arrays: Arrays) -> RestartState:
    """Invert :func:`pack_state`. Raises CheckpointError if the state is of another scene."""
    if plain["scene"] != scene_hash(scene):
        raise CheckpointError("it is of another scene")
    pairs: list[list[Any]] = [[tuple(part) if isinstance(part, list) else part for part in parts]
                              for parts in plain["ledgers"]]  # JSON has lists for pairs
    ledgers = tuple(Ledger(*parts) for parts in pairs)
    step_control = StepControl(**plain["pace"])
    return RestartState(_pore(scene, plain, arrays), step_control, ledgers, plain["remeshes"],
                        plain["iterations"], plain["row_h"], Compression(*plain["compression"]))


def _pore(scene: Scene, plain: dict, arrays: Arrays) -> Pore:
    numerics = scene.numerics
    method = Method(numerics.solver)
    first, last = plain["ends_um"]
    own = [{name.removesuffix(_ending(number)): array for name, array in arrays.items()
            if name.endswith(_ending(number))} for number in range(len(plain["names"]))]
    loops = tuple(each["loop"] for each in own)
    mesh = Mesh.of(arrays["points"], arrays["cells"], arrays["region"], loops, walls_of(scene),
                   (first, last), method)
    space = Space(mesh)
    guess = None
    if plain["guess"] is not None:
        from repro.model.transport import Concentrations  # a scene without [substrates] has none
        guess = Concentrations(arrays.get("acceptor"), arrays.get("donor"), plain["guess"])
    bodies = tuple(_body(scene, space, region, plain, number, each)
                   for number, (region, each) in enumerate(zip(mesh.regions, own)))
    return Pore(plain["time_h"], space, bodies, arrays["pressure"], guess, plain["front"])


def _body(scene: Scene, space: Space, region: Region, plain: dict, number: int,
          arrays: Arrays) -> Body:
    solid = material(space, region, arrays["reference"], energy_of(scene.growth))
    configuration = configuration_of(scene.growth, arrays.get("last", solid.reference))
    return Body(solid=solid, configuration=configuration, origin_known=plain["origin_known"],
                line_speeds=arrays.get("line_speeds"), seat=Seat(*plain["seats"][number]),
                name=plain["names"][number], **{name: arrays[name] for name in OF_BODY})
