"""Models of other programs' decks: closed forms, and the model that takes each card for itself."""

from dataclasses import replace

import numpy as np
import pytest

from fem import DIRECTIONS, MeshError, MeshWarning, Section, assemble, solve_modes
from fem.effects import DistributedMass
from fem.io import BarProperty, Body, Connection, DeckUnits, Equation, Link, model_of, read_model
from tests.decks import FLAT, LIGHT, STEEL, deck, everything, literal
from tests.frames import frequencies

L = 0.8
K = 3 * STEEL.E * FLAT.Iz / L**3
"""Stiffness across the tip of the cantilever, in y [N/m]: wide, 30 mm."""
BEAM = BarProperty(name="beam", material=LIGHT, section=FLAT, theory="euler-bernoulli")
ALONG_Y = ("x", "z", "rx", "ry")


def cantilever(*more_points, n=4, shift=(0.0, 0.0, 0.0)):
    """Return points and lines along x, the lines in turn forwards and backwards."""
    points = [[x, 0, 0] for x in np.linspace(0, L, n + 1)]
    points = np.array([*points, *more_points], dtype=float) + shift
    return points, [(k, k + 1) if k % 2 else (k + 1, k) for k in range(n)]


def test_a_cantilever_errs_as_cubic_elements_do():
    points, ends = cantilever(n=10)
    d = deck(points, ends, replace(BEAM, material=STEEL), supports={0: DIRECTIONS})
    model = model_of(d)
    assert list(model.mesh.members) == ["beam"]
    assert len(model.mesh.lines) == 10
    beta = 1.8751040687119611 / L
    exact = beta**2 * np.sqrt(STEEL.E * FLAT.Iy / (STEEL.rho * FLAT.A)) / (2 * np.pi)
    error = frequencies(model, 1)[0] / exact - 1
    assert error == pytest.approx((beta * L / 10) ** 4 / 1440, rel=0.05)


def test_a_mass_off_the_frame_is_a_mass_at_an_arm():
    e = 0.3
    points, ends = cantilever([L + 0.1, 0, 0], [L + 0.2, 0, 0])
    d = deck(
        points,
        ends,
        BEAM,
        supports={0: DIRECTIONS},
        bodies=(Body(name="CONM2 1", node=6, mass=2.0, arm=np.array([0.1, 0, 0])),),
        links=(
            Link(name="RBE2 1", node=4, dependents=(5,), directions=DIRECTIONS),
            Link(name="RBE2 2", node=5, dependents=(6,), directions=DIRECTIONS),
        ),
    )
    model = model_of(d)
    assert model.mesh.n_points == 5
    np.testing.assert_allclose(model.effect("CONM2 1").arm, [e, 0, 0], atol=1e-15)
    flexibility = np.array([(L**3 / 3 + L**2 * e + L * e**2) / (LIGHT.E * I) for I in (FLAT.Iy, FLAT.Iz)])
    expected = np.sqrt(1 / (2.0 * flexibility)) / (2 * np.pi)
    # the beam's mass beside 2 kg, 1e-9, is what the closed form neglects
    np.testing.assert_allclose(frequencies(model, 2), expected, rtol=1e-8)


def test_a_hinge_within_a_property_cuts_its_member():
    points, ends = cantilever(n=4)
    ends = [(0, 1), (1, 2), (2, 3), (3, 4)]
    stiffness = np.full((4, 2, 6), np.inf)
    stiffness[1, 1, 5] = 0.0
    d = deck(
        points,
        ends,
        BEAM,
        stiffness=stiffness,
        supports={0: DIRECTIONS, 4: DIRECTIONS, 2: ALONG_Y},
        bodies=(Body(name="CONM2 1", node=2, mass=2.0),),
    )
    model = model_of(d)
    assert model.mesh.groups == {"beam": ("beam.1", "beam.2")}
    expected = np.sqrt(2 * 8 * K / 2.0) / (2 * np.pi)  # two cantilevers of half the length
    np.testing.assert_allclose(frequencies(model, 1), expected, rtol=1e-8)


