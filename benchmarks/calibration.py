"""Draw how far stated probabilities can be trusted, and print the tables.

    dovetail validate --seed 7 --out out/seed-7
    python -m benchmarks.calibration out/seed-7 out/foreign-7-results --out docs/images/reliability.png

Records are folders of `dovetail validate` or of `tests.independent.table`, or their
files. All of them count alike.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dovetail.validation.calibration import (
    Calibration,
    RecordsError,
    Share,
    as_markdown,
    bin_names,
    calibrate,
    read_records,
)
from viz import style


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
    parser = argparse.ArgumentParser(
        description="Draw how far stated probabilities can be trusted, and print the tables."
    )
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
