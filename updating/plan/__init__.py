"""What a test could see and name before it is made, and tests that see more."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.plan.check import MULTIPLES, FailedTrial, trials
    from updating.plan.choose import ChosenChannels
    from updating.plan.perturbed import with_masses, without_supports
    from updating.plan.plan import with_averages
    from updating.plan.planned import planned_measurement
    from updating.plan.trial import drawn
    from updating.plan.visibility import POWER, SURE, needed, size_of
else:
    __getattr__, __dir__ = names_on_use(__name__)
