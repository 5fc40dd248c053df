"""The first screen of a report: verdict, probability, staircase, and the structure with the place."""

from dovetail.report import words
from dovetail.report.blocks import Block, Group, Plot, Text
from dovetail.report.drawn import test_in_words
from dovetail.report.probable import probability_text
from dovetail.report.sections import staircase
from dovetail.report.shown import TURN, Shown
from dovetail.result import RunResult
from updating.diagnosis.verdict import EFFECT, FAULT, NOTHING, UNEXPLAINED, Verdict

CLASS = {EFFECT: "effect", NOTHING: "nothing", FAULT: "fault", UNEXPLAINED: "unexplained"}


def answer(result: RunResult[Verdict], shown: Shown) -> list[Block]:
    """Return description and verdict with its probability, the staircase, and the structure."""
    d = result.diagnosis
    form = [f"Form: {words.departure_text(f)}." for f in d.departures]
    parts = [
        Text(f"Verdict: {d.verdict}", "kind"),
        Text(words.headline(d), "sentence"),
        *(Text(value, "value") for value in words.values_found(d)),
        Text(probability_text(d), "value probability"),
        Text(f"{d.reason[:1].upper()}{words.directions(d.reason[1:])}.", "why"),
        *(Text(doubt, "value doubt") for doubt in (*form, words.far_text(result.uncertain))),
    ]
    box = Group(f"verdict {CLASS.get(d.verdict, 'unexplained')}", parts)
    caption = staircase.CAPTIONS[d.stairs.unit]
    stairs = shown.figure("staircase", staircase.in_words(d), caption, ["staircase"])
    return [Text(result.study.description), box, Group("answer", [stairs, _structure(result, shown)])]


def _structure(result: RunResult[Verdict], shown: Shown) -> Plot:
    d = result.diagnosis
    effects = [words.effect_label(e.kind, e.where) for e in d.found]
    found = ", ".join(
        [*effects, *(f"{words.place(f.where)} {words.departure_label(f)}" for f in d.departures)]
    )
    alt = f"The structure{test_in_words(result)}" + (f"; marked: {found}" if found else "")
    caption = "The model with sections"
    if result.comparisons:
        caption = "Sensors in the colours of their error once the uncertain parameters are fitted"
    images = " and its mirror images" if len(d.images) > 1 else " and its mirror image" if d.images else ""
    caption += f"; rings mark what was found{images}" if found else ""
    if {e.name for x in d.credible for e in x.effects} - {
        e.name for e in (*d.found, *(e for x in d.images for e in x.effects))
    }:
        caption += "; diamonds mark the places of other explanations"
    caption += ". A click on a sensor shows its FRFs below." if result.comparisons else "."
    return shown.figure("model", f"{alt}.", caption, ["structure"], hint=TURN)
