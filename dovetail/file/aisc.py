"""Read the shapes database of AISC, saved as a text file (CSV), as a table of sections.

The columns in inches are read, which come first; the same headings follow in metric units. x and y of the
database are y and z here. Its constants go before those of the shape, which gives outline, shear coefficients
and shear centre. Angles have principal axes of their own, so that only A and J are taken from the database.
"""

from collections.abc import Sequence

NAME = "AISC_Manual_Label"
"""Heading by which the database is known."""

_CONSTANTS = {"A [in2]": "A", "Iy [in4]": "Ix", "Iz [in4]": "Iy", "J [in4]": "J"}
_FLANGED = {"b [in]": "bf", "h [in]": "d", "tf [in]": "tf", "tw [in]": "tw"}
_SHAPES: dict[str, tuple[str, dict[str, str]]] = {
    **dict.fromkeys(("W", "M", "S", "HP"), ("i_section", _FLANGED | _CONSTANTS)),
    **dict.fromkeys(("C", "MC"), ("channel", _FLANGED | _CONSTANTS)),
    **dict.fromkeys(("WT", "MT", "ST"), ("t_section", _FLANGED | _CONSTANTS)),
    "L": ("angle_section", {"b [in]": "d", "h [in]": "b", "t [in]": "t", "A [in2]": "A", "J [in4]": "J"}),
    "HSS": ("hollow_rectangle", {"b [in]": "B", "h [in]": "Ht", "t [in]": "tdes"} | _CONSTANTS),
    "PIPE": ("tube", {"d [in]": "OD", "t [in]": "tdes"} | _CONSTANTS),
}
"""Shape of each type, and the database's headings of our columns."""

_HEAD = ("name", "shape", *dict.fromkeys(key for _, keys in _SHAPES.values() for key in keys))

Row = tuple[int, list[str]]


def is_database(head: Sequence[str]) -> bool:
    """Whether a table has the headings of the database."""
    return {NAME, "Type", "Ix", "Iy"} <= set(head)


def sections_of(head: Sequence[str], rows: Sequence[Row]) -> tuple[list[str], list[Row]]:
    """Return the database's single shapes as heading and rows of a table of sections.

    Double angles are left out, as built-up sections whose gap is not stated by columns.
    """
    at = {title: k for k, title in reversed(list(enumerate(head)))}  # of the first of each name
    out: list[Row] = []
    for number, cells in rows:
        kind = cells[at["Type"]]
        round_tube = kind == "HSS" and not _is_number(cells[at["Ht"]])
        shape, columns = _SHAPES.get("PIPE" if round_tube else kind, ("", {}))
        if shape:
            values = {ours: cells[at[theirs]] for ours, theirs in columns.items() if theirs in at}
            values |= {"name": cells[at[NAME]], "shape": shape}
            out.append((number, [values.get(title, "") for title in _HEAD]))
    return list(_HEAD), out


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
