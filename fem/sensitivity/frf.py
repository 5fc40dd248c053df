"""FRFs with their derivatives, dH = -H_o dZ H_i: direct at each line, or on a reduced model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFError, FRFKind
from fem.analysis.receptance import LOCAL_DAMPING, locals_of
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Complexes, Floats
from fem.linalg.solvers import SingularMatrixError, factorise
from fem.model import ParameterRef
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model
from fem.sensitivity.matrices import MatrixDerivative, differentiate_matrices
from fem.summary import fields_summary
from fem.system import System, refuse_unsymmetric

LOCAL_FORCES = 48
"""Largest number of parameters' forces that join those of outputs and inputs in the basis of reduced FRFs."""


@dataclass(frozen=True, slots=True, eq=False)
class FRFSensitivity:
    """Frequency response functions and their derivatives.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        The parameters.
    frf : FRF
        At the present values.
    dH : ndarray of complex (n_par, n_freq, n_out, n_in)
        Derivatives of ``frf.H`` [its unit per unit of the parameter].
    """

    refs: tuple[ParameterRef, ...]
    frf: FRF
    dH: Complexes

    __repr__ = fields_summary


def differentiate_frf(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    refs: Sequence[ParameterRef] | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    method: str = "reduced",
) -> FRFSensitivity:
    """Compute FRFs and their derivatives, dH = -H_o dZ H_i.

    H_o and H_i are the responses of the elements that change to forces at the outputs and at the inputs.
    ``"direct"`` factorises Z(ω) at every line and is exact to rounding. ``"reduced"`` projects once on modes
    up to 2.5 times the highest frequency and six block-Krylov vectors of each output and input
    (:class:`fem.reduction.parametric_frf.ParametricFRF`), and of the forces of parameters that touch few
    DOFs, up to `LOCAL_FORCES` of them. Elsewhere H_o and H_i err by (1/2.5)¹² = 2e-5 of the contribution of
    higher modes at the highest frequency, and, where damping is not proportional, by the loss factor of that.

    Modal damping ratios are taken as 2iζ(ω)K by ``"reduced"``, the same at resonances.

    Parameters
    ----------
    system : System
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    outputs, inputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    refs : sequence of (effect, parameter), optional
        All parameters of the model's effects unless given.
    kind : FRFKind or str
        Receptance, mobility or accelerance.
    method : str
        ``"reduced"`` or ``"direct"``.

    Raises
    ------
    ModelError
        For parameters that the model does not have.
    FRFError
        For an unknown method, modal ratios with ``"direct"``, or a line where the receptance is infinite.
    """
    model = system.model
    refuse_unsymmetric(model)
    refs = tuple(model.values()) if refs is None else tuple(refs)
    out, out_labels = dof_vectors(model, outputs)
    inn, in_labels = dof_vectors(model, inputs)
    frequency = np.array(frequency, dtype=float, ndmin=1)
    if method == "reduced":
        H, dH = _reduced_slopes(system, frequency, out, inn, refs)
    elif method == "direct":
        H, dH = _direct_slopes(system, frequency, out, inn, refs)
    else:
        msg = f"the FRF method is '{method}'; allowed are reduced, direct"
        raise FRFError(msg)
    if not (np.isfinite(H).all() and np.isfinite(dH).all()):
        msg = "the receptance is infinite at a line: 0 Hz on a free structure, or an undamped resonance"
        raise FRFError(msg)
    frf = FRF.from_arrays(frequency, H, FRFKind.RECEPTANCE, out_labels, in_labels).as_kind(kind)
    factor = (2j * np.pi * frequency[:, None, None]) ** frf.kind.derivatives
    return FRFSensitivity(refs, frf, dH * factor)


def _local_forces(n_dof: int, derivatives: Sequence[tuple[MatrixDerivative, ...]]) -> Floats:
    """Return an orthonormal basis (n_dof, n) of the forces of parameters that touch few DOFs.

    Motions there become responses to forces of the basis, as accurate as the outputs'. Parameters come in
    until `LOCAL_FORCES` are there.
    """
    columns = np.zeros((n_dof, 0))
    for parts in derivatives:
        if sum(part.dofs.size for part in parts) > LOCAL_DAMPING:
            continue
        for part in parts:
            given = [X for X in (part.K, part.M, part.C, part.D, part.stiffness) if X is not None]
            for dofs, *matrices in zip(part.dofs, *(np.real(X) for X in given), strict=True):
                scaled = [X / max(np.abs(X).max(), 1e-300) for X in matrices]
                U, s, _ = np.linalg.svd(np.hstack(scaled))
                new = np.zeros((n_dof, int((s > 1e-12 * s[0]).sum())))
                np.add.at(new, dofs, U[:, : new.shape[1]])
                for _ in range(2):
                    new = new - columns @ (columns.T @ new)
                U, s, _ = np.linalg.svd(new, full_matrices=False)
                columns = np.hstack([columns, U[:, s > 1e-6]])
        if columns.shape[1] > LOCAL_FORCES:
            break
    return columns


def _direct_slopes(
    system: System, frequency: Floats, out: Floats, inn: Floats, refs: tuple[ParameterRef, ...]
) -> tuple[Complexes, Complexes]:
    model = system.model
    if model.damping.ratio.any():
        msg = (
            "the direct method needs damping matrices; modal damping ratios have none (use method='reduced')"
        )
        raise FRFError(msg)
    parts = [differentiate_matrices(model, ref) for ref in refs]
    forces = np.asarray(system.Q.T @ np.hstack([out, inn])).astype(complex)
    n_out = out.shape[1]
    H = np.empty((len(frequency), n_out, inn.shape[1]), dtype=complex)
    dH = np.zeros((len(refs), *H.shape), dtype=complex)
    for k, omega in enumerate((2 * np.pi * frequency).tolist()):
        try:
            u = system.Q @ factorise(system.dynamic_stiffness(omega)).solve(forces)
        except SingularMatrixError:
            H[k] = np.inf
            continue
        H[k] = out.T @ u[:, n_out:]
        for i, derivative in enumerate(parts):
            for part in derivative:
                at = u[part.dofs]
                force = part.dynamic_stiffness(model, omega) @ at[:, :, n_out:]
                dH[i, k] -= np.einsum("bmo,bmi->oi", at[:, :, :n_out], force, optimize=True)
    return H, dH


def _reduced_slopes(
    system: System, frequency: Floats, out: Floats, inn: Floats, refs: tuple[ParameterRef, ...]
) -> tuple[Complexes, Complexes]:
    model = system.model
    now = model.values()
    parts = [differentiate_matrices(model, ref) for ref in refs]
    dampers = (system.Q @ locals_of(system).U).toarray()
    forces = np.hstack([out, inn, dampers, _local_forces(model.n_dof, parts)])
    highest = max(float(frequency[-1]), 1.0)
    reduced = reduce_model(model, forces, highest, margin=2.5, n_krylov=6, releasable=False)
    engine = ParametricFRF(reduced, out, inn, frequency, refs)
    values = np.array([now[ref] for ref in refs], dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        H, dH, _ = engine.evaluate(values, model.damping.ratio_at(frequency))
    assert dH is not None
    return H, dH
