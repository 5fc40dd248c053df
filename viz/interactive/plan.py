"""The structure coloured by the least size of effects that a test shows at each place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os.path import commonprefix
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from numpy.typing import NDArray
from plotly.graph_objects import Figure

from fem.model import Effect, Model
from updating.diagnosis.evidence.places import place_of
from updating.plan.plan import Outlook
from updating.plan.visibility import size_of
from viz import style
from viz.interactive.solids import points_trace, scene, solid, wires
from viz.interactive.theme import CELL, colour_scale, layout, plain, rgb_text, single
from viz.models import model_surface
from viz.surfaces import Surface

N_TICKS, APART = 5, 0.1
"""At most so many sizes are named at the colours, so far apart in parts of their range [-]."""
SAME_POINT = 1e-3
"""Points nearer to each other than this share of the structure's size have one mark [-]."""
BLIND = style.VERMILION
"""Where the test shows no plausible size."""


@dataclass(frozen=True, slots=True)
class Wording:
    """Words of a figure of sizes.

    Attributes
    ----------
    what : str
        ``seen``, ``located`` or ``named``.
    size : callable
        Returns the size of an effect.
    place : callable
        Returns where an effect is and what the test shows there.
    """

    what: str
    size: Callable[[Effect], str]
    place: Callable[[Outlook], str]


def sizes_figure(
    model: Model, kinds: Sequence[Sequence[Outlook]], wording: Wording, height: float = 430
) -> Figure:
    """Return a structure to turn, coloured by the least size that is seen, located or named at each place.

    Members are coloured where an effect is one of the whole member, and marks elsewhere. Of several effects
    at a place, such as the directions of a joint, the one counts of which least is shown; pointing at it
    lists all. The first kind is visible; ``layout.meta["visible"]`` has which traces are, for each kind.

    Parameters
    ----------
    model : Model
    kinds : sequence of sequence of Outlook
        Effects of one kind and unit each.
    wording : Wording
    height : float
        [pixel].

    Raises
    ------
    ValueError
        If the model has no frame with sections.
    """
    surface = model_surface(model, pieces=1)
    x, triangles = surface.rest, surface.triangles
    plain_solid = solid(x, triangles, color=style.MEMBERS[-1], opacity=0.35, hoverinfo="skip", showlegend=False)
    traces, owner = [wires(x, surface.edges), plain_solid], [-1, -1]
    visible = []
    for k, some in enumerate(kinds):
        drawn = _Kind.of(model, some, wording).traces(model, surface)
        traces += drawn
        owner += [k] * len(drawn)
    for k in range(len(kinds)):
        shown = [o in (-1, k) for o in owner]
        solids = [t["type"] == "mesh3d" and o == k for t, o in zip(traces, owner, strict=True)]
        shown[1] = not any(solids)  # two surfaces at one place flicker
        visible.append(shown)
    for trace, shown in zip(traces, visible[0] if visible else [True, True], strict=True):
        trace["visible"] = shown
    look = layout(height, scene=scene(x), meta={"visible": visible})
    look["margin"] |= {"l": 0, "r": 0, "b": 0}
    return Figure(traces, look)


