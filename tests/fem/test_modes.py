"""Modes under attack: repeated, close, many; one element and thousands; watch parts, towers, hinges."""

import numpy as np
import pytest
import scipy.linalg as sla

import fem.analysis.modes
import fem.reduction.condensation
from fem import (
    AddedMass,
    Damping,
    Frame,
    FRFError,
    Joint,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    UnstableError,
    assemble,
    compute_frf,
    differentiate_modes,
    solve_complex_modes,
    solve_modes,
    solve_static,
)
from fem.analysis.modes import DENSE_LIMIT, solve_eigenpairs
from fem.effects import Preload
from fem.linalg.lanczos import RitzPairs
from fem.reduction import expand_smooth, reduce_craig_bampton, reduce_guyan, reduce_irs, reduce_serep
from tests.frames import FLAT, STEEL, beam, chain, fix, portal

CLAMPED, FREE = 1.875104068711961**2, 4.730040744862704**2


def dense(system, n=None):
    """Return all or the lowest frequencies from a dense solution [Hz]."""
    subset = None if n is None else (0, n - 1)
    lam = sla.eigh(system.K.toarray(), system.M.toarray(), eigvals_only=True, subset_by_index=subset)
    return np.sqrt(np.maximum(lam, 0)) / (2 * np.pi)


def rounding(system):
    """Return what rounding in K does to squares of frequencies: 100 times 2e-16 of the highest."""
    K, M = system.K.diagonal(), system.M.diagonal()
    return 100 * 2.2e-16 * (K / M).max() / (2 * np.pi) ** 2


def lattice(n, section, clamped):
    index = np.arange(n**3).reshape(n, n, n)
    points = np.argwhere(index >= 0).astype(float)
    lines = [np.stack([np.moveaxis(index, a, 0)[:-1], np.moveaxis(index, a, 0)[1:]], -1) for a in range(3)]
    mesh = Mesh.from_lines(points, np.concatenate([x.reshape(-1, 2) for x in lines]))
    p = MemberProperties(STEEL, section)
    feet = [fix(i) for i in np.flatnonzero(points[:, 2] == 0)] if clamped else []
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)), *feet))


def star(n, arms=8, length=1.0, width=0.02):
    angle = 2 * np.pi * np.arange(arms) / arms
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    points = np.vstack([np.zeros(3), length * ring])
    sets = {f"arm{i}": [i] for i in range(arms)}
    mesh = Mesh.from_lines(points, [[0, i + 1] for i in range(arms)], sets).split(n)
    p = MemberProperties(STEEL, Section.rectangle(width, width), theory="euler-bernoulli")
    ends = (fix(i + 1, ("x", "y", "z")) for i in range(arms))
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)), *ends))


@pytest.mark.parametrize(
    ("model", "n"),
    [
        (star(4), 30),  # dense
        # Lanczos alone loses modes of some of these, by chance
        (star(20), 5),
        (star(20, 8, 5.0, 0.125), 12),
        (star(20, 8, 5.0, 0.125), 20),
        (star(20, 12, 1.0, 0.125), 12),
        (star(20, 12, 1.0, 0.125), 30),
        (star(20, 6, 1.0, 0.125), 30),
        (lattice(6, Section.circle(0.02), True), 40),
        (lattice(6, Section.circle(0.02), False), 40),
        (lattice(6, FLAT, True), 40),
    ],
)
def test_repeated_and_close_modes_are_all_found(model, n):
    system = assemble(model)
    modes, exact = solve_modes(system, n), dense(system, n)
    error = modes.frequency**2 - np.where(np.arange(n) < modes.n_rigid, 0, exact) ** 2
    assert abs(error).max() < rounding(system)
    # as many members of each set as there are: a value more or less would shift all that follow
    M = modes.shapes.T @ (system.Q @ system.M @ system.Q.T @ modes.shapes)
    np.testing.assert_allclose(M, np.eye(n), atol=1e-8)


