"""Evidence for and against an added effect."""

from dataclasses import dataclass

import numpy as np

from fem.model import ParameterRef
from updating.correlation import Comparison
from updating.diagnosis.findings import parameters_of
from updating.live.engine import Evaluation, LiveModel
from updating.live.fitting import Progress, fit_all
from updating.live.hypothesis import Hypothesis


@dataclass(frozen=True, slots=True)
class WeighedChannel:
    """A sensor in a band, and its error with and without an effect.

    Attributes
    ----------
    sensor : str
    band : (float, float)
        [Hz].
    without, present : float
        Error [dB].
    """

    sensor: str
    band: tuple[float, float]
    without: float
    present: float


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """Evidence for and against an added effect.

    Attributes
    ----------
    name : str
        The effect's.
    without, present : Evaluation
        Hypotheses without and with it, both fitted if ``refitted``.
    refitted : bool
        Whether all that is left was fitted again without it; otherwise it keeps its values.
    better, worse : tuple of WeighedChannel
        Where the effect lowers the error most, and where it raises it most.
    at_bound : tuple of str
        Parameters of the effect that are at a bound.
    strained : tuple of (ParameterRef, float)
        Uncertain parameters more than two standard deviations off, with how many.
    """

    name: str
    without: Evaluation
    present: Evaluation
    refitted: bool
    better: tuple[WeighedChannel, ...]
    worse: tuple[WeighedChannel, ...]
    at_bound: tuple[str, ...]
    strained: tuple[tuple[ParameterRef, float], ...]

    @property
    def unseen_gain(self) -> float:
        """By how much the effect makes lines more likely that no fit has seen [nats]."""
        return self.without.result.unseen - self.present.result.unseen


N_CHANNELS = 2
"""Largest number of sensors in a band that are named on each side."""


def weigh(live: LiveModel, h: Hypothesis, name: str, progress: Progress | None = None) -> Weighed:
    """Return the evidence for and against an added effect.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    name : str
        Of the effect.
    progress : callable, optional
        If given, the model without the effect is fitted again, and its progress is told to this.
    """
    effect, less = h.effect(name), h.without_effect(name)
    if progress is not None:
        less = fit_all(live, less, progress)
    without, present = live.evaluate(less), live.evaluate(h)
    channels = sorted(_channels(without.comparison, present.comparison), key=lambda c: c.present - c.without)
    better = tuple(c for c in channels[:N_CHANNELS] if c.present < c.without)
    worse = tuple(c for c in channels[: -N_CHANNELS - 1 : -1] if c.present > c.without)
    bounds = tuple(p.name for p in parameters_of(effect, present.result) if p.at_bound)
    strains = live.problem.strains(present.result)
    # Standard deviations of its prior from which an uncertain parameter speaks against a hypothesis [-]
    strained = tuple((ref, s) for ref, s in strains.items() if abs(s) > 2.0)
    return Weighed(name, without, present, progress is not None, better, worse, bounds, strained)


def _channels(without: Comparison, present: Comparison) -> list[WeighedChannel]:
    before, now, edges = without.by_band(), present.by_band(), present.bands
    return [
        WeighedChannel(name, (float(edges[b]), float(edges[b + 1])), float(before[i, b]), float(now[i, b]))
        for i, name in enumerate(present.outputs)
        for b in range(before.shape[1])
        if np.isfinite(before[i, b]) and np.isfinite(now[i, b])
    ]
