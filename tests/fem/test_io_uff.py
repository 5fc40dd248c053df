"""Universal files: labels, odd forms of dataset 58, units, shapes, damage; pyuff as a second reader."""

import struct
import time
import warnings

import numpy as np
import pytest
import pyuff

from fem import FRF, Mesh, Modes
from fem.io import (
    Function,
    Points,
    UffError,
    label_of,
    parse_label,
    read_frf,
    read_modes,
    read_uff,
    write_uff,
)
from fem.io.uff_types import Header, TraceLine


def small_frf(kind="accelerance", outputs=("1Z+", "2X-"), inputs=("1Z+",), frequency=(0.0, 0.5, 1.0, 1.5)):
    rng = np.random.default_rng(3)
    H = rng.normal(size=(len(frequency), len(outputs), len(inputs), 2)) @ [1, 1j]
    return FRF.from_arrays(frequency, H, kind, outputs, inputs)


def record(
    values, *, n=None, kind=5, even=1, order=1, head58="58", types=(12, 13), ends=(1, 3, 1, 3), unit="m/s^2"
):
    """One dataset 58 in text, or the head of a binary one."""
    node, direction, reference, sense = ends
    lines = [
        "    -1",
        head58,
        *["NONE"] * 5,
        f"{4:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{node:10d}{direction:4d}"
        f" {'NONE':<10}{reference:10d}{sense:4d}",
        f"{kind:10d}{len(values) if n is None else n:10d}{even:10d}{1.0:13.5e}{0.5:13.5e}{0.0:13.5e}",
        f"{18:10d}    0    0    0 {'Frequency':<20} {'Hz':<20}",
        f"{types[0]:10d}    0    0    0 {'NONE':<20} {unit:<20}",
        f"{types[1]:10d}    0    0    0 {'NONE':<20} {'N':<20}",
        f"{0:10d}    0    0    0 {'NONE':<20} {'NONE':<20}",
    ]
    return "\n".join(lines) + "\n"


def text_record(values, **options):
    cells = [f"{v:13.5e}" for z in values for v in (z.real, z.imag)]
    body = "".join("".join(cells[k : k + 6]) + "\n" for k in range(0, len(cells), 6))
    return (record(values, **options) + body + "    -1\n").encode()


def binary_record(values, fmt="<f4", count=None, kind=5, gap=b"", floating=2, **options):
    payload = np.column_stack([np.real(values), np.imag(values)]).astype(fmt).tobytes()
    head = (
        f"{58:6d}b{1 if fmt[0] == '<' else 2:6d}{floating:6d}{11:12d}{count or len(payload):12d}"
        + "     0" * 4
    )
    return record(values, head58=head, kind=kind, **options).encode() + payload + gap + b"    -1\n"


VALUES = np.array([1 + 2j, -3 + 0.5j, 0.25 - 1j])


def read_bytes(path, data, **options):
    path.write_bytes(data)
    return read_uff(path, **options)


# Labels ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("node", "direction", "label"),
    [(12, 3, "12Z+"), (1, -1, "1X-"), (7, 4, "7RX+"), (7, -6, "7RZ-"), (3, 0, "3S")],
)
def test_labels_name_node_direction_and_sign(node, direction, label):
    assert label_of(node, direction) == label
    assert parse_label(label) == (node, direction)


@pytest.mark.parametrize("label", ["U1z", "12Z", "Z+", "12S+", "12RS+", "1.5X+", ""])
def test_other_labels_are_refused(label):
    with pytest.raises(UffError, match="is not the label of a degree of freedom"):
        parse_label(label)


def test_direction_out_of_range():
    with pytest.raises(UffError, match="direction 7 at node 1"):
        label_of(1, 7)


# Dataset 58 in the forms that programs write --------------------------------------------------------------


@pytest.mark.parametrize("count", [None, 12, 0, 999999], ids=["right", "half", "none", "too-large"])
@pytest.mark.parametrize("gap", [b"", b"\n", b"\r\n"], ids=["", "LF", "CRLF"])
@pytest.mark.parametrize("fmt", ["<f4", ">f4", "<f8", ">f8"])
def test_binary_values_whatever_the_byte_count_says(tmp_path, fmt, gap, count):
    data = binary_record(VALUES, fmt, count, kind=5 if fmt.endswith("4") else 6, gap=gap)
    file = read_bytes(tmp_path / "a.uff", 2 * data)
    np.testing.assert_array_equal(file.frf().H[:, 0, 0], VALUES)
    assert "it comes again with the same values and counts once" in file.skipped[0]