@pytest.mark.parametrize(
    ("model", "n"),
    [
        (star(20), 5),
        (star(20), 21),
        (lattice(6, FLAT, True), 20),
        (lattice(6, FLAT, False), 20),
        (portal(), 10),
    ],
)
def test_the_count_agrees_with_what_was_found(model, n):
    system = assemble(model)
    np.testing.assert_array_equal(
        solve_modes(system, n, check=True).frequency, solve_modes(system, n).frequency
    )


def without_one(pairs, which):
    left = np.delete(np.arange(len(pairs.eigenvalues)), which)
    return RitzPairs(pairs.eigenvalues[left], pairs.vectors[:, left], pairs.residual[left], pairs.following)


@pytest.mark.parametrize("clamped", [True, False])
@pytest.mark.parametrize("which", [0, 7, -2])
def test_a_missed_mode_is_noticed_and_found(monkeypatch, clamped, which):
    system = assemble(lattice(6, FLAT, clamped))
    right = solve_modes(system, 20).frequency
    real, calls = fem.analysis.modes.lowest_eigenpairs, []

    def forgetful(solve, M, shift, n, *args, **more):
        calls.append(n)
        found = real(solve, M, shift, n + 1 if len(calls) == 1 else n, *args, **more)
        return without_one(found, which) if len(calls) == 1 else found

    monkeypatch.setattr(fem.analysis.modes, "lowest_eigenpairs", forgetful)
    np.testing.assert_allclose(solve_modes(system, 20, check=True).frequency, right, rtol=1e-9)
    assert len(calls) == 2
    calls.clear()
    # unchecked, it stays missed: all above move down by one
    assert abs(solve_modes(system, 20).frequency - right).max() > 1e-4 * right[-1]


def test_a_mode_that_stays_missed_is_an_error(monkeypatch):
    system = assemble(lattice(6, FLAT, True))
    real = fem.analysis.modes.lowest_eigenpairs

    def blind(solve, M, shift, n, *args, **more):
        found = real(solve, M, shift, n + 1, *args, **more)
        return found.head(0) if "seed" in more else without_one(found, 3)

    monkeypatch.setattr(fem.analysis.modes, "lowest_eigenpairs", blind)
    with pytest.raises(ModelError, match=r"20 modes were found below .* Hz, but .* has 21 negative"):
        solve_modes(system, 20, check=True)


