"""What every test stands on: one thread, no screen, and skips that say what is missing."""

import gc
import os
import shutil
import subprocess
import sys
from pathlib import Path

import hypothesis
import pytest

# Before anything imports numpy or VTK, which read these once.
for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ["MPLBACKEND"] = "Agg"
os.environ["PYVISTA_OFF_SCREEN"] = "true"
# Without byte code each process that a test starts compiles all packages again, 1.5 s each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
PEERS_PYTHON = Path(os.environ.get("DOVETAIL_PEERS_PYTHON", ROOT / ".venv-peers" / "bin" / "python"))
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

# A busy machine is no failure; on CI the same examples run every time, so that only a change can break it.
hypothesis.settings.register_profile("here", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "here")


def pytest_collection_modifyitems(items):
    """Mark what uses the fixtures `shared` and `browser`, and skip what this machine has not got."""
    for item in items:
        for name in ("shared", "browser"):
            if name in getattr(item, "fixturenames", ()) and not item.get_closest_marker(name):
                item.add_marker(name)
        for marker in item.iter_markers("shared"):
            for below in marker.args or ("",):
                if not (SHARED / below).exists():
                    item.add_marker(pytest.mark.skip(f"needs ../shared/{below}"))
        if item.get_closest_marker("browser") and not CHROMIUM:
            item.add_marker(pytest.mark.skip("needs Chromium: `chromium` on the PATH"))
        if item.get_closest_marker("peer") and not PEERS_PYTHON.exists():
            item.add_marker(pytest.mark.skip("needs the programs that `make peers` installs"))


def pytest_collection_finish():
    """Leave the collected tests out of each later search for garbage: 14 % of the time of tests."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the root of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return ../shared; a test that uses it is skipped where that is absent.

    `@pytest.mark.shared("data/southampton-frame")` asks for one thing in it.
    """
    return SHARED


@pytest.fixture(scope="session")
def browser() -> Path:
    """Return Chromium's path; a test that uses it is skipped where there is none.

    Run it with --headless, --no-sandbox (it may be root) and a new --user-data-dir.
    """
    return Path(str(CHROMIUM))


@pytest.fixture(scope="session")
def offscreen() -> None:
    """Skip where VTK cannot draw without a display; tried in another process, because VTK then crashes."""
    draw = "import pyvista; pyvista.Plotter(off_screen=True).screenshot()"
    if subprocess.run([sys.executable, "-c", draw], capture_output=True, check=False).returncode:
        pytest.skip("needs off-screen OpenGL: on Debian, libegl1 and libgl1-mesa-dri")


# The example of a desk, read once -------------------------------------------------------------------------


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """Return the study of the cross-beam, with FRFs below 1600 Hz."""
    from dovetail import load_study
    from tests.studies import cross_beam_below_1600_hz

    return load_study(cross_beam_below_1600_hz(tmp_path_factory.mktemp("cross-beam")))


@pytest.fixture(scope="session")
def live(study):
    """Return its model, ready for one hypothesis after the other."""
    from dovetail.desk import live_model

    return live_model(study)


@pytest.fixture(scope="session")
def candidates(study):
    """Return its candidate effects by name."""
    return {e.name: e for e in study.candidates()}