@dataclass(frozen=True, slots=True, eq=False)
class _Kind:
    """Places of a kind with what pointing at them shows, and how large effects must be there.

    Attributes
    ----------
    members : dict of str to (float, str)
    marks : dict of tuple to (float, str, ndarray (3,))
        By rounded points [m].
    ticks : (list of float, list of str)
        Sizes that are named at the colours.
    """

    members: dict[str, tuple[float, str]]
    marks: dict[tuple[int, ...], tuple[float, str, NDArray[np.float64]]]
    ticks: tuple[list[float], list[str]]
    limits: tuple[float, float]
    title: str
    what: str

    @classmethod
    def of(cls, model: Model, some: Sequence[Outlook], wording: Wording) -> "_Kind":
        members: dict[str, tuple[float, str]] = {}
        marks: dict[tuple[int, ...], tuple[float, str, NDArray[np.float64]]] = {}
        named = []
        for o in some:
            least = o.least(wording.what)
            size = np.inf if least is None else _measure(o, least)
            if least is not None:
                named.append((size, wording.size(least)))
            line = plain(wording.place(o))
            kind, name = place_of(o.relevant)
            if kind == "member" and not any(p.position for p in o.relevant.parameters()):
                member = name.removeprefix("member ")
                known = members.get(member, (0.0, ""))
                members[member] = max(size, known[0]), _lines(known[1], line)
                continue
            for at in o.relevant.locations(model):
                key = tuple(np.round(at / (SAME_POINT * model.mesh.size)).astype(int).tolist())
                first, lines, point = marks.get(key, (0.0, "", at))
                marks[key] = max(size, first), _lines(lines, line), point
        ticks, texts, prefix = _ticks(sorted(named))
        limits = (min(named)[0], max(named)[0]) if named else (1.0, 1.0)
        title = f"{wording.what} from {prefix}".strip()
        return cls(members, marks, (ticks, texts), limits, title, wording.what)

    def traces(self, model: Model, surface: Surface) -> list[dict[str, Any]]:
        """Return members in their colours, marks, and crosses where nothing is shown."""
        out = self._members(model, surface) if self.members else []
        good = [m for m in self.marks.values() if np.isfinite(m[0])]
        blind = [m for m in self.marks.values() if not np.isfinite(m[0])]
        edge = {"color": style.INK, "width": 1}
        if np.isfinite(self.limits[1]) and self.ticks[0]:
            marker = {"size": 7, "line": edge, "color": single([np.log(m[0]) for m in good]), **self._colours()}
            # one point without a place where members alone have the colours
            at = [m[2] for m in good] or [np.full(3, np.nan)]
            marker |= {} if good else {"color": single([np.log(self.limits[0])])}
            out.append(
                points_trace(at, [""] * len(at), [m[1] for m in good] or [""], marker, showlegend=False)
            )
        if blind or any(not np.isfinite(size) for size, _ in self.members.values()):
            look = {"symbol": "x" if blind else "square", "size": 5, "color": BLIND}
            at = [m[2] for m in blind] or [np.full(3, np.nan)]
            name = f"not {self.what} at any plausible size"
            hover = [m[1] for m in blind] or [""]
            out.append(points_trace(at, [""] * len(at), hover, look, name=name, showlegend=True))
        return out

    def _members(self, model: Model, surface: Surface) -> list[dict[str, Any]]:
        norm, cmap = Normalize(*np.log(self.limits)), _map()
        colour = {
            m: rgb_text(cmap(norm(np.log(size)))) if np.isfinite(size) else BLIND
            for m, (size, _) in self.members.items()
        }
        owner = [str(m) for m in model.mesh.member_of_line()]
        face = [owner[line] for line in surface.line]
        vertex = np.zeros(len(surface.rest), dtype=int)
        vertex[surface.triangles.ravel()] = np.repeat(surface.line, 3)
        hover = [self.members.get(owner[line], (0.0, ""))[1] for line in vertex]
        return [
            solid(
                surface.rest, surface.triangles, facecolor=[colour.get(m, CELL) for m in face],
                hoverinfo="text", hovertext=hover, showlegend=False,
            )
        ]  # fmt: skip

    def _colours(self) -> dict[str, Any]:
        low, high = np.log(self.limits)
        values, texts = self.ticks
        bar = {
            "title": {"text": plain(self.title), "side": "right", "font": {"size": 11}}, "thickness": 12,
            "len": 0.75, "outlinewidth": 0, "x": 1, "xanchor": "left", "tickfont": {"size": 11},
            "tickvals": np.log(values).tolist(), "ticktext": [plain(t) for t in texts],
        }  # fmt: skip
        room = 0.0 if high > low else 0.5
        return {
            "cmin": low - room, "cmax": high + room, "colorscale": colour_scale(_map()), "colorbar": bar,
        }  # fmt: skip


def _map() -> Any:
    return style.displacement_map()


def _measure(o: Outlook, effect: Effect) -> float:
    """Return a size that rises with that in words: where this is a share, that of the relevant size."""
    return size_of(effect) / (size_of(o.relevant) if effect.size_in_words() else 1.0)


def _lines(one: str, other: str) -> str:
    return f"{one}<br>{other}" if one else other


def _ticks(named: Sequence[tuple[float, str]]) -> tuple[list[float], list[str], str]:
    """Return sizes, the texts beside them, and the words with which all of these begin."""
    if not named:
        return [], [], ""
    at = np.log([size for size, _ in named])
    span = float(np.ptp(at))
    chosen: list[int] = []
    for target in np.linspace(at[0], at[-1], N_TICKS)[[0, -1, *range(1, N_TICKS - 1)]]:
        k = int(np.argmin(np.abs(at - target)))
        if all(named[k][1] != named[c][1] and abs(at[k] - at[c]) > APART * span for c in chosen):
            chosen.append(k)
    texts = [named[k][1] for k in chosen]
    prefix = commonprefix([t.split(" ")[:-1] for t in texts])
    n = len(" ".join(prefix)) + 1 if prefix else 0
    return [named[k][0] for k in chosen], [t[n:] for t in texts], " ".join(prefix)
