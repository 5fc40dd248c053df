"""The exact generator against closed forms, and the elements against it with the error predicted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import fem
from benchmarks.validation import spectral as sp
from benchmarks.validation.frames import build_model, constant_loss, draw_draft
from benchmarks.validation.truth import (
    Attached,
    Cut,
    EndSpring,
    Member,
    Reading,
    Stretch,
    TrueFrame,
    TrueSupport,
    rectangle_constants,
)
from fem import assemble
from tests.frames import rows_at

E, NU, RHO, B, H, L = 70e9, 0.3, 2700.0, 0.03, 0.01, 0.8
A, IY, IZ, J = rectangle_constants(B, H)
G = E / (2 * (1 + NU))
NEVER = 1e12  # shear stiffness, in multiples of the real one, of a beam that does not shear


def cantilever(**changes):
    bar = Member(np.zeros(3), np.array([L, 0, 0]), B, H, E, NU, RHO, 0.0)
    clamp = TrueSupport("S", Cut("a", 0.0))
    return TrueFrame({"a": replace(bar, **changes)}, supports=(clamp,))


def tip(frame, f, direction=(0.0, 0.0, 1.0), at=L, force_at=L):
    read = Reading("r", Cut("a", at), np.array(direction))
    force = Reading("f", Cut("a", force_at), np.array(direction))
    return frame.frf(np.atleast_1d(f), (read,), (force,))[:, 0, 0]


def resonance(frame, near, direction=(0.0, 0.0, 1.0)):
    return brentq(lambda f: (1 / tip(frame, f, direction)).real[0], 0.995 * near, 1.005 * near, xtol=1e-9)


def test_constants_of_the_rectangle_are_those_of_the_sections():
    s = fem.Section.rectangle(B, H)
    np.testing.assert_allclose(
        [A, IY, IZ, J], [s.A, s.Iy, s.Iz, s.J], rtol=5e-9
    )  # their series ends at n = 59


def test_static_limit_of_a_cantilever():
    flexibility = L**3 / (3 * E * IY) + L / (5 / 6 * G * A)
    f = 0.05  # below the first resonance, f1 = 12.9 Hz, by so much that ω² adds 1.03 (f/f1)² = 1.5e-5
    assert tip(cantilever(), f)[0].real == pytest.approx(flexibility, rel=2e-5)
    axial = tip(cantilever(), f, (1.0, 0, 0))[0].real
    assert axial == pytest.approx(L / (E * A), rel=1e-8)


def euler():
    """Return the four-by-four of a beam without shear and rotary inertia."""
    return lambda f: sp.beam(
        2 * np.pi * np.atleast_1d(f), L, np.array(NEVER), np.array(E * IY), np.array(RHO * A), np.array(0.0)
    )


@pytest.mark.parametrize("root", [1.875104068711961, 4.694091132974175, 7.854757438237613])
def test_cantilever_without_shear_has_the_published_roots(root):
    exact = root**2 * np.sqrt(E * IY / (RHO * A)) / L**2 / (2 * np.pi)
    Z = euler()
    found = brentq(lambda f: np.linalg.det(Z(f)[0][2:, 2:]).real, 0.9999 * exact, 1.0001 * exact, xtol=1e-10)
    # The shear stiffness left in: relative error of order EI (β²)/kGA = 5e-10 · root².
    assert found == pytest.approx(exact, rel=1e-7)


def test_simply_supported_beam_under_tension():
    N = 2000.0
    for n in (1, 2, 5):
        beta = n * np.pi / L
        exact = np.sqrt((E * IY * beta**4 + N * beta**2) / (RHO * A)) / (2 * np.pi)

        def determinant(f):
            w = 2 * np.pi * np.atleast_1d(f)
            Z = sp.beam(w, L, np.array(NEVER), np.array(E * IY), np.array(RHO * A), np.array(0.0), N)
            return np.linalg.det(Z[0][np.ix_([1, 3], [1, 3])]).real

        found = brentq(determinant, 0.999 * exact, 1.001 * exact, xtol=1e-10)
        assert found == pytest.approx(exact, rel=1e-7)


def test_simply_supported_timoshenko_beam_has_both_spectra():
    kGA, EI, m, j = 5 / 6 * G * A, E * IY, RHO * A, RHO * IY
    beta = 3 * np.pi / L
    # w = sin βx, ψ = cos βx in the equations of `beam` leave a quadratic in ω².
    p = [m * j, -(m * (EI * beta**2 + kGA) + j * kGA * beta**2), kGA * EI * beta**4]
    for omega in np.sqrt(np.roots(p)):
        exact = omega / (2 * np.pi)

        def determinant(f):
            Z = sp.beam(
                2 * np.pi * np.atleast_1d(f), L, np.array(kGA), np.array(EI), np.array(m), np.array(j)
            )
            return np.linalg.det(Z[0][np.ix_([1, 3], [1, 3])]).real

        near = np.array([1 - 1e-6, 1 + 1e-6]) * exact
        assert determinant(near[0]) * determinant(near[1]) < 0


def test_rod_and_shaft():
    c = np.sqrt(E / RHO)
    frame = cantilever()
    assert resonance(frame, c / (4 * L), (1.0, 0, 0)) == pytest.approx(c / (4 * L), rel=1e-9)


def test_elements_without_shear_are_too_stiff_by_what_is_predicted():
    n = 12
    mesh = fem.Mesh.from_lines([[0, 0, 0], [L, 0, 0]], [[0, 1]], {"a": [0]}).refined(counts={"a": n})
    p = fem.MemberProperties(
        fem.Material("m", E, RHO, NU), fem.Section.rectangle(B, H), theory="euler-bernoulli"
    )
    model = fem.Model(mesh, (fem.Frame(members={"a": p}), fem.Support(name="S", point=0)))
    modes = fem.solve_modes(assemble(model), max_frequency=900.0)
    vertical = [f for f, s in zip(modes.frequency, modes.shapes.T, strict=True) if abs(s[6 * n + 2]) > 1.0]
    Z = euler()
    for f in vertical[2:6]:
        exact = brentq(lambda g: np.linalg.det(Z(g)[0][2:, 2:]).real, 0.98 * f, 1.001 * f, xtol=1e-9)
        beta = np.sqrt(2 * np.pi * exact * np.sqrt(RHO * A / (E * IY)))
        predicted = (beta * L / n) ** 4 / 1440
        assert f / exact - 1 == pytest.approx(predicted, rel=0.06)  # next term: of relative order (βh)²/10


@pytest.mark.parametrize("family", ["lap", "bolted_portal", "ladder"])
def test_elements_converge_to_the_exact_frame(family):
    rng = np.random.default_rng(11)
    draft = draw_draft(rng, family, small=True)
    eta = 0.05
    frame = replace(
        draft.frame,
        members={n: replace(m, loss=eta) for n, m in draft.frame.members.items()},
        joints=tuple(replace(j, law=constant_loss(eta)) for j in draft.frame.joints),
        attached=tuple(replace(a, law=constant_loss(eta)) for a in draft.frame.attached),
    )
    f = draft.frequency[10::20]
    exact = frame.frf(f, draft.sensors, draft.drives)
    heard = np.abs(exact) > 1e-3 * np.abs(exact).max()
    H = []
    for n in (10, 20, 40):
        model = build_model(draft.frame, draft.materials, draft.sensors, n)
        model = replace(model, damping=fem.Damping.structural(eta))
        rows = [rows_at(model, draft.frame, group) for group in (draft.sensors, draft.drives)]
        H.append(fem.compute_frf(assemble(model), f, *rows, "receptance", method="direct").H)
    coarse, middle, fine = (np.linalg.norm((h - exact)[heard] / exact[heard]) for h in H)
    # Order h² from shear and stretching at least, h⁴ from bending: each halving divides by 4 to 16.
    assert 3.4 < middle / fine < 17
    assert 3.0 < coarse / middle < 20
    assert fine / np.sqrt(heard.sum()) < 0.02


def test_receptances_are_reciprocal_and_do_not_depend_on_cuts():
    rng = np.random.default_rng(4)
    draft = draw_draft(rng, "tower", small=True)
    frame = replace(draft.frame, alpha=5.0, beta=1e-6)
    some = draft.sensors[:4]
    H = frame.frf(draft.frequency[::40], some, some)
    np.testing.assert_allclose(H, H.transpose(0, 2, 1), rtol=1e-6, atol=1e-9 * np.abs(H).max())
    nothing = tuple(Attached(Cut("C1", x)) for x in (0.05, 0.11, 0.2))
    again = frame.with_attached(*nothing).frf(draft.frequency[::40], some, some)
    np.testing.assert_allclose(H, again, rtol=1e-6, atol=1e-9 * np.abs(H).max())


def test_a_crack_an_end_spring_a_soft_stretch_and_a_foot_bend_the_cantilever_by_what_they_should():
    f, k, x = 0.05, 300.0, 0.3
    rigid = tip(cantilever(), f)[0].real
    inertia = 2e-5 * rigid  # as in the static limit
    crack = cantilever(springs=(EndSpring(x, 4, k),))
    assert tip(crack, f)[0].real - rigid == pytest.approx((L - x) ** 2 / k, rel=1e-4, abs=inertia)
    root = cantilever(springs=(EndSpring(0.0, 4, k),))
    assert tip(root, f)[0].real - rigid == pytest.approx(L**2 / k, rel=1e-4, abs=inertia)
    foot = cantilever().with_support(
        "S", rigid=(True, True, True, True, False, True), K=np.diag([0, 0, 0, 0, k, 0.0])
    )
    assert tip(foot, f)[0].real == pytest.approx(tip(root, f)[0].real, rel=1e-9)
    soft = cantilever(stretches=(Stretch(0.2, 0.4, E=0.5),))
    more = ((L - 0.2) ** 3 - (L - 0.4) ** 3) / (3 * E * IY) + 0.2 / (5 / 6 * G * A)
    assert tip(soft, f)[0].real - rigid == pytest.approx(more, rel=1e-4, abs=inertia)


def test_a_rigid_zone_shortens_the_beam_and_keeps_its_mass():
    f, zone = 0.05, 0.1
    frame = cantilever(zone1=zone)
    short = (L - zone) ** 3 / (3 * E * IY) + (L - zone) / (5 / 6 * G * A)
    assert tip(frame, f)[0].real == pytest.approx(short, rel=2e-5)
    assert tip(frame, f, at=zone / 2)[0] == 0  # clamped with the foot
    free = TrueFrame({"a": frame.members["a"]})
    # A free bar well below its first resonance moves as a rigid body: -1/(ω² m) at its middle.
    middle = tip(free, 0.5, at=L / 2, force_at=L / 2)[0].real
    assert middle * (2 * np.pi * 0.5) ** 2 == pytest.approx(-1 / (RHO * A * L), rel=1e-3)


def test_gyroscopic_coupling_breaks_reciprocity():
    # A wheel that spins about x couples the rotations about y and z, the bending in both planes.
    one, two = (
        Reading(n, Cut("a", x), np.array(d)) for n, x, d in (("y", L, [0, 1.0, 0]), ("z", L, [0, 0, 1.0]))
    )
    C = np.zeros((6, 6))
    C[3:, 3:] = 0.05 * np.array([[0, 0, 0], [0, 0, 1], [0, -1, 0]])
    frame = cantilever().with_attached(Attached(Cut("a", 0.7 * L), C=C))
    H = frame.frf(np.linspace(20, 200, 7), (one, two), (one, two))
    np.testing.assert_allclose(H[:, 0, 1], -H[:, 1, 0], rtol=1e-6)
    assert (np.abs(H[:, 0, 1]) > 1e-9).all()


def test_what_cannot_be_assembled_is_refused():
    bar = cantilever().members["a"]
    frame = TrueFrame({"a": bar}, supports=(TrueSupport("S", Cut("a", 0.0)), TrueSupport("T", Cut("a", 0.0))))
    with pytest.raises(sp.SpectralError, match="second node of connections 0 and 1"):
        tip(frame, 1.0)
    with pytest.raises(sp.SpectralError, match="must be above 0"):
        tip(cantilever(), 0.0)
