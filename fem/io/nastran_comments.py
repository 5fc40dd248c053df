"""Names that the comments of a Nastran deck give to properties, materials and bars.

Pre-processors write names in comments: HyperMesh, Femap, Patran, ANSA and Simcenter in forms of their own. Of
other comments, the last line directly above a card is a name if it looks like one: at most four words and a
letter, no comma, colon, semicolon or equals sign, no full stop at its end, neither a card nor a heading such
as "elements".
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from fem.io.deck import words
from fem.io.nastran_names import HARMLESS, LINES, NAMED, READ
from fem.mesh import free_name

PROPERTIES: Final = words("PBAR PBARL PBEAM PBEAML PROD PTUBE")
BARS: Final = words("CBAR CBEAM CROD CTUBE CONROD")

LONGEST = 60
"""Characters of a name."""

_BY_NUMBER: Final = (
    re.compile(r"\$HMNAME\s+(?P<kind>PROP|MAT)\w*\s+(?P<number>\d+)\s*\"(?P<name>[^\"]+)\"", re.IGNORECASE),
    re.compile(
        r"\$HMNAME\s+(?P<kind>COMP)\w*\s+(?P<component>\d+)\s*\"(?P<name>[^\"]+)\"(?:\s*(?P<number>\d+))?",
        re.IGNORECASE,
    ),
    re.compile(
        r"\$\s*FEMAP\b.*?\b(?P<kind>PROP|MAT)(?:ERTY|ERIAL)\s+(?P<number>\d+)\s*:(?P<name>.+)", re.IGNORECASE
    ),
    re.compile(r"\$ANSA_NAME_COMMENT;(?P<number>\d+);(?P<kind>P|MAT)\w+;(?P<name>[^;]+)", re.IGNORECASE),
)
"""Comments that name a property or a material by its number."""

_ABOVE: Final = (
    re.compile(r"\$\s*Elements and Element Prop\w* for region\s*:(?P<name>.+)", re.IGNORECASE),
    re.compile(r"\$\s*Material Record\s*:(?P<name>.+)", re.IGNORECASE),
    re.compile(r"\$\*\s*(?:Property|Material)\s*:(?P<name>.+)", re.IGNORECASE),
)
"""Comments that name the next property or material."""

_HEADINGS: Final = words(
    "BARS BEAMS RODS ELEMENTS NODES GRID GRIDS POINTS COORDINATES PROPERTIES PROPERTY MATERIALS MATERIAL "
    "SECTIONS SECTION MESH MODEL GEOMETRY CONNECTIVITY CARDS DATA UNTITLED"
)
_QUALIFIERS: Final = words("BAR BEAM ROD LINE ELEMENT NODE NODAL BULK WITH AND UNASSOCIATED")
"""Words of headings such as ``beam elements``, which are no names, and those that go with them."""

_RULER = re.compile(r"[\W\d_]*")
_HYPERMESH = re.compile(r"H[MW][A-Z]+\s")
"""Comments of HyperMesh: names, which are read by number, and colours."""


@dataclass(slots=True)
class Comments:
    """Comments of the bulk data.

    Attributes
    ----------
    above : the comments between a row of the bulk data and the one before it; empty texts are blank lines
    elsewhere : those that no row of the bulk data follows
    """

    above: dict[int, list[str]] = field(default_factory=dict)
    elsewhere: list[str] = field(default_factory=list)

    def add(self, texts: Sequence[str], numbers: Sequence[int], first: int, row: int) -> None:
        """Keep the comments of lines from ``first`` on, of which ``numbers`` are rows of the bulk data."""
        data = set(numbers)
        for number, text in enumerate(texts, start=first):
            if number in data:
                row += 1
            elif (comment := text.strip()) or row in self.above:
                self.above.setdefault(row, []).append(comment)

    def end(self) -> None:
        """Let no row follow the comments so far."""
        self.elsewhere += [text for lines in self.above.values() for text in lines]
        self.above.clear()


@dataclass(slots=True)
class Names:
    """Names by number, and of each bar the comment that heads its block of cards."""

    properties: dict[int, str] = field(default_factory=dict)
    materials: dict[int, str] = field(default_factory=dict)
    blocks: dict[int, str] = field(default_factory=dict)


def names_of(comments: Comments, cards: Sequence[tuple[int, str, str]]) -> Names:
    """Return the names that comments give.

    Parameters
    ----------
    comments : Comments
    cards : sequence of (int, str, str)
        Row, name and first field of each card, in the order of the file.
    """
    found, plain = Names(), Names()
    components: dict[int, list[str]] = {}
    texts = [*comments.elsewhere, *(text for lines in comments.above.values() for text in lines)]
    for match in filter(None, (form.match(text) for text in texts for form in _BY_NUMBER)):
        name, kind = _tidy(match["name"]), match["kind"].upper()
        digits = match["number"] or match["component"]
        number = int(digits) if len(digits) < 10 else 0
        if kind == "COMP":
            components.setdefault(number, []).append(name)
        elif name and not _is_heading(name):
            (found.materials if kind == "MAT" else found.properties)[number] = name
    region, block = "", ""
    for k, (row, card, first) in enumerate(cards):
        lines = comments.above.get(row, [])
        given = [_tidy(m["name"]) for text in lines for form in _ABOVE if (m := form.match(text))]
        region = given[-1] if given else region
        if lines:
            block = _plain_name(lines) if card == "GRID" or card in BARS else ""
        number = int(first) if first.isascii() and first.isdigit() and len(first) < 10 else 0
        if card in BARS and block:
            found.blocks[number] = block
        elif card in PROPERTIES or card == "MAT1":
            of_kind, alone = (plain.materials, {"MAT1"}) if card == "MAT1" else (plain.properties, PROPERTIES)
            after = cards[k + 1][:2] if k + 1 < len(cards) else (-1, "")
            name = region or (
                "" if after[1] in alone and after[0] not in comments.above else _plain_name(lines)
            )
            region = ""
            if name:
                of_kind[number] = name
    for number, given in components.items():
        if len(given) == 1 and given[0]:
            plain.properties[number] = given[0]
    found.properties = plain.properties | found.properties
    materials, found.materials = plain.materials | found.materials, {}
    for number, name in materials.items():
        # a study has its materials by name
        found.materials[number] = free_name(name, name, {*found.materials.values()})
    return found


def _plain_name(lines: Sequence[str]) -> str:
    """Return the comment above a card if it is a name, else an empty text."""
    blank = max((k for k, line in enumerate(lines) if not line), default=-1)
    texts = [text for line in lines[blank + 1 :] if not _RULER.fullmatch(text := line.lstrip("$ "))]
    if not texts or _HYPERMESH.match(texts[-1]):
        return ""
    name = _tidy(texts[-1])
    parts = name.split()
    no_name = len(parts) > 4 or name.endswith(".") or set(name) & set(":;=?!*") or len(name) > LONGEST
    if no_name or "," in texts[-1] or _is_heading(name):
        return ""
    is_card = parts[0] == parts[0].upper() and parts[0].rstrip("*") in {*HARMLESS, *READ, *LINES, *NAMED}
    return "" if is_card else name


def _is_heading(name: str) -> bool:
    parts = set(re.split(r"[\W_]+", name.upper()))
    return parts <= _HEADINGS | _QUALIFIERS and bool(parts & _HEADINGS)


def _tidy(text: str) -> str:
    """Return a name without the characters that a mesh file cannot have."""
    return " ".join("".join(c if c.isprintable() and c not in '",' else " " for c in text).split())
