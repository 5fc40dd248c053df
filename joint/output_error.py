"""Fit a physical joint to the assembly's FRFs, with the substructures' uncertainty: maximum likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import zherk

from joint._checks import (
    BoolArray,
    ComplexArray,
    FloatArray,
    as_frequency,
    as_lines,
    check_same_lines,
    solve_lines,
)
from joint.form import JointForm
from joint.identification import IdentificationError
from joint.interface import SubstructureFRF
from joint.joint_fit import JointFit
from joint.parts import Blocks, FixedParts, Parts
from joint.uncertainty import (
    LIKELY,
    Identifiability,
    correlation_of,
    stated_covariance,
    weakest_combinations,
)
from updating.measurement.noise import relative_noise

_CHUNK = 1 << 18
"""Complex numbers of the Jacobian that are held at a time."""

_STEPS = 40

SCAN = tuple(10.0 ** (k / 6) for k in range(-18, 19) if k)
"""Factors by which stiffnesses are tried far from the data [-]."""

RIGID = 1e4
"""Factor by which a stiffness that is rigid beside its present value exceeds that [-]."""

FAR = 10.0
"""Mean square of the residuals over the noise beyond which a start is far from the data [-]."""


def fit_joint(
    form: JointForm,
    substructures: SubstructureFRF | Parts,
    frequency: npt.ArrayLike,
    H_nn: npt.ArrayLike,
    start: npt.ArrayLike,
    *,
    noise: npt.ArrayLike | None = None,
    stages: Sequence[float] = (0.25, 0.5, 1.0),
    max_iterations: int = 30,
    tolerance: float = 1e-6,
    determined: float = 0.5,
    positive: bool | str = False,
    prior: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    part_start: npt.ArrayLike | None = None,
) -> JointFit:
    """Fit a joint's parameters to the receptances of the assembly by maximum likelihood: output error.

    minimise  Σ |H_nn(θ, x) - measured|² / σ² + ½ Σ x²  over θ and x

    with H_nn by (12) of Soleimanian, Tizfahm & Sadeghi (2011), σ² = E|noise|² of circular complex noise (so
    that the first sum carries a factor of 1), and x the substructures' uncertain parameters in units of their
    prior standard deviations. Derivatives are exact:

    dH_nn = -H_nj dZ_j H_jn                              by the joint
    dH_nn = [I, -H_nj Z_j] dH [I; -Z_j H_jn]             by the substructures

    Gauss-Newton steps with Levenberg-Marquardt damping run over a low band first and then over ever wider
    ones, as a start that is a resonance's width off misleads in the whole band. Far from the data,
    stiffnesses are first tried over six decades, the one that helps most first, and the steps minimise robust
    residuals of ln H, in which a resonance in the wrong place counts no more than one that lacks, with
    stiffness, mass and damping on the matrices' diagonals positive. The covariance is the inverse of Fisher's
    information (Cramér and Rao's bound), multiplied by chi² where that is above 1, as long as the residual is
    white. What neighbouring lines share of it is an error of the model, which widens the covariance
    (:func:`joint.uncertainty.stated_covariance`).

    Parameters
    ----------
    form : JointForm
        What the joint may be.
    substructures : SubstructureFRF or Parts
        Known substructures, or models with uncertain parameters (`ModelParts`).
    frequency : (n_freq,) array_like
        Lines of the assembly [Hz], those of the substructures.
    H_nn : (n_freq, M, L) array_like
        Measured receptances x/f at the internal coordinates; NaN where there is none.
    start : (n,) array_like
        θ from which to start, that of `identify_average` for example; NaN starts a viscoelastic law's own
        parameter at usual values, of which the best is taken.
    noise : array_like, optional
        Standard deviation σ: a number is relative to each |H|; an array that broadcasts to H_nn is absolute
        [unit of H]. Estimated from the lines' roughness unless given.
    stages : sequence of float
        Parts of the lines, from the lowest, that each stage takes; the last is 1.
    max_iterations : int
        For each stage.
    tolerance : float
        A stage ends when a step, in standard deviations of the estimate, is shorter than this times 1000 or
        the cost falls by less than this part of itself.
    determined : float
        A parameter counts as determined if its standard deviation is below this part of its value [-].
    positive : bool or str
        Whether parameters whose matrices are positive semidefinite stay positive to the end; ``"K"`` keeps
        stiffnesses so and leaves the others. They are then biased where noise hides them.
    prior : ((n,) array_like, (n,) array_like), optional
        What is known of θ before: mean and standard deviation, that of the logarithm for parameters that stay
        positive; infinite where nothing is. A wide one keeps a parameter that the data do not determine from
        drifting away.
    part_start : (m,) array_like, optional
        x from which to start, in prior standard deviations from the models' values [-]; 0 unless given.

    Returns
    -------
    JointFit
        The best point found, also where the iterations ran out; ``converged`` and ``message`` say so.

    Raises
    ------
    ValueError
        If shapes or lines do not fit, the noise is not positive, the start is not finite, or a stage or kind
        is none.
    IdentificationError
        If the form's coordinates are not those of the substructures, there are fewer data than parameters,
        or a parameter has no influence on any FRF (it is named).
    """
    parts: Parts = FixedParts(substructures) if isinstance(substructures, SubstructureFRF) else substructures
    mean = parts.at_mean
    lines = as_frequency(frequency)
    check_same_lines(lines, mean.frequency, "H_nn", "the substructures")
    interface = mean.interface
    if form.coordinates.labels != interface.joint.labels:
        msg = (
            "the form's coordinates are not the joint coordinates of the substructures, or not in their order"
        )
        raise IdentificationError(msg)
    given = np.asarray(H_nn, dtype=complex)
    seen = np.isfinite(given)
    measured = as_lines(
        np.where(seen, given, 0.0), "H_nn", lines, interface.outputs.labels, interface.inputs.labels
    )
    weight = np.where(seen, 1 / _noise(measured, noise, measured), 0.0)
    begin = form.starts(start, lines)
    n, m = len(form.names), len(parts.names)
    if not np.isfinite(begin[0]).all():
        name = form.names[int(np.argmin(np.isfinite(begin[0])))]
        msg = f"start has no finite value of {name}; only a viscoelastic law's own parameters may be NaN"
        raise ValueError(msg)
    if 2 * int(seen.sum()) < n:
        msg = f"{int(seen.sum())} complex values cannot determine {n} parameters"
        raise IdentificationError(msg)
    x = np.zeros(m) if part_start is None else np.asarray(part_start, dtype=float)
    if x.shape != (m,) or not np.isfinite(x).all():
        msg = f"part_start has shape {x.shape}; ({m},) finite values are needed"
        raise ValueError(msg)
    problem = _Problem(form, parts, lines, measured, weight)
    signed = form.positive | (form.semidefinite & (begin[0] > 0))
    if isinstance(positive, str):
        if missing := sorted(set(positive) - set("KMCD")):
            msg = f"positive names '{missing[0]}'; True, False, or some of K, M, C, D are allowed"
            raise ValueError(msg)
        kinds = np.array([term.kind in positive for term in form.terms for _ in term.parameters])
        kept = form.positive | (signed & kinds)
    else:
        kept = signed if positive else form.positive
    problem = replace(problem, positive=kept, prior=_prior(prior, kept, n))
    history: list[tuple[float, float, float]] = []
    if not len(stages) or not all(0 < part <= 1 for part in stages):
        msg = f"stages are {tuple(stages)}; parts of the lines above 0, up to 1, are needed"
        raise ValueError(msg)
    counts = [max(1, min(lines.size, round(part * lines.size))) for part in stages]
    tried = []
    for theta in begin:
        first = problem.state(theta, x, lines.size, False)
        points = [first]
        if len(begin) > 1 or first.cost > FAR * seen.sum():
            rough = replace(problem, positive=signed).rough(first, lines.size)
            points.append(_approach(rough, first, counts, history, max_iterations))
            if problem.at(points[-1]).cost > FAR * seen.sum():
                points.append(
                    _approach(rough, _scan(rough, rough.at(first)), counts, history, max_iterations)
                )
        tried.append(min((problem.at(p) for p in points), key=lambda s: s.cost))
    state, converged = min(tried, key=lambda s: s.cost), False
    if state.cost < FAR * seen.sum():
        counts = counts[-1:]  # near enough for the whole band
    for count in (*counts, lines.size):
        state = problem.state(state.theta, state.x, count)
        state, converged = _descend(problem, state, history, max_iterations, tolerance)
        if count == lines.size and (noise is None or np.ndim(noise) == 0):
            # noise relative to measured values makes large ones count too little: so take the rebuilt ones
            weight = np.where(seen, 1 / _noise(measured, noise, state.H), 0.0)
            problem = replace(problem, weight=weight)
    state = problem.state(state.theta, state.x, lines.size)
    return _result(problem, state, tuple(history), converged, determined)


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A point, its cost, and the Gauss-Newton matrix and gradient there."""

    theta: FloatArray
    x: FloatArray
    count: int
    cost: float
    A: FloatArray
    g: FloatArray
    H: ComplexArray

    @property
    def point(self) -> FloatArray:
        return np.concatenate([self.theta, self.x])


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    form: JointForm
    parts: Parts
    lines: FloatArray
    measured: ComplexArray
    weight: FloatArray
    positive: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    huber: float | None = None
    """Where the loss of ln H turns linear [-]; None for plain residuals of H."""
    prior: tuple[FloatArray, FloatArray, BoolArray] | None = None
    """Mean and standard deviation of θ, and where they are those of ln θ."""
    known: dict[bytes, Any] = field(default_factory=dict, repr=False)
    """The substructures at the last x, which many points share."""

    def rough(self, state: _State, count: int) -> _Problem:
        """Return the problem with robust residuals of ln H, for points far from the data."""
        plain = self.state(state.theta, state.x, count)
        r = np.abs(self._logarithmic(plain.H, slice(0, count))[0])
        return replace(self, huber=max(float(np.median(r[r > 0])) if r.any() else 0.0, 3.0))

    def at(self, state: _State) -> _State:
        """Return the cost of a point over all lines."""
        return self.state(state.theta, state.x, len(self.lines), False)

    def _parts_at(self, x: FloatArray) -> tuple[SubstructureFRF, tuple[Blocks, ...]]:
        key = x.tobytes()
        if key not in self.known:
            self.known.clear()
            self.known[key] = self.parts.evaluate(x)
        return self.known[key]

    def _logarithmic(self, H: ComplexArray, at: slice) -> tuple[ComplexArray, ComplexArray]:
        """Return ln(H / measured) over the relative noise, and what makes derivatives of H those of it."""
        measured = self.measured[at]
        use = (self.weight[at] > 0) & (measured != 0) & (H != 0)
        safe, model = np.where(use, measured, 1.0), np.where(use, H, 1.0)
        size = np.where(use, self.weight[at] * np.abs(safe), 0.0)
        return np.asarray(size * np.log(model / safe), dtype=complex), np.asarray(size / model, dtype=complex)

    def state(self, theta: FloatArray, x: FloatArray, count: int, gradient: bool = True) -> _State:
        """Evaluate the cost and, if asked, Gauss-Newton matrix and gradient over the first lines."""
        data = self.of_lines(theta, x, 0, count, gradient)
        n, m = len(theta), len(x)
        A, g, cost = data.A, data.g, data.cost
        # 2 Σ|r|²/2 … the prior ½ x² beside Σ|r|²: in units of the negative log likelihood
        A[n:, n:] += 0.5 * np.eye(m)
        g[n:] += 0.5 * x
        cost += 0.5 * float(x @ x)
        if self.prior is not None:
            middle, std, log = self.prior
            ratio = np.where(log, theta / np.where(log, middle, 1.0), 1.0)
            u = np.where(log, np.log(np.maximum(ratio, 1e-300)), theta - middle) / std
            du = np.where(log, 1 / np.where(log, np.maximum(theta, 1e-300), 1.0), 1.0) / std
            A[:n, :n] += 0.5 * np.diag(du**2)
            g[:n] += 0.5 * u * du
            cost += 0.5 * float(u @ u)
        return replace(data, cost=cost)

    def of_lines(
        self, theta: FloatArray, x: FloatArray, first: int, end: int, gradient: bool = True
    ) -> _State:
        """Evaluate what the lines from one up to another say, without priors."""
        frf, slopes = self._parts_at(x)
        count = end - first
        omega = 2 * np.pi * self.lines[first:end]
        n, m, n_matrices = len(theta), len(x), len(self.form.matrices)
        factors, which = self.form.slopes(omega, theta)
        coefficients = self.form.coefficients(omega, theta)
        A, g, cost = np.zeros((n + m, n + m)), np.zeros(n + m), 0.0
        # parameters of one kind share their factor, so that few sums over lines serve all of them
        rows = np.vstack([factors, np.ones((m, count))])
        shared, kind = np.unique(rows, axis=0, return_inverse=True)
        kind = kind.ravel()  # NumPy 2.0 gives it a second axis
        column = np.append(which, n_matrices + np.arange(m))
        H = np.empty((count, *self.measured.shape[1:]), dtype=complex)
        values = self.measured.shape[1] * self.measured.shape[2]
        step = max(1, _CHUNK // (values * (n_matrices + m + 1)))
        for start in range(0, count, step):
            here = slice(start, min(start + step, count))
            at = slice(first + here.start, first + here.stop)
            Z = np.einsum("uf,uij->fij", coefficients[:, here], self.form.matrices, optimize=True)
            N = len(self.form.coordinates)
            unit = np.eye(N)
            H_jn = solve_lines(unit + frf.H_bb[at] @ Z, frf.H_ba[at])
            H[here] = frf.H_aa[at] - frf.H_ab[at] @ (Z @ H_jn)
            w = self.weight[at]
            if self.huber is None:
                r = (w * (H[here] - self.measured[at])).reshape(len(H_jn), -1)
            else:
                r, w = self._logarithmic(H[here], at)
                r = r.reshape(len(H_jn), -1)
            square, root = np.abs(r) ** 2, np.ones(r.shape)
            if self.huber is not None:  # pseudo-Huber: less weight for what is far off
                root = np.sqrt(1 + square / self.huber**2)
                square = 2 * self.huber**2 * (root - 1)
            cost += float(square.sum())
            if not gradient:
                continue
            H_nj = solve_lines((unit + Z @ frf.H_bb[at]).mT, frf.H_ab[at].mT).mT
            J = self._jacobian(H_nj, H_jn, Z, slopes, at)
            J *= w.mT[:, None]
            J = J.reshape(len(J), n_matrices + m, -1)
            r = r.reshape(w.shape).mT.reshape(len(r), -1)
            if self.huber is not None:
                root = np.sqrt(root).reshape(w.shape).mT.reshape(len(r), -1)
                J /= root[:, None]
                r = r / root
            G = _gram(J)
            b = (J @ r.conj()[:, :, None]).conj()
            f = shared[:, here]
            pairs = (f.conj()[:, None] * f).reshape(-1, f.shape[1])
            sums = (pairs @ G.reshape(len(G), -1)).reshape(len(f), len(f), *G.shape[1:])
            A += sums[kind[:, None], kind, column[:, None], column].real
            g += (f.conj() @ b[:, :, 0])[kind, column].real
        return _State(theta, x, end, cost, A, g, H)

    def _jacobian(
        self,
        H_nj: ComplexArray,
        H_jn: ComplexArray,
        Z: ComplexArray,
        slopes: tuple[Blocks, ...],
        at: slice,
    ) -> ComplexArray:
        """Return the transposes of -H_nj T H_jn for each matrix, then of the derivatives by the parts.

        Both are (lines, n, L, M): one product for all matrices costs less than many small ones.
        """
        n_lines, N, n_in = H_jn.shape
        moved = (self.form.matrices.reshape(-1, N) @ H_jn).reshape(n_lines, -1, N, n_in)
        turned = np.swapaxes(moved, 2, 3).reshape(n_lines, -1, N)
        by_joint = (turned @ (-H_nj).mT).reshape(n_lines, -1, n_in, H_nj.shape[1])
        if not slopes:
            return by_joint
        left, right = H_nj @ Z, Z @ H_jn
        by_parts = [
            s.H_aa[at] - left @ s.H_ba[at] - s.H_ab[at] @ right + left @ (s.H_bb[at] @ right) for s in slopes
        ]
        return np.concatenate([by_joint, np.stack([part.mT for part in by_parts], axis=1)], axis=1)


def _gram(J: ComplexArray) -> ComplexArray:
    """Return J* Jᵀ at each line, (n_lines, u, u), of which only one triangle is computed."""
    upper = np.array([zherk(1.0, line.T, trans=2) for line in J])
    return upper + np.triu(upper, 1).conj().mT


def _noise(measured: ComplexArray, noise: npt.ArrayLike | None, reference: ComplexArray) -> FloatArray:
    """Return the noise's standard deviation at every value; relative noise is one of a reference."""
    size = np.abs(reference)
    least = 1e-6 * np.sqrt((size**2).mean(axis=0)) + 1e-300
    if noise is None:
        return np.maximum(np.sqrt(2) * relative_noise(measured) * size, least)
    level = np.asarray(noise, dtype=float)
    if not (np.isfinite(level).all() and (level > 0).all()):
        msg = "the noise must be positive and finite: relative as a number, or absolute as an array"
        raise ValueError(msg)
    if level.ndim == 0:
        return np.maximum(level * size, least * 1e-3)
    try:
        return np.broadcast_to(level, measured.shape)
    except ValueError as error:
        msg = f"noise has shape {level.shape}; a number or what broadcasts to {measured.shape} is needed"
        raise ValueError(msg) from error


def _prior(
    prior: tuple[npt.ArrayLike, npt.ArrayLike] | None, log: BoolArray, n: int
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Check what is known of θ beforehand."""
    if prior is None:
        return None
    mean, std = (np.asarray(v, dtype=float) for v in prior)
    if mean.shape != (n,) or std.shape != (n,) or not (np.isfinite(mean).all() and (std > 0).all()):
        msg = (
            f"the prior has a mean of shape {mean.shape} and deviations of shape {std.shape}; ({n},) each is "
            "needed, finite means and positive deviations"
        )
        raise ValueError(msg)
    if (wrong := log & (mean <= 0) & np.isfinite(std)).any():
        msg = f"the prior's mean {mean[wrong][0]:g} is of a parameter that stays positive; it must be too"
        raise ValueError(msg)
    return np.where(log & (mean <= 0), 1.0, mean), std, log


def _approach(
    rough: _Problem,
    state: _State,
    counts: list[int],
    history: list[tuple[float, float, float]],
    max_iterations: int,
) -> _State:
    """Return where robust steps over ever wider bands end."""
    for count in counts:
        problem = rough.rough(state, count)
        at = problem.state(state.theta, state.x, count)
        state, _ = _descend(problem, at, history, max_iterations, 1e-3)
    return state


def _scan(problem: _Problem, state: _State) -> _State:
    """Return the best of points where one stiffness, then another, is up to three decades off."""
    kinds = [term.kind for term in problem.form.terms for _ in term.parameters]
    first = {name for term in problem.form.terms for name, _ in term.parameters[:1]}
    scanned = [
        i
        for i, name in enumerate(problem.form.names)
        if problem.positive[i] and name in first and kinds[i] not in ("M", "C", "D")
    ]
    for _ in range(3):
        # the one that helps most first: another may only imitate it
        points = []
        for i in scanned:
            unit = np.arange(len(state.theta)) == i
            points += [np.where(unit, factor * state.theta, state.theta) for factor in SCAN]
        best = min(
            (problem.state(p, state.x, state.count, False) for p in points),
            key=lambda s: s.cost,
            default=state,
        )
        if best.cost > 0.95 * state.cost:
            break
        state = best
    return problem.state(state.theta, state.x, state.count)


def _descend(
    problem: _Problem,
    state: _State,
    history: list[tuple[float, float, float]],
    max_iterations: int,
    tolerance: float,
) -> tuple[_State, bool]:
    """Take Levenberg-Marquardt steps until nothing is gained; return the point and whether it converged."""
    n = len(state.theta)
    low, high = problem.form.bounds
    low, high = np.append(low, np.full(len(state.x), -8.0)), np.append(high, np.full(len(state.x), 8.0))
    log = np.append(problem.positive, np.zeros(len(state.x), dtype=bool))
    damping = 1e-3
    top = float(problem.lines[state.count - 1])
    for _ in range(max_iterations):
        pinned = ((state.point <= low) & (state.g > 0)) | ((state.point >= high) & (state.g < 0))
        free = ~pinned & (np.diag(state.A) > 0)
        # positive parameters move by factors: dθ = θ d ln θ
        slope = np.where(log, state.point, 1.0)
        scale = np.sqrt(np.diag(state.A)[free]) * slope[free]
        A = (state.A * np.outer(slope, slope))[np.ix_(free, free)] / np.outer(scale, scale)
        g = state.g[free] * slope[free] / scale
        for _ in range(_STEPS):
            step = np.zeros(len(state.point))
            step[free] = -np.linalg.solve(A + damping * np.eye(len(A)), g) / scale
            gain = -float((state.g * slope) @ step)
            if gain < tolerance * tolerance * max(state.cost, 1.0):
                return state, True
            moved = np.where(log, state.point * np.exp(np.clip(step, -1.5, 1.5)), state.point + step)
            point = np.clip(moved, low, high)
            new = problem.state(point[:n], point[n:], state.count)
            if np.isfinite(new.cost) and new.cost < state.cost:
                break
            damping = max(damping * 6, 1e-9)
        else:
            return state, True
        history.append((top, new.cost, float(np.linalg.norm(step[free] * scale))))
        fell = state.cost - new.cost
        state, damping = new, max(damping / 8, 1e-14)  # never 0: two parameters may do the same
        if fell < tolerance * max(new.cost, 1.0):
            return state, True
    return state, False


def _result(
    problem: _Problem,
    state: _State,
    history: tuple[tuple[float, float, float], ...],
    converged: bool,
    determined: float,
) -> JointFit:
    form, parts = problem.form, problem.parts
    n, m = len(state.theta), len(state.x)
    dead = [form.names[i] for i in range(n) if not state.A[i, i] > 0]
    if dead:
        msg = (
            f"{', '.join(dead[:6])} has no influence on any FRF; leave it out of the form or add coordinates"
        )
        raise IdentificationError(msg)
    state, at_bound = _at_zero(problem, state)
    residual = problem.weight * (state.H - problem.measured)
    count = int((problem.weight > 0).sum())
    chi2 = float((np.abs(residual) ** 2).sum() / max(count - n / 2, 1))
    low, high = form.bounds
    at_bound |= (state.theta <= low) | (state.theta >= high)

    def information(first: int, end: int) -> tuple[FloatArray, FloatArray]:
        part = problem.of_lines(state.theta, state.x, first, end)
        return part.A, part.g

    fixed = np.append(at_bound, np.zeros(m, dtype=bool))
    independent, covariance = stated_covariance(
        state.A, fixed, residual, _own_noise(problem), chi2, state.H, information
    )
    std = np.where(fixed, np.nan, np.sqrt(np.diag(covariance)))
    names = (*form.names, *parts.names)
    value = np.concatenate([state.theta, np.ones(m)])
    relative = np.divide(std, np.abs(value), out=np.full(n + m, np.inf), where=(value != 0) & ~fixed)
    weakest = weakest_combinations(covariance[:n, :n], state.theta, form.names)
    known = Identifiability(names, std, relative, relative < determined, correlation_of(covariance), weakest)
    some = ~fixed & np.isfinite(np.diag(covariance))
    wider = np.sqrt(np.divide(np.diag(covariance), np.diag(independent), out=np.ones(n + m), where=some))
    open_end = tuple(
        "" if known.determined[i] or at_bound[i] else _open_end(problem, state, i, float(wider[i]))
        for i in range(n)
    )
    physical = parts.physical(state.x)
    ahead = parts.physical(state.x + 1e-6)
    return JointFit(
        form, state.theta, covariance[:n, :n], independent[:n, :n], at_bound, open_end, parts.names, physical,
        std[n:] * (ahead - physical) / 1e-6 if m else np.zeros(0), problem.lines, state.H, residual, chi2,
        known, history, converged, _message(form, known, at_bound, chi2, converged),
    )  # fmt: skip


def _message(
    form: JointForm, known: Identifiability, at_bound: BoolArray, chi2: float, converged: bool
) -> str:
    """Say how a fit ended, and what to doubt."""
    message = "converged" if converged else "not converged: the iterations ran out at the best point so far"
    if chi2 > 2:
        message += (
            f"; the residual is {np.sqrt(chi2):.1f} times the noise: the model lacks an effect or is wrong"
        )
    own = zip(form.names, known.determined, at_bound, strict=False)
    loose = [name for name, ok, bound in own if not ok and not bound]
    if loose:
        message += f"; the data do not determine {', '.join(loose[:8])}{' …' if len(loose) > 8 else ''}"
    if at_bound.any():
        at = [name for name, bound in zip(form.names, at_bound, strict=True) if bound]
        message += f"; at a bound: {', '.join(at)}"
    return message


def _own_noise(problem: _Problem) -> FloatArray:
    """Return the data's own noise over the deviation that was allowed, at most 1, (n_freq, M, L)."""
    with np.errstate(invalid="ignore"):  # where there is no value, and no weight
        own = problem.weight * _noise(problem.measured, None, problem.measured)
    return np.where(problem.weight > 0, np.minimum(np.nan_to_num(own, nan=1.0), 1.0), 0.0)


def _at_zero(problem: _Problem, state: _State) -> tuple[_State, BoolArray]:
    """Put positive parameters that have run towards zero there; return the point and which they are.

    A factor never reaches zero, and its logarithm runs on for ever. At zero is what does no worse there.
    """
    n = len(state.theta)
    with np.errstate(divide="ignore"):
        std = 1 / np.sqrt(2 * np.maximum(np.diag(state.A)[:n], 0.0))
    own = np.array([len(term.parameters) > 1 for term in problem.form.terms for _ in term.parameters])
    near = problem.positive & ~own & (state.theta < 0.1 * std) & (state.g[:n] >= 0)
    if not near.any():
        return state, near
    there = problem.state(np.where(near, 0.0, state.theta), state.x, state.count)
    if there.cost <= state.cost + 0.01:
        return there, near
    return state, np.zeros(n, dtype=bool)


def _open_end(problem: _Problem, state: _State, i: int, wider: float) -> str:
    """Return which limit of a stiffness, mass or damping fits as well as its value, all else as it is."""
    if not problem.form.semidefinite[i]:
        return ""
    fits = []
    plain = replace(problem, prior=None)
    here = plain.at(state).cost
    for word, factor in (("released", 0.0), ("rigid", RIGID)):
        theta = state.theta.copy()
        theta[i] *= factor
        there = plain.state(theta, state.x, state.count, False).cost
        if np.isfinite(there) and (there - here) / wider**2 <= LIKELY:
            fits.append(word)
    return "either" if len(fits) == 2 else "".join(fits)
