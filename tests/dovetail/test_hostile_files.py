"""Files that are damaged or absurd end in one line of our own error, and nothing of the user's is lost."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from dovetail import StudyError, main
from dovetail.desk import Desk, journal_of
from dovetail.file import read_columns, read_mode_table, section_rows
from dovetail.units import FolderError, read_records
from fem import FRF, MeshError
from fem.io import Function, TableError, read_matrices, read_mesh, read_time_data, read_uff, write_npz
from fem.io.mat5 import read_mat5
from fem.io.units import size_of
from tests.studies import study_file

STUDY = """\
[points]
A = [0, 0, 0]
B = [1, 0, 0]
[members.bar]
from = "A"
to = "B"
section = { shape = "circle", d = 0.02 }
spin = 1.0
[materials.steel]
E = 210e9
rho = 7850
[[supports]]
point = "A"
[[sensors]]
name = "tip"
point = "B"
direction = "z"
label = "1Z+"
[[excitations]]
sensor = "tip"
[[unbalances]]
point = "B"
moment = 1e-5
"""


def refused(capsys, *command):
    """Run a command that must end in one line and exit code 2; return the line."""
    assert main([str(word) for word in command]) == 2
    printed = capsys.readouterr()
    lines = [line for line in printed.err.splitlines() if not line.startswith(("dovetail: warning", "usage"))]
    assert len(lines) == 1
    return lines[0]


def written(folder, more=""):
    return study_file(folder, STUDY + more)


@pytest.mark.parametrize("empty", ["", np.zeros((0, 0), dtype="U1"), np.array([""]), np.array(["", "ab"])])
def test_empty_texts_of_matlab(tmp_path, empty):
    from scipy.io import savemat

    cells = np.empty(2, dtype=object)
    cells[:] = ["", "acc"]
    savemat(tmp_path / "m.mat", {"a": empty, "s": {"b": empty, "c": 1.0}, "names": cells, "x": np.eye(2)})
    found = read_mat5(tmp_path / "m.mat")
    assert not "".join(found["a"].ravel().tolist()).replace("ab", "")
    assert found["names"].tolist() == ["", "acc"]
    assert found["x"].tolist() == np.eye(2).tolist()


@pytest.mark.parametrize("lengths", [(50, 100, 100), (101, 100, 100), (3, 100, 90)])
def test_times_of_another_length_are_refused(tmp_path, lengths):
    t, force, response = (np.arange(n) / 100.0 for n in lengths)
    np.savez(tmp_path / "r.npz", time=t, force=force, response=response)
    with pytest.raises(
        TableError, match=rf"r\.npz: no array has as many samples as its times \(time {lengths[0]}\)"
    ):
        read_time_data(tmp_path / "r.npz")


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/full"])
def test_devices_are_refused(tmp_path, capsys, device):
    study = written(tmp_path)
    words = f"{device}: it is a device, which may have no end; a file is needed"
    assert words in refused(capsys, "transient", study, "--excitation", device)
    assert words in refused(capsys, "modes", device)
    assert words in refused(capsys, "frf-estimate", device, "--out", tmp_path / "o.npz")
    (tmp_path / "link.csv").symlink_to(device)
    assert "it is a device" in refused(capsys, "spectrum", study, "--spectrum", tmp_path / "link.csv")


@pytest.mark.parametrize("rpm", ["1e308", "1e200", "-1e40", "1e11"])
def test_speeds_of_no_shaft_are_refused(tmp_path, capsys, rpm):
    study = written(tmp_path)
    words = r"a speed is \S+ rad/s \(\S+ turns a minute\); shafts turn at up to 1e\+09 rad/s"
    assert re.search(words, refused(capsys, "complex", study, f"--rpm={rpm}"))
    if float(rpm) > 0:
        for command in ("campbell", "unbalance"):
            assert re.search(words, refused(capsys, command, study, "--speeds", f"0:{rpm}:3"))
    study = written(tmp_path, f"[rotation]\nrpm = {rpm}\n")
    assert "rotation" in refused(capsys, "modes", study)


@pytest.mark.parametrize("types", [(18, 12), (0, 12), (13, 8), (9, 11)])
def test_what_is_no_motion_over_a_motion_is_refused(tmp_path, capsys, types):
    response, reference = types
    block = [
        "    -1",
        "    58",
        "frf",
        "NONE",
        "NONE",
        "NONE",
        "NONE",
        "    4         0    0         0 NONE               1   3 NONE               1   3",
        "         6         3         1 1.000000e+00 1.000000e+00  0.00000e+00",
        "        18    0    0    0 Frequency            Hz",
        f"{response:10d}    0    0    0 Acceleration         m/s^2",
        f"{reference:10d}    0    0    0 Force                N",
        "         0    0    0    0 NONE                 NONE",
        "  1.0e+00  0.0e+00  1.0e+00  0.0e+00  1.0e+00  0.0e+00",
        "    -1",
    ]
    (tmp_path / "f.uff").write_text("\n".join(block) + "\n", encoding="ascii")
    words = f"its data types are {response} over {reference}, a motion"
    assert words in "".join(read_uff(tmp_path / "f.uff", kind="accelerance").skipped)
    study = written(tmp_path, '[[measurements]]\nfile = "f.uff"\nkind = "accelerance"\n')
    assert words in refused(capsys, "compare", study)


@pytest.mark.parametrize("text", [b"\xff\xfe<html>", b"<h1>caf\xe9</h1>", b"\x80" * 20])
def test_reports_that_are_no_text_are_refused(tmp_path, capsys, text):
    (tmp_path / "report.html").write_bytes(text)
    said = refused(capsys, "report", tmp_path, "--docx", tmp_path / "r.docx")
    assert "report.html: byte " in said
    assert "is not UTF-8" in said
    assert not (tmp_path / "r.docx").exists()


@pytest.mark.parametrize("number", ["3" + 299 * "9" + ".1", "3" + 299 * "9", 200 * "9", "1e300"])
def test_frequencies_of_no_structure_are_refused(tmp_path, capsys, number):
    (tmp_path / "m.csv").write_text(f"frequency [Hz],tip\n{number},0.3\n9.4,0.2\n", encoding="utf-8")
    study = written(tmp_path, '[modes]\nfile = "m.csv"\n')
    assert "the mesh would have" in refused(capsys, "compare", study)
    study = written(tmp_path, f"[modes]\nfrequency = [9.4, {number}]\n")
    refused(capsys, "compare", study)
    study = written(tmp_path, f"[frequency]\nstop = {number}\n")
    refused(capsys, "modes", study)


def test_a_long_number_of_a_mode_table_is_cut_in_the_message(tmp_path):
    (tmp_path / "m.csv").write_text(f"frequency,tip\n{400 * '9'},0.3\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"row 2, frequency: '9{40}…' is not allowed; a number is needed"):
        read_mode_table(tmp_path / "m.csv")


@pytest.fixture
def desk_study(tmp_path):
    study = written(tmp_path, '[[measurements]]\nfile = "m.npz"\n[frequency]\nstop = 60.0\n')
    study.write_text(
        study.read_text(encoding="utf-8").replace("spin = 1.0\n", "").partition("[[unb")[0]
        + '[[measurements]]\nfile = "m.npz"\n',
        encoding="utf-8",
    )
    f = np.linspace(5, 60, 40)
    H = (1 / (1 - (f / 16.5) ** 2 + 0.02j * f / 16.5))[:, None, None].astype(complex)
    write_npz(tmp_path / "m.npz", FRF.from_arrays(f, H, "receptance", ("1Z+",), ("1Z+",)))
    return study


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("210000000000.0", 400 * "9"),
        ("210000000000.0", "1e400"),
        ("210000000000.0", "NaN"),
        ("210000000000.0", "[[1]]"),
        ('"states": [', '"states": ' + 3000 * "["),
        ('"hypothesis": {', '"hypothesis": null, "x": {'),
    ],
)
def test_a_damaged_journal_is_set_aside(desk_study, old, new):
    desk = Desk.open(desk_study)
    desk.add(next(iter(desk.candidates)))
    path = journal_of(desk_study)
    damaged = path.read_text(encoding="utf-8").replace(old, new)
    assert new in damaged
    for kept in (".study.desk.old.json", ".study.desk.old2.json"):
        path.write_text(damaged, encoding="utf-8")
        fresh = Desk.open(desk_study)
        assert fresh.history.undoes == ""
        assert kept in fresh.notes[0]
        assert (desk_study.parent / kept).read_text(encoding="utf-8") == damaged
        assert np.isfinite(fresh.shown.result.fit_db)


@pytest.mark.parametrize("scales", [{"NI_Number_Of_Scales": 50}, {"NI_Scale[49]_Scale_Type": "Linear"}])
def test_more_scales_than_properties_are_refused(tmp_path, capfd, scales):
    """A number of 2³¹ would be counted to its end."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        writer.write_segment(
            [nptdms.ChannelObject("g", "a", np.arange(9.0), {"wf_increment": 0.1, **scales})]
        )
    with pytest.raises(TableError, match=r"r\.tdms: channel 'a' would have 50 scales"):
        read_time_data(tmp_path / "r.tdms")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("offset", [np.nan, np.inf, 1e300])
