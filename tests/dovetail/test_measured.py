"""What is wrong with measured files is said before anything is fitted, and no model's command needs them."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.file import LazyComparison, fault_table
from fem import FRF, Modes
from fem.analysis.frf import WITHOUT_PHASE
from fem.io import Function, read_npz, write_csv, write_npz, write_uff
from tests.frames import MAST
from tests.studies import study_file, study_from
from updating import Fault

STUDY = (
    MAST.replace("1.0]", "1.2]")
    + """
[damping]
modal = 0.005

[[sensors]]
name = "low"
point = [0.0, 0.0, 0.4]
direction = "x"

[[sensors]]
name = "mid"
point = [0.0, 0.0, 0.8]
direction = "x"

[[sensors]]
name = "top"
point = "tip"
direction = "x"

[[excitations]]
sensor = "top"

[frequency]
start = 1.0
stop = 200.0
step = 0.25
"""
)
FILE = '\n[[measurements]]\nfile = "m.npz"\n'


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mast")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    assert main(["frf", str(folder / "study.toml"), "--out", str(folder / "m.npz"), "--quiet"]) == 0
    frf = read_npz(folder / "m.npz")
    g = np.random.default_rng(3).standard_normal((2, *frf.H.shape))
    return replace(frf, H=frf.H * (1 + 0.02 * (g[0] + 1j * g[1])))


@pytest.fixture
def load(tmp_path, computed):
    """Write values as the measurement of the study, with more lines to it, and load it."""

    def inner(H, more="", text=STUDY, **changes):
        write_npz(tmp_path / "m.npz", replace(computed, H=H, **changes))
        return study_from(tmp_path, text + FILE + more)

    return inner


def with_row(H, i, row):
    out = H.copy()
    out[:, i] = row
    return out


def of_sensor(name, line):
    return STUDY.replace(f'name = "{name}"', f'name = "{name}"\n{line}')


def test_a_right_measurement_passes_without_a_word(load, computed):
    assert load(computed.H).warnings == ()


def test_conjugated_frfs_are_refused_and_the_remedy_undoes_it(load, computed):
    with pytest.raises(StudyError, match=r"measurements\[1\].*e\^\{-iωt\}.*conjugate = true in \[\[measure"):
        load(computed.H.conj())
    study = load(computed.H.conj(), "conjugate = true\n")
    np.testing.assert_array_equal(study.measurements[0].frf.H, computed.H)
    assert study.warnings == ()
    unchecked = load(computed.H.conj(), "check_phase = false\n")
    np.testing.assert_array_equal(unchecked.measurements[0].frf.H, computed.H.conj())


def test_too_few_lines_to_be_sure_are_judged_beside_the_model(load, computed):
    """Lines 2 Hz apart have one or none in the width of a resonance."""
    some = slice(None, None, 8)
    changes = {"frequency": computed.frequency[some]}
    assert load(computed.H[some], **changes).warnings == ()
    with pytest.raises(
        StudyError, match=r"imaginary parts have the opposite sign of the model's; give conjugate = true"
    ):
        load(computed.H[some].conj(), **changes)
    (text,) = load(computed.H[some].conj(), text=STUDY.replace("210e9", "70e9"), **changes).warnings[:1]
    assert "too small to be sure" in text


def test_one_conjugated_sensor_is_named_with_its_remedy(load, computed):
    H = with_row(computed.H, 1, computed.H[:, 1].conj())
    with pytest.raises(StudyError, match=r"sensors\[2\]: .*sensor mid in .*conjugate = true in its"):
        load(H)
    study = load(H, text=of_sensor("mid", "conjugate = true"))
    np.testing.assert_array_equal(study.measurements[0].frf.H, computed.H)


def test_both_conventions_undo_each_other(load, computed):
    """Of a file for e^{-iωt} with one sensor for e^{+iωt}."""
    H = with_row(computed.H.conj(), 0, computed.H[:, 0])
    study = load(H, "conjugate = true\n", text=of_sensor("low", "conjugate = true"))
    np.testing.assert_array_equal(study.measurements[0].frf.H, computed.H)
    force = of_sensor("low", "conjugate = true").replace('sensor = "top"', 'sensor = "top"\nconjugate = true')
    study = load(H, text=force)
    np.testing.assert_array_equal(study.measurements[0].frf.H, computed.H)


@pytest.mark.parametrize(("factor", "degrees"), [(1j, -90), (-1j, 90)])
def test_a_factor_i_is_refused_and_the_remedy_undoes_it(load, computed, factor, degrees):
    with pytest.raises(StudyError, match=rf"quarter turn.*give phase = {degrees} in \[\[measurements\]\]"):
        load(factor * computed.H)
    study = load(factor * computed.H, f"phase = {degrees}\n")
    np.testing.assert_allclose(study.measurements[0].frf.H, computed.H, rtol=1e-12)


def test_a_sensor_of_another_kind_is_named_with_that_kind(load, computed):
    """A vibrometer among accelerometers."""
    velocity = computed.H[:, 1] / (1j * computed.omega[:, None])
    H = with_row(computed.H, 1, velocity)
    with pytest.raises(StudyError, match=r"sensors\[2\]: .*give kind = \"mobility\" in its \[\[sensors\]\]"):
        load(H)
    study = load(H, text=of_sensor("mid", 'kind = "mobility"'))
    np.testing.assert_allclose(study.measurements[0].frf.H, computed.H, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "called"),
    [
        ("receptance", "accelerance"),
        ("mobility", "accelerance"),
        ("accelerance", "receptance"),
        ("accelerance", "mobility"),
    ],
)
def test_another_kind_is_refused_with_the_right_one(load, computed, kind, called):
    H = computed.as_kind(kind).H
    with pytest.raises(StudyError, match=f'give kind = "{kind}"'):
        load(H, kind=called)
    assert load(H, kind=kind).warnings == ()


@pytest.mark.parametrize("gain", [1.0, 500.0, 2e-3])
def test_phase_and_slope_tell_the_power_of_frequency_whatever_the_gain(load, computed, gain):
    """By the size alone 500 times a mobility is an accelerance times i."""
    iw = 1j * computed.omega[:, None, None]
    mobility, receptance = computed.as_kind("mobility").H, computed.as_kind("receptance").H
    with pytest.raises(StudyError, match=r'1/\(iω\) times the accelerance.*give kind = "mobility"'):
        load(gain * mobility, kind="accelerance")
    with pytest.raises(StudyError, match=r'iω times the receptance.*give kind = "mobility"'):
        load(gain * mobility, kind="receptance")
    with pytest.raises(StudyError, match=r"i times the accelerance.*give phase = -90"):
        load(gain * 1j * computed.H)
    with pytest.raises(StudyError, match=r"iω times the accelerance.*divide its values by that factor"):
        load(gain * iw * computed.H)  # a jerk
    with pytest.raises(StudyError, match=r"1/\(iω\) times the receptance.*divide its values by that factor"):
        load(gain * receptance / iw, kind="receptance")
    with pytest.raises(StudyError, match=r'1/\(iω\)² times as large; give kind = "receptance"'):
        load(gain * receptance, kind="accelerance")


def test_a_force_off_by_a_power_of_frequency_has_no_remedy_in_the_study(load, computed):
    """A phase would leave the factor ω in its FRFs."""
    second = '\n[[excitations]]\nname = "other"\npoint = "tip"\ndirection = "x"\n'
    text = STUDY.replace("\n[frequency]", f"{second}\n[frequency]")
    H = np.concatenate([computed.H, 1j * computed.omega[:, None, None] * computed.H], axis=2)
    with pytest.raises(StudyError, match=r"iω times the accelerance.*divide its values by that factor"):
        load(H, text=text, inputs=("top", "other"))


def test_a_force_against_its_sensor_is_a_warning(load, computed):
    (text,) = load(-computed.H).warnings
    assert "gives power to the force at top" in text


@pytest.mark.parametrize(("unit", "size"), [("rad/s", 1 / (2 * np.pi)), ("kHz", 1e3), ("cpm", 1 / 60)])
def test_another_frequency_unit_is_a_warning_and_can_be_given(load, computed, unit, size):
    frequency = computed.frequency / size
    (text,) = load(computed.H, frequency=frequency).warnings
    assert f'frequency_unit = "{unit}"' in text
    assert "natural frequencies" in text
    study = load(computed.H, f'frequency_unit = "{unit}"\n', frequency=frequency)
    assert study.warnings == ()
    np.testing.assert_allclose(study.measurements[0].frf.frequency, computed.frequency, rtol=1e-12)


def test_a_unit_that_the_study_gives_wrongly_is_named(load, computed):
    study = load(computed.H, 'frequency_unit = "kHz"\n')
    (text,) = [w for w in study.warnings if "frequenc" in w]
    for words in ("are in Hz", "in kHz", 'frequency_unit = "Hz"', "factor of 0.001"):
        assert words in text


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (np.conj, "conjugated"),
        (lambda H: -H, "with the opposite sign"),
        (lambda H: 1j * H, "multiplied by -i"),
    ],
)
def test_a_repeat_in_another_convention_is_refused(load, computed, tmp_path, turn, words):
    rng = np.random.default_rng(3)
    noise = 0.3 * np.abs(computed.H) * (rng.standard_normal(computed.H.shape) + 1j)
    write_npz(tmp_path / "again.npz", replace(computed, H=turn(computed.H) + noise))
    with pytest.raises(StudyError, match=rf"again\.npz are nearer to those of the first file {words}"):
        load(computed.H, 'repeats = ["again.npz"]\n')
    write_npz(tmp_path / "again.npz", replace(computed, H=computed.H + noise))
    load(computed.H, 'repeats = ["again.npz"]\n')


def test_a_unit_is_a_warning_that_the_report_of_compare_repeats(load, computed, tmp_path, capsys):
    study = load(0.34 * computed.H)
    (text,) = study.warnings
    for words in ("0.34 times the model's", "scale = 2.20462", "2.94 times too light and soft"):
        assert words in text
    assert main(["compare", str(study.path)]) == 0
    assert f"warning: {text}" in capsys.readouterr().err
    assert load(0.34 * computed.H, "check_units = false\n").warnings == ()


def test_compare_names_exchanged_and_reversed_responses(load, computed, tmp_path, capsys):
    """Of two accelerometers: the search for faults needs more of them."""
    text = STUDY.replace('[[sensors]]\nname = "mid"\npoint = [0.0, 0.0, 0.8]\ndirection = "x"\n\n', "")
    H, ends = computed.H[:, [0, 2]], {"outputs": ("low", "top")}
    for measured, said in (
        (H, []),
        (H[:, ::-1], ["'low' and 'top' look exchanged: their error is"]),
        (with_row(H, 0, -H[:, 0]), ["'low' looks reversed: its phase is opposite to the model's at 100 %"]),
    ):
        study = load(measured, text=text, **ends)
        assert main(["compare", str(study.path), "--json", str(tmp_path / "c.json")]) == 0
        found = json.loads((tmp_path / "c.json").read_text())["suspected_labels"]
        assert [words in line for words, line in zip(said, found, strict=True)] == [True] * len(said)
        printed = capsys.readouterr().out
        assert all(line in printed for line in found)


def test_compare_names_one_reversed_force_rather_than_three_responses(load, computed, tmp_path, capsys):
    study = load(-computed.H)
    assert main(["compare", str(study.path), "--json", str(tmp_path / "c.json")]) == 0
    (line,) = json.loads((tmp_path / "c.json").read_text())["suspected_labels"]
    assert "force 'top' looks reversed: its phase is opposite to the model's at 100 %" in line
    assert "gives power to the force" in line
    assert line in capsys.readouterr().out


ROVING = (
    STUDY.replace("[[sensors]]", "[[excitations]]")
    .replace('[[excitations]]\nsensor = "top"\n', "")
    .replace(
        "[frequency]", '[[sensors]]\nname = "accelerometer"\npoint = "tip"\ndirection = "x"\n\n[frequency]'
    )
)
"""The forces of a hammer at three places, and one accelerometer at the last."""


@pytest.fixture
def roving(load, computed):
    """Load the measurement of a roving hammer, its forces changed by factors."""

    def inner(factors=(1, 1, 1)):
        H = np.swapaxes(computed.H, 1, 2) * np.array(factors)
        return load(H, text=ROVING, outputs=("accelerometer",), inputs=("low", "mid", "top"))

    return inner


def test_compare_has_a_row_for_each_place_of_a_roving_hammer(roving, tmp_path, capsys):
    study = roving((1, -1, 1))
    assert main(["compare", str(study.path), "--json", str(tmp_path / "c.json")]) == 0
    head, *rows = capsys.readouterr().out.splitlines()[1:5]
    assert head.startswith("excitation ")
    assert [row.split()[0] for row in rows] == ["low", "mid", "top"]
    found = json.loads((tmp_path / "c.json").read_text())
    assert [row["excitation"] for row in found["excitations"]] == ["low", "mid", "top"]
    (line,) = found["suspected_labels"]
    assert "force 'mid' looks reversed" in line


def test_shapes_of_a_roving_hammer_are_those_of_its_places(roving, computed, tmp_path, capsys):
    """By reciprocity they are those of three accelerometers and one force."""
    study = roving()
    out, other = tmp_path / "modes.npz", tmp_path / "other.npz"
    assert main(["identify-modes", str(study.path), "--out", str(out)]) == 0
    assert "3 places of forces" in capsys.readouterr().out
    with np.load(out) as modes:
        assert modes["labels"].tolist() == ["low", "mid", "top"]
        shapes = modes["shapes"]
    assert main(["identify-modes", str(study.path), "--out", str(tmp_path / "modes.uff")]) == 0
    (tmp_path / "fixed").mkdir()
    write_npz(tmp_path / "fixed" / "m.npz", computed)
    fixed = study_from(tmp_path / "fixed", STUDY + FILE)
    assert main(["identify-modes", str(fixed.path), "--out", str(other)]) == 0
    with np.load(other) as modes:
        np.testing.assert_allclose(shapes, modes["shapes"], rtol=1e-6)


def test_a_fault_of_a_force_is_written_and_read(load, computed, roving):
    """A shift moves the channel; the label of one force is exchanged with another's."""
    fault = Fault("sensor_position", "low", 0.4, 0.0, "m", "the place of mid", shift=(0.0, 0.0, 0.4))
    study = load(computed.H, "\n" + fault_table(fault))
    np.testing.assert_allclose(study.measurements[0].sensors[0].point, [0, 0, 0.8])
    np.testing.assert_allclose(study.sensors[0].point, [0, 0, 0.8])
    assert study.measurements[0].frf.outputs == ("low", "mid", "top")
    text = ROVING + FILE + "\n" + fault_table(Fault("excitation_swap", "low", 0.0, 0.0, other="top"))
    right, swapped = roving(), study_from(study.path.parent, text)
    np.testing.assert_array_equal(swapped.measurements[0].frf.H, right.measurements[0].frf.H[:, :, [2, 1, 0]])
    with pytest.raises(StudyError, match=r"faults\[1\]\.other: there is no excitation 'tip'"):
        study_from(study.path.parent, text.replace('other = "top"', 'other = "tip"'))


