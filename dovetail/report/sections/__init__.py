"""Sections of a result, a file each: whether one applies, its table, and its figure, for every medium."""
