"""Frequency response functions: one type for measured and computed data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from html import escape
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import counted, fields_summary, listed, span, summary

WITHOUT_PHASE = (
    "amplitudes without phase, which are not used as FRFs: in a study, from text or arrays, 'dovetail "
    "compare', 'locate', 'diagnose', 'update' and 'run' take them; the frequencies of their peaks, given as "
    "frequency = [...] (in a study: under [modes]), do as well"
)
"""Reason why amplitudes are no FRFs, and their use; every reader gives it."""

TRANSMISSIBILITY = "transmissibility"
"""An acceleration for an acceleration: an accelerance in which a motion is in place of the force."""

STRAIN = ("strain per force", "1/N"), ("strain per acceleration", "s²/m")
"""Name and SI unit of FRFs whose response is a strain, of any kind: to a force, and to an acceleration."""


class FRFKind(StrEnum):
    """Response per unit force: displacement, velocity or acceleration."""

    RECEPTANCE = "receptance"
    MOBILITY = "mobility"
    ACCELERANCE = "accelerance"

    @property
    def derivatives(self) -> int:
        """Number of time derivatives of the displacement: 0, 1 or 2."""
        return ("receptance", "mobility", "accelerance").index(self.value)

    @property
    def unit(self) -> str:
        """SI unit of a translational FRF."""
        return {"receptance": "m/N", "mobility": "(m/s)/N", "accelerance": "(m/s²)/N"}[self.value]

    @property
    def to_base(self) -> tuple[str, str]:
        """Name and SI unit of a translational FRF to an acceleration, of a base for example."""
        return {
            "receptance": ("displacement per acceleration", "s²"),
            "mobility": ("velocity per acceleration", "s"),
            "accelerance": (TRANSMISSIBILITY, "-"),
        }[self.value]


class FRFError(ValueError):
    """Frequency response data that cannot be used; the message gives the value found and those allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """How FRFs were computed, and how far from the model's they are at most.

    Attributes
    ----------
    method : str
        ``"modal"``, ``"reduced"`` or ``"direct"``.
    n_modes, n_vectors : int
        Number of modes, and of all vectors, modes included; 0 for ``"direct"``.
    bound : ndarray (n_freq, n_out, n_in) or None
        A bound of the error of each value, but for rounding [unit of the FRF]. None where none is known: for
        direct solutions, which have rounding alone, and with damping of members.
    worst : float
        The largest bound of an FRF relative to its peak over all lines of the computation [-]; NaN if
        unknown.
    tolerance : float
        Requested relative error [-].
    """

    method: str
    n_modes: int
    n_vectors: int
    bound: Floats | None
    worst: float
    tolerance: float

    __repr__ = fields_summary

    @property
    def reached(self) -> bool:
        """Whether the error is known to be below the tolerance."""
        return self.worst <= self.tolerance


