"""From a model and measured FRFs to the effect that is missing."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.effects import candidate_kinds, effect_classes
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.effects.joint_patch import JointPatch, with_patch
from fem.effects.solid_corner import SolidCorner
from fem.model import Effect, Model, applicable
from fem.summary import listed, summary
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.acceptance import ACCEPT_HELD_OUT, ACCEPT_LEVEL, takes_energy
from updating.diagnosis.amplitude import combined_levels, deviation_at_level, force_levels, search_amplitude
from updating.diagnosis.bootstrap import Bootstrap, bootstrap
from updating.diagnosis.corners import Cornered, with_corners
from updating.diagnosis.findings import (
    Finding,
    Ranked,
    Step,
    at_values_of,
    labels,
    parameters_of,
    step_added,
    step_of,
)
from updating.diagnosis.patches import choose_patch, proposed_patch, refined_at, with_turning
from updating.diagnosis.search import (
    TWIN_SHARE,
    Floor,
    Progress,
    Search,
    between,
    change_of,
    search_effects,
    similarity_of,
)
from updating.diagnosis.separation import what_decides
from updating.inference.fit import EXPLAINED_LEVEL, FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_result import FitResult
from updating.inference.parameters import Nuisance
from updating.inference.preparation import (
    N_FIT_LINES,
    build_fine,
    build_problem,
    fitted_model,
    with_higher_mass,
)
from updating.measurement.measurement import Measurement, instruments_on
from updating.quality.faults import Fault, find_faults, settle_faults
from updating.quality.gates import Gates, check_gates, with_last_faults

NOTHING, EFFECT, FAULT, UNEXPLAINED = "nothing missing", "effect", "measurement fault", "unexplained"
if TYPE_CHECKING:
    from updating.diagnosis.evidence.diagnosis import Searched

FITTED = "uncertain parameters fitted"
"""Label of the step before effects."""
N_CHECKED = 6
"""Lines at which the reduced basis is checked in the end, unless the search has done so."""
MOST_CHOICES = 2
"""So many times the search is made again with joints' patches that fit better beside what was found."""
SAME_SIZE = 0.1
"""Sizes of joints' patches that differ by no more count as one where the search would be made again [-]."""
PATCHES_LEFT = 0.25
"""Beside patches an effect in a model that is right without it must leave less than this share of the level's
square [-]: beams leave more at a lap than elsewhere, which weak effects take up."""
BASIS_LIMIT_DB = 0.5
"""Error of the reduced basis from which the notes warn of it [dB]."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What is missing, and how sure that is.

    Attributes
    ----------
    verdict : str
        ``"nothing missing"``, ``"effect"``, ``"measurement fault"`` or ``"unexplained"``.
    reason : str
        Why, in a sentence.
    findings : tuple of Finding
    faults : tuple of Fault
    steps : tuple of Step
        From the nominal model over fitted nuisances to each added effect.
    rounds : tuple of tuple of Ranked
        For each round of the forward selection, the candidates that were fitted, best first.
    noise_db, discretisation_db, basis_db : float
        Noise of the measurement, error of the mesh, and error of the reduced basis [dB].
    limit : float
        Residual level up to which the model counts as right [nepers].
    noise_limit : float
        Residual level up to which noise and the mesh account for what is left [nepers].
    problem : FitProblem
        Data, reduced model, sensors: what is needed to compute the FRFs of any step.
    model : Model
        The full model with fitted parameters and found effects.
    notes : tuple of str
        What a reader should know.
    seconds : float
    gates : Gates or None
        What was checked of the measurement before effects were searched for.
    candidates : tuple of Effect
        All that were looked at.
    tried : tuple of Bootstrap
        The verdict against chance, if that was asked for: the effects that were tried so, in their order.
    posterior : tuple of (tuple of str, float)
        Names of the effects of each hypothesis, and its probability, the most probable first; the last is
        that of what the library does not have, under the name ``"unknown"``.
    places : tuple of (str, float)
        Places by the share of the misfit that free forces there leave, the best first [-].
    searched : Searched or None
        The search by evidence that led to it.
    """

    verdict: str
    reason: str
    findings: tuple[Finding, ...]
    faults: tuple[Fault, ...]
    steps: tuple[Step, ...]
    rounds: tuple[tuple[Ranked, ...], ...]
    noise_db: float
    discretisation_db: float
    basis_db: float
    limit: float
    noise_limit: float
    problem: FitProblem
    model: Model
    notes: tuple[str, ...]
    seconds: float
    gates: Gates | None = None
    candidates: tuple[Effect, ...] = ()
    tried: tuple[Bootstrap, ...] = ()
    posterior: tuple[tuple[tuple[str, ...], float], ...] = ()
    places: tuple[tuple[str, float], ...] = ()
    searched: "Searched | None" = None

    def __repr__(self) -> str:
        """Return verdict, reason and staircase of the error on one line."""
        steps = " → ".join(f"{s.fit_db:.2f}" for s in self.steps)
        found = listed(f.effect.name for f in self.findings)
        return summary(self, f"{self.verdict}: {self.reason}; found: {found}; error {steps} dB")

    @property
    def more_than_noise(self) -> bool:
        """Whether more is left than noise and the mesh account for: the form of beams, or weak effects."""
        return self.steps[-1].level > self.noise_limit

    @property
    def noise_floor_db(self) -> float:
        """Noise and the model's discretisation error together [dB]."""
        return float(np.hypot(self.noise_db, self.discretisation_db))

    def frf(self, step: int) -> FRF:
        """Return the FRFs of a step in the kind of the measurement."""
        return self.problem.frf(self.steps[step].result)

    def deviation(self, step: int) -> NDArray[np.float64] | None:
        """Return the standard deviation of the ln|H| that a step predicts; None for the nominal model."""
        result = self.steps[step].result
        if any(e.amplitude_dependent for e in result.effects):
            return deviation_at_level(self.problem, result)
        return self.problem.deviation(result)

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.problem.measured


