"""What the commands compare, locate, diagnose and run do: load the study, search, print, write."""

import argparse
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dovetail.commands.commands import check_places, loaded, say
from dovetail.disk.output import Output, Progress, write_json

if TYPE_CHECKING:
    from updating.diagnosis.diagnose import Diagnosis

Options = argparse.Namespace


def compare(options: Options, progress: Progress) -> None:
    """Print how far the model's FRFs are from the measured ones."""
    from dovetail import pipeline as run
    from dovetail import result
    from dovetail.report import words
    from updating.correlation import compare as compare_frfs
    from updating.diagnosis.diagnose import begin_fitted

    check_places(options)
    study = loaded(options)
    progress("reducing the model")
    problem, faults = run.fit_problem(study), ()
    if options.fitted:
        progress("fitting the uncertain parameters", 0.3)
        problem, found, faults = begin_fitted(problem)
    else:
        found = problem.nominal()
    c = compare_frfs(problem.measured, problem.frf(found), options.bands, problem.data.mask)
    progress.close()
    what = "with fitted parameters" if options.fitted else "nominal"
    write_json(
        options.json,
        {
            "study": study.name,
            "model": what,
            **result.comparison_dict(c),
            "error_db": found.fit_db,
            "held_out_db": found.held_out_db,
            "all_lines_db": c.total_db,
            "noise_db": problem.data.noise_db,
            "faults": [result.fault_dict(f) for f in faults],
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
    )
    head = "  ".join(f"{word:>11}" for word in _band_names(c.bands))
    width = _width(c.outputs)
    say(
        options,
        f"{study.name}, {what}: error of the amplitude {found.fit_db:.2f} dB on the lines of the fit, "
        f"{_cell(found.held_out_db, 0)} on those held out and {c.total_db:.2f} on all; noise of the "
        f"measurement {problem.data.noise_db:.2f} dB",
        f"{'sensor':{width}}  {'all dB':>7}  {head}  {'least FRAC':>10}",
        *(
            f"{name:{width}}  {_cell(total, 7)}  {'  '.join(_cell(db, 11) for db in row)}  "
            f"{_cell(frac, 10, 3)}"
            for name, total, row, frac in zip(
                c.outputs, c.by_sensor(), c.by_band(), result.least_frac(c), strict=True
            )
        ),
        *(f"set right: {words.fault_text(f)}" for f in faults),
        *(f"note: {note}" for note in study.measured_notes),
    )


def locate(options: Options, progress: Progress) -> None:
    """Print which sensors, bands, members and places carry the misfit."""
    from dovetail import pipeline as run
    from dovetail import result
    from dovetail.report import words
    from updating.diagnosis.diagnose import begin_fitted
    from updating.diagnosis.localisation import locate as find_places

    check_places(options)
    study = loaded(options)
    progress("reducing the model")
    problem = run.fit_problem(study)
    progress("fitting the uncertain parameters", 0.2)
    problem, fitted, faults = begin_fitted(problem)
    progress("locating the misfit", 0.5)
    where = find_places(problem, fitted, options.bands)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            **result.localisation_dict(where),
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
    )
    order = np.argsort(-np.nan_to_num(where.by_sensor_db), kind="stable")[: options.number]
    head = "  ".join(f"{word:>11}" for word in _band_names(where.bands))
    width = _width(where.sensors)
    places = sorted(
        [(f"member {m}", s) for m, s in where.members.items()] + list(where.places), key=lambda t: -t[1]
    )
    wide = _width([words.place(p) for p, _ in places])
    say(
        options,
        f"{study.name}: {fitted.fit_db:.2f} dB once the uncertain parameters are fitted; sensors, the "
        "worst first",
        f"{'sensor':{width}}  {'all dB':>7}  {head}",
        *(
            f"{where.sensors[i]:{width}}  {where.by_sensor_db[i]:7.2f}  "
            f"{'  '.join(_cell(db, 11) for db in where.by_band_db[i])}"
            for i in order
        ),
        "",
        f"{'place':{wide}}  share of the misfit that a small change would explain",
        *(f"{words.place(name):{wide}}  {100 * share:5.1f} %" for name, share in places[: options.number]),
        "",
        *(f"set right: {words.fault_text(f)}" for f in faults),
        where.note,
        *(f"note: {note}" for note in study.measured_notes),
    )


