"""Input and result of readers of FRFs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from fem.analysis.frf import FRF, FRFKind
from fem.array_types import Floats
from fem.io.arrays import TableError
from fem.io.uff_types import Function, Points

FORMS = (
    "auto",
    "complex",
    "re-im",
    "magnitude-degrees",
    "magnitude-radians",
    "decibel-degrees",
    "magnitude",
    "decibel",
)
"""Forms of the values of an FRF."""


@dataclass(frozen=True, slots=True)
class Asked:
    """Statements of the user on a file of FRFs; each reader uses some of them.

    Attributes
    ----------
    kind : FRFKind, str or None
    outputs, inputs : sequence of str or None
        Labels of the responses and of the forces.
    unit_labels : bool
        Whether unit labels of the file count; where the user gives the factor to SI they do not.
    form : str
        One of ``FORMS``.
    delimiter : str or None
    header : bool or None
        Of a text table: whether its first line has names.
    pairs : sequence of str, mapping or None
        ``"response/force"`` of each FRF in the order of the file, or by the name that the file gives it.
    arrays : mapping of str to str
        Which array of the file is which: ``{"H": "FRF_matrix"}``.
    axes : sequence of str
        Order of the axes of an array of FRFs: some order of frequency, output, input.
    """

    kind: FRFKind | str | None = None
    outputs: Sequence[str] | None = None
    inputs: Sequence[str] | None = None
    unit_labels: bool = True
    form: str = "auto"
    delimiter: str | None = None
    header: bool | None = None
    pairs: Sequence[str] | Mapping[str, str] | None = None
    arrays: Mapping[str, str] = field(default_factory=dict)
    axes: Sequence[str] = ()

    def known_kind(self, name: str) -> FRFKind | None:
        """Return the kind that the user says."""
        try:
            return None if self.kind is None else FRFKind(self.kind)
        except ValueError:
            msg = f"{name}: the FRF kind is '{self.kind}'; allowed are {', '.join(FRFKind)}"
            raise TableError(msg) from None


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """FRFs of a file.

    Attributes
    ----------
    frfs : tuple of FRF
        Matrices; without phase their values are amplitudes.
    axes : tuple of tuple of str
        Unit labels of the frequencies of each matrix as the file has them; the FRFs are in Hz.
    phase : bool
        Whether the FRFs have a phase.
    coherence : ndarray (n_freq, n_out, n_in) or None
        Of the first matrix.
    averages : int or None
        Independent averages behind the coherence, where the file says it.
    functions : tuple of Function
        Other functions of a universal file.
    points : Points or None
    notes : tuple of str
        Conversions, omissions and assumptions.
    names : (mapping, mapping)
        Names that the file gives to responses and to forces, by their labels.
    stated : bool
        Whether file or user say what the values are; else columns are taken for real and imaginary parts.
    """

    frfs: tuple[FRF, ...]
    axes: tuple[tuple[str, ...], ...] = ()
    phase: bool = True
    coherence: Floats | None = None
    averages: int | None = None
    functions: Sequence[Function] = ()
    points: Points | None = None
    notes: tuple[str, ...] = ()
    names: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    stated: bool = True


def optional(module: str, name: str) -> Any:
    """Import a package that only some readers need.

    Parameters
    ----------
    module : str
    name : str
        File that needs it, for the message.
    """
    try:
        return import_module(module)
    except ImportError:
        msg = (
            f"{name}: it is read by {module}, which is not installed; install it with: "
            f"python -m pip install {module.partition('.')[0]}"
        )
        raise TableError(msg) from None