def test_a_hinge_at_an_end_that_is_turned():
    points, _ = cantilever(n=4)
    stiffness = np.full((4, 2, 6), np.inf)
    stiffness[3, 0, 5] = 0.0  # of the last line, which runs backwards
    ends = [(0, 1), (1, 2), (2, 3), (4, 3)]
    d = deck(points, ends, BEAM, stiffness=stiffness, supports={0: DIRECTIONS, 4: DIRECTIONS})
    member = model_of(d).effect("frame").members["beam"]
    assert (member.release1, member.release2) == ((), ("rz",))


def test_a_spring_to_a_fixed_node_is_a_spring_to_the_ground():
    points, ends = cantilever([L, 0.2, 0])
    spring = np.diag([0, 4 * K, 0, 0, 0, 0])
    d = deck(
        points,
        ends,
        BEAM,
        supports={0: DIRECTIONS, 4: ALONG_Y, 5: ("x", "y", "z")},
        bodies=(Body(name="CONM2 1", node=4, mass=2.0),),
        connections=(Connection(name="CBUSH 1", nodes=(5, 4), K=spring),),
    )
    model = model_of(d)
    assert model.mesh.n_points == 5
    assert (model.effect("CBUSH 1").point1, model.effect("CBUSH 1").point2) == (4, None)
    np.testing.assert_allclose(frequencies(model, 1), np.sqrt(5 * K / 2.0) / (2 * np.pi), rtol=1e-8)


def test_a_mass_on_a_spring_moves_by_itself():
    points, ends = cantilever([L, 0.2, 0])
    m1, m2, k2 = 2.0, 0.5, 0.3 * K
    d = deck(
        points,
        ends,
        BEAM,
        supports={0: DIRECTIONS, 4: ALONG_Y},
        bodies=(Body(name="CONM2 1", node=4, mass=m1), Body(name="CONM2 2", node=5, mass=m2)),
        connections=(Connection(name="CELAS2 1", nodes=(5, 4), K=np.diag([0, k2, 0, 0, 0, 0])),),
    )
    model = model_of(d)
    omega2 = np.linalg.eigvals(np.array([[(K + k2) / m1, -k2 / m1], [-k2 / m2, k2 / m2]]))
    np.testing.assert_allclose(frequencies(model, 2), np.sqrt(np.sort(omega2)) / (2 * np.pi), rtol=1e-8)
    assert model.mesh.notes == (
        "frame.bdf: nothing resists the motion of node 6 in x z rx ry rz: fixed there",
    )


def test_a_mass_on_the_mean_of_two_nodes():
    points = np.array([[0, 0, 0], [L, 0, 0], [0, 0, 1], [L / 2, 0, 1], [L, 0, 0.5]])
    mean = tuple(
        Equation(name=f"RBE3 {d}", terms=((4, d, 1.0), (1, d, -0.5), (3, d, -0.5))) for d in DIRECTIONS
    )
    d = deck(
        points,
        [(0, 1), (2, 3)],
        BEAM,
        supports={0: DIRECTIONS, 1: ALONG_Y, 2: DIRECTIONS, 3: ALONG_Y},
        bodies=(Body(name="CONM2 1", node=4, mass=2.0),),
        equations=mean,
    )
    expected = np.sqrt(4 / (2.0 * (1 / K + 1 / (8 * K)))) / (2 * np.pi)
    np.testing.assert_allclose(frequencies(model_of(d), 1), expected, rtol=1e-8)


def test_a_skew_support():
    a = 0.4
    axes = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    rod = replace(BEAM, theory="bar")
    d = deck(
        [[0, 0, 0], [L, 0, 0]],
        [(0, 1)],
        rod,
        supports={0: DIRECTIONS},
        bodies=(Body(name="CONM2 1", node=1, mass=2.0),),
        connections=(Connection(name="SPC 1", nodes=(1, None), axes=axes, rigid=("y", "z")),),
    )
    k = LIGHT.E * FLAT.A / L * np.cos(a) ** 2
    np.testing.assert_allclose(frequencies(model_of(d), 1), np.sqrt(k / 2.0) / (2 * np.pi), rtol=1e-8)


