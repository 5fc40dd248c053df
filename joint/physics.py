"""Laws of springs, masses and dampers in a joint's dynamic stiffness, and the model's effect for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from fem.array_types import Bools, Complexes, Floats
from fem.effects.joint import Joint
from fem.effects.viscoelastic import Viscoelastic
from fem.model import DIRECTIONS, Effect
from fem.summary import fields_summary
from joint._checks import as_frequency, as_lines
from joint.form import LAWS

LINEAR = ("K", "M", "C", "D")
"""Laws that are linear in their parameter: k, -ω² m, iω c, i d."""

UNEXPLAINED = 2.0
"""Misfit over the scatter of neighbouring lines beyond which no law explains a stiffness [-]."""


_WORDS = {
    "K": "a constant stiffness",
    "M": "a mass",
    "C": "viscous damping, rising with ω",
    "D": "structural damping, constant over ω",
    "zener": "a standard linear solid: a stiffness that rises over one decade or two",
    "fractional_kelvin_voigt": "a fractional Kelvin-Voigt element: stiffness and loss rise with a power of ω",
    "fractional_zener": "a fractional Zener element: a stiffness that rises over decades, as rubber's",
}


@dataclass(frozen=True, slots=True)
class LawFit:
    """One law fitted to a dynamic stiffness.

    Attributes
    ----------
    kinds : tuple of str
        ``"K"``, ``"M"``, ``"C"``, ``"D"`` together, or one viscoelastic law.
    values, std : mapping of str to float
        Parameters and standard deviations: by kind [N/m, kg, N s/m, N/m or rotational], or ``"stiffness"``
        and the law's own.
    misfit : float
        Root mean square of the residual over that of the stiffness [-].
    criterion : float
        Schwarz's criterion: the smaller the better.
    """

    kinds: tuple[str, ...]
    values: Mapping[str, float]
    std: Mapping[str, float]
    misfit: float
    criterion: float

    __repr__ = fields_summary

    @property
    def words(self) -> str:
        """Names of its parts, in a phrase."""
        return " and ".join(_WORDS[kind] for kind in self.kinds)

    def stiffness(self, frequency: npt.ArrayLike) -> Complexes:
        """Return its dynamic stiffness at lines [Hz], (n_freq,)."""
        omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float))
        if self.kinds[0] in LAWS:
            parameters = [self.values[f.name] for f in fields(LAWS[self.kinds[0]])]
            storage, loss = LAWS[self.kinds[0]](*parameters)(omega)
            return self.values["stiffness"] * (storage + 1j * loss)
        return np.asarray(sum(self.values[k] * _column(k, omega) for k in self.kinds), dtype=complex)


@dataclass(frozen=True, slots=True, eq=False)
class StiffnessLaw:
    """Law of one direction of a joint.

    Attributes
    ----------
    name : str
        Direction.
    frequency : (n,) array
        Lines that took part [Hz].
    Z : (n,) complex array
        Dynamic stiffness there [N/m or N m/rad].
    scatter : float
        Standard deviation of Z from line to line [N/m or N m/rad].
    best : LawFit
    others : tuple of LawFit
        The rest, by Schwarz's criterion.
    explained : bool
        Whether the best leaves no more than the lines scatter, times `UNEXPLAINED`.
    """

    name: str
    frequency: Floats
    Z: Complexes
    scatter: float
    best: LawFit
    others: tuple[LawFit, ...]
    explained: bool

    __repr__ = fields_summary

    @property
    def rivals(self) -> tuple[LawFit, ...]:
        """Other laws that are nearly as good."""
        # Difference of Schwarz's criterion from which one law counts as clearly better than another
        return tuple(f for f in self.others if f.criterion - self.best.criterion < 10.0)

    @property
    def sentence(self) -> str:
        """Sentence on the law found."""
        shown = ", ".join(
            f"{name} = {value:.4g} ± {self.best.std[name]:.1g}" for name, value in self.best.values.items()
        )
        text = f"{self.name}: {self.best.words} ({shown})"
        if not self.explained:
            text += f"; no law explains it: the best one leaves {self.best.misfit:.0%}"
        elif self.rivals:
            text += f"; cannot be distinguished from {self.rivals[0].words}"
        return text


def explain_stiffness(
    frequency: npt.ArrayLike,
    Z: npt.ArrayLike,
    names: Sequence[str] = DIRECTIONS,
    *,
    use: npt.ArrayLike | None = None,
    weight: npt.ArrayLike | None = None,
) -> tuple[StiffnessLaw, ...]:
    """Find the elements of each direction of a joint from its dynamic stiffness over frequency.

    Constant → stiffness, ω² → mass, iω → viscous, i → structural, rising → viscoelastic. Every combination of
    the first four with a stiffness or a mass, and every viscoelastic law, is fitted by robust least squares
    (Huber's weights); Schwarz's criterion n ln(misfit²) + k ln n chooses (Annals of Statistics 6, 1978).

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    Z : (n_freq, p, p) array_like
        Dynamic stiffness in relative coordinates, ``JointIdentification.z`` for example; NaN where unknown.
    names : sequence of str
        Names of the p directions.
    use : (n_freq,) array_like of bool, optional
        Lines to take, ``JointIdentification.regular`` for example.
    weight : (n_freq,) array_like, optional
        Weight of each line, 1 / ``amplification`` for example.

    Returns
    -------
    tuple of StiffnessLaw
        One for each diagonal entry of Z.

    Raises
    ------
    ValueError
        If shapes do not fit, or fewer than 8 lines are left.
    """
    lines = as_frequency(frequency)
    given = np.asarray(Z, dtype=complex)
    names = tuple(names)[: given.shape[1]] if given.ndim == 3 else tuple(names)
    seen = np.isfinite(given).all(axis=tuple(range(1, given.ndim)))
    array = as_lines(np.where(np.isfinite(given), given, 0), "Z", lines, names, names)
    keep: Bools = seen & (lines > 0)
    for word, values in (("use", use), ("weight", weight)):
        if values is not None and np.shape(values) != lines.shape:
            msg = (
                f"{word} has shape {np.shape(values)}; one value for each of the {lines.size} lines is needed"
            )
            raise ValueError(msg)
    if use is not None:
        keep &= np.asarray(use, dtype=bool)
    if keep.sum() < 8:
        msg = f"{int(keep.sum())} lines are left to explain a stiffness by; at least 8 are needed"
        raise ValueError(msg)
    w = np.ones(lines.size) if weight is None else np.asarray(weight, dtype=float)
    if not (np.isfinite(w[keep]).all() and (w[keep] > 0).all()):
        msg = "weight holds values that are not positive and finite at lines that are used"
        raise ValueError(msg)
    w = w[keep] / np.median(w[keep])
    return tuple(_explain(name, lines[keep], array[keep, i, i], w) for i, name in enumerate(names))


def effects_of(
    laws: Sequence[StiffnessLaw],
    name: str,
    point1: int,
    point2: int | None,
    location: npt.ArrayLike,
    **more: Any,
) -> tuple[Effect, ...]:
    """Return the effects that the findings suggest for a model.

    One `Joint` with the constant stiffnesses and dampings, and one `Viscoelastic` element for each direction
    that rises; a direction that no law explains gets its constant stiffness. Masses are not relative motions
    and are left out. Add them with ``model.with_effect(*effects)``.

    Parameters
    ----------
    laws : sequence of StiffnessLaw
        Named x y z rx ry rz.
    name : str
        Of the joint.
    point1, point2 : int, int or None
        Its sides in the model.
    location : (3,) array_like
        Where it acts [m].
    **more
        ``axes``, for example.
    """
    place = {"point1": point1, "point2": point2, "location": np.asarray(location, dtype=float), **more}
    matrices = {kind: np.zeros((6, 6)) for kind in "KCD"}
    out: list[Effect] = []
    for law in laws:
        i = DIRECTIONS.index(law.name)
        if law.best.kinds[0] in LAWS:
            values = dict(law.best.values)
            K = np.zeros((6, 6))
            K[i, i] = values.pop("stiffness")
            shape = LAWS[law.best.kinds[0]](**values)
            out.append(Viscoelastic(name=f"{name}.{law.name}", K=K, law=shape, **place))
            continue
        for kind in law.best.kinds:
            if kind != "M":
                matrices[kind][i, i] = law.best.values[kind]
    if any(X.any() for X in matrices.values()):
        out.insert(0, Joint(name=name, **matrices, **place))
    return tuple(out)


def _column(kind: str, omega: Floats) -> Complexes:
    return {
        "K": np.ones_like(omega, dtype=complex),
        "M": -(omega**2).astype(complex),
        "C": 1j * omega,
        "D": 1j * np.ones_like(omega),
    }[kind]


def _explain(name: str, frequency: Floats, Z: Complexes, weight: Floats) -> StiffnessLaw:
    scatter = _scatter(Z, weight)
    fits = [
        _linear((*rest, *loss), frequency, Z, weight, scatter)
        for rest in (("K",), ("M",), ("K", "M"))
        for loss in ((), ("C",), ("D",), ("C", "D"))
    ]
    fits += [_rising(kind, frequency, Z, weight, scatter) for kind in LAWS]
    fits = sorted((f for f in fits if np.isfinite(f.criterion)), key=lambda f: f.criterion)
    best = fits[0]
    residual = (Z - best.stiffness(frequency)) * weight
    misfit = 1.4826 * np.median(np.abs(np.concatenate([residual.real, residual.imag])))
    explained = bool(misfit <= UNEXPLAINED * scatter or best.misfit < 1e-6)
    return StiffnessLaw(name, frequency, Z, scatter, best, tuple(fits[1:]), explained)


def _scatter(Z: Complexes, weight: Floats) -> float:
    """Return the standard deviation from line to line, by second differences, robustly."""
    d = (Z[:-2] - 2 * Z[1:-1] + Z[2:]) * weight[1:-1] / np.sqrt(6)
    return float(1.4826 * np.median(np.abs(np.concatenate([d.real, d.imag]))))


def _criterion(r: Floats, n_parameters: int, floor: float) -> float:
    """Return Schwarz's criterion with Huber's loss at 1.5 robust deviations."""
    level = max(1.4826 * float(np.median(np.abs(r))), floor, 1e-300)
    t = np.abs(r) / level
    rho = np.where(t < 1.5, t**2, 3.0 * t - 2.25).mean() * level**2
    return len(r) * float(np.log(max(rho, floor**2, 1e-300))) + n_parameters * float(np.log(len(r)))


def _linear(
    kinds: tuple[str, ...], frequency: Floats, Z: Complexes, weight: Floats, scatter: float
) -> LawFit:
    omega = 2 * np.pi * frequency
    columns = np.stack([_column(k, omega) for k in kinds], axis=1) * weight[:, None]
    E = np.vstack([columns.real, columns.imag])
    size = np.linalg.norm(E, axis=0)
    y = np.concatenate([(Z * weight).real, (Z * weight).imag])
    floor = 1e-9 * float(np.sqrt((y**2).mean()))
    h = np.ones(len(y))
    theta = np.zeros(len(kinds))
    for _ in range(20):
        root = np.sqrt(h)[:, None]
        theta = np.linalg.lstsq(root * E / size, root[:, 0] * y, rcond=None)[0] / size
        r = y - E @ theta
        level = max(1.4826 * float(np.median(np.abs(r))), floor)
        h = 1 / np.maximum(np.abs(r) / (1.5 * level), 1.0)
    r = y - E @ theta
    std = np.sqrt(np.diag(np.linalg.inv((E / size).T @ (h[:, None] * E / size)))) / size
    std = std * max(1.4826 * float(np.median(np.abs(r))), floor)
    misfit = float(np.sqrt((r**2).mean() / max((y**2).mean(), 1e-300)))
    wrong = any(t < 0 for t in theta)  # a negative stiffness, mass or damping is none
    value = np.inf if wrong else _criterion(r, len(kinds), max(0.1 * scatter, floor))
    numbers = dict(zip(kinds, map(float, theta), strict=True))
    return LawFit(kinds, numbers, dict(zip(kinds, map(float, std), strict=True)), misfit, value)


def _rising(kind: str, frequency: Floats, Z: Complexes, weight: Floats, scatter: float) -> LawFit:
    omega = 2 * np.pi * frequency
    law, names = LAWS[kind], tuple(f.name for f in fields(LAWS[kind]))
    y = np.concatenate([(Z * weight).real, (Z * weight).imag])
    level = max(scatter, 1e-9 * float(np.sqrt((y**2).mean())))
    k0 = max(float(np.median(Z.real[: max(3, len(Z) // 10)])), 1e-12 * float(np.abs(Z).max()))

    def split(u: Floats) -> list[Any]:
        return [u[1 + i] if name == "alpha" else np.exp(u[1 + i]) for i, name in enumerate(names)]

    def residual(u: Floats) -> Floats:
        storage, loss = law(*split(u))(omega)
        z = np.exp(u[0]) * weight
        return (np.concatenate([z * storage, z * loss]) - y) / level

    best: Any = None
    low = [-np.inf, *(0.02 if n == "alpha" else np.log(1e-4 if n == "ratio" else 1e-9) for n in names)]
    high = [np.inf, *(1.0 if n == "alpha" else np.log(1e4 if n == "ratio" else 1e3) for n in names)]
    for tau in 1 / np.geomspace(omega[0], omega[-1], 3):
        start = [np.log(k0), *({"ratio": 0.0, "tau": np.log(tau), "alpha": 0.5}[n] for n in names)]
        found = scipy.optimize.least_squares(residual, start, bounds=(low, high), loss="soft_l1", f_scale=1.5)
        if best is None or found.cost < best.cost:
            best = found
    r = -best.fun * level
    at_bound = bool(np.any(best.active_mask[1:] != 0))
    covariance = (
        np.linalg.pinv(best.jac.T @ best.jac) * max(float(np.median(np.abs(best.fun))) * 1.4826, 1e-9) ** 2
    )
    du = np.sqrt(np.diag(covariance))
    values = {
        "stiffness": float(np.exp(best.x[0])),
        **dict(zip(names, map(float, split(best.x)), strict=True)),
    }
    slopes = [values[n] if n != "alpha" else 1.0 for n in ("stiffness", *names)]
    std = {n: float(s * d) for n, s, d in zip(("stiffness", *names), slopes, du, strict=True)}
    misfit = float(np.sqrt((r**2).mean() / max((y**2).mean(), 1e-300)))
    floor = max(0.1 * scatter, 1e-9 * float(np.sqrt((y**2).mean())))
    value = np.inf if at_bound else _criterion(r, len(names) + 1, floor)
    return LawFit((kind,), values, std, misfit, value)
