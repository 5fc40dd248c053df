"""Draw which rooms of the packages import which: python -m docs.make.imports writes docs/images/imports.svg.

The imports are those that the contracts in pyproject.toml are checked against (`grimp`). A room is a
sub-package, or a module directly in a package. Each is drawn above the rooms that it imports.
"""

from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
PACKAGES = ("dovetail", "viz", "joint", "updating", "fem")
COLOURS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677")
"""One of each package (P. Tol's bright scheme)."""

Imports = dict[str, set[str]]

_WIDTH, _ROW, _BOX, _GAP, _LEFT = 1200, 50, 24, 14, 240


def room_of(module: str) -> str:
    """Return the room of a module: ``package.room``."""
    return ".".join(module.split(".")[:2])


def room_imports() -> tuple[Imports, dict[tuple[str, str], int]]:
    """Return the rooms that each room imports, and the number of imports from package to package."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    rooms: Imports = {room_of(m): set() for m in sorted(graph.modules) if m not in PACKAGES}
    between: dict[tuple[str, str], int] = {}
    for module in sorted(set(graph.modules) - set(PACKAGES)):
        for imported in graph.find_modules_directly_imported_by(module):
            one, other = module.split(".")[0], imported.split(".")[0]
            if one != other:
                between[one, other] = between.get((one, other), 0) + 1
            elif imported not in PACKAGES and room_of(module) != room_of(imported):
                rooms[room_of(module)].add(room_of(imported))
    return rooms, between


def levels(rooms: Mapping[str, set[str]]) -> list[list[str]]:
    """Return rooms in levels, the first imports no other; each room is above all that it imports."""
    left, out = dict(rooms), []
    while left:
        level = [room for room, imported in left.items() if not imported & left.keys()]
        if not level:
            msg = f"rooms import each other in a circle: {', '.join(left)}"
            raise ValueError(msg)
        out.append(level)
        left = {room: imported for room, imported in left.items() if room not in level}
    return out


def direct(rooms: Mapping[str, set[str]]) -> Iterable[tuple[str, str]]:
    """Yield the imports that do not follow from others: a → c is left out where a → b and b → c."""
    reached: dict[str, set[str]] = {}
    for level in levels(rooms):
        for room in level:
            reached[room] = rooms[room].union(*(reached[r] for r in rooms[room]))
    for room, imported in rooms.items():
        yield from ((room, r) for r in sorted(imported) if not any(r in reached[other] for other in imported))


def draw(rooms: Imports, between: Mapping[tuple[str, str], int]) -> str:
    """Return the picture: a band for each package, and in it its rooms in levels."""
    shapes, top = [], 10.0
    for package, colour in zip(PACKAGES, COLOURS, strict=True):
        own = {room: r for room, r in rooms.items() if room.startswith(f"{package}.")}
        rows = levels(own)[::-1]
        height = _ROW * len(rows) + 16
        shapes.append(
            f'<rect x="4" y="{top:.0f}" width="{_WIDTH - 8}" height="{height}" rx="8" fill="{colour}" '
            f'fill-opacity="0.12"/><text x="18" y="{top + 30:.0f}" font-size="18">{package}</text>'
        )
        targets = [(other, between[package, other]) for other in PACKAGES if (package, other) in between]
        for k, (other, count) in enumerate(targets):
            words = f"→ {other}: {count} imports"
            shapes.append(f'<text x="18" y="{top + 52 + 17 * k:.0f}" font-size="12">{words}</text>')
        places = _places(rows, top + 12)
        for room, imported in direct(own):
            (x, y, _), (u, v, _) = places[room], places[imported]
            shapes.append(
                f'<path d="M{x:.0f} {y + _BOX:.0f}C{x:.0f} {y + _BOX + 16:.0f} {u:.0f} {v - 16:.0f} '
                f'{u:.0f} {v:.0f}" fill="none" stroke="{colour}"/>'
            )
        for room, (x, y, width) in places.items():
            name = escape(room.split(".")[1])
            shapes.append(
                f'<rect x="{x - width / 2:.0f}" y="{y:.0f}" width="{width:.0f}" height="{_BOX}" rx="5" '
                f'fill="white" stroke="{colour}"/><text x="{x:.0f}" y="{y + 16:.0f}" font-size="12" '
                f'text-anchor="middle">{name}</text>'
            )
        top += height + 10
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {top:.0f}" font-family="sans-serif">'
    )
    back = f'<rect width="{_WIDTH}" height="{top:.0f}" fill="white"/>'
    return "\n".join([head, back, *shapes, "</svg>"]) + "\n"


def _places(rows: list[list[str]], top: float) -> dict[str, tuple[float, float, float]]:
    """Return the middle, the upper edge and the width of each room's box."""
    places = {}
    for k, row in enumerate(rows):
        widths = [7.2 * len(room.split(".")[1]) + 14 for room in row]
        x = _LEFT + (_WIDTH - 20 - _LEFT - sum(widths) - _GAP * (len(row) - 1)) / 2
        for room, width in zip(row, widths, strict=True):
            places[room] = (x + width / 2, top + _ROW * k, width)
            x += width + _GAP
    return places


if __name__ == "__main__":
    (ROOT / "docs" / "images" / "imports.svg").write_text(draw(*room_imports()), encoding="utf-8")