def test_amplitudes_without_phase_are_compared_and_no_modes_are_identified(load, computed, tmp_path, capsys):
    """Values that are real and never negative are amplitudes, whoever wrote them and whatever their type."""
    size = np.abs(computed.H)
    path = tmp_path / "study.toml"
    load(size.astype(complex))
    np.savez(
        tmp_path / "n.npz",
        frequency=computed.frequency,
        H=size,
        kind="accelerance",
        outputs=computed.outputs,
        inputs=computed.inputs,
    )
    for name in ("m", "n"):
        path.write_text(STUDY + FILE.replace("m.npz", f"{name}.npz"), encoding="utf-8")
        study = load_study(path)
        assert study.measurements == ()
        np.testing.assert_allclose(study.amplitudes[0].frf.H, size)
        assert any(w == f"{name}.npz has {WITHOUT_PHASE}" for w in study.warnings)
    assert main(["compare", str(path), "--json", str(tmp_path / "c.json")]) == 0
    found = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    # the noise of 2 % in each part is one of 2 % in amplitude, 0.17 dB, and more in antiresonances
    assert 0.15 < found["error_db"] < 0.5
    assert found["sensors"][0]["frac"] == [None]
    assert "no phase" in found["missing"]["frac"]
    capsys.readouterr()
    assert main(["identify-modes", str(path)]) == 2
    assert "in n.npz amplitudes without phase, which are not used as FRFs" in capsys.readouterr().err
    path.write_text(path.read_text(encoding="utf-8") + '\n[update]\nto = "modes"\n', encoding="utf-8")
    with pytest.raises(StudyError, match="the study has no data for 'modes'"):
        load_study(path)


