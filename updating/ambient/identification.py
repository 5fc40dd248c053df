"""Modes from responses to unknown forces, with their uncertainty and without a choice by hand.

record ─ prepare_record → AmbientRecord ─ block_correlations → Correlations ─ decompose → Subspaces
       ─ fit_orders → SubspacePoles ─ clusters_of → Cluster, … → AmbientModes
                      AmbientRecord ─ singular_spectra → SingularSpectra, which checks them
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats
from fem.linalg.solvers import one_thread
from updating.ambient.ambient_modes import AmbientModes
from updating.ambient.clusters import Cluster, clusters_of
from updating.ambient.record import AmbientRecord, prepare_record
from updating.ambient.spectra import Peak, SingularSpectra, peaks_of, singular_spectra, spectra_mac
from updating.ambient.subspace import SubspacePoles, block_correlations, decompose, fit_orders
from updating.correlation.complexity import mean_phase_deviation, modal_phase_collinearity


@one_thread()
def identify_ambient(
    values: ArrayLike,
    sample_rate: float,
    channels: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
) -> AmbientModes:
    """Identify natural frequencies, damping ratios and shapes from responses to unknown random forces.

    Covariance-driven stochastic subspaces give poles of several orders from the one on that the record
    supports. Poles that are known better than their half-power half-width and persist over orders are modes;
    each is the mean of its poles, weighted by the inverse of their variances. Standard deviations come from
    the scatter of the correlations between blocks of the record. Nothing is random: the same record gives the
    same modes.

    The forces are taken to be white near each mode, and stationary. Machines with a steady speed appear as
    peaks of the spectra that no mode explains.

    Parameters
    ----------
    values : array_like (n_samples, n_channels)
        Responses of one kind in one unit, such as accelerations, sampled together.
    sample_rate : float
        [Hz].
    channels : sequence of str, optional
        Their names.
    band : (float, float), optional
        Lowest and highest frequency of modes; 1 to 40 % of the sample rate unless given [Hz].

    Raises
    ------
    AmbientError
        For a record that is too short, has too few channels or a constant one, or a sample rate that is too
        low for the band.
    """
    record = prepare_record(values, sample_rate, channels, band)
    every = list(range(len(record.channels)))
    correlations = block_correlations(record.y, 2 * record.n_rows, record.n_blocks, every)
    subspaces = decompose(correlations, record.n_rows)
    poles = fit_orders(subspaces, record.sample_rate)
    spectra = singular_spectra(record)
    return _result(record, poles, subspaces.order, spectra, clusters_of(poles, subspaces.order))


def _result(
    record: AmbientRecord,
    poles: SubspacePoles,
    order: int,
    spectra: SingularSpectra,
    clusters: Sequence[Cluster],
) -> AmbientModes:
    n_blocks = record.n_blocks
    lam = np.array([(c.weight * poles.poles[c.members]).sum() for c in clusters], dtype=complex)
    low, high = (2 * np.pi * f for f in record.band)
    kept = [k for k, pole in enumerate(lam.tolist()) if low <= abs(pole) <= high]
    clusters, lam = [clusters[k] for k in kept], lam[kept]
    moved = np.zeros((len(kept), n_blocks), dtype=complex)
    for k, c in enumerate(clusters):
        moved[k] = (c.weight[:, None] * poles.pole_deviation[c.members]).sum(axis=0)
    frequency, zeta, covariance = _values(lam, moved)
    std = np.sqrt(covariance.diagonal()).reshape(-1, 2)
    unit, of_unit = _shapes(poles, clusters, len(record.channels), n_blocks)
    spread = np.sqrt((of_unit**2).sum(axis=1) / (n_blocks * (n_blocks - 1))).T * record.scale[:, None]
    # back to the channels' units, with a largest entry of 1
    shapes = unit.T * record.scale[:, None]
    largest = np.ones(len(kept))
    for k in range(len(kept)):
        largest[k] = shapes[np.argmax(np.abs(shapes[:, k].real)), k].real
    peaks = tuple(p for p in peaks_of(spectra, record.band) if not _explained(p, frequency, zeta, spectra))
    return AmbientModes(
        Modes(frequency, np.real(shapes) / largest, zeta, record.channels),
        lam,
        shapes / largest,
        std[:, 0],
        std[:, 1],
        spread / np.abs(largest),
        covariance,
        modal_phase_collinearity(shapes),
        mean_phase_deviation(shapes),
        spectra_mac(spectra, frequency, unit),
        order,
        poles,
        tuple(c.members for c in clusters),
        spectra,
        peaks,
        record.duration,
        record.band,
    )


def _values(lam: Complexes, moved: Complexes) -> tuple[Floats, Floats, Floats]:
    """Return frequencies [Hz], damping ratios and the covariance of both, mode by mode, from deviations.

    |λ| changes by Re(λ* Δλ)/|λ|, and ζ = -Re λ/|λ| accordingly.
    """
    size, n_blocks = np.abs(lam), moved.shape[1]
    zeta = -np.real(lam) / size
    of_size = np.real(lam.conj()[:, None] * moved) / size[:, None]
    of_zeta = -(np.real(moved) + zeta[:, None] * of_size) / size[:, None]
    both = np.stack([of_size / (2 * np.pi), of_zeta], axis=1).reshape(-1, n_blocks)
    return size / (2 * np.pi), zeta, both @ both.T / (n_blocks * (n_blocks - 1))


def _shapes(
    poles: SubspacePoles, clusters: Sequence[Cluster], n_channels: int, n_blocks: int
) -> tuple[Complexes, Floats]:
    """Return the weighted mean shape of each mode (n, n_channels), and its deviations by block."""
    shapes, deviations = [], []
    for c in clusters:
        members = poles.shapes[c.members]
        sign = np.where((members @ members[np.argmax(c.weight)].conj()).real < 0, -1.0, 1.0) * c.weight
        shapes.append(sign @ members)
        deviations.append(np.tensordot(sign, poles.shape_deviation[c.members], 1))
    return (
        np.array(shapes, dtype=complex).reshape(-1, n_channels),
        np.array(deviations).reshape(-1, n_blocks, n_channels),
    )


def _explained(peak: Peak, frequency: Floats, zeta: Floats, spectra: SingularSpectra) -> bool:
    """Whether a mode is within its half-power width of a peak, or two lines of it."""
    reach = np.maximum(2 * zeta * frequency, 2 * spectra.step)
    return bool((np.abs(frequency - peak.frequency) <= reach).any())
