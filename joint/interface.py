"""Coordinates of substructures and joints, and receptances partitioned by them.

Joint coordinates `b` are those at which substructures and joints meet; internal coordinates `a` are the
others that take part. Responses and inputs may be taken at different internal coordinates, so that
H_aa is (M x L), H_ab (M x N), H_ba (N x L) and H_bb (N x N).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import fields_summary
from joint._checks import as_frequency, as_lines, check_same_lines, frozen_copy

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, slots=True)
class CoordinateSet:
    """Order the degrees of freedom of a set of nodes by label.

    Parameters
    ----------
    labels : tuple of str
        "node:direction", with direction one of x, y, z (translations [m], forces [N]) and rx, ry, rz
        (rotations [rad], moments [N m]), for example "U11:rz". Each label occurs once.

    Raises
    ------
    ValueError
        If a label is not of that form or occurs twice.
    """

    labels: tuple[str, ...]

    __repr__ = fields_summary

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        for position, label in enumerate(self.labels):
            node, _, direction = label.rpartition(":")
            if not node or direction not in DIRECTIONS:
                msg = (
                    f"coordinate {position} is labelled {label!r}; allowed is node:direction "
                    f"with direction one of {' '.join(DIRECTIONS)}, such as 'U11:rz'"
                )
                raise ValueError(msg)
        repeated = _repeated(self.labels)
        if repeated:
            msg = f"{_names(repeated)} occurs more than once; a coordinate may occur once"
            raise ValueError(msg)

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def rotational(self) -> Bools:
        """Mark the rotations, (n,)."""
        return np.array([label.rpartition(":")[2].startswith("r") for label in self.labels], dtype=bool)

    @property
    def lacking(self) -> dict[str, tuple[str, ...]]:
        """Which of the six directions a node lacks, for nodes that lack some."""
        have: dict[str, set[str]] = {}
        for label in self.labels:
            node, _, direction = label.rpartition(":")
            have.setdefault(node, set()).add(direction)
        return {
            node: tuple(d for d in DIRECTIONS if d not in found)
            for node, found in have.items()
            if len(found) < len(DIRECTIONS)
        }

    def positions(self, labels: Iterable[str]) -> Ints:
        """Return where the given labels stand in this set, (n_labels,).

        Raises
        ------
        ValueError
            If a label is not in the set.
        """
        place = {label: position for position, label in enumerate(self.labels)}
        labels = tuple(labels)
        missing = [label for label in labels if label not in place]
        if missing:
            msg = f"{_names(missing)} not among the {len(self)} coordinates {_names(self.labels)}"
            raise ValueError(msg)
        return np.array([place[label] for label in labels], dtype=np.int64)


def coordinates_of(nodes: Iterable[object], directions: Sequence[str] = DIRECTIONS) -> CoordinateSet:
    """Return the coordinates of nodes, node by node, all six directions of each by default."""
    return CoordinateSet(tuple(f"{node}:{direction}" for node in nodes for direction in directions))


@dataclass(frozen=True, slots=True)
class Interface:
    """Divide coordinates into joint coordinates and internal ones.

    Parameters
    ----------
    joint : CoordinateSet
        The N coordinates `b` (assembly: `j`) at which joints attach.
    outputs, inputs : CoordinateSet
        The M internal responses and the L internal inputs `a` (assembly: `n`). They may differ.

    Raises
    ------
    ValueError
        If a coordinate is both joint and internal, or there is no joint coordinate.
    """

    joint: CoordinateSet
    outputs: CoordinateSet
    inputs: CoordinateSet

    def __post_init__(self) -> None:
        if len(self.joint) == 0:
            msg = "the interface has no joint coordinate; at least one is needed"
            raise ValueError(msg)
        for name, internal in (("outputs", self.outputs), ("inputs", self.inputs)):
            both = [label for label in internal.labels if label in set(self.joint.labels)]
            if both:
                msg = (
                    f"{_names(both)} stands among the joint coordinates and the internal {name}; "
                    "a coordinate is either joint or internal"
                )
                raise ValueError(msg)


@dataclass(frozen=True, slots=True, eq=False)
class SubstructureFRF:
    """Hold the receptances of one or more uncoupled substructures.

    x_a = H_aa f_a + H_ab f_b,  x_b = H_ba f_a + H_bb f_b

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (3)-(4).

    Parameters
    ----------
    frequency : (n_freq,) array
        Lines [Hz], increasing.
    interface : Interface
        M internal outputs, L internal inputs, N joint coordinates.
    H_aa, H_ab, H_ba, H_bb : (n_freq, M, L), (n_freq, M, N), (n_freq, N, L), (n_freq, N, N) complex arrays
        Receptances x/f [m/N, rad/N, m/(N m), rad/(N m)], e^{+iωt}.
    expanded_by : str
        How coordinates that were not measured came in, `ExpandedFRF.method`; empty where none did.

    Raises
    ------
    ValueError
        If a shape does not fit the interface or a value is not finite.
    """

    frequency: Floats
    interface: Interface
    H_aa: Complexes
    H_ab: Complexes
    H_ba: Complexes
    H_bb: Complexes
    expanded_by: str = ""

    def __post_init__(self) -> None:
        frequency = as_frequency(self.frequency)
        joint, outputs, inputs = (
            self.interface.joint.labels,
            self.interface.outputs.labels,
            self.interface.inputs.labels,
        )
        object.__setattr__(self, "frequency", frozen_copy(frequency))
        for name, rows, columns in (
            ("H_aa", outputs, inputs),
            ("H_ab", outputs, joint),
            ("H_ba", joint, inputs),
            ("H_bb", joint, joint),
        ):
            block = as_lines(getattr(self, name), name, frequency, rows, columns)
            object.__setattr__(self, name, frozen_copy(block))


def partition_frf(
    frequency: npt.ArrayLike,
    H: npt.ArrayLike,
    outputs: CoordinateSet,
    inputs: CoordinateSet,
    interface: Interface,
    expanded_by: str = "",
) -> SubstructureFRF:
    """Pick the blocks of an interface out of one receptance array.

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    H : (n_freq, n_out, n_in) array_like
        Receptances x/f between all outputs and all inputs, SI units, e^{+iωt}.
    outputs, inputs : CoordinateSet
        Coordinates of the rows and the columns of `H`. Both must hold the joint coordinates.
    interface : Interface
        Coordinates to pick, in this order.
    expanded_by : str
        How coordinates that were not measured came in.

    Returns
    -------
    SubstructureFRF

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite, or the interface names a coordinate `H` lacks.
    """
    lines = as_frequency(frequency)
    array = as_lines(H, "H", lines, outputs.labels, inputs.labels)
    row_a, row_b = (outputs.positions(part.labels) for part in (interface.outputs, interface.joint))
    col_a, col_b = (inputs.positions(part.labels) for part in (interface.inputs, interface.joint))
    every = np.arange(lines.size)
    return SubstructureFRF(
        lines,
        interface,
        H_aa=array[np.ix_(every, row_a, col_a)],
        H_ab=array[np.ix_(every, row_a, col_b)],
        H_ba=array[np.ix_(every, row_b, col_a)],
        H_bb=array[np.ix_(every, row_b, col_b)],
        expanded_by=expanded_by,
    )


def stack_substructures(*substructures: SubstructureFRF) -> SubstructureFRF:
    """Place substructures side by side, not yet joined.

    H_aa = diag(H_aa^1, H_aa^2, ...), and likewise H_ab, H_ba and H_bb.

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (2)-(4), for any number of substructures. Coordinates keep
    the order in which the substructures are given.

    Parameters
    ----------
    *substructures : SubstructureFRF
        One or more, on the same frequency lines, with different labels.

    Returns
    -------
    SubstructureFRF
        Receptances between different substructures are zero.

    Raises
    ------
    ValueError
        If there is none, the lines differ, or a label occurs in two substructures.
    """
    if not substructures:
        msg = "no substructure given; at least one is needed"
        raise ValueError(msg)
    first = substructures[0]
    for number, other in enumerate(substructures[1:], start=1):
        check_same_lines(other.frequency, first.frequency, f"substructure {number}", "substructure 0")
    parts = [substructure.interface for substructure in substructures]
    interface = Interface(
        joint=_joined(part.joint for part in parts),
        outputs=_joined(part.outputs for part in parts),
        inputs=_joined(part.inputs for part in parts),
    )
    return SubstructureFRF(
        first.frequency,
        interface,
        H_aa=_block_diagonal([substructure.H_aa for substructure in substructures]),
        H_ab=_block_diagonal([substructure.H_ab for substructure in substructures]),
        H_ba=_block_diagonal([substructure.H_ba for substructure in substructures]),
        H_bb=_block_diagonal([substructure.H_bb for substructure in substructures]),
        expanded_by=", ".join(dict.fromkeys(s.expanded_by for s in substructures if s.expanded_by)),
    )


def stack_joints(joint: CoordinateSet, blocks: Sequence[tuple[CoordinateSet, npt.ArrayLike]]) -> Complexes:
    """Place the dynamic stiffness of each joint at its coordinates.

    Z_j is block-diagonal by joint: Soleimanian, Tizfahm & Sadeghi (2011), eq. (5). A joint that holds nodes
    of several substructures finds its coordinates by label, wherever the substructures' order put them.

    Parameters
    ----------
    joint : CoordinateSet
        All N joint coordinates, in the order wanted (that of the stacked substructures).
    blocks : sequence of (CoordinateSet, (n_freq, n, n) array_like)
        Each joint's coordinates and dynamic stiffness f/x [N/m, N/rad, N m/m, N m/rad].

    Returns
    -------
    (n_freq, N, N) complex array

    Raises
    ------
    ValueError
        If a coordinate belongs to no joint or to two, or a block does not fit its coordinates.
    """
    jointed = [label for coordinates, _ in blocks for label in coordinates.labels]
    if repeated := _repeated(jointed):
        msg = f"{_names(repeated)} belongs to two joints; add their stiffness in one joint"
        raise ValueError(msg)
    if free := [label for label in joint.labels if label not in set(jointed)]:
        msg = f"{_names(free)} belongs to no joint; leave it internal or give its joint a zero block"
        raise ValueError(msg)
    arrays = [np.asarray(block, dtype=complex) for _, block in blocks]
    n_freq = arrays[0].shape[0] if arrays[0].ndim == 3 else 0
    Z = np.zeros((n_freq, len(joint), len(joint)), dtype=complex)
    for number, ((coordinates, _), block) in enumerate(zip(blocks, arrays, strict=True)):
        shape = (n_freq, len(coordinates), len(coordinates))
        if block.shape != shape or n_freq == 0:
            msg = (
                f"joint {number} has an array of shape {block.shape}; (n_freq, {shape[1]}, {shape[2]}) is "
                "needed, with one n_freq for all joints"
            )
            raise ValueError(msg)
        places = joint.positions(coordinates.labels)
        Z[np.ix_(np.arange(n_freq), places, places)] = block
    return Z


def _joined(sets: Iterable[CoordinateSet]) -> CoordinateSet:
    return CoordinateSet(tuple(label for coordinates in sets for label in coordinates.labels))


def _block_diagonal(blocks: Sequence[Complexes]) -> Complexes:
    rows = np.cumsum([0] + [block.shape[1] for block in blocks])
    columns = np.cumsum([0] + [block.shape[2] for block in blocks])
    full = np.zeros((blocks[0].shape[0], rows[-1], columns[-1]), dtype=complex)
    for i, block in enumerate(blocks):
        full[:, rows[i] : rows[i + 1], columns[i] : columns[i + 1]] = block
    return full


def _repeated(labels: Sequence[str]) -> list[str]:
    seen: set[str] = set()
    return [label for label in labels if label in seen or seen.add(label)]


def _names(labels: Sequence[str], limit: int = 6) -> str:
    shown = ", ".join(labels[:limit])
    return shown if len(labels) <= limit else f"{shown} and {len(labels) - limit} more"
