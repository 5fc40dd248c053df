"""Frequency response functions: one type for measured and computed data, and how a system gives them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike, NDArray

from fem.basis import reduced_basis
from fem.model import DIRECTIONS, Model, ModelError
from fem.solvers import SingularMatrixError, factorise
from fem.system import System, law_change

Selection = Sequence[int | tuple[int, str]] | NDArray[np.float64]
"""DOF numbers, (point, direction) pairs, or combinations of DOFs as rows of an array (n, n_dof)."""

LOCAL_DAMPING = 48
"""A contribution to the damping that touches more DOFs than this is not local.

It is then taken for a member with a loss factor rather than a damper.
"""


class FRFKind(StrEnum):
    """Response per unit force: displacement, velocity or acceleration."""

    RECEPTANCE = "receptance"
    MOBILITY = "mobility"
    ACCELERANCE = "accelerance"

    @property
    def derivatives(self) -> int:
        """Number of time derivatives of the displacement: 0, 1 or 2."""
        return ("receptance", "mobility", "accelerance").index(self.value)

    @property
    def unit(self) -> str:
        """SI unit of a translational FRF."""
        return {"receptance": "m/N", "mobility": "(m/s)/N", "accelerance": "(m/s²)/N"}[self.value]


class FRFError(ValueError):
    """Frequency response data that cannot be used; the message says what was found and what is allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class FRF:
    """Frequency response functions with labels; time dependence e^{+iωt}.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Strictly increasing frequencies [Hz].
    H : ndarray of complex (n_freq, n_out, n_in)
        Response ``outputs[i]`` to a unit force at ``inputs[j]`` [SI unit of ``kind``].
    kind : FRFKind
        Receptance, mobility or accelerance.
    outputs, inputs : tuple of str
        Labels of the responses and of the forces, such as ``"U1z"`` or ``"12Z+"``.
    """

    frequency: NDArray[np.float64]
    H: NDArray[np.complex128]
    kind: FRFKind
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    @classmethod
    def from_arrays(
        cls,
        frequency: ArrayLike,
        H: ArrayLike,
        kind: FRFKind | str = FRFKind.ACCELERANCE,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> "FRF":
        """Build an FRF from bare arrays, checking them; one-dimensional ``H`` is one response to one force.

        Raises
        ------
        FRFError
            For shapes that do not fit, frequencies that do not increase or are negative, values that are not
            finite, labels given twice, or an unknown kind.
        """
        try:
            kind = FRFKind(kind)
        except ValueError:
            msg = f"the FRF kind is '{kind}'; allowed are {', '.join(FRFKind)}"
            raise FRFError(msg) from None
        frequency = np.array(frequency, dtype=float, ndmin=1)
        H = np.array(H, dtype=complex)
        if H.ndim == 1:
            H = H[:, None, None]
        if H.ndim != 3 or H.shape[0] != frequency.size or frequency.ndim != 1:
            msg = f"H has shape {H.shape} for {frequency.size} frequencies; (n_freq, n_out, n_in) is expected"
            raise FRFError(msg)
        outputs = tuple(outputs) if outputs is not None else tuple(f"out{i + 1}" for i in range(H.shape[1]))
        inputs = tuple(inputs) if inputs is not None else tuple(f"in{i + 1}" for i in range(H.shape[2]))
        for word, names, n in (("output", outputs, H.shape[1]), ("input", inputs, H.shape[2])):
            if len(names) != n:
                msg = f"{len(names)} {word} labels are given for {n} {word}s"
                raise FRFError(msg)
            if len(set(names)) != n:
                twice = next(name for name in names if names.count(name) > 1)
                msg = f"the {word} label '{twice}' occurs twice; labels must differ"
                raise FRFError(msg)
        if not np.isfinite(frequency).all() or (frequency < 0).any():
            msg = "frequencies must be finite and not negative [Hz]"
            raise FRFError(msg)
        if (np.diff(frequency) <= 0).any():
            k = int(np.flatnonzero(np.diff(frequency) <= 0)[0])
            msg = (
                f"frequencies must increase strictly; line {k + 1} has {frequency[k + 1]:g} Hz "
                f"after {frequency[k]:g} Hz"
            )
            raise FRFError(msg)
        if not np.isfinite(H).all():
            k, i, j = (int(v) for v in np.argwhere(~np.isfinite(H))[0])
            n = int((~np.isfinite(H)).sum())
            msg = (
                f"{n} FRF value(s) are not finite numbers, the first at {frequency[k]:g} Hz, "
                f"response '{outputs[i]}', force '{inputs[j]}'"
            )
            raise FRFError(msg)
        frequency.flags.writeable = False
        H.flags.writeable = False
        return cls(frequency, H, kind, outputs, inputs)

    @property
    def n_freq(self) -> int:
        """Number of frequency lines."""
        return self.frequency.size

    @property
    def omega(self) -> NDArray[np.float64]:
        """Angular frequencies, shape (n_freq,) [rad/s]."""
        return 2 * np.pi * self.frequency

    def as_kind(self, kind: FRFKind | str) -> "FRF":
        """Convert between receptance, mobility and accelerance by powers of iω.

        Raises
        ------
        FRFError
            If integration is asked for data with a line at 0 Hz, where it does not exist.
        """
        kind = FRFKind(kind)
        power = kind.derivatives - self.kind.derivatives
        if power == 0:
            return self
        if power < 0 and self.frequency[0] == 0:
            msg = (
                f"a line at 0 Hz cannot be converted from {self.kind} to {kind}; "
                "leave it out with select(band=…)"
            )
            raise FRFError(msg)
        return replace(self, H=self.H * (1j * self.omega[:, None, None]) ** power, kind=kind)

    def select(
        self,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        band: tuple[float, float] | None = None,
        lines: ArrayLike | None = None,
    ) -> "FRF":
        """Return some of the responses, forces and lines, in the order asked for.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            Labels to keep.
        band : (float, float), optional
            Lowest and highest frequency to keep [Hz].
        lines : array_like of int or bool, optional
            Lines to keep, as an index of ``frequency``; taken before ``band``.

        Raises
        ------
        FRFError
            For a label that is not there or a band without a line.
        """

        def index(word: str, have: tuple[str, ...], want: Sequence[str] | None) -> list[int]:
            if want is None:
                return list(range(len(have)))
            for name in want:
                if name not in have:
                    msg = f"there is no {word} '{name}'; the data have {', '.join(have)}"
                    raise FRFError(msg)
            return [have.index(name) for name in want]

        i, j = index("output", self.outputs, outputs), index("input", self.inputs, inputs)
        keep = np.arange(self.n_freq) if lines is None else np.arange(self.n_freq)[np.asarray(lines)]
        if band is not None:
            keep = keep[(self.frequency[keep] >= band[0]) & (self.frequency[keep] <= band[1])]
            if not keep.size:
                msg = (
                    f"no line lies in the band {band[0]:g} to {band[1]:g} Hz; the data cover "
                    f"{self.frequency[0]:g} to {self.frequency[-1]:g} Hz"
                )
                raise FRFError(msg)
        return FRF(
            self.frequency[keep],
            self.H[keep][:, i][:, :, j],
            self.kind,
            tuple(self.outputs[k] for k in i),
            tuple(self.inputs[k] for k in j),
        )


def compute_frf(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    method: str = "reduced",
) -> FRF:
    """Compute frequency response functions.

    ``"reduced"`` projects the system on its modes up to 1.5 times the highest frequency and on six
    block-Krylov vectors of each input and of each motion that a local damper resists, which makes the result
    exact at low frequency and leaves an error of about 10⁻⁶ of an FRF's root mean square at the highest.
    ``"direct"`` factorises Z(ω) at every line; it takes local, Rayleigh and structural damping, but not modal
    damping ratios.

    Parameters
    ----------
    system : System
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    outputs, inputs : selection
        DOF numbers, (point, direction) pairs such as ``(3, "z")``, or rows of combinations (n, n_dof).
    kind : FRFKind or str
        Receptance, mobility or accelerance.
    method : str
        ``"reduced"`` or ``"direct"``.

    Returns
    -------
    FRF
        ``H`` has shape (n_freq, n_out, n_in).

    Raises
    ------
    FRFError
        For an unknown method, frequencies that cannot be used, 0 Hz on a free structure, or modal ratios
        with ``"direct"``.
    """
    model = system.model
    out, out_labels = dof_vectors(model, outputs)
    inn, in_labels = dof_vectors(model, inputs)
    frequency = np.array(frequency, dtype=float, ndmin=1)
    if not frequency.size or not np.isfinite(frequency).all() or (frequency < 0).any():
        msg = "frequencies must be finite and not negative, and there must be one [Hz]"
        raise FRFError(msg)
    if method == "reduced":
        H = _reduced_receptance(system, frequency, out, inn)
    elif method == "direct":
        H = _direct_receptance(system, frequency, out, inn)
    else:
        msg = f"the FRF method is '{method}'; allowed are reduced, direct"
        raise FRFError(msg)
    # Rounding and local dampers may hold a free structure that nothing holds.
    free = (frequency == 0).any() and system.rigid.shape[1] > 0
    if free or not np.isfinite(H).all():
        msg = "the receptance is infinite at a line: 0 Hz on a free structure, or an undamped resonance"
        raise FRFError(msg)
    frf = FRF.from_arrays(frequency, H, FRFKind.RECEPTANCE, out_labels, in_labels)
    return frf.as_kind(kind)


def dof_vectors(model: Model, selection: Selection) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return a selection as columns (n_dof, n), and labels such as ``"3Z+"``.

    Raises
    ------
    ModelError
        For a point or a direction that the model does not have.
    """
    if isinstance(selection, np.ndarray) and selection.ndim == 2:
        if selection.shape[1] != model.n_dof:
            msg = f"the selection has {selection.shape[1]} columns; the model has {model.n_dof} DOFs"
            raise ModelError(msg)
        return selection.T.astype(float), tuple(f"row{i + 1}" for i in range(len(selection)))
    columns = np.zeros((model.n_dof, len(selection)))
    labels = []
    for i, item in enumerate(selection):
        if isinstance(item, tuple):
            point, direction = item
            if direction not in DIRECTIONS:
                msg = f"'{direction}' is not a direction; allowed are {', '.join(DIRECTIONS)}"
                raise ModelError(msg)
            dof = 6 * int(point) + DIRECTIONS.index(direction)
        else:
            dof = int(item)
        if not 0 <= dof < model.n_dof:
            msg = (
                f"DOF {dof} (point {dof // 6}) is not in the mesh, which has "
                f"{model.mesh.n_points} points, counted from 0"
            )
            raise ModelError(msg)
        columns[dof, i] = 1.0
        labels.append(f"{dof // 6}{('X', 'Y', 'Z', 'RX', 'RY', 'RZ')[dof % 6]}+")
    return columns, tuple(labels)


def _reduced_receptance(
    system: System, frequency: NDArray[np.float64], out: NDArray[np.float64], inn: NDArray[np.float64]
) -> NDArray[np.complex128]:
    damping = system.model.damping
    highest = max(float(frequency[-1]), 1.0)
    basis = reduced_basis(system, np.hstack([inn, _damped_motions(system)]), highest, margin=1.5, n_krylov=6)
    V = system.Q.T @ basis.T[:, : basis.n_main]
    K, M, C, D = (V.T @ (X @ V) for X in (system.K, system.M, system.C, system.D))
    lam, phi = sla.eigh(K, M)
    lam[: basis.n_rigid] = 0.0
    bo, bi = phi.T @ (basis.T[:, : basis.n_main].T @ out), phi.T @ (basis.T[:, : basis.n_main].T @ inn)
    omega = 2 * np.pi * frequency[:, None]
    omega_r = np.sqrt(np.maximum(lam, 0.0))
    zeta = damping.ratio_at(omega_r / (2 * np.pi))
    diagonal = (
        lam * (1 + 1j * damping.loss_factor)
        + 1j * omega * (2 * zeta * omega_r + damping.alpha + damping.beta * lam)
        - omega**2
    )
    if not (C.any() or D.any() or system.laws):
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.einsum("ro,fr,ri->foi", bo, 1 / diagonal, bi, optimize=True)
    local_C, local_D = phi.T @ C @ phi, phi.T @ D @ phi
    laws = [(law_change(law, omega[:, 0]), phi.T @ (V.T @ (X @ V)) @ phi) for law, X in system.laws]
    H = np.empty((len(frequency), out.shape[1], inn.shape[1]), dtype=complex)
    for k in range(len(frequency)):
        Z = np.diag(diagonal[k]) + 1j * (omega[k, 0] * local_C + local_D)
        Z = Z + sum(change[k] * X for change, X in laws)
        try:
            H[k] = bo.T @ np.linalg.solve(Z, bi)
        except np.linalg.LinAlgError:
            H[k] = np.inf
    return H


def _damped_motions(system: System) -> NDArray[np.float64]:
    """Return the forces of local dampers, shape (n_dof, n).

    Each gives an orthonormal basis of the range of its C and D. Damping of whole members (a material's loss
    factor) follows the stiffness there and needs none.
    """
    columns = [np.zeros((system.model.n_dof, 0))]
    for part in system.model.contributions():
        own = (part.C, part.D, part.K if part.law is not None else None)
        damping = [X for X in own if X is not None and X.any()]
        if not damping or part.dofs.size > LOCAL_DAMPING:
            continue
        for dofs, *matrices in zip(part.dofs, *damping, strict=True):
            U, s, _ = np.linalg.svd(np.hstack([X / max(np.abs(X).max(), 1e-300) for X in matrices]))
            keep = s > 1e-12 * s[0]
            forces = np.zeros((system.model.n_dof, int(keep.sum())))
            np.add.at(forces, dofs, U[:, keep])
            columns.append(forces)
    return np.hstack(columns)


def _direct_receptance(
    system: System, frequency: NDArray[np.float64], out: NDArray[np.float64], inn: NDArray[np.float64]
) -> NDArray[np.complex128]:
    damping = system.model.damping
    if damping.ratio.any():
        msg = (
            "the direct method needs damping matrices; modal damping ratios have none (use method='reduced')"
        )
        raise FRFError(msg)
    bo, bi = system.Q.T @ out, (system.Q.T @ inn).astype(complex)
    H = np.empty((len(frequency), out.shape[1], inn.shape[1]), dtype=complex)
    for k, omega in enumerate(2 * np.pi * frequency):
        try:
            H[k] = bo.T @ factorise(system.dynamic_stiffness(omega)).solve(bi)
        except SingularMatrixError:
            H[k] = np.inf
    return H
