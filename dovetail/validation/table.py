"""Rates with confidence intervals, and the list of failures."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dovetail.validation.judging import FLOOR, Record

CONFIDENCE = 0.95

Test = Callable[[Record], bool]

RATES: dict[str, tuple[tuple[str, Test], ...]] = {
    "single": (
        ("right effect and place, nothing else", lambda r: r["outcome"] == "right"),
        ("right effect and place first", lambda r: r.get("first", False)),
        ("among the first three", lambda r: r.get("in_three", False)),
        ("first, or named as a twin", lambda r: r.get("first", False) or r["outcome"] == "twin"),
        ("a wrong effect", lambda r: r["outcome"] in ("wrong", "beside")),
        ("unexplained", lambda r: r["outcome"] == "unexplained"),
        ("not noticed", lambda r: r["outcome"] == "not noticed"),
        ("taken for a fault", lambda r: r["outcome"] == "fault"),
    ),
    "null": (
        ("nothing missing", lambda r: r["outcome"] == "right"),
        ("false alarm", lambda r: r["outcome"] == "wrong"),
        ("unexplained", lambda r: r["outcome"] == "unexplained"),
    ),
    "withheld": (
        ("unexplained, or a twin", lambda r: r["outcome"] in ("right", "twin")),
        ("unexplained", lambda r: r["outcome"] == "right"),
        ("a wrong effect", lambda r: r["outcome"] == "wrong"),
        ("not noticed", lambda r: r["outcome"] == "not noticed"),
    ),
    "two": (
        ("both right, nothing else", lambda r: r["outcome"] == "right"),
        ("both right", lambda r: r["outcome"] in ("right", "beside")),
        ("one right, nothing else", lambda r: r["outcome"] == "part"),
        ("a wrong effect", lambda r: r["outcome"] in ("wrong", "beside")),
    ),
    "faults": (
        ("fault and sensor named, nothing else", lambda r: r["outcome"] == "right"),
        ("fault and sensor named", lambda r: r["outcome"] in ("right", "beside")),
        ("sensor named, another fault", lambda r: r["outcome"] == "twin"),
        ("wrong", lambda r: r["outcome"] == "wrong"),
        ("not noticed", lambda r: r["outcome"] == "not noticed"),
    ),
}
RATES["weak"] = RATES["mounting"] = RATES["frf-states"] = RATES["single"]
RATES["modes"] = RATES["frequencies"] = RATES["states"] = RATES["ambient"] = (
    ("right effect and place, nothing else", lambda r: r["outcome"] == "right"),
    ("right, or in a credible set of three", lambda r: r.get("evidence", {}).get("in_three", False)),
    ("truth in the credible set of 90 %", lambda r: r.get("evidence", {}).get("covered", False)),
    ("sure and wrong", lambda r: r.get("evidence", {}).get("sure_and_wrong", False)),
    ("a wrong effect", lambda r: r["outcome"] == "wrong"),
    ("unexplained", lambda r: r["outcome"] == "unexplained"),
    ("not noticed", lambda r: r["outcome"] == "not noticed"),
)
RATES["modes-null"] = RATES["frequencies-null"] = RATES["states-null"] = RATES["null"]
RATES["ambient-null"] = RATES["frf-states-null"] = RATES["null"]
RATES["connection"] = RATES["connections"] = RATES["mixed"] = (
    ("all right, nothing else", lambda r: r["outcome"] == "right"),
    ("all right", lambda r: r["outcome"] in ("right", "beside")),
    ("some right, nothing else", lambda r: r["outcome"] == "part"),
    ("a wrong effect", lambda r: r["outcome"] in ("wrong", "beside")),
    ("unexplained", lambda r: r["outcome"] == "unexplained"),
    ("not noticed", lambda r: r["outcome"] == "not noticed"),
)


def interval(hits: int, n: int) -> tuple[float, float]:
    """Return Clopper and Pearson's interval of a rate."""
    from scipy.stats import binomtest

    ci: Any = binomtest(hits, n).proportion_ci(CONFIDENCE, "exact")
    return float(ci.low), float(ci.high)


