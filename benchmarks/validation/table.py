"""Outcomes of each set with confidence intervals, errors of parameters, and the list of failures."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.validation.calibration import Share
from benchmarks.validation.judging import FLOOR, OUTCOMES, Record


def as_markdown(records: Sequence[Record], title: str) -> str:
    """Return the tables. Cases that failed count as neither right nor wrong, but in the number of cases."""
    head = ("set", "cases", "right (95 % interval)", *OUTCOMES[1:])
    lines = [f"# {title}", "", *(_row(cells) for cells in (head, ["---"] * len(head)))]
    for name in dict.fromkeys(r["set"] for r in records):
        count = Counter(r["outcome"] for r in records if r["set"] == name)
        cases = count.total()
        lines.append(_row((name, cases, Share(count["right"], cases), *(count[o] for o in OUTCOMES[1:]))))
    errors = [e for r in records for e in r.get("errors", ())]
    if errors:
        median = 100 * np.median([e["error"] for e in errors])
        covered = Share.of(e["covered"] for e in errors)
        lines += [
            "",
            f"Parameters of right effects: median error {median:.2g} %; 95 % intervals hold {covered}.",
        ]
    of_one_model = [r for r in records if r["set"] in ("single", "two", "null")]
    right = [r for r in of_one_model if r["outcome"] == "right"]
    if right:
        near_floor = Share.of(r["db"]["after"] <= FLOOR * r["db"]["floor"] for r in right)
        lines += ["", f"Error left within {FLOOR:g} times the floor, of right cases: {near_floor}."]
    seconds = [r["seconds"] for r in records]
    lines += ["", f"Seconds of a case: median {np.median(seconds):.0f}, largest {max(seconds):.0f}."]
    if len({r["program"] for r in records}) > 1:
        lines += ["", "These cases were run with different versions of the code."]
    failures = [_failure(r) for r in records if r["outcome"] != "right"]
    if failures:
        head = ("case", "frame", "hidden", "outcome", "found", "error [dB]", "floor [dB]")
        lines += ["", "## Not right", "", *(_row(cells) for cells in (head, ["---"] * len(head), *failures))]
    return "\n".join(lines) + "\n"


def _row(cells: Sequence[object]) -> str:
    return f"| {' | '.join(str(c).replace('|', '/') for c in cells)} |"


def _failure(r: Record) -> tuple[str, ...]:
    found = [f"{f['kind']} at {f['where']}" for f in r.get("found", ())]
    found += [f"{f['kind']} {f['sensor']}" for f in r.get("faults", ())]
    found += r.get("traceback", "").strip().splitlines()[-1:]
    hidden = (f"{h['kind']} at {h['where']}" if "where" in h else h["kind"] for h in r["hidden"])
    db, steps = r.get("db"), ("nominal", "fitted", "after")
    errors = (" → ".join(f"{db[k]:.2f}" for k in steps), f"{db['floor']:.2f}") if db else ("-", "-")
    words = "; ".join(found) or r.get("verdict", "")
    return (r["case"], r.get("family", ""), "; ".join(hidden) or "nothing", r["outcome"], words, *errors)
