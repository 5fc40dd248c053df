"""Abaqus decks: a keyword that makes or moves nodes and elements is applied, or refused by name and line."""

import math
import time
import warnings

import numpy as np
import pytest

from fem import MeshError
from fem.io import read_mesh, read_node_sets
from fem.io.abaqus import read_abaqus
from fem.io.abaqus_keywords import HARMLESS, NAMED, READ, REFUSED

TWO = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n*ELEMENT, TYPE=B31, ELSET=BAR\n1, 1, 2\n"
THREE = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 2, 0, 0\n*ELEMENT, TYPE=B31, ELSET=BAR\n1, 1, 2\n2, 2, 3\n"


def write(folder, text, name="a.inp"):
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text)
    return path


def raw_of(folder, text):
    return read_abaqus(write(folder, text))


def points_of(folder, text):
    raw = raw_of(folder, text)
    return dict(zip(raw.point_numbers.tolist(), np.asarray(raw.points), strict=True))


def refused(folder, text, words):
    with pytest.raises(MeshError, match=words):
        raw_of(folder, text)


# Coordinates --------------------------------------------------------------------------------------------


def test_cylindrical_nodes_in_a_shifted_and_turned_system(tmp_path):
    text = "*SYSTEM\n10, 0, 0, 10, 1, 0\n9, 0, 0\n*NODE, SYSTEM=C\n1, 2., 90., 5.\n*NODE\n2, 1., 0., 0.\n"
    found = points_of(tmp_path, text + "*SYSTEM\n*NODE\n3, 1., 0., 0.\n")
    np.testing.assert_allclose(found[1], [8, 0, 5], atol=1e-14)  # local y is global -x
    np.testing.assert_allclose(found[2], [10, 1, 0], atol=1e-14)
    np.testing.assert_allclose(found[3], [1, 0, 0])


@pytest.mark.parametrize(
    ("system", "place"),
    [
        ("1, 2, 3", [2, 2, 3]),  # a translation
        ("0, 0, 0, 3, 4, 12", [0.6, 0.8, 0]),  # x is laid into the x-y plane
        ("0, 0, 0, 0, 0, 2\n1, 0, 0", [0, 0, 1]),
    ],
)
def test_system_of_one_two_and_three_points(tmp_path, system, place):
    np.testing.assert_allclose(
        points_of(tmp_path, f"*SYSTEM\n{system}\n*NODE\n1, 1, 0, 0\n")[1], place, atol=1e-14
    )


def test_system_ends_with_its_part_and_moves_with_its_instance(tmp_path):
    text = (
        "*PART, NAME=P\n*SYSTEM\n0, 0, 5\n*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n*ELEMENT, TYPE=B31\n"
        "1, 1, 2\n*END PART\n"
    )
    text += (
        "*PART, NAME=Q\n*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n*ELEMENT, TYPE=B31\n1, 1, 2\n*END PART\n"
        "*ASSEMBLY, NAME=A\n"
    )
    text += (
        "*INSTANCE, NAME=P-1, PART=P\n0, 1, 0\n*END INSTANCE\n*INSTANCE, NAME=Q-1, PART=Q\n*END INSTANCE\n"
    )
    np.testing.assert_allclose(raw_of(tmp_path, text).points, [[0, 1, 5], [1, 1, 5], [0, 0, 0], [1, 0, 0]])


def test_spherical_nodes_are_read_from_the_plane_and_said(tmp_path):
    text = "*NODE, SYSTEM=S\n1, 2., 90., 30.\n"
    np.testing.assert_allclose(points_of(tmp_path, text)[1], [0, math.sqrt(3), 1], atol=1e-14)
    assert (
        "spherical coordinates (line 1): φ is measured from the x-y plane" in raw_of(tmp_path, text).notes[0]
    )


