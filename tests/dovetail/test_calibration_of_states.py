"""Calibration on a first state whose modes change places on the way."""

import numpy as np
import pytest

from dovetail.validation import modal_cases
from dovetail.validation.cases import CaseSettings
from updating.diagnosis.states import calibrate


class Drawn(Exception):  # noqa: N818 - it carries a case, and is no error
    """A case that is drawn and not diagnosed."""


def test_neighbouring_modes_that_change_places_do_not_stop_a_calibration(monkeypatch):
    """Two modes 2 % apart are mixtures of each other in the model, and known to 0.01 %."""

    def drawn(model, before, after, nuisances, **more):
        raise Drawn(model, before, nuisances)

    monkeypatch.setattr(modal_cases, "diagnose_change", drawn)
    with pytest.raises(Drawn) as caught:
        modal_cases.run_modal_case(CaseSettings(seed=5301, small=True), "states", 0)
    model, before, nuisances = caught.value.args
    assert before.frequency[1] / before.frequency[0] < 1.03
    first = calibrate(model, before, nuisances, model_error=0.0)
    off = np.log(first.computed.frequency / before.frequency) / before.frequency_std
    assert np.abs(off).max() < 4
