"""The command ``dovetail validate``."""

import argparse
import json
import sys
from pathlib import Path

from dovetail.disk.output import Progress, write_json
from dovetail.validation.cases import SETS, Settings
from dovetail.validation.judging import Record
from dovetail.validation.run import parse_case, plan, run_case, validate
from dovetail.validation.table import as_markdown, summarise
from fem.io.atomic import replacing

Options = argparse.Namespace


def run(options: Options, progress: Progress) -> None:
    """Draw cases, diagnose them, judge and print; or one case alone."""
    settings = Settings(options.seed, options.small)
    if options.case is not None:
        progress(f"case {options.case} of seed {options.seed}")
        record = run_case(settings, parse_case(options.case))
        progress.close()
        sys.stdout.write(json.dumps(record, indent=2, ensure_ascii=False, default=float) + "\n")
        return
    sets = tuple(s.strip() for s in options.sets.split(",") if s.strip()) if options.sets else SETS
    nulls = options.nulls if options.nulls is not None else options.cases
    tasks = plan(options.cases, nulls, sets)
    folder: Path = options.out or Path(f"validation-{options.seed}")

    def say(record: Record, done: int, total: int, left: float) -> None:
        progress(f"{record['case']} {record['outcome']}", done, total)
        if not options.quiet and not sys.stderr.isatty():
            sys.stderr.write(
                f"{done}/{total} {record['case']} {record['outcome']} {record['seconds']:.0f} s, "
                f"{left / 60:.0f} min to go\n"
            )

    progress("drawing the first cases", 0, len(tasks))
    records = validate(settings, tasks, folder, processes=options.processes, say=say)
    progress.close()
    summary = summarise(records)
    text = as_markdown(summary, f"Validation with seed {options.seed}")
    write_json(folder / "table.json", {"settings": settings.as_dict(), **summary})
    with replacing(folder / "table.md") as scratch:
        scratch.write_text(text, encoding="utf-8")
    if not options.quiet:
        sys.stdout.write(text)
