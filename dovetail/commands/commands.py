"""What each command does: load the study, call the numerics, print, write."""

import argparse
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.commands.labels import NodeNumbers, own_labels
from dovetail.disk.output import Output, OutputError, Progress, check_outputs, result_folder, write_json
from dovetail.file.config import MOST_LINES, NEEDS, Study, load_study
from dovetail.file.measured import sensor_rows
from dovetail.file.paths import InputFile, input_files
from dovetail.file.table import StudyError
from fem.analysis.frf import FRF, compute_frf
from fem.analysis.modes import first_modes, solve_modes
from fem.checks import Fault, check_model
from fem.io import write_csv, write_npz, write_uff
from fem.io.atomic import goes_to_stdout, replacing
from fem.system import assemble
from viz.offscreen import require_drawing

Options = argparse.Namespace

MOST_VALUES = 50_000_000
"""Values of all FRFs together that are computed at once: 0.8 GB."""


def say(options: Options, *lines: str) -> None:
    """Print lines, unless quiet is asked for or standard output is wanted for JSON."""
    target = getattr(options, "json", None)
    taken = target is not None and (str(target) == "-" or goes_to_stdout(target))
    if not options.quiet and not taken:
        sys.stdout.write("".join(f"{line}\n" for line in lines))


def loaded(options: Options, needs: Collection[str] = NEEDS) -> Study:
    """Load the study of a command, and say on standard error what is probably wrong in it."""
    study = load_study(options.study, needs)
    warn(study.warnings)
    return study


def warn(sentences: Iterable[str]) -> None:
    """Write warnings to standard error, whatever else is asked for."""
    sys.stderr.write("".join(f"dovetail: warning: {text}\n" for text in sentences))


def check_places(options: Options, *outputs: Output, more: Sequence[InputFile] = ()) -> None:
    """Refuse outputs over what a command reads, over one another, or where nothing can be written.

    Parameters
    ----------
    options : Options
        With the study and, if asked for, the file for JSON.
    outputs : Output
        All others.
    more : sequence of InputFile
        What is read besides the study.
    """
    check_outputs((*input_files(options.study), *more), *outputs, Output("--json", options.json))


def new(options: Options, progress: Progress) -> None:
    """Write a study to start from, and FRFs for it."""
    from dovetail.file.template import write_template

    for name in ("study.toml", "frf.npz"):
        if options.force and (options.folder / name).exists():
            msg = f"{options.folder / name} exists and would be overwritten; choose another folder"
            raise OutputError(msg)
    progress("computing its measurement")
    with result_folder(options.folder, options.force) as scratch:
        write_template(scratch)
    (options.folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    progress.close()
    say(
        options,
        f"{options.folder / 'study.toml'} is written: a portal frame, to be changed into yours.",
        f"{options.folder / 'frf.npz'} is a simulated measurement, with noise and with an effect "
        "that the study lacks.",
        "Next:",
        f"  dovetail modes {options.folder / 'study.toml'}",
    )


def check(options: Options, progress: Progress) -> None:
    """Print probable faults of the model; draw where they are."""
    if options.picture is not None and options.picture.suffix.lower() != ".png":
        msg = f"{options.picture}: the picture is written as .png"
        raise OutputError(msg)
    check_places(options, Output("--picture", options.picture))
    if options.picture is not None:
        require_drawing("--picture")
    study = load_study(options.study, needs=())
    warn(text for text in study.warnings if text not in study.implausible)
    progress("checking the model")
    faults = tuple(f for f in check_model(study.model) if f.kind != "implausible")
    faults += tuple(Fault("implausible", words) for words in study.implausible)
    if options.picture is not None:
        from viz.render import render_faults

        progress("drawing the faults")
        with replacing(options.picture) as scratch:
            render_faults(study.model, faults, scratch)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "warnings": study.warnings,
            "faults": [
                {"kind": f.kind, "message": f.message, "points": f.points.tolist(), "lines": f.lines.tolist()}
                for f in faults
            ],
            "mesh_notes": study.model.mesh.notes,
            "measured_notes": study.measured_notes,
            "assumptions": study.assumptions,
        },
    )
    mesh = study.model.mesh
    say(
        options,
        f"{study.name}: {mesh.n_points} points, {mesh.n_lines} elements, {len(mesh.members)} members",
        *(f"  {f.kind}: {f.message}" for f in faults),
        f"{len(faults)} fault(s) found" if faults else "no faults found",
        *_read(study),
    )


