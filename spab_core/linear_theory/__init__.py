"""Small motions about the static equilibrium.

Module               What it answers
-------------------  ----------------------------------------
equilibrium          Static equilibrium, stiffness of the concentric film
whirl                Eigenvalues of film and rotor together; threshold mass
coefficients         Stiffness and damping over whirl frequency and speed
ross_table           Those as a table for rotor programs
linear_table         Stability over a plane, tabulated and interpolated
summary              What a design means at an operating point: gas flow, stiffness, damping, whirl
"""
