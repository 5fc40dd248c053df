"""Natural frequencies of Nastran decks by the model that is read from them, beside those of the program.

    python -m benchmarks.decks FOLDER [--modes 10] [--csv out.csv]

FOLDER has decks (.bdf .dat .nas .inp) with the program's listing (.f06 .out) of the same name beside them,
as MSC and Simcenter Nastran, NASTRAN-95 and MYSTRAN write it. Units do not matter if they are consistent.
"""

import argparse
import csv
import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem import MeshError, ModelError, assemble, solve_modes
from fem.io import DeckUnits, model_of
from fem.io.nastran_frame import read_nastran_frame

DECKS = (".bdf", ".dat", ".nas", ".inp")
LISTINGS = (".f06", ".out")
_TABLE = re.compile(r"R\s?E\s?A\s?L\s+E\s?I\s?G\s?E\s?N\s?V\s?A\s?L\s?U\s?E\s?S", re.IGNORECASE)
_ROW = re.compile(r"^\d?\s*(\d+)\s+(\d+)\s+([-+.\dEeDd]+)\s+([-+.\dEeDd]+)\s+([-+.\dEeDd]+)(\s|$)")
RIGID = 1e-4
"""Frequencies below this share of the highest one count as those of rigid bodies [-]."""


def listed_frequencies(path: Path) -> NDArray[np.float64]:
    """Return the natural frequencies of the first table of eigenvalues in a listing [Hz]."""
    found: dict[int, float] = {}
    inside = False
    for line in path.read_text(errors="replace").splitlines():
        if _TABLE.search(line):
            if found and not inside:
                break
            inside = True
        elif inside and (row := _ROW.match(line)):
            found[int(row.group(1))] = float(row.group(5).upper().replace("D", "E"))
        elif inside and found and line.strip() and not line[:1].isdigit():
            inside = False
    return np.sort(np.array(list(found.values())))


def read_frequencies(path: Path, n: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the lowest natural frequencies of a deck's model [Hz], and its notes."""
    model = model_of(read_nastran_frame(path, DeckUnits()))
    return solve_modes(assemble(model), n).frequency, model.mesh.notes


def compare(deck: Path, listing: Path, n: int) -> list[tuple[int, float, float]]:
    """Return number, the program's frequency and ours [Hz] of the elastic modes."""
    theirs = listed_frequencies(listing)[:n]
    ours, _ = read_frequencies(deck, max(len(theirs) + 6, 10))
    top = theirs.max(initial=0.0)
    elastic = theirs[theirs > RIGID * top]
    mine = ours[ours > min(RIGID * top, 0.5 * elastic.min(initial=np.inf))]
    return [(k + 1, float(a), float(b)) for k, (a, b) in enumerate(zip(elastic, mine, strict=False))]


def main() -> None:
    """Print a table of the decks in a folder."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--modes", type=int, default=10)
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--each", action="store_true", help="print every mode")
    args = parser.parse_args()
    rows = []
    for deck in sorted(p for p in args.folder.rglob("*") if p.suffix.lower() in DECKS):
        same_name = (p for p in deck.parent.iterdir() if p.stem.lower() == deck.stem.lower())
        listing = next((p for p in same_name if p.suffix.lower() in LISTINGS), None)
        if listing is None or not len(listed_frequencies(listing)):
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                pairs = compare(deck, listing, args.modes)
        except (MeshError, ModelError, ValueError) as reason:
            print(f"{deck.name:34} not read: {reason}")
            continue
        deviation = [100 * (b / a - 1) for _, a, b in pairs]
        worst = max(deviation, key=abs, default=float("nan"))
        print(f"{deck.name:34} {len(pairs):3d} modes, {worst:+9.4f} % at most")
        rows += [(deck.name, k, a, b, d) for (k, a, b), d in zip(pairs, deviation, strict=True)]
        if args.each:
            for (k, a, b), d in zip(pairs, deviation, strict=True):
                print(f"    {k:3d} {a:14.6g} {b:14.6g} Hz {d:+9.4f} %")
    if args.csv:
        with args.csv.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("deck", "mode", "program [Hz]", "Dovetail [Hz]", "deviation [%]"))
            writer.writerows((n, k, f"{a:.6g}", f"{b:.6g}", f"{d:+.4f}") for n, k, a, b, d in rows)


if __name__ == "__main__":
    main()
