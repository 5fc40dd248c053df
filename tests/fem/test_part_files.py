"""Matrices of parts in the files of other programs, against the matrices that the files were made from."""

import struct
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from fem import Matrices, assemble
from fem.io import MatricesError, matrices_of, read_matrices, read_node_sets
from tests.fem.test_io_matrices import beam

BEAM = matrices_of(assemble(beam(3)))
NODE = BEAM.node + 11
"""Node numbers of the files; a beam along x, and numbers from 1."""
GRIDS = dict(zip((BEAM.nodes + 11).tolist(), BEAM.points.tolist(), strict=True))


def same(found: Matrices, digits: float = 1e-12) -> None:
    """Check a part against the beam, whatever the order of its rows."""
    order = [
        found.labels.index(f"{p}{label.lstrip('0123456789')}")
        for p, label in zip(NODE, BEAM.labels, strict=True)
    ]
    for key in "KM":
        X, Y = getattr(found, key).toarray()[np.ix_(order, order)], getattr(BEAM, key).toarray()
        np.testing.assert_allclose(X, Y, rtol=0, atol=digits * abs(Y).max())
    assert found.n == BEAM.n
    at = [found.nodes.tolist().index(p) for p in GRIDS]
    np.testing.assert_allclose(found.points[at], list(GRIDS.values()), atol=1e-7)
    R = found.rigid_motions()  # places and rows fit
    assert abs(found.K @ R).max() < 1e-6 * abs(found.K).max()


# Nastran ----------------------------------------------------------------------------------------------------


def dmig(name, X, layout="large", form=6, imaginary=0.0):
    """Return the cards of a matrix with all its entries that are not zero."""
    kind = 4 if imaginary else 2
    lines = [f"DMIG,{name},0,{form},{kind},0,,,{X.shape[0]}"]
    for j in range(X.shape[0]):
        cells = [name, NODE[j], BEAM.direction[j], ""]
        for i in np.flatnonzero(X[:, j]):
            cells += [NODE[i], BEAM.direction[i], X[i, j], imaginary * X[i, j] if imaginary else ""]
        lines += card(cells, layout)
    return lines


def card(cells, layout):
    each = 4 if layout == "large" else 8
    rows = [cells[k : k + each] for k in range(0, len(cells), each)]
    if layout == "free":
        return [
            ",".join(
                ["DMIG" if k == 0 else "", *(repr(float(c)) if isinstance(c, float) else str(c) for c in row)]
            )
            for k, row in enumerate(rows)
        ]
    width = 16 if layout == "large" else 8

    def cell(c):
        if not isinstance(c, float):
            return f"{c!s:>{width}}"
        return f"{c:16.9E}" if layout == "large" else f"{c:8.1E}".replace("E", "").rjust(8)

    head = "DMIG*" if layout == "large" else "DMIG"
    return [
        f"{head if k == 0 else ('*' if layout == 'large' else '')!s:<8}{''.join(map(cell, row))}"
        for k, row in enumerate(rows)
    ]


def grid_cards():
    return [f"GRID,{p},,{x!r},{y!r},{z!r}" for p, (x, y, z) in GRIDS.items()]


def test_names_of_cards_in_large_field_are_padded(tmp_path):
    """The assembly punch file of an external superelement has ``GRID   *`` and ``CORD2R *``."""
    grids = [
        f"{'GRID   *'}{p:<16d}{5:<16d}{x:<16.9f}{y:<16.9f}\n*       {z:<16.9f}"
        for p, (x, y, z) in GRIDS.items()
    ]
    system = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    cells = "".join(f"{v:<16.1f}" for v in system[:2])
    rest = ["*       " + "".join(f"{v:<16.1f}" for v in system[k : k + 4]) for k in (2, 6)]
    text = ["BEGIN SUPER     111     ", f"CORD2R *{5:<16d}{0:<16d}{cells}", *rest, *grids]
    (tmp_path / "part.pch").write_text("\n".join(text) + "\n")
    lines = [*op4_text("KGG", BEAM.K.toarray(), None), *op4_text("MGG", BEAM.M.toarray(), None)]
    (tmp_path / "part.op4").write_text("\n".join(lines) + "\n")
    same(read_matrices(tmp_path / "part.op4"), 1e-15)


