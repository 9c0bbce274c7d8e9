"""Plotly figures from results.

Module               What it answers
-------------------  ----------------------------------------
theme                What all figures share
map                  Stability maps
point                One operating point
lines                Bifurcation lines
margin               What stands along speed and mass around a point
bearing              Coefficients and stiffness
bands                What the motions along a line are worth, behind its figure
sensitivity          What a changed drawing does
drawings             Shares within tolerances, what drives them, the front of better drawings
surrogates           Predicted maps, errors, refining, the audit
plain_picture        The map and the orbits as plain pictures
"""
