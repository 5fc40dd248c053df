"""FRFs and the bound of their error, against a solution of every line with the full matrices."""

from dataclasses import replace

import numpy as np
import pytest

from fem import (
    Damping,
    Frame,
    FRFError,
    Joint,
    MemberProperties,
    Viscoelastic,
    Zener,
    assemble,
    compute_frf,
    dof_vectors,
    frf_blocks,
    solve_modes,
)
from fem.reduction import LocalChanges, ParametricFRF, reduce_model
from tests.frames import FLAT, STEEL, cross_beam
from tests.random_frames import random_frame

AT = [(1, "x"), (1, "y"), (2, "z"), (3, "rx"), (4, "z"), (4, "ry")]
IN = [(2, "z"), (4, "x")]

DAMPING = {
    "undamped": Damping(),
    "structural": Damping.structural(0.01),
    "rayleigh": Damping.rayleigh(20.0, 1e-5),
    "modal": Damping.modal([0.01, 0.03], [0.0, 500.0]),
}


def frame(seed, *, free, local):
    """Return a frame of steel shapes, soft and stiff dampers, and a viscoelastic element."""
    model = random_frame(seed, size=0.3, split=3, foot=False)
    points, effects = model.mesh.points, []
    if not free:
        effects.append(Joint(name="foot", point1=0, location=points[0], K=np.diag([1e5] * 3 + [1e3] * 3)))
    if local:
        scale = 10.0 ** np.random.default_rng(seed).uniform(-1, 4)
        C = scale * np.diag([1.0, 0, 2.0, 0, 0.05, 0.1])
        K = np.diag([1e6, 1e5, 1e6, 1e3, 1e3, 1e3])
        effects += [
            Joint(name="damper", point1=1, point2=3, location=points[1], C=C),
            Viscoelastic(name="rubber", point1=3, point2=4, location=points[4], K=K, law=Zener(3.0, 1e-3)),
        ]
        if not free:
            effects.append(Joint(name="lossy", point1=2, location=points[2], K=0.1 * K, eta=0.3))
    return model.with_effect(*effects)


def exact(system, f):
    """Return receptances by dense solutions; modal ratios on all modes of the undamped system."""
    out, inn = (system.Q.T @ dof_vectors(system.model, s)[0] for s in (AT, IN))
    more = np.zeros(system.K.shape)
    ratio = system.model.damping.ratio
    if ratio.any():
        modes = solve_modes(system, system.n_free)
        phi = system.M @ (system.Q.T @ modes.shapes)
        more = (phi * (2 * modes.omega * system.model.damping.ratio_at(modes.frequency))) @ phi.T
    H = []
    for w in 2 * np.pi * f:
        Z = system.dynamic_stiffness(w).toarray() + 1j * w * more
        scale = 1 / np.sqrt(abs(Z.diagonal()))
        H.append(out.T @ (scale[:, None] * np.linalg.solve(Z * np.outer(scale, scale), scale[:, None] * inn)))
    return np.array(H)


ROUNDING = 2e-8
"""Of the peak: the highest ω² is 10⁸ times the lowest that is asked for, and a resonance adds its 1/η."""


@pytest.mark.parametrize("method", ["reduced", "modal", "rough"])
@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize("local", [False, True], ids=["plain", "local"])
@pytest.mark.parametrize("free", [False, True], ids=["supported", "free"])
def test_the_bound_holds_and_is_of_use(free, local, damping, method):
    ratios = []
    for seed in range(2):
        system = assemble(frame(seed, free=free, local=local).with_damping(DAMPING[damping]))
        elastic = solve_modes(system, 20).frequency
        elastic = elastic[elastic > 1e-3 * elastic[-1]]
        # not at a resonance, where an undamped response is infinite
        f = np.setdiff1d(np.linspace(0.5 * elastic[0], elastic[8], 40), elastic)
        how = ("reduced", 0.3) if method == "rough" else (method, 1e-5)
        frf = compute_frf(system, f, AT, IN, "receptance", how[0], tolerance=how[1])
        H, accuracy = exact(system, f), frf.accuracy
        error, peak = abs(frf.H - H), abs(H).max(axis=0)
        assert (error <= accuracy.bound + ROUNDING * peak).all()
        if damping != "modal" and method != "modal":
            assert accuracy.reached
            assert (error.max(axis=0) <= how[1] * peak).all()
        seen = error.max(axis=0) > 100 * ROUNDING * peak
        ratios.append(accuracy.bound.max(axis=0)[seen] / error.max(axis=0)[seen])
    if damping != "modal" and (method == "rough" or not local):
        # Schwarz' inequality gives away the angle between what is left of a force and of a response, twice
        # where dampers pass it on.
        assert np.median(np.concatenate([np.ones(1), *ratios])) < (300 if local else 50)


