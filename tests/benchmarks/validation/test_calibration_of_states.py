"""Calibration on a first state: modes that change places on the way, and the model that comes of it."""

import numpy as np
import pytest

from benchmarks.validation import modal_cases
from benchmarks.validation.cases import CaseSettings
from dovetail import load_study
from dovetail.modes_pipeline import targets_of
from fem import assemble, first_modes
from tests.conftest import ROOT
from updating.diagnosis import calibrate


class Drawn(Exception):  # noqa: N818 - it carries a case, and is no error
    """A case that is drawn and not diagnosed."""


@pytest.mark.slow
def test_neighbouring_modes_that_change_places_do_not_stop_a_calibration(monkeypatch):
    """Two modes 2 % apart are mixtures of each other in the model, and known to 0.01 %."""

    def drawn(model, after, nuisances, *, baseline, **more):
        raise Drawn(model, baseline, nuisances)

    monkeypatch.setattr(modal_cases, "diagnose_modes", drawn)
    with pytest.raises(Drawn) as caught:
        modal_cases.run_modal_case(CaseSettings(seed=5301, small=True), "states", 0)
    model, before, nuisances = caught.value.args
    assert before.frequency[1] / before.frequency[0] < 1.03
    first = calibrate(model, before, nuisances, model_error=0.0)
    off = np.log(first.computed.frequency / before.frequency) / before.frequency_std
    assert np.abs(off).max() < 4


def test_a_calibrated_model_has_the_frequencies_of_its_fit():
    """A form that has moved shifts modes: on the nominal basis alone, by a deviation too little."""
    study = load_study(ROOT / "examples" / "before-and-after" / "study.toml")
    assert study.baseline is not None
    before = targets_of(study.baseline)
    first = calibrate(study.model, before, study.nuisances)
    whole = first_modes(assemble(first.model), before.n).frequency[: before.n]
    off = np.log(whole / first.computed.frequency) / before.frequency_std
    assert np.abs(off).max() < 0.3
