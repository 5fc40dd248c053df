"""Small deviations that every model and every test have: of frequencies, damping, and channels.

Beams against real structures differ mostly in frequencies. Each mode, and each member, dissipates by some per
cent more or less than a smooth damping curve says; of a joint's dissipation less is known. Sensors sit and
point a little otherwise than a test's description says. Thousands of lines see that.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

from fem.array_types import Complexes, Floats
from fem.effects.places import frame_of
from fem.elements.frame import Frame, member_contribution
from fem.model import Contribution, Effect, Model
from fem.reduction.deviations import Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.system import mass_forces
from updating.inference.belief import FORM_DAMPING, FORM_MODES
from updating.inference.defaults import FULL_LINES
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import ChannelScatter, FormScatter
from updating.inference.frf_function import FrfFunction
from updating.inference.frf_inputs import FrfInputs

N_SIZES = 5
"""Number of sizes of eigenvalues' shifts that are compared."""


def form_scatter(
    problem: FrfInputs, result: FitResult, size: float | None = None, share: float = 1.0
) -> FormScatter | None:
    """Return the small deviations that the form has besides its parameters, at a fitted model.

    Of the modes' damping, and of their eigenvalues and of channels where the form is not said to be right. At
    several levels of force there are none: errors of modes are those of linear structures.

    Parameters
    ----------
    problem : FrfInputs
    result : FitResult
    size : float, optional
        Standard deviation of the shifts of eigenvalues; the middle of what it may be unless given [-].
    share : float
        Part of the deviations that the data still have [-].
    """
    if problem.responses.n_levels > 1:
        return None
    damping = share * FORM_DAMPING
    if problem.model_error == 0:
        return scatter_of(problem, result, damping, 0.0)
    sizes = share * np.geomspace(*FORM_MODES, N_SIZES)
    middle = float(sizes[N_SIZES // 2])
    return with_channels(
        problem,
        result,
        scatter_of(problem, result, damping, middle if size is None else size, tuple(sizes)),
        share,
    )


def scatter_of(
    problem: FrfInputs,
    result: FitResult,
    damping: float,
    eigenvalue: float,
    sizes: tuple[float, ...] = (),
) -> FormScatter | None:
    """Return small deviations of damping and of eigenvalues at a fitted model; None if they are 0.

    Parameters
    ----------
    problem : FrfInputs
    result : FitResult
        The fitted model whose modes deviate.
    damping : float
        Standard deviation of the logarithm of each mode's damping ratio, and of each member's loss factor in
        parts of the median one, 2ζ [-]. The loss factor of each joint, η + 2ζ, is as uncertain as the study's
        damping.
    eigenvalue : float
    sizes : tuple of float
        As of :class:`FormScatter`.
    """
    if max(damping, eigenvalue) == 0:
        return None
    model, refs = problem.reduced.model, list(result.values)
    frequency = problem.data.frequency[problem.lines_up_to(np.inf, 2)]
    engine = problem.engine(frequency, refs, result.effects)
    total, _ = engine.matrices(np.array(list(result.values.values())))
    lam, modes = _forces(problem, engine, total)
    stiff = modes if eigenvalue > 0 else modes[:, :0]
    if damping == 0:
        return FormScatter(Deviations(stiff, modes[:, :0]), eigenvalue, np.zeros(0), sizes)
    loss = 2 * _of_members(problem, result, np.sqrt(lam) / (2 * np.pi))
    typical_loss = 2 * float(np.median(_of_members(problem, result, problem.data.frequency)))
    members = tuple(model.mesh.members) if len(model.mesh.members) > 1 and model.of_kind(Frame) else ()
    connections = _as_fitted(model, result)
    parts = [member_contribution(frame_of(model), model, m) for m in members]
    parts += [_with_changes(model, e, result.effects) for e in connections]
    elements = tuple(tuple(Contribution(c.dofs, D=c.K) for c in each if c.K is not None) for each in parts)
    of_joints = [problem.damping.std * (_loss_factor(e) + typical_loss) for e in connections]
    std = [np.full(modes.shape[1], damping), np.full(len(members), damping * typical_loss), of_joints]
    lossy = modes * np.sqrt(loss)
    return FormScatter(Deviations(stiff, lossy, elements), eigenvalue, np.concatenate(std), sizes)


def channel_scatter(problem: FrfInputs) -> FormScatter | None:
    """Return the errors of channels alone that data can know, at the nominal model."""
    none = np.zeros((problem.reduced.model.n_dof, 0))
    return with_channels(problem, problem.nominal(), FormScatter(Deviations(none, none), 0.0, np.zeros(0)))


def with_channels(
    problem: FrfInputs, result: FitResult, scatter: FormScatter | None, share: float = 1.0
) -> FormScatter | None:
    """Return small deviations with the errors of channels that data can know, at a fitted model.

    For each channel the left singular vectors of what a standard deviation of its errors changes, counted as
    if nothing but noise were left.
    """
    std = share * problem.data.measurement.errors.std
    if scatter is None or not std.any():
        return scatter
    changed, weight = _misread(problem, result)
    of, units = [], []
    for k, (change, counts) in enumerate(zip(changed, weight, strict=True)):
        S = std[:, None] * change.reshape(len(std), -1) * counts.ravel()
        U, s, _ = np.linalg.svd(np.hstack([S.real, S.imag]), full_matrices=False)
        # An error of a channel that changes the data by less than this does not vary [standard deviations of
        # them]. It costs an unknown and would change the evidence by ½ ln(1 + 0.3²) = 0.04 at most.
        known = U[:, s > 0.3].T * std
        of += [k] * len(known)
        units.append(known)
    return replace(scatter, channels=ChannelScatter(np.array(of, dtype=np.int64), np.concatenate(units), std))


def _misread(problem: FrfInputs, result: FitResult) -> tuple[list[Complexes], list[Floats]]:
    """Return what a unit of each error of each channel does to ln H, and what that counts, by channels.

    (5, n_lines, n_in) and (n_lines, n_in) of sensors, then with n_out of excitations.
    """
    # Lines that say which errors of channels data can know
    lines = problem.lines_up_to(np.inf, 40)
    data, refs, f = problem.data, list(result.values), problem.data.frequency[lines]
    engine = problem.engine(f, refs, result.effects, channels=result.channels)
    values, zeta = np.array([result.values[r] for r in refs]), problem.damping.ratio(f, result.zeta)
    state, _, _ = engine.solve(values, zeta)
    Xi, Xo = (state.solve(engine.inputs), state.solve(engine.outputs, transposed=True))
    every = engine.read(values, state, Xi)
    H = engine.referred(every)
    misread = np.tensordot(state.V.T, problem.misread[engine.active], axes=1)
    n_out = H.shape[1]
    of_outputs = np.einsum("roe,rif->oefi", misread[:, :n_out], Xi, optimize=True)
    of_inputs = np.einsum("rie,rof->efoi", misread[:, n_out:], Xo, optimize=True)
    of_inputs = engine.referred_slopes(of_inputs, every)
    # Errors of the sensors that responses refer to are not among them.
    alone = every[:, :n_out]
    by, by_output = (np.where(X != 0, 1 / np.where(X != 0, X, 1.0), 0.0) for X in (H, alone))
    function = FrfFunction(problem, (), *problem.unknowns((), ()), lines)
    levels = function.levels(counted_as=FULL_LINES)
    member = np.unique(function.groups, return_inverse=True)[1]
    worth = np.zeros(H.shape)
    worth[function.keep] = (levels.weight(levels.noise) / np.bincount(member))[member]
    counts = data.weight[lines] * np.sqrt(worth)
    outputs = [of_outputs[k] * by_output[:, k] for k in range(n_out)]
    inputs = [of_inputs[..., k] * by[:, :, k] for k in range(H.shape[2])]
    if not data.phase:  # amplitudes alone are known
        outputs, inputs = ([x.real + 0j for x in side] for side in (outputs, inputs))
    return [*outputs, *inputs], [*(counts[:, k] for k in range(n_out)), *np.moveaxis(counts, 2, 0)]


def _forces(problem: FrfInputs, engine: ParametricFRF, total: dict[str, Any]) -> tuple[Floats, Floats]:
    """Return λ (n,) and √λ Mφ (n_dof, n) of the elastic modes in the band and the next one.

    M is that of the nominal model; the forces are scaled so that φᵀ s = √λ in any case.
    """
    highest = (2 * np.pi * problem.data.frequency[-1]) ** 2
    lam, V = eigh(total["K"], total["M"], check_finite=False)
    elastic = np.flatnonzero(lam > 1e-6 * highest)
    elastic = elastic[: int((lam[elastic] <= highest).sum()) + 1]
    shapes = problem.reduced.basis.T[:, engine.active] @ V[:, elastic]
    return lam[elastic], mass_forces(problem.reduced.system, shapes) * np.sqrt(lam[elastic])


def _of_members(problem: FrfInputs, result: FitResult, frequency: Floats) -> Floats:
    """Return the damping ratio of members at frequencies [Hz]."""
    return np.asarray(np.atleast_2d(problem.damping.ratio(frequency, result.zeta))[0], dtype=float)


def _as_fitted(model: Model, result: FitResult) -> tuple[Effect, ...]:
    """Return connections with a loss factor at fitted values."""
    out = []
    for e in model.effects:
        if not e.connection or not np.isfinite(_loss_factor(e)):
            continue
        values = {name: v for (effect, name), v in result.values.items() if effect == e.name}
        out.append(e.with_values(**values))
    return tuple(out)


def _with_changes(model: Model, connection: Effect, effects: Iterable[Effect]) -> tuple[Contribution, ...]:
    """Return the elements of a connection, and those that effects add to the same DOFs."""
    parts = model.parts_of(connection)
    more = (c for e in effects for c in model.parts_of(e))
    return *parts, *(c for c in more if any(np.array_equal(c.dofs, part.dofs) for part in parts))


def _loss_factor(effect: Effect) -> float:
    """Return an effect's loss factor; NaN if it has none."""
    return next((float(np.real(p.value)) for p in effect.parameters() if p.name == "eta"), np.nan)
