"""What the commands identify-modes, match and update do: load the study, call the numerics, print, write."""

import argparse
import csv
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.commands.commands import check_places, loaded, say, write_with_nodes
from dovetail.commands.labels import NodeNumbers
from dovetail.disk.output import Output, OutputError, Progress, result_folder, write_json
from dovetail.file.paths import InputFile
from dovetail.file.table import StudyError
from dovetail.update import StudyUpdate, identify_study, update_study, updated_text
from fem.io import UFF_SUFFIXES, read_uff, write_npz
from fem.io.atomic import replacing
from updating.modal.peaks import peak_words

if TYPE_CHECKING:
    from updating.correlation.pairing import ModeComparison
    from updating.inference.update import UpdatedParameter

Options = argparse.Namespace

REPORT, STUDY, JSON = "report.html", "study.toml", "update.json"


def identify_modes(options: Options, progress: Progress) -> None:
    """Print the modes in a study's FRFs with their uncertainty; draw and write them."""
    for path in (options.picture, options.synthesis):
        if path is not None and path.suffix.lower() != ".png":
            msg = f"{path}: the picture is written as .png"
            raise OutputError(msg)
    suffix = "" if options.out is None else options.out.suffix.lower()
    if suffix not in ("", ".npz", *UFF_SUFFIXES):
        msg = f"{options.out}: modes are written as .npz or .uff, not '{suffix}'"
        raise OutputError(msg)
    check_places(
        options, Output("--out", options.out), Output("--picture", options.picture),
        Output("--synthesis", options.synthesis),
    )  # fmt: skip
    study = loaded(options)
    progress("identifying modes")
    own = {"least_mpc": options.least_mpc, "largest_mpd": options.largest_mpd}
    limits = replace(study.shape_limits, **{key: value for key, value in own.items() if value is not None})
    found, data, said = identify_study(study, options.measurement, options.band, limits)
    if options.out is not None and suffix == ".npz":
        write_npz(options.out, found.modes)
    elif options.out is not None:
        nodes = NodeNumbers(study)
        names = dict(zip(data.frf.outputs, nodes.labels("outputs", data.sensors), strict=True))
        write_with_nodes(options.out, nodes, modes=found.modes, dofs=names)
    for path, kind in ((options.picture, "stabilisation"), (options.synthesis, "synthesis")):
        if path is not None:
            from viz.modal import plot_stabilisation, plot_synthesis
            from viz.style import save

            progress("drawing")
            draw = plot_stabilisation if kind == "stabilisation" else plot_synthesis
            with replacing(path) as scratch:
                save(draw(data.frf, found), scratch)
    progress.close()
    zeta = np.zeros(found.modes.n_modes) if found.modes.zeta is None else found.modes.zeta
    write_json(
        options.json,
        {
            "study": study.name,
            "measurement": data.name,
            "modes": [
                {
                    "frequency_Hz": f, "frequency_std_Hz": found.frequency_std[k],
                    "damping_ratio": zeta[k], "damping_ratio_std": found.zeta_std[k],
                    "mpc": found.mpc[k], "mpd_deg": found.mpd[k],
                    "shape": found.modes.shapes[:, k], "shape_std": found.shape_std[:, k],
                }
                for k, f in enumerate(found.modes.frequency)
            ],
            "outputs": data.frf.outputs,
            "scaled": found.scaled,
            "left_out": [
                {"frequency_Hz": c.frequency, "reason": c.reason} for c in found.candidates if not c.accepted
            ],
            "unexplained_peaks": [
                {"frequency_Hz": p.frequency, "level_dB": p.level_db, "share": p.share, "reason": p.reason}
                for p in found.unexplained
            ],
            "measured_notes": study.measured_notes,
            "warnings": (*said, *study.warnings),
        },
    )  # fmt: skip
    left = sum(not c.accepted for c in found.candidates)
    say(
        options,
        f"{study.name}: {found.modes.n_modes} mode(s) identified from {data.name}; {left} other "
        "pole(s) were tried and rejected",
        found.table(),
        *(f"warning: {text}" for text in said if text not in peak_words(found.unexplained)),
        *(f"note: {text}" for text in study.measured_notes),
    )


