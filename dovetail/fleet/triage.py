"""Triage of one unit: its uncertain parameters by a few steps on the fleet's basis, and the residual."""

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.config import read_study_of
from dovetail.file.contents import StudyContents, measured, without_held_out
from dovetail.pipeline import fit_problem
from fem.array_types import Complexes, Floats, Ints
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_result import FitResult
from updating.inference.fitting import fit
from updating.inference.preparation import prepared_like
from updating.inference.unknowns import ScaledUnknown

PILOT = 20
"""Units from which the model's common error is known [-]: their median has 0.28 of a unit's own error, and
variances are 8 % larger for it."""

WIDER = 5.0
"""Priors of a unit's fit are so many times as wide as the study's: the population takes their place [-].

A prior of w σ moves a parameter that lies k σ off, and that the data know by s, by k σ s²/(s² + w²σ²).
That is at most k/2w of s: a tenth of its error for one standard deviation of the study's."""


class UnitError(ValueError):
    """A unit that was not measured as the others were."""


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """What all units share: the study, the reduced model, and the model's error in the first units.

    Attributes
    ----------
    text : str
        Of the study file.
    path : Path
        Where it lies.
    problem : FitProblem
        With the data of the first unit.
    start : FitResult
        Fit from which that of each unit begins.
    common : ndarray of complex (n_lines, n_out, n_in)
        Median over the first units of ln(computed / measured), 0 where it is not known. FRFs are divided by
        it: what the model lacks of all units alike is no reason to distrust the data of one.
    """

    text: str
    path: Path
    problem: FitProblem
    start: FitResult
    common: Complexes

    @classmethod
    def of(cls, text: str, path: Path, files: Sequence[Path]) -> "Fleet":
        """Build the basis, and fit the first units.

        Parameters
        ----------
        text : str
        path : Path
        files : sequence of Path
            FRFs of the units; the first must be readable, and gives lines and channels.

        Raises
        ------
        StudyError
            For a study or FRFs that cannot be read.
        """
        study = read_study_of(text, path, files[0])
        wide = tuple(replace(n, std=WIDER * n.std) for n in study.nuisances)
        problem = fit_problem(replace(study, nuisances=wide, damping_std=WIDER * study.damping_std))
        start = fit(problem)
        nothing = np.zeros((len(problem.lines_up_to(np.inf, problem.n_lines)), *problem.data.H.shape[1:]))
        bare = cls(text, path, problem, start, nothing.astype(complex))
        fits = []
        for file in files[:PILOT]:
            with suppress(ValueError, OSError):  # it is listed where its turn comes
                first_problem, result = bare.fitted(bare.study_of(file))
                fits.append((first_problem.log_ratio(result, bare.lines), result))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "All-NaN", RuntimeWarning)
            parts = [np.nanmedian([getattr(r, key) for r, _ in fits], axis=0) for key in ("real", "imag")]
        best = min((result for _, result in fits), key=lambda r: r.solution.cost)
        return replace(bare, start=best, common=np.nan_to_num(parts[0] + 1j * parts[1]))

    @property
    def lines(self) -> Ints:
        """Lines that are fitted and compared."""
        return self.problem.lines_up_to(np.inf, self.problem.n_lines)

    @property
    def frequency(self) -> Floats:
        """Frequencies of these lines [Hz]."""
        return self.problem.data.frequency[self.lines]

    def study_of(self, file: Path) -> StudyContents:
        """Return the study with the measurement of a unit.

        Raises
        ------
        StudyError
            If its file cannot be read, or is refused.
        """
        return read_study_of(self.text, self.path, file)

    @property
    def variables(self) -> tuple[ScaledUnknown, ...]:
        """The uncertain parameters that are fitted, the first of x; damping follows."""
        return self.problem.function((), (), self.problem.lines_up_to(np.inf, 2)).variables

    def fitted(self, study: StudyContents) -> tuple[FitProblem, FitResult]:
        """Fit the uncertain parameters and the damping to the measurement of a unit.

        Raises
        ------
        UnitError
            If it has other lines or channels than the first unit.
        """
        data = self._data_of(study)
        H = data.H.copy()
        H[self.lines] *= np.exp(self.common)
        problem = replace(self.problem, data=replace(data, H=H))
        return problem, fit(problem, stages=problem.stages[-1:], x_from=self.start)

    def rest_of(self, study: StudyContents) -> Complexes:
        """Return ln(computed / measured) of a unit at its own parameters, at all lines; NaN if not counted.

        Nothing is taken off it.
        """
        problem, result = self.fitted(study)
        return replace(problem, data=self._data_of(study)).log_ratio(result)

    def _data_of(self, study: StudyContents) -> FitData:
        problem = self.problem
        measurement = without_held_out(study, measured(study)[0])
        _require_alike(problem, measurement.frf.outputs, measurement.frf.inputs)
        data = prepared_like(problem, measurement, study.band)
        if not np.array_equal(data.frequency, problem.data.frequency):
            f, g = data.frequency, problem.data.frequency
            msg = (
                f"it has {len(f)} lines from {f[0]:g} to {f[-1]:g} Hz, and the first unit has {len(g)} from "
                f"{g[0]:g} to {g[-1]:g} Hz; they must be the same"
            )
            raise UnitError(msg)
        return data


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
        ln(computed / measured), less the common part; NaN where a value does not count.
    warnings : tuple of str
        Probable faults of its file.
    """

    x: Floats
    covariance: Floats
    residual: Complexes
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
    problem, result = fleet.fitted(study)
    lines = fleet.lines
    n = len(result.solution.x)
    return {
        "x": result.solution.x,
        "covariance": result.solution.covariance[:n, :n],
        "residual": problem.log_ratio(result, lines).astype(np.complex64),
        "warnings": np.array(study.warnings, dtype=str),
    }


def _require_alike(problem: FitProblem, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> None:
    frf = problem.data.measurement.frf
    if (outputs, inputs) != (frf.outputs, frf.inputs):
        missing = [n for n in (*frf.outputs, *frf.inputs) if n not in (*outputs, *inputs)]
        lack = f"it lacks {', '.join(missing)}" if missing else "they are others than those of the first unit"
        msg = f"its channels are {', '.join(outputs)} to {', '.join(inputs)}; {lack}"
        raise UnitError(msg)