@pytest.mark.parametrize(("fmt", "kind"), [("<f8", 5), ("<f4", 6)])
def test_precision_other_than_the_header_says(tmp_path, fmt, kind):
    frf = read_bytes(tmp_path / "a.uff", binary_record(VALUES, fmt, kind=kind)).frf()
    np.testing.assert_array_equal(frf.H[:, 0, 0], VALUES)


def test_the_end_mark_inside_binary_values_does_not_end_them(tmp_path):
    inside = np.frombuffer(b"    -1\n    -1\n  ", "<f8")  # 16 bytes that look like an end and a beginning
    values = np.array([1 + 1j, complex(*inside), 2 + 2j])
    frf = read_bytes(tmp_path / "a.uff", binary_record(values, "<f8", kind=6)).frf()
    np.testing.assert_array_equal(frf.H[:, 0, 0], values)


def test_uneven_abscissa_in_single_precision_beside_double_ordinates(tmp_path):
    head = record(VALUES, head58=f"{58:6d}b{1:6d}{2:6d}{11:12d}{60:12d}", kind=6, even=0).encode()
    payload = b"".join(struct.pack("<fdd", f, z.real, z.imag) for f, z in zip((1, 2, 4), VALUES, strict=True))
    frf = read_bytes(tmp_path / "a.uff", head + payload + b"    -1\n").frf()
    np.testing.assert_array_equal(frf.frequency, [1, 2, 4])
    np.testing.assert_array_equal(frf.H[:, 0, 0], VALUES)


def test_dec_and_ibm_numbers_are_passed_over_with_the_reason(tmp_path):
    file = read_bytes(tmp_path / "a.uff", binary_record(VALUES, floating=3) + text_record(VALUES))
    assert len(file.frfs) == 1
    assert "number format 3" in file.skipped[0]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_text_with_any_line_end(tmp_path, end):
    data = text_record(VALUES).replace(b"\n", end.encode())
    np.testing.assert_array_equal(read_bytes(tmp_path / "a.unv", data).frf().H[:, 0, 0], VALUES)


@pytest.mark.parametrize("text", ["Schwingung \u00fcber Br\u00fccke m/s\u00b2", "\x85\x0b\x1c"])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_header_that_is_not_ascii(tmp_path, text, encoding):
    data = text_record(VALUES).replace(b"NONE", text.encode(encoding), 1)
    file = read_bytes(tmp_path / "a.uff", data)
    np.testing.assert_array_equal(file.frf().H[:, 0, 0], VALUES)


def test_kind_by_data_types(tmp_path):
    for number, kind in ((8, "receptance"), (11, "mobility"), (12, "accelerance")):
        assert read_bytes(tmp_path / "a.uff", text_record(VALUES, types=(number, 13))).frf().kind == kind


def test_unknown_kind_must_be_told(tmp_path):
    path = tmp_path / "a.uff"
    file = read_bytes(path, text_record(VALUES, types=(0, 0)))
    assert not file.frfs
    assert file.functions[0].type_name == "frequency response function"
    with pytest.raises(UffError, match=r"no FRFs that can be used(.|\n)*give kind="):
        read_frf(path)
    assert read_frf(path, kind="mobility").kind == "mobility"
    with pytest.raises(UffError, match="the FRF kind is 'inertance'"):
        read_uff(path, kind="inertance")


def test_holes_split_the_matrix_and_are_named(tmp_path):
    data = b"".join(
        text_record(VALUES * k, ends=e)
        for k, e in enumerate([(1, 3, 1, 3), (2, 3, 1, 3), (1, 3, 2, 3)], start=1)
    )
    with pytest.warns(UserWarning, match=r"lacks 2Z\+/2Z\+; it is given as 2 complete matrices"):
        file = read_bytes(tmp_path / "a.uff", data)
    assert [(f.outputs, f.inputs) for f in file.frfs] == [(("1Z+", "2Z+"), ("1Z+",)), (("1Z+",), ("2Z+",))]
    np.testing.assert_array_equal(file.frfs[1].H[:, 0, 0], 3 * VALUES)
    with pytest.raises(UffError, match="2 groups of FRFs"):
        file.frf()


def test_roving_hammer_is_one_row(tmp_path):
    data = b"".join(text_record(VALUES * k, ends=(1, 3, k, -3)) for k in (1, 2, 3))
    frf = read_bytes(tmp_path / "a.uff", data).frf()
    assert frf.H.shape == (3, 1, 3)
    assert frf.inputs == ("1Z-", "2Z-", "3Z-")


