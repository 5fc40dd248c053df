"""Effects that contain a frame: changes of its members with the moduli of the model that proposed them."""

from dataclasses import dataclass, replace
from typing import Self

from fem.elements.frame import Frame
from fem.model import Effect, Model, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WithFrame(Effect):
    """A change of members, formed by the frame that it contains.

    Attributes
    ----------
    frame : Frame
        Of the model that it was proposed for: moduli that are a little otherwise hardly matter here.
    """

    frame: Frame

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return nothing: the moduli are those of the frame that it contains."""
        return ()

    def with_mass_of_higher_order(self) -> Self:
        """Return it with a frame whose consistent mass is of higher order."""
        return replace(self, frame=self.frame.with_mass_of_higher_order())
