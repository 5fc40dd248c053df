"""Joints that depend on amplitude: harmonic balance against time integration; found from two force levels."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dovetail import load_study
from dovetail.pipeline import run
from fem import parameter_values, solve_steady
from fem.analysis.harmonic_balance import Receptances
from fem.effects import JointCubic, JointFriction, JointGap
from fem.io import write_npz
from tests.nonlinear import make_rig
from tests.studies import study_file
from updating import EFFECT, UNEXPLAINED, diagnose
from updating.inference import effect_unknowns

COMMON = {"name": "e", "joint": "bolt", "direction": "z", "amplitude": 1e-5}
ELEMENTS = {
    "cubic": JointCubic(**COMMON, cubic=3.0),
    "gap": JointGap(**COMMON, stiffness=0.6, gap=0.3),
    "friction": JointFriction(**COMMON, force=0.05),
}


def chain(omega):
    """Return receptances of three masses in a row, δ between the second and the third."""
    K = np.array([[2.0, -1.0, 0.0], [-1.0, 2.2, -1.0], [0.0, -1.0, 1.0]])
    C, M = 0.15 * K, np.diag([1.0, 1.2, 0.8])
    b = np.array([0.0, 1.0, -1.0])
    out, inn = np.column_stack([np.eye(3), b]), np.column_stack([np.eye(3)[:, :2], b])
    block = [out.T @ np.linalg.solve(K + 1j * w * C - w**2 * M, inn) for w in omega]
    return K, C, M, b, Receptances.of(np.array(block))


def test_duffings_oscillator_has_its_closed_form():
    """One mass: (k + ¾ k₃ a² - ω² m)² + (ω c)² = (F/a)² (Worden & Tomlinson, ch. 3), to bisection's 1e-10."""
    m, c, k, k3, F = 1.0, 0.05, 1.0, 0.02, 0.1
    omega = np.linspace(0.3, 2.0, 40)
    g = 1 / (k + 1j * omega * c - omega**2 * m)
    block = np.ones((40, 2, 2)) * g[:, None, None]
    element = JointCubic(**COMMON, cubic=k3)
    steady = solve_steady(element, F, Receptances.of(block))
    a = steady.amplitude[:, 0]
    left = (k + 0.75 * k3 * a**2 - omega**2 * m) ** 2 + (omega * c) ** 2
    np.testing.assert_allclose(left, (F / a) ** 2, rtol=1e-8)
    np.testing.assert_allclose(np.abs(steady.H[:, 0, 0]) * F, a, rtol=1e-8)


def test_solutions_beside_a_fold_are_found_however_close_they_are():
    """F² |h|² = |1 + κ a² g|² a² turns at the fold; just above it lies the highest solution."""
    k3, F = 2.0, 1.0
    kappa, above = 0.75 * k3, np.geomspace(1e-4, 1e-2, 20)
    g, above = np.meshgrid(0.15 * np.exp(-1j * np.linspace(2.7, 3.1, 60)), above)
    cubic, square = kappa**2 * np.abs(g) ** 2, 2 * kappa * g.real
    fold = (-square + np.sqrt(square**2 - 3 * cubic)) / (3 * cubic)
    s = fold * (1 + above)
    level = np.sqrt(s * (1 + s * (square + s * cubic)))
    block = np.ones((g.size, 2, 2), dtype=complex)
    block[:, 1, 1], block[:, 1, 0] = g.ravel(), level.ravel() / F
    steady = solve_steady(JointCubic(**COMMON, cubic=k3), F, Receptances.of(block))
    np.testing.assert_allclose(steady.amplitude[:, 0], np.sqrt(s).ravel(), rtol=1e-6)


