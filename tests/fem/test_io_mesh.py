"""Meshes from files: what each format calls its sets, what is left out, and errors with file and reason."""

import sys
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from fem import Mesh, MeshError, MeshWarning, check_mesh
from fem.io import read_mesh, write_mesh, write_uff
from fem.io.meshio_mesh import _by_number, quiet
from fem.mesh import merge_advice


def write(path, text):
    path.write_text(text)
    return path


def members(mesh):
    return {name: rows.tolist() for name, rows in mesh.members.items()}


# Abaqus -------------------------------------------------------------------------------------------------

INP = """*HEADING
 a frame
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1000., 0, 0
3, 2000, 0, 0
*NODE
4, 2000, 0, 1000.
*Element, type=B31, elset=Beam
1, 1, 2
*ELEMENT, TYPE=B33, ELSET=BEAM
2, 2, 3
*element, type=t3d2
3, 3, 4
*ELSET, ELSET=All, GENERATE
1, 3, 1
*NSET, NSET=base
1
*NSET, NSET=ends
1, 4,
*BEAM SECTION, ELSET=BEAM, SECTION=RECT,
 MATERIAL=STEEL
10., 10.
"""


def test_abaqus_sets_over_several_blocks_and_in_any_case(tmp_path):
    mesh = read_mesh(write(tmp_path / "a.inp", INP), scale=0.001)
    np.testing.assert_allclose(mesh.points[3], [2, 0, 1])
    assert members(mesh) == {"BEAM": [0, 1], "ALL.rest": [2]}
    assert mesh.members_of("ALL") == ("BEAM", "ALL.rest")
    assert mesh.point_names["BASE"] == 0
    assert mesh.point_names["ENDS.2"] == 3


def test_abaqus_other_elements_orientation_nodes_and_quadratic_beams(tmp_path):
    text = INP + "*NODE\n5, 2000, 0, 2000\n6, 2000, 0, 3000\n7, 0, 9, 0\n"
    text += "*ELEMENT, TYPE=B32, ELSET=Q\n4, 4, 5, 6, 7\n"
    text += "*ELEMENT, TYPE=MASS, ELSET=M\n9, 3\n*ELEMENT, TYPE=S4\n10, 1, 2,\n3, 4\n"
    with pytest.warns(UserWarning, match="left out") as said:
        mesh = read_mesh(write(tmp_path / "a.inp", text))
    assert str(said[0].message) == (
        "a.inp: 1 MASS elements left out (only lines are read); "
        "1 S4 elements left out (only lines are read); "
        "1 quadratic line(s) became two lines each; "
        "sets without lines: 'M'; "
        "1 point on no line is left out, and the others are renumbered in their order"
    )
    np.testing.assert_array_equal(mesh.points[mesh.member_points("Q"), 2], [1000, 2000, 3000])


def test_abaqus_parts_are_placed(tmp_path):
    text = """*Part, name=Leg
*Node
1, 0,0,0
2, 0,0,1
*Element, type=B31
1, 1, 2
*Elset, elset=All
1,
*End Part
*Assembly, name=A
*Instance, name=L-1, part=Leg
*End Instance
*Instance, name=L-2, part=Leg
1., 0., 0.
1., 0., 0., 1., 1., 0., 90.
*End Instance
*Nset, nset=top, instance=L-2
2,
*End Assembly
"""
    mesh = read_mesh(write(tmp_path / "a.inp", text))
    np.testing.assert_allclose(mesh.points, [[0, 0, 0], [0, 0, 1], [1, 0, 0], [2, 0, 0]], atol=1e-15)
    assert members(mesh) == {"L-1.ALL": [0], "L-2.ALL": [1]}
    assert mesh.point_names["TOP"] == 3


def test_abaqus_include(tmp_path):
    write(tmp_path / "nodes.inp", INP[: INP.index("*Element")])
    rest = INP[INP.index("*Element") :]
    mesh = read_mesh(write(tmp_path / "a.inp", "*INCLUDE, INPUT=nodes.inp\n" + rest))
    assert mesh.n_lines == 3
    with pytest.raises(MeshError, match=r"a\.inp: line 1: the included file no\.inp cannot be read"):
        read_mesh(write(tmp_path / "a.inp", "*INCLUDE, INPUT=no.inp\n" + rest))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("3, 3, 4", "3, 3, 44", "element 3 refers to node 44"),
        (
            "1000., 0, 0",
            "x, 0, 0",
            r"line 5: \*NODE takes a number and up to three coordinates, but 'x' is not a number",
        ),
        ("3, 3, 4", "3, 3", r"element 3 of type T3D2 has 1 node\(s\); 2 are expected"),
    ],
)
def test_abaqus_errors_name_the_place(tmp_path, old, new, words):
    with pytest.raises(MeshError, match=rf"a\.inp: .*{words}"):
        read_mesh(write(tmp_path / "a.inp", INP.replace(old, new)))


