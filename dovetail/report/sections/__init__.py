"""Sections of a report, a file each: whether one applies, its page, its table, and its figure."""
