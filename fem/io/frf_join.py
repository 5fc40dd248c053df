"""FRFs of several files, such as one for each pair, as one matrix."""

from collections.abc import Sequence

import numpy as np

from fem.analysis.frf import FRF
from fem.io.arrays import TableError
from fem.io.frf_labels import matrix_of
from fem.io.frf_reading import Reading


def joined(readings: Sequence[Reading], names: Sequence[str]) -> Reading:
    """Return the FRFs of several files as one matrix.

    Parameters
    ----------
    readings : sequence of Reading
        With one matrix each.
    names : sequence of str
        Their files, for messages.
    """
    for reading, name in zip(readings, names, strict=True):
        if len(reading.frfs) != 1:
            msg = f"{name}: it has {len(reading.frfs)} matrices of FRFs; of several files each must have one"
            raise TableError(msg)
    frfs = [reading.frfs[0] for reading in readings]
    first = frfs[0]
    for frf, reading, name in zip(frfs, readings, names, strict=True):
        same = frf.n_freq == first.n_freq and np.allclose(frf.frequency, first.frequency, rtol=1e-6, atol=0)
        if not same:
            msg = (
                f"{name}: it has {frf.n_freq} lines from {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz, "
                f"{names[0]} {first.n_freq} from {first.frequency[0]:g} to {first.frequency[-1]:g} Hz; FRFs "
                "of one matrix need the same lines"
            )
            raise TableError(msg)
        if frf.kind != first.kind or reading.phase != readings[0].phase:
            msg = (
                f"{name}: its FRFs are {_words(reading)}, those of {names[0]} {_words(readings[0])}; one "
                "kind is needed"
            )
            raise TableError(msg)
    where: dict[tuple[str, str], tuple[int, int, int]] = {}
    for k, frf in enumerate(frfs):
        for i, output in enumerate(frf.outputs):
            for j, force in enumerate(frf.inputs):
                if (output, force) in where:
                    msg = (
                        f"{names[k]}: {output}/{force} is in {names[where[output, force][0]]}, too; give "
                        "pairs, response/force of each file"
                    )
                    raise TableError(msg)
                where[output, force] = k, i, j
    outputs, inputs, missing = matrix_of(where)
    if missing:
        msg = (
            f"the files {', '.join(names[:4])}{' …' if len(names) > 4 else ''} lack "
            f"{', '.join(missing[:5])}; each response to each force is needed once"
        )
        raise TableError(msg)
    H = np.empty((first.n_freq, len(outputs), len(inputs)), dtype=complex)
    known = [r.coherence is not None for r in readings]
    gamma = np.full(H.shape, np.nan)
    for (output, force), (k, i, j) in where.items():
        at = outputs.index(output), inputs.index(force)
        H[:, at[0], at[1]] = frfs[k].H[:, i, j]
        coherence = readings[k].coherence
        if coherence is not None:
            gamma[:, at[0], at[1]] = coherence[:, i, j]
    base = [name for name in inputs if any(name in frf.base for frf in frfs)]
    strain = [name for name in outputs if any(name in frf.strain for frf in frfs)]
    labels = tuple(dict.fromkeys(label for r in readings for group in r.axes for label in group))
    return Reading(
        (FRF.from_arrays(first.frequency, H, first.kind, outputs, inputs, base, strain),),
        (labels,) if labels else (),
        readings[0].phase,
        gamma if any(known) else None,
        readings[0].averages,
        tuple(f for r in readings for f in r.functions),
        next((r.points for r in readings if r.points is not None), None),
        tuple(f"{name}: {note}" for r, name in zip(readings, names, strict=True) for note in r.notes),
    )


def _words(reading: Reading) -> str:
    return f"{reading.frfs[0].kind}{'' if reading.phase else ' without phase'}"
