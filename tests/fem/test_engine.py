"""The reduced model and its parametric FRFs against direct solves of every line."""

from dataclasses import replace

import numpy as np
import pytest

import fem.reduction.reduced_model
from fem import (
    DIRECTIONS,
    Damping,
    Frame,
    Joint,
    Model,
    PointMass,
    Section,
    Support,
    assemble,
    compute_frf,
    dof_vectors,
    solve_modes,
)
from fem.analysis.modes import solve_eigenpairs
from fem.effects import (
    Crack,
    GroundSpring,
    JointCoupling,
    JointOffset,
    JointStiffness,
    JointStructuralDamping,
    JointViscousDamping,
    JointZener,
    MemberDamping,
    MemberSection,
    MemberShear,
    MemberStiffness,
    MemberTorsion,
    SectionShear,
    StiffnessLoss,
    SupportFlexibility,
)
from fem.reduction import LocalChanges, ParametricFRF, ReducedModel, reduce_model, values_of
from fem.reduction.scaling import scaling_exponents
from tests.frames import STEEL, beam, cross_beam, fix, portal

WIDE = Section.rectangle(0.04, 0.01)

FREQUENCY = np.linspace(5.0, 1200.0, 160)
OUT, IN = [(0, "z"), (5, "z"), (2, "y"), (3, "x")], [(0, "z"), (5, "x")]


def attachments(model, *points):
    """Return unit forces on both sides of the joints and supports, and at points (n_dof, n)."""
    columns = [dof_vectors(model, IN)[0]]
    sides = {p for j in model.of_kind(Joint) for p in (j.point1, j.point2) if p is not None}
    sides |= {s.point for s in model.of_kind(Support)} | set(points)
    for point in sides:
        columns.append(np.eye(model.n_dof)[:, 6 * point : 6 * point + 6])
    return np.hstack(columns)


def engine(model, refs, candidates=(), *, points=(), n_krylov=2, frequency=FREQUENCY):
    reduced = reduce_model(model, attachments(model, *points), frequency[-1], n_krylov=n_krylov)
    out, inn = dof_vectors(model, OUT)[0], dof_vectors(model, IN)[0]
    return ParametricFRF(reduced, out, inn, frequency, refs, candidates)


def direct(model, zeta=0.0, frequency=FREQUENCY):
    """Return receptances of the full model; 2ζ is a loss factor, as the engine has it."""
    damping = model.damping
    more = Damping(alpha=damping.alpha, beta=damping.beta, loss_factor=damping.loss_factor + 2 * zeta)
    system = assemble(model.with_damping(more))
    return compute_frf(system, frequency, OUT, IN, kind="receptance", method="direct").H


def misfit(H, exact):
    """Return the largest error relative to the root mean square of its FRF, of those not zero by symmetry."""
    level = np.sqrt((abs(exact) ** 2).mean(axis=0))
    seen = level > 1e-9 * level.max()
    return (abs(H - exact) / np.where(seen, level, np.inf)).max()


ACCURACY = 5e-5
"""What modes up to twice the band leave behind is some 1e-3 of a response, of which each attachment vector
takes away (f/f_cut)² or more, on the forces' side and, at joints, on the responses': 3e-5 at worst here."""


@pytest.mark.parametrize("factors", [(1, 1, 1, 1), (0.1, 3, 1.1, 0.95), (30, 10, 1.0, 1.0)])
@pytest.mark.parametrize(
    "damping",
    [Damping.structural(0.004), Damping.rayleigh(3.0, 1e-7)],
    ids=["structural", "rayleigh"],
)
def test_changed_parameters_against_direct_solves(damping, factors):
    model = cross_beam().with_damping(damping)
    refs = [("bolt", "kry"), ("bolt", "eta"), ("frame", "E:steel"), ("frame", "rho:steel")]
    values = values_of(model, refs) * factors
    H, _, _ = engine(model, refs).evaluate(values, np.full(FREQUENCY.size, 0.002), gradient=False)
    changed = model.with_values(dict(zip(refs, values, strict=True)))
    assert misfit(H, direct(changed, 0.002)) < ACCURACY