def small(**more):
    return assemble(cross_beam(0.1, **more))


def test_accuracy_follows_the_data():
    f = np.array([20.0, 150.0, 400.0, 777.0])
    frf = compute_frf(small(), f, AT, IN, "receptance", tolerance=1e-2)
    accuracy = frf.accuracy
    assert (accuracy.method, accuracy.reached) == ("reduced", True)
    assert accuracy.bound.shape == frf.H.shape
    assert 0 < accuracy.worst <= accuracy.tolerance == 1e-2
    some = frf.select(outputs=frf.outputs[2:4], inputs=frf.inputs[1:], band=(100.0, 500.0))
    np.testing.assert_array_equal(some.accuracy.bound, accuracy.bound[1:3, 2:4, 1:])
    changed = some.as_kind("accelerance").accuracy
    np.testing.assert_allclose(changed.bound, some.accuracy.bound * some.omega[:, None, None] ** 2)


def test_more_forces_than_responses_change_places():
    f = np.linspace(20.0, 900.0, 30)
    one, other = compute_frf(small(), f, AT, IN), compute_frf(small(), f, IN, AT)
    np.testing.assert_array_equal(np.swapaxes(other.H, 1, 2), one.H)
    np.testing.assert_array_equal(np.swapaxes(other.accuracy.bound, 1, 2), one.accuracy.bound)
    assert other.inputs == one.outputs


def test_a_lower_tolerance_takes_more_vectors():
    f = np.linspace(20.0, 900.0, 30)
    results = [compute_frf(small(), f, AT, IN, tolerance=10.0**-k).accuracy for k in (1, 4, 8)]
    assert all(a.reached for a in results)
    assert results[0].n_vectors < results[1].n_vectors < results[2].n_vectors


def test_direct_is_chosen_where_it_is_cheaper_or_the_bound_stays_above():
    system = small()
    assert system.n_free < 1000
    assert compute_frf(system, [100.0], AT, IN).accuracy.method == "reduced"
    assert compute_frf(assemble(cross_beam(0.005)), [100.0], AT, IN).accuracy.method == "direct"
    # 10⁻¹⁷ is below rounding; all vectors of the small system do not meet it
    accuracy = compute_frf(system, np.linspace(20.0, 900.0, 30), AT, IN, tolerance=1e-17).accuracy
    assert accuracy.method == "direct" or accuracy.n_vectors == system.n_free


def test_modes_that_span_everything_have_no_error():
    system = small(eta=0.0)
    f = np.linspace(20.0, 900.0, 12)
    frf = compute_frf(system, f, AT, IN, method="modal", n_modes=system.n_free)
    exact = compute_frf(system, f, AT, IN, method="direct").H
    assert frf.accuracy.worst == 0.0
    assert (abs(frf.H - exact).max(axis=0) < 1e-7 * abs(exact).max()).all()


@pytest.mark.parametrize("every", [False, True], ids=["some", "every DOF"])
@pytest.mark.parametrize("local", [False, True], ids=["plain", "local"])
def test_blocks_are_the_frfs(every, local, tmp_path, monkeypatch):
    monkeypatch.setattr("fem.analysis.receptance._CHUNK", 5_000)
    system = small(eta=0.1 if local else 0.0, C=np.diag([30.0, 0, 40.0, 0, 0.5, 2.0]) if local else None)
    f = np.linspace(20.0, 900.0, 23)
    out = inn = range(system.model.n_dof)
    if not every:
        out, inn = AT, IN
    exact = compute_frf(system, f, out, inn, method="direct").H
    shape = (f.size, len(out), len(inn))
    whole = np.lib.format.open_memmap(tmp_path / "H.npy", "w+", complex, shape)
    slices = [lines for lines, _ in frf_blocks(system, f, out, inn, out=whole)]
    np.testing.assert_array_equal(np.concatenate([np.arange(f.size)[s] for s in slices]), np.arange(f.size))
    if every:
        assert len(slices) > 5
    single = np.concatenate([H.copy() for _, H in frf_blocks(system, f, out, inn)])
    np.testing.assert_array_equal(single, whole)
    level = abs(exact).max(axis=0)
    level = np.maximum(level, 1e-3 * level.max())  # some are zero by symmetry
    assert (abs(whole - exact) < 2e-5 * level).all()


