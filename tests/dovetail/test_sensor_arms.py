"""Sensors and forces beside the axis of a member, which a rigid arm connects to it, without a mesh file."""

import numpy as np
import pytest

from dovetail import StudyError
from fem import assemble, compute_frf
from tests.studies import study_from
from updating import sensor_rows

BAR = """\
{first}
[points]
left = [0.0, 0.0, 0.0]
right = [0.8, 0.0, 0.0]
edge = [0.1, 0.025, 0.0]
[members.beam]
from = "left"
to = "right"
element_size = 0.1
[materials.steel]
E = 205e9
rho = 7880.0
[sections.bar]
shape = "rectangle"
b = 0.05
h = 0.005
[[supports]]
point = "left"
[damping]
modal = 0.01
{more}
[[excitations]]
sensor = "A3"
[frequency]
stop = 300.0
"""
LINK = """\
[[rigid_links]]
point = { member = "beam", position = 0.1 }
dependents = [DEPENDENT]
"""
SENSOR = '[[sensors]]\nname = "A3"\ndirection = "z"\n'


def edge_frf(folder, more, first=""):
    study = study_from(folder, BAR.format(first=first, more=more), ("sensors",))
    rows = sensor_rows(study.model, study.sensors), sensor_rows(study.model, study.excitations)
    return compute_frf(assemble(study.model), [20.0, 90.0, 250.0], *rows).H[:, 0, 0]


@pytest.fixture(scope="module")
def linked(tmp_path_factory):
    more = LINK.replace("DEPENDENT", '"edge"') + SENSOR + 'point = "edge"\nmass = 0.05\n'
    return edge_frf(tmp_path_factory.mktemp("linked"), more)


@pytest.mark.parametrize(
    ("more", "first"),
    [
        (
            LINK.replace("DEPENDENT", "[0.1, 0.025, 0]") + SENSOR + "point = [0.1, 0.025, 0]\nmass = 0.05\n",
            "",
        ),
        (SENSOR + 'point = "edge"\narm = true\nmass = 0.05\n', ""),
        (SENSOR + 'member = "beam"\nposition = 0.1\narm = [0, 0.025, 0]\nmass = 0.05\n', ""),
        ("", 'sensors = "sensors.csv"'),
    ],
    ids=["coordinates of a link", "arm from the nearest place", "arm as a vector", "table"],
)
def test_sensor_and_force_at_an_edge_equal_those_of_a_rigid_link(tmp_path, linked, more, first):
    table = "name,x [mm],y [mm],z [mm],direction,arm,mass\nA3,100,25,0,z,true,0.05\n"
    (tmp_path / "sensors.csv").write_text(table, encoding="utf-8")
    np.testing.assert_allclose(edge_frf(tmp_path, more, first), linked, rtol=1e-9)


def test_sensor_on_the_axis_reads_no_torsion(tmp_path, linked):
    on_axis = edge_frf(tmp_path, SENSOR + "point = [0.1, 0, 0]\nmass = 0.05\n")
    assert (abs(on_axis / linked - 1) > 1e-3).all()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (SENSOR + 'point = "edge"\n', r"arm = true connects one beside the axis by a rigid arm"),
        (SENSOR + 'point = "edge"\narm = 3\n', r"sensors\[1\].arm: 3 is not allowed"),
        (SENSOR + 'point = "edge"\narm = [1, 2]\n', r"3 numbers \[m\] are needed"),
        (
            LINK.replace("DEPENDENT", '"edgy"') + SENSOR + 'point = "edge"\n',
            r"no point 'edgy'; did you mean 'edge'",
        ),
    ],
)
def test_places_beside_the_axis_that_are_refused(tmp_path, more, words):
    with pytest.raises(StudyError, match=words):
        edge_frf(tmp_path, more)