def test_the_cubic_chain_vibrates_as_time_integration_says():
    """At two levels; what harmonic balance leaves out is what the third harmonic does to the first."""
    omega = np.array([0.35, 0.8, 1.6])
    K, C, M, b, part = chain(omega)
    element = ELEMENTS["cubic"]
    for F in (0.3, 1.0):
        H = solve_steady(element, F, part).H[:, :, 0]
        for n, w in enumerate(omega):

            def motion(t, y, w=w, F=F):
                x, v = y[:3], y[3:]
                inner = K @ x + C @ v + b * element.cubic * (b @ x) ** 3
                return np.concatenate([v, (np.array([F * np.cos(w * t), 0, 0]) - inner) / np.diag(M)])

            period = 2 * np.pi / w
            settle = np.ceil(700 / period) * period  # of the slowest motion e^{-0.075·0.2·700} is left
            t = settle + np.linspace(0, period, 257)[:-1]
            y = solve_ivp(motion, (0, t[-1]), np.zeros(6), "DOP853", t, rtol=1e-8, atol=1e-10).y
            first, third = (2 * (y[:3] * np.exp(-1j * k * w * t)).mean(axis=1) for k in (1, 3))
            left_out = 4 * abs(b @ third) / abs(b @ first)
            assert abs(first / F - H[n]).max() <= (left_out + 2e-3) * abs(H[n]).max()
            if n == 1:
                assert abs(part.H[n, :, 0] - H[n]).max() > 5 * abs(first / F - H[n]).max(), (
                    "makes no difference"
                )


@pytest.mark.parametrize("kind", ELEMENTS)
def test_slopes_are_differences(kind):
    omega = np.linspace(0.3, 1.7, 9)
    element, F = ELEMENTS[kind], 0.15
    *_, part = chain(omega)
    block = np.empty((9, 4, 3), dtype=complex)
    block[:, :-1, :-1], block[:, :-1, -1], block[:, -1, :-1], block[:, -1, -1] = (
        part.H,
        part.c,
        part.h,
        part.g,
    )
    rng = np.random.default_rng(1)
    change = rng.standard_normal((1, 9, 4, 3)) * block * 0.3
    names = tuple(p.name for p in element.parameters())
    steady = solve_steady(element, F, part)
    by_structure, by_own = steady.slopes(change.astype(complex), names)

    def at(x=0.0, **values):
        return solve_steady(element.with_values(**values), F, Receptances.of(block + x * change[0])).H

    def differences(function, step):
        near, far = (function(k * step) - function(-k * step) for k in (1, 2))
        return near / (2 * step), far / (4 * step)

    near, far = differences(at, 1e-5)
    # Central differences err by a third of what these two differ by; amplitudes are solved to 1e-10.
    rounding = 1e-9 * abs(steady.H).max() / 1e-5
    assert abs(by_structure[0] - near).max() <= abs(far - near).max() + rounding
    for i, p in enumerate(element.parameters()):
        step = 1e-5 * abs(p.value)
        near, far = differences(lambda s, p=p: at(**{p.name: p.value + s}), step)
        rounding = 1e-9 * abs(steady.H).max() / step
        assert abs(by_own[i] - near).max() <= abs(far - near).max() + rounding


@pytest.mark.parametrize("kind", ELEMENTS)
def test_a_force_that_does_not_move_the_joint_knows_nothing_of_it(kind):
    """Where h is 0 for one force, H' = H for it, whatever k is."""
    *_, part = chain(np.array([0.35, 0.8]))
    h = part.h.copy()
    h[:, 1] = 0.0
    part = replace(part, h=h)
    steady = solve_steady(ELEMENTS[kind], 1.0, part)
    np.testing.assert_allclose(steady.H[:, :, 1], part.H[:, :, 1], rtol=1e-12)
    assert not np.allclose(steady.H[:, :, 0], part.H[:, :, 0], rtol=1e-3)
    _, by_own = steady.slopes(
        np.zeros((0, 2, 4, 3), dtype=complex), tuple(p.name for p in ELEMENTS[kind].parameters())
    )
    assert not by_own[..., 1].any()


