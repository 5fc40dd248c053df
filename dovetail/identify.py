"""Identification of a joint of a study from its measurement: by output error, and line by line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.config import Study
from dovetail.file.measured import sensor_rows
from dovetail.file.table import StudyError, suggest
from fem.analysis.frf import compute_frf
from fem.connection_damping import ConnectionDamping
from fem.effects.joint import Joint, joint_unit
from fem.effects.joint_patch import JointPatch
from fem.effects.joint_stiffness import JointStiffness
from fem.model import DIRECTIONS, Model, directions_from
from fem.reduction.reduced import ReducedModel, reduce_model
from fem.system import assemble
from joint import (
    CoordinateSet,
    IdentificationError,
    Interface,
    JointFit,
    JointForm,
    JointIdentification,
    ReleasedParts,
    SubstructureFRF,
    couple,
    fit_joint,
    identify_average,
    relative_form,
)
from joint import identify_joint as solve_directly
from joint.form import KINDS, LAWS
from joint.output_error import SCAN
from updating.correlation import DB_PER_NEPER
from updating.inference.fit import INDEPENDENT_PER_MODE, FitProblem
from updating.inference.parameters import Nuisance
from updating.inference.preparation import build_problem
from updating.measurement.measurement import Measurement

MOST_LINES = 800
"""Lines that are fitted at most, as many in each band, unless the study says how many."""

ROUNDS = 3
"""Times the error levels of the bands are estimated anew at most."""

SETTLED = 0.1
"""Change of the error levels at which they are left alone [-]."""

CONTRADICTION = 4.0
"""Change of a parameter by a wider band, in standard deviations of the change, that is none of chance."""

SHARP = 0.15
"""Standard deviation of a parameter, over its value, up to which a band can contradict a wider one [-]."""

DISTINCT = 0.1
"""Relative difference from which two starts are worth a fit each [-]."""

RAYLEIGH_MEDIAN = float(np.sqrt(np.log(2)))
"""Median of the amplitude of complex noise of standard deviation 1 [-]."""

OUTLYING = 2.0
"""Residual over its level from which a value counts less [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What is asked of a joint of a study.

    Attributes
    ----------
    study : Study
    joint : Joint
    directions : tuple of str
        Relative motions whose dynamic stiffness is asked for.
    measurement : Measurement
        With the lines of the study's band above 0 Hz.
    """

    study: Study
    joint: Joint
    directions: tuple[str, ...]
    measurement: Measurement

    @property
    def index(self) -> list[int]:
        """Places of the directions among x y z rx ry rz."""
        return [DIRECTIONS.index(d) for d in self.directions]

    @property
    def interface(self) -> Interface:
        """Names of relative motions, responses and inputs."""
        m = self.measurement
        return Interface(
            joint=CoordinateSet(tuple(f"{self.joint.name}:{d}" for d in self.directions)),
            outputs=CoordinateSet(tuple(f"{s.name}:x" for s in m.sensors)),
            inputs=CoordinateSet(tuple(f"{s.name}:x" for s in m.excitations)),
        )

    @property
    def springs(self) -> NDArray[np.float64]:
        """Springs that hold the directions: the study's, or as stiff as the members themselves, (p,)."""
        own = np.diag(np.asarray(self.joint.K, dtype=float))[self.index]
        held = [d in self.joint.rigid for d in self.directions]
        return np.where((own > 0) & ~np.array(held), own, _typical(self.study.model, self.directions))

    def tied(self) -> Model:
        """Return the model with elastic springs, and nothing else, in the directions of the joint."""
        index, joint = self.index, self.joint
        K, C, D = (np.array(X, dtype=float) for X in (joint.K, joint.C, joint.D))
        for X in (K, C, D):
            X[index, :] = 0.0
            X[:, index] = 0.0
        # the loss factor multiplies all of K: put into D, so that the springs to be taken out have none
        D = D + joint.eta * K
        K[index, index] = self.springs
        rigid = tuple(d for d in joint.rigid if d not in self.directions)
        held = replace(joint, K=K, C=C, D=D, eta=0.0, rigid=rigid)
        model = self.study.model
        return replace(model, effects=tuple(held if e.name == joint.name else e for e in model.effects))

    def vectors(self) -> tuple[NDArray[np.float64], ...]:
        """Responses, inputs and relative motions as rows of combinations of degrees of freedom."""
        model, m = self.study.model, self.measurement
        dofs, B = self.joint.relative(model)
        rows = np.zeros((len(self.index), model.n_dof))
        rows[:, dofs] = B[self.index]
        return sensor_rows(model, m.sensors), sensor_rows(model, m.excitations), rows

    def nuisances(self) -> tuple[Nuisance, ...]:
        """Return what is uncertain besides the directions asked for."""
        asked = {f"k{d}" for d in self.directions} | {"eta"}
        return tuple(
            n for n in self.study.nuisances if not (n.effect == self.joint.name and n.parameter in asked)
        )


def read_task(study: Study, name: str, directions: str, measurement: str | None = None) -> Task:
    """Check what is asked of a joint.

    Parameters
    ----------
    study : Study
    name : str
        Name of a joint.
    directions : str
        Some of x y z rx ry rz, or all.
    measurement : str, optional
        Name of the measurement; the first unless given.

    Raises
    ------
    StudyError
        For an unknown joint or measurement, or no measurement.
    """
    joints = {j.name: j for j in study.model.of_kind(Joint)}
    if name not in joints:
        msg = f"{study.path}: there is no joint '{name}'; {suggest(name, joints)}"
        raise StudyError(msg)
    wanted = directions_from(directions, "--directions")
    if not wanted:
        msg = "--directions: no direction is named; some of x y z rx ry rz are needed"
        raise StudyError(msg)
    measured = _measurement(study, measurement)
    frf = measured.frf.select(lines=measured.frf.frequency > 0, band=study.band)
    study = replace(study, model=_with_known(study, name))
    joint = study.model.effect(name)
    assert isinstance(joint, Joint)
    return Task(study, joint, wanted, measured.with_frf(frf))


def _with_known(study: Study, name: str) -> Model:
    """Return the model whose joint has the stiffness of effects that are known for it.

    Beside a joint that is fitted, they would be taken for a part of all else.

    Raises
    ------
    StudyError
        For known effects of the joint that its matrices cannot say.
    """
    model = study.model
    for effect in study.model.effects:
        if isinstance(effect, ConnectionDamping):
            # the joint's own loss is identified: it must have no other
            model = model.without_effect(effect.name).with_effect(replace(effect, but=(*effect.but, name)))
        if effect.name == name or name not in (getattr(effect, "joint", ""), *getattr(effect, "joints", ())):
            continue
        if isinstance(effect, JointPatch):
            continue  # it says where the joint acts
        if not isinstance(effect, JointStiffness) or effect.joints != (name,):
            msg = (
                f"{study.path}: the effect '{effect.name}' in [[effects]] acts on joint '{name}'; what is "
                "identified would be beside it: take it out"
            )
            raise StudyError(msg)
        joint = model.effect(name)
        assert isinstance(joint, Joint)
        i, K = DIRECTIONS.index(effect.direction), np.array(joint.K, dtype=float)
        K[i, i] = effect.stiffness
        rigid = tuple(d for d in joint.rigid if d != effect.direction)
        new = replace(joint, K=K, rigid=rigid)
        kept = (e for e in model.effects if e.name != effect.name)
        model = replace(model, effects=tuple(new if e.name == name else e for e in kept))
    return model


def identify(task: Task, amplification: float = 1e3) -> JointIdentification:
    """Identify a joint's dynamic stiffness in some directions of its relative motion, line by line.

    The substructures are the study's model without the joint's stiffness and damping in these directions; in
    the others it keeps those of the study. Their receptances are those of the model with elastic springs k in
    these directions, which are then taken out again, H = H' + H'_d (1/k - H'_dd)⁻¹ H'_d; so parts that
    nothing else connects need no treatment of their own.

    Parameters
    ----------
    task : Task
    amplification : float
        Largest amplification of errors of a line that counts [-].

    Returns
    -------
    JointIdentification
        ``z`` is the dynamic stiffness in the directions, (n_freq, p, p), the joint's axes.

    Raises
    ------
    IdentificationError
        If the sensors and excitations cannot determine it.
    """
    frf = task.measurement.frf.as_kind("receptance")
    try:
        return solve_directly(_without(task), frf.frequency, frf.H, amplification_limit=amplification)
    except IdentificationError as reason:
        msg = f"joint '{task.joint.name}' in {', '.join(task.directions)}: {reason}"
        raise IdentificationError(msg) from reason


def _measurement(study: Study, name: str | None) -> Measurement:
    by_name = {m.name: m for m in study.measurements}
    if not by_name:
        msg = f"{study.path}: it has no [[measurements]]; the identification needs the measured assembly"
        raise StudyError(msg)
    if name is not None and name not in by_name:
        msg = f"{study.path}: there is no measurement '{name}'; {suggest(name, by_name)}"
        raise StudyError(msg)
    return by_name[name] if name is not None else study.measurements[0]


def _without(task: Task) -> SubstructureFRF:
    """Return the receptances of the model without a joint's stiffness in some directions."""
    model, frequency, k = task.study.model, task.measurement.frf.frequency, task.springs
    outputs, inputs, rows = task.vectors()
    # the direct method is exact, and asks for damping without modal ratios
    method = "reduced" if model.damping.ratio.any() else "direct"
    H = compute_frf(
        assemble(task.tied()),
        frequency,
        np.vstack([outputs, rows]),
        np.vstack([inputs, rows]),
        "receptance",
        method,
    ).H
    m, n = len(outputs), len(inputs)
    # the structure's own damping acts on these springs as on everything else
    omega = 2 * np.pi * frequency[:, None, None]
    z = np.diag(k) * (1 + 1j * (model.damping.loss_factor + omega * model.damping.beta))
    H = H + H[:, :, n:] @ np.linalg.solve(np.linalg.inv(z) - H[:, m:, n:], H[:, m:, :])
    return SubstructureFRF(frequency, task.interface, H[:, :m, :n], H[:, :m, n:], H[:, m:, :n], H[:, m:, n:])


def _typical(model: Model, directions: tuple[str, ...]) -> np.ndarray:
    """Return stiffnesses of the order of the members' own, E A / L and E I / L."""
    frame: Any = model.effect("frame")
    out = []
    for d in directions:
        values = [
            p.material.E
            * (p.section.A if d in "xyz" else p.section.Iy + p.section.Iz)
            / model.mesh.member_length(name)
            for name, p in frame.members.items()
        ]
        out.append(float(np.median(values)))
    return np.array(out)


def summarise(found: JointIdentification, directions: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return constant stiffness and damping of each direction: medians over the lines that count.

    z = k (1 + i eta) = k + i ω c; the scatter is 1.48 times the median absolute deviation of a line.
    """
    keep = found.regular
    omega = 2 * np.pi * found.frequency[keep]
    out = []
    for i, d in enumerate(directions):
        z = found.z[keep, i, i]
        k = float(np.median(z.real))
        out.append(
            {
                "direction": d,
                "k": k,
                "k_scatter": 1.4826 * float(np.median(np.abs(z.real - k))),
                "unit": joint_unit(d),
                "eta": float(np.median(z.imag)) / k if k else float("nan"),
                "c": float(np.median(z.imag / omega)),
                "unit_c": joint_unit(d, "c"),
            }
        )
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A fit to the lines up to some frequency.

    Attributes
    ----------
    fit : JointFit
    measured : (n_freq, M, L) complex array
        Receptances that were fitted, NaN where a value did not count [m/N, …].
    levels : tuple of (float, float)
        Upper end of each band [Hz] and the error that is left there, relative to each FRF [-].
    start : str
        Where the fit started.
    parts : SubstructureFRF
        The structure without the joint, as fitted.
    given : (n_freq, M, L) complex array
        All measured receptances, those that did not count too [m/N, …].
    """

    fit: JointFit
    measured: NDArray[np.complex128]
    levels: tuple[tuple[float, float], ...]
    start: str
    parts: SubstructureFRF
    given: NDArray[np.complex128]

    def line_by_line(self, amplification: float = 1e3) -> JointIdentification | None:
        """Return Z_j line by line from the structure as fitted; None if sensors or inputs are too few."""
        try:
            return solve_directly(
                self.parts, self.fit.frequency, self.given, amplification_limit=amplification
            )
        except IdentificationError:
            return None

    @property
    def highest(self) -> float:
        """Highest line [Hz]."""
        return float(self.fit.frequency[-1])

    @property
    def sharp(self) -> NDArray[np.bool_]:
        """Mark the parameters that it knows well if what is left is random, (n,)."""
        std = np.sqrt(np.diag(self.fit.independent))
        return ~self.fit.at_bound & (std < SHARP * np.abs(self.fit.values))

    def disagreement(self, wider: "Stage") -> NDArray[np.float64]:
        """Return how far a wider band moves the joint's parameters, in standard deviations of the change.

        If the model is right, the wider band knows more and var(θ - θ') = var θ - var θ': Hausman,
        Econometrica 46 (1978) 1251-1271.
        """
        own, other = np.diag(self.fit.independent), np.diag(wider.fit.independent)
        with np.errstate(divide="ignore", invalid="ignore"):  # a value at a bound has no deviation
            off = np.abs(self.fit.values - wider.fit.values) / np.sqrt(np.maximum(own - other, 0.05 * own))
        return np.nan_to_num(off, nan=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A joint of a study as its FRFs say it is.

    Attributes
    ----------
    task : Task
    stages : tuple of Stage
        Fits to ever wider bands that agree with each other; the last one counts. Covariances are those of as
        many independent values as the modes in the band allow.
    refused : Stage or None
        The next wider band, which contradicts the last: the model is not right there.
    prior, prior_std : (m,) arrays
        Uncertain parameters in the study [their units], and relative standard deviations [-].
    """

    task: Task
    stages: tuple[Stage, ...]
    refused: Stage | None
    prior: NDArray[np.float64]
    prior_std: NDArray[np.float64]

    @property
    def fit(self) -> JointFit:
        """The fit that counts."""
        return self.stages[-1].fit

    @property
    def measured(self) -> NDArray[np.complex128]:
        """What it was fitted to, (n_freq, M, L) [m/N, …]."""
        return self.stages[-1].measured

    def moved(self) -> NDArray[np.float64]:
        """How far each uncertain parameter moved, in its standard deviations before the fit, (m,) [-]."""
        return np.log(self.fit.part_values / self.prior) / self.prior_std

    @property
    def misfit_db(self) -> float:
        """Root mean square of ln |H / measured| over all values that count [dB]."""
        ratio = np.abs(self.fit.H) / np.abs(self.measured)
        return float(np.sqrt(np.nanmean(np.log(ratio) ** 2)) * DB_PER_NEPER)

    def determined(self, name: str) -> bool:
        """Whether the data determine a parameter of the joint."""
        known = self.fit.identifiability
        return bool(known.determined[known.names.index(name)])

    def correlated(self, limit: float = 0.5) -> list[tuple[str, str, float]]:
        """Return pairs of a parameter of the joint and any other whose estimates depend on each other."""
        known, n = self.fit.identifiability, len(self.fit.values)
        pairs = [
            (known.names[i], known.names[j], float(known.correlation[i, j]))
            for i in range(n)
            for j in range(i + 1, len(known.names))
        ]
        return sorted((p for p in pairs if abs(p[2]) > limit), key=lambda p: -abs(p[2]))

    def rows(self) -> list[dict[str, Any]]:
        """Return a table of the joint's parameters; those at a bound have no deviation."""
        fit, units = self.fit, dict(self.fit.form.parameters)
        return [
            {
                "parameter": name,
                "value": float(value),
                "std": _finite(std),
                "low": _finite(low),
                "high": _finite(high),
                "unit": units[name],
                "determined": self.determined(name),
                "at_bound": bool(bound),
                "open_end": end,
                "words": fit.words(k),
            }
            for k, (name, value, std, (low, high), bound, end) in enumerate(
                zip(
                    fit.form.names,
                    fit.values,
                    fit.std,
                    fit.interval(),
                    fit.at_bound,
                    fit.open_end,
                    strict=True,
                )
            )
        ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def form_of(task: Task, terms: Sequence[str] = ("K", "D"), coupled: bool = False) -> JointForm:
    """Return what the joint may be: stiffness, damping or a law in each direction.

    Parameters
    ----------
    task : Task
    terms : sequence of str
        Some of K, C, D, or one viscoelastic law, which brings its own stiffness and damping.
    coupled : bool
        Whether K couples the directions.

    Raises
    ------
    StudyError
        For terms that cannot be.
    """
    known = tuple(k for k in KINDS if k != "M")
    for word in terms:
        if word not in known:
            msg = f"--terms: there is no term '{word}'; {suggest(word, known)}"
            raise StudyError(msg)
    laws = [t for t in terms if t in LAWS]
    if len(laws) != 1 and "K" not in terms:
        msg = f"--terms: {', '.join(terms) or 'nothing'} has no stiffness; give K or one of {', '.join(LAWS)}"
        raise StudyError(msg)
    if laws and len(terms) > 1:
        msg = f"--terms: {laws[0]} has a stiffness and damping of its own; give it alone"
        raise StudyError(msg)
    names, p = task.directions, len(task.directions)
    B, one = np.eye(p), np.eye(p, dtype=bool)
    K = relative_form(
        task.interface.joint, B, (laws or ["K"])[:1], pattern=np.ones((p, p)) if coupled else one, names=names
    )
    for kind in (t for t in dict.fromkeys(terms) if t in ("C", "D")):
        for i, d in enumerate(names):
            K = K.with_term(
                f"{kind} {d} {d}", kind, np.outer(B[i], B[i]), joint_unit(d, "c" if kind == "C" else "k")
            )
    return K


def estimate(
    task: Task,
    terms: Sequence[str] = ("K", "D"),
    *,
    coupled: bool = False,
    accuracy: float = 0.05,
    lines: JointIdentification | None = None,
) -> Estimate:
    """Fit a joint to the measured FRFs by output error, with what the study says is uncertain beside it.

    The noise of a value is that of the data and, beside it, the accuracy that is asked of the model. Where
    the fit leaves more, in any of four bands, the error of that band is taken to be what is left; values
    beyond `OUTLYING` times it count less. An error of the model is common to neighbouring lines: these stand
    for 8 independent values for each mode: deviations are those of that many.

    The band grows by a quarter of the modes at a time for as long as the wider one agrees with the narrower
    (`Stage.disagreement`): models are wrong at high frequencies first, and what is wrong there would move the
    joint. With accuracy 0 the model is taken for exact, every value for independent, and all lines count.

    Parameters
    ----------
    task : Task
    terms, coupled
        As `form_of`.
    accuracy : float
        Relative to each FRF [-].
    lines : JointIdentification, optional
        Line by line: its middle is tried as a start.

    Raises
    ------
    StudyError
        For terms that cannot be.
    IdentificationError
        If a parameter has no influence, or there are fewer data than parameters.
    """
    form = form_of(task, terms, coupled)
    study, nuisances = task.study, task.nuisances()
    n_lines = study.n_lines or MOST_LINES
    problem = build_problem(
        task.tied(), task.measurement, nuisances,
        damping_std=study.damping_std, n_lines=n_lines, model_error=0.0,
    )  # fmt: skip
    every = _bands(problem, problem.data.frequency)
    step = np.concatenate([_spread(np.flatnonzero(every == b), n_lines, every) for b in np.unique(every)])
    vectors = [rows.T for rows in task.vectors()]
    reduced = reduce_model(
        problem.reduced.model,
        np.hstack(vectors),
        float(problem.data.frequency[-1]),
        margin=2.5,
        n_krylov=2,
        releasable=False,
    )
    bands = every[step]
    ends = [int(np.flatnonzero(bands == b)[-1]) + 1 for b in np.unique(bands)]
    fit_up_to = partial(_fit_stage, task, form, reduced, problem, step, bands, accuracy, lines)
    whole = fit_up_to(ends[-1], ())
    stages, refused = [whole], None
    if accuracy and len(ends) > 1:
        # the widest band has the most to start from; the narrowest is right first
        stages = []
        for count in ends:
            stage = fit_up_to(count, (whole, *stages[-1:]))
            if not stages and count < ends[-1] and (whole.sharp & ~stage.sharp).any():
                continue  # it knows too little to contradict anything
            if stages and stages[-1].disagreement(stage)[stages[-1].sharp].max(initial=0.0) > CONTRADICTION:
                refused = stage
                break
            stages.append(stage)
    prior_std = np.append([n.std for n in nuisances], np.full(len(problem.damping.knots), study.damping_std))
    values = problem.reduced.model.values()
    prior = np.append([values[n.effect, n.parameter] for n in nuisances], problem.damping.nominal)
    return Estimate(task, tuple(stages), refused, prior, prior_std)


WALK = (1.2, 1.05, 1.0125)
"""Factors of ever finer steps along one stiffness [-]."""

MISSES = 3, 1
"""Steps in a row that do not lower the cost after which a walk turns round, coarse and finer [-]; one that
doubles it counts twice."""

HELD = 1e-4
"""Standard deviation of a stiffness that is held while all else is fitted, of itself [-]."""

SEARCHES = 6
"""Times stiffnesses are searched anew beside what was fitted."""


def _fit_stage(
    task: Task,
    form: JointForm,
    reduced: ReducedModel,
    problem: FitProblem,
    step: NDArray[np.int64],
    bands: NDArray[np.int64],
    accuracy: float,
    lines: JointIdentification | None,
    count: int,
    before: Sequence[Stage],
) -> Stage:
    """Fit the first of the lines, with error levels of each band estimated from what is left."""
    at, bands = step[:count], bands[:count]
    mask, frequency = problem.data.mask[at], problem.data.frequency[at]
    outputs, inputs, rows = (v.T for v in task.vectors())
    parts = ReleasedParts.of(
        reduced, frequency, task.interface, (outputs, inputs, rows), task.springs, task.nuisances(),
        problem.damping,
    )  # fmt: skip
    size = np.abs(problem.data.H[at])
    H = np.where(mask, problem.data.H[at], np.nan)
    tried = _starts(task, form, parts, H, lines, before)
    # the model's error is common to neighbouring lines, so that they are not independent
    share = np.searchsorted(problem.data.frequency, frequency[-1]) / len(problem.data.frequency)
    independent = INDEPENDENT_PER_MODE * max(problem.n_modes * share, 1.0)
    spread = np.sqrt(max(1.0, int(mask.sum()) / independent)) if accuracy else 1.0
    plain = size * np.sqrt(accuracy**2 + 2 * problem.data.noise[at] ** 2)
    plain = np.maximum(plain, 1e-6 * np.sqrt((size**2).mean(axis=0)))
    levels, less = np.ones(bands.max() + 1), np.ones(mask.shape)
    rounds = searches = 0
    searching = not before and form.linear
    while True:
        fit = partial(
            fit_joint, form, parts, frequency, H, noise=plain * levels[bands][:, None, None] * less * spread,
            positive="K", tolerance=1e-5 if accuracy else 1e-6,
        )  # fmt: skip
        fits = [fit(theta, prior=_vague(task, form, theta)) for _, theta in tried]
        best = int(np.argmin([each.chi2 for each in fits]))
        found = fits[best]
        tried = [(tried[best][0], found.values)]
        if searching:
            # what is uncertain beside the joint hides a better place from a search, until it is fitted
            now, _ = parts.evaluate(parts.standard(found.part_values))
            again = _searched(task, form, found.values, partial(_distance, form, now, H))
            searches += 1
            if searches <= SEARCHES and (again != found.values).any():
                tried.append(("a search over six decades", again))
                continue
            searching = False
            walked = _walked(task, form, found, fit, parts.standard)
            if walked is not found:
                x = parts.standard(walked.part_values)
                found = fit(walked.values, prior=_vague(task, form, walked.values), part_start=x)
                tried = [("a walk along each stiffness", found.values)]
        rounds += 1
        if not accuracy or rounds == ROUNDS:
            break
        r = np.abs(np.nan_to_num(found.H - H)) / plain
        new = np.ones(len(levels))
        for b in np.unique(bands[mask.any(axis=(1, 2))]):
            new[b] = max(1.0, float(np.median(r[bands == b][mask[bands == b]])) / RAYLEIGH_MEDIAN)
        settled = np.abs(np.log(new / levels)).max() < SETTLED
        levels = new
        less = np.sqrt(np.maximum(1.0, r / levels[bands][:, None, None] / OUTLYING))
        if settled:
            break
    left = []
    for b in np.unique(bands[mask.any(axis=(1, 2))]):
        use = mask & (bands == b)[:, None, None]
        left.append((float(frequency[bands == b][-1]), float(levels[b] * np.median(plain[use] / size[use]))))
    fitted, _ = parts.evaluate(parts.standard(found.part_values))
    return Stage(found, H, tuple(left), tried[0][0], fitted, problem.data.H[at])


def _bands(problem: FitProblem, frequency: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return which of up to four bands with equally many modes each line is in."""
    knots = problem.damping.knots
    edges = np.quantile(knots, [0.25, 0.5, 0.75]) if len(knots) > 4 else np.zeros(0)
    return np.searchsorted(edges, frequency)


def _spread(lines: NDArray[np.int64], n_lines: int, bands: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return evenly spread lines of a band: its share of all that are fitted."""
    share = max(8, n_lines // len(np.unique(bands)))
    if len(lines) <= share:
        return lines
    return lines[np.unique(np.linspace(0, len(lines) - 1, share).round().astype(np.int64))]


def _vague(
    task: Task, form: JointForm, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what is taken for known of θ: stiffnesses to a factor of 20, damping below the stiffness.

    It is next to nothing for a parameter that the data determine, and holds the others.
    """
    k = dict(zip(task.directions, task.springs, strict=True))
    omega = 2 * np.pi * float(np.median(task.measurement.frf.frequency))
    mean, std = np.zeros(len(form.names)), np.full(len(form.names), np.inf)
    for n, name in enumerate(form.names):
        kind, a, b = name.split(" ")[:3]
        if len(name.split(" ")) > 3:  # a law's own parameter, which has bounds
            continue
        now = [max(abs(theta[form.names.index(f"{form.terms[0].kind} {d} {d}")]), k[d]) for d in (a, b)]
        size = float(np.sqrt(now[0] * now[1]))
        if kind in ("C", "D"):
            std[n] = size / (omega if kind == "C" else 1.0)
        elif a == b:
            mean[n], std[n] = k[a], np.log(20.0)
        else:
            std[n] = size
    return mean, std


def _distance(
    form: JointForm, parts: SubstructureFRF, H: NDArray[np.complex128], theta: NDArray[np.float64]
) -> float:
    """Return the mean of |ln H / measured|, at most 1 each [-]."""
    with np.errstate(all="ignore"):
        off = np.abs(np.log(couple(parts, form.Z(parts.frequency, theta)).H_nn / H))
    return float(np.nanmean(np.minimum(off, 1.0)))


def _searched(
    task: Task,
    form: JointForm,
    theta: NDArray[np.float64],
    far: Callable[[NDArray[np.float64]], float],
) -> NDArray[np.float64]:
    """Return θ with one stiffness after another changed, with its damping, to where the FRFs come nearest.

    The direction that helps most comes first: another may only imitate it.
    """
    best = far(theta)
    for _ in task.directions:
        points = []
        for d in task.directions:
            own = np.array([name.split(" ")[1:3] == [d, d] for name in form.names])
            points += [np.where(own, factor * theta, theta) for factor in SCAN]
        size, nearest = min(((far(p), k) for k, p in enumerate(points)), default=(best, 0))
        if size > 0.99 * best:
            break
        best, theta = size, points[nearest]
    return theta


def _walked(
    task: Task,
    form: JointForm,
    found: JointFit,
    fit: Callable[..., JointFit],
    standard: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> JointFit:
    """Return the best fit along one stiffness after another, all else fitted at each of its values.

    The cost has a small minimum wherever a resonance of the model lies between two lines, and descent ends
    there. Steps from one to the next, and then finer ones, see the valley that they lie in.
    """

    def moved(at: JointFit, i: int, factor: float) -> JointFit:
        theta = at.values.copy()
        theta[i] *= factor
        mean, std = _vague(task, form, theta)
        mean[i], std[i] = theta[i], HELD
        start = standard(at.part_values)
        return fit(theta, prior=(mean, std), part_start=start, stages=(1.0,), max_iterations=4)

    best = found
    for step, d in product(WALK, task.directions):
        i, begin = form.names.index(f"{form.terms[0].kind} {d} {d}"), best
        for factor in (1 / step, step):
            at, missed = begin, 0
            while missed < MISSES[step != WALK[0]]:
                at = moved(at, i, factor)
                if at.chi2 < 0.99 * best.chi2:
                    best, missed = at, 0
                else:
                    missed += 2 if at.chi2 > 2 * best.chi2 else 1
    return best


def _starts(
    task: Task,
    form: JointForm,
    parts: ReleasedParts,
    H: NDArray[np.complex128],
    lines: JointIdentification | None,
    before: Sequence[Stage],
) -> list[tuple[str, NDArray[np.float64]]]:
    """Return up to two starts: the study's values, line by line, averages, a search, other bands."""
    omega = 2 * np.pi * float(np.median(parts.at_mean.frequency))
    eta = task.joint.eta or 0.01

    def values(k: NDArray[np.float64], loss: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.zeros(len(form.names))
        for i, d in enumerate(task.directions):
            for kind, value in (("K", k[i]), ("D", loss[i]), ("C", loss[i] / omega)):
                if f"{kind} {d} {d}" in form.names:
                    out[form.names.index(f"{kind} {d} {d}")] = value
            for law in LAWS:
                if f"{law} {d} {d}" in form.names:
                    at = form.names.index(f"{law} {d} {d}")
                    out[at] = k[i]
                    out[[n.startswith(f"{law} {d} {d} ") for n in form.names]] = np.nan
        return out

    k = task.springs
    tried = [("the study's values", values(k, eta * k))]
    if lines is not None and lines.regular.sum() >= 8:
        middle = np.median(np.diagonal(lines.z[lines.regular], axis1=1, axis2=2), axis=0)
        size = np.where(middle.real > 0, middle.real, k)
        loss = np.where(middle.imag > 0, middle.imag, eta * size)
        tried.append(("the middle of the lines", values(size, loss)))
    if form.linear and np.isfinite(H).all():
        try:
            mean = identify_average(
                parts.at_mean, parts.at_mean.frequency, H, form, complete=True, misfit_limit=np.inf
            ).values
        except IdentificationError:
            pass
        else:
            usual = values(k, eta * k)
            tried.append(("the average solution", np.where(form.semidefinite & (mean <= 0), usual, mean)))
    tried += [(stage.start, stage.fit.values) for stage in before]
    if np.isnan(tried[0][1]).any():
        return tried[-1:]

    def far(theta: NDArray[np.float64]) -> float:
        return _distance(form, parts.at_mean, H, theta)

    if not before:
        tried.append(("a search over six decades", _searched(task, form, tried[0][1], far)))
    first, *others = sorted(tried, key=lambda each: far(each[1]))
    scale = np.maximum(np.abs(first[1]), 1e-3 * np.abs(first[1]).max())
    apart = [each for each in others if np.abs((each[1] - first[1]) / scale).max() > DISTINCT]
    return [first, *apart[:1]] if len(before) == 1 else [first]
