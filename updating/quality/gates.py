"""Checks of a measurement before any physics is fitted to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools, Complexes, Floats
from fem.summary import counted
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData, prepare
from updating.inference.fit_result import FitResult
from updating.measurement.measurement import Measurement, at_one_place
from updating.quality.corrections import Fault, corrected, uncorrected
from updating.quality.cross_prediction import Field, cross_predict
from updating.quality.phase import misphased, phase_evidence

LEAST_DIFFERENCE_DB = 0.3
"""Smaller differences of FRFs that ought to be equal are not called one [dB]."""

PASSED, FAILED, NOT_RUN = "passed", "failed", "not run"
_NEIGHBOURS = 7


@dataclass(frozen=True, slots=True)
class Reciprocity:
    """Deviation of H_jk from H_kj.

    Attributes
    ----------
    first, second : str
        The two excitations.
    error_db, noise_db : float
        Median difference of the amplitudes as a standard deviation, and the part of their noise [dB].
    """

    first: str
    second: str
    error_db: float
    noise_db: float

    @property
    def violated(self) -> bool:
        """Whether they differ by more than noise."""
        # H_jk and H_kj differ if they do by this multiple of their noise
        return self.error_db > max(3.0 * self.noise_db, LEAST_DIFFERENCE_DB)


@dataclass(frozen=True, slots=True)
class Homogeneity:
    """Deviation of the FRFs at another force level from those at the first.

    Attributes
    ----------
    measurement : str
    ratio : float
        Median difference in multiples of the noise [-]; NaN where lines or channels differ.
    somewhere : float
        The same of the tenth of the values that differ most, in means over seven lines: dependence on
        amplitude shows at few resonances, but there on many lines [-].
    largest_db : float
        Their difference [dB].
    """

    measurement: str
    ratio: float
    somewhere: float = float("nan")
    largest_db: float = float("nan")

    @property
    def violated(self) -> bool:
        """Whether they differ by more than noise."""
        # Two force levels differ if their FRFs do by this multiple of the noise
        if self.ratio > 1.5:
            return True
        # As many times the noise for the tenth of the values that differ most, averaged over neighbouring
        # lines
        return self.somewhere > 2.0 and self.largest_db > LEAST_DIFFERENCE_DB


@dataclass(frozen=True, slots=True)
class Check:
    """One gate: a check of the measurement, and its outcome.

    Attributes
    ----------
    name : str
        Such as ``"reciprocity"``.
    outcome : str
        ``"passed"``, ``"failed"`` or ``"not run"``.
    found : str
        The outcome, or why the check could not run, in a sentence.
    """

    name: str
    outcome: str
    found: str


@dataclass(frozen=True, slots=True, eq=False)
class Gates:
    """Checks of a measurement against itself and against a model with its uncertain parameters fitted.

    Attributes
    ----------
    sensors : tuple of str
    misfit : ndarray (n_out,)
        Robust level of ln(computed / measured) of each sensor [nepers].
    cross_misfit : ndarray (n_out,)
        Median distance of each sensor from the others' prediction for it, in standard deviations: about 0.8
        without faults and with a right model [-].
    reciprocity : tuple of Reciprocity
        Of each pair of excitations that both have a sensor at their place and in their direction.
    homogeneity : tuple of Homogeneity
        Of each further force level.
    noise_db, discretisation_db : float
        Noise of the measurement and error of the mesh [dB]; both count as noise.
    checks : tuple of Check
        All gates in their order, with those that could not run.
    """

    sensors: tuple[str, ...]
    misfit: Floats
    cross_misfit: Floats
    reciprocity: tuple[Reciprocity, ...]
    homogeneity: tuple[Homogeneity, ...]
    noise_db: float
    discretisation_db: float
    checks: tuple[Check, ...] = ()

    @property
    def linear(self) -> bool:
        """Whether no other force level gives other FRFs; True where there is none."""
        return not any(h.violated for h in self.homogeneity)

    @property
    def misfit_ratio(self) -> float:
        """Largest over median misfit of the sensors [-]: large where one sensor is at fault."""
        seen = self.misfit[np.isfinite(self.misfit)]
        return float(seen.max() / np.median(seen)) if seen.size and np.median(seen) > 0 else float("nan")

    @property
    def worst_sensor(self) -> str:
        """The sensor with the largest misfit."""
        return self.sensors[int(np.nanargmax(self.misfit))] if np.isfinite(self.misfit).any() else ""

    @property
    def noise_floor_db(self) -> float:
        """Noise and discretisation error together [dB]."""
        return float(np.hypot(self.noise_db, np.nan_to_num(self.discretisation_db)))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the reader, in sentences."""
        levels = tuple(_homogeneity_words(h) for h in self.homogeneity)
        return levels + tuple(
            f"the FRFs between {r.first} and {r.second} differ by {r.error_db:.2g} dB from one direction to "
            f"the other, and noise explains {r.noise_db:.2g} dB: a sensor or force is not as stated, or "
            "a part of the structure rotates (gyroscopic effects are not reciprocal)"
            for r in self.reciprocity
            if r.violated
        )


