"""Make fresh cases of structures that no set had before: python -m tests.independent.foreign OUT --seed 1"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from tests.independent.casefiles import NOTHING, with_noise, write_files
from tests.independent.foreign.bench import Bench
from tests.independent.foreign.draw import draw, plans, which_are_real
from tests.independent.foreign.real import AS_DESCRIBED, draw_instruments, in_truth, with_stated_masses
from tests.independent.foreign.structure import NAMED, nominal_of, read

REAL = 55
"""Number of the random stream that draws how tests really were."""
CODES = {"solid": "scikit-fem, quadratic hexahedra", "beam": "OpenSees, Timoshenko beams"}


def write(out, bench, plan, seed, real=None):
    """Write a case and return its truth; ``real`` says that its test is not as described, None of no case."""
    name = name_of(seed, plan)
    rng = np.random.default_rng([seed, plan.number])
    hidden, things, told = draw(bench, plan, rng)
    nominal = nominal_of(name, bench.structure, rng)
    instruments, of_test = AS_DESCRIBED, {}
    if real:
        own = np.random.default_rng([seed, plan.number, REAL])
        instruments = draw_instruments(bench.structure, own)
        nominal = with_stated_masses(nominal, instruments, own)
    if real is not None:
        db, left = bench.change_by_test(hidden, instruments)
        shows = {"kind": "test", "change_db": round(db, 2), "beyond_nuisances_db": round(left, 2)}
        of_test = {"test": "real" if real else "as described", "instruments": in_truth(instruments)}
    H = with_noise(bench.accelerances(hidden, test=instruments), rng)
    write_files(out / name, nominal, bench.structure.frequency, H)
    return {
        "code": CODES[bench.structure.code],
        "structure": plan.structure,
        "sort": sort_of([entry["kind"] for entry in told]),
        "effects": [thing.truth for thing in things] or [NOTHING],
        "shows": told if real is None else [*told, shows],
    } | of_test


def sort_of(drawn):
    """Return the sort of a case by the kinds that were drawn in the end."""
    soft = [kind in ("soft_axis", "soft_axes") for kind in drawn]
    if len(drawn) < 2:
        return "one" if drawn else "nothing"
    return "connections" if all(soft) else "mixed" if any(soft) and "point_mass" in drawn else "two"


def name_of(seed, plan):
    """Return the name of a case, which says nothing of what it hides."""
    return f"{plan.structure}-{seed}-{plan.number:02d}"


def main(argv=None):
    usual = read()
    known = usual | {name: each for file in NAMED for name, each in read(file).items()}
    parser = argparse.ArgumentParser(prog="python -m tests.independent.foreign", description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the cases")
    parser.add_argument("--seed", type=int, default=1, help="draws everything (default: %(default)s)")
    parser.add_argument("--cases", type=int, default=40, help="how many (default: %(default)s)")
    parser.add_argument("--structures", nargs="+", default=list(usual), choices=list(known), metavar="NAME")
    parser.add_argument(
        "--test",
        default="described",
        choices=["described", "real"],
        help="real: the tests of half of the cases are not as described (default: %(default)s)",
    )
    options = parser.parse_args(argv)
    options.out.mkdir(parents=True, exist_ok=True)
    told = options.out / "truth.json"
    truth = json.loads(told.read_text(encoding="utf-8")) if told.exists() else {}
    wanted = plans(options.seed, options.cases, options.structures)
    real = which_are_real([options.seed, REAL], options.cases) if options.test == "real" else {}
    for structure in options.structures:  # one after another, so that its parts are reduced once
        bench = Bench(known[structure])
        for plan in (p for p in wanted if p.structure == structure):
            name = name_of(options.seed, plan)
            if name in truth:
                continue
            start = time.perf_counter()
            truth[name] = write(options.out, bench, plan, options.seed, real.get(plan.number))
            told.write_text(
                json.dumps(dict(sorted(truth.items())), indent=1, ensure_ascii=False), encoding="utf-8"
            )
            sys.stderr.write(f"{name}: {time.perf_counter() - start:.1f} s\n")


if __name__ == "__main__":
    main()
