"""An answer of the open test: what a program says of a case, with probabilities."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

from benchmarks.open_test.case import CaseError
from benchmarks.open_test.kinds import check_effect

ANSWER_FORMAT = "open test of missing physics, answer, version 1"
ROUNDING = 1e-6
"""By so much the sum of probabilities may be above 1 [-]."""
KEYS = {
    "format", "case", "program", "version", "cpu_seconds", "ended", "explanations", "unexplained",
    "not_above",
}  # fmt: skip


@dataclass(frozen=True)
class Explanation:
    """Effects that may be missing together, none for "nothing missing", and how probable that is [-]."""

    probability: float
    effects: tuple


@dataclass(frozen=True)
class Answer:
    """What a program says of a case.

    ``unexplained`` is the probability that something is missing that no explanation has. What explanations
    and it leave of 1 is "do not know". ``ended`` is False where the time was up.
    """

    case: str
    program: str
    version: str
    cpu_seconds: float
    explanations: tuple
    unexplained: float = 0.0
    not_above: tuple = ()
    ended: bool = True

    @property
    def ranked(self):
        """Explanations, the most probable first."""
        return sorted(self.explanations, key=lambda e: -e.probability)

    @property
    def unknown(self):
        """Probability that the answer leaves open [-]."""
        return max(1.0 - self.unexplained - sum(e.probability for e in self.explanations), 0.0)

    def as_dict(self):
        """Return the answer as its file has it."""
        explanations = [{"probability": e.probability, "effects": list(e.effects)} for e in self.explanations]
        return {
            "format": ANSWER_FORMAT,
            "case": self.case,
            "program": self.program,
            "version": self.version,
            "cpu_seconds": self.cpu_seconds,
            "ended": self.ended,
            "explanations": explanations,
            "unexplained": self.unexplained,
            "not_above": list(self.not_above),
        }


def not_ended(case, program, version, seconds):
    """Return the answer of a program whose time was up: it does not know."""
    return Answer(case, program, version, seconds, (), ended=False)


def read_answer(file, structure):
    """Return the answer in a file.

    Raises
    ------
    CaseError
        If it is not as the schema says, names what the structure has not, or states impossible probabilities.
    """
    file = Path(file)
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as reason:
        msg = f"{file}: {reason}"
        raise CaseError(msg) from reason
    if not isinstance(told, dict) or told.get("format") != ANSWER_FORMAT:
        _refuse(file, f"format is not {ANSWER_FORMAT!r}")
    if more := sorted(told.keys() - KEYS):
        _refuse(file, f"there is no key {more[0]!r}; keys are {', '.join(sorted(KEYS))}")
    for key, what in (("case", str), ("program", str), ("cpu_seconds", int | float), ("explanations", list)):
        if not isinstance(told.get(key), what):
            _refuse(file, f"{key} is {told.get(key)!r}")
    if told["case"] != structure.name:
        _refuse(file, f"it answers {told['case']!r}, and the case is {structure.name!r}")
    explanations = []
    for k, e in enumerate(told["explanations"]):
        where = f"{file}, explanations[{k}]"
        for effect in e.get("effects", [{}]):
            check_effect(effect, structure, where)
        explanations.append(Explanation(_probability(where, e.get("probability")), tuple(e["effects"])))
    unexplained = _probability(f"{file}, unexplained", told.get("unexplained", 0.0))
    total = unexplained + math.fsum(e.probability for e in explanations)
    if total > 1 + ROUNDING:
        _refuse(
            file,
            f"the probabilities of explanations and of unexplained are together {total:.4g}; 1 is allowed",
        )
    return Answer(
        told["case"],
        told["program"],
        str(told.get("version", "")),
        float(told["cpu_seconds"]),
        tuple(explanations),
        unexplained,
        tuple(told.get("not_above", ())),
        bool(told.get("ended", True)),
    )


def _probability(where, value):
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1 + ROUNDING:
        msg = f"{where}: the probability is {value!r}; 0 to 1 is allowed"
        raise CaseError(msg)
    return min(float(value), 1.0)


def _refuse(file, text):
    msg = f"{file}: {text}"
    raise CaseError(msg)
