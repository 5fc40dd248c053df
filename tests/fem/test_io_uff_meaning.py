"""Universal files: what one dataset means for another, systems, groups, units, numbers used twice."""

import time
import warnings

import numpy as np
import pytest

from fem import FRFKind, Mesh
from fem.io import Function, Points, UffError, read_frf, read_mesh, read_uff, write_uff
from fem.io.uff_types import TraceLine
from fem.io.uff_units import force_factor, motion_factor
from fem.io.units import FORCE, MOMENT, quotient_of

VALUES = np.array([1 + 2j, -3 + 0.5j, 0.25 - 1j])
NONE = ("NONE",) * 5


def dataset(kind, *lines):
    return "".join(f"{line}\n" for line in ("    -1", f"{kind:6d}", *lines, "    -1"))


def ints(*numbers, width=10):
    return "".join(f"{k:{width}d}" for k in numbers)


def reals(*numbers, width=25):
    return "".join(f"{x:{width}.{width - 9}E}" for x in numbers)


def nodes(*rows, kind=2411):
    """Rows: label, definition system, displacement system, coordinates."""
    if kind == 15:
        return dataset(15, *(ints(*row[:3], 11) + reals(*row[3:], width=13) for row in rows))
    return dataset(kind, *(line for row in rows for line in (ints(*row[:3], 11), reals(*row[3:]))))


def beams(*pairs, descriptor=21, first=1, kind=2412):
    lines = []
    for k, pair in enumerate(pairs, start=first):
        head = (
            (k, descriptor, 1, 1, 7, len(pair)) if kind == 2412 else (k, descriptor, 1, 1, 1, 1, 7, len(pair))
        )
        lines += [ints(*head), ints(0, 1, 1), ints(*pair)]
    return dataset(kind, *lines)


def system(label, kind, axes, origin, part=1):
    rows = [reals(*row) for row in (*axes, origin)]
    return dataset(2420, ints(part), "PART", ints(label, kind, 0), "NAME", *rows)


def shape(rows, frequency=10.0, number=1, complex_values=False, kind=55):
    """Rows: node, three or six values."""
    width = len(rows[0]) - 1
    body = [line for node, *v in rows for line in (ints(node), reals(*v, width=13))]
    head = ints(1, 2, 2 if width == 3 else 3, 8, 2, width)
    if kind == 2414:
        data = [ints(0, 0, 0, 0, 0, number, 0, 0), ints(0, 0)]
        data += [reals(0, frequency, 0, 1, 0.01, 0, width=13), reals(*[0] * 6, width=13)]
        return dataset(2414, ints(1), "NONE", ints(1), *NONE, head, *data, *body)
    return dataset(55, *NONE, head, ints(2, 4, 1, number), reals(frequency, 1, 0.01, 0, width=13), *body)


def record(
    values=VALUES,
    ends=(1, 3, 1, 3),
    x=(18, "Hz"),
    y=(12, "m/s^2"),
    force=(13, "N"),
    case=0,
    kind=4,
    start=1.0,
    names=("NONE", "NONE"),
    record6=None,
    form=5,
):
    node, direction, reference, sense = ends
    line6 = record6 or (
        f"{kind:5d}{0:10d}{0:5d}{case:10d} {names[0]:<10}{node:10d}{direction:4d} "
        f"{names[1]:<10}{reference:10d}{sense:4d}"
    )
    cells = [f"{v:13.5e}" for z in values for v in ((z.real, z.imag) if form == 5 else (z.real,))]
    axes = [f"{k:10d}    0    0    0 {'NONE':<20} {u:<20}" for k, u in (x, y, force, (0, "NONE"))]
    body = ["".join(cells[k : k + 6]) for k in range(0, len(cells), 6)]
    line7 = f"{form:10d}{len(values):10d}{1:10d}{start:13.5e}{0.5:13.5e}{0.0:13.5e}"
    return dataset(58, *NONE, line6, line7, *axes, *body)