def test_records_in_other_units_are_not_mixed(tmp_path):
    data = text_record(VALUES, unit="g") + text_record(VALUES, ends=(2, 3, 1, 3))
    with pytest.warns(UserWarning, match=r"with the unit label 'g' and 'N' are multiplied by 9\.80665 to SI"):
        file = read_bytes(tmp_path / "a.uff", data)
    assert file.frf_units == (("g", "N"), ("m/s^2", "N"))
    np.testing.assert_allclose(file.frfs[0].H, 9.80665 * file.frfs[1].H, rtol=1e-15)


# Units ----------------------------------------------------------------------------------------------------

UNITS_MM_N = b"    -1\n   164\n        10mm (newton)                 2\n" + (
    b"  1.00000000000000000D+03  1.00000000000000000D+00  1.00000000000000000D+00\n"
    b"  2.73150000000000000D+02\n    -1\n"
)
POINTS_15 = (
    b"    -1\n    15\n         1         0         0         0-1.000000E+00-1.000000E+01-2.500000E+00\n"
    b"         2         0         0         0 1.00000E+03 0.00000E+00 0.00000E+00\n    -1\n"
)


def test_points_beginning_with_minus_one(tmp_path):
    points = read_bytes(tmp_path / "a.uff", POINTS_15).points
    np.testing.assert_array_equal(points.coordinates, [[-1, -10, -2.5], [1000, 0, 0]])
    np.testing.assert_array_equal(points.at(2), [1000, 0, 0])
    with pytest.raises(UffError, match="there is no node 9"):
        points.at(9)


def test_units_are_converted_to_si_and_said_once(tmp_path):
    data = UNITS_MM_N + POINTS_15 + text_record(VALUES, unit="NONE") + text_record(VALUES, unit="mm/s^2")
    with pytest.warns(
        UserWarning, match="lengths are divided by 1000 and forces by 1 in FRFs, coordinates"
    ) as said:
        file = read_bytes(tmp_path / "a.uff", data)
    assert len(said) == 1
    assert file.units.length == 1000
    assert file.units.mass == 1000  # tonnes
    np.testing.assert_array_equal(file.points.at(2), [1, 0, 0])
    for frf in file.frfs:
        np.testing.assert_allclose(frf.H[:, 0, 0], VALUES / 1000, rtol=1e-15)


def test_a_unit_label_in_si_goes_before_the_units_of_the_file(tmp_path):
    with pytest.warns(
        UserWarning, match=r"the unit label 'm/s\^2' of FRFs takes precedence over dataset 164"
    ):
        file = read_bytes(tmp_path / "a.uff", UNITS_MM_N + text_record(VALUES))
    np.testing.assert_array_equal(file.frf().H[:, 0, 0], VALUES)


@pytest.mark.parametrize(("ends", "power"), [((1, 4, 1, 3), 0), ((1, 3, 1, 4), 0), ((1, 4, 1, 4), 1)])
def test_rotations_and_moments_scale_by_their_own_powers_of_length(tmp_path, ends, power):
    # rad/s² per force: no length; translation per moment: mm/(N mm) = 1/N; rotation per moment: 1/(N mm)
    with pytest.warns(UserWarning, match="in FRFs"):
        file = read_bytes(tmp_path / "a.uff", UNITS_MM_N + text_record(VALUES, ends=ends, unit="NONE"))
    np.testing.assert_allclose(file.frf().H[:, 0, 0], VALUES * 1000**power, rtol=1e-15)


# Shapes ---------------------------------------------------------------------------------------------------


def test_modal_mass_and_units_scale_shapes_to_unit_modal_mass(tmp_path):
    modes = Modes(np.array([10.0]), np.array([[2.0], [0.0], [4.0]]), None, ("1X+", "1Y+", "1Z+"))
    write_uff(tmp_path / "a.uff", modes=modes)
    data = (tmp_path / "a.uff").read_bytes()
    heavy = data.replace(b" 1.00000e+01  1.00000e+00", b" 1.00000e+01  4.00000e+00")
    assert heavy != data
    (tmp_path / "b.uff").write_bytes(heavy)
    np.testing.assert_allclose(read_modes(tmp_path / "b.uff").shapes[:, 0], [1, 0, 2])
    (tmp_path / "c.uff").write_bytes(UNITS_MM_N + data[data.index(b"    55\n") - 7 :])
    with pytest.warns(UserWarning, match="in mode shapes"):
        scaled = read_modes(tmp_path / "c.uff")
    np.testing.assert_allclose(scaled.shapes[:, 0], np.array([2, 0, 4]) / np.sqrt(1000))


