"""What halving and doubling each constant of the priors changes: python -m benchmarks.prior_sensitivity

Each case is searched once. Then its best hypotheses are fitted again with one constant at half and at twice
its value, and put in order anew: the search itself is not repeated. A row says in which cases another
hypothesis is the best one then, and the mean probability of the answer that was the best before.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.evidence_cases import searched
from benchmarks.independent.table import CASES, hidden_effects
from updating.diagnosis.evidence import Fits, ScoredFit, Searched, values_of
from updating.inference import belief, unknowns

FACTORS = 0.5, 2.0
OF_THE_FORM = {
    "FORM_SECTION": ("section_form",),
    "FORM_CORNER, FORM_JOINT": ("zone_form",),
    "FORM_CLAMP": ("clamp_form",),
}
"""Constants that are standard deviations of the form's parameters, by kinds of effect."""
MISSING = "MISSING"
"""Its factor is one of the odds: twice 0.5 would leave nothing open."""
PLAIN = (
    "DATA_PER_MODE",
    "FORM_DAMPING",
    "FORM_MODES",
    "EFFECT_ODDS",
    "UNKNOWN_ODDS",
    "DISCREPANCY_MAX",
    "DISCREPANCY_MIN",
    "DECADE",
)
N_AGAIN, WITHIN = 8, 25.0
"""So many hypotheses at most are fitted again, of those within so many nats of the best one."""


@dataclass(frozen=True)
class Answer:
    """The best hypothesis of a case with some constants."""

    best: frozenset[str]
    probability: float


def value_of(name: str) -> Any:
    """Return a constant of the priors."""
    return getattr(belief if hasattr(belief, name) else unknowns, name)


@contextmanager
def constant(name: str, value: Any) -> Iterator[None]:
    """Give a constant of the priors another value in every module that has imported it."""
    modules = [m for key, m in list(sys.modules.items()) if key.startswith("updating.") and hasattr(m, name)]
    before = value_of(name)
    for m in modules:
        setattr(m, name, value)
    try:
        yield
    finally:
        for m in modules:
            setattr(m, name, before)


def with_form(fits: Fits, name: str, factor: float) -> Fits:
    """Return fits whose form is less or more certain."""
    kinds = {e.name for e in fits.problem.reduced.model.effects if e.kind in OF_THE_FORM[name]}
    nuisances = tuple(
        replace(n, std=factor * n.std) if n.effect in kinds else n for n in fits.problem.nuisances
    )
    return replace(fits, problem=replace(fits.problem, nuisances=nuisances))


def with_odds(fits: Fits, factor: float) -> Fits:
    """Return fits with other odds that something is missing."""
    odds = replace(fits.odds, something=fits.odds.something - float(np.log(factor)))
    return replace(fits, odds=odds)


def again(done: Searched, fits: Fits) -> Answer:
    """Return the answer among the best hypotheses and none, fitted again."""
    known = sorted(done.search.known.values(), key=lambda h: -h.score)
    kept = [h for h in known if h.score > known[0].score - WITHIN][:N_AGAIN]
    nothing = done.search.known[frozenset()]
    kept += [] if nothing in kept else [nothing]
    fitted: list[ScoredFit] = [fits.fully(h.effects, values_of(h.effects), h) for h in kept]
    best = max(fitted, key=lambda h: h.score)
    scores = np.array([*(h.score for h in fitted), done.search.unknown(best)])
    before = next(h for h in fitted if h.key == known[0].key)
    return Answer(best.key, float(np.exp(before.score - np.logaddexp.reduce(scores))))


def variants() -> Iterator[tuple[str, float]]:
    """Yield each constant with each factor."""
    for name in (*OF_THE_FORM, MISSING, *PLAIN):
        for factor in FACTORS:
            yield name, factor


def of_case(case: Path) -> dict[tuple[str, float], Answer]:
    """Return the answers of a case by constant and factor; ("", 1) stands for the constants as they are."""
    done = searched(case, "sensitivity")
    fits = done.search.fits
    out = {("", 1.0): again(done, fits)}
    for name, factor in variants():
        if name in OF_THE_FORM:
            out[name, factor] = again(done, with_form(fits, name, factor))
        elif name == MISSING:
            out[name, factor] = again(done, with_odds(fits, factor))
        else:
            value = value_of(name)
            with constant(
                name, tuple(np.multiply(factor, value)) if isinstance(value, tuple) else factor * value
            ):
                out[name, factor] = again(done, fits)
    return out


def main() -> None:
    """Print a row for each constant and factor."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=Path, default=CASES)
    parser.add_argument("--only", nargs="*", default=[""])
    options = parser.parse_args()
    truth = json.loads((options.cases / "truth.json").read_text(encoding="utf-8"))
    answers = {}
    for path in sorted(options.cases.glob("*/nominal.json")):
        case = path.parent
        if any(text in case.name for text in options.only):
            start = time.process_time()
            answers[case.name] = of_case(case)
            n_hidden = len(hidden_effects(truth[case.name], json.loads(path.read_text(encoding="utf-8")))[0])
            first = answers[case.name]["", 1.0]
            print(
                f"{case.name}: {n_hidden} hidden, best {sorted(first.best) or 'nothing'} "
                f"{first.probability:.2f}, {time.process_time() - start:.0f} s",
                file=sys.stderr,
                flush=True,
            )
    print("| constant | factor | other answer | mean probability of the answer before |\n|---|---|---|---|")
    for key in (("", 1.0), *variants()):
        other = [n for n, a in answers.items() if a[key].best != a["", 1.0].best]
        found = [f"{n}: {', '.join(sorted(answers[n][key].best)) or 'nothing'}" for n in other]
        mean = np.mean([a[key].probability for a in answers.values()])
        print(f"| `{key[0] or 'as they are'}` | {key[1]} | {'; '.join(found) or 'none'} | {mean:.3f} |")


if __name__ == "__main__":
    main()
