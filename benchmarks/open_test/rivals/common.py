"""What rivals share: the case, a reduced model of it, and candidates with their matrices.

They use the packages as a library, by public names alone. The model has springs instead of clamps, so that a
support can give way without a change of coordinates.
"""

import tempfile
import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.optimize
from scipy.sparse.linalg import splu

import fem
from benchmarks.independent.convert import convert
from benchmarks.open_test.answer import Explanation
from benchmarks.open_test.case import nominal_of, read_modes, read_structure
from benchmarks.open_test.words import effects_of
from dovetail import load_study
from updating import mac, sensor_rows

N_MODES, ABOVE = 40, 2.0
"""Modes of the reduced basis, at most, and the multiple of the band that they may reach."""
CLAMP = 1e4
"""A clamp's stiffness, in parts of the stiffest joint."""
STRUCTURAL = {"joint_stiffness", "support_flexibility", "stiffness_loss", "member_stiffness", "ground_spring"}
MASSES = {"point_mass", "member_density"}
DISSIPATION = {"joint_viscous_damping", "ground_damper"}
PLACES = 0.2, 0.5, 0.8
"""Where along a member a mass or a loss of stiffness is tried [-]."""
LOG_BOUNDS = -7.0, 3.0
"""Of changes of logarithms of stiffnesses."""
LEAST_MAC = 0.5
"""A measured mode has a partner from this MAC on [-]."""
FREQUENCY_STD, SHAPE_STD = 2e-3, 0.05
"""Standard deviations of natural frequencies, relative, and of shapes [-]."""


@dataclass
class Said:
    """What a method says: explanations, and the probability of none of them."""

    explanations: tuple = ()
    unexplained: float = 0.0


@dataclass(frozen=True)
class Option:
    """A candidate at a place, whose ``size`` is absent at ``absent``; positive ones go by logarithm."""

    effect: object
    parameter: str
    absent: float
    log: bool
    sizes: tuple
    bounds: tuple
    key: str

    def at(self, size):
        """Return the effect with a size."""
        return self.effect.with_values(**{self.parameter: size})


@dataclass
class Case:
    """A case of the test: its folder, and until when there is time (CPU seconds of this process)."""

    folder: Path
    limit: float = 300.0
    begun: float = field(default_factory=time.process_time)

    @property
    def left(self):
        """CPU seconds that are left."""
        return self.limit - (time.process_time() - self.begun)

    @cached_property
    def structure(self):
        return read_structure(self.folder)

    @cached_property
    def study(self):
        with tempfile.TemporaryDirectory() as out:
            file = Path(out) / "study.toml"
            file.write_text(convert(nominal_of(self.structure.told), self.folder, file), encoding="utf-8")
            return load_study(file)

    @cached_property
    def modes(self):
        """Measured frequencies [Hz], damping ratios, shapes (n_sensors, n_modes)."""
        return read_modes(self.folder)

    @cached_property
    def model(self):
        """The nominal model with springs instead of clamps."""
        model = self.study.model
        flexible = [e for e in self.study.candidates() if e.kind == "support_flexibility"]
        stiff = max((k for j in self.structure.told["joints"] for k in j["stiffness"].values()), default=1e8)
        for e in flexible:
            model = e.with_values(stiffness=CLAMP * stiff).added_to(model)
        return model

    @cached_property
    def reduced(self):
        return Reduced(self.model, self.study.measurements[0], self.structure.told["modal_damping_ratio"])

    def options(self, kinds):
        """Return the candidates of some kinds, those with a position at several places."""
        clamps = {e.name: e for e in self.model.effects if e.name.startswith("support_flexibility")}
        out = []
        for e in self.study.candidates():
            if e.kind not in kinds:
                continue
            e = clamps.get(e.name, e)
            p, *rest = e.parameters()
            member = getattr(e, "member", None)
            at = [{}]
            if any(q.name == "position" for q in rest):
                at = [{"position": s * self.structure.lengths[member]} for s in PLACES]
            sizes = _sizes(e, p, self)
            log = e.kind in ("joint_stiffness", "support_flexibility")
            bounds = (
                max(p.lower, -0.7) - p.absent,
                min(p.upper, 0.95 if p.name == "loss" else np.inf) - p.absent,
            )
            for values in at:
                placed = e.with_values(**values) if values else e
                key = f"{e.name}{values.get('position', '')}"
                out.append(Option(placed, p.name, p.value if log else p.absent, log, sizes, bounds, key))
        return out

    def said(self, weights, more=0.0):
        """Return what is said where hypotheses, tuples of (option, size, std), have log weights.

        ``more`` is the log weight of something else, None of nothing else.
        """
        names, logs = list(weights), np.array([weights[h] for h in weights], dtype=float)
        every = logs if more is None else np.append(logs, more)
        p = np.exp(logs - np.logaddexp.reduce(every))
        kept = {}
        for h, probability in zip(names, p, strict=True):
            effects = tuple(x for o, size, std in h for x in self.words(o, size, std))
            key = repr([(x["kind"], x["place"], x.get("direction"), x.get("position")) for x in effects])
            before = kept.get(key, Explanation(0.0, effects))
            kept[key] = Explanation(before.probability + float(probability), effects)
        return Said(tuple(kept.values()), max(1.0 - float(p.sum()), 0.0))

    def words(self, option, size, std=None):
        """Return an option with a size in the words of the test."""
        effect = option.at(size)
        values = {p.name: (float(p.value), None, p.unit) for p in effect.parameters()}
        values[option.parameter] = (float(size), std, values[option.parameter][2])
        return effects_of(effect.name, values, self.structure) or []


