"""Make fresh cases, drawn from a seed: python -m benchmarks.independent.foreign OUT --seed 1"""

import numpy as np

from benchmarks.independent.casefiles import NOISE, NOTHING, with_noise, write_files
from benchmarks.independent.foreign.draw import SHARES, draw, plans, which_are_real
from benchmarks.independent.foreign.generate import CODES, arguments, generate, name_of
from benchmarks.independent.foreign.real import AS_DESCRIBED, draw_instruments, in_truth, with_stated_masses
from benchmarks.independent.foreign.structure import nominal_of

REAL = 55
"""Number of the random stream that draws how tests really were."""


def write(out, bench, plan, seed, real=None, noise=NOISE):
    """Write a case and return its truth; ``real`` says that its test is not as described, None of no case."""
    name = name_of(seed, plan)
    rng = np.random.default_rng([seed, plan.number])
    hidden, things, told = draw(bench, plan, rng)
    nominal = nominal_of(name, bench.structure, rng)
    instruments = AS_DESCRIBED
    if real:
        own = np.random.default_rng([seed, plan.number, REAL])
        instruments = draw_instruments(bench.structure, own)
        nominal = with_stated_masses(nominal, instruments, own)
    H = with_noise(bench.accelerances(hidden, test=instruments), rng, noise)
    write_files(out / name, nominal, bench.structure.frequency, H)
    truth = {
        "code": CODES[bench.structure.code],
        "structure": plan.structure,
        "sort": sort_of([entry["kind"] for entry in told]),
        "effects": [thing.truth for thing in things] or [NOTHING],
        "shows": told,
    }
    if real is None:
        return truth
    db, left = bench.change_by_test(hidden, instruments)
    shows = {"kind": "test", "change_db": round(db, 2), "beyond_nuisances_db": round(left, 2)}
    of_test = {"test": "real" if real else "as described", "instruments": in_truth(instruments)}
    return truth | {"shows": [*told, shows]} | of_test


def sort_of(drawn):
    """Return the sort of a case by the kinds that were drawn in the end."""
    soft = [kind in ("soft_axis", "soft_axes") for kind in drawn]
    if len(drawn) < 2:
        return "one" if drawn else "nothing"
    return "connections" if all(soft) else "mixed" if any(soft) and "point_mass" in drawn else "two"


def main(argv=None):
    parser = arguments("benchmarks.independent.foreign", __doc__, cases=40)
    parser.add_argument(
        "--test",
        default="described",
        choices=["described", "real"],
        help="real: the tests of half of the cases are not as described (default: %(default)s)",
    )
    parser.add_argument("--sort", choices=SHARES, help="what every case hides; a mixture unless given")
    options = parser.parse_args(argv)
    shares = {options.sort: 1.0} if options.sort else SHARES
    real = which_are_real([options.seed, REAL], options.cases) if options.test == "real" else {}
    generate(
        options,
        plans(options.seed, options.cases, options.structures, shares),
        lambda bench, plan: write(options.out, bench, plan, options.seed, real.get(plan.number)),
    )


if __name__ == "__main__":
    main()
