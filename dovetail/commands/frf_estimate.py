"""``dovetail frf-estimate``: FRFs from time data, with coherence and standard deviations."""

import argparse
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import integer_up_to, number_up_to, positive, values_by_name
from dovetail.commands.common import Options, noted, warn
from dovetail.commands.results import Results, Written
from dovetail.disk.output import OutputError, Progress
from dovetail.report.table import Column, Table
from fem.analysis.frf import TRANSMISSIBILITY, FRFKind
from fem.io.atomic import replacing

if TYPE_CHECKING:
    from fem.io.time_data import TimeData
    from updating.measurement.frf_estimation import EstimatedFRF

EXAMPLE = "dovetail frf-estimate hits.wav --force ch1 --scale ch1=230,ch2=98.1 --hits 0.8 --out frf.npz"

RESULTS = Results(
    picture="FRFs and coherences",
    more=(Written("--out", "file to write", (".npz", ".uff", ".unv"), required=True),),
    read={"records": "a record of time data"},
)
Floats = NDArray[np.float64]
STILL_RINGING = 0.05
"""A response whose level at the end of a block is above this part of its peak has not died away [-]."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "records",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="time data: .wav, .tdms, .csv, .txt, .npz, .mat, .h5 or .uff; records of hits are joined",
    )
    p.add_argument(
        "--force",
        "--reference",
        nargs="+",
        metavar="CHANNEL",
        help="channels of forces (default: those in a unit of force), or of the motions that "
        "transmissibilities refer to",
    )
    p.add_argument(
        "--response", nargs="+", metavar="CHANNEL", help="channels of responses (default: the rest)"
    )
    p.add_argument(
        "--scale",
        type=values_by_name,
        default={},
        metavar="CHANNEL=FACTOR,...",
        help="factors to SI units, such as N/V; they override the units in the file",
    )
    p.add_argument(
        "--rename",
        type=labels_by_name,
        default={},
        metavar="CHANNEL=LABEL,...",
        help="labels of channels in the FRFs, such as ch1=12Z+",
    )
    p.add_argument("--sample-rate", type=positive, metavar="HZ", help="of files that do not say it")
    p.add_argument(
        "--kind",
        choices=[*map(str, FRFKind), TRANSMISSIBILITY],
        help="kind of FRF (default: that of the units, else accelerance); a transmissibility is a motion for "
        "another one",
    )
    p.add_argument(
        "--hits",
        type=positive,
        metavar="S",
        help="cut a block of this many seconds after each hit of one hammer",
    )
    p.add_argument(
        "--block", type=integer_up_to(1 << 26, 8), metavar="N", help="samples of a block (default: an eighth)"
    )
    p.add_argument(
        "--overlap", type=number_up_to(0.99), default=0.5, help="of blocks, 0 to 0.99 (default 0.5)"
    )
    p.add_argument(
        "--window",
        choices=["hann", "rectangular", "flattop", "exponential"],
        help="of the blocks (default: hann, of hits rectangular)",
    )
    p.add_argument(
        "--force-length", type=positive, metavar="S", help="set forces to zero so long after a hit begins"
    )
    p.add_argument("--estimator", choices=["H1", "H2", "Hv"], default="H1", help="default H1")
    p.add_argument("--band", type=positive, nargs=2, metavar="HZ", help="lines to keep")


def labels_by_name(text: str) -> dict[str, str]:
    """Read labels of channels, ``ch1=12Z+,ch2=5X+``."""
    out: dict[str, str] = {}
    for part in text.split(","):
        name, mark, label = (word.strip() for word in part.partition("="))
        if not (name and mark and label) or name in out:
            msg = f"'{part.strip()}' is not allowed; CHANNEL=LABEL is needed, each once, separated by commas"
            raise argparse.ArgumentTypeError(msg)
        out[name] = label
    return out


@dataclass(frozen=True, slots=True, eq=False)
class _Chosen:
    """Channels of forces and responses in SI units; ``of_motion`` where motions are in place of forces."""

    force: Floats
    response: Floats
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    kind: str
    notes: tuple[str, ...]
    of_motion: bool = False


def run(options: Options, progress: Progress) -> Answer:
    """Estimate FRFs and write them."""
    from fem.io.time_data import read_time_data

    if len(options.records) > 1 and options.hits is None:
        msg = "several records are joined where --hits cuts blocks of them; give one record, or --hits"
        raise OutputError(msg)
    progress("reading")
    records = [read_time_data(path, options.sample_rate) for path in options.records]
    chosen = [_channels(options, record) for record in records]
    progress("estimating", 0.3)
    estimate, notes = _estimate(options, records, chosen)
    _write(options.out, estimate)
    if options.picture is not None:
        from viz.estimation import plot_estimate
        from viz.style import save

        with replacing(options.picture) as scratch:
            save(plot_estimate(estimate, title=options.out.stem), scratch)
    return _report(options, estimate, [*dict.fromkeys(n for c in chosen for n in c.notes), *notes])


def _channels(options: Options, data: "TimeData") -> _Chosen:
    """Return the forces and responses of a record in SI units."""
    from fem.io.time_data import force_unit, motion_unit
    from fem.io.units import size_of

    for name in (*options.scale, *options.rename):
        data.channel(name)
    by_unit = [c for c, u in zip(data.channels, data.units, strict=True) if force_unit(u) is not None]
    forces = options.force or by_unit
    if not forces:
        listed = ", ".join(f"{c} [{u or '-'}]" for c, u in zip(data.channels, data.units, strict=True))
        msg = f"{data.name}: no channel is in a unit of force; give --force, of {listed}"
        raise OutputError(msg)
    responses = options.response or [c for c in data.channels if c not in forces]
    if not responses or set(forces) & set(responses):
        msg = (
            f"{data.name}: the forces are {', '.join(forces)}, the responses {', '.join(responses) or 'none'}"
        )
        raise OutputError(msg)
    notes = list(data.notes)
    kinds: dict[str, FRFKind] = {}
    columns: dict[str, Floats] = {}
    for name in (*forces, *responses):
        at = data.channel(name)
        unit, is_force = data.units[at], name in forces
        motion, force = motion_unit(unit), force_unit(unit)
        if motion is not None:
            kinds[name] = motion[0]
        if not is_force and force is not None and name not in options.scale:
            msg = (
                f"{data.name}: the response {name} is in '{unit}', a unit of force; give it as --force, or "
                f"--scale {name}=FACTOR"
            )
            raise OutputError(msg)
        known = force if motion is None else motion[1]
        other = size_of(unit)
        if known is None and other is not None and any(other[1]) and name not in options.scale:
            msg = (
                f"{data.name}: channel {name} is in '{unit}', which is neither a force nor a motion; leave "
                f"it out by --force and --response, or give --scale {name}=FACTOR"
            )
            raise OutputError(msg)
        if name not in options.scale and known is None:
            of = "SI units" if not is_force or options.kind == TRANSMISSIBILITY else "N"
            notes.append(
                f"channel {name} of {data.name} has {f'the unit {unit!r}' if unit else 'no unit'} and is "
                f"taken to be in {of}; --scale {name}=FACTOR corrects that"
            )
        if data.full_scale is not None and (np.abs(data.values[:, at]) >= 0.999 * data.full_scale).any():
            notes.append(f"channel {name} of {data.name} reaches the end of its range: it may be clipped")
        columns[name] = options.scale.get(name, known or 1.0) * data.values[:, at]
    kind, of_motion = _kind(
        options, data, {c: kinds.get(c) for c in forces}, {c: kinds.get(c) for c in responses}
    )
    labels = [tuple(options.rename.get(n, n) for n in part) for part in (forces, responses)]
    parts = [np.column_stack([columns[n] for n in part]) for part in (forces, responses)]
    return _Chosen(parts[0], parts[1], labels[0], labels[1], kind, tuple(notes), of_motion)


def _kind(
    options: Options,
    data: "TimeData",
    references: dict[str, FRFKind | None],
    responses: dict[str, FRFKind | None],
) -> tuple[str, bool]:
    """Return the kind of the FRFs, and whether their references are motions in place of forces.

    A motion for another one has the kind of the FRF to the acceleration of the reference
    (:attr:`fem.io.uff_types.Function.kind`), so two of one quantity have that of a transmissibility.
    """
    stated = {c: k for c, k in responses.items() if k is not None and c not in options.scale}
    if len(set(stated.values())) > 1 and options.kind is None:
        listed = ", ".join(f"{c} of {k}" for c, k in stated.items())
        msg = f"{data.name}: the responses are of several kinds ({listed}); give --response of one kind"
        raise OutputError(msg)
    motions = {c: k for c, k in references.items() if k is not None and c not in options.scale}
    asked = options.kind == TRANSMISSIBILITY
    if not asked and (
        not motions or (options.kind is not None and all(c in options.scale for c in references))
    ):
        return str(options.kind or next(iter(stated.values()), FRFKind.ACCELERANCE)), False
    from fem.io.time_data import force_unit

    labels = {c: data.units[data.channel(c)] for c in (*references, *responses)}
    of_force = [c for c in references if force_unit(labels[c]) is not None and c not in options.scale]
    if of_force:
        msg = (
            f"{data.name}: the reference {of_force[0]} is in '{labels[of_force[0]]}', a unit of force; "
            "a transmissibility refers to a motion, and --force takes either forces or motions"
        )
        raise OutputError(msg)
    if options.kind is not None and not asked:
        name = next(iter(motions))
        msg = (
            f"{data.name}: --force {name} is in '{labels[name]}', a unit of motion, and --kind "
            f"{options.kind} needs a force [N]; give --kind {TRANSMISSIBILITY}, or --scale {name}=FACTOR to N"
        )
        raise OutputError(msg)
    of, to = (next(iter(k.values()), None) for k in (stated, motions))
    if len(set(motions.values())) > 1:
        listed = ", ".join(motions)
        msg = f"{data.name}: the references are different motions ({listed}); give --force of one kind"
        raise OutputError(msg)
    if of is None or to is None or of == to:
        return str(FRFKind.ACCELERANCE), True
    order = of.derivatives - to.derivatives + 2
    if asked or not 0 <= order <= 2:
        one, other = next(iter(stated)), next(iter(motions))
        msg = (
            f"{data.name}: {one} is in '{labels[one]}' and the reference {other} in '{labels[other]}'; a "
            "transmissibility needs two motions of one kind"
        )
        raise OutputError(msg)
    return str(tuple(FRFKind)[order]), True


def _estimate(
    options: Options, records: "list[TimeData]", chosen: list[_Chosen]
) -> "tuple[EstimatedFRF, list[str]]":
    """Return the estimated FRFs, and notes on the blocks."""
    from updating.measurement.frf_estimation import estimate_frf, split_hits

    first = chosen[0]
    for record, c in zip(records, chosen, strict=True):
        one, other = ((x.inputs, x.outputs, x.kind, x.of_motion) for x in (c, first))
        same = one == other
        if not same or not np.isclose(record.sample_rate, records[0].sample_rate, rtol=1e-6):
            msg = f"{record.name}: it has other channels or another sample rate than {records[0].name}"
            raise OutputError(msg)
    rate, notes = records[0].sample_rate, [r.rate_note for r in records if r.rate_note]
    force, response = first.force, first.response
    if options.hits is not None:
        if force.shape[1] != 1:
            msg = f"--hits is for one hammer; the forces are {', '.join(first.inputs)}"
            raise OutputError(msg)
        parts = [split_hits(c.force[:, 0], c.response, rate, options.hits) for c in chosen]
        force, response = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
        notes += _ringing(response, first.outputs, options.window)
    window = options.window or ("hann" if options.hits is None else "rectangular")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # its messages say the same
        estimate = estimate_frf(
            force,
            response,
            rate,
            block=options.block,
            overlap=options.overlap,
            window=window,
            force_length=options.force_length,
            estimator=options.estimator,
            kind=first.kind,
            outputs=first.outputs,
            inputs=first.inputs,
            band=None if options.band is None else tuple(options.band),
            hits=options.hits is not None,
        )
    if first.of_motion:
        estimate = replace(estimate, frf=replace(estimate.frf, base=estimate.frf.inputs))
    warn(estimate.messages)
    if estimate.added_decay:
        notes.append(
            f"the exponential window adds {estimate.added_decay:.4g} 1/s to the decay of every mode, "
            f"{estimate.added_decay / (2 * np.pi):.3g} Hz of frequency times damping ratio: the damping of "
            "these "
            "FRFs is too large by that"
        )
    return estimate, notes


def _ringing(blocks: Floats, outputs: tuple[str, ...], window: str | None) -> list[str]:
    """Say of which responses the blocks end before they have died away."""
    if window == "exponential":
        return []
    tail = max(1, blocks.shape[1] // 20)
    peak = np.abs(blocks).max(axis=1)
    last = np.sqrt((blocks[:, -tail:] ** 2).mean(axis=1)) * np.sqrt(2)
    share = np.divide(last, peak, out=np.zeros(peak.shape), where=peak > 0).max(axis=0)
    return [
        f"the response {name} still has {100 * s:.2g} % of its peak at the end of the blocks, which leaks "
        "into "
        "its FRF: give longer --hits, or --window exponential"
        for name, s in zip(outputs, share, strict=True)
        if s > STILL_RINGING
    ]


def _write(path: Path, estimate: "EstimatedFRF") -> None:
    """Write FRFs with their coherence, and in .npz with averages and standard deviations."""
    from fem.io import write_uff
    from fem.io.uff_types import Function

    frf = estimate.frf
    kind = TRANSMISSIBILITY if frf.quantity == TRANSMISSIBILITY else str(frf.kind)
    averages = max(1, int(np.floor(estimate.effective_averages.min())))
    if path.suffix.lower() == ".npz":
        with replacing(path) as scratch, scratch.open("wb") as file:
            np.savez_compressed(
                file,
                frequency=frf.frequency,
                H=frf.H,
                kind=np.array(kind),
                outputs=np.array(frf.outputs, dtype=str),
                inputs=np.array(frf.inputs, dtype=str),
                coherence=estimate.coherence,
                averages=np.array(averages),
                std=estimate.std,
                added_decay=np.array(estimate.added_decay),
                base=np.array(frf.base, dtype=str),
            )
        return
    coherences = [
        Function(
            function_type=6,  # coherence
            response=output,
            reference=force,
            response_name="",
            reference_name="",
            x=frf.frequency,
            values=estimate.coherence[:, i, j],
            x_type=18,  # frequency
            ordinate_type=0,
            denominator_type=0,
            x_unit="Hz",
            unit="",
            denominator_unit="",
            title=(),
            load_case=0,
            version=0,
            place="",
        )
        for i, output in enumerate(frf.outputs)
        for j, force in enumerate(frf.inputs)
    ]
    write_uff(path, frf, functions=coherences)


def _report(options: Options, estimate: "EstimatedFRF", notes: list[str]) -> Answer:
    frf = estimate.frf
    pairs = [(i, j) for j in range(len(frf.inputs)) for i in range(len(frf.outputs))]
    spread = estimate.std / np.maximum(np.abs(frf.H), 1e-300)
    table = Table.of(
        "FRFs",
        Column("FRF", [f"{frf.outputs[i]}/{frf.inputs[j]}" for i, j in pairs]),
        Column("least coherence", [_least(estimate, i, j) for i, j in pairs]),
        Column("median", [np.median(estimate.coherence[:, i, j]) for i, j in pairs], show=".4f"),
        Column("std of |H|, median", [np.median(spread[:, i, j]) for i, j in pairs], "%", ".3g", 100),
    )
    averages = max(1, int(np.floor(estimate.effective_averages.min())))
    uff = options.out.suffix.lower() != ".npz"
    return Answer(
        None,
        [
            f"{options.out}: {frf.quantity} [{frf.unit}], {len(frf.outputs)} responses to {len(frf.inputs)} "
            f"{'reference' if frf.base else 'force'}(s), {frf.n_freq} lines from {frf.frequency[0]:.4g} to "
            f"{frf.frequency[-1]:.4g} Hz, {options.estimator} of {estimate.n_averages[0]} blocks worth "
            f"{estimate.effective_averages[0]:.3g} independent ones",
            table,
            *noted(notes),
            "in a study:",
            "  [[measurements]]",
            f'  file = "{options.out.name}"',
            *([f"  averages = {averages}"] if uff else []),
        ],
    )


def _least(estimate: "EstimatedFRF", i: int, j: int) -> str:
    gamma = estimate.coherence[:, i, j]
    k = int(np.argmin(gamma))
    return f"{gamma[k]:.3f} at {estimate.frf.frequency[k]:.4g}"