@pytest.mark.parametrize(("layout", "digits"), [("large", 1e-9), ("free", 1e-15)])
@pytest.mark.parametrize("form", [1, 6])
def test_dmig_cards_in_each_field_and_form(tmp_path, layout, digits, form):
    K, M = BEAM.K.toarray(), BEAM.M.toarray()
    K, M = (K, M) if form == 1 else (np.tril(K), np.triu(M))  # either triangle
    lines = ["$ PUNCH", *dmig("KAAX", K, layout, 1), *dmig("MAAX", M, layout, 1), *grid_cards()]
    text = "\n".join(lines).replace("AAX,0,1,", f"AAX,0,{form},") + "\n"
    (tmp_path / "part.pch").write_text(text)
    same(read_matrices(tmp_path / "part.pch"), digits)


def test_small_fields_and_places_of_a_deck(tmp_path):
    K, M = (
        np.where(X == 0, 0, np.sign(X) * 2.0 ** np.round(np.log2(abs(X) + 1e-300)))
        for X in (BEAM.K.toarray(), BEAM.M.toarray())
    )
    lines = [*dmig("K2GG", K, "small", 1), *dmig("M2GG", M, "small", 1)]
    (tmp_path / "part.pch").write_text("\n".join(lines) + "\n")
    (tmp_path / "other.bdf").write_text("\n".join(["BEGIN BULK", *grid_cards(), "ENDDATA"]) + "\n")
    found = read_matrices(tmp_path / "part.pch", deck=tmp_path / "other.bdf")
    # two digits are written
    order = [
        found.labels.index(f"{p}{x.lstrip('0123456789')}") for p, x in zip(NODE, BEAM.labels, strict=True)
    ]
    np.testing.assert_allclose(found.K.toarray()[np.ix_(order, order)], K, rtol=0.05)
    assert found.points.shape == (4, 3)


def test_the_imaginary_part_of_a_stiffness_is_structural_damping(tmp_path):
    K, M = BEAM.K.toarray(), BEAM.M.toarray()
    lines = [*dmig("KAAX", K, "free", 1, imaginary=0.04), *dmig("MAAX", M, "free", 1), *grid_cards()]
    (tmp_path / "part.pch").write_text("\n".join(lines) + "\n")
    found = read_matrices(tmp_path / "part.pch")
    np.testing.assert_allclose(found.D.toarray(), 0.04 * found.K.toarray(), rtol=1e-12)
    same(found)


