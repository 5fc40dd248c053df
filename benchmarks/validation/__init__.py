"""How often the search for missing effects is right: cases drawn from a seed, with truth of another kind.

The truth comes from exact frequency-dependent members (:mod:`benchmarks.validation.spectral`), not from
finite elements.
"""
