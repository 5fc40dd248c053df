"""How alike shapes and FRFs are: MAC, FRAC and logarithmic errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.frf import FRF, FRFError
from fem.modes import Modes

DB_PER_NEPER = 20 / np.log(10)

_NAN = complex(np.nan, np.nan)
"""No number in both parts; complex("nan") has the imaginary part 0, which would count as a phase."""


def mac(phi_x: ArrayLike, phi_a: ArrayLike) -> NDArray[np.float64]:
    """Compute the modal assurance criterion |φ_xᴴ φ_a|² / (φ_xᴴφ_x · φ_aᴴφ_a).

    Allemang & Brown, 1st IMAC, 1982. It says whether shapes look alike at the measured DOFs; with few
    sensors different modes may.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_modes)
        Shapes at the same DOFs, real or complex.

    Returns
    -------
    ndarray (n_modes_x, n_modes_a)
        0 to 1.

    Raises
    ------
    ValueError
        If the numbers of DOFs differ.
    """
    x, a = (np.atleast_2d(np.asarray(p).T).T for p in (phi_x, phi_a))
    if x.shape[0] != a.shape[0]:
        msg = f"the shapes have {x.shape[0]} and {a.shape[0]} DOFs; MAC needs the same DOFs in both"
        raise ValueError(msg)
    cross = np.abs(x.conj().T @ a) ** 2
    norm = np.outer((np.abs(x) ** 2).sum(axis=0), (np.abs(a) ** 2).sum(axis=0))
    return np.minimum(np.divide(cross, norm, out=np.zeros(cross.shape), where=norm > 0), 1.0)


def frac(H_x: ArrayLike, H_a: ArrayLike) -> NDArray[np.float64]:
    """Compute the frequency response assurance criterion of each FRF over the lines.

    |Σ H_x H_a*|² / (Σ|H_x|² Σ|H_a|²); Heylen & Lammens, 1996. Blind to a constant factor.

    Parameters
    ----------
    H_x, H_a : array_like (n_freq, n_out, n_in)

    Returns
    -------
    ndarray (n_out, n_in)
        0 to 1.
    """
    x, a = np.asarray(H_x), np.asarray(H_a)
    cross = np.abs((x * a.conj()).sum(axis=0)) ** 2
    norm = (np.abs(x) ** 2).sum(axis=0) * (np.abs(a) ** 2).sum(axis=0)
    return np.minimum(np.divide(cross, norm, out=np.zeros(cross.shape), where=norm > 0), 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How far computed FRFs are from measured ones.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Lines compared [Hz].
    log_ratio : ndarray of complex (n_freq, n_out, n_in)
        ln(H_computed / H_measured): real part in nepers, imaginary part the phase difference [rad]; NaN
        where masked.
    bands : ndarray (n_bands + 1,)
        Edges [Hz].
    error_db : ndarray (n_bands, n_out, n_in)
        Root mean square of the amplitude's error [dB].
    phase_deg : ndarray (n_bands, n_out, n_in)
        Root mean square of the phase difference [degrees].
    frac : ndarray (n_out, n_in)
    outputs, inputs : tuple of str
    """

    frequency: NDArray[np.float64]
    log_ratio: NDArray[np.complex128]
    bands: NDArray[np.float64]
    error_db: NDArray[np.float64]
    phase_deg: NDArray[np.float64]
    frac: NDArray[np.float64]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def total_db(self) -> float:
        """Root mean square of the amplitude's error over everything [dB]."""
        return rms_db(self.log_ratio)

    def by_sensor(self) -> NDArray[np.float64]:
        """Return the error of each sensor, shape (n_out,) [dB]."""
        return np.array([rms_db(self.log_ratio[:, i]) for i in range(len(self.outputs))])

    def by_band(self) -> NDArray[np.float64]:
        """Return the error of each sensor in each band, shape (n_out, n_bands) [dB]."""
        square = self.error_db**2
        seen = np.isfinite(square)
        n = seen.sum(axis=2)
        mean = np.divide(
            np.where(seen, square, 0.0).sum(axis=2), n, out=np.full(n.shape, np.nan), where=n > 0
        )
        return np.sqrt(mean).T


@dataclass(frozen=True, slots=True, eq=False)
class ModeComparison:
    """How far computed modes are from measured ones.

    Attributes
    ----------
    mac : ndarray (n_measured, n_computed)
        0 to 1.
    pairs : tuple of (int, int)
        Measured and computed modes that belong together, best MAC first, each mode once.
    frequency_error : ndarray (n_pairs,)
        Computed over measured natural frequency, less one [-].
    """

    mac: NDArray[np.float64]
    pairs: tuple[tuple[int, int], ...]
    frequency_error: NDArray[np.float64]


