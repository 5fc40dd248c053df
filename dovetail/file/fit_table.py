"""The table ``[fit]`` of a study: what is fitted, and how closely a right model must agree."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

from dovetail.file.measured import read_band
from dovetail.file.measured_match import HeldOut, read_held_out
from dovetail.file.sensors import Channel
from dovetail.file.settings import MOST_LINES, read_model_error
from dovetail.file.table import StudyTable


@dataclass(frozen=True, slots=True)
class FitTable:
    """What ``[fit]`` says.

    Attributes
    ----------
    band : (float, float) or None
        Frequencies that count [Hz].
    n_lines : int or None
        At most this many lines are fitted.
    model_error : float
        Level that beams may leave [nepers].
    held_out : HeldOut
    """

    band: tuple[float, float] | None
    n_lines: int | None
    model_error: float
    held_out: HeldOut

    @property
    def contents(self) -> dict[str, Any]:
        """What a study has of it, by name."""
        excitations, sensors, bands = self.held_out
        return {
            "band": self.band,
            "n_lines": self.n_lines,
            "model_error": self.model_error,
            "held_out": excitations,
            "held_out_sensors": sensors,
            "held_out_bands": bands,
        }


def read_fit(
    top: StudyTable,
    sensors: Sequence[Channel],
    excitations: Sequence[Channel],
    notes: list[str],
    attempt: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> FitTable:
    """Read ``[fit]``.

    Parameters
    ----------
    top : StudyTable
        Of the study.
    sensors, excitations : sequence of Channel
        Those that may be held out.
    notes : list of str
        Gets a note where the form does not vary.
    attempt : callable
        Gives the context in which what is held out is read.
    """
    t = top.table("fit")
    band, n_lines = read_band(t), t.integer("lines", None, 8, MOST_LINES)
    model_error = read_model_error(t)
    if model_error == 0:
        notes.append(
            "the form of sections and connections is taken as drawn, as [fit] says: it does not vary"
        )
    held_out: HeldOut = (), (), ()
    if t.get("held_out", ()) != []:  # as the desk saves a hypothesis that holds out nothing
        with attempt():
            held_out = read_held_out(t, sensors, excitations)
    t.finish()
    return FitTable(band, n_lines, model_error, held_out)
