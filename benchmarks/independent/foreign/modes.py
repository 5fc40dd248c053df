"""Cases of measured modes: one state or two: python -m benchmarks.independent.foreign.modes OUT --seed 1"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.independent.casefiles import NOTHING, write_nominal
from benchmarks.independent.foreign import kinds
from benchmarks.independent.foreign.bench import NUISANCE, Hidden
from benchmarks.independent.foreign.draw import KINDS_TRIED, TRIES, Deck
from benchmarks.independent.foreign.generate import CODES, arguments, generate, name_of
from benchmarks.independent.foreign.structure import nominal_of

FEWEST, MOST = 8, 15
"""Modes that a test gives."""
RIGID = 1.0
"""Modes below this are those of a body in soft cords [Hz]."""
SEEN = 0.05
"""A mode is measured where its largest residue is this share of the median of all in the band [-]."""
FREQUENCY_STD = 0.001, 0.005
"""Noise of natural frequencies, drawn for each case [-]."""
OF_STATES = 0.2
"""Noise of two states over that of one: repeats of one set-up [-]."""
ZETA_STD, SHAPE_STD = 0.1, 0.03
"""Noise of damping ratios, and of a shape's component over the root mean square of the shape [-]."""
CLEAR, CLEAR_STATES, MOST_CHANGE = 0.01, 3.0, 0.15
"""The rms change of natural frequencies: least beyond nuisances [-], of two states over noise; most [-]."""
OFF = 0.03, 0.10
"""How far a frequency that was misread is off [-]."""
APART = 0.01
"""A mode that does not exist is at least this far from all others [-]."""
OF_ONE_STATE = (
    *kinds.CONNECTIONS, *kinds.GEOMETRY, kinds.point_mass, kinds.rotary_inertia, kinds.notch,
    kinds.member_stiffness, kinds.member_density, kinds.member_section, kinds.rod_preload,
    kinds.ground_spring,
)  # fmt: skip
"""Kinds that change natural frequencies."""
OF_TWO_STATES = (
    *kinds.CONNECTIONS, kinds.settled_elsewhere, kinds.point_mass, kinds.rotary_inertia, kinds.notch,
    kinds.member_stiffness, kinds.rod_preload, kinds.ground_spring,
)  # fmt: skip
"""Kinds that come about between two tests."""
IN_BOTH = kinds.ground_spring, kinds.point_mass, kinds.soft_axis
"""What the model of a poor baseline lacks in both states."""


@dataclass(frozen=True)
class Plan:
    """A case before its strengths are drawn."""

    number: int
    structure: str
    states: int
    kind: object
    shapes: bool
    planar: bool
    bad: str
    poor: object