def test_amplitudes_that_could_be_parts_are_refused(computed, tmp_path):
    size = np.abs(computed.H)
    path = tmp_path / "study.toml"
    path.write_text(
        STUDY + '[[measurements]]\nfile = "m.csv"\nkind = "accelerance"\noutputs = "low"\ninputs = "top"\n',
        encoding="utf-8",
    )
    table = np.column_stack([computed.frequency, size[:, :2, 0]])
    np.savetxt(tmp_path / "m.csv", table, delimiter=",")  # two amplitudes, which pass for one FRF's two parts
    with pytest.raises(StudyError, match="columns look like amplitudes"):
        load_study(path)
    np.savetxt(tmp_path / "m.csv", table[:, :2], delimiter=",")
    with pytest.raises(StudyError, match=re.escape(WITHOUT_PHASE)):
        load_study(path)
    every = path.read_text(encoding="utf-8").replace('outputs = "low"', 'outputs = "low mid top"')
    path.write_text(every + 'form = "magnitude"\n', encoding="utf-8")
    np.savetxt(tmp_path / "m.csv", np.column_stack([computed.frequency, size[:, :, 0]]), delimiter=",")
    np.testing.assert_allclose(load_study(path).amplitudes[0].frf.H, size)
    units = (18, 12, 13, "Hz", "m/s^2", "N")
    records = [
        Function(4, f"{node}X+", "3X+", "", "", computed.frequency, size[:, k, 0], *units, (), 0, 0, "")
        for k, node in enumerate((1, 2, 3))
    ]
    write_uff(tmp_path / "m.uff", functions=records)
    path.write_text(f'{STUDY}[[measurements]]\nfile = "m.uff"\n', encoding="utf-8")
    with pytest.raises(StudyError, match=f"its values are real: {re.escape(WITHOUT_PHASE)}"):
        load_study(path)


