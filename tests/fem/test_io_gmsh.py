"""Gmsh files: the same model in every form gives the same mesh; what is wrong or left out is named."""

import random
import warnings

import numpy as np
import pytest

from fem import MeshError
from fem.io import read_mesh
from tests.msh_files import FORMS, Model, msh2, msh4

NODES = {1: (0.0, 0, 0), 2: (0.0, 0, 1), 4: (0.0, 0, 2), 7: (0.0, 1, 2), 9: (0.0, 3, 2)}


def model(groups=((7,), (8,), ()), parts=None):
    """A post of two lines, a beam of one and a tip of one; each is a curve in its groups."""
    return Model(
        NODES,
        {
            3: (list(groups[0]), [(11, 1, [1, 2]), (12, 1, [2, 4])]),
            5: (list(groups[1]), [(13, 1, [4, 7])]),
            6: (list(groups[2]), [(14, 1, [7, 9])]),
        },
        {2: ([1], [(1, 15, [1])])},
        [(0, 1, "base"), (1, 7, "post"), (1, 8, "a beam")],
        parts or {},
    )


def read(tmp_path, data, n_warnings=0):
    (tmp_path / "a.msh").write_bytes(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = read_mesh(tmp_path / "a.msh")
    assert len(caught) == n_warnings, [str(w.message) for w in caught]
    return mesh


def told(mesh):
    return (
        {name: mesh.points[mesh.member_points(name)].tolist() for name in mesh.members},
        dict(mesh.groups),
        {name: mesh.points[k].tolist() for name, k in mesh.point_names.items()},
    )


POST, BEAM, TIP = [[0, 0, 0], [0, 0, 1], [0, 0, 2]], [[0, 0, 2], [0, 1, 2]], [[0, 1, 2], [0, 3, 2]]


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_members_of_groups_and_names_of_points(tmp_path, form):
    members, groups, names = told(read(tmp_path, FORMS[form](model())))
    unnamed = form == "1"  # which has no names
    post, beam, base = ("physical 7", "physical 8", "physical 1") if unnamed else ("post", "a beam", "base")
    assert members == {post: POST, beam: BEAM, "curve 6": TIP}
    assert not groups
    assert names == {base: [0, 0, 0]}


@pytest.mark.parametrize("form", [form for form in FORMS if "binary" not in form])
def test_other_line_ends_and_a_byte_order_mark(tmp_path, form):
    data = FORMS[form](model())
    changed = b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n")
    assert told(read(tmp_path, changed)) == told(read(tmp_path, data))


@pytest.mark.parametrize("form", FORMS)
def test_a_curve_in_two_groups_is_one_line(tmp_path, form):
    mesh = read(tmp_path, FORMS[form](model(((7,), (8, 7), (9,)))))
    names = {7: "physical 7", 8: "physical 8"} if form == "1" else {7: "post", 8: "a beam"}
    assert mesh.n_lines == 4
    assert mesh.members_of(names[8]) == (names[8],)
    assert mesh.members_of(names[7]) == (f"{names[7]}.rest", names[8])
    assert mesh.members["physical 9"].tolist() == [3]


@pytest.mark.parametrize("form", [form for form in FORMS if form.startswith("4")])
@pytest.mark.parametrize("groups", [((7,), (8,), ()), ((7,), (8, 7), ())])
def test_a_partitioned_file_is_read_as_the_whole_one(tmp_path, form, groups):
    parts = {103: (3, [11]), 104: (3, [12]), 106: (6, [14])}
    whole, divided = (read(tmp_path, FORMS[form](model(groups, p))) for p in ({}, parts))
    assert told(divided) == told(whole)
    assert "curve 6" in divided.members


def test_a_part_of_a_part_belongs_to_the_whole(tmp_path):
    data = msh4(model(parts={103: (3, [11]), 104: (103, [12])}))
    assert told(read(tmp_path, data))[0]["post"] == POST


@pytest.mark.parametrize("form", [form for form in FORMS if form.startswith("4")])
def test_a_negative_group_turns_the_lines_as_format_2_does(tmp_path, form):
    mesh = read(tmp_path, FORMS[form](model(((-7,), (8, -7), ()))))
    assert told(mesh)[0]["post.rest"] == POST[::-1]
    assert told(mesh)[0]["a beam"] == BEAM


@pytest.mark.parametrize("form", [form for form in FORMS if form != "1"])
@pytest.mark.parametrize(("kind", "order"), [(8, 2), (26, 3), (27, 4), (28, 5), (62, 6), (66, 10)])
def test_lines_of_higher_order_become_chains(tmp_path, form, kind, order):
    nodes = {k + 1: (float(k), 0.0, 0.0) for k in range(order + 1)}
    told_first = [1, order + 1, *range(2, order + 1)]
    curved = Model(nodes, {1: ([7], [(1, kind, told_first)])}, {}, [(1, 7, "beam")])
    mesh = read(tmp_path, FORMS[form](curved), 1)
    assert mesh.points[mesh.member_points("beam"), 0].tolist() == list(range(order + 1))


# What is named ------------------------------------------------------------------------------------------


def notes(tmp_path, data):
    return read(tmp_path, data, 1).notes


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("Periodic", "a.msh: sections left out: $Periodic (line 36)"),
        ("GhostElements", "a.msh: sections left out: $GhostElements (line 36)"),
        ("NodeData", "a.msh: sections left out: $NodeData (line 36)"),
        ("Whatever", "a.msh: sections left out: $Whatever (line 36)"),
    ],
)
def test_sections_that_are_not_applied_are_named(tmp_path, section, words):
    data = msh2(model()) + f"${section}\n0\n$End{section}\n".encode()
    data = data.replace(b"$Nodes", b"$Comments\n$ a line\n$EndComments\n$Nodes")
    line = data[: data.index(f"${section}".encode())].count(b"\n") + 1
    assert notes(tmp_path, data) == (words.replace("36", str(line)),)