def test_complex_shapes_with_rotations(tmp_path):
    shapes = np.arange(1, 13).reshape(12, 1) * (1 - 0.5j)
    write_uff(tmp_path / "a.uff", modes=Modes(np.array([5.0]), shapes, np.array([0.02])))
    back = read_modes(tmp_path / "a.uff")
    assert back.labels[:7] == ("1X+", "1Y+", "1Z+", "1RX+", "1RY+", "1RZ+", "2X+")
    np.testing.assert_allclose(back.shapes, shapes, rtol=5e-6)
    np.testing.assert_allclose([back.frequency[0], back.zeta[0]], [5.0, 0.02], rtol=1e-5)


def test_modes_in_several_groups_are_refused_by_read_modes(tmp_path):
    write_uff(tmp_path / "a.uff", small_frf())
    with pytest.raises(UffError, match="no mode shapes that can be used; it holds 1 FRF matrices"):
        read_modes(tmp_path / "a.uff")


# pyuff as an independent reader and writer ----------------------------------------------------------------


@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("binary", [True, False])
def test_pyuff_reads_what_we_write(tmp_path, binary, double):
    frf = small_frf(outputs=("1Z+", "2RX-"))
    mesh = Mesh.from_lines([[-1, 0, 0], [1, 0, 0], [-1, 2, 0]], [[0, 1], [0, 2]], {"a": [0], "b": [1]})
    write_uff(
        tmp_path / "a.uff",
        frf,
        mesh=mesh,
        points=15,
        binary=binary,
        double=double,
        header=Header("m", "d", "p"),
    )
    sets = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
    assert [s["type"] for s in sets] == [151, 164, 15, 82, 82, 2412, 58, 58]
    assert (sets[0]["model_name"], sets[1]["length"]) == ("m", 1.0)
    assert sets[2]["x"] == [-1, 1, -1]
    assert sets[3]["nodes"].tolist() == [1, 2]
    assert [e["nodes_nums"] for e in sets[5][21]] == [[1, 2], [1, 3]]
    for k, (node, direction) in enumerate([(1, 3), (2, -4)]):
        assert (sets[6 + k]["rsp_node"], sets[6 + k]["rsp_dir"]) == (node, direction)
        assert sets[6 + k]["ordinate_spec_data_type"] == 12
        np.testing.assert_allclose(sets[6 + k]["x"], frf.frequency, atol=1e-12)
        rtol = 1e-12 if double else 6e-8 if binary else 5e-6
        np.testing.assert_allclose(sets[6 + k]["data"].real, frf.H[:, k, 0].real, rtol=rtol)
        np.testing.assert_allclose(sets[6 + k]["data"].imag, frf.H[:, k, 0].imag, rtol=rtol)


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("spacing", [0, 1])
def test_we_read_what_pyuff_writes(tmp_path, binary, spacing):
    frequency = np.array([1.0, 2.0, 3.0])
    data = pyuff.prepare_58(
        binary=binary,
        func_type=4,
        rsp_node=5,
        rsp_dir=-2,
        ref_node=1,
        ref_dir=3,
        data=VALUES,
        x=frequency,
        abscissa_spacing=spacing,
        abscissa_min=1.0,
        abscissa_inc=1.0,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
        orddenom_spec_data_type=13,
        id1="x",
        n_bytes=1,
    )
    pyuff.UFF(str(tmp_path / "a.uff")).write_sets(data, mode="add")
    frf = read_frf(tmp_path / "a.uff")
    assert (frf.outputs, frf.inputs) == (("5Y-",), ("1Z+",))
    np.testing.assert_allclose(frf.frequency, frequency)
    np.testing.assert_allclose(frf.H[:, 0, 0], VALUES, rtol=1e-11)


def test_the_byte_count_we_write_is_right(tmp_path):
    write_uff(tmp_path / "a.uff", small_frf(), double=False)
    header = next(
        line for line in (tmp_path / "a.uff").read_bytes().split(b"\n") if line.startswith(b"    58b")
    )
    assert int(header[31:43]) == 4 * 2 * 4  # lines, parts, bytes


# What cannot be written -----------------------------------------------------------------------------------