def _sizes(effect, p, case):
    """Return sizes from which a fit may start: a weak and a strong one."""
    match effect.kind:
        case "joint_stiffness":
            return 0.3 * p.value, 0.03 * p.value
        case "support_flexibility":
            stiff = p.value / CLAMP * (1e-3 if effect.name.rsplit(".", 1)[-1].startswith("r") else 1.0)
            return 0.3 * stiff, 0.03 * stiff
        case "stiffness_loss":
            return 0.3, 0.8
        case "member_stiffness" | "member_density":
            return 0.1, -0.1
        case "ground_spring":
            return 1e4, 3e5
        case "joint_viscous_damping" | "ground_damper":
            return 10.0, 100.0
    return 0.02 * case.reduced.mass, 0.1 * case.reduced.mass


class Reduced:
    """Matrices of a model on its first modes and its responses to loads at connections and forces."""

    def __init__(self, model, measurement, zeta):
        self.model, self.zeta = model, zeta
        self.system = fem.assemble(model)
        frf = measurement.frf
        self.frequency, self.H = frf.frequency, frf.H
        S = sensor_rows(model, measurement.sensors) @ self.system.Q
        F = sensor_rows(model, measurement.excitations) @ self.system.Q
        modes = fem.solve_modes(self.system, n=N_MODES)
        keep = modes.frequency < ABOVE * frf.frequency[-1]
        phi = self.system.Q.T @ modes.shapes[:, keep]
        shift = self.system.K - (2 * np.pi * frf.frequency[0]) ** 2 * self.system.M
        static = splu(shift.tocsc()).solve(np.column_stack([F.T, self._at_connections()]))
        static /= np.linalg.norm(static, axis=0)
        self.basis, _ = np.linalg.qr(np.column_stack([phi / np.linalg.norm(phi, axis=0), static]))
        self.S, self.F = S @ self.basis, F @ self.basis
        self.base = self._projected(self.system)

    @property
    def mass(self):
        """Mass of the structure that moves [kg]."""
        along = self.system.Q.T @ np.tile([1.0, 0, 0, 0, 0, 0], self.system.Q.shape[0] // 6)
        return float(along @ (self.system.M @ along))

    def _at_connections(self):
        """Return unit loads at points where something may give way: ends of elements at connections."""
        points = {p for e in self.model.effects for p in _points(e)}
        dofs = np.concatenate([fem.dofs_of(p) for p in sorted(points)]) if points else np.array([], dtype=int)
        return self.system.Q.T.toarray()[:, dofs]

    def _projected(self, system):
        B = self.basis
        K, M = B.T @ (system.K @ B), B.T @ (system.M @ B)
        return K, M, B.T @ (system.C @ B), B.T @ (system.D @ B)

    def with_effects(self, effects):
        """Return K, M, C, D of the model with effects; None where these change the coordinates."""
        model = self.model
        for e in effects:
            there = [e.name for known in model.effects if known.name == e.name]
            model = e.added_to(model.without_effect(*there))
        system = fem.assemble(model)
        return self._projected(system) if system.K.shape == self.system.K.shape else None

    def solve_modes(self, matrices, n):
        """Return frequencies [Hz] and readings of shapes at the sensors, (n_sensors, n)."""
        K, M, _, _ = matrices
        n = min(n, len(K))
        values, vectors = scipy.linalg.eigh(K, M, subset_by_index=[0, n - 1])
        return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi), self.S @ vectors, vectors

    def accelerance(self, matrices, lines, zeta=None):
        """Return accelerances at some lines, (n, n_out, n_in), with structural damping of 2 zeta."""
        K, M, C, D = matrices
        zeta = self.zeta if zeta is None else zeta
        out = np.empty((len(lines), len(self.S), len(self.F)), dtype=complex)
        for k, f in enumerate(lines):
            w = 2 * np.pi * f
            Z = K * (1 + 2j * zeta) + 1j * D + 1j * w * C - w**2 * M
            out[k] = -(w**2) * (self.S @ np.linalg.solve(Z, self.F.T))
        return out


