"""Dovetail by the modes of the case alone."""

from benchmarks.open_test.rivals.common import FREQUENCY_STD, SHAPE_STD, Said
from benchmarks.open_test.words import explanations_of
from updating import ModeTargets, diagnose_modes

SOURCE = "this package"


def solve(case):
    """Return the posterior of a diagnosis by modes."""
    frequency, zeta, shapes = case.modes
    study = case.study
    sensors = study.measurements[0].sensors
    known = {"zeta": zeta, "shapes": shapes.real, "shape_std": SHAPE_STD, "sensors": sensors}
    targets = ModeTargets.of(frequency, FREQUENCY_STD, **known)
    found = diagnose_modes(study.model, targets, study.nuisances, progress=case.watch)
    return Said(*explanations_of(found, case.structure))
