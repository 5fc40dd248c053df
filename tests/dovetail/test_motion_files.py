"""Files with motions of the whole structure: at the sensors they are what the command prints."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista

from dovetail import load_study, main
from fem import assemble, compute_participation

EXAMPLES = Path(__file__).parents[2] / "examples"
PORTAL, FAN = EXAMPLES / "loaded-portal", EXAMPLES / "fan"
"""Sensor 'sway' is the x-direction of corner B."""


def written(capsys, path, *arguments):
    """Run a command; return its JSON, and the mesh with its motions as ParaView reads it."""
    assert main([str(a) for a in (*arguments, "--vtu", path, "--json", "-")]) == 0
    mesh: Any = pyvista.read(path)
    return json.loads(capsys.readouterr().out), mesh


@pytest.fixture(scope="module")
def corner():
    return load_study(PORTAL / "study.toml").model.mesh.point_names["B"]


def test_base(tmp_path, capsys, corner):
    lines = ("--start", "5.1", "--stop", "5.5", "--step", "0.1")
    study = PORTAL / "study.toml"
    found, mesh = written(capsys, tmp_path / "b.vtu", "base", study, "--motion", "x", *lines)
    real, imaginary = (np.array(found[part])[:, 0, 0] for part in ("real", "imaginary"))
    k = np.hypot(real, imaginary).argmax()
    name = f"base X+, {found['frequency_Hz'][k]:.6g} Hz"
    assert mesh[f"{name}, real"][corner, 0] == pytest.approx(real[k], rel=1e-4)
    assert mesh[f"{name}, imaginary"][corner, 0] == pytest.approx(imaginary[k], rel=1e-4)
    more = ("--at", "5.2", "--at", "5.4", "--relative")
    found, mesh = written(capsys, tmp_path / "b.vtu", "base", study, "--motion", "x", *lines, *more)
    np.testing.assert_allclose(
        [mesh[f"base X+, {f} Hz, real"][corner, 0] for f in (5.2, 5.4)],
        np.array(found["real"])[[1, 3], 0, 0],
        rtol=1e-4,
    )


@pytest.mark.parametrize("options", [(), ("--relative",), ("--method", "newmark")])
def test_transient(tmp_path, capsys, corner, options):
    table = tmp_path / "e.csv"
    t = np.linspace(0, 0.2, 41)
    columns = np.column_stack([t, np.sin(40 * t), 1e3 * t])
    np.savetxt(table, columns, delimiter=",", header="time,base x,sway", comments="")
    arguments = ("transient", PORTAL / "study.toml", "--excitation", table, "--frames", "5", *options)
    found, mesh = written(capsys, tmp_path / "t.vtu", *arguments)
    sway = np.array(found["responses"]["sway"]["displacement"])
    seen = [mesh[f"{time:.6g} s"][corner, 0] for time in (0, 0.05, 0.1, 0.15, 0.2)]
    np.testing.assert_allclose(seen, sway[::10], rtol=1e-9, atol=1e-18)
    foot = mesh["0.2 s"][0, 0]
    assert (abs(foot) > 1e-4) == ("--relative" not in options)  # the base itself has moved
    if not options:
        assert main([str(a) for a in (*arguments, "--vtu", tmp_path / "t.xdmf", "--quiet")]) == 0
        assert pyvista.get_reader(tmp_path / "t.xdmf").time_values == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])


def test_spectrum(tmp_path, capsys, corner):
    options = ("--spectrum", PORTAL / "design.csv", "--number", "3")
    arguments = ("spectrum", PORTAL / "study.toml", *options)
    found, mesh = written(capsys, tmp_path / "s.vtu", *arguments)
    assert mesh["largest"][corner, 0] == pytest.approx(found["sensors"]["sway"]["displacement"])
    own = mesh["set:beam"] == 1
    assert mesh["largest My"][own].max() == pytest.approx(found["members"]["beam"]["My"])
    mode = found["modes"][2]
    peak = mesh[f"mode 3: {mode['frequency_Hz']:.6g} Hz, x"][corner, 0]
    study = load_study(PORTAL / "study.toml")
    modes = study.solve_modes(3)
    gamma = compute_participation(assemble(study.model), modes).factors[2, 0]
    expected = gamma * mode["spectrum"]["x"] / modes.omega[2] ** 2 * modes.shapes[6 * corner, 2]
    assert abs(peak) == pytest.approx(abs(expected))


def test_psd(tmp_path, capsys, corner, monkeypatch):
    monkeypatch.setattr("dovetail.commands.psd.MOST_VALUES", 200_000)  # several blocks of DOFs
    table = tmp_path / "s.csv"
    table.write_text("frequency,base x,sway\n2,0.1,1\n30,0.1,1\n", encoding="utf-8")
    found, mesh = written(capsys, tmp_path / "p.vtu", "psd", PORTAL / "study.toml", "--psd", table)
    assert mesh["RMS acceleration"][corner, 0] == pytest.approx(found["rms"]["sway"], rel=1e-4)
    assert mesh["RMS acceleration"][0, 0] == pytest.approx(np.sqrt(0.1 * 28))  # the base itself


def test_campbell(tmp_path, capsys):
    options = ("--speeds", "0:2000:3", "--number", "2")
    found, mesh = written(capsys, tmp_path / "c.vtu", "campbell", FAN / "study.toml", *options)
    first = found["critical_speeds"][0]
    name = f"critical speed 1: {first['speed_rpm']:.6g} rpm, 1X"
    shape = mesh[f"{name}, real"] + 1j * mesh[f"{name}, imaginary"]
    out = tmp_path / "m.vtu"
    speed = ("--rpm", str(first["speed_rpm"]), "--number", "2")
    _, other = written(capsys, out, "complex", FAN / "study.toml", *speed)
    names = [k.removesuffix(", real") for k in other.point_data if k.endswith("Hz, real")]
    modes = [other[f"{k}, real"] + 1j * other[f"{k}, imaginary"] for k in names]
    alike = [abs(np.vdot(v, shape)) / np.linalg.norm(v) / np.linalg.norm(shape) for v in modes]
    assert max(alike) == pytest.approx(1, abs=1e-6)


def test_modes(tmp_path, capsys, corner):
    found, mesh = written(capsys, tmp_path / "m.vtu", "modes", PORTAL / "study.toml", "--number", "3")
    shapes = load_study(PORTAL / "study.toml").solve_modes(3).shapes
    names = [f"mode {k + 1}: {mode['frequency_Hz']:.6g} Hz" for k, mode in enumerate(found["modes"])]
    moved = np.abs([mesh[name][corner, 1] for name in names])
    np.testing.assert_allclose(moved, np.abs(shapes[6 * corner + 1]), atol=1e-9)


def test_other_formats_are_refused_before_anything_is_computed(tmp_path, capsys):
    path = tmp_path / "a.txt"
    for command in ("modes", "static", "buckling", "complex", "base"):
        assert main([command, str(PORTAL / "study.toml"), "--vtu", str(path)]) == 2
        assert "is written as .vtu, .vtk or .xdmf, not '.txt'" in capsys.readouterr().err
