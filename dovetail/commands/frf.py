"""``dovetail frf``: FRFs from the excitations to the sensors."""

import argparse

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_kind, positive
from dovetail.commands.common import Options, loaded, noted, write_with_nodes
from dovetail.commands.labels import NodeNumbers, channel_labels
from dovetail.commands.results import Results, Written
from dovetail.commands.speed import add_rpm, at_asked_speed
from dovetail.disk.output import OutputError, Progress
from dovetail.file.settings import MOST_LINES
from dovetail.report.table import Column, Table
from dovetail.study import Study
from fem.analysis.frf import FRF
from fem.io import write_csv, write_npz
from updating.measurement.measurement import STRAIN

EXAMPLE = "dovetail frf study.toml --out frf.npz --stop 500 --step 0.5"
WRITERS = {".npz": write_npz, ".csv": write_csv, ".uff": None, ".unv": None}
RESULTS = Results(more=(Written("--out", "file to write", tuple(WRITERS), required=True),))
MOST_VALUES = 50_000_000
"""Values of all FRFs together that are computed at once: 0.8 GB."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_kind(p)
    add_rpm(p)
    add_lines(p)


def add_lines(p: argparse.ArgumentParser) -> None:
    """Add the options of the frequency lines."""
    for key, text in (
        ("start", "first frequency"),
        ("stop", "last frequency"),
        ("step", "distance of the lines"),
    ):
        p.add_argument(
            f"--{key}",
            type=positive,
            metavar="HZ",
            help=f"{text} (default: the measurement's lines, or [frequency])",
        )


def run(options: Options, progress: Progress) -> Answer:
    """Compute FRFs and write them."""
    suffix = options.out.suffix.lower()
    study = at_asked_speed(loaded(options, ("sensors",)), options)
    study.require_ends()
    parts = {"outputs": study.sensors, "inputs": study.excitations}
    nodes = NodeNumbers(study) if WRITERS[suffix] is None else None
    labels = [
        channel_labels(part, study.labels[which]) if nodes is None else nodes.labels(which, part)
        for which, part in parts.items()
    ]
    frequency = asked_lines(study, options, len(study.sensors) * len(study.excitations))
    progress("computing FRFs")
    found = study.frf(frequency, options.kind)
    driven = zip(study.excitations, labels[1], strict=True)
    base = [label for e, label in driven if e.per_acceleration]
    strain = [label for s, label in zip(study.sensors, labels[0], strict=True) if s.quantity == STRAIN]
    computed = FRF.from_arrays(frequency, found.H, found.kind, *labels, base=base, strain=strain)
    writer = WRITERS[suffix]
    if writer is not None:
        writer(options.out, computed)
    elif nodes is not None:
        write_with_nodes(options.out, nodes, frf=computed)
    new = nodes.unnamed("outputs", study.sensors) if nodes is not None else ""
    note = f"the file has {new}; give these labels in the study to read it back"
    return Answer(
        study,
        [
            f"{options.out}: {computed.quantity} [{computed.unit}], {len(found.outputs)} responses to "
            f"{len(found.inputs)} excitation(s), "
            f"{computed.n_freq} lines from {frequency[0]:g} to {frequency[-1]:g} Hz",
            *noted([note] if new else []),
        ],
        {
            "file": str(options.out),
            "kind": str(computed.kind),
            "unit": computed.unit,
            "lines": computed.n_freq,
            "first_Hz": frequency[0],
            "last_Hz": frequency[-1],
            "outputs": found.outputs,
            "inputs": found.inputs,
        },
        sheets=[table_of_frf(computed)],
    )


def table_of_frf(frf: FRF) -> Table:
    """Return FRFs as a table: frequencies down, real and imaginary parts across."""
    pairs = [(i, j) for j in range(len(frf.inputs)) for i in range(len(frf.outputs))]
    parts = {"re": np.real(frf.H), "im": np.imag(frf.H)}
    each = [
        Column(f"{part}({frf.outputs[i]}/{frf.inputs[j]})", values[:, i, j], frf.unit)
        for i, j in pairs
        for part, values in parts.items()
    ]
    return Table("FRFs", [Column("frequency", frf.frequency, "Hz"), *each])


def asked_lines(study: Study, options: Options, values: int) -> np.ndarray:
    """Return the frequencies that are asked for, or those of the measurement or study [Hz].

    Parameters
    ----------
    study : Study
    options : Options
    values : int
        Number of FRFs, which bounds that of the lines.
    """
    if options.start is None and options.stop is None and options.step is None:
        return study.measurements[0].frf.frequency if study.measurements else study.frequency
    base = study.measurements[0].frf.frequency if study.measurements else study.frequency
    stop = options.stop or float(base[-1])
    step = options.step or (float(base[1] - base[0]) if base.size > 1 else stop / 1000)
    start = options.start or max(step, float(base[0]))
    if start > stop:
        msg = f"the first frequency, {start:g} Hz, lies above the last, {stop:g} Hz"
        raise OutputError(msg)
    n = (stop - start) / step
    most = min(MOST_LINES, MOST_VALUES // values)
    if n > most:
        msg = (
            f"{n:.3g} lines from {start:g} to {stop:g} Hz in steps of {step:g} Hz, of {values} FRFs, are too "
            f"many; at most {most} are computed; give a larger --step"
        )
        raise OutputError(msg)
    return start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1)
