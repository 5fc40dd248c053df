"""Set-ups with shared sensors are merged to the shapes that all sensors together would have."""

from dataclasses import replace

import numpy as np
import pytest

from fem import Modes
from tests.updating.test_ambient import FREQUENCY, RATE, SHAPES, ZETA, N, chain, within_chance
from updating import AmbientError, identify_ambient, merge_set_ups

NAMES = ("m1", "m2", "m3", "m4")


def set_up(seed, channels, n=8000):
    y = chain(n, seed)[:, [NAMES.index(c) for c in channels]]
    return identify_ambient(y, RATE, channels, band=(1, 16))


@pytest.fixture(scope="module")
def identified():
    return set_up(0, NAMES)


def part(found, channels, factors, modes=range(N), shift=1.0):
    """Return the exact shapes at some masses, of any scale and with no deviation, as if identified."""
    rows, modes = [NAMES.index(c) for c in channels], list(modes)
    psi = SHAPES[np.ix_(rows, modes)] * np.array(factors)[modes]
    small = np.full(len(modes), 1e-4)
    return replace(
        found,
        modes=Modes(shift * FREQUENCY[modes], np.real(psi), np.full(len(modes), ZETA), tuple(channels)),
        complex_shapes=psi.astype(complex),
        frequency_std=FREQUENCY[modes] * 1e-3,
        zeta_std=small,
        shape_std=np.full(psi.shape, 1e-4),
    )


def true_shapes():
    return SHAPES / SHAPES[np.argmax(np.abs(SHAPES), axis=0), range(N)]


def test_exact_parts_of_any_scale_are_joined_exactly_along_a_chain_of_shared_sensors(identified):
    scales = np.array([[1, 2, -3, 0.5], [-2, 1j, 1, 4], [0.1, -1, 5, 1 + 1j]])
    parts = (("m1", "m2"), ("m2", "m4"), ("m4", "m3"))
    merged = merge_set_ups([part(identified, c, s) for c, s in zip(parts, scales, strict=True)])
    assert merged.modes.labels == ("m1", "m2", "m4", "m3")
    np.testing.assert_allclose(merged.modes.shapes, true_shapes()[[0, 1, 3, 2]], atol=1e-9)
    assert merged.modes.frequency == pytest.approx(FREQUENCY)
    assert merged.members == tuple({0: k, 1: k, 2: k} for k in range(N))


def test_a_shared_sensor_on_a_node_of_a_mode_does_not_tell_its_scale(identified):
    """The second mode of the chain does not move the third mass."""
    assert abs(SHAPES[2, 1]) < 1e-12
    merged = merge_set_ups([part(identified, c, np.ones(N)) for c in (("m1", "m3"), ("m3", "m4"))])
    assert merged.shape_std[:, 1].max() > 0.3
    assert merged.shape_std[:, [0, 2, 3]].max() < 0.01


def test_a_mode_that_a_set_up_has_not_found_has_gaps_there(identified):
    one = part(identified, ("m1", "m2", "m4"), np.ones(N))
    two = part(identified, ("m2", "m3", "m4"), np.ones(N), modes=[0, 1, 3])
    merged = merge_set_ups([one, two])
    assert merged.members[2] == {0: 2}
    assert np.isnan(merged.modes.shapes[:, 2]).tolist() == [False, False, False, True]  # m3 is last
    assert merged.modes.labels == ("m1", "m2", "m4", "m3")
    assert np.isfinite(merged.relative_std()[1]).all()


def test_of_two_close_modes_each_keeps_its_partner_by_the_shared_sensors(identified):
    """Both are within each other's half-power band, and in the second set-up they have changed places."""
    one, two = (part(identified, c, np.ones(N)) for c in (("m1", "m2", "m4"), ("m2", "m3", "m4")))
    f = np.array([5.0, 5.02, 8.0, 9.0])
    one = replace(one, modes=replace(one.modes, frequency=f))
    two = replace(
        two,
        modes=replace(two.modes, frequency=f, shapes=two.modes.shapes[:, [1, 0, 2, 3]]),
        complex_shapes=two.complex_shapes[:, [1, 0, 2, 3]],
    )
    merged = merge_set_ups([one, two])
    assert {tuple(g.items()) for g in merged.members[:2]} == {((0, 0), (1, 1)), ((0, 1), (1, 0))}
    assert (merged.agreement > 0.999).all()


def test_scattering_frequencies_have_larger_deviations(identified):
    one, two = (
        part(identified, c, np.ones(N), shift=f) for c, f in ((("m1", "m2"), 1.004), (("m2", "m3"), 0.996))
    )
    merged = merge_set_ups([one, two])
    # two values ± 4 deviations about their mean: √(2·4²/1) = 5.7 of the stated, and the mean ± 4
    assert merged.scatter == pytest.approx(np.full(N, 4 * np.sqrt(2)), rel=1e-6)
    assert merged.frequency_std == pytest.approx(4e-3 * FREQUENCY, rel=1e-6)


def test_set_ups_that_share_no_sensor_are_refused(identified):
    with pytest.raises(AmbientError, match=r"set-up 2 \(m3, m4\) shares no sensor"):
        merge_set_ups([part(identified, c, np.ones(N)) for c in (("m1", "m2"), ("m3", "m4"))])


def test_shapes_of_two_simulated_set_ups_scatter_about_the_closed_form_as_stated():
    scores = []
    for seed in range(6):
        merged = merge_set_ups(
            [set_up(2 * seed, ("m1", "m2", "m4")), set_up(2 * seed + 1, ("m4", "m3", "m2"))]
        )
        assert merged.modes.n_modes == N
        assert merged.modes.labels == ("m1", "m2", "m4", "m3")
        true, phi = SHAPES[[0, 1, 3, 2]], merged.modes.shapes
        true = true * np.sign((true * phi).sum(axis=0))
        size = np.linalg.norm(phi, axis=0)
        scores.append((phi / size - true / np.linalg.norm(true, axis=0)) / (merged.shape_std / size))
    every = np.array(scores)
    assert within_chance(every[:, 0].ravel())  # m1 and m3 were in one set-up each
    assert within_chance(every[:, 3].ravel())