@pytest.mark.parametrize("value", ["1e999", "nan", "inf", "-Infinity", "1_0", "<length>", "x"])
def test_a_coordinate_that_is_no_finite_number_is_named_with_its_line(tmp_path, value):
    refused(
        tmp_path,
        TWO.replace("2, 1,", f"2, {value},"),
        rf"^a\.inp: line 3: \*NODE takes .* but '{value}' is not a",
    )
    many = "*NODE\n" + "".join(f"{k}, {k}., 0., 0.\n" for k in range(1, 40))
    refused(tmp_path, many.replace("17, 17.", f"17, {value}"), rf"^a\.inp: line 18: \*NODE .*'{value}'")


def test_fortran_numbers_and_empty_fields(tmp_path):
    np.testing.assert_allclose(points_of(tmp_path, "*NODE\n1, 1.5D-1, , +2.E0,\n2\n")[1], [0.15, 0, 2])


# Generators ---------------------------------------------------------------------------------------------


def test_ngen_on_a_line_backwards_and_into_a_set(tmp_path):
    raw = raw_of(tmp_path, "*NODE\n10, 0, 0, 0\n1, 9, 0, 0\n*NGEN, NSET=ALL\n10, 1, 3\n")
    assert raw.point_numbers.tolist() == [10, 1, 7, 4]
    np.testing.assert_allclose(np.asarray(raw.points)[2:, 0], [3, 6])
    assert sorted(raw.point_sets["ALL"].tolist()) == [0, 1, 2, 3]


@pytest.mark.parametrize("extra", ["3", ", 0, 0, 0"])
def test_ngen_on_the_shorter_arc_about_a_node_or_a_point(tmp_path, extra):
    text = f"*NODE\n1, 2, 0, 0\n5, 0, 2, 0\n3, 0, 0, 0\n*NGEN, LINE=C\n1, 5, 1, {extra}\n".replace(
        "3, 0, 0, 0", "9, 0, 0, 0"
    )
    found = points_of(
        tmp_path,
        text.replace("1, 5, 1, 3", "1, 5, 1, 9").replace("1, 5, 1, , 0, 0, 0", "1, 5, 1, , 0., 0., 0."),
    )
    for k in (2, 3, 4):
        angle = math.radians(22.5 * (k - 1))
        np.testing.assert_allclose(found[k], [2 * math.cos(angle), 2 * math.sin(angle), 0], atol=1e-14)


def test_ngen_beyond_180_degrees_needs_and_takes_the_normal(tmp_path):
    text = "*NODE\n1, 1, 0, 0\n4, 0, -1, 0\n9, 0, 0, 0\n*NGEN, LINE=C\n1, 4, 1, 9, , , , 0, 0, 1\n"
    np.testing.assert_allclose(points_of(tmp_path, text)[2], [0, 1, 0], atol=1e-14)
    half = "*NODE\n1, 1, 0, 0\n3, -1, 0, 0\n9, 0, 0, 0\n*NGEN, LINE=C\n1, 3, 1, 9\n"
    refused(tmp_path, half, r"line 6: \*NGEN, LINE=C spans 0° or 180°; the normal")
    refused(tmp_path, half.replace("-1, 0", "-3, 0"), "ends at distances of 1 and 3 from the centre")


def test_ngen_on_a_parabola_and_centre_in_a_cylindrical_system(tmp_path):
    text = "*NODE\n1, 0, 0, 0\n5, 4, 0, 0\n9, 2, 1, 0\n*NGEN, LINE=P\n1, 5, 1, 9\n"
    found = points_of(tmp_path, text)
    np.testing.assert_allclose([found[k] for k in (2, 3, 4)], [[1, 0.75, 0], [2, 1, 0], [3, 0.75, 0]])
    text = "*NODE\n1, 2, 1, 0\n3, 1, 2, 0\n*NGEN, LINE=C, SYSTEM=C\n1, 3, 1, , 1.4142135623730951, 45., 0.\n"
    np.testing.assert_allclose(points_of(tmp_path, text)[2], [1 + 0.5**0.5] * 2 + [0], atol=1e-14)


