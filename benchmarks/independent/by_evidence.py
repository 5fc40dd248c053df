"""Diagnose a study of a case and start it at the truth: python -m benchmarks.independent.by_evidence

The truth is read when the diagnosis has ended. It writes result.json, as `dovetail run`, and record.json, as
`benchmarks.validation`.
"""

import argparse
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.independent import table
from benchmarks.validation.evidence import Stated, assess
from dovetail import load_study
from dovetail.disk.output import write_json
from dovetail.pipeline import analyse
from dovetail.result import result_dict

SOFT_KINDS = "joint_stiffness", "support_flexibility"
RESULT, RECORD = "result.json", "record.json"


def as_found(effect):
    """Return an effect of the program as result.json has it."""
    parameters = [{"name": p.name, "value": float(p.value), "unit": p.unit} for p in effect.parameters()]
    return {"kind": effect.kind, "where": effect.where, "parameters": parameters, "twins": []}


def stated(effects):
    """Return the ways in which the library can state hidden effects, each a list."""
    ways = [[]]
    for h in effects:
        own = ways_of(h)
        ways = [[*way, *more] for way in ways for more in own]
    return ways


def ways_of(hidden):
    """Return the ways in which the library can state one hidden effect."""
    if isinstance(hidden, table.HiddenConnection):
        return connection_ways(hidden)
    if isinstance(hidden, table.HiddenMove):
        return [[Stated(hidden.kinds, lambda e: hidden.is_at(as_found(e)), lambda e: moved(hidden, e))]]
    return [[Stated(hidden.kinds, lambda e: hidden.is_at(as_found(e)), lambda e: values_of(hidden, e))]]


def values_of(hidden, effect):
    """Return the true values of a candidate's parameters, as far as the truth states them in their unit."""
    first, out = effect.parameters()[0], {}
    if hidden.value is not None and hidden.unit == first.unit:
        out[first.name] = hidden.value
    return out if hidden.position is None else out | {"position": hidden.position}


def moved(hidden, effect):
    """Return how far a point of action is off, along the member or in the candidate's direction across it."""
    if np.ndim(hidden.value):
        return {"amount": float(np.dot(hidden.value, effect.across))}
    return {"amount": float(hidden.value)}


def connection_ways(hidden):
    """Return one stiffness for each direction, or with a loss factor a complex one or that of the joint."""

    def names(effect):
        return set(effect.where.replace(",", " ").split()) - table.WORDS

    def in_direction(d, kinds, values):
        return Stated(kinds, lambda e: names(e) == {hidden.place, d}, lambda e: values)

    soft = [in_direction(d, SOFT_KINDS, {"stiffness": k}) for d, k in hidden.stiffness.items()]
    if hidden.loss_factor is None:
        return [soft]
    lossy = Stated(
        tuple(table.LOSSY),
        lambda e: names(e) - table.DIRECTIONS == {hidden.place},
        lambda e: {e.parameters()[0].name: hidden.loss_factor},
    )
    whole = [
        in_direction(d, ("joint_complex_stiffness",), {"stiffness": k, "loss_factor": hidden.loss_factor})
        for d, k in hidden.stiffness.items()
    ]
    return [whole, [*soft, lossy]]


def judged(case, truth, nominal, done, result, diagnosis):
    """Return the record of a case, whose truth may be one that is not understood."""
    record = table.about(case, truth) | {"verdict": result["verdict"], "found": table.in_words(result)}
    try:
        effects, faults = table.hidden_effects(truth, nominal)
    except table.NOT_UNDERSTOOD:
        return record

    def is_right(chosen):
        found = [as_found(e) for e in chosen]
        verdict = "effect" if found else "measurement fault" if result["faults"] else "nothing missing"
        said = {"verdict": verdict, "effects": found, "faults": result["faults"]}
        return table.judge_case(truth, nominal, said) == table.YES

    outcome = table.judge_case(truth, nominal, result)
    plain = table.without_test(result, truth.get("instruments", {}), nominal)
    evidence = assess(
        done,
        diagnosis,
        outcome == table.YES,
        table.faults_are(faults, plain["faults"]),
        stated(effects),
        is_right,
    )
    hidden = table.hidden_in_words(effects, faults)
    return record | {"hidden": hidden, "outcome": outcome, "evidence": evidence}


def diagnosed(study, out):
    """Return the diagnosis of a study by its FRFs or its modes, and result.json."""
    run = analyse(study, out, lambda text, done: None)
    return run.diagnosis, result_dict(run)


def completed(result):
    """Return result.json with what that of modes lacks beside that of FRFs."""
    effects = [{"twins": []} | e for e in result["effects"]]
    return {"faults": [], "error_db": []} | result | {"effects": effects}


def main(argv=None):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.independent.by_evidence", description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("case", type=Path, help="folder with nominal.json; truth.json is beside it")
    parser.add_argument("out", type=Path, help="folder of result.json and record.json")
    parser.add_argument("--cap", type=int, help="seconds of the processor after which SIGXCPU ends this")
    options = parser.parse_args(argv)
    most = resource.getrlimit(resource.RLIMIT_CPU)
    if options.cap is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (options.cap, most[1]))
    study = load_study(options.study)
    begun = time.process_time()
    diagnosis, told_of_it = diagnosed(study, options.out)
    seconds = time.process_time() - begun
    resource.setrlimit(resource.RLIMIT_CPU, most)  # the start at the truth is not what is measured
    options.out.mkdir(parents=True, exist_ok=True)
    write_json(options.out / RESULT, completed(told_of_it))
    result = json.loads((options.out / RESULT).read_text(encoding="utf-8"))
    told = options.case.parent / "truth.json"
    truth = json.loads(told.read_text(encoding="utf-8")).get(options.case.name) if told.exists() else None
    if truth is not None:
        nominal = json.loads((options.case / "nominal.json").read_text(encoding="utf-8"))
        record = judged(options.case.name, truth, nominal, diagnosis.searched, result, diagnosis)
        write_json(options.out / RECORD, record | {"cpu_seconds": seconds})
    return 0


if __name__ == "__main__":
    sys.exit(main())
