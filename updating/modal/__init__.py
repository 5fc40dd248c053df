"""Modes identified from measured FRFs."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.modal.condensed_lines import N_NODES, condense_lines
    from updating.modal.modal_fit import ModalFitData
    from updating.modal.peaks import UnexplainedPeak, peak_words
    from updating.modal.poles import LEAST_ORDERS, channel_sizes, fit_orders, track_poles
    from updating.modal.refinement import fit_modes
else:
    __getattr__, __dir__ = names_on_use(__name__)
