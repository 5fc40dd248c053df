"""Make the cases of a seed, one structure after another, and go on after a run that was stopped."""

import argparse
import json
import sys
import time
from pathlib import Path

from benchmarks.independent.foreign.bench import Bench
from benchmarks.independent.foreign.structure import NAMED, read

CODES = {"solid": "scikit-fem, quadratic hexahedra", "beam": "OpenSees, Timoshenko beams"}


def name_of(seed, plan):
    """Return the name of a case, which says nothing of what it hides."""
    return f"{plan.structure}-{seed}-{plan.number:02d}"


def arguments(prog, description, cases):
    """Return a parser of what cases of every kind are made from."""
    usual = read()
    known = usual | {name: each for file in NAMED for name, each in read(file).items()}
    parser = argparse.ArgumentParser(prog=f"python -m {prog}", description=description)
    parser.add_argument("out", type=Path, help="folder of the cases")
    parser.add_argument("--seed", type=int, default=1, help="draws everything (default: %(default)s)")
    parser.add_argument("--cases", type=int, default=cases, help="how many (default: %(default)s)")
    parser.add_argument("--structures", nargs="+", default=list(usual), choices=list(known), metavar="NAME")
    parser.set_defaults(known=known)
    return parser


def generate(options, plans, write):
    """Write cases and truth.json; ``write(bench, plan)`` writes one and returns its truth."""
    options.out.mkdir(parents=True, exist_ok=True)
    told = options.out / "truth.json"
    truth = json.loads(told.read_text(encoding="utf-8")) if told.exists() else {}
    for structure in options.structures:  # one after another, so that its parts are reduced once
        bench = Bench(options.known[structure])
        for plan in (p for p in plans if p.structure == structure):
            name = name_of(options.seed, plan)
            if name in truth:
                continue
            start = time.perf_counter()
            truth[name] = write(bench, plan)
            told.write_text(
                json.dumps(dict(sorted(truth.items())), indent=1, ensure_ascii=False), encoding="utf-8"
            )
            sys.stderr.write(f"{name}: {time.perf_counter() - start:.1f} s\n")