# Nastran ------------------------------------------------------------------------------------------------

BDF = """GRID           1              0.      0.      0.
GRID           2             1.0      0.      0.
GRID*                  3                             2.0             0.0
*                 1.5-3
grid,4,,3.,0.,0.
CBAR           1       3       1       2      0.      0.      1.
CBEAM,2,4,2,3,0.,0.,1.  $ comment
CBAR*                  3               3               3               4
*                     0.              0.              1.
PBAR,3,1,1.,1.,1.,1.
"""


@pytest.mark.parametrize("frame", ["{}", "SOL 103\nCEND\nBEGIN BULK\n{}ENDDATA\n"])
def test_nastran_fields_small_large_and_free(tmp_path, frame):
    mesh = read_mesh(write(tmp_path / "a.bdf", frame.format(BDF)))
    np.testing.assert_array_equal(mesh.points, [[0, 0, 0], [1, 0, 0], [2, 0, 1.5e-3], [3, 0, 0]])
    assert mesh.members_of("property 3") == ("property 3.1", "property 3.2")
    assert members(mesh)["property 4"] == [1]


def test_nastran_says_what_else_was_there(tmp_path):
    with pytest.warns(UserWarning, match=r"left out: RBE2 \(line 13\); tie .*2 CQUAD4 cards left out"):
        read_mesh(
            write(tmp_path / "a.bdf", BDF + "CQUAD4,9,1,1,2,3,4\nCQUAD4,8,1,1,2,3,4\nRBE2,7,1,123456,2\n")
        )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("grid,4,,3.", "grid,4,7,3.", "line 5: grid point 4 is in coordinate system 7"),
        ("CBEAM,2,4,2,3", "CBEAM,2,4,2,33", "line 7: CBEAM 2 refers to grid point 33"),
        (
            "CBEAM,2,4,2,3",
            "CBEAM,2,4,a,3",
            "line 7: CBEAM 2, 4, a, 3, .* cannot be read: 'a' is not a whole number",
        ),
        ("1.0      0.", "1.x      0.", "line 2: GRID"),
    ],
)
def test_nastran_errors_name_the_line(tmp_path, old, new, words):
    with pytest.raises(MeshError, match=rf"a\.bdf: {words}"):
        read_mesh(write(tmp_path / "a.bdf", BDF.replace(old, new)))


# Gmsh ---------------------------------------------------------------------------------------------------

MSH22 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
4
0 1 "base"
1 1 "column a"
1 2 "beam"
1 3 "all"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 0 0 1
3 0 1 1
10 0 2 1
$EndNodes
$Elements
7
1 15 2 1 1 1
2 1 2 1 1 1 2
3 1 2 2 2 2 3
4 1 2 3 1 1 2
5 1 2 3 2 2 3
6 1 2 0 3 3 10
7 2 2 5 1 1 2 3
$EndElements
"""

MSH41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
0 1 "frame"
1 2 "frame"
$EndPhysicalNames
$Entities
2 2 0 0
1 0 0 0 1 1
2 1 0 0 0
1 0 0 0 1 0 0 1 2 2 1 -2
2 0 0 0 1 0 0 0 2 1 -2
$EndEntities
$Nodes
3 4 1 4
0 1 0 1
1
0 0 0
0 2 0 1
2
1 0 0
1 1 0 2
3
4
0.3 0 0
0.6 0 0.1
$EndNodes
$Elements
3 5 1 5
0 1 15 1
1 1
1 1 1 3
2 1 3
3 3 4
4 4 2
1 2 1 1
5 1 2
$EndElements
"""


def test_gmsh_22_groups_overlap_and_lines_in_none(tmp_path):
    with pytest.warns(UserWarning, match="1 triangles left out"):
        mesh = read_mesh(write(tmp_path / "a.msh", MSH22))
    assert members(mesh) == {"column a": [0], "beam": [1], "curve 3": [2]}
    assert dict(mesh.groups) == {"all": ("column a", "beam")}
    assert dict(mesh.point_names) == {"base": 0}


