"""When one more effect pays: by how much the levels must fall, and what candidates are ranked by.

The thresholds were set on cases with nothing hidden; `docs/finding-effects.md` says which.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fem.model import Effect, Parameter
from updating.diagnosis.findings import Ranked, parameters_of
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

STEP_LEVEL = 1.08
"""While much is unexplained an effect is tried with others if both levels fall by more than this factor."""
ACCEPT_LEVEL = 1.25
"""An effect stays only if without it the residual level is higher by more than this factor."""
ACCEPT_HELD_OUT = 1.15
"""An effect stays only if without it the level on lines that no fit has seen is higher by more than this.

In cases with nothing hidden the best of all candidates gains a few per cent.
"""
ACCEPT_SETTLED = 1.5
"""Where the model counts as right already, both levels must fall by more than this factor."""
ACCEPT_BESIDE = 2.0
"""Where beams may err and the model is right with other effects, the level on fitted lines must fall by more
than this factor: what beams leave beside an effect looks like a weak one."""
FIRM = 5.0
"""Or by ``ACCEPT_SETTLED``, if its first parameter lies so many standard deviations from its absence."""
ACCEPT_DAMPING = 30.0
"""Where beams may err and the model is settled, what takes energy and does nothing else counts if both levels
fall and the score of the fitted lines and that of the others fall by more than this together: beams err in
stiffness and mass, and leave no such forces."""
ACCEPT_TO_NOISE, ACCEPT_TO_NOISE_FIRMLY = 1.1, 1.25
"""Or, where no more is left with it than noise and the mesh leave, that over all lines together by more than
the first, and none of the two rises; by the second if it stands beside others or also damps. What beams leave
of a structure no effect takes away to the last."""
ACCEPT_GAIN, ACCEPT_GAIN_SHARE, ACCEPT_GAIN_HELD_OUT = 30.0, 0.1, 0.95
"""Or, of one alone, the score of the fitted lines must fall by more than the first and by more than the
second share of the independent data, and the level on held-out lines by more than the third factor: what acts
in a part of the band, as a soft spring to the ground, lowers the level there."""
PLAIN_LEVEL, PLAIN_HELD_OUT = 2.0, 0.9
"""Where the form is right and the level falls by more than the first factor, that on held-out lines need only
fall by more than the second, that is, not rise by more than chance can do."""
ACCEPT_WEAK, ACCEPT_WEAK_HELD_OUT = 1.02, 0.95
"""Where the caller says, besides, that the form is right, weak effects count: the factor over all lines
together, and that on held-out lines."""
ACCEPT_WEAK_BESIDE = 1.05
"""The first factor for one beside other effects, which may be a little otherwise than they are modelled."""
ACCEPT_WEAK_DAMPING, ACCEPT_WEAK_DAMPING_BESIDE = 1.05, 1.12
"""Both factors for an effect that also damps, alone and beside others, and that on the fitted lines by
themselves, as the curve of modal damping is no exact model; for gyroscopic forces the second number is the
factor for all lines together, and the first that on held-out lines."""
ACCEPT_WEAK_DAMPED = 6.0
"""Or, for one alone, the gain of the score on fitted and on other lines together beyond its parameters, if
neither level rises and none that makes modes complex has a lower score."""
LOSS_ALIKE = 0.2
"""Where the form is right and nothing stands beside it, a loss factor of less than this share of all damping
is no effect: members and joints are damped alike to a tenth at best."""
CERTAIN = 3.0
"""Where the model is settled, an effect is none if its first parameter lies within so many standard
deviations of its absence, unless the level falls with it by more than ``ACCEPT_LEVEL``."""
CERTAIN_GAIN = 12.0
"""Or, where the form is right, unless the score on fitted and on other lines gains more than this with it."""
STRAINED = 3.0
"""An uncertain parameter is what the model says up to so many prior standard deviations from it, and an
effect that sets it within these is none; beyond them it is an effect, where the model's form is right."""
DAMPING_MARGIN = 1.03
"""Of two candidates, the level of one that also damps counts as so much higher."""


