"""The search: places by the scan, then blocks and single laws there, each by its evidence."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.reduced_model import ReducedModel
from fem.system import assemble
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.evidence.fitting import Fitted, fit
from updating.diagnosis.evidence.places import Place, place_of, places_of
from updating.diagnosis.evidence.priors import PLACE_ODDS, TWIN_NATS, UNKNOWN_ODDS
from updating.diagnosis.evidence.ranking import FrfRanking, Ranking
from updating.diagnosis.evidence.scan import Scanned
from updating.inference.fit import FitProblem
from updating.inference.mode_fit import ModeProblem
from updating.inference.parameters import Nuisance

QUICK_LINES, FULL_LINES = 40, 100
"""Lines of quick fits, and of full ones."""
SHORT_STEPS, QUICK_STEPS = 2, 6
"""Steps of first, short fits in each band, and of those that go on from them."""
FAR = 3.0
"""Multiple of the floor from which on uncertain parameters may be bent, so that fits begin from nominal ones,
too [-]."""
N_PLACES, N_PAIRS, N_FULL, N_FINAL, N_BEAM = 4, 2, 6, 3, 2
"""Numbers of places at which each kind, and of connections at which the block, gets a short fit; of pairs of
connections; of hypotheses that are fitted fully at most and at least, and kept."""
AROUND = (0.6, 1.0, 1.6)
"""Factors of a found positive parameter at which other maxima are looked for."""
BEAM_NATS = 20.0
"""Hypotheses this much less probable than the best one with as many effects are not searched on from."""
MOST_FITS = 3
"""A hypothesis is fitted fully from at most so many values."""
N_RIVALS = 6
"""Number of rival candidates at the place of a found effect that are fitted."""
MOST_EFFECTS = 6
"""Largest number of effects in a hypothesis."""
BLOCK_KINDS = ("joint_stiffness", "support_flexibility", "end_release")
"""Kinds that give way in single directions: all of a connection's together are its block."""
N_STARTS = 3
"""Number of starts that are kept after short fits of the lowest band."""
BLOCK_SHARES = (0.2, 0.6)
"""Blocks begin at these places of the effects' grids, from the weakest to the strongest [-]."""
BASIS_SHARE, BASIS_LINES = 0.03, (8, 16)
"""The basis gets responses at so many lines of what was found while it errs there by more than this share of
the level."""
AnyProblem = FitProblem | ModeProblem
Say = Callable[[str], None]
Values = tuple[dict[str, float], ...]
Starts = list[Values]
Proposal = tuple[tuple[Effect, ...], Starts, bool]
"""Effects to add, values to start from, and whether they are one effect at the first place of the scan."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A model with effects, fitted.

    Attributes
    ----------
    fitted : Fitted
    prior : float
        Logarithm of its prior probability, up to a constant.
    """

    fitted: Fitted
    prior: float

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted values."""
        return self.fitted.effects

    @property
    def score(self) -> float:
        """Logarithm of its posterior probability, up to a constant."""
        return self.fitted.log_evidence + self.prior

    @property
    def key(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(e.name for e in self.effects)

    @property
    def places(self) -> frozenset[str]:
        """Members and connections that the effects act on."""
        return frozenset(set[str]().union(*map(near_to, self.effects)))

    @property
    def name(self) -> str:
        """Effects in words."""
        return " + ".join(sorted(f"{e.kind} {e.where}" for e in self.effects)) or "nothing"


def _size(effect: Effect, values: dict[str, float]) -> float:
    """Return how far values are from the effect's absence, on the scale of its first parameter."""
    p, value = effect.parameters()[0], values[effect.parameters()[0].name]
    if np.isinf(p.absent):
        return -value
    return abs(np.log(value / p.absent)) if p.log and p.absent > 0 else abs(value - p.absent)


def values_of(effects: Sequence[Effect]) -> Values:
    """Return the parameter values of effects."""
    return tuple(map(parameter_values, effects))


def _with_forces(problem: AnyProblem, effects: Sequence[Effect], values: Values) -> AnyProblem:
    """Return a problem whose basis has the responses to forces of effects at some values."""
    there = [e.with_values(**v) for e, v in zip(effects, values, strict=True)]
    return replace(problem, reduced=problem.reduced.with_forces_of(there))