def uff_study(folder, computed, label, factor, unit=""):
    """Write the FRFs with the frequencies of another unit and its label, and a study that reads them."""
    written = Path(folder) / "m.uff"
    frf = replace(computed, frequency=computed.frequency / factor)
    dofs = {"low": "1X+", "mid": "2X+", "top": "3X+"}
    write_uff(written, frf, dofs=dofs, binary=False)
    blank = f" {'Hz':<20}"
    text = written.read_text(encoding="utf-8")
    assert text.count(blank) == 3
    written.write_text(text.replace(blank, f" {label:<20}"), encoding="utf-8")
    text = STUDY
    for name, dof in dofs.items():
        text = text.replace(f'name = "{name}"\n', f'name = "{name}"\nlabel = "{dof}"\n')
    path = Path(folder) / "study.toml"
    path.write_text(f'{text}[[measurements]]\nfile = "m.uff"\n{unit}', encoding="utf-8")
    return path


@pytest.mark.parametrize(("label", "size"), [("rad/s", 1 / (2 * np.pi)), ("kHz", 1e3), ("rpm", 1 / 60)])
def test_frequencies_that_a_label_converts_are_converted_once(tmp_path, computed, label, size):
    for unit in ("", f'frequency_unit = "{label}"\n'):
        study = load_study(uff_study(tmp_path, computed, label, size, unit))
        found = study.measurements[0].frf.frequency
        np.testing.assert_allclose(found, computed.frequency, rtol=1e-6)
    for other in {"Hz", "kHz", "rad/s", "cpm"} - {label, "cpm" if label == "rpm" else ""}:
        path = uff_study(tmp_path, computed, label, size, f'frequency_unit = "{other}"\n')
        with pytest.raises(
            StudyError, match=f"frequency_unit: it is '{other}', and the file labels .*'{label}'"
        ):
            load_study(path)


