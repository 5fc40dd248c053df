"""How alike FRFs are: FRAC, SAC, FDAC, CSAC, CSF, CMIF, and errors by band, sensor and force.

Along frequency one number for each FRF (`frac`, `signature_assurance`), along the sensors one number for each
line (`cross_signature_assurance`, `cross_signature_scale`) or pair of lines (`fdac`).
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFError
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import counted, fields_summary, span, summary
from updating.correlation.shape_correlation import refuse_gaps

DB_PER_NEPER = 20 / np.log(10)

_AXES = ("line", "output", "input")

_NAN = complex(np.nan, np.nan)
"""No number in both parts; complex("nan") has the imaginary part 0, which would count as a phase."""


def frac(H_x: ArrayLike, H_a: ArrayLike) -> Floats:
    """Compute the frequency response assurance criterion of each FRF over the lines.

    |Σ H_x H_a*|² / (Σ|H_x|² Σ|H_a|²); Heylen and Lammens, Identification in Engineering Systems, Swansea,
    1996. Blind to a constant complex factor. High peaks decide, and a small shift of frequency weighs as much
    as a wrong shape: two resonances of damping ratio ζ whose frequencies ω differ by δ have 1 / (1 + (δ /
    2ζω)²), a half at one half-power bandwidth.

    Parameters
    ----------
    H_x, H_a : array_like (n_freq, n_out, n_in)
        On the same lines, of the same kind; (n_freq,) for a single FRF.

    Returns
    -------
    ndarray (n_out, n_in)
        0 to 1; 0 for an FRF that is zero.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _same_shape(H_x, H_a)
    return _alike((x * a.conj()).sum(axis=0), _square(x).sum(axis=0), _square(a).sum(axis=0))


def signature_assurance(H_x: ArrayLike, H_a: ArrayLike) -> Floats:
    """Compute the signature assurance criterion SAC: FRAC of the amplitudes alone.

    (Σ |H_x||H_a|)² / (Σ|H_x|² Σ|H_a|²), as in Dascotte and Strobbe, IMAC XVII, 1999. Blind to phases, hence
    to the sign of a sensor and to delays, and to a constant factor. Amplitudes are positive, so that even
    unrelated FRFs have values well above 0, and SAC is never below FRAC.

    Parameters
    ----------
    H_x, H_a : array_like (n_freq, n_out, n_in)
        On the same lines, of the same kind.

    Returns
    -------
    ndarray (n_out, n_in)
        0 to 1.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _same_shape(H_x, H_a)
    return frac(np.abs(x), np.abs(a))


def cross_signature_assurance(H_x: ArrayLike, H_a: ArrayLike) -> Floats:
    """Compute the cross signature assurance criterion CSAC: the MAC of the operating shapes at each line.

    |h_xᴴ h_a|² / (h_xᴴh_x h_aᴴh_a), with h the responses to one force at one line: Dascotte and Strobbe, IMAC
    XVII, 1999; the global shape correlation of Grafe, thesis, Imperial College London, 1998. Blind
    to a factor common to all sensors at a line; the sensors with the largest motion decide. One sensor says
    nothing: its CSAC is 1.

    Parameters
    ----------
    H_x, H_a : array_like (n_freq, n_out, n_in)
        On the same lines, of the same kind.

    Returns
    -------
    ndarray (n_freq, n_in)
        0 to 1.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _columns(*_same_shape(H_x, H_a))
    return _alike((x.conj() * a).sum(axis=1), _square(x).sum(axis=1), _square(a).sum(axis=1))


