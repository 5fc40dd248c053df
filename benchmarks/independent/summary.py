"""Statistics of records of `table`: python -m benchmarks.independent.summary FOLDER ... [--out OUT]"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.validation.calibration import Share, bin_names, calibrate, read_records, reliability_diagram
from benchmarks.validation.evidence import CREDIBLE, SURE
from viz import style

RIGHT, IN_THREE, IN_PART, WRONG, NOT_ENDED, FAILED = (
    "right", "right in a credible set of three", "in part", "wrong", "not ended", "failed",
)  # fmt: skip
OUTCOMES = RIGHT, IN_THREE, IN_PART, WRONG, NOT_ENDED, FAILED
ALARMS = "effect", "measurement fault"
"""Verdicts that are false where nothing is hidden."""


@dataclass(frozen=True)
class Group:
    """Statistics of some cases.

    ``outcomes`` counts each of `OUTCOMES`; ``sure_and_wrong`` is of all cases, ``false_alarms`` of those that
    ended and hide nothing, ``coverage`` of credible sets; ``cpu`` the median [s], None without any.
    """

    name: str
    cases: int
    outcomes: dict
    sure_and_wrong: Share
    false_alarms: Share
    coverage: Share
    cpu: float | None

    def as_dict(self):
        shares = {key: getattr(self, key) for key in ("sure_and_wrong", "false_alarms", "coverage")}
        plain = {key: {"hits": s.hits, "cases": s.cases} for key, s in shares.items()}
        return {"name": self.name, "cases": self.cases, **self.outcomes, **plain, "cpu_median_s": self.cpu}

    def cells(self):
        shares = self.sure_and_wrong, self.false_alarms, self.coverage
        cpu = "-" if self.cpu is None else f"{self.cpu:.0f}"
        counts = (str(self.outcomes[o]) for o in OUTCOMES)
        return (self.name, str(self.cases), *counts, *(f"{s.hits} of {s.cases}" for s in shares), cpu)


def outcome_of(record):
    """Return what became of a case; one that is right as a twin counts as in part."""
    outcome = record.get("outcome", FAILED)
    if outcome in (NOT_ENDED, FAILED):
        return outcome
    if outcome == "yes":
        return RIGHT
    if record["evidence"]["in_three"]:
        return IN_THREE
    return WRONG if outcome == "no" else IN_PART


def group(name, records):
    """Return the statistics of some records."""
    found = [outcome_of(r) for r in records]
    told = [r["evidence"] for r in records if "evidence" in r]
    nothing = [r for r in records if r["kind"] == "nothing" and "verdict" in r]
    seconds = [r["cpu_seconds"] for r in records if "cpu_seconds" in r]
    return Group(
        name,
        len(records),
        {o: found.count(o) for o in OUTCOMES},
        Share(sum(e["sure_and_wrong"] for e in told), len(records)),
        Share(sum(r["verdict"] in ALARMS and outcome_of(r) != RIGHT for r in nothing), len(nothing)),
        Share(sum(any(c["right"] for c in e["credible"]) for e in told), len(told)),
        median(seconds) if seconds else None,
    )


def groups(records):
    """Return the statistics of all cases, and by test, by number and kind of what is hidden, by structure."""
    out = [group("all", records)]
    splits = (
        ("test {}", lambda r: r["test"]),
        ("bad reading: {}", lambda r: "yes" if r["spoilt"] else "no"),
        ("poor baseline: {}", lambda r: "yes" if r["poor_baseline"] else "no"),
        ("set {}", lambda r: r["set"]),
        ("hidden: {}", lambda r: r["kind"]),
        ("structure {}", lambda r: r["structure"]),
    )
    for name, key in splits:
        values = sorted({key(r) for r in records})
        if len(values) > 1:
            out += [group(name.format(v), [r for r in records if key(r) == v]) for v in values]
    return out


def markdown(every, calibration):
    """Return the statistics and the reliability of stated probabilities as tables."""
    sure, credible = f"sure (≥ {100 * SURE:g} %) and wrong", f"{100 * CREDIBLE:g} % sets hold the truth"
    head = ("", "cases", *OUTCOMES, sure, "false alarms, nothing hidden", credible, "CPU, median [s]")
    lines = [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *(g.cells() for g in every))]
    if calibration:
        lines += ["", "| stated probability | answers right | mean stated |", "|---|---|---|"]
        for name, share in zip(bin_names(), calibration.answers, strict=True):
            mean = f"{100 * share.stated:.1f} %" if share.cases else "-"
            lines.append(f"| {name} | {share} | {mean} |")
    return "\n".join(lines) + "\n"


def summarise(records, out):
    """Write summary.json, summary.md and reliability.png into a folder; return the tables."""
    records = [r for r in records if "kind" in r]
    if not records:
        return ""
    calibration = calibrate(records) if any("evidence" in r for r in records) else None
    every, bins = groups(records), []
    if calibration:
        bins = [
            {"stated": name, "mean_stated": s.stated if s.cases else None, "right": s.hits, "cases": s.cases}
            for name, s in zip(bin_names(), calibration.answers, strict=True)
        ]
        style.save(reliability_diagram(calibration), out / "reliability.png")
    text, plain = markdown(every, calibration), {"groups": [g.as_dict() for g in every], "reliability": bins}
    (out / "summary.json").write_text(json.dumps(plain, indent=1, ensure_ascii=False), encoding="utf-8")
    (out / "summary.md").write_text(text, encoding="utf-8")
    return text


def main(argv=None):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.independent.summary", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="where `table` wrote records.jsonl")
    parser.add_argument("--out", type=Path, help="folder of the summary (default: the first one)")
    options = parser.parse_args(argv)
    out = options.out or options.folders[0]
    out.mkdir(parents=True, exist_ok=True)
    sys.stdout.write(summarise([r for folder in options.folders for r in read_records(folder)], out))
    return 0


if __name__ == "__main__":
    sys.exit(main())
