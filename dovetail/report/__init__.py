"""The report of a run: words, pictures and one HTML page."""
