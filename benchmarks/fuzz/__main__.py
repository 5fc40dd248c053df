"""Feed damaged files to the readers.

python -m benchmarks.fuzz --minutes 10 --seed 3
python -m benchmarks.fuzz --count 2000 --formats inp,bdf
python -m benchmarks.fuzz --replay out/fuzz/inp-TypeError-17.inp --formats inp
"""

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from benchmarks.fuzz import worker
from benchmarks.fuzz.targets import TARGETS


def main() -> int:
    """Run what is asked for; return 1 if an input got no answer."""
    parser = argparse.ArgumentParser(
        "python -m benchmarks.fuzz", description="Feed damaged files to the readers."
    )
    parser.add_argument("--count", type=int, default=50_000, help="inputs for each format (default 50000)")
    parser.add_argument("--minutes", type=float, help="time for all formats together; ends before the count")
    parser.add_argument("--seed", type=int, default=1, help="what the inputs are drawn from (default 1)")
    parser.add_argument("--formats", default=",".join(TARGETS), help=f"of {', '.join(TARGETS)}")
    parser.add_argument(
        "--out", type=Path, default=Path("out/fuzz"), help="folder for inputs that got no answer"
    )
    parser.add_argument("--replay", type=Path, help="read this one file with the reader of the format")
    options = parser.parse_args()
    names = options.formats.split(",")
    unknown = [name for name in names if name not in TARGETS]
    if unknown:
        parser.error(f"there is no format '{unknown[0]}'; allowed are {', '.join(TARGETS)}")
    if options.replay:
        TARGETS[names[0]].read(options.replay)
        return 0
    failed = 0
    for name in names:
        failed += _format(name, options, len(names))
    return 1 if failed else 0


def _format(name: str, options: argparse.Namespace, n: int) -> int:
    target = TARGETS[name]
    begun = time.monotonic()
    until = begun + 60 * options.minutes / n if options.minutes else float("inf")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        seeds = target.seeds(folder)
        for k, data in enumerate(seeds):
            (folder / target.file).write_bytes(data)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    target.read(folder / target.file)
            except Exception as reason:
                print(f"{name}: its own seed {k} is not read: {reason!r}")
                return 1
        show = (lambda at: print(f"\r{name}: {at}", end="", flush=True)) if sys.stdout.isatty() else None
        done, failures = worker.run(
            target, seeds, options.seed, options.count, folder, until=until, progress=show
        )
    print(
        f"\r{name}: {done} inputs in {time.monotonic() - begun:.0f} s, {len(failures)} without an answer",
        flush=True,
    )
    kinds = Counter((f.what.split(":")[0], f.where) for f in failures)
    for (what, where), number in kinds.most_common():
        first = next(f for f in failures if (f.what.split(":")[0], f.where) == (what, where))
        options.out.mkdir(parents=True, exist_ok=True)
        kept = options.out / f"{name}-{what.split()[0]}-{first.index}{Path(target.file).suffix}"
        kept.write_bytes(worker.input_of(target, seeds, options.seed, first.index))
        print(f"  {number:5d}  {first.what}  {where}  {kept}")
    return len(failures)


if __name__ == "__main__":
    sys.exit(main())