def test_starts_that_are_no_times_are_refused(tmp_path, offset):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        for name, more in (("a", {}), ("b", {"wf_start_offset": offset})):
            channel = nptdms.ChannelObject("g", name, np.arange(9.0), {"wf_increment": 0.1, **more})
            writer.write_segment([channel])
    with pytest.raises(TableError, match=r"r\.tdms: channel '[ab]' starts \S+ samples after the first one"):
        read_time_data(tmp_path / "r.tdms")


@pytest.mark.parametrize("time", [np.nan, np.inf])
def test_times_that_are_not_finite_are_refused(tmp_path, time):
    t = np.arange(9.0)
    t[3] = time
    np.savez(tmp_path / "r.npz", time=t, force=np.ones(9))
    with pytest.raises(
        TableError, match=r"r\.npz: the time of sample 4 is (nan|inf); finite times are needed"
    ):
        read_time_data(tmp_path / "r.npz")


@pytest.mark.parametrize(
    "table",
    [
        b"\xf8\xff\x00",
        b"1,1X,1,X,0,0,0\n2,1Y,2,Y,0,0\n",
        b"1,1X,1,X,0,0,0\n2,1Y,9223372036854775808,Y,0,0,0\n",
        b"1,1X,1,X,0,0,0\n2,1Y,1,Y,0,inf,0\n",
        b'"' + 200_000 * b"x" + b'"\n',
    ],
)
def test_tables_of_rows_of_matrices(tmp_path, table):
    for key in "KM":
        text = "%%MatrixMarket matrix array real symmetric\n2 2\n1\n0\n1\n"
        (tmp_path / f"f.{key}.mtx").write_text(text, encoding="ascii")
    (tmp_path / "f.dofs.csv").write_bytes(b"row,label,node,direction,x_m,y_m,z_m\n" + table)
    with pytest.raises(ValueError, match=r"f\.dofs\.csv: ") as caught:
        read_matrices(tmp_path / "f.mtx")
    assert type(caught.value).__module__.startswith("fem.")


