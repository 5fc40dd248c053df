"""``dovetail learn``: how the form of frames is off, from frames that lack nothing."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, check_places, warn
from dovetail.disk.output import Output, Progress
from dovetail.file.paths import input_files
from dovetail.report.table import Column, Table
from dovetail.study import load_study
from fem.io.atomic import replacing

EXAMPLE = "dovetail learn bench/study.toml rack/study.toml --out form.toml"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    p.add_argument(
        "studies",
        type=Path,
        nargs="+",
        metavar="STUDY",
        help="studies of frames that lack nothing, with FRFs",
    )
    p.add_argument(
        "--json", type=Path, metavar="FILE", help="write the result as JSON; - for standard output"
    )
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="file of means and standard deviations (TOML), which [form] file = … of other studies names",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Fit the frames, and write what they say of the form together."""
    from dovetail.learning import NothingLearnedError, form_data, written
    from dovetail.result import FORM_QUANTITIES
    from updating.inference.learned_form import learned, usual

    read = [file for path in options.studies for file in input_files(path)]
    check_places(options, Output("--out", options.out), more=read)
    frames, left = {}, []
    for n, path in enumerate(options.studies):
        progress(f"fitting {path}", n, len(options.studies))
        study = load_study(path)
        warn(study.warnings)
        found = form_data(study)
        if found is None:
            left.append(f"note: {path} is left out: its model does not explain the data")
        else:
            frames[path] = found
    if not frames:
        msg = (
            "none of the models explains its data: diagnose what each lacks, and learn from the found.toml "
            "of the diagnosis"
        )
        raise NothingLearnedError(msg)
    progress("learning", 1, 1)
    known = list(frames.values())
    before, after = usual(known), learned(known)
    with replacing(options.out) as scratch:
        scratch.write_text(written(after, list(frames)), encoding="utf-8")
    number = [sum(k == kind for f in known for k in f.kinds) for kind in after]
    table = Table.of(
        "form",
        Column("of", [f"{place}: {FORM_QUANTITIES[key]}" for place, key in after]),
        Column("number", number),
        *(
            Column(f"{when} {what}", [pairs[kind][i] for kind in after], "", ".3g")
            for when, pairs in (("usual", before), ("learned", after))
            for i, what in enumerate(("mean", "std"))
        ),
    )
    return Answer(
        None,
        [table, "", *left, f"written to {options.out}; a study reads it by [form] file"],
        {"form": {f"{place} {key}": pair for (place, key), pair in after.items()}},
    )