def test_notes_of_a_measured_file_reach_the_commands(tmp_path, computed, capsys):
    """Records that come again, another load case and a dataset that is not read, as text and as JSON."""
    path = uff_study(tmp_path, computed, "Hz", 1.0)
    text = (tmp_path / "m.uff").read_text(encoding="utf-8")
    first = text.index("    -1\n    58\n")
    records = text[first:]
    other = records.replace(f"{4:5d}{0:10d}{0:5d}{0:10d} NONE", f"{4:5d}{0:10d}{0:5d}{7:10d} NONE")
    assert other.count(f"{4:5d}{0:10d}{0:5d}{7:10d} NONE") == 3
    again = records[: records.index("    -1\n    -1\n") + 7]
    strange = "    -1\n  9999\nsomething\n    -1\n"
    (tmp_path / "m.uff").write_text(text + again + other + strange, encoding="utf-8")
    said = load_study(path).measured_notes
    for words in (
        "m.uff: FRFs of 2 load cases (0, 7) are separate matrices",
        "FRF 1X+/3X+: it comes again with the same values and counts once",
        "datasets of type 9999 are not read",
        "m.uff: matrix 2: load case 7",
    ):
        assert sum(words in note for note in said) == 1
    assert not set(said) & set(load_study(path).assumptions)
    out = tmp_path / "out.json"
    for command in ("check", "modes", "compare", "identify-modes"):
        assert main([command, str(path), "--json", str(out)]) == 0
        printed = capsys.readouterr().out
        assert all(printed.count(note) == 1 for note in said)
        assert json.loads(out.read_text(encoding="utf-8"))["measured_notes"] == list(said)


