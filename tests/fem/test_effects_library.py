"""Effects against closed forms and against models that have them built in."""

from dataclasses import replace

import numpy as np
import pytest

from fem import (
    DIRECTIONS,
    FRF,
    Damping,
    Environment,
    Frame,
    Joint,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    assemble,
    compute_frf,
    lever_matrix,
    solve_modes,
    sum_contributions,
)
from fem.effects import (
    Crack,
    DistributedMass,
    EndRelease,
    FluidAddedMass,
    GroundDamper,
    GroundSpring,
    JointCubic,
    JointFriction,
    JointGap,
    JointInertia,
    JointMass,
    MassDamping,
    MemberSection,
    MemberShear,
    MemberTorsion,
    RigidEndZone,
    Rotor,
    SectionShear,
    StiffnessDamping,
    candidate_kinds,
)
from fem.elements.stretches import mass_of_stretch
from tests.frames import FLAT, STEEL, beam, cross_beam, fix, portal
from updating import Measurement, Sensor, propose


def sums(model, *effects):
    """Return K, M, C and D of effects, dense."""
    parts = tuple(c for e in effects for c in e.contribute(model))
    return [X.toarray() for X in sum_contributions(parts, model.n_dof)]


def change(model, other):
    """Return what the frame of another model has beyond that of a model."""
    (a,), (b,) = model.of_kind(Frame), other.of_kind(Frame)
    return [y - x for x, y in zip(sums(model, a), sums(other, b), strict=True)]


def close(a, b, to):
    assert abs(a - b).max() <= 1e-13 * abs(to).max()


@pytest.fixture
def frame_options():
    return {"along": (1, 2, -0.5), "theory": "timoshenko", "rigid1": 0.05, "offset1": np.array([0, 0, 0.02])}


# --------------------------------------------------------------------------------------------- soft places


@pytest.mark.parametrize("direction", ["rx", "ry", "rz"])
@pytest.mark.parametrize("end", [1, 2])
@pytest.mark.parametrize("mass", ["consistent", "higher-order", "lumped"])
def test_an_end_release_is_a_spring_at_the_members_end(frame_options, direction, end, mass):
    frame_options |= {"mass": mass}
    model = beam(3, 0.9, **frame_options)
    built_in = beam(3, 0.9, **frame_options, **{f"spring{end}": {direction: 2e3}})
    effect = EndRelease(
        name="soft", member="beam", end=end, direction=direction, compliance=1 / 2e3, reference=1.0
    )
    wholes, expected = sums(model, model.effects[0]), change(model, built_in)
    changes = sums(model, effect)
    for X, Y, whole in zip(changes[:2], expected[:2], wholes[:2], strict=True):
        close(X, Y, whole)
    assert all(
        abs(changes[k]).max() > 1e-6 * abs(wholes[k]).max() for k in range(1 if mass == "lumped" else 2)
    )


def test_a_release_beside_a_spring_is_in_series_with_it():
    model = beam(3, 0.9, spring1={"ry": 4e3}, release2=("rz",))
    built_in = beam(3, 0.9, spring1={"ry": 1 / (1 / 4e3 + 1 / 2e3)}, release2=("rz",))
    effect = EndRelease(name="soft", member="beam", end=1, direction="ry", compliance=1 / 2e3, reference=1.0)
    for k in range(2):
        close(sums(model, effect)[k], change(model, built_in)[k], sums(model, model.effects[0])[k])