def units(length, force=1.0):
    text = "".join(f"{x:25.17E}".replace("E", "D") for x in (length, force, 1.0))
    return dataset(164, f"{9:10d}{'own':<20}{2:10d}", text, f"{273.15:25.17E}".replace("E", "D"))


def read(path, *parts, **options):
    path.write_text("".join(parts))
    return read_uff(path, **options)


def quietly(path, *parts, reader=read_uff, **options):
    path.write_text("".join(parts))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return reader(path, **options), " | ".join(str(w.message) for w in said)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.unv"


TURN = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
PLAIN = nodes((1, 0, 0, 0, 0, 0), (2, 0, 0, 1, 0, 0), (3, 0, 0, 2, 0, 0))
LINES = beams((1, 2), (2, 3))


# Coordinate systems ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [15, 781, 2411])
@pytest.mark.parametrize("last", [True, False], ids=["systems-last", "systems-first"])
def test_positions_in_a_turned_system(path, kind, last):
    systems = system(2, 0, TURN, (10, 0, 0))
    points = nodes((1, 0, 1, 0, 0, 0), (2, 2, 1, 0, 9, 0), (3, 2, 1, 0, 8, 0), kind=kind)
    parts = (points, LINES, systems) if last else (systems, points, LINES)
    mesh, said = quietly(path, *parts, reader=read_mesh)
    np.testing.assert_allclose(mesh.points, [[0, 0, 0], [1, 0, 0], [2, 0, 0]], atol=1e-12)
    assert "the positions of 2 nodes in coordinate system 2 (dataset 2420, line" in said


@pytest.mark.parametrize(
    ("kind", "local", "place"),
    [
        (1, (2.0, 30.0, 0.5), (np.sqrt(3), 1.0, 0.5)),
        (2, (2.0, 90.0, 30.0), (np.sqrt(3), 1.0, 0.0)),
        (2, (2.0, 60.0, 0.0), (np.sqrt(3), 0.0, 1.0)),
    ],
)
def test_angles_of_cylindrical_and_spherical_systems_are_degrees(path, kind, local, place):
    systems = system(7, kind, np.eye(3), (1, 2, 3))
    file, said = quietly(path, systems, nodes((1, 7, 0, *local)))
    np.testing.assert_allclose(file.points.coordinates[0], np.add(place, (1, 2, 3)), atol=1e-9)
    assert "its angles are in degrees" in said


def test_systems_of_dataset_18_refer_to_others(path):
    first = (ints(5, 1, 0, 1, 1), "CYL", reals(1, 0, 0, 1, 1, 0, width=13), reals(1, 0, 1, width=13))
    # in system 5 (r, θ, z; x along +Y): origin at r = 2 on its x axis, x axis outwards, z up
    second = (ints(6, 0, 5, 1, 1), "ON", reals(2, 0, 0, 3, 0, 0, width=13), reals(2, 0, 1, width=13))
    file, _ = quietly(path, dataset(18, *second, *first), nodes((1, 6, 0, 1, 0, 0), (2, 5, 0, 1, 90, 0)))
    np.testing.assert_allclose(file.points.at(1), [1, 3, 0], atol=1e-12)
    np.testing.assert_allclose(file.points.at(2), [0, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((), r"node 2 at line 5 refers to coordinate system 8, which the file does not define"),
        ((system(8, 3, np.eye(3), (0, 0, 0)),), r"coordinate system 8, whose type is 3 \(dataset 2420, line"),
        ((system(8, 0, np.ones((3, 3)), (0, 0, 0)),), r"whose axes are not three right-handed unit vectors"),
        ((system(8, 0, np.diag([1, 1, -1]), (0, 0, 0)),), r"at right angles \(dataset 2420, line 1[0-9]\)"),
        (
            (system(8, 0, TURN, (0, 0, 0)), system(8, 0, TURN, (1, 0, 0), part=2)),
            r"which dataset 2420, line 1[0-9] and dataset 2420, line 2[0-9] define differently",
        ),
        (
            (dataset(18, ints(8, 0, 8, 1, 1), "X", reals(*range(6), width=13), reals(1, 2, 4, width=13)),),
            r"which refers to itself",
        ),
    ],
)
def test_systems_that_cannot_be_applied_are_refused_where_they_are_used(path, parts, words):
    with pytest.raises(UffError, match=rf"a\.unv: .*{words}"):
        read(path, nodes((1, 0, 0, 0, 0, 0), (2, 8, 0, 1, 0, 0)), *parts)
    unused = read(path, nodes((1, 0, 0, 0, 0, 0)), *parts)
    assert unused.points is not None


