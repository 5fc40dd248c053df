"""FRFs of an assembled system: by modes, by modes and Krylov vectors, or line by line.

:func:`compute_frf` chooses among them. :mod:`fem.analysis.receptance` evaluates the superpositions and their
error bounds.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from fem.analysis.basis import Complement, complement, extended
from fem.analysis.frf import FRF, Accuracy, FRFError, FRFKind
from fem.analysis.modes import solve_eigenpairs
from fem.analysis.receptance import (
    Locals,
    Superposition,
    locals_of,
    modes_below,
    nearly_static,
    receptance,
    receptance_blocks,
    response_sizes,
    sharpened,
    static_residual,
    superpose,
)
from fem.analysis.selection import Selection, dof_columns
from fem.array_types import Complexes, Floats, Ints
from fem.linalg.solvers import SingularMatrixError, factorise
from fem.system import System, refuse_motionless

METHODS = ("auto", "modal", "reduced", "direct")
"""Methods of ``compute_frf``."""

MARGIN = 1.25
"""Modes are taken up to this multiple of the highest frequency."""

_STEPS = 12
"""Blocks of Krylov vectors that are tried before a wider range of modes."""

_RESERVE = 0.5
"""The bound is brought below this part of the tolerance at the lines that are watched."""


def compute_frf(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    method: str = "auto",
    *,
    tolerance: float = 1e-5,
    n_modes: int | None = None,
) -> FRF:
    """Compute frequency response functions.

    - ``"reduced"`` projects the system on its modes up to 1.25 times the highest frequency and on
      block-Krylov vectors of each input and of each motion that a local damper resists, as many as it takes
      until a bound of the error meets the tolerance.
    - ``"modal"`` superposes modes and adds the static flexibility of the others.
    - ``"direct"`` factorises Z(ω) at every line; it takes all damping but modal ratios.
      Only it takes matrices that are not symmetric; a modal ratio ζ is then the loss factor 2ζ at each line.
    - ``"auto"`` is ``"reduced"``, or ``"direct"`` for one or two lines of a large system and for a small
      system of which the bound does not meet the tolerance.

    ``accuracy`` of the result has the method used and the bound.

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
        ``"auto"``, ``"modal"``, ``"reduced"`` or ``"direct"``.
    tolerance : float
        Error to be met, relative to the peak of each FRF over the lines [-].
    n_modes : int, optional
        Number of modes of ``"modal"``; those up to 1.25 times the highest frequency unless given.

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
    if method not in METHODS:
        msg = f"the FRF method is '{method}'; allowed are {', '.join(METHODS)}"
        raise FRFError(msg)
    task, out_labels, in_labels = _task(system, frequency, outputs, inputs, kind, tolerance)
    if not system.reciprocal:
        if method not in ("auto", "direct"):
            msg = (
                f"the FRF method '{method}' needs symmetric matrices, and an effect of the model has others; "
                "allowed are auto and direct"
            )
            raise FRFError(msg)
        method = "direct"
    # Where Z is symmetric so is H: forces and responses may change places.
    swap = system.reciprocal and task.inputs.shape[1] > task.outputs.shape[1]
    solved = replace(task, inputs=task.outputs, outputs=task.inputs) if swap else task
    H, accuracy = _solved(solved, method, n_modes)
    bound = accuracy.bound
    if swap:
        H = np.swapaxes(H, 1, 2)
        bound = None if bound is None else np.swapaxes(bound, 1, 2)
    _check_finite(task, H, task.frequency)
    frf = FRF.from_arrays(task.frequency, H, FRFKind.RECEPTANCE, out_labels, in_labels)
    return replace(frf, accuracy=replace(accuracy, bound=bound)).as_kind(kind)


def reduced_frf(
    system: System,
    frequency: Floats,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    *,
    tolerance: float = 1e-5,
) -> Callable[[Floats], Complexes]:
    """Return a function that computes FRFs (n_freq, n_out, n_in) at any frequencies up to the highest [Hz].

    The method is ``"reduced"`` of :func:`compute_frf`, with one set of vectors for all calls; an FRF may be
    infinite.

    Parameters
    ----------
    system : System
    frequency : ndarray (n_freq,)
        Lines at which the error is watched [Hz].
    outputs, inputs, kind, tolerance
        As for :func:`compute_frf`.

    Raises
    ------
    FRFError
        As :func:`compute_frf`.
    """
    task, _, _ = _task(system, frequency, outputs, inputs, kind, tolerance)
    swap = task.inputs.shape[1] > task.outputs.shape[1]
    task = replace(task, inputs=task.outputs, outputs=task.inputs) if swap else task
    s = _reduced(task, locals_of(system))

    def at(lines: Floats) -> Complexes:
        omega = 2 * np.pi * lines
        H = receptance(s, omega, bounds=False)[0] * ((1j * omega) ** task.kind.derivatives)[:, None, None]
        return np.swapaxes(H, 1, 2) if swap else H

    return at


