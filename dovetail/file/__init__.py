"""The study file: reading it, and writing it with other values."""
