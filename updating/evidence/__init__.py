"""What is missing in a model, by evidence: place first, then kind, one probability model and one criterion."""