@pytest.mark.parametrize("section", ["Comments", "Parametrizations", "InterpolationScheme"])
def test_harmless_sections_are_not_named(tmp_path, section):
    assert read(tmp_path, msh4(model()) + f"${section}\n0\n$End{section}\n".encode()).notes == ()


def test_a_node_number_used_twice(tmp_path):
    text = msh2(model()).replace(b"$Nodes\n5", b"$Nodes\n6")
    same = text.replace(b"$EndNodes", b"7 0 1.0 2\n$EndNodes")
    assert notes(tmp_path, same) == (
        "a.msh: node 7 is defined at line 15 and again at line 17, with the same coordinates",
    )
    moved = text.replace(b"$EndNodes", b"7 0 1.5 2\n$EndNodes")
    with pytest.raises(
        MeshError, match=r"a\.msh: node 7 is defined at line 15 and again at line 17, with other"
    ):
        read(tmp_path, moved)


@pytest.mark.parametrize("form", ["1", "4.0", "4.1", "4.1 parametric"])
def test_a_node_number_used_twice_in_other_forms(tmp_path, form):
    there = Model({1: (0, 0, 0), 2: (0, 0, 1), 33: (0, 0, 5)}, {1: ([], [(1, 1, [1, 2])])})
    with pytest.raises(MeshError, match=r"node 2 is defined at line \d+ and again at line \d+, with other"):
        read(tmp_path, FORMS[form](there).replace(b"33", b"2"))


def test_an_element_number_used_twice(tmp_path):
    said = notes(tmp_path, msh4(model()).replace(b"\n13 4 7\n", b"\n12 4 7\n"))
    assert said == ("a.msh: element 12 is defined at line 38 and again at line 40; both are read",)


def test_an_element_that_repeats_another(tmp_path):
    said = notes(tmp_path, msh2(model()).replace(b"13 1 2 8 5 4 7", b"13 1 2 7 3 2 4"))
    assert "1 elements repeat another of the same group and are read once, first that at line 23" in said[0]
    assert "which repeats that at line 22" in said[0]


