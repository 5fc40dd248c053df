"""The interactive figures of a report, and all its FRFs in few bytes."""

import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plotly.graph_objects import Figure

from dovetail.report import planning, words
from dovetail.report.drawings import Figures
from dovetail.report.drawn import (
    WITH_EFFECT,
    compared_models,
    error_bands,
    failing_members,
    failing_places,
    fits_of,
    frf_error,
    held_out_bands,
    marked_places,
    misfit_limit,
    misfit_steps,
    pair_errors,
    rivals,
    telling_pairs,
    test_of,
)
from dovetail.report.sections import explanations, measured_modes, rounds, staircase
from dovetail.report.sections.mode_shapes import shapes_of
from dovetail.result import FrfResult, RunResult, has_frfs
from fem.analysis.frf import FRF
from fem.analysis.modes import Modes
from fem.model import Model
from updating.diagnosis.verdict import Verdict
from updating.plan.plan import Plan
from viz.chart import Axis, Chart
from viz.curves import COHERENCE, MAGNITUDE, MEASURED, PHASE, Curves, frf, frf_curves
from viz.heat_maps import error_map
from viz.interactive.live import axis_title
from viz.interactive.model import model_figure
from viz.interactive.modes import MeasuredShape, modes_figure
from viz.interactive.plan import Wording, sizes_figure

MOST_VALUES = 1_200_000
"""Numbers of all FRFs together; of more lines every second, third … is kept."""
STEP = 0.01
"""FRFs are kept in steps of 0.01 dB and 0.01°, coherence in steps of 0.0001."""
GAP = -32768
"""Stands for no value."""
MOST_MODES, MOST_MODE_VALUES = 40, 1_000_000
"""Modes that move in the report, and numbers of all their surfaces together."""


def make_all(result: RunResult[Verdict]) -> Figures:
    """Make every interactive figure of a report."""
    out, d = Figures(), result.diagnosis
    out.add("model", lambda: _model(result))
    out.add("staircase", lambda: staircase.figure(d, height=430))
    out.add("probability", lambda: explanations.figure(d))
    out.add("deviations", lambda: measured_modes.deviations(result))
    out.add("mac", lambda: measured_modes.mac(result))
    if has_frfs(result):
        _add_frfs(result, out)
    out.add("modes", lambda: _modes(result))
    if (excluded := result.excluded) is not None and excluded.relevant:
        out.add("excluded", lambda: sizes(excluded, "seen"))
    return out


def _add_frfs(result: FrfResult, out: Figures) -> None:
    for name, step, _ in misfit_steps(result):
        out.add(f"map-{name}", lambda step=step: _error_map(result, step))
    out.add("misfit", lambda: _misfit(result))
    for k in range(len(result.diagnosis.rounds)):
        out.add(f"ranking-{k + 1}", lambda k=k: rounds.figure(result.diagnosis, k))
    out.add("frf", lambda: _frf(result, out))
    out.add("frf-error", lambda: frf_error(result))


def sizes(plan: Plan, what: str, kind: str = "") -> Figure:
    """Return the structure with the least sizes that are ``seen``, ``located`` or ``named``.

    Of one kind of :attr:`Plan.kinds`, or of all, of which the first is visible.
    """
    kinds = [some for name, some in plan.kinds.items() if kind in ("", name)]
    wording = Wording(what, planning.size_text, lambda e: words.place(e.where))
    return sizes_figure(plan.model, kinds, wording)


def _sensor_errors(result: FrfResult, step: int) -> dict[str, float]:
    c = result.comparisons[step]
    return dict(zip(c.outputs, c.by_sensor().tolist(), strict=True))


def _model(result: RunResult[Verdict]) -> Figure:
    errors = _sensor_errors(result, misfit_steps(result)[0][1]) if has_frfs(result) else None
    places = marked_places(result)
    return model_figure(result.study.model, *test_of(result), errors=errors, places=places, height=430)


def _misfit(result: FrfResult) -> Figure | None:
    where = result.localisation
    if where is None or not (where.members or where.places):
        return None
    m = result.diagnosis.problem.data.measurement
    _, step, _ = misfit_steps(result)[0]
    return model_figure(
        result.study.model,
        m.sensors,
        errors=_sensor_errors(result, step),
        members=failing_members(where) if where.says_where else None,
        joints=failing_places(where) if where.says_where else (),
    )


def _error_map(result: FrfResult, step: int) -> Chart:
    c = result.comparisons[step]
    return error_map(c.by_band(), c.outputs, error_bands(result), limits=(0.0, misfit_limit(result)))