def test_receptances_near_an_anchor_are_those_without_it():
    """Of parameters that matrices are linear in, of one that multiplies others, and of several at once."""
    model = cross_beam().with_effect(
        MemberSection(name="thicker", member="lower", direction="z"),
        MemberStiffness(name="softer", member="upper"),
    )
    refs = [
        ("bolt", "kry"),
        ("bolt", "krz"),
        ("frame", "E:steel"),
        ("frame", "rho:steel"),
        ("thicker", "change"),
        ("softer", "change"),
    ]
    one, other = engine(model, refs), engine(model, refs)
    start = values_of(model, refs)
    start += np.array([100.0, 0, 2e9, 0, 0.02, -0.03])
    zeta = np.full(FREQUENCY.size, 0.002)
    one.anchor(start)
    moved = {0: 900.0, 2: 1.9e11, 4: -0.1, 5: 0.2}
    for some in ((), *((k,) for k in moved), (2, 4, 5)):
        values = start.copy()
        values[list(some)] = [moved[k] for k in some]
        H, exact = (e.evaluate(values, zeta, gradient=False)[0] for e in (one, other))
        # some of these FRFs are zero by symmetry but for rounding
        np.testing.assert_allclose(H, exact, rtol=1e-6, atol=1e-9 * np.abs(exact).max())
        assert (misfit(H, other.evaluate(start, zeta, gradient=False)[0]) > 1e-2) == bool(some)


def test_local_dampers_against_direct_solves():
    C = np.diag([30.0, 0, 40.0, 0, 0.5, 2.0])
    model = cross_beam(C=C, eta=0.08)
    H, _, _ = engine(model, []).evaluate(np.zeros(0), np.zeros(FREQUENCY.size), gradient=False)
    assert misfit(H, direct(model)) < ACCURACY
    # the dampers matter
    assert misfit(H, direct(cross_beam())) > 0.1


def test_damping_of_a_soft_direction_beside_a_stiff_one():
    joint = cross_beam().effect("bolt")
    K = np.diag([1e10, 1e10, 1e10, 40.0, 40.0, 40.0])
    model = cross_beam(loss_factor=1e-4).without_effect("bolt")
    model = model.with_effect(Joint(name="bolt", point1=1, point2=4, location=joint.location, K=K, eta=0.2))
    H, _, _ = engine(model, []).evaluate(np.zeros(0), np.zeros(FREQUENCY.size), gradient=False)
    assert misfit(H, direct(model)) < ACCURACY


CANDIDATES = {
    "joint": lambda: JointStiffness(name="c", joints=("bolt",), direction="ry", stiffness=900.0, assumed=3e3),
    "joint C": lambda: JointViscousDamping(
        name="c", joint="bolt", direction="ry", damping=1.5, reference=3e3
    ),
    "joint D": lambda: JointStructuralDamping(name="c", joint="bolt", loss_factor=0.3),
    "member": lambda: MemberStiffness(name="c", member="lower", change=-0.2),
    "mass": lambda: PointMass(name="c", member="upper", position=0.63, mass=0.15, span=(0.0, 0.8)),
    "crack": lambda: StiffnessLoss(name="c", member="lower", position=0.25, loss=0.5, width=0.08, length=0.8),
}