def match(options: Options, progress: Progress) -> None:
    """Find where the points of a test's geometry are on the model; draw it."""
    from updating.measurement.matching import match_members

    if options.picture is not None and options.picture.suffix.lower() != ".png":
        msg = f"{options.picture}: the picture is written as .png"
        raise OutputError(msg)
    geometry = InputFile(options.geometry, "the geometry")
    check_places(options, Output("--picture", options.picture), more=[geometry])
    study = loaded(options, ())
    names, points = _test_points(options.geometry)
    progress("matching")
    found, mesh = match_members(
        points, study.model.mesh, options.tolerance,
        axes="same" if options.same_axes else "any", unit=options.unit, alternative=options.alternative,
    )  # fmt: skip
    if options.picture is not None:
        from viz.correlation import plot_geometry_match
        from viz.style import save

        with replacing(options.picture) as scratch:
            save(plot_geometry_match(mesh, found, names), scratch)
    progress.close()
    rows = []
    for (i, p), distance in zip(found.pairs.tolist(), found.distance, strict=True):
        member, position, _ = mesh.nearest_on_members(mesh.points[p])
        rows.append((names[i], mesh.points[p], member, position, float(distance)))
    write_json(
        options.json,
        {
            "study": study.name,
            "scale_m": found.scale,
            "rotation": found.R,
            "translation_m": found.translation,
            "points": [
                {"name": n, "point_m": xyz, "member": m, "position_m": s, "distance_m": d}
                for n, xyz, m, s, d in rows
            ],
            "unmatched": [names[i] for i in found.unmatched],
        },
    )
    say(
        options,
        f"{study.name}: {found.describe()}",
        f"{'point':>10}  {'x m':>9} {'y m':>9} {'z m':>9}  {'off mm':>7}  member, position m",
        *(
            f"{n:>10}  {xyz[0]:9.4f} {xyz[1]:9.4f} {xyz[2]:9.4f}  {1e3 * d:7.2f}  {m}, {s:.4f}"
            for n, xyz, m, s, d in rows
        ),
        *(f"{names[i]:>10}  lies on no member within the tolerance" for i in found.unmatched),
    )


def _test_points(path: Path) -> tuple[list[str], np.ndarray]:
    """Read the points of a universal file, or of a table with name, x, y and z."""
    if path.suffix.lower() in UFF_SUFFIXES:
        points = read_uff(path).points
        if points is None:
            msg = f"{path}: it has no points (dataset 15 or 2411)"
            raise StudyError(msg)
        return [str(int(k)) for k in points.labels], points.coordinates
    suffixes = ", ".join(UFF_SUFFIXES)
    allowed = f"a table of names and three coordinates, or a universal file ({suffixes}), is needed"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.reader(file) if row and any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as reason:
        msg = f"{path}: it is no text in UTF-8; {allowed}"
        raise StudyError(msg) from reason
    names, xyz = [], []
    for k, row in enumerate(rows):
        try:
            values = [float(cell) for cell in row[1:4]]
        except ValueError:
            if k == 0:
                continue  # a heading
            values = []
        if len(values) != 3 or not np.isfinite(values).all():
            msg = f"{path}: row {k + 1} is {', '.join(row)}; {allowed}"
            raise StudyError(msg)
        names.append(row[0].strip())
        xyz.append(values)
    if not xyz:
        msg = f"{path}: it has no points; {allowed}"
        raise StudyError(msg)
    return names, np.array(xyz)


def update(options: Options, progress: Progress) -> None:
    """Update a study's model to its measurement; write a report and the study with the new values."""
    check_places(options, Output("--out", options.out, (REPORT, STUDY, JSON, "pictures")))
    study = loaded(options)
    progress("updating")
    result = update_study(study)
    text, unsaid = updated_text(study, result.updated, options.out)
    data = _update_dict(result, unsaid)
    with result_folder(options.out, options.force) as scratch:
        progress("drawing", 0.8)
        (scratch / STUDY).write_text(text, encoding="utf-8")
        write_json(scratch / JSON, data)
        _write_report(result, unsaid, scratch)
    progress.close()
    write_json(options.json, data)
    u = result.updated
    say(
        options,
        f"{study.name}: updated to {' and '.join(result.to)}; {u.ending.value[0]}",
        u.table(),
        *_errors(result),
        *(f"note: {text}" for text in (*result.notes, *unsaid, *study.measured_notes)),
        f"{options.out / REPORT} and {options.out / STUDY} are written",
    )


def _errors(result: StudyUpdate) -> list[str]:
    first, last = result.updated.path[0], result.updated.path[-1]
    out = []
    for label, a, b in (
        ("natural frequencies, rms [%]", 100 * first.frequency_error, 100 * last.frequency_error),
        ("MAC, mean", first.mac, last.mac),
        ("FRFs, rms [dB]", first.frf_db, last.frf_db),
    ):
        if np.isfinite(a) and np.isfinite(b):
            out.append(f"{label}: {a:.3g} before, {b:.3g} after")
    return out


def _update_dict(result: StudyUpdate, unsaid: tuple[str, ...]) -> dict[str, Any]:
    u = result.updated
    return {
        "study": result.study.name,
        "to": result.to,
        "ending": u.ending.value[0],
        "parameters": [
            {
                "name": p.name, "unit": p.unit, "start": p.start, "lower": p.lower, "upper": p.upper,
                "prior_std": p.prior_std, "value": p.value, "std": p.std, "interval_95": p.interval(0.95),
                "at_bound": p.at_bound, "determined": p.determined, "from_prior": p.from_prior,
                "prior_let_go": p.released,
            }
            for p in u.parameters
        ],
        "correlation": u.correlation,
        "misfit": dict(u.misfit),
        "path": [
            {
                "stage": s.stage, "values": s.values, "frequency_error": s.frequency_error, "mac": s.mac,
                "frf_db": s.frf_db,
            }
            for s in u.path
        ],
        "messages": u.messages,
        "notes": (*result.notes, *unsaid),
        "warnings": result.study.warnings,
        "mesh_notes": result.study.model.mesh.notes,
        "measured_notes": result.study.measured_notes,
    }  # fmt: skip


