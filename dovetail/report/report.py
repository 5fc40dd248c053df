"""The report: one HTML file with everything in it, for an engineer who has not seen the study before."""

import ast
import importlib
import inspect
import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from dovetail.report import words
from dovetail.report.page import (
    Markup,
    bullets,
    facts,
    folded,
    image,
    join,
    page,
    paragraph,
    section,
    table,
    tag,
)
from dovetail.report.pictures import Album, Picture, held_out_bands
from dovetail.result import RunResult, Uncertain, least_frac, program_version
from fem.io.atomic import replacing
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnose import EFFECT, FAULT, NOTHING, UNEXPLAINED
from updating.diagnosis.findings import Finding, Ranked
from updating.diagnosis.separation import Proposal
from updating.inference.fit_data import TRANSVERSE, FitData

CLASS = {EFFECT: "effect", NOTHING: "nothing", FAULT: "fault", UNEXPLAINED: "unexplained"}

MODULES = (
    "updating.diagnosis.acceptance", "updating.diagnosis.search", "updating.diagnosis.diagnose",
    "updating.inference.preparation", "updating.inference.fit", "updating.inference.fit_data",
    "updating.inference.fit_function", "updating.quality.fault_hypotheses",
    "updating.quality.sensor_faults", "updating.quality.faults",
)  # fmt: skip
"""Modules whose constants decide the verdict; the report lists them."""


RANKING = [
    "candidate",
    "value ± std",
    "level [dB]",
    "fitted lines [dB]",
    "held-out lines [dB]",
    "similarity [-]",
]


def write_report(result: RunResult, album: Album, path: Path) -> None:
    """Write the report, whole or not at all."""
    with replacing(path) as scratch:
        scratch.write_text(report_html(result, album), encoding="utf-8")


def report_html(result: RunResult, album: Album) -> str:
    """Return the report as one HTML page that loads nothing else."""
    parts = [
        _verdict(result, album),
        _warnings(result),
        _compared(result, album),
        _gates(result),
        _misfit(result, album),
        _missing(result, album),
        _search(result, album),
        _frfs(result, album),
        _modes(result, album),
        _uncertain(result),
        _faults(result),
        _notes(result, album),
        _assumptions(result),
        _about(result),
    ]
    return page(f"{result.study.name}: {result.diagnosis.verdict}", *parts)


def _figure(picture: Picture | None, class_: str = "") -> Markup:
    return image(picture.file, picture.alt, picture.caption, class_) if picture else Markup()


# -------------------------------------------------------------------------------------------------- verdict


def _verdict(result: RunResult, album: Album) -> Markup:
    d, study = result.diagnosis, result.study
    values = [tag("p", words.finding_text(f), class_="value") for f in d.findings]
    box = tag(
        "div",
        tag("p", f"Verdict: {d.verdict}", class_="kind"),
        tag("p", words.headline(result), class_="sentence"),
        *values,
        tag("p", f"{d.reason[:1].upper()}{d.reason[1:]}.", class_="why"),
        class_=f"verdict {CLASS.get(d.verdict, 'unexplained')}",
    )
    more = [tag("p", study.description)] if study.description else []
    advice = [tag("h3", "What would help"), bullets(words.advice(result))] if d.verdict == UNEXPLAINED else []
    return tag(
        "header",
        tag("h1", study.name),
        *more,
        box,
        tag("h3", "How sure"),
        bullets(words.confidence(result)),
        _figure(album["staircase"]),
        _steps(result),
        *advice,
    )


def _steps(result: RunResult) -> Markup:
    d = result.diagnosis
    head = ["step", "fitted lines [dB]", "held-out lines [dB]", "residual level [dB]"]
    rows = [
        [
            words.step_label(s.label),
            _db(s.fit_db),
            _db(s.held_out_db),
            _db(s.level * DB_PER_NEPER),
            *(_db(e[k]) for e in result.held_out_channels.values()),
        ]
        for k, s in enumerate(d.steps)
    ]
    head += [f"{name}, held out [dB]" for name in result.held_out_channels]
    return join(
        [
            table(head, rows, numbers=range(1, len(head))),
            paragraph(
                "Errors are root mean squares of 20 lg |H computed / H measured|. The residual level "
                "also counts the phase and weighs outliers less. Candidates are ranked by how likely "
                "the data are with them, each of up to four bands having an error level of its own; held-out "
                "lines count as well."
            ),
        ]
    )