@pytest.mark.parametrize("kind", [55, 2414])
def test_shapes_in_displacement_systems_are_turned(path, kind):
    points = nodes((1, 0, 0, 0, 0, 0), (2, 0, 2, 1, 0, 0), (3, 0, 3, 0, 4, 0))
    systems = system(2, 0, TURN, (10, 0, 0)) + system(3, 1, np.eye(3), (0, 0, 0))
    rows = [(1, 1.0, 2, 3, 4, 5, 6), (2, 1.0, 2, 3, 4, 5, 6), (3, 1.0, 2, 3, 4, 5, 6)]
    file, said = quietly(path, shape(rows, kind=kind), points, systems)
    found = file.modes[0].shapes[:, 0].reshape(3, 6)
    turned = [-2.0, 1, 3, -5, 4, 6]  # x' along Y and y' along -X; at node 3, r along Y and θ along -X
    np.testing.assert_allclose(found, [rows[0][1:], turned, turned], atol=1e-12)
    assert "displacements of shapes at 2 nodes are turned" in said


def test_directions_of_frfs_in_displacement_systems(path):
    points = nodes((1, 0, 0, 0, 0, 0), (2, 0, 2, 1, 0, 0))
    parts = [record(ends=(2, d, 1, 3), values=d * VALUES) for d in (1, -2)]
    file, said = quietly(path, *parts, points, system(2, 0, TURN, (0, 0, 0)))
    assert file.frf().outputs == ("2Y+", "2X+")
    assert "2 directions of FRFs in the displacement systems" in said


def test_frfs_along_slanted_axes_are_combined_or_left_out_by_name(path):
    c, s = np.cos(0.5), np.sin(0.5)
    systems = system(2, 0, [[c, s, 0], [-s, c, 0], [0, 0, 1]], (0, 0, 0))
    points = nodes((1, 0, 0, 0, 0, 0), (2, 0, 2, 1, 0, 0))
    parts = [record(ends=(2, d, 1, 3), values=v * VALUES) for d, v in ((1, c), (2, -s), (3, 2))]
    file, _ = quietly(path, *parts, points, systems)  # 1 along X and 2 along Z
    frf = file.frf()
    order = [frf.outputs.index(label) for label in ("2X+", "2Y+", "2Z+")]
    np.testing.assert_allclose(frf.H[:, order, 0], np.outer(VALUES, [1, 0, 2]), atol=2e-5)
    alone, _ = quietly(path, parts[0], points, systems)
    assert not alone.frfs
    assert (
        "FRF 2X+/1Z+: the displacement system of node 2 has this direction along no global axis"
        in (alone.skipped[0])
    )
    with pytest.raises(UffError, match="along no global axis"):
        quietly(path, parts[0], points, systems, reader=read_frf)


def test_an_undefined_displacement_system_matters_only_where_it_is_used(path):
    points = nodes((1, 0, 0, 0, 0, 0), (2, 0, 9, 1, 0, 0), (3, 0, 0, 2, 0, 0))
    assert read(path, points, LINES).mesh().n_lines == 2
    with pytest.raises(UffError, match=r"the displacements of node 2 are in coordinate system 9, which"):
        read(path, points, shape([(2, 1.0, 0, 0)]))
    with pytest.raises(UffError, match=r"the displacements of node 2 are in coordinate system 9, which"):
        read(path, points, record(ends=(2, 1, 1, 1)))


