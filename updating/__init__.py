"""Compare, update, diagnose."""