def test_a_label_of_hz_gives_way_to_the_study(tmp_path, computed):
    path = uff_study(tmp_path, computed, "Hz", 1 / (2 * np.pi), 'frequency_unit = "rad/s"\n')
    found = load_study(path).measurements[0].frf.frequency
    np.testing.assert_allclose(found, computed.frequency, rtol=1e-6)


@pytest.mark.parametrize("degrees", [True, False])
def test_amplitude_and_angle_are_not_taken_for_parts(tmp_path, computed, degrees):
    h = computed.H[:, 2, 0]
    table = np.column_stack([computed.frequency, np.abs(h), np.angle(h, deg=degrees)])
    np.savetxt(tmp_path / "m.csv", table, delimiter=",")
    text = STUDY.split("[[sensors]]")
    body = text[0] + "[[sensors]]" + text[3] + '[[measurements]]\nfile = "m.csv"\nkind = "accelerance"\n'
    path = study_file(tmp_path, body + 'outputs = ["top"]\ninputs = ["top"]\n')
    with pytest.raises(StudyError, match='give form = "magnitude-degrees"'):
        load_study(path)


def test_parts_in_a_table_are_still_read(tmp_path, computed):
    write_csv(tmp_path / "m.csv", computed)
    path = study_file(tmp_path, STUDY + FILE.replace("npz", "csv"))
    assert load_study(path).warnings == ()


BROKEN = {
    "no file": ("", '[[measurements]]\nfile = "none.npz"\n'),
    "no archive": ("", '[[measurements]]\nfile = "study.toml"\nkind = "mobility"\n'),
    "conjugated": ("", '[[measurements]]\nfile = "conj.npz"\n'),
    "no such channel": ('[[sensors]]\nname = "z"\npoint = "tip"\ndirection = "z"\n', FILE),
    "a sensor nowhere": ('[[sensors]]\nname = "z"\npoint = [9, 9, 9]\ndirection = "z"\n', ""),
    "an excitation nowhere": ('[[excitations]]\nsensor = "none"\n', ""),
    "no modes": ("", '[modes]\nfile = "none.unv"\n'),
    "held out": (
        '[[sensors]]\nname = "z"\npoint = [9, 9, 9]\ndirection = "z"\n',
        '[fit]\nheld_out = ["z"]\n',
    ),
}


@pytest.mark.parametrize("case", BROKEN)
@pytest.mark.parametrize("command", ["modes", "check"])
def test_commands_of_the_model_need_no_measurement(tmp_path, computed, capsys, command, case):
    """A bad file is named; natural frequencies are those without it. The check counts it as a fault."""
    write_npz(tmp_path / "m.npz", computed)
    write_npz(tmp_path / "conj.npz", replace(computed, H=computed.H.conj()))
    bare, path = tmp_path / "bare.toml", tmp_path / "study.toml"
    bare.write_text(STUDY, encoding="utf-8")
    path.write_text(STUDY + "".join(BROKEN[case]), encoding="utf-8")
    assert main([command, str(bare)]) == 0
    out = capsys.readouterr().out
    before = out.split("assumed")[0].splitlines()[1:]
    assert main([command, str(path)]) == (2 if command == "check" else 0)
    after = capsys.readouterr()
    if command == "check":
        assert out.splitlines()[-1] == "no faults found"
        assert after.out.splitlines()[-1].endswith(" fault(s) found")
        assert "'dovetail run' would refuse it: " in after.err
        return
    assert after.out.split("assumed")[0].splitlines()[1 : 1 + len(before)] == before
    assert ("warning: left out, because this command does not need it: " in after.err) == (
        case != "conjugated"
    )


