"""Damaged and hostile input files for every reader: `make fuzz`, and a bounded run in the tests."""
