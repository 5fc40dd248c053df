"""Machines without PyVista or OpenGL: what cannot be drawn is said in one line, and all else is there."""

import json
import os
import subprocess
import sys

import pytest

from tests.frames import STUDY, write_study

BLOCK = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("pyvista", "vtkmodules", "vtk"):
            raise ImportError(f"{name} is blocked")
sys.meta_path.insert(0, Blocked())
from dovetail.cli import main
raise SystemExit(main(sys.argv[1:]))
"""


def without_pyvista(*words):
    return subprocess.run([sys.executable, "-c", BLOCK, *words], capture_output=True, text=True, check=False)


def without_opengl(*words):
    return subprocess.run(
        [sys.executable, "-m", "dovetail", *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "VTK_DEFAULT_OPENGL_WINDOW": "vtkNoSuchWindow", "DISPLAY": ""},
    )


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("frame"))


@pytest.mark.parametrize("option", ["modes --picture", "check --picture"])
def test_pictures_without_pyvista(study, tmp_path, option):
    command, word = option.split()
    target = tmp_path / ("p" if command == "modes" else "p.png")
    done = without_pyvista(command, str(study), word, str(target))
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == (
        f"dovetail: {word}: pictures of the structure cannot be drawn: PyVista is not installed here (python "
        "-m pip install pyvista); all the rest works without it\n"
    )
    assert not target.exists()


def test_pictures_without_opengl(study, tmp_path):
    done = without_opengl("modes", str(study), "--picture", str(tmp_path / "p"))
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("dovetail: --picture: pictures of the structure cannot be drawn: VTK cannot")
    assert "libegl1" in line
    assert not (tmp_path / "p").exists()


@pytest.mark.slow
def test_a_run_without_pyvista_has_all_the_rest(study, tmp_path):
    done = without_pyvista("run", str(study), "--out", str(tmp_path / "out"))
    assert (done.returncode, done.stderr) == (0, "")
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Pictures of the structure and of its modes are missing: PyVista is not installed here" in report
    names = {p.name for p in (tmp_path / "out" / "pictures").iterdir()}
    assert "staircase.png" in names
    assert "structure.png" not in names
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "effect"


@pytest.mark.slow
def test_a_match_is_drawn_without_pyvista(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "points.csv").write_text(
        "name,x,y,z\na,0,0,0\nb,0,0,0.25\nc,0,0,0.5\nd,0.2,0,0.5\ne,0.4,0,0.5\n", encoding="utf-8"
    )
    words = ["match", str(tmp_path / "study.toml"), str(tmp_path / "points.csv"), "--same-axes"]
    done = without_pyvista(*words, "--picture", str(tmp_path / "match.png"))
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "match.png").stat().st_size > 1000