def functions():
    """Return a time record, a coherence on uneven lines and a complex spectrum, as a reader would."""
    rng = np.random.default_rng(5)
    common = dict(title=("run 3",) + ("",) * 4, load_case=2, version=1, place="")
    even, uneven = 0.125 * np.arange(9) - 0.25, np.array([1.0, 2.5, 2.75, 8.0, 9.5])
    spectrum = rng.standard_normal(4) * (1 + 2j)
    return (
        Function(1, "12Z-", "0S", "lid", "", even, rng.normal(size=9), 17, 12, 0, "s", "m/s^2", "", **common),
        Function(6, "12Z+", "3X+", "", "foot", uneven, rng.random(5), 18, 0, 0, "Hz", "", "", **common),
        Function(
            12, "7RY+", "0S", "", "", uneven[:4] - 1.0, spectrum, 18, 11, 0, "Hz", "rad/s", "", **common
        ),
    )


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("double", [True, False])
def test_all_kinds_of_functions_come_back(tmp_path, binary, double):
    path = tmp_path / "f.uff"
    write_uff(path, functions=functions(), binary=binary, double=double)
    back = read_uff(path).functions
    size = {(True, True): 0.0, (True, False): 1e-7, (False, True): 1e-12, (False, False): 1e-5}[
        binary, double
    ]
    names = """
        function_type response reference response_name reference_name x_type ordinate_type
        denominator_type x_unit unit denominator_unit load_case version
    """
    for was, now in zip(functions(), back, strict=True):
        np.testing.assert_allclose(now.values, was.values, rtol=size, atol=size * np.abs(was.values).max())
        np.testing.assert_allclose(now.x, was.x, rtol=0, atol=1e-6)
        for name in names.split():
            assert getattr(now, name) == getattr(was, name), name
        assert now.title[0] == "run 3"
        assert np.iscomplexobj(now.values) == np.iscomplexobj(was.values)
    for dataset, was in zip(pyuff.UFF(str(path)).read_sets(), [None, None, *functions()], strict=True):
        if was is not None:
            np.testing.assert_allclose(dataset["data"], was.values, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("points", [15, 2411])
def test_a_test_geometry_keeps_its_node_numbers_and_lifts_the_pen(tmp_path, points):
    geometry = Points(
        np.array([101, 7, 12, 3]), np.array([[0, 0, 1.0], [-1, 2, 0], [0.5, 0, -0.25], [3, 3, 3]])
    )
    lines = (TraceLine(4, "lid", ((101, 7), (12, 3, 7))), TraceLine(9, "foot", ((7, 12),)))
    path = tmp_path / "g.uff"
    write_uff(path, small_frf(), geometry=geometry, trace_lines=lines, points=points)
    back = read_uff(path)
    assert back.points is not None
    np.testing.assert_array_equal(back.points.labels, geometry.labels)
    np.testing.assert_allclose(back.points.coordinates, geometry.coordinates, atol=1e-5)
    assert back.trace_lines == lines
    assert len(back.frfs) == 1
    assert set(back.mesh().groups) | set(back.mesh().members) == {"lid", "lid.1", "lid.2", "lid.3", "foot"}
    with pytest.raises(UffError, match="goes through node 8"):
        write_uff(path, geometry=geometry, trace_lines=[TraceLine(1, "x", ((101, 8),))])
    with pytest.raises(UffError, match="a mesh and a geometry"):
        write_uff(path, mesh=Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]]), geometry=geometry)


def test_names_that_are_no_dofs_need_a_map(tmp_path):
    frf = small_frf(outputs=("U1z", "U2z"), inputs=("U1z",))
    with pytest.raises(UffError, match=r"'U1z' is not the label.*name its degree of freedom in dofs"):
        write_uff(tmp_path / "a.uff", frf)
    write_uff(tmp_path / "a.uff", frf, dofs={"U1z": "1Z+", "U2z": "2Z-"})
    assert read_frf(tmp_path / "a.uff").outputs == ("1Z+", "2Z-")


def test_refusals_on_writing_leave_the_old_file(tmp_path):
    path = tmp_path / "a.uff"
    path.write_text("old")
    big = FRF.from_arrays([1.0], [1e39], "accelerance", ["1X+"], ["1X+"])
    close = FRF.from_arrays([1.0, 100.0, 100.000001], [1, 2, 3], "accelerance", ["1X+"], ["1X+"])
    for frf, options, words in (
        (big, {"double": False}, "single precision ends"),
        (close, {"binary": False}, "cannot be distinguished"),
        ((), {}, "nothing to write"),
    ):
        with pytest.raises(UffError, match=words):
            write_uff(path, frf, **options)
    with pytest.raises(UffError, match="15 or 2411"):
        write_uff(path, mesh=Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]]), points=12)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


