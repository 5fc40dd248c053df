"""How far stated probabilities can be trusted, over the records of any number of sets.

    python -m benchmarks.validation --seed 7 --out out/seed-7
    python -m benchmarks.validation.calibration out/seed-7 out/foreign-7-results --out out/reliability.png

Records are folders of `benchmarks.validation` or of `benchmarks.independent.table`, or their files.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest

from benchmarks.validation.evidence import (
    CREDIBLE,
    LOST_BY_DATA,
    LOST_BY_SEARCH,
    NOT_IN_LIBRARY,
    SURE,
    WRONG_FAULT,
)
from dovetail.units import json_lines
from updating import UNEXPLAINED
from viz import style

EDGES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Edges of the bins of stated probability; a bin has its lower edge, the last one both [-]."""
FILES = ("cases.jsonl", "records.jsonl")
"""Names of files of records in a folder."""

Record = dict[str, Any]


class RecordsError(ValueError):
    """Records that cannot be read, or say nothing of probabilities."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of cases, with the 95 % interval of Clopper and Pearson."""

    hits: int
    cases: int
    stated: float = float("nan")  # mean probability that was stated for them [-]

    @classmethod
    def of(cls, right: Iterable[Any], stated: Iterable[float] = ()) -> "Share":
        """Return the share of cases that are right, with the mean of what was stated."""
        hits, p = [bool(r) for r in right], list(stated)
        return cls(sum(hits), len(hits), float(np.mean(p)) if p else float("nan"))

    @property
    def rate(self) -> float:
        """Share of hits; not a number without cases [-]."""
        return self.hits / self.cases if self.cases else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Least and largest rate at a confidence of 95 % [-]."""
        if not self.cases:
            return 0.0, 1.0
        ci: Any = binomtest(self.hits, self.cases).proportion_ci(0.95, "exact")
        return float(ci.low), float(ci.high)

    def __str__(self) -> str:
        """Return the share in words."""
        if not self.cases:
            return "no cases"
        low, high = (100 * x for x in self.interval)
        return f"{self.hits} of {self.cases}, {100 * self.rate:.1f} % ({low:.1f}-{high:.1f})"


@dataclass(frozen=True, slots=True)
class Calibration:
    """Summary of all records. Unexplained cases state no probability."""

    answers: tuple[Share, ...]  # right answers in each bin of stated probability
    places: tuple[Share, ...]
    sure: Share  # right answers of those with a probability of at least `SURE`
    sure_findings: Share  # of those of them that name effects
    sure_and_wrong: Share  # of all cases
    coverage: Share  # credible sets that hold the truth; stated is the mean of their total probability
    attainable: Share  # right answers of the cases that are right or lost by the search


def read_records(path: Path) -> list[Record]:
    """Return the records of a file of JSON lines, or of a folder that has one.

    Raises
    ------
    RecordsError
        If a folder has no such file.
    """
    files = [path / name for name in FILES if (path / name).exists()] if path.is_dir() else [path]
    if not files:
        msg = f"{path}: the folder has neither {' nor '.join(FILES)}"
        raise RecordsError(msg)
    return [r for r in json_lines(files[0].read_bytes()) if "settings" not in r]


def reliability(stated: Sequence[float], right: Sequence[bool]) -> tuple[Share, ...]:
    """Return for each bin of stated probability how many are right."""
    p, hit = np.asarray(stated, dtype=float), np.asarray(right, dtype=bool)
    index = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    return tuple(Share.of(hit[index == k], p[index == k]) for k in range(len(EDGES) - 1))


def calibrate(records: Iterable[Record]) -> Calibration:
    """Return how far the probabilities of all records can be trusted.

    Raises
    ------
    RecordsError
        If no record has any.
    """
    every = [r["evidence"] for r in records if "evidence" in r]
    if not every:
        msg = "no record has 'evidence': run benchmarks.validation, or benchmarks.independent.table"
        raise RecordsError(msg)
    answers = [e for e in every if e["verdict"] != UNEXPLAINED]
    placed = [e for e in answers if e["place_right"] is not None]
    sure = [e for e in answers if e["probability"] >= SURE]
    found = [e for e in sure if e["verdict"] == "effect"]
    attained = [e for e in every if e["right"] or e["loss"] == LOST_BY_SEARCH]

    def right_of(chosen: Sequence[Record]) -> Share:
        return Share.of((e["right"] for e in chosen), (e["probability"] for e in chosen))

    return Calibration(
        reliability([e["probability"] for e in answers], [e["right"] for e in answers]),
        reliability([e["place_probability"] for e in placed], [e["place_right"] for e in placed]),
        right_of(sure),
        right_of(found),
        Share.of(e["sure_and_wrong"] for e in every),
        Share.of(
            (any(c["right"] for c in e["credible"]) for e in every),
            (sum(c["probability"] for c in e["credible"]) for e in every),
        ),
        Share.of(e["right"] for e in attained),
    )


def _set_rows(records: Sequence[Record]) -> list[str]:
    """Return a line for each set: rates, losses, and times of the processor."""
    rows = []
    for name in dict.fromkeys(r["set"] for r in records):
        of_set = [r for r in records if r["set"] == name]
        every = [r["evidence"] for r in of_set if "evidence" in r]
        loss = Counter(e["loss"] for e in every)
        right = sum(e["right"] for e in every)
        attained = right + loss[LOST_BY_SEARCH]
        seconds = [r["cpu_seconds"] for r in of_set if "cpu_seconds" in r]
        cells = (
            name,
            len(of_set),
            right,
            sum(e["in_three"] for e in every),
            sum(e.get("covered", False) for e in every),
            sum(e["sure_and_wrong"] for e in every),
            loss[LOST_BY_SEARCH],
            loss[LOST_BY_DATA],
            loss[WRONG_FAULT],
            loss[NOT_IN_LIBRARY],
            len(of_set) - len(every),
            f"{100 * right / attained:.0f} %" if attained else "-",
            f"{np.median(seconds):.0f}, {max(seconds):.0f}" if seconds else "-",
        )
        rows.append(f"| {' | '.join(map(str, cells))} |")
    return rows


def as_markdown(records: Sequence[Record]) -> str:
    """Return the tables: each set, the bins of stated probability, and the shares that are aimed at."""
    c = calibrate(records)
    lines = [
        "| set | cases | right | right or in a credible set of three | truth in the credible set "
        "| sure and wrong | search loss | information loss | wrong fault | not in the library | failed "
        "| of the attainable | CPU [s], median, largest |",
        f"|{13 * '---|'}",
        *_set_rows(records),
        "",
        "| stated probability | answers right | mean stated | places right | mean stated |",
        "|---|---|---|---|---|",
    ]
    for name, answer, place in zip(bin_names(), c.answers, c.places, strict=True):
        lines.append(f"| {name} | {answer} | {_percent(answer)} | {place} | {_percent(place)} |")
    lines += [
        "",
        "| | share |",
        "|---|---|",
        f"| right, of answers at least {100 * SURE:g} % sure | {c.sure}; {_percent(c.sure)} stated |",
        f"| of these, effects | {c.sure_findings}; {_percent(c.sure_findings)} stated |",
        f"| sure and wrong, of all cases | {c.sure_and_wrong} |",
        f"| truth in {100 * CREDIBLE:g} % credible sets | {c.coverage}; {_percent(c.coverage)} stated |",
        f"| right, of the attainable | {c.attainable} |",
    ]
    return "\n".join(lines) + "\n"


def bin_names() -> tuple[str, ...]:
    """Return the bins of stated probability in words."""
    return tuple(f"{100 * low:g}-{100 * high:g} %" for low, high in pairwise(EDGES))


def _percent(share: Share) -> str:
    return f"{100 * share.stated:.1f} %" if share.cases else "-"


def reliability_diagram(calibration: Calibration) -> Figure:
    """Return the share that is right for each bin of stated probability, of answers and of places."""
    with style.look():
        figure = style.new_figure(height=3.4)
        left, right = figure.subplots(1, 2, sharey=True)
        _draw(left, calibration.answers, "Answer: kind and place", style.BLUE)
        _draw(right, calibration.places, "Place alone", style.GREEN)
        left.set_ylabel("right [%]")
        handles = left.get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper right", ncols=2)
    return figure


def _draw(ax: Axes, shares: Sequence[Share], title: str, colour: str) -> None:
    """Draw shares with their 95 % intervals over bins, and what was stated."""
    for k, share in enumerate(shares):
        if not share.cases:
            continue
        low, high = share.interval
        first = k == next(i for i, s in enumerate(shares) if s.cases)
        ax.plot(
            [k - 0.3, k + 0.3],
            [100 * share.stated] * 2,
            color=style.INK,
            label="stated, mean" if first else None,
        )
        ax.errorbar(
            k,
            100 * share.rate,
            [[100 * (share.rate - low)], [100 * (high - share.rate)]],
            fmt="o",
            color=colour,
            capsize=3,
            label="right, 95 % interval" if first else None,
        )
    ax.set_title(title)
    names = (name.removesuffix(" %") for name in bin_names())
    labels = [f"{name}\n{share.cases}" for name, share in zip(names, shares, strict=True)]
    ax.set_xticks(np.arange(len(shares)), labels)
    ax.set_xlabel("stated probability [%], and number of cases")
    ax.set_xlim(-0.6, len(shares) - 0.4)
    ax.set_ylim(-4, 104)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables and write the picture."""
    parser = argparse.ArgumentParser(description="Print how far stated probabilities can be trusted.")
    parser.add_argument("records", nargs="+", type=Path, help="folders or files of records")
    parser.add_argument("--out", type=Path, help="picture of the reliability diagram, as png, pdf or svg")
    options = parser.parse_args(argv)
    try:
        records = [r for path in options.records for r in read_records(path)]
        text = as_markdown(records)
    except RecordsError as reason:
        sys.stderr.write(f"{reason}\n")
        return 2
    sys.stdout.write(text)
    if options.out:
        style.save(reliability_diagram(calibrate(records)), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