def _write_report(result: StudyUpdate, unsaid: tuple[str, ...], folder: Path) -> None:
    from dovetail.file.measured import sensor_rows
    from dovetail.report import page
    from fem.analysis.frf import compute_frf
    from fem.system import assemble
    from viz.correlation import plot_mode_pairs
    from viz.curves import plot_frf
    from viz.modal import plot_stabilisation
    from viz.style import save
    from viz.updating import plot_convergence, plot_correlation, plot_parameters

    u, study = result.updated, result.study
    pictures = folder / "pictures"
    pictures.mkdir()

    def picture(name: str, figure: Any, caption: str) -> page.Markup:
        return page.image(save(figure, pictures / f"{name}.png"), caption, caption)

    shown: list[page.Markup] = []
    if result.after is not None and result.before is not None:
        shown.append(page.section("Modes", _mode_table(result.before, result.after)))
        caption = "Measured modes and those of the updated model."
        shown.append(picture("modes", plot_mode_pairs(result.after), caption))
    if result.identified is not None:
        data = study.measurements[0].frf
        caption = "Poles of all orders, and the modes that were taken."
        shown.append(picture("stabilisation", plot_stabilisation(data, result.identified), caption))
    m = result.measurement
    if m is not None:
        frf = m.frf.select(lines=m.frf.frequency > 0, band=study.band)
        outputs, inputs = (sensor_rows(study.model, part) for part in (m.sensors, m.excitations))
        models = {
            label: type(frf).from_arrays(
                frf.frequency, compute_frf(assemble(model), frf.frequency, outputs, inputs, frf.kind).H,
                frf.kind, frf.outputs, frf.inputs,
            )
            for label, model in (("at the start", study.model), ("updated", u.model))
        }  # fmt: skip
        caption = "Measured FRFs, and those of the model at the start and at the end."
        shown.append(page.section("FRFs", picture("frfs", plot_frf(frf, models), caption)))
    head = ["parameter", "unit", "start", "bounds", "prior", "value", "std", "95 % interval", "change"]
    related = [_most_correlated(result, i) for i in range(len(u.parameters))]
    rows = [(*_cells(p), other) for p, other in zip(u.parameters, related, strict=True)]
    words = [*study.warnings, *u.messages, *result.notes, *unsaid]
    html = page.page(
        f"{study.name}: updated",
        page.tag("h1", study.name),
        page.tag(
            "div",
            page.tag("p", f"Updated to {' and '.join(result.to)}", class_="kind"),
            page.tag("p", f"{u.ending.value[0]}: {u.ending.cause}", class_="value"),
            *(page.paragraph(text) for text in _errors(result)),
            class_="verdict " + ("nothing" if u.converged else "unexplained"),
        ),
        page.section(
            "Parameters",
            page.table([*head, "most correlated with"], rows, numbers=range(2, 9), at_most=60),
            picture(
                "parameters", plot_parameters(u), "Change from the start, with 95 % intervals and priors."
            ),
        ),
        page.section("What to doubt", page.bullets(words)) if words else "",
        *shown,
        page.section(
            "How it came about",
            picture("convergence", plot_convergence(u), "Errors and parameters over the steps."),
            picture("correlation", plot_correlation(u), "Correlations of the estimates.")
            if len(u.parameters) > 1
            else "",
        ),
        *(
            page.section(head, page.bullets(notes))
            for head, notes in (
                ("Notes on the mesh file", study.model.mesh.notes),
                ("Notes on the measured files", study.measured_notes),
            )
            if notes
        ),
        page.section("Assumptions", page.bullets(study.assumptions)) if study.assumptions else "",
    )
    (folder / REPORT).write_text(html, encoding="utf-8")


def _cells(p: "UpdatedParameter") -> tuple[str, ...]:
    low, high = p.interval(0.95)
    prior = "-" if p.prior_std is None else f"{100 * p.prior_std:.3g} %" if p.log else f"{p.prior_std:.3g}"
    change = f"{100 * (p.value / p.start - 1):+.2f} %" if p.start else "-"
    mark = " at its bound" if p.at_bound else "" if p.determined else " not determined"
    prior += " (dropped)" if p.released else ""
    return (
        p.name, p.unit, f"{p.start:.5g}", f"{p.lower:.4g} to {p.upper:.4g}", prior, f"{p.value:.5g}",
        f"{p.std:.2g}" if np.isfinite(p.std) else "-",
        f"{low:.5g} to {high:.5g}" if np.isfinite(p.std) else "-", change + mark,
    )  # fmt: skip


def _most_correlated(result: StudyUpdate, i: int) -> str:
    row = np.abs(result.updated.correlation[i]).copy()
    row[i] = 0.0
    if row.size < 2 or not row.max() > 0.5:
        return "-"
    k = int(np.argmax(row))
    return f"{result.updated.names[k]} ({result.updated.correlation[i, k]:+.2f})"


def _mode_table(before: "ModeComparison", after: "ModeComparison") -> Any:
    from dovetail.report import page

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
    return page.table(head, rows, numbers=range(8))
