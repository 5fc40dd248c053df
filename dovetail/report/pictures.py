"""The pictures of a run, as files; a picture that cannot be drawn is left out and named."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dovetail.report import words
from dovetail.report.drawings import Album
from dovetail.report.drawn import (
    FRF_ERROR,
    compared_models,
    draw_misfit,
    error_bands,
    fits_of,
    frf_error,
    held_out_bands,
    marked_places,
    misfit_limit,
    misfit_steps,
    rivals,
    telling_pairs,
    test_in_words,
    test_of,
)
from dovetail.report.sections import measured_modes, rounds, staircase
from dovetail.report.sections.mode_shapes import mode_heading, shapes_of
from dovetail.result import FrfResult, RunResult, has_frfs
from updating.diagnosis.fitted_modes import FittedModePair
from updating.diagnosis.verdict import Verdict
from viz import curves, heat_maps
from viz.offscreen import NO_OPENGL, can_draw, why_not

N_MODES = 4
"""Mode shapes that are drawn."""
MANY = 40
"""With more sensors than this, the heat map shows the worst of them only."""

Say = Callable[[str, float], None]


def draw_all(result: RunResult[Verdict], folder: Path, say: Say) -> Album:
    """Draw everything that a report shows.

    Parameters
    ----------
    result : RunResult
    folder : Path
        Where to; made if it is not there.
    say : callable
        Progress: a text and the fraction done.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with new_garbage_alone():
        return _drawn(result, Album(folder), say)


