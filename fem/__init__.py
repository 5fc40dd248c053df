"""Finite elements for 3D frames."""
