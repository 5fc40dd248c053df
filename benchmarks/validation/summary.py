"""Summarise runs of `dovetail validate`, one row for each seed and set.

    dovetail validate --seed 3601 --out out/seed-3601
    python -m benchmarks.validation.summary out/seed-3601 >> benchmarks/validation/seeds.csv

The columns are described in docs/validation-seeds.md.
"""

import csv
import json
import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

SETS = (
    "single", "null", "weak", "two", "faults", "withheld",
    "connection", "connections", "mixed", "mounting",
)  # fmt: skip
OUTCOMES = ("right", "twin", "beside", "part", "wrong", "unexplained", "not noticed", "fault", "failed")
SEEDS = Path(__file__).with_name("seeds.csv")

Record = dict[str, Any]


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of one run, a row for each set that it has cases of."""
    lines = (folder / "cases.jsonl").read_text(encoding="utf-8").splitlines()
    head, *records = [json.loads(line) for line in lines]
    seed = head["settings"]["seed"]
    parts = {name: [r for r in records if r["set"] == name] for name in SETS}
    return [summary(seed, name, part) for name, part in parts.items() if part]


def summary(seed: int, name: str, records: Sequence[Record]) -> dict[str, Any]:
    """Return how often each outcome came in one set of one seed, with errors of parameters and times."""
    outcomes = Counter(r["outcome"] for r in records)
    errors = [e for r in records for e in r.get("errors", ())]
    return {
        "seed": seed,
        "set": name,
        "cases": len(records),
        **{o.replace(" ", "_"): outcomes[o] for o in OUTCOMES},
        "first": sum(r.get("first", False) for r in records),
        "in_three": sum(r.get("in_three", False) for r in records),
        "first_or_twin": sum(r.get("first", False) or r["outcome"] == "twin" for r in records),
        "parameters": len(errors),
        "covered": sum(e["covered"] for e in errors),
        "median_error": f"{statistics.median(e['error'] for e in errors):.3g}" if errors else "",
        "median_seconds": f"{statistics.median(r['seconds'] for r in records):.3g}",
        "programs": " ".join(dict.fromkeys(r.get("program", "") for r in records)),
    }


def main(folders: Sequence[str]) -> None:
    """Print the rows of some runs, without the header."""
    for folder in folders:
        rows = rows_of(Path(folder))
        csv.DictWriter(sys.stdout, list(rows[0]), lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main(sys.argv[1:])
