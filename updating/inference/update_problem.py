"""The cost of an update as a function of its unknowns: residuals of modes and FRFs, and priors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRFError
from fem.model import Model, ModelError, ParameterRef
from fem.system import System
from updating.correlation import DB_PER_NEPER
from updating.inference.determined import held
from updating.inference.frf_data import FRFData
from updating.inference.frf_residual import FRFResidual, with_ratios
from updating.inference.mode_data import ModeData
from updating.inference.mode_residual import ModePairs, ModePoint, mode_jacobian, mode_residual
from updating.inference.regularisation import LCurve
from updating.inference.unknowns import ScaledUnknown
from updating.inference.update_nuisances import nuisances_of
from updating.inference.update_settings import UpdateSettings
from updating.inference.updated import UpdateStep
from updating.least_squares.levenberg_marquardt import Linearisation
from updating.least_squares.loss import pseudo_huber, pseudo_huber_weight

_ROBUST = 0.5
"""Residual of an FRF at which the loss turns from quadratic to linear [nepers]."""

_MOST_SHIFTS = 40
"""At most so many natural frequencies get an error of their own."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualGroup:
    """Residuals of one kind, of modes or of FRFs.

    Attributes
    ----------
    name : str
        ``"modes"`` or ``"frf"``.
    r : ndarray (m,)
        Real and whitened, with the weights of the robust loss in them.
    square : float
        Σρ/σ².
    n : int
        Number of data.
    J : ndarray (n_unknown, m) or None
        Derivatives of r.
    """

    name: str
    r: NDArray[np.float64]
    square: float
    n: int
    J: NDArray[np.float64] | None

    @property
    def q(self) -> float:
        """Mean square residual in units of the stated variance [-]."""
        return self.square / self.n

    @property
    def cost(self) -> float:
        """Negative log likelihood, with the variance estimated where it is above the stated one [nats]."""
        q = self.q
        return 0.5 * self.n * (q - 1 if q < 1 else float(np.log(q)))

    @property
    def factor(self) -> float:
        """Derivative of the cost by half the sum of squares."""
        return 1 / max(self.q, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class UpdatePoint:
    """Residuals and cost at values of the unknowns.

    Attributes
    ----------
    x : ndarray (n,)
    cost : float
        Negative log posterior up to a constant [nats].
    groups : tuple of ResidualGroup
    modes : ModePoint or None
        Modes there, if modes are fitted.
    errors : (float, float, float)
        Of frequencies [-], mean MAC [-], and of FRFs [dB], as :class:`UpdateStep` has them.
    """

    x: NDArray[np.float64]
    cost: float
    groups: tuple[ResidualGroup, ...]
    modes: ModePoint | None
    errors: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class UpdateLinearisation(Linearisation):
    """The quadratic model of the cost at a point, and the point with its derivatives."""

    at: UpdatePoint
    width: NDArray[np.float64]
    prior: NDArray[np.float64]

    def among(self, free: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the matrix of free unknowns, stiff along directions that the data do not determine."""
        return held(self.matrix[np.ix_(free, free)], self.width[free], self.prior[free])


@dataclass(frozen=True, slots=True, eq=False)
class UpdateProblem:
    """Everything that the cost of an update depends on but x.

    Attributes
    ----------
    model : Model
        At the values to start from.
    unknowns : tuple of ScaledUnknown
        Parameters, then damping ratios, shifts of frequencies, and gains (:attr:`parts`).
    modes : ModeData or None
    frf : FRFData or None
    knots : ndarray or None
        Frequencies of the damping ratios [Hz].
    settings : UpdateSettings
    shift_knots : ndarray or None
        Frequencies of the shifts [Hz].
    n_gains : int
    residual : FRFResidual or None
        Of the lines of a stage, on a basis made for it.
    stage : str
        For the path.
    before : ModePairs or None
        Pairs of the last point, which modes are followed from.
    near : System or None
        Matrices of the last point.
    fixed : tuple of (int, float)
        Unknowns that selection left out, with their start.
    precision : ndarray (n, n) or None
        λ² LᵀL of the regularisation, about the start.
    curve : LCurve or None
    """

    model: Model
    unknowns: tuple[ScaledUnknown, ...]
    modes: ModeData | None
    frf: FRFData | None
    knots: NDArray[np.float64] | None
    settings: UpdateSettings
    shift_knots: NDArray[np.float64] | None = None
    n_gains: int = 0
    residual: FRFResidual | None = None
    stage: str = "modes"
    before: ModePairs | None = None
    near: System | None = None
    fixed: tuple[tuple[int, float], ...] = ()
    precision: NDArray[np.float64] | None = None
    curve: LCurve | None = None

    @property
    def start(self) -> NDArray[np.float64]:
        """Where all unknowns start, (n,)."""
        return np.array([u.start for u in self.unknowns])

    @property
    def widths(self) -> NDArray[np.float64]:
        """Possible errors of all unknowns, (n,)."""
        return np.array([u.width for u in self.unknowns])

    @property
    def prior_information(self) -> NDArray[np.float64]:
        """1/σ² of the priors of all unknowns, 0 without, (n,)."""
        return 1 / np.array([u.std for u in self.unknowns]) ** 2

    @property
    def refs(self) -> tuple[ParameterRef, ...]:
        """Parameters that the unknowns move, in their order."""
        return tuple(ref for u in self.unknowns for ref in u.refs)

    @property
    def limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounds of the unknowns; those of fixed ones are equal."""
        low, high = np.array([u.low for u in self.unknowns]), np.array([u.high for u in self.unknowns])
        for i, x in self.fixed:
            low[i] = high[i] = x
        return low, high

    @property
    def frozen(self) -> NDArray[np.bool_]:
        """Which unknowns selection left out, (n,)."""
        out = np.zeros(len(self.unknowns), dtype=bool)
        out[[i for i, _ in self.fixed]] = True
        return out

    def values(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of ``refs``."""
        parts = [u.moved(xi) for u, xi in zip(self.unknowns, x, strict=True) if u.refs]
        return np.concatenate(parts) if parts else np.zeros(0)

    @property
    def parts(self) -> tuple[slice, slice, slice, slice]:
        """Where parameters, damping ratios, shifts and gains are among the unknowns."""
        n = sum(1 for u in self.unknowns if u.refs)
        edges = np.cumsum(
            [
                n,
                0 if self.knots is None else len(self.knots),
                0 if self.shift_knots is None else 1 + len(self.shift_knots),
                self.n_gains,
            ]
        ).tolist()
        return slice(0, n), slice(n, edges[1]), slice(edges[1], edges[2]), slice(edges[2], edges[3])

    def ratios(self, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Damping ratios at the knots."""
        return None if self.knots is None else np.exp(x[self.parts[1]])

    def with_nuisances(self, x: NDArray[np.float64]) -> tuple["UpdateProblem", NDArray[np.float64]]:
        """Return the problem with the model's own errors as unknowns, and x with zeros for them."""
        if self.residual is None or self.frf is None:
            return self, x
        knots = self.residual.seen()
        if knots.size > _MOST_SHIFTS:
            knots = np.quantile(knots, np.linspace(0, 1, _MOST_SHIFTS))
        knots = np.unique(knots)
        has_shifts = self.frf.model_error > 0 and knots.size > 0
        n_places = self.frf.outputs.shape[1] + self.frf.inputs.shape[1]
        n_gains = n_places if self.frf.amplitude_error > 0 else 0
        more = nuisances_of(knots if has_shifts else knots[:0], self.frf)
        problem = replace(
            self, unknowns=(*self.unknowns, *more), shift_knots=knots if has_shifts else None, n_gains=n_gains
        )
        return problem, np.concatenate([x, np.zeros(len(more))])

    def model_at(self, x: NDArray[np.float64]) -> Model:
        """Return the model at values of the unknowns."""
        model = self.model.with_values(dict(zip(self.refs, self.values(x).tolist(), strict=True)))
        ratios = self.ratios(x)
        if ratios is not None and self.knots is not None:
            model = with_ratios(model, self.knots, ratios)
        return model

    def based(
        self, x: NDArray[np.float64], part: float, n_lines: int, exact: bool = False
    ) -> "UpdateProblem":
        """Return the problem with the FRFs up to a part of the highest frequency, on a basis made at x."""
        if self.frf is None:
            return self
        top = self.frf.frequency[-1] * part
        lines = self.frf.lines(top, n_lines)
        if not lines.mask.any():
            lines = self.frf.lines(np.inf, n_lines)
        residual = FRFResidual(lines, self.model_at(x), self.refs, self.knots, self.shift_knots, exact=exact)
        return replace(self, residual=residual, stage=f"to {lines.frequency[-1]:.4g} Hz")

    def chain(self, x: NDArray[np.float64], dr: NDArray[Any]) -> NDArray[Any]:
        """Return derivatives by the updated parameters from those by ``refs``."""
        rows: list[NDArray[Any]] = []
        k = 0
        for u, xi in zip(self.unknowns, x, strict=True):
            if u.refs:
                rows.append(u.slopes(xi) @ dr[k : k + len(u.refs)])
                k += len(u.refs)
        return np.array(rows).reshape(len(rows), dr.shape[1])

    def state(self, x: NDArray[np.float64], gradient: bool, known: ModePoint | None = None) -> UpdatePoint:
        """Evaluate residuals, and derivatives if asked for."""
        groups: list[ResidualGroup] = []
        point, errors = None, [np.nan, np.nan, np.nan]
        if self.modes is not None:
            model = self.model.with_values(dict(zip(self.refs, self.values(x).tolist(), strict=True)))
            point = known if known is not None else mode_residual(self.modes, model, self.before, self.near)
            J = None
            if gradient:
                J = np.zeros((len(x), point.r.size))
                J[self.parts[0]] = self.chain(x, mode_jacobian(self.modes, point, self.refs))
            groups.append(ResidualGroup("modes", point.r, float(point.r @ point.r), self.modes.n_data, J))
            ok = point.pairs.partner >= 0
            if ok.any():
                ratio = point.pairs.computed[ok] / self.modes.frequency[ok] - 1
                errors[0] = float(np.sqrt((ratio**2).mean()))
                errors[1] = float(point.pairs.mac[ok].mean())
        if self.residual is not None:
            of_shifts, of_gains = self.parts[2:]
            ratios = self.ratios(x)
            terms = self.residual.evaluate(
                self.values(x), gradient, ratios=ratios,
                shifts=None if self.shift_knots is None else x[of_shifts][0] + x[of_shifts][1:],
                gains=x[of_gains] if self.n_gains else None,
            )  # fmt: skip
            r, w = terms.r, terms.weight
            cost = float((w**2 * pseudo_huber(r, _ROBUST)).sum())
            w = w * np.sqrt(pseudo_huber_weight(r, _ROBUST))
            phase = self.residual.data.phase
            J = None
            if gradient and terms.by_values is not None:
                rows = [self.chain(x, terms.by_values)]
                if ratios is not None and terms.by_ratios is not None:
                    rows.append(ratios[:, None] * terms.by_ratios)
                if terms.by_shifts is not None:
                    rows += [terms.by_shifts.sum(axis=0, keepdims=True), terms.by_shifts]
                if terms.by_gains is not None:
                    rows.append(terms.by_gains)
                full = np.vstack(rows) * w
                J = np.hstack([full.real, full.imag]) if phase else full.real
            flat = np.concatenate([w * r.real, w * r.imag]) if phase else w * r.real
            groups.append(ResidualGroup("frf", flat, cost, self.residual.n_data, J))
            errors[2] = float(np.sqrt((r.real**2).mean()) * DB_PER_NEPER)
        return UpdatePoint(
            x,
            self.prior(x) + sum(g.cost for g in groups),
            tuple(groups),
            point,
            (errors[0], errors[1], errors[2]),
        )

    def prior(self, x: NDArray[np.float64]) -> float:
        """Return the negative log density of the priors and the regularisation, up to a constant [nats]."""
        out = 0.5 * sum(
            ((xi - u.mean) / u.std) ** 2 for u, xi in zip(self.unknowns, x, strict=True) if np.isfinite(u.std)
        )
        if self.precision is not None:
            d = x - self.start
            out += 0.5 * float(d @ self.precision @ d)
        return float(out)

    def normal(self, state: UpdatePoint) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return Gauss and Newton's matrix of the cost, and its gradient."""
        weight = self.prior_information
        A = np.diag(weight)
        g = weight * (state.x - np.array([u.mean for u in self.unknowns]))
        if self.precision is not None:
            A = A + self.precision
            g = g + self.precision @ (state.x - self.start)
        for group in state.groups:
            assert group.J is not None
            A = A + group.factor * (group.J @ group.J.T)
            g = g + group.factor * (group.J @ group.r)
        return A, g

    def reduced(self, state: UpdatePoint, stated: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the linearised problem A d ≈ -r of the parameters: other unknowns are projected out.

        Parameters
        ----------
        state : UpdatePoint
        stated : bool
            Whether residuals count by the stated variance, or by the present misfit where that is larger.
        """
        factor = [1.0 if stated else np.sqrt(g.factor) for g in state.groups]
        B = np.vstack([f * g.J.T for f, g in zip(factor, state.groups, strict=True) if g.J is not None])
        r = np.concatenate([f * g.r for f, g in zip(factor, state.groups, strict=True)])
        n = self.parts[0].stop
        others = self.unknowns[n:]
        if others:
            know = np.array([1 / u.std for u in others])
            offset = know * (state.x[n:] - np.array([u.mean for u in others]))
            Q = np.linalg.qr(np.vstack([B[:, n:], np.diag(know)]))[0]
            A = np.vstack([B[:, :n], np.zeros((len(others), n))])
            r = np.concatenate([r, offset])
            return A - Q @ (Q.T @ A), r - Q @ (Q.T @ r)
        return B, r

    def step_of(self, state: UpdatePoint) -> UpdateStep:
        """Return a point as a step of the path."""
        n = self.parts[1].stop
        values = np.array([u.to_value(xi) for u, xi in zip(self.unknowns[:n], state.x[:n], strict=True)])
        lost = () if state.modes is None else state.modes.pairs.lost
        return UpdateStep(self.stage, values, state.cost, *state.errors, lost)

    def following(self, point: UpdatePoint) -> "UpdateProblem":
        """Return the problem with modes followed from a point, and its matrices at hand."""
        if point.modes is None:
            return self
        return replace(self, before=point.modes.pairs, near=point.modes.system)

    def tried(self, x: NDArray[np.float64]) -> UpdatePoint | None:
        """Return a trial; None where the model there has no modes or no finite response."""
        try:
            point = self.state(x, False)
        except (ModelError, FRFError, np.linalg.LinAlgError):
            return None
        return point if np.isfinite(point.cost) else None

    def at(self, x: NDArray[np.float64], near: UpdatePoint) -> UpdatePoint | None:
        """Return a trial with modes followed from the last accepted point: costs compare the same pairs."""
        return self.following(near).tried(x)

    def linearised(self, point: UpdatePoint) -> UpdateLinearisation:
        """Return the quadratic model at a point."""
        state = self.derived(point)
        A, g = self.normal(state)
        return UpdateLinearisation(g, A, state, self.widths, self.prior_information)

    def derived(self, point: UpdatePoint) -> UpdatePoint:
        """Return a point with derivatives."""
        if all(g.J is not None for g in point.groups):
            return point
        return self.state(point.x, True, point.modes)