def modes(options: Options, progress: Progress) -> None:
    """Print natural frequencies; draw mode shapes."""
    check_places(options, Output("--pictures", options.pictures, ("mode-01.png",)))
    if options.pictures is not None:
        require_drawing("--pictures")
    study = loaded(options, ())
    progress("solving for modes")
    system = assemble(study.model, reciprocal=False)
    if options.max is not None:
        found = solve_modes(system, max_frequency=options.max)
    else:
        found = first_modes(system, options.number or 10)
    zeta = np.zeros(found.n_modes) if found.zeta is None else found.zeta
    if options.pictures is not None:
        from viz.render import render_mode

        with result_folder(options.pictures, options.force) as scratch:
            for k in range(found.n_rigid, found.n_modes):
                progress("drawing mode shapes", k - found.n_rigid, found.n_modes - found.n_rigid)
                render_mode(study.model, found, k, scratch / f"mode-{k + 1:02d}.png")
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "n_rigid": found.n_rigid,
            "modes": [
                {"frequency_Hz": f, "damping_ratio": z} for f, z in zip(found.frequency, zeta, strict=True)
            ],
            "elements": study.model.mesh.n_lines,
            "mesh_notes": study.model.mesh.notes,
            "measured_notes": study.measured_notes,
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
    )
    rows = [
        f"{k + 1:5d}  {f:12.4f}  {100 * z:8.3f}"
        f"{'   rigid body' if k < found.n_rigid else '   grows: the structure is unstable' if f < 0 else ''}"
        for k, (f, z) in enumerate(zip(found.frequency, zeta, strict=True))
    ]
    say(
        options,
        f"{study.name}: {study.model.mesh.n_lines} elements, {system.n_free} coordinates",
        " mode  frequency Hz  damping %",
        *rows,
        *_read(study),
        *(
            [f"the model has {found.n_modes} modes in all"]
            if options.max is None and options.number and found.n_modes < found.n_rigid + options.number
            else []
        ),
        *_assumed(study),
    )


def _read(study: Study) -> list[str]:
    """Say what the readers of the mesh file and of the measured files left out or found suspicious."""
    notes = {
        "notes on the mesh file:": study.model.mesh.notes,
        "notes on the measured files:": study.measured_notes,
    }
    return [
        line for head, said in notes.items() if said for line in ("", head, *(f"  - {text}" for text in said))
    ]


def _assumed(study: Study) -> list[str]:
    return ["", "assumed:", *(f"  - {text}" for text in study.assumptions)] if study.assumptions else []


def frf(options: Options, progress: Progress) -> None:
    """Compute FRFs and write them."""
    writers = {".npz": write_npz, ".csv": write_csv, ".uff": None, ".unv": None}
    suffix = options.out.suffix.lower()
    if suffix not in writers:
        msg = f"{options.out}: FRFs are written as .npz, .csv or .uff, not '{suffix}'"
        raise OutputError(msg)
    check_places(options, Output("--out", options.out))
    study = loaded(options, ("sensors",))
    if not study.sensors or not study.excitations:
        missing = "sensors" if not study.sensors else "excitations"
        msg = f"{options.study}: it has no [[{missing}]]; FRFs need both sensors and excitations"
        raise StudyError(msg)
    parts = {"outputs": study.sensors, "inputs": study.excitations}
    nodes = NodeNumbers(study) if writers[suffix] is None else None
    labels = [
        own_labels(part, study.labels[which]) if nodes is None else nodes.labels(which, part)
        for which, part in parts.items()
    ]
    frequency = _lines(study, options)
    kind = options.kind or (study.measurements[0].frf.kind if study.measurements else "accelerance")
    progress("computing FRFs")
    H = compute_frf(
        assemble(study.model, reciprocal=False),
        frequency,
        sensor_rows(study.model, study.sensors),
        sensor_rows(study.model, study.excitations),
        kind,
    )
    names = [tuple(s.name for s in part) for part in (study.sensors, study.excitations)]
    computed = FRF.from_arrays(frequency, H.H, kind, *labels)
    writer = writers[suffix]
    if writer is not None:
        writer(options.out, computed)
    elif nodes is not None:
        write_with_nodes(options.out, nodes, frf=computed)
    new = nodes.unnamed("outputs", study.sensors) if nodes is not None else ""
    progress.close()
    words = {
        "file": str(options.out),
        "kind": str(computed.kind),
        "unit": computed.kind.unit,
        "lines": computed.n_freq,
        "first_Hz": frequency[0],
        "last_Hz": frequency[-1],
        "outputs": names[0],
        "inputs": names[1],
        "measured_notes": study.measured_notes,
        "warnings": study.warnings,
    }
    write_json(options.json, words)
    say(
        options,
        f"{options.out}: {computed.kind} [{computed.kind.unit}], {len(names[0])} responses to "
        f"{len(names[1])} force(s), "
        f"{computed.n_freq} lines from {frequency[0]:g} to {frequency[-1]:g} Hz",
        *([f"note: the file has {new}; give these labels in the study to read it back"] if new else []),
    )


