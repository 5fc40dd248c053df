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
from updating.inference.heartbeat import EndEarlyError, may_end_early

N_MODES, ABOVE = 40, 2.0
"""Modes of the reduced basis, at most, and the multiple of the band that they may reach."""
CLAMP = 1e3
"""A clamp's stiffness, in parts of the stiffest joint."""
STRUCTURAL = {"joint_stiffness", "support_flexibility", "stiffness_loss", "member_stiffness", "ground_spring"}
MASSES = {"point_mass", "member_density"}
DISSIPATION = {"joint_viscous_damping", "ground_damper"}
PLACES = tuple(np.linspace(0.05, 0.95, 10))
"""Where along a member a mass or a loss of stiffness is tried [-]."""
LOG_BOUNDS = -7.0, 3.0
"""Of changes of logarithms of stiffnesses."""
MOST_COMPLIANT = 1e3
"""Of a clamp, in parts of the compliance of the stiffest joint."""
LEAST = 1e-9
"""Explanations that are less probable are left out."""
FREQUENCY_STD, SHAPE_STD = 2e-3, 0.05
"""Standard deviations of natural frequencies, relative, and of shapes [-]."""


RESERVE = 30.0
"""CPU seconds for what a diagnosis does after it was ended."""


@dataclass
class Said:
    """What a method says: explanations, and the probability of none of them."""

    explanations: tuple = ()
    unexplained: float = 0.0


@dataclass(frozen=True)
class Option:
    """A candidate at a place, whose ``size`` is absent at ``absent``.

    Fits change it by a number x, from 0. Stiffnesses that are there have x = ln(size / absent), and clamps
    x = usual compliance times (1/size - 1/absent), so that a rigid clamp has a finite slope; of others x is
    what is added. The matrices are linear in `amount`.
    """

    effect: object
    parameter: str
    absent: float
    form: str
    sizes: tuple
    bounds: tuple
    key: str

    def at(self, size):
        """Return the effect with a size."""
        return self.effect.with_values(**{self.parameter: size})

    @property
    def ratio(self):
        """Stiffness of the clamp over the usual one of a clamp that gives way."""
        return self.absent / self.sizes[0]

    def amount(self, x):
        """Return what the slopes of matrices are multiplied by after a change."""
        if self.form == "log":
            return np.expm1(x)
        return 1 / (1 + x * self.ratio) - 1 if self.form == "compliance" else x

    def rate(self, x):
        """Return the slope of `amount`."""
        if self.form == "log":
            return np.exp(x)
        return -self.ratio / (1 + x * self.ratio) ** 2 if self.form == "compliance" else 1.0

    def size(self, x):
        """Return the size after a change."""
        return float(self.absent + self.amount(x) * (1.0 if self.form == "linear" else self.absent))

    def change(self, size):
        """Return the change that makes a size."""
        if self.form == "log":
            return float(np.log(size / self.absent))
        if self.form == "compliance":
            return (self.absent / size - 1) / self.ratio
        return size - self.absent

    @property
    def usual(self):
        """A change that counts as large as the usual ones of other candidates."""
        return {"log": 0.5, "compliance": 1.0, "linear": 0.1}[self.form]

    @property
    def limits(self):
        """Least and largest change."""
        if self.form == "log":
            return LOG_BOUNDS
        return (0.0, MOST_COMPLIANT) if self.form == "compliance" else self.bounds


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

    def watch(self, text, done):
        """End a diagnosis of Dovetail with what it has, where the time is nearly up; its ``progress``."""
        if self.left < RESERVE and may_end_early():
            raise EndEarlyError

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
            form = {"joint_stiffness": "log", "support_flexibility": "compliance"}.get(e.kind, "linear")
            bounds = (
                max(p.lower, -0.7) - p.absent,
                min(p.upper, 0.95 if p.name == "loss" else np.inf) - p.absent,
            )
            for values in at:
                placed = e.with_values(**values) if values else e
                key = f"{e.name}{values.get('position', '')}"
                absent = p.absent if form == "linear" else p.value
                option = Option(placed, p.name, absent, form, sizes, bounds, key)
                out += [option] if self.words(option, sizes[0]) else []
        return out

    def said(self, weights, temperature=1.0, unknown=0.0, penalty=0.0, unexplained=0.0):
        """Return what is said where hypotheses, tuples of (option, size, std), have log weights.

        Weights count too much where errors of the model are alike in all data: ``temperature`` divides their
        logarithms, and each effect costs ``penalty`` nats beside them. ``unknown`` and ``unexplained`` are
        probabilities that are left beside all of it.
        """
        names = list(weights)
        logs = np.array([weights[h] / temperature - penalty * len(h) for h in names])
        p = (1 - unknown - unexplained) * np.exp(logs - np.logaddexp.reduce(logs))
        kept = {}
        for h, probability in zip(names, p, strict=True):
            effects = tuple(x for o, size, std in h for x in self.words(o, size, std))
            key = repr([(x["kind"], x["place"], x.get("direction"), x.get("position")) for x in effects])
            before = kept.get(key, Explanation(0.0, effects))
            kept[key] = Explanation(before.probability + float(probability), effects)
        return Said(tuple(e for e in kept.values() if e.probability > LEAST), unexplained)

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
        case "preload":
            return 1e3, 1e4
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
        self.slopes = {}

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
        K, M = matrices[:2]
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