@dataclass(frozen=True, slots=True, eq=False)
class FRF:
    """Frequency response functions with labels; time dependence e^{+iωt}.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Strictly increasing frequencies [Hz].
    H : ndarray of complex (n_freq, n_out, n_in)
        Response ``outputs[i]`` to a unit force at ``inputs[j]`` [SI unit of ``kind``].
    kind : FRFKind
        Receptance, mobility or accelerance.
    outputs, inputs : tuple of str
        Labels of the responses and of the forces, such as ``"U1z"`` or ``"12Z+"``.
    accuracy : Accuracy or None
        For computed data: the method, and a bound of the error.
    base : tuple of str
        Those of ``inputs`` that are accelerations, of a base for example, in place of forces: FRFs to them
        are transmissibilities.
    strain : tuple of str
        Those of ``outputs`` that are strains, in place of motions: ``kind`` says nothing of them, and they
        are the same in every kind [1/N].
    """

    frequency: Floats
    H: Complexes
    kind: FRFKind
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    accuracy: Accuracy | None = None
    base: tuple[str, ...] = ()
    strain: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return kind, unit, lines and labels on one line."""
        lines = f"{counted(self.n_freq, 'line')}, {span(self.frequency, 'Hz')}"
        ends = f"{len(self.outputs)} outputs ({listed(self.outputs)}) × {len(self.inputs)} inputs"
        return summary(self, f"{self.quantity} [{self.unit}]: {lines}; {ends} ({listed(self.inputs)})")

    @property
    def quantity(self) -> str:
        """Name of the FRFs: their kind, transmissibility or strain per force; all that there are."""
        return ", ".join(name for name, _ in self._quantities)

    @property
    def unit(self) -> str:
        """SI unit of the FRFs of translations and strains; one for each name in ``quantity``."""
        return ", ".join(unit for _, unit in self._quantities)

    @property
    def _quantities(self) -> list[tuple[str, str]]:
        """Return names and units, motions before strains and forces before accelerations."""
        motion = (str(self.kind), self.kind.unit), self.kind.to_base
        outputs = {name in self.strain for name in self.outputs}
        inputs = {name in self.base for name in self.inputs}
        return [(STRAIN if o else motion)[i] for o in sorted(outputs) for i in sorted(inputs)]

    @property
    def is_strain(self) -> Bools:
        """Whether each output is a strain, shape (n_out,)."""
        return np.array([name in self.strain for name in self.outputs], dtype=bool)

    @property
    def has_phase(self) -> bool:
        """Whether the values have phases; amplitudes are real and never negative, over more than one line."""
        bare = self.n_freq > 1 and bool(self.H.any()) and not self.H.imag.any()
        return not (bare and bool((self.H.real >= 0).all()))

    def __getitem__(self, pair: tuple[str, str]) -> Complexes:
        """Return the curve of an output and an input, ``frf["U1z", "D3z"]``, shape (n_freq,) [unit of kind].

        Raises
        ------
        FRFError
            If a label is not there, or other than two labels are given.
        """
        if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(x, str) for x in pair)):
            msg = f"an FRF is taken by two labels, frf[output, input], not by {pair!r}; see select for parts"
            raise FRFError(msg)
        return self.select([pair[0]], [pair[1]]).H[:, 0, 0]

    def to_xarray(self) -> Any:
        """Return an ``xarray.DataArray`` with dimensions frequency [Hz], output and input.

        Its name is the kind, its attribute ``units`` the SI unit.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        xarray = imported("xarray")
        array = xarray.DataArray(
            np.array(self.H),
            dims=("frequency", "output", "input"),
            coords={
                "frequency": np.array(self.frequency),
                "output": list(self.outputs),
                "input": list(self.inputs),
            },
            name=self.quantity,
            attrs={"units": self.unit, "kind": str(self.kind), "time_dependence": "exp(+i omega t)"},
        )
        array["frequency"].attrs["units"] = "Hz"
        return array

    def to_frame(self) -> Any:
        """Return a ``pandas.DataFrame``: frequencies [Hz] down, (output, input) across, complex values.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        pandas = imported("pandas")
        columns = pandas.MultiIndex.from_product([self.outputs, self.inputs], names=["output", "input"])
        index = pandas.Index(np.array(self.frequency), name="frequency [Hz]")
        frame = pandas.DataFrame(self.H.reshape(self.n_freq, -1), index=index, columns=columns)
        frame.attrs = {"units": self.unit, "kind": str(self.kind)}
        return frame

    def _repr_html_(self) -> str:
        """Return the text of the prompt: labels of files stay text."""
        return f"<code>{escape(repr(self))}</code>"

    @classmethod
    def from_arrays(
        cls,
        frequency: ArrayLike,
        H: ArrayLike,
        kind: FRFKind | str = FRFKind.ACCELERANCE,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        base: Sequence[str] = (),
        strain: Sequence[str] = (),
    ) -> "FRF":
        """Build an FRF from bare arrays, checking them.

        ``H`` (n_freq, n_out) has the responses to one force, ``H`` (n_freq,) one response to one force.
        ``base`` names the inputs that are accelerations, ``strain`` the outputs that are strains.

        Raises
        ------
        FRFError
            For shapes that do not fit, frequencies that do not increase or are negative, values that are not
            finite, labels given twice, a base that is no input, a strain that is no output, or an unknown
            kind.
        """
        try:
            kind = FRFKind(kind)
        except ValueError:
            msg = f"the FRF kind is '{kind}'; allowed are {', '.join(FRFKind)}"
            raise FRFError(msg) from None
        if np.iscomplexobj(frequency):
            msg = f"the frequencies, of shape {np.shape(frequency)}, are complex; are they the FRFs?"
            raise FRFError(msg)
        frequency = np.array(frequency, dtype=float, ndmin=1)
        H = np.array(H, dtype=complex)
        if not 1 <= H.ndim <= 3 or H.shape[0] != frequency.size or frequency.ndim != 1:
            msg = (
                f"H has shape {H.shape} for {frequency.size} frequencies; (n_freq, n_out, n_in) is expected, "
                "(n_freq, n_out) for one force, or (n_freq,) for one response to one force"
            )
            raise FRFError(msg)
        H = H.reshape(*H.shape, *(1,) * (3 - H.ndim))
        outputs = tuple(outputs) if outputs is not None else tuple(f"out{i + 1}" for i in range(H.shape[1]))
        inputs = tuple(inputs) if inputs is not None else tuple(f"in{i + 1}" for i in range(H.shape[2]))
        for word, names, n in (("output", outputs, H.shape[1]), ("input", inputs, H.shape[2])):
            if len(names) != n:
                msg = f"{len(names)} {word} labels are given for {n} {word}s"
                raise FRFError(msg)
            if len(set(names)) != n:
                twice = next(name for name in names if names.count(name) > 1)
                msg = f"the {word} label '{twice}' occurs twice; labels must differ"
                raise FRFError(msg)
        for word, what, some, names in (
            ("input", "an acceleration", base, inputs),
            ("output", "a strain", strain, outputs),
        ):
            stranger = next((name for name in some if name not in names), None)
            if stranger is not None:
                have = ", ".join(names)
                msg = f"there is no {word} '{stranger}' that could be {what}; the data have {have}"
                raise FRFError(msg)
        if not np.isfinite(frequency).all() or (frequency < 0).any():
            msg = "frequencies must be finite and not negative [Hz]"
            raise FRFError(msg)
        if (np.diff(frequency) <= 0).any():
            k = int(np.flatnonzero(np.diff(frequency) <= 0)[0])
            msg = (
                f"frequencies must increase strictly; line {k + 1} has {frequency[k + 1]:g} Hz "
                f"after {frequency[k]:g} Hz"
            )
            raise FRFError(msg)
        if not np.isfinite(H).all():
            k, i, j = (int(v) for v in np.argwhere(~np.isfinite(H))[0])
            n = int((~np.isfinite(H)).sum())
            msg = (
                f"{n} FRF value(s) are not finite numbers, the first at {frequency[k]:g} Hz, "
                f"response '{outputs[i]}', force '{inputs[j]}'"
            )
            raise FRFError(msg)
        frequency.flags.writeable = False
        H.flags.writeable = False
        return cls(frequency, H, kind, outputs, inputs, base=tuple(base), strain=tuple(strain))

    @property
    def n_freq(self) -> int:
        """Number of frequency lines."""
        return self.frequency.size

    @property
    def omega(self) -> Floats:
        """Angular frequencies, shape (n_freq,) [rad/s]."""
        return 2 * np.pi * self.frequency

    def with_receptances(self, H: ArrayLike, frequency: ArrayLike | None = None) -> "FRF":
        """Return FRFs of the same channels and kind, from receptances on these lines or others [Hz]."""
        lines = self.frequency if frequency is None else frequency
        frf = FRF.from_arrays(lines, H, FRFKind.RECEPTANCE, self.outputs, self.inputs, self.base, self.strain)
        return frf.as_kind(self.kind)

    def as_kind(self, kind: FRFKind | str) -> "FRF":
        """Convert between receptance, mobility and accelerance by powers of iω; strains stay as they are.

        Raises
        ------
        FRFError
            If integration is asked for data with a line at 0 Hz, where it does not exist.
        """
        kind = FRFKind(kind)
        power = kind.derivatives - self.kind.derivatives
        if power == 0:
            return self
        moving = ~self.is_strain
        if power < 0 and self.frequency[0] == 0 and moving.any():
            msg = (
                f"a line at 0 Hz cannot be converted from {self.kind} to {kind}; "
                "leave it out with select(band=…)"
            )
            raise FRFError(msg)
        accuracy = self.accuracy
        omega = self.omega[:, None, None]
        if accuracy is not None and accuracy.bound is not None:
            bound = np.array(accuracy.bound)
            bound[:, moving] *= omega**power
            accuracy = replace(accuracy, bound=bound)
        H = np.array(self.H)
        if moving.any():
            H[:, moving] *= (1j * omega) ** power
        return replace(self, H=H, kind=kind, accuracy=accuracy)

    def select(
        self,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        band: tuple[float, float] | None = None,
        lines: ArrayLike | None = None,
    ) -> "FRF":
        """Return some of the responses, forces and lines, in the order asked for.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            Labels to keep.
        band : (float, float), optional
            Lowest and highest frequency to keep [Hz].
        lines : array_like of int or bool, optional
            Lines to keep, as an index of ``frequency``; taken before ``band``.

        Raises
        ------
        FRFError
            For a label that is not there or a band without a line.
        """

        def index(word: str, have: tuple[str, ...], want: Sequence[str] | None) -> list[int]:
            if want is None:
                return list(range(len(have)))
            for name in want:
                if name not in have:
                    msg = f"there is no {word} '{name}'; the data have {', '.join(have)}"
                    raise FRFError(msg)
            return [have.index(name) for name in want]

        i, j = index("output", self.outputs, outputs), index("input", self.inputs, inputs)
        keep = np.arange(self.n_freq) if lines is None else np.arange(self.n_freq)[np.asarray(lines)]
        if band is not None:
            keep = keep[(self.frequency[keep] >= band[0]) & (self.frequency[keep] <= band[1])]
            if not keep.size:
                msg = (
                    f"no line lies in the band {band[0]:g} to {band[1]:g} Hz; the data cover "
                    f"{self.frequency[0]:g} to {self.frequency[-1]:g} Hz"
                )
                raise FRFError(msg)
        accuracy = self.accuracy
        if accuracy is not None and accuracy.bound is not None:
            accuracy = replace(accuracy, bound=accuracy.bound[keep][:, i][:, :, j])
        return FRF(
            self.frequency[keep],
            self.H[keep][:, i][:, :, j],
            self.kind,
            tuple(self.outputs[k] for k in i),
            tuple(self.inputs[k] for k in j),
            accuracy,
            tuple(self.inputs[k] for k in j if self.inputs[k] in self.base),
            tuple(self.outputs[k] for k in i if self.outputs[k] in self.strain),
        )


# Responses per unit acceleration of a reference output, in place of unit force at the input -----------------
# A force f of unknown amplitude moves output o by H_of and a reference output r by H_rf. Their ratio is free
# of the force:
#
#     T = H_of / (s² H_rf),   dT = (dH_of - T s² dH_rf) / (s² H_rf),   s = iω


@dataclass(frozen=True, slots=True, eq=False)
class References:
    """Which outputs the responses to each input refer to; they follow the ``n`` outputs that are read.

    Attributes
    ----------
    n : int
        Number of outputs that are read.
    rows : ndarray of int (n_in,)
        Output whose acceleration divides the responses to each input; -1 where the input is a known force.
    """

    n: int
    rows: Ints

    def behind(self, n: int) -> "References":
        """Return the same references behind another number of outputs."""
        return References(n, np.where(self.rows >= 0, self.rows - self.n + n, -1))

    def read(self, H: Complexes, omega: NDArray[Any]) -> Complexes:
        """Return what is read, (n_freq, n, n_in), of the receptances of all outputs."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return H[:, : self.n] / self._accelerations(H, omega)[:, None]

    def slopes(self, dH: NDArray[Any], H: Complexes, omega: NDArray[Any]) -> NDArray[Any]:
        """Return the derivatives of what is read, (…, n_freq, n, n_in), by those of all receptances H."""
        over = self._accelerations(H, omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = self._at_references(dH) / np.where(self.rows >= 0, self._at_references(H), 1.0)
            relative = np.where(self.rows >= 0, relative, 0.0)
            return dH[..., : self.n, :] / over[:, None] - self.read(H, omega) * relative[..., None, :]

    def _at_references(self, H: NDArray[Any]) -> NDArray[Any]:
        """Return the receptance of each input's reference, (…, n_freq, n_in)."""
        return H[..., self.rows, np.arange(len(self.rows))]

    def _accelerations(self, H: Complexes, omega: NDArray[Any]) -> Complexes:
        """Return the acceleration of each input's reference for unit force, (n_freq, n_in); 1 without one."""
        a = -(np.asarray(omega)[:, None] ** 2) * self._at_references(H)
        return np.where(self.rows >= 0, a, 1.0)


# Tables of pandas and labelled arrays of xarray, both optional ----------------------------------------------


def imported(package: str) -> Any:
    """Import pandas or xarray.

    Raises
    ------
    ImportError
        If it is not installed; the message has the command that installs it.
    """
    try:
        return import_module(package)
    except ImportError as reason:
        msg = f"{package} is not installed; install it with: python -m pip install {package}"
        raise ImportError(msg) from reason