@pytest.mark.parametrize("name", CANDIDATES)
def test_candidates_against_direct_solves(name):
    model, effect = cross_beam(), CANDIDATES[name]()
    refs = [("c", p.name) for p in effect.parameters()]
    # forces were foreseen where the effect acts, but for one that acts along a whole member
    dofs = np.unique(np.concatenate([c.dofs.ravel() for c in effect.contribute(model)]))
    e = engine(model, refs, [effect], points=() if name == "member" else set(dofs // 6))
    values = values_of(model, refs, [effect])
    zeta = np.full(FREQUENCY.size, 0.001)
    exact = direct(model.with_effect(effect), 0.001)
    # the member's shapes change smoothly: modes up to twice the band carry all but some 1e-3 of that
    limit = 1e-2 if name == "member" else ACCURACY
    H, _, _ = e.evaluate(values, zeta, gradient=False)
    assert misfit(H, exact) < limit
    assert misfit(direct(model, 0.001), exact) > 30 * limit  # and the effect is there
    # The low-rank update is another way to the same reduced result; a member's change has no low rank.
    local = ParametricFRF(e.reduced, *(dof_vectors(model, s)[0] for s in (OUT, IN)), FREQUENCY, [])
    (scanned,) = LocalChanges.of(local, np.zeros(0), zeta).receptances([effect])
    # the same but for rounding in the eigenproblem: 1e-16 of its highest eigenvalue against the lowest
    assert misfit(scanned, H) < ACCURACY


@pytest.mark.parametrize("name", ["joint C", "joint D", "member", "mass", "crack"])
def test_what_but_multiplies_is_projected_once(name, monkeypatch):
    model, effect = cross_beam(), CANDIDATES[name]()
    reduced = reduce_model(model, attachments(model), FREQUENCY[-1])
    first = effect.parameters()[0]
    values = [effect.with_values(**{first.name: f * first.value}) for f in (1.0, 0.1, 0.0, 1.7)]
    direct = [reduced.project(e.contribute(model)) for e in values]
    projected, project = [], ReducedModel.project
    monkeypatch.setattr(ReducedModel, "project", lambda *args: projected.append(1) or project(*args))
    for mine, right in zip(map(reduced.value_of, values), direct, strict=True):
        for key in "KMCD":
            X = right.dense(key)
            np.testing.assert_allclose(mine.dense(key), X, rtol=0, atol=1e-12 * max(np.abs(X).max(), 1e-300))
    reduced.derivative_of(values[1], first.name, 0.3)
    assert len(projected) == 1


def test_effects_on_few_dofs_are_projected_once_at_the_same_values(monkeypatch):
    """Each forecast of many candidates asks for the same little of each."""
    model = beam(20, effects=(fix(0),))
    reduced, projected = reduce_model(model, attachments(model), FREQUENCY[-1]), []
    monkeypatch.setattr(
        ReducedModel, "project", lambda *args, of=ReducedModel.project: projected.append(1) or of(*args)
    )
    crack = Crack(
        name="c", member="beam", position=0.4, direction="ry", compliance=1e-4, reference=1e-4, length=1.0
    )
    first, second, other = (reduced.value_of(crack.with_values(compliance=c)) for c in (1e-4, 1e-4, 2e-4))
    assert first.K is second.K
    assert other.K is not first.K
    wider = reduced.with_forces_of([crack])
    there = wider.value_of(crack)
    assert there.K is first.K
    assert there.L.shape[1] == wider.basis.T.shape[1] > reduced.basis.T.shape[1]
    assert len(projected) == 2


def test_a_members_change_by_the_motions_that_forces_bring_about(monkeypatch):
    model = cross_beam()
    model = model.with_mesh(model.mesh.split(8))
    member = MemberStiffness(name="c", member="lower", change=-0.2)
    reduced, ends = (
        reduce_model(model, attachments(model), FREQUENCY[-1]),
        [dof_vectors(model, s)[0] for s in (OUT, IN)],
    )
    zeta, out = np.full(FREQUENCY.size, 0.001), []
    for share in (0.0, 100.0):
        monkeypatch.setattr("fem.reduction.reduced_model.LOCAL_SHARE", share)
        again = ReducedModel(reduced.model, reduced.basis, reduced.system)
        assert (again.value_of(member).L is None) is (share == 0)
        assert again.with_forces_of([member]) is again  # far too many
        out += LocalChanges.of(ParametricFRF(again, *ends, FREQUENCY, []), np.zeros(0), zeta).receptances(
            [member]
        )
    assert np.abs(out[1] - out[0]).max() < 1e-5 * np.abs(out[0]).max()


def test_a_crack_that_no_force_foresaw_is_underrated():
    # Modes of the sound structure are smooth over a crack: Rayleigh-Ritz from above, it seems smaller.
    model, effect = cross_beam(), CANDIDATES["crack"]()
    sound, cracked = (solve_modes(assemble(m), 16).frequency[6:] for m in (model, model.with_effect(effect)))

    def shift(points):
        reduced = reduce_model(model, attachments(model, *points), FREQUENCY[-1], n_krylov=2)
        total, term = reduced.base_sum, reduced.value_of(effect)
        lam = np.linalg.eigvals(np.linalg.solve(total["M"], total["K"] + term.dense("K"))).real
        found = np.sqrt(np.sort(lam)[6:16]) / (2 * np.pi)
        assert (found > cracked * (1 - 1e-6)).all()
        return (found - sound)[4:] / (cracked - sound)[4:]

    nodes = np.unique(effect.contribute(model)[0].dofs // 6)
    np.testing.assert_allclose(shift(nodes), 1.0, atol=1e-3)
    assert shift(()).min() < 0.9


def test_an_extended_basis_projects_what_is_new_alone_and_the_same():
    model = cross_beam(C=np.diag([30.0, 0, 40.0, 0, 0.5, 2.0]), eta=0.08).with_effect(fix(3))
    model = model.with_mesh(model.mesh.split(3))
    reduced = reduce_model(model, attachments(model), FREQUENCY[-1])
    refs = [("frame", "E:steel"), ("frame", "rho:steel"), ("bolt", "kry")]
    ends = [dof_vectors(model, s)[0] for s in (OUT, IN)]
    ParametricFRF(reduced, *ends, FREQUENCY, refs)  # projects all that it needs
    larger = reduced.with_forces_of([CANDIDATES["crack"]()])
    assert larger.basis.T.shape[1] > reduced.basis.T.shape[1]
    fresh = ReducedModel(model, larger.basis, larger.system)
    for key, X in fresh.base_sum.items():
        np.testing.assert_allclose(larger.base_sum[key], X, rtol=0, atol=1e-10 * max(np.abs(X).max(), 1e-300))
    values, zeta = values_of(model, refs), np.full(FREQUENCY.size, 0.01)
    H, dH, _ = ParametricFRF(larger, *ends, FREQUENCY, refs).evaluate(values * 1.1, zeta)
    expected, slopes, _ = ParametricFRF(fresh, *ends, FREQUENCY, refs).evaluate(values * 1.1, zeta)
    assert np.abs(H - expected).max() < 1e-6 * np.abs(expected).max()
    for mine, right in zip(dH, slopes, strict=True):
        assert np.abs(mine - right).max() < 1e-6 * np.abs(right).max()


@pytest.mark.parametrize("mine", ["section", "shear"])
def test_elements_that_are_alike_are_formed_and_projected_as_one(mine, monkeypatch):
    model = cross_beam()
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    mesh = replace(model.mesh, points=model.mesh.points @ turn).split(5)  # 80 elements each
    (frame,) = model.of_kind(Frame)
    lossy = replace(STEEL, loss_factor=0.01)
    members = {m: replace(p, material=lossy) for m, p in frame.members.items()}
    model = Model(mesh, (replace(frame, members=members), *model.effects[1:]))
    effect = {
        "section": MemberSection(name="c", member="upper", direction="z", change=0.1),
        "shear": MemberShear(name="c", member="upper", euler=False, share=2.0),
    }[mine]
    reduced = reduce_model(model, attachments(model), FREQUENCY[-1])
    assert reduced.basis.T.shape[1] <= 80
    name, value = effect.parameters()[0].name, effect.parameters()[0].value
    projected, sums = [], fem.reduction.reduced_model._sums_over_pairs
    monkeypatch.setattr(
        "fem.reduction.reduced_model._sums_over_pairs", lambda *args: projected.append(1) or sums(*args)
    )

    def both():
        fresh = ReducedModel(model, reduced.basis, reduced.system)
        modulus = "frame", "E:steel"
        stepped = model.with_values({modulus: 1.1 * STEEL.E + 1e-200j})
        return [
            fresh.value_of(effect),
            fresh.derivative_of(effect, name, value),
            *fresh.slopes_in(effect, model, {modulus: stepped}),
        ]

    together = both()
    assert projected == [1]  # for the value and both derivatives
    monkeypatch.setattr(Frame, "alike", lambda *args: False)
    one_by_one = both()
    assert projected == [1]  # for the value and both derivatives
    for k, (found, expected) in enumerate(zip(together, one_by_one, strict=True)):
        for key in "KMD" if k < 2 else "KD":
            X = expected.dense(key)
            assert np.abs(X).max() > 0
            np.testing.assert_allclose(found.dense(key), X, rtol=0, atol=1e-10 * np.abs(X).max())


@pytest.mark.parametrize(
    "own",
    [{"release1": ("ry",)}, {"offset1": np.array([0, 0, 0.01])}, {"rigid2": 0.02}, {"section2": WIDE}],
    ids=["release", "offset", "rigid end", "taper"],
)
def test_members_with_ends_of_their_own_have_elements_that_differ(own):
    model = cross_beam()
    (frame,) = model.of_kind(Frame)
    members = {**frame.members, "lower": replace(frame.members["lower"], **own)}
    changed = replace(frame, members=members)
    assert [changed.alike(model.mesh, m) for m in ("lower", "upper")] == [False, True]


def test_elements_of_another_length_are_not_alike():
    model = cross_beam()
    (frame,) = model.of_kind(Frame)
    assert all(frame.alike(model.mesh, m) for m in model.mesh.members)
    for direction in (0, 2):  # along the member, and out of line
        points = model.mesh.points.copy()
        points[model.mesh.lines[model.mesh.members["lower"][2], 1], direction] += 1e-5
        moved = replace(model.mesh, points=points)
        assert [frame.alike(moved, m) for m in ("lower", "upper")] == [False, True]


@pytest.mark.parametrize("place", [0.2531, 0.307])
def test_the_ends_of_a_stretch_are_what_its_place_moves(place):
    model = cross_beam()
    model = model.with_mesh(model.mesh.split(20))
    reduced = reduce_model(model, attachments(model), FREQUENCY[-1])
    loss = StiffnessLoss(name="c", member="lower", position=place, loss=0.5, width=0.3, length=0.8)
    slope = reduced.derivative_of(loss, "position", place)
    assert slope.L is not None  # few DOFs, though the stretch has many
    step = 1e-6
    two = [reduced.value_of(loss.with_values(position=place + d)).dense("K") for d in (step, -step)]
    expected = (two[0] - two[1]) / (2 * step)
    np.testing.assert_allclose(slope.dense("K"), expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("place", [0.40625, 0.4])
def test_a_stretch_that_ends_on_a_point_moves_as_elsewhere(place):
    model = beam(8)  # points at eighths: the first place has an end on one
    loss = StiffnessLoss(name="c", member="beam", position=place, loss=0.5, width=0.3125, length=1.0)
    (part,) = loss.with_values(position=place + 1e-200j).contribute(model)
    stretched = np.zeros(model.n_dof)
    stretched[::6] = model.mesh.points[:, 0]  # alike everywhere: the energy does not depend on the place
    u = stretched[part.dofs]
    energy = np.einsum("bi,bij,bj->", u, part.K, u)
    assert abs(energy.imag / 1e-200) < 1e-9 * abs(energy.real)


REFERRING = {
    "torsion": lambda: MemberTorsion(name="c", member="lower", change=1.2),
    "thickness": lambda: MemberSection(name="c", member="lower", direction="z", change=0.1),
    "release": lambda: Crack(
        name="c", member="lower", position=0.33, compliance=2e-3, direction="ry", length=0.8, reference=1e-2
    ),
    "stretch": lambda: StiffnessLoss(
        name="c", member="lower", position=0.25, loss=0.5, width=0.08, length=0.8
    ),
    "loss": lambda: MemberDamping(name="c", member="lower", loss_factor=0.05),
    "offset": lambda: JointOffset(name="c", joint="bolt", direction="z", offset=0.02, reach=0.02),
    "coupling": lambda: JointCoupling(
        name="c", joint="bolt", first="x", second="ry", coupling=0.4, scale=1.0
    ),
    "joint D": lambda: JointStructuralDamping(name="c", joint="bolt", loss_factor=0.3),
    "zener": lambda: JointZener(name="c", joint="bolt", direction="ry", assumed=3e3, ratio=2.0, tau=1e-3),
}


@pytest.mark.parametrize("name", REFERRING)
def test_candidates_follow_what_they_refer_to(name):
    # An effect on a member or joint whose stiffness is fitted too is an effect on the fitted one: a crack's
    # compliance, an offset, a loss factor would otherwise be off by as much as that stiffness.
    model, effect = cross_beam(0.1), REFERRING[name]()
    refs = [("frame", "E:steel"), ("frame", "rho:steel"), ("bolt", "kry"), ("bolt", "kx")]
    refs += [("c", p.name) for p in effect.parameters()]
    points = range(model.mesh.n_points)  # the basis spans everything
    e = engine(model, refs, [effect], points=points)
    x = values_of(model, refs, [effect])
    x[:4] *= [1.1, 0.95, 0.8, 1.2]
    zeta = np.full(FREQUENCY.size, 0.01)
    fitted = model.with_values(dict(zip(refs[:4], x[:4], strict=True))).with_effect(effect)
    H, dH, _ = e.evaluate(x, zeta)
    assert misfit(H, direct(fitted, 0.01)) < ACCURACY
    for i, value in enumerate(x):
        step = 1e-4 * value * np.eye(len(x))[i]
        near, far = (
            (e.evaluate(x + k * step, zeta, False)[0] - e.evaluate(x - k * step, zeta, False)[0])
            / (2e-4 * k * value)
            for k in (1, 2)
        )
        # as in the test of gradients above
        bound = abs(far - near).max() + 1e-10 * abs(H).max() / (1e-4 * value)
        assert abs(dH[i] - near).max() <= bound


@pytest.mark.parametrize("name", REFERRING)
def test_what_others_parameters_but_multiply_is_formed_on_nominal_values(name, monkeypatch):
    model, effect = cross_beam(0.1), REFERRING[name]()
    refs = [("c", p.name) for p in effect.parameters()]
    refs += [("frame", "E:steel"), ("frame", "rho:steel"), ("bolt", "kx"), ("bolt", "kry"), ("bolt", "eta")]
    x = values_of(model, refs, [effect]) * (1 + 0.1 * np.cos(np.arange(len(refs))))
    zeta = np.full(FREQUENCY.size, 0.01)
    quick = engine(model, refs, [effect])
    # A release gives way beside the member's own E, a joint's matrices are sums over its stiffnesses, and a
    # law has its own frequencies.
    multiplied = name in ("torsion", "thickness", "stretch", "loss")
    assert any(s.effect is effect for s in quick._scaled) == multiplied
    monkeypatch.setattr(ReducedModel, "scaling_of", lambda self, effect, ref: None)
    plain = engine(model, refs, [effect])
    assert any(e is effect for e, _, _ in plain._nonlinear)
    for found, expected in zip(quick.evaluate(x, zeta), plain.evaluate(x, zeta), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7 * abs(expected).max())


def test_proportions_are_seen_in_small_differences_of_large_matrices():
    """A coefficient of shear that is off by little changes the mass by a few 1e-12 of it, mostly rounding."""
    model = beam(8, theory="timoshenko", section=Section.tube(0.05, 0.005))
    shear = SectionShear.of(model)
    shear = shear.with_values(**{p.name: 1 + 1e-7 for p in shear.parameters()})
    by = {key: scaling_exponents(shear, model, ("frame", f"{key}:steel")) for key in ("E", "rho")}
    assert (by["E"]["K"], by["E"]["M"], by["rho"]["K"], by["rho"]["M"]) == (1, 0, 0, 1)


@pytest.mark.parametrize("kind", ["member", "joint"])
def test_modes_that_join_the_basis_are_exact(kind):
    # Rayleigh-Ritz finds a mode to rounding, 1e-16 of the highest eigenvalue, whose shape is in the basis.
    if kind == "member":
        model = cross_beam(0.1)
        effect = MemberTorsion(name="c", member="lower", change=3.0)
    else:  # a constraint of the model is replaced by a spring
        model = portal()
        effect = JointStiffness(name="c", joints=("corner0",), direction="ry", stiffness=1e3, assumed=np.inf)
    found = model.with_effect(effect)
    exact = solve_modes(assemble(found), 20).frequency
    free = slice(6 if kind == "member" else 0, (exact < 1000.0).sum())  # 0 Hz are the root of rounding
    exact = exact[free]

    def error(reduced):
        nothing = np.zeros((model.n_dof, 0))
        e = ParametricFRF(reduced, nothing, nothing, np.ones(1), [], [effect])
        total, _ = e.matrices(np.zeros(0))
        lam = np.sort(np.linalg.eigvals(np.linalg.solve(total["M"], total["K"])).real)
        f = np.sqrt(np.maximum(lam, 0.0))[free] / (2 * np.pi)
        return (abs(f - exact) / exact).max()

    before = reduce_model(model, dof_vectors(model, IN)[0], 500.0)
    system = assemble(found)
    after = before.with_shapes(system.Q @ solve_eigenpairs(system, max_frequency=1000.0).vectors)
    assert error(before) > 1e-5
    assert error(after) < 1e-8


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e12])
@pytest.mark.parametrize("kind", ["support", "joint"])
def test_released_constraints_against_direct_solves(kind, stiffness):
    model = portal()
    if kind == "support":
        effect = SupportFlexibility(name="c", supports=("foot0", "foot1"), direction="ry", stiffness=1e6)
    else:
        effect = JointStiffness(name="c", joints=("corner0",), direction="ry", stiffness=1e6, assumed=np.inf)
    e = engine(model, [("c", "stiffness")], [effect])
    H, _, _ = e.evaluate(np.array([stiffness]), np.zeros(FREQUENCY.size), gradient=False)
    exact = direct(model.with_effect(effect.with_values(stiffness=stiffness)))
    # 1e12 N·m/rad is rigid: there the direct solve errs by 1e-16 of it against the members' 1e3, times ten
    assert misfit(H, exact) < (1e-3 if stiffness == 1e12 else ACCURACY)
    rigid = misfit(H, direct(model))
    assert rigid < 1e-3 if stiffness == 1e12 else rigid > 1e-3


@pytest.mark.parametrize("name", ["joint", "crack", "mass"])
def test_connections_with_a_ratio_of_their_own_against_direct_solves(name):
    # A joint's stiffness with ratio 2 % beside members with 0.1 % is one with the loss factor 3.8 % more,
    # also where an effect makes it softer.
    model, effect = cross_beam(), CANDIDATES[name]()
    lossy = cross_beam(eta=model.effect("bolt").eta + 2 * (0.02 - 0.001))
    ratio = np.stack([np.full(FREQUENCY.size, z) for z in (0.001, 0.02)])
    refs = [("c", p.name) for p in effect.parameters()] + [("bolt", "kry")]
    dofs = np.unique(np.concatenate([c.dofs.ravel() for c in effect.contribute(model)]))
    for candidates in ([], [effect]):
        used = refs if candidates else refs[-1:]
        e = engine(model, used, candidates, points=set(dofs // 6))
        values = values_of(model, used, candidates)
        H, _, _ = e.evaluate(values, ratio, gradient=False)
        exact = direct(lossy.with_effect(*candidates), 0.001)
        assert misfit(H, exact) < ACCURACY
        assert misfit(direct(model.with_effect(*candidates), 0.001), exact) > 0.01
    local = ParametricFRF(e.reduced, *(dof_vectors(model, s)[0] for s in (OUT, IN)), FREQUENCY, [])
    (scanned,) = LocalChanges.of(local, np.zeros(0), ratio).receptances([effect])
    assert misfit(scanned, H) < ACCURACY


@pytest.mark.parametrize("name", CANDIDATES)
@pytest.mark.parametrize("connections", [(), (0.03,)], ids=["alike", "connections"])
def test_gradients_against_finite_differences(name, connections):
    model, effect = cross_beam(0.1), CANDIDATES[name]()
    refs = [("c", p.name) for p in effect.parameters()]
    refs += [("frame", "E:steel"), ("frame", "rho:steel"), ("bolt", "kry"), ("bolt", "eta")]
    e = engine(model, refs, [effect])
    x, zeta = values_of(model, refs, [effect]), np.full(FREQUENCY.size, 0.01)
    zeta = np.stack([zeta, *(np.full(FREQUENCY.size, z) for z in connections)]) if connections else zeta
    _, dH, dzeta = e.evaluate(x, zeta)

    def at(i, step):
        return e.evaluate(x + step * np.eye(len(x))[i], zeta, gradient=False)[0]

    def check(gradient, function, step):
        near, far = ((function(s) - function(-s)) / (2 * s) for s in (step, 2 * step))
        # Central differences err by step² f‴/6, a third of what the two differ by. Rounding in H is 1e-16 of
        # the highest eigenvalue against the lowest elastic one, 1e-10, over the step.
        bound = abs(far - near).max() + 1e-10 * level / step
        assert abs(gradient - near).max() <= bound
        assert bound < 0.01 * abs(gradient).max()

    level = abs(at(0, 0.0)).max()
    for i, value in enumerate(x):
        check(dH[i], lambda s, i=i: at(i, s), 1e-4 * abs(value))
    if not connections:
        check(dzeta, lambda s: e.evaluate(x, zeta + s, gradient=False)[0], 1e-5)
    for row in range(2 if connections else 0):
        one = np.eye(2)[row][:, None]
        check(dzeta[row], lambda s, one=one: e.evaluate(x, zeta + s * one, gradient=False)[0], 1e-5)


def test_size_does_not_depend_on_the_mesh():
    coarse, fine = (engine(cross_beam(size), []) for size in (0.05, 0.0125))
    assert fine.reduced.model.n_dof > 3.5 * coarse.reduced.model.n_dof
    # a mode may move over the limit of twice the band
    assert abs(fine.reduced.basis.T.shape[1] - coarse.reduced.basis.T.shape[1]) <= 2
    H, G = (e.evaluate(np.zeros(0), np.full(FREQUENCY.size, 0.01), False)[0] for e in (coarse, fine))
    # between them lies the elements' error: 1e-4 of ω in the band, over a loss factor of 0.024 at a resonance
    assert misfit(H, G) < 0.05


def test_reduced_frf_is_as_good_as_direct_solves_up_to_the_top_of_the_band():
    # A stiff joint's loss factor acts where the modes have no motion: its forces must be in the basis.
    model = cross_beam(0.02)
    system, f = assemble(model), np.arange(2.0, 3201.0, 14.0)
    args = (f, [(0, "z"), (2, "x"), (3, "z"), (5, "y"), (4, "ry")], [(0, "z"), (3, "y")])
    assert misfit(compute_frf(system, *args).H, compute_frf(system, *args, method="direct").H) < 1e-5


def on_cords(stiffness):
    """Return a cross-beam with springs of some stiffness [N/m] from two points to the ground."""
    cords = [
        GroundSpring(name=f"cord{p}{d}", point=p, place="", direction=d, stiffness=stiffness, reference=1.0)
        for p in (0, 3)
        for d in DIRECTIONS
    ]
    return cross_beam(0.02).with_effect(*cords)


@pytest.mark.parametrize("effects", [(), ("crack",)])
def test_soft_cords_cost_the_basis_no_digits(effects):
    # As a whole the structure then moves 1e8 times as far under a static force as it bends.
    model, more = on_cords(0.05), [CANDIDATES[name]() for name in effects]
    assert solve_modes(assemble(model), 6).frequency[0] < 0.1
    frequency, zeta = np.linspace(50.0, 3000.0, 100), np.full(100, 0.01)
    reduced = reduce_model(model, attachments(model), frequency[-1]).with_forces_of(more)
    ends = [dof_vectors(model, s)[0] for s in (OUT, IN)]
    H, _, _ = ParametricFRF(reduced, *ends, frequency, [], more).evaluate(np.zeros(0), zeta, gradient=False)
    exact = direct(model.with_effect(*more), 0.01, frequency)
    level = np.sqrt((abs(exact) ** 2).mean(axis=0))
    seen = level > 1e-3 * level.max()
    assert (abs(H - exact)[:, seen] / level[seen]).max() < (1e-3 if more else 3e-5)


def test_what_a_basis_lacks_is_known_on_soft_cords():
    dofs, motions = np.arange(6 * 40, 6 * 41), np.eye(6)
    one, other = (
        reduce_model(model, attachments(model), FREQUENCY[-1]).residual_flexibility(dofs, motions)
        for model in (on_cords(0.5), on_cords(0.05))
    )
    assert (one.diagonal() > 0).all()
    scale = np.sqrt(np.outer(one.diagonal(), one.diagonal()))
    np.testing.assert_allclose(other / scale, one / scale, rtol=0, atol=1e-4)


def test_direct_solves_without_pivoting_keep_their_digits():
    # K - ω²M is indefinite and is factorised without pivoting off the diagonal.
    model = cross_beam(0.1, loss_factor=0.0, eta=0.0)
    system = assemble(model)
    resonance = solve_modes(system, 12).frequency[9]
    f = np.array([40.0, resonance * (1 - 1e-6), 900.0, 2500.0])
    H = compute_frf(system, f, OUT, IN, kind="receptance", method="direct").H
    K, M = system.K.toarray(), system.M.toarray()
    out, inn = (system.Q.T @ dof_vectors(model, s)[0] for s in (OUT, IN))
    for k, w in enumerate(2 * np.pi * f):
        exact = out.T @ np.linalg.solve(K - w**2 * M, inn)
        # 1e-16 of the stiffest entry against the softest motion, 1e8; next to a resonance times 1e6/2
        limit = 1e-2 if k == 1 else 1e-7
        assert abs(H[k] - exact).max() < limit * abs(exact).max()


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize(
    "effects", [(), (fix(0),), (fix(0, ("x", "y", "z")),)], ids=["free", "clamped", "ball"]
)
def test_reduced_frf_where_the_modes_span_everything(n, effects):
    model = beam(n, effects=effects).with_damping(Damping.structural(0.02))
    system = assemble(model)
    f = np.array([10.0, 1000.0, 1e6])
    at = [(1, "z"), (1, "x"), (1, "rx")]
    reduced, exact = (
        compute_frf(system, f, at, at, kind="receptance", method=m).H for m in ("reduced", "direct")
    )
    assert (abs(reduced - exact).max(axis=(1, 2)) < 1e-7 * abs(exact).max(axis=(1, 2))).all()