def diagnose(options: Options, progress: Progress) -> None:
    """Print what is missing and how all candidates did."""
    from dovetail import pipeline as run
    from dovetail import result
    from dovetail.report import words
    from updating.correlation import DB_PER_NEPER

    check_places(options)
    study = loaded(options)
    found = run.diagnose_study(study, progress)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            **result.diagnosis_dict(found),
            "notes": list(found.notes),
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
            "seconds": found.seconds,
        },
    )
    lines = [f"{study.name}: {found.verdict}; {found.reason}", *_found(found), "", *_staircase(found)]
    for k, ranked in enumerate(found.rounds):
        if not ranked:
            continue
        shown = ranked[: options.number]
        width = _width([words.ranked_label(r) for r in shown])
        lines += [
            "",
            f"round {k + 1}, {len(shown)} of {len(ranked)} candidates",
            f"{'':{width}}  level dB  fitted dB  held-out dB  similarity",
            *(
                f"{words.ranked_label(r):{width}}  {r.level * DB_PER_NEPER:8.2f}  {r.fit_db:9.2f}  "
                f"{_cell(r.held_out_db, 11)}  "
                f"{r.similarity:10.2f}  "
                f"{words.parameters_text(r.parameters)}{'' if r.refined else ' (quick fit)'}"
                for r in shown
            ),
        ]
    say(options, *lines, *(f"note: {note}" for note in (*found.notes, *study.measured_notes)))


def run(options: Options, progress: Progress) -> None:
    """Do the whole loop and print the verdict."""
    from dovetail import pipeline as loop
    from dovetail.report import words
    from dovetail.result import NAMES, result_dict

    out = Output("--out", options.out, NAMES)
    check_places(options, out)
    study = loaded(options)
    done = loop.run(study, options.out, progress, force=options.force)
    progress.close()
    write_json(options.json, result_dict(done))
    say(
        options,
        f"{study.name}: {done.diagnosis.verdict}",
        words.headline(done),
        *_found(done.diagnosis),
        "",
        *_staircase(done.diagnosis, done.held_out_channels),
        *(f"note: {note}" for note in (*done.notes, *study.measured_notes)),
        "",
        str(done.report),
    )


def _found(d: "Diagnosis") -> list[str]:
    """Return found effects with values and twins, sensor faults, and what chance would do, a line each."""
    from dovetail.report import words

    out = []
    for f in d.findings:
        out.append(f"  {words.finding_text(f)}")
        if f.twins:
            out.append(f"    cannot be told from: {'; '.join(words.ranked_label(t) for t in f.twins)}")
    out += [f"  {words.fault_text(f)}" for f in d.faults]
    return out + [f"  {words.chance_text(t, d)}" for t in d.tried]


def _staircase(d: "Diagnosis", held_out: Mapping[str, tuple[float, ...]] | None = None) -> list[str]:
    """Return the table of errors after each step."""
    from dovetail.report.words import step_label

    held_out = held_out or {}
    width = _width([step_label(s.label) for s in d.steps])
    names = "".join(f"  {n:>16}" for n in held_out)
    rows = [
        f"{step_label(s.label):{width}}  {s.fit_db:9.2f}  {_cell(s.held_out_db, 11)}"
        + "".join(f"  {_cell(db[k], 16)}" for db in held_out.values())
        for k, s in enumerate(d.steps)
    ]
    floor = f"{'noise floor':{width}}  {d.noise_floor_db:9.2f}"
    return [f"{'error after each step':{width}}  fitted dB  held-out dB{names}", *rows, floor]


def _width(names: Iterable[str]) -> int:
    return max([len(n) for n in names] + [21])


def _cell(value: float, width: int, digits: int = 2) -> str:
    """Return a number for a table, a dash where there is none."""
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else f"{'-':>{width}}"


def _band_names(bands: np.ndarray) -> list[str]:
    return [f"{a:.4g}-{b:.4g}" for a, b in pairwise(bands)]
