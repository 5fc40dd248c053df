"""``dovetail identify-modes`` of an ambient record: from time data to the modes that a study reads."""

import json
import shutil
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.commands.ambient_modes import std_of
from dovetail.modes_pipeline import targets_of
from fem.io import read_modes
from updating import identify_ambient

TRUE = np.array([1.60051, 1.62457, 4.40473, 4.59170, 14.0480, 14.5519])
"""Natural frequencies of the model from which examples/ambient-mast/simulate.py makes the record [Hz]."""


@pytest.fixture
def study(root, tmp_path):
    return shutil.copytree(root / "examples" / "ambient-mast", tmp_path / "mast") / "study.toml"


def edited(study, *pairs):
    text = study.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    study.write_text(text, encoding="utf-8")
    return study


def record(study, channels, values, **more):
    np.savez(study.parent / "wind.npz", channels=np.array(channels), acc=values, **({"fs": 50.0} | more))


def test_the_modes_of_the_example_are_those_of_its_model_and_come_back_from_the_file(study, capsys):
    out = study.parent / "new.npz"
    words = ["identify-modes", str(study), "--out", str(out), "--json", str(study.parent / "r.json")]
    assert main([*words, "--picture", str(study.parent / "p.png")]) == 0
    said = json.loads((study.parent / "r.json").read_text(encoding="utf-8"))
    frequency, std = (
        np.array([m[key] for m in said["modes"]]) for key in ("frequency_Hz", "frequency_std_Hz")
    )
    assert (np.abs(frequency - TRUE) < 3 * std).all()
    assert said["record"] == "wind.npz"
    assert (study.parent / "p.png").stat().st_size > 20_000
    assert 'file = "new.npz"' in capsys.readouterr().out

    modes = load_study(edited(study, ("modes.npz", "new.npz"))).modes
    targets = targets_of(modes)
    assert [s.name for s in targets.sensors] == said["outputs"]
    assert targets.frequency == pytest.approx(frequency)
    assert targets.frequency_std == pytest.approx(std / frequency)
    ratio = np.array([m["damping_ratio_std"] / m["damping_ratio"] for m in said["modes"]])
    assert targets.zeta_std == pytest.approx(ratio)
    assert (targets.shape_std >= 0.01).all()
    with np.load(out) as new, np.load(study.parent / "modes.npz") as old:
        assert new["frequency"] == pytest.approx(old["frequency"], rel=1e-6)


def test_keys_of_the_study_replace_the_standard_deviations_of_the_file(study):
    edited(
        study,
        ('file = "modes.npz"', 'file = "modes.npz"\nfrequency_std = 0.01\nzeta_std = [1, 1, 1, 1, 1, 2]'),
    )
    modes = load_study(study).modes
    assert (modes.frequency_std == 0.01).all()
    assert modes.zeta_std.tolist() == [1, 1, 1, 1, 1, 2]
    assert 0.01 <= modes.shape_std.min() < modes.shape_std.max()


def test_universal_files_come_with_the_deviations_as_keys(study, capsys):
    out = study.parent / "modes.uff"
    assert main(["identify-modes", str(study), "--ambient", "--out", str(out)]) == 0
    assert read_modes(out).frequency == pytest.approx(TRUE, rel=3e-3)
    printed = capsys.readouterr().out
    keys = tomllib.loads(printed[printed.index("[modes]") :])["modes"]
    with np.load(study.parent / "modes.npz") as file:
        for key in ("frequency_std", "zeta_std", "shape_std"):
            assert keys[key] == pytest.approx(file[key], rel=0.01)


def test_deviations_of_zero_are_not_written():
    rng, kernel = np.random.default_rng(2), np.exp(-0.01 * np.arange(600)) * np.sin(0.6 * np.arange(600))
    q = np.convolve(rng.standard_normal(6000), kernel)[:6000]
    found = identify_ambient(np.column_stack([q, 0.4 * q]) + 0.1 * rng.standard_normal((6000, 2)), 10.0)
    assert set(std_of(found)) == {"frequency_std", "zeta_std", "shape_std"}
    assert set(std_of(replace(found, zeta_std=0 * found.zeta_std))) == {"frequency_std", "shape_std"}
    no_damping = replace(found.modes, zeta=np.zeros(found.modes.n_modes))
    assert set(std_of(replace(found, modes=no_damping))) == {"frequency_std", "shape_std"}


def test_channels_of_no_sensor_and_of_no_unit_are_said(study, capsys):
    with np.load(study.parent / "wind.npz") as file:
        y, names = file["acc"], file["channels"].tolist()
    record(study, [*names, "wind speed"], np.column_stack([y, y[:, 0]]))
    assert main(["identify-modes", str(study), "--ambient"]) == 0
    assert "the channels wind speed belong to no sensor and are not used" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("", "study.toml, line 50, ambient.file: the record is 6 s long, 300 samples"),
        ("band = [0.8, 40.0]", "ambient.file: the band ends at 40 Hz, and samples at 50 Hz hold"),
        ("band = [9.0, 3.0]", "ambient.band: [9.0, 3.0] is not allowed"),
        ("scale = { nothing = 2.0 }", "ambient.scale: wind.npz has no channel 'nothing'"),
        ('scale = { "tip y" = "two" }', "ambient.scale.tip y: ['two'] is not allowed"),
        ("bands = 1", "ambient.bands: unknown key; did you mean 'band'?"),
    ],
)
def test_faults_of_the_table_and_the_record_are_refused_with_their_place(study, capsys, lines, words):
    with np.load(study.parent / "wind.npz") as file:
        y, names = file["acc"], file["channels"].tolist()
    record(study, names, y[:300] if not lines else y)
    edited(study, ("band = [0.8, 20.0]", lines))
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    assert words in capsys.readouterr().err


