"""FRFs as labelled arrays of xarray and tables of pandas, both optional."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fem.analysis.frf import FRF


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


def frf_array(frf: "FRF") -> Any:
    """Return FRFs as an ``xarray.DataArray`` with frequencies, outputs and inputs as coordinates."""
    xarray = imported("xarray")
    array = xarray.DataArray(
        np.array(frf.H),
        dims=("frequency", "output", "input"),
        coords={
            "frequency": np.array(frf.frequency),
            "output": list(frf.outputs),
            "input": list(frf.inputs),
        },
        name=frf.quantity,
        attrs={"units": frf.unit, "kind": str(frf.kind), "time_dependence": "exp(+i omega t)"},
    )
    array["frequency"].attrs["units"] = "Hz"
    return array


def frf_frame(frf: "FRF") -> Any:
    """Return FRFs as a ``pandas.DataFrame``: frequencies down, (output, input) across, complex values."""
    pandas = imported("pandas")
    columns = pandas.MultiIndex.from_product([frf.outputs, frf.inputs], names=["output", "input"])
    index = pandas.Index(np.array(frf.frequency), name="frequency [Hz]")
    frame = pandas.DataFrame(frf.H.reshape(frf.n_freq, -1), index=index, columns=columns)
    frame.attrs = {"units": frf.unit, "kind": str(frf.kind)}
    return frame
