"""How often hypotheses are as true as they are probable: python -m benchmarks.independent.reliability OUT ...

Each OUT is a folder of `table`. Every hypothesis of each posterior counts, "nothing missing" included, from
0.1 % on; those that all say what is hidden count as one. They are judged as answers are, by kinds and places,
without positions along members. The truth is beside the data that a study names.
"""

import argparse
import json
import sys
import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.independent import table
from benchmarks.independent.by_evidence import as_found
from benchmarks.validation.calibration import Share
from dovetail import load_study
from updating import propose
from updating.diagnosis.evidence import UNKNOWN
from updating.diagnosis.evidence.diagnosis import AS_READ

EDGES = np.linspace(0.0, 1.0, 11)
LEAST = 1e-3
"""Hypotheses that are less probable are not counted [-]."""
LEAST_SCORED = 1e-4
"""A truth that is less probable scores as this: the prior odds of an effect outside the library [-]."""
INSTRUMENTS = "driver_mass", "sensor_mass", "stinger"


@dataclass(frozen=True)
class Judged:
    """The posterior of a case: probabilities, and whether each hypothesis is true.

    ``shown`` is None where the library does not state the truth.
    """

    case: str
    shown: bool | None
    probabilities: np.ndarray
    true: np.ndarray

    @property
    def log_score(self):
        """Ln of the probability of the truth."""
        return float(np.log(max(self.probabilities[self.true].sum(), LEAST_SCORED)))


def judged(folder):
    """Return the posterior of a case in a folder of `table`; None if it did not end or has no truth."""
    result, record = (folder / "result" / f"{name}.json" for name in ("result", "record"))
    if not record.exists():
        return None
    result, record = (json.loads(p.read_text(encoding="utf-8")) for p in (result, record))
    if "evidence" not in record:
        return None
    case = folder_of_data(folder / "study.toml")
    truth = json.loads((case.parent / "truth.json").read_text(encoding="utf-8"))[case.name]
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    hidden, faults = table.hidden_effects(truth, nominal)
    hidden = [replace(h, position=None) if isinstance(h, table.Hidden) else h for h in hidden]
    corners = table.has_solid_corners(truth, nominal)
    found = found_by_name(folder / "study.toml")

    def effects_of(hypothesis):
        as_read = {name.removeprefix(AS_READ) for name in hypothesis["effects"] if name.startswith(AS_READ)}
        effects = [found(name) for name in hypothesis["effects"] if not name.startswith(AS_READ)]
        kept = [f for f in result["faults"] if f"{f['kind']}:{f['sensor']}" not in as_read]
        verdict = "effect" if effects else "measurement fault" if kept else "nothing missing"
        said = result | {"verdict": verdict, "effects": effects, "faults": kept}
        return table.without_test(said, truth.get("instruments", {}), nominal)

    posterior = [(h["probability"], effects_of(h)) for h in result["posterior"]]
    gained = record["evidence"]["truth"]
    true = [table.judge(hidden, faults, said, corners) == table.YES for _, said in posterior]
    if gained is None:  # the library does not have it
        true = [h["effects"] == [UNKNOWN] for h in result["posterior"]]
    parts = [p for p, said in posterior if is_part(hidden, said, corners)]
    p, true = np.array([p for p, _ in posterior]), np.array(true, dtype=bool)
    # Several ways to say what is hidden are one hypothesis.
    p, true = np.append(p[~true], p[true].sum()), np.append(true[~true], True)
    names = sorted(e["name"] for e in result["effects"])
    answer = [h["probability"] for h in result["posterior"] if sorted(h["effects"]) == names]
    shown = None if gained is None or not answer else is_shown(gained, answer[0], parts)
    return Judged(folder.name, shown, p, true)


def is_shown(gained, answer, parts):
    """Say whether data show what is hidden: a fit with all of it is more probable than one with a part.

    ``gained`` is how much the former scores above the answer [nats], which has the probability ``answer``, as
    the hypotheses have that lack some of what is hidden: nothing at all for one effect.
    """
    most = max(parts, default=0.0)
    return bool(most <= 0 or gained >= np.log(most / answer))


def is_part(hidden, said, corners):
    """Say whether effects are some of those that are hidden, none besides, and not all."""

    def is_at(h, e):
        return h.is_part(e) if isinstance(h, table.HiddenConnection) else h.is_at(e)

    every = table.judge(hidden, [], said | {"faults": []}, corners) == table.YES
    return bool(hidden) and not every and all(any(is_at(h, e) for h in hidden) for e in said["effects"])


def folder_of_data(study):
    """Return the folder of the case whose data a study reads."""
    stated = tomllib.loads(study.read_text(encoding="utf-8"))
    measured = (*stated.get("measurements", ()), stated.get("modes", {}))
    files = [m["file"] for m in measured if "file" in m]
    return (study.parent / files[0]).resolve().parent


def found_by_name(study):
    """Return a function that gives a candidate of a study by its name, as result.json has effects."""
    every = {e.name: as_found(e) for e in propose(load_study(study).model)}

    @cache
    def found(name):
        kind, _, place = name.partition(":")
        if kind in (*INSTRUMENTS, UNKNOWN):
            return {"kind": kind, "where": f"excitation at {place}", "parameters": [], "twins": []}
        return every[name]

    return found


def shares(cases):
    """Return for each bin of stated probability how many hypotheses are true."""
    p = np.concatenate([np.zeros(0), *(c.probabilities for c in cases)])
    true = np.concatenate([np.zeros(0, dtype=bool), *(c.true for c in cases)])
    at = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    at[p < LEAST] = -1
    return [Share.of(true[at == k], p[at == k]) for k in range(len(EDGES) - 1)]


def as_markdown(cases):
    """Return the bins of cases that the data show and of others, and the log scores."""
    groups = {
        "effect shown, or nothing hidden": [c for c in cases if c.shown],
        "effect not shown": [c for c in cases if c.shown is False],
        "not stated by the library": [c for c in cases if c.shown is None],
    }
    groups = {name: some for name, some in groups.items() if some}
    heads = [f"{name} ({len(some)} cases) | mean stated" for name, some in groups.items()]
    lines = [f"| stated probability | {' | '.join(heads)} |", f"|{'---|' * (1 + 2 * len(groups))}"]
    for k, row in enumerate(zip(*(shares(some) for some in groups.values()), strict=True)):
        name = f"{100 * EDGES[k]:g}-{100 * EDGES[k + 1]:g} %"
        cells = [f"{s} | {f'{100 * s.stated:.1f} %' if s.cases else '-'}" for s in row]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    scores = [f"{np.mean([c.log_score for c in some]):.2f} | " for some in groups.values()]
    lines.append(f"| mean log score | {' | '.join(scores)} |")
    return "\n".join(lines) + "\n"


def main(argv=None):
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.independent.reliability", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="where `table` wrote its results")
    parser.add_argument("--cases", action="store_true", help="print the log score of each case too")
    options = parser.parse_args(argv)
    folders = [p.parent for each in options.folders for p in sorted(each.glob("*/study.toml"))]
    cases = [c for c in map(judged, folders) if c is not None]
    if not cases:
        sys.stderr.write("no folder has records of cases whose truth is known\n")
        return 2
    if options.cases:
        for c in cases:
            shown = {True: "", False: "not shown", None: "not stated"}[c.shown]
            sys.stdout.write(f"{c.case:42s}{c.log_score:8.2f}  {shown}\n")
    sys.stdout.write(as_markdown(cases))
    return 0


if __name__ == "__main__":
    sys.exit(main())