def slopes_of(reduced, options):
    """Return the slopes of K, M, C and D with sizes, of stiffnesses that are there with relative sizes."""
    out = []
    for o in options:
        if o.key not in reduced.slopes:
            step = -0.01 if o.form != "linear" else o.sizes[0]
            size = o.absent * (1 + step) if o.form != "linear" else o.absent + step
            changed = reduced.with_effects([o.at(size)])
            reduced.slopes[o.key] = tuple((a - b) / step for a, b in zip(changed, reduced.base, strict=True))
        out.append(reduced.slopes[o.key])
    return out


@dataclass
class Updating:
    """Fits to measured modes: sizes of options vary, and what is uncertain within its tolerance.

    Frequencies count as logarithms, and shapes scaled to the measured ones; slopes of shapes by Fox and
    Kapoor (AIAA J. 6, 1968). The scale of the error of each frequency and of each shape is not known beyond
    its least one, so that a mode which the model cannot have does not decide (Student's t).
    """

    case: Case
    options: list

    def __post_init__(self):
        """Compute slopes of all matrices once."""
        reduced = self.case.reduced
        own = slopes_of(reduced, self.options)
        usual = common_slopes(self.case)
        self.slopes = [np.array([s[i] for s in (*own, *usual)]) for i in (0, 1)]
        self.n, self.n_common = len(self.options), len(usual)
        limits = [o.limits for o in self.options] + [(-3.0, 3.0)] * len(usual)
        self.bounds = np.array(limits).T

    def matrices(self, changes):
        """Return K and M after changes, of options and of what is uncertain."""
        amount = np.array(changes, dtype=float)
        amount[: self.n] = [o.amount(x) for o, x in zip(self.options, changes, strict=False)]
        at = np.flatnonzero(amount)
        both = zip(self.case.reduced.base[:2], self.slopes, strict=True)
        return [b + np.tensordot(amount[at], s[at], 1) for b, s in both]

    def linearised(self, changes, columns=slice(None)):
        """Return residuals (n,) and slopes with some changes (n, n_columns), in standard deviations.

        And the numbers of the groups (n,) in which residuals have one scale.
        """
        reduced, (f, _, phi) = self.case.reduced, self.case.modes
        frequency, shapes, vectors = reduced.solve_modes(self.matrices(changes), len(reduced.base[0]))
        partner, _ = paired(frequency, shapes, f, phi.real)
        values = (2 * np.pi * frequency) ** 2
        rate = np.ones(len(changes))
        rate[: self.n] = [o.rate(x) for o, x in zip(self.options, changes, strict=False)]
        dK, dM = self.slopes[0][columns], self.slopes[1][columns]
        moving = vectors[:, partner]
        forces = _applied(dK, moving) - _applied(dM, moving) * values[partner]
        forces = np.tensordot(vectors.T, forces, (1, 1)) * rate[columns][:, None]  # (n, n_columns, n_modes)
        rows, slopes, groups = [], [], []
        for k, j in enumerate(partner):
            gaps = values[j] - values
            least = 1e-3 * abs(values[j])
            gaps = np.where(np.abs(gaps) < least, np.where(gaps < 0, -least, least), gaps)
            gaps[j] = np.inf
            a, b = shapes[:, j], phi[:, k].real
            scale = (a @ b) / (a @ a)
            size = np.sqrt(np.mean(b**2)) * SHAPE_STD
            rows += [np.log(f[k] / frequency[j]) / FREQUENCY_STD, *((b - scale * a) / size)]
            groups += [2 * k, *[2 * k + 1] * len(a)]
            d = forces[:, :, k]
            moved = shapes @ (d / gaps[:, None])
            moved -= np.outer(a, a @ moved) / (a @ a)
            slopes += [d[j][None, :] / (2 * values[j]) / FREQUENCY_STD, scale * moved / size]
        return np.array(rows), np.vstack(slopes), np.array(groups)

    def loss(self, r, groups, changes):
        """Return minus the logarithm of the likelihood and the prior of what is uncertain."""
        n, squares = np.bincount(groups), np.bincount(groups, r**2)
        usual = changes[self.n :]
        return 0.5 * float(np.sum(n * np.log1p(squares / n)) + usual @ usual)

    def fit(self, solve, chosen=None, steps=8, start=None):
        """Return changes of options, their covariance, the loss and the number of residuals.

        ``solve(A, b)`` returns changes of the chosen options, beside which those of what is uncertain are
        eliminated.
        """
        chosen = np.arange(self.n) if chosen is None else np.asarray(chosen, dtype=int)
        total = np.zeros(self.n + self.n_common)
        if start is not None:
            total[chosen] = start
        columns = np.append(chosen, np.arange(self.n, len(total)))
        best, known, step, covariance, r = np.inf, total, total, np.zeros((0, 0)), np.zeros(0)
        for _ in range(steps):
            r, S, groups = self.linearised(total, columns)
            loss = self.loss(r, groups, total)
            if loss > best - 1e-3:
                if loss <= best or np.abs(step).max() < 1e-3:
                    break
                step = 0.3 * step
                total = known + step
                continue
            best, known = loss, total
            n = np.bincount(groups)
            weight = 1 / np.sqrt(1 + np.bincount(groups, r**2) / n)[groups]
            r, S = r * weight, S * weight[:, None]
            own, usual = S[:, : len(chosen)], S[:, len(chosen) :]
            whole = np.linalg.cholesky(np.eye(len(r)) + usual @ usual.T)
            b = r + S @ total[columns]
            A, y = (scipy.linalg.solve_triangular(whole, v, lower=True) for v in (own, b))
            x = solve(A, y)
            inner = scipy.linalg.cho_solve((whole, True), b - own @ x)
            new = np.zeros_like(total)
            new[chosen] = x
            new[self.n :] = usual.T @ inner
            most = np.maximum(1.0, np.abs(total))
            step = np.clip(total + np.clip(new - total, -most, most), *self.bounds) - total
            covariance = np.linalg.pinv(A.T @ A)
            total = total + step
        self.last = known
        return known[: self.n], covariance, best, len(r)

    def settled(self):
        """Return changes after a fit of what is uncertain alone."""
        self.fit(_least_squares, [])
        return self.last

    def hypothesis(self, chosen, near=None):
        """Return some options with their sizes as they fit, and the logarithm of BIC's weight.

        Stiffnesses are fitted from several sizes, since their slopes where they are rigid say little of where
        they are soft. ``near`` are changes of all but the last one from which the fit begins.
        """
        starts = [np.zeros(len(chosen))]
        if len(chosen):
            o = self.options[chosen[-1]]
            before = np.zeros(len(chosen) - 1) if near is None else near
            sizes = o.sizes if o.form != "linear" or o.parameter == "stiffness" else ()
            starts = [np.append(before, x) for x in (0.0, *map(o.change, sizes))]
        fits = [self.fit(_least_squares, chosen, start=start) for start in starts]
        x, covariance, loss, n = min(fits, key=lambda fit: fit[2])
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        told = []
        for k, s in zip(chosen, std, strict=True):
            o = self.options[k]
            size = o.size(x[k])
            rate = o.rate(x[k]) * (1.0 if o.form == "linear" else o.absent)
            told.append((o, size, float(abs(s * rate))))
        return tuple(told), -loss - 0.5 * len(chosen) * np.log(n)

    def largest(self, order, changes):
        """Return BIC's weights of none, one and more options in an order, by hypothesis."""
        found = [self.hypothesis(order[:k], changes[order[: max(k - 1, 0)]]) for k in range(len(order) + 1)]
        return dict(found)


def _applied(matrices, vectors):
    """Return products (m, n, n_vectors) of matrices (m, n, n) with vectors (n, n_vectors) at one go."""
    m, n, _ = matrices.shape
    return (matrices.reshape(m * n, n) @ vectors).reshape(m, n, -1)


def _least_squares(A, b):
    return np.linalg.lstsq(A, b, rcond=None)[0] if A.shape[1] else np.zeros(0)


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
