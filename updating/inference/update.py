"""Update a model's parameters to measured modes and FRFs, with their uncertainty.

    updated = update(model, [("frame", "E:steel")], frequency=[43.2, 118.9])
    updated = update(model, parameters, frf=H, lines=f, outputs=places, inputs=places[:1])
    print(updated.table())

An update is the most probable model with nothing added (:mod:`updating.inference.fitting`): the likelihood,
the form of the frame and the deviations are those of every fit and diagnosis. `docs/updating.md` says how and
when to doubt it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.linalg.solvers import one_thread
from fem.model import Model, ModelError
from updating.inference.arrays import frf_data, mode_data
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.form import with_form
from updating.inference.formed import formed_mode_problem, formed_problem
from updating.inference.mode_targets import ModeTargets
from updating.inference.places import Places
from updating.inference.unknowns import Parameters, checked_unknowns
from updating.inference.update_run import update_fitted
from updating.inference.update_settings import UpdateSettings
from updating.inference.updated import Updated
from updating.measurement.measurement import Measurement, with_resting_base
from updating.modal.identified_modes import IdentifiedModes


@one_thread()
def update(
    model: Model,
    parameters: Parameters,
    *,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    modes: Modes | IdentifiedModes | ModeTargets | None = None,
    frf: FRF | Measurement | ArrayLike | None = None,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    noise: ArrayLike | None = None,
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
    settings: UpdateSettings | None = None,
) -> Updated:
    """Update parameters of a model to measured natural frequencies, shapes, FRFs, or all of them at once.

    The form of the frame varies with them unless ``model_error`` is 0, which is textbook updating: the
    parameters alone, and noise as stated. Damping is fitted in any case.

    Parameters
    ----------
    model : Model
        At the values to start from.
    parameters : sequence of (effect, parameter) or Unknown, or mapping
        Parameters to update; a mapping gives prior standard deviations, relative for positive parameters [-]
        and in their units for others.
    frequency, shapes : array_like (n,), (n_out, n), optional
        Measured natural frequencies without rigid-body modes [Hz], and shapes at the outputs.
    modes : Modes or IdentifiedModes, optional
        Both in one, with damping ratios; labels pick outputs that are given by label. Identified modes bring
        their standard deviations, in place of ``frequency_std`` and ``shape_std``.
    frf : FRF, Measurement or array_like (n_freq, n_out, n_in), optional
    lines : array_like (n_freq,), optional
        Frequencies of bare FRFs [Hz].
    outputs, inputs : places, optional
        DOF numbers, (point, direction) pairs, rows of combinations, sensors, or (point, direction) by label.
    kind : FRFKind or str
        Of bare FRFs.
    band : (float, float), optional
        Lines that count [Hz].
    numbers : sequence of int, optional
        Which elastic modes of the model the frequencies belong to, counted from 0, where there are no shapes.
    frequency_std, shape_std : float or array_like (n,)
        Noise of the modes: of frequencies, and of a shape's components over its root mean square, relative
        [-].
    noise : float or array_like, optional
        Of the FRFs, relative, of real and imaginary part each; estimated unless given [-].
    damping_std : float
        Standard deviation of the logarithm of the damping ratio; 0 keeps the model's [-].
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself; 0 if
        nothing but noise and the mesh may be left [nepers].
    settings : UpdateSettings, optional

    Returns
    -------
    Updated
        The best point, also where the fit failed; ``ending`` and ``messages`` say so.

    Raises
    ------
    ModelError
        For unknown parameters, data that do not fit one another or the model, or nothing to fit.
    MeasurementError
        For FRFs of too few lines, or of which no value can be compared.
    """
    settings, unknowns = settings or UpdateSettings(), checked_unknowns(model, parameters)
    for what, value in (("damping_std", damping_std), ("model_error", model_error)):
        if not (np.isfinite(value) and value >= 0):
            msg = f"{what} is {value}; it must be finite and not negative"
            raise ModelError(msg)
    targets = _targets(model, frequency, shapes, modes, outputs, numbers, frequency_std, shape_std)
    if targets is None and frf is None:
        msg = "there is nothing to update to; give frequency, modes or frf"
        raise ModelError(msg)
    if not unknowns:
        msg = "there is no parameter to update"
        raise ModelError(msg)
    how = {"damping_std": damping_std, "model_error": model_error}
    if frf is None:
        assert targets is not None
        problem, _ = formed_mode_problem(model, targets, unknowns, **how)
    else:
        data = frf_data(model, frf, lines=lines, outputs=outputs, inputs=inputs, kind=kind, noise=noise)
        problem, _ = formed_problem(model, data, unknowns, band=band, n_lines=settings.n_lines, **how)
        problem = replace(problem, modes=targets)
    done = update_fitted(problem, with_form(model, model_error), unknowns, settings)
    return replace(done, model=with_resting_base(done.model))


def _targets(
    model: Model,
    frequency: ArrayLike | None,
    shapes: ArrayLike | None,
    modes: Modes | IdentifiedModes | ModeTargets | None,
    outputs: Places | None,
    numbers: Sequence[int] | None,
    frequency_std: ArrayLike,
    shape_std: ArrayLike,
) -> ModeTargets | None:
    if isinstance(modes, ModeTargets) or (modes is None and frequency is None):
        return modes
    more = {}
    if isinstance(modes, IdentifiedModes):
        more["zeta_std"] = modes.zeta_std / np.asarray(modes.modes.zeta)
        (frequency_std, shape_std), modes = modes.relative_std(), modes.modes
    if modes is not None and outputs is None:
        modes = replace(modes, shapes=modes.shapes[:0])
    elif shapes is not None and outputs is None:
        msg = "shapes need the places where they were measured: outputs=…"
        raise ModelError(msg)
    return mode_data(
        model,
        frequency,
        shapes,
        modes=modes,
        outputs=() if outputs is None else outputs,
        numbers=numbers,
        frequency_std=frequency_std,
        shape_std=shape_std,
        **more,
    )