def summarise(records: Sequence[Record]) -> dict[str, Any]:
    """Return rates for each set, errors of parameters, times and failures.

    Kinds that the program does not know are rows of their own: no answer to them could be right but
    "unexplained". Cases that failed count as neither right nor wrong, but in the number of cases.
    """
    rows = []
    for name, tests in RATES.items():
        of_set = [r for r in records if r["set"] == name]
        for known in (True, False):
            part = [r for r in of_set if r["known"] == known]
            if not part:
                continue
            label = name if known else f"{name}, kinds not known"
            for what, test in (*tests, ("failed", lambda r: r["outcome"] == "failed")):
                hits = sum(map(test, part))
                if what == "failed" and not hits:
                    continue
                low, high = interval(hits, len(part))
                rows.append(
                    {"set": label, "what": what, "hits": hits, "cases": len(part), "low": low, "high": high}
                )
    errors = [e for r in records for e in r.get("errors", ())]
    right = [r for r in records if r["outcome"] == "right" and r["set"] in ("single", "two", "null")]
    floor = [r["db"]["after"] <= FLOOR * r["db"]["floor"] for r in right]
    return {
        "rates": rows,
        "parameters": {
            "number": len(errors),
            "median_error": float(np.median([e["error"] for e in errors])) if errors else None,
            "covered": _rate([e["covered"] for e in errors]),
        },
        "within_floor": _rate(floor),
        "seconds": _spread([r["seconds"] for r in records]),
        "outcomes": dict(Counter(f"{r['set']}: {r['outcome']}" for r in records)),
        "kinds": _by_kind(records),
        "programs": sorted({r.get("program", "") for r in records}),
        "failures": [_failure(r) for r in records if r["outcome"] != "right"],
    }


def _rate(flags: Sequence[bool]) -> dict[str, Any]:
    if not flags:
        return {"hits": 0, "cases": 0, "low": None, "high": None}
    low, high = interval(sum(flags), len(flags))
    return {"hits": int(sum(flags)), "cases": len(flags), "low": low, "high": high}


def _spread(values: Sequence[float]) -> dict[str, Any]:
    return {"median": float(np.median(values)), "largest": float(max(values))} if len(values) else {}


def _by_kind(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return how each kind fared alone, with one effect."""
    out = []
    single = [r for r in records if r["set"] in ("single", "faults") and r["hidden"]]
    for kind in sorted({r["hidden"][0]["kind"] for r in single}):
        of_kind = [r for r in single if r["hidden"][0]["kind"] == kind]
        out.append({"kind": kind, **Counter(r["outcome"] for r in of_kind), "cases": len(of_kind)})
    return out


def _failure(r: Record) -> dict[str, Any]:
    found = [f"{f['kind']} at {f['where']}" for f in r.get("found", ())]
    found += [f"{f['kind']} {f['sensor']}" for f in r.get("faults", ())]
    last = r.get("traceback", "").strip().splitlines()[-1:]
    return {
        "case": r["case"],
        "family": r.get("family", ""),
        "hidden": "; ".join(
            f"{h['kind']} at {h['where']}" if "where" in h else h["kind"] for h in r["hidden"]
        )
        or "nothing",
        "known": r["known"],
        "outcome": r["outcome"],
        "said": "; ".join(found) or "".join(last) or r.get("verdict", ""),
        "db": r.get("db"),
    }


def as_markdown(summary: dict[str, Any], title: str) -> str:
    """Return the summary as tables."""
    lines = [f"# {title}", "", "| set | what | cases | rate | 95 % interval |", "|---|---|---|---|---|"]
    for r in summary["rates"]:
        rate = 100 * r["hits"] / r["cases"]
        lines.append(
            f"| {r['set']} | {r['what']} | {r['hits']} of {r['cases']} | {rate:.1f} % | "
            f"{100 * r['low']:.1f}-{100 * r['high']:.1f} % |"
        )
    p, floor, seconds = summary["parameters"], summary["within_floor"], summary["seconds"]
    if p["number"]:
        c = p["covered"]
        lines += [
            "",
            f"Parameters of right effects: {p['number']}, median error {100 * p['median_error']:.2g} %; "
            f"the 95 % interval holds the truth in {c['hits']} of {c['cases']}.",
        ]
    if floor["cases"]:
        lines += [
            "",
            f"Error left within {FLOOR:g} times the floor: {floor['hits']} of {floor['cases']} right cases.",
        ]
    if seconds:
        lines += ["", f"Seconds of a case: median {seconds['median']:.0f}, largest {seconds['largest']:.0f}."]
    if len(summary["programs"]) > 1:
        lines += ["", "These cases were run with different versions of the code."]
    if summary["failures"]:
        lines += [
            "",
            "## Not right",
            "",
            "| case | frame | hidden | outcome | said | error [dB] | floor [dB] |",
            "|---|---|---|---|---|---|---|",
        ]
        for f in summary["failures"]:
            db = f["db"] or {}
            steps = " → ".join(f"{db[k]:.2f}" for k in ("nominal", "fitted", "after")) if db else "-"
            errors = f"{steps} | {db['floor']:.2f}" if db else "- | -"
            note = "" if f["known"] else " (kind not known)"
            said = f["said"].replace("|", "/")
            lines.append(
                f"| {f['case']} | {f['family']} | {f['hidden']}{note} | {f['outcome']} | {said} | {errors} |"
            )
    return "\n".join(lines) + "\n"