def test_coordinates_beyond_what_lengths_can_be(tmp_path):
    there = model()
    there.nodes = NODES | {4: (0.0, 1e200, 2.0)}
    with pytest.raises(MeshError, match=r"a\.msh: node 4 is so far away, at 0, 1e\+200"):
        read(tmp_path, msh4(there))


def test_two_curves_between_the_same_nodes_are_two_lines(tmp_path):
    text = (
        msh2(model())
        .replace(b"13 1 2 8 5 4 7", b"13 1 2 8 5 2 4")
        .replace(b"14 1 2 0 6 7 9", b"14 1 2 0 6 2 9")
    )
    mesh = read(tmp_path, text, 1)
    assert mesh.n_lines == 4
    assert "1 lines join the same two points as another line" in " ".join(mesh.notes)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_coordinates_that_are_not_finite(tmp_path, form, value):
    there = model()
    there.nodes = NODES | {4: (0.0, value, 2.0)}
    place = "byte" if "binary" in form else "line"
    with pytest.raises(
        MeshError, match=rf"a\.msh: {place} \d+: node 4 has the coordinates 0, {value:g}, 2; they"
    ):
        read(tmp_path, FORMS[form](there))
    there.nodes = NODES | {99: (0.0, value, 2.0)}  # on no line
    assert "node 99, on no line" in notes(tmp_path, FORMS[form](there))[0]


def test_names_of_groups_that_are_wrong_or_unused(tmp_path):
    there = model()
    there.names += [(1, 8, "other"), (1, 3, "empty"), (0, 9, "none"), (2, 4, "plate"), (1, 7, "post")]
    text = msh4(there).replace(b'1 8 "other"', b"1 8 other")
    text = text.replace(b'1 7 "post"\n$', b'1 8 "other"\n$')
    text = text.replace(b"$PhysicalNames\n8", b"$PhysicalNames\n9")
    said = notes(tmp_path, text)
    for words in (
        "line 9, in $PhysicalNames, is left out: '1 8 other' is found where a dimension",
        "line 13, in $PhysicalNames, gives group 8 of dimension 1 the name 'other'; its name 'a beam'",
        "$PhysicalNames announces 9 names and has 8",
        "physical curves without elements: 'empty'",
        "physical points without elements: 'none'",
        "physical surfaces left out: 'plate'",
    ):
        assert any(text.startswith(f"a.msh: {words}") for text in said)