class Limits(NamedTuple):
    """Levels of residuals [nepers].

    Attributes
    ----------
    settled : float
        From which on only weak effects are looked for.
    weak : float
        From which these count, each by its own evidence; 0 unless the model's form is right.
    noise : float
        Up to which noise and the mesh account for what is left.
    """

    settled: float
    weak: float = 0.0
    noise: float = 0.0


class Factors(NamedTuple):
    """By how much levels must fall with an effect.

    Attributes
    ----------
    level : float
        On fitted lines or, where the form is right, on all lines together.
    held_out : float
        On held-out lines.
    fitted : float
        On fitted lines by themselves.
    """

    level: float
    held_out: float
    fitted: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """When one more effect pays.

    Attributes
    ----------
    problem : FitProblem
    limit : float
        Level from which on the model is settled, that is right but for noise [nepers].
    settled : bool
        Whether it was so when the round began.
    before : FitResult
        The model without it.
    noise : float
        Level up to which noise and the mesh account for what is left [nepers].
    """

    problem: FitProblem
    limit: float
    settled: bool
    before: FitResult
    noise: float = 0.0

    def factors(self, after: FitResult) -> Factors:
        """Return by how much the levels must fall with the last effect of a fit."""
        beside, last = bool(self.before.effects), after.effects[-1]
        if not self.settled:
            return Factors(STEP_LEVEL, STEP_LEVEL)
        if not self.problem.form_right:
            more = beside and not is_firm(after, last)
            return Factors(ACCEPT_BESIDE if more else ACCEPT_SETTLED, ACCEPT_SETTLED)
        return weak_factors(self.problem, last, beside=beside)

    def pays(self, after: FitResult, *, best: bool = True) -> bool:
        """Whether a fit with one more effect is enough better than that without.

        And not within tolerance nor, where the model is settled, within ``CERTAIN`` deviations of nothing.
        ``best`` is whether no other candidate has a lower score, where the form is right none that makes
        modes complex, which :func:`takes_energy` asks for.
        """
        alone, last = not self.before.effects, after.effects[-1]
        form_right = self.problem.form_right
        if self.tolerates(after) or known_already(self.problem, after, last.name):
            return False
        if best and self.settled and takes_energy(self.problem, self.before, after, last):
            return True
        if self.settled and not stands_out(self.problem, self.before, after, last.name):
            return False
        if not form_right and not spread_is_certain(after, last):
            return False
        if alone and not (self.settled and form_right) and gains(self.problem, self.before, after):
            return True
        if self.settled and ends_in_noise(self.problem, self.before, after, last, self.noise):
            return True
        return falls(self.before, after, self.factors(after), form_right)

    def tolerates(self, after: FitResult) -> bool:
        """Whether the last effect of a fit is but a loss factor within the tolerance of damping."""
        share = LOSS_ALIKE if self.problem.form_right and not self.before.effects else None
        return within_tolerance(self.problem, after, after.effects[-1].name, share)

    def ranked(self, fit: FitResult, similarity: float, refined: bool) -> Ranked:
        """Return a candidate's fit as an entry of the ranking."""
        effect = fit.effects[-1]
        return Ranked(
            effect.name, effect.kind, effect.where, parameters_of(effect, fit), fit.level, fit.fit_db,
            fit.held_out_db, similarity, refined, self.before.level / self.factors(fit).level, fit,
        )  # fmt: skip


def score(problem: FitProblem, fit: FitResult, n_last: int = 1) -> float:
    """Return what candidates are ranked by: :func:`fitted_score`, and the lines that no fit has seen.

    These count as those of the fit do: what only bends to what a model cannot do at some lines is wrong at
    others. Where beams may err an effect's ``spread`` must be ``CERTAIN`` to be named in place of the simpler
    effect, by the ratio of likelihoods: it counts CERTAIN² / 2 and not 1.
    """
    out = fitted_score(problem, fit, n_last) + fit.unseen
    if problem.form_right:
        return out
    spread = sum(bool(effect.spread) for effect in fit.effects[len(fit.effects) - n_last :])
    return out + spread * (CERTAIN**2 / 2 - 1)


