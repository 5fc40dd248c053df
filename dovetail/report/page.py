"""Small pieces of HTML: escaped text, tables, embedded images; a page of them loads nothing else."""

import base64
import html
import re
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

from PIL import Image, features

MIME = {".png": "image/png", ".gif": "image/gif"}

CSS = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")
_QUALITY = 82
"""Of pictures in the page; the files beside it are whole."""


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()

    def __add__(self, other: str) -> "Markup":
        return Markup(str(self) + esc(other))


def esc(text: object) -> Markup:
    """Return text as HTML; Markup stays as it is."""
    return text if isinstance(text, Markup) else Markup(html.escape(str(text)))


def tag(name: str, *content: object, **attributes: object) -> Markup:
    """Return an element; in attributes' names ``class_`` stands for class, ``data_x`` for data-x."""
    words = "".join(
        f' {k.rstrip("_").replace("_", "-")}="{esc(v)}"' for k, v in attributes.items() if v not in (None, "")
    )
    return Markup(f"<{name}{words}>{join(content)}</{name}>")


def join(parts: Iterable[object]) -> Markup:
    """Return parts one after the other."""
    return Markup("".join(esc(p) for p in parts))


def paragraph(*content: object) -> Markup:
    """Return a paragraph."""
    return tag("p", *content) + Markup("\n")


def bullets(items: Sequence[object]) -> Markup:
    """Return a list; nothing for none."""
    return tag("ul", *(tag("li", item) for item in items)) if items else Markup()


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[object]],
    *,
    numbers: Iterable[int] = (),
    marked: Iterable[int] = (),
    caption: str = "",
    at_most: int = 20,
) -> Markup:
    """Return a table; rows beyond ``at_most`` are collapsed.

    Parameters
    ----------
    head : sequence of str
        Headings with units.
    rows : sequence of sequences
    numbers : iterable of int
        Columns that hold numbers.
    marked : iterable of int
        Rows that stand out.
    caption : str
    at_most : int
    """
    numbers, marked = set(numbers), set(marked)
    few = at_most if len(rows) > at_most + 3 else len(rows)
    shown = _table(head, rows[:few], numbers, marked, caption)
    if few == len(rows):
        return shown
    rest = _table(head, rows[few:], numbers, {k - few for k in marked}, "")
    return join([shown, tag("details", tag("summary", f"{len(rows) - few} more"), rest)])


def _table(
    head: Sequence[str], rows: Sequence[Sequence[object]], numbers: set[int], marked: set[int], caption: str
) -> Markup:
    top = tag(
        "tr", *(tag("th", h, scope="col", class_="n" if k in numbers else None) for k, h in enumerate(head))
    )
    body = []
    for r, row in enumerate(rows):
        cells = [
            tag("th", c, scope="row")
            if k == 0 and 0 not in numbers
            else tag("td", c, class_="n" if k in numbers else None)
            for k, c in enumerate(row)
        ]
        body.append(tag("tr", *cells, class_="mark" if r in marked else None))
    whole = tag("table", tag("caption", caption) if caption else "", tag("thead", top), tag("tbody", *body))
    return tag("div", whole, class_="wide") + Markup("\n")


def image(file: Path, alt: str, caption: str = "", class_: str = "") -> Markup:
    """Return a figure with the image in it."""
    return figure(picture(file, alt), caption=caption, class_=class_)


def figure(*content: object, caption: str = "", **attributes: object) -> Markup:
    """Return a figure with a caption."""
    return tag("figure", *content, tag("figcaption", caption) if caption else "", **attributes) + Markup("\n")


def picture(file: Path, alt: str, class_: str = "") -> Markup:
    """Return an image with its content in the page, and the name of its file for other programs."""
    kind, content = _embedded(file)
    width, height = _size(file.read_bytes())
    data = base64.b64encode(content).decode("ascii")
    named = f' class="{esc(class_)}"' if class_ else ""
    return Markup(
        f'<img{named} src="data:{kind};base64,{data}" alt="{esc(alt)}" width="{width}" height="{height}" '
        f'data-file="{esc(file.name)}">'
    )


def _embedded(file: Path) -> tuple[str, bytes]:
    """Return the kind and the bytes of an image in a page: WebP where that is smaller."""
    content = file.read_bytes()
    if file.suffix == ".png" and features.check("webp"):
        with Image.open(file) as drawn:
            buffer = BytesIO()
            drawn.convert("RGB").save(buffer, "webp", quality=_QUALITY, method=4)
        if buffer.tell() < len(content):
            return "image/webp", buffer.getvalue()
    return MIME[file.suffix], content


def _size(content: bytes) -> tuple[int, int]:
    """Return width and height of a PNG or a GIF, so that the page does not jump while it is laid out."""
    if content.startswith(b"\x89PNG"):
        return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")
    return int.from_bytes(content[6:8], "little"), int.from_bytes(content[8:10], "little")


def section(title: str, *content: object) -> Markup:
    """Return a section with its heading."""
    return tag("section", tag("h2", title), "\n", *content, id=slug(title)) + Markup("\n")


def slug(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def contents(parts: Iterable[str]) -> Markup:
    """Return links to the sections among parts of a page."""
    found = [m for part in parts for m in re.findall(r'<section id="([^"]+)"><h2>(.*?)</h2>', part)]
    links = [tag("li", tag("a", Markup(title), href=f"#{anchor}")) for anchor, title in found]
    return tag("nav", tag("ul", *links), class_="contents", aria_label="Contents") + Markup("\n")


def folded(summary: str, *content: object) -> Markup:
    """Return content that is shown on demand."""
    return tag("details", tag("summary", summary), *content) + Markup("\n")


def facts(pairs: Iterable[tuple[str, object]]) -> Markup:
    """Return a list of names and values."""
    return tag("dl", *(join([tag("dt", k), tag("dd", v)]) for k, v in pairs))


def script(text: str, **attributes: object) -> Markup:
    """Return a script, or data for one; the text must not hold the end of a script."""
    return tag("script", Markup(text), **attributes) + Markup("\n")


POLICY = "default-src 'none'; " + "; ".join(
    (
        "script-src 'unsafe-inline'",
        "style-src 'unsafe-inline'",
        "img-src data: blob:",
        "font-src data:",
        "base-uri 'none'",
        "form-action 'none'",
    )
)
"""Content security policy: the page has all that it shows in itself, and nothing comes from the network."""


def page(title: str, *content: object) -> str:
    """Return a whole page."""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n<title>{esc(title)}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<link rel="icon" href="data:,">\n<style>{CSS}</style>\n</head>\n'
        f"<body>\n{join(content)}</body>\n</html>\n"
    )
