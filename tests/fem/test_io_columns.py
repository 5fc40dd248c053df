"""FRFs in columns of text as analysers export them: separators, headers, units, parts and pairs."""

import numpy as np
import pytest

from fem.io import G0, Asked, TableError, read_csv, read_frf, read_frfs
from fem.io.columns import cut_number
from fem.io.frf_labels import decibel_reference, frf_unit

F = [1.0, 1.5, 2.0]
H = np.array([3 + 4j, -1 + 2j, 0.5 - 6j])


def write(folder, text, name="a.txt", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def read(folder, text, **asked):
    reading = read_frfs(write(folder, text), Asked(**asked))
    return reading, reading.frfs[0]


def rows(mark=";", decimal=".", columns=None):
    """Return lines of frequency, real and imaginary part of H."""
    table = np.column_stack([F, H.real, H.imag] if columns is None else columns)
    return "".join(mark.join(f"{v:.12g}".replace(".", decimal) for v in row) + "\n" for row in table)


@pytest.mark.parametrize(
    ("mark", "decimal"),
    [(";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), ("   ", "."), (" ", ",")],
)
def test_separator_and_decimal_mark_are_found(tmp_path, mark, decimal):
    _, frf = read(tmp_path, rows(mark, decimal), kind="mobility")
    np.testing.assert_allclose(frf.frequency, F)
    np.testing.assert_allclose(frf.H[:, 0, 0], H)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_encodings_and_line_ends(tmp_path, encoding):
    text = f"Prüfling: Mast\nFreq [Hz];s1/s5 Real [(m/s²)/N];s1/s5 Imag [(m/s²)/N]\n{rows()}"
    path = write(tmp_path, text.replace("\n", "\r\n"), encoding=encoding)
    frf = read_frf(path)
    assert (frf.kind, frf.outputs, frf.inputs) == ("accelerance", ("s1",), ("s5",))
    np.testing.assert_allclose(frf.H[:, 0, 0], H)


HEADERS = {
    "names and units in one row": "Frequency [Hz];s1/s5 Real [g/N];s1/s5 Imag [g/N]\n",
    "a row of units": "Frequency;s1/s5 Real;s1/s5 Imag\nHz;g/N;g/N\n",
    "a unit above the first part alone": "Frequency;s1/s5 Real;s1/s5 Imag\nHz;g/N\n",
    "names above two columns each": ";s1/s5;\nFrequency;Real;Imaginary\nHz;g/N;g/N\n",
    "many lines before": "Project:;demo\nDate;2024-05-06\n\nNumber of lines: "
    "3\nf;Re(s1/s5);Im(s1/s5)\nHz;g/N;g/N\n",
    "a comment": "# Frequency [Hz];s1/s5 Real [g/N];s1/s5 Imag [g/N]\n",
    "underscores": "freq_Hz;s1/s5_real;s1/s5_imag\nHz;g/N;g/N\n",
    "quotes": '"Frequency [Hz]";"FRF s1 / s5 Real [g/N]";"FRF s1 / s5 Imag [g/N]"\n',
}


@pytest.mark.parametrize("head", HEADERS.values(), ids=HEADERS)
def test_headers_tell_pairs_parts_and_units(tmp_path, head):
    reading, frf = read(tmp_path, head + rows())
    assert (frf.kind, frf.outputs, frf.inputs) == ("accelerance", ("s1",), ("s5",))
    np.testing.assert_allclose(frf.H[:, 0, 0], G0 * H)
    assert any("multiplied by 9.80665" in note for note in reading.notes)


def test_signals_over_their_parts_with_units_below(tmp_path):
    """Signals, their parts, then "Units:" and the units, that of a signal once: SignalCalc's order."""
    head = (
        "Data written for:\tdemo\n\n\tH1,2\t\tH1,3\t\nFrequency\tReal\tImag\tReal\tImag\n\nUnits:\n"
        "Hz\t(m/s2)/N\t\t(m/s2)/N\t\n\n"
    )
    table = rows("\t", columns=[F, H.real, H.imag, 2 * H.real, 2 * H.imag])
    with_pairs = {"H1,2": "s2/s1", "H1,3": "s3/s1"}
    _, frf = read(tmp_path, head + table, pairs=with_pairs)
    assert (frf.outputs, frf.inputs) == (("s2", "s3"), ("s1",))
    np.testing.assert_allclose(frf.H[:, :, 0], np.column_stack([H, 2 * H]))
    reading, frf = read(tmp_path, head + table)  # which of 1 and 2 is the force is not told
    assert frf.outputs == ("out1", "out2")
    assert any("do not say response and force as a/b" in note for note in reading.notes)


def test_a_column_that_counts_the_lines_is_left_out(tmp_path):
    """Lines of text, then number, frequency, real and imaginary part: PULSE's order."""
    reading, frf = read(
        tmp_path,
        "Header\nanother line: 3\n" + rows("\t", columns=[[1, 2, 3], F, H.real, H.imag]),
        kind="mobility",
    )
    np.testing.assert_allclose(frf.frequency, F)
    np.testing.assert_allclose(frf.H[:, 0, 0], H)
    assert any("counts the lines" in note for note in reading.notes)


def polar(unit):
    return rows(columns=[F, np.abs(H), np.rad2deg(np.angle(H)) if unit == "deg" else np.angle(H)])


FORM = {"deg": "magnitude-degrees", "rad": "magnitude-radians"}


@pytest.mark.parametrize("unit", FORM)
def test_magnitude_and_phase(tmp_path, unit):
    head = f"Freq;Mag s1/s5;Phase s1/s5\nHz;m/s/N;{unit}\n"
    _, frf = read(tmp_path, head + polar(unit))
    assert frf.kind == "mobility"
    np.testing.assert_allclose(frf.H[:, 0, 0], H)
    _, frf = read(
        tmp_path,
        polar(unit),
        kind="mobility",
        form={"deg": "magnitude-degrees"}.get(unit, "magnitude-radians"),
    )
    np.testing.assert_allclose(frf.H[:, 0, 0], H)


def test_angles_without_a_unit_are_degrees_where_they_cannot_be_radians(tmp_path):
    head = "Freq;Mag;Phase\n"
    np.testing.assert_allclose(read(tmp_path, head + polar("deg"), kind="mobility")[1].H[:, 0, 0], H)
    with pytest.raises(TableError, match=r"column 3 does not say whether its angles, up to 2\.0.*are"):
        read(tmp_path, head + rows(columns=[F, np.abs(H), np.abs(np.angle(H))]), kind="mobility")


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("dB", 1), ("dB re 1e-3 (m/s²)/N", 1e-3), ("dB re 1 g/N", G0), ("dB (mm/s^2/N)", 1e-3)],
)
def test_levels_with_phase_and_their_reference(tmp_path, unit, factor):
    head = f"Freq;s1/s5 Mag [{unit}];s1/s5 Phase [°]\n"
    table = rows(columns=[F, 20 * np.log10(np.abs(H)), np.rad2deg(np.angle(H))])
    reading, frf = read(tmp_path, head + table, kind="accelerance")
    np.testing.assert_allclose(frf.H[:, 0, 0], factor * H)
    assert any("say no unit" in note for note in reading.notes) == (unit == "dB")


def test_amplitudes_alone_have_no_phase(tmp_path):
    level = rows(columns=[F, 20 * np.log10(np.abs(H)), 20 * np.log10(2 * np.abs(H))])
    reading, frf = read(tmp_path, "f;s1/s5;s2/s5\nHz;dB;dB\n" + level, kind="mobility")
    assert not reading.phase
    np.testing.assert_allclose(frf.H[:, :, 0], np.column_stack([np.abs(H), 2 * np.abs(H)]))
    with pytest.raises(TableError, match="amplitudes without phase"):
        read_frf(tmp_path / "a.txt", kind="mobility")
    size = rows(columns=[F, np.abs(H)])
    assert not read(tmp_path, "f;Magnitude\n" + size, kind="mobility")[0].phase
    assert not read(tmp_path, size, kind="mobility", form="magnitude")[0].phase
    with pytest.raises(TableError, match="some have negative values"):
        read(tmp_path, "f;s1/s5;s2/s5\n" + rows(), kind="mobility")


def test_both_forms_of_a_pair_and_its_coherence(tmp_path):
    """Real and imaginary part, magnitude and phase of one FRF say it twice; its coherence is kept."""
    table = rows(columns=[F, H.real, H.imag, np.abs(H), np.rad2deg(np.angle(H)), [0.9, 1.0, 0.5]])
    head = "Freq [Hz];a/b Real;a/b Imag;a/b Mag;a/b Phase [deg];a/b Coherence\n"
    reading, frf = read(tmp_path, head + table, kind="mobility")
    np.testing.assert_allclose(frf.H[:, 0, 0], H)
    np.testing.assert_allclose(reading.coherence[:, 0, 0], [0.9, 1.0, 0.5])


def test_each_pair_may_have_its_own_column_of_the_same_frequencies(tmp_path):
    columns = [F, H.real, H.imag, F, H.imag, H.real]
    head = "Freq;Real a/c;Imag a/c;Freq;Real b/c;Imag b/c\n"
    _, frf = read(tmp_path, head + rows(columns=columns), kind="mobility")
    np.testing.assert_allclose(frf.H[:, :, 0], np.column_stack([H, H.imag + 1j * H.real]))
    columns[3] = [1.0, 1.5, 2.5]
    with pytest.raises(TableError, match="columns 1 and 4 are both frequencies and differ"):
        read(tmp_path, head + rows(columns=columns), kind="mobility")


def test_words_of_a_title_are_no_frequencies_and_no_counts(tmp_path):
    head = "Frequency [Hz];Frequency Response Point 1/Point 2\nHz;dB\n"
    reading, frf = read(tmp_path, head + rows(columns=[F, 20 * np.log10(np.abs(H))]), kind="mobility")
    np.testing.assert_allclose(frf.H[:, 0, 0], np.abs(H))
    assert not reading.phase


def test_pairs_by_order_and_by_name_and_columns_left_out(tmp_path):
    head = "Freq;Kanal 3 Real;Kanal 3 Imag;Kanal 4 Real;Kanal 4 Imag\n"
    table = rows(columns=[F, H.real, H.imag, H.imag, H.real])
    _, frf = read(tmp_path, head + table, kind="mobility", pairs=("s1/h", "s2/h"))
    assert (frf.outputs, frf.inputs) == (("s1", "s2"), ("h",))
    reading, frf = read(tmp_path, head + table, kind="mobility", pairs={"Kanal 4 Real": "s2/h"})
    assert frf.outputs == ("s2",)
    assert any("Kanal 3 Real are in no pair" in note for note in reading.notes)
    for pairs, words in (
        (("s1/h",), "1 pairs are given for its 2 FRFs"),
        (("s1/h", "s2"), "the pair 's2' is not allowed"),
        ({"Kanal 5": "s1/h"}, "'Kanal 5', which is above no column; its columns have Kanal 3 Real"),
    ):
        with pytest.raises(TableError, match=words):
            read(tmp_path, head + table, kind="mobility", pairs=pairs)


TWO = "f [Hz];a/h Real [{}];a/h Imag [{}];b/h Real{};b/h Imag{}\n1;1;1;1;1\n2;1;1;1;1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1;2;3\n1;2;3\n2;3;4\n", "line 2 has 1 Hz again as line 1"),
        ("1;2;3\n3;2;3\n2;3;4\n", "line 3 has 2 Hz after 3 Hz of line 2"),
        ("f;a;b\n1;2;3\n2;nan;3\n3;4;5\n", "line 3, column 2 has a value that is not finite, 1 in all"),
        ("f;a;b\n1;2;3\n2;1.#QNAN;3\n3;4;5\n", "line 3, column 2 has a value that is not finite"),
        ("f;a;b\n1;2;3\n2;;3\n3;4;5\n", "line 3, column 2 has '' where a number is expected"),
        ("f;a;b\n1;2;3\n2;3;4\n3;4\n", "line 4 has 2 columns, the first line of data has 3"),
        ("f;a;b\n1;2;3\n2;3;4\n3;4;5e\n", "line 4, column 3 has '5e' where a number"),
        ("1;2,5;3.000\n2;2,5;1.200\n", "its numbers have commas and points"),
        ("1,5, 2,5\n2,5, 3,5\n", "commas with and without a blank behind them"),
        (TWO.format("g/N", "g/N", " [m/N]", " [m/N]"), "of one kind"),
        (TWO.format("g/N", "g/N", "", ""), "has no unit and other"),
        (TWO.format("V/N", "V/N", " [V/N]", " [V/N]"), r"the unit 'V/N', which is none .* give scale"),
        (TWO.format("m/N", "m/N", " [m/N]", ""), "'m/N' is that of receptance, and kind is acc"),
        ("f;a/h Real;b/h Real\n1;1;1\n2;1;1\n", "is a real part alone"),
        ("f;a/h Real;a/h Real\n1;1;1\n2;1;1\n", "the header names a/h twice"),
        ("f;a/h Mag;a/h Phase [deg]\n1;-1;1\n2;1;1\n", r"line 2, column 2 has the magnitude -1.*decibel"),
        ("only words\nand more\n", "where a number|no lines of data"),
        ("\0\1\2binary", "it is no text"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, text, words):
    with pytest.raises(TableError, match=rf"^a\.txt: .*(?:{words})"):
        read(tmp_path, text, kind="accelerance")


