"""The error after each step, from the nominal model to what was found, above the noise floor."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.report.blocks import TableBlock
from dovetail.report.cells import decimals
from dovetail.report.table import Column, Table
from dovetail.report.words import step_label
from dovetail.result import by_frfs
from updating.diagnosis.verdict import Verdict

if TYPE_CHECKING:
    from viz.chart import Chart

WORDS: dict[str, dict[str, Any]] = {
    "dB": {
        "ylabel": "error of the amplitude [dB]",
        "names": ("on the lines of the fit", "on held-out lines"),
    },
    "%": {
        "ylabel": "error of natural frequencies [%]",
        "names": ("of fitted modes", "of held-out modes"),
    },
}
"""Words of the figure by the unit of the error."""
HEADS = {"dB": ("fitted lines", "held-out lines"), "%": ("fitted modes", "held-out modes")}
"""Headings of a page's table by the unit."""
CAPTIONS = {
    "dB": (
        "Root mean square error of the FRF amplitudes after each step, on fitted and on held-out lines. The "
        "noise floor is that of measurement noise and mesh error."
    ),
    "%": (
        "Root mean square deviation of computed from measured natural frequencies after each step. The grey "
        "floor is the standard deviation of the measurement and the mesh error."
    ),
}
QUANTITIES = {"dB": "Error", "%": "Error of natural frequencies"}


def digits(d: Verdict) -> int:
    """Return the digits after the point: two, or as many as leave two of a noise floor in percent."""
    if d.stairs.unit == "dB":
        return 2
    return int(np.clip(1 - math.floor(math.log10(max(d.stairs.floor, 1e-9))), 2, 6))


def steps(d: Verdict) -> list[tuple[str, float, float | None]]:
    """Return label and errors of each step, of what was fitted and of what was held out."""
    return [(step_label(label), fit, h if math.isfinite(h) else None) for label, fit, h in d.stairs.rows]


def in_words(d: Verdict) -> str:
    """Return the staircase in words."""
    n, stairs = digits(d), d.stairs
    each = "; ".join(f"{label} {fit:.{n}f} {stairs.unit}" for label, fit, _ in stairs.rows)
    floor = f"{stairs.floor:.{n}f} {stairs.unit}"
    return f"{QUANTITIES[stairs.unit]} after each step: {each}; noise floor {floor}."


def table(d: Verdict, held_out: Mapping[str, tuple[float, ...]] | None = None) -> Table:
    """Return the errors after each step, and the noise floor; ``held_out`` has those of channels [dB]."""
    stairs, show = d.stairs, f".{digits(d)}f"
    labels, fit, held = zip(*stairs.rows, strict=True)
    return Table.of(
        "steps",
        Column("error after each step", [*map(step_label, labels), "noise floor"]),
        Column("fitted", [*fit, stairs.floor], stairs.unit, show),
        Column("held-out", [*held, math.nan], stairs.unit, show),
        *(Column(name, [*db, math.nan], show=show) for name, db in (held_out or {}).items()),
    )


def block(d: Verdict, held_out: Mapping[str, tuple[float, ...]] | None = None) -> TableBlock:
    """Return the errors after each step for a page; ``held_out`` has those of channels [dB]."""
    stairs, n = d.stairs, digits(d)
    some = by_frfs(d) or any(math.isfinite(h) for *_, h in stairs.rows)
    head = ["step", *(f"{name} [{stairs.unit}]" for name in HEADS[stairs.unit][: 2 if some else 1])]
    columns: list[list[float]] = [
        [r[1] for r in stairs.rows],
        *([[r[2] for r in stairs.rows]] if some else []),
    ]
    for name, errors in (held_out or {}).items():
        head.append(f"{name}, held out [dB]")
        columns.append(list(errors[: len(stairs.rows)]))
    labels = (step_label(label) for label, *_ in stairs.rows)
    rows = [
        [label, *(decimals(x, n) for x in row)]
        for label, row in zip(labels, zip(*columns, strict=True), strict=True)
    ]
    return TableBlock(head, rows, numbers=range(1, len(head)))


def figure(d: Verdict, **more: Any) -> "Chart":
    """Return the figure; more as :func:`viz.search.staircase`."""
    from viz.search import staircase

    unit = d.stairs.unit
    return staircase(steps(d), d.stairs.floor, unit=unit, digits=digits(d), **WORDS[unit], **more)