def test_elgen_of_three_levels_counts_as_abaqus(tmp_path):
    text = "*NODE\n1, 0, 0, 0\n" + "".join(f"{k}, {k}, 0, {k % 7}\n" for k in range(2, 300))
    text += "*ELEMENT, TYPE=B31\n1, 1, 2\n*ELGEN, ELSET=G\n1, 3, 2, 1, 2, 20, 10, 2, 100, 100\n"
    raw = raw_of(tmp_path, text)
    assert raw.line_numbers.tolist() == [1, 2, 3, 11, 12, 13, 101, 102, 103, 111, 112, 113]
    starts = raw.point_numbers[raw.lines[:, 0]]
    assert starts.tolist() == [1, 3, 5, 21, 23, 25, 101, 103, 105, 121, 123, 125]
    assert len(raw.sets["G"]) == 12


def test_nfill_with_bias_and_sets_as_they_are_at_that_line(tmp_path):
    text = (
        "*NODE, NSET=A\n1, 0, 0, 0\n2, 0, 1, 0\n*NODE, NSET=B\n11, 7, 0, 0\n12, 7, 1, 0\n"
        "*NFILL, BIAS={}\nA, B, 3, 4\n"
    )
    found = points_of(tmp_path, text.format("0.5") + "*NSET, NSET=A\n11\n")
    np.testing.assert_allclose([found[5][0], found[9][0], found[6][0]], [1, 3, 1])  # 1, 2 and 4: ratio 0.5
    assert 15 not in found
    found = points_of(tmp_path, text.format("1"))
    np.testing.assert_allclose(found[5], [7 / 3, 0, 0])


def test_ncopy_shifts_turns_and_reflects(tmp_path):
    text = "*NODE, NSET=A\n1, 1, 2, 3\n*NCOPY, OLD SET=A, CHANGE NUMBER=10, NEW SET=B, {}\n"
    found = points_of(tmp_path, text.format("SHIFT, MULTIPLE=2\n1, 0, 0\n0, 0, 0, 0, 0, 1, 90"))
    np.testing.assert_allclose([found[11], found[21]], [[-2, 2, 3], [-2, -1, 3]], atol=1e-14)
    for reflect, place in (
        ("POINT\n0, 0, 0", [-1, -2, -3]),
        ("LINE\n0, 0, 0, 0, 0, 1", [-1, -2, 3]),
        ("MIRROR\n0, 0, 1, 1, 0, 1\n0, 1, 1", [1, 2, -1]),
    ):
        np.testing.assert_allclose(
            points_of(tmp_path, text.format("REFLECT=" + reflect))[11], place, atol=1e-14
        )
    refused(
        tmp_path,
        text.format("POLE\n1, 0, 0"),
        r"line 3: \*NCOPY has the parameter POLE, which is not supported",
    )


