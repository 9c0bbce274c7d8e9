"""Loads and gas flow of a porous journal bearing by openAirBearing, as JSON.

    python -m venv oab && oab/bin/pip install openairbearing==0.2.1     (Python 3.12 or newer)
    oab/bin/python benchmarks/open_air_bearing.py

openAirBearing (Aalto-Arotor) solves the Reynolds equation over a porous wall by finite elements,
the shaft at rest. It needs another Plotly than spab, so it runs in a Python of its own:
tests/physics/test_published_cases.py takes the one named by SPAB_OPENAIRBEARING_PYTHON (it may be
that of ROSS, CONTRIBUTING.md). The bearing is that of docs/published_cases.md: R 25 mm, C 15 µm,
2e-15 m² over 4.5 mm, 511,325 Pa."""

import json
import sys

import numpy as np
import openairbearing as oab

LENGTHS = (0.025, 0.050)  # m
ECCENTRICITIES = np.array([0.1, 0.3, 0.5, 0.7])
CLEARANCE = 15e-6


def main():
    found = {}
    for length in LENGTHS:
        bearing = oab.JournalBearing(
            bore_diameter=0.050 + CLEARANCE,
            shaft_diameter=0.050 - CLEARANCE,
            xa=length,
            ps=5.046385 * 101325.0,
            kappa=2e-15,
            nh=len(ECCENTRICITIES),
            eccentricity_sweep=ECCENTRICITIES * CLEARANCE,
            nx=41,
            ny=121,
        )
        answer = oab.solve_bearing_fem_2d(bearing)
        found[f"{length:g}"] = {"load_n": answer.w.tolist(), "flow_l_min": answer.qs.tolist()}
    json.dump(found | {"version": oab.__version__}, sys.stdout)


if __name__ == "__main__":
    main()
