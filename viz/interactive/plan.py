"""The structure coloured by the least size of effects that a test shows at each place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from plotly.graph_objects import Figure

from fem.array_types import Floats
from fem.model import Effect, Model
from updating.diagnosis.evidence.places import place_of
from updating.plan.plan import Outlook
from updating.plan.visibility import size_of
from viz import style
from viz.interactive.solids import line_of_vertex, points_trace, scene, solid, wires
from viz.interactive.theme import CELL, colour_bar, colour_scale, layout, plain, rgb_text, single
from viz.models import drawn_names, model_surface
from viz.surfaces import Surface

N_TICKS, APART = 5, 0.1
"""At most so many sizes are named at the colours, so far apart in parts of their range [-]."""
ROOM, RANGE = 0.06, float(np.log(2))
"""Colours beyond the least and the largest size, in parts of the range, and the least range of logarithms.

The sizes are an estimate that is a factor of two off at worst, as checks have shown [-].
"""
MANY, SIZES = 60, (6, 4)
"""Number of marks above which they are small; sizes [pixel]."""
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
        Returns where an effect is.
    """

    what: str
    size: Callable[[Effect], str]
    place: Callable[[Effect], str]

    @property
    def nowhere(self) -> str:
        """Words for an effect of which no size is shown."""
        return f"not {self.what} at any plausible size"

    def line(self, o: Outlook) -> str:
        """Return where an effect is and from what size on it is shown."""
        least = o.least(self.what)
        size = f"{self.what} from {self.size(least)}" if least else self.nowhere
        return f"{plain(self.place(o.relevant))}:<br>   {plain(size)}"


def sizes_figure(model: Model, kinds: Sequence[Sequence[Outlook]], wording: Wording) -> Figure:
    """Return a structure to turn, coloured by the least size that is shown at each place.

    Members are coloured where an effect is one of the whole member, and marks elsewhere. Of several effects
    at a place, such as the directions of a joint, the one with the largest size has the colour; pointing at
    the place lists all. The first kind is visible; ``layout.meta["visible"]`` has the traces of each kind.

    Parameters
    ----------
    model : Model
    kinds : sequence of sequence of Outlook
        Effects of one kind and unit each.
    wording : Wording

    Raises
    ------
    ValueError
        If the model has no frame with sections.
    """
    surface = model_surface(model, pieces=1)
    # axes and edges, no surfaces: even a transparent one would answer pointing in place of the marks in it
    line = {"color": style.AT_REST, "width": 4}
    axes = wires(model.mesh.points, np.asarray(model.mesh.lines), line=line)
    traces, owner = [wires(surface.rest, surface.edges), axes], [-1, -1]
    for k, some in enumerate(kinds):
        drawn = _Kind.of(model, some, wording).traces(model, surface)
        traces += [{**trace, "visible": k == 0} for trace in drawn]
        owner += [k] * len(drawn)
    visible = [[o in (-1, k) for o in owner] for k in range(len(kinds))]
    look = layout(430, scene=scene(surface.rest), meta={"visible": visible})
    look["margin"] |= {"l": 0, "r": 0, "b": 0}
    return Figure(traces, look)


@dataclass(slots=True)
class _Spot:
    """A place with the sizes that are shown there, infinite where none is plausible, and a line for each."""

    point: Floats
    sizes: list[float]
    lines: list[str]

    @property
    def worst(self) -> float:
        """The largest size that is plausible; infinite if none is."""
        return max((s for s in self.sizes if np.isfinite(s)), default=np.inf)

    @property
    def blind(self) -> bool:
        """Whether some effect at the place is not shown."""
        return not np.isfinite(self.sizes).all()


