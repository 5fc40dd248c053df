"""Derivatives of matrices, modes and FRFs with respect to the parameters of effects."""