def _frf(result: FrfResult, figures: Figures) -> Chart:
    d = result.diagnosis
    compared = compared_models(result)
    frfs: dict[str, FRF] = dict(compared.frfs)
    for k, rival in rivals(result).items():
        (with_it, before), (label, other) = fits_of(result, k, rival).items()
        if with_it != WITH_EFFECT:
            frfs[with_it] = before
        frfs[f"rival: {label}"] = other
    coherence = d.problem.data.measurement.coherence
    pair = next(((o, i) for o, i, _ in telling_pairs(result, 4)), None)
    figure = frf(
        d.measured,
        frfs,
        pair,
        deviations=compared.deviations,
        held_out=held_out_bands(result),
        coherence=coherence,
        compared=d.problem.data.mask,
        title="",
        height=560,
    )
    curves = frf_curves(d.measured, frfs, compared.deviations, d.problem.data.mask)
    labels = list(compared.frfs)
    errors = {label: pair_errors(result, step) for label, step in zip(labels, compared.steps, strict=True)}
    figures.data["frf"] = frf_store(curves, coherence, errors)
    if d.measured.strain:  # FRFs have different units
        figures.data["frf"]["titles"] = [
            [magnitude_title(d.measured.select([o], [i])) for i in d.measured.inputs]
            for o in d.measured.outputs
        ]
    return figure


def magnitude_title(frf: FRF) -> str:
    """Return the title of the axis of one FRF's amplitude, with its unit."""
    return axis_title(Axis(frf.quantity, decibels=frf.unit))


def frf_store(
    curves: tuple[Curves, ...],
    coherence: NDArray[np.float64] | None = None,
    errors: Mapping[str, NDArray[np.float64]] | None = None,
) -> dict[str, Any]:
    """Return FRFs of all pairs as a page reads them: differences of small integers, compressed.

    ``blocks`` lists series and quantity of each array (n_out, n_in, n_freq); ``data`` has them one after the
    other as differences of 16-bit integers along frequency, deflated, in base64. A value is the integer times
    the block's ``step``; `GAP` is none.

    Parameters
    ----------
    curves : tuple of Curves
        The first gives the frequencies.
    coherence : ndarray (n_freq, n_out, n_in), optional
        Of the first.
    errors : mapping of str to ndarray (n_out, n_in), optional
        Error of each FRF by label [dB].
    """
    first = curves[0]
    blocks: list[tuple[str, str, float, NDArray[np.float64]]] = []
    for c in curves:
        blocks.append((c.label, MAGNITUDE, STEP, c.magnitude))
        if c.phase is not None:
            blocks.append((c.label, PHASE, STEP, c.phase))
        if c.spread is not None:
            blocks.append((c.label, "spread", STEP, c.spread))
    if coherence is not None:
        blocks.append((MEASURED, COHERENCE, 1e-4, coherence))
    every = -(-sum(block[3].size for block in blocks) // MOST_VALUES)
    packed = [_integers(values[::every], step) for _, _, step, values in blocks]
    data = zlib.compress(np.concatenate(packed).tobytes(), 9)
    return {
        "frequency": np.float32(first.frequency[::every]).tolist(),
        "every": every,
        "outputs": list(first.outputs),
        "inputs": list(first.inputs),
        "blocks": [{"series": s, "quantity": q, "step": step} for s, q, step, _ in blocks],
        "gap": GAP,
        "data": b64encode(data).decode("ascii"),
        "errors": {label: _plain(np.round(e, 2)) for label, e in (errors or {}).items()},
    }


def _integers(values: NDArray[np.float64], step: float) -> NDArray[np.int16]:
    """Return values (n_freq, n_out, n_in) as differences of integers, (n_out n_in n_freq,)."""
    known = np.isfinite(values)
    integers = np.where(known, np.clip(np.round(np.where(known, values, 0.0) / step), -32767, 32767), GAP)
    lines = np.moveaxis(integers.astype(np.int16), 0, 2).reshape(-1, len(values))
    with np.errstate(over="ignore"):  # differences wrap round, and back where they are summed
        return np.diff(lines, axis=1, prepend=np.int16(0)).astype("<i2").ravel()


def _plain(values: NDArray[np.float64]) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in values]


def _modes(result: RunResult[Verdict]) -> Figure | None:
    shown = shapes_of(result)
    return moving_modes(
        result.diagnosis.model,
        shown.modes,
        list(shown.headings),
        shown.measured,
        labels=shown.headings,
        first=shown.changed.index if shown.changed else -1,
    )


def moving_modes(
    model: Model,
    modes: Modes,
    indices: Sequence[int],
    measured: Mapping[int, MeasuredShape],
    *,
    labels: Mapping[int, str] | None = None,
    first: int = -1,
) -> Figure | None:
    """Return modes that the page moves, as many as it can hold, at the beginning one of them."""
    chosen = list(indices)[:MOST_MODES]
    if not chosen:
        return None
    vertices = modes_figure(model, modes, chosen[:1], frames=False).layout.meta["modes"][0]["surface"].size
    chosen = chosen[: max(1, MOST_MODE_VALUES // vertices)]
    figure = modes_figure(model, modes, chosen, measured=measured, labels=labels, frames=False)
    meta: dict[str, Any] = dict(figure.layout.meta)
    meta["modes"] = [_in_few_bytes(mode) for mode in meta["modes"]]
    meta["first"] = chosen.index(first) if first in chosen else 0
    figure.layout.meta = meta  # pyright: ignore[reportAttributeAccessIssue]
    return figure


def _in_few_bytes(mode: Mapping[str, Any]) -> dict[str, Any]:
    """Return a mode whose surface moves in steps of a 32767th of its largest displacement."""
    step = max(float(np.abs(mode["surface"]).max()), 1e-300) / 32767
    return {**mode, "surface": np.round(mode["surface"] / step).astype(np.int16), "step": step}
