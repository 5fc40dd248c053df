"""The measurement in a report: warnings, data, gates."""

import numpy as np

from dovetail.mode_result import ModeRunResult
from dovetail.report.drawn import held_out_bands
from dovetail.report.page import Markup, bullets, facts, folded, paragraph, section, table
from dovetail.report.shown import Shown
from dovetail.result import RunResult
from fem.summary import counted
from updating.inference.fit_data import TRANSVERSE, FitData
from updating.measurement.measurement import MOTION


def check_first(result: RunResult | ModeRunResult) -> Markup:
    """Return the probable faults of the study; nothing without any."""
    warnings = result.study.warnings
    return section("Check first", bullets(warnings)) if warnings else Markup()


def compared(result: RunResult, shown: Shown) -> Markup:
    """Return the measured data, and how they are compared with the model."""
    d, study = result.diagnosis, result.study
    data = d.problem.data
    rows, before = [], study.baseline_frfs
    named = [(m.name, m) for m in study.measurements or study.amplitudes]
    named += [(f"{before.name}, the baseline", before)] if before is not None else []
    for name, m in named:
        f = m.frf.frequency
        force = f"{m.force_level:g}" if m.force_level else "–"
        rows.append(
            [
                name,
                m.frf.quantity,
                m.frf.unit,
                len(m.frf.outputs),
                len(m.frf.inputs),
                m.frf.n_freq,
                f"{f[0]:g} to {f[-1]:g}",
                force,
            ]
        )
    head = ["data", "kind", "unit", "responses", "excitations", "lines", "band [Hz]", "force [N]"]
    mesh = study.model.mesh
    return section(
        "Compared data",
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
                    f"{counted(len(mesh.members), 'member')}, {mesh.n_lines} beam elements, "
                    f"{mesh.n_points} points",
                ),
            ]
        ),
        folded(
            f"{counted(len(study.sensors), 'sensor')} and {counted(len(study.excitations), 'excitation')}",
            _sensor_places(result),
        ),
    )


def gates(result: RunResult) -> Markup:
    """Return the tests of the measurement before the search."""
    known = result.diagnosis.gates
    if known is None:
        return Markup()
    rows = [[c.name, c.outcome, f"{c.found[:1].upper()}{c.found[1:]}."] for c in known.checks]
    return section(
        "Checks of the measurement",
        paragraph(
            "Made before the search for effects. What fails is set right, counted as "
            "noise, or stays a warning beside the verdict."
        ),
        table(["check", "outcome", "finding"], rows),
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
                    word if s.quantity == MOTION else f"{word} ({s.quantity})",
                    *(f"{x:.4g}" for x in s.point),
                    " ".join(f"{x:g}" for x in np.round(s.direction, 4) + 0.0),
                ]
            )
    return table(
        ["name", "kind", "x [m]", "y [m]", "z [m]", "direction"], rows, numbers=(2, 3, 4), at_most=1000
    )
