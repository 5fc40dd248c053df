"""Measured modes in a diagnosis by FRFs, fitted and held out, with the models' partners."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.mode_diagnosis import frequency_error
from updating.inference.joint_fit import mode_problem_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ModePartners:
    """Measured modes, and their partners in the model of each step.

    Attributes
    ----------
    measured, std : ndarray (n,)
        Natural frequencies [Hz], and their relative standard deviations [-].
    computed, mac : mapping of str to ndarray (n,)
        Frequencies [Hz] and modal assurance criteria by step; NaN without a partner, or without shapes.
    held_out : ndarray of bool (n,)
    """

    measured: Floats
    std: Floats
    computed: dict[str, Floats]
    mac: dict[str, Floats]
    held_out: NDArray[np.bool_]

    def error(self, step: str, held_out: bool) -> float:
        """Return the root mean square of ln f ratios of modes that were fitted, or held out [-]."""
        return frequency_error(self.measured, self.computed[step], self.held_out == held_out)


def mode_partners(d: Diagnosis) -> ModePartners | None:
    """Return the measured modes of a diagnosis by FRFs with the partners in its models; None without any."""
    targets, computed, mac = d.problem.modes, {}, {}
    if targets is None:
        return None
    for step in d.steps:
        problem = mode_problem_of(d.problem, step.result.effects)
        assert problem is not None
        found = problem.computed(step.result)
        computed[step.label], mac[step.label] = found.frequency, found.mac
    return ModePartners(targets.frequency, targets.frequency_std, computed, mac, targets.held_out)


def partners_dict(m: ModePartners) -> dict[str, Any]:
    """Return measured modes and their partners of each step in plain types."""
    return {
        "modes": [
            {
                "measured_Hz": m.measured[k],
                "std": m.std[k],
                "held_out": bool(m.held_out[k]),
                "computed_Hz": {step: f[k] for step, f in m.computed.items()},
                "mac": {step: mac[k] for step, mac in m.mac.items()},
            }
            for k in range(len(m.measured))
        ],
        "error": {
            step: {"fit": m.error(step, False), "held_out": m.error(step, True)} for step in m.computed
        },
    }


def partner_lines(m: ModePartners) -> list[str]:
    """Return measured modes and their partners of the first, second and last step as lines of text."""
    steps = list(dict.fromkeys([*list(m.computed)[:2], list(m.computed)[-1]]))
    heads = dict(zip(steps, ("nominal %", "fitted %", "found %"), strict=False))
    lines = ["measured Hz  " + "  ".join(heads.values()) + "    MAC"]
    for k, f in enumerate(m.measured):
        off = [100 * (m.computed[s][k] / f - 1) for s in steps]
        cells = [
            f"{x:+.2f}".rjust(len(heads[s])) if np.isfinite(x) else "-".rjust(len(heads[s]))
            for s, x in zip(steps, off, strict=True)
        ]
        mac = m.mac[steps[-1]][k]
        lines.append(
            f"{f:11.5g}  {'  '.join(cells)}  {f'{mac:.3f}' if np.isfinite(mac) else '-':>5}"
            + ("  predicted, not fitted" if m.held_out[k] else "")
        )
    return lines
