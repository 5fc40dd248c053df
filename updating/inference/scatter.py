"""Small deviations that every model has, by their slopes: of frequencies and damping.

Beams against real structures differ mostly in frequencies. Each mode, and each member, dissipates by some per
cent more or less than a smooth damping curve says; of a joint's dissipation less is known. Thousands of lines
see that.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.effects.places import frame_of
from fem.elements.frame import Frame, member_contribution
from fem.model import Contribution, Effect, Model
from fem.reduction.local_changes import LocalChanges
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """How receptances change with small deviations, at some lines.

    Attributes
    ----------
    relative : ndarray (n, n_lines, n_out, n_in)
        Slopes of the receptances, in parts of these.
    own : ndarray (n, n_lines)
        How much each weakens itself: 0 where a deviation changes the receptances in proportion.
    together : ndarray of int (n,)
        Those with the same number weaken one another.
    """

    relative: Complexes
    own: Complexes
    together: NDArray[np.int64]

    def changed(self, shifts: Floats) -> tuple[Complexes, Complexes]:
        """Return the receptances with deviations (n,), in parts of those without, and the denominators.

        Shapes (n_lines, n_out, n_in) and (n, n_lines). Derivatives are ``relative`` over their squares.
        """
        weakened = np.zeros((int(self.together.max(initial=-1)) + 1, self.own.shape[1]), dtype=complex)
        np.add.at(weakened, self.together, shifts[:, None] * self.own)
        whole = 1 + weakened[self.together]
        return 1 + np.einsum("kl,kloi->loi", shifts[:, None] / whole, self.relative), whole


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Shifts of the loss factors of members and joints, and of modes' eigenvalues and damping ratios.

    With Z⁻¹ = Σ φ_r φ_rᵀ / (λ_r s + m), s = 1 + i(η + 2ζ) and m = -ω², changes x of ln λ_r and y of ln ζ_r
    add a = λ_r (s x + 2iζ y) to the term's denominator. With G_rr, the response of mode r to a force on
    itself, the receptances change by -(Z⁻¹φ_r) a (Z⁻¹φ_r)ᵀ / (1 + a G_rr) (Sherman and Morrison): with little
    damping a peak moves as far as it is wide, where nothing is linear. Loss factors change the receptances,
    though not their logarithms, in proportion.

    Attributes
    ----------
    problem : FitProblem
    result : FitResult
        The fitted model whose slopes count.
    eigenvalue : float
        Standard deviation of the relative shift of each elastic mode's eigenvalue [-].
    damping : float
        Standard deviation of the logarithm of each mode's damping ratio, and of each member's loss factor in
        parts of the median one, 2ζ [-].
    members : tuple of str
    connections : tuple of Effect
        Those with a loss factor. The loss factor of each, η + 2ζ, is as uncertain as the damping curve.
    n_modes : int
    sizes : tuple of float
        What ``eigenvalue`` may be, each as probable as the others.
    """

    problem: FitProblem
    result: FitResult
    eigenvalue: float
    damping: float
    members: tuple[str, ...]
    connections: tuple[Effect, ...]
    n_modes: int
    sizes: tuple[float, ...] = ()
    _known: dict[bytes, Slopes] = field(default_factory=dict, repr=False)

    @property
    def std(self) -> Floats:
        """Standard deviations of all shifts, (n,)."""
        p = self.problem
        ratio = np.atleast_2d(p.damping.ratio(p.data.frequency, self.result.zeta))[0]
        own = 2 * float(np.median(ratio))
        loss = np.full(len(self.members), self.damping * own)
        of_joints = [p.damping.std * (_loss_factor(e) + own) for e in self.connections]
        of_modes = [s for s in (self.eigenvalue, self.damping) if s > 0]
        return np.concatenate([loss, of_joints, np.tile(of_modes, self.n_modes)])

    @property
    def shifts(self) -> NDArray[np.int64]:
        """Which of all shifts are those of eigenvalues."""
        if self.eigenvalue == 0:
            return np.zeros(0, dtype=np.int64)
        first = len(self.members) + len(self.connections)
        return first + np.arange(self.n_modes) * (2 if self.damping > 0 else 1)

    def slopes(self, lines: NDArray[np.int64]) -> Slopes:
        """Return the slopes of the receptances at some lines (computed once)."""
        key = lines.tobytes()
        if key not in self._known:
            self._known[key] = self._slopes_at(lines)
        return self._known[key]

    def _slopes_at(self, lines: NDArray[np.int64]) -> Slopes:
        changes, zeta = _solved(self.problem, self.result, lines)
        state, H, out = changes.state, changes.H, []
        n_first, stds = len(self.members) + len(self.connections), (self.eigenvalue, self.damping)
        model, fields = self.problem.reduced.model, changes.fields()
        of_members = (member_contribution(frame_of(model), model, m) for m in self.members)
        for parts in (*of_members, *(model.parts_of(e) for e in self.connections)):
            out.append(fields.slope([Contribution(c.dofs, D=c.K) for c in parts if c.K is not None]))
        modes = _shifted(self.problem, changes)[: self.n_modes]
        own = [np.zeros((n_first, len(lines)), dtype=complex)]
        for r, response in zip(modes, state.own_responses(modes), strict=True):
            for factor, std in zip((state.stiffness, 2j * zeta), stds, strict=True):
                if std > 0:
                    out.append(-np.einsum("of,if->foi", changes.Xo[r], factor * state.lam[r] * changes.Xi[r]))
                    own.append((factor * state.lam[r] * response)[None])
        per_mode = sum(std > 0 for std in stds)
        together = np.concatenate([np.arange(n_first), n_first + np.repeat(np.arange(len(modes)), per_mode)])
        relative = np.asarray(np.stack(out) / np.where(H != 0, H, np.inf), dtype=complex)
        return Slopes(relative, np.concatenate(own), together)


