"""Cross-sections: constants, shapes with their formulas, and the integrals behind them.

section       `Section`, with a constructor for each shape
constants     the constants that elements use
solid, hollow, profiles, polygons    one kind of shape each
shear, torsion                       shear coefficients and torsion constants in closed form
walls, warping, outlines             shear flow in thin walls, finite elements, areas of polygons
dimensions    checks of dimensions
"""
