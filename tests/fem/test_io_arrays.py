"""FRFs and modes in .npz files, FRFs in text tables, and what is said about files that are neither."""

import numpy as np
import pytest

from fem import FRF, Modes
from fem.io import TableError, read_frf, read_modes, write_csv, write_npz

TABLE = "1;1+2j;3-4j\n2;5+6j;7+8j\n"


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_table_without_header_has_one_force(tmp_path):
    frf = read_frf(write(tmp_path / "a.csv", TABLE), kind="accelerance")
    assert (frf.outputs, frf.inputs) == (("out1", "out2"), ("in1",))
    np.testing.assert_array_equal(frf.frequency, [1, 2])
    np.testing.assert_array_equal(frf.H[:, :, 0], [[1 + 2j, 3 - 4j], [5 + 6j, 7 + 8j]])


def test_columns_go_force_by_force(tmp_path):
    path = write(tmp_path / "a.csv", "1;1+1j;2+1j;3+1j;4+1j\n")
    frf = read_frf(path, kind="mobility", outputs=["a", "b"], inputs=["p", "q"])
    np.testing.assert_array_equal(frf.H[0].real, [[1, 3], [2, 4]])
    assert read_frf(path, kind="mobility", outputs=["a", "b"]).inputs == ("in1", "in2")
    with pytest.raises(
        TableError, match=r"a\.csv: it has 4 FRFs for 3 responses and 1 forces; 3 are expected"
    ):
        read_frf(path, kind="mobility", outputs=["a", "b", "c"])


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("f,a,b\n1,3,4\n", {}),
        ("1\t3\t4\n", {}),
        ("  1   3 4 \n", {}),
        ("# made by hand\n\n1,0;3,0;4,0;\n", {}),
        ("1 3+4j\n", {}),
        ("1, 3+4i\n", {}),
        ("1|3|4", {"delimiter": "|"}),
        ("1,5,53.13010235415598", {"form": "magnitude-degrees"}),
        ("9,9,9\n1,3,4\n", {"header": True}),
        ("1+0j,3+4j\n", {}),
    ],
)
def test_tables_in_many_forms(tmp_path, text, options):
    frf = read_frf(write(tmp_path / "a.txt", text), kind="receptance", **options)
    np.testing.assert_allclose([frf.frequency[0], frf.H[0, 0, 0]], [1, 3 + 4j])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1;1+2j\n2;x\n", "line 2, column 2 has 'x' where a number is expected"),
        ("f;H\n1;1+2j\n2;1+2j;3\n", "line 3 has 3 columns, the first line of data has 2"),
        ("1,2\n", "line 1 has 2 columns; the frequency and two columns for each FRF"),
        ("", "no lines of data"),
        ("f;H\n", "a header and no lines of data"),
        ("1\n2\n", "has one column"),
        ("2;1j\n1;1j\n", "frequencies must increase strictly"),
        ("1;nan+1j\n", "not finite"),
    ],
)
def test_bad_tables_name_line_and_column(tmp_path, text, words):
    with pytest.raises(TableError, match=rf"^a\.csv: .*{words}"):
        read_frf(write(tmp_path / "a.csv", text), kind="accelerance")


def test_the_kind_is_in_the_file_or_told(tmp_path):
    path = write(tmp_path / "a.csv", TABLE)
    with pytest.raises(TableError, match="does not say the kind of its FRFs; give kind, one of"):
        read_frf(path)
    with pytest.raises(TableError, match="allowed are receptance"):
        read_frf(path, kind="inertance")
    write_csv(tmp_path / "b.csv", read_frf(path, kind="mobility"))
    assert read_frf(tmp_path / "b.csv", kind="receptance").kind == "mobility"


def test_a_header_that_lacks_an_frf(tmp_path):
    path = write(tmp_path / "a.csv", "f,re(a/p),im(a/p),re(b/p),im(b/p),re(a/q),im(a/q)\n1,1,1,1,1,1,1\n")
    with pytest.raises(TableError, match="the header lacks b/q"):
        read_frf(path, kind="mobility")


def test_a_label_with_a_slash_cannot_go_into_a_header(tmp_path):
    frf = FRF.from_arrays([1.0], [1j], "mobility", ["a"], ["p/q"])
    with pytest.raises(TableError, match="'p/q'"):
        write_csv(tmp_path / "a.csv", frf)
    assert not list(tmp_path.iterdir())


def test_unknown_suffix_form_and_options(tmp_path):
    path = write(tmp_path / "a.csv", TABLE)
    with pytest.raises(TableError, match=r"not '\.xls'"):
        read_frf(write(tmp_path / "a.xls", ""))
    with pytest.raises(TableError, match=r"not '\.csv'"):
        read_modes(path)
    with pytest.raises(TableError, match="the form is 'polar'"):
        read_frf(path, kind="mobility", form="polar")
    with pytest.raises(TypeError, match="the options header are not for a universal file"):
        read_frf(write(tmp_path / "a.uff", ""), header=True)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"H": [1j]}, "there is no array 'frequency'; it has kind, H"),
        ({"frequency": [1.0, 2.0], "H": [1j]}, r"H has shape \(1,\) for 2 frequencies"),
        ({"frequency": ["a"], "H": [1j]}, "could not convert"),
        ({"frequency": [1.0], "H": [1j], "outputs": ["a", "b"]}, "2 output labels"),
    ],
)
def test_bad_npz(tmp_path, arrays, words):
    np.savez(tmp_path / "a.npz", kind="mobility", **arrays)
    with pytest.raises(TableError, match=words):
        read_frf(tmp_path / "a.npz")


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04", b"text", b"\x93NUMPY\x01\x00v\x00{'a"])
def test_no_npz_at_all(tmp_path, data):
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(TableError, match=r"a\.npz: it cannot be read as \.npz"):
        read_frf(tmp_path / "a.npz")


def test_bare_arrays_in_npz(tmp_path):
    np.savez(tmp_path / "a.npz", frequency=[1.0, 2.0], H=[1j, 2j])
    with pytest.raises(TableError, match="does not say the kind"):
        read_frf(tmp_path / "a.npz")
    assert read_frf(tmp_path / "a.npz", kind="mobility").H.shape == (2, 1, 1)
    with pytest.raises(TableError, match="there is no array 'shapes'"):
        read_modes(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"shapes": np.ones((3, 2))}, r"shapes have shape \(3, 2\) for 1 frequencies"),
        ({"shapes": np.ones((3, 1)), "labels": ["1X+"]}, "1 labels for 3 rows"),
        ({"shapes": np.ones((3, 1)), "zeta": [0.1, 0.2]}, "2 damping ratios"),
    ],
)
def test_bad_modes(tmp_path, arrays, words):
    np.savez(tmp_path / "a.npz", frequency=[1.0], **arrays)
    with pytest.raises(TableError, match=words):
        read_modes(tmp_path / "a.npz")


def test_modes_keep_all_they_have(tmp_path):
    modes = Modes(np.array([0.0, 2.0]), np.eye(2), np.array([0.0, 0.1]), ("1X+", "2X+"), 1)
    write_npz(tmp_path / "a.npz", modes)
    back = read_modes(tmp_path / "a.npz")
    np.testing.assert_array_equal(back.shapes, modes.shapes)
    assert (back.labels, back.n_rigid, back.zeta.tolist()) == (modes.labels, 1, [0.0, 0.1])