def cross_signature_scale(H_x: ArrayLike, H_a: ArrayLike) -> Floats:
    """Compute the cross signature scale factor CSF: how alike operating shapes are in size and shape.

    2 |h_xᴴ h_a| / (h_xᴴh_x + h_aᴴh_a); sources as for :func:`cross_signature_assurance`, Grafe's global
    amplitude correlation. 1 only for equal amplitudes too: a factor c in place of 1 gives 2|c| / (1 + |c|²),
    the same for c and 1/c. It is at most the root of CSAC. Between resonances and antiresonances that are
    shifted it is low though the model may be good; a common phase goes unseen.

    Parameters
    ----------
    H_x, H_a : array_like (n_freq, n_out, n_in)
        On the same lines, of the same kind.

    Returns
    -------
    ndarray (n_freq, n_in)
        0 to 1.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _columns(*_same_shape(H_x, H_a))
    cross = 2 * np.abs((x.conj() * a).sum(axis=1))
    total = _square(x).sum(axis=1) + _square(a).sum(axis=1)
    return np.minimum(np.divide(cross, total, out=np.zeros(cross.shape), where=total > 0), 1.0)


def fdac(H_x: ArrayLike, H_a: ArrayLike) -> Floats:
    """Compute the frequency domain assurance criterion: operating shapes of any line against any other.

    |h_x(ω_x)ᴴ h_a(ω_a)|² / (h_xᴴh_x h_aᴴh_a) for the responses to each force: Pascual, Golinval and Razeto,
    IMAC XV, 1997, 587-592, with the square of MAC. A ridge off the diagonal is a shift of frequency; its
    slope f_a / f_x says by how much the model is too stiff. FRFs need not be on the same lines. The caveats
    of MAC hold: few sensors make different shapes look alike. On the diagonal it is CSAC.

    Parameters
    ----------
    H_x : array_like (n_freq_x, n_out, n_in)
    H_a : array_like (n_freq_a, n_out, n_in)
        Of the same kind.

    Returns
    -------
    ndarray (n_freq_x, n_freq_a, n_in)
        0 to 1.

    Raises
    ------
    ValueError
        If the numbers of outputs or inputs differ.
    """
    x, a = _columns(np.asarray(H_x), np.asarray(H_a))
    refuse_gaps(_AXES, H_x=x, H_a=a)
    if x.shape[1:] != a.shape[1:]:
        msg = f"the FRFs have shapes {x.shape} and {a.shape}; FDAC needs the same outputs and inputs in both"
        raise ValueError(msg)
    cross = np.stack([x[:, :, j].conj() @ a[:, :, j].T for j in range(x.shape[2])], axis=-1)
    return _alike(cross, _square(x).sum(axis=1)[:, None], _square(a).sum(axis=1)[None])


def cmif(H: ArrayLike) -> Floats:
    """Compute the complex mode indication function: the singular values of H at each line.

    Shih, Tsuei, Allemang and Brown, *Mech. Syst. Signal Process.* 2, 1988, 367, whose function is their
    square. The first peaks at every natural frequency; at one line, as many are large as there are modes
    close to each other. Outputs should have the same unit.

    Parameters
    ----------
    H : array_like (n_freq, n_out, n_in)

    Returns
    -------
    ndarray (n_freq, min(n_out, n_in))
        Falling [unit of H]; NaN at lines with a value that is not finite.
    """
    values = np.asarray(H, dtype=complex)
    known = np.asarray(np.isfinite(values).all(axis=(1, 2)))
    found = np.linalg.svd(np.where(known[:, None, None], values, 0.0), compute_uv=False)
    return np.where(known[:, None], found, np.nan)


def _same_shape(H_x: ArrayLike, H_a: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    x, a = np.asarray(H_x), np.asarray(H_a)
    if x.shape != a.shape or x.ndim == 0:
        msg = f"the FRFs have shapes {x.shape} and {a.shape}; they must be the same, (n_freq, n_out, n_in)"
        raise ValueError(msg)
    refuse_gaps(_AXES, H_x=x, H_a=a)
    return x, a


def _columns(*data: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return FRFs with three axes; (n_freq, n_out) is the response to one force."""
    for H in data:
        if H.ndim not in (2, 3):
            msg = (
                f"an FRF has shape {H.shape}; (n_freq, n_out, n_in) is expected, or (n_freq, n_out) for one "
                "force: one response alone has no shape"
            )
            raise ValueError(msg)
    return tuple(H[..., None] if H.ndim == 2 else H for H in data)


def _square(H: NDArray[Any]) -> Floats:
    return np.real(H) ** 2 + np.imag(H) ** 2


def _alike(cross: NDArray[Any], square_x: Floats, square_a: Floats) -> Floats:
    """Return |cross|² / (square_x square_a), at most 1; 0 where nothing moves. Safe for small numbers."""
    size = np.sqrt(square_x) * np.sqrt(square_a)
    cosine = np.divide(np.abs(cross), size, out=np.zeros(np.shape(cross)), where=size > 0)
    return np.minimum(cosine, 1.0) ** 2


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

    frequency: Floats
    log_ratio: Complexes
    bands: Floats
    error_db: Floats
    phase_deg: Floats
    frac: Floats
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the error, the lines and the channels on one line."""
        lines = f"{counted(len(self.frequency), 'line')}, {span(self.frequency, 'Hz')}"
        ends = f"{counted(len(self.outputs), 'sensor')} × {counted(len(self.inputs), 'excitation')}"
        by = self.by_sensor()
        worst = f", worst {self.outputs[int(np.nanargmax(by))]} {np.nanmax(by):.2f} dB" if by.any() else ""
        return summary(self, f"{self.total_db:.2f} dB on all lines{worst}; {ends}, {lines}")

    @property
    def total_db(self) -> float:
        """Root mean square of the amplitude's error over everything [dB]."""
        return rms_db(self.log_ratio)

    def transposed(self) -> "Comparison":
        """Return the same with forces in the place of responses, and the other way round."""
        arrays = {
            key: np.swapaxes(getattr(self, key), 1, 2) for key in ("log_ratio", "error_db", "phase_deg")
        }
        return replace(self, frac=self.frac.T, outputs=self.inputs, inputs=self.outputs, **arrays)

    @property
    def moving_forces(self) -> bool:
        """Whether the forces are at more places than the responses, as those of a roving hammer."""
        return len(self.inputs) > len(self.outputs)

    def by_sensor(self) -> Floats:
        """Return the error of each sensor, shape (n_out,) [dB]."""
        return np.array([rms_db(self.log_ratio[:, i]) for i in range(len(self.outputs))])

    def by_band(self) -> Floats:
        """Return the error of each sensor in each band, shape (n_out, n_bands) [dB]."""
        square = self.error_db**2
        seen = np.isfinite(square)
        n = seen.sum(axis=2)
        mean = np.divide(
            np.where(seen, square, 0.0).sum(axis=2), n, out=np.full(n.shape, np.nan), where=n > 0
        )
        return np.sqrt(mean).T


