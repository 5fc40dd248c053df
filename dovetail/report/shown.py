"""Figures in a page: interactive where a script runs, still pictures where none does or on paper."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from plotly.offline import get_plotlyjs

from dovetail.report.blocks import Plot
from dovetail.report.drawings import Album, Figures, as_json, packed
from dovetail.report.page import Markup, join, script, tag
from viz.interactive.theme import CONFIG, NIGHT

LIVE = (Path(__file__).parent / "live.js").read_text(encoding="utf-8")
TURN = "Drag to turn; click, then scroll to zoom. Keys: arrows turn, + and − zoom."
"""How a figure in space is turned."""


def choice(word: str, names: Sequence[str], *, values: bool = False) -> Markup:
    """Return a list of names to choose from, with a label; with values for scripts that need them."""
    options = (tag("option", name, value=name if values else None) for name in names)
    return tag("label", word, tag("select", *options))


@dataclass(frozen=True, slots=True)
class Shown:
    """The pictures and the interactive figures of a report.

    Attributes
    ----------
    album : Album
    figures : Figures
        Without any the page has pictures alone, and no script.
    """

    album: Album
    figures: Figures = field(default_factory=Figures)

    def figure(
        self,
        name: str,
        alt: str,
        caption: str,
        stills: Sequence[str] = (),
        *,
        tools: str = "",
        hint: str = "",
    ) -> Plot:
        """Return an interactive figure with the still pictures that stand for it; these alone without it."""
        f = self.figures
        pictures = [p for key in stills if (p := self.album[key])]
        plot, data = (packed(of[name]) if name in f.known and name in of else "" for of in (f.known, f.data))
        return Plot(name, alt, caption, pictures, plot, data, tools, hint)

    def scripts(self) -> Markup:
        """Return the scripts of the figures, plotly.js itself included; nothing where there are none."""
        if not self.figures.known:
            return Markup()
        night = script(as_json(NIGHT), type="application/json", id="night-colours")
        config = script(as_json(CONFIG), type="application/json", id="config")
        return join([night, config, script(get_plotlyjs()), script(LIVE)])