# Groups ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [752, 2417, 2429, 2430, 2432, 2435, 2452, 2467, 2477])
def test_groups_of_elements_and_nodes(path, kind):
    rest = () if kind in (752, 2417, 2429, 2430, 2432) else (0, 0)
    per_line = 2 if rest else 4
    zeros = (0,) * (4 if kind == 752 else 6)

    def group(number, name, *entities):
        cells = [ints(*entity, *rest) for entity in entities]
        lines = ["".join(cells[k : k + per_line]) for k in range(0, len(cells), per_line)]
        return [ints(number, *zeros, len(entities)), name, *lines]

    columns = group(1, "COLUMNS", (8, 1), (8, 3), (8, 5), (8, 6), (8, 7))
    feet = group(2, "FEET", (7, 1), (7, 4))
    chain = nodes(*((k, 0, 0, k, 0, 0) for k in range(1, 9)))
    parts = (dataset(kind, *columns, *feet), chain, beams(*((k, k + 1) for k in range(1, 8))))
    mesh, said = quietly(path, *parts, reader=read_mesh)
    assert not said
    of = {
        name: sorted(r for m in mesh.members_of(name) for r in mesh.members[m])
        for name in ("COLUMNS", "property 1")
    }
    assert of == {"COLUMNS": [0, 2, 4, 5, 6], "property 1": [1, 3]}
    assert (mesh.point_names["FEET.1"], mesh.point_names["FEET.2"], mesh.point_names["4"]) == (0, 3, 3)


def test_what_a_group_cannot_hold_is_named(path):
    group = dataset(
        2467,
        ints(4, 0, 0, 0, 0, 0, 0, 4),
        "ODD",
        ints(8, 1, 0, 0, 8, 99, 0, 0),
        ints(7, 55, 0, 0, 12, 1, 0, 0),
    )
    _, said = quietly(path, PLAIN, LINES, group, reader=read_mesh)
    for words in (
        "group 'ODD' (dataset 2467, line ",
        "names 1 element(s) that the file does not have, the first 99",
        "names 1 node(s) that the file does not have, the first 55",
        "left out: 1 of type 12",
    ):
        assert words in said
    with pytest.raises(UffError, match=r"line 2[0-9] has 3 numbers where 4 for each entity of group 'ODD'"):
        read(path, PLAIN, LINES, group.replace(ints(8, 1, 0, 0, 8, 99, 0, 0), ints(8, 1, 0)))


def test_groups_that_share_names_and_lines(path):
    groups = [
        dataset(2467, ints(k, 0, 0, 0, 0, 0, 0, len(e)), name, *(ints(8, n, 0, 0) for n in e))
        for k, name, e in ((1, "all", (1, 2)), (2, "left", (1,)), (3, "left", (2,)))
    ]
    traces = dataset(82, ints(1, 2, 0), "left", ints(1, 2))
    mesh, said = quietly(path, PLAIN, LINES, *groups, traces, reader=read_mesh)
    assert "group 'left' (dataset 2467, line" in said
    assert "it is named 'left 3'" in said
    assert set(mesh.members) == {"left", "left 3"}
    assert mesh.groups["all"] == ("left", "left 3")


# Numbers used twice ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [15, 2411])
def test_a_node_number_with_two_positions_is_refused_with_both_lines(path, kind):
    again = nodes((2, 0, 0, 5, 0, 0), kind=kind)
    with pytest.raises(
        UffError, match=r"node 2 is defined at line 5 and at line 12 with two positions, \(1, 0, 0\)"
    ):
        read(path, PLAIN, again)
    same = read(path, PLAIN, nodes((2, 0, 0, 1, 0, 0), kind=kind), LINES)
    assert same.points.labels.tolist() == [1, 2, 3]
    assert same.mesh().n_lines == 2


def test_an_element_number_with_two_meanings_is_refused_with_both_lines(path):
    with pytest.raises(
        UffError, match=r"element 1 is defined at line 12 and again, with other nodes or type, at line 21;"
    ):
        read(path, PLAIN, LINES, beams((1, 3)))
    assert len(read(path, PLAIN, LINES, LINES).elements) == 2