def test_friction_that_holds_is_a_rigid_joint():
    """Below F π/4 |g|/|h| nothing slides: δ = 0, as of a spring without bound."""
    omega = np.array([0.2, 0.3])
    *_, part = chain(omega)
    held = solve_steady(ELEMENTS["friction"].with_values(force=10.0), 0.1, part)
    assert not held.amplitude.any()
    stiff = solve_steady(JointGap(**COMMON, stiffness=1e9, gap=1e-12), 0.1, part)
    np.testing.assert_allclose(held.H, stiff.H, rtol=1e-6)


def slide(x, v):
    return 0.5 * np.tanh(1e10 * v)


TRUTHS = {
    "joint_cubic": (lambda x, v: 3e17 * x**3, (1.0, 20.0), {"cubic": 3e17}),
    "joint_gap": (
        lambda x, v: 3e7 * np.sign(x) * np.maximum(abs(x) - 2e-6, 0),
        (1.0, 20.0),
        {"stiffness": 3e7, "gap": 2e-6},
    ),
    "joint_friction": (slide, (2.0, 20.0), {"force": 0.5}),
}
SUDDEN = [kind for kind in TRUTHS if kind != "joint_cubic"]


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["two", "all"])
@pytest.mark.parametrize("kind", ["joint_cubic", *(pytest.param(k, marks=pytest.mark.slow) for k in SUDDEN)])
def test_what_depends_on_amplitude_is_found_from_two_force_levels(kind, every):
    """Truth with the third harmonic, on a finer mesh, with 1 % of noise in each part.

    Beside a linear spring in the joint, and among every kind of candidate.
    """
    kinds = None if every else (kind, "joint_stiffness")
    force, levels, values = TRUTHS[kind]
    rig = make_rig(force, levels)
    found = diagnose(rig.model, rig.measurements, rig.nuisances, kinds=kinds)
    assert found.gates is not None
    assert not found.gates.linear
    assert found.verdict == EFFECT
    (finding,) = found.findings
    assert (finding.effect.kind, finding.effect.where) == (kind, "joint bolt, z")
    for p in finding.parameters:
        # The third harmonic moves the joint too, and changes its first by a few per cent.
        assert abs(p.value - values[p.name]) < 3 * p.std + 0.05 * values[p.name]
    assert "2 force levels were fitted together" in found.reason
    assert found.frf(-1).H.shape == rig.measurements[0].frf.H.shape
    spread, expected = found.deviation(-1), spread_by_differences(found)
    assert spread is not None
    ratio = spread[SOME][expected > 0] / expected[expected > 0]
    # all but lines near a jump from one state to another, or where friction begins to slide
    assert np.quantile(np.abs(np.log(ratio)), 0.9) < 1e-3


SOME = slice(None, None, 9)


def spread_by_differences(found):
    """Return √(gᵀCg) of ln|H| at some lines, g from central differences over 1e-5 of what was fitted."""
    problem, fit = found.problem, found.steps[-1].result
    element, lines = fit.effects[-1], np.arange(len(found.measured.frequency))[SOME]
    own = effect_unknowns([element], [parameter_values(element)])
    ends = []
    units = np.ones(len(fit.covariance))
    variables = (*problem.function(fit.effects[:-1], [], lines).variables, *own)
    for k, v in enumerate(variables):
        units[k] = v.size
        of_x = np.sqrt(fit.covariance[k, k]) / v.size
        assert fit.std[v.ref] == pytest.approx(v.deviation(v.to_x(fit.values[v.ref]), of_x), rel=1e-6)
        for step in (1e-5, -1e-5):
            value = v.to_value(v.to_x(fit.values[v.ref]) + step)
            effect = element.with_values(**({v.ref[1]: value} if v.ref[0] == element.name else {}))
            ends.append(replace(fit, values={**fit.values, v.ref: value}, effects=(effect,)))
    turns = [np.exp(s * np.eye(len(fit.zeta))[k]) for k in range(len(fit.zeta)) for s in (1e-5, -1e-5)]
    ends += [replace(fit, zeta=fit.zeta * turn) for turn in turns]
    size = np.array([np.log(np.abs(problem.receptance(r, lines))) for r in ends])
    g = (size[::2] - size[1::2]) / 2e-5 / units[:, None, None, None]
    return np.sqrt(np.einsum("ifop,ij,jfop->fop", g, fit.covariance, g))


