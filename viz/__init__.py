"""Pictures of structures and mode shapes (PyVista, off-screen) and curves (matplotlib figures)."""