@pytest.mark.parametrize("theory", ["timoshenko", "euler-bernoulli"])
@pytest.mark.parametrize("direction", ["ry", "rz"])
def test_a_crack_is_a_hinge_with_a_spring_condensed_away(theory, direction):
    """K and M of one element with the cut, against two elements and a joint, condensed to their ends."""
    at, k = 0.3, 1500.0
    model = beam(1, 1.0, theory=theory)
    effect = Crack(
        name="crack",
        member="beam",
        position=at,
        compliance=1 / k,
        direction=direction,
        length=1.0,
        reference=1.0,
    )
    points = [[0, 0, 0], [1, 0, 0], [at, 0, 0], [at, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 2], [3, 1]], {"a": [0], "b": [1]})
    part = model.of_kind(Frame)[0].members["beam"]
    stiff = {"x": 1e13, "y": 1e13, "z": 1e13, "rx": 1e13, "ry": 1e13, "rz": 1e13, direction: k}
    joint = Joint(
        name="j", point1=2, point2=3, location=np.array([at, 0, 0]), K=np.diag([stiff[d] for d in stiff])
    )
    halves = Model(mesh, (Frame(members={"a": part, "b": part}), joint))
    K, M, *_ = sums(halves, *halves.effects)
    inner = np.arange(12, 24)
    T = np.vstack([np.eye(12), -np.linalg.solve(K[np.ix_(inner, inner)], K[12:, :12])])
    cracked = sums(model, *model.effects, effect)
    # the joint's other springs are soft by EA/(L k) = 6e7/1e13, and 1e-16 · 1e13 of rounding enters 1e7
    for whole, X in zip((K, M), cracked[:2], strict=True):
        assert abs(X - T.T @ whole @ T).max() <= 1e-5 * abs(X).max()
    assert abs(cracked[1] - sums(model, *model.effects)[1]).max() > 1e-2 * abs(cracked[1]).max()


def test_cracks_keep_half_the_depth_from_ends_or_a_tenth_of_a_stubby_member():
    model = beam(4, 0.9)
    section = model.of_kind(Frame)[0].members["beam"].section
    half = {"ry": np.sqrt(3 * section.Iy / section.A), "rz": np.sqrt(3 * section.Iz / section.A)}
    found = {e.direction: e for e in Crack.propose(model)}
    for direction, depth in half.items():
        position = found[direction].parameters()[1]
        assert (position.lower, position.upper) == (
            pytest.approx(depth, rel=1e-6),
            pytest.approx(0.9 - depth, rel=1e-6),
        )
        assert min(start["position"] for start in found[direction].starts(lambda _: 1.0)) >= depth
    (short, _) = Crack.propose(beam(4, 2 * half["ry"]))
    assert short.nearest == pytest.approx(0.2 * half["ry"])


def test_a_crack_in_the_middle_of_a_hinged_beam_lowers_its_frequency_as_rayleighs_quotient_says():
    """Δ(ω²)/ω² = -c M(s)²/(2 U) with M = EI κ of the mode: -2 c EI/L sin²(πs/L) to first order in c EI/L."""
    EI = STEEL.E * FLAT.Iy
    hinged = (fix(0, ("x", "y", "z", "rx", "rz")), fix(1, ("y", "z", "rx", "rz")))
    model = beam(20, 1.0, effects=hinged)
    part = 1e-4
    effect = Crack(
        name="c",
        member="beam",
        position=0.37,
        compliance=part / EI,
        direction="ry",
        length=1.0,
        reference=1.0,
    )
    before, after = (solve_modes(assemble(m), n=3).omega[0] ** 2 for m in (model, model.with_effect(effect)))
    # the element's curvature is a straight line; what its mass bends between comes with the kink's mass
    expected = -2 * part * np.sin(np.pi * 0.37) ** 2
    # the next order is the square of the change times a sum over the other modes, Σ 2/(n²(1 - 1/n⁴)) < 2
    assert (after - before) / before == pytest.approx(expected, rel=2 * part * 2 + 1e-4)


@pytest.mark.parametrize("end", [1, 2])
def test_a_rigid_end_zone_is_stiffer_elements_condensed_away(end):
    """A zone of 1.3 elements at a hundred times the stiffness, against elements cut at its end."""
    length = 0.3 * 1.3
    model = beam(3, 0.9, theory="timoshenko")
    zone = RigidEndZone(name="z", ends=(("beam", end),), length=length, longest=0.5)
    where = length if end == 1 else 0.9 - length
    mesh = model.mesh.with_point_on("beam", where)
    extra = mesh.n_points - 1
    properties = model.of_kind(Frame)[0].members["beam"]
    hard = replace(properties, material=replace(STEEL, name="hard", E=100 * STEEL.E))
    s = mesh.arc_fractions().mean(axis=1) * 0.9
    inside = s < where if end == 1 else s > where
    sets = {"soft": np.flatnonzero(~inside), "hard": np.flatnonzero(inside)}
    cut = Mesh.from_lines(mesh.points, mesh.lines, {k: v.tolist() for k, v in sets.items()})
    built = Model(cut, (Frame(members={"soft": properties, "hard": hard}),))
    K = sums(built, *built.effects)[0]
    inner = np.arange(6 * extra, 6 * extra + 6)
    kept = np.setdiff1d(np.arange(built.n_dof), inner)
    condensed = K[np.ix_(kept, kept)] - K[np.ix_(kept, inner)] @ np.linalg.solve(
        K[np.ix_(inner, inner)], K[np.ix_(inner, kept)]
    )
    close(sums(model, *model.effects, zone)[0], condensed, 10 * condensed)