@pytest.mark.parametrize("line", [b"\xf8", b"[1]", b"7", b"{", 3000 * b"[", b'{"a": ' + 5000 * b"1" + b"}"])
def test_lines_of_records_that_are_none_are_named(tmp_path, line):
    file = tmp_path / "records.jsonl"
    file.write_bytes(b'{"settings": {"a": 1}}\n\n' + line + b"\n")
    with pytest.raises(FolderError, match=r"records\.jsonl: line 3 is not"):
        read_records(file, {"a": 1})


def test_values_beyond_the_largest_number_are_refused(tmp_path, capsys):
    (tmp_path / "h.csv").write_text("time [s],base z [g]\n0,0\n1,1e308\n2,0\n", encoding="utf-8")
    said = refused(capsys, "transient", written(tmp_path), "--excitation", tmp_path / "h.csv")
    assert "h.csv: the column 'base z' has values that are not finite in SI" in said


@pytest.mark.parametrize("piece", ["- ", "a_", " ", "("])
def test_long_headings_take_no_time(tmp_path, piece):
    long = f"frequency {16_000 * piece}x"
    (tmp_path / "t.csv").write_text(f"{long};b\n1;2\n2;3\n3;4\n", encoding="utf-8")
    begun = time.process_time()
    for read in (
        read_time_data,
        read_mode_table,
        lambda p: section_rows(p, []),
        lambda p: read_columns(p, ("time",)),
    ):
        with pytest.raises(ValueError, match=r"^t\.csv"):
            read(tmp_path / "t.csv")
    assert time.process_time() - begun < 1


@pytest.mark.parametrize("piece", [" ", "a", "(a", "^", "2"])
def test_long_units_of_sections_take_no_time(tmp_path, piece):
    (tmp_path / "t.csv").write_text(f"name;A (cm{4000 * piece}x\nS;1\n", encoding="utf-8")
    begun = time.process_time()
    section_rows(tmp_path / "t.csv", [])
    assert time.process_time() - begun < 1


def test_long_labels_of_units_take_no_time():
    begun = time.process_time()
    for piece in ("per ", " ", "s", "-1", "("):
        assert size_of("m" + 16_000 * piece + "x") is None
    assert time.process_time() - begun < 1


def test_a_function_type_below_zero_has_no_name_of_another():
    one = Function(-1, "1Z+", "0S", "", "", np.arange(3.0), np.ones(3), 12, 13, 0, "Hz", "", "", (), 0, 0, "")
    assert replace(one, function_type=-400).type_name == "function of type -400"
    assert one.type_name == "function of type -1"


def test_names_of_arrays_that_are_no_text_are_refused(tmp_path, monkeypatch):
    import meshio

    found = meshio.Mesh(np.eye(3), [("line", np.array([[0, 1], [1, 2]]))])
    found.cell_data = {b"\xff": [np.ones(2)]}
    monkeypatch.setattr(meshio, "read", lambda file: found)
    (tmp_path / "f.med").write_bytes(b"")
    with pytest.raises(MeshError, match=r"f\.med: the array b'.xff' has a name that is no text"):
        read_mesh(tmp_path / "f.med")


@pytest.mark.parametrize("dtype", [">f8", "f2", ">i4", "u1"])
def test_matrices_of_any_type_of_number_are_read(tmp_path, dtype):
    entries = {f"{key}_{part}": np.arange(2) for key in "KM" for part in ("row", "column")}
    values = {f"{key}_value": np.array([2, 3], dtype=dtype) for key in "KM"}
    shapes = {f"{key}_shape": np.array([2, 2]) for key in "KM"}
    np.savez(tmp_path / "m.npz", **entries, **values, **shapes, labels=np.array(["1X", "1Y"]))
    found = read_matrices(tmp_path / "m.npz")
    np.testing.assert_array_equal(found.K.toarray(), np.diag([2.0, 3.0]))
