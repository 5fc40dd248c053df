"""Where a test sees and names effects of a relevant size."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image

from fem.declarations import Role
from fem.model import Effect
from updating.diagnosis.evidence.places import place_of
from updating.plan.plan import Outlook, Plan
from viz import style
from viz.models import drawn_names, drawn_size, model_surface
from viz.overlay import Mark
from viz.scene import Scene

LOOKS = (
    ("named", style.BLUE),
    ("seen, and the place known", style.SKY),
    ("seen", style.ORANGE),
    ("not seen", style.VERMILION),
)
"""What a test shows of an effect, the most first, and in which colour."""


def render_plan(plan: Plan, path: str | Path, title: str = "") -> Path:
    """Draw where a test names connections that give way, other members, cracks, masses and so on.

    A picture for each. Where several effects have one place, such as the directions of a
    joint, the one counts of which least is seen.

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
    groups: dict[str, list[Outlook]] = {}
    for o in plan.relevant:
        groups.setdefault(_group(o.relevant), []).append(o)
    if not groups:
        msg = "no candidate has a relevant size: there is nothing to draw"
        raise ValueError(msg)
    path = Path(path)
    with TemporaryDirectory() as folder:
        each = [
            _draw(plan, some, Path(folder) / f"{k}.png", f"{title}: {name}" if title else name)
            for k, (name, some) in enumerate(groups.items())
        ]
        pictures = [np.asarray(Image.open(p).convert("RGB")) for p in each]
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(_in_two_columns(pictures)).save(path)
    return path


def _group(effect: Effect) -> str:
    """Return in which picture an effect is."""
    if place_of(effect)[0] in ("joint", "support", "end"):
        return "masses at connections" if Role.MASS in effect.role else "connections that give way"
    if any(p.position for p in effect.parameters()):
        return effect.kind.replace("_", " ")
    return "members"


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


def _draw(plan: Plan, some: Sequence[Outlook], path: Path, title: str) -> Path:
    surface, size = model_surface(plan.model), drawn_size(plan.model)
    looks = [next(k for k, good in enumerate((o.named, o.located, o.seen, True)) if good) for o in some]
    points: dict[tuple[int, ...], tuple[int, NDArray[np.float64]]] = {}
    members: dict[str, int] = {}
    for o, look in zip(some, looks, strict=True):
        kind, name = place_of(o.relevant)
        if kind == "member" and not any(p.position for p in o.relevant.parameters()):
            member = name.removeprefix("member ")
            members[member] = max(look, members.get(member, 0))
            continue
        for at in o.relevant.locations(plan.model):
            key = tuple(np.round(at / (1e-3 * size)).astype(int).tolist())
            if key not in points or points[key][0] < look:
                points[key] = look, at
    scene = Scene(surface.rest, title=title)
    plain = to_rgb("#e4e7eb")
    rgb = [to_rgb(LOOKS[members[m]][1]) if m in members else plain for m in drawn_names(plan.model)]
    scene.add_surface(surface, surface.rest, rgb=np.array(rgb)[surface.line])
    scene.marks += [Mark(at, "o", LOOKS[look][1], 8.0) for look, at in points.values()]
    scene.legend += [
        Line2D([], [], color=colour, marker="o", linestyle="", label=name) for name, colour in LOOKS
    ]
    return scene.save(path)
