"""Files, one format each."""
