"""Analyses of an assembled system: statics, modes, frequency responses, buckling and derivatives."""