def test_unit_labels_do_not_count_where_the_user_scales(tmp_path):
    _, frf = read(
        tmp_path, "f [Hz];a/h Real [V/N];a/h Imag [V/N]\n1;1;1\n2;1;1\n", kind="mobility", unit_labels=False
    )
    np.testing.assert_array_equal(frf.H[:, 0, 0], [1 + 1j, 1 + 1j])


@pytest.mark.parametrize(
    ("label", "kind", "factor"),
    [
        ("g/N", "accelerance", G0),
        ("(m/s²)/N", "accelerance", 1),
        ("m/s^2/N", "accelerance", 1),
        ("mm/s/N", "mobility", 1e-3),
        ("m/N", "receptance", 1),
        ("µm/kN", "receptance", 1e-9),
        ("1/kg", "accelerance", 1),
        ("s/kg", "mobility", 1),
        ("s^2/kg", "receptance", 1),
        ("m/(N m)", "receptance", 1),
        ("mm/s/(N mm)", "mobility", 1),
        ("in/lbf", "receptance", 0.0254 / 4.4482216152605),
    ],
)
def test_units_of_frfs(label, kind, factor):
    unit = frf_unit(label)
    assert unit is not None
    assert unit.kind == kind
    assert unit.factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("label", ["V/N", "g", "N", "s1/s5", "", "m/s²", "Hz", "g/g"])
