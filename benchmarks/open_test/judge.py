"""Set answers against the truth: log score, rates with intervals, credible sets, tables and pictures."""

import math
from dataclasses import dataclass
from itertools import pairwise
from statistics import mean, median

from scipy.stats import binomtest

from benchmarks.open_test.kinds import is_right, share

SURE, CREDIBLE, SMALL_SET = 0.9, 0.9, 3
LEAST = 1e-6
"""The log score takes no smaller probability than this."""
PRIOR = {0: 0.2, 1: 0.35, 2: 0.2, 3: 0.05}
"""What "do not know" is taken for: probabilities that none, one, two, three or more effects are missing."""
PRIOR_OUTSIDE = 0.2
"""And that an effect is missing that no kind describes."""
CLEAR_DB = (0.0, 1.5, 3.0, 6.0, 15.0)
"""Classes of how clearly effects show [dB]."""


@dataclass(frozen=True)
class Judged:
    """How one answer compares with the truth.

    ``log_score`` in nats; ``outcome`` as in `OUTCOMES`; ``size`` and ``covered`` of the credible set;
    ``named``, ``missed`` and ``false`` effects of the first explanation. ``shows_db`` is what the least
    visible effect changes beyond what is uncertain [dB], None of no effect. ``guess`` says how the most
    probable explanation with effects compares, however improbable it is: `RIGHT`, `PART` where it names a
    true effect, or `WRONG`; empty where the truth has no effects of the kinds.
    """

    case: str
    kinds: tuple
    structure: str
    test: str
    seen: bool | None
    log_score: float
    outcome: str
    sure: bool
    covered: bool
    size: int
    named: int
    missed: int
    false: int
    cpu_seconds: float
    shows_db: float | None = None
    guess: str = ""

    @property
    def sure_and_wrong(self):
        """Whether the answer was sure and is not right."""
        return self.sure and self.outcome in (PART, WRONG)


RIGHT, IN_SET, PART, WRONG, UNKNOWN, NOT_ENDED = (
    "right", "in a set of three", "in part", "wrong", "do not know", "not ended",
)  # fmt: skip
OUTCOMES = RIGHT, IN_SET, PART, WRONG, UNKNOWN, NOT_ENDED


def blind(truth, structure, *, something=False):
    """Return the probability of the true answer by someone who has not seen the data.

    The share of `PRIOR` for as many effects, spread over all answers with so many effects; ``something`` of
    someone who knows that it is not nothing.
    """
    n_effects = len(truth["effects"])
    weight = PRIOR_OUTSIDE if truth.get("outside") else PRIOR.get(n_effects, PRIOR[max(PRIOR)])
    weight /= 1.0 if truth.get("outside") else structure.n_single**n_effects
    if something:
        is_nothing = not n_effects and not truth.get("outside")
        weight = 0.0 if is_nothing else weight / (1 - PRIOR[0])
    return weight


def without_test(effects, truth):
    """Return stated effects without those that say how a test that is not as described was."""
    hidden = {p for t in truth["effects"] if t["kind"] == "sensor" for p in (t["place"], *t.get("also", ()))}
    if truth["test"] == "as described":
        return list(effects)
    return [e for e in effects if e["kind"] != "sensor" or e["place"] in hidden]


def judge(answer, truth, structure, nats=None):
    """Return how an answer compares with the truth of its case.

    ``nats`` is what the least visible true effect explains beyond its odds, by an oracle that is given
    the truth; a case with less than 0 does not show all of its effects.
    """
    true, outside = truth["effects"], bool(truth.get("outside"))
    said = [(e.probability, without_test(e.effects, truth)) for e in answer.ranked]
    right = [(p, not outside and is_right(effects, true, structure)) for p, effects in said]
    p = sum(p for p, ok in right if ok)
    p += answer.unknown * blind(truth, structure)
    p += answer.unexplained * blind(truth, structure, something=True)
    every = [*right, (answer.unexplained, outside), (answer.unknown, False)]
    every.sort(key=lambda pair: -pair[0])
    credible, total = [], 0.0
    for pair in every:
        if total >= CREDIBLE:
            break
        credible.append(pair)
        total += pair[0]
    covered = any(ok for _, ok in credible)
    first_p, first = said[0] if said else (0.0, [])
    knows = bool(said) and first_p >= max(answer.unexplained, answer.unknown)
    missed = answer.unexplained > max(first_p, answer.unknown)
    guess = without_test(next((e.effects for e in answer.ranked if e.effects), ()), truth)
    named, false = share(first if knows else [], true, structure)
    if not answer.ended:
        outcome = NOT_ENDED
    elif (missed and outside) or (knows and right[0][1]):
        outcome = RIGHT
    elif covered and len(credible) <= SMALL_SET:
        outcome = IN_SET
    elif missed and not true:
        outcome = WRONG
    elif not knows:
        outcome = UNKNOWN
    else:
        outcome = PART if named and not false else WRONG
    return Judged(
        answer.case,
        ("outside",) if outside else tuple(sorted({t["kind"] for t in true})) or ("nothing",),
        truth["structure"],
        truth["test"],
        None if nats is None else nats >= 0,
        math.log(max(p, LEAST)),
        outcome,
        max(first_p, answer.unexplained) >= SURE,
        covered,
        len(credible),
        named,
        len(true) - named,
        false,
        answer.cpu_seconds,
        min((_shows(each) for each in truth.get("shows", ()) if each["kind"] != "test"), default=None),
        _guess(guess, true, structure) if true and not outside else "",
    )