def _db(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"


# ------------------------------------------------------------------------------------------ what was compared


def _compared(result: RunResult, album: Album) -> Markup:
    d, study = result.diagnosis, result.study
    data = d.problem.data
    rows = []
    for m in study.measurements:
        f = m.frf.frequency
        force = f"{m.force_level:g}" if m.force_level else "–"
        rows.append(
            [
                m.name,
                str(m.frf.kind),
                m.frf.kind.unit,
                len(m.frf.outputs),
                len(m.frf.inputs),
                m.frf.n_freq,
                f"{f[0]:g} to {f[-1]:g}",
                force,
            ]
        )
    head = ["data", "kind", "unit", "responses", "forces", "lines", "band [Hz]", "force [N]"]
    mesh = study.model.mesh
    return section(
        "What was compared",
        _figure(album["structure"]),
        table(head, rows, numbers=(3, 4, 5), caption="Measured FRFs"),
        facts(
            [
                (
                    "band compared",
                    f"{data.frequency[0]:g} to {data.frequency[-1]:g} Hz, {data.frequency.size} lines",
                ),
                ("held out", _held_out_words(result)),
                ("values that count", _counted(data, result.study.model_error)),
                ("noise", f"{d.noise_db:.2f} dB, from {data.measurement.noise_source}"),
                (
                    "model",
                    f"{len(mesh.members)} members, {mesh.n_lines} beam elements, {mesh.n_points} points",
                ),
            ]
        ),
        folded(
            f"{len(study.sensors)} sensors and {len(study.excitations)} excitations", _sensor_places(result)
        ),
    )


def _gates(result: RunResult) -> Markup:
    gates = result.diagnosis.gates
    if gates is None:
        return Markup()
    rows = [[c.name, c.outcome, f"{c.found[:1].upper()}{c.found[1:]}."] for c in gates.checks]
    return section(
        "Gates first",
        paragraph(
            "What was asked of the measurement before effects were searched for. What failed is set right, "
            "counted as noise, or stays a warning beside the verdict."
        ),
        table(["gate", "outcome", "what was found"], rows),
    )


def _held_out_words(result: RunResult) -> str:
    data = result.diagnosis.problem.data
    bands = held_out_bands(result)
    text = (
        f"{int(data.held_out.sum())} lines in {len(bands)} bands: "
        + ", ".join(f"{a:.4g}–{b:.4g}" for a, b in bands)
        + " Hz"
        if bands
        else "no lines"
    )
    return "; ".join([text, *result.held_out_channels])


def _counted(data: FitData, model_error: float) -> str:
    mask = np.broadcast_to(data.mask, data.H.shape)
    silent = [
        f"{o}/{i}"
        for r, o in enumerate(data.measurement.frf.outputs)
        for c, i in enumerate(data.measurement.frf.inputs)
        if not mask[:, r, c].any()
    ]
    text = (
        f"{100 * mask.mean():.0f} % of all; left out are FRFs that are zero by symmetry "
        "and lines with too much noise"
    )
    if model_error > 0:
        text += (
            f", and readings that {100 * TRANSVERSE:.0f} % of the motion across their sensor may have made"
        )
    if silent:
        text += f". Left out as a whole: {', '.join(silent[:12])}" + (
            f" and {len(silent) - 12} more" if len(silent) > 12 else ""
        )
    return text


def _sensor_places(result: RunResult) -> Markup:
    rows = []
    for word, sensors in (("sensor", result.study.sensors), ("excitation", result.study.excitations)):
        for s in sensors:
            rows.append(
                [
                    s.name,
                    word,
                    *(f"{x:.4g}" for x in s.point),
                    " ".join(f"{x:g}" for x in np.round(s.direction, 4) + 0.0),
                ]
            )
    return table(
        ["name", "what", "x [m]", "y [m]", "z [m]", "direction"], rows, numbers=(2, 3, 4), at_most=1000
    )


# --------------------------------------------------------------------------------------------- where it fails


def _misfit(result: RunResult, album: Album) -> Markup:
    after = [_figure(album[name]) for name in ("misfit-final", "misfit-bands-final")]
    return section(
        "Where it fails",
        paragraph(
            "The model with its uncertain parameters fitted and nothing added. One that lacks nothing is "
            "equally good "
            "everywhere; a missing effect shows near it, or in the modes that strain it."
        ),
        _figure(album["misfit-fitted"]),
        _figure(album["misfit-bands-fitted"]),
        *_shares(result),
        folded("The same with what was found", *after) if any(after) else "",
        folded("Error of each sensor", _sensor_errors(result)),
    )


def _shares(result: RunResult) -> list[Markup]:
    where = result.localisation
    if where is None:
        return []
    shares = [*((f"member {m}", s) for m, s in where.members.items()), *where.places]
    rows = [
        [words.place(name), f"{100 * s:.0f}"] for name, s in sorted(shares, key=lambda t: -t[1]) if s >= 0.005
    ]
    return [
        tag("h3", "Where a small change would help"),
        table(["place", "share of the misfit [%]"], rows, numbers=(1,), at_most=8)
        if rows
        else paragraph(
            "Nowhere: no small change of any member, joint or support explains a share of the misfit."
        ),
        paragraph(where.note),
    ]


def _sensor_errors(result: RunResult) -> Markup:
    first, last = result.comparisons[0], result.comparisons[-1]
    middle = result.comparisons[min(1, len(result.comparisons) - 1)]
    columns = [c.by_sensor() for c in (first, middle, last)]
    frac = least_frac(last)
    order = np.argsort(-np.nan_to_num(columns[1]), kind="stable")
    rows = [
        [first.outputs[i], *(_db(float(c[i])) for c in columns), _number(float(frac[i]), 3)] for i in order
    ]
    head = ["sensor", "nominal [dB]", "fitted [dB]", "in the end [dB]", "least FRAC in the end [-]"]
    return table(head, rows, numbers=(1, 2, 3, 4))


# -------------------------------------------------------------------------------------------- what is missing


def _missing(result: RunResult, album: Album) -> Markup:
    d = result.diagnosis
    if not d.findings:
        chance = [_figure(p) for p in album.starting("chance-")]
        return section("What is missing", *_nothing_found(result), *chance)
    rows = [
        [
            words.effect_label(f.effect.kind, f.effect.where),
            p.name.replace("_", " "),
            words.fitted_text(p),
            _absent(f, p.name),
            "–" if p.at_bound else _percent(p.std, p.value),
        ]
        for f in d.findings
        for p in f.parameters
    ]
    parts = [
        table(["effect", "parameter", "value ± std", "model has", "std [%]"], rows, numbers=(2, 3, 4)),
    ]
    for k, finding in enumerate(d.findings):
        if not finding.without:
            parts.append(_why(finding, d.rounds[k] if k < len(d.rounds) else ()))
        parts.append(_decided(finding, album[f"decides-{k + 1}"]))
        parts += [_separated(finding, t, p) for t, p in zip(finding.twins, finding.proposals, strict=False)]
    parts.append(
        paragraph(
            "Standard deviations are linearised and hold if the effect is the right one; the uncertain "
            "parameters vary with it. What is left beyond noise counts in them as an error of the model that "
            "is much the same at neighbouring lines; a model that is wrong all over may shift values by more."
        )
    )
    parts += [_figure(p) for p in album.starting("chance-")]
    return section("What is missing", *parts)


def _absent(finding: Finding, name: str) -> str:
    """Return the model's value of a found parameter, a dash where it has none."""
    absent = next((p.absent for p in finding.effect.parameters() if p.name == name), math.nan)
    p = next(p for p in finding.parameters if p.name == name)
    return "–" if absent == p.value else words.with_unit(absent, p.unit, like=words.near(absent, p.value))


def _percent(std: float, value: float) -> str:
    if not value or not math.isfinite(std) or std <= 0:
        return "–"
    share = 100 * std / abs(value)
    return f"{share:.2g}" if share < 1000 else "> 1000"


def _why(finding: Finding, ranked: tuple[Ranked, ...]) -> Markup:
    own = next((r for r in ranked if r.name == finding.effect.name), None)
    known = [(own, "accepted"), *((t, "twin") for t in finding.twins)]
    known.append((words.rival_of(finding, ranked), "best other"))
    rows = [
        [_tagged(r, what), words.parameters_text(r.parameters), *_errors(r), f"{r.similarity:.2f}"]
        for r, what in known
        if r is not None
    ]
    twins = (
        "Twins bring nearly the same reduction; which of them it is only knowledge of the structure can say."
        if finding.twins
        else "No candidate brings nearly the same reduction."
    )
    return join(
        [
            tag("h3", f"Why {words.effect_label(finding.effect.kind, finding.effect.where)}"),
            table(RANKING, rows, numbers=(2, 3, 4, 5), marked=(0,) if own else ()),
            paragraph(
                f"{twins} Similarity is the correlation of what two effects do to the FRFs; 1 means that "
                "these "
                "sensors cannot tell them apart."
            ),
        ]
    )


def _decided(finding: Finding, picture: Picture | None) -> Markup:
    """Say which FRFs and bands prefer the effect to its rival."""
    against = finding.rival or (finding.twins[0] if finding.twins else None)
    if against is None or not finding.decisive:
        return Markup()
    first = finding.decisive[0]
    lead = (
        f"Were it {words.ranked_label(against)} instead, the FRF {first.output} / {first.input} between "
        f"{first.band[0]:.4g} and {first.band[1]:.4g} Hz would be {first.second_db:.1f} dB off even with the "
        f"best values of its parameters; it is {first.first_db:.1f} dB off. The pieces that speak most for "
        "the effect, with the error with it and with its rival:"
    )
    return join(
        [
            tag("h3", "What decides"),
            paragraph(lead),
            bullets([words.decisive_text(piece) for piece in finding.decisive]),
            _figure(picture),
        ]
    )


def _separated(finding: Finding, twin: Ranked, proposals: tuple[Proposal, ...]) -> Markup:
    """Say what to measure next to tell the effect from a twin."""
    own = words.effect_label(finding.effect.kind, finding.effect.where)
    rows = [
        [words.proposal_text(p), f"{p.difference_db:.2f}", words.evidence_text(p.evidence)]
        for p in proposals[:6]
    ]
    head = ["measurement", "difference of the predictions [dB]", "odds to expect"]
    return join(
        [
            tag("h3", f"To tell {own} from {words.ranked_label(twin)}"),
            table(head, rows, numbers=(1, 2))
            if rows
            else paragraph("No sensor, force or band that was tried would separate them."),
            paragraph(
                "Odds are those of the likelihoods once the wrong one has been fitted again to all data, if "
                "the new data are as good as the present ones. A sensor counts with the present forces, a "
                "force with the present sensors."
            ),
        ]
    )


def _tagged(r: Ranked, what: str) -> Markup:
    return join([words.ranked_label(r), " ", tag("span", what, class_="tag") if what else ""])


def _errors(r: Ranked) -> list[str]:
    return [_db(r.level * DB_PER_NEPER), _db(r.fit_db), _db(r.held_out_db)]


def _nothing_found(result: RunResult) -> list[Markup]:
    d = result.diagnosis
    best, looked_at = words.best_of(d.rounds), len(d.candidates)
    gained = (
        f" The best, {words.ranked_label(best)} ({words.parameters_text(best.parameters)}), lowers the "
        f"residual level from {d.steps[-1].level * DB_PER_NEPER:.2f} to {best.level * DB_PER_NEPER:.2f} "
        "dB."
        if best
        else ""
    )
    kinds = sorted({e.kind.replace("_", " ") for e in d.candidates})
    text = {
        NOTHING: (
            "Nothing that these data can show. This does not prove that the model is right where no mode "
            "of the band strains it."
            if not d.more_than_noise
            else "Nothing that stands out from what beams leave of any structure."
        ),
        FAULT: "Nothing, once the sensors below are set right.",
        UNEXPLAINED: (
            "Something, but none of the candidates. The model should not be trusted for what it was made "
            "for until the cause is known."
        ),
    }.get(d.verdict, d.reason)
    return [
        paragraph(text),
        paragraph(
            f"{looked_at} candidates were looked at: {', '.join(kinds)}.{gained}"
            if looked_at
            else "There were no candidates."
        ),
    ]


# ------------------------------------------------------------------------------------------------- the search


def _search(result: RunResult, album: Album) -> Markup:
    d = result.diagnosis
    if not any(d.rounds):
        return Markup()
    parts = [
        paragraph(
            "Each round looks at every candidate on a grid of its parameters (of very many, at those on a "
            "short list), fits the promising ones quickly, together with the uncertain parameters, and the "
            "best of these fully. The best is accepted if the residual level falls enough, on the lines of "
            "the fit and on held-out lines, or if it is the first and makes the data much more likely, as "
            "in a part of the band; then the search is repeated with it. Those that were fitted are listed."
        )
    ]
    for k, ranked in enumerate(d.rounds):
        if not ranked:  # in the model before the search
            continue
        body = join(
            [
                _figure(album[f"ranking-{k + 1}"]),
                _ranking(ranked, d.findings[k] if k < len(d.findings) else None, k),
            ]
        )
        parts.append(body if len(parts) == 1 else folded(f"Round {k + 1}: {_outcome(result, k)}", body))
    return section("How the candidates did", *parts)


def _outcome(result: RunResult, k: int) -> str:
    d = result.diagnosis
    if k < len(d.findings):
        f = d.findings[k]
        return f"{words.effect_label(f.effect.kind, f.effect.where)} is accepted"
    return "no candidate improves the model enough; the search ends"


def _ranking(ranked: tuple[Ranked, ...], finding: Finding | None, k: int) -> Markup:
    twins = {t.name for t in finding.twins} if finding else set()
    accepted = finding.effect.name if finding else None
    rows = []
    for r in ranked:
        what = (
            "accepted"
            if r.name == accepted
            else "twin"
            if r.name in twins
            else ""
            if r.refined
            else "quick fit"
        )
        rows.append(
            [_tagged(r, what), words.parameters_text(r.parameters), *_errors(r), f"{r.similarity:.2f}"]
        )
    marked = [i for i, r in enumerate(ranked) if r.name == accepted]
    body = table(RANKING, rows, numbers=(2, 3, 4, 5), marked=marked)
    return folded(f"Round {k + 1} in numbers: {len(ranked)} candidates", body)


# ------------------------------------------------------------------------------------ FRFs, modes, parameters


def _frfs(result: RunResult, album: Album) -> Markup:
    pictures = [
        _figure(p)
        for p in (
            *album.starting("frf-error"),
            *(p for p in album.starting("frf-") if p is not album["frf-error"]),
        )
    ]
    text = "Sensors and forces are set right as in the table of faults." if result.diagnosis.faults else ""
    return section("FRFs before and after", *([paragraph(text)] if text else []), *pictures)


def _modes(result: RunResult, album: Album) -> Markup:
    rows = [
        [
            k + 1,
            _number(m.nominal, 5),
            _number(m.fitted, 5),
            _shift(m.nominal, m.fitted),
            _number(100 * m.nominal_zeta, 3),
            _number(100 * m.fitted_zeta, 3),
            f"{m.mac:.3f}" if math.isfinite(m.mac) else "–",
        ]
        for k, m in enumerate(result.modes)
    ]
    head = [
        "elastic mode",
        "nominal [Hz]",
        "fitted [Hz]",
        "change [%]",
        "damping nominal [%]",
        "damping fitted [%]",
        "MAC [-]",
    ]
    what = " and what was found" if result.diagnosis.findings else ""
    grows = (
        " A frequency below zero is that of a motion that grows: members are under more compression than "
        "they bear in the model, where forces keep their direction."
        if any(f < 0 for m in result.modes for f in (m.nominal, m.fitted))
        else ""
    )
    shapes = [p for p in album.starting("mode-") if p is not album["mode-changed"]]
    return section(
        "Natural frequencies and mode shapes",
        paragraph(
            f"Undamped modes in the band, of the nominal model and of that with fitted parameters{what}, "
            "paired by their shapes. Damping is the fitted curve and what local dampers take from each "
            f"mode.{grows}"
        ),
        table(head, rows, numbers=range(7), at_most=15),
        _figure(album["mode-changed"], "small"),
        tag("div", *(_figure(p) for p in shapes), class_="pair") if shapes else "",
    )


def _number(value: float, digits: int) -> str:
    return words.number(value, digits) if math.isfinite(value) else "–"


def _shift(before: float, after: float) -> str:
    return (
        f"{100 * (after / before - 1):+.2f}".replace("-", "−")
        if math.isfinite(before) and min(before, after) > 0
        else "–"
    )


def _uncertain(result: RunResult) -> Markup:
    rows = [[u.words, *_parameter_row(u)] for u in result.uncertain]
    bound = sum(u.at_bound for u in result.uncertain)
    text = (
        f" {bound} of them end at the edge of what was allowed, four prior standard deviations from "
        "nominal: doubt the nominal value, or widen it."
        if bound
        else ""
    )
    return section(
        "Uncertain parameters",
        paragraph(f"Fitted in every step within their prior standard deviations.{text}"),
        table(
            ["parameter", "nominal", "fitted ± std", "change [prior std]", "prior std [%]", ""],
            rows,
            numbers=(1, 2, 3, 4),
            at_most=25,
        ),
    )


def _parameter_row(u: Uncertain) -> list[object]:
    flag = tag("span", "at bound", class_="tag bound") if u.at_bound else ""
    if not math.isfinite(u.fitted):
        return [
            words.with_unit(u.nominal, u.unit),
            "replaced by the effect",
            "–",
            _percent(u.prior_std, u.nominal),
            flag,
        ]
    return [
        words.with_unit(u.nominal, u.unit),
        words.with_unit(u.fitted, u.unit, math.nan if u.at_bound else u.std),
        f"{u.moved:+.1f}".replace("-", "−") if math.isfinite(u.moved) else "–",
        _percent(u.prior_std, u.nominal),
        flag,
    ]


def _faults(result: RunResult) -> Markup:
    faults = result.diagnosis.faults
    if not faults:
        return section(
            "Faults of the measurement",
            paragraph(
                "None was found: what each sensor reads agrees with the motion that the others imply at its "
                "place, and signs and levels of the forces agree."
            ),
        )
    rows = [
        [f.sensor, words.FAULT_NAMES[f.kind], words.fault_value(f), words.fault_remedy(f)] for f in faults
    ]
    return section(
        "Faults of the measurement",
        paragraph(
            "These sensors and forces were set right before effects were searched for. A gain is what the "
            "reading carries: measured = gain × true value."
        ),
        table(["sensor or force", "fault", "value", "remedy"], rows, numbers=(2,)),
    )


# -------------------------------------------------------------------------------------------- the small print


def _warnings(result: RunResult) -> Markup:
    warnings = result.study.warnings
    return section("Check first", bullets(warnings)) if warnings else Markup()


def _notes(result: RunResult, album: Album) -> Markup:
    study = result.study
    notes = [*study.model.mesh.notes, *study.measured_notes, *result.notes, *album.failures]
    return section("Notes", bullets(notes)) if notes else Markup()


def _assumptions(result: RunResult) -> Markup:
    rows = [[tag("code", name), words.number(value), text] for name, value, text in thresholds()]
    study = result.study
    return section(
        "Assumptions and thresholds",
        bullets(study.assumptions)
        if study.assumptions
        else paragraph("The study says everything; nothing was assumed."),
        folded(
            "Thresholds of the search", table(["name", "value", "meaning"], rows, numbers=(1,), at_most=100)
        ),
        folded("The study file", tag("pre", study.text)),
    )


def thresholds() -> Iterator[tuple[str, float, str]]:
    """Yield name, value and meaning (the docstring under it) of every constant that decides a verdict."""
    for name in MODULES:
        module = importlib.import_module(name)
        body = ast.parse(inspect.getsource(module)).body
        for statement, after in pairwise(body):
            if not isinstance(statement, ast.Assign) or not isinstance(statement.targets[0], ast.Name):
                continue
            value = getattr(module, statement.targets[0].id)
            known = (
                isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
                and isinstance(after.value.value, str)
            )
            if isinstance(value, int | float) and not isinstance(value, bool):
                text = str(after.value.value) if known else ""  # pyright: ignore[reportAttributeAccessIssue]
                yield statement.targets[0].id, value, " ".join(text.replace("``", "").split())


def _program() -> str:
    version = program_version()
    return "Dovetail, not installed" if version == "unknown" else f"Dovetail {version}"


def _about(result: RunResult) -> Markup:
    d, study = result.diagnosis, result.study
    mesh = study.model.mesh
    return section(
        "About this run",
        facts(
            [
                ("study file", study.path.name),
                ("program", _program()),
                ("date", result.finished.strftime("%Y-%m-%d %H:%M %Z")),
                ("duration", f"{result.seconds:.0f} s, of which the diagnosis took {d.seconds:.0f} s"),
                (
                    "mesh",
                    f"{mesh.n_lines} elements of {1e3 * mesh.lengths().min():.3g} to "
                    f"{1e3 * mesh.lengths().max():.3g} mm, {study.model.n_dof} degrees of freedom before "
                    "constraints",
                ),
                ("error of the mesh", f"{d.discretisation_db:.2g} dB, estimated by halving every element"),
                (
                    "error of the reduced basis",
                    f"{d.basis_db:.2g} dB, against direct solutions of the full model",
                ),
                (
                    "files beside this one",
                    "result.json (for programs), frf.npz (measured and computed FRFs of each step), "
                    "pictures/",
                ),
            ]
        ),
    )
