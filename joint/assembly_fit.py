"""A joint fitted to the FRFs of its assembly by output error, over ever wider bands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.effects.joint import joint_unit
from fem.reduction.reduced_model import ReducedModel, reduce_model
from joint.assembly import JointTask
from joint.average import identify_average
from joint.form import KINDS, LAWS, FormError, JointForm, relative_form
from joint.identification import JointIdentification, JointIdentificationError
from joint.identification import identify_joint as solve_directly
from joint.interface import SubstructureFRF
from joint.joint_fit import JointFit
from joint.output_error import SCAN, fit_joint
from joint.parts import ReleasedParts, deviations
from joint.substructuring import couple
from updating.correlation import DB_PER_NEPER
from updating.inference.fit import FitProblem
from updating.inference.preparation import build_problem

MOST_LINES = 800
"""Lines that are fitted at most, as many in each band, unless the task says how many."""


SETTLED = 0.1
"""Change of the error levels at which they are left alone [-]."""


SHARP = 0.15
"""Standard deviation of a parameter, over its value, up to which a band can contradict a wider one [-]."""


RAYLEIGH_MEDIAN = float(np.sqrt(np.log(2)))
"""Median of the amplitude of complex noise of standard deviation 1 [-]."""

OUTLYING = 2.0
"""Residual over its level from which a value counts less [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class FitStage:
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
    measured: Complexes
    levels: tuple[tuple[float, float], ...]
    start: str
    parts: SubstructureFRF
    given: Complexes

    def line_by_line(self, amplification: float = 1e3) -> JointIdentification | None:
        """Return Z_j line by line from the structure as fitted; None if sensors or inputs are too few."""
        try:
            return solve_directly(
                self.parts, self.fit.frequency, self.given, amplification_limit=amplification
            )
        except JointIdentificationError:
            return None

    @property
    def highest(self) -> float:
        """Highest line [Hz]."""
        return float(self.fit.frequency[-1])

    @property
    def sharp(self) -> Bools:
        """Mark the parameters with small deviations if the residual is random, (n,)."""
        std = np.sqrt(np.diag(self.fit.independent))
        return ~self.fit.at_bound & (std < SHARP * np.abs(self.fit.values))

    def disagreement(self, wider: "FitStage") -> Floats:
        """Return how far a wider band moves the joint's parameters, in standard deviations of the change.

        If the model is right, the wider band knows more and var(θ - θ') = var θ - var θ': Hausman,
        Econometrica 46 (1978) 1251-1271.
        """
        v, other = np.diag(self.fit.independent), np.diag(wider.fit.independent)
        with np.errstate(divide="ignore", invalid="ignore"):  # a value at a bound has no deviation
            off = np.abs(self.fit.values - wider.fit.values) / np.sqrt(np.maximum(v - other, 0.05 * v))
        return np.nan_to_num(off, nan=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A joint as the FRFs of its assembly show it.

    Attributes
    ----------
    task : JointTask
    stages : tuple of FitStage
        Fits to ever wider bands that agree with each other; the last one counts. Covariances are those of as
        many independent values as the modes in the band allow.
    refused : FitStage or None
        The next wider band, which contradicts the last: the model is not right there.
    prior, prior_std : (m,) arrays
        Uncertain parameters of the model [their units], and relative standard deviations [-]; of a parameter
        that is 0, that of its value.
    """

    task: JointTask
    stages: tuple[FitStage, ...]
    refused: FitStage | None
    prior: Floats
    prior_std: Floats

    @property
    def fit(self) -> JointFit:
        """The fit that counts."""
        return self.stages[-1].fit

    @property
    def measured(self) -> Complexes:
        """FRFs that it was fitted to, (n_freq, M, L) [m/N, …]."""
        return self.stages[-1].measured

    def moved(self) -> Floats:
        """How far each uncertain parameter moved, in its standard deviations before the fit, (m,) [-]."""
        return deviations(self.fit.part_values, self.prior, self.prior_std)

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


def form_of(task: JointTask, terms: Sequence[str] = ("K", "D"), coupled: bool = False) -> JointForm:
    """Return the form of the joint: stiffness, damping or a law in each direction.

    Parameters
    ----------
    task : JointTask
    terms : sequence of str
        Some of K, C, D, or one viscoelastic law, which brings its own stiffness and damping.
    coupled : bool
        Whether K couples the directions.

    Raises
    ------
    FormError
        For terms that cannot be.
    """
    known = tuple(k for k in KINDS if k != "M")
    for word in terms:
        if word not in known:
            msg = f"terms: there is no term '{word}'; allowed are {', '.join(known)}"
            raise FormError(msg)
    laws = [t for t in terms if t in LAWS]
    if len(laws) != 1 and "K" not in terms:
        msg = f"terms: {', '.join(terms) or 'nothing'} has no stiffness; give K or one of {', '.join(LAWS)}"
        raise FormError(msg)
    if laws and len(terms) > 1:
        msg = f"terms: {laws[0]} has a stiffness and damping of its own; give it alone"
        raise FormError(msg)
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
    task: JointTask,
    terms: Sequence[str] = ("K", "D"),
    *,
    coupled: bool = False,
    accuracy: float = 0.05,
    lines: JointIdentification | None = None,
) -> Estimate:
    """Fit a joint to the measured FRFs by output error, with the uncertain parameters of the parts.

    The noise of a value is that of the data and, beside it, the accuracy that is asked of the model. Where
    the fit leaves more, in any of four bands, the error of that band is taken to be the residual; values
    beyond `OUTLYING` times it count less. An error of the model is common to neighbouring lines: these stand
    for 8 independent values for each mode: deviations are those of that many.

    The band grows by a quarter of the modes at a time for as long as the wider one agrees with the narrower
    (`Stage.disagreement`): models are wrong at high frequencies first, and their error there would move the
    joint. With accuracy 0 the model is taken for exact, every value for independent, and all lines count.

    Parameters
    ----------
    task : JointTask
    terms, coupled
        As `form_of`.
    accuracy : float
        Relative to each FRF [-].
    lines : JointIdentification, optional
        Line by line: its middle is tried as a start.

    Raises
    ------
    FormError
        For terms that cannot be.
    JointIdentificationError
        If a parameter has no influence, or there are fewer data than parameters.
    """
    form = form_of(task, terms, coupled)
    nuisances = task.nuisances()
    n_lines = task.n_lines or MOST_LINES
    problem = build_problem(
        task.tied(),
        task.measurement,
        nuisances,
        damping_std=task.damping_std,
        n_lines=n_lines,
        model_error=0.0,
    )
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

    def fit_up_to(count: int, before: Sequence[FitStage]) -> FitStage:
        return _fit_stage(task, form, reduced, problem, step[:count], accuracy, lines, before)

    widest = fit_up_to(ends[-1], ())
    stages, refused = [widest], None
    if accuracy and len(ends) > 1:
        # the widest band has the most to start from; the narrowest is right first
        stages = []
        for count in ends:
            stage = fit_up_to(count, (widest, *stages[-1:]))
            if not stages and count < ends[-1] and (widest.sharp & ~stage.sharp).any():
                continue  # it knows too little to contradict anything
            # Change of a parameter by a wider band, in standard deviations of the change, that is none of
            # chance
            if stages and stages[-1].disagreement(stage)[stages[-1].sharp].max(initial=0.0) > 4.0:
                refused = stage
                break
            stages.append(stage)
    prior_std = np.append([n.std for n in nuisances], np.full(len(problem.damping.knots), task.damping_std))
    values = problem.reduced.model.values()
    prior = np.append([values[n.effect, n.parameter] for n in nuisances], problem.damping.nominal)
    return Estimate(task, tuple(stages), refused, prior, prior_std)


def _fit_stage(
    task: JointTask,
    form: JointForm,
    reduced: ReducedModel,
    problem: FitProblem,
    at: Ints,
    accuracy: float,
    lines: JointIdentification | None,
    before: Sequence[FitStage],
) -> FitStage:
    """Fit some lines from what earlier stages and the identification line by line give as starts."""
    outputs, inputs, rows = (v.T for v in task.vectors())
    parts = ReleasedParts.of(
        reduced,
        problem.data.frequency[at],
        task.interface,
        (outputs, inputs, rows),
        task.springs,
        task.nuisances(),
        problem.damping,
    )
    H = np.where(problem.data.mask[at], problem.data.H[at], np.nan)
    starts = starting_values(
        task, form, parts, H, lines, [(stage.start, stage.fit.values) for stage in before]
    )
    return _fit_with_levels(
        task, form, parts, problem, at, accuracy, starts, search=not before and form.linear
    )


def _fit_with_levels(
    task: JointTask,
    form: JointForm,
    parts: ReleasedParts,
    problem: FitProblem,
    at: Ints,
    accuracy: float,
    starts: Sequence[tuple[str, Floats]],
    *,
    search: bool,
) -> FitStage:
    """Fit some lines from several starts, with error levels of each band estimated from the residual."""
    mask, frequency = problem.data.mask[at], problem.data.frequency[at]
    bands = _bands(problem, frequency)
    size = np.abs(problem.data.H[at])
    H = np.where(mask, problem.data.H[at], np.nan)
    tried = list(starts)
    # the model's error is common to neighbouring lines, so that they are not independent
    independent = problem.n_independent(float(frequency[-1]))
    spread = np.sqrt(max(1.0, int(mask.sum()) / independent)) if accuracy else 1.0
    plain = size * np.sqrt(accuracy**2 + 2 * problem.data.noise[at] ** 2)
    plain = np.maximum(plain, 1e-6 * np.sqrt((size**2).mean(axis=0)))
    levels, less = np.ones(bands.max() + 1), np.ones(mask.shape)
    rounds = searches = 0
    while True:
        fit = partial(
            fit_joint,
            form,
            parts,
            frequency,
            H,
            noise=plain * levels[bands][:, None, None] * less * spread,
            positive="K",
            tolerance=1e-5 if accuracy else 1e-6,
        )
        fits = [fit(theta, prior=vague_prior(task, form, theta)) for _, theta in tried]
        best = int(np.argmin([each.chi2 for each in fits]))
        found = fits[best]
        tried = [(tried[best][0], found.values)]
        if search:
            # uncertain parameters of the parts hide a better minimum from a search until they are fitted
            now, _ = parts.evaluate(parts.standard(found.part_values))
            again = searched(task, form, found.values, partial(relative_distance, form, now, H))
            searches += 1
            if searches <= SEARCHES and (again != found.values).any():
                tried.append(("a search over six decades", again))
                continue
            search = False
            stepped = walked(task, form, found, fit, parts.standard)
            if stepped is not found:
                x = parts.standard(stepped.part_values)
                found = fit(stepped.values, prior=vague_prior(task, form, stepped.values), part_start=x)
                tried = [("a walk along each stiffness", found.values)]
        rounds += 1
        # Times the error levels of the bands are estimated anew at most
        if not accuracy or rounds == 3:
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
    band_levels = []
    for b in np.unique(bands[mask.any(axis=(1, 2))]):
        use = mask & (bands == b)[:, None, None]
        level = float(levels[b] * np.median(plain[use] / size[use]))
        band_levels.append((float(frequency[bands == b][-1]), level))
    fitted, _ = parts.evaluate(parts.standard(found.part_values))
    return FitStage(found, H, tuple(band_levels), tried[0][0], fitted, problem.data.H[at])


def _bands(problem: FitProblem, frequency: Floats) -> Ints:
    """Return which of up to four bands with equally many modes each line is in."""
    knots = problem.damping.knots
    edges = np.quantile(knots, [0.25, 0.5, 0.75]) if len(knots) > 4 else np.zeros(0)
    return np.searchsorted(edges, frequency)


def _spread(lines: Ints, n_lines: int, bands: Ints) -> Ints:
    """Return evenly spread lines of a band: its share of all that are fitted."""
    share = max(8, n_lines // len(np.unique(bands)))
    if len(lines) <= share:
        return lines
    return lines[np.unique(np.linspace(0, len(lines) - 1, share).round().astype(np.int64))]


# Starting points of a joint's fits, and searches around fitted values: the cost has many minima -------------


WALK = (1.2, 1.05, 1.0125)
"""Factors of ever finer steps along one stiffness [-]."""


SEARCHES = 6
"""Number of further searches for stiffnesses around the fitted values."""


def vague_prior(task: JointTask, form: JointForm, theta: Floats) -> tuple[Floats, Floats]:
    """Return the prior of θ: stiffnesses to a factor of 20, damping below the stiffness.

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


def relative_distance(form: JointForm, parts: SubstructureFRF, H: Complexes, theta: Floats) -> float:
    """Return the mean of |ln H / measured|, at most 1 each [-]."""
    with np.errstate(all="ignore"):
        off = np.abs(np.log(couple(parts, form.Z(parts.frequency, theta)).H_nn / H))
    return float(np.nanmean(np.minimum(off, 1.0)))


def searched(task: JointTask, form: JointForm, theta: Floats, far: Callable[[Floats], float]) -> Floats:
    """Return θ with one stiffness after another changed, with its damping, to where the FRFs come nearest.

    The direction that helps most comes first: another may only imitate it.
    """
    best = far(theta)
    for _ in task.directions:
        points = []
        for d in task.directions:
            diagonal = np.array([name.split(" ")[1:3] == [d, d] for name in form.names])
            points += [np.where(diagonal, factor * theta, theta) for factor in SCAN]
        size, nearest = min(((far(p), k) for k, p in enumerate(points)), default=(best, 0))
        if size > 0.99 * best:
            break
        best, theta = size, points[nearest]
    return theta


def walked(
    task: JointTask,
    form: JointForm,
    found: JointFit,
    fit: Callable[..., JointFit],
    standard: Callable[[Floats], Floats],
) -> JointFit:
    """Return the best fit along one stiffness after another, all else fitted at each of its values.

    The cost has a small minimum wherever a resonance of the model lies between two lines, and descent ends
    there. Steps from one to the next, and then finer ones, see the valley that they lie in.
    """

    def moved(at: JointFit, i: int, factor: float) -> JointFit:
        theta = at.values.copy()
        theta[i] *= factor
        mean, std = vague_prior(task, form, theta)
        # Relative standard deviation that fixes a stiffness while all else is fitted [-]
        mean[i], std[i] = theta[i], 1e-4
        start = standard(at.part_values)
        return fit(theta, prior=(mean, std), part_start=start, stages=(1.0,), max_iterations=4)

    best = found
    for step, d in product(WALK, task.directions):
        i, begin = form.names.index(f"{form.terms[0].kind} {d} {d}"), best
        for factor in (1 / step, step):
            at, missed = begin, 0
            # Steps in a row that do not lower the cost after which a walk turns round, coarse and finer [-];
            # one that doubles it counts twice
            while missed < (3, 1)[step != WALK[0]]:
                at = moved(at, i, factor)
                if at.chi2 < 0.99 * best.chi2:
                    best, missed = at, 0
                else:
                    missed += 2 if at.chi2 > 2 * best.chi2 else 1
    return best


def starting_values(
    task: JointTask,
    form: JointForm,
    parts: ReleasedParts,
    H: Complexes,
    lines: JointIdentification | None,
    before: Sequence[tuple[str, Floats]],
) -> list[tuple[str, Floats]]:
    """Return up to two starts with their names: of the model, line by line, averages, a search, other bands.

    ``before`` are the results of narrower bands.
    """
    omega = 2 * np.pi * float(np.median(parts.at_mean.frequency))
    eta = task.joint.eta or 0.01

    def values(k: Floats, loss: Floats) -> Floats:
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
    tried = [("the model's values", values(k, eta * k))]
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
        except JointIdentificationError:
            pass
        else:
            usual = values(k, eta * k)
            tried.append(("the average solution", np.where(form.semidefinite & (mean <= 0), usual, mean)))
    tried += before
    if np.isnan(tried[0][1]).any():
        return tried[-1:]

    def far(theta: Floats) -> float:
        return relative_distance(form, parts.at_mean, H, theta)

    if not before:
        tried.append(("a search over six decades", searched(task, form, tried[0][1], far)))
    first, *others = sorted(tried, key=lambda each: far(each[1]))
    scale = np.maximum(np.abs(first[1]), 1e-3 * np.abs(first[1]).max())
    # Relative difference from which two starts are worth a fit each [-]
    apart = [each for each in others if np.abs((each[1] - first[1]) / scale).max() > 0.1]
    return [first, *apart[:1]] if len(before) == 1 else [first]