def _lines(study: Study, options: Options) -> np.ndarray:
    if options.start is None and options.stop is None and options.step is None:
        return study.measurements[0].frf.frequency if study.measurements else study.frequency
    base = study.measurements[0].frf.frequency if study.measurements else study.frequency
    stop = options.stop or float(base[-1])
    step = options.step or (float(base[1] - base[0]) if base.size > 1 else stop / 1000)
    start = options.start or max(step, float(base[0]))
    if start > stop:
        msg = f"the first frequency, {start:g} Hz, lies above the last, {stop:g} Hz"
        raise OutputError(msg)
    n, values = (stop - start) / step, len(study.sensors) * len(study.excitations)
    most = min(MOST_LINES, MOST_VALUES // values)
    if n > most:
        msg = (
            f"{n:.3g} lines from {start:g} to {stop:g} Hz in steps of {step:g} Hz, of {values} FRFs, are too "
            f"many; at most {most} are computed; give a larger --step"
        )
        raise OutputError(msg)
    return start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1)


def write_with_nodes(path: Path, nodes: NodeNumbers, **data: Any) -> None:
    """Write a universal file with the mesh, or with its points as the study's labels number them."""
    if nodes.own:
        write_uff(path, geometry=nodes.geometry(), trace_lines=nodes.lines(), **data)
    else:
        write_uff(path, mesh=nodes.mesh, **data)


def identify_joint(options: Options, progress: Progress) -> None:
    """Fit a joint by output error; show it line by line beside; write what was found into a study."""
    from dovetail.identify import estimate, identify, read_task, summarise
    from dovetail.propose import write_proposal
    from dovetail.report.joint import draw_joint, joint_result, joint_words
    from joint import IdentificationError

    for path, suffix, what in (
        (options.out, ".npz", "the result"),
        (options.propose, ".toml", "the proposed study"),
        (options.picture, ".png", "the picture"),
    ):
        if path is not None and path.suffix.lower() != suffix:
            msg = f"{path}: {what} is written as {suffix}"
            raise OutputError(msg)
    check_places(
        options, Output("--out", options.out), Output("--propose", options.propose),
        Output("--picture", options.picture),
    )  # fmt: skip
    study = loaded(options)
    task = read_task(study, options.joint, options.directions, options.measurement)
    terms = tuple(options.terms.replace(",", " ").split())
    progress("line by line")
    lines, reason = None, ""
    try:
        lines = identify(task, options.amplification)
    except IdentificationError as refusal:
        reason = str(refusal).partition(": ")[2]
    progress("fitting the joint to all lines")
    found = estimate(task, terms, coupled=options.coupled, accuracy=options.accuracy, lines=lines)
    summary = [] if lines is None else summarise(lines, task.directions)
    progress.close()
    if options.out is not None:
        _write_joint(options.out, found, lines)
    if options.picture is not None:
        draw_joint(found, options.picture, options.amplification)
    proposal = write_proposal(found, options.propose) if options.propose is not None else ()
    write_json(options.json, joint_result(study.name, found, lines, summary))
    say(options, *joint_words(found, lines, summary, reason))
    if proposal:
        say(
            options,
            f"{options.propose} is written: the study with this joint. Check it with "
            f"dovetail compare {options.propose}",
        )


def _write_joint(path: Path, found: Any, lines: Any) -> None:
    fit = found.fit
    arrays: dict[str, Any] = {
        "directions": np.array(found.task.directions),
        "names": np.array(fit.form.names),
        "values": fit.values,
        "covariance": fit.covariance,
        "fit_frequency": fit.frequency,
        "H": fit.H,
        "measured": found.measured,
    }
    if lines is not None:
        arrays |= {
            "frequency": lines.frequency,
            "Z": lines.z,
            "regular": lines.regular,
            "condition_A": lines.condition_A,
            "condition_B": lines.condition_B,
            "residual": lines.residual,
        }
    with replacing(path) as scratch, scratch.open("wb") as file:
        np.savez_compressed(file, **arrays)
