"""Exact natural frequencies and shapes of a true frame, from its dynamic stiffness."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from benchmarks.validation.frames import Draft
from benchmarks.validation.spectral import Assembly, Law, Segment, SpectralFrame
from benchmarks.validation.truth import Cut, Member, Reading, TrueFrame, rectangle_constants

Floats = NDArray[np.float64]
CLAMPED = 22.37
"""(βL)² of the first bending mode of a piece clamped at both ends [-]."""
HIGHEST = 1.5
"""Pieces are so short that they have no mode of their own up to this multiple of the highest frequency."""
POINTS = 12
"""Frequencies at which the stiffness is linearised to begin with."""
STEP = 1e-4
"""Relative step in ω² of its derivative [-]."""
MASSLESS = 1e-11
"""Less than this part of the largest mass, all scaled to one stiffness, is rounding of the derivative [-]."""
CONVERGED = 1e-9
"""Relative change of ω² at which an iteration ends [-]."""


class ModesError(ValueError):
    """Modes of which one was missed."""


def true_modes(
    frame: TrueFrame, sensors: Sequence[Reading], low: float, high: float
) -> tuple[Floats, Floats]:
    """Return the undamped natural frequencies between two [Hz], and their shapes at sensors (n_out, n).

    Zeros of Z(ω) by inverse iteration from linearisations at several frequencies. Pieces are short enough to
    have no clamped mode below, so that the number of negative eigenvalues of Z is that of the natural
    frequencies below (Wittrick and Williams, *Q. J. Mech. Appl. Math.* 24, 1971, 263): none is missed.

    Raises
    ------
    ModesError
        If iterations have found other modes than there are.
    """
    cuts = [
        Cut(name, float(m.length * k / n))
        for name, m in frame.members.items()
        for n in (_n_pieces(m, HIGHEST * high),)
        for k in range(1, n)
    ]
    pieces, probes = frame.pieces(cuts, sensors)
    assembly = Assembly.of(_undamped(pieces), probes)

    def Z(square: float) -> Floats:
        out = assembly.stiffness(np.array([np.sqrt(square)]))[0].real
        return (out + out.T) / 2

    bottom, top = (2 * np.pi * low) ** 2, (2 * np.pi * high) ** 2
    n_below, n_above = ((np.linalg.eigvalsh(Z(s)) < 0).sum() for s in (bottom, top))
    found: list[tuple[float, Floats]] = []
    edges = np.geomspace(bottom, top, POINTS + 1)
    for a, b in pairwise(edges):
        at = float(np.sqrt(a * b))
        D = (Z(at * (1 + STEP)) - Z(at * (1 - STEP))) / (2 * STEP * at)
        lam, V = _linear_modes(Z(at) - at * D, -D)
        for k in np.flatnonzero((lam > a / 1.3) & (lam < 1.3 * b)):
            square, q = _refined(Z, float(lam[k]), V[:, k])
            if bottom < square < top and not _known(square, q, found):
                found.append((square, q))
    found.sort(key=lambda x: x[0])
    if len(found) != n_above - n_below:
        msg = f"{len(found)} of {n_above - n_below} modes from {low:g} to {high:g} Hz were found"
        raise ModesError(msg)
    shapes = np.zeros((len(sensors), len(found)))
    for k, (square, q) in enumerate(found):
        omega = np.array([np.sqrt(square)])
        shapes[:, k] = [float((assembly.row(p, omega)[0, 0] @ q).real) for p in probes]
    return np.sqrt([s for s, _ in found]) / (2 * np.pi), shapes


def seen_modes(frame: TrueFrame, draft: Draft) -> tuple[Floats, Floats]:
    """Return the modes in the band of a test, but for those all along directions that no sensor has."""
    f, phi = true_modes(frame, draft.sensors, float(draft.frequency[0]), float(draft.frequency[-1]))
    size = np.sqrt((phi**2).mean(axis=0))
    seen = size > 1e-3 * size.max()
    return f[seen], phi[:, seen]


def _linear_modes(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues and vectors of K - λM, where M of directions without mass is rounding."""
    scale = 1 / np.sqrt(np.abs(K.diagonal()))
    mass, U = np.linalg.eigh(scale[:, None] * M * scale)
    lam, V = sla.eigh(scale[:, None] * K * scale, (U * np.maximum(mass, MASSLESS * mass[-1])) @ U.T)
    return lam, scale[:, None] * V


def _refined(Z, square: float, q: Floats) -> tuple[float, Floats]:
    """Return a zero of Z near a start: Newton's steps in ω² with q by inverse iteration."""
    for _ in range(12):
        D = (Z(square * (1 + STEP)) - Z(square * (1 - STEP))) / (2 * STEP * square)
        now = Z(square)
        step = float((q @ now @ q) / (q @ D @ q))
        square = max(square - step, 1e-6 * square)
        if abs(step) < CONVERGED * square:
            break
        try:
            q = np.linalg.solve(Z(square * (1 + 1e-12)), D @ q)
        except np.linalg.LinAlgError:  # singular to the last digit there, as it is at a zero
            q = np.linalg.solve(Z(square * (1 + 1e-9)), D @ q)
        q = q / np.linalg.norm(q)
    return square, q


def _known(square: float, q: Floats, found: Sequence[tuple[float, Floats]]) -> bool:
    """Whether a mode is one of those found, or of equal frequency and a combination of them."""
    alike = [p for other, p in found if abs(square / other - 1) < 1e-6]
    if not alike:
        return False
    Q, _ = np.linalg.qr(np.stack(alike, axis=1))
    return float(np.linalg.norm(Q.T @ q) / np.linalg.norm(q)) > 0.9


def _n_pieces(m: Member, highest: float) -> int:
    """Return into how many pieces a member is cut."""
    A, Iy, Iz, _ = rectangle_constants(m.b, m.h)
    mass = m.rho * A + max(m.fluid) + sum(s.mass for s in m.stretches)
    E = m.E * min([1.0, *(s.E for s in m.stretches)])
    bending = CLAMPED * np.sqrt(E * min(Iy, Iz) / mass) / (2 * np.pi * highest)
    return max(2, int(np.ceil(m.length / np.sqrt(bending))))


def _undamped(frame: SpectralFrame) -> SpectralFrame:
    """Return a frame whose stiffnesses are real and that has no dampers."""
    segments = tuple(_real(s) for s in frame.segments)
    connections = tuple(
        replace(c, K=np.real(c.K), C=0 * np.real(c.C), law=_storage(c.law)) for c in frame.connections
    )
    bodies = tuple(replace(b, K=np.real(b.K), C=0 * np.real(b.C), law=_storage(b.law)) for b in frame.bodies)
    return replace(frame, segments=segments, connections=connections, bodies=bodies)


def _real(s: Segment) -> Segment:
    stiff = {k: complex(np.real(getattr(s, k))) for k in ("EA", "GJ", "EIy", "EIz", "kGAy", "kGAz")}
    return replace(s, **stiff, alpha=0.0, beta=0.0)


def _storage(law: Law | None) -> Law | None:
    return None if law is None else lambda omega: np.real(law(omega))
