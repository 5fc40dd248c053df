"""Parts of other programs in studies: their attachments are joints, and parts need no members."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import StudyError, load_study, main
from dovetail.export import WRITERS, exported_deck
from dovetail.file import connections
from fem import DIRECTIONS, Attachment, Superelement, assemble, solve_modes
from fem.effects import JointStiffness
from fem.io import model_of, read_deck, read_matrices, write_matrices, write_npz
from tests.frames import FLAT_STEEL

FRAME = (
    """
[points]
A = [0, 0, 0]
B = [0.6, 0, 0]

[members]
first = { from = "A", to = "B" }
"""
    + FLAT_STEEL
    + """
[frequency]
stop = 200
"""
)

DATA = Path(__file__).parents[1] / "data" / "bracket"
CALCULIX = json.loads((DATA / "calculix.json").read_text())
END, TOP = CALCULIX["nodes"]["END"], CALCULIX["nodes"]["TOP"]


def study(tmp_path, text):
    (tmp_path / "bracket.npz").write_bytes((DATA / "bracket.npz").read_bytes())
    (tmp_path / "study.toml").write_text(text)
    return load_study(tmp_path / "study.toml")


def attached(more=""):
    return (
        f'{FRAME}[[superelements]]\nfile = "bracket.npz"\nattach = [{{ point = "B", nodes = {END}{more} }}]\n'
    )


def test_an_attachment_is_a_rigid_joint_that_costs_nothing(tmp_path):
    """The frequencies are those of the part tied to the frame's point itself."""
    model = study(tmp_path, attached()).model
    joint, part = model.effect("bracket.1"), model.effect("bracket")
    assert set(joint.rigid) == set(DIRECTIONS)
    assert (joint.point2,) == part.points
    direct = Superelement.from_matrices(
        "bracket",
        read_matrices(DATA / "bracket.npz"),
        model.mesh,
        [Attachment(joint.point1, tuple(END))],
        max_frequency=400.0,
        residual=True,
    )
    tied = model.without_effect("bracket.1", "bracket").with_effect(direct)
    tied = tied.with_mesh(model.mesh)
    expected = solve_modes(assemble(model), n=14).frequency
    # the point of its own has nothing on it here; hold it out of the way by the same joint
    both = tied.with_effect(joint)
    np.testing.assert_allclose(solve_modes(assemble(both), n=14).frequency, expected, rtol=1e-9, atol=1e-3)


def test_each_direction_of_an_attachment_is_a_candidate(tmp_path):
    model = study(tmp_path, attached()).model
    found = {e.direction for e in JointStiffness.propose(model) if e.joints == ("bracket.1",)}
    assert found == set(DIRECTIONS)


def test_an_attachment_may_have_a_stiffness(tmp_path):
    model = study(
        tmp_path, attached(', name = "bolt", k = { kx = 2e7, kz = 1e5 }, rigid = "y rx ry rz"')
    ).model
    assert model.effect("bolt").K[0, 0] == 2e7
    soft = solve_modes(assemble(model), n=14).frequency
    stiff = solve_modes(assemble(study(tmp_path, attached()).model), n=14).frequency
    assert (soft[6:] < stiff[6:] * (1 + 1e-9)).all()
    assert (soft[6:] / stiff[6:]).min() < 0.99


def test_stiffness_and_mass_of_parts_are_uncertain(tmp_path):
    found = {n.refs[0]: n.std for n in study(tmp_path, attached()).nuisances}
    assert found["bracket", "stiffness"] == 0.05
    assert found["bracket", "mass"] == pytest.approx(0.02, rel=1e-12)
    text = attached() + "[uncertain]\nparts = 0.1\npart.bracket.mass = 0\n"
    found = {n.refs[0]: n.std for n in study(tmp_path, text).nuisances}
    assert found["bracket", "stiffness"] == 0.1
    assert ("bracket", "mass") not in found


def test_modes_of_parts_are_uncertain_where_asked(tmp_path):
    text = attached().replace("stop = 200", "stop = 6000") + "[uncertain]\npart_modes = 0.03\n"
    made = study(tmp_path, text)
    part = made.model.effect("bracket")
    assert part.n_uncertain == (part.fixed_frequency < 12000).sum() > 0
    found = {n.refs[0]: n.std for n in made.nuisances}
    assert {name: std for (_, name), std in found.items() if name.startswith("mode")} == {
        f"mode{k + 1}": 0.03 for k in range(part.n_uncertain)
    }
    alone = study(tmp_path, text + "part.bracket.modes = 0\n")
    assert alone.model.effect("bracket").n_uncertain == 0
    fitted = study(tmp_path, text + "[values.bracket]\nmode1 = 0.02\n")
    assert fitted.model.values()["bracket", "mode1"] == 0.02


