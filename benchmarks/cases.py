"""CPU seconds, peak memory and verdicts of diagnoses, of one checkout or of two side by side.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.cases STUDIES... [--before CHECKOUT] [--limit 600]

STUDIES are study files or folders with them at any depth. Each runs in a process of its own.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Run:
    """What a diagnosis took [s, MB] and said; no seconds of one that did not end."""

    seconds: float | None
    memory: float
    found: str

    def __str__(self) -> str:
        took = "not ended" if self.seconds is None else f"{self.seconds:.1f}"
        return f"{took:>10s}{self.memory:7.0f}  {self.found}"


def diagnosed(checkout: Path, study: Path, limit: float) -> Run:
    """Return what a diagnosis by a checkout takes."""
    code = (
        "import resource, sys; from dovetail.cli import main; main(sys.argv[1:]); "
        "u = resource.getrusage(resource.RUSAGE_SELF); print(u.ru_utime + u.ru_stime, u.ru_maxrss / 1e3)"
    )
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "result.json")
        command = [sys.executable, "-c", code, "diagnose", str(study), "--json", str(out), "--processes", "1"]
        env = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command, cwd=checkout, env=env, capture_output=True, text=True, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            return Run(None, float("nan"), "")
        if not out.exists():
            return Run(None, float("nan"), done.stderr.strip().splitlines()[-1][:60])
        answer = json.loads(out.read_text(encoding="utf-8"))
        seconds, memory = map(float, done.stdout.split()[-2:])
        names = ", ".join(e["name"] for e in answer.get("effects", []))
        return Run(seconds, memory, names or answer["verdict"])


def studies(paths: list[Path]) -> list[Path]:
    """Return all study files."""
    return [s for p in paths for s in ([p] if p.is_file() else sorted(p.rglob("study.toml")))]


def main() -> None:
    """Print the table and its medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="+", type=Path)
    parser.add_argument("--before", type=Path, help="another checkout, run first on each study")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds of the clock for each")
    options = parser.parse_args()
    checkouts = [c.resolve() for c in (options.before, HERE) if c]
    print(f"{'':40s}" + "   ".join(f"{'CPU s':>10s}{'MB':>7s}  found" for _ in checkouts))
    rows = []
    for study in studies(options.studies):
        runs = [diagnosed(c, study.resolve(), options.limit) for c in checkouts]
        rows.append(runs)
        print(f"{study.parent.name:40s}" + "   ".join(map(str, runs)), flush=True)
    for k, column in enumerate(zip(*rows, strict=True)):
        took = [r.seconds for r in column if r.seconds is not None]
        if took:
            name = "now" if checkouts[k] == HERE else "before"
            print(
                f"{name}: {len(took)} of {len(column)} ended, median {statistics.median(took):.1f} s, "
                f"largest {max(took):.1f} s"
            )


if __name__ == "__main__":
    main()
