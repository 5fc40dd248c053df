"""A report as PowerPoint slides."""

from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from dovetail.report.blocks import plain
from dovetail.report.office import BLUE, office
from dovetail.report.outline import Items, Outline, OutlinePicture, ReportPart, TableBlock, Text
from fem.io.atomic import replacing

WIDTH, HEIGHT = 13.333, 7.5
"""Size of a slide [inch]."""
MARGIN, TOP = 0.6, 1.25
"""Room beside everything, and above it for the title [inch]."""
MOST_ROWS, MOST_ITEMS = 12, 6
"""Rows of a table and items of a list on one slide."""
LONG = 100
"""Verdicts of more characters are set in smaller type."""
LEFT_OUT = ("Assumptions and thresholds", "About this run", "Notes")
"""Sections for readers of the page rather than for an audience."""


def write_pptx(outline: Outline, path: Path) -> None:
    """Write the story of a report as slides atomically.

    Raises
    ------
    OfficeError
        If python-pptx is not installed.
    """
    show = office("pptx").Presentation()
    inches = office("pptx.util").Inches
    show.slide_width, show.slide_height = inches(WIDTH), inches(HEIGHT)
    show.core_properties.title = outline.name
    _verdict(show, outline)
    for picture in (b for b in outline.first if isinstance(b, OutlinePicture)):
        _picture(show, outline.name, picture)
    section = ""
    for part in outline.parts:
        section = part.heading if part.level == 1 else section
        if section not in LEFT_OUT:
            _part(show, part, section)
    with replacing(path) as scratch:
        show.save(str(scratch))


def _slide(show: Any, title: str) -> Any:
    """Return a new slide with a title."""
    slide = show.slides.add_slide(show.slide_layouts[5])
    heading, util = slide.shapes.title, office("pptx.util")
    heading.left, heading.top = util.Inches(MARGIN), util.Inches(0.3)
    heading.width, heading.height = util.Inches(WIDTH - 2 * MARGIN), util.Inches(0.85)
    heading.text_frame.text = title
    heading.text_frame.word_wrap = True
    paragraph = heading.text_frame.paragraphs[0]
    paragraph.alignment = office("pptx.enum.text").PP_ALIGN.LEFT
    paragraph.font.size, paragraph.font.bold = util.Pt(28), True
    return slide


def _texts(slide: Any, lines: list[tuple[str, float, bool]], top: float, height: float) -> None:
    """Add paragraphs, each with its size [pt] and whether it is bold."""
    util = office("pptx.util")
    box = slide.shapes.add_textbox(
        util.Inches(MARGIN), util.Inches(top), util.Inches(WIDTH - 2 * MARGIN), util.Inches(height)
    )
    frame = box.text_frame
    frame.word_wrap = True
    for k, (text, size, bold) in enumerate(lines):
        paragraph = frame.paragraphs[0] if k == 0 else frame.add_paragraph()
        paragraph.text = text
        paragraph.font.size, paragraph.font.bold = util.Pt(size), bold
        paragraph.space_after = util.Pt(8)


def _verdict(show: Any, outline: Outline) -> None:
    slide = _slide(show, outline.name)
    lines = [(text, 18.0, True) for text in outline.texts("kind")]
    lines += [(text, 34.0 if len(text) < LONG else 24.0, True) for text in outline.texts("sentence")]
    lines += [(text, 22.0, False) for text in outline.texts("value")]
    lines += [(text, 18.0, False) for text in outline.texts("why")]
    _texts(slide, lines, 2.0, 4.5)
    frame = slide.shapes[-1].text_frame
    frame.paragraphs[0].font.color.rgb = office("pptx.dml.color").RGBColor.from_string(BLUE)


def _part(show: Any, part: ReportPart, section: str) -> None:
    title = part.heading if part.level == 1 else f"{section}: {part.heading}" if section else part.heading
    listed = [b for b in part.blocks if isinstance(b, Items)]
    if listed or all(isinstance(b, Text) for b in part.blocks):
        lines = [(plain(b.text), 18.0, False) for b in part.blocks[:MOST_ITEMS] if isinstance(b, Text)]
        lines += [(f"•  {plain(item)}", 18.0, False) for b in listed for item in b.items[:MOST_ITEMS]]
        if lines:
            _texts(_slide(show, title), lines, TOP, HEIGHT - TOP - MARGIN)
    for block in part.blocks:
        if isinstance(block, OutlinePicture):
            _picture(show, title, block)
        elif isinstance(block, TableBlock):
            _table(show, title, block)


def _picture(show: Any, title: str, block: OutlinePicture) -> None:
    slide, util = _slide(show, title), office("pptx.util")
    with Image.open(BytesIO(block.content)) as drawn:
        proportion = drawn.width / drawn.height
    height = HEIGHT - TOP - MARGIN - (0.7 if block.caption else 0.0)
    width = min(WIDTH - 2 * MARGIN, height * proportion)
    shape = slide.shapes.add_picture(
        BytesIO(block.content), util.Inches((WIDTH - width) / 2), util.Inches(TOP), util.Inches(width)
    )
    shape._element._nvXxPr.cNvPr.set("descr", block.alt)
    if block.caption:
        _texts(slide, [(block.caption, 14.0, False)], HEIGHT - MARGIN - 0.75, 0.7)


def _table(show: Any, title: str, block: TableBlock) -> None:
    util, right = office("pptx.util"), office("pptx.enum.text").PP_ALIGN.RIGHT
    headed = any(block.head)
    rows = ([block.head] if headed else []) + list(block.rows[:MOST_ROWS])
    columns = max(map(len, rows))
    slide = _slide(show, title)
    frame = slide.shapes.add_table(
        len(rows),
        columns,
        util.Inches(MARGIN),
        util.Inches(TOP),
        util.Inches(WIDTH - 2 * MARGIN),
        util.Inches(0.36 * len(rows)),
    )
    frame.table.first_row = headed
    for r, row in enumerate(rows):
        for k, text in enumerate(row):
            paragraph = frame.table.cell(r, k).text_frame.paragraphs[0]
            paragraph.text = text
            paragraph.font.size = util.Pt(12 if columns > 4 else 14)
            if k in block.numbers:
                paragraph.alignment = right
    hidden = len(block.rows) - MOST_ROWS
    if hidden > 0:
        _texts(slide, [(f"{hidden} more rows are in the report", 12.0, False)], HEIGHT - MARGIN - 0.3, 0.4)
