"""Decks of a model: what they hold, and what the readers of other programs' decks make of their text."""

import re
import warnings

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    MeshError,
    Model,
    MultiPointConstraint,
    PointMass,
    RigidLink,
    Section,
    Support,
    assemble,
    first_modes,
)
from fem.effects import (
    Crack,
    DistributedMass,
    EndRelease,
    JointStiffness,
    MemberDensity,
    SprungMass,
    StiffnessLoss,
    SupportFlexibility,
)
from fem.io import abaqus_text, ansys_text, deck_of, model_of, nastran_text, read_model
from fem.io.deck_changes import changed_deck
from fem.io.deck_nodes import connection_matrices, plain, with_nodes
from fem.io.nastran_write import number

STEEL = Material("steel", 210e9, 7850.0, 0.3)
ALUMINIUM = Material("aluminium", 70e9, 2700.0, 0.33)
BOX = Section.hollow_rectangle(b=0.06, h=0.1, t=0.004)
FLAT = Section.rectangle(b=0.03, h=0.05)
WIRE = Section.circle(d=0.016)
TURNED = np.array([[np.cos(0.4), np.sin(0.4), 0.0], [-np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
POINTS = np.array(
    [
        [0, 0, 0],
        [0, 0, 1],
        [0, 0, 2],
        [1, 0.2, 2],
        [2, 0.3, 2],
        [2, 0, 0],
        [2, 0, 1],
        [2, 0.5, 2.2],
        [1, 0.2, 2.3],
    ],
    dtype=float,
)
ROD = {".bdf": "lumped-slender", ".inp": "consistent", ".cdb": "consistent"}
"""Mass of rods by program."""
TEXTS = {".bdf": nastran_text, ".inp": abaqus_text, ".cdb": ansys_text}


def frame(*more, softness=None, elements=6, theory="timoshenko", rod="consistent"):
    """Return a bay with offsets, a brace, a body on an arm, links, an equation and turned connections."""
    lines = [[0, 1], [1, 2], [2, 3], [3, 4], [5, 6], [6, 4], [0, 4], [7, 8]]
    members = {"left": [0, 1], "beam": [2, 3], "right": [4, 5], "brace": [6], "top": [7]}
    mesh = Mesh.from_lines(POINTS, lines, members)
    mesh = mesh.refined(counts={m: elements for m in ("left", "beam", "right", "top")})
    up = {"theory": theory, "orientation": np.array([1.0, 0.3, 0.0])}
    properties = {
        "left": MemberProperties(STEEL, BOX, **up),
        "beam": MemberProperties(
            ALUMINIUM,
            BOX,
            theory=theory,
            offset1=np.array([0, 0, 0.05]),
            offset2=np.array([0.02, 0, 0.05]),
            **(softness or {}),
        ),
        "right": MemberProperties(STEEL, BOX, **up),
        "brace": MemberProperties(STEEL, WIRE, theory="bar", mass=rod),
        "top": MemberProperties(ALUMINIUM, FLAT, theory=theory),
    }
    inertia = np.array([[0.02, 0.003, 0], [0.003, 0.03, -0.002], [0, -0.002, 0.04]])
    effects = (
        Frame(members=properties),
        Support(name="foot", point=0),
        Joint(
            name="skew",
            point1=5,
            location=POINTS[5],
            axes=TURNED,
            rigid=("x", "z", "rx"),
            K=np.diag([0, 3e6, 0, 0, 2e4, 1e4]),
            C=np.diag([0, 10.0, 0, 0, 0, 0]),
        ),
        Joint(
            name="mount",
            point1=7,
            point2=4,
            location=np.array([2, 0.45, 2.1]),
            axes=TURNED,
            K=np.diag([1e6, 2e6, 3e6, 1e4, 2e4, 3e4]),
            eta=0.1,
        ),
        RigidLink(name="plate", point=3, dependents=(8,)),
        MultiPointConstraint(name="gear", terms=((6, "x", 1.0), (1, "x", -0.5))),
        AddedMass(name="motor", point=2, mass=12.0, inertia=inertia, arm=np.array([0.1, -0.05, 0.2])),
        AddedMass(name="box", point=6, mass=3.0),
        SprungMass(name="absorber", point=4, mass=2.0, k={"z": 4e4}, c={"z": 5.0}),
        DistributedMass.over(mesh, "beam", properties["beam"], 2.0),
    )
    return Model(mesh, (*effects, *more), Damping.structural(0.02))


SOFT = {"release1": ("ry",), "spring2": {"rz": 3e4, "ry": 5e4}}
FOUND = (
    Crack(
        name="crack:left.ry",
        member="left",
        position=0.45,
        compliance=2e-5,
        direction="ry",
        length=2.0,
        reference=1.0,
    ),
    EndRelease(
        name="end_release:right.2.ry", member="right", end=2, direction="ry", compliance=1e-5, reference=1.0
    ),
    PointMass(name="point_mass:right", member="right", position=0.3, mass=1.5),
    MemberDensity(name="member_density:right", member="right", change=0.1),
    JointStiffness(
        name="joint_stiffness:mount.x", joints=("mount",), direction="x", stiffness=6e5, assumed=1e6
    ),
    SupportFlexibility(name="support_flexibility:foot.ry", supports=("foot",), direction="ry", stiffness=1e5),
)


LOSS = StiffnessLoss.propose(frame())[0].with_values(loss=0.3)


def frequencies(model, n=15):
    return first_modes(assemble(model, reciprocal=False), n).frequency


def read_back(path, text, units="SI"):
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notes of the reader on mass matrices and damping
        return read_model(path, units)


def worst(found, expected):
    return np.abs(found / expected - 1).max()


@pytest.mark.parametrize("softness", [None, SOFT])
def test_a_deck_has_all_of_a_model(softness):
    """A crack, a mass and soft ends are exact on a mesh with a point where they are."""
    model = frame(*FOUND, softness=softness)
    deck = deck_of(model)
    mesh = model.mesh.with_point_on("left", 0.45).with_point_on("right", 0.3)
    assert not deck.notes
    assert not deck.matrices
    assert worst(frequencies(model_of(deck)), frequencies(model.with_mesh(mesh))) < 1e-10


@pytest.mark.parametrize("suffix", TEXTS)
@pytest.mark.parametrize("units", ["SI", "mm-t-s"])
def test_a_deck_read_again_has_the_same_frequencies(tmp_path, suffix, units):
    model = frame(rod=ROD[suffix])
    again = read_back(tmp_path / f"deck{suffix}", TEXTS[suffix](deck_of(model), units), units)
    assert worst(frequencies(again), frequencies(model)) < 1e-6


def test_slender_beams_keep_their_theory(tmp_path):
    for suffix in (".bdf", ".inp"):
        model = frame(theory="euler-bernoulli", rod=ROD[suffix])
        again = read_back(tmp_path / f"deck{suffix}", TEXTS[suffix](deck_of(model)))
        assert worst(frequencies(again), frequencies(model)) < 1e-6


@pytest.mark.parametrize("suffix", TEXTS)
def test_soft_ends_and_effects_become_connections_of_new_nodes(tmp_path, suffix):
    """The nodes behind soft ends have motions of their own, which members have statically."""
    deck = deck_of(frame(*FOUND, softness=SOFT, rod=ROD[suffix]))
    expected = with_nodes(deck, releases=suffix != ".bdf")
    again = read_back(tmp_path / f"deck{suffix}", TEXTS[suffix](deck))
    assert worst(frequencies(again), frequencies(model_of(expected))) < 1e-6


def test_motions_behind_soft_ends_matter_less_on_finer_meshes():
    """Mass that slips statically errs by order h⁴: a sixteenth on half of the elements' length."""
    errors = []
    for elements in (6, 12):
        model = frame(softness=SOFT, elements=elements)
        nodes = model_of(with_nodes(deck_of(model), releases=True))
        errors.append(worst(frequencies(nodes, 5), frequencies(model, 5)))
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.3)


def test_matrices_become_springs_along_combinations_of_motions():
    model = frame(LOSS)
    deck = deck_of(model)
    coupled = [c for c in deck.connections if not plain(c)]
    assert coupled
    split = with_nodes(deck, springs=plain)
    assert all(plain(c) for c in split.connections)
    assert worst(frequencies(model_of(split)), frequencies(model)) < 1e-7


def test_matrices_of_an_effect_are_those_of_its_dmig():
    deck = deck_of(frame(LOSS))
    expected: dict[tuple[int, ...], float] = {}
    for m in (connection_matrices(deck, c) for c in deck.connections if not plain(c)):
        at = [(int(deck.nodes[n]), d) for n in m.nodes for d in range(1, 7)]
        for i, j in np.argwhere(m.K):
            if at[i] >= at[j]:
                key = (*at[i], *at[j])
                expected[key] = expected.get(key, 0.0) + m.K[i, j]
    found = _dmig(nastran_text(deck))
    assert "K2GG = KEFF" in nastran_text(deck)
    assert found.keys() == expected.keys()
    values = np.array([(found[key], expected[key]) for key in found])
    assert np.abs(values[:, 0] - values[:, 1]).max() < 1e-9 * np.abs(values).max()


def _dmig(text):
    """Return the entries of K by node and direction of row and column."""
    out, fields = {}, []
    for line in [*text.splitlines(), "END"]:
        if line.startswith("*"):
            fields += [line[k : k + 16].strip() for k in range(8, 72, 16)]
            continue
        if fields[:1] == ["KEFF"] and fields[2] and fields[1] != "0":
            cells = fields[4:]
            for n, d, value in zip(cells[::4], cells[1::4], cells[2::4], strict=False):
                if n:
                    out[int(n), int(d), int(fields[1]), int(fields[2])] = float(value.replace("D", "e"))
        fields = [line[k : k + 16].strip() for k in range(8, 72, 16)] if line.startswith("DMIG*") else []
    return out


def test_numbers_fill_their_field():
    values = 10 ** np.linspace(-40, 40, 999)
    for value in (*values, *-values, 0.0, 9999999.999999999, 0.0099999999999999):
        text = number(float(value))
        back = float(re.sub(r"(?<=[\d.])([+-])", r"e\1", text))
        assert len(text) <= 16
        assert "." in text
        assert back == pytest.approx(value, rel=1e-10)
    with pytest.raises(MeshError, match="nan is no number"):
        number(float("nan"))


def test_the_change_of_a_deck_has_the_cards_of_its_effects_alone():
    before, now = deck_of(frame(softness=SOFT)), deck_of(frame(*FOUND, softness=SOFT))
    change = changed_deck(now, before)
    text = nastran_text(change)
    assert [b.name for b in change.bodies] == ["point_mass:right"]
    names = [c.name for c in change.connections]
    assert names == ["mount with joint_stiffness:mount.x", "support_flexibility:foot.ry"]
    assert [p.name for p in change.properties] == ["left", "right"]
    # of the mass and the crack, behind two soft ends, and on both sides of the mount
    assert text.count("GRID*") == 6
    assert "take out of the supports of node 1: ry" in text
    assert "SOL 103" not in text
    assert changed_deck(before, before).bars.numbers.size == 0


def test_nodes_keep_the_numbers_of_the_deck_that_the_model_is_of(tmp_path):
    deck = deck_of(frame())
    text = nastran_text(deck)
    model = read_back(tmp_path / "deck.bdf", text)
    again = deck_of(model)
    place = {int(n): tuple(np.round(p, 9)) for n, p in zip(deck.nodes, deck.points, strict=True)}
    kept = [
        n
        for n, p in zip(again.nodes, again.points, strict=True)
        if place.get(int(n)) == tuple(np.round(p, 9))
    ]
    assert len(kept) >= len(deck.nodes) - 1  # but for the node of the absorber, which gets another


@pytest.mark.parametrize(("suffix", "mark"), [(".bdf", "$"), (".inp", "**"), (".cdb", "!")])
def test_comments_name_effects_and_what_is_left_out(suffix, mark):
    deck = deck_of(frame(*FOUND))
    heading = ["found: stiffness 2.1·10⁻⁴ ± 0.3 N·m/rad"]
    text = TEXTS[suffix](deck, "SI", heading)
    assert f"{mark} found: stiffness 2.1e-4 +- 0.3 N m/rad" in text
    assert f"{mark} mount with joint_stiffness:mount.x" in text
    assert text.isascii()
    assert max(map(len, text.splitlines())) < 200