def rms_db(log_ratio: Complexes) -> float:
    """Return the root mean square of the real part in dB, without NaN; NaN if no value remains."""
    x = log_ratio.real[np.isfinite(log_ratio.real)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")


def complex_log(z: Complexes) -> Complexes:
    """Return ln|z| + i arg z; as np.log, in a quarter of its time.

    NumPy's own is also exact to the last digit of a logarithm near 0, which misfits do not need.
    """
    out = np.empty(np.shape(z), dtype=np.complex128)
    np.log(np.abs(z), out=out.real)
    np.arctan2(z.imag, z.real, out=out.imag)
    return out


def log_ratio(computed: Complexes, measured: Complexes) -> Complexes:
    """Return ln(computed / measured) with the phase between -π and π; NaN where one of them is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = complex_log(computed / measured)
    return np.where(np.isfinite(ratio), ratio, _NAN)


def compare(
    measured: FRF, computed: FRF, bands: ArrayLike | int = 6, mask: Bools | None = None
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
    edges, which = _bands(f, bands)
    shape = (len(edges) - 1, *ratio.shape[1:])
    error, phase = np.full(shape, np.nan), np.full(shape, np.nan)
    for b in range(len(edges) - 1):
        part: Complexes = np.asarray(ratio[which == b])
        seen = np.isfinite(part).any(axis=0) if part.size else np.zeros(shape[1:], dtype=bool)
        if seen.any():
            error[b][seen] = np.sqrt(np.nanmean(part.real[:, seen] ** 2, axis=0)) * DB_PER_NEPER
            phase[b][seen] = np.rad2deg(np.sqrt(np.nanmean(part.imag[:, seen] ** 2, axis=0)))
    return Comparison(f, ratio, edges, error, phase, frac(measured.H, H), measured.outputs, measured.inputs)


def exchanged_labels(
    measured: FRF, computed: FRF, mask: Bools | None = None
) -> dict[tuple[str, str, str], str]:
    """Return pairs of responses or of forces that look exchanged by a model, with a sentence on each.

    Keys are ``"responses"`` or ``"forces"`` and two names.

    Two are enough, unlike for :func:`updating.quality.faults.find_faults`. Arguments are those of
    :func:`compare`.
    """
    H = computed.as_kind(measured.kind).H
    seen = np.ones(H.shape, dtype=bool) if mask is None else np.broadcast_to(mask, H.shape)
    sizes = [np.where(seen, log_ratio(X, np.ones_like(X)).real, np.nan) for X in (H, measured.H)]
    out: dict[tuple[str, str, str], str] = {}
    for axis, word, names in ((1, "responses", measured.outputs), (2, "forces", measured.inputs)):
        computed_size, size = (np.moveaxis(x, axis, 0) for x in sizes)
        for j in range(len(names)):
            for i in range(j):
                before, after = (
                    _rms_db(computed_size[[i, j]] - size[order], computed_size[[j, i]] - size[order])
                    for order in ([i, j], [j, i])
                )
                # Two channels look exchanged if that leaves less than this part of their error [-]
                if after < 0.5 * before:
                    out[word, names[i], names[j]] = (
                        f"{word} '{names[i]}' and '{names[j]}' look exchanged: their error is "
                        f"{before:.2g} dB, and {after:.2g} dB with each label at the other's place"
                    )
    return out


def _rms_db(difference: Floats, other: Floats) -> float:
    """Return the root mean square of a difference where another is known, too [dB]; 0 where none is."""
    both = np.isfinite(difference).all(axis=0) & np.isfinite(other).all(axis=0)
    return DB_PER_NEPER * float(np.sqrt(np.square(difference[:, both]).mean())) if both.any() else 0.0


By = Literal["all", "band", "output", "input", "each"]
"""Groups for which an error is given: all, each band, sensor, force, or each of all these."""


@dataclass(frozen=True, slots=True, eq=False)
class BandError:
    """Energies of FRFs and of their difference by band, output and input; sums over the lines.

    Attributes
    ----------
    bands : ndarray (n_bands + 1,)
        Edges [Hz].
    n_lines : ndarray of int (n_bands,)
        Number of lines in each band.
    measured, computed : ndarray (n_bands, n_out, n_in)
        Σ|H_x|², Σ|H_a|² [square of the unit of H].
    difference : ndarray (n_bands, n_out, n_in)
        Σ|H_a - H_x|².
    log_square : ndarray (n_bands, n_out, n_in)
        Σ|ln(H_a/H_x)|², amplitude [neper] and phase [rad] together.
    n_log : ndarray of int (n_bands, n_out, n_in)
        Number of lines in it: those where neither FRF is zero.
    """

    bands: Floats
    n_lines: Ints
    measured: Floats
    computed: Floats
    difference: Floats
    log_square: Floats
    n_log: Ints

    __repr__ = fields_summary

    def relative(self, by: By = "all") -> Floats:
        """Return (Σ|H_a - H_x|² / Σ|H_x|²)^½ [-], 0 for equal FRFs; high peaks decide."""
        return np.sqrt(_ratio(_total(self.difference, by), _total(self.measured, by)))

    def level_db(self, by: By = "all") -> Floats:
        """Return 10 lg(Σ|H_a|² / Σ|H_x|²) [dB], positive where the model moves too much."""
        ratio = _ratio(_total(self.computed, by), _total(self.measured, by))
        return 10 * np.log10(ratio, out=np.full(ratio.shape, -np.inf), where=~(ratio <= 0))

    def log_error(self, by: By = "all") -> Floats:
        """Return the root mean square of |ln(H_a/H_x)| [neper, rad].

        Peaks and antiresonances count alike, and so does noise in antiresonances; the phase is that between
        -π and π.
        """
        return np.sqrt(_ratio(_total(self.log_square, by), _total(self.n_log, by)))


def band_error(frequency: ArrayLike, H_x: ArrayLike, H_a: ArrayLike, bands: ArrayLike | int = 6) -> BandError:
    """Sum energies and logarithmic errors of FRFs by band, output and input.

    Parameters
    ----------
    frequency : array_like (n_freq,)
        Lines, rising [Hz].
    H_x, H_a : array_like (n_freq, n_out, n_in)
        Measured and computed FRFs of the same kind.
    bands : array_like or int
        Edges of bands [Hz], or how many equal ones; a line on an edge belongs to the band above it, one on
        the last edge to the last band.

    Raises
    ------
    ValueError
        If the shapes differ or do not fit the lines.
    """
    f = np.asarray(frequency, dtype=float)
    x, a = _same_shape(H_x, H_a)
    x, a = _columns(*(H[:, None] if H.ndim == 1 else H for H in (x, a)))
    if f.shape != x.shape[:1]:
        msg = f"{f.size} frequencies are given for {x.shape[0]} lines of the FRFs"
        raise ValueError(msg)
    edges, which = _bands(f, bands)
    log = log_ratio(np.asarray(a, dtype=complex), np.asarray(x, dtype=complex))
    seen = np.isfinite(log)
    parts = (_square(x), _square(a), _square(a - x), np.where(seen, _square(log), 0.0))

    def sums(values: NDArray[Any]) -> NDArray[Any]:
        return np.stack([values[which == b].sum(axis=0) for b in range(edges.size - 1)])

    n_lines = np.array([(which == b).sum() for b in range(edges.size - 1)])
    return BandError(edges, n_lines, *(sums(p) for p in parts), n_log=sums(seen))


def _bands(f: Floats, bands: ArrayLike | int) -> tuple[Floats, Ints]:
    """Return edges, and the band of each line; -1 for those in none."""
    edges = np.linspace(f[0], f[-1], bands + 1) if isinstance(bands, int) else np.asarray(bands, dtype=float)
    which = np.minimum(np.searchsorted(edges, f, side="right") - 1, len(edges) - 2)
    which[f > edges[-1]] = -1
    return edges, which


def _total(values: NDArray[Any], by: By) -> NDArray[Any]:
    axes = {"all": (0, 1, 2), "band": (1, 2), "output": (0, 2), "input": (0, 1), "each": ()}
    if by not in axes:
        msg = f"errors by '{by}' are not known; allowed are {', '.join(axes)}"
        raise ValueError(msg)
    return np.asarray(values.sum(axis=axes[by]), dtype=float)


def _ratio(a: Floats, b: Floats) -> Floats:
    return np.divide(a, b, out=np.full(a.shape, np.nan), where=b > 0)
