"""Blocks as HTML, with images embedded; a page of them loads nothing else."""

import base64
import re
from collections.abc import Iterable
from dataclasses import replace
from functools import singledispatch
from html import escape
from io import BytesIO
from pathlib import Path

from PIL import Image, features

from dovetail.report.blocks import (
    Details,
    Facts,
    Group,
    Heading,
    Items,
    Pick,
    Picture,
    Plot,
    Report,
    ReportMark,
    ReportSection,
    TableBlock,
    Text,
)
from dovetail.report.outline import ID, packed_outline

MIME = {".png": "image/png", ".gif": "image/gif"}

CSS = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()

    def __add__(self, other: str) -> "Markup":
        return Markup(str(self) + html(other))


@singledispatch
def html(part: object) -> Markup:
    """Return a block or text as HTML; Markup stays as it is, and nothing of a block without content."""
    return Markup(escape(str(part)))


def tag(name: str, *content: object, **attributes: object) -> Markup:
    """Return an element; in attributes' names ``class_`` means class, ``data_x`` means data-x."""
    words = "".join(
        f' {k.rstrip("_").replace("_", "-")}="{html(v)}"'
        for k, v in attributes.items()
        if v not in (None, "")
    )
    return Markup(f"<{name}{words}>{join(content)}</{name}>")


def join(parts: Iterable[object]) -> Markup:
    """Return parts one after the other."""
    return Markup("".join(map(html, parts)))


@html.register
def _(part: Markup) -> Markup:
    return part


@html.register
def _(_part: None) -> Markup:
    return Markup()


@html.register
def _(parts: tuple) -> Markup:
    return join(parts)


@html.register
def _(mark: ReportMark) -> Markup:
    return tag("code", mark.text) if mark.style == "code" else tag("span", mark.text, class_=mark.style)


@html.register
def _(pick: Pick) -> Markup:
    label = f"Show the FRF {pick.output} / {pick.input}"
    known = {"data_output": pick.output, "data_input": pick.input, "aria_label": label}
    return tag("button", "show", type="button", class_="pick", **known)


@html.register
def _(block: Heading) -> Markup:
    return tag("h3", block.text)


@html.register
def _(block: Text) -> Markup:
    if block.style == "pre":
        return tag("pre", block.text)
    return tag("p", block.text, class_=block.style) + Markup("\n") if block else Markup()


@html.register
def _(block: Items) -> Markup:
    return tag("ul", *(tag("li", item) for item in block.items)) if block else Markup()


@html.register
def _(block: Facts) -> Markup:
    return tag("dl", *(tag("dt", name) + tag("dd", value) for name, value in block.pairs))


@html.register
def _(block: TableBlock) -> Markup:
    few, numbers, marked = block.n_shown, set(block.numbers), set(block.marked)
    shown = _rows(block, 0, few, numbers, marked)
    if few == len(block.rows):
        return shown
    rest = _rows(replace(block, caption=""), few, len(block.rows), numbers, marked)
    return shown + tag("details", tag("summary", f"{len(block.rows) - few} more"), rest)


def _rows(block: TableBlock, first: int, end: int, numbers: set[int], marked: set[int]) -> Markup:
    """Return some rows of a table below its headings."""
    kind = {k: "n" for k in numbers}
    top = tag("tr", *(tag("th", h, scope="col", class_=kind.get(k)) for k, h in enumerate(block.head)))
    body = []
    for r, row in enumerate(block.rows[first:end], first):
        cells = [
            tag("th", c, scope="row") if k == 0 and k not in kind else tag("td", c, class_=kind.get(k))
            for k, c in enumerate(row)
        ]
        body.append(tag("tr", *cells, class_="mark" if r in marked else None))
    caption = tag("caption", block.caption) if block.caption else ""
    table = tag("table", caption, tag("thead", top), tag("tbody", *body))
    return tag("div", table, class_="wide") + Markup("\n")


@html.register
def _(block: Picture) -> Markup:
    return figure(picture(block.file, block.alt), caption=block.caption, class_=block.style)


@html.register
def _(block: Plot) -> Markup:
    if not block.packed:
        return join(block.stills)
    label = f"{block.alt} {block.hint}".strip()
    return figure(
        tag("div", Markup(block.tools), class_="tools") if block.tools else "",
        tag("div", class_="plot", role="group", tabindex="0", aria_label=label),
        *(replace(still, style="still") for still in block.stills),
        tag("p", block.hint, class_="hint") if block.hint else "",
        script(block.packed, type="text/plain", id=f"figure-{block.name}"),
        script(block.data, type="text/plain", id=f"data-{block.name}") if block.data else "",
        tag("figcaption", block.caption, class_="live"),
        data_figure=block.name,
        class_="" if block.stills else "bare",
    )


@html.register
def _(block: Group) -> Markup:
    return tag("div", *block.blocks, class_=block.title) if block else Markup()


@html.register
def _(block: ReportSection) -> Markup:
    return section(block.title, *block.blocks) if block else Markup()


@html.register
def _(block: Details) -> Markup:
    return tag("details", tag("summary", block.title), *block.blocks) + Markup("\n") if block else Markup()


def figure(*content: object, caption: str = "", **attributes: object) -> Markup:
    """Return a figure with a caption."""
    return tag("figure", *content, tag("figcaption", caption) if caption else "", **attributes) + Markup("\n")


def picture(file: Path, alt: str) -> Markup:
    """Return an image with its content in the page, and the name of its file for other programs."""
    kind, content = _embedded(file)
    width, height = _size(file.read_bytes())
    data = base64.b64encode(content).decode("ascii")
    return Markup(
        f'<img src="data:{kind};base64,{data}" alt="{html(alt)}" width="{width}" height="{height}" '
        f'data-file="{html(file.name)}">'
    )


def _embedded(file: Path) -> tuple[str, bytes]:
    """Return the kind and the bytes of an image in a page: WebP where that is smaller."""
    content = file.read_bytes()
    if file.suffix == ".png" and features.check("webp"):
        with Image.open(file) as drawn:
            buffer = BytesIO()
            # of pictures in the page; the files beside it are whole
            drawn.convert("RGB").save(buffer, "webp", quality=82, method=2)
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
    """Return a complete page."""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n<title>{html(title)}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<link rel="icon" href="data:,">\n<style>{CSS}</style>\n</head>\n'
        f"<body>\n{join(content)}</body>\n</html>\n"
    )


def report_page(report: Report, *scripts: Markup) -> str:
    """Return a report as a page, with its story for other programs."""
    parts = {each.title: html(each) for each in report.sections if each}
    links = (tag("li", tag("a", title, href=f"#{slug(title)}")) for title in parts)
    return page(
        f"{report.name}: {report.verdict}",
        tag("a", "Skip to the figures and tables", class_="skip", href="#body"),
        tag("header", tag("h1", report.name), *report.first),
        tag("nav", tag("ul", *links), class_="contents", aria_label="Contents") + Markup("\n"),
        tag("main", *parts.values(), id="body"),
        tag("template", packed_outline(report), id=ID),
        *scripts,
    )
