"""Random designs, all within their ranges."""

import dataclasses
import math

from hypothesis import strategies as st

from spab_core.design.model import (
    MAX_FEEDING_NUMBER,
    MIN_LAYER_NUMBER,
    SLENDERNESS_RANGE,
    SPHERE,
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
            if m["choices"]:
                values[f.name] = draw(st.sampled_from(m["choices"]))
                continue
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
    layer = bearing["layer_thickness"] = min(
        bearing["layer_thickness"], 0.499 * bearing["wall_thickness"]
    )
    conductance = 6.0 * bearing["radius"] ** 2 / bearing["clearance"] ** 3
    least = 1.001 * MIN_LAYER_NUMBER * layer / conductance
    if draw(st.booleans()) or layer == 0.0 or least > 1e-11:
        bearing["layer_thickness"] = bearing["layer_permeability"] = 0.0
    else:
        bearing["layer_permeability"] = max(bearing["layer_permeability"], least, 1e-300)
    low, high = (2.0 * limit * bearing["radius"] for limit in SLENDERNESS_RANGE)
    bearing["length"] = min(max(bearing["length"], 1.0001 * low), 0.9999 * high)
    rotor = pick(Rotor)
    if draw(st.booleans()):
        rotor["shaft_stiffness"] = math.inf
    rotor["axial_motion"] &= bearing["shape"] == SPHERE
    rotor["axial_load"] *= bearing["shape"] == SPHERE
    rotor["span"] = max(rotor["span"], 1e-3)
    rotor["transverse_inertia"] *= bearing["shape"] == SPHERE
    rotor["polar_inertia"] = min(rotor["polar_inertia"], 1.999 * rotor["transverse_inertia"])
    contact = pick(Contact)
    contact["force_at_closure"] = min(
        contact["force_at_closure"], 0.999e-9 * math.exp(min(1.0 / contact["roughness"], 40.0))
    )
    return Design(Bearing(**bearing), Gas(**pick(Gas)), Rotor(**rotor), Contact(**contact))