def test_other_labels_are_no_units_of_frfs(label):
    assert frf_unit(label) is None


def test_references_of_levels():
    assert decibel_reference("dB") == (1.0, "")
    assert decibel_reference("dB re 1e-6 m/N") == (1e-6, "m/N")
    assert decibel_reference("dB (g/N)") == (1.0, "g/N")
    assert decibel_reference("m/N") is None


def test_a_universal_file_with_another_ending_is_read_as_what_it_is(tmp_path):
    from fem import FRF
    from fem.io import write_uff

    frf = FRF.from_arrays(F, H, "accelerance", ["1Z+"], ["2Z+"])
    write_uff(tmp_path / "a.uff", frf)
    (tmp_path / "b.txt").write_bytes((tmp_path / "a.uff").read_bytes())
    np.testing.assert_allclose(read_frf(tmp_path / "b.txt").H[:, 0, 0], H)


@pytest.mark.parametrize(
    ("column", "cut"),
    [
        (["0.5", "0.25", "0"], False),
        (["1.5", "2.25", "3"], False),
        (["0.125", "0.25"], False),
        (["1", "2", "3"], False),
        (["0.12", "0.13", "0.14", "0.15", "0.1"], True),
        (["0.12", "0.1", "0.14", "0.15", "0.1"], False),
        (["0.1234", "0.12"], True),
        (["1.2e-05", "1.3e-05", "1.4e-0"], True),
        (["1.2e-05", "1.3e-05", "1.4"], True),
        (["1.2e-05", "1.3", "1.4"], False),
        (["1.5", "2.5", "3."], True),
        (["1.", "2.", "3."], False),
        (["1,234", "2,345", "2,"], True),
    ],
)
def test_a_last_number_without_a_line_end(column, cut):
    assert bool(cut_number(column, ())) == cut


