"""The measured data, and how they are compared with the model."""

import numpy as np

from dovetail.file.contents import StudyContents
from dovetail.report.blocks import Details, Facts, ReportSection, TableBlock
from dovetail.report.drawn import held_out_bands
from dovetail.report.shown import Shown
from dovetail.result import FrfResult, RunResult, by_any, has_frfs
from fem.lengths import shown_length
from fem.mesh import Mesh
from fem.summary import counted
from updating.diagnosis.verdict import Verdict
from updating.inference.fit_data import TRANSVERSE, FitData
from updating.measurement.measurement import MOTION

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the measured data, and how they are compared with the model."""
    study = result.study
    facts = [("model", model_size(study.model.mesh))]
    if not has_frfs(result):
        return ReportSection("Compared data", [_modes_table(study), Facts([*_motion_seen(study), *facts])])
    d, data = result.diagnosis, result.diagnosis.problem.data
    f = data.frequency
    facts = [
        ("band compared", f"{f[0]:g} to {f[-1]:g} Hz, {f.size} lines"),
        ("held out", _held_out_words(result)),
        ("values that count", _counted(data, study.model_error)),
        ("noise", f"{d.noise_db:.2f} dB, from {data.measurement.noise_source}"),
        *facts,
    ]
    places = f"{counted(len(study.sensors), 'sensor')} and {counted(len(study.excitations), 'excitation')}"
    tables = [_frfs_table(study), *([_modes_table(study)] if study.modes is not None else [])]
    return ReportSection("Compared data", [*tables, Facts(facts), Details(places, [_sensor_places(result)])])


def _frfs_table(study: StudyContents) -> TableBlock:
    before = study.baseline_frfs
    named = [(m.name, m) for m in study.measurements or study.amplitudes]
    named += [(f"{before.name}, the baseline", before)] if before is not None else []
    rows = []
    for name, m in named:
        frf, force = m.frf, f"{m.force_level:g}" if m.force_level else "–"
        band = f"{frf.frequency[0]:g} to {frf.frequency[-1]:g}"
        size = len(frf.outputs), len(frf.inputs), frf.n_freq
        rows.append([name, frf.quantity, frf.unit, *size, band, force])
    head = ["data", "kind", "unit", "responses", "excitations", "lines", "band [Hz]", "force [N]"]
    return TableBlock(head, rows, numbers=(3, 4, 5), caption="Measured FRFs")


def _modes_table(study: StudyContents) -> TableBlock:
    rows = []
    for name, m in (("modes", study.modes), ("baseline", study.baseline)):
        if m is None:
            continue
        f, std, zeta = m.modes.frequency, 100 * m.frequency_std, m.modes.zeta
        spread = f"{std.min():.2g}" + (f" to {std.max():.2g}" if np.ptp(std) else "")
        damped = "yes" if zeta is not None and np.isfinite(zeta).any() else "no"
        sensors, held_out = len(m.sensors) if m.has_shapes else "–", ", ".join(map(str, m.held_out)) or "–"
        rows.append([name, m.name, len(f), f"{f[0]:.4g} to {f[-1]:.4g}", spread, damped, sensors, held_out])
    head = ["state", "data", "modes", "band [Hz]", "std of frequencies [%]", "damping", "sensors of shapes"]
    return TableBlock([*head, "held out"], rows, numbers=(2, 6), caption="Measured modes")


def _motion_seen(study: StudyContents) -> list[tuple[str, str]]:
    """Return which motion a test of modes has seen."""
    m = study.modes
    if m is None:
        return []
    seen = [("motion that the test has seen", f"along {', '.join(m.plane)}")] if m.plane else []
    if not m.has_shapes:
        by = (("sensors of the test", m.sensors), ("forces of the test", m.driven))
        seen += [(name, ", ".join(s.name for s in part)) for name, part in by if part]
    return seen


def model_size(mesh: Mesh) -> str:
    """Return how large a model is."""
    members = counted(len(mesh.members), "member")
    return f"{members}, {mesh.n_lines} beam elements, {mesh.n_points} points"


def _held_out_words(result: FrfResult) -> str:
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
        f"{100 * mask.mean():.0f} % of all; excluded are FRFs that are zero by symmetry "
        "and lines with too much noise"
    )
    if model_error > 0:
        text += f", and readings that {100 * TRANSVERSE:.0f} % transverse sensitivity could have caused"
    if silent:
        text += f". Excluded entirely: {', '.join(silent[:12])}" + (
            f" and {len(silent) - 12} more" if len(silent) > 12 else ""
        )
    return text


def _sensor_places(result: FrfResult) -> TableBlock:
    rows, (size, unit) = [], shown_length(1.0)
    for word, sensors in (("sensor", result.study.sensors), ("excitation", result.study.excitations)):
        for s in sensors:
            kind = word if s.quantity == MOTION else f"{word} ({s.quantity})"
            along = " ".join(f"{x:g}" for x in np.round(s.direction, 4) + 0.0)
            rows.append([s.name, kind, *(f"{size * x:.4g}" for x in s.point), along])
    head = ["name", "kind", *(f"{axis} [{unit}]" for axis in "xyz"), "direction"]
    return TableBlock(head, rows, numbers=(2, 3, 4), at_most=1000)
