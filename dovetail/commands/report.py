"""``dovetail report``: the report of a run as a Word document or as slides."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options
from dovetail.disk.output import Output, OutputError, Progress, check_outputs
from dovetail.file.paths import InputFile

EXAMPLE = "dovetail report out/report --docx report.docx"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("folder", type=Path, metavar="DIR", help="folder of a run or an update")
    p.add_argument("--docx", type=Path, metavar="FILE", help="Word document to write")
    p.add_argument("--pptx", type=Path, metavar="FILE", help="PowerPoint file to write")


def run(options: Options, progress: Progress) -> Answer:
    """Read the report of a run and write it for other programs."""
    from dovetail.report.outline import OutlinePicture, read_outline
    from dovetail.report.slides import write_pptx
    from dovetail.report.word import write_docx
    from dovetail.result import REPORT
    from fem.summary import counted

    wanted = (
        ("--docx", options.docx, write_docx, "Word document"),
        ("--pptx", options.pptx, write_pptx, "PowerPoint slides"),
    )
    if not any(path for _, path, *_ in wanted):
        msg = "nothing to write; give --docx FILE, --pptx FILE or both"
        raise OutputError(msg)
    page = InputFile(options.folder / REPORT, "the report")
    check_outputs((page,), *(Output(option, path) for option, path, *_ in wanted))
    outline = read_outline(options.folder)
    files = [(path, write, what) for _, path, write, what in wanted if path]
    for path, write, _ in files:
        progress(f"writing {path.name}")
        write(outline, path)
    pictures = sum(isinstance(block, OutlinePicture) for block in outline.blocks())
    content = f"{counted(len(outline.parts), 'section')}, {counted(pictures, 'picture')}"
    return Answer(None, [f"{what} of {outline.name}: {path} ({content})" for path, _, what in files])