def test_frfs_whose_last_number_is_cut_are_refused(tmp_path):
    rows = ["# kind: accelerance", "frequency_Hz,re(1Z+/1Z+),im(1Z+/1Z+)", "1.0,0.1257302210933933,-0.31630"]
    (tmp_path / "h.csv").write_text("\n".join(rows), encoding="utf-8")
    with pytest.raises(TableError, match=r"^h\.csv: line 3: its last number '-0\.31630' has fewer decimals"):
        read_csv(tmp_path / "h.csv")
    (tmp_path / "h.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")
    assert read_csv(tmp_path / "h.csv").H[0, 0, 0] == 0.1257302210933933 - 0.3163j


# LMS Testlab text: a row for each key, its value above the first column of each function
KEYS = {
    "Resolution": "1 Hz",
    "X axis unit": "Hz",
    "Value type": "Complex",
    "Y axis quantity": "AccelerationOverForce",
    "Y axis unit": "g/N",
    "Reference DOF id": "Point:2:-Z",
    "Number of averages": "3",
    "DOF id": "Point:3:-Z",
    "Original project dir": "C:\\data/of\\test.lms",
    "Function class": "FRF",
}
GAMMA = np.linspace(0.8, 1, 24)
LINES = np.arange(1.0, 25.0)
LONG = np.tile(H, 8) * np.linspace(1, 2, 24)
RE_IM = [LONG.real, LONG.imag]


