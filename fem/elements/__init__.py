"""Frame elements, from the properties of members to matrices.

properties       material, section, beam theory, mass and end connections of a member
axes             local axes
layout           properties and axes of every line of a mesh, without moduli
lines            geometry and properties of some lines in arrays, with moduli and section changes
interpolation    shape functions, strains and slopes
closed_form      matrices of prismatic elements in closed form
matrices         matrices by quadrature
connections      releases and springs at ends
rigid_zones      masses of rigid end zones
tapered          bending and extension of tapered elements
geometric_stiffness    under all six section forces
frame            the effect `Frame`
stretches, cut   parts of members between two arc lengths, and places that give way
part_ties, part_reduction    parts from other programs: ties to points, fixed-interface modes
"""