def _moved(one: Fitted, two: Fitted) -> bool:
    """Whether an effect's parameter is more than a deviation from where it is in another fit."""
    a, b = one.result, two.result
    names = {e.name for e in one.effects} & {e.name for e in two.effects}
    return any(abs(a.values[r] - b.values[r]) > b.std[r] for r in a.values if r[0] in names)


def _turns(effect: Effect) -> bool:
    """Whether an effect lets a connection give way about an axis."""
    return effect.kind == "end_release" or str(getattr(effect, "direction", "")).startswith("r")


def near_to(effect: Effect) -> set[str]:
    """Return the names of the members and connections that an effect acts on."""
    fields = (getattr(effect, key, None) for key in ("joint", "support", "member"))
    names = {f for f in fields if isinstance(f, str)}
    for key in ("joints", "supports"):
        many = getattr(effect, key, None)
        names |= {x for x in many if isinstance(x, str)} if isinstance(many, tuple) else set()
    return names or {place_of(effect)[1]}


@dataclass(frozen=True, slots=True, eq=False)
class Maximum:
    """A maximum of the posterior and the normal approximation around it.

    Attributes
    ----------
    x : ndarray (n,)
    covariance : ndarray (n, n)
    log_evidence : float
    """

    x: NDArray[np.float64]
    covariance: NDArray[np.float64]
    log_evidence: float

    def distance(self, other: "Maximum") -> float:
        """Return the largest distance of unknowns, in standard deviations of the other."""
        return float(np.abs((self.x - other.x) / np.sqrt(np.diag(other.covariance))).max())