def lms_text(functions, mark="\t", layout="shared", order=1, **other):
    """Return the text of functions, each given by the values that differ from KEYS and its columns.

    ``layout`` is "shared" for one column of frequencies, "spaced" with an empty column between functions,
    "blocks" for keys and frequencies of each, and "repeated" with values above every column.
    """
    lines = [[key] for key in [*KEYS][::order]]
    numbers = [[f"{f:g}"] for f in LINES]
    for k, (values, columns) in enumerate(functions):
        if k and layout in ("spaced", "blocks"):
            lines, numbers = ([[*row, ""] for row in part] for part in (lines, numbers))
        if k and layout == "blocks":
            lines = [[*row, row[0]] for row in lines]
            numbers = [[*row, row[0]] for row in numbers]
        again = layout == "repeated"
        for row in lines:
            value = {**KEYS, **other, **values}[row[0]]
            row += [value, *[value if again else ""] * (len(columns) - 1)]
        for row, cells in zip(numbers, zip(*columns, strict=True), strict=True):
            row += [x if isinstance(x, str) else f"{x:.9e}" for x in cells]
    return "\n".join(mark.join([*row, "", ""]) for row in [*lines, *numbers]) + "\n"


SECOND = {"DOF id": "Point:5:+X"}


@pytest.mark.parametrize("mark", ["\t", ";", ","])
@pytest.mark.parametrize("order", [1, -1])
def test_testlab_text_gives_points_directions_quantity_and_unit(tmp_path, mark, order):
    text = lms_text([({}, RE_IM)], mark, order=order)
    reading, frf = read(tmp_path, text)
    assert (frf.kind, frf.outputs, frf.inputs, reading.stated) == ("accelerance", ("3Z-",), ("2Z-",), True)
    np.testing.assert_allclose(frf.frequency, LINES)
    np.testing.assert_allclose(frf.H[:, 0, 0], LONG * G0)
    if mark != ",":
        np.testing.assert_allclose(read(tmp_path, text.replace(".", ","))[1].H, frf.H)


@pytest.mark.parametrize("averages", ["\u00b2", "1" * 5000, "-3", "3.5", "many"])
def test_what_is_no_number_of_averages_is_left_out(tmp_path, averages):
    coherence = {"Function class": "Coherence", "Value type": "Real", "Y axis unit": ""}
    text = lms_text([({}, RE_IM), (coherence, [GAMMA])], **{"Number of averages": averages})
    assert read(tmp_path, text)[0].averages is None


