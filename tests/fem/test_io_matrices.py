"""Matrices for and from other programs."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg as sla
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import Damping, Matrices, assemble, solve_modes
from fem.io import MatricesError, matrices_of, read_calculix, read_matrices, read_node_sets, write_matrices
from fem.matrices import UNITS
from tests.frames import beam, cross_beam, fix, portal

BRICK = Path(__file__).parents[1] / "data" / "bracket"


def dense(X):
    return None if X is None else X.toarray()


def assert_same(a, b):
    for key in "KMCDQ":
        x, y = dense(getattr(a, key)), dense(getattr(b, key))
        assert (x is None) == (y is None), key
        if x is not None:
            np.testing.assert_array_equal(x, y, err_msg=key)
    assert a.labels == b.labels
    known = {int(n): p.tolist() for n, p in zip(a.nodes, a.points, strict=True)}
    assert known == {int(n): p.tolist() for n, p in zip(b.nodes, b.points, strict=True)}


@pytest.mark.parametrize("name", ["frame.npz", "frame.mtx"])
@pytest.mark.parametrize("model", [cross_beam(0.2, C=0.1 * np.eye(6)), portal(0.2)], ids=["cross", "portal"])
def test_a_system_comes_back_exactly(tmp_path, name, model):
    matrices = matrices_of(assemble(model))
    files = write_matrices(tmp_path / name, assemble(model), title="a frame")
    assert sorted(p.name for p in files) == sorted(p.name for p in tmp_path.iterdir())
    assert_same(read_matrices(tmp_path / name), matrices)


@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 7),
    exponent=st.integers(-12, 12),
    suffix=st.sampled_from(["npz", "mtx"]),
)
@settings(max_examples=25, deadline=None)
def test_any_matrices_come_back_exactly(tmp_path_factory, seed, n, exponent, suffix):
    rng = np.random.default_rng(seed)
    K, M, C = (
        10.0**exponent * (X + X.T) * (rng.random((n, n)) > 0.3) for X in rng.standard_normal((3, n, n))
    )
    K, M, C = (np.tril(X) + np.tril(X, -1).T for X in (K, M, C))
    nodes = rng.choice(1000, n, replace=False)
    a = Matrices.from_arrays(K, M, nodes, rng.integers(1, 7, n), nodes, rng.standard_normal((n, 3)), C=C)
    path = tmp_path_factory.mktemp("m") / f"any.{suffix}"
    write_matrices(path, a)
    assert_same(read_matrices(path), a)


def test_another_reader_sees_a_symmetric_matrix_with_a_comment(tmp_path):
    model = cross_beam(0.2)
    system = assemble(model)
    write_matrices(tmp_path / "frame.mtx", system, title="cross beam")
    head = (tmp_path / "frame.K.mtx").read_text().splitlines()[:3]
    assert head[0] == "%%MatrixMarket matrix coordinate real symmetric"
    assert "stiffness" in head[1]
    assert "cross beam" in head[1]
    assert "frame.dofs.csv" in head[2]
    assert scipy.io.mminfo(tmp_path / "frame.K.mtx")[-1] == "symmetric"
    K = scipy.io.mmread(tmp_path / "frame.K.mtx", spmatrix=False).toarray()
    np.testing.assert_allclose(K, system.K.toarray(), rtol=1e-15, atol=1e-15 * abs(K).max())
    table = (tmp_path / "frame.dofs.csv").read_text().splitlines()
    assert table[0] == "row,label,node,direction,x_m,y_m,z_m"
    assert table[6 * 4 + 3] == "27,4Z+,4,3,0.0,0.0,0.01".replace("27", str(6 * 4 + 3))


def test_labels_are_those_of_frfs_and_damping_is_that_of_the_structure():
    model = cross_beam(0.2, C=0.1 * np.eye(6)).with_damping(Damping(alpha=3.0, beta=1e-5, loss_factor=0.01))
    system = assemble(model)
    a = matrices_of(system)
    assert a.labels[:7] == ("0X+", "0Y+", "0Z+", "0RX+", "0RY+", "0RZ+", "1X+")
    omega = 321.0
    Z = a.K + 1j * a.D + 1j * omega * a.C - omega**2 * a.M
    expected = system.dynamic_stiffness(omega)
    assert abs(Z - expected).max() <= 1e-13 * abs(expected).max()


def test_constraints_leave_coordinates_whose_meaning_q_says():
    model = beam(4, effects=(fix(0), fix(1, ("x", "z"))))
    held, whole = matrices_of(assemble(model)), matrices_of(assemble(model), constrained=False)
    assert "0X+" not in held.labels
    assert "1X+" not in held.labels
    assert "1Y+" in held.labels
    assert whole.labels[0] == "0X+"
    assert whole.n == model.n_dof
    np.testing.assert_allclose(
        (held.Q.T @ whole.K @ held.Q).toarray(), held.K.toarray(), rtol=1e-12, atol=1e-3
    )
    tied = matrices_of(assemble(portal(0.5)))
    assert any(label.startswith("q") for label in tied.labels)
    assert whole.Q is None


def test_what_matrices_cannot_say_is_said():
    model = cross_beam(0.2).with_damping(Damping.modal(0.01))
    with pytest.warns(UserWarning, match="modal damping ratios have no matrix"):
        matrices_of(assemble(model))


def test_other_programs_find_the_same_frequencies(tmp_path):
    """SciPy's dense solver on what was written, against our own: both exact but for rounding."""
    model = beam(6, effects=(fix(0),))
    system = assemble(model)
    write_matrices(tmp_path / "b.mtx", system)
    K, M = (scipy.io.mmread(tmp_path / f"b.{key}.mtx", spmatrix=False).toarray() for key in "KM")
    frequency = np.sqrt(sla.eigh(K, M, eigvals_only=True)[:4]) / (2 * np.pi)
    np.testing.assert_allclose(frequency, solve_modes(system, n=4).frequency, rtol=1e-8)