def test_a_record_that_comes_twice(path):
    same = read(path, record(), record())
    assert same.frf().H.shape == (3, 1, 1)
    assert "FRF 1Z+/1Z+: it comes again with the same values and counts once" in same.skipped[0]
    parts = (record(), record(ends=(2, 3, 1, 3)), record(values=2 * VALUES))
    file, said = quietly(path, *parts)
    assert [f.outputs for f in file.frfs] == [("1Z+", "2Z+"), ("1Z+",)]
    assert (
        "FRF 1Z+/1Z+ of dataset 58 at line 1 (byte 0) comes again with other values in dataset 58 at line"
        in said
    )


def test_load_cases_are_told_apart(path):
    file, said = quietly(path, record(case=1), record(values=2 * VALUES, case=2))
    assert file.frf_runs == ("load case 1", "load case 2")
    assert "FRFs of 2 load cases (1, 2)" in said
    with pytest.raises(UffError, match="1: accelerance, load case 2, 3 lines"):
        file.frf()


# Units ----------------------------------------------------------------------------------------------------


def test_units_act_wherever_they_stand(path):
    rows = [(1, 1.0, 0, 0), (2, 2.0, 0, 0)]
    parts = (PLAIN, LINES, shape(rows), record(y=(12, "NONE")))
    (first, one), (last, two) = quietly(path, units(1000.0), *parts), quietly(path, *parts, units(1000.0))
    assert one == two
    np.testing.assert_array_equal(first.frf().H, last.frf().H)
    np.testing.assert_allclose(first.frf().H[:, 0, 0], VALUES / 1000, rtol=1e-5)
    np.testing.assert_array_equal(first.points.coordinates, last.points.coordinates)
    np.testing.assert_array_equal(first.modes[0].shapes, last.modes[0].shapes)


def test_two_systems_of_units_are_refused_and_the_same_twice_is_not(path):
    with pytest.raises(
        UffError, match=r"dataset 164 at line 16 .*1 for lengths and 1 for forces, beside 1000 and 1"
    ):
        read(path, units(1000.0), PLAIN, units(1.0))
    file, _ = quietly(path, units(1000.0), PLAIN, units(1000.0))
    np.testing.assert_allclose(file.points.at(3), [0.002, 0, 0])


FREQUENCIES = {
    "Hz": 1.0,
    "kHz": 1e3,
    "rad/s": 0.5 / np.pi,
    "rad/sec": 0.5 / np.pi,
    "RPM": 1 / 60,
    "rpm": 1 / 60,
    "CPM": 1 / 60,
    "cpm": 1 / 60,
    "1/min": 1 / 60,
    "cps": 1.0,
    "[Hz]": 1.0,
    "MHz": 1e6,
    "NONE": 1.0,
    "radians/sec": 0.5 / np.pi,
}


@pytest.mark.parametrize(("label", "factor"), FREQUENCIES.items())
def test_labels_of_the_abscissa(path, label, factor):
    frf, said = quietly(path, record(x=(18, label)), reader=read_frf)
    np.testing.assert_allclose(frf.frequency, factor * np.array([1.0, 1.5, 2.0]), rtol=1e-12)
    assert (f"an abscissa in '{label}' is converted to Hz" in said) == (factor != 1.0)


def test_coherences_have_the_abscissa_of_their_frfs(path):
    parts = (record(x=(18, "kHz")), record(values=np.ones(3), kind=6, form=2, x=(18, "kHz"), y=(0, "NONE")))
    file, _ = quietly(path, *parts)
    np.testing.assert_array_equal(file.functions[0].x, file.frf().frequency)
    assert file.functions[0].x_unit == "Hz"


