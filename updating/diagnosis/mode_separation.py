"""Which further modes and sensors would tell explanations of measured modes apart."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem.analysis.modes import first_modes
from fem.lengths import coordinates_text
from fem.model import Model
from fem.system import assemble
from updating.correlation import pair_modes
from updating.diagnosis.separation import BAND_BEYOND

FURTHER = 5
"""Number of modes beyond the measured ones that are compared."""
FREQUENCY_STD, SHAPE_STD = 1e-3, 0.03
"""Deviations of what would be measured: of a frequency, and of a component of a shape in parts of its largest
value [-]."""


def next_measurements(base: Model, models: Sequence[Model], n: int, top: float) -> tuple[str, ...]:
    """Return the frequencies and shapes that differ most between two models.

    Each in standard deviations of a usual test; those of less than two are left out, and modes beyond
    ``BAND_BEYOND`` times the measured band, which the same test would not reach.

    Parameters
    ----------
    base : Model
        With the mesh of both.
    models : sequence of Model
        Nothing is said unless there are two.
    n : int
        Number of modes that were measured.
    top : float
        The highest of their frequencies [Hz].
    """
    if len(models) != 2:
        return ()
    try:
        one, two = (first_modes(assemble(m, reciprocal=False), n + FURTHER) for m in models)
        rigid = one.n_rigid
        alike = pair_modes(
            one.frequency[rigid:],
            one.shapes[:, rigid:],
            two.frequency,
            two.shapes,
            frequency_spread=None,
            n_rigid=two.n_rigid,
        )
    except (np.linalg.LinAlgError, ValueError):  # no structure
        return ()
    proposals: list[tuple[float, str]] = []
    for i, j in sorted((rigid + i, j) for i, j in alike.pairs):
        f, g = one.frequency[i], two.frequency[j]
        if f > BAND_BEYOND * top:
            continue
        new = f > 1.02 * top
        size = abs(np.log(f / g)) / FREQUENCY_STD
        if new:
            proposals.append((size, f"the natural frequency near {f:.4g} Hz ({f:.5g} or {g:.5g} Hz)"))
        proposals.append(_shape(base, np.real(one.shapes[:, i]), np.real(two.shapes[:, j]), f))
    proposals = sorted((t for t in proposals if t[0] >= 2.0), key=lambda t: -t[0])
    # Largest number of proposals
    return tuple(text for _, text in proposals[:3])


def _shape(
    model: Model, phi: NDArray[np.floating], psi: NDArray[np.floating], frequency: float
) -> tuple[float, str]:
    """Return where two shapes of a mode differ most among displacements, in deviations, and in words."""
    moves = np.arange(len(phi)) % 6 < 3
    a, b = phi * moves, psi * moves
    b = b * ((a @ b) / (b @ b))
    largest = float(np.abs(a).max())
    k = int(np.argmax(np.abs(a - b)))
    place = coordinates_text(model.mesh.points[k // 6])
    size = float(np.abs(a - b)[k]) / largest / SHAPE_STD
    return size, (
        f"the shape at {frequency:.4g} Hz, along {'xyz'[k % 6]} at {place}, where it "
        f"differs by {100 * size * SHAPE_STD:.0f} % of its largest value"
    )
