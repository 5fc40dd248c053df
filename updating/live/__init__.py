"""Hypotheses changed by hand: FRFs and errors at once, fits that can be watched and cancelled."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.live.engine import LiveModel
    from updating.live.fitting import fit_all, fit_effect, fit_uncertain, weigh
    from updating.live.hypothesis import Hypothesis
    from updating.live.ranking import rank
    from updating.live.sensitivity import frequency_sensitivities, sensitivities
else:
    __getattr__, __dir__ = names_on_use(__name__)
