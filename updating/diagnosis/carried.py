"""What a model that is calibrated on one state of a structure leaves there, carried over to another state."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools
from fem.model import Model
from updating.correlation import log_ratio
from updating.inference.fit import FitProblem
from updating.inference.fit_data import MODEL_ERROR, FitData
from updating.inference.fit_result import FitResult
from updating.inference.parameters import Nuisance
from updating.inference.preparation import prepared_like
from updating.measurement.measurement import Measurement
from updating.quality.corrections import Fault, corrected

CHANGED = 0.1
"""Share of the form's error that two states of one structure do not share: it acts on the change [-]."""


@dataclass(frozen=True, slots=True)
class Between:
    """What two states differ by besides effects.

    Attributes
    ----------
    nuisances : tuple of Nuisance
        Parameters of the model that have values of their own in each state.
    damping_std : float or None
        Standard deviation of the logarithm of the damping ratio from one state to the other [-]; as uncertain
        as in the first state unless given.
    form_share : float
        Share of the form's error that is not common to both [-].
    """

    nuisances: tuple[Nuisance, ...] = ()
    damping_std: float | None = None
    form_share: float = CHANGED


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedFrfs:
    """A model that was fitted to the FRFs of one state.

    Attributes
    ----------
    model : Model
        With fitted values, form included.
    problem : FitProblem
        Of this state, with faults set right.
    result : FitResult
        The fit.
    faults : tuple of Fault
        Of sensors and forces of this state.
    mesh_db : float
        Error of the mesh [dB].
    alone : FitProblem
        Of this state and the calibrated model, with nothing uncertain but damping, as of the second state.
    """

    model: Model
    problem: FitProblem
    result: FitResult
    faults: tuple[Fault, ...]
    mesh_db: float
    alone: FitProblem

    @property
    def level(self) -> float:
        """Robust level of what the model leaves, amplitude and phase [nepers]."""
        return self.result.level

    def at(self, before: Measurement, outputs: Sequence[str], inputs: Sequence[str]) -> "CalibratedFrfs":
        """Return the same calibration with data of other channels of the first state, as far as it has them.

        Parameters
        ----------
        before : Measurement
            Of the first state, with all channels.
        outputs, inputs : sequence of str
            Names of sensors and excitations.
        """
        frf = before.frf
        outputs, inputs = [n for n in outputs if n in frf.outputs], [n for n in inputs if n in frf.inputs]
        if not outputs or not inputs:
            return self
        f = self.alone.data.frequency
        kept = before.with_frf(frf.select(outputs, inputs, band=(float(f[0]), float(f[-1]))))
        data = corrected(prepared_like(self.alone, kept), self.faults)
        return replace(self, alone=replace(self.alone, data=data))


def carried_over(first: CalibratedFrfs, after: FitData, form_share: float = CHANGED) -> FitData:
    """Return the second state's data without what the calibrated model leaves on the first.

    ln H is less by d = ln(measured / computed) of the first state, and variances of both states add. The
    structure moves its resonances, and d with them: at a line whose FRF has changed by c = ln(after / before)
    as much as |c| of d may belong elsewhere, and |c| ≪ 1 for a small change. So d is uncertain by
    |d| min(1, √(form_share² + |c|²)). Values that the first state has not are compared without correction,
    and are as uncertain as d is large at the others.
    """
    before = first.alone.data
    d_at = -first.alone.log_ratio(first.alone.nominal())  # NaN where it does not count
    d, known = at_lines_of(d_at, before, after)
    H_before, _ = at_lines_of(np.log(np.where(before.H != 0, before.H, 1.0)), before, after, angle=True)
    noise, _ = at_lines_of(before.noise, before, after)
    c = np.where(known, log_ratio(after.H, np.exp(np.where(known, H_before, 0.0))), 0.0)
    d, noise = np.where(known, d, 0.0), np.where(known, noise, 0.0)
    uncertain = np.abs(d) * np.minimum(1.0, np.hypot(form_share, np.abs(c)))
    rms = float(np.sqrt((np.abs(d[known]) ** 2).mean())) if known.any() else 0.0
    uncertain = np.where(known, uncertain, rms)
    mask = after.mask
    total = np.sqrt(after.uncertain**2 + noise**2 + uncertain**2)
    return replace(
        after,
        H=np.where(mask, after.H * np.exp(-d), after.H),
        weight=MODEL_ERROR / np.hypot(MODEL_ERROR, total) * mask,
        noise=np.hypot(after.noise, noise),
    )


def at_lines_of(
    values: NDArray[Any], have: FitData, want: FitData, *, angle: bool = False
) -> tuple[NDArray[Any], Bools]:
    """Return values of one state at lines and channels of another, and which of them there are.

    Between lines they are linear; with ``angle`` their imaginary parts are angles, continued first.
    """
    one, two = have.measurement.frf, want.measurement.frf
    out: NDArray[Any] = np.full(want.H.shape, np.nan, dtype=values.dtype)
    f = have.frequency
    within = (want.frequency >= f[0] * (1 - 1e-9)) & (want.frequency <= f[-1] * (1 + 1e-9))
    for (i, output), (j, force) in product(enumerate(two.outputs), enumerate(two.inputs)):
        if output in one.outputs and force in one.inputs:
            column = values[:, one.outputs.index(output), one.inputs.index(force)]
            if angle:
                column = np.real(column) + 1j * np.unwrap(np.imag(column))
            # NaN at a line that does not count makes lines between it and its neighbours NaN, too
            out[within, i, j] = np.interp(want.frequency, f, column)[within]
    return out, np.isfinite(out)