@dataclass(frozen=True, slots=True, eq=False)
class _Kind:
    """Places of the effects of one kind, and the colours of their sizes.

    Attributes
    ----------
    members : dict of str to _Spot
        Members of which all is affected.
    marks : tuple of _Spot
        Points.
    sizes, texts : list of float, list of str
        Sizes that are named at the colours, and how.
    limits : (float, float)
        Of the colours, in logarithms of sizes.
    title : str
        Of the colours.
    wording : Wording
    """

    members: dict[str, _Spot]
    marks: tuple[_Spot, ...]
    sizes: list[float]
    texts: list[str]
    limits: tuple[float, float]
    title: str
    wording: Wording

    @classmethod
    def of(cls, model: Model, some: Sequence[Outlook], wording: Wording) -> "_Kind":
        members: dict[str, _Spot] = {}
        marks: dict[tuple[int, ...], _Spot] = {}
        named = []
        for o in some:
            least = o.least(wording.what)
            size = np.inf if least is None else _measure(o, least)
            named += [] if least is None else [(size, wording.size(least))]
            kind, name = place_of(o.relevant)
            if kind == "member" and not any(p.position for p in o.relevant.parameters()):
                spots = [members.setdefault(name.removeprefix("member "), _Spot(np.full(3, np.nan), [], []))]
            else:
                # Points nearer to each other than this share of the structure's size have one mark [-]
                keyed = (
                    (tuple(np.round(at / (1e-3 * model.mesh.size)).astype(int).tolist()), at)
                    for at in o.relevant.locations(model)
                )
                spots = [marks.setdefault(key, _Spot(at, [], [])) for key, at in keyed]
            for spot in spots:
                spot.sizes.append(size)
                spot.lines.append(wording.line(o))
        sizes, texts, prefix = _ticks(sorted(named))
        low, high = np.log([min(named)[0], max(named)[0]]) if named else (0.0, 0.0)
        room = max(ROOM * (high - low), (RANGE - (high - low)) / 2)
        limits = float(low - room), float(high + room)
        title = f"{wording.what} from" + (f": {prefix}" if prefix else "")
        return cls(members, tuple(marks.values()), sizes, texts, limits, title, wording)

    def traces(self, model: Model, surface: Surface) -> list[dict[str, Any]]:
        """Return members in their colours, and marks by how many of the effects there are shown."""
        nowhere = _Spot(np.full(3, np.nan), [], [""])
        none = [m for m in self.marks if not np.isfinite(m.worst)]
        part = [m for m in self.marks if m.blind and np.isfinite(m.worst)]
        every = [m for m in self.marks if not m.blind]
        out = self._members(model, surface) if self.members else []
        if self.sizes:  # its bar of colours is that of members and other marks, too
            out.append(self._trace(every or [nowhere], "circle"))
        if part:
            out.append(self._trace(part, "diamond", f"not {self.wording.what} in every direction"))
        if none or any(m.blind for m in self.members.values()):
            symbol = "circle-open" if none else "square"
            out.append(self._trace(none or [nowhere], symbol, self.wording.nowhere))
        return out

    def _trace(self, spots: Sequence[_Spot], symbol: str, name: str = "") -> dict[str, Any]:
        edge = {"color": BLIND, "width": 3}
        marker: dict[str, Any] = {
            "symbol": symbol,
            "size": SIZES[len(self.marks) > MANY],
            "color": BLIND,
            "line": edge,
        }
        if symbol in ("circle", "diamond"):
            sizes = [m.worst if np.isfinite(m.worst) else 1.0 for m in spots]
            marker |= {
                "line": {"color": style.INK, "width": 1},
                "color": single(np.log(sizes)),
                **self._colours(),
                "showscale": symbol == "circle",
            }
        hover = ["<br>".join(m.lines) for m in spots]
        points = [m.point for m in spots]
        return points_trace(points, [""] * len(spots), hover, marker, name=plain(name), showlegend=bool(name))

    def _members(self, model: Model, surface: Surface) -> list[dict[str, Any]]:
        norm, cmap = Normalize(*self.limits), _map()
        colour = {
            m: BLIND if spot.blind else rgb_text(cmap(norm(np.log(spot.worst))))
            for m, spot in self.members.items()
        }
        owner = [str(m) for m in drawn_names(model)]
        hover = {m: "<br>".join(spot.lines) for m, spot in self.members.items()}
        return [
            solid(
                surface.rest,
                surface.triangles,
                showlegend=False,
                hoverinfo="text",
                facecolor=[colour.get(owner[line], CELL) for line in surface.line],
                hovertext=[hover.get(owner[line], "") for line in line_of_vertex(surface)],
            )
        ]

    def _colours(self) -> dict[str, Any]:
        bar = {
            **colour_bar(self.title, 11, 0.75, "top", x=1, xanchor="left"),
            "thickness": 12,
            "tickvals": np.log(self.sizes).tolist(),
            "ticktext": [plain(t) for t in self.texts],
        }
        low, high = self.limits
        return {"cmin": low, "cmax": high, "colorscale": colour_scale(_map()), "colorbar": bar}


def _map() -> Any:
    return style.displacement_map()


def _measure(o: Outlook, effect: Effect) -> float:
    """Return a size that rises with that in words: where this is a share, that of the relevant size."""
    return size_of(effect) / (size_of(o.relevant) if effect.parameters()[0].in_words else 1.0)


def _ticks(named: Sequence[tuple[float, str]]) -> tuple[list[float], list[str], str]:
    """Return sizes, the texts beside them, and the words with which all of these begin."""
    if not named:
        return [], [], ""
    at = np.log([size for size, _ in named])
    span = max(float(np.ptp(at)), RANGE)
    chosen: list[int] = []
    for target in np.linspace(at[0], at[-1], N_TICKS)[[0, -1, *range(1, N_TICKS - 1)]]:
        k = int(np.argmin(np.abs(at - target)))
        if all(named[k][1] != named[c][1] and abs(at[k] - at[c]) > APART * span for c in chosen):
            chosen.append(k)
    texts = [named[k][1] for k in chosen]
    columns = zip(*(t.split(" ")[:-1] for t in texts), strict=False)
    common = takewhile(lambda words: len(set(words)) == 1 and words[0].isalpha(), columns)
    prefix = "".join(f"{words[0]} " for words in common)
    return [named[k][0] for k in chosen], [t.removeprefix(prefix) for t in texts], prefix.strip()
