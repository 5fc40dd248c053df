"""NAFEMS benchmarks for the free vibration of beams: the deviations from FV2 to FV5.

The figures are in `benchmarks/book/nafems.py`. They have four or five digits; half a unit of the last
is part of each tolerance, the rest is predicted or explained.
"""

import numpy as np
import pytest

from benchmarks.book.nafems import (
    COWPER,
    FV2,
    FV3,
    FV4,
    FV5_BENDING,
    STEEL,
    deep_beam,
    double_cross,
    frequencies,
    square,
    square_frame,
    stretchless,
    with_masses,
)
from fem import Section, assemble, solve_modes
from tests.benchmarks.test_beams_closed_form import timoshenko_pinned


def printed(text):
    return np.array([float(word) for word in text.split()])


FV2_ROOTS = np.array([np.pi] + 7 * [3.926602312] + [2 * np.pi] + 7 * [7.068582746])
"""Arms pinned at both ends, turning alike; or pinned and clamped."""


@pytest.mark.parametrize("n", [4, 16])
def test_fv2_double_cross_with_pinned_ends(n):
    square = Section.rectangle(0.125, 0.125)
    predicted = (FV2_ROOTS / n) ** 4 / 1440
    digits = 0.0005 / FV2
    # The published figures are those of arms that do not stretch.
    rigid = frequencies(double_cross(n, *stretchless(square, STEEL)), 16) / FV2 - 1
    assert (abs(rigid - predicted) < 0.15 * (FV2_ROOTS / n) ** 2 * predicted + 2 * digits).all()
    # Real arms let the centre move in x and y: two modes of each seven are lower, the others are the same.
    real = frequencies(double_cross(n, STEEL, square), 16) / FV2 - 1
    moving, still = [1, 2, 9, 10], [0, *range(3, 8), 8, *range(11, 16)]
    assert (
        abs(real - predicted)[still] < (0.15 * (FV2_ROOTS / n) ** 2 * predicted + 2 * digits)[still]
    ).all()
    if n == 16:
        expected = [-0.0016, -0.0016, -0.0055, -0.0055]
        np.testing.assert_allclose((real - predicted)[moving], expected, atol=0.0001)


def test_fv2_many_equal_modes_are_all_found():
    # 16 elements an arm: solved by Lanczos, which by itself returns one or two of seven equal modes
    f = frequencies(double_cross(16, *stretchless(Section.rectangle(0.125, 0.125), STEEL)), 16)
    assert (abs(f / 17.709 - 1) < 1e-4).sum() == 7
    assert (abs(f / 57.390 - 1) < 1e-4).sum() == 7


def test_fv3_free_square_frame():
    published = printed(FV3)
    section = Section.rectangle(0.25, 0.25)
    model = square_frame(16, "euler-bernoulli", STEEL, section)
    modes = solve_modes(assemble(model), 8)
    assert modes.n_rigid == 3
    # A converged Euler-Bernoulli frame: what remains is a property of the published figures
    # (0.02, -0.05, 0.06, -0.23 %); rotary inertia and shear would lower the last by another 0.4 %.
    deviation = modes.frequency[3:] / published - 1
    np.testing.assert_allclose(deviation, [0.0002, -0.0005, 0.0006, 0.0006, -0.0023], atol=0.0002)
    deep = frequencies(square_frame(16, "timoshenko", STEEL, section), 8)
    assert deep[4] / modes.frequency[7] - 1 == pytest.approx(-0.0043, abs=0.0002)


def test_fv4_cantilever_with_off_centre_masses():
    published = printed(FV4)

    def found(theory):
        return frequencies(with_masses(theory), 6)

    # Published for beams without shear and rotary inertia. Converged, ours differ by what is noted.
    slender = found("euler-bernoulli") / published - 1
    np.testing.assert_allclose(slender, [0.0002, -0.0001, 0.0001, 0.0003, 0.0015, 0.0011], atol=0.0003)
    # With both, a beam 20 times as long as thick is softer, the more so the shorter its half waves.
    np.testing.assert_allclose(
        found("timoshenko") / found("euler-bernoulli") - 1,
        [-0.0007, -0.0008, -0.0005, -0.0028, -0.0075, -0.0109],
        atol=0.0002,
    )


@pytest.mark.parametrize(
    ("k", "deviation"), [(5 / 6, [-0.0009, -0.0035, -0.0077]), (COWPER, [-0.0001, -0.0011, -0.0038])]
)
def test_fv5_bending_of_a_deep_beam(k, deviation):
    published = printed(FV5_BENDING)
    exact = np.array([timoshenko_pinned(m, 10.0, STEEL, square(2.0, k))[0] for m in (1, 2, 3)])
    # Timoshenko's closed form: what the shear coefficient leaves is a property of the published figures.
    np.testing.assert_allclose(exact / published - 1, deviation, atol=0.0001)
    coarse, fine = (deep_beam(square(2.0, k), n)[[0, 4, 7]] / exact - 1 for n in (40, 80))
    np.testing.assert_allclose(coarse / fine, 4, rtol=0.01)
    assert (fine < 1.1e-3).all()
    # The two planes of a square vibrate alike.
    both = deep_beam(square(2.0, k), 40)
    np.testing.assert_allclose(both[[0, 4, 7]], both[[1, 5, 8]], rtol=1e-9)


def test_fv5_axial_mode():
    # quarter wave of 5000 m/s over 10 m
    assert deep_beam(square(2.0, 5 / 6), 40)[3] / 125.0 - 1 == pytest.approx(
        (np.pi / 2 / 40) ** 2 / 24, rel=0.01
    )


def test_fv5_torsion_published_is_that_of_twenty_elements_with_polar_moment():
    # 77.542 and 233.10 Hz: J = Ip, and 20 linear elements, which are too stiff by (kh)²/24.
    f = deep_beam(square(2.0, 5 / 6), 20)
    wave = np.sqrt(STEEL.G / STEEL.rho)
    for m, published, index in ((1, 77.542, 2), (3, 233.10, 6)):
        exact, kh = m * wave / 40, m * np.pi / 2 / 20
        assert f[index] / exact - 1 == pytest.approx(kh**2 / 24, rel=0.1 * kh**2 + 1e-3)
        assert f[index] == pytest.approx(
            published, abs=0.5 * 10.0 ** -(3 if m == 1 else 2) + 1e-4 * published
        )


def test_fv5_torsion_with_the_torsion_constant_of_a_square():
    # St Venant's J = 0.1406 a⁴ in place of a⁴/6; the published 213.61 is not quite three times 71.20 (213.59)
    n = 40
    f = deep_beam(Section.rectangle(2.0, 2.0), n)
    for m, published in ((1, 71.20), (3, 213.61)):
        predicted = (m * np.pi / 2 / n) ** 2 / 24
        nearest = f[np.argmin(abs(f - published))]
        assert nearest / published - 1 == pytest.approx(
            predicted, abs=0.005 / published + (2e-5 if m == 1 else 1e-4)
        )
