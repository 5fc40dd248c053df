"""What every test stands on: one thread, no screen, and skips that say what is missing."""

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
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"

# A busy machine is no failure; on CI the same examples run every time, so that only a change can break it.
hypothesis.settings.register_profile("here", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "here")


def find_chromium() -> Path | None:
    """Return the Chromium to run, or None."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    return Path(found) if found else None


def pytest_collection_modifyitems(items):
    """Mark the tests that use the fixtures `shared` and `browser`, so that `-m` selects them."""
    for item in items:
        for name in {"shared", "browser"} & set(getattr(item, "fixturenames", ())):
            item.add_marker(name)


def pytest_runtest_setup(item):
    """Skip a test whose data or browser is not on this machine."""
    for marker in item.iter_markers("shared"):
        for below in marker.args or ("",):
            if not (SHARED / below).exists():
                pytest.skip(f"needs ../shared/{below}")
    if item.get_closest_marker("browser") and find_chromium() is None:
        pytest.skip("needs Chromium: `chromium` on the PATH")


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the root of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return ../shared, or skip; `@pytest.mark.shared("data/...")` asks for one thing in it."""
    if not SHARED.is_dir():
        pytest.skip("needs ../shared/")
    return SHARED


@pytest.fixture(scope="session")
def browser() -> Path:
    """Return Chromium's path, or skip; as root it runs only with --headless --no-sandbox."""
    found = find_chromium()
    if found is None:
        pytest.skip("needs Chromium: `chromium` on the PATH")
    return found


@pytest.fixture(scope="session")
def offscreen() -> None:
    """Skip where VTK cannot draw without a display; tried in another process, because VTK then crashes."""
    draw = "import pyvista; pyvista.Plotter(off_screen=True).screenshot()"
    if subprocess.run([sys.executable, "-c", draw], capture_output=True, check=False).returncode:
        pytest.skip("needs off-screen OpenGL: on Debian, libegl1 and libgl1-mesa-dri")