def fitted_score(problem: FitProblem, fit: FitResult, n_last: int = 1) -> float:
    """Return the negative log posterior of a fit + k / c.

    Akaike's criterion (IEEE Trans. Autom. Control 19, 1974) with k parameters of the last effects, so that
    one with more must earn them, by data of which noise makes ``noise_counted`` c times as many independent
    ones as the posterior counts. The posterior is what was minimised: each band has an error level of its
    own, so that one that no model reaches says little, and an uncertain parameter far from its nominal value
    counts against a candidate that asks for it. The level of an effect that also damps counts
    ``DAMPING_MARGIN`` times.
    """
    last = fit.effects[len(fit.effects) - n_last :]
    damping = any(damps(problem, effect) for effect in last)
    margin = problem.n_independent() * np.log(DAMPING_MARGIN) if damping else 0.0
    return float(fit.solution.cost + margin + sum(len(e.parameters()) for e in last) / problem.noise_counted)


def gains(problem: FitProblem, before: FitResult, after: FitResult) -> bool:
    """Whether the only effect lowers the score of the fitted lines as ``ACCEPT_GAIN`` asks.

    And held-out lines allow it. One that also damps must take ``ACCEPT_GAIN_SHARE`` more.
    """
    gain = fitted_score(problem, before, 0) - fitted_score(problem, after)
    share = ACCEPT_GAIN_SHARE * problem.n_independent()
    least = max(ACCEPT_GAIN, share) + (share if damps(problem, after.effects[-1]) else 0.0)
    return gain > least and before.held_out_level > ACCEPT_GAIN_HELD_OUT * after.held_out_level


def ends_in_noise(
    problem: FitProblem, without: FitResult, fit: FitResult, effect: Effect, noise: float
) -> bool:
    """Whether an effect takes a model of which beams leave more than noise down to the level of noise."""
    firmly = len(fit.effects) > 1 or damps(problem, effect)
    factor = ACCEPT_TO_NOISE_FIRMLY if firmly else ACCEPT_TO_NOISE
    lower = whole_level(without) > factor * whole_level(fit)
    return fit.level <= noise and lower and _neither_rises(without, fit)


def takes_energy(problem: FitProblem, without: FitResult, fit: FitResult, effect: Effect) -> bool:
    """Whether an effect takes energy, and the data ask for it by their likelihood and not by the level alone.

    Where beams may err it must do nothing else, and gain ``ACCEPT_DAMPING``. Where the form is right one that
    stands alone needs ``ACCEPT_WEAK_DAMPED``, but must be certain.
    """
    if problem.form_right:
        asked = ACCEPT_WEAK_DAMPED + len(effect.parameters()) / problem.noise_counted
        alone = len(fit.effects) == 1 and damps(problem, effect)
        fits = alone and stands_out(problem, without, fit, effect.name)
    else:
        asked, fits = ACCEPT_DAMPING, dissipates(problem, effect)
    return fits and _evidence(without, fit) > asked and _neither_rises(without, fit)


def _evidence(without: FitResult, fit: FitResult) -> float:
    """Return the gain of the log posterior with an effect, and of the lines that no fit has seen."""
    return without.solution.cost + without.unseen - fit.solution.cost - fit.unseen


def _neither_rises(without: FitResult, fit: FitResult) -> bool:
    """Whether the levels of fitted and of held-out lines are lower with an effect."""
    return fit.level < without.level and fit.held_out_level < without.held_out_level


def spread_is_certain(fit: FitResult, effect: Effect) -> bool:
    """Whether the parameter that tells an effect from a simpler one is ``CERTAIN`` deviations from 0.

    As the fit knows it: the ratio of likelihoods is that of an error model, which may be too sure. True of
    effects that have no such parameter.
    """
    p = next((p for p in effect.parameters() if p.name == effect.spread), None)
    return p is None or abs(p.value) > CERTAIN * fit.std[effect.name, p.name]


