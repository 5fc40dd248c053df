"""End-of-line testing of many units of one structure: a population, and the units that are not of it."""