def test_elcopy_copies_lines_and_counts_the_rest(tmp_path):
    text = (
        THREE
        + "*NCOPY, OLD SET=N, CHANGE NUMBER=10, SHIFT\n0, 1, 0\n*ELEMENT, TYPE=S3, ELSET=BAR\n7, 1, 2, 3\n"
    )
    text = (
        text.replace("*NODE", "*NODE, NSET=N")
        + "*ELCOPY, OLD SET=BAR, ELEMENT SHIFT=10, SHIFT NODES=10, NEW SET=NEW\n"
    )
    raw = raw_of(tmp_path, text)
    assert raw.line_numbers.tolist() == [1, 2, 11, 12]
    assert raw.left_out == {"S3 elements": 2}
    assert raw.sets["NEW"].tolist() == [2, 3]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("*NGEN\n1, 9\n", r"line 8: node 9 is not defined before this line"),
        ("*NGEN\n1, 2, 7\n", r"line 8: \*NGEN runs from node 1 to 2 in steps of 7"),
        ("*NODE\n900000001, 9, 0, 0\n*NGEN\n1, 900000001\n", r"line 10: .*at most 1000000 in one deck"),
        ("*ELGEN\n1, 5000, 0, 1, 5000, 0, 5000\n", r"line 8: \*ELGEN would make"),
        ("*ELGEN\n5, 3\n", "line 8: element 5 is to be copied, but is not defined before"),
        (
            "*NFILL, SINGULAR=1\nA, B, 2, 1\n",
            r"line 7: \*NFILL has the parameter SINGULAR, which is not supported; supported are BIAS",
        ),
        ("*NFILL\nA, B, 2, 1\n", "line 8: there is no node set A before this line"),
        (
            "*NMAP, NSET=A, TYPE=CYLINDRICAL\n",
            r"line 7: \*NMAP moves nodes to another coordinate system, which is not supported",
        ),
        ("*IMPERFECTION, FILE=x, STEP=1\n1, 0.1\n", r"line 7: \*IMPERFECTION moves nodes"),
        (
            "*NODE, FOO=1\n",
            r"line 7: \*NODE has the parameter FOO, which is not supported; supported are INPUT, NSET",
        ),
        (
            "*NODE, SYSTEM=X\n3, 0, 0, 0\n",
            r"line 7: \*NODE cannot be read: SYSTEM=X is not allowed; R, C and S are",
        ),
        ("*ELEM, TYPE=B31\n2, 1, 2\n", r"line 7: \*ELEM may be \*ELEMENT; write the keyword in full"),
        ("*ELEMENT, TYPE=B31, OFFSET=5\n2, 1, 2\n", r"\*ELEMENT has the parameter OFFSET"),
        (
            "*ELEMENT, TYPE=B31\n2, 1, 2, 1, 2\n",
            r"line 8: element 2 of type B31 has 4 node\(s\); 2 are expected, or one more",
        ),
        (
            "*ELEMENT, TYPE=T3D2\n2, 1, 2, 1\n",
            r"line 8: element 2 of type T3D2 has 3 node\(s\); 2 are expected$",
        ),
        ("*ELEMENT, TYPE=B31\n2, 1, 1\n", "line 8: element 2 joins a node with itself"),
        ("*ELEMENT, TYPE=B31\n2, 1, 77\n", "line 8: element 2 refers to node 77"),
        ("*NODE\n0, 1, 1, 1\n", "line 8: node number 0 is not allowed"),
        ("*INSTANCE, NAME=I, LIBRARY=old\n", r"\*INSTANCE has the parameter LIBRARY"),
        ("*SYSTEM\n0, 0, 0, 1, 0, 0\n2, 0, 0\n", r"line 8: \*SYSTEM defines no axes"),
    ],
)
def test_what_is_not_read_is_refused_by_name_and_line(tmp_path, text, words):
    refused(tmp_path, TWO + "*NSET, NSET=N\n" + text, rf"^a\.inp: .*{words}")


# Files --------------------------------------------------------------------------------------------------


def test_input_files_and_includes_in_folders(tmp_path):
    write(tmp_path, "1, 0, 0, 0\n** a comment\n2, 1, 0, 0\n", "sub/my nodes.txt")
    write(tmp_path, '*NODE, INPUT="my nodes.txt"\n*INCLUDE, INPUT=deeper/e.inp\n', "sub/n.inp")
    write(tmp_path, "*ELEMENT, TYPE=B31, ELSET=E\n1, 1, 2\n", "sub/deeper/e.inp")
    write(tmp_path, "1,\n2\n", "set.txt")
    for name in ("sub/n.inp", '"sub/n.inp"', "sub\\n.inp"):
        raw = raw_of(tmp_path, f"*Include, Input={name}\n*NSET, NSET=ALL, INPUT=set.txt\n")
        assert (len(raw.points), len(raw.lines)) == (2, 1)
        assert raw.point_sets["ALL"].tolist() == [0, 1]


