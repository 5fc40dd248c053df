"""The missing effects, the evidence for them, and measurements that would distinguish rivals."""

import math

from dovetail.report import cells, planning, words
from dovetail.report.blocks import (
    Block,
    Group,
    Heading,
    Items,
    Pick,
    Picture,
    ReportSection,
    TableBlock,
    Text,
)
from dovetail.report.sections import explanations, rounds
from dovetail.report.sections.how_sure import best_of
from dovetail.report.shown import TURN, Shown, choice
from dovetail.result import RunResult, by_any, by_frfs
from fem.model import inverse
from updating.diagnosis.findings import EffectParameter, Finding, Ranked
from updating.diagnosis.separation import Proposal
from updating.diagnosis.verdict import FAULT, NOTHING, UNEXPLAINED, UNFINISHED, Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the found effects or explanations, their evidence, and measurements that would tell rivals."""
    d = result.diagnosis
    blocks: list[Block] = _found(d) if d.findings else _nothing_found(result, shown)
    if d.modes is not None:
        blocks.append(explanations.credible(d))
    blocks += explanations.page(d, shown)
    for k, finding in enumerate(d.findings):
        if k < len(d.rounds):  # not of effects that were added by hand
            blocks += [*_why(d, finding, d.rounds[k]), *_decided(d, k, shown.album[f"decides-{k + 1}"])]
        for twin, proposals in zip(finding.alternatives, finding.proposals, strict=False):
            blocks += _separated(finding, twin, proposals)
    text = (
        "Standard deviations are linearised and hold if the effect is the right one; the uncertain "
        "parameters vary with it. Brackets hold the interval of one standard deviation of the fitted "
        "compliance or logarithm, where it is wide."
    )
    if by_frfs(d):
        text += (
            " The residual beyond noise counts in them as an error of the model that is much the same at "
            "neighbouring lines; a model that is wrong all over may shift values by more."
        )
    some = d.findings or d.modes is not None
    title = "Missing effects" if d.baseline is None else "What has changed"
    return ReportSection(title, [*blocks, *([Text(text)] if some else [])])


def _found(d: Verdict) -> list[Block]:
    """Return the found effects with their values."""
    rows = []
    for f in d.findings:
        for p in f.parameters:
            std = "–" if p.at_bound else cells.percent(p.std, p.value)
            label = words.effect_label(f.effect.kind, f.effect.where)
            first = words.as_stiffness(p)
            for form in filter(None, (first, first.reciprocal)):
                value = words.fitted_text(form)
                rows.append([label, form.name.replace("_", " "), value, _absent(f, p, form), std])
                label = std = ""
    head = ["effect", "parameter", "value ± std", "model has", "std [%]"]
    return [TableBlock(head, rows, numbers=(2, 3, 4))]


def _absent(finding: Finding, found: EffectParameter, form: EffectParameter) -> str:
    """Return the model's value of a found parameter in one of its forms, a dash where it has none."""
    of = next((p for p in finding.effect.parameters() if p.name == found.name), None)
    absent = math.nan if of is None else of.absent if form.name == found.name else inverse(of.absent)
    if absent == form.value or (form.name == "compliance" and math.isinf(absent)):
        return "–"
    return words.with_unit(absent, form.unit, like=words.near(absent, form.value))


def _why(d: Verdict, finding: Finding, ranked: tuple[Ranked, ...]) -> list[Block]:
    accepted = next((r for r in ranked if r.name == finding.effect.name), None)
    known = [(accepted, "accepted"), *((t, "twin") for t in finding.alternatives)]
    extensions = [*finding.extensions, *(r for r in ranked if r.extends(finding.effect))]
    known += [(r, "contains it") for r in dict.fromkeys(extensions)][:2]
    equal = {r.name for r in finding.equal_fits}
    known += [(r, "fits as well") for r in finding.equal_fits]
    if finding.rival is not None and finding.rival.name not in equal:
        known.append((finding.rival, "best other"))
    twins = (
        "Twins explain the data nearly as well; only knowledge of the structure can decide between them."
        if finding.alternatives
        else "No candidate without it explains the data nearly as well."
    )
    if finding.equal_fits:
        twins = (
            "Other candidates fit the data as well. Their priors make them less probable: odds against each "
            "place and change, and the ranges of their parameters. The data do not decide."
        )
    text = (
        f"{twins} Similarity is the correlation of two effects' changes of the FRFs; 1 means that these "
        "sensors cannot distinguish them."
    )
    return [
        Heading(f"Why {words.effect_label(finding.effect.kind, finding.effect.where)}"),
        rounds.block([(r, what) for r, what in known if r is not None], (0,) if accepted else (), d.model),
        Text(text),
    ]


