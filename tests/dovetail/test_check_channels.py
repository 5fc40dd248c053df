"""``dovetail check`` of sensors and forces: their places, directions and data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dovetail import main
from fem.io import read_npz, write_npz
from tests.frames import STUDY, write_study
from tests.studies import study_file


def channel(name, point, direction, kind="sensors"):
    return f'\n[[{kind}]]\nname = "{name}"\npoint = {point}\ndirection = "{direction}"\n'


def checked(file, capsys):
    assert main(["check", str(file)]) == 0
    return capsys.readouterr()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (channel("S", "[0.0, 0.0, 0.0]", "z"), "sensor 'S' reads no motion: the model holds (0, 0, 0) m"),
        (
            channel("E", "[0.0, 0.0, 0.0]", "x", "excitations"),
            "excitation 'E' drives no motion: the model holds (0, 0, 0) m",
        ),
        (
            channel("S", '"tip"', "z"),
            "sensors 'T' and 'S' have one place and direction, (0.4, 0, 0.5) m: one of them says nothing new",
        ),
        (
            channel("S", '"tip"', "-z"),
            "sensors 'T' and 'S' have one place and direction, (0.4, 0, 0.5) m, with opposite signs",
        ),
        (
            channel("E", '"tip"', "-z", "excitations"),
            "excitations 'T' and 'E' have one place and direction, (0.4, 0, 0.5) m, with opposite signs",
        ),
        (channel("S", '"tip"', "y"), "sensor 'S' is across all motion: none of the forces moves the model"),
    ],
)
def test_a_channel_that_says_nothing_is_named_with_its_place(tmp_path, capsys, more, words):
    printed = checked(study_file(tmp_path, STUDY + more), capsys).out
    assert f"  channel: {words}" in printed
    assert "1 fault(s) found" in printed


def test_sensors_along_two_axes_of_one_place_are_no_fault(tmp_path, capsys):
    more = channel("S", '"tip"', "x") + channel("E", '"tip"', "y", "excitations")
    file = study_file(tmp_path, STUDY + more + channel("Y", '"tip"', "y"))
    assert "no faults found" in checked(file, capsys).out


def with_data(folder, change):
    """Return a study whose FRFs (n_freq, n_out, n_in) are changed; sensor S is where T is."""
    file = write_study(folder, mass=0.0)
    frf = read_npz(folder / "frf.npz")
    more, H = change(frf)
    write_npz(folder / "frf.npz", replace(frf, H=H, outputs=more))
    return file


def doubled(scale):
    """Return the channels of a sensor S as those of T, with noise, times a factor."""

    def change(frf):
        rng = np.random.default_rng(1)
        T = frf.H[:, [list(frf.outputs).index("T")]]
        S = scale * T * (1 + 0.01 * rng.standard_normal(T.shape))
        return (*frf.outputs, "S"), np.concatenate([frf.H, S], axis=1)

    return change


@pytest.mark.parametrize(("scale", "fault"), [(1.0, False), (0.5, True)])
def test_two_sensors_of_one_place_are_a_fault_if_their_data_differ(tmp_path, capsys, scale, fault):
    file = with_data(tmp_path, doubled(scale))
    file.write_text(file.read_text() + channel("S", '"tip"', "z"))
    printed = checked(file, capsys).out
    assert ("and their FRFs differ by 50 %: one is elsewhere, or along another axis" in printed) == fault
    assert ("no faults found" in printed) != fault


def test_a_channel_that_was_stored_twice_is_named(tmp_path, capsys):
    def change(frf):
        T = list(frf.outputs).index("T")
        return (*frf.outputs, "S"), np.concatenate([frf.H, frf.H[:, [T]]], axis=1)

    file = with_data(tmp_path, change)
    file.write_text(file.read_text() + channel("S", '"knee"', "z"))
    assert (
        "sensors 'T' and 'S' have the same measured FRFs: one was stored twice" in checked(file, capsys).out
    )


@pytest.mark.parametrize("factor", [1 / 9.80665, 1000.0])
def test_the_unit_of_one_sensor_is_doubted_by_its_data(tmp_path, capsys, factor):
    def change(frf):
        H = frf.H.copy()
        H[:, list(frf.outputs).index("A")] *= factor
        return frf.outputs, H

    said = checked(with_data(tmp_path, change), capsys)
    assert "at sensor A are " in said.err
    assert f"its unit is another one (gain = {factor:.6g} corrects that)" in said.err
    assert "at sensor T are" not in said.err
    file = Path(tmp_path / "study.toml")
    file.write_text(file.read_text().replace('name = "A"', f'name = "A"\ngain = {factor!r}'))
    assert "its unit" not in checked(file, capsys).err
