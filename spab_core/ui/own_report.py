"""The report of one's own bearing: sections out of what a page knows."""

from __future__ import annotations

from collections.abc import Callable

import plotly.graph_objects as go

from spab_core.active_learning.refine import Refinement
from spab_core.design.model import Design
from spab_core.linear_theory.summary import derive
from spab_core.maps.margin import Margin
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.point import orbit_figure, section_figure
from spab_core.reporting.report import Section, design_section
from spab_core.ui.own_map import map_command, own_figure
from spab_core.ui.solving import live_point
from spab_core.ui.view import OWN_LAYERS


def report_page(
    design: Design,
    found: tuple[Refinement, StabilityMap],
    at: Margin | None,
    rotor_mass: float,
    bearing_number: float,
    numbers: str,
    masses: str,
    minutes: float,
) -> Callable[[], tuple] | None:
    """The arguments of ``report.report_html``, made when they are wanted; None as long as the
    solver is compiled.
    """
    point = live_point(design, rotor_mass, bearing_number)
    if point is None:
        return None

    def make() -> tuple:
        refined = found[0]
        state = derive(design, rotor_mass, bearing_number)
        margin_text = (
            [at.headline(), *at.sentences()]
            if at
            else ["The operating point lies outside the map."]
        )
        orbits: dict[str, go.Figure] = (
            {
                "Orbits at the operating point": orbit_figure(point),
                "Poincaré section": section_figure(point),
            }
            if point.mle
            else {}
        )
        where = f"{rotor_mass:g} kg on one bearing at {design.speed_rpm(bearing_number):,.0f} rpm (Λ = {bearing_number:.4g})"
        rest = (
            [
                f"At rest on its film: eccentricity {state.eccentricity:.3f}, attitude angle "
                f"{state.attitude_angle:.1f}°."
            ]
            if state.status == "ok"
            else [f"{state.status.capitalize()}."]
        )
        sections = [
            design_section(design),
            Section(f"Operating point: {where}", [point.verdict(), *rest], {}, orbits),
            Section("Margin", margin_text),
            Section(
                "Map",
                [
                    f"{int(refined.solved.sum()):,} of {refined.batch.size:,} cells solved "
                    "(dots), the others "
                    f"predicted by trees on linear theory; {refined.metadata['mesh']} film nodes, "
                    f"{refined.metadata['transient']} + {refined.metadata['revolutions']} "
                    "revolutions a cell."
                ],
                {},
                {
                    f"{layer} over the plane": own_figure(found, layer, bearing_number, rotor_mass)
                    for layer in OWN_LAYERS
                },
            ),
        ]
        commands = [
            f"spab simulate --design my.toml --rotor-mass {rotor_mass:g} --bearing-number "
            f"{bearing_number:.6g}",
            map_command(" --design my.toml", numbers, masses, minutes),
        ]
        return "Rotor on spherical porous gas bearings", sections, commands

    return make
