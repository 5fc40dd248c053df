"""Where a test sees and names effects of a relevant size."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image

from fem.array_types import Floats
from fem.model import Effect, Model
from updating.diagnosis.evidence.places import place_of
from updating.plan.plan import SHOWN, Outlook, Plan
from viz import style
from viz.models import drawn_size, model_surface
from viz.overlay import Mark
from viz.scene import Scene
from viz.surfaces import Surface

COLOURS: dict[str, str] = dict(
    zip(SHOWN, (style.BLUE, style.SKY, style.ORANGE, style.VERMILION), strict=True)
)
"""Of marks, by what a test says of an effect."""


MOST_PANELS = 6
"""Rows of a plan's table that are drawn: three rows of panels are as high as a sheet."""


def drawn_kinds(plan: Plan) -> tuple[str, ...]:
    """Return the kinds of a plan that are drawn, in its order: those whose effects differ most.

    Where a test says the same of nearly all effects of a row, the table says as much as a picture.
    """
    if len(plan.kinds) <= MOST_PANELS:
        return tuple(plan.kinds)
    most = {name: max(Counter(o.shown for o in some).values()) for name, some in plan.kinds.items()}
    odd = {name: len(some) - most[name] for name, some in plan.kinds.items()}
    first = sorted(odd, key=lambda name: -odd[name])[:MOST_PANELS]
    return tuple(name for name in plan.kinds if name in first and odd[name]) or (first[0],)


def render_plan(plan: Plan, path: str | Path, title: str = "") -> Path:
    """Draw what a test says of each effect of a relevant size: a panel for each of some rows of its table.

    The rows are those of :func:`drawn_kinds`.

    Effects at one place of which it says unlike things, such as the directions of a joint, have marks beside
    each other.

    Parameters
    ----------
    plan : Plan
    path : str or Path
        PNG file to write.
    title : str
        Heading.

    Raises
    ------
    ValueError
        If no effect has a relevant size.
    """
    if not plan.relevant:
        msg = "no candidate has a relevant size: there is nothing to draw"
        raise ValueError(msg)
    path, surface = Path(path), model_surface(plan.model)
    with TemporaryDirectory() as folder:
        each = [
            _draw(plan, surface, plan.kinds[name], Path(folder) / f"{k}.png", f"{title}: {name}".strip(" :"))
            for k, name in enumerate(drawn_kinds(plan))
        ]
        pictures = [np.asarray(Image.open(p).convert("RGB")) for p in each]
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(_in_two_columns(pictures)).save(path)
    return path


def _in_two_columns(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return pictures beside and below one another, on white."""
    height, width = (max(p.shape[k] for p in pictures) for k in (0, 1))
    columns = min(2, len(pictures))
    out = np.full((-(-len(pictures) // columns) * height, columns * width, 3), 255, dtype=np.uint8)
    for k, picture in enumerate(pictures):
        row, column = divmod(k, columns)
        top, left = row * height, column * width
        out[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
    return out


def _draw(plan: Plan, surface: Surface, some: Sequence[Outlook], path: Path, title: str) -> Path:
    size = drawn_size(plan.model)
    points: dict[tuple[int, ...], Mark] = {}
    for o in sorted(some, key=lambda o: SHOWN.index(o.shown)):
        for at in _places(plan.model, o.relevant):
            key = (SHOWN.index(o.shown), *np.round(at / (1e-3 * size)).astype(int).tolist())
            points[key] = Mark(at, "o", COLOURS[o.shown], 8.0)
    scene = Scene(surface.rest, title=title)
    plain = np.broadcast_to(to_rgb("#e4e7eb"), (len(surface.line), 3))
    scene.add_surface(surface, surface.rest, rgb=plain)
    scene.marks += points.values()
    counts = Counter(o.shown for o in some)
    scene.legend += [
        Line2D(
            [],
            [],
            color=COLOURS[word],
            marker="o",
            linestyle="",
            label=f"{word}: {counts[word]} of {len(some)}",
        )
        for word in SHOWN
    ]
    return scene.save(path)


def _places(model: Model, effect: Effect) -> Floats:
    """Return where an effect is marked, (n, 3) [m]: in the middle of a member of which it changes all."""
    places, mesh = effect.locations(model), model.mesh
    if len(places):
        return places
    member = place_of(effect)[1].removeprefix("member ")
    if member not in mesh.members:
        return places
    return mesh.point_at(mesh.locate(member, mesh.member_length(member) / 2))[None]