def test_a_rigid_base_whose_leading_node_is_fixed():
    points, ends = cantilever([-0.1, 0, 0])
    base = Link(name="RBE2 1", node=5, dependents=(0,), directions=DIRECTIONS)
    built_in = model_of(deck(points[:5], ends, supports={0: DIRECTIONS}))
    model = model_of(deck(points, ends, links=(base,), supports={5: DIRECTIONS}))
    assert model.mesh.n_points == 5
    np.testing.assert_allclose(frequencies(model), frequencies(built_in), rtol=1e-12)
    hinge = model_of(deck(points, ends, links=(base,), supports={5: ("x", "y", "z", "rx", "ry")}))
    wanted = literal(deck(points, ends, links=(base,), supports={5: ("x", "y", "z", "rx", "ry")}))
    np.testing.assert_allclose(
        solve_modes(assemble(hinge), 4).frequency[1:],
        solve_modes(assemble(wanted), 4).frequency[1:],
        rtol=1e-8,
    )


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_non_structural_mass_has_no_rotary_inertia(mass):
    points, ends = cantilever(n=5)
    plain = replace(BEAM, material=STEEL, mass=mass)
    heavy = replace(plain, mass_per_length=3 * STEEL.rho * FLAT.A)
    bending = {0: DIRECTIONS} | {k: ("x", "rx") for k in range(1, 6)}
    f, g = (frequencies(model_of(deck(points, ends, p, supports=bending))) for p in (plain, heavy))
    np.testing.assert_allclose(g, f / 2, rtol=1e-10)


