"""End-of-line testing of many units of one structure: a population, and the units that are not of it."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.fleet.diagnosing import between_units, cause_text, diagnose_outliers, typical_measurement
    from dovetail.fleet.population import PopulationError, find_population
    from dovetail.fleet.run import Triaged, run_fleet
    from dovetail.fleet.triage import Fleet
else:
    __getattr__, __dir__ = names_on_use(__name__)