def check_gates(
    problem: FitProblem,
    result: FitResult,
    others: Sequence[Measurement] = (),
    discretisation_db: float = float("nan"),
    faults: Sequence[Fault] = (),
) -> Gates:
    """Check a measurement before physics is searched for in it.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Fit of the uncertain parameters.
    others : sequence of Measurement
        At other force levels.
    discretisation_db : float
        Error of the model's mesh, for instance of :func:`updating.inference.preparation.discretisation_error`
        [dB].
    faults : sequence of Fault
        Faults that were corrected in the problem's data; the others are corrected in the same way.
    """
    ratio = problem.log_ratio(result)
    every = np.arange(len(problem.data.frequency))
    n = ratio.shape[1]
    misfit = np.full(n, np.nan)
    for i in range(n):
        alone = np.full(ratio.shape, complex("nan"))
        alone[:, i] = ratio[:, i]
        if np.isfinite(ratio[:, i].real).any():
            misfit[i] = problem.level(alone, every)
    cross = np.full(n, np.nan)
    if problem.data.phase:
        free = problem.unloaded(result).as_forces(result)
        X = cross_predict(free, Field.of(free, result))
        z = np.abs(X.measured - X.predicted) / np.sqrt(X.variance)
        known = [i for i in range(n) if X.seen[:, i].any()]
        cross[known] = [np.median(z[:, i][X.seen[:, i]]) for i in known]
    bare = Gates(
        tuple(s.name for s in problem.data.measurement.sensors),
        misfit,
        cross,
        reciprocity(problem),
        homogeneity(problem, others, faults),
        problem.data.noise_db,
        discretisation_db,
    )
    return replace(bare, checks=_checks(problem, bare, others, faults))


def _checks(
    problem: FitProblem, gates: Gates, others: Sequence[Measurement], faults: Sequence[Fault]
) -> tuple[Check, ...]:
    """Return each gate in words."""
    data = problem.data
    share = float(np.broadcast_to(data.mask, data.H.shape).mean())
    source = data.measurement.noise_source
    noise = f"{gates.noise_db:.2f} dB, from {source}; {100 * share:.0f} % of the values count"
    out = [Check("noise", PASSED if share > 0.5 else FAILED, noise), phase_check(data.measurement)]
    if np.isfinite(gates.discretisation_db):
        change = gates.discretisation_db
        mesh = f"halving every element changes the FRFs by {change:.2f} dB, which a fit counts as noise"
        fine = gates.discretisation_db < max(gates.noise_db, LEAST_DIFFERENCE_DB)
        out.append(Check("mesh", PASSED if fine else FAILED, mesh if fine else f"{mesh}: refine the mesh"))
    out.append(_fault_check(gates, faults, ()))
    out.append(reciprocity_check(problem, gates))
    out.append(_level_check(gates, others))
    return tuple(out)


def phase_check(measurement: Measurement) -> Check:
    """Return the gate of time convention and phase in words."""
    frf = measurement.frf
    if not measurement.phase:
        return Check("phase", NOT_RUN, "the measurement has amplitudes without phase")
    if not measurement.has_structure_poles:
        return Check("phase", NOT_RUN, "responses over that of a sensor need not ring after the impulse")
    evidence = phase_evidence(frf)
    known, every = int((evidence.direction != 0).sum()), evidence.direction.size
    if not known:
        why = "no FRF rings long enough in the band to distinguish e^{+iωt} from e^{-iωt}"
        return Check("phase", NOT_RUN, why)
    wrong = misphased(evidence)
    if wrong:
        words = {"conjugate": "conjugated", "quarter turn": "a quarter turn off"}
        parts = [f"{', '.join(w.names) or 'all FRFs'} {words[w.fault]}" for w in wrong]
        return Check("phase", FAILED, f"not e^{{+iωt}} or not {frf.kind}: {'; '.join(parts)}")
    least = float(np.nanmin(np.where(evidence.direction > 0, evidence.log_ratio, np.nan)))
    more_db = 10 * np.log10(np.e) * least  # of energies, whose natural logarithm it is
    found = (
        f"{known} of {every} FRFs ring after the impulse, with at least {more_db:.0f} dB more energy than "
        "before it"
    )
    return Check("phase", PASSED, found)


