"""Still pictures and interactive figures of a report by name; one that fails is left out and named."""

import json
import zlib
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from plotly.graph_objects import Figure

from dovetail.report.blocks import Picture
from viz import still
from viz.chart import Chart
from viz.interactive import live
from viz.style import save

DPI = 130
"""Resolution of the curves [1/inch]."""


@dataclass(slots=True)
class Album:
    """The pictures of a report by name, and failures of drawing.

    Attributes
    ----------
    folder : Path
    pictures : dict of str to Picture
    failures : list of str
        Sentences.
    """

    folder: Path
    pictures: dict[str, Picture] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def __getitem__(self, name: str) -> Picture | None:
        return self.pictures.get(name)

    def add(
        self, name: str, alt: str, caption: str, draw: Callable[[Path], Any], suffix: str = ".png"
    ) -> None:
        """Draw a picture into the folder."""
        file = self.folder / f"{name}{suffix}"
        try:
            draw(file)
        except Exception as reason:
            file.unlink(missing_ok=True)
            self.failures.append(
                f"The picture {file.name} could not be drawn ({type(reason).__name__}: {reason})."
            )
            return
        self.pictures[name] = Picture(file, alt, caption)

    def plot(
        self, name: str, alt: str, caption: str, plot: Callable[..., Any], *args: Any, **more: Any
    ) -> None:
        """Draw curves into the folder: the figure that ``plot`` returns for its arguments, or describes."""

        def drawn(file: Path) -> Any:
            made = plot(*args, **more)
            save(still.draw(made) if isinstance(made, Chart) else made, file, DPI)

        self.add(name, alt, caption, drawn)


@dataclass(slots=True)
class Figures:
    """The interactive figures of a report by name.

    Attributes
    ----------
    known : dict of str to Figure
    data : dict of str to mapping
        Further data of a figure, by its name.
    failures : list of str
        Sentences about those that could not be made.
    """

    known: dict[str, Figure] = field(default_factory=dict)
    data: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def add(self, name: str, make: Callable[[], Figure | Chart | None]) -> None:
        """Make a figure; one that cannot be made is left out and named."""
        try:
            made = make()
            figure = live.draw(made) if isinstance(made, Chart) else made
        except Exception as reason:
            self.failures.append(
                f"The figure {name} could not be made ({type(reason).__name__}: {reason}); "
                "the report has its picture instead."
            )
            return
        if figure is not None:
            self.known[name] = figure


def as_json(value: Any) -> str:
    """Return a figure or plain data as JSON that may stand between script tags."""
    text = value.to_json() if isinstance(value, Figure) else json.dumps(value, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def packed(value: Any) -> str:
    """Return a figure or plain data as deflated JSON in base64."""
    return b64encode(zlib.compress(as_json(value).encode(), 9)).decode("ascii")