def frf_blocks(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    *,
    tolerance: float = 1e-5,
    out: NDArray[Any] | None = None,
) -> Iterator[tuple[slice, Complexes]]:
    """Compute many FRFs a few lines at a time, for those that do not fit into memory together.

    The method is ``"reduced"`` of :func:`compute_frf`.

    Parameters
    ----------
    system : System
    frequency, outputs, inputs, kind, tolerance
        As for :func:`compute_frf`.
    out : array of complex (n_freq, n_out, n_in), optional
        Filled as the blocks come; a ``numpy.memmap`` for example.

    Yields
    ------
    lines : slice
        Lines of the block.
    H : ndarray (n_lines, n_out, n_in)
        Their FRFs: a part of ``out``, or without it an array that the next block overwrites.

    Raises
    ------
    FRFError
        As :func:`compute_frf`, and for an array of another shape or type.
    """
    if not system.reciprocal:
        msg = "blocks of FRFs need symmetric matrices, and an effect of the model has others; use compute_frf"
        raise FRFError(msg)
    task, _, _ = _task(system, frequency, outputs, inputs, kind, tolerance)
    shape = (task.frequency.size, task.outputs.shape[1], task.inputs.shape[1])
    if out is not None and (out.shape != shape or out.dtype != complex):
        msg = f"the array for the FRFs is {out.dtype} {out.shape}; complex128 {shape} is needed"
        raise FRFError(msg)
    s = _reduced(task, locals_of(system))
    symmetric = shape[1] == shape[2] and bool((s.same == np.arange(shape[1])).all())
    for lines, H in receptance_blocks(s, task.omega, task.kind.derivatives, symmetric, out):
        _check_finite(task, H, task.frequency[lines])
        yield lines, H


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Forces and responses to compute, as sparse columns on the independent coordinates."""

    system: System
    frequency: Floats
    inputs: Any
    outputs: Any
    kind: FRFKind
    tolerance: float

    @property
    def omega(self) -> Floats:
        return 2 * np.pi * self.frequency

    @property
    def highest(self) -> float:
        return max(float(self.frequency.max()), 1.0)

    @property
    def few(self) -> bool:
        """Whether factorising at each line costs less than modes and vectors."""
        return self.frequency.size <= 2 and self.system.n_free > 1000

    @property
    def small(self) -> bool:
        """Whether factorising at each line costs little enough to be a last resort."""
        return self.frequency.size * self.system.n_free <= 400_000

    def sample(self, eigenvalues: Floats) -> Ints:
        """Return lines at which the bound is watched: next to the modes, the last ones, and some between."""
        n = self.frequency.size
        order = np.argsort(self.omega)
        near = np.searchsorted(self.omega[order], np.sqrt(eigenvalues[eigenvalues > 0]))
        some = np.linspace(0, n - 1, min(n, 12)).astype(int)
        return order[np.unique(np.clip(np.concatenate([near - 1, near, some]), 0, n - 1))]

    def worst(self, s: Superposition, omega: Floats, H: Complexes, bound: Floats | None) -> float:
        """Return the largest bound of an FRF relative to its peak."""
        if bound is None:
            return np.nan
        power = omega[:, None, None] ** self.kind.derivatives
        peak, error = (np.abs(H) * power).max(axis=0), (bound * power).max(axis=0)
        # Part of the level that an FRF's places could give: smaller FRFs (zero by symmetry) are judged by it
        level = 1e-3 * _possible(s, omega, self.kind.derivatives)
        return float((error / np.maximum(np.maximum(peak, level), 1e-300)).max(initial=0.0))


def _task(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind | str,
    tolerance: float,
) -> tuple[_Task, tuple[str, ...], tuple[str, ...]]:
    """Return the checked task, and the labels of outputs and inputs."""
    refuse_motionless(system)
    out, out_labels = dof_columns(system.model, outputs)
    inn, in_labels = dof_columns(system.model, inputs)
    lines = np.array(frequency, dtype=float, ndmin=1)
    if not lines.size or not np.isfinite(lines).all() or (lines < 0).any():
        msg = "frequencies must be finite and not negative, and there must be one [Hz]"
        raise FRFError(msg)
    q_out, q_in = sp.csc_array(system.Q.T @ out), sp.csc_array(system.Q.T @ inn)
    return _Task(system, lines, q_in, q_out, FRFKind(kind), tolerance), out_labels, in_labels


def _check_finite(task: _Task, H: Complexes, frequency: Floats) -> None:
    # Rounding and local dampers may hold a free structure that nothing holds.
    free = (frequency == 0).any() and task.system.rigid.shape[1] > 0
    if free or not np.isfinite(H).all():
        msg = "the receptance is infinite at a line: 0 Hz on a free structure, or an undamped resonance"
        raise FRFError(msg)


def _possible(s: Superposition, omega: Floats, derivatives: int) -> Floats:
    """Return how large FRFs between these places could be, (n_out, n_in): Schwarz, with 0.1 % of damping."""
    parts = omega[:, None] ** 2 * s.mass + s.stiffness
    size = np.maximum(np.abs(s.stiffness - omega[:, None] ** 2 * s.mass), 1e-3 * parts)
    weight = omega[:, None] ** derivatives / np.maximum(size, 1e-300)
    out, inn = (np.sqrt(weight @ X**2).max(axis=0) for X in (s.responses, s.loads[:, : s.n_in]))
    return out[:, None] * inn


def _solved(task: _Task, method: str, n_modes: int | None) -> tuple[Complexes, Accuracy]:
    ratios = task.system.model.damping.ratio.any()
    if method == "direct" or (method == "auto" and task.few and not ratios):
        return _direct(task), Accuracy("direct", 0, 0, None, 0.0, task.tolerance)
    local = locals_of(task.system)
    s = _modal(task, local, n_modes) if method == "modal" else _reduced(task, local)
    H, bound = receptance(s, task.omega)
    worst = task.worst(s, task.omega, H, bound)
    if method == "auto" and worst > task.tolerance and task.small and not ratios:
        return _direct(task), Accuracy("direct", 0, 0, None, 0.0, task.tolerance)
    kind = "modal" if method == "modal" or s.n_vectors == s.n_modes else "reduced"
    return H, Accuracy(kind, s.n_modes, s.n_vectors, bound, worst, task.tolerance)


def _modal(task: _Task, local: Locals, n_modes: int | None) -> Superposition:
    system = task.system
    if n_modes is None:
        pairs, cut = modes_below(system, MARGIN * task.highest)
    else:
        pairs = sharpened(system, solve_eigenpairs(system, n_modes, unstable=True))
        cut = np.inf if n_modes >= system.n_free else float(pairs.eigenvalues[-1])
        if cut <= 0:
            msg = (
                f"{n_modes} modes are asked for, and none of them oscillates: besides {pairs.n_rigid} of a "
                "rigid body at least one is needed"
            )
            raise FRFError(msg)
    loads = np.hstack([task.inputs.toarray(), local.U.toarray()])
    s = superpose(system, pairs, cut, local, task.inputs, task.outputs, loads, None)
    return static_residual(system, pairs, s, loads, task.outputs)


def _reduced(task: _Task, local: Locals) -> Superposition:
    """Return modes and as many Krylov vectors as the tolerance takes."""
    system = task.system
    loads = np.hstack([task.inputs.toarray(), local.U.toarray()])
    pairs, cut = modes_below(system, MARGIN * task.highest)
    pairs = nearly_static(system, pairs, cut)
    sizes = response_sizes(system, pairs, task.outputs) if cut < np.inf else np.zeros(task.outputs.shape[1])

    def on(more: Complement | None) -> Superposition:
        return superpose(system, pairs, cut, local, task.inputs, task.outputs, loads, more, sizes)

    if cut == np.inf or not loads.shape[1]:
        return on(None)
    more = complement(system, pairs, loads)
    if local.wide:
        # Blocks of Krylov vectors after the first, where no bound is known
        for _ in range(5):
            more = extended(system, pairs, more, loads)
        return on(more)
    omega = task.omega[task.sample(pairs.eigenvalues)]
    x = (omega[-1] ** 2 - pairs.shift) / (cut - pairs.shift)
    rate = (1 - np.sqrt(1 - x)) / (1 + np.sqrt(1 - x))
    s, worst, step = on(more), np.inf, 1
    while True:
        # The bound falls by about this rate at each step (that of Lanczos' method), or faster.
        missing = np.log(worst / (_RESERVE * task.tolerance)) / -np.log(rate) if worst < np.inf else 2
        target = min(step + max(1, int(0.8 * missing)), _STEPS)
        while step < target and not more.complete:
            more, step = extended(system, pairs, more, loads), step + 1
        s, previous = on(more), worst
        worst = task.worst(s, omega, *receptance(s, omega))
        done = worst <= _RESERVE * task.tolerance or more.complete or step == _STEPS
        if done or worst > 0.5 * previous:
            return s


def _direct(task: _Task) -> Complexes:
    """Return receptances (n_freq, n_out, n_in) by one factorisation for each line."""
    system = task.system
    damping = system.model.damping
    if system.reciprocal and damping.ratio.any():
        msg = (
            "the direct method needs damping matrices; modal damping ratios have none (use method='reduced')"
        )
        raise FRFError(msg)
    bi = task.inputs.toarray().astype(complex)
    backend = None if system.reciprocal else "superlu"  # the one that does not rely on symmetry
    H = np.empty((task.frequency.size, task.outputs.shape[1], bi.shape[1]), dtype=complex)
    ratio = damping.ratio_at(task.frequency)
    for k, omega in enumerate(task.omega):
        Z = system.dynamic_stiffness(omega)
        if ratio[k]:
            Z = sp.csc_array(Z + 2j * ratio[k] * system.K)
        try:
            H[k] = task.outputs.T @ factorise(Z, backend=backend).solve(bi)
        except SingularMatrixError:
            H[k] = np.inf
    return H
