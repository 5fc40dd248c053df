"""FRFs among the named arrays of a file: which array is which, and which axis."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from fem.analysis.frf import FRF, FRFError, FRFKind
from fem.array_types import Complexes, Floats
from fem.io.arrays import TableError
from fem.io.faults import error_at
from fem.io.frf_labels import NAMES, Unit, decibel_reference, frequency_factor, frf_unit
from fem.io.frf_reading import Asked, Reading
from fem.io.mat_hdf5 import Named

USUAL: dict[str, tuple[str, ...]] = {
    "frequency": (
        "frequency",
        "frequencies",
        "freq",
        "freqs",
        "f",
        "fhz",
        "freqhz",
        "frequencyhz",
        "freqvec",
        "frequencyvector",
        "omega",
        "w",
        "angularfrequency",
    ),
    "H": (
        "h",
        "frf",
        "frfs",
        "frfmatrix",
        "hmatrix",
        "h1",
        "h2",
        "hv",
        "hexp",
        "hmeas",
        "transferfunction",
        *NAMES,
    ),
    "real": (
        "real",
        "re",
        "hreal",
        "hre",
        "realh",
        "reh",
        "frfreal",
        "frfre",
        "realfrf",
        "refrf",
        "realpart",
    ),
    "imag": (
        "imag",
        "im",
        "himag",
        "him",
        "imagh",
        "imh",
        "frfimag",
        "frfim",
        "imagfrf",
        "imfrf",
        "imagpart",
    ),
    "magnitude": (
        "magnitude",
        "mag",
        "amplitude",
        "amp",
        "abs",
        "absh",
        "hmag",
        "hmagnitude",
        "habs",
        "frfmag",
        "frfmagnitude",
        "frfabs",
        "magnitudedb",
        "magdb",
        "hmagdb",
        "hdb",
        "frfdb",
        "frfmagdb",
    ),
    "phase": (
        "phase",
        "angle",
        "phi",
        "hphase",
        "hangle",
        "frfphase",
        "frfangle",
        "phasedeg",
        "phaserad",
        "angledeg",
        "anglerad",
        "hphasedeg",
        "hphaserad",
        "frfphasedeg",
        "frfphaserad",
    ),
    "coherence": ("coherence", "coh", "gamma2", "gammasquared"),
    "outputs": (
        "outputs",
        "output",
        "outputlabels",
        "outputnames",
        "responses",
        "responselabels",
        "responsenames",
        "sensors",
        "sensornames",
        "sensorlabels",
    ),
    "inputs": (
        "inputs",
        "input",
        "inputlabels",
        "inputnames",
        "forces",
        "forcelabels",
        "forcenames",
        "references",
        "referencelabels",
        "referencenames",
        "excitations",
        "excitationlabels",
        "excitationnames",
    ),
    "kind": ("kind", "frfkind", "frftype"),
}
"""Usual names of arrays, in small letters without punctuation."""

TEXTS = ("outputs", "inputs", "kind")
AXES = ("frequency", "output", "input")

_AXIS_WORDS = {
    "frequency": (*USUAL["frequency"], "line", "lines"),
    "output": ("output", "outputs", "out", "response", "responses", "sensor", "sensors", "o"),
    "input": ("input", "inputs", "in", "force", "forces", "reference", "references", "excitation", "i"),
}

Values = Floats | Complexes


@dataclass(frozen=True, slots=True)
class _Found:
    key: str
    array: Named


def frf_of_arrays(arrays: Mapping[str, Named], name: str, asked: Asked) -> Reading:
    """Return the FRFs among named arrays.

    Parameters
    ----------
    arrays : mapping of str to Named
    name : str
        The file, for messages.
    asked : Asked
        Uses ``kind``, ``outputs``, ``inputs``, ``arrays``, ``axes``, ``form`` and ``unit_labels``.
    """
    file = _File(arrays, name, asked)
    frequency, axis_label = file.frequency()
    main, values, phase = file.values()
    outputs, inputs = (file.labels(role) for role in ("outputs", "inputs"))
    order = file.order(main, values.shape, frequency.size, outputs, inputs)
    H = order.apply(values)
    kind, factor, notes = file.kind(main)
    coherence = file.optional("coherence")
    gamma = None
    if coherence is not None:
        if coherence.array.values.shape != values.shape:
            file.refuse(
                f"the array '{coherence.key}' has shape {coherence.array.values.shape}, the FRFs have "
                f"{values.shape}; they must agree"
            )
        gamma = order.apply(np.asarray(coherence.array.values, dtype=float)).real
    try:
        frf = FRF.from_arrays(frequency, factor * H, kind, outputs, inputs)
    except FRFError as reason:
        file.refuse(str(reason))
    taken = ", ".join(dict.fromkeys(f"'{key}' as {role}" for role, key in file.taken.items()))
    return Reading(
        (frf,),
        ((axis_label,),) if axis_label else (),
        phase,
        gamma,
        notes=(*([f"the arrays {taken} are taken"] if file.taken else []), *notes, *order.notes),
    )


@dataclass(frozen=True, slots=True)
class _Order:
    """Axes of an array of FRFs: that of the frequencies, the responses and the forces, -1 for none."""

    axes: tuple[int, int, int]
    notes: tuple[str, ...] = ()

    def apply(self, values: Values) -> Values:
        """Return values as (n_freq, n_out, n_in)."""
        kept = [a for a in self.axes if a >= 0]
        rest = [a for a in range(values.ndim) if a not in kept]  # of size 1
        moved = values.transpose(*kept, *rest).reshape([values.shape[a] for a in kept])
        shape = iter(moved.shape)
        return moved.reshape([next(shape) if a >= 0 else 1 for a in self.axes])


class _File:
    """Named arrays of one file, with the user's statements about them."""

    def __init__(self, arrays: Mapping[str, Named], name: str, asked: Asked) -> None:
        self.arrays, self.name, self.asked = arrays, name, asked
        self.taken: dict[str, str] = {}
        for role in asked.arrays:
            if role not in USUAL:
                self.refuse(f"arrays has the key '{role}'; allowed are {', '.join(USUAL)}")

    def refuse(self, text: str) -> NoReturn:
        """Raise an error with the file's name."""
        raise error_at(self.name, text, TableError)

    @property
    def content(self) -> str:
        """The arrays with their shapes, in words."""
        shown = [f"{key} {value.values.shape}" for key, value in list(self.arrays.items())[:12]]
        return ", ".join(shown) + (" …" if len(self.arrays) > 12 else "") or "none"

    def optional(self, role: str) -> _Found | None:
        """Return the array that is stated for a role, or the only one with a usual name of it."""
        stated = self.asked.arrays.get(role)
        if stated is not None:
            if stated not in self.arrays:
                self.refuse(f"there is no array '{stated}' for {role}; it has {self.content}")
            return _Found(stated, self.arrays[stated])
        texts = role in TEXTS
        found = [
            key
            for key, value in self.arrays.items()
            if _plain(key.rpartition("/")[2]) in USUAL[role] and (value.values.dtype.kind == "U") == texts
        ]
        if len(found) > 1:
            self.refuse(
                f"the arrays {', '.join(found[:6])} could each be the {role}; state it: "
                f'arrays = {{ {role} = "{found[0]}" }}'
            )
        if found and not texts:
            self.taken[role] = found[0]
        return _Found(found[0], self.arrays[found[0]]) if found else None

    def frequency(self) -> tuple[Floats, str]:
        """Return the frequencies [Hz], and the label of their unit in the file."""
        found = self.optional("frequency") or self._scale()
        if found is None:
            self.refuse(
                f"no array has a usual name of frequencies ({', '.join(USUAL['frequency'][:5])} …); it has "
                f'{self.content}; state it: arrays = {{ frequency = "…" }}'
            )
        values = np.squeeze(found.array.values)
        values = values.reshape(1) if values.ndim == 0 else values
        if values.ndim != 1 or values.dtype.kind not in "fiu":
            self.refuse(
                f"the array '{found.key}' is {values.dtype} of shape {found.array.values.shape}; a list of "
                "real frequencies is needed"
            )
        label = found.array.unit
        if not label and _plain(found.key.rpartition("/")[2]) in ("omega", "w", "angularfrequency"):
            label = "rad/s"
        factor = frequency_factor(label) if label else 1.0
        if factor is None:
            self.refuse(
                f"the array '{found.key}' is in '{label}', which is no unit of frequency that is known"
            )
        return (factor or 1.0) * values.astype(float), label

    def _scale(self) -> _Found | None:
        """Return frequencies that lie along an axis of another array."""
        for value in self.arrays.values():
            for axis, scale in value.scales.items():
                if _axis_of(axis) == "frequency":
                    return _Found(axis, Named(scale))
        return None

    def values(self) -> tuple[_Found, Values, bool]:
        """Return the array that tells the axes, FRFs or amplitudes in its order, and whether with phase."""
        H = self.optional("H")
        parts = {role: self.optional(role) for role in ("real", "imag", "magnitude", "phase")}
        if H is not None and H.array.values.dtype.kind == "c" and self.asked.form in ("auto", "complex"):
            return H, H.array.values, bool(np.imag(H.array.values).any())
        if H is not None and parts["magnitude"] is None and parts["real"] is None:
            parts["magnitude"] = H
        real, imag, magnitude, angle = parts.values()
        if real is not None and imag is not None:
            return real, self._alike(real, imag, lambda a, b: a + 1j * b), True
        if magnitude is None:
            self.refuse(
                f"no array has a usual name of FRFs ({', '.join(USUAL['H'][:5])} …, or real and imag, or "
                f'magnitude and phase); it has {self.content}; state it: arrays = {{ H = "…" }}'
            )
        size = self._amplitude(magnitude)
        if angle is None:
            return magnitude, size, False
        unit = self._radians(angle)
        turned = self._alike(magnitude, angle, lambda _, b: size * np.exp(1j * unit * b))
        return magnitude, turned, True

    def _alike(self, one: _Found, other: _Found, join: Callable[[Any, Any], Values]) -> Values:
        a, b = one.array.values, other.array.values
        if a.shape != b.shape or "c" in (a.dtype.kind, b.dtype.kind):
            self.refuse(
                f"the arrays '{one.key}' ({a.dtype}, {a.shape}) and '{other.key}' ({b.dtype}, {b.shape}) "
                "must be real and of one shape"
            )
        return join(a, b)

    def _amplitude(self, found: _Found) -> Floats:
        """Return amplitudes that are given as such or as levels."""
        values = found.array.values
        if values.dtype.kind == "c":
            self.refuse(f"the array '{found.key}' is complex; magnitudes are real")
        level = _plain(found.key).endswith("db") or decibel_reference(found.array.unit or "-") is not None
        if self.asked.form in ("decibel", "decibel-degrees") or (level and self.asked.form == "auto"):
            reference = decibel_reference(found.array.unit) or (1.0, "")
            return reference[0] * 10 ** (np.asarray(values, dtype=float) / 20)
        if (np.asarray(values) < 0).any():
            self.refuse(
                f"the array '{found.key}' is real with negative values, so it has no amplitudes; give the "
                'imaginary parts too (arrays = { real = "…", imag = "…" }), or form = "decibel" for '
                "levels"
            )
        return np.asarray(values, dtype=float)

    def _radians(self, found: _Found) -> float:
        """Return the unit of an array of angles [rad]."""
        forms = {"magnitude-degrees": "deg", "decibel-degrees": "deg", "magnitude-radians": "rad"}
        label = forms.get(self.asked.form) or found.array.unit.strip().lower()
        plain = _plain(found.key)
        label = label or ("deg" if plain.endswith("deg") else "rad" if plain.endswith("rad") else "")
        largest = float(np.nanmax(np.abs(found.array.values.astype(float)), initial=0.0))
        if label in ("deg", "degree", "degrees", "°") or (not label and largest > 2 * np.pi + 0.01):
            return np.pi / 180
        if label in ("rad", "radian", "radians"):
            return 1.0
        self.refuse(
            f"the array '{found.key}' does not say whether its angles, up to {largest:.3g}, are degrees or "
            'radians; give form = "magnitude-degrees" or "magnitude-radians"'
        )

    def labels(self, role: str) -> list[str] | None:
        """Return labels of responses or forces: those that the user gives, or the file's."""
        given = getattr(self.asked, role)
        if given is not None:
            return list(given)
        found = self.optional(role)
        if found is not None:
            return [str(x) for x in found.array.values.reshape(-1)]
        for value in self.arrays.values():
            for axis, scale in value.scales.items():
                if f"{_axis_of(axis)}s" == role and scale.dtype.kind == "U":
                    return [str(x) for x in scale]
        return None

    def order(
        self,
        main: _Found,
        shape: Sequence[int],
        n_freq: int,
        outputs: Sequence[str] | None,
        inputs: Sequence[str] | None,
    ) -> _Order:
        """Return which axis of an array of FRFs is which: as stated, as the file names them, or by sizes."""
        named = tuple(self.asked.axes) or tuple(_axis_of(axis) for axis in main.array.axes)
        counts = {"frequency": n_freq, "output": _count(outputs), "input": _count(inputs)}
        if named and set(named) <= set(AXES):
            return self._by_names(main.key, shape, named, counts)
        long = [a for a, n in enumerate(shape) if n != 1]
        of_lines = [a for a in long if shape[a] == n_freq]
        if n_freq == 1:
            of_lines = [-1]
        if len(of_lines) != 1:
            found = "no axis" if not of_lines else f"{len(of_lines)} axes"
            self.refuse(
                f"the array '{main.key}' has shape {tuple(shape)}: {found} of it "
                f"{'have' if of_lines else 'has'} "
                f"the {n_freq} frequencies{self._axes_hint(len(shape)) if of_lines else ''}"
            )
        rest = [a for a in long if a != of_lines[0]]
        if not rest:
            return _Order((of_lines[0], -1, -1))
        if len(rest) == 1:
            return self._one_more(main.key, shape, of_lines[0], rest[0], outputs, inputs)
        if len(rest) > 2:
            self.refuse(
                f"the array '{main.key}' has shape {tuple(shape)}; one axis each for frequencies, responses "
                "and forces is allowed"
            )
        fits = [
            pair
            for pair in (rest, rest[::-1])
            if counts["output"] in (None, shape[pair[0]]) and counts["input"] in (None, shape[pair[1]])
        ]
        if len(fits) != 1:
            words = "do not fit" if not fits else "do not tell responses from forces"
            known = ", ".join(f"{n} {w}s" for w, n in counts.items() if n is not None and w != "frequency")
            self.refuse(
                f"the array '{main.key}' has shape {tuple(shape)}, and its sizes {words}"
                f"{f' ({known} are known)' if known else ''}{self._axes_hint(len(shape))}"
            )
        return _Order((of_lines[0], fits[0][0], fits[0][1]))

    def _axes_hint(self, n: int) -> str:
        order = " ".join(("frequency", "output", "input")[:n])
        return f'; give the order of its axes, such as axes = "{order}"'

    def _by_names(
        self, key: str, shape: Sequence[int], named: Sequence[str], counts: Mapping[str, int | None]
    ) -> _Order:
        if len(named) != len(shape) or len(set(named)) != len(named) or "frequency" not in named:
            self.refuse(
                f"the axes are given as {' '.join(named)}, and the array '{key}' has shape {tuple(shape)}; "
                f"one of {', '.join(AXES)} for each axis is needed, frequency among them"
            )
        for axis, n in zip(named, shape, strict=True):
            count = counts[axis]
            if count is not None and count != n:
                self.refuse(
                    f"the array '{key}' has shape {tuple(shape)}: its axis {axis} has {n} values for {count} "
                    f"{'frequencies' if axis == 'frequency' else f'{axis}s'}"
                )
        at = [named.index(axis) if axis in named else -1 for axis in AXES]
        return _Order((at[0], at[1], at[2]))

    def _one_more(
        self,
        key: str,
        shape: Sequence[int],
        lines: int,
        rest: int,
        outputs: Sequence[str] | None,
        inputs: Sequence[str] | None,
    ) -> _Order:
        n, n_out, n_in = shape[rest], _count(outputs), _count(inputs)
        to_one_force = n_out in (None, n) and n_in in (None, 1)
        of_one_sensor = n_in in (None, n) and n_out in (None, 1)
        if to_one_force and (n_out == n or n_in == 1):
            return _Order((lines, rest, -1))
        if of_one_sensor and (n_in == n or n_out == 1):
            return _Order((lines, -1, rest))
        if to_one_force and of_one_sensor:
            note = f"the axis of {n} values of the array '{key}' is taken for responses to one force"
            return _Order((lines, rest, -1), (note,))
        self.refuse(
            f"the array '{key}' has shape {tuple(shape)}: its {n} FRFs at each frequency do not fit "
            f"{n_out or 'unknown'} responses to {n_in or 'unknown'} forces"
        )

    def kind(self, main: _Found) -> tuple[FRFKind, float, tuple[str, ...]]:
        """Return the kind, the factor to its SI unit, and notes on them."""
        unit = self._unit(main) if self.asked.unit_labels else None
        asked = self.asked.known_kind(self.name)
        if unit is not None and unit.kind is not None:
            if asked is not None and asked != unit.kind:
                self.refuse(
                    f"the array '{main.key}' has the unit '{main.array.unit}', that of {unit.kind}, and kind "
                    f"is {asked}; correct kind, or give scale, with which unit labels do not count"
                )
            factor = unit.factor
            note = f"the FRFs are in '{main.array.unit}' and multiplied by {factor:.6g}"
            return unit.kind, factor, () if factor == 1 else (note,)
        stated = self.optional("kind")
        word = str(stated.array.values.reshape(-1)[0]).lower() if stated is not None else ""
        kind = NAMES.get(word) or NAMES.get(_plain(main.key.rpartition("/")[2])) or asked
        if kind is None:
            self.refuse(f"it does not say the kind of its FRFs; give kind, one of {', '.join(FRFKind)}")
        return kind, 1.0, ()

    def _unit(self, main: _Found) -> Unit | None:
        label = main.array.unit.strip()
        level = decibel_reference(label)
        label = level[1] if level is not None else label
        if not label:
            return None
        unit = frf_unit(label)
        if unit is None:
            self.refuse(
                f"the array '{main.key}' has the unit '{label}', which is none of FRFs that is known; give "
                "scale, the factor to SI, with which unit labels do not count, and kind"
            )
        if unit.kind is None:
            self.refuse(
                f"the array '{main.key}' has the unit '{label}' of strains, which are read from .npz, "
                "tables and universal files; write it as .npz with strain, the names of those outputs"
            )
        return unit


def _count(labels: Sequence[str] | None) -> int | None:
    return None if labels is None else len(labels)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _axis_of(name: str) -> str:
    """Return which of ``AXES`` a name is; the name itself for none."""
    plain = _plain(name)
    return next((axis for axis, words in _AXIS_WORDS.items() if plain in words), name)
