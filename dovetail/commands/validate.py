"""``dovetail validate``: how often a diagnosis is right, on frames drawn from a seed."""

import argparse
import json
import sys
from pathlib import Path

from dovetail.commands.argument_types import add_pool, whole, whole_up_to
from dovetail.commands.common import Options
from dovetail.disk.output import Progress, write_json
from dovetail.units.pool import pool_of
from dovetail.units.work import Step
from dovetail.validation import calibration
from dovetail.validation.cases import CaseSettings
from dovetail.validation.hidden import SETS
from dovetail.validation.judging import Record
from dovetail.validation.run import parse_case, plan, run_case, validate
from dovetail.validation.table import as_markdown, summarise
from fem.io.atomic import replacing

HELP = "measure how often a diagnosis is right, on frames and hidden effects drawn from a seed"
EXAMPLE = "dovetail validate --seed 7 --cases 300 --nulls 200 --processes 4 --out out/seed-7"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--seed", type=whole, required=True, metavar="S", help="seed of the random cases")
    p.add_argument(
        "--cases",
        type=whole_up_to(1_000_000),
        default=33,
        metavar="N",
        help="cases of each set but null (default 33)",
    )
    p.add_argument(
        "--nulls",
        type=whole_up_to(1_000_000, 0),
        metavar="M",
        help="cases with nothing hidden (default: as many as the others)",
    )
    p.add_argument("--sets", metavar="LIST", help=f"of {', '.join(SETS)} (default: all)")
    add_pool(p, "cases")
    p.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the results; a run that was stopped goes on there"
    )
    p.add_argument("--case", metavar="CASE", help="run one case alone and print it, such as 12 or null:3")
    p.add_argument("--small", action="store_true", help="small frames and few lines, to try the command")


def run(options: Options, progress: Progress) -> None:
    """Draw cases, diagnose them, judge and print; or one case alone."""
    settings = CaseSettings(options.seed, options.small)
    if options.case is not None:
        progress(f"case {options.case} of seed {options.seed}")
        record = run_case(settings, parse_case(options.case))
        progress.close()
        sys.stdout.write(json.dumps(record, indent=2, ensure_ascii=False, default=float) + "\n")
        return
    sets = tuple(s.strip() for s in options.sets.split(",") if s.strip()) if options.sets else tuple(SETS)
    nulls = options.nulls if options.nulls is not None else options.cases
    tasks = plan(options.cases, nulls, sets)
    folder: Path = options.out or Path(f"validation-{options.seed}")

    def say(record: Record, step: Step) -> None:
        ended = f"{record['case']} {record['outcome']}"
        progress(f"{ended}, {step.words}", step.done, step.total)
        if not options.quiet and not sys.stderr.isatty():
            sys.stderr.write(f"{ended} in {record['seconds']:.0f} s; {step.words}\n")

    progress("drawing the first cases", 0, len(tasks))
    with pool_of(options.processes, options.scheduler) as pool:
        records = validate(settings, tasks, folder, pool=pool, say=say)
    progress.close()
    summary = summarise(records)
    text = as_markdown(summary, f"Validation with seed {options.seed}")
    if any("evidence" in r for r in records):
        text += f"\n## By evidence\n\n{calibration.as_markdown(records)}"
    write_json(folder / "table.json", {"settings": settings.as_dict(), **summary})
    with replacing(folder / "table.md") as scratch:
        scratch.write_text(text, encoding="utf-8")
    if not options.quiet:
        sys.stdout.write(text)
