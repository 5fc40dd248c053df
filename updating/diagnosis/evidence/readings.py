"""The same data read in two ways: with every fault of the measurement set right, or only the sure ones.

Some faults resemble effects on the structure: a sensor beside a shifted foot seems to read too much. Each way
has its own search. Their hypotheses are on one scale, and the most probable one is the answer.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from updating.inference.fit_data import FitData
from updating.quality.corrections import UNLIKE_EFFECTS, Fault, corrected, log_odds_against


def doubtful(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Return the faults that resemble effects on the structure."""
    return tuple(f for f in faults if f.kind not in UNLIKE_EFFECTS)


def as_read(data: FitData, right: FitData, sure: Sequence[Fault]) -> FitData:
    """Return data in which only the sure faults are set right.

    Parameters
    ----------
    data : FitData
        As they were measured.
    right : FitData
        With all faults set right. Its noise counts, so that fits to both can be compared.
    sure : sequence of Fault
    """
    return replace(corrected(data, sure), noise=right.noise)


def log_prior(faults: Sequence[Fault], data: FitData) -> float:
    """Return the logarithm of the prior odds for faults, with the Occam factors of their values.

    The odds are those of effects: against one more change, by the number of channels, and by that of the
    kinds of faults of each. A value may be anywhere in the range that was looked at: its Occam factor is
    √(2π) times its standard deviation over this range. Fits to corrected data still have the channel's
    tolerance, so that any value within it does as well.
    """
    errors = data.measurement.errors
    tolerances = {"gain": errors.gain, "tilt": errors.direction}
    channels = {"sensor": data.measurement.sensors, "excitation": data.measurement.excitations}
    total = 0.0
    for f in faults:
        of, kind = f.kind.split("_", 1)
        std = np.hypot(f.std / f.value if kind == "gain" else f.std, tolerances.get(kind, 0.0))
        occam = np.log(min(1.0, np.sqrt(2 * np.pi) * std / f.span)) if std > 0 and f.span > 0 else 0.0
        total += float(occam) - log_odds_against(len(channels[of]))
    return total