def test_an_included_file_goes_on_with_the_data_of_the_block_before(tmp_path):
    write(tmp_path, "2, 1, 0, 0\n*ELEMENT, TYPE=B31\n1, 1, 2\n", "rest.inp")
    raw = raw_of(tmp_path, "*NODE\n1, 0, 0, 0\n*INCLUDE, INPUT=rest.inp\n2, 2, 1\n")
    assert (len(raw.points), len(raw.lines)) == (2, 2)


def test_includes_that_do_not_end_are_named(tmp_path):
    write(tmp_path, "*INCLUDE, INPUT=a.inp\n", "b.inp")
    refused(
        tmp_path,
        "*NODE\n*INCLUDE, INPUT=b.inp\n",
        r"^b\.inp: line 1: .*includes itself \(a\.inp → b\.inp → a\.inp\)",
    )
    for k in range(9):
        write(tmp_path, f"*INCLUDE, INPUT=c{k + 1}.inp\n" * 9, f"c{k}.inp")
    write(tmp_path, "*NODE\n1, 0, 0, 0\n", "c9.inp")
    begin = time.perf_counter()
    refused(tmp_path, "*INCLUDE, INPUT=c0.inp\n", "a deck may include at most 1000 files")
    for k in range(60):
        write(tmp_path, f"*INCLUDE, INPUT=d{k + 1}.inp\n", f"d{k}.inp")
    refused(tmp_path, "*INCLUDE, INPUT=d0.inp\n", "nested more than 50 levels deep")
    assert time.perf_counter() - begin < 5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "*INCLUDE, INPUT=no.inp\n",
            r"^a\.inp: line 1: the included file no\.inp cannot be read: the folder of a\.inp has none",
        ),
        ("*INCLUDE, INPUT=/dev/zero\n", "the included file /dev/zero cannot be read"),
        ("*INCLUDE\n", "a file without a name"),
        (
            "*NODE, INPUT=keys.txt\n",
            r"^keys\.txt: line 1: \*NODE is in a file that a\.inp: line 1 reads with INPUT=",
        ),
    ],
)
def test_files_that_cannot_be_read(tmp_path, text, words):
    write(tmp_path, "*NODE\n1, 0, 0, 0\n", "keys.txt")
    refused(tmp_path, text, words)


# Sets ---------------------------------------------------------------------------------------------------


def test_sets_of_sets_before_and_after_they_are_defined(tmp_path):
    text = "*ELSET, ELSET=LATER\nFIRST, 2\n*ELSET, ELSET=ALL\nLATER\n*ELSET, ELSET=FIRST\n1\n" + THREE
    text += '*ELSET, ELSET="Quoted name"\nBAR\n*ELSET, ELSET=Q\n"Quoted name"\n*NSET, NSET=N, ELSET=FIRST\n'
    raw = raw_of(tmp_path, text)
    assert [sorted(raw.sets[k].tolist()) for k in ("LATER", "ALL", "FIRST", "Quoted name", "Q")] == [
        [0, 1],
        [0, 1],
        [0],
        [0, 1],
        [0, 1],
    ]
    assert raw.point_sets["N"].tolist() == [0, 1]
    assert raw.notes == []


def test_a_set_takes_in_what_another_has_at_that_line(tmp_path):
    raw = raw_of(tmp_path, THREE + "*ELSET, ELSET=A\n1\n*ELSET, ELSET=B\nA\n*ELSET, ELSET=A\n2\n")
    assert (raw.sets["A"].tolist(), raw.sets["B"].tolist()) == ([0, 1], [0])


def test_members_that_are_not_there_are_named_with_their_lines(tmp_path):
    text = THREE + "*ELSET, ELSET=M\nBAR, NOSUCH\n*NSET, NSET=N\n2, 99\n*NSET, NSET=G, GENERATE\n1, 5, 2\n"
    assert raw_of(tmp_path, text).notes == [
        "sets name members that the file does not have, which are ignored: element set M (line 9) "
        "names NOSUCH; node set N (line 11) names 99; node set G (line 13) names 1 of the 3 numbers 1 to 5"
    ]


