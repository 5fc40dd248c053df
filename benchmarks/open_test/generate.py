"""Generate the cases of a set, before `take`: python -m benchmarks.open_test.generate practice|sealed OUT

It runs where OpenSees, scikit-fem and pyuff are installed (make peers). The practice set has a seed that
everybody knows; that of the sealed set is read from a file which its keeper has.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.independent.foreign.__main__ import REAL, write
from benchmarks.independent.foreign.draw import plans, which_are_real
from benchmarks.independent.foreign.generate import generate
from benchmarks.independent.foreign.structure import NAMED, OPEN, read

SHARES = {"nothing": 0.2, "outside": 0.2, "one": 0.3, "connections": 0.1, "mixed": 0.05, "two": 0.15}
"""How often cases hide nothing, an effect outside the kinds of the test, one, two soft connections, a soft
connection and a mass, any two."""
NOISE_RANGE = 0.003, 0.03
"""Relative noise of FRFs, uniform in its logarithm [-]."""
NOISE = 56
"""Number of the random stream that draws noise levels."""
N_CASES = 48
PRACTICE_SEED = 7148
PRACTICE = (
    "portal", "tframe", "bed", "rack", "tee", "yoke", "stool", "coatstand", "mast", "bay", "gantry", "jib",
    "truss", "stand", "barrow", "walker",
)  # fmt: skip
"""Structures that other sets have used up: eight of solids, eight of beams, three cases each."""


def main(argv=None):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.open_test.generate", description=__doc__)
    parser.add_argument("set", choices=("practice", "sealed"))
    parser.add_argument("out", type=Path, help="folder of the generated cases, with their truth")
    parser.add_argument("--seed-file", type=Path, help="of the sealed set: a file with an integer")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="write the cases of some structures")
    options = parser.parse_args(argv)
    if options.set == "sealed":
        if options.seed_file is None:
            parser.error("the sealed set has a seed of its keeper: --seed-file is needed")
        options.seed, names = int(options.seed_file.read_text(encoding="utf-8")), tuple(read(OPEN))
    else:
        options.seed, names = PRACTICE_SEED, PRACTICE
    options.known = read() | {name: each for file in NAMED for name, each in read(file).items()}
    options.structures = [name for name in names if name in (options.only or names)]
    real = which_are_real([options.seed, REAL], N_CASES)

    def written(bench, plan):
        low, high = np.log(NOISE_RANGE)
        noise = float(np.exp(np.random.default_rng([options.seed, plan.number, NOISE]).uniform(low, high)))
        truth = write(options.out, bench, plan, options.seed, real[plan.number], noise)
        return truth | {"noise": round(noise, 5)}

    generate(options, plans(options.seed, N_CASES, names, SHARES), written)


if __name__ == "__main__":
    main()
