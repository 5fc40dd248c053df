"""Update a model's parameters to measured modes and FRFs, with their uncertainty.

    updated = update(model, [("frame", "E:steel")], frequency=[43.2, 118.9])
    updated = update(model, parameters, frf=H, lines=f, outputs=places, inputs=places[:1])
    print(updated.table())

Natural frequencies and shapes by their linearised sensitivities (Friswell and Mottershead, *Finite Element
Model Updating in Structural Dynamics*, 1995, ch. 8), FRFs by their logarithm, or both in one objective: the
negative log posterior of the parameters, with priors. `docs/updating.md` says how and when to doubt it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.model import Model, ModelError
from updating.inference.frf_data import FRFData, frf_data
from updating.inference.frf_residual import with_ratios
from updating.inference.mode_data import ModeData, mode_data
from updating.inference.places import Places
from updating.inference.unknowns import Parameters, scaled_unknowns
from updating.inference.update_nuisances import damping_knots, damping_ratios
from updating.inference.update_problem import UpdateProblem
from updating.inference.update_settings import UpdateSettings
from updating.inference.update_stages import run_and_release
from updating.inference.updated import Updated
from updating.measurement.measurement import Measurement, with_instruments, with_resting_base
from updating.modal.identified_modes import IdentifiedModes


def update(
    model: Model,
    parameters: Parameters,
    *,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    modes: Modes | IdentifiedModes | ModeData | None = None,
    frf: FRF | Measurement | FRFData | ArrayLike | None = None,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    noise: ArrayLike | None = None,
    model_error: float = 1e-3,
    amplitude_error: float = 0.01,
    damping: bool | ArrayLike | None = None,
    settings: UpdateSettings | None = None,
) -> Updated:
    """Update parameters of a model to measured natural frequencies, shapes, FRFs, or all of them at once.

    Minimised is Σ_g ½ n_g F(q_g) + ½ Σ ((x - mean)/std)², with q_g the mean square residual of modes
    (:mod:`updating.inference.mode_residual`) and of FRFs (:mod:`updating.inference.frf_residual`) in units of
    the stated variance, and F(q) = q - 1 below 1 and ln q above: the stated variance is the least, and while
    a model is far off its misfit counts as error, so that priors hold. Levenberg-Marquardt steps with exact
    derivatives, within bounds (:mod:`updating.least_squares.levenberg_marquardt`).

    FRFs are fitted up to rising frequencies on a reduced basis, which is made again at the new values until
    these stay; the cost of an iteration does not depend on the mesh.

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
        Both in one; its labels pick outputs that are given by label. Identified modes bring their standard
        deviations, in place of ``frequency_std`` and ``shape_std``.
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
    model_error, amplitude_error : float
        Error of natural frequencies and of amplitudes with the right parameters, relative [-].
    damping : bool or array_like, optional
        Whether modal damping ratios are updated too, which add to the model's other damping; an array gives
        the frequencies between which they are linear [Hz]. With FRFs it is so unless declined. Without, the
        measured modes' ratios are taken over if asked for.
    settings : UpdateSettings, optional

    Returns
    -------
    Updated
        The best point, also where the fit failed; ``ending`` and ``messages`` say so.

    Raises
    ------
    ModelError
        For unknown parameters, data that do not fit one another or the model, or nothing to fit.
    """
    settings = settings or UpdateSettings()
    if isinstance(frf, Measurement):
        model = with_instruments(model, frf.sensors, frf.excitations)
    of_modes = _mode_data(
        model, frequency, shapes, modes, outputs, numbers, frequency_std, shape_std, model_error
    )
    of_frf = None
    if isinstance(frf, FRFData):
        of_frf = frf
    elif frf is not None:
        of_frf = frf_data(
            model, frf, lines=lines, outputs=outputs, inputs=inputs, kind=kind, band=band, noise=noise,
            model_error=model_error, amplitude_error=amplitude_error,
        )  # fmt: skip
    if of_modes is None and of_frf is None:
        msg = "there is nothing to update to; give frequency, modes or frf"
        raise ModelError(msg)
    unknowns = scaled_unknowns(model, parameters)
    wanted = of_frf is not None if damping is None else damping is not False
    if of_frf is not None and wanted:
        given = None if isinstance(damping, bool) else damping
        knots = damping_knots(model, of_frf, given)
        unknowns = (*unknowns, *damping_ratios(model, knots))
    else:
        knots = None
    if not unknowns:
        msg = "there is no parameter to update"
        raise ModelError(msg)
    problem = UpdateProblem(model, unknowns, of_modes, of_frf, knots, settings)
    result = run_and_release(problem)
    result = replace(result, model=with_resting_base(result.model), problem=problem)
    if of_frf is None and wanted and of_modes is not None and of_modes.zeta is not None:
        d = model.damping
        omega = 2 * np.pi * of_modes.frequency
        other = (d.alpha / omega + d.beta * omega + d.loss_factor) / 2
        ratio = np.maximum(of_modes.zeta - other, 0.0)
        result = replace(result, model=with_ratios(result.model, of_modes.frequency, ratio))
    return result


def _mode_data(
    model: Model,
    frequency: ArrayLike | None,
    shapes: ArrayLike | None,
    modes: Modes | IdentifiedModes | ModeData | None,
    outputs: Places | None,
    numbers: Sequence[int] | None,
    frequency_std: ArrayLike,
    shape_std: ArrayLike,
    model_error: float,
) -> ModeData | None:
    if isinstance(modes, ModeData):
        return modes
    if isinstance(modes, IdentifiedModes):
        (frequency_std, shape_std), modes = modes.relative_std(), modes.modes
    if modes is None and frequency is None:
        return None
    if modes is not None and outputs is None:
        modes = replace(modes, shapes=modes.shapes[:0])
    elif shapes is not None and outputs is None:
        msg = "shapes need the places where they were measured: outputs=…"
        raise ModelError(msg)
    return mode_data(
        model, frequency, shapes, modes=modes, outputs=() if outputs is None else outputs, numbers=numbers,
        frequency_std=frequency_std, shape_std=shape_std, model_error=model_error,
    )  # fmt: skip