def test_elements_that_are_no_lines_are_members_that_are_there(tmp_path):
    raw = raw_of(tmp_path, THREE + "*ELEMENT, TYPE=S4, ELSET=S\n5, 1, 2,\n3, 1\n*ELSET, ELSET=ALL\n1, 5\n")
    assert (raw.sets["ALL"].tolist(), raw.notes, raw.left_out) == ([0], [], {"S4 elements": 1})


def test_sets_in_a_circle_and_in_long_chains(tmp_path):
    refused(
        tmp_path,
        THREE + "*ELSET, ELSET=A\nB\n*ELSET, ELSET=B\nA\n",
        r"line \d+: the element set B refers to itself",
    )
    refused(
        tmp_path,
        THREE + "*ELSET, ELSET=A\nB\n*ELSET, ELSET=B\nC\n*ELSET, ELSET=C\nA\n",
        "element set",
    )
    chain = "".join(f"*NSET, NSET=S{k}\nS{k + 1}\n" for k in range(20_000)) + "*NSET, NSET=S20000\n1\n"
    assert raw_of(tmp_path, THREE + chain).point_sets["S0"].tolist() == [0]


@pytest.mark.parametrize("last", [90_000_000, 9_000_000_000, 10**11])
@pytest.mark.parametrize("keyword", ["ELSET", "NSET"])
def test_huge_ranges_are_bounded_and_named(tmp_path, keyword, last):
    begin = time.perf_counter()
    raw = raw_of(tmp_path, TWO + f"*{keyword}, {keyword}=E, GEN\n1, {last}\n")
    assert time.perf_counter() - begin < 1
    there = {"ELSET": 1, "NSET": 2}[keyword]
    assert f"names {last - there} of the {last} numbers 1 to {last}" in raw.notes[0]


def test_nested_sets_are_taken_in_once(tmp_path):
    text = TWO + "*ELSET, ELSET=A0\n" + ", ".join(["1"] * 16) + "\n"
    text += "".join(f"*ELSET, ELSET=A{k + 1}\n" + ", ".join([f"A{k}"] * 12) + "\n" for k in range(12))
    assert raw_of(tmp_path, text).sets["A12"].tolist() == [0]


PARTS = """*PART, NAME=P
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 2, 0, 0
*ELEMENT, TYPE=B31
1, 1, 2
2, 2, 3
*NSET, NSET=END
3
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=P-1, PART=P
*END INSTANCE
*INSTANCE, NAME="P 2", PART=P
0, 0, 1
*ELSET, ELSET=OWN
2
*END INSTANCE
"""


def test_sets_by_label_of_an_instance(tmp_path):
    text = PARTS + '*NSET, NSET=T\nP-1.3, p-1.END, "P 2".1, A.P-1.2\n*ELSET, ELSET=E, INSTANCE=P-1\n2\n'
    raw = raw_of(tmp_path, text.replace(", A.P-1.2", ""))
    assert raw.point_sets["T"].tolist() == [2, 3]
    assert (raw.sets["E"].tolist(), raw.sets["P 2.OWN"].tolist()) == ([1], [3])
    bad = raw_of(tmp_path, PARTS + "*NSET, NSET=T\nP-1.9, Q-1.1\n*NSET, NSET=U, INSTANCE=Q\n1\n")
    assert "node set T (line 21) names P-1.9, Q-1.1; node set U (line 23) names instance Q" in bad.notes[0]


def test_nodes_in_an_instance_move_with_it(tmp_path):
    text = (
        "*PART, NAME=P\n*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n0, 5, 0\n"
        "0, 0, 0, 0, 0, 1, 90\n"
    )
    raw = raw_of(tmp_path, text + TWO + "*END INSTANCE\n")
    np.testing.assert_allclose(raw.points, [[-5, 0, 0], [-5, 1, 0]], atol=1e-14)


