"""Plotly figures from results.

Module               What it answers
-------------------  ----------------------------------------
theme                What all figures share
map                  Stability maps
point                One operating point
lines                Bifurcation lines
bearing              Coefficients and stiffness
sensitivity          What a changed drawing does
surrogates           Predicted maps, errors, refining, the audit
plain_picture        The map and the orbits as plain pictures
"""
