"""Parts of other programs in studies: their attachments are joints, and parts need no members."""

import json
from pathlib import Path

import numpy as np
import pytest

from dovetail.file import condensed, connections
from dovetail.file.config import load_study
from dovetail.file.table import StudyError
from fem.analysis.modes import solve_modes
from fem.effects.joint_stiffness import JointStiffness
from fem.effects.superelement import Superelement
from fem.elements.part_ties import Attachment
from fem.io.matrices import read_matrices
from fem.model import DIRECTIONS
from fem.system import assemble

FRAME = """
[points]
A = [0, 0, 0]
B = [0.6, 0, 0]

[members]
first = { from = "A", to = "B" }

[materials.steel]
E = 210e9
rho = 7850

[sections.flat]
shape = "rectangle"
b = 0.03
h = 0.01

[frequency]
stop = 200
"""

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
        "bracket", read_matrices(DATA / "bracket.npz"), model.mesh, [Attachment(joint.point1, tuple(END))],
        max_frequency=400.0, residual=True,
    )  # fmt: skip
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
    assert condensed.FORMAT == 1