PARTS = f"""
[[superelements]]
file = "bracket.npz"
name = "left"
attach = [
  {{ name = "left end", nodes = {END} }},
  {{ name = "left top", nodes = {TOP} }},
  {{ name = "corner", nodes = [{TOP[0] - 1}] }},
]

[[sensors]]
name = "s"
point = "corner"
direction = "x"

[[excitations]]
sensor = "s"

[frequency]
stop = 6000
"""


def test_a_part_alone_is_a_structure(tmp_path):
    """Free, with all its points: CalculiX's frequencies, to what the modes left out cost."""
    found = study(tmp_path, PARTS)
    modes = solve_modes(assemble(found.model), n=9)
    expected = np.array(CALCULIX["frequency_Hz"]["free"])[6:9]
    assert modes.n_rigid == 6
    part = found.model.effect("left")
    error = part.frequency_error(found.model, modes.frequency, modes.shapes)[6:]
    below = modes.frequency[6:] < 12000
    assert below.any()
    assert (modes.frequency[6:][below] / expected[below] - 1 <= 3 * error[below] + 2e-3).all()
    assert (modes.frequency[6:][below] / expected[below] - 1 >= -1e-6).all()


def test_a_place_that_no_attachment_names_is_refused(tmp_path):
    with pytest.raises(StudyError, match=r"at \[0.5, 0.5, 0.5\] m is at no point of a part"):
        study(tmp_path, PARTS.replace('point = "corner"', "point = [0.5, 0.5, 0.5]"))
    with pytest.raises(StudyError, match="there is a point 'left end' already"):
        study(tmp_path, PARTS.replace('"left top"', '"left end"'))


def test_a_part_is_not_named_like_the_members(tmp_path):
    with pytest.raises(StudyError, match="name: 'frame' stands for the members; give the part another name"):
        study(tmp_path, attached().replace("file =", 'name = "frame"\nfile ='))


def test_a_large_part_is_condensed_once(tmp_path, monkeypatch):
    monkeypatch.setattr(connections, "WORTH_KEEPING", 10)
    first = study(tmp_path, PARTS).model.effect("left")
    assert (tmp_path / "left.condensed.npz").is_file()
    with monkeypatch.context() as patch:
        patch.setattr(Superelement, "from_matrices", lambda *_, **__: pytest.fail("condensed again"))
        again = study(tmp_path, PARTS).model.effect("left")
    for key in ("K", "M", "recovery", "left_out"):
        np.testing.assert_array_equal(getattr(first, key), getattr(again, key))
    other = study(tmp_path, PARTS.replace("stop = 6000", "stop = 3000")).model.effect("left")
    assert other.limit < first.limit or other.n_internal < first.n_internal
    (tmp_path / "left.condensed.npz").write_bytes(b"PK damaged")
    np.testing.assert_array_equal(study(tmp_path, PARTS).model.effect("left").K, first.K)
    assert connections.FORMAT == 1


SUPPORTED = attached() + '[[supports]]\npoint = "A"\n'


@pytest.mark.parametrize("name", ["again.npz", "again.mtx"])
def test_matrices_written_are_the_same_part(tmp_path, name):
    expected = solve_modes(assemble(study(tmp_path, SUPPORTED).model), n=14).frequency
    write_matrices(tmp_path / name, read_matrices(DATA / "bracket.npz"))
    again = study(tmp_path, SUPPORTED.replace("bracket.npz", name)).model
    np.testing.assert_allclose(solve_modes(assemble(again), n=14).frequency, expected, rtol=1e-6)