def damps(problem: FitProblem, effect: Effect) -> bool:
    """Whether a parameter of an effect changes damping alone, or a law of stiffness and damping."""
    return any(_damps(problem, effect, p) for p in effect.parameters())


def makes_complex(problem: FitProblem, effect: Effect) -> bool:
    """Whether an effect does as uneven damping does: it damps, or adds gyroscopic forces alone."""
    return any(_damps(problem, effect, p) or _is_gyroscopic(problem, effect, p) for p in effect.parameters())


def is_loss_factor(effect: Effect) -> bool:
    """Whether an effect is but a loss factor, which the tolerance of damping may allow for."""
    return [p.name for p in effect.parameters()] == ["loss_factor"]


def dissipates(problem: FitProblem, effect: Effect) -> bool:
    """Whether all parameters of an effect change damping alone."""
    changed = [_changed(problem, effect, p) for p in effect.parameters()]
    return all(keys and keys <= {"C", "D"} for keys in changed)


def weak_factors(problem: FitProblem, effect: Effect, *, beside: bool) -> Factors:
    """Return the factors by which the levels must fall with a weak effect, alone or beside others."""
    if damps(problem, effect):
        damping = ACCEPT_WEAK_DAMPING_BESIDE if beside else ACCEPT_WEAK_DAMPING
        return Factors(damping, damping, damping)
    if makes_complex(problem, effect):
        return Factors(ACCEPT_WEAK_DAMPING_BESIDE, ACCEPT_WEAK_DAMPING)
    return Factors(ACCEPT_WEAK_BESIDE if beside else ACCEPT_WEAK, ACCEPT_WEAK_HELD_OUT)


def within_tolerance(problem: FitProblem, fit: FitResult, name: str, share: float | None = None) -> bool:
    """Whether an effect of a fit is but a loss factor that the tolerance of damping allows for, or a share.

    Members and joints are not damped alike to a tenth of their damping; that is no effect that a model lacks.
    """
    curve, effect = problem.damping, next(e for e in fit.effects if e.name == name)
    if not is_loss_factor(effect):
        return False
    (p,) = effect.parameters()
    mean = float(np.exp(np.log(fit.zeta[: len(curve.knots)]).mean()))
    return abs(p.value) < (curve.std if share is None else share) * 2 * mean


def known_already(problem: FitProblem, fit: FitResult, name: str) -> bool:
    """Whether an effect but sets uncertain parameters within ``STRAINED`` deviations of their nominal values.

    Such as the stiffness of a joint whose tolerance the caller gives: free of it, it fits a little better. Of
    several joints that are set alike the root of the sum of squares counts.
    """
    effect = next(e for e in fit.effects if e.name == name)
    own, replaced = effect.parameters(), effect.replaces()
    if len(own) != 1 or not replaced:
        return False
    strains = problem.strains(replace(fit, values=dict.fromkeys(replaced, own[0].value)))
    return len(strains) == len(replaced) and bool(np.linalg.norm(list(strains.values())) <= STRAINED)


def stands_out(problem: FitProblem, without: FitResult, fit: FitResult, name: str) -> bool:
    """Whether the first parameter of an effect is ``CERTAIN`` standard deviations from where it is absent.

    Of the logarithm where it is fitted in it and that of absence is finite; a value that would have to be
    infinite must be so many deviations above 0. Of several parameters one may be uncertain because another
    is, as a mass near a support with its position: it counts how well it is known where these are. What
    lowers the level by more than ``ACCEPT_LEVEL`` passes: a support that is loose, or a contact that is
    rigid, may be uncertain by any factor. So does, where the form is right, what gains ``CERTAIN_GAIN``:
    deviations are those of a linear law, and far from absence they say less than the likelihoods do.
    """
    if problem.form_right and _evidence(without, fit) > CERTAIN_GAIN:
        return True
    effect = next(e for e in fit.effects if e.name == name)
    p = effect.parameters()[0]
    std = fit.std[name, p.name] * _own_share(fit, effect)
    if not std > 0 or without.level > ACCEPT_LEVEL * fit.level:
        return True
    # Next to nothing is uncertain by any factor, and yet so much less than what would be its absence.
    factor = p.log and 0 < p.absent < np.inf
    next_to_nothing = factor and std > p.value and p.absent - p.value > CERTAIN * std
    return bool(next_to_nothing) or _lies_off(p, std, CERTAIN)