@pytest.mark.parametrize(("start", "stop"), [(0.0, 0.9), (0.02, 0.86), (0.01, 0.04), (0.87, 0.9)])
def test_mass_along_a_stretch_is_all_there_also_in_rigid_zones(start, stop):
    """Its momentum and angular momentum are those of a rod, whatever the ends are like."""
    model = beam(3, 0.9, theory="timoshenko", rigid1=0.05, rigid2=0.08, offset1=np.array([0, 0.01, 0.02]))
    (frame,) = model.of_kind(Frame)
    unit = mass_of_stretch(frame, model, "beam", start, stop, (2.0, 2.0, 2.0, 0, 0, 0))
    M = np.zeros((model.n_dof, model.n_dof))
    np.add.at(M, (unit.dofs[:, :, None], unit.dofs[:, None, :]), unit.M)
    rigid = np.vstack([lever_matrix(p) for p in model.mesh.points])
    body = rigid.T @ M @ rigid
    first, last = np.array([0, 0.01, 0.02]), np.array([0.9, 0, 0])  # the member's axis
    s = np.linspace(start, stop, 20001)[:, None] / 0.9
    levers = [lever_matrix(p)[:3] for p in first + s * (last - first)]
    mass = 2.0 * (stop - start) * np.linalg.norm(last - first) / 0.9
    weights = np.full(len(s), 1 / (len(s) - 1))
    weights[[0, -1]] /= 2
    expected = mass * sum(w * L.T @ L for w, L in zip(weights, levers, strict=True))
    np.testing.assert_allclose(body, expected, atol=1e-6 * abs(expected).max())


def test_a_zone_of_no_length_changes_nothing_and_begins_smoothly():
    model = beam(3, 0.9, theory="timoshenko")
    zone = RigidEndZone(name="z", ends=(("beam", 1),), length=0.0, longest=0.5)
    assert not sums(model, zone)[0].any()
    slope = np.imag(zone.with_values(length=1e-200j).contribute(model)[0].K) / 1e-200
    step = zone.with_values(length=1e-6).contribute(model)[0].K
    # second order in step/h, times 1/h³ · h in the lever's share: some 1e-6/0.3
    np.testing.assert_allclose(step, 1e-6 * slope, atol=1e-4 * abs(step).max())


# ------------------------------------------------------------------------------------------------ sections


def test_shear_coefficients_of_boxes_are_those_of_boxes_that_state_them():
    def frame_with(change):
        points = [[0, 0, 0], [0.4, 0, 0], [0.4, 0.3, 0], [0.4, 0.3, 0.5]]
        mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {n: [i] for i, n in enumerate("abc")}).split(
            3
        )
        box, square = (
            Section.hollow_rectangle(0.015, 0.025, 0.0015),
            Section.hollow_rectangle(0.02, 0.02, 0.002),
        )
        parts = {"a": box, "b": square, "c": box}
        parts = {m: MemberProperties(STEEL, change(section)) for m, section in parts.items()}
        return Model(mesh, (Frame(members=parts), fix(0)))

    model = frame_with(lambda section: section)
    shear = SectionShear.of(model)
    assert shear is not None
    assert [p.name for p in shear.parameters()] == ["ky:a", "kz:a", "k:b"]
    factors = {"ky:a": 1.7, "kz:a": 0.8, "k:b": 1.1}
    stated = frame_with(
        lambda s: (
            replace(s, ky=s.ky * 1.1, kz=s.kz * 1.1)
            if s.ky == s.kz
            else replace(s, ky=s.ky * 1.7, kz=s.kz * 0.8)
        )
    )
    for X in "KM":
        have = getattr(assemble(model.with_effect(shear.with_values(**factors))), X)
        want = getattr(assemble(stated), X)
        assert abs(have - want).max() < 1e-12 * abs(want).max()
        alone = getattr(assemble(model), X)
        assert abs(getattr(assemble(model.with_effect(shear)), X) - alone).max() == 0
        assert abs(want - alone).max() > 1e-6 * abs(want).max()


