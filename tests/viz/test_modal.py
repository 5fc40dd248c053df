"""Pictures of an identification: the right poles, lines, curves and labels."""

import numpy as np
import pytest

from fem.analysis.frf import FRF
from updating.modal.identification import identify_modes
from viz import style
from viz.modal import plot_stabilisation, plot_synthesis


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
    ax = figure.axes[0]
    clouds = {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}
    shown = np.concatenate([line.get_xdata() for line in clouds.values()])
    assert np.allclose(np.sort(shown), np.sort(found.stabilisation.frequency))
    modes = [line.get_xdata()[0] for line in ax.lines if line.get_color() == style.VERMILION]
    assert modes == pytest.approx([20, 41])
    assert ax.get_xlabel() == "frequency [Hz]"
    assert figure.axes[1].get_ylabel() == "root mean square accelerance [(m/s²)/N]"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["new", "frequency stable", "frequency, damping and participation stable", "mode"]


def test_synthesis_lies_on_the_lines_of_the_fit_and_says_its_error(case):
    frf, found = case
    figure = plot_synthesis(frf, found, [("2Z+", "1Z+")])
    top = figure.axes[0]
    measured, fitted = (line.get_ydata() for line in top.lines)
    assert len(measured) == found.synthesised.n_freq < frf.n_freq
    assert np.allclose(measured, fitted)
    assert top.get_title(loc="left").startswith("2Z+ / 1Z+: error ")