def test_displacement_axes_of_grid_points_are_turned_back(tmp_path):
    """Node 12 has cylindrical axes about a line beside it; its directions are then r, around, z."""
    x, y, _ = GRIDS[12]
    centre = np.array([x - 0.3, y - 0.4, 0.0])
    radial, around = np.array([0.6, 0.8, 0]), np.array([-0.8, 0.6, 0])
    R = np.stack([radial, around, [0, 0, 1.0]])
    part = Matrices.from_arrays(BEAM.K, BEAM.M, NODE, BEAM.direction, list(GRIDS), list(GRIDS.values()))
    local = part.turned({12: R})
    a, b, c = centre, np.add(centre, [0, 0, 1]), np.add(centre, [1, 0, 0])
    grids = [line + (",5" if line.startswith("GRID,12,") else "") for line in grid_cards()]
    system = (
        "CORD2C,5,,"
        + ",".join(repr(float(v)) for v in (*a, *b))
        + "\n,"
        + ",".join(repr(float(v)) for v in c)
    )
    lines = [
        *dmig("KAAX", local.K.toarray(), "free", 1),
        *dmig("MAAX", local.M.toarray(), "free", 1),
        *grids,
        system,
    ]
    (tmp_path / "part.pch").write_text("\n".join(lines) + "\n")
    same(read_matrices(tmp_path / "part.pch"))


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ("DMIG,KAAX,0,9,2,0,,,3", "line 1: DMIG KAAX: form 9, type 2, polar 0; read are forms 1 and 6"),
        ("DMIG,KAAX,1,1,,1,1,2.0", "line 1: DMIG KAAX: its column comes before its header"),
        (
            "DMIG,KAAX,0,6,2,0,,,3\nDMIG,KAAX,1,1,,1,1,two",
            "line 2: DMIG KAAX: 'TWO' is not a number|'two' is not",
        ),
        ("DMIG,KAAX,0,6,2,0,,,3\nDMIG,KAAX,1,1,,1,1,2.0\n,1,1,3.0", "DMIG KAAX has an entry twice"),
        ("DMIG,KAAX,0,6,2,0,,,3\nDMIG,KAAX,1,1,,1,1,2.0", "there is no mass matrix M; it has K"),
    ],
)
def test_dmig_cards_that_cannot_be_read_are_named(tmp_path, card, words):
    (tmp_path / "part.pch").write_text(card + "\n")
    with pytest.raises(MatricesError, match=words):
        read_matrices(tmp_path / "part.pch")


def op4_text(name, X, bigmat, form="1P,3E23.16"):
    n = X.shape[0]
    lines = [f"{n:8d}{-n if bigmat else n:8d}{6:8d}{2:8d}{name:8s}{form}"]
    for j in range(n):
        rows = np.flatnonzero(X[:, j])
        if not rows.size:
            continue
        if bigmat is None:
            lines += [f"{j + 1:8d}{rows[0] + 1:8d}{rows[-1] - rows[0] + 1:8d}"]
            lines += numbers(X[rows[0] : rows[-1] + 1, j])
            continue
        strings = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        words = sum(2 * s.size + (2 if bigmat else 1) for s in strings)
        lines.append(f"{j + 1:8d}{0:8d}{words:8d}")
        for s in strings:
            lines.append(
                f"{2 * s.size + 1:8d}{s[0] + 1:8d}" if bigmat else f"{65536 * (2 * s.size + 1) + s[0] + 1:8d}"
            )
            lines += numbers(X[s, j])
    return [*lines, f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:23.16E}"]


def numbers(values):
    return ["".join(f"{v:23.16E}" for v in values[k : k + 3]) for k in range(0, len(values), 3)]


