"""Missing effects by evidence: place first, then kind, one probability model and one criterion."""
