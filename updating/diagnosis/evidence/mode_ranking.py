"""Which places and candidates can explain the misfit of measured modes, by sensitivities of the modes.

A change of the matrices moves an eigenvalue by φᵀ(dK - λ dM)φ and mixes the shapes of other modes into its
own: all from the modal basis, so that a candidate costs the same on any mesh.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations, groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, parameter_values
from fem.reduction.parametric_modes import DampedMode, ModesAt
from fem.reduction.terms import ReducedTerm, motions_of
from updating.diagnosis.evidence.hypothesis import Start
from updating.diagnosis.evidence.places import Place, acting
from updating.diagnosis.evidence.ranking import MOST_GRIDS, Against, RankedBlocks
from updating.diagnosis.evidence.scan import Scanned
from updating.diagnosis.evidence.screening import Screened
from updating.forecast.grid import Grid, Little
from updating.forecast.look import candidate_terms
from updating.forecast.sizes import Sizes
from updating.inference.belief import EFFECT_ODDS
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.mode_fit import DOUBT, MetModes, ModeFunction, ModeProblem, Partners

N_LOOKED = 24
"""Number of the best candidates by slopes that are evaluated on their grids, near the data."""
VISIBLE = 0.1
"""Candidates that move the data by less than this at every point of their grids are left out: what was
measured does not see them [standard deviations]."""
HIGHEST = 4.0
"""Modes up to this multiple of the highest measured frequency make the space in which grids are looked at."""
N_PAIRED = 8
"""Number of the best connections of which pairs are made."""
MOST_FORCES = 6
"""Effects with more independent forces act on a member or more as a whole, whose modes hold what they do."""
SAME_FORCE = 1e-6
"""Forces that differ by less are one [-]."""

Floats = NDArray[np.float64]
Key = tuple[tuple[str, str], ...]


@dataclass(eq=False)
class ModeChanges:
    """The modes of a fitted model, and what effects do to their residuals, however these are weighted.

    Attributes
    ----------
    problem : ModeProblem
    current : FitResult
    """

    problem: ModeProblem
    current: FitResult

    @cached_property
    def function(self) -> ModeFunction:
        """The residuals as a function of what varies in the fit."""
        values = [parameter_values(e) for e in self.current.effects]
        return self.problem.function(self.current.effects, values, self.problem.targets.fitted)

    @cached_property
    def x(self) -> Floats:
        """Unknowns of the fit; those that it has not, as an effect took their place, are nominal."""
        return self.function.moved_to(self.current)

    @cached_property
    def base(self) -> ModesAt:
        """The modes of the fit."""
        return self.function.modes_at(self.x)

    @cached_property
    def found(self) -> tuple[NDArray[np.complex128], Partners]:
        """Residuals of the fit, and its partners of the measured modes."""
        return self.function.residuals(self.base)

    def slopes(self, effects: Sequence[Effect]) -> NDArray[np.complex128]:
        """Return what effects do to the residuals to the first order, (n, m).

        What they have is taken for a small change.
        """
        out = np.zeros((len(effects), len(self.found[0])), dtype=complex)
        base, partners = self.base, self.found[1]
        free = [n for n, e in enumerate(effects) if not e.released()]
        terms = [self._restricted(self.problem.reduced.value_of(effects[n])) for n in free]
        out[free] = self.function.slopes(base, partners, list(enumerate(terms)), len(free))
        constrained = [n for n, e in enumerate(effects) if e.released()]
        each = [self._opened(effects[n]) for n in constrained]
        out[constrained] = self.function.slopes(
            base,
            partners,
            [(k, o.term) for k, o in enumerate(each)],
            len(constrained),
            lambda mode: np.stack([o.moved(mode) for o in each]),
        )
        return out

    def at_points(self, grid: Grid, more: Sequence[dict[str, float]] = ()) -> NDArray[np.complex128]:
        """Return by how much the residuals change at each point of a grid and at some more, (n, m).

        NaN where there is no structure.
        """
        terms = candidate_terms(self.problem, self.current, grid)
        if more:
            terms += candidate_terms(self.problem, self.current, Grid(grid.effect, tuple(more)))
        released, around, met = grid.effect.released(), dict[Any, ModesAt](), dict[int, MetModes]()
        for n, term in enumerate(terms):
            if term.place not in around:
                around[term.place] = self.around(released, term)
            larger, term = self._with_lacking(around[term.place], term)
            with suppress(np.linalg.LinAlgError, ValueError):  # no structure
                met[n] = self.function.met(larger.with_term(term))
        out = np.full((len(terms), len(self.found[0])), np.nan, dtype=complex)
        if met:
            out[list(met)] = self.function.residuals_of(list(met.values())) - self.found[0]
        return out

    def _restricted(self, term: ReducedTerm) -> ReducedTerm:
        P = self.base.columns
        if term.L is not None:
            return replace(term, L=term.L @ P)
        each = {key: None if (X := getattr(term, key)) is None else P.T @ X @ P for key in "KMCD"}
        return replace(term, **each, laws=tuple((f, P.T @ X @ P) for f, X in term.laws))

    def _opened(self, effect: Effect) -> "Opened":
        """Return what a connection does that gives way a little."""
        basis, reduced = self.problem.reduced.basis, self.problem.reduced
        columns = [basis.n_main + basis.keys.index(key) for key in effect.released()]
        term = reduced.value_of(effect)
        stiff: Any = term.dense("K")
        for factor, X in term.laws:
            stiff = stiff + abs(complex(np.median(factor(self.base.omega)))) * term.spread(X)
        k = stiff[np.ix_(columns, columns)] if np.ndim(stiff) else np.eye(len(columns)) * 1e30
        forces = [(self.base.columns.T @ reduced.base_sum[key][:, columns]).T for key in "KM"]
        compliance: Any = np.linalg.pinv(k)
        return Opened(compliance, forces[0], forces[1], self.problem.outputs()[columns])

    def around(self, released: Key, term: ReducedTerm) -> ModesAt:
        """Return the modes without some constraints, in the space of the lower modes and of a term's forces.

        Those of a connection that becomes soft are no sum of the modes of a stiff one.
        """
        at, V = self._lower(tuple(released))
        if released or (forces := self._forces(term)) is None:
            return at.on(V)
        vectors, lam = self.base.pairs(0).vectors, self.base.pairs(0).eigenvalues
        high = lam > (2 * np.pi * self._top) ** 2
        still = vectors[:, high] @ ((vectors[:, high].T @ forces) / lam[high, None])
        return at.on(np.hstack([V, _independent_columns(still)]))

    def _with_lacking(self, at: ModesAt, term: ReducedTerm) -> tuple[ModesAt, ReducedTerm]:
        """Return modes and a term on a basis that has the responses to the term's forces as well.

        What a hinge lets turn has mass: with the flexibility alone it would turn too late.
        """
        if term.L is None or term.dofs is None or term.K is None or not term.K.any() or term.laws:
            return at, term
        lacking = self.problem.reduced.lacking(term.dofs, motions_of([term.K])[0])
        if lacking is None:
            return at, term
        return (
            at.with_lacking(lacking, term.stiffer, self._heavier),
            replace(term, L=np.hstack([term.L, lacking.motion])),
        )

    @cached_property
    def _heavier(self) -> float:
        """The ratio of the mass to the nominal one."""
        P = self.base.columns
        nominal = np.einsum("ik,ij,jk->", P, self.problem.reduced.base_sum["M"], P, optimize=True)
        return float(np.trace(self.base.mass) / nominal)

    @cached_property
    def _top(self) -> float:
        return HIGHEST * float(self.problem.targets.frequency[-1])

    def _lower(self, released: Key) -> tuple[ModesAt, Floats]:
        """Return the model without some constraints, its lower modes with them and what opens each."""
        if released not in self._spaces:
            at, pairs = self.base, self.base.pairs(0)
            V = pairs.vectors[:, pairs.frequency <= self._top]
            if released:
                at = self.function.modes_at(self.x, released)
                lower = at.columns.T @ (self.base.columns @ V)
                more = [int(np.flatnonzero(at.columns[self._column(k)])[0]) for k in released]
                V = np.hstack([lower, np.eye(len(lower))[:, more]])
            self._spaces[released] = at, V
        return self._spaces[released]

    def _forces(self, term: ReducedTerm) -> Floats | None:
        """Return a term's forces on the reduced coordinates (r, k); None where it acts on much."""
        if term.L is None:
            return None
        parts = [X for X in (term.K, term.M, *(X for _, X in term.laws)) if X is not None and X.any()]
        U = _independent_columns(np.hstack([np.zeros((len(term.L), 0)), *parts]))
        return (term.L @ self.base.columns).T @ U if 0 < U.shape[1] <= MOST_FORCES else None

    @cached_property
    def _spaces(self) -> dict[Key, tuple[ModesAt, Floats]]:
        return {}

    def _column(self, key: tuple[str, str]) -> int:
        basis = self.problem.reduced.basis
        return basis.n_main + basis.keys.index(key)


