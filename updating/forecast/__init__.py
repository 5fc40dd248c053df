"""What each candidate effect, of any size, would do to the data of a fit beyond all that may vary."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.forecast.forecast import EffectEstimate, Forecast
    from updating.forecast.grid import Grid, Little
    from updating.forecast.information import ExpectedGains, Information, without
    from updating.forecast.look import Look, candidate_terms, level
    from updating.forecast.sizes import Sizes
else:
    __getattr__, __dir__ = names_on_use(__name__)
