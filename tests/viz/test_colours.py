"""Colours as people with colour blindness see them, by day and by night.

Matrices of Machado, Oliveira and Fernandes, IEEE Trans. Vis. Comput. Graph. 15(6), 2009, 1291, severity 1.
"""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from viz import style
from viz.interactive.theme import NIGHT

SIGHT = {
    "all colours": np.eye(3),
    "no red": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no green": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "no blue": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
TOLD_APART = 10.0
"""Colour difference ΔE of CIE 1976 that lines need: a just noticeable one is 2.3 (Mahy et al., 1994)."""


def seen(colours, sight):
    """Return CIE L*a*b* of colours (n, 3) from 0 to 1, as they are seen."""
    rgb = np.asarray(colours, dtype=float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ np.transpose(SIGHT[sight]), 0, 1)
    t = linear @ XYZ.T / XYZ.sum(axis=1)
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def test_the_conversion_meets_known_colours():
    white, red = seen([[1, 1, 1], [1, 0, 0]], "all colours")
    np.testing.assert_allclose(white, [100, 0, 0], atol=0.02)
    np.testing.assert_allclose(red, [53.24, 80.09, 67.20], atol=0.05)  # of sRGB's primary, D65


@pytest.mark.parametrize("night", [False, True])
@pytest.mark.parametrize("sight", list(SIGHT))
def test_curves_are_told_apart_by_colour_or_by_dashes(sight, night):
    lines = [(style.MEASURED, "-"), *style.MODELS]
    colours = [NIGHT.get(c, c) if night else c for c, _ in lines]
    lab = seen([to_rgb(c) for c in colours], sight)
    for (a, (_, dash)), (b, (_, other)) in combinations(enumerate(lines), 2):
        assert dash != other or np.linalg.norm(lab[a] - lab[b]) > TOLD_APART


@pytest.mark.parametrize("sight", list(SIGHT))
@pytest.mark.parametrize("name", ["misfit_map", "agreement_map", "displacement_map"])
def test_maps_rise_or_fall_in_lightness(name, sight):
    lightness = seen(getattr(style, name)()(np.linspace(0, 1, 64))[:, :3], sight)[:, 0]
    steps = np.diff(lightness) * np.sign(lightness[-1] - lightness[0])
    assert steps.min() > 0
    assert abs(lightness[-1] - lightness[0]) > 60