def test_too_few_channels_dead_ones_and_files_that_are_not_there_are_refused(study, capsys):
    with np.load(study.parent / "wind.npz") as file:
        y, names = file["acc"], file["channels"].tolist()
    record(study, ["tip y", "b", "c", "d", "e", "f"], y)
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    assert "1 belong(s) to sensors of the study; two or more are needed" in capsys.readouterr().err
    y = y.copy()
    y[:, 4] = 7
    record(study, names, y)
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    assert "channel tip y is constant; leave it out" in capsys.readouterr().err
    record(study, names, y, fs=np.array([1.0, 2.0]))
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    assert "it does not say its sample rate" in capsys.readouterr().err
    (study.parent / "wind.npz").unlink()
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    assert "ambient.file: there is no file" in capsys.readouterr().err


@pytest.mark.parametrize(("rate", "noted"), [("1000", True), ("50", False)])
def test_another_sample_rate_than_that_of_the_file_is_noted(study, capsys, rate, noted):
    edited(study, ("band = [0.8, 20.0]", f"band = [0.8, 20.0]\nsample_rate = {rate}"))
    assert main(["identify-modes", str(study), "--ambient"]) == 0
    words = f"wind.npz states a sample rate of 50 Hz, and {rate} Hz, as asked for, takes its place"
    assert (words in capsys.readouterr().out) == noted


def test_motions_of_different_kinds_are_refused(study, capsys):
    with np.load(study.parent / "wind.npz") as file:
        y, names = file["acc"], file["channels"].tolist()
    units = ["g", "m/s^2", "m/s^2", "mm/s", "m/s^2", "m/s^2"]
    head = ",".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
    table = np.column_stack([np.arange(len(y)) / 50, y])[:2000]
    np.savetxt(study.parent / "wind.csv", table, delimiter=",", header=f"Time [s],{head}", comments="")
    edited(study, ("wind.npz", "wind.csv"))
    assert main(["identify-modes", str(study), "--ambient"]) == 2
    err = capsys.readouterr().err
    assert "different kinds of motion (middle x: acceleration" in err
    assert "corner y: velocity" in err


def test_options_of_frfs_and_studies_without_a_record_are_refused(study, root, capsys):
    assert main(["identify-modes", str(study), "--ambient", "--synthesis", "s.png"]) == 2
    assert "--synthesis is for FRFs" in capsys.readouterr().err
    other = root / "examples" / "three-storeys" / "study.toml"
    assert main(["identify-modes", str(other), "--ambient"]) == 2
    assert "it has no [ambient]" in capsys.readouterr().err


SET_UPS = (("middle x", "middle y", "corner x", "tip y"), ("corner x", "corner y", "tip y", "tip z"))


def two_set_ups(study, parts=SET_UPS):
    """Cut the record into two halves with sensors of their own, and two that stay."""
    with np.load(study.parent / "wind.npz") as file:
        y, names, rate = file["acc"], file["channels"].tolist(), float(file["fs"])
    for k, (own, half) in enumerate(zip(parts, np.array_split(y, 2), strict=True), 1):
        columns = [names.index(name) for name in own]
        np.savez(study.parent / f"part-{k}.npz", channels=np.array(own), acc=half[:, columns], fs=rate)
    return edited(study, ('file = "wind.npz"', 'file = ["part-1.npz", "part-2.npz"]'))


def test_two_set_ups_give_the_modes_of_the_model_at_all_sensors(study, capsys):
    two_set_ups(study)
    out, result = study.parent / "new.npz", study.parent / "r.json"
    words = ["identify-modes", str(study), "--out", str(out), "--json", str(result)]
    assert main([*words, "--picture", str(study.parent / "p.png")]) == 0
    assert "2 set-ups, 6 channels" in capsys.readouterr().out
    said = json.loads(result.read_text(encoding="utf-8"))
    frequency, std = (
        np.array([m[key] for m in said["modes"]]) for key in ("frequency_Hz", "frequency_std_Hz")
    )
    assert (np.abs(frequency - TRUE) < 3.5 * std).all()
    assert all(m["set_ups"] == {"1": k, "2": k} for k, m in enumerate(said["modes"], 1))
    assert {"p-1.png", "p-2.png"} <= {p.name for p in study.parent.iterdir()}
    with np.load(study.parent / "modes.npz") as file:
        whole, names = file["shapes"], file["labels"].tolist()
    merged = read_modes(out)
    merged_rows = [merged.labels.index(name) for name in names]
    mac = [np.corrcoef(a, b)[0, 1] ** 2 for a, b in zip(whole.T, merged.shapes[merged_rows].T, strict=True)]
    assert min(mac) > 0.97
    assert load_study(edited(study, ("modes.npz", "new.npz"))).modes.modes.n_modes == 6


@pytest.mark.parametrize(
    ("parts", "file", "words"),
    [
        ((SET_UPS[0][:2], SET_UPS[1]), None, "set-up 2 (corner x, corner y, tip y, tip z) shares no sensor"),
        (SET_UPS, '["part-1.npz", "part-1.npz"]', "ambient.file: 'part-1.npz' is named twice"),
        (SET_UPS, '["part-1.npz", "part-3.npz"]', "ambient.file: there is no file"),
    ],
)
def test_set_ups_that_cannot_be_merged_are_refused(study, capsys, parts, file, words):
    two_set_ups(study, parts)
    if file:
        edited(study, ('["part-1.npz", "part-2.npz"]', file))
    assert main(["identify-modes", str(study)]) == 2
    assert words in capsys.readouterr().err