@contextmanager
def new_garbage_alone() -> Iterator[None]:
    """Let garbage collections in the block look at objects that it makes alone.

    Each picture ends in one, as plotters hold their images in cycles; a search leaves millions of objects.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _drawn(result: RunResult[Verdict], album: Album, say: Say) -> Album:
    """Return an album with everything that a report shows drawn into it."""
    d = result.diagnosis
    say("writing the report: curves", 0.0)
    caption = staircase.CAPTIONS[d.stairs.unit]
    album.plot("staircase", staircase.in_words(d), caption, staircase.figure, d)
    measured_modes.draw(result, album)
    if has_frfs(result):
        _draw_errors(result, album)
        _draw_frfs(result, album)
    say("writing the report: the structure", 0.3)
    if can_draw():
        _draw_structure(result, album)
        if has_frfs(result):
            _draw_misfit(result, album)
        _draw_modes(result, album, say)
    else:
        album.failures.append(
            f"Pictures of the structure and of its modes are missing: {why_not() or NO_OPENGL}."
        )
    return album


def _draw_errors(result: FrfResult, album: Album) -> None:
    d = result.diagnosis
    limits = 0.0, misfit_limit(result)
    for name, step, what in misfit_steps(result):
        c = result.comparisons[step]
        order, bands = np.arange(len(c.outputs)), error_bands(result)
        alt = f"Heat map of the error of each sensor in {len(bands)} frequency bands, {what}."
        caption = f"Error of each sensor in each band, {what}"
        if len(order) > MANY:
            order = np.argsort(-np.nan_to_num(c.by_sensor()), kind="stable")[:MANY]
            caption += f"; the {MANY} worst of {len(c.outputs)} sensors"
        shown = c.by_band()[order], [c.outputs[i] for i in order], bands
        album.plot(f"misfit-bands-{name}", alt, f"{caption}.", heat_maps.error_map, *shown, limits=limits)
    for k, ranked in enumerate(d.rounds):
        if len(ranked) > 1:
            alt = f"Error that each of {len(ranked)} candidates leaves in round {k + 1}."
            album.plot(f"ranking-{k + 1}", alt, rounds.caption(d, k), rounds.figure, d, k)


def _draw_frfs(result: FrfResult, album: Album) -> None:
    d, compared, unseen = result.diagnosis, compared_models(result), held_out_bands(result)
    measured, models, bands = d.measured, compared.frfs, compared.deviations
    shaded = "; shaded, the 95 % band of the last one's parameters." if bands else "."
    chosen = telling_pairs(result)
    marked = {"held_out": unseen, "compared": d.problem.data.mask}
    for n, part in enumerate((chosen[k : k + 2] for k in range(0, len(chosen), 2)), 1):
        pairs = [(o, i) for o, i, _ in part]
        listed = " and ".join(f"{o} / {i} ({why})" for o, i, why in part)
        alt = (
            f"{words.frf_parts(d)} of the FRFs {listed}, measured and computed ({', '.join(models)}){shaded}"
        )
        shown = measured, models, pairs
        caption = f"Response / force: {listed}."
        album.plot(f"frf-{n}", alt, caption, curves.plot_frf, *shown, deviations=bands, **marked)
    for k, against in rivals(result).items():
        rival, drawn = words.ranked_label(against), fits_of(result, k, against)
        decisive = d.findings[k].decisive
        pairs = list(dict.fromkeys((piece.output, piece.input) for piece in decisive))[:2]
        listed = " and ".join(f"{o} / {i}" for o, i in pairs)
        alt = f"The FRFs {listed}, measured, with the effect and with its rival {rival}."
        caption = f"The FRFs that decide: {listed}, with the effect and with {rival}, both fitted."
        album.plot(f"decides-{k + 1}", alt, caption, curves.plot_frf, measured, drawn, pairs, **marked)
    alt = f"Relative error of all FRFs together over frequency, for {', '.join(models)}."
    album.plot("frf-error", alt, FRF_ERROR, frf_error, result)


def _draw_structure(result: RunResult[Verdict], album: Album) -> None:
    from viz import render

    model, (sensors, forces) = result.study.model, test_of(result)
    marks = [(p.point, p.label) for p in marked_places(result) if p.role != "candidate"]
    many = test_in_words(result)
    many += (
        f"; marked: {', '.join(dict.fromkeys(label for _, label in marks))}".replace("\n", " at ")
        if marks
        else ""
    )
    album.add(
        "structure",
        f"The structure{many}.",
        f"The model with sections{many.replace(' with', ',', 1)}.",
        lambda p: render.render_model(model, p, sensors, forces, marks),
    )


def _draw_misfit(result: FrfResult, album: Album) -> None:
    model, sensors = result.study.model, result.diagnosis.problem.data.measurement.sensors
    most = float(np.nanmax(result.comparisons[misfit_steps(result)[0][1]].by_sensor()))
    where = result.localisation if result.localisation and result.localisation.says_where else None
    for name, step, what in misfit_steps(result):
        members = name == "fitted" and where is not None and bool(where.members)
        caption = f"Error of each sensor on the structure, {what}"
        if members:
            caption += "; members, joints and supports by the share of it that a change there would explain"
        drawn = sensors, result.comparisons[step].by_sensor()
        album.add(
            f"misfit-{name}",
            f"The structure with its sensors coloured by their error, {what}.",
            f"{caption}.",
            lambda p, drawn=drawn, members=members: draw_misfit(
                model, *drawn, p, where, members=members, most=most
            ),
        )


def _draw_modes(result: RunResult[Verdict], album: Album, say: Say) -> None:
    from viz import animation, render

    model, shown = result.diagnosis.model, shapes_of(result)
    modes, pair = shown.modes, shown.changed
    for done, (k, title) in enumerate(list(shown.headings.items())[:N_MODES]):
        say("writing the report: mode shapes", 0.5 + 0.1 * done)
        number, arrows = k - modes.n_rigid + 1, shown.measured.get(k) if result.reported else None
        album.add(
            f"mode-{number}",
            f"Shape of elastic mode {number} of the fitted model at {modes.frequency[k]:.4g} Hz.",
            title,
            lambda p, k=k, title=title, arrows=arrows: render.render_mode(model, modes, k, p, arrows, title),
        )
    if pair is None:
        return
    say("writing the report: the mode that changed most", 0.9)
    k = pair.index
    title = mode_heading(k, modes.n_rigid, pair.fitted, pair.fitted_zeta)
    album.add(
        "mode-changed",
        f"Animated shape of the mode that the effect changes most, at {pair.fitted:.4g} Hz.",
        f"The mode that the effect changes most: {_moved(pair)}.",
        lambda p: animation.animate_mode(model, modes, k, p, title=title),
        ".gif",
    )


def _moved(pair: FittedModePair) -> str:
    return (
        f"{pair.nominal:.4g} Hz and {100 * pair.nominal_zeta:.2g} % damping without it, {pair.fitted:.4g} "
        "Hz and "
        f"{100 * pair.fitted_zeta:.2g} % with it"
    )