def plans(seed, n, structures):
    """Return n plans; those of a larger n begin with the same.

    Of five cases one hides nothing and two have a baseline; of four one has a bad reading; of three baselines
    one is poor; half have shapes, and half have sensors along the force's direction alone.
    """
    streams = np.random.default_rng([seed, FEWEST]).spawn(9)
    structure, states = Deck(structures, streams[0]), Deck((1, 1, 1, 2, 2), streams[1])
    hides = {s: Deck((True, True, True, True, False), streams[1 + s]) for s in (1, 2)}
    changes = {1: Deck(OF_ONE_STATE, streams[4]), 2: Deck(OF_TWO_STATES, streams[4])}
    shapes, planar = (Deck((True, False), streams[k]) for k in (5, 6))
    bad = Deck(("misread", "spurious", *[""] * 6), streams[7])
    poor, lacking = Deck((True, False, False), streams[8]), Deck(IN_BOTH, streams[8])
    out = []
    for number in range(1, n + 1):
        of = states.draw()
        kind = changes[of].draw() if hides[of].draw() else None
        lacks = lacking.draw() if of == 2 and poor.draw() else None
        out.append(Plan(number, structure.draw(), of, kind, shapes.draw(), planar.draw(), bad.draw(), lacks))
    return out


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a state at all sensors of a structure: frequencies [Hz], damping ratios, shapes (n_out, n)."""

    frequency: np.ndarray
    zeta: np.ndarray
    shapes: np.ndarray

    def at(self, chosen):
        return Modes(self.frequency[chosen], self.zeta[chosen], self.shapes[:, chosen])


def elastic(bench, hidden, nuisance=None):
    """Return the modes in the band."""
    key = repr((hidden, nuisance))
    if key not in bench.known:
        bench.known[key] = Modes(*bench.modes(hidden, nuisance))
    f = bench.known[key].frequency
    return bench.known[key].at((f > RIGID) & (f < bench.structure.frequency[-1]))


def change_of(before, after):
    """Return ln f after over before for each mode before; partners have like shapes and are near.

    A mode that left the band has none: NaN.
    """
    a, b = (m.shapes / np.linalg.norm(m.shapes, axis=0) for m in (before, after))
    moved = np.log(after.frequency[None] / before.frequency[:, None])
    rows, columns = linear_sum_assignment(1 - (a.T @ b) ** 2 + 2 * np.abs(moved))
    out = np.full(len(before.frequency), np.nan)
    out[rows] = moved[rows, columns]
    return out


def shows(bench, thing, beside, test):
    """Return the rms change of measured natural frequencies by a thing beside others, and beyond nuisances.

    Nuisances take part with a standard deviation each, as in `Bench.left`, against 0.1 % of noise.
    """
    before = elastic(bench, beside)
    change = change_of(before, elastic(bench, beside | thing.hidden))
    steps = NUISANCE | {c.name: 0.1 for c in bench.structure.joints}
    X = np.array(
        [
            change_of(before, elastic(bench, beside, {key: 1 + s}))
            for key, s in steps.items()
            if key != "damping"
        ]
    ).T
    some = np.isfinite(change) & np.isfinite(X).all(axis=1) & test.sees(before)
    d, X = change[some], X[some]
    c = np.linalg.solve(X.T @ X / 1e-6 + np.eye(X.shape[1]), X.T @ d / 1e-6)
    return float(np.sqrt(np.mean(d**2))), float(np.sqrt(np.mean((d - X @ c) ** 2)))


@dataclass(frozen=True, eq=False)
class Test:
    """A test by one force: rows of its sensors, that of the force among all, number of modes, noise [-]."""

    __test__ = False  # pytest
    rows: np.ndarray
    driven: int
    n_modes: int
    std: float

    def sees(self, modes):
        """Return whether each mode is measured: in the band, with a residue, not beyond the last one."""
        residue = np.abs(modes.shapes[self.rows]).max(axis=0) * np.abs(modes.shapes[self.driven])
        seen = residue > SEEN * np.median(residue)
        return seen & (np.cumsum(seen) <= self.n_modes)


def drawn_test(bench, plan, rng):
    """Return a test that measures at least `FEWEST` modes where nothing is hidden."""
    channels = bench.structure.channels
    driven = int(rng.integers(len(bench.structure.excitations)))
    modes, n_modes = elastic(bench, Hidden()), int(rng.integers(FEWEST, MOST + 1))
    std = float(np.exp(rng.uniform(*np.log(FREQUENCY_STD)))) * (OF_STATES if plan.states == 2 else 1.0)
    names = [s["name"] for s in channels]
    tests = []
    for k in range(len(bench.structure.excitations)):
        force = names.index(bench.structure.excitations[(driven + k) % len(bench.structure.excitations)])
        along = [i for i, s in enumerate(channels) if s["direction"] == channels[force]["direction"]]
        tests.append(
            Test(np.array(along if plan.planar else range(len(names))), force, n_modes, round(std, 6))
        )
    tests += [Test(np.arange(len(names)), t.driven, n_modes, t.std) for t in tests]
    return next((t for t in tests if t.sees(modes).sum() >= FEWEST), tests[-1])


def drawn(bench, kind, choices, before, test, states, rng):
    """Return a thing that shows clearly, of a kind or of another where it has no place, and how much."""
    least = CLEAR_STATES * test.std if states == 2 else max(CLEAR, 2 * test.std)
    beside = Hidden()
    for other in before:
        beside |= other.hidden
    others = [choices[i] for i in rng.permutation(len(choices))]
    for each, _ in itertools.product((kind, *others[:KINDS_TRIED]), range(TRIES)):
        thing = each(bench, rng)
        if thing is None or any(thing.where == other.where for other in before):
            continue
        change, left = shows(bench, thing, beside, test)
        if left >= least and change <= MOST_CHANGE:
            told = {"kind": each.__name__, "change": round(change, 5), "beyond_nuisances": round(left, 5)}
            return thing, told
    msg = f"nothing of {len(others)} kinds shows in {bench.structure.name}"
    raise ValueError(msg)


def measured(bench, hidden, test, rng):
    """Return the modes that a test gives, with noise: columns of a table and the shapes (n_out, n)."""
    modes = elastic(bench, hidden)
    modes = modes.at(test.sees(modes))
    f = modes.frequency * (1 + test.std * rng.standard_normal(len(modes.frequency)))
    zeta = modes.zeta * (1 + ZETA_STD * rng.standard_normal(len(f)))
    shapes = modes.shapes[test.rows]
    size = np.sqrt((shapes**2).mean(axis=0))
    return Modes(f, np.maximum(zeta, 1e-5), shapes + SHAPE_STD * size * rng.standard_normal(shapes.shape))


def spoilt(modes, how, rng):
    """Return modes with a bad reading, in rising order, and what truth.json says of it."""
    f = modes.frequency
    if how == "misread":
        k = int(rng.integers(len(f)))
        off = kinds.either(rng, *OFF)
        told = {"kind": how, "true_Hz": round(float(f[k]), 4), "read_Hz": round(float(f[k] * (1 + off)), 4)}
        f = np.where(np.arange(len(f)) == k, f * (1 + off), f)
        new = Modes(f, modes.zeta, modes.shapes)
    else:
        while True:
            extra = float(np.exp(rng.uniform(*np.log(f[[0, -1]]))))
            if np.abs(np.log(f / extra)).min() > APART:
                break
        told = {"kind": how, "read_Hz": round(extra, 4)}
        shape = rng.standard_normal((len(modes.shapes), 1)) * np.median(np.abs(modes.shapes))
        zeta = np.append(modes.zeta, np.median(modes.zeta) * rng.uniform(0.5, 2))
        new = Modes(np.append(f, extra), zeta, np.hstack([modes.shapes, shape]))
    return new.at(np.argsort(new.frequency)), told


def table(modes, std, names):
    """Return a table of modes as a study reads it, with columns of shapes for some names."""
    head = ["frequency [Hz]", "zeta", "frequency_std", "zeta_std", *(["shape_std"] if names else []), *names]
    lines = [", ".join(head)]
    for k, f in enumerate(modes.frequency):
        cells = [f"{f:.4f}", f"{modes.zeta[k]:.5f}", f"{std:g}", f"{ZETA_STD:g}"]
        cells += [f"{SHAPE_STD:g}", *(f"{x:.5g}" for x in modes.shapes[:, k])] if names else []
        lines.append(", ".join(cells))
    return "\n".join(lines) + "\n"


def write(out, bench, plan, seed):
    """Write a case and return its truth."""
    name, structure = name_of(seed, plan), bench.structure
    rng = np.random.default_rng([seed, plan.number, FEWEST])
    test, both, told, before = drawn_test(bench, plan, rng), Hidden(), [], []
    if plan.poor:
        thing, how = drawn(bench, plan.poor, IN_BOTH, [], test, 1, rng)
        both, before = thing.hidden, [thing]
        told.append(how | {"in": "both states"})
    hidden, things = both, []
    if plan.kind:
        choices = OF_ONE_STATE if plan.states == 1 else OF_TWO_STATES
        thing, how = drawn(bench, plan.kind, choices, before, test, plan.states, rng)
        hidden, things = both | thing.hidden, [thing]
        told.append(how)
    nominal = nominal_of(name, structure, rng)
    channels, force = structure.channels, structure.channels[test.driven]["name"]
    files = {"baseline.csv": both, "modes.csv": hidden} if plan.states == 2 else {"modes.csv": hidden}
    nominal = {key: value for key, value in nominal.items() if key not in ("frequency", "response")}
    nominal |= {
        "sensors": [channels[i] for i in test.rows], "excitations": [{"sensor": force}], "files": list(files)
    }  # fmt: skip
    nominal["points"] = {
        key: xyz for key, xyz in nominal["points"].items()
        if key in {str(s["node"]) for s in nominal["sensors"]} | {c.name for c in structure.supports}
    }  # fmt: skip
    write_nominal(out / name, nominal)
    readings, spoil = [], str(rng.choice(list(files)))
    for file, state in files.items():
        modes = measured(bench, state, test, rng)
        if plan.bad and file == spoil:
            modes, reading = spoilt(modes, plan.bad, rng)
            readings.append({"file": file} | reading)
        names = [s["name"] for s in nominal["sensors"]] if plan.shapes else []
        (out / name / file).write_text(table(modes, test.std, names), encoding="utf-8")
    every = elastic(bench, hidden)
    seen = test.sees(every)
    missed = every.frequency[~seen & (every.frequency < every.frequency[seen].max())]
    return {
        "code": CODES[structure.code],
        "structure": plan.structure,
        "sort": "states" if plan.states == 2 else "modes with shapes" if plan.shapes else "modes",
        "effects": [thing.truth for thing in things] or [NOTHING],
        "both_states": [thing.truth for thing in before],
        "readings": readings,
        "missed_Hz": missed.round(3).tolist(),
        "planar": len(test.rows) < len(channels),
        "shapes": plan.shapes,
        "shows": told,
    }


def main(argv=None):
    options = arguments("benchmarks.independent.foreign.modes", __doc__, cases=30).parse_args(argv)
    generate(
        options,
        plans(options.seed, options.cases, options.structures),
        lambda bench, plan: write(options.out, bench, plan, options.seed),
    )


if __name__ == "__main__":
    main()
