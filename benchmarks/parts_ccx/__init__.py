"""Studies with parts of solid elements, made and solved by CalculiX; see ``__main__``."""
