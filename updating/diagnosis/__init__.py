"""The search for the physical effect that a model lacks."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.diagnosis.amplitude import force_levels
    from updating.diagnosis.baseline import calibrate, judged
    from updating.diagnosis.candidates import admitted, situated, unstated
    from updating.diagnosis.carried import Between, carried_over
    from updating.diagnosis.departures import Departure, departed
    from updating.diagnosis.diagnose import BASIS_LIMIT_DB
    from updating.diagnosis.fitted_modes import FittedModePair, damped_modes, modes_of, most_changed
    from updating.diagnosis.frf_states import (
        ONE_STRUCTURE,
        calibrate_frfs,
        changed_frf_problem,
        poor_baseline,
    )
    from updating.diagnosis.localisation import NOWHERE
    from updating.diagnosis.mode_table import ModeTable
    from updating.diagnosis.separation import BAND_BEYOND, what_decides
    from updating.diagnosis.states import changed_problem
    from updating.diagnosis.verdict import Explanation
else:
    __getattr__, __dir__ = names_on_use(__name__)