@pytest.mark.parametrize(
    ("x", "words"),
    [
        ((20, "orders"), "data type 20, not 18"),
        ((18, "Orders"), "'Orders', which is no frequency"),
        ((18, "s"), "'s', which is no frequency"),
        ((17, "s"), "data type 17, not 18"),
    ],
)
def test_an_abscissa_that_is_no_frequency_makes_no_frf(path, x, words):
    with pytest.raises(UffError, match=rf"a\.unv: no FRFs that can be used.*\n.*line 1 .*{words}"):
        quietly(path, record(x=x), reader=read_frf)


def test_a_label_that_is_not_known_is_named(path):
    frf, said = quietly(path, record(x=(18, "furlong")), reader=read_frf)
    assert "the label 'furlong' of the abscissa is not known; Hz is taken (dataset 58 at line 1" in said
    assert frf.frequency[0] == 1.0


@pytest.mark.parametrize(
    ("y", "force", "ends", "factor"),
    [
        ("g", "N", (1, 3, 1, 3), 9.80665),
        ("g/N", "NONE", (1, 3, 1, 3), 9.80665),
        ("mm/s^2", "N", (1, 3, 1, 3), 1e-3),
        ("mm/s2", "kN", (1, 3, 1, 3), 1e-6),
        ("(in/s^2)/lbf", "NONE", (1, 3, 1, 3), 0.0254 / 4.4482216152605),
        ("(1/N)*(m/s²)", "NONE", (1, 3, 1, 3), 1.0),
        ("m/s/s", "N", (1, 3, 1, 3), 1.0),
        ("rad/s^2", "N", (1, 6, 1, 3), 1.0),
        ("deg/s^2", "N*mm", (1, 6, 1, 6), np.pi / 180 * 1e3),
        ("m/s^2", "Nm", (1, 3, 1, 6), 1.0),
        ("m/s^2", "lbf-in", (1, 3, 1, 6), 1 / (4.4482216152605 * 0.0254)),
    ],
)
def test_unit_labels_convert_frfs(path, y, force, ends, factor):
    frf, said = quietly(path, record(y=(12, y), force=(13, force), ends=ends), reader=read_frf)
    np.testing.assert_allclose(frf.H[:, 0, 0], factor * VALUES, rtol=1e-5)
    assert ("are multiplied by" in said) == (factor != 1.0)
    raw, _ = quietly(path, record(y=(12, y), force=(13, force), ends=ends), unit_labels=False)
    np.testing.assert_allclose(raw.frf().H[:, 0, 0], VALUES, rtol=1e-5)


@pytest.mark.parametrize("label", ["banana", "V", "m/s", "dB"])
def test_a_unit_label_that_is_not_known_is_in_skipped(path, label):
    file = read(path, record(y=(12, label)))
    assert (
        f"the unit label '{label}' is not known for FRFs of kind accelerance and is ignored"
        in file.skipped[0]
    )


@pytest.mark.parametrize(
    ("label", "motion", "force"),
    [
        ("m/s^2/N", 1.0, 1.0),
        ("(cm/s²)/kN", 0.01, 1e3),
        ("(1/N)*(m/s²)", 1.0, 1.0),
        ("[g]/mN", 9.80665, 1e-3),
        ("mm/s/s/MN", 1e-3, 1e6),
        ("in / sec^2 / lbf", 0.0254, 4.4482216152605),
        ("g", 9.80665, 0.0),
        ("meters per second squared/newton", 1.0, 1.0),
        ("m s^-2/(N)", 1.0, 1.0),
        ("mm/ms^2/N", 1e3, 1.0),
        ("m/s^2/V", None, 0.0),
        ("m/s^2/m", None, 0.0),
        ("m/s/N", None, 1.0),
        ("1/N", None, 1.0),
    ],
)
def test_a_label_states_a_motion_and_the_force_below_it(label, motion, force):
    assert motion_factor(label, FRFKind.ACCELERANCE, turned=False) == motion
    _, (size, powers) = quotient_of(label)
    assert (size if powers == FORCE else 0.0) == pytest.approx(force, rel=1e-14)


