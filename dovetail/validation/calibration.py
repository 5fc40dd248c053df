"""How far stated probabilities can be trusted, over the records of any number of sets."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.units.folder import json_lines
from dovetail.validation.evidence import (
    CREDIBLE,
    LOST_BY_DATA,
    LOST_BY_SEARCH,
    NOT_IN_LIBRARY,
    SURE,
    WRONG_FAULT,
)
from dovetail.validation.table import interval
from updating.diagnosis.diagnosis import UNEXPLAINED

EDGES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Edges of the bins of stated probability; a bin has its lower edge, the last one both [-]."""
FILES = ("cases.jsonl", "records.jsonl")
"""Names of files of records in a folder."""

Record = dict[str, Any]


class RecordsError(ValueError):
    """Records that cannot be read, or say nothing of probabilities."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of cases, with the 95 % interval of Clopper and Pearson.

    Attributes
    ----------
    hits, cases : int
    stated : float
        Mean probability that was stated for them; not a number where none was [-].
    """

    hits: int
    cases: int
    stated: float = float("nan")

    @property
    def rate(self) -> float:
        """Share of hits; not a number without cases [-]."""
        return self.hits / self.cases if self.cases else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Least and largest rate at a confidence of 95 % [-]."""
        return interval(self.hits, self.cases) if self.cases else (0.0, 1.0)

    def __str__(self) -> str:
        """Return the share in words."""
        if not self.cases:
            return "no cases"
        low, high = (100 * x for x in self.interval)
        return f"{self.hits} of {self.cases}, {100 * self.rate:.1f} % ({low:.1f}-{high:.1f})"


@dataclass(frozen=True, slots=True)
class Calibration:
    """Summary of all records.

    Attributes
    ----------
    answers, places : tuple of Share
        For each bin of stated probability, how many answers, and how many places, are right. Unexplained
        cases state no probability.
    sure : Share
        Answers with a probability of at least ``SURE`` that are right.
    sure_findings : Share
        Those of them that name effects.
    sure_and_wrong : Share
        Of all cases.
    coverage : Share
        Credible sets that hold the truth; ``stated`` is the mean of their total probability.
    attainable : Share
        Right answers of the cases that are right or lost by the search.
    """

    answers: tuple[Share, ...]
    places: tuple[Share, ...]
    sure: Share
    sure_findings: Share
    sure_and_wrong: Share
    coverage: Share
    attainable: Share


def read_records(path: Path) -> list[Record]:
    """Return the records of a file of JSON lines, or of a folder that has one.

    Raises
    ------
    RecordsError
        If there is no such file, or a line is no record.
    """
    if path.is_dir():
        found = [path / name for name in FILES if (path / name).exists()]
        if not found:
            msg = f"{path}: the folder has neither {' nor '.join(FILES)}"
            raise RecordsError(msg)
        path = found[0]
    try:
        records = json_lines(path.read_bytes())
    except (OSError, ValueError) as reason:
        msg = f"{path}: {getattr(reason, 'strerror', None) or reason}"
        raise RecordsError(msg) from None
    return [r for r in records if "settings" not in r]


def told(records: Iterable[Record]) -> list[Record]:
    """Return the records of searches by evidence.

    Raises
    ------
    RecordsError
        If no record says anything of that.
    """
    out = [r["evidence"] for r in records if "evidence" in r]
    if not out:
        msg = "no record has 'evidence': run dovetail validate, or tests.independent.table"
        raise RecordsError(msg)
    return out


def reliability(stated: Sequence[float], right: Sequence[bool]) -> tuple[Share, ...]:
    """Return for each bin of stated probability how many are right."""
    p, hit = np.asarray(stated, dtype=float), np.asarray(right, dtype=bool)
    index = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    return tuple(_share(p[index == k], hit[index == k]) for k in range(len(EDGES) - 1))


def _share(p: Any, hit: Any) -> Share:
    return Share(int(np.sum(hit)), len(p), float(np.mean(p)) if len(p) else float("nan"))


def calibrate(records: Iterable[Record]) -> Calibration:
    """Return how far the probabilities of all records can be trusted."""
    every = told(records)
    answers = [e for e in every if e["verdict"] != UNEXPLAINED]
    placed = [e for e in answers if e["place_right"] is not None]
    sure = [e for e in answers if e["probability"] >= SURE]
    found = [e for e in sure if e["verdict"] == "effect"]
    attained = [e for e in every if e["right"] or e["loss"] == LOST_BY_SEARCH]

    def right_of(chosen: Sequence[Record]) -> Share:
        return _share([e["probability"] for e in chosen], [e["right"] for e in chosen])

    return Calibration(
        reliability([e["probability"] for e in answers], [e["right"] for e in answers]),
        reliability([e["place_probability"] for e in placed], [e["place_right"] for e in placed]),
        right_of(sure),
        right_of(found),
        Share(sum(e["sure_and_wrong"] for e in every), len(every)),
        _share(
            [sum(c["probability"] for c in e["credible"]) for e in every],
            [any(c["right"] for c in e["credible"]) for e in every],
        ),
        Share(sum(e["right"] for e in attained), len(attained)),
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
            name, len(of_set), right, sum(e["in_three"] for e in every),
            sum(e["sure_and_wrong"] for e in every), loss[LOST_BY_SEARCH], loss[LOST_BY_DATA],
            loss[WRONG_FAULT], loss[NOT_IN_LIBRARY], len(of_set) - len(every),
            f"{100 * right / attained:.0f} %" if attained else "-",
            f"{np.median(seconds):.0f}, {max(seconds):.0f}" if seconds else "-",
        )  # fmt: skip
        rows.append(f"| {' | '.join(map(str, cells))} |")
    return rows


def as_markdown(records: Sequence[Record]) -> str:
    """Return the tables: each set, the bins of stated probability, and the shares that are aimed at."""
    c = calibrate(records)
    lines = [
        "| set | cases | right | right or in a credible set of three | sure and wrong | search loss "
        "| information loss | wrong fault | not in the library | failed | of the attainable "
        "| CPU [s], median, largest |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
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
