"""Inputs of a fit: data, a reduced model, and uncertain parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats
from fem.model import Effect
from fem.recent import Unsent
from fem.reduction.reduced_model import ReducedModel
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.parameters import DampingCurve
from updating.inference.solve import Solution
from updating.inference.unknowns import ScaledUnknown, Uncertain, effect_unknowns, nuisance_unknowns


class Data(Protocol):
    """Measured data, prepared for fits."""

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
class FitInputs(ABC, Generic[D]):
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
    # Copies of a problem have the same model and nuisances, and each fit asks for their unknowns.
    _unknowns: Unsent = field(default_factory=lambda: Unsent(2), repr=False)

    @property
    def nuisance_unknowns(self) -> tuple[ScaledUnknown, ...]:
        """The unknowns of all nuisances, in their order."""
        model, nuisances = self.reduced.model, self.nuisances
        return self._unknowns.get((model, nuisances), lambda: nuisance_unknowns(model, nuisances))

    @abstractmethod
    def surroundings(self, key: tuple[str, str]) -> float:
        """Return the median impedance of the structure to motion along a released constraint [N/m, N·m/rad].

        It is the magnitude of force over displacement in the band of the data.
        """

    def unknowns(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]]
    ) -> tuple[tuple[ScaledUnknown, ...], Floats]:
        """Return the variables with some effects, and where all unknowns but small deviations start."""
        fixed = {ref for e in effects for ref in e.replaces()}
        nuisance = (v for v in self.nuisance_unknowns if not fixed.intersection(v.refs))
        variables = (*nuisance, *effect_unknowns(effects, starts))
        return variables, np.concatenate([[v.start for v in variables], np.log(self.damping.start)])

    def nominal(self) -> FitResult:
        """Return the model as it was given, unfitted."""
        variables = self.nuisance_unknowns
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
