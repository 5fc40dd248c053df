"""Tables of pandas and labelled arrays of xarray, both optional."""

from importlib import import_module
from typing import Any


def imported(package: str) -> Any:
    """Import pandas or xarray.

    Raises
    ------
    ImportError
        If it is not installed; the message has the command that installs it.
    """
    try:
        return import_module(package)
    except ImportError as reason:
        msg = f"{package} is not installed; install it with: python -m pip install {package}"
        raise ImportError(msg) from reason
