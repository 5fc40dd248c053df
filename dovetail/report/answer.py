"""The first screen of a report: verdict, probability, staircase, and the structure with the place."""

from collections.abc import Sequence

from dovetail.file.contents import StudyContents
from dovetail.report import cells, words
from dovetail.report.blocks import Block, Group, Heading, Items, Plot, ReportSection, TableBlock, Text
from dovetail.report.confidence import confidence
from dovetail.report.drawn import STAIRCASE, staircase_alt
from dovetail.report.probable import probability_text
from dovetail.report.shown import TURN, Shown
from dovetail.result import RunResult
from fem.summary import counted
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnosis import EFFECT, FAULT, NOTHING, UNEXPLAINED, Diagnosis

CLASS = {EFFECT: "effect", NOTHING: "nothing", FAULT: "fault", UNEXPLAINED: "unexplained"}


def answer(result: RunResult, shown: Shown) -> list[Block]:
    """Return verdict and probability, with the staircase and the structure."""
    d = result.diagnosis
    values = [words.finding_text(f) for f in d.findings]
    form = [f"Form: {words.departure_text(f)}." for f in d.departures]
    doubts = [*form, words.far_text(result.uncertain)]
    box = verdict_box(d.verdict, words.headline(result), values, probability_text(d), d.reason, doubts)
    return first_screen(result.study, box, _staircase(result, shown), _structure(result, shown))


def verdict_box(
    verdict: str, headline: str, values: Sequence[str], sure: str, reason: str, doubts: Sequence[str]
) -> Group:
    """Return the verdict in words, with values, probability, reason, and what speaks for caution."""
    parts = [
        Text(f"Verdict: {verdict}", "kind"),
        Text(headline, "sentence"),
        *(Text(value, "value") for value in values),
        Text(sure, "value probability"),
        Text(f"{reason[:1].upper()}{words.directions(reason[1:])}.", "why"),
        *(Text(doubt, "value doubt") for doubt in doubts),
    ]
    return Group(f"verdict {CLASS.get(verdict, 'unexplained')}", parts)


def first_screen(study: StudyContents, box: Group, *figures: Block) -> list[Block]:
    """Return description and verdict, with the staircase and the structure."""
    return [Text(study.description), box, Group("answer", figures)]


def _staircase(result: RunResult, shown: Shown) -> Plot:
    return shown.figure("staircase", staircase_alt(result.diagnosis), STAIRCASE, ["staircase"])


def _structure(result: RunResult, shown: Shown) -> Plot:
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


def how_sure(result: RunResult) -> ReportSection:
    """Return how sure the verdict is, the errors of the steps, and advice."""
    unexplained = result.diagnosis.verdict == UNEXPLAINED
    advice = [Heading("Advice"), Items(words.advice(result))] if unexplained else []
    return ReportSection("How sure", [Items(confidence(result)), *_steps(result.diagnosis, result), *advice])


def _steps(d: Diagnosis, result: RunResult) -> list[Block]:
    channels = result.held_out_channels
    head = ["step", "fitted lines [dB]", "held-out lines [dB]", "residual level [dB]"]
    head += [f"{name}, held out [dB]" for name in channels]
    rows = []
    for k, s in enumerate(d.steps):
        errors = s.fit_db, s.held_out_db, s.level * DB_PER_NEPER, *(e[k] for e in channels.values())
        rows.append([words.step_label(s.label), *map(cells.decimals, errors)])
    text = (
        "Errors are root mean squares of 20 lg |H computed / H measured|. The residual level "
        f"{'also counts the phase, ' if d.problem.data.phase else ''}gives outliers less weight, "
        "and corrects small errors of single modes. "
    )
    if d.posterior:
        text += (
            "Hypotheses are ranked by their evidence, with a separate error level in each of up to four "
            "bands. Held-out lines do not count."
        )
    return [TableBlock(head, rows, numbers=range(1, len(head))), Text(text)]
