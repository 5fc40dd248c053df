"""Checks of a measurement before any physics is fitted to it."""
