"""Whether this machine can draw without a screen, found out where a crash does no harm."""

import functools
import os
import subprocess
import sys

VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable that VTK reads once: the class of its windows."""

_DRAW = """
import numpy, pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(40, 40))
plotter.set_background("white")
plotter.add_mesh(pyvista.Sphere(), color="black")
raise SystemExit(0 if numpy.ptp(plotter.screenshot(None, return_img=True)) > 100 else 3)
"""


@functools.cache
def can_draw() -> bool:
    """Return whether VTK draws off screen, and set the environment up for it.

    VTK ends the process where a library is missing, hence the try in another one. Without a display it is
    told to use EGL. To be called before PyVista is imported.
    """
    os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
    ways: list[dict[str, str]] = [{}]
    if sys.platform.startswith("linux") and VARIABLE not in os.environ:
        egl = {VARIABLE: "vtkEGLRenderWindow"}
        ways = [{}, egl] if os.environ.get("DISPLAY") else [egl]
    for way in ways:
        if _draws(way):
            os.environ.update(way)
            return True
    return False


def _draws(way: dict[str, str]) -> bool:
    try:
        done = subprocess.run(
            [sys.executable, "-c", _DRAW],
            env={**os.environ, **way},
            capture_output=True,
            timeout=120,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0
