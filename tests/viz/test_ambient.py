"""Picture of an ambient test: every pole once, the modes, and peaks without a mode."""

import numpy as np
import pytest

from updating import identify_ambient
from viz import plot_ambient, style


@pytest.fixture(scope="module")
def found():
    rng, rate = np.random.default_rng(1), 50.0
    t = np.arange(20_000) / rate
    kernel = np.exp(-0.3 * t[:2000]) * np.sin(2 * np.pi * 5 * t[:2000])
    q = np.convolve(rng.standard_normal(t.size), kernel)[: t.size]
    y = np.column_stack([q, 0.5 * q]) + 0.2 * rng.standard_normal((t.size, 2))
    return identify_ambient(y + np.sin(2 * np.pi * 12 * t)[:, None], rate, band=(1, 20))


def test_spectra_and_poles_are_drawn_with_modes_and_unexplained_peaks(found):
    figure = plot_ambient(found, "a mast")
    top, low = figure.axes
    modes = [line.get_xdata()[0] for line in low.lines if line.get_color() == style.VERMILION]
    assert modes == pytest.approx([5], rel=0.01)
    clouds = [line for line in low.lines if line.get_linestyle() == "None"]
    shown = np.concatenate([line.get_xdata() for line in clouds])
    assert np.allclose(np.sort(shown), np.sort(found.stabilisation.frequency))
    (peaks,) = (line for line in top.lines if line.get_marker() == "v")
    assert peaks.get_xdata() == pytest.approx([12], rel=0.01)
    assert low.get_xlabel() == "frequency [Hz]"
    assert top.get_ylabel() == "singular values [dB re 1/Hz]"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words[:2] == ["largest singular value", "next singular values"]
    assert {"mode", "peak without a mode", "pole of a mode"} <= set(words)