@pytest.mark.parametrize(
    "kind", ["crack", "end_release", "stiffness_loss", "rigid_end_zone", "member_section", "member_shear"]
)
def test_what_takes_a_part_of_an_element_takes_it_of_that_with_the_shear_that_it_has(kind):
    """A hinge is one whatever shear coefficients are: with those of the model it left stiffness behind."""
    model = portal(0.2)
    (frame,), members = model.of_kind(Frame), tuple(model.mesh.members)
    part = frame.members[members[0]]
    assert all(p.section == part.section for p in frame.members.values())
    shear = SectionShear(groups={members[0]: members}, directions={members[0]: ("ky", "kz")})
    shear = shear.with_values(**{f"ky:{members[0]}": 0.3, f"kz:{members[0]}": 0.2})
    section = replace(part.section, ky=0.3 * part.section.ky, kz=0.2 * part.section.kz)
    other = replace(frame, members=dict.fromkeys(members, replace(part, section=section)))
    stated = replace(model, effects=tuple(other if e is frame else e for e in model.effects))
    hinge = EndRelease(name="h", member="left", end=2, direction="rz", compliance=1.0, reference=1.0)
    effect = hinge if kind == hinge.kind else propose(model, [kind])[0]
    effect = effect.with_values(**effect.starts(lambda key: 1e3)[-1])
    sheared = model.with_effect(shear)
    for X in "KM":
        have, want = (getattr(assemble(m.with_effect(effect)), X) for m in (sheared, stated))
        assert abs(have - want).max() < 1e-9 * abs(want).max()
    # with the model's coefficients much else
    alone = sums(model, effect)[0]
    assert abs(sums(sheared, effect)[0] - alone).max() > 1e-3 * abs(alone).max()


def test_only_coefficients_that_are_estimated_are_unsure():
    assert not Section.rectangle(0.02, 0.01).estimated_k
    assert Section.tube(0.02, 0.002).estimated_k
    assert SectionShear.of(beam(3, theory="timoshenko")) is None
    open_braces = SectionShear.of(tower(2))
    assert open_braces is not None
    assert list(open_braces.groups) == ["brace0"]


def test_full_shear_of_an_euler_beam_makes_it_a_timoshenko_beam():
    for more in ({}, {"offset1": np.array([0, 0, 0.02])}):
        euler, timoshenko = (beam(3, 0.5, theory=t, **more) for t in ("euler-bernoulli", "timoshenko"))
        effect = MemberShear(name="s", member="beam", euler=True, share=1.0)
        for X, expected, whole in zip(
            sums(euler, effect), change(euler, timoshenko), sums(euler, euler.effects[0]), strict=True
        ):
            assert abs(X - expected).max() <= 1e-13 * abs(whole).max()


def test_shear_of_a_timoshenko_beam_is_that_of_another_shear_coefficient():
    other = replace(FLAT, ky=FLAT.ky / 3, kz=FLAT.kz / 3)
    model, built_in = (beam(3, 0.5, theory="timoshenko", section=s) for s in (FLAT, other))
    effect = MemberShear(name="s", member="beam", euler=False, share=3.0)
    K, M, *_ = sums(model, effect)
    dK, dM, *_ = change(model, built_in)
    close(K, dK, sums(model, model.effects[0])[0])
    close(M, dM, sums(model, model.effects[0])[1])


@pytest.mark.parametrize("direction", ["y", "z"])
def test_a_thicker_section_is_that_of_a_thicker_rectangle(direction):
    f = 1.1
    size = {"b": 0.03, "h": 0.02}
    size["b" if direction == "y" else "h"] *= f
    made = Section.rectangle(**size)
    plain = Section.rectangle(0.03, 0.02)
    model, built_in = (beam(3, 0.5, theory="timoshenko", section=s) for s in (plain, made))
    effect = MemberSection(name="s", member="beam", direction=direction, change=f - 1)
    J = f**4 * (plain.Iy + plain.Iz) / (made.Iy + made.Iz) * plain.J
    assert pytest.approx(made.J, rel=0.01) == J
    same_J = beam(3, 0.5, theory="timoshenko", section=replace(made, J=J))
    for X, expected, whole in zip(
        sums(model, effect), change(model, same_J), sums(built_in, built_in.effects[0]), strict=True
    ):
        assert abs(X - expected).max() <= 1e-13 * abs(whole).max()