def op4_binary(name, X, bigmat, order, kind):
    n, real, each = X.shape[0], "f" if kind == 1 else "d", 1 if kind == 1 else 2
    out = [struct.pack(f"{order}4i8s", n, -n if bigmat else n, 6, kind, name.encode().ljust(8))]
    for j in range(n):
        rows = np.flatnonzero(X[:, j])
        if not rows.size:
            continue
        if bigmat is None:
            body = struct.pack(f"{order}{rows[-1] - rows[0] + 1}{real}", *X[rows[0] : rows[-1] + 1, j])
        else:
            body = b""
            for s in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
                size = each * s.size
                mark = (size + 1, s[0] + 1) if bigmat else (65536 * (size + 1) + s[0] + 1,)
                body += struct.pack(f"{order}{len(mark)}i{s.size}{real}", *mark, *X[s, j])
        out.append(
            struct.pack(f"{order}3i", j + 1, rows[0] + 1 if bigmat is None else 0, len(body) // 4) + body
        )
    out.append(struct.pack(f"{order}3id", n + 1, 1, 2, 1.0))
    return b"".join(struct.pack(f"{order}i", len(r)) + r + struct.pack(f"{order}i", len(r)) for r in out)


LAYOUTS = [None, False, True]
"""Dense; sparse; sparse with BIGMAT."""


@pytest.mark.parametrize("bigmat", LAYOUTS)
def test_output4_in_text_with_the_grid_points_of_a_deck(tmp_path, bigmat):
    lines = [*op4_text("KGG", BEAM.K.toarray(), bigmat), *op4_text("MGG", BEAM.M.toarray(), bigmat)]
    (tmp_path / "part.op4").write_text("\n".join(lines) + "\n")
    (tmp_path / "part.bdf").write_text("\n".join(grid_cards()) + "\n")
    same(read_matrices(tmp_path / "part.op4"), 1e-15)
    (tmp_path / "part.op4").write_text("\n".join(lines[: len(lines) * 3 // 4]) + "\n")
    with pytest.raises(MatricesError, match=r"part\.op4, line \d+: "):
        read_matrices(tmp_path / "part.op4")


@pytest.mark.parametrize("bigmat", LAYOUTS)
def test_output4_with_wide_counts_in_the_heading_alone(tmp_path, bigmat):
    """MSC Nastran writes counts of columns and rows in 16 columns each, and |I16, where eight do not do."""
    lines: list[str] = []
    for name, X in (("KGG", BEAM.K), ("MGG", BEAM.M)):
        heading, *rest = op4_text(name, X.toarray(), bigmat)
        columns, rows, kind = heading[:8], heading[8:16], heading[16:]
        lines += [f"{columns:>16}{rows:>16}{kind}|I16", *rest]
    (tmp_path / "part.op4").write_text("\n".join(lines) + "\n")
    (tmp_path / "part.bdf").write_text("\n".join(grid_cards()) + "\n")
    same(read_matrices(tmp_path / "part.op4"), 1e-15)


@pytest.mark.parametrize("bigmat", LAYOUTS)
@pytest.mark.parametrize(("order", "kind"), [("<", 2), (">", 2), ("<", 1), (">", 1)])
def test_output4_in_binary(tmp_path, bigmat, order, kind):
    data = b"".join(
        op4_binary(n, X.toarray(), bigmat, order, kind) for n, X in (("KAAX", BEAM.K), ("MAAX", BEAM.M))
    )
    (tmp_path / "part.op4").write_bytes(data)
    aset = ",".join(["ASET1", "123456", *map(str, GRIDS)])
    (tmp_path / "part.asm").write_text("\n".join([*grid_cards(), "GRID,99,,9.,9.,9.", aset]) + "\n")
    same(read_matrices(tmp_path / "part.op4"), 1e-15 if kind == 2 else 1e-7)
    (tmp_path / "part.op4").write_bytes(data[:-20])
    with pytest.raises(
        MatricesError, match=r"byte \d+: a record of \d+ bytes does not end|the file ends within"
    ):
        read_matrices(tmp_path / "part.op4")


def test_output4_without_rows_is_refused_with_advice(tmp_path):
    lines = [*op4_text("KGG", BEAM.K.toarray(), None), *op4_text("MGG", BEAM.M.toarray(), None)]
    (tmp_path / "part.op4").write_text("\n".join(lines) + "\n")
    with pytest.raises(MatricesError, match=r"write part\.dofs\.csv next to it"):
        read_matrices(tmp_path / "part.op4")
    (tmp_path / "part.bdf").write_text("\n".join(grid_cards()[:2]) + "\n")
    with pytest.raises(
        MatricesError, match=r"have 24 rows, and the cards EXTRN, ASET and GRID of part\.bdf say 12; "
    ):
        read_matrices(tmp_path / "part.op4")


def test_modes_with_the_interface_held_are_coordinates_of_a_part(tmp_path):
    """A part that was reduced elsewhere: scalar points have no place, and are zero in rigid motions."""
    n = BEAM.n
    extra = sp.block_diag([BEAM.K, sp.diags_array([4e6, 9e6])]).toarray()
    mass = sp.block_diag([BEAM.M, sp.eye_array(2)]).toarray()
    mass[:3, n:], mass[n:, :3] = 0.1, 0.1
    lines = [*op4_text("KXX", extra, True), *op4_text("MXX", mass, True)]
    (tmp_path / "part.op4").write_text("\n".join(lines) + "\n")
    extrn = "".join(f",{p},123456" for p in GRIDS)
    (tmp_path / "part.pch").write_text(
        "\n".join(["BEGIN SUPER 7", f"EXTRN{extrn}", ",901,0,902,0", *grid_cards()]) + "\n"
    )
    found = read_matrices(tmp_path / "part.op4", "mm-t-s")
    assert found.direction[-2:].tolist() == [0, 0]
    assert not found.rigid_motions()[-2:].any()
    # an amplitude is a number: its energy of 4e6 t mm²/s² is 4 J
    np.testing.assert_allclose(found.K.diagonal()[-2:], [4e6 * 1e-3, 9e6 * 1e-3], rtol=1e-12)


# Abaqus, ANSYS, MATLAB --------------------------------------------------------------------------------------


def write_inp(folder, name):
    rows = [f"{p}, {x!r}, {y!r}, {z!r}" for p, (x, y, z) in GRIDS.items()]
    (folder / name).write_text("\n".join(["*NODE", *rows]) + "\n")


@pytest.mark.parametrize("triangle", [np.tril, np.triu, np.asarray])
def test_entries_of_abaqus_with_labels(tmp_path, triangle):
    for word, X in (("STIF", BEAM.K), ("MASS", BEAM.M)):
        Y = triangle(X.toarray())
        rows = [
            f"{NODE[i]},{BEAM.direction[i]}, {NODE[j]},{BEAM.direction[j]}, {Y[i, j]:.15e}"
            for i, j in np.argwhere(Y)
        ]
        if word == "STIF":  # node 99 is held
            rows.append("99,1, 99,1, 1.000000000000000e+36")
        (tmp_path / f"job_{word}2.mtx").write_text("\n".join(rows) + "\n")
    write_inp(tmp_path, "job.inp")
    same(read_matrices(tmp_path / "job_STIF2.mtx"))
    same(read_matrices(tmp_path / "job.mtx"))
    (tmp_path / "job_MASS2.mtx").write_text("11,1, 11,1, 2.0\n-4,1, -4,1, 1.0\n")
    with pytest.raises(MatricesError, match=r"job_MASS2\.mtx: an entry of -4, 1, -4, 1: nodes count from 1"):
        read_matrices(tmp_path / "job.mtx")
    (tmp_path / "job_MASS2.mtx").write_text("11,1, 11,1, 2.0\n11,1, 11,x, 1.0\n")
    with pytest.raises(
        MatricesError, match=r"job_MASS2\.mtx, line 2: '11 1  11 x  1.0' is found where 5 numbers"
    ):
        read_matrices(tmp_path / "job.mtx")


def write_coordinates(folder, K, M):
    for word, X in (("STIF", K), ("MASS", M)):
        Y = sp.coo_array(X)
        rows = [f"{i + 1} {j + 1}  {v:.15e}" for i, j, v in zip(*Y.coords, Y.data, strict=True)]
        (folder / f"job_{word}1.mtx").write_text("\n".join(rows) + "\n")


def test_coordinates_of_abaqus_need_a_table(tmp_path):
    write_coordinates(tmp_path, BEAM.K, BEAM.M)
    with pytest.raises(MatricesError, match=r"write job_STIF1\.dofs\.csv next to it"):
        read_matrices(tmp_path / "job_STIF1.mtx")
    labels = [f"{p}{x.lstrip('0123456789')}" for p, x in zip(NODE, BEAM.labels, strict=True)]
    places = {"nodes": list(GRIDS), "points": list(GRIDS.values())}
    same(read_matrices(tmp_path / "job.mtx", labels=labels, **places))


CAE = """*Heading
*Part, name=bar
*End Part
*Assembly, name=Assembly
*Instance, name=bar-1, part=bar
*Node
{nodes}
*Nset, nset=ENDS
{ends}
*End Instance
*End Assembly
"""
"""A deck as Abaqus/CAE writes it for an orphan mesh: the nodes are in the only instance."""


def by_nodes():
    """Return the rows of BEAM by node, rising, and by direction."""
    return np.lexsort((BEAM.direction, NODE))


@pytest.mark.parametrize("flat", [True, False])
def test_coordinates_of_abaqus_are_in_the_order_of_the_nodes(tmp_path, flat):
    order = by_nodes()
    write_coordinates(tmp_path, BEAM.K[order][:, order], BEAM.M[order][:, order])
    rows = [f"{p}, {x!r}, {y!r}, {z!r}" for p, (x, y, z) in reversed(GRIDS.items())]
    ends = ", ".join(map(str, list(GRIDS)[:2]))
    deck = CAE.format(nodes="\n".join(rows), ends=ends)
    (tmp_path / "job.inp").write_text(
        "\n".join(["*NODE", *rows, "*NSET, NSET=ENDS", ends, ""]) if flat else deck
    )
    same(read_matrices(tmp_path / "job_STIF1.mtx"))
    assert set(read_node_sets(tmp_path / "job.inp")["ENDS"]) == set(list(GRIDS)[:2])


def test_coordinates_of_abaqus_in_another_order_need_a_table(tmp_path):
    order = by_nodes()[::-1]
    write_coordinates(tmp_path, BEAM.K[order][:, order], BEAM.M[order][:, order])
    write_inp(tmp_path, "job.inp")
    with pytest.raises(MatricesError, match=r"write job_STIF1\.dofs\.csv next to it"):
        read_matrices(tmp_path / "job_STIF1.mtx")


def test_internal_nodes_of_abaqus_are_named(tmp_path):
    """Elements such as B33 have nodes without a number, whose entries may come first."""
    (tmp_path / "job_STIF1.mtx").write_text("-1,1, -1,1,  2.0e+07\n1,1, -1,1, -1.0e+07\n")
    (tmp_path / "job_MASS1.mtx").write_text("-1,1, -1,1,  6.0\n1,1, -1,1, 3.0\n")
    with pytest.raises(MatricesError, match=r"job_MASS1\.mtx: an entry of -1, 1, -1, 1: nodes count from 1"):
        read_matrices(tmp_path / "job_STIF1.mtx")


def test_a_single_matrix_of_abaqus_is_not_enough(tmp_path):
    (tmp_path / "jobSTIF1.mtx").write_text("1 1  2.0e+07\n")
    with pytest.raises(
        MatricesError, match=r"jobSTIF1\.mtx: it is one matrix of \*MATRIX OUTPUT; K and M are"
    ):
        read_matrices(tmp_path / "jobSTIF1.mtx")


def test_a_substructure_of_abaqus(tmp_path):
    """Node 11 has all six directions; the list says the others' only where they change."""
    lines = [
        "** GENERATION OF SUBSTRUCTURE",
        "*USER ELEMENT, NODES=4, LINEAR",
        "** ELEMENT NODES",
        "** 11, 12,",
        "** 13, 14",
        "1, 2, 3, 4, 5, 6",
    ]
    for word, X in (("STIFFNESS", BEAM.K), ("MASS", BEAM.M)):
        values = X.toarray()[np.tril_indices(BEAM.n)]
        lines += [
            f"*MATRIX,TYPE={word}",
            *(", ".join(f"{v:.14e}" for v in values[k : k + 4]) + "," for k in range(0, values.size, 4)),
        ]
    (tmp_path / "sub.mtx").write_text("\n".join(lines) + "\n")
    write_inp(tmp_path, "sub.inp")
    same(read_matrices(tmp_path / "sub.mtx"))
    (tmp_path / "sub.mtx").write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(
        MatricesError, match=r"line \d+: M has 296 entries; the lower triangle of 24 rows has 300"
    ):
        read_matrices(tmp_path / "sub.mtx")


def harwell(X, per_line=3):
    lower = sp.csc_array(sp.tril(X))
    parts = [[f"{v + 1:10d}" for v in index] for index in (lower.indptr, lower.indices)]
    parts.append([f"{v:25.16E}".replace("E", "D") for v in lower.data])
    blocks = [["".join(p[k : k + per_line]) for k in range(0, len(p), per_line)] for p in parts]
    counts = [len(b) for b in blocks]
    return [
        "Stiffness matrix",
        "".join(f"{c:14d}" for c in (sum(counts), *counts, 0)),
        f"RSA{'':11}{X.shape[0]:14d}{X.shape[0]:14d}{lower.nnz:14d}{0:14d}",
        f"({per_line}I10)        ({per_line}I10)        ({per_line}D25.16)",
        *(line for b in blocks for line in b),
    ]


def test_harwell_boeing_with_the_equations_of_ansys(tmp_path):
    for key in "KM":
        (tmp_path / f"part.{key}.matrix").write_text("\n".join(harwell(getattr(BEAM, key))) + "\n")
    labels = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
    rows = [f"{k + 1:12d}{NODE[k]:10d}        {labels[BEAM.direction[k] - 1]}" for k in range(BEAM.n)]
    (tmp_path / "part.K.mapping").write_text("\n".join(["   Matrix Eqn    Node       DOF", *rows]) + "\n")
    rows = [f"{p}, {x!r}, {y!r}, {z!r}" for p, (x, y, z) in GRIDS.items()]
    (tmp_path / "part.nodes.csv").write_text("\n".join(["node,x,y,z", *rows]) + "\n")
    same(read_matrices(tmp_path / "part.matrix"))
    same(read_matrices(tmp_path / "part.K.matrix"))
    text = (tmp_path / "part.K.mapping").read_text().replace("ROTX", "TEMP", 1)
    (tmp_path / "part.K.mapping").write_text(text)
    with pytest.raises(
        MatricesError, match=r"part\.K\.mapping, line 5: .*TEMP': equation, node and one of UX"
    ):
        read_matrices(tmp_path / "part.matrix")


def test_a_matlab_file(tmp_path):
    table = np.column_stack([NODE, BEAM.direction])
    nodes = np.column_stack([list(GRIDS), list(GRIDS.values())])
    scipy.io.savemat(
        tmp_path / "part.mat",
        {"K": sp.csc_array(BEAM.K), "M": BEAM.M.toarray(), "dofs": table, "nodes": nodes},
    )
    same(read_matrices(tmp_path / "part.mat"), 1e-15)
    scipy.io.savemat(
        tmp_path / "part.mat", {"K": BEAM.K.toarray(), "M": BEAM.M.toarray(), "dofs": table.T, "nodes": nodes}
    )
    with pytest.raises(
        MatricesError, match=r"part\.mat: 'dofs' has the shape \(2, 24\); \(n, 2\) is expected: node, d"
    ):
        read_matrices(tmp_path / "part.mat")
    scipy.io.savemat(tmp_path / "part.mat", {"K": BEAM.K.toarray(), "M": BEAM.M.toarray()})
    with pytest.raises(MatricesError, match=r"write part\.dofs\.csv next to it"):
        read_matrices(tmp_path / "part.mat")


def test_a_matrix_that_is_not_symmetric_is_refused(tmp_path):
    K = BEAM.K.toarray()
    K[3, 9] += 0.01 * K.max()
    table = np.column_stack([NODE, BEAM.direction])
    scipy.io.savemat(tmp_path / "part.mat", {"K": K, "M": BEAM.M.toarray(), "dofs": table})
    with pytest.raises(MatricesError, match=r"part\.mat: K is not symmetric: the entries \("):
        read_matrices(tmp_path / "part.mat")


def test_a_deck_of_another_kind_is_refused(tmp_path):
    scipy.io.savemat(tmp_path / "part.mat", {"K": BEAM.K.toarray(), "M": BEAM.M.toarray()})
    with pytest.raises(
        MatricesError, match=r"places of nodes are read from \.csv and from \.bdf, .* not '\.vtu'"
    ):
        read_matrices(tmp_path / "part.mat", deck=Path("part.vtu"))