@dataclass(eq=False)
class ModeLook:
    """The misfit of a fitted model's modes, ready for changes.

    Residuals are in standard deviations, and behind them stand the deviations of all that varies from its
    prior: what adapts to a change is taken out of both, as a fit would.

    Attributes
    ----------
    changes : ModeChanges
    all_belong : bool
        Whether changes are to explain readings that seem bad as well: those may be what is missing.
    """

    changes: ModeChanges
    all_belong: bool = False

    @classmethod
    def of(cls, problem: ModeProblem, current: FitResult, *, all_belong: bool = False) -> "ModeLook":
        """Return a look at a fit."""
        return cls(ModeChanges(problem, current), all_belong)

    @property
    def _function(self) -> ModeFunction:
        return self.changes.function

    @cached_property
    def _scale(self) -> Floats:
        """One over the standard deviation of each residual, discrepancy included."""
        member, size = np.unique(self._function.groups, return_inverse=True, return_counts=True)[1:]
        return np.sqrt((self._worth / size)[member])

    @cached_property
    def _squares(self) -> Floats:
        return self._function.mean_by_group(np.abs(self.changes.found[0]) ** 2)

    @cached_property
    def _worth(self) -> Floats:
        """Weight of each reading."""
        levels = self._function.levels()
        return (replace(levels, bad_prior=0.0) if self.all_belong else levels).weight(self._squares)

    @cached_property
    def doubtful(self) -> bool:
        """Whether any reading seems bad."""
        return bool((self._function.levels().is_bad(self._squares) > DOUBT).any())

    @cached_property
    def _adapting(self) -> tuple[Floats, Floats, Floats]:
        """Orthonormal directions of what varies, the misfit without them, and what varies, row by row."""
        function = self._function
        x, prior = self.changes.x, function.prior()
        _, J = function(x, True)
        assert J is not None
        known = np.where(np.isfinite(prior.std), 1 / prior.std, 0.0)
        rows = np.hstack([self._plain(J), np.diag(known)])
        Q, _ = np.linalg.qr(rows.T)
        y = np.concatenate(
            [self._plain(self.changes.found[0][None])[0], known * (x - np.nan_to_num(prior.mean))]
        )
        return Q, y - Q @ (Q.T @ y), rows

    def evidence(self, slopes: Floats, factor: Floats) -> tuple[Floats, Floats]:
        """Return by how much changes of known size raise the log evidence, and how sharply they are known.

        Of multiples ``factor`` (n,) of slopes (n, m), to the first order. The level of error is the one that
        they leave, and what adapts to them is known as well as that level allows. The second result is one
        over the standard deviation of the multiple, (n,).
        """
        levels, rows = self._function.levels(), self._adapting[2]
        n, member = len(self._scale), np.unique(self._function.groups, return_inverse=True)[1]
        of_group = np.eye(member.max() + 1)[np.concatenate([member, member])]

        def parts(r: Floats) -> tuple[Floats, Floats]:
            return r[:, : 2 * n] ** 2 @ of_group, (r[:, 2 * n :] ** 2).sum(axis=1)

        def posterior(r: Floats) -> tuple[Floats, Floats]:
            """Return the log evidence up to a constant, and the weight of each group's squares."""
            squares, known = parts(r)
            v = squares / self._worth
            share = levels.weight(v) / self._worth
            curvature = np.einsum("ng,gij->nij", share, each) + rows[:, 2 * n :] @ rows[:, 2 * n :].T
            return -levels.costs(v) - known / 2 - np.linalg.slogdet(curvature)[1] / 2, share

        each = np.einsum("im,mg,jm->gij", rows[:, : 2 * n], of_group, rows[:, : 2 * n], optimize=True)
        now, _ = posterior(self.misfit[None])
        then, share = posterior(self.misfit + factor[:, None] * slopes)
        squares, known = parts(slopes)
        return then - now, np.sqrt((share * squares).sum(axis=1) + known)

    def _plain(self, r: NDArray[np.complex128]) -> Floats:
        scaled = r * self._scale
        return np.hstack([scaled.real, scaled.imag])

    def adapted(self, changes: NDArray[np.complex128]) -> Floats:
        """Return changes (n, m) of the residuals without what adapts to them."""
        Q = self._adapting[0]
        flat = np.hstack([self._plain(changes), np.zeros((len(changes), len(self.changes.x)))])
        return flat - (flat @ Q) @ Q.T

    @property
    def misfit(self) -> Floats:
        """The misfit in standard deviations, without what adapts."""
        return self._adapting[1]

    def slopes(self, effects: Sequence[Effect]) -> Floats:
        """Return what effects do to the misfit to the first order, (n, m)."""
        return self.adapted(self.changes.slopes(effects))

    def residual_squares_at(self, grid: Grid) -> Floats:
        """Return :meth:`residual_squares` at each point of a grid."""
        return self.residual_squares(self.changes.at_points(grid))

    def residual_squares(self, changes: NDArray[np.complex128]) -> Floats:
        """Return the squares of the misfit that changes (n, m) of the residuals leave, in deviations², (n,).

        Infinite where there is no structure, and everywhere if the data see none of them.
        """
        there = np.isfinite(changes).all(axis=1)
        change, out = self.adapted(changes[there]), np.full(len(changes), np.inf)
        if np.linalg.norm(change, axis=1).max(initial=0.0) >= VISIBLE:
            out[there] = ((self.misfit + change) ** 2).sum(axis=1)
        return out


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A constraint that gives way a little under the forces on it, f = (K_cu - ω² M_cu) x by motions x.

    What opens the constraint is in static equilibrium elsewhere, so that nearly all of f is inertia.

    Attributes
    ----------
    compliance : ndarray (c, c)
    stiffness, mass : ndarray (c, r)
        K_cu and M_cu.
    outputs : ndarray (c, n_out)
        Motion of the sensors where the constraint opens.
    """

    compliance: Floats
    stiffness: Floats
    mass: Floats
    outputs: Floats

    @property
    def term(self) -> ReducedTerm:
        """The change of the dynamic stiffness, -fᵀ k⁻¹ f, in powers of -ω²."""
        powers = np.diag([1.0, 0.0]), np.array([[0.0, 1.0], [1.0, 0.0]]), np.diag([0.0, 1.0])
        laws = tuple((partial(_power, n), np.kron(which, -self.compliance)) for n, which in enumerate(powers))
        return ReducedTerm(np.vstack([self.stiffness, self.mass]), None, None, None, None, laws)

    def moved(self, mode: DampedMode) -> NDArray[Any]:
        """Return the motion of the sensors by the opening in a mode, (n_out,)."""
        force = self.stiffness @ mode.vector - mode.eigenvalue.real * (self.mass @ mode.vector)
        return -(self.compliance @ force) @ self.outputs


def _power(n: int, omega: Floats) -> Floats:
    return (-(omega**2)) ** n


@dataclass(frozen=True, slots=True)
class SmallModeChange:
    """What the best multiple of a candidate's change does, to the first order.

    Attributes
    ----------
    residual_squares : float
        Squares of the misfit that it leaves [deviations²].
    values, std : dict
        Parameter values there, and their standard deviations.
    evidence : float
        By how much the candidate raises the log evidence, whatever its size; -∞ if the data do not see it.
    """

    residual_squares: float
    values: dict[str, float]
    std: dict[str, float]
    evidence: float


class ModeRanking:
    """Ranking by measured modes: they tell candidates apart less, and fits to them cost little."""

    breadth = 12
    precise_looks = False

    def scan(self, problem: ModeProblem, current: FitResult, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return places by the misfit that the slopes of all candidates there leave.

        Those are left out that gain less evidence than the prior asks for one more effect.
        """
        look = ModeLook.of(problem, current, all_belong=True)
        effects = [(n, acting(e)) for n, place in enumerate(places) for e in place.effects]
        effects = [(n, e) for n, e in effects if not e.amplitude_dependent]
        slopes = look.slopes([e for _, e in effects])
        rows_of: dict[str, list[int]] = {}
        for row, (n, _) in enumerate(effects):
            if np.isfinite(slopes[row]).all():
                rows_of.setdefault(places[n].name, []).append(row)
        least = 1 - EFFECT_ODDS / max(0.5 * float((look.misfit**2).sum()), 1e-300)
        there = (p for p in places if p.name in rows_of)
        found = [Scanned((p,), _residual_ratio(look, slopes[rows_of[p.name]])) for p in there]
        singles = sorted((s for s in found if s.residual_ratio < least), key=lambda s: s.residual_ratio)
        connections = [s for s in singles if s.places[0].kind in ("joint", "support", "end")]
        connections = [s for s in connections if "," not in s.name][:N_PAIRED]
        pairs = []
        for one, two in combinations(connections, 2):
            rows = [*rows_of[one.name], *rows_of[two.name]]
            both = Scanned((*one.places, *two.places), _residual_ratio(look, slopes[rows]))
            if both.residual_ratio < 0.9 * min(one.residual_ratio, two.residual_ratio):
                pairs.append(both)
        return tuple(sorted([*singles, *pairs], key=lambda s: s.residual_ratio))

    def screened(
        self,
        problem: ModeProblem,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
        against: Against | None = None,
        *,
        far: bool = False,
    ) -> tuple[Screened, ...]:
        """Return candidates by the misfit that they leave on their grids, of the best by their slopes.

        Beside uncertain parameters as they are fitted, which a strong effect has bent, and beside nominal
        ones. A change between two states may be far weaker than any point of a grid, so that the best
        multiple of each candidate's slope is one more. Far from the data slopes say little.
        """
        return self._looked_at(problem, current, effects, listed, MOST_GRIDS if against is None else N_LOOKED)

    def _looked_at(
        self,
        problem: ModeProblem,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
        most: int,
    ) -> tuple[Screened, ...]:
        grids = _grids(problem, effects)
        bases = [ModeChanges(problem, base) for base in _bases(problem, current)]
        looks = [each for base in bases for each in _by_slopes(base, grids)]
        squares = ([x.residual_squares for x in little] for _, little in looks)
        chosen = [np.argsort(each, kind="stable")[:most] for each in squares]
        gains = np.full((len(looks), len(grids)), -np.inf)
        starts: list[list[Start]] = [[] for _ in grids]
        for i, grid in enumerate(grids):
            wanted = [k for k in range(len(looks)) if i in chosen[k] or listed(grid.effect)]
            each = _tried([(looks[k][0], looks[k][1][i].values) for k in wanted], grid)
            for k, (gain, start) in zip(wanted, each, strict=True):
                gains[k, i] = gain
                starts[i] += start
        rank = np.argsort(np.argsort(-gains, axis=1, kind="stable"), axis=1).min(axis=0)
        gain = gains.max(axis=0, initial=-np.inf)
        # Less than the prior asks for one more effect cannot make a hypothesis the more probable one.
        there = [int(i) for i in np.lexsort((-gain, rank)) if gain[i] > EFFECT_ODDS]
        return tuple(Screened(grids[i].effect, tuple(starts[i]), float(gain[i])) for i in there)

    def looked(
        self, problem: ModeProblem, current: FitResult, effects: Sequence[Effect]
    ) -> list[tuple[Effect, SmallModeChange]]:
        """Return candidates that the data see, with their changes of a fit to first order."""
        grids = _grids(problem, effects)
        ways = [little for _, little in _by_slopes(ModeChanges(problem, current), grids)]
        each = [(g, max(little, key=lambda x: x.evidence)) for g, *little in zip(grids, *ways, strict=True)]
        return [(g.effect.with_values(**x.values), x) for g, x in each if np.isfinite(x.evidence)]

    def blocks(self, problem: ModeProblem, current: FitResult, *, far: bool) -> RankedBlocks:
        """Return what ranks nothing: modes say too little of several springs at once."""
        return lambda groups: []

    def rivals(
        self, problem: ModeProblem, last: FitResult, effects: Sequence[Effect], n_best: int
    ) -> tuple[Screened, ...]:
        """Return the candidates that leave least in the place of the last effect of a fit."""
        without = last.without(last.effects[-1].name)
        return self._looked_at(problem, without, effects, lambda effect: False, N_LOOKED)[:n_best]

    def log_evidence(self, problem: ModeProblem, current: FitResult, effects: Sequence[Effect]) -> None:
        """Return None: :mod:`updating.diagnosis.unfitted` weighs them."""
        return

    def scatter(
        self, problem: ModeProblem, result: FitResult, size: float | None = None
    ) -> FormScatter | None:
        """Return None: the discrepancy of damping ratios represents it."""
        return None

    def allowed_squares(self, problem: ModeProblem) -> Any:
        """Return the mean squares that a right model may leave beyond noise, of each group."""
        return problem.allowed_squares


