"""The report of an update: one HTML file with the changes, their uncertainty, and doubts."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.ensemble.bootstrap import Bootstrap, sentences
from dovetail.report.blocks import Group, Items, Picture, Report, ReportSection, TableBlock, Text
from dovetail.result import PICTURES, REPORT, parameter_in_words
from dovetail.update import StudyUpdate, errors_before_and_after
from fem.model import Model

if TYPE_CHECKING:
    from updating.correlation.pairing import ModeComparison
    from updating.inference.updated import UpdatedParameter


def write_update_report(
    result: StudyUpdate, unsaid: tuple[str, ...], folder: Path, refits: Bootstrap | None = None
) -> None:
    """Write the report and its pictures into a folder."""
    from dovetail.report.page import report_page
    from updating.measurement.computed import computed_frf
    from viz.correlation import plot_mode_pairs
    from viz.curves import plot_frf
    from viz.modal import plot_stabilisation
    from viz.style import save
    from viz.updating import plot_bootstrap, plot_convergence, plot_correlation, plot_parameters

    u, study = result.updated, result.study
    pictures = folder / PICTURES
    pictures.mkdir()

    def picture(name: str, figure: Any, caption: str) -> Picture:
        return Picture(save(figure, pictures / f"{name}.png"), caption, caption)

    words = [*study.warnings, *u.messages, *result.notes, *unsaid]
    parameters = picture(
        "parameters", plot_parameters(u), "Change from the start, with 95 % intervals and priors."
    )
    sections = [
        ReportSection("Parameters", (_parameter_table(result), parameters)),
        ReportSection("Doubts", (Items(words),)),
    ]
    if result.after is not None and result.before is not None:
        caption = "Measured modes and those of the updated model."
        drawn = picture("modes", plot_mode_pairs(result.after), caption)
        sections.append(ReportSection("Modes", (_mode_table(result.before, result.after), drawn)))
    if result.identified is not None:
        data = study.measurements[0].frf
        caption = "Mode indicators, poles of all orders, and the modes that were taken."
        drawn = picture("stabilisation", plot_stabilisation(data, result.identified), caption)
        sections.append(ReportSection("Identified modes", (drawn,)))
    m = result.measurement
    if m is not None:
        frf = m.frf.select(lines=m.frf.frequency > 0, band=study.band)
        models = {
            label: computed_frf(model, m.sensors, m.excitations, frf.frequency, frf.kind)
            for label, model in (("at the start", study.model), ("updated", u.model))
        }
        caption = "Measured FRFs, and those of the model at the start and at the end."
        sections.append(ReportSection("FRFs", (picture("frfs", plot_frf(frf, models), caption),)))
    if refits is not None:
        caption = "Refits of resamples (5 to 95 %, median) and the linearised interval of as many per cent."
        drawn = picture("bootstrap", plot_bootstrap(u, refits.values), caption)
        sections.append(
            ReportSection(
                "Bootstrap", (_bootstrap_table(refits, result.study.model), drawn, Items(sentences(refits)))
            )
        )
    steps = [picture("convergence", plot_convergence(u), "Errors and parameters over the steps.")]
    if len(u.parameters) > 1:
        steps.append(picture("correlation", plot_correlation(u), "Correlations of the estimates."))
    sections += [
        ReportSection("How it came about", steps),
        ReportSection("Notes on the mesh file", (Items(study.model.mesh.notes),)),
        ReportSection("Notes on the measured files", (Items(study.measured_notes),)),
        ReportSection("Assumptions", (Items(study.assumptions),)),
    ]
    verdict = (
        Text(f"Updated to {' and '.join(result.to)}", "kind"),
        Text(f"{u.ending.value[0]}: {u.ending.cause}", "value"),
        *map(Text, errors_before_and_after(result)),
    )
    first = Group("verdict " + ("nothing" if u.converged else "unexplained"), verdict)
    report = Report(study.name, "updated", (first,), sections)
    (folder / REPORT).write_text(report_page(report), encoding="utf-8")


def _parameter_table(result: StudyUpdate) -> TableBlock:
    u = result.updated
    related = [_most_correlated(result, i) for i in range(len(u.parameters))]
    rows = [(*_cells(p, result.study.model), other) for p, other in zip(u.parameters, related, strict=True)]
    head = ["parameter", "unit", "start", "bounds", "prior", "value", "std", "95 % interval", "change"]
    return TableBlock([*head, "most correlated with"], rows, numbers=range(2, 9), at_most=60)


def _bootstrap_table(found: Bootstrap, model: Model) -> TableBlock:
    """Return the standard deviations of the refits and the linearised ones."""
    std, bias, error, q = found.std, found.bias, found.bias_error, found.quantiles.value
    rows = [
        (
            parameter_in_words(model, p.name, p.unit),
            p.unit,
            f"{p.value:.5g}",
            f"{p.std:.3g}" if np.isfinite(p.std) else "-",
            f"{std[k]:.3g}",
            f"{bias[k]:.2g} ± {error[k]:.2g}",
            *(f"{v:.5g}" for v in q[:, k]),
        )
        for k, p in enumerate(found.updated.parameters)
    ]
    head = ["parameter", "unit", "value", "linearised std", f"std of {found.n} refits", "bias"]
    return TableBlock([*head, "5 %", "median", "95 %"], rows, numbers=range(2, 9), at_most=60)


def _cells(p: "UpdatedParameter", model: Model) -> tuple[str, ...]:
    low, high = p.interval(0.95)
    prior = "-" if p.prior_std is None else f"{100 * p.prior_std:.3g} %" if p.log else f"{p.prior_std:.3g}"
    mark = " at its bound" if p.at_bound else "" if p.determined else " not determined"
    return (
        parameter_in_words(model, p.name, p.unit),
        p.unit,
        f"{p.start:.5g}",
        f"{p.lower:.4g} to {p.upper:.4g}",
        prior,
        f"{p.value:.5g}",
        f"{p.std:.2g}" if np.isfinite(p.std) else "-",
        f"{low:.5g} to {high:.5g}" if np.isfinite(p.std) else "-",
        p.change + mark,
    )


def _most_correlated(result: StudyUpdate, i: int) -> str:
    row = np.abs(result.updated.correlation[i]).copy()
    row[i] = 0.0
    if row.size < 2 or not row.max() > 0.5:
        return "-"
    k = int(np.argmax(row))
    p = result.updated.parameters[k]
    return (
        f"{parameter_in_words(result.study.model, p.name, p.unit)} ({result.updated.correlation[i, k]:+.2f})"
    )


def _mode_table(before: "ModeComparison", after: "ModeComparison") -> TableBlock:
    def by_measured(c: "ModeComparison") -> dict[int, tuple[float, float]]:
        return {i: (float(c.frequency_computed[j]), float(c.mac[i, j])) for i, j in c.pairs}

    first, last = by_measured(before), by_measured(after)
    rows = []
    for i, f in enumerate(after.frequency_measured):
        cells = [str(i + 1), f"{f:.4g}"]
        for found in (first, last):
            if i in found:
                g, likeness = found[i]
                cells += [f"{g:.4g}", f"{100 * (g / f - 1):+.2f}", f"{likeness:.3f}"]
            else:
                cells += ["-", "-", "-"]
        rows.append(cells)
    head = ["mode", "measured [Hz]", "start [Hz]", "error [%]", "MAC", "updated [Hz]", "error [%]", "MAC"]
    return TableBlock(head, rows, numbers=range(8))
