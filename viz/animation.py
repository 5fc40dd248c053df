"""Mode shapes as animated GIFs."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fem.analysis.modes import Modes
from fem.model import Model
from viz.models import drawn_size, model_surface
from viz.overlay import (
    blend,
)
from viz.render import mode_title, shape_phase
from viz.scene import Scene
from viz.shapes import amplification
from viz.surfaces import Surface


def animate_mode(
    model: Model,
    modes: Modes,
    index: int,
    path: str | Path,
    frames: int = 20,
    width: float = 4.5,
    title: str = "",
) -> Path:
    """Write a mode shape as an animated GIF of one period.

    Parameters
    ----------
    model : Model
    modes : Modes
        With a row for every DOF of the model's mesh; a complex shape travels.
    index : int
        Mode, counted from 0.
    path : str or Path
        GIF file to write.
    frames : int
        Number of pictures in a period.
    width : float
        Width [inch at 160 dpi].
    title : str
        Heading; number, frequency and damping unless given.
    """
    shape = modes.shapes[:, index] * shape_phase(modes.shapes[:, index])
    real, imag = np.ascontiguousarray(shape.real, dtype=float), np.ascontiguousarray(shape.imag, dtype=float)
    surface, quadrature = model_surface(model, real), model_surface(model, imag)
    scale = amplification(surface, drawn_size(model))
    phases = 2 * np.pi * np.arange(frames) / frames

    def at(phase: float) -> Surface:
        c, s = np.cos(phase), np.sin(phase)
        return surface.with_motion(
            c * surface.translation - s * quadrature.translation,
            c * surface.rotation - s * quadrature.rotation,
        )

    places = [at(phase).deformed(scale) for phase in phases]
    scene = Scene(surface.rest, *places, title=title or mode_title(modes, index), width=width, dpi=160)
    scene.add_ghost(surface)
    moving = scene.add_moving(surface, scale)
    with scene.open() as stage:
        pictures = []
        for place in places:
            for mesh, lift in zip(moving, (0.0, scene.lift), strict=True):
                mesh.points = (place + lift).astype(np.float32)
            pictures.append(stage.photograph())
        overlay = scene.overlay(pictures[0])
    images = [Image.fromarray(blend(scene.embed(picture), overlay)) for picture in pictures]
    palette = _palette(np.asarray(images[0]), np.asarray(images[frames // 2]))
    images = [_indexed(image, palette) for image in images]
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    images[0].save(
        path, save_all=True, append_images=images[1:], duration=60, loop=0, optimize=False, disposal=1
    )
    return path


def _palette(*pictures: NDArray[np.uint8]) -> Image.Image:
    """Return one palette for all frames, so that colours do not flicker, with the white of the page in it."""
    seen = np.concatenate([p.reshape(-1, 3) for p in pictures])
    seen = seen[(seen < 250).any(axis=1)]
    rows = Image.fromarray(np.ascontiguousarray(seen[None]))
    colours = (
        rows.quantize(255, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).getpalette() or []
    )[:765]
    palette = Image.new("P", (1, 1))
    palette.putpalette([255, 255, 255, *colours])
    return palette


def _indexed(image: Image.Image, palette: Image.Image) -> Image.Image:
    """Return an image in the colours of a palette, the first of which is exactly white."""
    index = np.array(image.quantize(palette=palette, dither=Image.Dither.NONE))
    index[(np.asarray(image) >= 250).all(axis=2)] = 0
    out = Image.fromarray(index)
    out.putpalette(palette.getpalette() or [])
    return out
