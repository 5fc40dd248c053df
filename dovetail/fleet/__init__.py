"""End-of-line testing of many units of one structure: a population, and the units that are not of it."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.fleet.diagnosing import cause_text, diagnose_outliers
    from dovetail.fleet.population import PopulationError, find_population
    from dovetail.fleet.run import Triaged, run_fleet
    from dovetail.fleet.triage import Fleet
    from dovetail.fleet.typical import between_units, typical_measurement
else:
    __getattr__, __dir__ = names_on_use(__name__)