def test_parts_and_instances_that_are_twice_or_not_there(tmp_path):
    refused(tmp_path, PARTS.replace("PART=P\n*END", "PART=X\n*END"), "line 13: instance P-1 refers to part X")
    refused(
        tmp_path,
        PARTS.replace('"P 2"', "P-1"),
        "line 15: the instance P-1 is defined a second time, after .* line 13",
    )
    refused(
        tmp_path,
        "*PART, NAME=P\n*END PART\n*PART, NAME=P\n",
        "line 3: the part P is defined a second time, after .* line 1",
    )
    raw = raw_of(tmp_path, PARTS.replace("*ASSEMBLY", "*PART, NAME=Q\n" + TWO + "*END PART\n*ASSEMBLY"))
    assert raw.notes == ["parts without an instance left out: Q"]


# Numbers used twice -------------------------------------------------------------------------------------


def test_a_number_used_twice_is_named_with_both_lines(tmp_path):
    text = THREE + "*NODE\n2, 1, 0.5, 0\n*ELEMENT, TYPE=B31, ELSET=B\n1, 3, 1\n"
    raw = raw_of(tmp_path, text)
    assert raw.notes == [
        "node 2 is defined at line 3 and with other coordinates at line 9; the last definition "
        "is taken, as Abaqus does",
        "element 1 is defined at line 6 and with other nodes at line 11; the last definition "
        "is taken, as Abaqus does",
    ]
    np.testing.assert_allclose(raw.points[1], [1, 0.5, 0])
    assert raw.lines.tolist() == [[2, 0], [1, 2]]
    assert raw_of(tmp_path, THREE + "*NODE\n2, 1., 0, 0.\n*ELEMENT, TYPE=B31\n1, 1, 2\n").notes == []


def test_a_number_of_a_line_and_of_another_element_is_named_with_both_lines(tmp_path):
    raw = raw_of(tmp_path, THREE + "*ELEMENT, TYPE=S3\n2, 1, 2, 3\n9, 1, 2, 3\n")
    assert raw.notes == ["element 2 is a line at line 7 and of type S3 at line 9; the line is read"]


# What is left out ---------------------------------------------------------------------------------------


def test_keywords_that_matter_are_counted_with_a_remedy_and_unknown_ones_by_name(tmp_path):
    text = TWO + "*MATERIAL, NAME=S\n*ELASTIC\n1\n*RELEASE\n1, S1, ALLM\n*MPC\nBEAM, 1, 2\n*MPC\nTIE, 1, 2\n"
    text += (
        "*EQUATION\n2\n*BOUNDARY\n1, 1, 6\n*TRANSFORM, NSET=N\n1, 0, 0, 0, 1, 0\n*FOO BAR\n1\n"
        "*STEP\n*END STEP\n"
    )
    assert raw_of(tmp_path, text).notes == [
        "left out: *RELEASE (line 9); give the members release1 or release2 in the study file",
        "left out: *MPC (2, first at line 11), *EQUATION (line 15); tie the places with "
        "[[rigid_links]], [[joints]] "
        "or [[constraints]] in the study file",
        "left out: *BOUNDARY (line 17); give [[supports]] in the study file",
        "left out: *TRANSFORM (line 19); it turns the directions of loads and results; positions stay",
        "left out, because their meaning is not known: *FOO BAR (line 21)",
    ]


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("*BEAM SECTION, SECTION=RECT, ELSET=BAR\n1, 2\n", False),
        ("*BEAM SECTION, SECTION=RECT, ELSET=BAR, OFFSET1=0.5\n1, 2\n", True),
        ("*BEAM SECTION, SECTION=I, ELSET=BAR\n0.1, 0.2, 0.1, 0.1, 0.01, 0.01, 0.01\n", False),
        ("*BEAM SECTION, SECTION=I, ELSET=BAR\n0.0, 0.2, 0.1, 0.1, 0.01, 0.01, 0.01\n", True),
        ("*BEAM SECTION, SECTION=L, ELSET=BAR\n0.1, 0.1, 0.01, 0.01\n", True),
        ("*BEAM GENERAL SECTION, SECTION=GENERAL, ELSET=BAR\n1, 1, 0, 1, 1\n*CENTROID\n0.1, 0\n", True),
    ],
)
def test_a_section_whose_axis_is_beside_the_nodes_is_named(tmp_path, section, said):
    assert any("offset1" in note for note in raw_of(tmp_path, TWO + section).notes) is said