@pytest.mark.parametrize("layout", ["shared", "spaced", "blocks", "repeated"])
def test_testlab_functions_side_by_side(tmp_path, layout):
    reading, frf = read(
        tmp_path, lms_text([({}, RE_IM), (SECOND, [2 * LONG.real, 2 * LONG.imag])], layout=layout)
    )
    assert (frf.outputs, frf.inputs) == (("3Z-", "5X+"), ("2Z-",))
    np.testing.assert_allclose(frf.H[:, :, 0], np.column_stack([LONG, 2 * LONG]) * G0)
    assert reading.notes == ("FRFs in 'g/N' are multiplied by 9.80665",)


def test_testlab_coherence_goes_with_its_frf_and_other_functions_are_noted(tmp_path):
    coherence = {"Function class": "Coherence", "Value type": "Real", "Y axis unit": ""}
    power = {"Function class": "AutoPower Spectrum", "Value type": "Real"}
    reading, frf = read(tmp_path, lms_text([({}, RE_IM), (coherence, [GAMMA]), (power, [5 + LINES])]))
    np.testing.assert_allclose(frf.H[:, 0, 0], LONG * G0)
    np.testing.assert_allclose(reading.coherence[:, 0, 0], GAMMA)
    assert reading.averages == 3
    assert any("no FRF (AutoPower Spectrum) and left out" in note for note in reading.notes)


POLAR = [np.abs(LONG), np.degrees(np.angle(LONG))]


@pytest.mark.parametrize(
    ("heading", "value_type", "columns", "assumed"),
    [
        ("Hz\tg/N\t°\n", "Complex", POLAR, False),
        ("Hz\tg/N\trad\n", "Complex", [np.abs(LONG), np.angle(LONG)], False),
        ("Frequency\tAmplitude\tPhase [deg]\n", "Complex", POLAR, False),
        ("", "Amplitude/Phase (deg)", POLAR, False),
        ("", "Complex", POLAR, True),
    ],
)
def test_testlab_amplitude_and_phase(tmp_path, heading, value_type, columns, assumed):
    text = lms_text([({}, columns)], **{"Value type": value_type})
    head, mark, numbers = text.partition(f"{LINES[0]:g}\t{columns[0][0]:.9e}")
    reading, frf = read(tmp_path, head + heading + mark + numbers)
    np.testing.assert_allclose(frf.H[:, 0, 0], LONG * G0)
    assert any("are taken for amplitude and phase [deg]" in note for note in reading.notes) == assumed


def test_mobility_of_a_driving_point_is_not_taken_for_an_amplitude(tmp_path):
    mobility = {"Y axis quantity": "VelocityOverForce", "Y axis unit": "(m/s)/N"}
    reading, frf = read(tmp_path, lms_text([({}, [np.abs(LONG.real), LONG.imag])], **mobility))
    np.testing.assert_allclose(frf.H[:, 0, 0], np.abs(LONG.real) + 1j * LONG.imag)
    assert frf.kind == "mobility"
    assert any("are taken for real and imaginary part" in note for note in reading.notes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (lms_text([({}, RE_IM)], **{"Y axis unit": "(m/s)/N"}), "unit '(m/s)/N' is that of mobility"),
        (lms_text([({}, RE_IM)], **{"Function class": "Time"}), "it has no FRF: its functions are Time"),
        (lms_text([({}, [LONG.real])]), "export its real and imaginary part"),
        (
            lms_text([({}, RE_IM), ({**SECOND, "Y axis quantity": "VelocityOverForce"}, RE_IM)]),
            "FRFs of one kind are needed",
        ),
        (lms_text([({}, RE_IM), ({}, RE_IM)]), "twice"),
    ],
)
def test_what_testlab_text_contradicts_is_refused(tmp_path, text, words):
    with pytest.raises(TableError, match=words.replace("(", r"\(").replace(")", r"\)")):
        read(tmp_path, text)


def test_a_value_with_its_unit_is_no_unit_of_a_column(tmp_path):
    _, frf = read(tmp_path, f"Resolution;0.5 Hz;\n{rows()}", kind="mobility")
    np.testing.assert_allclose(frf.frequency, F)


def test_named_column_that_is_blank_throughout_is_refused(tmp_path):
    with pytest.raises(TableError, match=r"column 3 \('gap'\) is blank in all lines"):
        read(tmp_path, "f;re;gap;im\n1;2;;3\n2;3;;4\n", kind="mobility")
