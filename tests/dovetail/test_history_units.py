"""Units in headings of histories, spectra and densities: converted to SI, or refused by name."""

import json

import numpy as np
import pytest

from dovetail import main
from fem.io import G0

STUDY = """
[mesh]
element_size=1
[points]
a=[0,0,0]
b=[1,0,0]
[members.m]
from="a"
to="b"
theory="bar"
section={A=1e-4,Iy=1e-9,Iz=1e-9,J=1e-9}
[materials.s]
E=4e7
rho=20
[[supports]]
point="a"
[[supports]]
point="b"
fixed="y z rx ry rz"
[[masses]]
point="b"
mass=10
[[masses]]
point="a"
mass=5
[[sensors]]
name="tip"
point="b"
direction="x"
[[excitations]]
sensor="tip"
[damping]
modal=0.05
"""

HISTORY = "0,0\n0.1,1\n0.2,0\n0.3,0\n"
DENSITY = "1,0.001\n10,0.001\n50,0.001\n"
SPECTRUM = "0,1\n0.1,2.5\n0.5,2.5\n3,0.4\n"


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path


def answer(folder, command, table):
    """Return the exit status of a command on a table, and what it found."""
    (folder / "table.csv").write_text(table, encoding="utf-8")
    option = {"transient": "--excitation", "psd": "--psd", "spectrum": "--spectrum"}[command]
    out = folder / "out.json"
    out.unlink(missing_ok=True)
    status = main(
        [command, str(folder / "study.toml"), option, str(folder / "table.csv"), "--json", str(out)]
    )
    found = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    return status, found


def of_history(folder, table):
    status, found = answer(folder, "transient", table)
    assert status == 0
    return found["responses"]["tip"]["acceleration"]


def of_density(folder, table):
    status, found = answer(folder, "psd", table)
    assert status == 0
    return found["rms"]["tip"]


def of_spectrum(folder, table):
    status, found = answer(folder, "spectrum", table)
    assert status == 0
    return found["sensors"]["tip"]["acceleration"]


@pytest.mark.parametrize(
    ("heading", "plain", "factor"),
    [
        ("time [s],base x [g]", "base x", G0),
        ("time (s),base x (cm/s²)", "base x", 0.01),
        ("time,base x_g", "base x", G0),
        ("time,Base X [mm/s/s]", "base x", 1e-3),
        ("time,tip [kN]", "tip", 1e3),
        ("time,tip_lbf", "tip", 4.4482216152605),
    ],
)
def test_histories_are_converted(study, heading, plain, factor):
    wanted = of_history(study, f"time,{plain}\n{HISTORY}")
    assert of_history(study, f"{heading}\n{HISTORY}") == pytest.approx([factor * v for v in wanted])


@pytest.mark.parametrize(
    "heading", ["time_ms", "time [ms]", "Time(milliseconds)", "Time ms", "timestamp_us", "t/ms"]
)
def test_times_are_converted(study, heading):
    size = 1e6 if "us" in heading else 1e3
    rows = "".join(f"{size * t:.12g},{v}\n" for t, v in ((0, 0), (0.1, 1), (0.2, 0), (0.3, 0)))
    wanted = of_history(study, f"time,base x\n{HISTORY}")
    assert of_history(study, f"{heading},base x\n{rows}") == pytest.approx(wanted)


def test_date_times_are_seconds(study):
    rows = "".join(f"2024-03-01T23:59:{59 + t:.1f}Z,{v}\n" for t, v in ((0, 0), (0.1, 1), (0.2, 0), (0.3, 0)))
    wanted = of_history(study, f"time,base x\n{HISTORY}")
    assert of_history(study, f"time,base x\n{rows}") == pytest.approx(wanted)


def test_densities_are_converted(study):
    wanted = of_density(study, f"frequency,base x\n{DENSITY}")
    assert of_density(study, f"frequency [Hz],base x [g^2/Hz]\n{DENSITY}") == pytest.approx(G0 * wanted)
    assert of_density(study, f"frequency_Hz,base x ((cm/s²)²/Hz)\n{DENSITY}") == pytest.approx(0.01 * wanted)
    turned = "".join(f"{f * 2 * np.pi:.15g},0.001\n" for f in (1, 10, 50))
    heading = "frequency [rad/s],base x [(m/s^2)^2/(rad/s)]"
    assert of_density(study, f"{heading}\n{turned}") == pytest.approx(np.sqrt(2 * np.pi) * wanted)


def test_spectra_are_converted(study):
    wanted = of_spectrum(study, f"period,x\n{SPECTRUM}")
    assert of_spectrum(study, f"period [s],x [g]\n{SPECTRUM}") == pytest.approx(G0 * wanted)
    rows = "0,1\n100,2.5\n500,2.5\n3000,0.4\n"
    assert of_spectrum(study, f"period [ms],x [cm/s^2]\n{rows}") == pytest.approx(0.01 * wanted)


@pytest.mark.parametrize(
    ("command", "heading", "words"),
    [
        ("transient", "time [s],base x [m]", "the column 'base x' has the unit 'm', which is none of accel"),
        ("transient", "time [s],base x [V]", "has the unit 'V'"),
        ("transient", "time [s],base rx [m/s^2]", "none of angular acceleration"),
        ("transient", "time [s],tip [g]", "none of force"),
        ("transient", "time [Hz],tip [N]", "the first column has the unit 'Hz', which is none of time"),
        ("transient", "time (fortnights),tip", "has the unit 'fortnights'"),
        ("psd", "frequency [Hz],base x [g]", "none of a density of acceleration"),
        ("psd", "frequency [Hz],base x [g/sqrt(Hz)]", "has the unit 'g/sqrt(Hz)'"),
        ("psd", "frequency [s],base x", "none of frequency"),
        ("psd", "frequency [rad/s],base x", "has no unit, and its frequencies are angular"),
        ("spectrum", "period [s],x [cm/s]", "has the unit 'cm/s'"),
        ("spectrum", "period [Hz],x", "none of period"),
    ],
)
def test_units_that_do_not_fit_are_named(study, capsys, command, heading, words):
    status, _ = answer(study, command, f"{heading}\n0,0.25\n0.1,1.5\n0.2,0.3\n")
    err = capsys.readouterr().err
    assert status == 2
    assert "table.csv, line 1: " in err
    assert words in err


@pytest.mark.parametrize(
    "cut", ["0,0.123\n0.1,1.2", "0,1.25e-03\n0.1,1.25e-0", "0,1.25\n0.1", "0,1.2\n0.1,1.2e"]
)
def test_a_history_that_is_cut_is_refused(study, capsys, cut):
    status, _ = answer(study, "transient", f"time,tip\n{cut}")
    assert status == 2
    assert "table.csv, line 3: " in capsys.readouterr().err


def test_a_line_end_may_be_missing(study):
    wanted = of_history(study, f"time,tip\n{HISTORY}")
    assert of_history(study, f"time,tip\n{HISTORY.rstrip()}") == wanted