def scatter_of(
    problem: FitProblem,
    result: FitResult,
    damping: float,
    eigenvalue: float,
    sizes: tuple[float, ...] = (),
) -> Scatter | None:
    """Return small deviations of damping and of eigenvalues at a fitted model; None if they are 0.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    damping, eigenvalue : float
        As of :class:`Scatter`.
    sizes : tuple of float
        As of :class:`Scatter`.
    """
    if max(damping, eigenvalue) == 0:
        return None
    model = problem.reduced.model
    several = damping > 0 and len(model.mesh.members) > 1 and bool(model.of_kind(Frame))
    members = tuple(model.mesh.members) if several else ()
    connections = _as_fitted(model, result) if damping > 0 else ()
    changes, _ = _solved(problem, result, problem.lines_up_to(np.inf, 2))
    n_modes = len(_shifted(problem, changes))
    return Scatter(problem, result, eigenvalue, damping, members, connections, n_modes, sizes)


def _as_fitted(model: Model, result: FitResult) -> tuple[Effect, ...]:
    """Return connections with a loss factor at fitted values, effects that are parts of them included."""
    out = []
    for e in model.effects:
        if not e.connection or not np.isfinite(_loss_factor(e)):
            continue
        own = {name: v for (effect, name), v in result.values.items() if effect == e.name}
        now: Effect = e.with_values(**own)
        for part in result.effects:
            now = part.merged_into(now) or now
        out.append(now)
    return tuple(out)


def _loss_factor(effect: Effect) -> float:
    """Return an effect's loss factor; NaN if it has none."""
    return next((float(np.real(p.value)) for p in effect.parameters() if p.name == "eta"), np.nan)


def _solved(problem: FitProblem, result: FitResult, lines: NDArray[np.int64]) -> tuple[LocalChanges, Floats]:
    """Return the solved state of a fitted model at some lines, and its damping ratio there."""
    frequency, refs = problem.data.frequency[lines], list(result.values)
    zeta = problem.damping.ratio(frequency, result.zeta)
    engine = problem.engine(frequency, refs, result.effects)
    values = np.array(list(result.values.values()))
    return LocalChanges.of(engine, values, zeta), np.atleast_2d(zeta)[0]


def _shifted(problem: FitProblem, changes: LocalChanges) -> NDArray[np.int64]:
    """Return the elastic modes of a solved state in the band and the next one."""
    lam, highest = changes.state.lam, (2 * np.pi * problem.data.frequency[-1]) ** 2
    elastic = np.flatnonzero(lam > 1e-6 * highest)
    return elastic[: int((lam[elastic] <= highest).sum()) + 1]
