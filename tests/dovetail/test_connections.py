"""Joints with axes, viscoelastic elements, rigid links and equations in study files."""

import json
from pathlib import Path

import numpy as np
import pytest

from dovetail import StudyError, load_study
from tests.frames import FLAT_STEEL

FRAME = (
    """
[points]
A = [0, 0, 0]
B = [0.6, 0, 0]
C = [0, 0.02, 0]
D = [0.6, 0.02, 0]

[members]
first = { from = "A", to = "B" }
second = { from = "C", to = "D" }
"""
    + FLAT_STEEL
    + """
[frequency]
stop = 200

[damping]
modal = 0.01
"""
)


def study(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(FRAME + text, encoding="utf-8")
    return load_study(path)


def test_axes_of_a_joint(tmp_path):
    text = '[[joints]]\npoint1 = "A"\npoint2 = "C"\nk.kx = 5.0\naxes = [[0, 2, 0], [-3, 1, 0]]\n'
    (joint,) = (e for e in study(tmp_path, text).model.effects if e.kind == "joint")
    np.testing.assert_allclose(joint.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert joint.K[0, 0] == 5.0


def test_viscoelastic_elements(tmp_path):
    text = """
[[viscoelastic]]
name = "rubber"
point1 = "A"
point2 = "C"
law = "fractional_zener"
k = { kx = 1e5, kz = 2e5 }
ratio = 5.0
tau = 1e-3
alpha = 0.5

[[viscoelastic]]
name = "mount"
point1 = "B"
law = "table"
table.frequency = [10, 100]
table.kz = { storage = [1e5, 2e5], loss = [1e4, 3e4] }
"""
    model = study(tmp_path, text).model
    rubber, mount = model.effect("rubber"), model.effect("mount")
    np.testing.assert_array_equal(np.diag(rubber.K), [1e5, 0, 2e5, 0, 0, 0])
    assert (rubber.law.ratio, rubber.law.tau, rubber.law.alpha) == (5.0, 1e-3, 0.5)
    assert mount.K[1, 2, 2] == 2e5 + 3e4j
    assert mount.point2 is None


def test_links_and_equations(tmp_path):
    text = """
[[rigid_links]]
point = "A"
dependents = ["C", { member = "second", position = 0.3 }]
directions = "x y z"

[[constraints]]
terms = [
    { point = "B", direction = "z", coefficient = 1 },
    { point = "D", direction = "z", coefficient = -1 },
]
"""
    model = study(tmp_path, text).model
    link, tie = model.effect("link1"), model.effect("constraint1")
    np.testing.assert_allclose(model.mesh.points[list(link.dependents)], [[0, 0.02, 0], [0.3, 0.02, 0]])
    assert link.directions == ("x", "y", "z")
    assert [(d, c) for _, d, c in tie.terms] == [("z", 1.0), ("z", -1.0)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '[[joints]]\npoint1 = "A"\nk.kx = 1\naxes = [[1, 0, 0], [2, 0, 0]]',
            r"joints\[1\].axes: .*parallel",
        ),
        ('[[joints]]\npoint1 = "A"\nk.kx = 1\naxes = [[1, 0, 0]]', "two vectors are needed"),
        ('[[viscoelastic]]\npoint1 = "A"\nlaw = "maxwell"', "'maxwell' is not allowed; .*zener"),
        ('[[viscoelastic]]\npoint1 = "A"\nlaw = "zener"\nratio = 2\ntau = 1', "has no static stiffness"),
        ('[[viscoelastic]]\npoint1 = "A"\nlaw = "zener"\nk.kx = 1\nratio = 2', "'tau' is missing"),
        (
            '[[viscoelastic]]\npoint1 = "A"\nlaw = "fractional_zener"\nk.kx = 1\n'
            "ratio = 2\ntau = 1\nalpha = 1.5",
            "alpha is 1.5; it lies between",
        ),
        (
            '[[viscoelastic]]\npoint1 = "A"\nlaw = "table"\ntable.frequency = [1, 2]',
            "the table has no stiffness",
        ),
        (
            '[[viscoelastic]]\npoint1 = "A"\nlaw = "table"\ntable.frequency = [2, 1]\n'
            "table.kz = { storage = [1, 1], loss = [0, 0] }",
            "must be finite, not negative, and increase",
        ),
        ('[[rigid_links]]\npoint = "A"\ndependents = ["A"]', "at least one other point"),
        (
            '[[rigid_links]]\npoint = "A"\ndependents = ["Q"]',
            r"dependents.*there is no point 'Q'",
        ),
        (
            '[[constraints]]\nterms = [{ point = "A", direction = "u", coefficient = 1 }]',
            "'u' is not allowed",
        ),
        ("[[constraints]]\nterms = []", "needs terms"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(tmp_path, text, message):
    with pytest.raises(StudyError, match=message):
        study(tmp_path, text)


def test_a_part_from_another_program(tmp_path):
    """The bracket of CalculiX's solids hangs on the end of the first beam; the model has its modes."""
    data = Path(__file__).parents[1] / "data" / "bracket"
    (tmp_path / "bracket.npz").write_bytes((data / "bracket.npz").read_bytes())
    nodes = json.loads((data / "calculix.json").read_text())["nodes"]["END"]
    text = f"""
[[superelements]]
file = "bracket.npz"
eta = 0.01
modes = 12
attach = [{{ point = "B", nodes = {nodes}, tie = "average" }}]
"""
    found = study(tmp_path, text)
    part = found.model.effect("bracket")
    assert part.n_internal >= 12
    assert found.model.n_dof == 6 * found.model.mesh.n_points + part.n_internal
    wrong = text.replace("average", "glue")
    with pytest.raises(StudyError, match=r"'glue' is not allowed; .*rigid"):
        study(tmp_path, wrong)
    with pytest.raises(StudyError, match=r"superelements.*file"):
        study(tmp_path, text.replace("bracket.npz", "none.npz"))