def test_no_keyword_is_in_two_tables():
    tables = [set(READ), set(REFUSED), set(NAMED), set(HARMLESS)]
    assert len(set().union(*tables)) == sum(map(len, tables))


# Forms of lines -----------------------------------------------------------------------------------------


def test_keywords_and_data_over_several_lines_with_blanks_comments_and_bom(tmp_path):
    text = (
        "\ufeff* node ,\n** in between\nnset = all\n1, 0, 0, 0\n\n** more\n2, 1, 0, 0,\r\n"
        "*Element,type=b31,\nElset=e\n1,\n1,\n2\n"
    )
    raw = raw_of(tmp_path, text)
    assert (raw.lines.tolist(), list(raw.sets), raw.point_sets["ALL"].tolist()) == ([[0, 1]], ["E"], [0, 1])


def test_a_comma_at_the_end_of_a_whole_element_does_not_swallow_the_next(tmp_path):
    assert len(raw_of(tmp_path, THREE.replace("1, 1, 2\n2, 2, 3\n", "1, 1, 2,\n2, 2, 3,\n")).lines) == 2
    many = (
        "".join(f"{k}, {k}., 0., 0.,\n" for k in range(1, 42)),
        "".join(f"{k}, {k}, {k + 1},\n" for k in range(1, 41)),
    )
    assert len(raw_of(tmp_path, f"*NODE\n{many[0]}*ELEMENT, TYPE=B31\n{many[1]}").lines) == 40


def test_a_comma_at_the_end_of_a_keyword_line_before_data(tmp_path):
    assert raw_of(tmp_path, TWO + "*NSET, NSET=A,\n1, 2\n").point_sets["A"].tolist() == [0, 1]


def test_bulk_and_careful_reading_agree(tmp_path):
    rng = np.random.default_rng(3)
    xyz = rng.normal(size=(200, 3))
    nodes = [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(xyz.tolist(), start=1)]
    elements = [f"{k}, {k}, {k + 1}" for k in range(1, 200)]
    plain = raw_of(
        tmp_path, "*NODE\n" + "\n".join(nodes) + "\n*ELEMENT, TYPE=B31\n" + "\n".join(elements) + "\n"
    )
    odd = [nodes[0].replace("e-", "d-") + ", 0., 0., 1.", *nodes[1:]]
    careful = raw_of(
        tmp_path,
        "*NODE\n"
        + "\n".join(odd)
        + "\n*ELEMENT, TYPE=B31\n"
        + "\n".join([elements[0] + ", 7", *elements[1:]]),
    )
    np.testing.assert_array_equal(plain.points, careful.points)
    np.testing.assert_array_equal(plain.points, xyz)
    np.testing.assert_array_equal(plain.lines, careful.lines)


def test_node_sets_of_a_deck_name_what_is_not_there(tmp_path):
    path = write(
        tmp_path, THREE + "*NSET, NSET=A, UNSORTED\n3, 1\n*NSET, NSET=B\nA, 2, 3\n*NSET, NSET=C, ELSET=BAR\n"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_node_sets(path) == {"A": (3, 1), "B": (1, 2, 3), "C": (1, 2, 3)}
    with pytest.warns(UserWarning, match=r"node set A \(line 9\) names 9"):
        read_node_sets(write(tmp_path, THREE + "*NSET, NSET=A\n9, 1\n"))


def test_the_notes_reach_the_warning_of_the_mesh(tmp_path):
    with pytest.warns(
        UserWarning, match=r"^a\.inp: left out: \*RELEASE \(line 6\); give the members release1"
    ):
        read_mesh(write(tmp_path, TWO + "*RELEASE\n1, S1, ALLM\n"))
