"""Small motions about the static equilibrium.

Module               What it answers
-------------------  ----------------------------------------
equilibrium          Static equilibrium, stiffness of the concentric film
held                 Steady film of a journal held off the centre: what a bearing carries
whirl                Eigenvalues of film and rotor together; threshold mass
conical              The family that tilts: rates and threshold
impedance            Dynamic stiffness of the film at any complex frequency
modes                Vibrations of rotor and film: frequency, damping, direction, shape, name
film_whirl           The film's whirl, followed over shaft speed by continuity
coefficients         Stiffness and damping over whirl frequency and speed
ross_table           Those as a table for rotor programs
linear_table         Stability over a plane, tabulated and interpolated
parallel_table       The same row by row, for many processes
summary              What a design means at an operating point: gas flow, stiffness, damping, whirl
"""
