"""Measurements: FRFs with sensors, their estimation from time data, noise, and the plan of a test."""
