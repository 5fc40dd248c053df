"""Figures in a page: interactive where a script runs, still pictures where none does or on paper."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from plotly.offline import get_plotlyjs

from dovetail.report.figures import Figures, as_json, packed
from dovetail.report.page import Markup, figure, image, join, script, tag
from dovetail.report.pictures import Album
from viz.interactive.theme import CONFIG, NIGHT

LIVE = (Path(__file__).parent / "live.js").read_text(encoding="utf-8")
TURN = "Drag to turn; click, then scroll to zoom. Keys: arrows turn, + and − zoom."
"""How a figure in space is turned."""


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

    def __contains__(self, name: str) -> bool:
        return name in self.figures.known

    def picture(self, name: str, class_: str = "") -> Markup:
        """Return a picture with its caption; nothing if there is none."""
        p = self.album[name]
        return image(p.file, p.alt, p.caption, class_) if p else Markup()

    def figure(
        self,
        name: str,
        alt: str,
        caption: str,
        stills: Sequence[str] = (),
        *,
        tools: Markup | str = "",
        hint: str = "",
    ) -> Markup:
        """Return an interactive figure with the still pictures that stand for it; these alone without it."""
        pictures = [p for key in stills if (p := self.album[key])]
        if name not in self:
            return join(image(p.file, p.alt, p.caption) for p in pictures)
        return figure(
            tag("div", tools, class_="tools") if tools else "",
            tag("div", class_="plot", role="group", tabindex="0", aria_label=f"{alt} {hint}".strip()),
            *(image(p.file, p.alt, p.caption, "still") for p in pictures),
            tag("p", hint, class_="hint") if hint else "",
            script(packed(self.figures.known[name]), type="text/plain", id=f"figure-{name}"),
            script(packed(self.figures.data[name]), type="text/plain", id=f"data-{name}")
            if name in self.figures.data
            else "",
            tag("figcaption", caption, class_="live"),
            data_figure=name,
            class_="" if pictures else "bare",
        )

    def scripts(self) -> Markup:
        """Return the scripts of the figures, plotly.js itself included; nothing where there are none."""
        if not self.figures.known:
            return Markup()
        night = script(as_json(NIGHT), type="application/json", id="night-colours")
        config = script(as_json(CONFIG), type="application/json", id="config")
        return join([night, config, script(get_plotlyjs()), script(LIVE)])
