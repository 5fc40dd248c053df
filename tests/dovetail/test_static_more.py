"""Static studies with skew supports, and with bars that go slack."""

import json

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.commands.common import first_largest

PANEL = """
[mesh]
plane = "xz"

[points]
A = [0, 0, 0]
B = [3, 0, 0]
C = [3, 0, 2]
D = [0, 0, 2]

[defaults]
theory = "bar"

[members.left]
from = "A"
to = "D"

[members.right]
from = "B"
to = "C"

[members.top]
from = "D"
to = "C"

[members.rising]
from = "A"
to = "C"
only = "tension"

[members.falling]
from = "D"
to = "B"
only = "tension"

[materials.steel]
E = 210e9
rho = 7850.0

[sections.rod]
shape = "circle"
d = 0.02

[[supports]]
point = "A"
fixed = "x z"

[[supports]]
point = "B"
fixed = "x z"

[[loads]]
case = "east"
point = "D"
force = [1e4, 0, 0]

[[loads]]
case = "west"
point = "D"
force = [-1e4, 0, 0]

[[combinations]]
name = "more west"
factors = { east = 1.0, west = 1.5 }
"""


@pytest.fixture
def panel(tmp_path):
    path = tmp_path / "panel.toml"
    path.write_text(PANEL, encoding="utf-8")
    return path


def test_slack_bars_by_case(panel, capsys):
    assert main(["static", str(panel), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["slack_members"] == {"east": ["falling"], "west": ["rising"], "more west": ["rising"]}
    forces = found["cases"]["east"]["members"]
    assert forces["rising"]["N"][0] == pytest.approx(1e4 * np.hypot(3, 2) / 3, rel=1e-6)
    assert abs(forces["falling"]["N"][0]) < 1e-4
    ratio = found["cases"]["more west"]["members"]["falling"]["N"][0] / forces["rising"]["N"][0]
    assert ratio == pytest.approx(0.5)
    assert any("may go slack in dovetail static alone" in text for text in found["assumptions"])
    assert main(["static", str(panel)]) == 0
    assert "; slack: falling" in capsys.readouterr().out


def test_what_needs_a_linear_structure_refuses_them(panel, capsys):
    study = load_study(panel)
    for solve in (study.static, study.second_order):
        with pytest.raises(StudyError, match=r"falling.* may go slack"):
            solve("east")
    assert main(["buckling", str(panel), "--case", "east"]) == 2
    assert "may go slack" in capsys.readouterr().err
    assert main(["modes", str(panel), "--number", "2"]) == 0


SKEW = """
[points]
A = [0, 0, 0]
B = [2, 0, 0]

[members.beam]
from = "A"
to = "B"

[materials.steel]
E = 210e9
rho = 7850.0

[sections.rod]
shape = "circle"
d = 0.04

[[supports]]
point = "A"
fixed = "x y z rx"

[[supports]]
name = "slope"
point = "B"
fixed = "z y"
axes = [[0.8660254037844386, 0, 0.5], [0, 1, 0]]

[[loads]]
case = "weight"
gravity = [0, 0, -9.81]

[[loads]]
case = "drop"
support = "slope"
settlement = { z = -0.01 }
"""


def test_a_skew_support_holds_along_its_own_axes(tmp_path):
    """On a slope of 30° it slides; its force is normal, and pushes the beam."""
    path = tmp_path / "skew.toml"
    path.write_text(SKEW, encoding="utf-8")
    study = load_study(path)
    found = study.static("weight", "drop")
    u = found.displacements[6:9, 0]
    normal = np.array([-0.5, 0, np.sqrt(0.75)])
    assert normal @ u == pytest.approx(0.0, abs=1e-15)
    weight = 9.81 * 7850 * np.pi * 0.02**2 * 2
    along = found.reactions["slope", "z"][0]
    assert along * np.sqrt(0.75) == pytest.approx(weight / 2, rel=1e-9)
    assert found.reactions["A", "x"][0] == pytest.approx(0.5 * along, rel=1e-9)
    assert normal @ found.displacements[6:9, 1] == pytest.approx(-0.01)
    path.write_text(SKEW.replace("[0, 1, 0]]", "[1.7320508075688772, 0, 1]]"), encoding="utf-8")
    with pytest.raises(StudyError, match=r"supports\[2\]\.axes: the vectors"):
        load_study(path)


BEAM = """
[mesh]
element_size = 6

[points]
a = [0, 0, 0]
b = [6, 0, 0]

[members.m]
from = "a"
to = "b"
theory = "euler-bernoulli"
section = { A = 0.02, Iy = 3e-4, Iz = 1e-4, J = 1e-4 }
release1 = "ry"
release2 = "ry"

[materials.s]
E = 2e11
rho = 7850

[[supports]]
point = "a"

[[supports]]
point = "b"

[[loads]]
case = "q"
member = "m"
force_per_length = [0, 0, -10000]
"""


@pytest.mark.parametrize("pieces", ["1", "20"])
def test_the_largest_displacement_is_that_within_the_member(tmp_path, capsys, pieces):
    """5qL⁴/384EI = 2.8125 mm, however few places of the member are written."""
    path = tmp_path / "beam.toml"
    path.write_text(BEAM)
    main(["static", str(path), "--json", "-", "--pieces", pieces])
    case = json.loads(capsys.readouterr().out)["cases"]["q"]
    assert case["largest_displacement"]["m"] == pytest.approx(2.8125e-3, rel=1e-9)
    assert case["largest_displacement"]["place"] == "m at 3.000 m"
    np.testing.assert_allclose(case["largest_displacement"]["at"], [3, 0, 0])
    turns = case["members"]["m"]["u_ry"]
    assert [turns[0], turns[-1]] == pytest.approx([1.5e-3, -1.5e-3])


@pytest.mark.parametrize(("force", "missing"), [(-1000, False), (1000, True)])
def test_a_case_without_a_buckling_factor_has_the_reason(tmp_path, capsys, force, missing):
    path = tmp_path / "beam.toml"
    held = BEAM.replace("element_size = 6", "element_size = 1")
    held = held.replace('point = "b"\n', 'point = "b"\nfixed = "y z rx ry rz"\n')
    load = f'[[loads]]\ncase = "q"\npoint = "b"\nforce = [{force}, 0, 0]\n'
    path.write_text(held[: held.index("[[loads]]")] + load)
    main(["static", str(path), "--second-order", "--json", "-"])
    found = json.loads(capsys.readouterr().out)
    assert (found["buckling_factors"]["q"] is None) == missing
    assert ("does not buckle" in found.get("buckling_factors_missing", {}).get("q", "")) == missing


def test_of_values_that_differ_by_rounding_the_first_is_named():
    """The moments of two members at their corner are equal, and rounding differs between processors."""
    assert first_largest([1.0, 3.0, 3.0 * (1 + 1e-15), 2.0]) == 1
    assert first_largest([[1.0, 3.0], [3.001, 2.0]]) == 2
