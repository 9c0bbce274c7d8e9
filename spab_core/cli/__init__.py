"""The command ``spab``.

Module               What it answers
-------------------  ----------------------------------------
main                 Parser, common options, simulate, map, bifurcation, stiffness, export
design, design_map   Designs: presets, numbers, coefficients, maps of one's own
margin               How far trouble is
models, surrogates   Training, predicting, ranking, verifying
refine               Where to solve next
jobs                 Background work
dashboard            The dashboard
"""