@pytest.mark.parametrize("divided", ["N m", "Nm", "N*m", "nm", "NM", "N·m", "kNmm", "lbfin", "in-lb"])
def test_moments_below_a_rotation(divided):
    size = 4.4482216152605 * 0.0254 if "lb" in divided else 1.0
    label = f"rad/s^2/({divided})"
    assert motion_factor(label, FRFKind.ACCELERANCE, turned=True) == 1.0
    assert quotient_of(label)[1] == (pytest.approx(size, rel=1e-14), MOMENT)
    assert force_factor(divided, moment=True) == pytest.approx(size, rel=1e-14)


def test_reading_a_label_ends_for_any_text():
    for text in ("", "((m", "m" * 10**6, "(" * 10**5):
        assert motion_factor(text, FRFKind.ACCELERANCE, False) is None
        assert force_factor(text, False) is None


# Elements -------------------------------------------------------------------------------------------------


def test_elements_of_dataset_780_and_pipes(path):
    mesh, _ = quietly(
        path,
        nodes((1, 0, 0, 0, 0, 0), (2, 0, 0, 1, 0, 0), kind=781),
        beams((1, 2), kind=780),
        reader=read_mesh,
    )
    assert mesh.n_lines == 1
    assert read(path, PLAIN, beams((1, 2), (2, 3), descriptor=31)).mesh().n_lines == 2


def test_other_elements_are_counted_by_type(path):
    shells = dataset(2412, ints(9, 91, 1, 1, 7, 3), ints(1, 2, 3), ints(10, 121, 1, 1, 7, 2), ints(1, 3))
    _, said = quietly(path, PLAIN, LINES, shells, reader=read_mesh)
    assert "1 shell elements of type 91 left out" in said
    assert "1 rigid elements of type 121 left out" in said


def test_elements_of_an_old_form_refuse_a_mesh_but_not_measured_values(path):
    old = dataset(71, ints(1, 21, 1, 1, 7, 2), ints(1, 2))
    with pytest.raises(
        UffError, match=r"a\.unv: dataset 71 at line 1 .*elements of an old form are not read"
    ):
        read(path, old, PLAIN).mesh()
    assert read(path, old, record()).frf().n_freq == 3


def test_numbers_that_touch_and_columns_that_are_empty(path):
    wide = 10**9
    points = dataset(2411, ints(wide + 1, 0, 0, 1), reals(0, 0, 0), ints(wide + 2, 0, 0, 1), reals(-1, 0, 0))
    lines = dataset(
        2412, f"{1:10d}{21:10d}{'':10}{'':10}{7:10d}{2:10d}", ints(0, 1, 1), ints(wide + 1, wide + 2)
    )
    assert read(path, points, lines).mesh().n_lines == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LINES.replace(ints(2, 3), ints(2)), r"element 2 announces 2 node\(s\), but 0 come before line \d+"),
        (LINES.replace(ints(2, 21, 1, 1, 7, 2), ints(2, 21, 1, 1)), r"line 6 has 4 numbers where the 6"),
        (LINES.replace(f"{21:10d}", "        2x", 1), r"line 3 has '2x' where a whole number is expected"),
        (beams((1, 9)), r"element 1 at line 12 refers to node 9, which is not among the 3 points"),
    ],
)
def test_damaged_elements_are_refused_with_their_line(path, text, words):
    with pytest.raises(UffError, match=words):
        read(path, *((PLAIN, text) if "node 9" in words else (text, PLAIN))).mesh()


# What is left out ------------------------------------------------------------------------------------------


def test_datasets_left_out_reach_the_mesh_with_place_and_count(path):
    left_out = [dataset(1710, "a"), dataset(1710, "b"), dataset(4711, "x"), dataset(2400, "h")]
    _, said = quietly(path, PLAIN, LINES, *left_out, reader=read_mesh)
    assert "dataset 1710 at line 19 (byte " in said
    assert "datasets of type 1710 (materials) are not read; 2 of them" in said
    assert "datasets of type 4711 are not read" in said
    assert "2400" not in said


