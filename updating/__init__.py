"""Measured against computed: how far apart they are, where, and which effect the model lacks.

    Measurement, Model ─ compare → Comparison
                       ─ build_problem → FitProblem ─ locate → Localisation
                       ─ diagnose → Diagnosis: verdict, findings with their twins, faults, the updated model

`docs/finding-effects.md` says how a diagnosis is made and when not to believe it.
"""

from updating.correlation import Comparison, ModeComparison, compare, compare_modes, frac, mac
from updating.diagnosis import (
    EFFECT,
    FAULT,
    NOTHING,
    UNEXPLAINED,
    Diagnosis,
    EffectParameter,
    Finding,
    Ranked,
    Step,
    build_problem,
    diagnose,
    propose,
)
from updating.faults import Fault
from updating.fit import FitProblem, FitResult
from updating.localisation import Localisation, locate
from updating.measurement import Measurement, MeasurementError, Sensor, place_sensors
from updating.parameters import Nuisance

__all__ = [
    "EFFECT",
    "FAULT",
    "NOTHING",
    "UNEXPLAINED",
    "Comparison",
    "Diagnosis",
    "EffectParameter",
    "Fault",
    "Finding",
    "FitProblem",
    "FitResult",
    "Localisation",
    "Measurement",
    "MeasurementError",
    "ModeComparison",
    "Nuisance",
    "Ranked",
    "Sensor",
    "Step",
    "build_problem",
    "compare",
    "compare_modes",
    "diagnose",
    "frac",
    "locate",
    "mac",
    "place_sensors",
    "propose",
]
