"""The search: places by the scan, blocks and single laws there by evidence, then the simplest law."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fem.model import Effect, parameter_values
from updating.diagnosis.evidence.model import Fitted, Posterior, Scales, lines_for
from updating.diagnosis.evidence.places import Place, place_of, places_of
from updating.diagnosis.evidence.scan import Scan
from updating.diagnosis.screening import Grid, screen
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

QUICK_LINES = 60
"""Lines of the first fits."""
N_PLACES, N_PAIRS, N_SINGLES, N_FINAL = 8, 3, 10, 3
"""So many places, pairs of them and single effects of the scan are fitted; so many of these go on."""
MOST_EFFECTS = 6
"""A model has at most so many effects."""
PLACE_ODDS = np.log(10.0)
"""Prior odds, as a logarithm, against one more place at which something is missing."""
BLOCK_KINDS = ("joint_stiffness", "support_flexibility", "end_release")
"""Kinds that give way in single directions: all of a connection's together are its block."""
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A model with effects, fitted.

    Attributes
    ----------
    effects : tuple of Effect
    fitted : Fitted
    prior : float
        Logarithm of its prior probability, up to a constant.
    n_lines : int
    """

    effects: tuple[Effect, ...]
    fitted: Fitted
    prior: float
    n_lines: int

    @property
    def score(self) -> float:
        """Logarithm of its posterior probability, up to a constant."""
        return self.fitted.log_evidence + self.prior

    @property
    def key(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(e.name for e in self.effects)

    @property
    def name(self) -> str:
        """Effects in words."""
        return " + ".join(sorted(f"{e.kind} {e.where}" for e in self.effects)) or "nothing"


@dataclass(slots=True, eq=False)
class Search:
    """A search and all hypotheses that it has fitted.

    Attributes
    ----------
    problem : FitProblem
    candidates : tuple of Effect
    null : FitResult
        Fit of the uncertain parameters.
    """

    problem: FitProblem
    candidates: tuple[Effect, ...]
    null: FitResult
    say: Say = lambda text: None
    known: dict[tuple[frozenset[str], int], Hypothesis] = field(default_factory=dict)
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        self.places = places_of(self.problem, self.candidates)

    def run(self) -> Hypothesis:
        """Return the most probable hypothesis."""
        full = len(lines_for(self.problem))
        best = self.fitted((), [()], full)
        while len(best.effects) < MOST_EFFECTS:
            better = self.extended(best)
            if better is None or better.score <= best.score + 1.0:
                break
            best = self.simplified(better)
            self.say(f"=> {best.name}: {best.score:.1f}")
        return best

    def extended(self, base: Hypothesis) -> Hypothesis | None:
        """Return the best hypothesis with something more than another has."""
        full = len(lines_for(self.problem))
        proposals = self.proposals(base)
        quick: dict[frozenset[str], Hypothesis] = {}
        for effects, starts in proposals:
            both = (*base.fitted.result.effects, *effects)
            begun = [tuple(parameter_values(e) for e in base.fitted.result.effects)]
            all_starts = [(*begun[0], *s) for s in starts]
            h = self.fitted(both, all_starts, QUICK_LINES, base)
            quick[h.key] = h
            self.say(f"   {h.score:10.1f} {h.fitted.left_db:.2f} dB {h.name}")
        chosen = sorted(quick.values(), key=lambda h: -h.score)[:N_FINAL]
        finals = [self.refitted(h, full) for h in chosen]
        return max(finals, key=lambda h: h.score, default=None)

    def proposals(
        self, base: Hypothesis
    ) -> list[tuple[tuple[Effect, ...], list[tuple[dict[str, float], ...]]]]:
        """Return effects that may be added, and values to start from."""
        current = base.fitted.result
        ranked = Scan.of(self.problem, current).run(self.places)
        present = base.key
        fields = {r for e in base.effects for r in e.released()}

        def fits(effect: Effect) -> bool:
            return effect.name not in present and not fields & set(effect.released())

        singles = [s for s in ranked if len(s.places) == 1][:N_PLACES]
        self.say("scan: " + "; ".join(f"{s.name} {s.left:.3f}" for s in ranked[:6]))
        grids = {e.name: Grid.of(self.problem, c) for c in self.candidates for e in [c] if fits(c)}
        near = {e.name for s in singles for e in s.places[0].effects}
        listed = [g for n, g in grids.items() if n in near] if len(grids) > 200 else list(grids.values())
        screened = screen(self.problem, current, listed, False, lambda text, done: None)
        chosen = screened[:N_SINGLES]
        out: list[tuple[tuple[Effect, ...], list[tuple[dict[str, float], ...]]]] = []
        for s in chosen:
            out.append(((s.effect,), [(start,) for start in s.starts]))
        done: set[frozenset[str]] = {frozenset([s.effect.name]) for s in chosen}
        pairs = [s for s in ranked if len(s.places) == 2][:N_PAIRS]
        for scanned in (*singles, *pairs):
            block = [e for p in scanned.places for e in self.block(p) if fits(e)]
            key = frozenset(e.name for e in block)
            if len(block) > 1 and key not in done:
                done.add(key)
                out.append((tuple(block), self.block_starts(block)))
        return out

    def block(self, place: Place) -> tuple[Effect, ...]:
        """Return the effects of a connection that together let it give way in all its directions."""
        if place.kind not in ("joint", "support", "end"):
            return ()
        return tuple(e for e in place.effects if e.kind in BLOCK_KINDS)

    def block_starts(self, block: Sequence[Effect]) -> list[tuple[dict[str, float], ...]]:
        """Return starts from slight to large flexibility in all directions, by the effects' own grids."""
        grids = [e.starts(self.problem.surroundings) for e in block]
        out = []
        for share in (0.75, 0.5):
            out.append(tuple(g[min(int(share * len(g)), len(g) - 1)] for g in grids))
        return out

    def fitted(
        self,
        effects: Sequence[Effect],
        starts: Iterable[Sequence[dict[str, float]]],
        n_lines: int,
        base: Hypothesis | None = None,
    ) -> Hypothesis:
        """Return a hypothesis from the best of some starts."""
        key = (frozenset(e.name for e in effects), n_lines)
        if key in self.known:
            return self.known[key]
        problem = replace(self.problem, reduced=self.problem.reduced.with_forces_of(list(effects)))
        fits = []
        for s in starts:
            try:
                fits.append(
                    problem.fit(effects, list(s), n_lines=min(n_lines, 50), max_iterations=8, assess=False)
                )
            except (np.linalg.LinAlgError, AssertionError):
                continue
        best = min(fits, key=lambda r: r.solution.cost)
        if n_lines > QUICK_LINES:
            best = problem.refit(best, assess=False) if effects else self.null
        h = self._posterior(problem, best, n_lines, Scales())
        self.known[key] = h
        return h

    def refitted(self, h: Hypothesis, n_lines: int) -> Hypothesis:
        """Return a hypothesis on more lines, from where it is."""
        key = (h.key, n_lines)
        if key not in self.known:
            effects = h.fitted.result.effects
            problem = replace(self.problem, reduced=self.problem.reduced.with_forces_of(effects))
            again = problem.refit(h.fitted.result, assess=False)
            self.known[key] = self._posterior(problem, again, n_lines, h.fitted.scales)
        return self.known[key]

    def _posterior(self, problem: FitProblem, result: FitResult, n_lines: int, scales: Scales) -> Hypothesis:
        lines = problem.lines_up_to(np.inf, n_lines)
        post = Posterior.of(problem, result.effects, lines)
        x = np.array([v.to_x(result.values[v.ref]) for v in post.function.variables])
        fitted = post.fit(np.concatenate([x, np.log(result.zeta)]), scales)
        return Hypothesis(tuple(fitted.result.effects), fitted, self.prior(result.effects), n_lines)

    def prior(self, effects: Sequence[Effect]) -> float:
        """Return the logarithm of the prior probability of effects."""
        total = 0.0
        seen: set[str] = set()
        for e in effects:
            kind, name = place_of(e)
            alike = [c for c in self.candidates if place_of(c)[1] == name]
            total -= np.log(max(len(alike), 1))
            if name not in seen:
                seen.add(name)
                n = len({place_of(c)[1] for c in self.candidates if place_of(c)[0] == kind})
                total -= PLACE_ODDS + np.log(max(n, 1))
        return float(total)

    def simplified(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis without the effects whose absence raises its score, one after the other."""
        full = h.n_lines
        while h.effects:
            options = []
            for e in h.effects:
                rest = tuple(x for x in h.fitted.result.effects if x.name != e.name)
                key = frozenset(x.name for x in rest)
                if not rest and (key, full) in self.known:
                    options.append(self.known[key, full])
                    continue
                if (key, full) in self.known:
                    options.append(self.known[key, full])
                    continue
                quick = self.fitted(rest, [tuple(parameter_values(x) for x in rest)], QUICK_LINES, h)
                now = self.known.get((h.key, QUICK_LINES)) or self.fitted(
                    h.fitted.result.effects, [tuple(parameter_values(x) for x in h.effects)], QUICK_LINES
                )
                if quick.score > now.score - 5.0:
                    options.append(self.refitted(quick, full))
            better = max(options, key=lambda o: o.score, default=None)
            if better is None or better.score <= h.score:
                return h
            h = better
            self.say(f"   simpler: {h.score:.1f} {h.name}")
        return h