# CalculiX ---------------------------------------------------------------------------------------------------


def test_calculix_brick():
    a = read_calculix(BRICK / "brick.sti", units="mm-t-s")
    assert a.n == 48
    assert a.labels[:4] == ("1X+", "1Y+", "1Z+", "2X+")
    np.testing.assert_allclose(np.ptp(a.points, axis=0), [0.03, 0.02, 0.01], rtol=1e-15)
    R = a.rigid_motions(about=[0.015, 0.01, 0.005])
    mass = 2700.0 * 0.03 * 0.02 * 0.01
    inertia = mass / 12 * np.array([0.02**2 + 0.01**2, 0.03**2 + 0.01**2, 0.03**2 + 0.02**2])
    G = R.T @ (a.M @ R)
    # trilinear elements follow rigid motions exactly, and the files have 14 digits
    np.testing.assert_allclose(np.diag(G)[:3], mass, rtol=1e-12)
    np.testing.assert_allclose(np.diag(G)[3:], inertia, rtol=1e-12)
    # the cancellation of forces keeps 14 digits of the largest entry
    assert abs(a.K @ R).max() <= 1e-12 * abs(a.K).max()
    assert read_node_sets(BRICK / "brick.inp")["BOTTOM"] == (1, 2, 3, 4, 9, 10, 13, 14)
    same = read_matrices(BRICK / "brick.sti", units=(1e-3, 1e3, 1.0))
    assert_same(same, a)


@pytest.mark.parametrize(
    ("ending", "change", "message"),
    [
        ("dof", lambda text: text.replace("1.3", "1,3", 1), "line 3 is '1,3'; node and direction"),
        ("dof", lambda text: text.replace("1.3", "1.2", 1), "1Y\\+ comes twice"),
        ("sti", lambda text: text + "7\n", "row, column and value are expected"),
        ("sti", lambda text: re.sub(r"(?m)^ *5 +5 .*\n", "", text), "no diagonal entry of row 5, 1 missing"),
        ("sti", lambda text: text.rstrip()[:-1], "fewer digits in its exponent"),
        ("mas", lambda text: text.rstrip()[:-6], "may be cut"),
        ("mas", lambda text: text + "49 1 1.0\n", "row 49 and column 1; the .dof file has 48 rows"),
    ],
)
def test_damaged_calculix_files_are_refused(tmp_path, ending, change, message):
    for part in ("inp", "sti", "mas", "dof"):
        text = (BRICK / f"brick.{part}").read_text()
        (tmp_path / f"brick.{part}").write_text(change(text) if part == ending else text)
    with pytest.raises(MatricesError, match=message):
        read_calculix(tmp_path / "brick.sti")


