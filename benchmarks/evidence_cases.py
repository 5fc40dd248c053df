"""Diagnose cases of other codes by evidence: python -m benchmarks.evidence_cases

Prints for each case the truth, the most probable model, its probability, errors, and the score of the
truth where a fit begins at it: below that of the answer information is lost, above it the search has lost it.
"""

import argparse
import json
import sys
import time
from pathlib import Path

from benchmarks.independent.by_evidence import stated
from benchmarks.independent.convert import convert
from benchmarks.independent.table import CASES, hidden_effects, hidden_in_words
from benchmarks.validation.evidence import at_truth, decibels
from dovetail import load_study
from dovetail.file import without_held_out
from dovetail.file.contents import measured
from updating.diagnosis.evidence import prepare_search, search_of_problem
from updating.diagnosis.evidence import searched as run_search


def searched(case, folder, say=lambda text: None):
    """Return the search of a case, whose study is written into a folder."""
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    path = Path("out") / folder / case.name / "study.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(convert(nominal, case, path), encoding="utf-8")
    study = load_study(path)
    prepared = prepare_search(
        study.model,
        without_held_out(study, measured(study)[0]),
        study.nuisances,
        damping_std=study.damping_std,
        band=study.band,
        kinds=study.kinds,
        exclude=study.exclude,
        model_error=study.model_error,
    )
    return run_search(
        search_of_problem(*prepared, progress=lambda text, _: say(text)), lambda text, _: say(text)
    )


def one(case, truth, say):
    start = time.process_time()
    done = searched(case, "ev", say)
    seconds = time.process_time() - start
    search, best = done.search, done.best
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    hidden, faults = hidden_effects(truth, nominal)
    words = hidden_in_words(hidden, faults)
    started = at_truth(search, stated(hidden))
    about = "not in library" if started is None else f"{started.score - best.score:+.1f}"
    print(" | ".join((case.name, words, *summary(done), f"truth {about}", f"{seconds:.0f} s")), flush=True)
    for h in sorted(search.known.values(), key=lambda h: -h.score)[:5]:
        print(f"      {h.score - best.score:8.1f} {decibels(h.fitted.level):.2f} dB {h.name}", flush=True)


def summary(done):
    """Return what was found, how probable that is, and what is left."""
    search, best = done.search, done.best
    nothing = search.known[frozenset()]
    floor = decibels(search.fits.floor)
    faults = ", ".join(f"{f.kind} {f.sensor}" for f in done.faults) or "no faults"
    return (
        f"{best.name}; {faults}",
        f"p {done.probability(best):.2f}, of the places {done.probability_there(best):.2f}",
        f"unknown {done.unknown - best.score:+.1f}",
        f"{decibels(nothing.fitted.level):.2f} > {decibels(best.fitted.level):.2f} (floor {floor:.2f}) dB",
        f"gain {best.score - nothing.score:.1f}",
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=Path, default=CASES)
    parser.add_argument("--only", default="")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    truth = json.loads((options.cases / "truth.json").read_text(encoding="utf-8"))
    say = (
        (lambda text: print(f"{time.process_time():.1f} {text}", file=sys.stderr, flush=True))
        if options.verbose
        else (lambda text: None)
    )
    for path in sorted(options.cases.glob("*/nominal.json")):
        case = path.parent
        if options.only in case.name:
            one(case, truth[case.name], say)


if __name__ == "__main__":
    main()
