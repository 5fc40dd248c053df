"""From a model and measured FRFs to the effect that is missing."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.effects import candidate_kinds, effect_classes
from fem.effects.joint import Joint, PointPair
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.frf import FRF
from fem.model import Effect, Model, Parameter, parameter_values
from fem.reduced import ParametricFRF, ReducedModel, reduce_model, values_of
from fem.solvers import factorise
from fem.system import assemble, connection_stiffness
from updating.amplitude import combined_levels, force_levels, search_amplitude
from updating.correlation import DB_PER_NEPER, log_ratio, rms_db
from updating.faults import Fault, find_faults, settle_faults
from updating.fit import (
    LEVEL_FLOOR,
    NOISE_LIMIT,
    FitData,
    FitProblem,
    FitResult,
    prepare,
    sensor_vectors,
)
from updating.gates import Gates, check_gates, with_last_faults
from updating.measurement import Measurement, MeasurementError, instruments_on, with_sensor_masses
from updating.parameters import DampingCurve, Nuisance
from updating.screening import N_BEST, N_BEST_DEEP, Grid, rivals, screen
from updating.separation import Decisive, Proposal, next_measurements, what_decides

NOTHING, EFFECT, FAULT, UNEXPLAINED = "nothing missing", "effect", "measurement fault", "unexplained"

STEP_LEVEL = 1.08
"""While much is unexplained an effect is tried with others if both levels fall by more than this factor."""
ACCEPT_LEVEL = 1.25
"""An effect stays only if without it the residual level is higher by more than this factor."""
ACCEPT_HELD_OUT = 1.15
"""An effect stays only if without it the level on lines that no fit has seen is higher by more than this.

In cases with nothing hidden the best of all candidates gains a few per cent.
"""
EXPLAINED_LEVEL = 0.3
"""Residual level up to which a model of beams counts as right, unless the caller says otherwise [nepers]."""
RIGHT_MARGIN = 1.25
"""A model counts as right up to this multiple of the level that noise and the mesh leave."""
FLOOR_MARGIN = 2.5
"""Up to this multiple of it, little enough is left for a search of weak effects."""
ACCEPT_SETTLED = 1.5
"""Where the model counts as right already, both levels must fall by more than this factor."""
PLAIN_LEVEL, PLAIN_HELD_OUT = 2.0, 0.9
"""Where the form is right and the level falls by more than the first factor, that on held-out lines need only
fall by more than the second, that is, not rise by more than chance can do."""
ACCEPT_WEAK, ACCEPT_WEAK_HELD_OUT = 1.02, 0.95
"""Where the caller says, besides, that the form is right, weak effects count: the factor over all lines
together, and that on held-out lines."""
ACCEPT_WEAK_BESIDE = 1.05
"""The first factor for one beside other effects, which may be a little otherwise than they are modelled."""
ACCEPT_WEAK_DAMPING = 1.12
"""Both factors there for an effect that also damps, as the curve of modal damping is no exact model."""
DAMPING_MARGIN = 1.1
"""Of two candidates, the level of one that also damps counts as so much higher."""
MOST_LEFT = 0.5
"""Effects that leave more than a right model are believed if they bring the level's square below this share.