def _decided(d: Verdict, k: int, picture: Picture | None) -> list[Block]:
    """Say which FRFs and bands prefer the effect to its rival."""
    finding = d.findings[k]
    heading = Heading("Deciding evidence")
    against = finding.rival or next(iter(finding.alternatives), None)
    if against is None:
        return [heading, Text(words.no_rival_text(d, finding, d.rounds[k]))]
    if not finding.decisive:
        return []
    first = finding.decisive[0]
    n = words.digits_apart(first.first_db, [first.second_db])
    lead = (
        f"With {words.ranked_label(against)} instead, the FRF {first.output} / {first.input} between "
        f"{first.band[0]:.4g} and {first.band[1]:.4g} Hz is {first.second_db:.{n}f} dB off at its best "
        f"parameters, and {first.first_db:.{n}f} dB off with the effect. The data that favour the effect "
        "most, with its error and that of the rival:"
    )
    pieces = [(words.decisive_text(each), " ", Pick(each.output, each.input)) for each in finding.decisive]
    return [heading, Text(lead), Items(pieces), Group("off", [picture])]


def _separated(finding: Finding, twin: Ranked, proposals: tuple[Proposal, ...]) -> list[Block]:
    """Return the next measurement that would tell the effect from a twin."""
    effect = words.effect_label(finding.effect.kind, finding.effect.where)
    rows = [
        [words.proposal_text(p), f"{p.difference_db:.2f}", words.evidence_text(p.evidence)]
        for p in proposals[:6]
    ]
    head = ["measurement", "difference of the predictions [dB]", "odds to expect"]
    none = Text("No sensor, force or band that was tried would separate them.")
    text = (
        "Odds are ratios of likelihoods, after the wrong hypothesis has been fitted again to all data and "
        "if the new data are as good as the present ones. A new sensor counts with the present forces, a "
        "new force with the present sensors."
    )
    heading = Heading(f"To distinguish {effect} from {words.ranked_label(twin)}")
    return [heading, TableBlock(head, rows, numbers=(1, 2)) if rows else none, Text(text)]


def _nothing_found(result: RunResult[Verdict], shown: Shown) -> list[Block]:
    d = result.diagnosis
    best, looked_at = best_of(d.rounds), len(d.candidates)
    gained = (
        f" The best, {words.ranked_label(best)} ({words.parameters_text(best.parameters)}), lowers the "
        f"error from {d.steps[-1].fit_db:.2f} to {best.fit_db:.2f} dB."
        if best
        else ""
    )
    kinds = sorted({e.kind.replace("_", " ") for e in d.candidates})
    text = {
        NOTHING: (
            "Nothing that these data can show. This does not prove that the model is right where no mode "
            "of the band strains it."
            if not (by_frfs(d) and d.more_than_noise)
            else "Nothing that stands out from the error of beam theory."
        ),
        FAULT: "Nothing, once the sensors below are corrected.",
        UNEXPLAINED: (
            "Something, but none of the candidates. The model should not be trusted for its purpose "
            "until the cause is known."
        ),
    }.get(d.verdict, d.reason)
    were = "were to be examined" if d.verdict == UNFINISHED else "were examined"
    looked = f"{looked_at} candidates {were}: {', '.join(kinds)}.{gained}"
    tried = Text(looked if looked_at else "There were no candidates.")
    return [Text(text), *_excluded(result, shown), tried]


def _excluded(result: RunResult[Verdict], shown: Shown) -> list[Block]:
    """Return which sizes of effects the data would have shown, and where."""
    if result.excluded is None:
        return []
    figure = shown.figure(
        "excluded",
        "The structure coloured by the sizes above; the list above the figure chooses the effect.",
        "Smallest size of an effect that would have been seen at each place. "
        "Where it may have several directions, the colour is that of the largest size. Point at a place "
        "for all of them.",
        tools=choice("effect", list(result.excluded.kinds)),
        hint=TURN,
    )
    tables = planning.tables_of_excluded(result.excluded)
    return [*(b for text, table in tables for b in (Text(text), TableBlock(*table.texts()))), figure]