def test_matrices_of_a_frame_are_a_part_of_another(tmp_path):
    """A frame that is free: written as matrices, and read as a part that is tied at one of its points."""
    undamped = FRAME + "[damping]\nmodal = 0\n"
    free = study(tmp_path, undamped).model
    write_matrices(tmp_path / "arm.mtx", assemble(free))
    last = free.mesh.point_names["B"]
    at = FRAME.replace("A = [0, 0, 0]", "A = [0.6, 0.4, 0]")
    part = f'attach = [{{ point = "B", nodes = [{last}] }}]'
    text = f'{at}[[superelements]]\nfile = "arm.mtx"\n{part}\nmodes = 300\n'
    both = FRAME.replace("[members]", 'C = [0.6, 0.4, 0]\n\n[members]\nother = { from = "C", to = "B" }')
    found = solve_modes(assemble(study(tmp_path, text).model), n=20)
    expected = solve_modes(assemble(study(tmp_path, both).model), n=20)
    assert found.n_rigid == expected.n_rigid == 6
    np.testing.assert_allclose(found.frequency[6:], expected.frequency[6:], rtol=1e-6)


@pytest.mark.parametrize(("program", "suffix"), [("abaqus", ".inp"), ("ansys", ".cdb")])
def test_a_whole_deck_has_the_part(tmp_path, program, suffix):
    """Its matrices become springs and masses along combinations of motions."""
    made = study(tmp_path, SUPPORTED)
    deck, heading = exported_deck(made, whole=True)
    path = tmp_path / f"deck{suffix}"
    path.write_text(WRITERS[program](deck, heading=heading))
    found = solve_modes(assemble(model_of(read_deck(path, "SI"))), n=14).frequency
    np.testing.assert_allclose(found, solve_modes(assemble(made.model), n=14).frequency, rtol=1e-6)


def test_cards_of_what_was_found_leave_a_part_to_its_program(tmp_path):
    """A fitted part has no cards: a note says what to change in its own model."""
    bolt = ', name = "bolt", k = { kx = 2e7, kz = 1e5 }, rigid = "y rx ry rz"'
    made = study(
        tmp_path,
        attached(bolt)
        + '[[effects]]\ncandidate = "joint_stiffness:bolt.x"\nstiffness = 3e5\n'
        + '[estimates]\n"bracket.stiffness" = { before = 0.0, std = 0.01 }\n'
        + '"bolt.kz" = { before = 1e5, std = 1e3 }\n',
    )
    made = replace(
        made, model=made.model.with_values({("bracket", "stiffness"): 0.04, ("bolt", "kz"): 1.2e5})
    )
    deck, lines = exported_deck(made, whole=False, fitted=True)
    assert not deck.matrices
    assert [c.name.split(" with ")[0] for c in deck.connections] == ["bolt"]
    (note,) = (n for n in deck.notes if "change the part's own model: stiffness of part bracket" in n)
    assert "0.040 ± 0.010" in note
    assert not any("bracket" in line or "kx" in line for line in lines)


JOINED = f"""
{SUPPORTED}
[[sensors]]
name = "s"
point = "B"
direction = "z"

[[sensors]]
name = "t"
member = "first"
position = 0.3
direction = "z"

[[excitations]]
sensor = "t"

[damping]
modal = 0.004

[uncertain]
joints = 0
"""


def test_a_joint_of_a_part_is_identified_from_frfs(tmp_path, capsys):
    """The other side of the joint is a part whose stiffness and mass are uncertain, too."""
    bolt = (
        ', name = "bolt", k = { kx = 4e6, ky = 5e6, kz = 2e6, krx = 2e3, kry = 1e3, krz = 3e3 }, rigid = ""'
    )
    text = JOINED.replace("nodes = ", f"{bolt[2:]}, nodes = ").replace("stop = 200", "stop = 800")
    study(tmp_path, text)
    made = dovetail.load_study(tmp_path / "study.toml")
    lines = np.arange(20.0, 800.0, 2.0)
    truth = made.model.with_values({("bolt", "kry"): 400.0, ("bracket", "mass"): 0.01})
    write_npz(tmp_path / "frf.npz", replace(made, model=truth).frf(lines))
    (tmp_path / "measured.toml").write_text(text + '[[measurements]]\nfile = "frf.npz"\n')
    command = ["identify-joint", str(tmp_path / "measured.toml"), "--joint", "bolt", "--directions", "ry"]
    assert main([*command, "--terms", "K", "--accuracy", "0.01", "--quiet", "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["directions"]
    assert found["k"] == pytest.approx(400.0, rel=0.02)
    assert abs(found["k"] - 400.0) < 3 * found["k_std"]
