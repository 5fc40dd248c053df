"""Substructures whose receptances depend on uncertain parameters of their models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats
from fem.model import DIRECTIONS, Model
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model
from fem.summary import fields_summary
from joint._checks import as_frequency, frozen_copy
from joint.interface import CoordinateSet, Interface, SubstructureFRF, partition_frf, stack_substructures


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
