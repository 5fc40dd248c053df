"""The pictures of a run, as files; one that cannot be drawn is left out and named."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.report import words
from dovetail.report.blocks import Picture
from dovetail.report.drawn import (
    FRF_ERROR,
    STAIRCASE,
    candidate_labels,
    compared_models,
    error_bands,
    error_steps,
    failing_places,
    fits_of,
    held_out_bands,
    marked_places,
    misfit_limit,
    misfit_steps,
    ranking_caption,
    rivals,
    staircase_alt,
    telling_pairs,
)
from dovetail.result import RunResult
from fem.analysis.modes import Modes
from fem.model import Model
from fem.summary import counted
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnosis import EFFECT, FAULT, NOTHING
from updating.diagnosis.findings import Ranked
from updating.diagnosis.fitted_modes import ModePair, modes_of, most_changed, pair_modes
from viz import curves, heat_maps, search
from viz.interactive.modes import MeasuredShape
from viz.offscreen import NO_OPENGL, can_draw, why_not
from viz.style import save

N_MODES = 4
"""Mode shapes that are drawn."""
DPI = 130
"""Resolution of the curves [1/inch]."""
TELLING = 0.1
"""Members and joints are coloured by their share of the misfit if one of them has at least this."""
MANY = 40
"""With more sensors than this, the heat map shows the worst of them only."""

Say = Callable[[str, float], None]


@dataclass(slots=True)
class Album:
    """The pictures of a report by name, and failures of drawing.

    Attributes
    ----------
    folder : Path
    pictures : dict of str to Picture
    failures : list of str
        Sentences.
    """

    folder: Path
    pictures: dict[str, Picture] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def __getitem__(self, name: str) -> Picture | None:
        return self.pictures.get(name)

    def add(
        self, name: str, draw: Callable[[Path], Any], alt: str, caption: str = "", suffix: str = ".png"
    ) -> None:
        """Draw a picture into the folder."""
        file = self.folder / f"{name}{suffix}"
        try:
            draw(file)
        except Exception as reason:
            file.unlink(missing_ok=True)
            self.failures.append(
                f"The picture {file.name} could not be drawn ({type(reason).__name__}: {reason})."
            )
            return
        self.pictures[name] = Picture(file, alt, caption)


def draw_all(result: RunResult, folder: Path, say: Say) -> Album:
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
    album = Album(folder)
    say("drawing curves", 0.0)
    _draw_errors(result, album)
    _draw_frfs(result, album)
    say("drawing the structure", 0.3)
    if can_draw():
        _draw_structure(result, album)
        _draw_modes(result, album, say)
    else:
        album.failures.append(
            f"Pictures of the structure and of its modes are missing: {why_not() or NO_OPENGL}."
        )
    return album


def _draw_errors(result: RunResult, album: Album) -> None:
    d = result.diagnosis
    album.add(
        "staircase",
        lambda p: save_staircase(error_steps(d), d.noise_floor_db, p),
        staircase_alt(d),
        STAIRCASE,
    )
    top = misfit_limit(result)
    for name, step, what in misfit_steps(result):
        c = result.comparisons[step]
        values, order, bands = c.by_band(), np.arange(len(c.outputs)), error_bands(result)
        if len(order) > MANY:
            order = np.argsort(-np.nan_to_num(c.by_sensor()), kind="stable")[:MANY]
        album.add(
            f"misfit-bands-{name}",
            lambda p, v=values[order], o=[c.outputs[i] for i in order], b=bands: save(
                heat_maps.plot_misfit_matrix(v, o, b, "error [dB]", (0.0, top)), p, DPI
            ),
            f"Heat map of the error of each sensor in {len(bands)} frequency bands, {what}.",
            f"Error of each sensor in each band, {what}"
            + (f"; the {MANY} worst of {len(c.outputs)} sensors." if len(c.outputs) > MANY else "."),
        )
    for k, ranked in enumerate(d.rounds):
        _draw_ranking(result, k, ranked, album)


def save_staircase(
    steps: Sequence[tuple[str, float, float | None]],
    floor: float,
    path: Path,
    *,
    ylabel: str = "error of the amplitude [dB]",
    **more: Any,
) -> None:
    """Draw a staircase into a file; more as :func:`viz.search.plot_staircase`."""
    figure = search.plot_staircase(steps, floor, ylabel=ylabel, **more)
    low, high = figure.axes[0].get_ylim()
    figure.axes[0].set_ylim(low, high + 0.17 * (high - low))  # room for the legend over the last step
    save(figure, path, DPI)


def _draw_ranking(result: RunResult, k: int, ranked: Sequence[Ranked], album: Album) -> None:
    d = result.diagnosis
    if not ranked:
        return
    labels = candidate_labels(ranked)
    by_name = dict(zip([r.name for r in ranked], labels, strict=True))
    found = d.findings[k] if k < len(d.findings) else None
    baseline = d.steps[min(k + 1, len(d.steps) - 1)].level * DB_PER_NEPER
    twins = {by_name[t.name] for t in found.twins if t.name in by_name} if found else set()
    accepted = by_name.get(found.effect.name) if found else None
    levels = [r.level * DB_PER_NEPER for r in ranked]

    def draw(path: Path) -> None:
        figure = search.plot_ranking(
            labels,
            levels,
            baseline,
            twins=twins,
            accepted=accepted,
            xlabel=words.level_label(d),
        )
        save(figure, path, DPI)

    album.add(
        f"ranking-{k + 1}",
        draw,
        f"Residual level that each of {len(ranked)} candidates leaves in round {k + 1}.",
        ranking_caption(result, k, ranked),
    )


def _draw_frfs(result: RunResult, album: Album) -> None:
    d = result.diagnosis
    measured = d.measured
    compared = compared_models(result)
    models, bands = compared.frfs, compared.deviations
    held = held_out_bands(result)
    shaded = "shaded, the 95 % band of the last one's parameters."
    sigma = np.abs(measured.H) * np.broadcast_to(d.problem.data.noise, measured.H.shape)
    chosen = telling_pairs(result)
    for start in range(0, len(chosen), 2):
        part = chosen[start : start + 2]
        listed = " and ".join(f"{o} / {i} ({why})" for o, i, why in part)
        album.add(
            f"frf-{start // 2 + 1}",
            lambda p, part=part: save(
                curves.plot_frf(
                    measured, models, [(o, i) for o, i, _ in part], held_out=held, deviations=bands
                ),
                p,
                DPI,
            ),
            f"{words.frf_parts(d)} of the FRFs {listed}, measured and computed ({', '.join(models)})"
            + (f"; {shaded}" if bands else "."),
            f"Response / force: {listed}.",
        )
    for k, against in rivals(result).items():
        finding, rival = d.findings[k], words.ranked_label(against)
        drawn = fits_of(result, k, against)
        pairs = list(dict.fromkeys((piece.output, piece.input) for piece in finding.decisive))[:2]
        listed = " and ".join(f"{o} / {i}" for o, i in pairs)
        album.add(
            f"decides-{k + 1}",
            lambda p, drawn=drawn, pairs=pairs: save(
                curves.plot_frf(measured, drawn, pairs, held_out=held), p, DPI
            ),
            f"The FRFs {listed}, measured, with the effect and with its rival {rival}.",
            f"The FRFs that decide: {listed}, with the effect and with {rival}, both fitted.",
        )
    album.add(
        "frf-error",
        lambda p: save(
            curves.plot_frf_error(
                measured, models, floor=sigma, held_out=held, smooth=max(1, measured.n_freq // 150)
            ),
            p,
            DPI,
        ),
        "Relative error of all FRFs together over frequency, for " + ", ".join(models) + ".",
        FRF_ERROR,
    )


def _draw_structure(result: RunResult, album: Album) -> None:
    from viz import render

    d, study = result.diagnosis, result.study
    m = d.problem.data.measurement
    marks = [(place.point, place.label) for place in marked_places(result)]
    seen = f"; marked: {', '.join(dict.fromkeys(label for _, label in marks))}" if marks else ""
    many = f"{counted(len(m.sensors), 'sensor')} and {counted(len(m.excitations), 'excitation')}"
    album.add(
        "structure",
        lambda p: render.render_model(study.model, p, m.sensors, m.excitations, marks),
        f"The structure with {many}{seen}.",
        f"The model with sections, {many}{seen}.",
    )
    points, directions = (np.array([getattr(s, key) for s in m.sensors]) for key in ("point", "direction"))
    before = result.comparisons[misfit_steps(result)[0][1]].by_sensor()
    good = result.diagnosis.verdict in (NOTHING, FAULT)
    limits = (0.0 if good else float(np.nanmin(before)), float(np.nanmax(before)))
    where = result.localisation
    shares, joints = (dict(where.members), failing_places(where)) if where else ({}, [])
    telling = max([*shares.values(), *(v for _, v in joints)], default=0.0) >= TELLING
    for name, step, what in misfit_steps(result):
        db = result.comparisons[step].by_sensor()
        known = np.isfinite(db)
        members = shares if name == "fitted" and telling else None
        album.add(
            f"misfit-{name}",
            lambda p, db=db, known=known, members=members: render.render_misfit(
                study.model,
                points[known],
                directions[known],
                db[known],
                [s.name for s, k in zip(m.sensors, known, strict=True) if k],
                p,
                members=members,
                joints=[(place.point, v) for place, v in joints],
                label="error [dB]",
                members_label="share of the misfit [-]",
                limits=limits,
            ),
            f"The structure with its sensors coloured by their error, {what}.",
            f"Error of each sensor on the structure, {what}"
            + (
                "; members, joints and supports by the share of it that a small change would explain."
                if members
                else "."
            ),
        )


def _draw_modes(result: RunResult, album: Album, say: Say) -> None:
    from viz import animation

    _, without, fitted = modes_of(result.diagnosis)
    model = result.diagnosis.model
    elastic = range(fitted.n_rigid, fitted.n_modes)[:N_MODES]
    zeta = fitted.zeta
    titles = {
        k: mode_heading(k, fitted.n_rigid, fitted.frequency[k], None if zeta is None else zeta[k])
        for k in elastic
    }
    add_modes(album, model, fitted, titles, {}, say)
    if result.diagnosis.verdict != EFFECT:
        return
    pair = most_changed(pair_modes(without, fitted))
    if pair is None:
        return
    say("drawing the mode that changed most", 0.9)
    k = pair.index
    title = mode_heading(k, fitted.n_rigid, pair.fitted, pair.fitted_zeta)
    album.add(
        "mode-changed",
        lambda p: animation.animate_mode(model, fitted, k, p, title=title),
        f"Animated shape of the mode that the effect changes most, at {pair.fitted:.4g} Hz.",
        f"The mode that the effect changes most: {_moved(pair)}.",
        ".gif",
    )


def add_modes(
    album: Album,
    model: Model,
    modes: Modes,
    titles: Mapping[int, str],
    measured: Mapping[int, MeasuredShape],
    say: Say,
) -> None:
    """Draw the modes that have a title, with measured shapes where there are any."""
    from viz import render

    for done, (k, title) in enumerate(titles.items()):
        say("drawing mode shapes", 0.5 + 0.1 * done)
        number = k - modes.n_rigid + 1
        album.add(
            f"mode-{number}",
            lambda p, k=k, title=title: render.render_mode(model, modes, k, p, measured.get(k), title),
            f"Shape of elastic mode {number} of the fitted model at {modes.frequency[k]:.4g} Hz.",
            title,
        )


def mode_heading(k: int, n_rigid: int, frequency: float, zeta: float | None) -> str:
    """Return the heading of an elastic mode, counted from 1 without rigid-body modes."""
    text = f"Elastic mode {k - n_rigid + 1}: {frequency:.4g} Hz"
    if frequency < 0:
        return f"{text}, a motion that grows"
    return text if zeta is None else f"{text}, damping {100 * zeta:.2g} %"


def _moved(pair: ModePair) -> str:
    return (
        f"{pair.nominal:.4g} Hz and {100 * pair.nominal_zeta:.2g} % damping without it, {pair.fitted:.4g} "
        "Hz and "
        f"{100 * pair.fitted_zeta:.2g} % with it"
    )