def test_torsion_raises_the_frequencies_of_torsion_alone():
    held = (fix(0), *(fix(p, ("x", "y", "z", "ry", "rz"), f"s{p}") for p in range(1, 9)))
    model = beam(8, 1.0, effects=held)
    effect = MemberTorsion(name="t", member="beam", change=0.44)
    f = [solve_modes(assemble(m), n=2).frequency for m in (model, model.with_effect(effect))]
    np.testing.assert_allclose(f[1], 1.2 * f[0], rtol=1e-10)


# ---------------------------------------------------------------------------------------------------- mass


def test_mass_along_a_member_moves_as_a_whole():
    model = beam(7, 1.0, along=(1, 2, 2))
    axes = model.of_kind(Frame)[0].rotations(model.mesh)[0]
    rigid = np.kron(np.ones((model.mesh.n_points, 1)), np.eye(6)[:, :3])
    fluid = FluidAddedMass(name="f", member="beam", direction="y", mass=3.0, reference=1.0)
    moved = rigid.T @ sums(model, fluid)[1] @ rigid
    np.testing.assert_allclose(moved, 3.0 * np.outer(axes[1], axes[1]), atol=1e-12)
    part = DistributedMass(
        name="d", member="beam", mass=2.0, position=0.3, width=0.4, length=1.0, reference=1.0
    )
    M = sums(model, part)[1]
    np.testing.assert_allclose(rigid.T @ M @ rigid, 0.8 * np.eye(3), atol=1e-12)
    # ∫ m s ds from 0.1 to 0.5, the first moment about the first end
    s = np.concatenate([[0.0, 1.0], np.arange(1, 7) / 7])
    along = np.kron(s[:, None], np.eye(6)[:, :3]) @ axes[1]
    turn = np.kron(np.ones(model.mesh.n_points), np.r_[0, 0, 0, axes[2]])
    assert (rigid @ axes[1]) @ M @ (along + turn) == pytest.approx(2.0 * (0.5**2 - 0.1**2) / 2, rel=1e-12)


def test_joint_bodies_have_their_mass():
    model = cross_beam(0.2)
    rigid = np.kron(np.ones((model.mesh.n_points, 1)), np.eye(6)[:, :3])
    mass, inertia = (
        JointMass(name="m", joint="bolt", mass=0.7, reference=1.0),
        JointInertia(name="i", joint="bolt", inertia=0.002, reference=1.0),
    )
    np.testing.assert_allclose(rigid.T @ sums(model, mass)[1] @ rigid, 0.7 * np.eye(3), atol=1e-14)
    turns = np.kron(np.ones((model.mesh.n_points, 1)), np.eye(6)[:, 3:])
    np.testing.assert_allclose(turns.T @ sums(model, inertia)[1] @ turns, 0.002 * np.eye(3), atol=1e-16)


# ------------------------------------------------------------------------------------- amplitude, rotation


def describing(force, amplitude):
    """Return the complex stiffness of a force f(displacement, velocity) by quadrature over one period."""
    n = 200_000
    phase = 2 * np.pi * (np.arange(n) + 0.5) / n
    f = force(amplitude * np.sin(phase), np.cos(phase))
    return 2 / (n * amplitude) * np.sum(f * (np.sin(phase) + 1j * np.cos(phase)))


