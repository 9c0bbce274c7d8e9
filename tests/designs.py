"""Random designs, all within their ranges."""

import dataclasses
import math

from hypothesis import strategies as st

from spab_core.design.model import (
    MAX_FEEDING_NUMBER,
    Bearing,
    Contact,
    Design,
    Gas,
    Rotor,
)


@st.composite
def designs(draw):
    def pick(cls):
        values = {}
        for f in dataclasses.fields(cls):
            m = f.metadata
            values[f.name] = draw(st.floats(m["low"], m["high"], exclude_min=m["open_low"]))
        return values

    bearing = pick(Bearing)
    bearing["clearance"] = min(bearing["clearance"], 0.05 * bearing["radius"])
    feeding = (
        6.0
        * bearing["permeability"]
        * bearing["radius"] ** 2
        / (bearing["wall_thickness"] * bearing["clearance"] ** 3)
    )
    bearing["permeability"] *= min(1.0, 0.999 * MAX_FEEDING_NUMBER / max(feeding, 1e-9))
    rotor = pick(Rotor)
    if draw(st.booleans()):
        rotor["shaft_stiffness"] = math.inf
    contact = pick(Contact)
    contact["force_at_closure"] = min(
        contact["force_at_closure"], 0.999e-9 * math.exp(min(1.0 / contact["roughness"], 40.0))
    )
    return Design(Bearing(**bearing), Gas(**pick(Gas)), Rotor(**rotor), Contact(**contact))
