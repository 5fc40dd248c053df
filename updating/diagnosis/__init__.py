"""The search for the physical effect that a model lacks."""
