"""Triage of one unit: its uncertain parameters by a few steps on the fleet's basis, and what is left."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.config import read_study_of
from dovetail.file.contents import Study
from dovetail.pipeline import fit_problem, without_held_out
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.preparation import prepared_like

Floats = NDArray[np.float64]


class UnitError(ValueError):
    """A unit that was not measured as the others were."""


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """What all units share: the study, the reduced model and the fit of the first unit.

    Attributes
    ----------
    text : str
        Of the study file.
    path : Path
        Where it lies.
    problem : FitProblem
        With the data of the first unit.
    start : FitResult
        Its fit, from which each other one begins.
    """

    text: str
    path: Path
    problem: FitProblem
    start: FitResult

    @classmethod
    def of(cls, text: str, path: Path, first: Path) -> "Fleet":
        """Build the basis and fit the first unit.

        Parameters
        ----------
        text : str
        path : Path
        first : Path
            Its FRFs.

        Raises
        ------
        StudyError
            For a study or FRFs that cannot be read.
        """
        problem = fit_problem(read_study_of(text, path, first))
        return cls(text, path, problem, problem.fit_anew())

    @property
    def lines(self) -> NDArray[np.int64]:
        """Lines that are fitted and compared."""
        return self.problem.lines_up_to(np.inf, self.problem.n_lines)

    @property
    def frequency(self) -> Floats:
        """Frequencies of these lines [Hz]."""
        return self.problem.data.frequency[self.lines]

    def study_of(self, file: Path) -> Study:
        """Return the study with the measurement of a unit.

        Raises
        ------
        StudyError
            If its file cannot be read, or is refused.
        """
        return read_study_of(self.text, self.path, file)


@dataclass(frozen=True, slots=True, eq=False)
class Triage:
    """Result of a unit.

    Attributes
    ----------
    x : ndarray (n,)
        Uncertain parameters, as logarithms where they are positive, and logarithms of the damping.
    covariance : ndarray (n, n)
        Of x, by the unit's own data and the study's priors.
    residual : ndarray of complex (n_lines, n_out, n_in)
        ln(computed / measured); NaN where a value does not count.
    noise : ndarray (n_lines, n_out, n_in)
        Relative noise of the measured values [-].
    warnings : tuple of str
        Probable faults of its file.
    """

    x: Floats
    covariance: Floats
    residual: NDArray[np.complex128]
    noise: Floats
    warnings: tuple[str, ...]


def triage(fleet: Fleet, unit: tuple[str, int, int]) -> dict[str, Any]:
    """Read and fit a unit; return the fields of a :class:`Triage` as arrays.

    Parameters
    ----------
    fleet : Fleet
    unit : (str, int, int)
        Its file; with the size and the time of its last change, by which a later run knows it.

    Raises
    ------
    UnitError
        If it has other lines or channels than the first unit.
    """
    study = fleet.study_of(Path(unit[0]))
    problem = fleet.problem
    measurement = without_held_out(study, study.measurements[0])
    _require_alike(problem, measurement.frf.outputs, measurement.frf.inputs)
    data = prepared_like(problem, measurement, study.band)
    if not np.array_equal(data.frequency, problem.data.frequency):
        msg = (
            f"{Path(unit[0]).name} has {len(data.frequency)} lines from {data.frequency[0]:g} to "
            f"{data.frequency[-1]:g} Hz, and the first unit has {len(problem.data.frequency)} from "
            f"{problem.data.frequency[0]:g} to {problem.data.frequency[-1]:g} Hz; they must be the same"
        )
        raise UnitError(msg)
    own = replace(problem, data=data)
    result = own.fit(stages=own.stages[-1:], x_from=fleet.start, assess=False)
    lines = fleet.lines
    n = len(result.solution.x)
    return {
        "x": result.solution.x,
        "covariance": result.solution.covariance[:n, :n],
        "residual": own.log_ratio(result, lines).astype(np.complex64),
        "noise": data.noise[lines].astype(np.float32),
        "warnings": np.array(study.warnings, dtype=str),
    }


def _require_alike(problem: FitProblem, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> None:
    own = problem.data.measurement.frf
    if (outputs, inputs) != (own.outputs, own.inputs):
        missing = [n for n in (*own.outputs, *own.inputs) if n not in (*outputs, *inputs)]
        lack = f"it lacks {', '.join(missing)}" if missing else "they are others than those of the first unit"
        msg = f"its channels are {', '.join(outputs)} to {', '.join(inputs)}; {lack}"
        raise UnitError(msg)
