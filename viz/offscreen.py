"""Whether this machine can draw without a screen, found out where a crash does no harm."""

import functools
import importlib.util
import os
import subprocess
import sys

NO_PYVISTA = "PyVista is not installed here (python -m pip install pyvista)"
NO_OPENGL = "VTK cannot draw off screen here (on Debian and Ubuntu, install libegl1 and libgl1-mesa-dri)"

VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable that VTK reads once: the class of its windows."""

# without PyVista, whose import takes twice as long as all of this
_DRAW = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import (
    vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow, vtkWindowToImageFilter
)
sphere, mapper, actor, renderer = vtkSphereSource(), vtkPolyDataMapper(), vtkActor(), vtkRenderer()
window, picture = vtkRenderWindow(), vtkWindowToImageFilter()
mapper.SetInputConnection(sphere.GetOutputPort())
actor.SetMapper(mapper)
actor.GetProperty().SetColor(0, 0, 0)
renderer.SetBackground(1, 1, 1)
renderer.AddActor(actor)
window.SetOffScreenRendering(True)
window.SetSize(40, 40)
window.AddRenderer(renderer)
window.Render()
picture.SetInput(window)
picture.Update()
low, high = picture.GetOutput().GetScalarRange()
raise SystemExit(0 if high - low > 100 else 3)
"""


class DrawingError(RuntimeError):
    """A picture was asked for that this machine cannot draw."""


def require_drawing(option: str) -> None:
    """Refuse an option that asks for pictures of the structure where they cannot be drawn.

    Raises
    ------
    DrawingError
        Its message names the reason.
    """
    reason = why_not()
    if reason:
        msg = f"{option}: pictures of the structure cannot be drawn: {reason}; all the rest works without it"
        raise DrawingError(msg)


def can_draw() -> bool:
    """Return whether pictures of the structure can be drawn here."""
    return not why_not()


@functools.cache
def why_not() -> str:
    """Return why no picture of the structure can be drawn here; nothing if it can.

    The environment is set up for it. VTK ends the process where a library is missing, hence the try in
    another one. Without a display it is told to use EGL. To be called before PyVista is imported.
    """
    try:
        if importlib.util.find_spec("pyvista") is None:
            return NO_PYVISTA
    except (ImportError, ValueError):
        return NO_PYVISTA
    os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
    ways: list[dict[str, str]] = [{}]
    if sys.platform.startswith("linux") and VARIABLE not in os.environ:
        egl = {VARIABLE: "vtkEGLRenderWindow"}
        ways = [{}, egl] if os.environ.get("DISPLAY") else [egl]
    for way in ways:
        if _draws(way):
            os.environ.update(way)
            try:
                importlib.import_module("pyvista")
            except ImportError as reason:
                return f"PyVista cannot be imported ({' '.join(str(reason).split())})"
            return ""
    return NO_OPENGL


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