def unit_of(option):
    """Return a change of an option's size, or of its logarithm, and the size after it."""
    if option.log:
        return np.log(0.99), 0.99 * option.absent
    step = 0.01 if option.parameter in ("change", "loss") else 0.1 * option.sizes[0]
    return step, option.absent + step


def slopes_of(reduced, options):
    """Return the slopes of K, M, C and D with sizes, or with their logarithms, of options."""
    out = []
    for o in options:
        step, size = unit_of(o)
        changed = reduced.with_effects([o.at(size)])
        out.append(tuple((a - b) / step for a, b in zip(changed, reduced.base, strict=True)))
    return out


@dataclass
class Updating:
    """Least squares on measured modes: sizes of options vary, and what is uncertain within its tolerance.

    Frequencies count as logarithms, and shapes scaled to the measured ones; slopes of shapes by Fox and
    Kapoor (AIAA J. 6, 1968). Changes are of sizes, or of logarithms of stiffnesses that are there already.
    """

    case: Case
    options: list

    def __post_init__(self):
        """Compute slopes of all matrices once."""
        reduced = self.case.reduced
        own = slopes_of(reduced, self.options)
        usual = common_slopes(self.case)
        self.slopes = [np.array(parts) for parts in zip(*(*own, *usual), strict=True)]
        self.log = np.array([o.log for o in self.options] + [False] * len(usual))
        self.n, self.n_common = len(self.options), len(usual)
        limits = [LOG_BOUNDS if o.log else o.bounds for o in self.options] + [(-3.0, 3.0)] * len(usual)
        self.bounds = np.array(limits).T

    def matrices(self, changes):
        """Return K, M, C and D after changes, of options and of what is uncertain."""
        amount = np.where(self.log, np.expm1(np.clip(changes, *LOG_BOUNDS)), changes)
        return [
            b + np.tensordot(amount, s, 1) for b, s in zip(self.case.reduced.base, self.slopes, strict=True)
        ]

    def linearised(self, changes, columns=slice(None)):
        """Return residuals (n,) and slopes with some changes (n, n_columns), in standard deviations."""
        reduced, (f, _, phi) = self.case.reduced, self.case.modes
        frequency, shapes, vectors = reduced.solve_modes(self.matrices(changes), len(reduced.base[0]))
        partner, assurance = paired(frequency, shapes, f, phi.real)
        values = (2 * np.pi * frequency) ** 2
        factor = np.where(self.log, np.exp(np.clip(changes, *LOG_BOUNDS)), 1.0)[columns]
        dK, dM = self.slopes[0][columns], self.slopes[1][columns]
        rows, slopes = [], []
        for k, j in enumerate(partner):
            if assurance[j, k] < LEAST_MAC:
                continue
            gaps = values[j] - values
            gaps[np.abs(gaps) < 1e-6 * abs(values[j])] = np.inf
            a, b = shapes[:, j], phi[:, k].real
            scale = (a @ b) / (a @ a)
            size = np.sqrt(np.mean(b**2)) * SHAPE_STD
            rows += [np.log(f[k] / frequency[j]) / FREQUENCY_STD, *((b - scale * a) / size)]
            d = vectors.T @ (dK @ vectors[:, j] - values[j] * (dM @ vectors[:, j])).T * factor
            moved = reduced.S @ (vectors @ (d / gaps[:, None]))
            moved -= np.outer(a, a @ moved) / (a @ a)
            slopes += [d[j][None, :] / (2 * values[j]) / FREQUENCY_STD, scale * moved / size]
        return np.array(rows), np.vstack(slopes)

    def fit(self, solve, chosen=None, steps=6):
        """Return changes of options, their covariance and the misfit, after some linearised steps.

        ``solve(A, b)`` returns changes of the chosen options, beside which those of what is uncertain are
        eliminated; the misfit is the sum of squares with their priors.
        """
        chosen = np.arange(self.n) if chosen is None else np.asarray(chosen, dtype=int)
        total = np.zeros(self.n + self.n_common)
        columns = np.append(chosen, np.arange(self.n, len(total)))
        A = y = x = np.zeros(0)
        for _ in range(steps):
            r, S = self.linearised(total, columns)
            own, usual = S[:, : len(chosen)], S[:, len(chosen) :]
            whole = np.linalg.cholesky(np.eye(len(r)) + usual @ usual.T)
            b = r + S @ total[columns]
            A, y = (scipy.linalg.solve_triangular(whole, v, lower=True) for v in (own, b))
            x = solve(A, y)
            inner = scipy.linalg.cho_solve((whole, True), b - own @ x)
            new = np.zeros_like(total)
            new[chosen] = x
            new[self.n :] = usual.T @ inner
            total = np.clip(total + np.clip(new - total, -1.0, 1.0), *self.bounds)
        covariance = np.linalg.pinv(A.T @ A)
        return total[: self.n], covariance, float(np.sum((y - A @ x) ** 2)), len(y)

    def value(self, k, change):
        """Return the size of an option after a change."""
        o = self.options[k]
        return float(o.absent * np.exp(np.clip(change, *LOG_BOUNDS)) if o.log else o.absent + change)

    def hypothesis(self, chosen):
        """Return some options with their sizes as they fit, and the logarithm of BIC's weight."""
        if not len(chosen):
            r, usual = self.linearised(np.zeros(self.n + self.n_common), slice(self.n, None))
            square = float(r @ np.linalg.solve(np.eye(len(r)) + usual @ usual.T, r))
            return (), -0.5 * len(r) * np.log(square / len(r))
        x, covariance, square, n = self.fit(lambda A, b: np.linalg.lstsq(A, b, rcond=None)[0], chosen)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        told = []
        for k, s in zip(chosen, std, strict=True):
            size = self.value(k, x[k])
            told.append((self.options[k], size, float(s * abs(size) if self.options[k].log else s)))
        return tuple(told), -0.5 * (n * np.log(square / n) + len(chosen) * np.log(n))


