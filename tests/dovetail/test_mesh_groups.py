"""Studies that name groups of a mesh: of points at supports, and of curves that the mesh lacks."""

import pytest

from benchmarks.fuzz.decks import GMSH_FRAME, GMSH_NAMES
from dovetail import StudyError, load_study
from fem import Support
from tests.studies import study_file

STUDY = """[mesh]
file = "m.msh"
[materials.steel]
E = 210e9
rho = 7850.0
[members.frame]
section = { shape = "rectangle", b = 0.03, h = 0.01 }
[[supports]]
point = "feet"
fixed = "translations"
"""


def write(folder, **words):
    (folder / "m.msh").write_text(GMSH_FRAME.format(**words))
    return study_file(folder, STUDY)


def test_a_support_at_a_group_of_points_is_at_each_of_them(tmp_path):
    model = load_study(write(tmp_path, names=GMSH_NAMES, one=1), needs=()).model
    supports = [e for e in model.effects if isinstance(e, Support)]
    assert [e.name for e in supports] == ["feet.1", "feet.2"]
    assert sorted(model.mesh.points[e.point].tolist() for e in supports) == [[0, 0, 0], [1, 0, 0]]
    assert all(tuple(e.fixed) == ("x", "y", "z") for e in supports)


def test_a_mesh_without_named_groups_is_suspected(tmp_path):
    with pytest.raises(StudyError, match="no named physical group of curves: is one missing"):
        load_study(write(tmp_path, names="", one=0), needs=())
