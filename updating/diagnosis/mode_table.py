"""Measured modes beside those of the models of each step of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fem.array_types import Bools, Floats
from updating.inference.mode_fit import DAMPING, FREQUENCY, ComputedModes
from updating.inference.mode_targets import ModeTargets

HALF = 0.5
"""What is less probable than all else together is not taken for the answer [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeTable:
    """Measured modes and their computed partners, (n,) each; NaN where there is none.

    Attributes
    ----------
    measured, std : ndarray
        Frequencies [Hz] and their relative standard deviations [-].
    computed, mac, zeta_computed : mapping of str to ndarray
        Frequencies [Hz], modal assurance criteria and damping ratios of the model of each step: nominal,
        fitted, and with each effect that was found.
    zeta : ndarray
        Measured damping ratios [-].
    held_out : ndarray of bool
        Modes that no fit has seen: they are predicted.
    found_std : ndarray
        Relative standard deviations of ``found`` where a mode is predicted [-].
    bad : ndarray
        Probability that the frequency does not belong to the structure's model; NaN where it was held out.
    """

    measured: Floats
    std: Floats
    computed: Mapping[str, Floats]
    mac: Mapping[str, Floats]
    zeta: Floats
    zeta_computed: Mapping[str, Floats]
    held_out: Bools
    found_std: Floats
    bad: Floats

    @classmethod
    def of(cls, t: ModeTargets, steps: Mapping[str, ComputedModes]) -> ModeTable:
        """Return measured modes beside the models of some steps, the last of which is reported."""
        return cls(
            t.frequency,
            t.frequency_std,
            {label: c.frequency for label, c in steps.items()},
            {label: c.mac for label, c in steps.items()},
            t.zeta,
            {label: c.zeta for label, c in steps.items()},
            t.held_out,
            *np.full((2, t.n), np.nan),
        )

    @property
    def nominal(self) -> Floats:
        """Frequencies of the nominal model [Hz]."""
        return next(iter(self.computed.values()))

    @property
    def fitted(self) -> Floats:
        """Frequencies of the model with fitted uncertain parameters, without what was found [Hz]."""
        return list(self.computed.values())[min(1, len(self.computed) - 1)]

    @property
    def found(self) -> Floats:
        """Frequencies of the model that is reported [Hz]."""
        return list(self.computed.values())[-1]

    @property
    def mac_nominal(self) -> Floats:
        """Modal assurance criteria of the nominal model [-]."""
        return next(iter(self.mac.values()))

    @property
    def mac_fitted(self) -> Floats:
        """Modal assurance criteria of the model with fitted uncertain parameters, as ``fitted`` [-]."""
        return list(self.mac.values())[min(1, len(self.mac) - 1)]

    @property
    def mac_found(self) -> Floats:
        """Modal assurance criteria of the model that is reported [-]."""
        return list(self.mac.values())[-1]

    @property
    def zeta_found(self) -> Floats:
        """Damping ratios of the model that is reported [-]."""
        return list(self.zeta_computed.values())[-1]

    @property
    def belongs(self) -> Bools:
        """Whether each mode is more probably the model's than not."""
        return ~(self.bad >= HALF)

    def predicted_text(self, k: int) -> str:
        """Return a predicted frequency with its standard deviation."""
        return f"{self.found[k]:.5g} ± {self.found[k] * self.found_std[k]:.2g} Hz"

    def error_of(self, kind: int, step: int) -> float:
        """Return the root mean square error of a kind of reading in a step, of modes that were fitted [-].

        Of ln ratios, of shapes √(1 - MAC); without modes that do not belong, NaN where nothing is measured.
        """
        computed, mac, zeta = (list(x.values())[step] for x in (self.computed, self.mac, self.zeta_computed))
        if kind == FREQUENCY:
            return self.errors(computed, False)
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.log(zeta / self.zeta) if kind == DAMPING else np.sqrt(np.maximum(1 - mac, 0.0))
        off = off[~self.held_out & self.belongs & np.isfinite(off)]
        return float(np.sqrt(np.mean(off**2))) if off.size else np.nan

    def errors(self, computed: Floats, held_out: bool) -> float:
        """Return the root mean square of ln f ratios of modes that were fitted, or held out [-].

        Without those that do not belong.
        """
        return frequency_error(self.measured, computed, (self.held_out == held_out) & self.belongs)


def frequency_error(measured: Floats, computed: Floats, some: Bools) -> float:
    """Return the root mean square of ln f ratios of some modes, NaN where none has a partner [-]."""
    some = some & np.isfinite(computed)
    if not some.any():
        return float("nan")
    return float(np.sqrt(np.mean(np.log(computed[some] / measured[some]) ** 2)))
