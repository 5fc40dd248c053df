"""Common parts of the writers of Word, PowerPoint and Excel files."""

import importlib
from typing import Any

BLUE = "0B5394"
"""Colour of emphasis."""

PACKAGES = {"docx": "python-docx", "pptx": "python-pptx", "openpyxl": "openpyxl"}
"""Names under which the packages of modules are installed."""


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
        package = PACKAGES[module.partition(".")[0]]
        msg = f"{package} is not installed; install it with: python -m pip install {package}"
        raise OfficeError(msg) from reason
