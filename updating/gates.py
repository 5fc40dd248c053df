"""What is checked of a measurement before any physics is fitted to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from updating.correlation import DB_PER_NEPER, log_ratio
from updating.cross_prediction import Field, cross_predict
from updating.fit import FitProblem, FitResult
from updating.measurement import Measurement

NOT_RECIPROCAL = 3.0
"""H_jk and H_kj differ if they do by this multiple of their noise."""
NOT_HOMOGENEOUS = 1.5
"""Two force levels differ if their FRFs do by this multiple of the noise."""
LEAST_DIFFERENCE_DB = 0.3
"""Smaller differences of FRFs that ought to be equal are not called one [dB]."""


@dataclass(frozen=True, slots=True)
class Reciprocity:
    """How far H_jk is from H_kj.

    Attributes
    ----------
    first, second : str
        The two excitations.
    error_db, noise_db : float
        Median difference of the amplitudes as a standard deviation, and what their noise explains [dB].
    """

    first: str
    second: str
    error_db: float
    noise_db: float

    @property
    def violated(self) -> bool:
        """Whether they differ by more than noise."""
        return self.error_db > max(NOT_RECIPROCAL * self.noise_db, LEAST_DIFFERENCE_DB)


@dataclass(frozen=True, slots=True)
class Homogeneity:
    """How far the FRFs of another force level are from the first's.

    Attributes
    ----------
    measurement : str
    ratio : float
        Median difference in multiples of what noise explains [-]; NaN where lines or channels differ.
    """

    measurement: str
    ratio: float

    @property
    def violated(self) -> bool:
        """Whether they differ by more than noise."""
        return self.ratio > NOT_HOMOGENEOUS


@dataclass(frozen=True, slots=True, eq=False)
class Gates:
    """Checks of a measurement against itself and against a model with its uncertain parameters fitted.

    Attributes
    ----------
    sensors : tuple of str
    misfit : ndarray (n_out,)
        Robust level of ln(computed / measured) of each sensor [nepers].
    cross_misfit : ndarray (n_out,)
        Median distance of each sensor from what the others predict for it, in standard deviations: about 0.8
        without faults and with a right model [-].
    reciprocity : tuple of Reciprocity
        Of each pair of excitations that both have a sensor at their place and in their direction.
    homogeneity : tuple of Homogeneity
        Of each further force level.
    noise_db, discretisation_db : float
        Noise of the measurement and error of the mesh [dB]; both count as noise.
    """

    sensors: tuple[str, ...]
    misfit: NDArray[np.float64]
    cross_misfit: NDArray[np.float64]
    reciprocity: tuple[Reciprocity, ...]
    homogeneity: tuple[Homogeneity, ...]
    noise_db: float
    discretisation_db: float

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
        """What a reader should know, in sentences."""
        return tuple(
            f"the FRFs between {r.first} and {r.second} differ by {r.error_db:.2g} dB from one direction to "
            f"the other, and noise explains {r.noise_db:.2g} dB: a sensor or force is not as stated, or "
            "something turns (gyroscopic effects are not reciprocal)"
            for r in self.reciprocity
            if r.violated
        )


def check_gates(
    problem: FitProblem,
    result: FitResult,
    others: Sequence[Measurement] = (),
    discretisation_db: float = float("nan"),
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
        Error of the model's mesh, for instance of :func:`updating.diagnosis.discretisation_error` [dB].
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
    X = cross_predict(problem, Field.of(problem, result))
    z = np.abs(X.measured - X.predicted) / np.sqrt(X.variance)
    cross = np.array([np.median(z[:, i][X.seen[:, i]]) if X.seen[:, i].any() else np.nan for i in range(n)])
    return Gates(
        tuple(s.name for s in problem.data.measurement.sensors),
        misfit,
        cross,
        reciprocity(problem),
        homogeneity(problem, others),
        problem.data.noise_db,
        discretisation_db,
    )


def reciprocity(problem: FitProblem) -> tuple[Reciprocity, ...]:
    """Compare H_jk with H_kj where both excitations have a sensor at their place and in their direction."""
    m, data = problem.data.measurement, problem.data
    size = problem.reduced.model.mesh.size
    at: list[tuple[int, float]] = []
    for e in m.excitations:
        found = (-1, 1.0)
        for i, s in enumerate(m.sensors):
            cosine = float(np.dot(s.direction, e.direction))
            if np.linalg.norm(s.point - e.point) < 1e-6 * size and abs(cosine) > 0.999:
                found = (i, float(np.sign(cosine)))
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
            r = log_ratio(sign_j * data.H[:, row_j, k], sign_k * data.H[:, row_k, j])[seen]
            expected = np.hypot(data.noise[:, row_j, k], data.noise[:, row_k, j])[seen]
            # The median of the modulus of a complex normal number with unit deviation in each part is 1.177.
            out.append(
                Reciprocity(
                    m.excitations[j].name,
                    m.excitations[k].name,
                    float(np.median(np.abs(r)) / 1.1774 * DB_PER_NEPER),
                    float(np.median(expected) * DB_PER_NEPER),
                )
            )
    return tuple(out)


def homogeneity(problem: FitProblem, others: Sequence[Measurement]) -> tuple[Homogeneity, ...]:
    """Compare measurements at other force levels with the problem's; a linear structure gives equal FRFs."""
    first, out = problem.data, []
    for other in others:
        frf = other.frf.as_kind("receptance")
        same = np.isin(frf.frequency, first.frequency)
        fits = frf.outputs == first.measurement.frf.outputs and frf.inputs == first.measurement.frf.inputs
        if not fits or same.sum() != len(first.frequency):
            out.append(Homogeneity(other.name, float("nan")))
            continue
        difference = np.abs(log_ratio(frf.H[same], first.H).real) / first.noise
        median = float(np.median(difference[first.mask]))
        out.append(Homogeneity(other.name, median / 0.6745 / float(np.sqrt(2))))
    return tuple(out)
