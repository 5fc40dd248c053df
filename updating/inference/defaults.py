"""Numbers of a fit that a study file may state otherwise; reading one needs no fit."""

EXPLAINED_LEVEL = 0.3
"""Residual level up to which a model of beams counts as right, unless the caller says otherwise [nepers]."""

FULL_LINES = 100
"""Lines of full fits, and as how many the lines of any fit count unless it is said otherwise."""

BASIS_LINES = 16, 24
"""At how many lines responses of a fitted model join its basis, once and again."""

MOST_SPLITS = 4
"""Largest number of pieces of an element."""
