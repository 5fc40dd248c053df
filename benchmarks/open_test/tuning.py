"""Choose temperature, cost of an effect and probability of "do not know" of a method where truth is open."""

from dataclasses import replace
from itertools import product
from statistics import mean

import numpy as np

from benchmarks.open_test.answer import Explanation
from benchmarks.open_test.judge import judge

RATIOS = 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0
PENALTIES = 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0
"""Nats that each effect costs."""
UNKNOWN = 0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9


def tempered(answer, ratio, penalty, unknown):
    """Return an answer with a temperature multiplied by a ratio, a cost of each effect, and "do not know"."""
    known = [e for e in answer.explanations if e.probability > 0]
    if not known:
        return answer
    logs = np.array([np.log(e.probability) / ratio - penalty * len(e.effects) for e in known])
    p = (1 - unknown) * np.exp(logs - np.logaddexp.reduce(logs))
    explanations = (Explanation(float(x), e.effects) for x, e in zip(p, known, strict=True))
    return replace(answer, explanations=tuple(explanations), unexplained=0.0)


def tuned(answers, truths, structures):
    """Return the mean log score [nats], and the ratio, penalty and "do not know" that score best.

    Parameters
    ----------
    answers : list of Answer
        Of one method.
    truths, structures : dict
        By case.
    """

    def score(ratio, penalty, unknown):
        changed = (tempered(a, ratio, penalty, unknown) for a in answers)
        return mean(judge(a, truths[a.case], structures[a.case]).log_score for a in changed)

    every = [(score(*each), *each) for each in product(RATIOS, PENALTIES, UNKNOWN)]
    return max(every, key=lambda found: (found[0], -found[2]))