def write_calculix(folder, K, dofs):
    """Write a brick's files with another stiffness: one triangle, and node.direction of the rows."""
    upper = sp.coo_array(sp.triu(K))
    entries = zip(*upper.coords, upper.data, strict=True)
    (folder / "brick.sti").write_text("".join(f"{i + 1} {j + 1} {v:.14e}\n" for i, j, v in entries))
    (folder / "brick.dof").write_text("".join(f"{dof}\n" for dof in dofs))
    for part in ("inp", "mas"):
        (folder / f"brick.{part}").write_text((BRICK / f"brick.{part}").read_text())


def test_incompatible_modes_of_calculix_are_coordinates_of_a_part(tmp_path):
    """C3D8I: the modes have nodes that the deck lacks, no mass, and rest in rigid-body motions."""
    brick = read_calculix(BRICK / "brick.sti")
    dofs = [f"{p}.{d}" for p, d in zip(brick.node, brick.direction, strict=True)]
    G = np.random.default_rng(0).standard_normal((brick.n, 3)) / 10
    KG = brick.K @ G  # forces of the modes balance: RᵀKG = 0
    inner = G.T @ KG + np.diag(np.full(3, 0.1 * brick.K.max()))
    K = sp.csr_array(sp.block_array([[brick.K, KG], [KG.T, inner]]))
    write_calculix(tmp_path, K, [*dofs, "900.1", "900.2", "900.3"])
    found = read_calculix(tmp_path / "brick.sti")
    assert found.labels[:48] == brick.labels
    assert found.labels[48:] == ("q48", "q49", "q50")
    assert abs(found.K @ found.rigid_motions()).max() < 1e-12 * abs(K).max()


def test_nodes_that_calculix_adds_to_a_deck_stay_nodes(tmp_path):
    """Beams and shells become solid: without the places of their nodes no motion of the part is rigid."""
    brick = read_calculix(BRICK / "brick.sti")
    dofs = [f"{p if p < 9 else p + 900}.{d}" for p, d in zip(brick.node, brick.direction, strict=True)]
    write_calculix(tmp_path, brick.K, dofs)
    found = read_calculix(tmp_path / "brick.sti")
    assert found.direction.min() == 1
    with pytest.raises(MatricesError, match="the place of node 909 is not known"):
        found.rigid_motions()


def test_a_missing_calculix_file_is_named(tmp_path):
    with pytest.raises(MatricesError, match=r"SOLVER=MATRIXSTORAGE"):
        read_calculix(tmp_path / "nothing.sti")


# Units and places -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("units", [u for u in UNITS if u != "SI"])
def test_units_keep_frequencies_and_energies(units):
    """Matrices written in other units and scaled back are the same; done by hand from definitions."""
    a = matrices_of(assemble(beam(3, 0.5)))
    length, mass, time = UNITS[units]
    turned = a.direction > 3
    # each entry is force by motion: N/m, N or N·m for K; a moment has one more length than a force
    lengths = turned[:, None].astype(float) + turned[None]
    K = dense(a.K) / (mass / time**2 * length**lengths)
    M = dense(a.M) / (mass * length**lengths)
    other = Matrices.from_arrays(K, M, a.node, a.direction, a.nodes, a.points / length)
    back = other.scaled(units)
    for key in "KM":
        x, y = dense(getattr(a, key)), dense(getattr(back, key))
        np.testing.assert_allclose(y, x, rtol=1e-14, atol=0)
    np.testing.assert_allclose(back.points, a.points, rtol=1e-15)


def test_a_turned_part_is_the_part_in_its_new_place():
    angle = 0.7
    R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    a = matrices_of(assemble(beam(3, along=(1, 0, 0))))
    b = matrices_of(assemble(beam(3, along=R[:, 0])))
    turned = a.placed(R, [0.1, 0.2, 0.3])
    for key in "KM":
        x, y = dense(getattr(b, key)), dense(getattr(turned, key))
        np.testing.assert_allclose(y, x, atol=1e-13 * abs(x).max())
    np.testing.assert_allclose(turned.points, b.points + np.array([0.1, 0.2, 0.3]), atol=1e-15)


def test_minus_signs_in_labels_turn_rows(tmp_path):
    a = matrices_of(assemble(beam(2)))
    sign = np.where(np.arange(a.n) % 4 == 1, -1.0, 1.0)
    labels = [label[:-1] + ("-" if s < 0 else "+") for label, s in zip(a.labels, sign, strict=True)]
    np.savez(
        tmp_path / "m.npz",
        K=sign[:, None] * dense(a.K) * sign,
        M=sign[:, None] * dense(a.M) * sign,
        labels=labels,
        nodes=a.nodes,
        points=a.points,
    )
    assert_same(read_matrices(tmp_path / "m.npz"), a)