def common_slopes(case):
    """Return slopes of everything that is uncertain, E, density and joints, in standard deviations."""
    told = case.structure.told["tolerances"]
    members, joints = case.options({"member_stiffness", "member_density"}), case.options({"joint_stiffness"})
    groups = [([o for o in members if o.effect.kind == "member_stiffness"], told["E"])]
    groups.append(([o for o in members if o.effect.kind == "member_density"], told["rho"]))
    groups += [([o], told["joint_stiffness"]) for o in joints]
    out = []
    for group, std in groups:
        out.append(tuple(std * sum(parts) for parts in zip(*slopes_of(case.reduced, group), strict=True)))
    return out


def _points(effect):
    """Return the points of the mesh at which a joint or a support is."""
    out = [getattr(effect, name, None) for name in ("point", "point1", "point2")]
    return [p for p in out if isinstance(p, int | np.integer)]


def paired(frequency, shapes, f, phi):
    """Return for each measured mode the number of the computed one that is likest, by MAC and frequency."""
    assurance = mac(shapes, phi)
    near = np.abs(np.log(f[:, None] / np.maximum(frequency, 1e-9)[None, :]))
    likeness = assurance.T - 2.0 * near
    rows, columns = scipy.optimize.linear_sum_assignment(-likeness)
    out = np.full(len(f), -1)
    out[rows] = columns
    return out, assurance
