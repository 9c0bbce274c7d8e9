"""Film and rotor advanced in time by compiled kernels, with the exact tangent.

Module               What it answers
-------------------  ----------------------------------------
film                 The mesh and the discretised Reynolds equation, readable
rotor                Disc, journal, shaft and contact, readable
system               Both at one operating point, on one mesh
cache                Where compiled kernels are kept, one folder for each state of the sources
simd                 Numbers in registers, eight by eight: the azimuths of a latitude
ring                 Matrices over these azimuths: products and inverses
slope                The right-hand side and its tangent, compiled
axial                What the kernels do more where the journal moves along the axis
curvature            The second derivative of the right-hand side along a direction
linear_solve         The linear system of an implicit step, solved exactly by blocks
dtm                  The paper's scheme: differential transformation in time
rodas                One step of RODAS4 and its exact derivative
stepping             Step control, whole revolutions; any system by ``bind``
"""