def test_gmsh_41_group_on_some_curves_and_one_name_in_two_dimensions(tmp_path):
    mesh = read_mesh(write(tmp_path / "a.msh", MSH41))
    assert members(mesh) == {"frame": [0, 1, 2], "curve 2": [3]}
    assert dict(mesh.point_names) == {"frame": 0}
    np.testing.assert_array_equal(mesh.member_points("frame"), [0, 2, 3, 1])


@pytest.mark.parametrize("text", [MSH22, MSH41])
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("$EndElements\n", "", r"line \d+: the section \$Elements has no end"),
        ("$Elements", "$Other", r"there is no section \$Elements"),
        ("\n1 0 0 0", "\n1 0 0 x", r"line 1\d, in \$\w+: 'x' is not a number"),
        (
            "1 2\n",
            "1 77\n",
            r"line \d+, in \$Elements: element \d refers to node 77, which is not among the 4",
        ),
    ],
)
def test_gmsh_errors_name_section_and_line(tmp_path, text, old, new, words):
    text = text.replace("$EndOther", "").replace(old, new)
    if new == "$Other":
        text = text.replace("$EndElements", "$EndOther")
    with pytest.raises(MeshError, match=rf"a\.msh: {words}"):
        read_mesh(write(tmp_path / "a.msh", text))


# Through meshio -----------------------------------------------------------------------------------------

POINTS = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 2, 1.0]])


def test_gmsh_binary(tmp_path):
    tags = [np.array([1, 2, 2])]
    cells = [("line", np.array([[0, 1], [1, 2], [2, 3]]))]
    found = meshio.Mesh(
        POINTS,
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"col": np.array([1, 1]), "beam": np.array([2, 1])},
    )
    meshio.write(tmp_path / "a.msh", found, file_format="gmsh22")
    assert members(read_mesh(tmp_path / "a.msh")) == {"col": [0], "beam": [1, 2]}


def test_cell_array_numbers_members_and_triangles_are_left_out(tmp_path):
    cells = [
        ("line", np.array([[0, 1], [1, 2]])),
        ("triangle", np.array([[0, 1, 2]])),
        ("line3", np.array([[2, 3, 4]])),
    ]
    points = np.vstack([POINTS, [0, 1.5, 1.1]])
    data = {"part": [np.array([1, 2]), np.array([9]), np.array([4])]}
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(points, cells, cell_data=data))
    with pytest.warns(UserWarning, match=r"1 triangle cells left out.*1 quadratic line\(s\) became two"):
        mesh = read_mesh(tmp_path / "a.vtu", sets="part")
    assert members(mesh) == {"part 1": [0], "part 2": [1], "part 4": [2, 3]}
    np.testing.assert_array_equal(mesh.member_points("part 4"), [2, 4, 3])
    with pytest.raises(MeshError, match="there is no cell array 'x'; it has part"):
        read_mesh(tmp_path / "a.vtu", sets="x")


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk", "a.msh", "a.foo", "a", "a.stl"])
@pytest.mark.parametrize("data", [b"", b"<VTKFile>", b"$MeshFormat\n9 0 8\n", bytes(range(200))])
def test_what_meshio_cannot_read_is_a_mesh_error_and_silent(tmp_path, capfd, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MeshError, match=name):
        read_mesh(tmp_path / name)  # any warning would be an error here
    assert capfd.readouterr() == ("", "")


