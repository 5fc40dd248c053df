"""Tables of the benchmark book, computed from the entries that the tests check."""

from collections.abc import Iterator
from functools import cache

import numpy as np

from benchmarks.book.entry import ROUNDING, Compared, Problem, compare
from benchmarks.book.shelf import SOURCES

HEAD = """\
| problem | quantity | published | Dovetail | deviation | remarks |
|---|---|---|---|---|---|"""
AGREES = "all digits"


@cache
def table(source: str) -> str:
    """Return the table of a source, by its name in `SOURCES`."""
    rows = [row for problem in SOURCES[source].PROBLEMS for row in _rows(problem)]
    return "\n".join([HEAD, *rows])


def summary() -> str:
    """Return a sentence with the number of problems and of numbers."""
    compared = [c for source in SOURCES.values() for problem in source.PROBLEMS for c in compare(problem)]
    n_problems = sum(len(source.PROBLEMS) for source in SOURCES.values())
    n = sum(c.ours.size for c in compared)
    within = sum(int((np.abs(c.deviation) <= ROUNDING * c.quantity.half_digits).sum()) for c in compared)
    wrong = sum(c.quantity.exact is not None for c in compared)
    return (
        f"{n_problems} problems have {n} numbers. {within} agree in all printed digits; the tables state the "
        f"deviations of the others and their causes. In {wrong} rows a published number is proved wrong."
    )


def _rows(problem: Problem) -> Iterator[str]:
    """Yield a row for each quantity; the first has the name and the title."""
    for k, compared in enumerate(compare(problem)):
        title = f"**{problem.name}**: {problem.title}" if k == 0 else ""
        remark = problem.remark if k == 0 else ""
        yield _row(compared, title, remark)


def _row(compared: Compared, title: str, remark: str) -> str:
    q, i = compared.quantity, compared.shown
    word = q.printed.split()[i]
    n = compared.ours.size
    published = f"<del>{word}</del> {_like(word, q.reference[i])}" if q.exact else word
    deviation = _deviation(compared)
    reason = "" if deviation == AGREES else q.reason
    words = [f"the worst of {n} numbers" if n > 1 else "", q.proof, reason, remark]
    cells = [
        title,
        f"{q.name} [{q.unit}]",
        published,
        _like(word, compared.ours[i]),
        deviation,
        "; ".join(w for w in words if w),
    ]
    return f"| {' | '.join(cells)} |"


def _like(word: str, value: float) -> str:
    """Return a number with one digit more than a printed one."""
    mantissa, _, exponent = word.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) + 1
    return f"{value:.{decimals}e}" if exponent else f"{value:.{decimals}f}"


def _deviation(compared: Compared) -> str:
    """Return the deviation of the number shown, relative to the largest, or that all digits agree."""
    q, i = compared.quantity, compared.shown
    if (np.abs(compared.deviation) <= ROUNDING * q.half_digits).all() and q.exact is None:
        return AGREES
    deviation = 100 * compared.deviation[i] / np.abs(q.reference).max()
    # a smaller one may be what rounding leaves, which differs between processors
    return f"{deviation:+.2g} %" if abs(deviation) >= 1e-6 else "below 1e-06 %"