# Damage ---------------------------------------------------------------------------------------------------


def test_a_file_cut_off_says_where(tmp_path):
    data = binary_record(VALUES)
    with pytest.raises(
        UffError, match=r"a.uff: dataset 58b at line 1 \(byte 0\) announces 3 values in 24 bytes, but 1[0-9]"
    ):
        read_bytes(tmp_path / "a.uff", data[:-15])
    with pytest.raises(
        UffError, match=r"dataset 15 at line 1 \(byte 0\) has no end; the file stops after line 4"
    ):
        read_bytes(tmp_path / "a.uff", POINTS_15[: -len("    -1\n")])


def test_a_word_among_the_numbers_is_found(tmp_path):
    with pytest.raises(
        UffError, match=r"dataset 15 at line 1 .* line 3 has 'minus' where a number is expected"
    ):
        read_bytes(tmp_path / "a.uff", POINTS_15.replace(b"-1.000000E+00", b"   minus     "))


def test_too_few_values_in_text(tmp_path):
    with pytest.raises(UffError, match=r"dataset 58 at line 1 \(byte 0\): it announces 5 values and has 3"):
        read_bytes(tmp_path / "a.uff", text_record(VALUES, n=5))


@pytest.mark.parametrize("data", [b"", b"hello\nworld\n", bytes(range(256)), b"    -1\n"])
def test_other_files_are_no_universal_files(tmp_path, data):
    with pytest.raises(UffError, match="no dataset found"):
        read_bytes(tmp_path / "a.uff", data)


def test_unknown_datasets_and_stray_text_are_listed(tmp_path):
    data = b"remark\n    -1\n  9999\nx\n    -1\n    -1\nword\n    -1\n" + POINTS_15
    file = read_bytes(tmp_path / "a.uff", data)
    assert file.skipped == (
        "line 1: text outside any dataset: 'remark'",
        "dataset 9999 at line 2 (byte 7): datasets of type 9999 are not read",
        "dataset 0 at line 6 (byte 30): its type 'word' is not a number",
    )
    assert file.contents == "2 points"


def test_reading_writes_and_prints_nothing(tmp_path, capfd):
    (tmp_path / "in").mkdir()
    write_uff(tmp_path / "in" / "a.uff", small_frf())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_uff(tmp_path / "in" / "a.uff")
    assert [p.name for p in (tmp_path / "in").iterdir()] == ["a.uff"]
    assert capfd.readouterr() == ("", "")


def test_time_to_write_grows_with_the_number_of_members(tmp_path):
    """pyuff reads the file again for each trace line: 4000 of them took 80 s."""
    n = 4000
    points = np.column_stack([np.arange(n + 1.0), np.zeros(n + 1), np.zeros(n + 1)])
    lines = np.column_stack([np.arange(n), np.arange(n) + 1])
    mesh = Mesh.from_lines(points, lines, {f"m{k}": [k] for k in range(n)})
    start = time.process_time()
    write_uff(tmp_path / "m.uff", mesh=mesh)
    assert time.process_time() - start < 8
    traces = read_uff(tmp_path / "m.uff").trace_lines
    assert [(t.name, t.strokes) for t in traces[:2]] == [("m0", ((1, 2),)), ("m1", ((2, 3),))]
    assert len(traces) == n


@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("even", [True, False])
def test_many_lines_of_text_are_written_as_a_few(tmp_path, double, even):
    """Lines are formatted thousands at a time; each has the cells that it has in a short file."""
    n = 20001
    f = np.arange(1.0, n + 1) if even else np.arange(1.0, n + 1) ** 1.1
    H = np.random.default_rng(4).standard_normal((n, 1, 1)) * (1 - 2j)
    write_uff(
        tmp_path / "m.uff", FRF.from_arrays(f, H, "mobility", ["1X+"], ["1X+"]), binary=False, double=double
    )
    lines = (tmp_path / "m.uff").read_text().splitlines()
    body = lines[lines.index("    58") + 12 : -1]
    cell = "{:20.12e}" if double else "{:13.5e}"
    rows = [
        ("" if even else f"{x:13.6e}") + cell.format(h.real) + cell.format(h.imag)
        for x, h in zip(f, H[:, 0, 0], strict=True)
    ]
    per_line = {(True, True): 2, (True, False): 1, (False, True): 3, (False, False): 2}[double, even]
    assert body == ["".join(rows[k : k + per_line]) for k in range(0, n, per_line)]
