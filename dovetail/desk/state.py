"""The desk's state as a value, and the history of such values: undo and redo of everything."""

from dataclasses import dataclass, replace

from updating.live.engine import Evaluation
from updating.live.hypothesis import Hypothesis

MOST_STATES = 300
"""States that can be undone [-]."""


@dataclass(frozen=True, slots=True)
class Stair:
    """One step of the staircase: its action, and the errors after it [dB]."""

    label: str
    fit_db: float
    held_out_db: float

    @classmethod
    def of(cls, label: str, evaluation: Evaluation) -> "Stair":
        """Return the step that ended with an evaluation."""
        return cls(label, evaluation.result.fit_db, evaluation.result.held_out_db)


@dataclass(frozen=True, slots=True, eq=False)
class DeskState:
    """A state that the desk shows and can undo.

    Attributes
    ----------
    label : str
        Action that led here.
    hypothesis : Hypothesis
        The hypothesis shown.
    stairs : tuple of Stair
        The steps to it, the nominal model first.
    other : Hypothesis or None
        A second hypothesis beside it.
    other_stairs : tuple of Stair
    """

    label: str
    hypothesis: Hypothesis
    stairs: tuple[Stair, ...]
    other: Hypothesis | None = None
    other_stairs: tuple[Stair, ...] = ()

    def moved(self, label: str, hypothesis: Hypothesis) -> "DeskState":
        """Return the state with another hypothesis in place of the present one."""
        return replace(self, label=label, hypothesis=hypothesis)

    def with_stair(self, stair: Stair) -> "DeskState":
        """Return the state with one more step of the staircase."""
        return replace(self, stairs=(*self.stairs, stair))

    def kept(self) -> "DeskState":
        """Return the state with the present hypothesis as the second one, too."""
        label = "keep this hypothesis for comparison"
        return replace(self, label=label, other=self.hypothesis, other_stairs=self.stairs)

    def swapped(self) -> "DeskState":
        """Return the state with the two hypotheses exchanged; itself if there is only one."""
        if self.other is None:
            return self
        return DeskState("exchange hypotheses", self.other, self.other_stairs, self.hypothesis, self.stairs)

    def alone(self) -> "DeskState":
        """Return the state without the second hypothesis."""
        return replace(self, label="drop the second hypothesis", other=None, other_stairs=())


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """States one after the other, and which of them is the present one.

    Attributes
    ----------
    states : tuple of State
        At least one.
    at : int
    """

    states: tuple[DeskState, ...]
    at: int = 0

    @property
    def now(self) -> DeskState:
        """The present state."""
        return self.states[self.at]

    def then(self, state: DeskState) -> "History":
        """Return the history with a new present state; undone states are dropped."""
        states = (*self.states[: self.at + 1], state)[-MOST_STATES:]
        return History(states, len(states) - 1)

    def undone(self) -> "History":
        """Return the history one state earlier, where there is one."""
        return replace(self, at=max(self.at - 1, 0))

    def redone(self) -> "History":
        """Return the history one state later, where there is one."""
        return replace(self, at=min(self.at + 1, len(self.states) - 1))

    @property
    def undoes(self) -> str:
        """Action that undo takes back; empty if none."""
        return self.now.label if self.at else ""

    @property
    def redoes(self) -> str:
        """Action that redo brings back; empty if none."""
        return self.states[self.at + 1].label if self.at + 1 < len(self.states) else ""