def test_all_cards_together():
    d = everything()
    model = model_of(d)
    assert model.mesh.n_points == 19  # 17 on bars, the mass on a spring, the node of RBE3
    assert model.of_kind(DistributedMass)
    d = replace(d, supports={**d.supports, 19: ("rx", "ry", "rz")})  # which nothing resists
    np.testing.assert_allclose(frequencies(model, 20), frequencies(literal(d), 20), rtol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_turned_lines_of_any_deck(seed):
    """Random directions of lines, orientations, tapers and offsets: each bar keeps what its card says."""
    rng = np.random.default_rng(seed)
    n = 12
    angle = np.linspace(0, 1.5 * np.pi, n + 1)
    points = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    ends = [(k, k + 1) if rng.random() < 0.5 else (k + 1, k) for k in range(n)]
    ends += [(n, 0)] if seed % 2 else []
    height = np.where(rng.random((len(ends), 1)) < 0.5, [0.2, 0.1, 1.0], [0.0, 0.0, 2.0])
    offsets = np.zeros((len(ends), 2, 3))
    offsets[rng.random(len(ends)) < 0.4] = [0, 0, 0.02]
    offsets[rng.random((len(ends), 2)) < 0.1] = [0, 0.01, 0.0]
    stiffness = np.full((len(ends), 2, 6), np.inf)
    stiffness[rng.random((len(ends), 2)) < 0.2, 4] = 1e3
    flat, angled = FLAT, Section(A=3e-4, Iy=2e-8, Iz=5e-9, J=6e-9, ky=0.8, kz=0.8, angle=0.5)
    d = deck(
        points,
        ends,
        BarProperty(name="a", material=STEEL, section=flat),
        BarProperty(name="b", material=STEEL, section=angled),
        BarProperty(name="c", material=STEEL, section=flat, section2=Section.rectangle(b=0.02, h=0.02)),
        kinds=np.sort(rng.integers(0, 3, len(ends))),
        height=height,
        offsets=offsets,
        stiffness=stiffness,
        supports={0: DIRECTIONS},
    )
    model = model_of(d)
    np.testing.assert_allclose(frequencies(model, 12), frequencies(literal(d), 12), rtol=1e-8)
    if seed == 0:
        fine = model.with_mesh(model.mesh.refined(0.05))
        assert (frequencies(fine, 4) <= frequencies(model, 4) * (1 + 1e-6)).all()


def test_members_have_names_of_their_own():
    points, ends = cantilever(n=4)
    kinds = [0, 1, 2, 0]
    three = (BEAM, replace(BEAM, material=STEEL), replace(BEAM, name="beam.1"))
    mesh = model_of(deck(points, ends, *three, kinds=kinds)).mesh
    assert mesh.groups == {"beam": ("beam.3", "beam.4")}
    lines = {name: rows.tolist() for name, rows in mesh.members.items()}
    assert lines == {"beam.3": [0], "beam.4": [3], "beam.2": [1], "beam.1": [2]}


def test_a_closed_ring():
    angle = np.linspace(0, 2 * np.pi, 13)[:-1]
    points = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    ends = [(k, (k + 1) % 12) for k in range(12)]
    stiffness = np.full((12, 2, 6), np.inf)
    stiffness[0, 0, 4] = 10.0
    d = deck(points, ends, stiffness=stiffness, supports={3: DIRECTIONS})
    np.testing.assert_allclose(frequencies(model_of(d)), frequencies(literal(d)), rtol=1e-9)


def test_a_node_that_two_pinned_links_share_is_a_ball_joint():
    points = [[0, 0, 0], [0.4, 0, 0], [0.5, 0, 0], [0.6, 0, 0], [1.0, 0, 0]]
    pins = tuple(Link(name=f"RBE2 {k}", node=k, dependents=(2,), directions=("x", "y", "z")) for k in (1, 3))
    d = deck(points, [(0, 1), (3, 4)], links=pins, supports={0: DIRECTIONS, 4: DIRECTIONS})
    held = replace(d, supports={**d.supports, 2: ("rx", "ry", "rz")})  # which nothing resists
    np.testing.assert_allclose(frequencies(model_of(d)), frequencies(literal(held)), rtol=1e-9)


def test_refusals_name_file_and_element():
    points, ends = cantilever(n=2)
    with pytest.raises(MeshError, match=r"frame.bdf: it has bars without sections"):
        model_of(replace(deck(points, ends), properties=()))
    with pytest.raises(MeshError, match=r"frame.bdf: element 20, from node 3 to node 3, has no length"):
        model_of(deck(points, [(0, 1), (2, 2)]))
    height = np.array([[0, 0, 1.0], [2, 0, 0]])
    with pytest.raises(MeshError, match=r"element 20, .* has an orientation vector along its axis"):
        model_of(deck(points, ends, height=height))
    stiffness = np.full((2, 2, 6), np.inf)
    stiffness[1, :, 3] = 0.0
    with pytest.raises(MeshError, match=r"frame.bdf: element 20: .* nothing holds the member's torsion"):
        model_of(deck(points, ends, stiffness=stiffness))
    with pytest.raises(MeshError, match=r"frame.bdf: 'CONM2 1': its mass is -1 kg"):
        model_of(deck(points, ends, bodies=(Body(name="CONM2 1", node=1, mass=-1.0),)))


def test_units_and_notes(monkeypatch, tmp_path):
    assert DeckUnits.of("mm-t-s").stress == pytest.approx(1e6)
    assert DeckUnits.of((1e-3, 1.0, 1e-3)).force == pytest.approx(1e3)
    assert DeckUnits.of("mm-t-s").density == pytest.approx(1e12)
    with pytest.raises(MeshError, match="the units are 'cm'; allowed are SI, mm-t-s"):
        DeckUnits.of("cm")
    with pytest.raises(MeshError, match=r"length, mass and time in m, kg and s are needed"):
        DeckUnits.of((1.0, 2.0))
    with pytest.raises(MeshError, match=r"models are read from \.bdf.*, not '\.msh'"):
        read_model(tmp_path / "a.msh")
    monkeypatch.setattr("fem.io.frame_model.read_deck", lambda *_: everything())
    with pytest.warns(MeshWarning, match="frame.bdf: PCOMP 7 is left out"):
        model = read_model("frame.bdf")
    assert model.mesh.point_names["node 12"] == 11
