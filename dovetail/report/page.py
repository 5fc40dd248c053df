"""Small pieces of HTML: escaped text, tables, embedded images; a page of them loads nothing else."""

import base64
import html
from collections.abc import Iterable, Sequence
from pathlib import Path

MIME = {".png": "image/png", ".gif": "image/gif"}

CSS = """
:root { color: #1f2328; background: #fff;
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 62rem; padding: 1.5rem 1.25rem 4rem; }
h1 { font-size: 1.15rem; font-weight: 600; color: #57606a; margin: 0 0 1rem; }
h2 { font-size: 1.35rem; margin: 2.8rem 0 .8rem; padding-top: .8rem; border-top: 1px solid #d0d7de; }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .5rem; }
p { margin: .5rem 0; max-width: 48rem; }
ul { margin: .5rem 0; padding-left: 1.3rem; max-width: 48rem; }
li { margin: .25rem 0; }
.verdict { border-left: .45rem solid #6e7781; background: #f6f8fa; padding: 1rem 1.25rem 1.1rem; }
.verdict p { max-width: none; }
.verdict .kind { text-transform: uppercase; letter-spacing: .06em; font-size: .8rem;
  font-weight: 600; color: #57606a; margin: 0; }
.verdict .sentence { font-size: 1.6rem; line-height: 1.25; font-weight: 600; margin: .2rem 0 .4rem;
  text-wrap: balance; }
.verdict .value { font-size: 1.15rem; margin: .25rem 0; }
.verdict.effect { border-color: #D55E00; }
.verdict.nothing { border-color: #009E73; }
.verdict.fault { border-color: #0072B2; }
.verdict.unexplained { border-color: #E69F00; }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .92rem; }
caption { text-align: left; color: #57606a; padding-bottom: .3rem; }
th, td { padding: .28rem .8rem .28rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid #eaeef2; }
thead th { border-bottom: 1.5px solid #6e7781; font-weight: 600; vertical-align: bottom; }
tbody th { font-weight: 400; min-width: 8rem; }
.verdict .why { color: #57606a; margin: .5rem 0 0; font-size: .95rem; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.mark th, tr.mark td { font-weight: 600; }
tr.mark { background: #fdf1e8; }
.tag { display: inline-block; font-size: .8rem; font-weight: 600; padding: 0 .45em; border-radius: .3em;
  background: #fbe3d2; color: #8a3c00; white-space: nowrap; }
tr:not(.mark) .tag { background: #eaeef2; color: #57606a; }
.tag.bound { background: #fbe3d2 !important; color: #8a3c00 !important; }
figure { margin: 1rem 0; }
figure.small { max-width: 34rem; }
figure img { display: block; max-width: 100%; height: auto; }
figcaption { color: #57606a; font-size: .9rem; margin-top: .3rem; max-width: 48rem; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 0 1.2rem;
  align-items: start; }
details { margin: .6rem 0; }
summary { cursor: pointer; color: #0b5394; }
code { font: .9em ui-monospace, "SF Mono", Menlo, Consolas, monospace; overflow-wrap: anywhere; }
pre { overflow-x: auto; background: #f6f8fa; padding: .8rem; font-size: .82rem; line-height: 1.4; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: .6rem 0; }
dt { color: #57606a; } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 40rem) {
  th.n { white-space: normal; } tbody th { min-width: 6rem; }
  body { padding: 1rem .9rem 3rem; } .verdict .sentence { font-size: 1.3rem; }
  dl { grid-template-columns: 1fr; } dd { margin-bottom: .4rem; }
}
@media print {
  :root { font-size: 11px; } body { max-width: none; padding: 0; }
  figure, tr, .verdict { break-inside: avoid; } h2, h3 { break-after: avoid; }
  details::details-content { content-visibility: visible; block-size: auto; } .wide { overflow: visible; }
}
"""


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()

    def __add__(self, other: str) -> "Markup":
        return Markup(str(self) + esc(other))


def esc(text: object) -> Markup:
    """Return text as HTML; what is HTML already stays."""
    return text if isinstance(text, Markup) else Markup(html.escape(str(text)))


def tag(name: str, *content: object, **attributes: object) -> Markup:
    """Return an element; a trailing underscore in an attribute's name is dropped (``class_``)."""
    words = "".join(f' {k.rstrip("_")}="{esc(v)}"' for k, v in attributes.items() if v not in (None, ""))
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
    content = file.read_bytes()
    width, height = _size(content)
    data = base64.b64encode(content).decode("ascii")
    source = Markup(f"data:{MIME[file.suffix]};base64,{data}")
    img = Markup(f'<img src="{source}" alt="{esc(alt)}" width="{width}" height="{height}">')
    return tag("figure", img, tag("figcaption", caption) if caption else "", class_=class_) + Markup("\n")


def _size(content: bytes) -> tuple[int, int]:
    """Return width and height of a PNG or a GIF, so that the page does not jump while it is laid out."""
    if content.startswith(b"\x89PNG"):
        return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")
    return int.from_bytes(content[6:8], "little"), int.from_bytes(content[8:10], "little")


def section(title: str, *content: object) -> Markup:
    """Return a section with its heading."""
    return tag("section", tag("h2", title), "\n", *content) + Markup("\n")


def folded(summary: str, *content: object) -> Markup:
    """Return content that is shown on demand."""
    return tag("details", tag("summary", summary), *content) + Markup("\n")


def facts(pairs: Iterable[tuple[str, object]]) -> Markup:
    """Return a list of names and values."""
    return tag("dl", *(join([tag("dt", k), tag("dd", v)]) for k, v in pairs))


def page(title: str, *content: object) -> str:
    """Return a whole page."""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{esc(title)}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="icon" href="data:,">\n<style>{CSS}</style>\n</head>\n'
        f"<body>\n{join(content)}</body>\n</html>\n"
    )
