"""Common parts of the writers of Word, PowerPoint and Excel files."""

import importlib
from typing import Any

BLUE = "0B5394"
"""Colour of emphasis."""

PACKAGES = {
    "docx": ("python-docx", "office"),
    "pptx": ("python-pptx", "office"),
    "openpyxl": ("openpyxl", "xlsx"),
}
"""Names of packages, and the extras that install them."""


class OfficeError(ValueError):
    """A library that is needed is not installed."""


def office(module: str) -> Any:
    """Return a module of python-docx, python-pptx or openpyxl.

    Raises
    ------
    OfficeError
        If it is not installed; the message has the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as reason:
        package, extra = PACKAGES[module.partition(".")[0]]
        msg = f"{package} is not installed; install it with: python -m pip install 'dovetail[{extra}]'"
        raise OfficeError(msg) from reason
