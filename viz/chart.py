"""Descriptions of plane figures: marks on two axes.

:mod:`viz.still` draws them by matplotlib and :mod:`viz.interactive.live` by plotly. A figure is one function
from data to a description, and each backend draws every description.
"""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from matplotlib.colors import Colormap
from numpy.typing import ArrayLike

from viz import style

MOST_LINES = 6
"""Lines of a name beside an axis [-]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ChartMark:
    """Something drawn on the axes.

    Attributes
    ----------
    name : str
        Empty for a mark that has none.
    colour : str
    opacity : float
    keyed : bool
        Whether a mark with a name is in the legend.
    meta : mapping
        What a page knows the mark by.
    """

    name: str = ""
    colour: str = style.INK
    opacity: float = 1.0
    keyed: bool = True
    meta: Mapping[str, str] = field(default_factory=dict)

    def mapped(self, f: Callable[[Any], Any]) -> "ChartMark":
        """Return a copy whose values along y are those of a function of them."""
        return self


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Values(ChartMark):
    """Values that readers point at, with texts for each.

    Attributes
    ----------
    text : sequence of str
        Shown beside each value.
    hover : sequence of str or str
        Shown on pointing at a value: a text each, or one with ``{x}`` and ``{y}``, formatted as in
        ``{y:.1f}``. Values without any do not answer.
    data : sequence
        What a click on a value answers.
    """

    text: Sequence[str] = ()
    hover: Sequence[Any] | str = ()
    data: Sequence[Any] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Curve(Values):
    """A line, points, or both.

    Attributes
    ----------
    x, y : array_like (n,)
    dash : str
        Of the line, as matplotlib spells it; no line if empty.
    width : float
        Of the line [pixel].
    symbol : str
        Of the points, as matplotlib spells it; no points if empty.
    treads : bool
        Whether the line is level at each point and rises halfway to the next.
    spread : array_like (n,), optional
        Half length of an upright bar at each point.
    above : sequence of bool
        Which texts are above their points.
    """

    x: ArrayLike
    y: ArrayLike
    dash: str = ""
    width: float = 1.6
    symbol: str = ""
    treads: bool = False
    spread: ArrayLike | None = None
    above: Sequence[bool] = ()

    def mapped(self, f: Callable[[Any], Any]) -> "Curve":
        """Return a copy whose values along y are those of a function of them."""
        return replace(self, y=f(self.y))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RowBars(Values):
    """Level bars at ``y`` from a base to ``x``; thickness in units of ``y``, hatched with ``/`` or ``x``."""

    y: ArrayLike
    x: ArrayLike
    base: float = 0.0
    thickness: float = 0.68
    hatch: str = ""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Matrix(Values):
    """Cells (rows, columns), coloured between ``limits``; ``label`` is that of the colours.

    Their numbers have so many ``digits`` and are shown if that is given.
    """

    cells: ArrayLike
    colours: Colormap
    limits: tuple[float, float]
    label: str
    digits: int | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Band(ChartMark):
    """What lies between two curves over ``x``."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike

    def mapped(self, f: Callable[[Any], Any]) -> "Band":
        """Return a copy whose values along y are those of a function of them."""
        return replace(self, low=f(self.low), high=f(self.high))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Span(ChartMark):
    """A range of one axis, over all of the other."""

    low: float
    high: float
    along: str = "x"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rule(ChartMark):
    """A line across the figure at one value of an axis, with words beside it."""

    value: float
    along: str = "x"
    dash: str = "-"
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """An axis.

    Attributes
    ----------
    label : str
        With the unit.
    limits : (float, float), optional
        Its ends; the first is the larger one where values fall along it.
    ticks : (sequence of float, sequence of str), optional
        Values that are marked, and their names.
    grid, log : bool
        Whether there are lines at its ticks, and whether it is logarithmic.
    decibels : str, optional
        Unit that values in decibels are relative to; a still picture shows them in this unit, on a
        logarithmic axis.
    """

    label: str = ""
    limits: tuple[float, float] | None = None
    ticks: tuple[Sequence[float], Sequence[str]] | None = None
    grid: bool = True
    log: bool = False
    decibels: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Marks below others over the same x, as high as a part of the first ones."""

    marks: Sequence[ChartMark]
    y: Axis
    part: float


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """A plane figure.

    Attributes
    ----------
    marks : sequence of ChartMark
        The later ones over the earlier ones.
    x, y : Axis
    title : str
    height : float
        Of an interactive figure [pixel].
    size : (float, float)
        Of a still picture [inch].
    below : sequence of Panel
    compares : bool
        Whether pointing at an x shows the values of all curves there.
    equal : bool
        Whether both axes have one scale.
    meta : mapping
        What a page knows the figure by.
    """

    marks: Sequence[ChartMark]
    x: Axis
    y: Axis
    title: str = ""
    height: float = 340.0
    size: tuple[float, float] = (style.WIDTH, 3.4)
    below: Sequence[Panel] = ()
    compares: bool = False
    equal: bool = False
    meta: Mapping[str, str] = field(default_factory=dict)


def columns(names: Sequence[str], label: str = "") -> Axis:
    """Return an axis with a value for each name."""
    return Axis(label, (-0.5, len(names) - 0.5), (range(len(names)), names), grid=False)


def rows(names: Sequence[str], label: str = "", *, grid: bool = False) -> Axis:
    """Return an upright axis with a row for each name, the first one at the top."""
    return Axis(label, (len(names) - 0.5, -0.5), (range(len(names)), names), grid)


def broken(text: str, width: int) -> str:
    """Return a text with line breaks between words: lines of even length, cut where many."""

    def wrapped(w: int) -> list[str]:
        return textwrap.wrap(text, w, break_long_words=False, break_on_hyphens=False)

    n = len(wrapped(width))
    even = next(w for w in range(max(width // 2, 1), width + 1) if len(wrapped(w)) <= n)
    lines = wrapped(even)
    return "\n".join(lines[:MOST_LINES]) + (" …" if len(lines) > MOST_LINES else "") or " "


def decibel(unit: str) -> str:
    """Return the unit of a level in decibel."""
    return "dB" if unit == "-" else f"dB re 1 {unit}"
