"""What the fits and the search ask of any kind of data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect
from fem.reduction.reduced_model import ReducedModel
from updating.inference.defaults import BASIS_LINES, EXPLAINED_LEVEL
from updating.inference.fit_function import FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.parameters import DampingCurve
from updating.inference.solve import Solution
from updating.inference.unknowns import ScaledUnknown, Uncertain, effect_unknowns, nuisance_unknowns

if TYPE_CHECKING:
    from updating.inference.damped import DampedFrfs
    from updating.inference.mode_fit import ComputedModes
    from updating.inference.mode_targets import ModeTargets
    from updating.inference.scatter import FormScatter
    from updating.measurement.measurement import Measurement

Floats = NDArray[np.float64]


class Data(Protocol):
    """What was measured, prepared for fits."""

    @property
    def frequency(self) -> Floats:
        """Frequencies of lines, or of modes [Hz]."""
        ...

    @property
    def noise_level(self) -> float:
        """Residual level that noise alone leaves [nepers], or relative noise of frequencies [-]."""
        ...

    @property
    def has_damping(self) -> bool:
        """Whether fits see damping."""
        ...

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Numbers on which a fit depends."""
        ...


D = TypeVar("D", bound=Data)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Problem(ABC, Generic[D]):
    """Everything that a fit to one kind of data needs but the candidates.

    Attributes
    ----------
    reduced : ReducedModel
    data
        What was measured.
    nuisances : tuple of Nuisance or Unknown
    damping : DampingCurve
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left.
    mesh_level : float
        Residual level that the elements leave of exact members [nepers], or relative error of frequencies
        [-].
    scatter : FormScatter, optional
        Small deviations that are uncertain in every fit.
    """

    reduced: ReducedModel
    data: D
    nuisances: tuple[Uncertain, ...]
    damping: DampingCurve
    model_error: float = EXPLAINED_LEVEL
    mesh_level: float = 0.0
    scatter: FormScatter | None = None

    # what each kind of data has -----------------------------------------------------------------------------

    @property
    @abstractmethod
    def measured_words(self) -> str:
        """The kind of data, in the singular."""

    @property
    @abstractmethod
    def stages(self) -> Floats:
        """Stages of a fit from far away, (n,); the last is the whole of the data."""

    @abstractmethod
    def lines_up_to(self, frequency: float, n_lines: int) -> NDArray[np.int64]:
        """Return at most ``n_lines`` lines up to a frequency [Hz], or all modes; none is held out."""

    @abstractmethod
    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: NDArray[np.int64]
    ) -> FitFunction[Self]:
        """Return the residuals at some lines, or of some modes, as a function of all that varies.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        lines : ndarray of int
        """

    @abstractmethod
    def residuals(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        stage: float | None = None,
        n_lines: int | None = None,
    ) -> FitFunction[Any]:
        """Return all residuals of a stage of a fit as a function of all that varies.

        Parameters
        ----------
        effects, starts
            As of :meth:`function`.
        stage : float, optional
            One of ``stages``; the whole of the data unless given.
        n_lines : int, optional
            Largest number of lines; that of the problem unless given.
        """

    @abstractmethod
    def surroundings(self, key: tuple[str, str]) -> float:
        """Return the median impedance of the structure to motion along a released constraint [N/m, N·m/rad].

        It is the magnitude of force over displacement in the band of the data.
        """

    @abstractmethod
    def better_basis(
        self, result: FitResult, n_lines: int = BASIS_LINES[0]
    ) -> tuple[float, ReducedModel] | None:
        """Return the error of the reduced basis at a fitted model, and a better basis.

        None where the error is small against the level that the data leave.
        """

    @abstractmethod
    def resampled(self, result: FitResult, misfit: Mapping[str, float], rng: np.random.Generator) -> Self:
        """Return the problem with data that a fitted model would have been measured to have.

        Parameters
        ----------
        result : FitResult
        misfit : mapping of str to float
            Mean square residuals in units of the stated noise, of ``"modes"`` and ``"frf"``: above 1 they
            scale the noise that is drawn [-].
        rng : numpy.random.Generator
        """

    # what only some data have -------------------------------------------------------------------------------

    @property
    def measured_modes(self) -> ModeTargets | None:
        """Measured modes that are fitted, alone or beside other data."""
        return None

    def computed_modes(self, result: FitResult) -> ComputedModes | None:
        """Return the partners of the measured modes in a fitted model."""
        return None

    def small_deviations(
        self, result: FitResult, size: float | None = None, share: float = 1.0
    ) -> FormScatter | None:
        """Return the small deviations that the form has besides its parameters, at a fitted model.

        Parameters
        ----------
        result : FitResult
        size : float, optional
            Standard deviation of the shifts of eigenvalues; the middle of what it may be unless given [-].
        share : float
            Part of the deviations that the data still have [-].
        """
        return None

    def damped_frfs(self) -> DampedFrfs | None:
        """Return the data at complex frequencies, where fits converge from far away."""
        return None

    def with_other_damping(self) -> Self | None:
        """Return the problem with the other form of damping between resonances."""
        return None

    def with_seen_noise(self, result: FitResult) -> Self:
        """Return the problem with no more noise than the residuals of a fit show."""
        return self

    def test_of(self, result: FitResult) -> Measurement | None:
        """Return the test with the form of damping and the errors of channels that a fit has found."""
        return None

    def strain(self, result: FitResult) -> float:
        """Return the largest distance of uncertain parameters from nominal, in prior deviations [-].

        A fit bends uncertain parameters to stand in for what the model lacks.
        """
        return 0.0

    def far_start(self, result: FitResult) -> FitResult | None:
        """Return where fits of further effects begin if a fit is far from the data; None for where it is."""
        return None

    def at_places_of(self, result: FitResult) -> Self | None:
        """Return the problem on a basis for the places of a fit's effects; None if its own is as good."""
        return None

    # what all have in common --------------------------------------------------------------------------------

    @property
    def form_right(self) -> bool:
        """Whether the residual may only be noise and the mesh's error."""
        return self.model_error == 0

    def unknowns(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]]
    ) -> tuple[tuple[ScaledUnknown, ...], Floats]:
        """Return the variables with some effects, and where all unknowns but small deviations start."""
        fixed = {ref for e in effects for ref in e.replaces()}
        varying = [n for n in self.nuisances if not fixed.intersection(n.refs)]
        nuisance = nuisance_unknowns(self.reduced.model, varying)
        variables = (*nuisance, *effect_unknowns(effects, starts))
        return variables, np.concatenate([[v.start for v in variables], np.log(self.damping.start)])

    def nominal(self) -> FitResult:
        """Return the model as it was given, unfitted."""
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        n = len(variables)
        empty = Solution(np.zeros(n), np.nan, np.nan, 0, True, np.zeros((n, n)))
        values = {
            ref: value
            for v in variables
            for ref, value in zip(v.refs, v.moved(v.start).tolist(), strict=True)
        }
        zero = dict.fromkeys(values, 0.0)
        return FitResult(empty, values, zero, self.damping.start, (), np.nan, np.nan, np.nan)

    def at_nominal(self, result: FitResult) -> FitResult:
        """Return a result with the nuisance parameters of the model back at their nominal values.

        Damping stays.
        """
        names, nominal = {e.name for e in self.reduced.model.effects}, self.reduced.model.values()
        values = {r: nominal[r] if r[0] in names else v for r, v in result.values.items()}
        return replace(result, values=values)

    def with_forces_of(self, result: FitResult) -> Self:
        """Return the problem on a basis with the responses to the forces of a fit's effects.

        On a basis without them the same fit has other responses: modes and other responses hardly bend where
        a crack or a released end does.
        """
        reduced = self.reduced.with_forces_of(result.effects)
        return self if reduced is self.reduced else replace(self, reduced=reduced)

    def with_even_damping(self, result: FitResult) -> FitResult:
        """Return a result whose damping ratios are a power of frequency, by medians of slopes and of levels.

        A fit may leave a part of the band with ratios far from its neighbours', where they cost little: of
        eight knots two may be anything. Theil and Sen's line through ln ζ over ln f at the knots (Sen, *J.
        Am. Stat. Assoc.* 63, 1968, 1379).
        """
        n = len(self.damping.knots)
        f, zeta = np.log(self.damping.knots), np.log(result.zeta[:n])
        i, j = np.triu_indices(n, 1)
        slope = float(np.median((zeta[j] - zeta[i]) / (f[j] - f[i]))) if n > 1 else 0.0
        even = slope * f + np.median(zeta - slope * f)
        lo, hi = self.damping.limits[:n].T
        return replace(result, zeta=np.concatenate([np.exp(np.clip(even, lo, hi)), result.zeta[n:]]))
