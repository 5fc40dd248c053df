"""Substructures whose receptances depend on uncertain parameters of their models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats
from fem.model import DIRECTIONS, Model, ModelError
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel, reduce_model
from fem.summary import fields_summary
from joint._checks import as_frequency, frozen_copy, solve_lines
from joint.interface import CoordinateSet, Interface, SubstructureFRF, partition_frf, stack_substructures
from updating.inference.parameters import DampingCurve, Nuisance


@dataclass(frozen=True, slots=True, eq=False)
class ReceptanceBlocks:
    """Hold derivatives of receptances by one parameter, shaped as those of a `SubstructureFRF`."""

    H_aa: Complexes
    H_ab: Complexes
    H_ba: Complexes
    H_bb: Complexes


class Parts(Protocol):
    """Substructures as a function of uncertain parameters with normal priors of mean 0 and deviation 1."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        ...

    @property
    def at_mean(self) -> SubstructureFRF:
        """Receptances where every parameter is 0."""
        ...

    def evaluate(self, x: Floats) -> tuple[SubstructureFRF, tuple[ReceptanceBlocks, ...]]:
        """Return receptances and their derivatives at x."""
        ...

    def physical(self, x: Floats) -> Floats:
        """Return the parameters in their own units."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class FixedParts:
    """Substructures that are known, measured for example.

    Attributes
    ----------
    at_mean : SubstructureFRF
    """

    at_mean: SubstructureFRF

    __repr__ = fields_summary

    @property
    def names(self) -> tuple[str, ...]:
        """No parameters."""
        return ()

    def evaluate(self, x: Floats) -> tuple[SubstructureFRF, tuple[ReceptanceBlocks, ...]]:
        """Return the receptances as they are."""
        return self.at_mean, ()

    def physical(self, x: Floats) -> Floats:
        """Return nothing."""
        return x


@dataclass(frozen=True, slots=True)
class Uncertain:
    """An uncertain parameter of a part's model: log-normal around its value in the model.

    Attributes
    ----------
    part : str
        Name of the part.
    effect, parameter : str
        Of the part's model, such as ``"frame"`` and ``"E:steel"``; ``"damping"`` and ``"ratio"`` for the
        structural loss of the whole part.
    std : float
        Standard deviation of the logarithm [-].
    """

    part: str
    effect: str
    parameter: str
    std: float


@dataclass(frozen=True, slots=True, eq=False)
class ModelParts:
    """Substructures given by finite-element models, with uncertain parameters.

    Build it with :meth:`of`.

    Attributes
    ----------
    at_mean : SubstructureFRF
        Receptances with every parameter as in the models.
    uncertain : tuple of Uncertain
    """

    at_mean: SubstructureFRF
    uncertain: tuple[Uncertain, ...]
    _engines: tuple[tuple[str, ParametricFRF, Floats, Floats, Interface, CoordinateSet], ...]
    _means: Floats

    __repr__ = fields_summary

    @classmethod
    def of(
        cls,
        models: Mapping[str, Model],
        frequency: npt.ArrayLike,
        joint: Mapping[str, Sequence[int]],
        internal: Mapping[str, Sequence[tuple[int, str]]],
        uncertain: Sequence[Uncertain] = (),
        inputs: Mapping[str, Sequence[tuple[int, str]]] | None = None,
    ) -> ModelParts:
        """Project each model once, so that every evaluation costs nothing that grows with its mesh.

        Parameters
        ----------
        models : mapping of str to Model
            The parts by name. Their structural loss factor counts as damping; modal ratios are taken as
            2 ζ of structural damping at each line.
        frequency : (n_freq,) array_like
            Lines [Hz].
        joint : mapping of str to sequence of int
            Points of each part's mesh where joints attach, with all six directions.
        internal : mapping of str to sequence of (int, str)
            Internal responses of each part, as points and directions.
        uncertain : sequence of Uncertain
        inputs : mapping, optional
            Internal inputs; those of ``internal`` unless given.

        Raises
        ------
        ValueError
            For a part or parameter that is not there.
        """
        lines = as_frequency(frequency)
        engines, frfs, means = [], [], np.zeros(len(uncertain))
        for entry in uncertain:
            if entry.part not in models:
                msg = f"there is no part '{entry.part}'; the parts are {', '.join(models)}"
                raise ValueError(msg)
        for name, model in models.items():
            b = CoordinateSet(tuple(f"{name}{p}:{d}" for p in joint[name] for d in DIRECTIONS))
            out = CoordinateSet(tuple(f"{name}{p}:{d}" for p, d in internal[name]))
            given = internal[name] if inputs is None else inputs[name]
            inn = CoordinateSet(tuple(f"{name}{p}:{d}" for p, d in given))
            every = CoordinateSet(tuple(dict.fromkeys((*b.labels, *out.labels, *inn.labels))))
            columns = np.zeros((model.n_dof, len(every)))
            for k, label in enumerate(every.labels):
                point, direction = label[len(name) :].split(":")
                columns[6 * int(point) + DIRECTIONS.index(direction), k] = 1.0
            mine = [(i, u) for i, u in enumerate(uncertain) if u.part == name and u.effect != "damping"]
            refs = [(u.effect, u.parameter) for _, u in mine]
            known = model.values()
            for i, u in mine:
                if (u.effect, u.parameter) not in known:
                    msg = f"part '{name}' has no parameter {u.effect} {u.parameter}; it has {sorted(known)}"
                    raise ValueError(msg)
                means[i] = known[u.effect, u.parameter]
            reduced = reduce_model(model, columns, float(lines[-1]), margin=2.5, n_krylov=2, releasable=False)
            engine = ParametricFRF(reduced, columns, columns, lines, refs)
            zeta = model.damping.ratio_at(lines)
            engines.append((name, engine, zeta, np.zeros(0), Interface(b, out, inn), every))
            H, _, _ = engine.evaluate(np.array([known[ref] for ref in refs]), zeta, False)
            frfs.append(partition_frf(lines, H, every, every, engines[-1][4]))
        return cls(stack_substructures(*frfs), tuple(uncertain), tuple(engines), frozen_copy(means))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(f"{u.part} {u.effect} {u.parameter}" for u in self.uncertain)

    def physical(self, x: Floats) -> Floats:
        """Return the parameters in their own units: mean · exp(std · x)."""
        std = np.array([u.std for u in self.uncertain])
        return np.where(self._means > 0, self._means, 1.0) * np.exp(std * x)

    def evaluate(self, x: Floats) -> tuple[SubstructureFRF, tuple[ReceptanceBlocks, ...]]:
        """Return receptances and their derivatives by x."""
        values = self.physical(x)
        frfs: list[SubstructureFRF] = []
        slopes: list[list[tuple[int, Complexes]]] = []
        for name, engine, zeta, _, _, _ in self._engines:
            mine = [i for i, u in enumerate(self.uncertain) if u.part == name and u.effect != "damping"]
            loss = [i for i, u in enumerate(self.uncertain) if u.part == name and u.effect == "damping"]
            eta = engine.reduced.model.damping.loss_factor
            factor = float(np.prod([values[i] for i in loss]))
            # a change of the loss factor η is one of 2 ζ at every line
            extra = zeta * factor + 0.5 * eta * (factor - 1)
            H, dH, dH_dzeta = engine.evaluate(values[mine], extra, True)
            assert dH is not None
            assert dH_dzeta is not None
            rows = [(i, dH[k] * values[i] * self.uncertain[i].std) for k, i in enumerate(mine)]
            change = (zeta + 0.5 * eta)[:, None, None] * factor
            rows += [(i, dH_dzeta * change * self.uncertain[i].std) for i in loss]
            frfs.append(self._partition(len(frfs), H))
            slopes.append(rows)
        stacked = stack_substructures(*frfs)
        out: list[ReceptanceBlocks | None] = [None] * len(self.uncertain)
        for part, rows in enumerate(slopes):
            for i, dH in rows:
                pieces = [
                    self._partition(
                        k, dH if k == part else np.zeros((len(dH), *self._shape(k)), dtype=complex)
                    )
                    for k in range(len(frfs))
                ]
                slope = stack_substructures(*pieces)
                out[i] = ReceptanceBlocks(slope.H_aa, slope.H_ab, slope.H_ba, slope.H_bb)
        return stacked, tuple(b for b in out if b is not None)

    def _shape(self, part: int) -> tuple[int, int]:
        n = len(self._engines[part][5])
        return n, n

    def _partition(self, part: int, H: Complexes) -> SubstructureFRF:
        _, engine, _, _, interface, every = self._engines[part]
        return partition_frf(engine.omega / (2 * np.pi), H, every, every, interface)


# A structure without one of its joints, as a function of its uncertain parameters ---------------------------


@dataclass(frozen=True, slots=True, eq=False)
class ReleasedParts:
    """A model without the stiffness of a joint in some of its directions.

    The model itself holds springs z in these directions, so that parts that nothing else connects need no
    treatment of their own. Taken out again, with d the relative motions,

    H = H' + H'_·d S⁻¹ H'_d·,       S = z⁻¹ - H'_dd
    dH = (1 + H'_·d S⁻¹ E_dᵀ) dH' (1 + E_d S⁻¹ H'_d·)

    E_d picks the relative motions. The springs have the structure's own damping, as everything has, and so
    has the joint that is identified.

    Build it with :meth:`of`.

    Attributes
    ----------
    at_mean : SubstructureFRF
        Receptances with every parameter as in the model; the joint coordinates are the relative motions.
    nuisances : tuple of Nuisance
    damping : DampingCurve
    """

    at_mean: SubstructureFRF
    nuisances: tuple[Nuisance, ...]
    damping: DampingCurve
    _engine: ParametricFRF
    _springs: Floats
    _means: Floats
    _interface: Interface

    __repr__ = fields_summary

    @classmethod
    def of(
        cls,
        reduced: ReducedModel,
        frequency: Floats,
        interface: Interface,
        vectors: tuple[Floats, Floats, Floats],
        springs: Floats,
        nuisances: Sequence[Nuisance],
        damping: DampingCurve,
    ) -> ReleasedParts:
        """Take the springs out of a projected model.

        Parameters
        ----------
        reduced : ReducedModel
            Of the model with the springs, and without modal damping, which is that of the curve; with
            attachment vectors of all outputs, inputs and relative motions.
        frequency : (n_freq,) array
            Lines [Hz], above 0.
        interface : Interface
            Names of the p relative motions, the M responses and the L inputs.
        vectors : ((n_dof, M), (n_dof, L), (n_dof, p)) arrays
            Responses, inputs and relative motions as combinations of degrees of freedom.
        springs : (p,) array
            Stiffness of the springs in the relative motions [N/m, N·m/rad].
        nuisances : sequence of Nuisance
            Parameters that are uncertain: positive ones with the standard deviation of their logarithm,
            those that are 0, such as a relative change, with that of their value.
        damping : DampingCurve
            Modal damping and its uncertainty.

        Raises
        ------
        ModelError
            For a nuisance that is no parameter of the model or has a negative value.
        """
        lines = as_frequency(frequency)
        outputs, inputs, relative = vectors
        model = reduced.model
        known = model.values()
        refs = [(n.effect, n.parameter) for n in nuisances]
        for ref in refs:
            if not known.get(ref, -1.0) >= 0:
                msg = f"'{ref[0]} {ref[1]}' is uncertain, but no parameter of the model that is 0 or positive"
                raise ModelError(msg)
        engine = ParametricFRF(
            reduced, np.hstack([outputs, relative]), np.hstack([inputs, relative]), lines, refs
        )
        means = np.array([known[ref] for ref in refs])
        zeta = damping.ratio(lines, damping.nominal)
        H, _, _ = engine.evaluate(means, zeta, False)
        at_mean = _partition(lines, interface, _release(H, *_taken_out(H, springs, model, lines, zeta)))
        return cls(at_mean, tuple(nuisances), damping, engine, frozen_copy(springs), means, interface)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nuisances, then of the damping at the knots of its curve."""
        knots = (f"damping at {f:.0f} Hz" for f in self.damping.knots)
        return (*(f"{n.effect} {n.parameter}" for n in self.nuisances), *knots)

    def physical(self, x: Floats) -> Floats:
        """Return the parameters in their own units: mean · exp(std · x), std · x where the mean is 0."""
        mean, std = self._priors()
        return np.where(mean > 0, mean * np.exp(std * x), std * x)

    def standard(self, values: Floats) -> Floats:
        """Return x of parameters in their own units: the inverse of `physical`."""
        return deviations(values, *self._priors())

    def _priors(self) -> tuple[Floats, Floats]:
        """Return means and standard deviations of the nuisances, then of the damping at its knots."""
        std = np.append([n.std for n in self.nuisances], np.full(len(self.damping.knots), self.damping.std))
        return np.append(self._means, self.damping.nominal), std

    def evaluate(self, x: Floats) -> tuple[SubstructureFRF, tuple[ReceptanceBlocks, ...]]:
        """Return receptances and their derivatives by x."""
        n = len(self.nuisances)
        values = self.physical(x)
        lines = self.at_mean.frequency
        hats = self.damping.hats(lines)
        zeta = self.damping.ratio(lines, values[n:])
        H, dH, dH_dzeta = self._engine.evaluate(values[:n], zeta, True)
        assert dH is not None
        assert dH_dzeta is not None
        model = self._engine.reduced.model
        S, dz = _taken_out(H, self._springs, model, lines, zeta)
        frf = _partition(lines, self._interface, _release(H, S, dz))
        p = len(self._springs)
        left = _left(H, S, p)
        right = _left(H.mT, S.mT, p).mT
        scale = np.where(self._means > 0, values[:n], 1.0)
        slopes = [left @ (dH[k] * (scale[k] * each.std)) @ right for k, each in enumerate(self.nuisances)]
        # the springs that are taken out carry the damping too: dS = -z⁻¹ dz z⁻¹ - dH'_dd
        base = left @ dH_dzeta @ right
        through = solve_lines(S, H[:, -p:]) / dz[:, :, None]
        back = solve_lines(S.mT, H[:, :, -p:].mT).mT / dz[:, None, :]
        base = base + (back * (2j * self._springs)) @ through
        slopes += [
            base * (zeta * hats[:, k] * self.damping.std)[:, None, None]
            for k in range(len(self.damping.knots))
        ]
        return frf, tuple(self._blocks(each) for each in slopes)

    def _blocks(self, H: Complexes) -> ReceptanceBlocks:
        p = len(self._springs)
        return ReceptanceBlocks(H[:, :-p, :-p], H[:, :-p, -p:], H[:, -p:, :-p], H[:, -p:, -p:])


def deviations(values: Floats, mean: Floats, std: Floats) -> Floats:
    """Return parameters in standard deviations from their means, of logarithms unless a mean is 0."""
    ratio = np.divide(values, mean, out=np.ones_like(mean), where=mean > 0)
    return np.where(mean > 0, np.log(ratio), values) / std


def _taken_out(
    H: Complexes, springs: Floats, model: Model, lines: Floats, zeta: Floats
) -> tuple[Complexes, Complexes]:
    """Return S = z⁻¹ - H'_dd, (n_freq, p, p), and z, (n_freq, p)."""
    p = len(springs)
    loss = model.damping.loss_factor + 2 * np.pi * lines * model.damping.beta + 2 * zeta
    z = springs * (1 + 1j * loss[:, None])
    S = -H[:, -p:, -p:]
    S[:, np.arange(p), np.arange(p)] += 1 / z
    return S, z


def _release(H: Complexes, S: Complexes, z: Complexes) -> Complexes:
    """Return receptances without the springs."""
    p = z.shape[1]
    return H + H[:, :, -p:] @ solve_lines(S, H[:, -p:])


def _left(H: Complexes, S: Complexes, p: int) -> Complexes:
    """Return 1 + H'_·d S⁻¹ E_dᵀ, by which a change of H' goes into one of H."""
    n = H.shape[1]
    out = np.broadcast_to(np.eye(n, dtype=complex), (len(H), n, n)).copy()
    out[:, :, -p:] += solve_lines(S.mT, H[:, :, -p:].mT).mT
    return out


def _partition(lines: Floats, interface: Interface, H: Complexes) -> SubstructureFRF:
    p = len(interface.joint)
    return SubstructureFRF(lines, interface, H[:, :-p, :-p], H[:, :-p, -p:], H[:, -p:, :-p], H[:, -p:, -p:])