def test_describing_functions_are_those_of_their_forces():
    a = 1.3e-4
    common = {"name": "e", "joint": "bolt", "direction": "z", "amplitude": a}
    gap = 0.4e-4
    cases = (
        (JointCubic(**common, cubic=2e12), lambda x, v: 2e12 * x**3),
        (
            JointGap(**common, stiffness=3e6, gap=gap),
            lambda x, v: 3e6 * np.sign(x) * np.maximum(abs(x) - gap, 0.0),
        ),
        (JointFriction(**common, force=12.0), lambda x, v: 12.0 * np.sign(v)),
    )
    model = cross_beam(0.2)
    for effect, force in cases:
        k = describing(force, a)
        K, _, _, D = sums(model, effect)
        # the midpoint rule on 200 000 points errs by 1e-10 at kinks, by 1e-5 at none: the jumps fall between
        assert K[8, 8] == pytest.approx(k.real, rel=1e-8, abs=1e-8 * abs(k))
        assert D[8, 8] == pytest.approx(k.imag, rel=1e-8, abs=1e-8 * abs(k))
    closed = JointGap(**common, stiffness=3e6, gap=2 * a)
    assert not sums(model, closed)[0].any()
    with pytest.raises(ModelError, match="must be positive"):
        JointCubic(**{**common, "amplitude": 0.0}, cubic=1.0)


def test_a_rotor_splits_two_equal_frequencies_into_whirls():
    """I θ'' + C θ' + k θ = 0 has ω = √(k/I + (h/2I)²) ± h/2I, and C does no work."""
    model = beam(1)
    h, inertia, k = 0.4, 0.02, 900.0
    C = sums(model, Rotor(name="r", point=1, axis=(1, 0, 0), momentum=h))[2][6 + 4 : 6 + 6, 6 + 4 : 6 + 6]
    np.testing.assert_array_equal(C, -C.T)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / inertia * np.eye(2), -C / inertia]])
    found = np.sort(np.abs(np.linalg.eigvals(A).imag))[::2]
    half = h / (2 * inertia)
    np.testing.assert_allclose(found, np.sqrt(k / inertia + half**2) + np.array([-half, half]), rtol=1e-12)
    # forward whirl, θ_y ahead of θ_z by a quarter as the rotor turns from y to z, is the faster one
    values, vectors = np.linalg.eig(A)
    fast = np.argmax(values.imag)
    assert (vectors[1, fast] / vectors[0, fast]).imag < 0
    with pytest.raises(ModelError, match="not symmetric"):
        assemble(model.with_effect(Rotor(name="r", point=1, axis=(1, 0, 0), momentum=h)))


def test_proportional_damping_is_rayleighs():
    model = cross_beam(0.2, eta=0.0, loss_factor=0.0)
    alpha, beta = MassDamping(name="a", alpha=3.0), StiffnessDamping(name="b", beta=2e-5)
    rows = [(2, "z"), (5, "z")]
    H = [
        compute_frf(assemble(m), np.linspace(20, 300, 15), rows, rows, method="direct").H
        for m in (model.with_effect(alpha, beta), model.with_damping(Damping.rayleigh(3.0, 2e-5)))
    ]
    np.testing.assert_allclose(H[0], H[1], rtol=1e-9)


# ------------------------------------------------------------------------------------------ many candidates


def tower(storeys):
    """Return a welded tower on four clamped feet, four columns, four beams and a brace for each storey.

    Braces are channels.
    """
    corners = np.array([[0, 0], [0.4, 0], [0.4, 0.4], [0, 0.4]])
    points = [[x, y, 0.5 * z] for z in range(storeys + 1) for x, y in corners]
    lines, names = [], []
    for z in range(storeys):
        a, b = 4 * z, 4 * z + 4
        for k in range(4):
            lines += [[a + k, b + k], [b + k, b + (k + 1) % 4]]
            names += [f"column{z}.{k}", f"beam{z}.{k}"]
        lines.append([a, b + 1])
        names.append(f"brace{z}")
    mesh = Mesh.from_lines(points, lines, {n: [i] for i, n in enumerate(names)}).split(2)
    part = MemberProperties(STEEL, FLAT, theory="timoshenko")
    feet = tuple(fix(k, name=f"foot{k}") for k in range(4))
    brace = replace(part, section=Section.channel(0.03, 0.03, 0.003, 0.003))
    members = {n: brace if n.startswith("brace") else part for n in names}
    return Model(mesh, (Frame(members=members), *feet))