def _grids(problem: ModeProblem, effects: Sequence[Effect]) -> list[Grid]:
    """Return the grids of effects that have points; modes say nothing of amplitudes."""
    grids = [Grid.of(problem, e) for e in effects]
    return [g for g in grids if g.points and not g.effect.amplitude_dependent]


def _bases(problem: ModeProblem, current: FitResult) -> tuple[FitResult, ...]:
    """Return a fit, and the same with nominal parameters if any are uncertain."""
    nominal = problem.at_nominal(current)
    return (current,) if nominal.values == current.values else (current, nominal)


def _tried(
    looks: Sequence[tuple[ModeLook, dict[str, float]]], grid: Grid
) -> list[tuple[float, tuple[Start, ...]]]:
    """Return by how much a candidate raises the log likelihood in some looks, and where it does [nats].

    With each look stands one more point. Looks at one fit share what the candidate does to its modes.
    """
    grid = Grid(grid.effect, grid.points)  # of its matrices none are kept for later
    n, out = len(grid.points), []
    for changes, alike in groupby(looks, key=lambda each: each[0].changes):
        group = list(alike)
        done = changes.at_points(grid, [values for _, values in group])
        for k, (look, values) in enumerate(group):
            squares = look.residual_squares(done[[*range(n), n + k]])
            best = int(np.argmin(squares))
            point = (*grid.points, values)[best]
            start = (Start((point,), changes.current),) if np.isfinite(squares[best]) else ()
            out.append((float((look.misfit**2).sum() - squares[best]) / 2, start))
    return out