Not where the caller says that the model's form is right.
"""
TWIN_SHARE = 0.9
"""A candidate that brings more than this share of the best one's reduction of ln level is its twin."""
MODE_MARGIN = 2.5
"""The reduced basis holds the modes up to this multiple of the highest frequency."""
MESH_SHARE = 0.1
"""Elements are cut where the level that the mesh leaves is more than this share of the noise's."""
MOST_SPLITS = 4
"""Into so many at most."""
NOMINAL_RATIO = 5e-3
"""Damping ratio of a model that has none [-]."""
N_LINES = 160
"""At most this many lines are fitted."""
FINALS_SETTLED = 3
"""So many are fitted fully where the model is right already."""
N_RIVALS = 4
"""So many candidates at the place of an accepted one are fitted from where its fit ended."""
SAME_PLACE = 0.1
"""Places no farther apart than this share of the structure's size count as one there."""
SAME_MEMBER = 0.5
"""Nor may they be farther apart than this share of the longest member's length."""
N_LINES_WEAK = 480
"""So many where weak effects are looked for: few lines see a narrow resonance or its absence."""
LEAST_LINES = 10
"""Data of fewer lines are not compared: blocks of them are held out and compared with one another."""
FIRST_STAGE, STAGE_GROWTH, STAGE_LINES = 2, 1.5, 20
"""A fit in fine stages begins with so many modes, takes so many times more from stage to stage, and has so
many lines at least."""
N_FINE = 2
"""So many of the best candidates are fitted in fine stages as long as much is unexplained."""
QUICK_LINES = 50
"""Lines of a quick fit."""
QUICK_REACH = 3.0
"""Candidates whose first one ends above so many times the best have no second."""
MOST_REFINED = 6
"""At most this many candidates are fitted fully in a round."""
MAX_EFFECTS = 3
"""At most this many effects are added."""
MOST_SEPARATED = 3
"""For so many twins the next measurement is worked out."""
N_BRANCHES = 2
"""So many other candidates of the first round are searched on from before what is left is unexplained."""
OTHERWISE = 0.9
"""Those whose similarity to the best is below this."""
AS_GOOD_ALONE = 1.2
"""One effect is preferred to several if its level is no more than this factor above theirs."""
AS_GOOD = 3.0
"""Optima whose negative log posterior is no more than this above the best count as possible values."""
BASIS_SHARE = 0.03
"""Error of the reduced basis, in parts of the residual level, above which the found model's modes join it."""
BASIS_REACH = (1.2, 2.0)
"""They are taken up to these multiples of the highest frequency, one after the other if need be."""
BASIS_LINES = 12
"""Lines at which that error is checked."""
BASIS_LIMIT_DB = 0.5
"""Error of the reduced basis from which the notes warn of it [dB]."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A parameter of a found effect: value and standard deviation in ``unit``."""

    name: str
    value: float
    unit: str
    std: float


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A candidate and how well it does.

    Attributes
    ----------
    name, kind, where : str
        The effect's.
    parameters : tuple of EffectParameter
    level : float
        Robust residual level with it [nepers].
    fit_db, held_out_db : float
        Error with it [dB].
    similarity : float
        Correlation of what it does to the FRFs with what the best candidate does [-].
    refined : bool
        False if only the quick screening fit was made.
    asked : float
        Level that it had to reach to be accepted [nepers].
    result : FitResult
        The fit.
    """

    name: str
    kind: str
    where: str
    parameters: tuple[EffectParameter, ...]
    level: float
    fit_db: float
    held_out_db: float
    similarity: float
    refined: bool
    asked: float
    result: FitResult


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A missing effect.

    Attributes
    ----------
    effect : Effect
        Ready to be added to the model.
    parameters : tuple of EffectParameter
    twins : tuple of Ranked
        Candidates that explain the data nearly as well.
    rival : Ranked or None
        The best candidate that is no twin.
    decisive : tuple of Decisive
        The pieces of the data that speak most for the effect against the rival (without one, the first twin).
    proposals : tuple of tuple of Proposal
        For each of the first ``MOST_SEPARATED`` twins, the measurements that would separate the two.
    """

    effect: Effect
    parameters: tuple[EffectParameter, ...]
    twins: tuple[Ranked, ...]
    rival: Ranked | None = None
    decisive: tuple[Decisive, ...] = ()
    proposals: tuple[tuple[Proposal, ...], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of the staircase: what was added, and the errors after it.

    Attributes
    ----------
    label : str
    fit_db, held_out_db : float
        On the lines fitted and held out [dB].
    level : float
        Robust residual level, amplitude and phase [nepers].
    result : FitResult
    """

    label: str
    fit_db: float
    held_out_db: float
    level: float
    result: FitResult


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
    problem: FitProblem
    model: Model
    notes: tuple[str, ...]
    seconds: float
    gates: Gates | None = None
    candidates: tuple[Effect, ...] = ()

    @property
    def noise_floor_db(self) -> float:
        """Noise and the model's discretisation error together [dB]."""
        return float(np.hypot(self.noise_db, self.discretisation_db))

    def frf(self, step: int) -> FRF:
        """Return the FRFs of a step in the kind of the measurement."""
        return self.problem.frf(self.steps[step].result)

    def deviation(self, step: int) -> NDArray[np.float64] | None:
        """Return the standard deviation of the ln|H| that a step predicts; None for the nominal model."""
        return self.problem.deviation(self.steps[step].result)

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.problem.measured


def attachment_forces(model: Model, measurement: Measurement) -> NDArray[np.float64]:
    """Return where forces act or may act: excitations, sensors and the sides of joints, shape (n_dof, k)."""
    # Sensors count too: where a response is mostly local stretching, modes alone converge slowly.
    columns = [sensor_vectors(model, measurement.excitations), sensor_vectors(model, measurement.sensors)]
    for element in model.of_kind(PointPair):
        dofs, B = element.relative(model)
        rigid = element.rigid if isinstance(element, Joint) else ()
        held = [d not in rigid for d in ("x", "y", "z", "rx", "ry", "rz")]
        block = np.zeros((model.n_dof, 6))
        block[dofs] = B.T
        columns.append(block[:, held])
    return np.hstack(columns)


def elastic_frequencies(reduced: ReducedModel, up_to: float) -> NDArray[np.float64]:
    """Return the reduced model's elastic natural frequencies up to a frequency [Hz]."""
    total, n = reduced.base_sum(), reduced.basis.n_main
    lam = sla.eigh(total["K"][:n, :n], total["M"][:n, :n], eigvals_only=True)[reduced.basis.n_rigid :]
    f = np.sqrt(np.maximum(lam, 0.0)) / (2 * np.pi)
    return f[f <= up_to]


def build_problem(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance],
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_LINES,
    connections: bool = False,
) -> FitProblem:
    """Reduce a model and prepare the data for fits.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor. Its modal damping ratios become the nominal damping curve
        (0.5 % where there are none).
    measurement : Measurement
    nuisances : sequence of Nuisance
    damping_std : float
        Standard deviation of the logarithm of the damping ratio [-].
    band : (float, float), optional
        Frequencies that count [Hz].
    n_lines : int
        At most this many lines are fitted.
    connections : bool
        Whether connections may be damped otherwise than members.

    Raises
    ------
    MeasurementError
        If there are fewer than ``LEAST_LINES`` lines, or no value of the FRFs is left to compare.
    """
    model = with_sensor_masses(model, (*measurement.sensors, *measurement.excitations))
    frf = measurement.frf.select(band=band) if band else measurement.frf
    n_usable = int((frf.frequency > 0).sum())
    if n_usable < LEAST_LINES:
        msg = (
            f"'{measurement.name}' has {n_usable} line(s) above 0 Hz in the band; at least {LEAST_LINES} are "
            "needed to compare a model with it"
        )
        raise MeasurementError(msg)
    highest = float(frf.frequency[-1])
    undamped = model.with_damping(replace(model.damping, ratio=np.zeros(1), frequency=np.zeros(1)))
    reduced = reduce_model(undamped, attachment_forces(model, measurement), highest, margin=MODE_MARGIN)
    modes = elastic_frequencies(reduced, highest)
    # A suspension's modes below the band have no lines: they are neither knots nor stages.
    modes = modes[modes >= frf.frequency[0]]
    n_knots = int(np.clip(len(modes) // 2, 1, 8))
    knots = (
        np.unique(np.quantile(modes, np.linspace(0, 1, n_knots))) if len(modes) else np.array([highest / 2])
    )
    ratio = model.damping.ratio_at(knots)
    no_other = not (model.damping.alpha or model.damping.beta or model.damping.loss_factor)
    curve = DampingCurve(
        knots, np.maximum(ratio, NOMINAL_RATIO if no_other and not ratio.any() else 1e-5), damping_std,
        connections,
    )  # fmt: skip
    k = len(modes)
    low = modes[4] * 1.1 if k > 8 else highest
    middle = modes[k // 2] if k > 14 else highest
    stages = np.unique(np.minimum([low, middle, highest], highest))
    start = frf.frequency[frf.frequency > 0]
    values = values_of(undamped, ())
    engine = ParametricFRF(
        reduced,
        sensor_vectors(model, measurement.sensors),
        sensor_vectors(model, measurement.excitations),
        start,
        (),
    )
    nominal, _, _ = engine.evaluate(values, curve.ratio(start, curve.start), gradient=False)
    data = prepare(measurement, nominal, band)
    counted = data.frequency[data.mask.any(axis=(1, 2)) & ~data.held_out]
    if not counted.size:
        msg = (
            f"no FRF of '{measurement.name}' can be compared: every value is 0, small beside the others, or "
            f"uncertain by more than {100 * NOISE_LIMIT:.0f} % (from {measurement.noise_source})"
        )
        raise MeasurementError(msg)
    stages = stages[stages >= counted[0]]
    ends = np.unique(np.round(FIRST_STAGE * STAGE_GROWTH ** np.arange(40)).astype(int))
    fine = np.array([*(np.sqrt(modes[n - 1] * modes[n]) for n in ends[ends < k]), highest])
    enough = np.searchsorted(counted, fine, "right") >= STAGE_LINES
    enough[-1] = True
    return FitProblem(reduced, data, tuple(nuisances), curve, stages, max(k, 1), n_lines, fine[enough])


def discretisation_error(problem: FitProblem, n_lines: int = 200) -> tuple[float, float]:
    """Estimate the error of the mesh by halving every element: root mean square [dB], and level [nepers].

    Cubic elements converge with the fourth power of their size, so that the difference is 15/16 of the error.
    """
    model, m = problem.reduced.model, problem.data.measurement
    fine_model = model.with_mesh(model.mesh.split(2))
    lines = problem.lines_up_to(np.inf, n_lines)
    f = problem.data.frequency[lines]
    zeta = problem.damping.ratio(f, problem.damping.start)
    highest = float(problem.data.frequency[-1])
    forces = attachment_forces(fine_model, m)
    fine = reduce_model(fine_model, forces, highest, margin=MODE_MARGIN, releasable=False)
    H = []
    for reduced in (problem.reduced, fine):
        outputs, inputs = (sensor_vectors(reduced.model, part) for part in (m.sensors, m.excitations))
        engine = ParametricFRF(reduced, outputs, inputs, f, ())
        H.append(engine.evaluate(np.zeros(0), zeta, gradient=False)[0])
    ratio: Any = np.where(problem.data.mask[lines], log_ratio(H[0], H[1]), complex("nan")) * 16 / 15
    return rms_db(ratio), problem.level(ratio, lines)


def _splits(mesh_level: float, noise_level: float) -> int:
    """Return into how many to cut each element, so that the mesh's error is small beside the noise."""
    too_large = mesh_level / (MESH_SHARE * noise_level)
    return min(MOST_SPLITS, int(np.ceil(too_large**0.25))) if too_large > 1 else 1


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
        return tuple(e for cls in classes for e in cls.propose(model))
    instruments = instruments_on(model.mesh, test)
    return tuple(e for cls in classes for e in cls.propose_for_test(model, instruments))


def diagnose(
    model: Model,
    measurements: Sequence[Measurement],
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    n_lines: int = N_LINES,
    model_error: float = EXPLAINED_LEVEL,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the physical effect that a model lacks.

    Nuisance parameters are fitted; sensors with a wrong sign or gain are set right; then every candidate
    effect is fitted from the nominal start together with the nuisances, the best is added if it pays, and the
    search is repeated with it.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor (:func:`updating.measurement.place_sensors`).
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
    progress : callable, optional
        Called with a text and the fraction done.
    """
    begun = time.perf_counter()
    say = progress or (lambda text, done: None)
    say("reducing the model", 0.0)
    candidates = propose(model, kinds, exclude, measurements[0])
    build = partial(
        build_problem, measurement=measurements[0], nuisances=nuisances, damping_std=damping_std, band=band,
        n_lines=n_lines, connections=True,
    )  # fmt: skip
    problem = build(model)
    mesh_db, mesh_level = discretisation_error(problem)
    notes: list[str] = []
    n = _splits(mesh_level, max(problem.data.noise_level, model_error, LEVEL_FLOOR))
    if n > 1:
        notes.append(
            f"each element was cut into {n}: the mesh's error was {mesh_db:.2g} dB, not small beside the "
            f"noise of {problem.data.noise_db:.2g} dB"
        )
        say(f"cutting each element into {n}", 0.01)
        model = model.with_mesh(model.mesh.split(n))
        candidates = propose(model, kinds, exclude, measurements[0])
        problem = build(model)
        mesh_db, mesh_level = discretisation_error(problem)
    floor = float(np.hypot(problem.data.noise_level, mesh_level))
    nominal = problem.nominal()
    say("fitting the uncertain parameters", 0.03)
    null = min(problem.fit(), problem.fit(stages=problem.fine_stages), key=lambda r: r.solution.cost)
    problem, null, faults = find_faults(problem, null)
    steps = _step("nominal model", nominal), _step("uncertain parameters fitted", null)
    gates = check_gates(problem, null, measurements[1:], mesh_db, faults)
    notes += gates.notes

    limit = max(RIGHT_MARGIN * floor, model_error)
    levels = () if gates.linear else force_levels(problem, measurements, faults)
    nonlinear = _amplitude_candidates(model, kinds, exclude, measurements[0]) if levels else ()
    if not gates.linear and not levels:
        notes.append(
            "what depends on amplitude is searched for only where each measurement states its force_level, "
            "and two differ"
        )
    search = _Search(problem, (), (), steps, null)
    if nonlinear:
        alone = _amplitude_added(search, levels, nonlinear, _between(say, 0.05, 0.2))
        search = alone if alone.current.level <= limit else search
    if not search.depends_on_amplitude:
        search = _linear_added(search, candidates, floor, model_error, _between(say, 0.05, 0.9))
        if nonlinear:
            search = _amplitude_added(search, levels, nonlinear, _between(say, 0.9, 0.98))
    say("checking", 0.98)
    depends = search.depends_on_amplitude
    if not depends:
        first = faults
        search, faults = _with_faults_settled(search, faults, limit)
        gates = with_last_faults(gates, first, faults)
        if search.problem.data is not problem.data:
            null = search.problem.assessed(replace(null, level=np.nan))
    problem, current, findings, rounds, steps = (
        search.problem, search.current, search.findings, search.rounds, search.steps,
    )  # fmt: skip
    basis_db = basis_error(problem, current)
    if basis_db > BASIS_LIMIT_DB:
        notes.append(
            f"the reduced basis differs from the full model by {basis_db:.2g} dB at the checked lines: "
            "read weak findings with care"
        )
    most_left = _most_left(null, model_error)
    verdict, reason = _verdict(null, current, (limit, most_left), findings, faults)
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
    if verdict == UNEXPLAINED:
        findings, current, steps = (), steps[1].result, steps[:2]
    model_fitted = _fitted(model, current)
    return Diagnosis(
        verdict, reason, findings, faults, steps, rounds, problem.data.noise_db, mesh_db, basis_db,
        limit, problem, model_fitted, tuple(notes), time.perf_counter() - begun, gates,
        (*candidates, *nonlinear),
    )  # fmt: skip


def _amplitude_candidates(
    model: Model, kinds: Sequence[str] | None, exclude: Sequence[str], test: Measurement
) -> tuple[AmplitudeDependent, ...]:
    every = propose(model, kinds, exclude, test, levels=True)
    return tuple(e for e in every if isinstance(e, AmplitudeDependent))


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
    shift = _change(problem, best.result, current)
    ranked = tuple(
        Ranked(
            f.effect.name, f.effect.kind, f.effect.where, _parameters(f.effect, f.result), f.level,
            f.result.fit_db, f.result.held_out_db,
            _similarity(shift, _change(problem, f.result, current)), True, without[0] / ACCEPT_LEVEL,
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


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """How far the search for effects has come."""

    problem: FitProblem
    findings: tuple[Finding, ...]
    rounds: tuple[tuple[Ranked, ...], ...]
    steps: tuple[Step, ...]
    current: FitResult

    @property
    def depends_on_amplitude(self) -> bool:
        """Whether an effect was found that does."""
        return any(f.effect.amplitude_dependent for f in self.findings)


def _amplitude_added(
    search: _Search,
    levels: tuple[FitData, ...],
    candidates: Sequence[AmplitudeDependent],
    say: Progress,
) -> _Search:
    """Return a search with a nonlinear joint beside the effects that it has found; as it is, if none pays."""
    found = _amplitude_round(search.problem, levels, search.current, candidates, say)
    if found is None:
        return search
    finding, current, ranked = found
    linear = _at_values_of(current, search.findings)
    n = len(linear)
    return replace(
        search,
        findings=(*linear, finding),
        rounds=(*search.rounds[:n], ranked, *search.rounds[n:]),
        steps=(*search.steps, _added([finding.effect], current)),
        current=current,
    )


def _linear_added(
    begin: _Search, candidates: Sequence[Effect], floor: float, model_error: float, say: Progress
) -> _Search:
    """Search for effects.

    Once more among more of the candidates for one effect that does alone what several do together, or before
    what is left is called unexplained; then also from other first effects.

    ``floor`` is the level that noise and the mesh leave.
    """
    settled, limit = FLOOR_MARGIN * floor, max(RIGHT_MARGIN * floor, model_error)
    weak = settled if model_error == 0 else 0.0
    grids = {e.name: Grid.of(begin.problem, e) for e in candidates}
    full = max(settled, model_error), weak
    search = _search(begin, candidates, grids, full, N_BEST, say)
    later = _between(say, 0.53, 1.0)
    if len(search.findings) > 2 or (len(search.findings) > 1 and search.current.level > limit):
        search = _exchanged(search, candidates, full, _between(say, 0.5, 0.53))
    believed = max(limit, _most_left(begin.current, model_error))
    if len(search.findings) > 1 or search.current.level > believed:
        alone = _search(begin, candidates, grids, (limit, weak), N_BEST_DEEP, later, most=1)
        if alone.findings and alone.current.level < AS_GOOD_ALONE * search.current.level:
            search = alone
        if search.current.level > believed and alone.rounds:
            search = _branched(begin, search, alone.rounds[0], candidates, full, later)
    return _on_own_basis(search)


def _exchanged(
    search: _Search, candidates: Sequence[Effect], limits: tuple[float, float], say: Progress
) -> _Search:
    """Take away each of several effects but the last, search on beside the others, and keep the best end.

    The first was chosen while the others were missing, and may have stood for some of them.
    """
    best, grids = search, {e.name: Grid.of(search.problem, e) for e in candidates}
    for i in range(len(search.findings) - 1):
        findings = search.findings[:i] + search.findings[i + 1 :]
        rounds = search.rounds[:i] + search.rounds[i + 1 :]
        less = search.problem.fit_without(search.current, search.findings[i].effect.name)
        begin = _Search(
            search.problem, tuple(_at_values_of(less, findings)), rounds[: len(findings)],
            (*search.steps[:2], _added(less.effects, less)), less,
        )  # fmt: skip
        again = _search(begin, candidates, grids, limits, N_BEST, say, most=len(search.findings))
        if _worth(again) < _worth(best):
            best = again
    return best


def _branched(
    begin: _Search,
    search: _Search,
    ranked: tuple[Ranked, ...],
    candidates: Sequence[Effect],
    limits: tuple[float, float],
    say: Progress,
) -> _Search:
    """Search on from other candidates of a first round, and keep the best end.

    From those that do something else than the best one, and from that if it was not searched on from: of two
    effects neither need come first while both are missing. A third is looked for beside the best two alone.
    """
    ended, tried = search, {f.effect.name for f in search.findings}
    others = [r for r in ranked if r.refined and (r.similarity < OTHERWISE or r is ranked[0])]
    for other in [r for r in others if r.name not in tried][:N_BRANCHES]:
        problem = _attached(begin.problem, other.result.effects)
        best = _polish(problem, other.result)
        order = (other, *(r for r in ranked if r is not other))
        (effect,) = best.effects
        finding = Finding(effect, _parameters(effect, best), *_explained(problem, order, begin.current))
        steps = (*begin.steps, _added([effect], best))
        branch = _Search(problem, (finding,), (order,), steps, best)
        again = _search(branch, candidates, {}, limits, N_BEST, say, most=2)
        if _worth(again) < _worth(ended):
            ended = again
    return ended if ended is search else _search(ended, candidates, {}, limits, N_BEST, say)


def _worth(search: _Search) -> float:
    """Return the score of all effects of a search together."""
    return _score(search.problem, search.current, len(search.findings))


def _on_own_basis(search: _Search) -> _Search:
    """Fit what was found once more on a basis with its own modes, if that of the search is not good enough.

    The search's basis has the nominal model's modes and the responses to forces at the effects' places. Where
    an effect changes a whole member, they converge slowly to the modes with it. The noise of thousands of
    values averages out in a parameter, and an error of the basis does not: it must be much smaller.
    """
    problem, current = search.problem, search.current
    for reach in BASIS_REACH if search.findings else ():
        allowed = BASIS_SHARE * max(current.level, LEVEL_FLOOR) * DB_PER_NEPER / np.sqrt(2)
        if basis_error(problem, current, BASIS_LINES) <= allowed:
            break
        up_to = reach * float(problem.data.frequency[-1])
        reduced = problem.reduced.with_modes_of(_fitted(problem.reduced.model, current), up_to)
        problem = _attached(replace(problem, reduced=reduced), current.effects)
        current = _polish(problem, current)
    if current is search.current:
        return search
    findings = tuple(_at_values_of(current, search.findings))
    steps = (*search.steps[:-1], _step(search.steps[-1].label, current))
    return replace(search, problem=problem, current=current, findings=findings, steps=steps)


def _with_faults_settled(
    search: _Search, faults: tuple[Fault, ...], limit: float
) -> tuple[_Search, tuple[Fault, ...]]:
    """Look for faults once more where the physics is right, and withdraw those that it has explained."""
    problem, current, findings, steps = search.problem, search.current, search.findings, search.steps
    if findings and current.level < limit:  # small faults show only there
        problem, current, late = find_faults(problem, current)
        if late:
            faults = (*faults, *late)
            steps = (*steps[:-1], _step(steps[-1].label, current))
    if faults:
        problem, current, faults = settle_faults(problem, current, faults)
        before = [_step(s.label, problem.assessed(replace(s.result, level=np.nan))) for s in steps[:-1]]
        steps = (*before, _step(steps[-1].label, current))
    findings = tuple(_at_values_of(current, findings))
    return replace(search, problem=problem, current=current, findings=findings, steps=steps), faults


def _search(
    begin: _Search,
    candidates: Sequence[Effect],
    grids: Mapping[str, Grid],
    limits: tuple[float, float],
    n_best: int,
    say: Progress,
    most: int = MAX_EFFECTS,
) -> _Search:
    """Add effects while they pay, and drop those that the others have made idle.

    ``grids`` are those of the candidates on the problem to begin with; ``limits`` are the levels from which
    on only weak effects are looked for, and from which they count. The ``n_best`` best candidates by each
    measure are fitted, and ``most`` effects added.
    """
    problem, current = begin.problem, begin.current
    findings, rounds, steps = list(begin.findings), list(begin.rounds), list(begin.steps)
    first = steps[: len(steps) - bool(findings)]
    limit, weak_limit = limits
    while len(findings) < most:
        taken = {f.effect.name for f in findings}
        open_ = [
            e for e in candidates if e.name not in taken and not (set(e.released()) & _released(findings))
        ]
        part = _part(say, len(rounds))
        grids = grids or {e.name: Grid.of(problem, e) for e in open_}
        settled = current.level < limit
        if settled and weak_limit and problem.n_lines < N_LINES_WEAK:
            problem = replace(problem, n_lines=N_LINES_WEAK)
            current = problem.refit(current)
            findings = _at_values_of(current, findings)
            steps[-1] = _step(steps[-1].label, current)
        rule = _Rule(problem, limit, settled, current, weak_limit > 0)
        ranked, best = _round(rule, open_, grids, n_best, part)
        rounds.append(ranked)
        if best is None:
            break
        # The candidate's fit may have found better nuisance parameters; the model without it
        # deserves them too.
        again = problem.refit(current, _believed(best))
        if again.solution.cost < current.solution.cost - 0.1:
            current = again
            steps[-1] = _step(steps[-1].label, current)
        rule = replace(rule, before=current)
        if not rule.pays(best):
            break
        say(f"checking {_label(best.effects[-1])}", (len(rounds) + 0.9) / (len(rounds) + 2))
        attached = _attached(problem, best.effects)
        best = _polish(attached, best)
        if attached is not problem:  # the position has moved: once more where it is now
            problem = _attached(attached, best.effects)
            best = _polish(problem, best)
            grids = {e.name: Grid.of(problem, e) for e in open_}
        reduced = problem.reduced
        problem, rounds[-1], best = _against_rivals(problem, rule, ranked, best, open_, grids)
        grids = grids if problem.reduced is reduced else {}
        explained = _explained(problem, rounds[-1], current)
        last = best.effects[-1]
        findings = [*_at_values_of(best, findings), Finding(last, _parameters(last, best), *explained)]
        current = best
        steps.append(_added([last], best))
    before = findings
    findings, current = _without_idle(problem, findings, current, weak_limit)
    if len(findings) < len(before):
        left = {f.effect.name for f in findings}
        kept = [k for k, f in enumerate(before) if f.effect.name in left]
        rounds = [rounds[k] for k in (*kept, *(k for k in range(len(rounds)) if k not in kept))]
        steps = [*first, *([_added((f.effect for f in findings), current)] if findings else [])]
    return _Search(problem, tuple(findings), tuple(rounds), tuple(steps), current)


def _at_values_of(fit: FitResult, findings: Sequence[Finding]) -> list[Finding]:
    """Return findings with the values that a fit gives their effects, which are its first."""
    return [
        replace(f, effect=e, parameters=_parameters(e, fit))
        for e, f in zip(fit.effects, findings, strict=False)
    ]


def _most_left(null: FitResult, model_error: float) -> float:
    """Return the level up to which effects are believed though more is left than a right model leaves."""
    return MOST_LEFT**0.5 * null.level if model_error > 0 else 0.0


def _part(say: Progress, n: int) -> Progress:
    """Return progress of round n as a part of the whole, whose length is not known before."""
    return lambda text, done: say(text, (n + done) / (n + 2))


def _between(say: Progress, start: float, end: float) -> Progress:
    return lambda text, done: say(text, start + (end - start) * done)


def _step(label: str, result: FitResult) -> Step:
    return Step(label, result.fit_db, result.held_out_db, result.level, result)


def _added(effects: Iterable[Effect], result: FitResult) -> Step:
    return _step(f"{_labels(effects)} added", result)


def _labels(effects: Iterable[Effect]) -> str:
    return " and ".join(map(_label, effects))


def _label(effect: Effect) -> str:
    return f"{effect.kind.replace('_', ' ')} at {effect.where}"


def _released(findings: Sequence[Finding]) -> set[tuple[str, str]]:
    return {key for f in findings for key in f.effect.released()}


@dataclass(frozen=True, slots=True, eq=False)
class _Rule:
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
    form_right : bool
        Whether the caller says that nothing but noise and the mesh may be left.
    """

    problem: FitProblem
    limit: float
    settled: bool
    before: FitResult
    form_right: bool

    def factors(self, effect: Effect) -> tuple[float, float]:
        """Return by how much the levels on fitted and on held-out lines must fall with an effect."""
        if not self.settled:
            return STEP_LEVEL, STEP_LEVEL
        if not self.form_right:
            return ACCEPT_SETTLED, ACCEPT_SETTLED
        return _weak(self.problem, effect, beside=bool(self.before.effects))

    def pays(self, after: FitResult) -> bool:
        """Whether a fit with one more effect is enough better than that without, and not within tolerance."""
        if _within_tolerance(self.problem, after):
            return False
        return _falls(self.before, after, self.factors(after.effects[-1]), self.form_right)

    def ranked(self, fit: FitResult, similarity: float, refined: bool) -> Ranked:
        """Return a candidate's fit as an entry of the ranking."""
        effect = fit.effects[-1]
        return Ranked(
            effect.name, effect.kind, effect.where, _parameters(effect, fit), fit.level, fit.fit_db,
            fit.held_out_db, similarity, refined, self.before.level / self.factors(effect)[0], fit,
        )  # fmt: skip


def _round(
    rule: _Rule, candidates: Sequence[Effect], grids: Mapping[str, Grid], n_best: int, say: Progress
) -> tuple[tuple[Ranked, ...], FitResult | None]:
    """Look at every candidate, fit the promising quickly and the best of them fully.

    While the model is settled fits start from its parameters; before, they start from the nominal ones as
    well, because parameters that were fitted without an effect are off. As long as the best leave more than a
    settled model does, they are fitted in fine stages too.
    Returns those that were fitted, best first, and the best fit. The best of those that pay comes before a
    better one that does not: it may have found its gain where the lines of the fit are, and nowhere else.
    """
    if not candidates:
        return (), None
    problem, current, settled = rule.problem, rule.before, rule.settled
    have = list(current.effects)
    have_start = [parameter_values(e) for e in have]
    look = [grids[e.name] for e in candidates]
    chosen = screen(problem, current, look, settled, n_best, _between(say, 0.0, 0.3))
    if not chosen:
        return (), None
    stages = [float(f) for f in np.unique([problem.stages[0], problem.stages[-1]])]
    tried: dict[str, list[FitResult]] = {}
    on: dict[str, FitProblem] = {}
    quick = {"n_lines": problem.n_lines if settled else QUICK_LINES, "max_iterations": 6, "assess": False}
    for i, option in enumerate(chosen):
        say(f"screening {_label(option.effect)}", 0.3 + 0.2 * i / len(chosen))
        name, starts = option.effect.name, [*have_start, option.starts[0]]
        places = [option.effect.with_values(**start) for start in option.starts]
        on[name] = replace(problem, reduced=problem.reduced.with_forces_of(places))
        begin: dict[str, Any] = {"stages": stages[-1:], "x_from": current} if settled else {"stages": stages}
        tried[name] = [on[name].fit([*have, option.effect], starts, **begin, **quick)]
    reach = QUICK_REACH * min(fits[0].level for fits in tried.values())
    for option in () if settled else chosen:
        name, effects = option.effect.name, [*have, option.effect]
        if tried[name][0].level > reach:
            continue
        say(f"screening {_label(option.effect)}", 0.5)
        for k, start in enumerate(option.starts):
            starts = [*have_start, start]
            begin = {"stages": stages} if k else {"stages": stages[-1:], "x_from": current}
            tried[name].append(on[name].fit(effects, starts, **begin, **quick))
    for fits in tried.values():
        fits.sort(key=lambda f: f.level)
    names = sorted(tried, key=lambda n: _score(problem, tried[n][0]))
    near = [n for n in names if tried[n][0].level < 1.8 * tried[names[0]][0].level]
    finalists = names[: int(np.clip(len(near), 3, MOST_REFINED))]
    if settled:
        finalists = names[:FINALS_SETTLED]
    final: dict[str, FitResult] = {}
    for i, name in enumerate(finalists):
        quickly = tried[name][0]
        effect = quickly.effects[-1]
        say(f"fitting {_label(effect)}", 0.6 + 0.4 * i / len(finalists))
        starts = [*have_start, parameter_values(effect)]
        mine = on[name] = _attached(problem, [effect])
        options = [mine.fit([*have, effect], starts, stages=[mine.stages[-1]], x_from=quickly, assess=False)]
        if not settled:
            options.append(mine.fit([*have, effect], starts, assess=False))
        final[name] = mine.assessed(min(options, key=lambda r: r.solution.cost))
    leading = sorted(final, key=lambda n: _score(problem, final[n]))[:N_FINE]
    if not settled and final[leading[0]].level > rule.limit:
        for name in leading:
            starts = [*have_start, parameter_values(tried[name][0].effects[-1])]
            fine = on[name].fit([*have, final[name].effects[-1]], starts, stages=problem.fine_stages)
            final[name] = min(final[name], fine, key=lambda r: r.solution.cost)
    order = sorted(final, key=lambda n: _score(problem, final[n]))
    best_name = next((n for n in order if rule.pays(final[n])), order[0])
    best = final[best_name]
    shift = _change(on[best_name], best, current)
    ranked = []
    for name in names:
        fit = final.get(name) or on[name].assessed(tried[name][0])
        similarity = _similarity(shift, _change(on[name], fit, current))
        ranked.append(rule.ranked(fit, similarity, name in final))
    return _in_order(problem, ranked, best_name), best


def _against_rivals(
    problem: FitProblem,
    rule: _Rule,
    ranked: tuple[Ranked, ...],
    best: FitResult,
    candidates: Sequence[Effect],
    grids: Mapping[str, Grid],
) -> tuple[FitProblem, tuple[Ranked, ...], FitResult]:
    """Let the other candidates at the place of an accepted one take its turn, and keep the best.

    They are fitted from where its fit ended: without an effect, or with the nominal ones, the uncertain
    parameters are off, and what acts much alike, such as a crack beside a support and the support's own
    flexibility, then comes out in an order of chance.
    """
    model, winner = problem.reduced.model, best.effects[-1]
    longest = max(model.mesh.member_length(m) for m in model.mesh.members)
    reach = min(SAME_PLACE * model.mesh.size, SAME_MEMBER * longest)
    others, places = (grids[e.name] for e in candidates if e.name != winner.name), winner.locations(model)
    near = [part for grid in others if (part := grid.near(model, places, reach))]
    shift = _change(problem, best, rule.before)
    entries = {r.name: r for r in ranked}
    entries[winner.name] = rule.ranked(best, 1.0, True)
    chosen_problem, chosen = problem, best
    for option in rivals(problem, best, near, N_RIVALS):
        mine = _attached(problem, [*best.effects, option.effect.with_values(**option.starts[0])])
        effects = [*best.effects[:-1], option.effect]
        starts = [*map(parameter_values, best.effects[:-1]), option.starts[0]]
        fit = mine.fit(effects, starts, stages=[mine.stages[-1]], x_from=best)
        name = option.effect.name
        known = entries.get(name)
        if known is None or not known.refined or _score(problem, fit) < _score(problem, known.result):
            entries[name] = rule.ranked(fit, _similarity(shift, _change(mine, fit, rule.before)), True)
        if _score(problem, fit) < _score(problem, chosen):
            chosen_problem, chosen = mine, fit
    if chosen is not best:
        chosen = _polish(chosen_problem, chosen)
        entries[chosen.effects[-1].name] = rule.ranked(chosen, 1.0, True)
    return chosen_problem, _in_order(problem, entries.values(), chosen.effects[-1].name), chosen


def _in_order(problem: FitProblem, ranked: Iterable[Ranked], best: str) -> tuple[Ranked, ...]:
    """Return candidates with the named one first, those fitted fully before the others, then by score."""
    return tuple(sorted(ranked, key=lambda r: (not r.refined, r.name != best, _score(problem, r.result))))


def _believed(fit: FitResult) -> FitResult:
    """Return a fit whose last effect's value stands for the parameter that it replaced."""
    last = fit.effects[-1]
    replaced, own = last.replaces(), last.parameters()
    if len(replaced) != 1 or len(own) != 1:
        return fit
    return replace(fit, values={**fit.values, replaced[0]: own[0].value})


def _score(problem: FitProblem, fit: FitResult, n_last: int = 1) -> float:
    """Return what candidates are ranked by: n ln level + ½ k ln n, with k parameters of the last effects.

    Schwarz's criterion (Ann. Stat. 6, 1978) for an unknown error level, with as many independent data n as
    the fits count, so that an effect with more parameters must earn them. The level of one that also damps
    counts ``DAMPING_MARGIN`` times.
    """
    n = problem.function((), (), np.zeros(0, dtype=np.int64)).n_independent()
    parameters = [(e, p) for e in fit.effects[len(fit.effects) - n_last :] for p in e.parameters()]
    level = np.hypot(fit.level, LEVEL_FLOOR)
    if any(_damps(problem, effect, p) for effect, p in parameters):
        level *= DAMPING_MARGIN
    return float(n * np.log(level) + 0.5 * len(parameters) * np.log(n))


def _weak(problem: FitProblem, effect: Effect, *, beside: bool) -> tuple[float, float]:
    """Return the factors by which the levels must fall with a weak effect, alone or beside others."""
    if any(_damps(problem, effect, p) for p in effect.parameters()):
        return ACCEPT_WEAK_DAMPING, ACCEPT_WEAK_DAMPING
    return ACCEPT_WEAK_BESIDE if beside else ACCEPT_WEAK, ACCEPT_WEAK_HELD_OUT


def _within_tolerance(problem: FitProblem, fit: FitResult) -> bool:
    """Whether the last effect is but a loss factor that the tolerance of damping allows for.

    Members and joints are not damped alike to a tenth of their damping; that is no effect that a model lacks.
    """
    effect, curve = fit.effects[-1], problem.damping
    p, *others = effect.parameters()
    if others or p.name != "loss_factor":
        return False
    mean = float(np.exp(np.log(fit.zeta[: len(curve.knots)]).mean()))
    return abs(p.value) < curve.std * 2 * mean


def _damps(problem: FitProblem, effect: Effect, p: Parameter) -> bool:
    """Whether a parameter changes damping alone, or a law of stiffness and damping."""
    term = problem.reduced.derivative_of(effect, p.name, p.value)
    if term.laws:
        return True
    present = {key for key in "KMCD" if (X := getattr(term, key)) is not None and X.any()}
    return bool(present) and present <= {"C", "D"}


def _without_idle(
    problem: FitProblem, findings: list[Finding], current: FitResult, weak_limit: float
) -> tuple[list[Finding], FitResult]:
    """Drop effects without which the fit is nearly as good.

    Up to the level ``weak_limit``, which is 0 unless the model's form is right, weak effects stay.
    """
    for finding in list(findings):
        name = finding.effect.name
        rest = [f for f in findings if f.effect.name != name]
        less = problem.fit_without(current, name)
        usual = (ACCEPT_LEVEL, ACCEPT_HELD_OUT)
        weak = current.level < weak_limit
        factors = _weak(problem, finding.effect, beside=bool(rest)) if weak else usual
        if not _falls(less, current, factors, weak_limit > 0):
            findings = [
                replace(f, effect=e, parameters=_parameters(e, less))
                for f, e in zip(rest, less.effects, strict=True)
            ]
            current = less
    return findings, current


def _attached(problem: FitProblem, effects: Sequence[Effect]) -> FitProblem:
    """Return the problem with the forces of effects in its basis, for a position also on either side of it.

    The modes alone make what is local, such as a crack, look weaker than it is.
    """
    model = problem.reduced.model
    reach = float(model.mesh.lengths().max())
    near = list(effects)
    for effect in effects:
        for p in effect.parameters():
            if p.name == "position":
                places = np.clip(p.value + np.array([-reach, reach]), p.lower, p.upper)
                near += [effect.with_values(position=float(s)) for s in places]
    reduced = problem.reduced.with_forces_of(near)
    return problem if reduced is problem.reduced else replace(problem, reduced=reduced)


def _polish(problem: FitProblem, best: FitResult) -> FitResult:
    """Fit again from starts around the best, with another value of its first parameter or of a law or width.

    Such as a width that reaches beyond a member's end, where the FRFs do not change with it. Optima that are
    as good widen the first parameter's standard deviation.
    """
    *have, last = best.effects
    first, *others = last.parameters()
    tried = [problem.refit(best, assess=False)]
    near = [(first, f) for f in (0.6, 0.8, 1.25, 1.7)]
    near += [(p, f) for p in others if p.name != "position" for f in (0.6, 1.7)]
    for p, factor in near:
        value = float(np.clip(factor * p.value, p.lower, p.upper))
        starts = [*map(parameter_values, have), {**parameter_values(last), p.name: value}]
        tried.append(
            problem.fit(best.effects, starts, stages=[problem.stages[-1]], x_from=best, assess=False)
        )
    tried.sort(key=lambda r: r.solution.cost)
    winner = tried[0]
    ref = (last.name, first.name)
    good = [r for r in tried if r.solution.cost < winner.solution.cost + AS_GOOD]
    spread = max(abs(r.values[ref] - winner.values[ref]) for r in good)
    return problem.assessed(replace(winner, std={**winner.std, ref: max(winner.std[ref], spread)}))


def _change(problem: FitProblem, fit: FitResult, base: FitResult) -> NDArray[np.complex128]:
    lines = problem.lines_up_to(np.inf, 60)
    ratio = log_ratio(problem.receptance(fit, lines), problem.receptance(base, lines))
    return np.nan_to_num(np.where(problem.data.mask[lines], ratio, 0.0)).ravel()


def _similarity(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(abs(np.vdot(a, b).real) / norm) if norm > 0 else 0.0


def _falls(
    before: FitResult, after: FitResult, factors: tuple[float, float], form_right: bool = False
) -> bool:
    """Whether the levels on fitted and on held-out lines fall by more than two factors.

    Where the model's form is right the first counts for all lines together, as chance gains little there,
    and held-out lines need only fall by ``PLAIN_HELD_OUT`` if the fitted ones fall by ``PLAIN_LEVEL``: a
    narrow resonance may lie between them.
    """
    whole, held_out = factors
    if not form_right:
        return before.held_out_level > held_out * after.held_out_level and before.level > whole * after.level
    if before.level > max(PLAIN_LEVEL, whole) * after.level:
        held_out = PLAIN_HELD_OUT
    return before.held_out_level > held_out * after.held_out_level and _level(before) > whole * _level(after)


def _level(fit: FitResult) -> float:
    """Return the level over fitted and held-out lines, of which there are a third as many."""
    return float(np.sqrt(0.75 * fit.level**2 + 0.25 * fit.held_out_level**2))


def _explained(
    problem: FitProblem, ranked: Sequence[Ranked], current: FitResult
) -> tuple[tuple[Ranked, ...], Ranked | None, tuple[Decisive, ...], tuple[tuple[Proposal, ...], ...]]:
    """Return the twins of the best candidate, its rival, what decides, and what would separate the twins."""
    best = ranked[0]
    gain = np.log(current.level / best.level)
    refined = [r for r in ranked[1:] if r.refined]
    twins = tuple(r for r in refined if np.log(current.level / r.level) > TWIN_SHARE * gain)
    rival = next((r for r in refined if r not in twins), None)
    against = rival or (twins[0] if twins else None)
    decisive = what_decides(problem, best.result, against.result) if against else ()
    proposals = tuple(next_measurements(problem, best.result, t.result) for t in twins[:MOST_SEPARATED])
    return twins, rival, decisive, proposals


def _parameters(effect: Effect, fit: FitResult) -> tuple[EffectParameter, ...]:
    return tuple(
        EffectParameter(p.name, fit.values[effect.name, p.name], p.unit, fit.std[effect.name, p.name])
        for p in effect.parameters()
    )


def _verdict(
    null: FitResult,
    current: FitResult,
    limits: tuple[float, float],
    findings: Sequence[Finding],
    faults: Sequence[Fault],
) -> tuple[str, str]:
    """Return the verdict and why, from the levels up to which a model is right and effects are believed."""
    limit, most_left = limits
    level, before = (f"{r.level * DB_PER_NEPER:.2g}" for r in (current, null))
    right = current.level <= limit
    if findings:
        names = _labels(f.effect for f in findings)
        if right:
            return EFFECT, f"{names} lowers the residual level from {before} to {level} dB"
        left = f"the {level} dB that are left are more than a right model leaves"
        if current.level <= most_left:
            return EFFECT, f"{names} lowers the residual level from {before} to {level} dB; {left}"
        return (
            UNEXPLAINED,
            f"the best of the candidates, {names}, lowers the residual level from {before}; {left}",
        )
    if right:
        if faults:
            return (
                FAULT,
                f"with {len(faults)} fault(s) of the measurement set right nothing improves the model "
                "further; "
                f"residual level {level} dB",
            )
        return NOTHING, f"no candidate improves the fitted model, whose residual level is {level} dB"
    return (
        UNEXPLAINED,
        f"the residual level stays at {level} dB, and none of the candidates lowers it enough",
    )


def _fitted(model: Model, result: FitResult) -> Model:
    """Return the full model with the values and the effects of a fit."""
    own = {e.name for e in model.effects}
    values = {ref: v for ref, v in result.values.items() if ref[0] in own}
    return model.with_values(values).with_effect(*result.effects)


def basis_error(problem: FitProblem, result: FitResult, n_lines: int = 6) -> float:
    """Check the reduced basis against direct solutions of the full model with the fitted parameters [dB].

    Effects that depend on amplitude are left out of both.
    """
    effects = tuple(e for e in result.effects if not e.amplitude_dependent)
    gone = {e.name for e in result.effects if e.amplitude_dependent}
    values = {ref: v for ref, v in result.values.items() if ref[0] not in gone}
    result = replace(result, effects=effects, values=values)
    model = problem.reduced.model
    system = assemble(_fitted(model, result), reciprocal=False)
    outputs, inputs = problem.vectors
    lines = problem.lines_up_to(np.inf, n_lines)
    f = problem.data.frequency[lines]
    zeta, *others = np.atleast_2d(problem.damping.ratio(f, result.zeta))
    connections = connection_stiffness(system) if others else None
    reduced = problem.receptance(result, lines)
    ratio = []
    backend, factor = None if system.reciprocal else "superlu", None
    for k, omega in enumerate(2 * np.pi * f):
        Z = system.dynamic_stiffness(float(omega)) + 2j * zeta[k] * system.K
        if connections is not None:
            Z = Z + 2j * (others[0][k] - zeta[k]) * connections
        factor = factorise(Z, like=factor, backend=backend)
        direct = outputs.T @ (system.Q @ factor.solve((system.Q.T @ inputs).astype(complex)))
        ratio.append(np.where(problem.data.mask[lines[k]], log_ratio(reduced[k], direct), complex("nan")))
    return rms_db(np.array(ratio))