def test_frf_needs_sensors_and_no_measurement(tmp_path, capsys):
    path, out = tmp_path / "study.toml", tmp_path / "out.npz"
    path.write_text(STUDY + '[[measurements]]\nfile = "none.npz"\n', encoding="utf-8")
    assert main(["frf", str(path), "--out", str(out)]) == 0
    assert (
        "warning: left out, because this command does not need it: study.toml, line 43"
        in capsys.readouterr().err
    )
    assert read_npz(out).outputs == ("low", "mid", "top")
    path.write_text(STUDY.replace("[0.0, 0.0, 0.8]", "[9, 9, 9]"), encoding="utf-8")
    assert main(["frf", str(path), "--out", str(out)]) == 2
    assert "sensors[2]" in capsys.readouterr().err


def test_a_typing_error_of_the_model_is_still_refused(tmp_path, capsys):
    path = study_file(tmp_path, STUDY + '[fit]\nheld_out = ["nobody"]\n')
    assert main(["modes", str(path)]) == 2
    assert "nobody" in capsys.readouterr().err


def test_a_shape_that_is_zero_at_the_sensors_is_refused(tmp_path):
    shapes = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [0.5, 1.0]])
    write_npz(
        tmp_path / "modes.npz", Modes(np.array([5.8, 36.3]), shapes, None, ("low", "mid", "top", "other"))
    )
    path = study_file(tmp_path, STUDY + '[modes]\nfile = "modes.npz"\n')
    with pytest.raises(StudyError, match=r"mode 2, at 36.3 Hz, is zero at every sensor, low, mid, top"):
        load_study(path)


def test_labels_that_come_twice_are_named(tmp_path, computed):
    H = np.concatenate([computed.H, 2 * computed.H[:, :1]], axis=1)
    names = [*computed.outputs, computed.outputs[0]]
    np.savez(
        tmp_path / "m.npz",
        frequency=computed.frequency,
        H=H,
        kind="accelerance",
        outputs=names,
        inputs=["top"],
    )
    path = study_file(tmp_path, STUDY + FILE)
    with pytest.raises(StudyError, match=r"m\.npz: the output label 'low' occurs twice"):
        load_study(path)
    write_csv(
        tmp_path / "m.csv",
        FRF.from_arrays(computed.frequency, computed.H, computed.kind, computed.outputs, ["top"]),
    )
    text = (tmp_path / "m.csv").read_text(encoding="utf-8")
    (tmp_path / "m.csv").write_text(text.replace("(mid/top)", "(low/top)"), encoding="utf-8")
    path.write_text(STUDY + FILE.replace("npz", "csv"), encoding="utf-8")
    with pytest.raises(StudyError, match=r"m.csv: the header .*(twice|lacks)"):
        load_study(path)


def _refuse(*args, **kwargs):
    msg = "computed"
    raise AssertionError(msg)


def test_a_long_thin_structure_is_compared_without_its_modes(load, computed, monkeypatch):
    """A mast of 20 m bends in 96 modes in a band in which one of 1.2 m has 4; both ways say the same."""
    text = STUDY.replace("tip = [0.0, 0.0, 1.2]", "tip = [0.0, 0.0, 20.0]")

    def found():
        (said,) = [w for w in load(0.01 * computed.H, text=text).warnings if "times the model's" in w]
        return float(re.search(r"are ([\d.e+-]+) times", said)[1])

    with monkeypatch.context() as patched:
        patched.setattr("fem.analysis.frf_solver.modes_below", _refuse)
        by_lines = found()
    monkeypatch.setattr("fem.analysis.condensed._SECONDS_PER_MODE", 0.0)
    assert by_lines == pytest.approx(found(), rel=0.02)


def test_only_commands_that_use_measurements_compute_frfs_to_check_them(load, computed, monkeypatch):
    path = load(computed.H).path
    monkeypatch.setattr("dovetail.file.suspicions.frf_function", _refuse)
    with pytest.raises(AssertionError, match="computed"):
        load_study(path)
    for needs in ((), ("sensors",)):
        assert load_study(path, needs).measurements
    assert main(["modes", str(path), "--quiet"]) == 0
    assert main(["frf", str(path), "--out", str(path.with_name("out.npz")), "--quiet"]) == 0


def test_no_unit_is_tried_in_which_the_mesh_shows_nothing(load, computed):
    """In kHz the lines would lie at 1 to 200 kHz, where the mesh has less than two elements to a wave."""
    study = load(computed.H)
    comparison = LazyComparison.of(study.model, study.measurements)[0]
    assert comparison.on_axis(1 / 60) is not None
    assert comparison.on_axis(1e3) is None
