"""The first screen of a report: verdict, probability, staircase, and the structure with the place."""

from collections.abc import Sequence

from dovetail.file.contents import Study
from dovetail.report import cells, words
from dovetail.report.confidence import confidence
from dovetail.report.page import Markup, bullets, join, paragraph, section, table, tag
from dovetail.report.probable import probability_text
from dovetail.report.shown import TURN, Shown
from dovetail.result import RunResult
from fem.summary import counted
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnosis import EFFECT, FAULT, NOTHING, UNEXPLAINED, Diagnosis

CLASS = {EFFECT: "effect", NOTHING: "nothing", FAULT: "fault", UNEXPLAINED: "unexplained"}


def answer(result: RunResult, shown: Shown) -> Markup:
    """Return heading, verdict and probability, with the staircase beside the structure."""
    d = result.diagnosis
    box = verdict_box(
        d.verdict,
        words.headline(result),
        [words.finding_text(f) for f in d.findings],
        probability_text(d),
        d.reason,
        words.far_text(result.uncertain),
        [f"Form: {words.departure_text(f)}." for f in d.departures],
    )
    return first_screen(result.study, box, _staircase(result, shown), _structure(result, shown))


def verdict_box(
    verdict: str,
    headline: str,
    values: Sequence[str],
    sure: str,
    reason: str,
    doubt: str = "",
    form: Sequence[str] = (),
) -> Markup:
    """Return the verdict in words, with values, probability, reason, and what speaks for caution."""
    return tag(
        "div",
        tag("p", f"Verdict: {verdict}", class_="kind"),
        tag("p", headline, class_="sentence"),
        *(tag("p", value, class_="value") for value in values),
        tag("p", sure, class_="value probability") if sure else "",
        tag("p", f"{reason[:1].upper()}{words.directions(reason[1:])}.", class_="why"),
        *(tag("p", text, class_="value doubt") for text in form),
        tag("p", doubt, class_="value doubt") if doubt else "",
        class_=f"verdict {CLASS.get(verdict, 'unexplained')}",
    )


def first_screen(study: Study, box: Markup, staircase: Markup, structure: Markup) -> Markup:
    """Return heading and verdict, with the staircase beside the structure."""
    more = [tag("p", study.description)] if study.description else []
    return tag("header", tag("h1", study.name), *more, box, tag("div", staircase, structure, class_="answer"))


def _staircase(result: RunResult, shown: Shown) -> Markup:
    d = result.diagnosis
    alt = "Error after each step: " + "; ".join(f"{s.label} {s.fit_db:.2f} dB" for s in d.steps)
    caption = (
        "Root mean square error of the FRFs' amplitudes after each step, on the lines of the fit and on "
        "lines held out from it. The grey floor is measurement noise and mesh error."
    )
    return shown.figure("staircase", f"{alt}; noise floor {d.noise_floor_db:.2f} dB.", caption, ["staircase"])


def _structure(result: RunResult, shown: Shown) -> Markup:
    d = result.diagnosis
    m = d.problem.data.measurement
    effects = [words.effect_label(f.effect.kind, f.effect.where) for f in d.findings]
    form = [f"{words.place(f.where)} {words.departure_label(f)}" for f in d.departures]
    found = ", ".join([*effects, *form])
    many = f"{counted(len(m.sensors), 'sensor')} and {counted(len(m.excitations), 'excitation')}"
    alt = f"The structure with {many}"
    if found:
        alt += f"; marked: {found}"
    caption = (
        "Sensors in the colours of their error once the uncertain parameters are fitted"
        + ("; rings mark what was found." if found else ".")
        + " A click on a sensor shows its FRFs below."
    )
    return shown.figure("model", f"{alt}.", caption, ["structure"], hint=TURN)


def how_sure(result: RunResult) -> Markup:
    """Return how sure the verdict is, the errors of the steps, and advice."""
    advice = (
        [tag("h3", "Advice"), bullets(words.advice(result))]
        if result.diagnosis.verdict == UNEXPLAINED
        else []
    )
    return section("How sure", bullets(confidence(result)), _steps(result), *advice)


def _steps(result: RunResult) -> Markup:
    d = result.diagnosis
    head = ["step", "fitted lines [dB]", "held-out lines [dB]", "residual level [dB]"]
    rows = [
        [
            words.step_label(s.label),
            cells.db(s.fit_db),
            cells.db(s.held_out_db),
            cells.db(s.level * DB_PER_NEPER),
            *(cells.db(e[k]) for e in result.held_out_channels.values()),
        ]
        for k, s in enumerate(d.steps)
    ]
    head += [f"{name}, held out [dB]" for name in result.held_out_channels]
    return join(
        [
            table(head, rows, numbers=range(1, len(head))),
            paragraph(
                "Errors are root mean squares of 20 lg |H computed / H measured|. The residual level "
                f"{'also counts the phase, ' if d.problem.data.phase else ''}weighs outliers less, and has "
                "small errors of single modes set right. " + _ranked_by(d)
            ),
        ]
    )


def _ranked_by(d: Diagnosis) -> str:
    """Return by what the search has ranked hypotheses; nothing where none was made."""
    if not d.posterior:
        return ""
    return (
        "Hypotheses are ranked by their evidence, each of up to four bands having an error level of its own; "
        "held-out lines do not count."
    )
