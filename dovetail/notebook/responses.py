"""FRFs that a study computes, with a figure."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from numpy.typing import ArrayLike

from fem.analysis import frf


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyFRF(frf.FRF):
    """Frequency response functions of a study's model; :class:`fem.FRF` with a figure."""

    @classmethod
    def of(cls, data: frf.FRF) -> "StudyFRF":
        """Return FRFs with a figure."""
        return cls(**{f.name: getattr(data, f.name) for f in fields(data)})

    def select(
        self,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        band: tuple[float, float] | None = None,
        lines: ArrayLike | None = None,
    ) -> "StudyFRF":
        """Return some of the responses, forces and lines; see :meth:`fem.FRF.select`."""
        return StudyFRF.of(frf.FRF.select(self, outputs, inputs, band, lines))

    def plot(self, output: str | None = None, input_: str | None = None) -> Any:
        """Return an interactive plotly figure of one FRF, magnitude [dB] and phase [degrees].

        Parameters
        ----------
        output, input_ : str, optional
            Labels of the response and of the force; the first of each unless given.

        Raises
        ------
        FRFError
            If there is no such label.
        """
        from viz.curves import frf
        from viz.interactive.live import draw

        pair = (output or self.outputs[0], input_ or self.inputs[0])
        return draw(frf(None, {"model": self}, pair))