def test_a_tower_of_a_hundred_members_gets_its_candidates():
    model = tower(12).in_environment(*Environment)
    assert len(model.mesh.members) == 108
    sensors = tuple(
        Sensor(f"s{i}", model.mesh.points[p], np.eye(3)[i % 3]) for i, p in enumerate(range(4, 52, 3))
    )
    frf = FRF.from_arrays(
        [1.0], np.ones((1, len(sensors), 1)), "receptance", [s.name for s in sensors], [sensors[-1].name]
    )
    test = Measurement(frf, sensors, sensors[-1:])
    candidates = propose(model, test=test)
    names = [e.name for e in candidates]
    assert len(set(names)) == len(names)
    assert names == [e.name for e in propose(model, test=test)]
    finer = propose(model.with_mesh(model.mesh.split(2)), test=test)
    assert names == [e.name for e in finer]
    kinds = {e.kind for e in candidates}
    joints = {k for k in candidate_kinds() if k.startswith("joint_")}
    assert kinds == set(candidate_kinds()) - joints - {"part_shift", "foot_shift"}  # those of elastic joints
    one = {k: sum(e.kind == k for e in candidates) for k in kinds}
    assert one["crack"] == one["fluid_added_mass"] == one["member_section"] == 216
    assert one["rigid_end_zone"] == 216 + 1
    # 52 corners; four of them are clamped feet; the excitation's own direction belongs to its stinger
    assert one["ground_spring"] == 48 * 3 - 1
    assert one["ground_damper"] == 48 * 3  # a stinger is no damper: that of a driven point was no candidate
    assert one["sensor_mass"] == one["driver_mass"] == 1
    assert one["stinger"] == 2


@pytest.mark.parametrize(("gap", "n_points"), [(0.0, 4), (0.02, 5)])
def test_both_sides_of_a_rigid_joint_may_be_held_where_they_lie_apart(gap, n_points):
    points = [[0, 0, 0], [0.4, 0, 0], [0.8, 0, 0], [0.4, gap, 0], [0.4, 0.5, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [3, 4]], {"bar": [0, 1], "arm": [2]})
    part = MemberProperties(STEEL, FLAT)
    bolt = Joint(name="bolt", point1=1, point2=3, location=np.array(points[1]), rigid=DIRECTIONS)
    model = Model(mesh, (Frame(members={"bar": part, "arm": part}), bolt))
    assert len({e.point for e in GroundSpring.propose(model)}) == n_points
    assert (3 in {e.point for e in GroundDamper.propose(model)}) == (gap > 0)


def test_a_joint_may_have_the_name_of_a_member():
    points = [[-0.4, 0, 0], [0, 0, 0], [0.4, 0, 0], [0, -0.4, 0.02], [0, 0, 0.02], [0, 0.4, 0.02]]
    lines = [[0, 1], [1, 2], [3, 4], [4, 5]]
    mesh = Mesh.from_lines(points, lines, {"bar": [0, 1], "arm": [2, 3]})
    part = MemberProperties(STEEL, FLAT)
    bolt = Joint(name="bar", point1=1, point2=4, location=np.array(points[1]), rigid=DIRECTIONS)
    model = Model(mesh, (Frame(members={"bar": part, "arm": part}), bolt))
    springs = GroundSpring.propose(model)
    assert {e.point for e in springs} == set(range(6))
    names = [e.name for e in propose(model)]
    assert len(set(names)) == len(names)


def test_where_two_ends_meet_one_of_them_gives_way():
    points = [[0, 0, 0], [0, 0, 0.5], [0.4, 0, 0.5]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2]], {"post": [0], "arm": [1]}).split(4)
    part = MemberProperties(STEEL, FLAT)
    model = Model(mesh, (Frame(members={"post": part, "arm": part}), fix(0, name="foot")))
    assert {(e.member, e.end) for e in EndRelease.propose(model)} == {("post", 2)}


@pytest.mark.parametrize(("rise", "more"), [(0.0, []), (0.6, ["rx", "rz"]), (1e9, [])])
def test_where_two_ends_meet_the_second_gives_way_about_axes_that_the_first_has_not(rise, more):
    way = np.array([0.0, 1.0, rise]) / np.hypot(1.0, rise)  # level, askew, and upright
    mesh = Mesh.from_lines([[1, 0, 0], [0, 0, 0], way], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    model = Model(mesh.split(2), (Frame(members=dict.fromkeys("ab", MemberProperties(STEEL, FLAT))),))
    names = [e.name for e in propose(model, ["end_release"])]
    assert names[:3] == [f"end_release:a.2.{d}" for d in ("rx", "ry", "rz")]
    assert names[3:] == [f"end_release:b.1.{d}" for d in more]
