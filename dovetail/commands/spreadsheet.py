"""Tables of commands as Excel files."""

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dovetail.commands.common import Options
from dovetail.disk.output import Output, OutputError
from dovetail.report.office import office
from fem.io.atomic import replacing

Sheet = tuple[Sequence[str], Sequence[Sequence[Any]]]
"""Headings and rows."""
WIDTH = 14
"""Of a column [characters]."""


def add_xlsx(p: argparse.ArgumentParser) -> None:
    """Add the option of the Excel file."""
    p.add_argument("--xlsx", type=Path, metavar="FILE", help="also write the tables for Excel: .xlsx")


def check_xlsx(options: Options) -> Output:
    """Return the Excel file as an output; refuse another suffix, and a library that is not installed."""
    if options.xlsx is not None:
        if options.xlsx.suffix.lower() != ".xlsx":
            msg = f"--xlsx {options.xlsx} is written as .xlsx, not '{options.xlsx.suffix}'"
            raise OutputError(msg)
        office("openpyxl")
    return Output("--xlsx", options.xlsx)


def write_xlsx(path: Path | None, sheets: Mapping[str, Sheet]) -> None:
    """Write sheets by their names; numbers that there are not become empty cells.

    Raises
    ------
    OfficeError
        If openpyxl is not installed.
    """
    if path is None:
        return
    book = office("openpyxl").Workbook()
    book.remove(book.active)
    bold = office("openpyxl.styles").Font(bold=True)
    letter = office("openpyxl.utils").get_column_letter
    for name, (head, rows) in sheets.items():
        sheet = book.create_sheet(name)
        sheet.freeze_panes = "A2"
        for row in (head, *rows):
            sheet.append([None if isinstance(x, float) and not math.isfinite(x) else x for x in row])
        for k, cell in enumerate(sheet[1], 1):
            cell.font = bold
            sheet.column_dimensions[letter(k)].width = max(WIDTH, len(head[k - 1]) + 2)
    with replacing(path) as scratch:
        book.save(scratch)
