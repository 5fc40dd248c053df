"""Common parts of the writers of Word and PowerPoint files."""

import importlib
from typing import Any

BLUE = "0B5394"
"""Colour of emphasis."""

PACKAGES = {"docx": "python-docx", "pptx": "python-pptx"}


class OfficeError(ValueError):
    """A library that is needed is not installed."""


def office(module: str) -> Any:
    """Return a module of python-docx or python-pptx.

    Raises
    ------
    OfficeError
        If it is not installed; the message has the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as reason:
        package = PACKAGES[module.partition(".")[0]]
        msg = f"{package} is not installed; install it with: python -m pip install 'dovetail[office]'"
        raise OfficeError(msg) from reason
