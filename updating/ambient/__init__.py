"""Modes from responses to unknown forces: subspace identification with uncertainty, and singular spectra."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.ambient.record import USED_BAND, prepare_record
    from updating.ambient.spectra import singular_spectra
    from updating.ambient.subspace import Correlations, block_correlations, decompose, fit_orders
else:
    __getattr__, __dir__ = names_on_use(__name__)
