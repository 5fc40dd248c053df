"""Random vibration: power spectral densities and root mean squares under stationary random excitation.

S_r = Σ |H|² S of excitations that are not correlated; the mean square is its integral over frequency. All
densities are one-sided, per hertz.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fem.analysis.base_excitation import compute_base_frf
from fem.analysis.complex_modes import solve_complex_modes
from fem.analysis.frf import FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.analysis.modes import solve_modes
from fem.analysis.participation import compute_energies
from fem.analysis.selection import Selection
from fem.analysis.tabulated import Tabulated
from fem.array_types import Floats
from fem.model import ModelError
from fem.summary import fields_summary
from fem.system import System

RESPONSES = ("displacement", "velocity", "acceleration")

_STEP = 0.125
"""Of arsinh x, x the distance from a mode in half bandwidths [-]."""
_LEAST_RATIO = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class RandomResponse:
    """Densities and root mean squares of responses.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Lines, denser at resonances [Hz].
    density : ndarray (n_freq, n_out)
        One-sided [(unit of the response)²/Hz].
    outputs : tuple of str
    response : str
        ``"displacement"``, ``"velocity"`` or ``"acceleration"``.
    relative : bool
        Whether responses are relative to the base.
    """

    frequency: Floats
    density: Floats
    outputs: tuple[str, ...]
    response: str
    relative: bool

    __repr__ = fields_summary

    @property
    def rms(self) -> Floats:
        """Root mean squares, shape (n_out,) [m, m/s or m/s²]."""
        return np.sqrt(_integral(self.frequency, self.density))

    @property
    def crossings(self) -> Floats:
        """Upward crossings of the mean per second, √(∫ f² S df / ∫ S df) (Rice), shape (n_out,) [Hz]."""
        second = _integral(self.frequency, self.frequency[:, None] ** 2 * self.density)
        total = _integral(self.frequency, self.density)
        return np.sqrt(np.divide(second, total, out=np.zeros_like(total), where=total > 0))


def solve_random(
    system: System,
    outputs: Selection,
    *,
    loads: ArrayLike | None = None,
    forces: Sequence[Tabulated] = (),
    base: Mapping[str, Tabulated] | None = None,
    response: str = "acceleration",
    relative: bool = False,
    about: ArrayLike | None = None,
) -> RandomResponse:
    """Compute densities of responses to random forces and motions of the base, none correlated with another.

    Parameters
    ----------
    system : System
    outputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    loads : array_like (k, n_dof), optional
        Loads whose factors are random, as rows.
    forces : sequence of Tabulated
        Densities of these factors, k [1/Hz; N²/Hz for loads of 1 N]; none outside their frequencies.
    base : mapping of str to Tabulated, optional
        Densities of accelerations of the base by direction [(m/s²)²/Hz].
    response : str
    relative : bool
        Whether responses are relative to the base.
    about : array_like (3,), optional
        Point about which the base turns, the origin unless given [m].

    Raises
    ------
    ModelError
        For an unknown response, no excitation, or densities that do not fit the loads.
    FRFError
        As :func:`fem.analysis.frf_solver.compute_frf`.
    """
    if response not in RESPONSES:
        msg = f"the response is '{response}'; allowed are {', '.join(RESPONSES)}"
        raise ModelError(msg)
    rows = np.zeros((0, system.model.n_dof)) if loads is None else np.array(loads, dtype=float, ndmin=2)
    base = dict(base or {})
    if rows.shape != (len(forces), system.model.n_dof) or not (len(forces) or base):
        msg = (
            f"{len(forces)} densities of forces are given for loads of shape {rows.shape}, and {len(base)} "
            f"of the base; (number of densities, {system.model.n_dof}) is expected, and at least one density"
        )
        raise ModelError(msg)
    spectra = [*forces, *base.values()]
    low = min(s.frequency[0] for s in spectra)
    high = max(s.frequency[-1] for s in spectra)
    corners = np.unique(np.concatenate([s.frequency for s in spectra]))
    lines = resonance_lines(system, low, high, corners)
    power = RESPONSES.index(response)
    density, labels = 0.0, ()
    if len(forces):
        kind = list(FRFKind)[power]
        found = compute_frf(system, lines, outputs, rows, kind)
        S = np.stack([s.within(lines) for s in forces], axis=1)
        density, labels = np.einsum("foi,fi->fo", np.abs(found.H) ** 2, S), found.outputs
    if base:
        found = compute_base_frf(system, lines, outputs, list(base), relative=relative, about=about)
        S = np.stack([s.within(lines) for s in base.values()], axis=1)
        omega = (2 * np.pi * lines) ** (2 * (power - 2))  # per acceleration of the base
        density = density + omega[:, None] * np.einsum("foi,fi->fo", np.abs(found.H) ** 2, S)
        labels = found.outputs
    return RandomResponse(lines, np.asarray(density), labels, response, relative)


def resonance_lines(system: System, low: float, high: float, corners: ArrayLike = ()) -> Floats:
    """Return lines over which densities with resonances are integrated [Hz].

    Equal steps of arsinh x, x the distance from a mode in half bandwidths: equal ones near the mode, and
    equal ratios of distances farther off; and equal ratios of frequencies for what has no mode near it.

    Parameters
    ----------
    system : System
    low, high : float
        Band [Hz].
    corners : array_like
        Further lines within the band [Hz].
    """
    modes = solve_modes(system, max_frequency=1.1 * high)
    keep = modes.frequency > 0
    if system.reciprocal:
        zeta = compute_energies(system.model, modes).zeta  # local dampers included
        f, z = modes.frequency[keep], np.maximum(zeta[keep], _LEAST_RATIO)
    else:  # a rotor's frequencies split with its speed, some into the band
        # Modes of a rotor beyond those of it at rest: backward whirl lowers the frequencies of some
        poles = solve_complex_modes(system, int(keep.sum()) + 6).poles
        poles = poles[poles.imag > 0]
        f, z = np.abs(poles) / (2 * np.pi), np.maximum(-poles.real / np.abs(poles), _LEAST_RATIO)
    near = [f0 * (1 + ratio * np.sinh(_arsinh_steps(ratio))) for f0, ratio in zip(f, z, strict=True)]
    # lines in an octave
    n = int(np.ceil(np.log2(high / low) * 24)) + 2
    every = np.concatenate([*near, np.geomspace(low, high, n), np.asarray(corners, dtype=float), f])
    return np.unique(every[(every >= low) & (every <= high)])


def _arsinh_steps(ratio: float) -> Floats:
    """Return equal steps up to where the distance from a mode is its frequency."""
    n = int(np.ceil(np.arcsinh(1 / ratio) / _STEP))
    return np.linspace(-n * _STEP, n * _STEP, 2 * n + 1)


def _integral(x: Floats, values: Floats) -> Floats:
    """Return the integrals of columns by monotone cubics, which follow resonances closer than lines do."""
    return np.asarray(
        scipy.interpolate.PchipInterpolator(x, values, axis=0).integrate(x[0], x[-1]), dtype=float
    )
