"""Missing effects by evidence: place first, then kind, one probability model and one criterion."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.diagnosis.evidence.absence import gains_without, left_out
    from updating.diagnosis.evidence.blocks import Blocks
    from updating.diagnosis.evidence.budget import NORMAL
    from updating.diagnosis.evidence.channel_rivals import without_effects_of_channels
    from updating.diagnosis.evidence.diagnosis import (
        UNKNOWN,
        Searched,
        prepare_search,
        search_of_problem,
        searched,
    )
    from updating.diagnosis.evidence.fits import N_STARTS, QUICK_STEPS, SHORT_STEPS, Fits
    from updating.diagnosis.evidence.halving import Damped
    from updating.diagnosis.evidence.hypothesis import (
        Odds,
        ScoredFit,
        Start,
        n_changes,
        near_to,
        values_of,
    )
    from updating.diagnosis.evidence.mode_ranking import ModeRanking
    from updating.diagnosis.evidence.places import place_of, places_of
    from updating.diagnosis.evidence.ranking import Ranking
    from updating.diagnosis.evidence.readings import as_read, doubtful, log_prior
    from updating.diagnosis.evidence.scan import Scan
    from updating.diagnosis.evidence.screening import best_starts, look_at, screen
    from updating.diagnosis.evidence.search import Search
else:
    __getattr__, __dir__ = names_on_use(__name__)