def _independent_columns(A: Floats) -> Floats:
    """Return an orthonormal basis of the columns of a matrix, each of which counts as much."""
    size = np.linalg.norm(A, axis=0)
    U, s, _ = np.linalg.svd(A[:, size > 0] / size[size > 0], full_matrices=False)
    return U[:, s > SAME_FORCE * s.max(initial=0.0)]


def _by_slopes(changes: ModeChanges, grids: Sequence[Grid]) -> list[tuple[ModeLook, list[SmallModeChange]]]:
    """Return the best multiples of the candidates' changes of a fit.

    In a look at it, and in one that believes every reading where any seems bad.
    """
    # a change is taken from the nominal value, also of a parameter that is replaced
    littles = [Little.of(grid, {}) for grid in grids]
    slopes = changes.slopes([o.grid.effect.with_values(**p) for o in littles for p in o.points])
    look = ModeLook(changes)
    looks = (look, ModeLook(changes, all_belong=True)) if look.doubtful else (look,)
    return [(look, _best_multiples(look, littles, look.adapted(slopes))) for look in looks]


def _best_multiples(look: ModeLook, littles: Sequence[Little], slopes: Floats) -> list[SmallModeChange]:
    """Return what the best multiples of the slopes by a little of each candidate do, place by place."""
    n_each = [len(o.points) for o in littles]
    slopes, y = np.nan_to_num(slopes), look.misfit
    size = (slopes**2).sum(axis=1)
    factor = -(slopes @ y) / np.where(size > 0, size, 1.0)
    one_sided = np.repeat([o.grid.one_sided() for o in littles], n_each)
    limit = np.concatenate([np.zeros(0), *(o.most for o in littles)])
    factor = np.clip(factor, np.where(one_sided, 0.0, -limit), limit)
    squares = ((y + factor[:, None] * slopes) ** 2).sum(axis=1)
    gain, sharp = look.evidence(slopes, factor)
    gain[np.sqrt(size) * limit < VISIBLE] = -np.inf
    std, out = 1 / np.maximum(sharp, 1e-12), []
    for little, end in zip(littles, np.cumsum(n_each).tolist(), strict=True):
        rows = range(end - len(little.points), end)
        sizes = Sizes.of(look.changes.problem, little)
        each = [gain[i] + sizes.log_share(k, float(factor[i]), float(std[i])) for k, i in enumerate(rows)]
        k = int(np.argmin(squares[rows]))
        i = rows[k]
        evidence = float(np.logaddexp.reduce(each) - np.log(len(rows)))
        values, deviations = _around(sizes, k, float(factor[i]), float(std[i]))
        out.append(SmallModeChange(float(squares[i]), values, deviations, evidence))
    return out