# Errors -----------------------------------------------------------------------------------------------------


def good(n=3):
    return {"K": np.eye(n), "M": np.eye(n), "labels": np.array(["1X+", "1Y+", "1Z+"])}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"K": None}, "there is no stiffness matrix K; it has M"),
        ({"labels": None}, "does not say the degrees of freedom"),
        ({"labels": np.array(["1X+", "1Y", "W7"])}, "the label of row 2 is 'W7'"),
        ({"labels": np.array(["1X+", "1Y"])}, r"K has shape \(3, 3\); \(2, 2\) is expected"),
        ({"labels": np.array(["1X+", "1Y+", "1X-"])}, r"1X\+ comes twice"),
        ({"M": np.diag([1, np.nan, 1])}, "M has 1 entries that are not finite"),
        ({"K": np.array([[1, 2, 0], [2.001, 1, 0], [0, 0, 1]])}, r"\(0, 1\) and \(1, 0\) differ by 0.001"),
        ({"K": 1j * np.eye(3)}, "K is complex; .* with structural damping in D"),
        ({"nodes": np.array([1, 1]), "points": np.zeros((2, 3))}, "node 1 has two places"),
        ({"nodes": np.array([1]), "points": np.zeros((2, 3))}, "2, 3.* for 1 nodes"),
    ],
)
def test_bad_matrices_are_refused(tmp_path, change, message):
    arrays = {key: value for key, value in (good() | change).items() if value is not None}
    np.savez(tmp_path / "part.npz", **arrays)
    with pytest.raises(MatricesError, match=f"part.npz: .*{message}"):
        read_matrices(tmp_path / "part.npz")


def test_bad_files_are_refused(tmp_path):
    with pytest.raises(MatricesError, match=r"read from .npz, .mtx, .* and .sti files, not '.txt'"):
        read_matrices(tmp_path / "part.txt")
    with pytest.raises(MatricesError, match=r"written as .npz or .mtx, not '.mat'"):
        write_matrices(tmp_path / "part.mat", matrices_of(assemble(beam(2))))
    with pytest.raises(MatricesError, match=r"part\.K\.mtx: there is no such file"):
        read_matrices(tmp_path / "part.mtx")
    write_matrices(tmp_path / "part.mtx", matrices_of(assemble(beam(2))))
    (tmp_path / "part.K.mtx").write_text("%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 x 3\n")
    with pytest.raises(MatricesError, match=r"part\.K\.mtx, line 3: '1 x 3' is found where"):
        read_matrices(tmp_path / "part.mtx")
    (tmp_path / "part.npz").write_bytes(b"PK nothing")
    with pytest.raises(MatricesError, match=r"cannot be read as \.npz"):
        read_matrices(tmp_path / "part.npz")


def test_units_that_are_not_known_are_refused():
    a = matrices_of(assemble(beam(2)))
    with pytest.raises(MatricesError, match="the units are 'cm'; allowed are SI, mm-t-s"):
        a.scaled("cm")
    with pytest.raises(MatricesError, match="all three must be positive"):
        a.scaled((0.0, 1.0, 1.0))
    with pytest.raises(MatricesError, match="a proper orthogonal matrix"):
        a.placed(2 * np.eye(3))
    with pytest.raises(MatricesError, match="have no unit to convert"):
        matrices_of(assemble(portal(0.5))).scaled("mm-t-s")


@pytest.mark.parametrize("name", ["part.npz", "part.mtx"])
def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch, name):
    a = matrices_of(assemble(beam(2)))
    write_matrices(tmp_path / name, a)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def half(file, *_, **__):
        (file.write(b"half") if hasattr(file, "write") else file.write_bytes(b"half"))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", half)
    monkeypatch.setattr(scipy.io, "mmwrite", half)
    with pytest.raises(OSError, match="No space left"):
        write_matrices(tmp_path / name, matrices_of(assemble(beam(3))))
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_sparse_and_dense_give_the_same():
    a = Matrices.from_arrays(np.eye(3), sp.eye_array(3), [1, 1, 1], [1, 2, 3])
    assert_same(a, Matrices.from_arrays(sp.eye_array(3), np.eye(3), [1, 1, 1], [1, 2, 3]))
    with pytest.raises(MatricesError, match="the place of node 1 is not known"):
        a.rigid_motions()