def propose(
    model: Model,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    test: Measurement | None = None,
    *,
    levels: bool = False,
) -> tuple[Effect, ...]:
    """Return all candidates of some kinds (default: all that the program knows) for a model.

    With a measurement there are also those of its instruments: masses of sensors, stingers. Those that
    depend on amplitude come where there are several ``levels`` of force.

    Raises
    ------
    ValueError
        For a kind that does not exist.
    """
    known = candidate_kinds()
    for kind in (*(kinds or ()), *exclude):
        if kind not in known:
            msg = f"there is no candidate kind '{kind}'; allowed are {', '.join(known)}"
            raise ValueError(msg)
    classes = [effect_classes()[kind] for kind in (kinds or known) if kind not in exclude]
    classes = [cls for cls in classes if levels or not cls.amplitude_dependent]
    if test is None:
        return applicable((e for cls in classes for e in cls.propose(model)), model)
    instruments = instruments_on(model.mesh, test)
    return applicable((e for cls in classes for e in cls.propose_for_test(model, instruments)), model)


def diagnose(
    model: Model,
    measurements: Sequence[Measurement],
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
    n_simulated: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the physical effect that a model lacks.

    Nuisance parameters are fitted; sensors with a wrong sign or gain are set right; then every candidate
    effect is fitted from the nominal start together with the nuisances, the best is added if it pays, and the
    search is repeated with it.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor (:func:`updating.measurement.measurement.place_sensors`).
    measurements : sequence of Measurement
        The first is fitted; others, at other force levels, are checked for proportionality.
    nuisances : sequence of Nuisance
        What is known only roughly.
    damping_std : float
        Standard deviation of the logarithm of the damping ratio [-].
    band : (float, float), optional
        Frequencies that count [Hz].
    kinds : sequence of str, optional
        Kinds of candidates; all unless given.
    exclude : sequence of str
        Kinds to leave out.
    n_lines : int
        At most this many lines are fitted.
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left.
    n_simulated : int
        So many measurements are simulated by the fitted model without the effect that the data need least,
        and it is only believed if it gains more than the best candidate does in any of them; 19 make that
        5 % by chance. What a fit leaves in one of them counts as right. Not for what depends on amplitude.
    progress : callable, optional
        Called with a text and the fraction done.
    """
    begun = time.perf_counter()
    asked = _Asked(
        measurements, nuisances, damping_std, band, kinds, exclude, n_lines, model_error, n_simulated,
        progress or (lambda text, done: None),
    )  # fmt: skip
    model = with_higher_mass(model)
    known = next(iter(model.of_kind(JointPatch)), None)
    looked_for = JointPatch.kind in (kinds or candidate_kinds()) and JointPatch.kind not in exclude
    patch = known or (proposed_patch(JointPatch.propose(model), model) if looked_for else None)
    patch = patch if model_error > 0 else None
    if patch:
        model = refined_at(model, patch)
    found, used, other = _attempt(asked, model, patch, choose=patch is not known)
    for _ in range(MOST_CHOICES):
        if other is used:
            break
        again, used, other = _attempt(asked, model, patch, choose=other is not None, given=other)
        found = found if again.verdict == UNEXPLAINED else again
    return replace(found, seconds=time.perf_counter() - begun)


def begin(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
) -> FitProblem:
    """Return the problem that a diagnosis begins with: data, and a reduced model on a mesh fine enough.

    Parameters as of :func:`diagnose`. Its nominal model is that of the diagnosis, unless this looks for the
    extent of joints.
    """
    asked = _Asked(
        (measurement,), nuisances, damping_std, band, None, (), n_lines, model_error, 0,
        lambda text, done: None,
    )  # fmt: skip
    model = with_higher_mass(model)
    known = next(iter(model.of_kind(JointPatch)), None)
    model = refined_at(model, known) if known and model_error > 0 else model
    return build_fine(asked.build, model, model_error)[0]


def begin_fitted(problem: FitProblem) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Return a problem with faults of the measurement set right, its fit and these, as a diagnosis has them.

    The first step of a search: uncertain parameters are fitted, and every sensor is compared with the others.
    """
    return find_faults(problem, _fitted(problem))


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """What a diagnosis was asked for: the arguments of :func:`diagnose` but for the model."""

    measurements: Sequence[Measurement]
    nuisances: Sequence[Nuisance]
    damping_std: float
    band: tuple[float, float] | None
    kinds: Sequence[str] | None
    exclude: Sequence[str]
    n_lines: int
    model_error: float
    n_simulated: int
    progress: Progress

    @property
    def say(self) -> Progress:
        """Called with what the search does; the second half is left to simulations."""
        return between(self.progress, 0.0, 0.5) if self.n_simulated else self.progress

    def build(self, model: Model, nuisances: Sequence[Nuisance] | None = None) -> FitProblem:
        """Return the fits' problem of a model, with more uncertain parameters if these are given."""
        return build_problem(
            model, self.measurements[0],
            with_turning(self.nuisances if nuisances is None else nuisances, model),
            damping_std=self.damping_std, band=self.band, n_lines=self.n_lines, connections=True,
            model_error=self.model_error,
        )  # fmt: skip

    def candidates(self, model: Model) -> tuple[Effect, ...]:
        """Return a model's candidates but for joints' patches.

        They are no parameter of a fit, and are looked for first.
        """
        every = propose(model, self.kinds, self.exclude, self.measurements[0])
        return tuple(e for e in every if not (e.evidence_only or isinstance(e, JointPatch)))

    def amplitude_candidates(self, model: Model) -> tuple[AmplitudeDependent, ...]:
        """Return those that depend on amplitude."""
        every = propose(model, self.kinds, self.exclude, self.measurements[0], levels=True)
        return tuple(e for e in every if isinstance(e, AmplitudeDependent))


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """What is known before effects are searched for.

    Attributes
    ----------
    bare, plain : Model, FitProblem
        Without the joints' patches that this looked for itself; the problem has those that were given.
    model, problem : Model, FitProblem
        With them.
    used : JointPatch or None
        The patches in the model.
    candidates : tuple of Effect
    null : FitResult
        With the uncertain parameters fitted.
    steps : tuple of Step
        The nominal model, and that.
    faults : tuple of Fault
    mesh_db : float
        Error of the mesh [dB].
    floor : Floor
        What it and noise leave together, and how much more a model may leave.
    notes : tuple of str
    """

    bare: Model
    plain: FitProblem
    model: Model
    problem: FitProblem
    used: JointPatch | None
    candidates: tuple[Effect, ...]
    null: FitResult
    steps: tuple[Step, ...]
    faults: tuple[Fault, ...]
    mesh_db: float
    floor: Floor
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """What a search has led to.

    Attributes
    ----------
    search : Search
    null : FitResult
        With the uncertain parameters fitted, on the data as they are by now.
    faults : tuple of Fault
    cornered : Cornered or None
        Corners of finite size, if they stay.
    searched : tuple of Effect
        The candidates that were searched.
    other : JointPatch or None
        The joints' patches that the data ask for beside what was found.
    notes : tuple of str
    """

    search: Search
    null: FitResult
    faults: tuple[Fault, ...]
    cornered: Cornered | None
    searched: tuple[Effect, ...]
    other: JointPatch | None
    notes: tuple[str, ...] = ()


def _attempt(
    asked: _Asked, model: Model, patch: JointPatch | None, *, choose: bool, given: JointPatch | None = None
) -> tuple[Diagnosis, JointPatch | None, JointPatch | None]:
    """Return a diagnosis, the joints' patches with which it was made, and those that it speaks for.

    ``patch`` may be there, by a choice of the data if that is asked for; ``given`` is there at first.
    """
    start = _started(asked, model, patch if choose else None, given)
    gates = check_gates(start.problem, start.null, asked.measurements[1:], start.mesh_db, start.faults)
    levels = () if gates.linear else force_levels(start.problem, asked.measurements, start.faults)
    nonlinear = asked.amplitude_candidates(start.model) if levels else ()
    end = _searched(asked, start, patch, levels, nonlinear, choose=choose)
    found = _concluded(asked, start, end, gates, levels, nonlinear)
    used, other = start.used, end.other
    if patch and choose and found.verdict == UNEXPLAINED and gates.linear and other is used and not given:
        other = patch.with_values(size=1.0, twist=1.0)
    if used and other and used.twist == other.twist and abs(used.size - other.size) < SAME_SIZE:
        other = used
    return found, used, other


def _started(asked: _Asked, model: Model, patch: JointPatch | None, given: JointPatch | None) -> _Start:
    """Reduce the model on a mesh that is fine enough, set faults right, and choose joints' patches."""
    asked.say("reducing the model", 0.0)
    notes = list[str]()
    patched = partial(with_patch, patch=given) if given else lambda bare: bare
    problem, bare, n, left, before = build_fine(lambda m: asked.build(patched(m)), model, asked.model_error)
    mesh_db, mesh_level = left
    if n > 1:
        notes.append(
            f"each element was cut into {n}: the mesh's error was {before:.2g} dB, not small beside the "
            f"noise of {problem.data.noise_db:.2g} dB"
        )
    model = patched(bare)
    candidates = asked.candidates(model)
    data = problem.data
    level, floor_db = np.hypot([data.noise_level, data.noise_db], [mesh_level, mesh_db]).tolist()
    asked.say("fitting the uncertain parameters", 0.03)
    problem, null, faults = begin_fitted(problem)
    plain, used = problem, given
    if given:
        notes.append(_where_patched(given))
    elif patch:
        asked.say("looking for the extent of joints", 0.04)
        used = choose_patch(asked.build, model, patch, problem)
        if used:
            model = with_patch(model, used)
            built = asked.build(model)
            problem = replace(problem, reduced=built.reduced, nuisances=built.nuisances)
            candidates = asked.candidates(model) if used.twist else candidates
            before, null = null, _fitted(problem)
            notes.append(_where_patched(used, before, null))
    steps = step_of("nominal model", problem.nominal()), step_of(FITTED, null)
    return _Start(
        bare, plain, model, problem, used, candidates, null, steps, faults, mesh_db,
        Floor(level, floor_db, asked.model_error), tuple(notes),
    )  # fmt: skip


def _searched(
    asked: _Asked,
    start: _Start,
    patch: JointPatch | None,
    levels: tuple[FitData, ...],
    nonlinear: Sequence[AmplitudeDependent],
    *,
    choose: bool,
) -> _End:
    """Search for effects: beside corners of finite size, then without; and for what depends on amplitude."""
    say, floor, candidates = asked.say, start.floor, start.candidates
    problem, null, faults, steps = start.problem, start.null, start.faults, start.steps
    search, open_ = Search(problem, (), (), steps, null), candidates
    cornered = (
        with_corners(asked.build, start.model, candidates, problem, null)
        if floor.model_error > 0 and not levels
        else None
    )
    if nonlinear:
        alone = _amplitude_added(search, levels, nonlinear, between(say, 0.05, 0.2))
        search = alone if alone.current.level <= floor.limit else search
    if search.depends_on_amplitude:
        return _End(search, null, faults, cornered, open_, start.used)
    look = partial(search_effects, floor=floor, say=between(say, 0.05, 0.9))
    if cornered:
        open_ = tuple(e for e in candidates if not isinstance(e, SolidCorner))
        solid = look(cornered.begin(steps[0]), open_)
        cornered = cornered.kept(problem, solid.current)
        if cornered:
            search, problem, null = solid, cornered.problem, cornered.without(steps[1]).result
    if not cornered:
        open_ = candidates
        search = look(search, open_)
    if not search.explains(floor, null):
        # A sensor near a support with a wrong gain: it may be the support, but no effect explains it.
        anew, doubtful = _with_doubtful_faults(problem, null, search.steps, floor.limit)
        if doubtful:
            problem, faults = anew.problem, (*faults, *doubtful)
            null = problem.assessed(replace(null, level=np.nan)) if cornered else anew.current
            search = look(anew, open_)
    other, notes = start.used, ()
    if patch and search.findings and not cornered:
        if choose:
            say("looking for the extent of joints once more", 0.9)
            plain = replace(start.plain, data=problem.data)
            found = [f.effect for f in search.findings]
            twist = start.used.twist if start.used else 0.0
            other = choose_patch(asked.build, start.bare, patch, plain, found, twist)
        damped = len(search.findings) == 1 and takes_energy(
            search.problem, null, search.current, search.findings[0].effect
        )
        weak = search.current.level**2 > PATCHES_LEFT * null.level**2
        if null.level <= floor.limit and weak and not damped:
            notes = (_why_weak(search, null),)
            search = Search(problem, (), search.rounds[:1], steps, null)
    if nonlinear:
        search = _amplitude_added(search, levels, nonlinear, between(say, 0.9, 0.98))
    return _End(search, null, faults, cornered, open_, other, notes)


def _concluded(
    asked: _Asked,
    start: _Start,
    end: _End,
    gates: Gates,
    levels: tuple[FitData, ...],
    nonlinear: tuple[AmplitudeDependent, ...],
) -> Diagnosis:
    """Settle faults, weigh what was found against chance if that is asked for, and give the verdict."""
    asked.say("checking", 0.98)
    search, null, faults, cornered = end.search, end.null, end.faults, end.cornered
    notes = [*start.notes, *gates.notes]
    if not gates.linear and not levels:
        notes.append(
            "what depends on amplitude is searched for only where each measurement states its force_level, "
            "and two differ"
        )
    notes += end.notes
    floor, limit = start.floor, start.floor.limit
    depends = search.depends_on_amplitude
    if not depends:
        first, before = faults, search.problem.data
        search, faults = _with_faults_settled(search, faults, limit, bool(search.findings or cornered))
        gates = with_last_faults(gates, first, faults)
        if search.problem.data is not before:
            null = search.problem.assessed(replace(null, level=np.nan))
    tried: tuple[Bootstrap, ...] = ()
    if asked.n_simulated and not depends:
        later = between(asked.progress, 0.5, 1.0)
        search, tried = bootstrap(search, end.searched, floor.limits, asked.n_simulated, later)
        limit = max(limit, *tried[-1].levels)
        notes += [_why_dropped(each) for each in tried if each.effect and not each.believed]
    problem, current, findings, rounds, steps = (
        search.problem, search.current, search.findings, search.rounds, search.steps,
    )  # fmt: skip
    if cornered:
        findings, rounds = (cornered.finding(current), *findings), ((), *rounds)
        steps = (steps[0], step_of(FITTED, null), *steps[1:])
    basis_db = search.basis_error(N_CHECKED)
    if basis_db > BASIS_LIMIT_DB:
        notes.append(
            f"the reduced basis differs from the full model by {basis_db:.2g} dB at the checked lines: "
            "read weak findings with care"
        )
    verdict, reason = _verdict(null, current, floor, limit, findings, faults)
    if depends:
        before_all, after_all = (
            combined_levels(problem, levels, fit)[0] * DB_PER_NEPER for fit in (steps[-2].result, current)
        )
        reason += (
            f"; over the {len(levels)} force levels together from {before_all:.2g} to {after_all:.2g} dB"
        )
    elif not gates.linear:
        reason += "; the FRFs change with the level of force, and nothing that was tried explains it"
        verdict = UNEXPLAINED if verdict in (NOTHING, FAULT) else verdict
    if verdict != UNEXPLAINED and current.level > floor.noise and floor.model_error > 0:
        notes.append(
            f"{current.fit_db:.2g} dB are left, noise and the mesh account for "
            f"{np.hypot(problem.data.noise_db, start.mesh_db):.2g}: the form of beams may leave the rest "
            f"(model_error = {floor.model_error:g} neper), and so may weak effects; with model_error = 0 "
            "these are named, too"
        )
    drawn = start.model
    if verdict == UNEXPLAINED:
        findings, current, steps = (), steps[1].result, steps[:2]
    elif cornered:
        drawn = cornered.model
    return Diagnosis(
        verdict, reason, findings, faults, steps, rounds, problem.data.noise_db, start.mesh_db, basis_db,
        limit, floor.noise, problem, fitted_model(drawn, current), tuple(notes), 0.0,
        gates, (*start.candidates, *nonlinear), tried,
    )  # fmt: skip


def _fitted(problem: FitProblem) -> FitResult:
    """Return the best fit of the uncertain parameters: in few stages, in fine ones, and from even damping."""
    anew = problem.fit_anew()
    even = problem.refit(anew, problem.with_even_damping(anew), assess=False)
    return problem.assessed(min(anew, even, key=lambda r: r.solution.cost))


def _where_patched(patch: JointPatch, before: FitResult | None = None, after: FitResult | None = None) -> str:
    """Return where joints have patches and why: what was left without and with them, or what was found so."""
    short, long = (1e3 * length for length in patch.lengths())
    length = f"{short:.3g} mm" if long - short < 0.1 else f"{short:.3g} to {long:.3g} mm"
    why = "what is found explains the data so"
    if before and after:
        one, two = (f"{r.level * DB_PER_NEPER:.2g}" for r in (before, after))
        why = f"the data are more likely so ({two} dB are left in place of {one})"
    several = len(patch.joints) > 1
    turning = f", and turn{'' if several else 's'} about {'their normals' if several else 'its normal'}"
    return (
        f"{patch.where}: joined over {length} of the members, {patch.size:.2g} times their breadth, rather "
        f"than in a point{turning if patch.twist else ''}: {why}; all that follows has it"
    )


def _why_weak(search: Search, null: FitResult) -> str:
    """Return why an effect was not believed beside joints that are joined over an area."""
    names = labels(f.effect for f in search.findings)
    before, after = (f"{r.level * DB_PER_NEPER:.2g}" for r in (null, search.current))
    return (
        f"{names} would lower the residual level from {before} to {after} dB, and is not believed: beams "
        "leave as much where members lie on each other"
    )


def _why_dropped(tried: Bootstrap) -> str:
    """Return why an effect was dropped."""
    return (
        f"{tried.effect} was dropped: it lowers the residual level by a factor of {tried.gain:.3g}, and in "
        f"{tried.as_much} of {len(tried.gains)} simulated measurements without it some candidate does as much"
    )


def _amplitude_round(
    problem: FitProblem,
    levels: tuple[FitData, ...],
    current: FitResult,
    candidates: Sequence[AmplitudeDependent],
    say: Progress,
) -> tuple[Finding, FitResult, tuple[Ranked, ...]] | None:
    """Fit nonlinear joints to all force levels; None unless the best lowers the levels over all of them."""
    fits = search_amplitude(problem, levels, current, candidates, say)
    if not fits:
        return None
    without = combined_levels(problem, levels, current)
    best = fits[0]
    if not (without[0] > ACCEPT_LEVEL * best.level and without[1] > ACCEPT_HELD_OUT * best.held_out_level):
        return None
    shift = change_of(problem, best.result, current)
    ranked = tuple(
        Ranked(
            f.effect.name, f.effect.kind, f.effect.where, parameters_of(f.effect, f.result), f.level,
            f.result.fit_db, f.result.held_out_db,
            similarity_of(shift, change_of(problem, f.result, current)), True, without[0] / ACCEPT_LEVEL,
            f.result,
        )
        for f in fits
    )  # fmt: skip
    gain = np.log(without[0] / best.level)
    twins = tuple(r for r in ranked[1:] if np.log(without[0] / r.level) > TWIN_SHARE * gain)
    rival = next((r for r in ranked[1:] if r not in twins), None)
    against = rival or (twins[0] if twins else None)
    decisive = what_decides(problem, best.result, against.result) if against else ()
    return Finding(best.effect, ranked[0].parameters, twins, rival, decisive), best.result, ranked


def _amplitude_added(
    search: Search,
    levels: tuple[FitData, ...],
    candidates: Sequence[AmplitudeDependent],
    say: Progress,
) -> Search:
    """Return a search with a nonlinear joint beside the effects that it has found; as it is, if none pays."""
    found = _amplitude_round(search.problem, levels, search.current, candidates, say)
    if found is None:
        return search
    finding, current, ranked = found
    linear = at_values_of(current, search.findings)
    n = len(linear)
    return replace(
        search,
        findings=(*linear, finding),
        rounds=(*search.rounds[:n], ranked, *search.rounds[n:]),
        steps=(*search.steps, step_added([finding.effect], current)),
        current=current,
    )


def _with_doubtful_faults(
    problem: FitProblem, null: FitResult, steps: Sequence[Step], limit: float
) -> tuple[Search, tuple[Fault, ...]]:
    """Return a search to begin with where faults are set right that a support may look like, and these.

    None of them unless the model is right then.
    """
    mended, fit, faults = find_faults(problem, null, doubtful=True)
    begin = Search(mended, (), (), (steps[0], step_of(steps[1].label, fit)), fit)
    return begin, faults if fit.level <= limit else ()


def _with_faults_settled(
    search: Search, faults: tuple[Fault, ...], limit: float, changed: bool
) -> tuple[Search, tuple[Fault, ...]]:
    """Look for faults once more where the physics is right, and withdraw those that it has explained.

    ``changed`` tells whether it has become so since they were looked for.
    """
    problem, current, findings, steps = search.problem, search.current, search.findings, search.steps
    if changed and current.level < limit:  # small faults show only there
        problem, current, late = find_faults(problem, current)
        if late:
            faults = (*faults, *late)
            steps = (*steps[:-1], step_of(steps[-1].label, current))
    if faults:
        problem, current, faults = settle_faults(problem, current, faults)
        before = [step_of(s.label, problem.assessed(replace(s.result, level=np.nan))) for s in steps[:-1]]
        steps = (*before, step_of(steps[-1].label, current))
    findings = tuple(at_values_of(current, findings))
    return replace(search, problem=problem, current=current, findings=findings, steps=steps), faults


def _verdict(
    null: FitResult,
    current: FitResult,
    floor: Floor,
    limit: float,
    findings: Sequence[Finding],
    faults: Sequence[Fault],
) -> tuple[str, str]:
    """Return the verdict and why; ``limit`` is the level up to which a model counts as right [nepers]."""
    believed = not findings or floor.believes(current, null)
    level, before = (f"{r.level * DB_PER_NEPER:.2g}" for r in (current, null))
    right = believed and current.level <= limit
    if findings:
        names, lower = labels(f.effect for f in findings), "lower" if len(findings) > 1 else "lowers"
        off = next((abs(f.strain) for f in findings if f.strain), 0.0)
        if right and off:
            strained = (
                f"the fit needs the uncertain value in its place {off:.2g} standard deviations off nominal"
            )
            return EFFECT, f"without {names} {strained}"
        if right and level == before:
            likely = f"the data are more likely with {names}"
            return EFFECT, f"{likely}, though the residual level stays at {level} dB"
        if right:
            return EFFECT, f"{names} {lower} the residual level from {before} to {level} dB"
        left = f"the {level} dB that are left are more than a right model leaves"
        if believed:
            return EFFECT, f"{names} {lower} the residual level from {before} to {level} dB; {left}"
        if current.level <= floor.believed(null):
            left = (
                f"at some lines more is left than a right model leaves, {current.audible_db:.2g} dB as root "
                f"mean square where noise and the mesh leave {floor.db:.2g}"
            )
        return (
            UNEXPLAINED,
            f"the best of the candidates, {names}, {lower} the residual level from {before} to {level} dB; "
            f"{left}",
        )
    if right:
        if faults:
            return (
                FAULT,
                f"with {len(faults)} fault(s) of the measurement set right nothing improves the model "
                f"further; residual level {level} dB",
            )
        return NOTHING, f"no candidate improves the fitted model, whose residual level is {level} dB"
    return (
        UNEXPLAINED,
        f"the residual level stays at {level} dB, and none of the candidates lowers it enough",
    )