def _around(sizes: Sizes, k: int, factor: float, std: float) -> tuple[dict[str, float], dict[str, float]]:
    """Return the values at a multiple of the k-th place, and their deviations; of positions the grid's.

    Where the data ask for none of it, those of the slight change: nothing is known of a bound's effect.
    """
    factor = factor or 1.0
    values = sizes.little.values(k, factor)
    x, *ends = (sizes.x(k, a) for a in (factor, factor - std, factor + std))
    wide = min(sizes.prior.std, abs(ends[1] - ends[0]) / 2)
    deviation = {key: float(np.std([q[key] for q in sizes.little.grid.points])) for key in values}
    return values, deviation | {sizes.ref[1]: sizes.unknown.deviation(x, wide)}


def _residual_ratio(look: ModeLook, slopes: Floats) -> float:
    """Return the mean square of the misfit that changes along slopes leave, by their evidence.

    Their sizes have a common normal prior whose deviation the data choose. It is 1 less the gain in evidence
    over the largest one that any change can have, half the squares of the misfit.
    """
    D = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
    y = look.misfit
    lam, U = np.linalg.eigh(D @ D.T)
    there = lam > 1e-8 * lam[-1]
    lam, z = lam[there], (U[:, there].T @ (D @ y)) / np.sqrt(lam[there])
    best = 0.0
    for s2 in np.geomspace(1.0, max(4.0, float(y @ y)), 8):
        shrunk = s2 * lam / (1 + s2 * lam)
        best = max(best, 0.5 * float((shrunk * z**2).sum()) - 0.5 * float(np.log1p(s2 * lam).sum()))
    return 1 - best / max(0.5 * float(y @ y), 1e-300)
