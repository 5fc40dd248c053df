"""Parts of solid elements in studies, compared with CalculiX, which solves the whole structure.

    python -m benchmarks.parts_ccx bolts OUT --seeds 1 2 [--csv bolts.csv]  # 8 minutes a seed
    python -m benchmarks.parts_ccx corner OUT [--csv corner.csv]            # 2 minutes
    python -m benchmarks.parts_ccx picture OUT parts.png                     # of studies in OUT

`bolts` runs `dovetail run` on two cases of each seed: one bolt soft in two directions, and none. `corner`
compares a frame on a solid corner piece without any fit. CalculiX is needed: `ccx` on the PATH.
"""

import argparse
import csv
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.parts_ccx import bolts, corner
from benchmarks.parts_ccx.calculix import CalculixError


@dataclass(frozen=True)
class Answer:
    """The answer of a diagnosis beside the truth.

    Attributes
    ----------
    seed, verdict : int, str
    hidden, effects : tuple of str
        Names of the effects that are hidden, and of those found.
    values : tuple of (float, float, float)
        Hidden stiffness, found stiffness and its standard deviation [N/m] of each hidden direction that was
        found.
    probability : float
        Of the hypothesis [-].
    level_db : float
        Residual level of the hypothesis [dB].
    seconds : float
    right : bool
        Whether it names all that is hidden and nothing else.
    """

    seed: int
    verdict: str
    hidden: tuple[str, ...]
    effects: tuple[str, ...]
    values: tuple[tuple[float, float, float], ...]
    probability: float
    level_db: float
    seconds: float
    right: bool


def diagnose(folder: Path, seed: int, hidden: bool) -> Answer:
    """Make a case in a folder, run `dovetail run` on it and return its answer."""
    truth = bolts.make(folder, seed, hidden)
    values = {"moduli": truth.moduli, "bolts": truth.bolts, "zeta": truth.zeta, "soft": truth.soft}
    (folder / "truth.json").write_text(json.dumps(values, indent=1) + "\n")
    command = [sys.executable, "-m", "dovetail", "run", str(folder / "study.toml"), "--quiet"]
    command += ["--out", str(folder / "report"), "--force", "--processes", "1"]
    subprocess.run(command, check=True)
    return answer_of(folder, seed, truth)


def answer_of(folder: Path, seed: int, truth: bolts.Truth) -> Answer:
    """Return the answer in folder/report beside the truth."""
    result = json.loads((folder / "report" / "result.json").read_text())
    found = {effect["name"]: effect["parameters"][0] for effect in result["effects"]}
    names = [f"joint_stiffness:bolt {truth.soft}.{d}" for d in bolts.HIDDEN_DIRECTIONS if truth.soft]
    values = [
        (truth.bolts[truth.soft]["xyz".index(name[-1])], found[name]["value"], found[name]["std"] or 0.0)
        for name in names
        if name in found
    ]
    return Answer(
        seed,
        result["verdict"],
        tuple(names),
        tuple(found),
        tuple(values),
        float(result["posterior"][0]["probability"]),
        float(result["error_db"][-1]["level"]),
        float(result["seconds"]),
        set(found) == set(names) and result["verdict"] == ("effect" if truth.soft else "nothing missing"),
    )


def short(effects: Sequence[str]) -> str:
    """Return names of effects for a table."""
    return ", ".join(name.replace("joint_stiffness:", "") for name in effects) or "nothing"


def run_bolts(out: Path, seeds: Sequence[int], table: Path | None) -> None:
    """Print and perhaps write the answers of some seeds."""
    rows: list[tuple[object, ...]] = []
    for seed in seeds:
        for hidden in (True, False):
            a = diagnose(out / f"bolts-{seed}-{'soft' if hidden else 'nothing'}", seed, hidden)
            true = ", ".join(f"{1e-6 * t:.2f}" for t, _, _ in a.values)
            value = ", ".join(f"{1e-6 * v:.2f} ± {1e-6 * std:.2f}" for _, v, std in a.values)
            names = [short(effects) for effects in (a.hidden, a.effects)]
            numbers = f"{100 * a.probability:.1f}", f"{a.level_db:.2f}", f"{a.seconds:.0f}"
            rows.append((seed, *names, true, value, *numbers, "yes" if a.right else "no"))
            print(*rows[-1], sep=" | ", flush=True)
    head = ("seed", "hidden", "found", "true [kN/mm]", "found [kN/mm]")
    head += ("probability [%]", "residual [dB]", "time [s]", "right")
    _write(table, head, rows)


MODELS = {
    "lines": "centre lines, mass of the block",
    "zones": "the same, rigid inside the block",
    "average": "corner as a superelement, faces tied on average",
    "rigid": "corner as a superelement, faces tied rigidly",
}
"""Models of the frame on a corner piece, in words."""


def run_corner(out: Path, table: Path | None) -> None:
    """Print and perhaps write how far each model of the frame is from CalculiX."""
    rows: list[tuple[object, ...]] = []
    for a in corner.compare(out / "corner", tuple(MODELS)):
        low, high = 100 * min(a.frequency), 100 * max(a.frequency)
        rows.append((MODELS[a.model], f"{low:+.2f} to {high:+.2f}", f"{a.all_db:.2f}"))
        print(*rows[-1], sep=" | ", flush=True)
    _write(table, ("model", "natural frequencies [%]", "FRFs [dB]"), rows)


def _write(table: Path | None, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    if table:
        with table.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([head, *rows])


def main() -> None:
    """Make and judge cases, as the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("bolts", "corner", "picture"))
    parser.add_argument("out", type=Path, help="folder of the studies")
    parser.add_argument("picture", type=Path, nargs="?", default=Path("parts.png"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--csv", type=Path)
    args = parser.parse_args()
    try:
        if args.what == "bolts":
            run_bolts(args.out, args.seeds, args.csv)
        elif args.what == "corner":
            run_corner(args.out, args.csv)
        else:
            from benchmarks.parts_ccx.picture import draw

            draw(args.out, args.picture)
    except CalculixError as reason:
        sys.exit(str(reason))


if __name__ == "__main__":
    main()