def _guess(effects, true, structure):
    if is_right(effects, true, structure):
        return RIGHT
    return PART if share(effects, true, structure)[0] else WRONG


def _shows(each):
    return each.get("beyond_nuisances_db", each["change_db"])


def interval(hits, cases):
    """Return the 95 % interval of a rate (Clopper and Pearson, Biometrika 26, 1934)."""
    return binomtest(hits, cases).proportion_ci(method="exact") if cases else (0.0, 1.0)


def rate(hits, cases):
    """Return a rate and its interval in words."""
    low, high = interval(hits, cases)
    return f"{hits} of {cases} ({100 * low:.0f}–{100 * high:.0f} %)" if cases else "-"


HEAD = (
    "program", "cases", "log score [nats]", "right", "or in a set of three", "in part", "sure and wrong",
    "best guess right", "names a true effect", "90 % sets hold the truth", "size of the sets",
    "CPU, median [s]", "not ended",
)  # fmt: skip


def row(program, judged):
    """Return a line of the table of programs."""
    n, seconds = len(judged), [j.cpu_seconds for j in judged if not math.isnan(j.cpu_seconds)]
    n_guessed = sum(bool(j.guess) for j in judged)
    count = {o: sum(j.outcome == o for j in judged) for o in OUTCOMES}
    return (
        program,
        str(n),
        f"{mean(j.log_score for j in judged):.2f}",
        rate(count[RIGHT], n),
        rate(count[RIGHT] + count[IN_SET], n),
        str(count[PART]),
        rate(sum(j.sure_and_wrong for j in judged), n),
        f"{sum(j.guess == RIGHT for j in judged)} of {n_guessed}",
        f"{sum(j.guess in (RIGHT, PART) for j in judged)} of {n_guessed}",
        f"{sum(j.covered for j in judged)} of {n}",
        f"{mean(j.size for j in judged):.1f}",
        f"{median(seconds):.0f}" if seconds else "-",
        str(count[NOT_ENDED]),
    )


def markdown(head, rows):
    """Return a table."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)) + "\n"


def report(by_program, missing):
    """Return the tables: of programs, of what they name by kind, and of cases that show their effects.

    ``by_program`` has lists of `Judged` by program, ``missing`` the names of cases without an answer.
    """
    order = sorted(by_program, key=lambda name: -mean(j.log_score for j in by_program[name]))
    text = markdown(HEAD, [row(name, by_program[name]) for name in order])
    for name in sorted(missing):
        text += f'\n{name} has not answered {len(missing[name])} cases, which count as "do not know".\n'
    kinds = sorted({k for judged in by_program.values() for j in judged for k in j.kinds})
    rows = []
    for kind in kinds:
        cells = []
        for name in order:
            mine = [j for j in by_program[name] if kind in j.kinds]
            cells.append(_of_cases(mine))
        rows.append((kind.replace("_", " "), *cells))
    text += "\nRight or in a set of three, by what is hidden (cases with several effects count for each):\n\n"
    text += markdown(("hidden", *order), rows)
    text += "\nThe same by what the least visible effect changes beyond what is uncertain:\n\n"
    rows = []
    for low, high in pairwise(CLEAR_DB):
        mine = [[j for j in by_program[n] if low <= (j.shows_db or -1.0) < high] for n in order]
        if any(mine):
            rows.append((f"{low:g} to {high:g} dB", *map(_of_cases, mine)))
    text += markdown(("shows", *order), rows)
    seen = [[j for j in by_program[name] if j.seen is not None] for name in order]
    if any(seen):
        text += "\nCases whose data show the effects by the oracle, and those whose data do not:\n\n"
        rows = []
        for which, label in ((True, "shown"), (False, "not shown")):
            mine = [[j for j in judged if j.seen is which] for judged in seen]
            cells = (rate(sum(j.outcome in (RIGHT, IN_SET) for j in m), len(m)) for m in mine)
            rows.append((label, *cells))
        text += markdown(("", *order), rows)
    return text


def _of_cases(judged):
    return f"{sum(j.outcome in (RIGHT, IN_SET) for j in judged)} of {len(judged)}"


def draw(by_program, file):
    """Draw log scores and outcomes of programs into a picture."""
    from matplotlib.figure import Figure

    order = sorted(by_program, key=lambda name: mean(j.log_score for j in by_program[name]))
    figure = Figure(figsize=(9, 0.5 * len(order) + 1.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for k, name in enumerate(order):
        scores = [j.log_score for j in by_program[name]]
        left.plot(scores, [k] * len(scores), "|", color="0.6")
        left.plot([mean(scores)], [k], "o", color="C0")
        start = 0
        for i, outcome in enumerate(OUTCOMES):
            n = sum(j.outcome == outcome for j in by_program[name])
            colour = ("C2", "C8", "C0", "C3", "0.75", "0.4")[i]
            right.barh(k, n, left=start, color=colour, label=outcome if k == 0 else None)
            start += n
    left.set_yticks(range(len(order)), order)
    left.set_xlabel("log score [nats], mean and each case")
    right.set_xlabel("cases")
    figure.legend(*right.get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    figure.savefig(file, dpi=150)