@pytest.mark.parametrize("n", [1, 2, 5, 40])
@pytest.mark.parametrize("ask", ["one", "half", "all but one", "all"])
def test_any_number_of_modes(n, ask):
    system = assemble(beam(n, effects=(fix(0),)))
    want = {"one": 1, "half": system.n_free // 2, "all but one": system.n_free - 1, "all": system.n_free}[ask]
    modes = solve_modes(system, want)
    assert modes.n_modes == want
    exact = dense(system)[:want] ** 2
    # low modes come from the flexibility, with 1e-16 of its largest value; where that is 1e8 times theirs,
    # Rayleigh's quotient takes over
    assert (abs(modes.frequency**2 - exact) < rounding(system) + 1e-7 * exact).all()
    phi = system.Q.T @ modes.shapes
    # rounding mixes 1e-16 ω_r²/ω_1² of the lowest modes into the highest; those of 40 elements span 1e12
    np.testing.assert_allclose(phi.T @ (system.M @ phi), np.eye(want), atol=1e-7)
    stiffness = phi.T @ (system.K @ phi)
    assert abs(stiffness - np.diag(modes.omega**2)).max() < 1e-7 * modes.omega[-1] ** 2


def test_more_modes_than_there_are():
    assert solve_modes(assemble(beam(1, effects=(fix(0),))), 100).n_modes == 6


def test_all_modes_up_to_a_frequency():
    system = assemble(star(20))
    assert system.n_free > DENSE_LIMIT
    exact = dense(system)
    for limit in (1.0, exact[10] * 1.001, exact[25] * 1.001):
        found = solve_modes(system, max_frequency=limit).frequency
        assert len(found) == max(1, (exact <= limit).sum())


@pytest.mark.parametrize(
    ("effects", "n_rigid"),
    [
        ((), 6),
        ((fix(0, ("x", "y", "z")),), 3),
        ((fix(0, ("y", "z", "rx", "ry", "rz")),), 1),  # slider
        ((fix(0, ("x", "y", "z")), fix(1, ("y", "z"))), 1),  # spins about its axis
        ((fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z"))), 0),
        ((fix(0, ("z",)), fix(1, ("z",))), 4),
        ((fix(0, ("rx", "ry", "rz")),), 3),
        ((fix(0),), 0),
    ],
)
@pytest.mark.parametrize(("length", "n"), [(1e-3, 3), (1.0, 40), (300.0, 120)])
def test_rigid_motions_that_supports_leave(effects, n_rigid, length, n):
    section = Section.rectangle(0.03 * length, 0.01 * length)
    modes = solve_modes(assemble(beam(n, length, effects=effects, section=section)), 9)
    assert modes.n_rigid == n_rigid
    assert (modes.frequency[:n_rigid] == 0).all()
    unit = np.sqrt(STEEL.E * section.Iy / (STEEL.rho * section.A)) / (2 * np.pi * length**2)
    assert modes.frequency[n_rigid] > 2 * unit  # the softest here is a cantilever, 3.5


@pytest.mark.parametrize("along", [(1, 0, 0), (0, 0, 1), (1, 2, -0.5)])
def test_pinned_ends_on_any_line(along):
    # On a slanted line two pins leave the spin about that line, which is no axis of the mesh.
    ends = (fix(0, ("x", "y", "z")), fix(1, ("x", "y", "z")))
    assert solve_modes(assemble(beam(6, effects=ends, along=along)), 4).n_rigid == 1


@pytest.mark.parametrize(
    ("length", "section"),
    [
        (1e-3, Section.rectangle(3e-5, 1e-5)),  # a watch part
        (1.0, FLAT),
        (300.0, Section.hollow_rectangle(10.0, 10.0, 0.5)),  # a tower
        (300.0, Section.circle(0.01)),  # a wire
    ],
    ids=["watch", "beam", "tower", "wire"],
)
@pytest.mark.parametrize("n", [1, 10, 100, 1000])
@pytest.mark.parametrize("effects", [(), (fix(0),)], ids=["free", "clamped"])
def test_scales_and_meshes(length, section, n, effects):
    model = beam(n, length, section=section, effects=effects)
    modes = solve_modes(assemble(model), 9 if effects else 15)
    assert modes.n_rigid == (0 if effects else 6)
    root = CLAMPED if effects else FREE
    weak = min(section.Iy, section.Iz)
    unit = np.sqrt(STEEL.E * weak / (STEEL.rho * section.A)) / (2 * np.pi * length**2)
    # Rayleigh's quotient of one cubic: 0.5 % (clamped), √720 against 22.37 (free); then (βL/n)⁴/1440.
    error = modes.frequency[modes.n_rigid] / (unit * root) - 1
    expected = {True: 0.0048, False: np.sqrt(720) / FREE - 1}[bool(effects)] if n == 1 else 0
    predicted = root**2 / n**4 / 1440 if n > 1 else 0
    assert error == pytest.approx(expected + predicted, abs=0.15 * predicted + 2e-4 * (n == 1) + 1e-6)


@pytest.mark.parametrize("along", [(1, 0, 0), (0.55, 0.35, 0.65)], ids=["level", "skew"])
@pytest.mark.parametrize(("effects", "root"), [((fix(0),), CLAMPED), ((), FREE)], ids=["clamped", "free"])
def test_slender_chains_keep_their_lowest_frequency(along, effects, root):
    """Entries of K are n⁴ = 10¹² times the lowest ω², so that their rounding alone would leave 1e-6 of it."""
    length, section = 300.0, Section.circle(0.01)
    system = assemble(beam(1000, length, section=section, effects=effects, along=along))
    modes = solve_modes(system, 9)
    unit = np.sqrt(STEEL.E * section.Iy / (STEEL.rho * section.A)) / (2 * np.pi * length**2)
    assert modes.frequency[modes.n_rigid] == pytest.approx(unit * root, rel=1e-9)
    elastic = system.Q.T @ modes.shapes[:, modes.n_rigid :]
    assert elastic.T @ system.M @ elastic == pytest.approx(np.eye(elastic.shape[1]), abs=1e-10)


@pytest.mark.parametrize("k", [1e3, 1.0, 1e-3, 1e-6])
@pytest.mark.parametrize(
    ("length", "section"),
    [(1e-3, Section.rectangle(3e-5, 1e-5)), (1.0, FLAT), (300.0, Section.hollow_rectangle(10.0, 10.0, 0.5))],
    ids=["watch", "beam", "tower"],
)
@pytest.mark.parametrize("n", [10, 100])
def test_soft_springs_are_neither_missed_nor_mechanisms(n, length, section, k):
    free = beam(n, length, section=section)
    springs = [
        Joint(name=f"s{p}", point1=p, location=free.mesh.points[p], K=k * np.diag([1, 1, 1, 0, 0, 0]))
        for p in (0, 1)
    ]
    system = assemble(free.with_effect(*springs))
    modes = solve_modes(system, 9)
    assert modes.n_rigid == 1  # the spin about its axis
    mass = STEEL.rho * section.A * length
    elastic = solve_modes(assemble(free), 7).frequency[6]
    # √(2k/m) along; √(2k (L/2)²/(m L²/12)) = √3 times that about the middle, the beam being rigid beside the
    # springs; and what rounding leaves of ω²
    heave = np.sqrt(2 * k / mass) / (2 * np.pi)
    if heave < 0.03 * elastic:
        expected = heave * np.array([1, 1, 1, np.sqrt(3), np.sqrt(3)])
        stray = abs(modes.frequency[1:6] ** 2 - expected**2)
        assert (stray < 3e-3 * expected**2 + rounding(system)).all()
        # springs do not change the elastic modes by more than (heave/elastic)², and rounding does not either
        assert modes.frequency[6] == pytest.approx(elastic, rel=5 * (heave / elastic) ** 2 + 1e-5)


@pytest.mark.parametrize("length", [1e-3, 1.0, 300.0])
@pytest.mark.parametrize("n", [1, 4, 40, 300])
@pytest.mark.parametrize(
    ("n_members", "effects", "n_rigid", "n_loose"), [(3, (), 6, 6), (2, (fix(0),), 0, 3)]
)
def test_hinge_chains_are_mechanisms(n_members, effects, n_rigid, n_loose, length, n):
    section = Section.rectangle(0.03 * length, 0.01 * length)
    model = chain(n_members, n, effects, length=length, section=section)
    with pytest.raises(ModelError, match=r"mechanism: \d motion.* besides (\d) rigid-body") as found:
        solve_modes(assemble(model))
    words = str(found.value).split()
    count = int(words[words.index("mechanism:") + 1])
    assert f"besides {n_rigid} rigid-body" in str(found.value)
    # fine meshes: rounding stiffens one or two of them beyond recognition, never all
    assert count == n_loose if n <= 4 else 1 <= count <= n_loose
    # hinges that a feather holds are none
    feather = 1e-6 * STEEL.E * section.Iz / length
    held = solve_modes(assemble(chain(2, n, (fix(0),), length=length, section=section, stiffness=feather)))
    assert held.n_rigid == 0
    assert held.frequency[0] > 0


def test_a_mechanism_is_found_whatever_number_of_modes_is_asked_for():
    for n in (1, 3, 30):
        with pytest.raises(ModelError, match="mechanism"):
            solve_modes(assemble(chain(3, 4)), n)


def test_sound_frames_are_no_mechanisms():
    models = (portal(), lattice(3, FLAT, False), chain(1, 1), star(2))
    assert [solve_modes(assemble(model), 10).n_rigid for model in models] == [0, 6, 6, 0]


def test_rigid_modes_do_not_depend_on_the_origin():
    mesh = beam(6).mesh
    far = Mesh.from_lines(np.add(mesh.points, [1e4, -2e4, 5e3]), mesh.lines, {"beam": np.arange(6)})
    near, moved = (solve_modes(assemble(Model(m, beam(6).effects)), 12) for m in (mesh, far))
    assert moved.n_rigid == 6
    # coordinates of 2e4 m have 4e-12 m of rounding, 2e-11 of an element's length
    np.testing.assert_allclose(moved.frequency, near.frequency, rtol=1e-9)


EULER = np.pi**2 * STEEL.E * FLAT.Iy
PINNED = fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z"))


def pressed(n, load, ends=PINNED, damping=None):
    """Return a beam of 1 m, pinned unless given, under a multiple of Euler's load."""
    force = Preload(name="press", member="beam", tension=-load * EULER, buckling=EULER)
    model = beam(n, effects=(*ends, force))
    return model if damping is None else Model(model.mesh, model.effects, damping)


@pytest.mark.parametrize("n", [16, 160])  # dense, and Lanczos
@pytest.mark.parametrize("load", [1.01, 1.5, 4.5, 8.0])
def test_beyond_buckling(n, load):
    """A pinned beam has ω² = (kπ/L)⁴ EI/m - (kπ/L)² N/m, also below zero."""
    system = assemble(pressed(n, load))
    modes = solve_modes(system, 12)
    k, m = np.pi * np.arange(1, 8)[:, None], STEEL.rho * FLAT.A
    bending, pressure = k**4 * STEEL.E * np.array([FLAT.Iy, FLAT.Iz]) / m, k**2 * load * EULER / m
    exact = (bending - pressure).ravel()
    # both parts err by (kh)⁴/720, as in test_tension_and_buckling_of_a_pinned_beam
    allowed = (1.5 * (k / n) ** 4 / 720 * (bending + pressure)).ravel()
    order = np.argsort(exact)[:6]
    found = (modes.omega**2 * np.sign(modes.omega))[:6]
    assert (found[: (exact < 0).sum()] < 0).all()
    assert (abs(found - exact[order]) <= allowed[order] + (2 * np.pi) ** 2 * rounding(system)).all()
    assert (modes.zeta[modes.frequency < 0] == 0).all()


@pytest.mark.parametrize("n", [16, 160])
@pytest.mark.parametrize("load", [0.02, 0.4, 3.0])
@pytest.mark.parametrize("free", [True, False])
def test_frfs_of_unstable_structures_are_those_of_the_dynamic_stiffness(n, load, free):
    ends = () if free else PINNED
    load = load if free else 1 + load
    system = assemble(pressed(n, load, ends, Damping.structural(0.01)))
    modes = solve_modes(system, 16, check=True)
    assert (modes.frequency[: modes.n_rigid] == 0).all()
    assert modes.n_rigid == (4 if free else 0)  # two turns of a free body are not free any more
    assert (modes.frequency < 0).any()
    assert (np.diff(modes.frequency[modes.n_rigid :]) >= 0).all()
    gram = modes.shapes.T @ (system.Q @ (system.M @ (system.Q.T @ modes.shapes)))
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-8)
    f, at = np.linspace(1.0, 400.0, 60), [(0, "ry"), (5, "z")]
    H = {way: compute_frf(system, f, at, at, method=way).H for way in ("direct", "reduced", "modal")}
    peak = abs(H["direct"]).max(axis=0)
    assert (abs(H["reduced"] - H["direct"]).max(axis=0) <= 1e-5 * peak).all()  # what compute_frf promises
    assert (abs(H["modal"] - H["direct"]).max(axis=0) <= 0.05 * peak).all()
    with pytest.raises(FRFError, match="1 modes are asked for, and none of them oscillates"):
        compute_frf(system, f, at, at, method="modal", n_modes=1)


@pytest.mark.parametrize("load", [5.0, 20.0, 80.0])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_motions_without_mass_cannot_grow(n, load):
    """Turns of a lumped mass have none: an element that is past its own buckling has no fastest motion."""
    force = Preload(name="press", member="beam", tension=-load * EULER, buckling=EULER)
    system = assemble(beam(n, effects=(*PINNED, force), mass="lumped"))
    if load * np.pi**2 / n**2 < 10:  # 12 EI/l² buckle an element whose ends turn freely, fewer a chain
        assert (solve_modes(system, 3).frequency < 0).any()
    else:
        with pytest.raises(ModelError, match="a motion without mass has a negative stiffness"):
            solve_modes(system, 3)


def test_light_compression_counts_and_rounding_does_not():
    slow = solve_modes(assemble(pressed(160, 1e-4, ())), 8).frequency
    assert slow[4:6] == pytest.approx(
        solve_modes(assemble(pressed(16, 1e-4, ())), 8).frequency[4:6], rel=1e-3
    )
    assert (slow[4:6] < 0).all()
    heavy = AddedMass(name="heavy", point=0, mass=1e6)
    grounded = [Joint(name=f"g{p}", point1=p, location=np.zeros(3), K=1e-2 * np.eye(6)) for p in (0, 1)]
    soft = beam(
        1500, along=(1, 0.37, 0.61), section=Section.rectangle(0.01, 0.01), effects=(heavy, *grounded)
    )
    assert (solve_eigenpairs(assemble(soft), 12).eigenvalues >= 0).all()


@pytest.mark.parametrize("n", [16, 160])
@pytest.mark.parametrize("load", [1.01, 1.5, 10.0])
def test_what_needs_a_stable_structure_says_so(n, load):
    """Beyond buckling a structure moves against a static load, and what rests on statics is void."""
    system = assemble(pressed(n, load))
    middle, push = [6 * (1 + n // 2) + 2], np.zeros(system.model.n_dof)
    push[middle] = 1.0
    every = [int(d) for d in np.flatnonzero(np.diff(system.Q.indptr))]
    free = assemble(pressed(n, 0.4 * load, ()))
    some = [6 * p + d for p in (0, n // 2, 1, 7) for d in range(4)]
    modes = solve_modes(system, 3)
    asked = (
        lambda: solve_eigenpairs(system),
        lambda: solve_eigenpairs(free, 1),
        lambda: solve_complex_modes(system),
        lambda: solve_static(system, push),
        lambda: reduce_guyan(system, middle),
        lambda: reduce_guyan(system, every),
        lambda: reduce_guyan(free, some),
        lambda: reduce_irs(system, middle),
        lambda: reduce_serep(system, middle),
        lambda: reduce_serep(free, some, 3),
        lambda: reduce_craig_bampton(system, middle, 4),
        lambda: differentiate_modes(system, n=3),
        lambda: expand_smooth(system, modes, [(3, "z")], np.ones((1, 1)), 0.1),
    )
    for ask in asked:
        with pytest.raises(UnstableError, match="the structure is unstable"):
            ask()
    with pytest.raises(
        UnstableError, match=r"\d motion\(s\) have a negative stiffness, by 'press'; the first moves"
    ):
        solve_eigenpairs(system)
    solve_static(assemble(pressed(n, 0.99)), push)
    reduce_guyan(assemble(pressed(n, 0.99)), middle)


def test_sound_reductions_are_not_looked_at_again(monkeypatch):
    """Rounding of a static condensation is no negative stiffness: no modes are asked for."""

    def refuse(*_, **__):
        raise AssertionError

    monkeypatch.setattr(fem.reduction.condensation, "solve_eigenpairs", refuse)
    for model in (beam(50), beam(160), beam(400)):
        system = assemble(model)
        for points in ((0, 1, 5), (0, 20, 30, 40, 45, 1)):
            reduce_guyan(system, [6 * p + d for p in points for d in range(4)])


@pytest.mark.parametrize("k", [0.0, 2e5])
def test_a_mass_at_a_single_point_has_the_modes_of_its_spring(k):
    joint = Joint(name="spring", point1=0, location=np.zeros(3), K=np.diag([k, k, k, k, k, k]))
    mass = AddedMass(name="mass", point=0, mass=2.0, inertia=0.5 * np.eye(3))
    modes = solve_modes(assemble(Model(Mesh.of_points([[0.0, 0.0, 0.0]]), (mass, joint))), 6)
    closed = np.sqrt(k / np.repeat([2.0, 0.5], 3)) / (2 * np.pi)
    assert modes.frequency == pytest.approx(closed, rel=1e-6, abs=1e-3)
