"""Measure how often a diagnosis is right, on frames and hidden effects drawn from a seed.

    python -m benchmarks.validation --seed 7 --cases 300 --nulls 200 --processes 4 --out out/seed-7

docs/validation.md describes the sets and the records.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.validation import calibration, run
from benchmarks.validation.cases import CaseSettings
from benchmarks.validation.hidden import SETS
from benchmarks.validation.judging import Record
from benchmarks.validation.table import as_markdown
from dovetail.commands.argument_types import add_pool, integer_up_to, natural
from dovetail.units import FolderError, PoolError, WorkStep, outcome_of, pool_of
from fem.io.atomic import replacing


def sets_of(text: str) -> tuple[str, ...]:
    """Read names of sets, separated by commas."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in names:
        if name not in SETS:
            msg = f"there is no set '{name}'; there are {', '.join(SETS)}"
            raise argparse.ArgumentTypeError(msg)
    return names or tuple(SETS)


def case_of(text: str) -> run.Task:
    """Read ``123``, of the set single, or ``null:123``."""
    name, _, number = text.rpartition(":")
    name = name or "single"
    if name not in SETS or not number.isdigit():
        msg = f"'{text}' is not a case; give a number, or one of {', '.join(SETS)} with one, as null:3"
        raise argparse.ArgumentTypeError(msg)
    return name, int(number)


def options_of(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    p = argparse.ArgumentParser("python -m benchmarks.validation", description=(__doc__ or "").split("\n")[0])
    cases = integer_up_to(1_000_000)
    p.add_argument("--seed", type=natural, required=True, metavar="S", help="seed of the random cases")
    p.add_argument("--cases", type=cases, default=33, metavar="N", help="cases of each set (default 33)")
    p.add_argument(
        "--nulls",
        type=integer_up_to(1_000_000, 0),
        metavar="M",
        help="cases of each set with nothing hidden (default: as many as of the others)",
    )
    p.add_argument("--sets", type=sets_of, default=tuple(SETS), metavar="LIST", help=f"of {', '.join(SETS)}")
    add_pool(p, "cases")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder of results; a stopped run goes on there")
    p.add_argument("--case", type=case_of, metavar="CASE", help="run one case and print it: 12 or null:3")
    p.add_argument("--small", action="store_true", help="small frames and few lines, to try the command")
    p.add_argument("--quiet", action="store_true", help="print neither cases nor tables")
    return p.parse_args(argv)


def run_all(options: argparse.Namespace, settings: CaseSettings) -> None:
    """Draw cases, diagnose and judge them, and write the table."""
    nulls = options.nulls if options.nulls is not None else options.cases
    folder: Path = options.out or Path(f"validation-{options.seed}")

    def say(record: Record, step: WorkStep) -> None:
        if not options.quiet:
            words = f"{record['case']} {record['outcome']} in {record['seconds']:.0f} s; {step.words}"
            print(words, file=sys.stderr, flush=True)

    with pool_of(options.processes, options.scheduler) as pool:
        tasks = run.plan(options.cases, nulls, options.sets)
        records = run.validate(settings, tasks, folder, pool=pool, say=say)
    text = as_markdown(records, f"Validation with seed {options.seed}")
    if any("evidence" in r for r in records):
        text += f"\n## By evidence\n\n{calibration.as_markdown(records)}"
    with replacing(folder / "table.md") as scratch:
        scratch.write_text(text, encoding="utf-8")
    if not options.quiet:
        sys.stdout.write(text)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return 2 for a folder or a cluster that cannot be used, 1 if it was interrupted."""
    options = options_of(argv)
    settings = CaseSettings(options.seed, options.small)
    try:
        if options.case is None:
            run_all(options, settings)
        else:
            outcome = outcome_of(run.run_case, settings, options.case)
            record = run.record_of(settings, outcome)
            print(json.dumps(record, indent=2, ensure_ascii=False, default=float))
    except KeyboardInterrupt as reason:
        print(f"interrupted: {reason}", file=sys.stderr)
        return 1
    except (FolderError, PoolError, OSError) as reason:
        print(reason, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
