"""Natural modes of the nominal and the fitted model side by side."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from fem.analysis.modes import Modes, solve_eigenpairs
from fem.array_types import Floats, Ints
from fem.model import Model
from fem.system import assemble, connection_stiffness
from updating.correlation import mac
from updating.diagnosis.diagnosis import Diagnosis
from updating.inference.parameters import DampingCurve
from updating.measurement.measurement import with_resting_base

SAME_SHAPE = 0.5
"""Least MAC of two modes that count as the same one."""


@dataclass(frozen=True, slots=True)
class FittedModePair:
    """A natural mode of the fitted model and the same one of the nominal model.

    Attributes
    ----------
    index, nominal_index : int
        Numbers among all modes, from 0; -1 where there is none of such a shape.
    nominal, fitted : float
        Natural frequencies [Hz]; NaN where there is none.
    nominal_zeta, fitted_zeta : float
        Damping ratios [-].
    mac : float
        How alike the shapes are, 0 to 1.
    """

    index: int
    nominal_index: int
    nominal: float
    fitted: float
    nominal_zeta: float
    fitted_zeta: float
    mac: float


def damped_modes(model: Model, curve: DampingCurve, unknowns: Floats, up_to: float) -> Modes:
    """Compute modes up to a frequency with the damping that a fit uses, a curve and local dampers.

    ζ = ζ_m + s (ζ_c - ζ_m) + φᵀ D φ / (2 ω²) + φᵀ C φ / (2 ω), with the curve's ratios of members and of
    connections, the share s of a mode's strain energy that is in connections, and the energy that local
    dampers take from undamped modes.
    """
    system = assemble(model, reciprocal=False)  # C that does no work takes no energy either
    pairs = solve_eigenpairs(system, max_frequency=up_to, unstable=True)
    V, omega = pairs.vectors, pairs.omega
    elastic = omega > 0
    w = np.where(elastic, omega, 1.0)
    local = np.einsum("ij,ij->j", V, system.D @ V) / (2 * w**2) + np.einsum("ij,ij->j", V, system.C @ V) / (
        2 * w
    )
    d = model.damping
    overall = d.loss_factor / 2 + d.alpha / (2 * w) + d.beta * w / 2
    ratio, *others = np.atleast_2d(curve.ratio(w / (2 * np.pi), unknowns))
    for other in others:
        share = np.einsum("ij,ij->j", V, connection_stiffness(system) @ V) / w**2
        ratio = ratio + share * (other - ratio)
    zeta = np.where(elastic, ratio + local + overall, 0.0)
    return Modes(omega / (2 * np.pi), system.Q @ V, zeta, n_rigid=pairs.n_rigid)


def modes_of(d: Diagnosis) -> tuple[Modes, Modes, Modes]:
    """Return modes up to the band's end: nominal, fitted without what was found, and with it.

    Motions below the band in which the nominal structure moves freely, as a body, count as rigid: small
    stiffnesses of exciters are fitted and hold it.
    """
    curve, (bottom, top) = d.problem.damping, d.problem.data.frequency[[0, -1]].tolist()
    with_all = d.model
    without = with_all.without_effect(*(f.effect.name for f in d.findings)) if d.findings else with_all
    zeta = d.steps[-1].result.zeta
    fitted = damped_modes(with_all, curve, zeta, top)
    before = fitted if without is with_all else damped_modes(without, curve, zeta, 1.1 * top)
    nominal = damped_modes(with_resting_base(d.problem.reduced.model), curve, curve.start, 1.1 * top)
    return nominal, _as_free(before, nominal.n_rigid, bottom), _as_free(fitted, nominal.n_rigid, bottom)


def _as_free(modes: Modes, n_rigid: int, bottom: float) -> Modes:
    """Return modes of which as many are rigid as another model has, those below a frequency [Hz]."""
    held = int(np.sum(modes.frequency[modes.n_rigid : n_rigid] < bottom))
    return replace(modes, n_rigid=modes.n_rigid + held)


def pair_modes(nominal: Modes, fitted: Modes, n_points: int) -> tuple[FittedModePair, ...]:
    """Pair the elastic modes of two models of one mesh by their shapes at its points; the second's count."""
    a, b = (np.arange(m.n_rigid, m.n_modes) for m in (nominal, fitted))
    alike = (
        mac(_translations(nominal, a, n_points), _translations(fitted, b, n_points))
        if a.size and b.size
        else np.zeros((a.size, b.size))
    )
    rows, columns = scipy.optimize.linear_sum_assignment(-alike)
    partner = {int(j): int(i) for i, j in zip(rows, columns, strict=True) if alike[i, j] >= SAME_SHAPE}
    out = []
    for j, k in enumerate(b):
        same = _pair(int(k), fitted)
        if j in partner:
            i = int(a[partner[j]])
            same = replace(
                same,
                nominal_index=i,
                nominal=float(nominal.frequency[i]),
                nominal_zeta=_zeta(nominal, i),
                mac=float(alike[partner[j], j]),
            )
        out.append(same)
    return tuple(out)


def most_changed(pairs: tuple[FittedModePair, ...]) -> FittedModePair | None:
    """Return the mode whose pole moved farthest for its frequency, |Δω|/ω and Δζ together."""
    known = [p for p in pairs if p.nominal_index >= 0]
    return max(known, key=_change, default=None)


def _change(pair: FittedModePair) -> float:
    if pair.nominal * pair.fitted <= 0:  # one that grows has no frequency to compare
        return 0.0
    return float(
        np.hypot(np.log(pair.fitted / pair.nominal), pair.fitted_zeta - pair.nominal_zeta)
    ) + 0.05 * (1 - pair.mac)


def _pair(k: int, fitted: Modes) -> FittedModePair:
    return FittedModePair(k, -1, np.nan, float(fitted.frequency[k]), np.nan, _zeta(fitted, k), np.nan)


def _zeta(modes: Modes, k: int) -> float:
    return np.nan if modes.zeta is None else float(modes.zeta[k])


def _translations(modes: Modes, which: Ints, n_points: int) -> Floats:
    # internal coordinates of parts follow those of the points
    shapes = np.asarray(np.real(modes.shapes[: 6 * n_points, which]), dtype=np.float64)
    return shapes.reshape(-1, 6, len(which))[:, :3].reshape(-1, len(which))