def test_what_meshio_only_prints_becomes_part_of_the_message(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    pyvista.UnstructuredGrid(np.array([4, 0, 1, 2, 3]), np.array([4]), POINTS).save(tmp_path / "a.vtu")
    with pytest.raises(
        MeshError, match=r"a\.vtu: no lines; it has polylines left out, which meshio cannot read"
    ):
        read_mesh(tmp_path / "a.vtu")


def test_polylines_beside_lines_are_named_and_numbers_stay_with_their_cells(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.UnstructuredGrid(np.array([3, 0, 1, 2, 2, 2, 3]), np.array([4, 3]), POINTS)
    grid.cell_data["member"] = [5, 6]
    grid.save(tmp_path / "a.vtu")
    with pytest.warns(MeshWarning, match="polylines left out"):
        mesh = read_mesh(tmp_path / "a.vtu")
    assert members(mesh) == {"member 6": [0]}
    assert mesh.notes[0] == (
        "a.vtu: polylines left out, which meshio cannot read; write them as lines of two points each"
    )


@pytest.mark.parametrize("how", [{}, {"binary": False}, {"compression": None}, {"compression": "lzma"}])
def test_vtu_of_every_kind_is_the_same_mesh(tmp_path, how):
    cells = [("line", np.array([[0, 1], [1, 2]])), ("line4", np.array([[0, 3, 1, 2]]))]
    found = meshio.Mesh(POINTS, cells, cell_data={"member": [np.array([4, 2]), np.array([3])]})
    with quiet():
        meshio.write(tmp_path / "a.vtu", found, **how)
    with pytest.warns(MeshWarning, match="2 lines join the same two points as another"):
        mesh = read_mesh(tmp_path / "a.vtu")
    assert members(mesh) | {"member 4": [0], "member 2": [1]} == members(mesh)
    np.testing.assert_array_equal(mesh.lines[2:], [[0, 1], [1, 2], [2, 3]])


@pytest.mark.parametrize(
    ("values", "what"), [([1.5, 2.0], "part"), ([np.nan, 1.0], "part"), ([[1, 2], [3, 4]], "part")]
)
def test_cell_arrays_that_are_no_numbers_of_members(tmp_path, values, what):
    found = meshio.Mesh(POINTS[:3], [("line", [[0, 1], [1, 2]])], cell_data={what: [np.array(values)]})
    meshio.write(tmp_path / "a.vtu", found)
    with pytest.raises(
        MeshError, match=r"a\.vtu: the cell array 'part' does not have one whole number for each"
    ):
        read_mesh(tmp_path / "a.vtu", sets="part")
    found.cell_data = {"member": found.cell_data.pop(what)}
    meshio.write(tmp_path / "a.vtu", found)
    with pytest.warns(
        MeshWarning, match="the cell array 'member' names no members: it has not one whole number"
    ):
        assert read_mesh(tmp_path / "a.vtu").groups["frame"] == ("frame.1", "frame.2")


def test_cell_arrays_that_could_name_members_are_named(tmp_path):
    found = meshio.Mesh(POINTS[:3], [("line", [[0, 1], [1, 2]])], cell_data={"part": [np.array([1, 2])]})
    meshio.write(tmp_path / "a.vtu", found)
    with pytest.warns(
        MeshWarning, match="the cell arrays 'part' have whole numbers, and sets = 'part' would"
    ):
        read_mesh(tmp_path / "a.vtu")


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".xdmf"])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_coordinates_that_are_not_finite_name_the_file(tmp_path, suffix, value):
    points = POINTS[:3].copy()
    points[1, 2] = value
    more = {"data_format": "XML"} if suffix == ".xdmf" else {}
    with quiet():
        meshio.write(tmp_path / f"a{suffix}", meshio.Mesh(points, [("line", [[0, 1], [1, 2]])]), **more)
    with pytest.raises(
        MeshError, match=rf"a{suffix}: point 2 has the coordinates 0, 0, {value:g}; they must be"
    ):
        read_mesh(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".xdmf", ".med"])
def test_without_h5py_the_package_is_named(tmp_path, monkeypatch, suffix):
    monkeypatch.setitem(sys.modules, "h5py", None)
    item = '<DataItem DataType="Float" Dimensions="3 3" Format="HDF" Precision="8">a.h5:/0</DataItem>'
    grid = f'<Grid Name="Grid"><Geometry GeometryType="XYZ">{item}</Geometry></Grid>'
    write(tmp_path / f"a{suffix}", f'<Xdmf Version="3.0"><Domain>{grid}</Domain></Xdmf>')
    with pytest.raises(
        MeshError, match=rf"a{suffix}: .*it needs the package h5py: python -m pip install h5py, or write"
    ):
        read_mesh(tmp_path / f"a{suffix}")


def test_no_such_file(tmp_path):
    with pytest.raises(MeshError, match="there is no such file"):
        read_mesh(tmp_path / "a.msh")


def test_mode_shapes_for_paraview(tmp_path):
    mesh = Mesh.from_lines(POINTS, [[0, 1], [1, 2], [2, 3]], {"col": [0], "long beam": [1, 2]})
    shape = np.arange(12.0).reshape(4, 3)
    write_mesh(mesh, tmp_path / "a.vtu", {"mode 1": shape})
    found = meshio.read(tmp_path / "a.vtu")
    np.testing.assert_array_equal(found.point_data["mode 1"], shape)
    np.testing.assert_array_equal(found.cell_data["member"][0], [1, 2, 2])
    for values in (shape[:3], shape * 1j):
        with pytest.raises(MeshError, match="point data 'mode 1' have shape"):
            write_mesh(mesh, tmp_path / "b.vtu", {"mode 1": values})
    with pytest.raises(MeshError, match="keeps no point data"):
        write_mesh(mesh, tmp_path / "b.inp", {"mode 1": shape})
    with pytest.raises(MeshError, match=r"b\.stl: it cannot be written"):
        write_mesh(mesh, tmp_path / "b.stl")
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtu"]


