"""Models with fewer coordinates: condensation, expansion, and the fast reduced model."""
