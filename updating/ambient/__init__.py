"""Modes from responses to unknown forces: subspace identification with uncertainty, and singular spectra."""
