"""What is missing in a model, by evidence: place first, then kind, one probability model and one criterion.

Begun beside `updating.diagnosis.search`, which `diagnose` still uses; nothing imports this package yet.
"""
