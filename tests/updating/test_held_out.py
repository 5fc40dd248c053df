"""Bands that no fit sees: as text, and as lines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from updating import MeasurementError
from updating.measurement import band_of, band_text, held_out_lines

FREQUENCY = np.arange(10.0, 210.0)
ends = st.floats(0, 1e5).map(lambda x: float(f"{x:.6g}"))


@given(ends, ends)
def test_a_band_is_read_as_it_was_written(a, b):
    low, high = sorted((a, b))
    if low < high:
        assert band_of(band_text((low, high))) == (low, high)


@pytest.mark.parametrize("text", ["band 120-180 Hz", "band 120 to 180", "band 1.2e2 – 180.0Hz"])
def test_a_band_may_be_written_in_several_ways(text):
    assert band_of(text) == (120.0, 180.0)


@pytest.mark.parametrize("text", ["sensor A1", "band", "band saw", "band 120 Hz", "120-180"])
def test_other_texts_are_no_bands(text):
    assert band_of(text) is None


def test_a_band_must_have_a_width():
    with pytest.raises(MeasurementError, match="ends at 100 Hz and begins at 100 Hz"):
        band_of("band 100-100 Hz")


def test_bands_take_the_place_of_blocks():
    held = held_out_lines(FREQUENCY, [(20.0, 29.5), (200.0, 1e4)])
    np.testing.assert_array_equal(FREQUENCY[held], [*range(20, 30), *range(200, 210)])
    blocks = held_out_lines(FREQUENCY)
    assert blocks.sum() == len(FREQUENCY) / 4
    assert np.diff(blocks.astype(int)).clip(0).sum() == 5  # separate blocks


@pytest.mark.parametrize(
    ("bands", "said"),
    [
        ([(300.0, 400.0)], "no line lies in the held-out band 300-400 Hz; the lines of t go from 10 to 209"),
        ([(0.0, 100.0), (100.0, 300.0)], "have every line"),
    ],
)
def test_bands_that_leave_nothing_to_hold_or_to_fit_are_refused(bands, said):
    with pytest.raises(MeasurementError, match=said):
        held_out_lines(FREQUENCY, bands, "t")
