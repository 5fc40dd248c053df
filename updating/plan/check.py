"""Whether a map of what a test sees is true: diagnoses of data drawn with effects of known sizes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from fem.model import Effect
from updating.diagnosis.diagnosis import Diagnosis
from updating.measurement.measurement import Measurement
from updating.plan.plan import Outlook, Plan
from updating.plan.trial import drawn
from updating.plan.visibility import SURE

MULTIPLES = (0.5, 0.75, 1.0, 1.5, 2.0)
"""Amplitudes of drawn effects, in parts of those that are named [-]."""
FAILURES = (ArithmeticError, AssertionError, LookupError, RuntimeError, TypeError, ValueError)
"""Errors of one set of data that leave the others to be diagnosed."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A diagnosis of data drawn with an effect.

    Attributes
    ----------
    effect : Effect
    multiple : float
        Its amplitude, in parts of that which is named [-].
    chances : (float, float)
        Predicted probabilities that it is seen, and named.
    nothing, right : float
        Posterior probabilities that nothing is missing, and that the effect is.
    best : tuple of str
        Names of the effects that are most probable.
    """

    effect: Effect
    multiple: float
    chances: tuple[float, float]
    nothing: float
    right: float
    best: tuple[str, ...]

    @property
    def seen(self) -> bool:
        """Whether something is missing for sure."""
        return self.nothing <= 1 - SURE

    @property
    def named(self) -> bool:
        """Whether the effect is missing for sure."""
        return self.right >= SURE


@dataclass(frozen=True, slots=True, eq=False)
class FailedTrial:
    """A set of data that could not be drawn or diagnosed.

    Attributes
    ----------
    effect : Effect
        The effect with which it was drawn.
    multiple : float
        Its amplitude, in parts of that which is named [-].
    error : Exception
    """

    effect: Effect
    multiple: float
    error: Exception


def trials(
    plan: Plan, n: int, rng: np.random.Generator, diagnose: Callable[[Measurement], Diagnosis]
) -> Iterator[Trial | FailedTrial]:
    """Yield diagnoses of data with an effect each, at multiples of the size at which it is named.

    Kinds are drawn, then effects of each kind; of those that are named at a plausible size. A set whose
    diagnosis ends in an error is a :class:`FailedTrial`, and the next one follows.

    Parameters
    ----------
    plan : Plan
        Of a planned test.
    n : int
    rng : Generator
    diagnose : callable
        Returns the diagnosis of data.
    """
    problem, discrepancy = plan.visibility.problem, plan.visibility.discrepancy or 0.0
    kinds: dict[str, list[Outlook]] = {}
    for o in plan.relevant:
        if o.visible.is_plausible(MULTIPLES[-1] * o.visible.enough[2]):
            kinds.setdefault(o.relevant.kind, []).append(o)
    names = sorted(kinds)
    for k in range(n if names else 0):
        some = kinds[names[int(rng.integers(len(names)))]]
        visible = some[int(rng.integers(len(some)))].visible
        multiple = MULTIPLES[k % len(MULTIPLES)]
        amplitude = multiple * visible.enough[2]
        effect = visible.at(amplitude)
        assert effect is not None
        try:
            found = diagnose(replace(drawn(problem, (effect,), discrepancy, rng), name=f"drawn {k + 1}"))
        except FAILURES as error:  # not Exception: a progress function stops the work by one of its own
            yield FailedTrial(effect, multiple, error)
            continue
        yield Trial(
            effect,
            multiple,
            visible.chances(amplitude),
            sum(p for some, p in found.posterior if not some),
            sum(p for some, p in found.posterior if effect.name in some),
            max(found.posterior, key=lambda each: each[1])[0] if found.posterior else (),
        )