@pytest.mark.slow
def test_of_a_joint_that_moves_harmonically_the_cubic_spring_is_found_as_it_is():
    """Without noise and third harmonic the mesh is left: element lengths of a half give 1/16 of its error."""
    force, levels, values = TRUTHS["joint_cubic"]
    rig = make_rig(force, levels, noise=0.0, third=False)
    found = diagnose(rig.model, rig.measurements, rig.nuisances, kinds=["joint_cubic"])
    (p,) = found.findings[0].parameters
    assert p.value == pytest.approx(values["cubic"], rel=0.02)


def test_without_stated_forces_the_gate_fails_and_nothing_is_called_right():
    force, levels, _ = TRUTHS["joint_cubic"]
    rig = make_rig(force, levels)
    silent = [replace(m, force_level=None) for m in rig.measurements]
    found = diagnose(rig.model, silent, rig.nuisances, kinds=["joint_stiffness", "joint_cubic"])
    assert found.verdict == UNEXPLAINED
    assert any("states its force_level" in note for note in found.notes)
    linear = make_rig(lambda x, v: 0.0 * x, (1.0, 20.0), seed=3)
    found = diagnose(
        linear.model, linear.measurements, linear.nuisances, kinds=["joint_stiffness", "joint_cubic"]
    )
    assert found.gates is not None
    assert found.gates.linear
    assert found.verdict == "nothing missing"


STUDY = """
[materials.steel]
E = 210e9
rho = 7850.0
[points]
a = [-0.4, 0.0, 0.0]
b = [0.4, 0.0, 0.0]
c = [0.0, -0.4, 0.01]
d = [0.0, 0.4, 0.01]
[defaults]
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.01 }
orientation = "z"
[members.lower]
from = "a"
to = "b"
[members.upper]
from = "c"
to = "d"
[[joints]]
name = "bolt"
member1 = "lower"
position1 = 0.4
member2 = "upper"
position2 = 0.4
location = [0.0, 0.0, 0.005]
k = { kx = 5e7, ky = 5e7, kz = 1e7, krx = 3e3, kry = 3e3, krz = 5e3 }
eta = 0.006
[damping]
modal = 0.004
[uncertain]
E = 0.02
rho = 0.01
joints = 0
damping = 0.5
[candidates]
kinds = ["joint_stiffness", "joint_cubic", "joint_friction"]
"""


@pytest.mark.slow
def test_a_study_finds_it_from_its_files_and_writes_a_study_that_can_be_read(tmp_path):
    force, levels, values = TRUTHS["joint_cubic"]
    rig = make_rig(force, levels)
    text = STUDY
    for s in rig.measurements[0].sensors:
        text += f'[[sensors]]\nname = "{s.name}"\npoint = {s.point.tolist()}\ndirection = "z"\n'
    for e in rig.measurements[0].excitations:
        text += f'[[excitations]]\nsensor = "{e.name}"\n'
    for k, m in enumerate(rig.measurements):
        write_npz(tmp_path / f"level{k}.npz", m.frf)
        text += f'[[measurements]]\nfile = "level{k}.npz"\nforce_level = {m.force_level}\n'
    path = study_file(tmp_path, text)
    study = load_study(path)
    done = run(study, tmp_path / "out")
    (finding,) = done.diagnosis.findings
    assert finding.effect.name == "joint_cubic:bolt.z"
    assert finding.parameters[0].value == pytest.approx(values["cubic"], rel=0.15)
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Checks of the measurement" in report
    assert "joint cubic" in report
    assert "measured and computed" in report
    assert "shaded, the 95 % band of the last one's parameters" in report
    again = load_study(tmp_path / "out" / "found.toml").model.effect("known joint_cubic:bolt.z")
    assert isinstance(again, JointCubic)
    assert again.cubic == pytest.approx(finding.parameters[0].value)
    assert isinstance(finding.effect, JointCubic)
    assert again.amplitude == pytest.approx(finding.effect.amplitude)
