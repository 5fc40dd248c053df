"""Modes identified from measured FRFs."""