def test_two_groups_of_one_name_become_one_set(tmp_path):
    there = model()
    there.names[2] = (1, 8, "post")
    (tmp_path / "a.msh").write_bytes(msh4(there))
    with pytest.warns(UserWarning, match="physical curves 7, 8 are all called 'post' and become one set"):
        mesh = read_mesh(tmp_path / "a.msh")
    assert told(mesh)[1] == {"post": ("post.1", "post.2")}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"2.2 0 8", b"3.0 0 8", r"line 2, in \$MeshFormat: format 3.0 is not read; save it .* 4.1 or 2.2"),
        (b"2.2 0 8", b"4.2 0 8", r"line 2, in \$MeshFormat: format 4.2 is not read"),
        (b"$Nodes\n5", b"$Nodes\n6", r"11, in \$Nodes: 6 nodes are announced, and 5 are"),
        (b"$Nodes\n5", b"$Nodes\n4", r"11, in \$Nodes: 4 nodes are announced, and 5 are"),
        (
            b"$Elements\n5",
            b"$Elements\n999999999999",
            r"line 19, in \$Elements: 999999999999 elements are ann",
        ),
        (
            b"12 1 2 7 3 2 4",
            b"12 1 2 7 3 2",
            r"line 22, in \$Elements: element 12 of type 1 has 1 nodes; 2 are",
        ),
        (
            b"12 1 2 7 3 2 4",
            b"12 1 9 7 3 2 4",
            r"line 22, in \$Elements: 9 tags are announced, and 4 numbers",
        ),
        (
            b"4 0.0 0.0 2.0",
            b"4 0.0 0.0",
            r"line 14, in \$Nodes: 3 numbers, where a node has its number, x, y",
        ),
        (
            b"4 0.0 0.0 2.0",
            b"4.5 0.0 0.0 2.0",
            r"line 14, in \$Nodes: 4.5 is found where an integer is expected",
        ),
        (b"4 0.0 0.0 2.0", b"4 0.0 0.0 2,0", r"line 14, in \$Nodes: '2,0' is not a number"),
        (b"$Elements\n", b"$Elements\nx\n", r"line 19, in \$Elements: 'x' is not an integer"),
        (b"$EndNodes\n", b"", r"line 10: the section \$Nodes has no end"),
        (
            b"$EndElements\n",
            b"$EndElements\n$Nodes\n0\n$EndNodes\n",
            r"a second section \$Nodes; the first is",
        ),
    ],
)
def test_format_2_errors_name_line_and_section(tmp_path, old, new, words):
    data = msh2(model())
    assert old in data
    with pytest.raises(MeshError, match=rf"a\.msh: .*{words}"):
        read(tmp_path, data.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"$Nodes\n2 5", b"$Nodes\n2 6", r"in \$Nodes: 6 nodes are announced, and its blocks have 5"),
        (
            b"$Nodes\n2 5",
            b"$Nodes\n3 5",
            r"in \$Nodes: it is cut off: 3 numbers are announced, and 0 are left",
        ),
        (b"1 3 0 2\n", b"1 3 0 999999999999\n", r"in \$Nodes: .* 999999999999 numbers are announced"),
        (b"1 3 1 2\n", b"1 3 1 1\n", r"line 39, in \$Elements: 4 numbers, where 5 are expected"),
        (b"\n12 2 4\n", b"\n12 2\n", r"line 38, in \$Elements: 2 numbers, where 3 are expected"),
        (b"\n12 2 4\n", b"\n12 2 4 7\n", r"line 38, in \$Elements: 4 numbers, where 3 are expected"),
        (b"1 3 1 2\n", b"1 3 77 2\n", r"line 3\d, in \$Elements: elements of type 77 are not known"),
    ],
)
def test_format_4_errors_name_line_and_section(tmp_path, old, new, words):
    data = msh4(model())
    assert old in data
    with pytest.raises(MeshError, match=rf"a\.msh: .*{words}"):
        read(tmp_path, data.replace(old, new))


def test_numbers_in_the_wrong_byte_order_are_named(tmp_path):
    data = msh4(model(), True).replace(b"\x01\0\0\0\n$EndMeshFormat", b"\x01\0\0\x01\n$EndMeshFormat")
    with pytest.raises(MeshError, match=r"the bytes 01 00 00 01 are not the integer 1 in either byte order"):
        read(tmp_path, data)


def test_a_file_of_another_kind(tmp_path):
    with pytest.raises(MeshError, match=r"a\.msh: this is not a Gmsh file; one begins with \$MeshFormat"):
        read(tmp_path, b'(0 "Fluent")\n(2 3)\n')


@pytest.mark.parametrize("form", FORMS)
def test_damaged_files_are_mesh_errors_or_meshes(tmp_path, form):
    """Bytes changed, cut or repeated: nothing else than a mesh or a MeshError comes of it."""
    data, chance = FORMS[form](model(parts={103: (3, [11])})), random.Random(form)
    said: list[str] = []
    for _ in range(300):
        changed = bytearray(data)
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(changed))
            piece = bytes(
                chance.choice(b"0123456789 -.$\n\x00\xff\x7fe") for _ in range(chance.randint(0, 9))
            )
            changed[at : at + chance.randint(0, 9)] = piece
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                (tmp_path / "a.msh").write_bytes(changed)
                read_mesh(tmp_path / "a.msh")
        except MeshError as reason:
            said.append(str(reason))
    assert all(text.startswith("a.msh: ") and "\n" not in text for text in said)
    assert len(said) > 100