def with_last_faults(gates: Gates, first: Sequence[Fault], last: Sequence[Fault]) -> Gates:
    """Return gates that state the outcome for the faults once effects were found.

    Parameters
    ----------
    gates : Gates
    first : sequence of Fault
        Faults that were corrected before the search.
    last : sequence of Fault
        Faults that remained after it, or appeared.
    """
    stay = {(f.kind, f.sensor) for f in last}
    check = _fault_check(gates, last, [f for f in first if (f.kind, f.sensor) not in stay])
    return replace(gates, checks=tuple(check if c.name == check.name else c for c in gates.checks))


def _fault_check(gates: Gates, faults: Sequence[Fault], withdrawn: Sequence[Fault]) -> Check:
    taken_back = ""
    if withdrawn:
        names = ", ".join(dict.fromkeys(f.sensor for f in withdrawn))
        taken_back = f"the apparent fault of {names} is explained by the effects that were found"
    if faults:  # of forces also where sensors are too few to check one another
        names = ", ".join(dict.fromkeys(f.sensor for f in faults))
        found = f"{counted(len(faults), 'fault')} corrected, at {names}"
        return Check("sensors and forces", FAILED, f"{found}; {taken_back}" if taken_back else found)
    if withdrawn:
        return Check("sensors and forces", PASSED, taken_back)
    if np.isnan(gates.cross_misfit).all():
        return Check("sensors and forces", NOT_RUN, "no sensor can be compared with the others")
    if len(gates.sensors) < 3:
        few = f"{len(gates.sensors)} sensors cannot check one another; three are needed"
        return Check("sensors and forces", NOT_RUN, few)
    agree = (
        "each sensor agrees with the motion that the others imply at its place; largest over median misfit "
        f"{gates.misfit_ratio:.2g} ({gates.worst_sensor})"
    )
    return Check("sensors and forces", PASSED, agree)


def reciprocity_check(problem: FitProblem, gates: Gates) -> Check:
    """Return the gate of reciprocity in words: of its pairs the worst, one that fails if any does."""
    pairs = gates.reciprocity
    if not pairs:
        n = len(problem.data.measurement.excitations)
        why = (
            "there is one excitation"
            if n < 2
            else "no two excitations both have a sensor at their place and in their direction"
        )
        return Check("reciprocity", NOT_RUN, f"{why}; H_jk = H_kj needs forces at two sensors")
    worst = max(pairs, key=lambda r: (r.violated, r.error_db / max(r.noise_db, 1e-12)))
    found = (
        f"{worst.first} and {worst.second} differ by {worst.error_db:.2g} dB from one direction to the "
        f"other; noise explains {worst.noise_db:.2g} dB"
    )
    return Check("reciprocity", FAILED if any(r.violated for r in pairs) else PASSED, found)


def _level_check(gates: Gates, others: Sequence[Measurement]) -> Check:
    if not others:
        why = "there is one measurement; a check of linearity needs two force levels"
        return Check("force levels", NOT_RUN, why)
    compared = [h for h in gates.homogeneity if np.isfinite(h.ratio)]
    words = "; ".join(_homogeneity_words(h) for h in gates.homogeneity)
    if not compared:
        return Check("force levels", NOT_RUN, words)
    return Check("force levels", PASSED if gates.linear else FAILED, words)


def _homogeneity_words(h: Homogeneity) -> str:
    if not np.isfinite(h.ratio):
        return f"{h.measurement}: not compared with the first measurement, its lines or channels differ"
    if not h.violated:
        return f"{h.measurement} and the first measurement agree within their noise: the structure is linear"
    return (
        f"{h.measurement} differs from the first measurement by {h.ratio:.2g} times the noise in "
        f"the median, and {h.somewhere:.2g} times ({h.largest_db:.2g} dB) where it differs most: the "
        "structure is not linear, or the two were not measured in the same way"
    )


