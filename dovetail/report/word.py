"""A report as a Word document."""

from io import BytesIO
from pathlib import Path
from typing import Any

from dovetail.report.office import BLUE, office
from dovetail.report.outline import Block, Items, Outline, OutlinePicture, TableBlock, Text
from fem.io.atomic import replacing

WIDTH = 6.3
"""Width of the text on the page [inch]."""


def write_docx(outline: Outline, path: Path) -> None:
    """Write the story of a report as a Word document atomically.

    Raises
    ------
    OfficeError
        If python-docx is not installed.
    """
    document = office("docx").Document()
    shared = office("docx.shared")
    for section in document.sections:
        section.left_margin = section.right_margin = shared.Inches((8.27 - WIDTH) / 2)
        section.page_width, section.page_height = shared.Inches(8.27), shared.Inches(11.69)
    document.styles["Normal"].font.name = "Calibri"
    document.styles["Normal"].font.size = shared.Pt(10.5)
    document.core_properties.title = outline.name
    document.core_properties.author = "Dovetail"
    document.add_heading(outline.name, 0)
    for block in outline.first:
        _add(document, block)
    for part in outline.parts:
        document.add_heading(part.heading, part.level)
        for block in part.blocks:
            _add(document, block)
    with replacing(path) as scratch:
        document.save(str(scratch))


def _add(document: Any, block: Block) -> None:
    if isinstance(block, Text):
        _add_text(document, block)
    elif isinstance(block, Items):
        for item in block.items:
            document.add_paragraph(item, style="List Bullet")
    elif isinstance(block, TableBlock):
        _add_table(document, block)
    else:
        _add_picture(document, block)


def _add_text(document: Any, block: Text) -> None:
    shared = office("docx.shared")
    paragraph = document.add_paragraph()
    run = paragraph.add_run(block.text)
    if block.style == "sentence":
        run.bold, run.font.size = True, shared.Pt(16)
    elif block.style == "kind":
        run.bold, run.font.color.rgb = True, shared.RGBColor.from_string(BLUE)
    elif block.style == "value":
        run.font.size = shared.Pt(12)


def _add_picture(document: Any, block: OutlinePicture) -> None:
    shape = document.add_picture(BytesIO(block.content), width=office("docx.shared").Inches(WIDTH))
    shape._inline.docPr.set("descr", block.alt)
    document.paragraphs[-1].paragraph_format.keep_with_next = bool(block.caption)
    if block.caption:
        document.add_paragraph(block.caption, style="Caption")


def _add_table(document: Any, block: TableBlock) -> None:
    shared, right = office("docx.shared"), office("docx.enum.text").WD_ALIGN_PARAGRAPH.RIGHT
    if block.caption:
        document.add_paragraph(block.caption, style="Caption")
    headed = any(block.head)
    rows = ([block.head] if headed else []) + list(block.rows)
    table = document.add_table(rows=len(rows), cols=max(map(len, rows)))
    table.style = "Light List Accent 1" if headed else "Normal Table"
    # Tables of more columns are set in smaller type
    size = shared.Pt(8 if len(block.head) > 5 else 9.5)
    for row, cells in zip(rows, table.rows, strict=True):
        for k, (text, cell) in enumerate(zip(row, cells.cells, strict=False)):
            paragraph = cell.paragraphs[0]
            paragraph.add_run(text).font.size = size
            if k in block.numbers:
                paragraph.alignment = right
    document.add_paragraph()