def compare_modes(
    measured: Modes, computed: Modes, rows: ArrayLike, least_mac: float = 0.5
) -> ModeComparison:
    """Pair measured with computed modes by their shapes, and compare natural frequencies.

    Parameters
    ----------
    measured : Modes
        Shapes (n, n_measured) at the sensors.
    computed : Modes
        Shapes (n_dof, n_computed) at all DOFs; rigid-body modes are left out of the pairs.
    rows : array_like (n, n_dof)
        Sensors as combinations of DOFs.
    least_mac : float
        Pairs below this MAC are not made [-].

    Raises
    ------
    ValueError
        If the shapes do not fit the sensors.
    """
    rows = np.asarray(rows, dtype=float)
    if rows.ndim != 2 or rows.shape != (measured.shapes.shape[0], computed.shapes.shape[0]):
        msg = (
            f"rows have shape {rows.shape}; {measured.shapes.shape[0]} measured and "
            f"{computed.shapes.shape[0]} computed DOFs need (n_measured, n_computed) of these"
        )
        raise ValueError(msg)
    values = mac(measured.shapes, rows @ computed.shapes)
    left = values.copy()
    left[:, : computed.n_rigid] = -1.0
    pairs = []
    for _ in range(min(left.shape)):
        i, j = (int(k) for k in np.unravel_index(np.argmax(left), left.shape))
        if left[i, j] < least_mac:
            break
        pairs.append((i, j))
        left[i], left[:, j] = -1.0, -1.0
    error = np.array([computed.frequency[j] / measured.frequency[i] - 1 for i, j in pairs])
    return ModeComparison(values, tuple(pairs), error)


def rms_db(log_ratio: NDArray[np.complex128]) -> float:
    """Return the root mean square of the real part in dB, without NaN; NaN if nothing is left."""
    x = log_ratio.real[np.isfinite(log_ratio.real)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")


def log_ratio(computed: NDArray[np.complex128], measured: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return ln(computed / measured) with the phase between -π and π; NaN where one of them is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(computed / measured)
    return np.where(np.isfinite(ratio), ratio, _NAN)


def compare(
    measured: FRF, computed: FRF, bands: ArrayLike | int = 6, mask: NDArray[np.bool_] | None = None
) -> Comparison:
    """Compare measured with computed FRFs at the measured lines.

    Parameters
    ----------
    measured, computed : FRF
        With the same lines and labels; kinds are converted.
    bands : array_like or int
        Edges of bands [Hz], or how many equal ones.
    mask : ndarray of bool (n_out, n_in), optional
        FRFs that count; those that are zero by symmetry should not.

    Raises
    ------
    FRFError
        If lines or labels differ.
    """
    if measured.outputs != computed.outputs or measured.inputs != computed.inputs:
        msg = (
            f"the measured FRFs are {', '.join(measured.outputs)} / {', '.join(measured.inputs)}, "
            f"the computed ones {', '.join(computed.outputs)} / {', '.join(computed.inputs)}"
        )
        raise FRFError(msg)
    if measured.n_freq != computed.n_freq or not np.allclose(
        measured.frequency, computed.frequency, rtol=1e-6
    ):
        msg = (
            f"the measured FRFs have {measured.n_freq} lines, the computed ones {computed.n_freq}, "
            "not at the same frequencies"
        )
        raise FRFError(msg)
    H = computed.as_kind(measured.kind).H
    ratio = log_ratio(H, measured.H)
    if mask is not None:
        ratio = np.where(mask, ratio, _NAN)
    f = measured.frequency
    edges = np.linspace(f[0], f[-1], bands + 1) if isinstance(bands, int) else np.asarray(bands, dtype=float)
    which = np.minimum(np.searchsorted(edges, f, side="right") - 1, len(edges) - 2)
    which[f > edges[-1]] = -1  # in no band, as those below the first edge
    shape = (len(edges) - 1, *ratio.shape[1:])
    error, phase = np.full(shape, np.nan), np.full(shape, np.nan)
    for b in range(len(edges) - 1):
        part: NDArray[np.complex128] = np.asarray(ratio[which == b])
        seen = np.isfinite(part).any(axis=0) if part.size else np.zeros(shape[1:], dtype=bool)
        if seen.any():
            error[b][seen] = np.sqrt(np.nanmean(part.real[:, seen] ** 2, axis=0)) * DB_PER_NEPER
            phase[b][seen] = np.rad2deg(np.sqrt(np.nanmean(part.imag[:, seen] ** 2, axis=0)))
    return Comparison(f, ratio, edges, error, phase, frac(measured.H, H), measured.outputs, measured.inputs)
