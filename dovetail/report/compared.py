"""The measurement in a report: warnings, data, gates."""

import numpy as np

from dovetail.mode_result import ModeRunResult
from dovetail.report.blocks import Details, Facts, Items, ReportSection, TableBlock, Text
from dovetail.report.drawn import held_out_bands
from dovetail.result import RunResult
from fem.mesh import Mesh
from fem.summary import counted
from updating.inference.fit_data import TRANSVERSE, FitData
from updating.measurement.measurement import MOTION


def check_first(result: RunResult | ModeRunResult) -> ReportSection:
    """Return the probable faults of the study; nothing without any."""
    return ReportSection("Check first", [Items(result.study.warnings)])


def compared(result: RunResult) -> ReportSection:
    """Return the measured data, and how they are compared with the model."""
    d, study = result.diagnosis, result.study
    data, mesh, before = d.problem.data, study.model.mesh, study.baseline_frfs
    named = [(m.name, m) for m in study.measurements or study.amplitudes]
    named += [(f"{before.name}, the baseline", before)] if before is not None else []
    rows = []
    for name, m in named:
        frf, force = m.frf, f"{m.force_level:g}" if m.force_level else "–"
        band = f"{frf.frequency[0]:g} to {frf.frequency[-1]:g}"
        size = len(frf.outputs), len(frf.inputs), frf.n_freq
        rows.append([name, frf.quantity, frf.unit, *size, band, force])
    head = ["data", "kind", "unit", "responses", "excitations", "lines", "band [Hz]", "force [N]"]
    f = data.frequency
    facts = [
        ("band compared", f"{f[0]:g} to {f[-1]:g} Hz, {f.size} lines"),
        ("held out", _held_out_words(result)),
        ("values that count", _counted(data, study.model_error)),
        ("noise", f"{d.noise_db:.2f} dB, from {data.measurement.noise_source}"),
        ("model", model_size(mesh)),
    ]
    places = f"{counted(len(study.sensors), 'sensor')} and {counted(len(study.excitations), 'excitation')}"
    measured = TableBlock(head, rows, numbers=(3, 4, 5), caption="Measured FRFs")
    return ReportSection("Compared data", [measured, Facts(facts), Details(places, [_sensor_places(result)])])


def model_size(mesh: Mesh) -> str:
    """Return how large a model is."""
    members = counted(len(mesh.members), "member")
    return f"{members}, {mesh.n_lines} beam elements, {mesh.n_points} points"


def gates(result: RunResult) -> ReportSection:
    """Return the tests of the measurement before the search; nothing without any."""
    known = result.diagnosis.gates
    rows = (
        [[c.name, c.outcome, f"{c.found[:1].upper()}{c.found[1:]}."] for c in known.checks] if known else []
    )
    text = (
        "Made before the search for effects. What fails is corrected, counted as noise, or reported as a "
        "warning with the verdict."
    )
    blocks = [Text(text), TableBlock(["check", "outcome", "finding"], rows)] if known else []
    return ReportSection("Checks of the measurement", blocks)


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


def _sensor_places(result: RunResult) -> TableBlock:
    rows = []
    for word, sensors in (("sensor", result.study.sensors), ("excitation", result.study.excitations)):
        for s in sensors:
            kind = word if s.quantity == MOTION else f"{word} ({s.quantity})"
            along = " ".join(f"{x:g}" for x in np.round(s.direction, 4) + 0.0)
            rows.append([s.name, kind, *(f"{x:.4g}" for x in s.point), along])
    head = ["name", "kind", "x [m]", "y [m]", "z [m]", "direction"]
    return TableBlock(head, rows, numbers=(2, 3, 4), at_most=1000)