def reciprocity(problem: FitProblem) -> tuple[Reciprocity, ...]:
    """Compare H_jk with H_kj where both excitations have a sensor at their place and in their direction."""
    m, data = problem.data.measurement, problem.data
    size = problem.reduced.model.mesh.size
    at: list[tuple[int, float]] = []
    for e in m.excitations:
        found = (-1, 1.0)
        for i, s in enumerate(m.sensors):
            if sign := at_one_place(s, e, 1e-6 * size):
                found = (i, sign)
        at.append(found)
    out = []
    for k in range(len(m.excitations)):
        for j in range(k):
            (row_j, sign_j), (row_k, sign_k) = at[j], at[k]
            if row_j < 0 or row_k < 0:
                continue
            seen = data.mask[:, row_j, k] & data.mask[:, row_k, j]
            if seen.sum() < 10:
                continue
            r = data.seen(log_ratio(sign_j * data.H[:, row_j, k], sign_k * data.H[:, row_k, j])[seen])
            expected = np.hypot(data.noise[:, row_j, k], data.noise[:, row_k, j])[seen]
            # Of a complex normal number with unit deviation in each part, or of a real one.
            median = 1.1774 if data.phase else 0.6745
            out.append(
                Reciprocity(
                    m.excitations[j].name,
                    m.excitations[k].name,
                    float(np.median(np.abs(r)) / median * DB_PER_NEPER),
                    float(np.median(expected) * DB_PER_NEPER),
                )
            )
    return tuple(out)


def at_level(problem: FitProblem, other: Measurement, faults: Sequence[Fault] = ()) -> FitData | None:
    """Return another measurement at the problem's lines, prepared like its data; None where they differ.

    Values count that count in both. Faults that were corrected in the problem's data are corrected in these.
    """
    first, frf = problem.data, other.frf
    before = uncorrected(first, faults).measurement
    rows = [e.name for e in before.excitations]
    if frf.outputs != tuple(s.name for s in before.sensors) or frf.inputs != tuple(rows):
        return None
    same = np.isin(frf.frequency, first.frequency)
    if same.sum() != len(first.frequency):
        return None
    data = prepare(other.with_frf(frf.select(lines=np.flatnonzero(same))))
    data = corrected(replace(data, measurement=replace(data.measurement, sensors=before.sensors)), faults)
    both = data.mask & first.mask
    # Of readings that the motion across a sensor may have made, the first data know.
    weight = np.minimum(data.weight, first.weight) * both
    return replace(data, mask=both, weight=weight, held_out=first.held_out)


def homogeneity(
    problem: FitProblem, others: Sequence[Measurement], faults: Sequence[Fault] = ()
) -> tuple[Homogeneity, ...]:
    """Compare measurements at other force levels with the problem's; a linear structure gives equal FRFs."""
    first, out = problem.data, []
    for other in others:
        data = at_level(problem, other, faults)
        if data is None or not data.mask.any():
            out.append(Homogeneity(other.name, float("nan")))
            continue
        ratio = log_ratio(data.H, first.H)
        sigma = np.hypot(data.noise, first.noise)
        # Robust: lines at resonances carry more noise than their neighbours say.
        median = float(np.median((np.abs(ratio.real) / sigma)[data.mask])) / 0.6745
        smooth = _means(np.where(data.mask, ratio / sigma, 0.0), data.mask)
        apart = _means(np.where(data.mask, ratio, 0.0), data.mask)
        # The modulus of a complex normal number with unit deviation in each part exceeds 2.146 in a tenth.
        somewhere = float(np.quantile(np.abs(smooth[data.mask]), 0.9)) * np.sqrt(_NEIGHBOURS) / 2.146
        largest = float(np.quantile(np.abs(apart[data.mask]), 0.9)) * DB_PER_NEPER
        out.append(Homogeneity(other.name, median, somewhere, largest))
    return tuple(out)


def _means(x: Complexes, seen: Bools) -> Complexes:
    """Return means over neighbouring lines that count, (n_freq, n_out, n_in)."""
    half = _NEIGHBOURS // 2

    def sums(a: NDArray[Any]) -> Any:
        total = np.cumsum(np.concatenate([np.zeros((1, *a.shape[1:])), a]), axis=0)
        k = np.arange(len(a))
        return total[np.minimum(k + half + 1, len(a))] - total[np.maximum(k - half, 0)]

    return sums(x) / np.maximum(sums(seen.astype(float)), 1.0)