def is_firm(fit: FitResult, effect: Effect) -> bool:
    """Whether the first parameter of an effect lies ``FIRM`` standard deviations from where it is absent."""
    p = effect.parameters()[0]
    return _lies_off(p, fit.std[effect.name, p.name], FIRM)


def _lies_off(p: Parameter, std: float, n_std: float) -> bool:
    """Whether a parameter lies more than so many standard deviations from where its effect is absent."""
    if p.log and 0 < p.absent < np.inf:
        return bool(abs(np.log(p.value / p.absent)) > n_std * np.arcsinh(std / p.value))
    distance = p.value if np.isinf(p.absent) else abs(p.value - p.absent)
    return bool(distance > n_std * std)


def _own_share(fit: FitResult, effect: Effect) -> float:
    """Return what share of the first parameter's deviation is left where the effect's others are known."""
    own = [(effect.name, p.name) for p in effect.parameters()]
    if len(own) == 1:
        return 1.0
    places = [list(fit.values).index(ref) for ref in own]
    C = fit.covariance[np.ix_(places, places)]
    known = C.diagonal() > 0  # others are at a bound
    if not known[0]:
        return 1.0
    std = np.sqrt(C.diagonal()[known])
    correlation = C[np.ix_(known, known)] / np.outer(std, std)
    return float(1 / np.sqrt(max(np.linalg.pinv(correlation, hermitian=True)[0, 0], 1.0)))


def _damps(problem: FitProblem, effect: Effect, p: Parameter) -> bool:
    """Whether a parameter changes damping alone, or a law of stiffness and damping."""
    changed = _changed(problem, effect, p)
    return "law" in changed or (bool(changed) and changed <= {"C", "D"})


def _is_gyroscopic(problem: FitProblem, effect: Effect, p: Parameter) -> bool:
    """Whether a parameter changes gyroscopic forces alone, which take no energy.

    They make modes complex, as damping does that is not in proportion to stiffness.
    """
    return _changed(problem, effect, p) == {"skew C"}


def _changed(problem: FitProblem, effect: Effect, p: Parameter) -> set[str]:
    """Return which matrices a parameter changes: K, M, D, C or skew C, or a law."""
    term = problem.reduced.derivative_of(effect, p.name, p.value)
    out = {key for key in "KMCD" if (X := getattr(term, key)) is not None and X.any()}
    if term.C is not None and "C" in out and np.abs(term.C + term.C.T).max() <= 1e-9 * np.abs(term.C).max():
        out = (out - {"C"}) | {"skew C"}
    return out | ({"law"} if term.laws else set())


def falls(before: FitResult, after: FitResult, factors: Factors, form_right: bool = False) -> bool:
    """Whether the levels fall by more than factors.

    Where the model's form is right the first counts for all lines together, as chance gains little there,
    and held-out lines need only fall by ``PLAIN_HELD_OUT`` if the fitted ones fall by ``PLAIN_LEVEL``: a
    narrow resonance may lie between them.
    """
    held_out = factors.held_out
    if form_right:
        lower = whole_level(before) > factors.level * whole_level(after)
        if before.level > max(PLAIN_LEVEL, factors.level) * after.level:
            held_out = PLAIN_HELD_OUT
    else:
        lower = before.level > factors.level * after.level
    by_themselves = before.level > factors.fitted * after.level
    return lower and by_themselves and before.held_out_level > held_out * after.held_out_level


def whole_level(fit: FitResult) -> float:
    """Return the level over fitted and held-out lines, of which there are a third as many."""
    return float(np.sqrt(0.75 * fit.level**2 + 0.25 * fit.held_out_level**2))
