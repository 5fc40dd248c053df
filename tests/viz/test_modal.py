"""Pictures of an identification: the right poles, lines, curves and labels."""

from dataclasses import replace

import numpy as np
import pytest

from fem import FRF
from updating import identify_modes
from updating.modal import UnexplainedPeak
from viz import plot_stabilisation, plot_synthesis, style


@pytest.fixture(scope="module")
def case():
    lines = np.linspace(5, 60, 300)
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * np.array([20.0, 41.0])
    phi = np.array([[0.8, 0.3], [0.4, -1.0]])
    q = -(w**2) / (wn**2 - w**2 + 0.02j * wn * w)
    frf = FRF.from_arrays(lines, (phi * q[:, None]) @ phi[[0]].T, "accelerance", ["1Z+", "2Z+"], ["1Z+"])
    return frf, identify_modes(frf, band=(10, 60), highest_order=20)


def test_stabilisation_diagram_shows_every_pole_once_and_the_modes(case):
    frf, found = case
    figure = plot_stabilisation(frf, found, "a frame")
    top, ax = figure.axes
    clouds = {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}
    shown = np.concatenate([line.get_xdata() for line in clouds.values()])
    assert np.allclose(np.sort(shown), np.sort(found.stabilisation.frequency))
    modes = [line.get_xdata()[0] for line in ax.lines if line.get_color() == style.VERMILION]
    assert modes == pytest.approx([20, 41])
    assert ax.get_xlabel() == "frequency [Hz]"
    assert ax.get_ylabel() == "order of the denominator"
    assert top.get_ylabel() == "mode indicator [dB]"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == [
        "measured",
        "fitted modes and residuals",
        "residual",
        "mode",
        "new",
        "frequency stable",
        "frequency, damping and participation stable",
    ]


def test_indicators_are_of_measured_fitted_and_what_is_left(case):
    frf, found = case
    top = plot_stabilisation(frf, found).axes[0]
    curves = {line.get_label(): line.get_ydata() for line in top.lines}
    lines = frf.frequency >= 10
    H = frf.H[lines, :, 0]
    level = 10 * np.log10((np.abs(H) ** 2 / (np.abs(H) ** 2).mean(axis=0)).mean(axis=1))
    assert curves["measured"] == pytest.approx(level)
    assert curves["fitted modes and residuals"] == pytest.approx(level, abs=1e-3)
    assert curves["residual"].max() < -60  # the data are exact
    assert (10 ** (curves["measured"] / 10)).mean() == pytest.approx(1)


def test_a_peak_without_a_mode_is_marked(case):
    frf, _ = case
    found = identify_modes(frf, band=(10, 60), highest_order=20)
    peak = UnexplainedPeak(41.0, 20.0, 1.0, "left out")
    top = plot_stabilisation(frf, replace(found, unexplained=(peak,))).axes[0]
    (mark,) = (line for line in top.lines if line.get_label() == "peak without a mode")
    assert mark.get_xdata() == pytest.approx([41.0], abs=0.1)


def test_synthesis_lies_on_the_lines_of_the_fit_and_says_its_error(case):
    frf, found = case
    figure = plot_synthesis(frf, found, [("2Z+", "1Z+")])
    top = figure.axes[0]
    measured, fitted = (line.get_ydata() for line in top.lines)
    assert len(measured) == found.synthesised.n_freq < frf.n_freq
    assert np.allclose(measured, fitted)
    assert top.get_title(loc="left").startswith("2Z+ / 1Z+: error ")