@pytest.mark.parametrize("digit", [b"1", b"1.", b"-", b"1E", b" "])
def test_long_lines_are_refused_at_once(path, digit):
    path.write_bytes((PLAIN.replace(reals(1, 0, 0), "@")).encode().replace(b"@", digit * 16000 + b"x"))
    start = time.process_time()
    with pytest.raises(UffError, match="line 6 has"):
        read_uff(path)
    assert time.process_time() - start < 1.0


# Writing --------------------------------------------------------------------------------------------------


def test_groups_and_named_points_come_back(path):
    mesh = Mesh.from_lines(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0]],
        [[0, 1], [1, 2], [2, 3]],
        {"a": [0, 1], "b c": [2]},
        {"tip": 3},
    )
    write_uff(path, mesh=mesh)
    back = read_mesh(path)
    assert dict(back.groups) == dict(mesh.groups)
    assert {name: rows.tolist() for name, rows in back.members.items()} == {
        name: rows.tolist() for name, rows in mesh.members.items()
    }
    assert back.point_names["tip"] == 3


@pytest.mark.parametrize("name", ['say "hi"', "O'Brien", "back\\slash", "[x]", "\u00fcber", "a" * 80, "a  b"])
def test_names_of_members_survive(path, name):
    write_uff(path, mesh=Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {name: [0]}))
    assert list(read_mesh(path).members) == [name]


@pytest.mark.parametrize("name", ["two\nlines", "a" * 81, " blank", "none", "tab\there"])
def test_names_that_the_format_does_not_keep_are_refused(path, name):
    with pytest.raises(UffError, match=r"cannot be written: it is .*; give it another name"):
        write_uff(path, mesh=Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {name: [0]}))
    with pytest.raises(UffError, match="cannot be written"):
        write_uff(
            path,
            geometry=Points(np.array([1, 2]), np.eye(3)[:2]),
            trace_lines=[TraceLine(1, name, ((1, 2),))],
        )
    assert not path.exists()


@pytest.mark.parametrize(
    ("field", "text"),
    [("response_name", "BEAM_TOP_FLANGE"), ("unit", "(metres per second)/N"), ("title", ("a\nb",))],
)
def test_labels_of_functions_survive_or_are_refused(path, field, text):
    given = dict(
        function_type=1,
        response="1Z+",
        reference="0S",
        response_name="r",
        reference_name="",
        x=np.arange(3.0),
        values=np.arange(3.0),
        x_type=17,
        ordinate_type=12,
        denominator_type=0,
        x_unit="s",
        unit="g",
        denominator_unit="",
        title=("t" * 100, "x", "", "", ""),
        load_case=1,
        version=2,
        place="",
    )
    write_uff(path, functions=[Function(**given)])
    back = read_uff(path).functions[0]
    assert (back.title[0], back.unit, back.response_name) == ("t" * 100, "g", "r")
    with pytest.raises(UffError, match="cannot be written"):
        write_uff(path, functions=[Function(**{**given, field: text})])


def test_a_dataset_whose_opening_mark_is_missing_is_refused(path):
    with pytest.raises(UffError, match=r"a\.unv: line 10 has '2412', the number of a dataset, outside"):
        read(path, PLAIN, LINES.removeprefix("    -1\n"))


def test_frfs_along_three_slanted_axes_of_forces(path):
    axes = np.linalg.qr(np.arange(9.0).reshape(3, 3) + 4 * np.eye(3))[0]
    axes *= np.linalg.det(axes)
    force = np.array([0.5, -1.0, 2.0])  # response to a unit force along X, Y, Z
    parts = [record(ends=(1, 3, 2, k + 1), values=axes[k] @ force * VALUES) for k in range(3)]
    points = nodes((1, 0, 0, 0, 0, 0), (2, 0, 2, 1, 0, 0))
    file, _ = quietly(path, *parts, points, system(2, 0, axes, (0, 0, 0)))
    frf = file.frf()
    assert frf.inputs == ("2X+", "2Y+", "2Z+")
    np.testing.assert_allclose(frf.H[:, 0], np.outer(VALUES, force), atol=1e-4)
