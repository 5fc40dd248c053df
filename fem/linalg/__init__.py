"""Sparse factorisations and eigensolvers."""
