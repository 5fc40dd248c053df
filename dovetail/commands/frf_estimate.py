"""``dovetail frf-estimate``: FRFs from time data, with coherence and standard deviations."""

import argparse
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import integer_up_to, number_up_to, positive, values_by_name
from dovetail.commands.common import Options, noted, warn
from dovetail.commands.results import Results, Written
from dovetail.disk.output import OutputError, Progress
from dovetail.report.table import Column, Table
from fem.analysis.frf import TRANSMISSIBILITY, FRFKind
from fem.array_types import Floats
from fem.io.atomic import replacing

if TYPE_CHECKING:
    from fem.io.time_data import TimeData
    from updating.measurement.frf_estimation import EstimatedFRF
    from updating.measurement.recorded_channels import RecordedChannels

EXAMPLE = "dovetail frf-estimate hits.wav --force ch1 --scale ch1=230,ch2=98.1 --hits 0.8 --out frf.npz"

RESULTS = Results(
    picture="FRFs and coherences",
    more=(Written("--out", "file to write", (".npz", ".uff", ".unv"), required=True),),
    read={"records": "a record of time data"},
)


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


def run(options: Options, progress: Progress) -> Answer:
    """Estimate FRFs and write them."""
    from fem.io.time_data import read_time_data
    from updating.measurement.recorded_channels import recorded_channels

    if len(options.records) > 1 and options.hits is None:
        msg = "several records are joined where --hits cuts blocks of them; give one record, or --hits"
        raise OutputError(msg)
    progress("reading")
    records = [read_time_data(path, options.sample_rate) for path in options.records]
    chosen = [
        recorded_channels(
            record,
            options.force,
            options.response,
            scale=options.scale,
            labels=options.rename,
            kind=options.kind,
        )
        for record in records
    ]
    progress("estimating", 0.3)
    estimate, notes = _estimate(options, records, chosen)
    _write(options.out, estimate)
    if options.picture is not None:
        from viz.curves import plot_estimate
        from viz.style import save

        save(plot_estimate(estimate, title=options.out.stem), options.picture)
    return _report(options, estimate, [*dict.fromkeys(n for c in chosen for n in c.notes), *notes])


def _estimate(
    options: Options, records: "list[TimeData]", chosen: "list[RecordedChannels]"
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
    from updating.measurement.frf_estimation import level_at_end

    if window == "exponential":
        return []
    return [
        f"the response {name} still has {100 * s:.2g} % of its peak at the end of the blocks, which leaks "
        "into "
        "its FRF: give longer --hits, or --window exponential"
        for name, s in zip(outputs, level_at_end(blocks), strict=True)
        # A response whose level at the end of a block is above this part of its peak has not died away [-]
        if s > 0.05
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
