"""The command ``spab``.

Module               What it answers
-------------------  ----------------------------------------
main                 The whole command: its groups, its exit codes
options              What the commands share: parser, options
progress             What a long command shows, and says when it is stopped
point                One operating point: simulate, stiffness, whirl-threshold
maps                 Many operating points: map, bifurcation, export
margin               How far trouble is from an operating point
surrogates           evaluate, predict
models               train, verify
refine               Where to solve next
design, design_map   Designs: presets, numbers, coefficients, maps of one's own
drawings             What tolerances mean, better drawings
jobs                 Background work
dashboard            The dashboard
"""