def test_blocks_need_an_array_that_fits():
    with pytest.raises(FRFError, match=r"complex64 \(3, 6, 2\); complex128 \(3, 6, 2\) is needed"):
        next(frf_blocks(small(), [1.0, 2.0, 3.0], AT, IN, out=np.empty((3, 6, 2), np.complex64)))


def local_changes():
    """Return the state of changes at the joint of a cross beam, and a function that solves a change anew."""
    model, f = cross_beam(0.1), np.linspace(20.0, 900.0, 40)
    out, inn = (dof_vectors(model, s)[0] for s in (AT, IN))
    sides = np.eye(model.n_dof)[:, [6 * p + d for p in (1, 4) for d in range(6)]]
    reduced = reduce_model(model, np.hstack([inn, sides]), f[-1], n_krylov=2)
    engine = ParametricFRF(reduced, out, inn, f, [])
    state = LocalChanges.of(engine, np.zeros(0), np.zeros(f.size))

    def exact_with(effect):
        changed = ParametricFRF(reduced, out, inn, f, [], [effect])
        return changed.evaluate(np.zeros(0), np.zeros(f.size), gradient=False)[0]

    return state, exact_with


def test_local_changes_at_one_place_do_not_disturb_each_other():
    # Each call may use what a former one kept: first one direction, then all, then another one and a damper.
    state, exact_with = local_changes()

    def change(K=(0,) * 6, C=(0,) * 6):
        at = np.array([0, 0, 0.005])
        return Joint(name="c", point1=1, point2=4, location=at, K=np.diag(K), C=np.diag(C))

    every = (-2e7, 5e7, 1e7, 3e3, -1e3, 5e3)
    for effect in (
        change((0, 0, 0, 0, 3e3, 0)),
        change(every),
        change((0, 0, 2e7, 0, 0, 0), (0, 0, 300.0, 0, 0.3, 0)),
    ):
        (H,) = state.receptances([effect])
        exact = exact_with(effect)
        # rounding: 1e-16 of the highest eigenvalue of the reduced model against the lowest
        assert (abs(H - exact).max(axis=0) < 1e-7 * abs(exact).max(axis=0).max()).all()
        assert abs(H - state.H).max() > 1e-3 * abs(exact).max()


def test_a_coupling_after_an_effect_that_leaves_rounding_in_its_direction():
    # The matrix of a coupling has zeros on its diagonal: what rounding leaves there is no scale.
    state, exact_with = local_changes()
    rounding, coupling = np.diag([2e7, 2e7, 0, 0, 0, 1e-26]), np.zeros((6, 6))
    coupling[0, 5] = coupling[5, 0] = 5e4
    for K in (rounding, coupling):
        effect = Joint(name="c", point1=1, point2=4, location=np.array([0, 0, 0.005]), K=K)
        (H,) = state.receptances([effect])
        exact = exact_with(effect)
        assert (abs(H - exact).max(axis=0) < 1e-7 * abs(exact).max(axis=0).max()).all()


def lossy(*loss):
    """Return the crossed beams of materials with loss factors, the joint between them without."""
    model = cross_beam(0.1, eta=0.0, loss_factor=0.0)
    members = {
        name: MemberProperties(replace(STEEL, name=f"steel{i}", loss_factor=eta), FLAT)
        for i, (name, eta) in enumerate(zip(model.mesh.members, loss, strict=True))
    }
    return assemble(replace(model, effects=(Frame(members=members), *model.effects[1:])))


@pytest.mark.parametrize(("loss", "bounded"), [((0.02, 0.02), True), ((0.02, 0.05), False)])
def test_loss_factors_of_materials(loss, bounded):
    system = lossy(*loss)
    f = np.linspace(60.0, 900.0, 40)
    frf = compute_frf(system, f, AT, IN, "receptance")
    H = exact(system, f)
    error, peak = abs(frf.H - H), abs(H).max(axis=0)
    assert (frf.accuracy.bound is not None) == bounded
    if bounded:
        assert frf.accuracy.reached
        assert (error <= frf.accuracy.bound + ROUNDING * peak.max()).all()
    else:
        assert np.isnan(frf.accuracy.worst)
        # what the vectors miss is of the order of the difference of the loss factors times what modes miss
        assert (error.max(axis=0) <= 1e-4 * peak.max()).all()
