"""The name under which pip installs the program, whose import is ``dovetail``."""

DISTRIBUTION = "dovetail-dynamics"
