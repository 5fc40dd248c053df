"""What a dynamic stiffness is made of: every law is told from the others, and becomes an effect."""

import numpy as np
import pytest

from fem import Joint, Viscoelastic, assemble
from joint import effects_of, explain_stiffness
from tests.frames import cross_beam
from tests.noise import complex_normal

FREQUENCY = np.linspace(10.0, 1000.0, 200)
OMEGA = 2 * np.pi * FREQUENCY
S = 1j * OMEGA
CASES = {
    ("K",): (2e6 + 0 * S, {"K": 2e6}),
    ("M",): (0.3 * S**2, {"M": 0.3}),
    ("K", "M"): (2e6 + 0.1 * S**2, {"K": 2e6, "M": 0.1}),
    ("K", "C"): (2e6 + 100 * S, {"K": 2e6, "C": 100.0}),
    ("K", "D"): (2e6 * (1 + 0.1j) + 0 * S, {"K": 2e6, "D": 2e5}),
    ("K", "C", "D"): (2e6 * (1 + 0.1j) + 100 * S, {"K": 2e6, "C": 100.0, "D": 2e5}),
    ("zener",): (2e6 * (1 + 3 * S * 1e-3 / (1 + S * 1e-3)), {"stiffness": 2e6, "ratio": 3.0, "tau": 1e-3}),
    ("fractional_kelvin_voigt",): (
        2e6 * (1 + (S * 1e-3) ** 0.4),
        {"stiffness": 2e6, "tau": 1e-3, "alpha": 0.4},
    ),
    ("fractional_zener",): (
        2e6 * (1 + 20 * (S * 1e-4) ** 0.6 / (1 + (S * 1e-4) ** 0.6)),
        {"stiffness": 2e6, "ratio": 20.0, "tau": 1e-4, "alpha": 0.6},
    ),
}


def noisy(z, level, seed=0):
    rng = np.random.default_rng(seed)
    size = level * np.sqrt((abs(z) ** 2).mean())
    return z + size * complex_normal(rng, z.shape) / np.sqrt(2)


@pytest.mark.parametrize("kinds", CASES, ids="+".join)
def test_each_law_is_told_from_the_others(kinds):
    z, truth = CASES[kinds]
    (found,) = explain_stiffness(FREQUENCY, noisy(z, 0.005)[:, None, None], ["x"])
    assert found.best.kinds == kinds
    assert found.explained
    for name, value in truth.items():
        assert abs(found.best.values[name] - value) < 4.5 * found.best.std[name]


def test_wild_lines_do_not_decide():
    """A tenth of the lines off by twenty times the stiffness, as at badly conditioned ones."""
    z = noisy(CASES[("K", "D")][0], 0.01)
    rng = np.random.default_rng(1)
    z[rng.choice(200, 20, replace=False)] *= 20
    (found,) = explain_stiffness(FREQUENCY, z[:, None, None], ["x"])
    assert found.best.kinds == ("K", "D")
    assert found.best.values["K"] == pytest.approx(2e6, rel=0.01)


def test_what_no_law_explains_is_said():
    resonance = 1e6 / (1 - (FREQUENCY / 400) ** 2 + 0.05j)
    (found,) = explain_stiffness(FREQUENCY, resonance[:, None, None], ["x"])
    assert not found.explained
    assert "no law explains it" in found.sentence


def test_rivals_are_named_where_the_band_is_too_narrow():
    """Over a twentieth of an octave viscous and structural damping look alike."""
    lines = np.linspace(500.0, 515.0, 60)
    z = noisy(2e6 * (1 + 0.1j) + np.zeros(60), 0.01)
    (found,) = explain_stiffness(lines, z[:, None, None], ["x"])
    assert {r.kinds for r in found.rivals} | {found.best.kinds} >= {("K", "C"), ("K", "D")}
    assert "cannot be distinguished from" in found.sentence


def test_the_effects_have_the_stiffness_that_was_found():
    model = cross_beam(0.2)
    joint = model.effect("bolt")
    Z = np.zeros((200, 6, 6), dtype=complex)
    Z[:, [0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]] = np.stack(
        [CASES[("zener",)][0]] + [CASES[("K", "D")][0]] * 5, axis=1
    )
    laws = explain_stiffness(FREQUENCY, noisy(Z, 1e-3))
    effects = effects_of(laws, "found", joint.point1, joint.point2, joint.location)
    assert [type(e) for e in effects] == [Joint, Viscoelastic]
    bare = model.without_effect("bolt")
    added = bare.with_effect(*effects)
    omega = OMEGA[60]
    extra = assemble(added).dynamic_stiffness(omega) - assemble(bare).dynamic_stiffness(omega)
    dofs, B = joint.relative(model)
    static = np.diag([CASES[("zener",)][0].real[0], *[2e6] * 5]) * 1j * model.damping.loss_factor
    expected = B.T @ (np.diag(np.diag(Z[60])) + static) @ B
    got = extra.toarray()[np.ix_(dofs, dofs)]
    assert abs(got - expected).max() < 5e-3 * abs(expected).max()


def test_too_few_lines_are_refused():
    with pytest.raises(ValueError, match="at least 8 are needed"):
        explain_stiffness(FREQUENCY[:5], np.ones((5, 1, 1)), ["x"])
