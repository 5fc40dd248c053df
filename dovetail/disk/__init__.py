"""Output on disk: written atomically, and never over an input."""
