"""Two states of one structure by FRFs: what is carried over from the first, and what has changed."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from fem import PointMass
from tests.frames import write_study
from updating import Nuisance
from updating.correlation import log_ratio
from updating.diagnosis import (
    ONE_STRUCTURE,
    Between,
    calibrate_frfs,
    carried_over,
    changed_frf_problem,
    poor_baseline,
)
from updating.inference import MODEL_ERROR

COMMON = PointMass(name="common", member="post", position=0.31, mass=0.08)
"""In both states: the model does not have it."""


def measured(folder, *, mass, others=(COMMON,)):
    folder.mkdir(exist_ok=True)
    return load_study(write_study(folder, mass, others=others))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    study = measured(tmp_path_factory.mktemp("first"), mass=0)
    nuisances = (Nuisance("frame", "E:steel", 0.02),)
    return study, calibrate_frfs(study.model, study.measurements[0], nuisances)


def test_the_error_that_both_states_share_is_taken_off(calibrated):
    """Where the second state is the first one, the calibrated model's residuals are none but noise."""
    _, first = calibrated
    alone = first.alone
    here = np.nanmax(np.abs(alone.log_ratio(alone.nominal())))
    data = carried_over(first, alone.data)
    left = replace(alone, data=data).log_ratio(alone.nominal())
    assert here > 0.1
    assert np.nanmax(np.abs(left)) < 1e-9
    assert data.noise[data.mask] == pytest.approx(np.sqrt(2) * alone.data.noise[data.mask])


def test_a_change_that_is_the_same_at_all_lines_is_kept(calibrated):
    """A factor e^c on all FRFs is left of the second state's data, and weighs the carried error by |c|."""
    _, first = calibrated
    alone, c = first.alone, 0.2 + 0.1j
    d = np.abs(alone.log_ratio(alone.nominal()))
    data = carried_over(first, replace(alone.data, H=np.exp(c) * alone.data.H))
    computed = alone.receptance(alone.nominal())
    there = data.mask & (data.weight > 0)
    assert log_ratio(data.H, computed)[there] == pytest.approx(np.full(there.sum(), c))
    before = (1 / alone.data.weight[there]) ** 2 - 1
    more = ((1 / data.weight[there]) ** 2 - 1 - before) * MODEL_ERROR**2
    expected = alone.data.noise[there] ** 2 + (d[there] * np.hypot(0.1, abs(c))) ** 2
    assert more == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_lines_and_channels_that_the_first_state_has_not_are_uncertain(calibrated):
    study, first = calibrated
    frf = study.measurements[0].frf
    less = study.measurements[0].with_frf(frf.select(["P", "K", "T"], band=(4.0, 200.0)))
    few = calibrate_frfs(study.model, less)
    data = carried_over(few, first.alone.data)
    same = first.alone.data.H
    known = np.zeros(same.shape, dtype=bool)
    known[first.alone.data.frequency <= 200.0, :3] = True
    changed = (same != data.H) & data.mask
    assert changed[known & data.mask].all()
    assert not changed[~known].any()
    assert data.weight[~known & data.mask].max() < first.alone.data.weight[~known & data.mask].max()


def test_lines_between_those_of_the_first_state_are_interpolated(calibrated):
    """Of twice the spacing nothing is left at common lines, and the curvature of the error between them."""
    _, first = calibrated
    data, half = first.alone.data, slice(None, None, 2)
    frf = data.measurement.frf.select(lines=np.arange(0, len(data.frequency), 2))
    arrays = {
        key: getattr(data, key)[half] for key in ("frequency", "H", "mask", "weight", "noise", "held_out")
    }
    sparse = replace(data, measurement=data.measurement.with_frf(frf), **arrays)
    carried = carried_over(replace(first, alone=replace(first.alone, data=sparse)), data)
    left = np.abs(replace(first.alone, data=carried).log_ratio(first.alone.nominal()))
    assert np.nanmax(left[half]) < 1e-9
    before = np.abs(first.alone.log_ratio(first.alone.nominal()))
    assert 0 < np.nanmedian(left[1::2]) < 0.3 * np.nanmedian(before[1::2])


def test_what_two_units_differ_by_is_uncertain_in_the_second(calibrated):
    """Parameters scatter, damping too, and more of the form's error is not common to both."""
    study, first = calibrated
    scatter, after = Nuisance("frame", "E:steel", 0.01), study.measurements[0]
    of_one, of_two = (
        changed_frf_problem(study.model, first, after, between=between)[2]
        for between in (ONE_STRUCTURE, Between((scatter,), 0.1, 0.3))
    )
    assert of_one.nuisances == ()
    assert of_two.nuisances == (scatter,)
    assert of_one.damping.std == first.alone.damping.std
    assert of_two.damping.std == 0.1
    assert of_two.model_error == pytest.approx(3 * of_one.model_error)
    large = np.nan_to_num(np.abs(first.alone.log_ratio(first.alone.nominal()))) > 0.05
    assert (of_two.data.weight[large] < of_one.data.weight[large]).all()
    with_scatter = of_two.nominal()
    assert set(with_scatter.values) == {("frame", "E:steel")}


def test_a_band_that_the_calibrated_model_misses_is_named(calibrated):
    """80 g that the model does not have are within what beams may leave, but not beside a right form."""
    study, first = calibrated
    assert poor_baseline(first) == ()
    right = calibrate_frfs(
        study.model, study.measurements[0], (Nuisance("frame", "E:steel", 0.02),), model_error=0.0
    )
    (text,) = poor_baseline(right)
    low, high = (float(part) for part in text.split("from ")[1].split(" Hz")[0].split(" to "))
    f = right.problem.data.frequency
    assert f[0] <= low < high <= f[-1]