# Points that coincide, sets that overlap ----------------------------------------------------------------

TWO_PARTS = INP.replace("3, 3, 4", "3, 5, 4").replace(
    "4, 2000, 0, 1000.", "4, 2000, 0, 1000.\n5, 2000.0001, 0, 0"
)


def test_coinciding_points_are_named_and_merged_only_on_request(tmp_path):
    path = write(tmp_path / "a.inp", TWO_PARTS)
    with pytest.warns(UserWarning, match="1 point lies at the place of another and is not") as said:
        mesh = read_mesh(path, scale=0.001)
    assert mesh.n_points == 5
    advice = merge_advice(2e-6)
    assert advice in str(said[0].message)
    assert any(advice in defect.message for defect in check_mesh(mesh))
    with pytest.warns(UserWarning, match="1 points merged"):
        read_mesh(path, scale=0.001, merge_tolerance=float(advice.split("= ")[1].split()[0]))
    with pytest.warns(UserWarning, match=r"1 points merged with others within 1e-05 m; 1 point on no line"):
        mesh = read_mesh(path, scale=0.001, merge_tolerance=1e-5)
    assert (mesh.n_points, mesh.n_lines) == (4, 3)
    with pytest.raises(MeshError, match="the merge tolerance is -1"):
        read_mesh(path, merge_tolerance=-1)
    with pytest.raises(MeshError, match="the scale is 0"):
        read_mesh(path, scale=0)


def test_merging_drops_lines_that_vanish(tmp_path):
    with pytest.warns(UserWarning, match="1 lines shorter than the merge tolerance left out"):
        mesh = read_mesh(
            write(tmp_path / "a.inp", TWO_PARTS + "*ELEMENT, TYPE=B31\n8, 3, 5\n"), merge_tolerance=0.001
        )
    assert members(mesh) == {"BEAM": [0, 1], "ALL.rest": [2]}


def test_lines_given_twice_are_named(tmp_path):
    with pytest.warns(UserWarning, match="1 lines join the same two points as another"):
        read_mesh(write(tmp_path / "a.inp", INP + "*ELEMENT, TYPE=B31, ELSET=X\n8, 4, 3\n"))


def test_sets_that_cross_are_cut(tmp_path):
    text = INP + "*ELSET, ELSET=END\n2, 3\n"
    with pytest.warns(UserWarning, match="sets overlap; lines that several share are separate members"):
        mesh = read_mesh(write(tmp_path / "a.inp", text))
    assert set(mesh.members) == {"BEAM & END & ALL", "BEAM & ALL", "END & ALL"}
    assert set(mesh.members_of("END")) == {"BEAM & END & ALL", "END & ALL"}
    assert set(mesh.members_of("BEAM")) == {"BEAM & ALL", "BEAM & END & ALL"}


def test_no_lines(tmp_path):
    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n"
    with pytest.raises(MeshError, match=r"a\.inp: no lines; it has 1 S3 elements"):
        read_mesh(write(tmp_path / "a.inp", text))


# Universal files ----------------------------------------------------------------------------------------


def test_universal_file_names_points_by_their_numbers(tmp_path):
    mesh = Mesh.from_lines(POINTS, [[0, 1], [1, 2], [2, 3]], {"col": [0], "beam": [1, 2]})
    write_uff(tmp_path / "a.unv", mesh=mesh)
    back = read_mesh(tmp_path / "a.unv")
    assert members(back) == {"col": [0], "beam": [1, 2]}
    assert dict(back.point_names) == {"1": 0, "2": 1, "3": 2, "4": 3}


def test_universal_file_without_lines(tmp_path):
    (tmp_path / "a.unv").write_bytes(
        b"    -1\n    15\n" + b"         1" + b"         0" * 3 + b"  0.0" * 3 + b"\n    -1\n"
    )
    with pytest.raises(MeshError, match=r"a\.unv: no lines"):
        read_mesh(tmp_path / "a.unv")


def test_a_number_and_a_dimension_in_a_row_name_cells_too():
    """A damaged VTK file gave field data of shape (1, 2)."""
    found = SimpleNamespace(field_data={"legs": np.array([[3, 1]]), "odd": np.array([np.nan, 1.0])})
    named = _by_number(found, "gmsh:physical", np.array([3, 3, 4]))
    assert [(name, rows.tolist()) for name, rows in named] == [("legs", [0, 1]), ("physical 4", [2])]