@dataclass(slots=True, eq=False)
class Search:
    """A search and all hypotheses that it has fitted.

    Attributes
    ----------
    problem : FitProblem or ModeProblem
        With the form among the uncertain parameters.
    form : tuple of Nuisance
        Those of them that are the form's.
    candidates : tuple of Effect
    floor : float
        Level that noise and the mesh leave [nepers].
    """

    problem: AnyProblem
    form: tuple[Nuisance, ...]
    candidates: tuple[Effect, ...]
    say: Say = lambda text: None
    known: dict[frozenset[str], Hypothesis] = field(default_factory=dict)
    places: tuple[Place, ...] = ()
    scanned: tuple[Scanned, ...] = ()
    ranking: Ranking = field(default_factory=FrfRanking)

    floor: float = field(init=False)
    _n_fits: Counter[frozenset[str]] = field(default_factory=Counter, init=False)
    _n_candidates: Counter[str] = field(init=False)
    _n_places: Counter[str] = field(init=False)

    def __post_init__(self) -> None:
        self.floor = float(np.hypot(self.problem.data.noise_level, self.problem.mesh_level))
        self.places = places_of(self.problem, self.candidates)
        where = [place_of(c) for c in self.candidates]
        self._n_candidates = Counter(name for _, name in where)
        self._n_places = Counter(kind for kind, _ in set(where))

    # the search ---------------------------------------------------------------------------------------------

    def run(self) -> Hypothesis:
        """Return the most probable hypothesis; all that were fitted fully are in ``known``."""
        best = self.full((), ())
        self.say(f"nothing: {best.score:.1f}, level {best.fitted.level:.4f}, floor {self.floor:.4f}")
        beam = [best]
        while beam and len(best.effects) < MOST_EFFECTS:
            better = {h.key: h for b in beam for h in self.extended(b)}
            beam = sorted(better.values(), key=lambda h: -h.score)[:N_BEAM]
            beam = [h for k, h in enumerate(beam) if k == 0 or self.apart(h, beam[0])]
            if not beam or beam[0].score <= best.score:
                break
            beam[0] = best = self.on_own_basis(self.swapped(beam[0]))
            self.say(f"=> {best.score:.1f}, level {best.fitted.level:.4f}: {best.name}")
        return max(self.known.values(), key=lambda h: h.score)

    def is_far(self, h: Hypothesis) -> bool:
        """Whether a hypothesis is so far from the data that its uncertain parameters may be bent."""
        return h.fitted.level > FAR * self.floor

    def apart(self, h: Hypothesis, best: Hypothesis) -> bool:
        """Whether a hypothesis is nearly as probable as the best one, and at other places."""
        return h.score > best.score - BEAM_NATS and not h.places <= best.places

    def extended(self, base: Hypothesis) -> list[Hypothesis]:
        """Return the best hypotheses with something more than another has, simplified."""
        quick = self.quick(base)
        kept = tuple(parameter_values(e) for e in base.effects)
        short: list[tuple[list[Hypothesis], bool]] = []
        for effects, starts, first in self.proposals(base, quick):
            fits = self.shortly(quick, base, (*base.effects, *effects), [(*kept, *s) for s in starts])
            if fits:
                short.append((fits, first))
        short.sort(key=lambda each: -each[0][0].score)
        # A few steps say little of a strong effect, and the scan has needed none.
        tried = [
            self.continued(quick, fits[: 2 if k < self.ranking.breadth // 2 else 1])
            for k, (fits, first) in enumerate(short)
            if k < self.ranking.breadth or first
        ]
        tried.sort(key=lambda h: -h.score)
        now = self.quickly(quick, base, base.effects, kept).score
        least = 1 if base.effects else N_FINAL
        tried = [h for k, h in enumerate(tried) if k < least or h.score > now - TWIN_NATS][:N_FULL]
        for h in tried:
            self.say(f"   {h.score:9.1f} {h.fitted.level:.4f} {h.name}")
        out = []
        for h in tried:
            if h.score < tried[0].score - 2 * TWIN_NATS and len(out) >= N_FINAL:  # few lines say less
                break
            h = self.highest(quick, h, base)
            out.append(self.simplified(self.full(h.effects, values_of(h.effects), h.fitted, base)))
        return out

    def simplified(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis without the effects whose absence raises its score, one after the other."""
        while len(h.effects) > 1:
            quick, options = self.quick(h), []
            for e in h.effects:
                rest = tuple(x for x in h.effects if x.name != e.name)
                options.append(self.quickly(quick, h, rest, values_of(rest)))
            best = max(options, key=lambda o: o.score)
            now = self.quickly(quick, h, h.effects, values_of(h.effects))
            if best.score < now.score - TWIN_NATS:
                return h
            less = self.full(best.effects, values_of(best.effects), best.fitted, h, anew=True)
            if less.score <= h.score:
                return h
            h = less
            self.say(f"   simpler: {h.score:.1f} {h.name}")
        return h

    def swapped(self, h: Hypothesis) -> Hypothesis:
        """Return the best of a hypothesis and those with another effect at the place of one of its own.

        All that are nearly as probable are fitted fully: they are its credible set.
        """
        result, quick = h.fitted.result, self.quick(h)
        now = self.quickly(quick, h, h.effects, values_of(h.effects))
        for e in h.effects:
            rest = tuple(x for x in h.effects if x.name != e.name)
            near = [c for c in self.candidates if c.name not in h.key and near_to(c) & near_to(e)]
            own = {r: v for r, v in result.values.items() if r[0] not in self._form_names}
            last = replace(result, effects=(*rest, e), values=own)
            found = self.ranking.rivals(quick, last, near, N_RIVALS)
            for s in found:
                other = self.quickly(quick, h, (*rest, s.effect), (*values_of(rest), s.starts[0]))
                self.say(f"   rival {other.score - now.score:+.1f} {other.name}")
                if other.score > now.score - 2 * TWIN_NATS:  # few lines say less
                    self.full(other.effects, values_of(other.effects), other.fitted, h)
        return max(
            (k for k in self.known.values() if len(k.effects) == len(h.effects)), key=lambda k: k.score
        )

    # proposals ----------------------------------------------------------------------------------------------

    def proposals(self, base: Hypothesis, quick: AnyProblem) -> list[Proposal]:
        """Return effects that may be added."""
        current = base.fitted.result
        ranked = self.ranking.scan(self.problem, current, self.places)
        if not base.effects:
            self.scanned = ranked
        fields = {r for e in base.effects for r in e.released()}

        def fits(effect: Effect) -> bool:
            return effect.name not in base.key and not fields & set(effect.released())

        singles = [s for s in ranked if len(s.places) == 1]
        pairs = [s for s in ranked if len(s.places) == 2][:N_PAIRS]
        self.say("scan: " + "; ".join(f"{s.name} {s.left:.3f}" for s in ranked[:6]))
        within = {r: v for r, v in current.values.items() if r[0] not in self._form_names}
        now = replace(current, values=within)
        wholes = list(dict.fromkeys(s.places[0].whole for s in singles))[:N_PLACES]
        held = [{e.name for p in self.places if p.whole == whole for e in p.effects} for whole in wholes]
        there = set[str]().union(*held)
        screened = self.ranking.screened(
            quick, now, [c for c in self.candidates if fits(c)], lambda e: e.name in there
        )
        chosen = list(screened[: self.ranking.breadth])
        for names in held:
            best = {s.effect.kind: s for s in reversed(screened) if s.effect.name in names}
            chosen += [s for s in best.values() if s not in chosen]
        first = held[0] if held else set[str]()
        out: list[Proposal] = [
            ((s.effect,), [(start,) for start in s.starts], s.effect.name in first) for s in chosen
        ]
        done = {frozenset([e.name for e in effects]) for effects, *_ in out}
        connections = [s for s in singles if s.places[0].kind in ("joint", "support", "end")][:N_PLACES]
        for scanned in (*connections, *pairs):
            block = [
                e
                for p in scanned.places
                for e in p.effects
                if e.kind in BLOCK_KINDS and _turns(e) and fits(e)
            ]
            key = frozenset(e.name for e in block)
            if len(block) > 1 and key not in done:
                done.add(key)
                out.append((tuple(block), self.block_starts(block), False))
        return out

    def block_starts(self, block: Sequence[Effect]) -> Starts:
        """Return starts in which each direction gives way a little or much, by the effects' own grids.

        All combinations at one place; at several, each place's directions together.
        """
        grids = [sorted(e.starts(self.problem.surroundings), key=partial(_size, e)) for e in block]
        places = [place_of(e)[1] for e in block]
        groups = (
            list(range(len(block)))
            if len(set(places)) == 1
            else [sorted(set(places)).index(p) for p in places]
        )
        out = []
        for shares in product(BLOCK_SHARES, repeat=max(groups) + 1):
            out.append(tuple(g[int(shares[k] * (len(g) - 1))] for g, k in zip(grids, groups, strict=True)))
        return out[: 2**4]

    # fits ---------------------------------------------------------------------------------------------------

    @property
    def _form_names(self) -> set[str]:
        return {n.effect for n in self.form}

    def quick(self, base: Hypothesis) -> AnyProblem:
        """Return the problem with the form fixed: as it is in a hypothesis, or nominal if that is far."""
        names, values = self._form_names, self.form_of(base)
        reduced = self.problem.reduced
        if any(values.values()):
            model = reduced.model.with_values(values)
            reduced = ReducedModel(model, reduced.basis, assemble(model, reciprocal=False))
        own = tuple(n for n in self.problem.nuisances if n.effect not in names)
        return replace(self.problem, reduced=reduced, nuisances=own)

    def form_of(self, base: Hypothesis) -> dict[ParameterRef, float]:
        """Return the form's parameters in a hypothesis, which are bent where it is far from the data."""
        if self.is_far(base):
            return {}
        return {r: v for r, v in base.fitted.result.values.items() if r[0] in self._form_names}

    def shortly(
        self, quick: AnyProblem, base: Hypothesis, effects: Sequence[Effect], starts: Starts
    ) -> list[Hypothesis]:
        """Return a hypothesis after a few steps from each of some starts, the best first.

        None where no start has a structure. Of many starts those go on that do best in the lowest band. All
        else begins where it is in a base and, where that is far from the data, at its nominal values, too.
        """
        if len(starts) > N_STARTS:
            tried = [
                fit(
                    quick, effects, start, stages=quick.stages[:1], n_lines=QUICK_LINES, max_iterations=3
                ).log_likelihood
                for start in starts
            ]
            starts = [starts[k] for k in np.argsort(tried)[::-1][:N_STARTS]]
        ways: list[dict[str, Any]] = [{"stages": quick.stages[-1:], "x_from": base.fitted.result}]
        ways += [{}] if self.is_far(base) else []
        fits = []
        for start in starts:
            problem = _with_forces(quick, effects, start)
            for way in ways:
                with suppress(np.linalg.LinAlgError):
                    fits.append(
                        fit(problem, effects, start, n_lines=QUICK_LINES, max_iterations=SHORT_STEPS, **way)
                    )
        fits.sort(key=lambda f: -f.log_evidence)
        return [Hypothesis(f, self.prior(effects)) for f in fits]

    def highest(self, quick: AnyProblem, h: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return a hypothesis at the highest of the maxima around it, on few lines.

        Resonances that pass each other leave several. All but the effects beside those of the base begins as
        it is there, and these off in one positive parameter.
        """
        starts = self._around(h.effects, len(base.effects))
        fits = [self.quickly(quick, base, h.effects, start) for start in starts]
        return max([h, *fits], key=lambda k: k.score)

    def continued(self, quick: AnyProblem, begun: Sequence[Hypothesis]) -> Hypothesis:
        """Return the best of hypotheses with the same effects that are fitted on from where they are."""
        fits = [self.quickly(quick, h, h.effects, values_of(h.effects)) for h in begun]
        return max(fits, key=lambda h: h.score)

    def quickly(
        self, quick: AnyProblem, near: Hypothesis, effects: Sequence[Effect], values: Values
    ) -> Hypothesis:
        """Return a hypothesis fitted on few lines with the form fixed, from near another one."""
        problem = _with_forces(quick, effects, values)
        way: dict[str, Any] = {"stages": problem.stages[-1:], "x_from": near.fitted.result}
        fitted = fit(problem, effects, values, n_lines=QUICK_LINES, max_iterations=QUICK_STEPS, **way)
        return Hypothesis(fitted, self.prior(effects))

    def full(
        self,
        effects: Sequence[Effect],
        values: Values,
        near: Fitted | None = None,
        base: Hypothesis | None = None,
        *,
        anew: bool = False,
    ) -> Hypothesis:
        """Return a hypothesis fitted on all lines with the form free, once from the same values.

        From others, and ``anew``, it is fitted again, and the better one stays.
        """
        key = frozenset(e.name for e in effects)
        known = self.known.get(key)
        again = anew or (near is not None and known is not None and _moved(near, known.fitted))
        if known is None or (again and self._n_fits[key] < MOST_FITS):
            self._n_fits[key] += 1
            fitted = self.fitted(effects, values, near, base)
            if known is None or fitted.score > known.score:
                self.known[key] = fitted
        return self.known[key]

    def fitted(
        self,
        effects: Sequence[Effect],
        values: Values,
        near: Fitted | None = None,
        base: Hypothesis | None = None,
    ) -> Hypothesis:
        """Return a hypothesis fitted on all lines with the form free, from some values.

        Everything else begins where it is near there, with the form of a base, or else at its nominal value.
        """
        problem = _with_forces(self.problem, effects, values)
        way: dict[str, Any] = {}
        if near is not None and base is not None:
            from_near = replace(near.result, values={**self.form_of(base), **near.result.values})
            way = {"stages": problem.stages[-1:], "x_from": from_near}
        fitted = fit(problem, effects, values, n_lines=FULL_LINES, **way)
        return self.scattered(problem, Hypothesis(fitted, self.prior(effects)))

    def scattered(self, problem: AnyProblem, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis fitted on with the small deviations of its form, by their slopes there."""
        scatter = self.ranking.scatter(problem, h.fitted.result)
        whole: dict[str, Any] = {"stages": problem.stages[-1:], "x_from": h.fitted.result}
        problem, values = replace(problem, scatter=scatter), values_of(h.effects)
        return replace(h, fitted=fit(problem, h.effects, values, n_lines=FULL_LINES, **whole))

    def at(self, effects: Sequence[Effect], values: Values) -> Hypothesis:
        """Return a hypothesis from the better of fits that begin at some values, staged and not."""
        problem = _with_forces(self.problem, effects, values)
        ways = problem.stages, problem.stages[-1:]
        fits = [fit(problem, effects, values, stages=way, n_lines=FULL_LINES) for way in ways]
        best = Hypothesis(max(fits, key=lambda f: f.log_evidence), self.prior(effects))
        return self.scattered(problem, best)

    def on_own_basis(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis on a basis with its responses at some lines, where the search's is not good.

        Effects that act on a whole member converge slowly on modes without them.
        """
        for n_lines in BASIS_LINES if h.effects else ():
            problem = _with_forces(self.problem, h.effects, values_of(h.effects))
            better = self.ranking.basis_for(problem, h.fitted.result, n_lines, BASIS_SHARE)
            if better is None:
                break
            error, reduced = better
            self.problem = replace(self.problem, reduced=reduced)
            decibels = error * DB_PER_NEPER
            self.say(f"   basis errs by {decibels:.3f} dB: with responses at {n_lines} lines")
            self.known[h.key] = h = self.fitted(h.effects, values_of(h.effects), h.fitted, h)
        return h

    def polished(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis at the best of the maxima around it, as uncertain as they are apart.

        They are looked for from nominal parameters, and with the form fixed; of these those that are nearly
        as probable are fitted fully.

        Resonances that pass each other leave several maxima of the posterior. The covariance is that of the
        mixture of their normal approximations: Σ w (C + d dᵀ), with weights w by their evidence and distances
        d from the best one.
        """
        if not h.effects:
            return h
        quick = self.quick(h)
        fits = [h.fitted, self.at(h.effects, values_of(h.effects)).fitted]
        starts = self._around(h.effects)
        around = [self.quickly(quick, h, h.effects, start) for start in starts]
        here = self.quickly(quick, h, h.effects, values_of(h.effects))
        for a in around:
            if a.score > here.score - BEAM_NATS and _moved(a.fitted, here.fitted):
                fits.append(self.fitted(h.effects, values_of(a.effects), a.fitted, h).fitted)
        fits.sort(key=lambda f: -f.log_evidence)
        best = fits[0]
        # The scale of an unknown is that of its start: all are compared on the one of the best.
        values = [parameter_values(e) for e in best.effects]
        function = self.problem.function(best.effects, values, self.problem.lines_up_to(np.inf, FULL_LINES))
        scale = np.outer(function.units, function.units)
        apart: list[Maximum] = []
        for f in fits:
            m = Maximum(function.point_of(f.result), f.result.covariance / scale, f.log_evidence)
            if f.log_evidence > best.log_evidence - BEAM_NATS and all(m.distance(a) > 1.0 for a in apart):
                apart.append(m)
        x = apart[0].x
        weight = np.exp([m.log_evidence - best.log_evidence for m in apart])
        each = [m.covariance + np.outer(m.x - x, m.x - x) for m in apart]
        covariance = np.tensordot(weight / weight.sum(), np.stack(each), axes=1)
        result = function.result(replace(best.result.solution, x=x, covariance=covariance))
        self.known[h.key] = Hypothesis(replace(best, result=result), h.prior)
        return self.known[h.key]

    def _around(self, effects: Sequence[Effect], first: int = 0) -> Starts:
        """Return starts at the effects' values but for one positive parameter, some factors off."""
        values = values_of(effects)
        starts: Starts = []
        for k, e in list(enumerate(effects))[first:]:
            for p in e.parameters():
                for factor in AROUND if p.log else ():
                    moved = {p.name: float(np.clip(factor * p.value, p.lower, p.upper))}
                    starts.append((*values[:k], values[k] | moved, *values[k + 1 :]))
        return starts

    def prior(self, effects: Sequence[Effect]) -> float:
        """Return the logarithm of the prior probability of effects."""
        total = 0.0
        seen: set[str] = set()
        for e in effects:
            kind, name = place_of(e)
            total -= np.log(max(self._n_candidates[name], 1))
            if name not in seen:
                seen.add(name)
                total -= PLACE_ODDS + np.log(max(self._n_places[kind], 1))
        return float(total)

    def unknown(self, best: Hypothesis) -> float:
        """Return the score of an effect that the library does not have, and that explains the data."""
        left = self.ranking.left(self.problem)
        return best.score + best.fitted.gain_of(best.fitted.levels.noise + left) - UNKNOWN_ODDS
