"""One operating point, from the cold start to its regime.

Module               What it answers
-------------------  ----------------------------------------
settings             Mesh, method, length
compiling            Compile the kernels before they are wanted, in a process of its own
run                  One trajectory from the cold start
periodic_orbit       When a run has settled on a periodic orbit: its leading multiplier
shooting             Periods beside the run: the orbit itself and its monodromy matrix
lyapunov             Growth of the tangent -> maximum Lyapunov exponent and its error
regimes              Section and exponent -> periodic-n, quasi-periodic, chaotic, undecided
assessment           What a motion is worth to a designer, and why
point                The three together -> OperatingPoint
point_file           A solved operating point as a file
starts               States to start from instead of from rest
provenance           What a result says of how it was made
expected_time        How long a point takes, told before it is solved
revolution           One revolution in full: film thickness, pressure and forces; the run-up
spectrum             Amplitudes over orders of the running speed
"""
