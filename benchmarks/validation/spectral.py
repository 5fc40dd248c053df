"""Exact FRFs of frames: the dynamic stiffness of uniform members in closed form, line by line.

Nothing of :mod:`fem` is used here, so that a search can be tested against effects outside its own elements.
The differential equations of a Timoshenko beam, a rod and a shaft are solved exactly; there is no mesh, and
nothing but rounding to converge. The method is that of Howson & Williams, J. Sound and Vibration 26 (1973)
503-515, and Doyle, Wave Propagation in Structures, 1997; the form used here is derived in :func:`beam`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Law = Callable[[NDArray[np.float64]], Array]
"""From ω (n,) [rad/s] to the complex factors of a stiffness, (n,), or (n, 6) for each direction.

An entry between two directions has the square root of both factors.
"""

_LINES_AT_ONCE = 256


class SpectralError(ValueError):
    """A frame that cannot be assembled; the message names the place."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A uniform piece of a member between two nodes."""

    nodes: tuple[int, int]
    ends: NDArray[np.float64]  # (2, 3) where its two ends are; rigid arms lead there from the nodes [m]
    axes: NDArray[np.float64]  # (3, 3) local x (along it), y and z as rows
    EA: complex  # [N, N·m²]; Iy is of bending in x-z, kGAz of shear along z
    GJ: complex
    EIy: complex
    EIz: complex
    kGAy: complex
    kGAz: complex
    mass: NDArray[np.float64]  # (3,) mass per length that moves along local x, y, z [kg/m]
    inertia: NDArray[np.float64]  # (3,) rotary inertia per length about local x, y, z [kg·m]
    tension: float = 0.0  # axial force, positive in tension [N]
    alpha: float = 0.0  # Rayleigh damping of this piece, C = alpha M + beta K [1/s, s]
    beta: float = 0.0

    @property
    def length(self) -> float:
        """Length of the flexible piece [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """Connection of a second node to a first one, or to the ground, at a place.

    The second node's motion relative to the first, both carried to ``location``, is zero in the directions
    of ``rigid`` and resisted by law(ω) K + iωC in the others, exactly.
    """

    first: int | None  # node, or None for the ground
    second: int  # node whose six coordinates are replaced by those of the first and the relative motions
    location: NDArray[np.float64]  # (3,) [m]
    axes: NDArray[np.float64]  # (3, 3) directions as rows
    rigid: tuple[bool, ...]  # for x y z rx ry rz
    K: Array  # (6, 6) [N/m and with rotations], C likewise
    C: Array
    law: Law | None = None  # factor of K; 1 for None
    # (3,) where the first node's rigid arm ends; at the location for None [m]
    from_first: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body, springs or dashpots to ground at a place that a node carries."""

    node: int
    location: NDArray[np.float64]  # (3,) [m]
    M: Array  # (6, 6) in global directions; C may be unsymmetric, as of a spinning wheel
    C: Array
    K: Array
    law: Law | None = None  # complex factor of `K`; 1 for None


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """A place and direction where motion is read or a force acts."""

    direction: NDArray[np.float64]  # (3,)
    segment: int | None = None  # segment that it is on, or None at a node
    fraction: float = 0.0  # part of the segment's length from its first end [-]
    node: int | None = None  # node, for those that are not on a segment
    # (3,) where it is if a rigid arm leads there from the node; the node itself for None [m]
    location: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SpectralFrame:
    """Nodes, and the pieces between and on them."""

    nodes: NDArray[np.float64]  # (n, 3) coordinates [m]
    segments: tuple[Segment, ...]
    connections: tuple[Connection, ...] = ()
    bodies: tuple[Body, ...] = ()


def carry(arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rigid-body map (6, 6) to a place at an arm [m]: u' = u + θ × arm."""
    x, y, z = arm
    out = np.eye(6)
    out[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return out


# ------------------------------------------------------------------------------------------- members


@dataclass(frozen=True, slots=True, eq=False)
class _Waves:
    """Half of the waves of a beam at each line: exponents λ with Re λ ≥ 0, and ψ = a w for e^{λx}."""

    exponent: Array  # (2, n)
    slope: Array  # (2, n)
    L: float

    @property
    def tanh(self) -> Array:
        """Return tanh(λL/2)."""
        z = self.exponent * self.L
        return -np.expm1(-z) / (1 + np.exp(-z))

    def at(self, x: float) -> tuple[Array, Array]:
        """Return cosh(λx) and sinh(λx) over cosh(λL/2), -L/2 ≤ x ≤ L/2."""
        z, half = self.exponent, self.L / 2
        plus, minus, below = np.exp(z * (x - half)), np.exp(-z * (x + half)), 1 + np.exp(-z * self.L)
        return (plus + minus) / below, (plus - minus) / below


def _beam_waves(omega: Array, L: float, kGA: Array, EI: Array, m: Array, j: Array, N: float) -> _Waves:
    a = (kGA + N) * EI
    b = -kGA * N + (kGA + N) * omega**2 * j + omega**2 * m * EI
    c = omega**2 * m * (omega**2 * j - kGA)
    root = np.sqrt(b**2 - 4 * a * c + 0j)
    q = -(b + np.where(np.real(np.conj(b) * root) >= 0, root, -root)) / 2
    exponent = np.sqrt(np.stack([q / a, c / q]))  # the principal root has Re ≥ 0
    slope = ((kGA + N) * exponent**2 + omega**2 * m) / (kGA * exponent)
    return _Waves(exponent, slope, L)


def _amplitudes(waves: _Waves) -> tuple[Array, Array]:
    """Return the amplitudes of the even and the odd waves, (2, 2, n), for unit (w, ψ) at the far end."""
    (t1, t2), (a1, a2) = waves.tanh, waves.slope
    even = np.stack([[a2 * t2, -np.ones_like(t1)], [-a1 * t1, np.ones_like(t1)]]) / (a2 * t2 - a1 * t1)
    odd = np.stack([[a2, -t2], [-a1, t1]]) / (t1 * a2 - t2 * a1)
    return even, odd


def beam(omega: Array, L: float, kGA: Array, EI: Array, m: Array, j: Array, N: float = 0.0) -> Array:
    """Return the dynamic stiffness of a Timoshenko beam in one plane for (w, ψ) at both ends, (n, 4, 4).

    With ψ the rotation of the section, w' = ψ + shear strain, and an axial force N,

        (kGA (w' - ψ))' + N w'' + ω² m w = 0,      (EI ψ')' + kGA (w' - ψ) + ω² j ψ = 0

    have solutions e^{λx} with (kGA + N) EI λ⁴ + (ω² j (kGA + N) + ω² m EI - kGA N) λ² + ω² m (ω² j - kGA) = 0
    and ψ = ((kGA + N) λ² + ω² m) / (kGA λ) w. About the middle the even solutions w = A₁ cosh λ₁x + A₂ cosh
    λ₂x and the odd ones separate, so that a 2×2 system in closed form gives each; with cosh(λL/2) divided
    out, nothing overflows. End forces are Q = kGA (w' - ψ) + N w' and M = EI ψ'.

    Parameters
    ----------
    omega : ndarray (n,)
        [rad/s].
    L : float
        [m].
    kGA, EI, m, j : ndarray (n,) or number
        Shear stiffness [N], bending stiffness [N·m²], mass [kg/m] and rotary inertia [kg·m] per length.
    N : float
        Tension [N].
    """
    waves = _beam_waves(omega, L, kGA, EI, m, j, N)
    even, odd = _amplitudes(waves)
    lam, a, t = waves.exponent, waves.slope, waves.tanh
    shear = (kGA + N) * lam - kGA * a
    n = omega.size
    Z = np.zeros((n, 4, 4), dtype=complex)
    force_even = np.stack([(shear * t)[:, None] * even, (EI * a * lam)[:, None] * even]).sum(axis=1)
    force_odd = np.stack([shear[:, None] * odd, (EI * a * lam * t)[:, None] * odd]).sum(axis=1)
    e, o = np.moveaxis(force_even, -1, 0) / 2, np.moveaxis(force_odd, -1, 0) / 2
    # Even: w₊ = w₋, ψ₊ = -ψ₋, Q₋ = Q₊, M₋ = -M₊ in the sense of forces on the ends; odd: the opposite.
    flip = np.array([1.0, -1.0])
    Z[:, 2:, 2:] = e + o
    Z[:, 2:, :2] = e * flip - o * flip
    Z[:, :2, 2:] = flip[:, None] * (e - o)
    Z[:, :2, :2] = flip[:, None] * (e + o) * flip
    return Z


def rod(omega: Array, L: float, EA: Array, m: Array) -> Array:
    """Return the dynamic stiffness of a rod, or with GJ and the polar inertia of a shaft, (n, 2, 2).

    EA u'' + ω² m u = 0: the ends' forces are EA λ tanh(λL/2) times the even half of the motion and
    EA λ / tanh(λL/2) times the odd one, λ = iω √(m/EA).
    """
    waves = _Waves(_rod_exponent(omega, EA, m)[None], np.zeros((1, omega.size)), L)
    lam, t = waves.exponent[0], waves.tanh[0]
    e, o = EA * lam * t / 2, EA * lam / t / 2
    return np.moveaxis(np.array([[e + o, e - o], [e - o, e + o]]), -1, 0)


def _rod_exponent(omega: Array, EA: Array, m: Array) -> Array:
    lam = 1j * omega * np.sqrt(m / EA + 0j)
    return np.where(lam.real >= 0, lam, -lam)


_X, _RX = [0, 6], [3, 9]
_XZ, _XY = [2, 4, 8, 10], [1, 5, 7, 11]
_SIGN = np.array([1.0, -1.0, 1.0, -1.0])
"""ψ = w' is -θy in x-z and θz in x-y."""


def _damped(s: Segment, omega: Array) -> tuple[Array, Array]:
    return 1 + 1j * omega * s.beta, 1 - 1j * s.alpha / omega


def segment_stiffness(s: Segment, omega: Array) -> Array:
    """Return the dynamic stiffness of a piece in local axes, (n, 12, 12)."""
    k, m = _damped(s, omega)
    Z = np.zeros((omega.size, 12, 12), dtype=complex)
    L, N = s.length, s.tension
    Z[np.ix_(range(omega.size), _X, _X)] = rod(omega, L, k * s.EA, m * s.mass[0])
    Z[np.ix_(range(omega.size), _RX, _RX)] = rod(omega, L, k * s.GJ, m * s.inertia[0])
    xz = beam(omega, L, k * s.kGAz, k * s.EIy, m * s.mass[2], m * s.inertia[1], N)
    Z[np.ix_(range(omega.size), _XZ, _XZ)] = _SIGN[:, None] * xz * _SIGN
    xy = beam(omega, L, k * s.kGAy, k * s.EIz, m * s.mass[1], m * s.inertia[2], N)
    Z[np.ix_(range(omega.size), _XY, _XY)] = xy
    return Z


def segment_shape(s: Segment, omega: Array, fraction: float) -> Array:
    """Return the local translations within a piece from its ends' motion, (n, 3, 12), exactly."""
    k, m = _damped(s, omega)
    L, x = s.length, (fraction - 0.5) * s.length
    N = np.zeros((omega.size, 3, 12), dtype=complex)
    waves = _Waves(_rod_exponent(omega, k * s.EA, m * s.mass[0])[None], np.zeros((1, omega.size)), L)
    (c,), (h,) = waves.at(x)
    odd = h / waves.tanh[0]
    N[:, 0, _X[1]], N[:, 0, _X[0]] = (c + odd) / 2, (c - odd) / 2
    for row, columns, sign, kGA, EI, m_, j in (
        (2, _XZ, _SIGN, s.kGAz, s.EIy, s.mass[2], s.inertia[1]),
        (1, _XY, np.ones(4), s.kGAy, s.EIz, s.mass[1], s.inertia[2]),
    ):
        waves = _beam_waves(omega, L, k * kGA, k * EI, m * m_, m * j, s.tension)
        even, odd = _amplitudes(waves)
        cosh, sinh = waves.at(x)
        e, o = (cosh[:, None] * even).sum(axis=0) / 2, (sinh[:, None] * odd).sum(axis=0) / 2  # (2, n)
        part = np.stack([e[0] - o[0], -e[1] + o[1], e[0] + o[0], e[1] + o[1]], axis=1)
        N[:, row, columns] = part * sign
    return N


# ------------------------------------------------------------------------------------------ assembly


def coordinates(frame: SpectralFrame) -> tuple[NDArray[np.float64], dict[int, NDArray[np.int64]]]:
    """Return T with u = T q, (6 n_nodes, n_q), and each connection's relative motions within q.

    Raises
    ------
    SpectralError
        If a node is the second one of two connections, or connections run in a circle.
    """
    by_second: dict[int, int] = {}
    for i, c in enumerate(frame.connections):
        if c.second in by_second:
            msg = f"node {c.second} is the second node of connections {by_second[c.second]} and {i}"
            raise SpectralError(msg)
        by_second[c.second] = i
    n = len(frame.nodes)
    extra: dict[int, NDArray[np.int64]] = {}
    relative: dict[int, NDArray[np.int64]] = {}
    n_q = 0
    for node in range(n):
        i = by_second.get(node)
        size = 6 if i is None else 6 - sum(frame.connections[i].rigid)
        place = np.arange(n_q, n_q + size)
        if i is None:
            extra[node] = place
        else:
            relative[i] = place
        n_q += size
    rows: dict[int, NDArray[np.float64]] = {}

    def row(node: int, above: tuple[int, ...] = ()) -> NDArray[np.float64]:
        if node in above:
            msg = f"the connections of nodes {above} run in a circle"
            raise SpectralError(msg)
        if node not in rows:
            T = np.zeros((6, n_q))
            if node in extra:
                T[:, extra[node]] = np.eye(6)
            else:
                c = frame.connections[by_second[node]]
                if c.first is not None:
                    place = c.location if c.from_first is None else c.from_first
                    T += carry(place - frame.nodes[c.first]) @ row(c.first, (*above, node))
                free = [d for d in range(6) if not c.rigid[d]]
                T[:, relative[by_second[node]]] += np.kron(np.eye(2), c.axes).T[:, free]
                T = carry(frame.nodes[node] - c.location) @ T
            rows[node] = T
        return rows[node]

    return np.vstack([row(node) for node in range(n)]), relative


def _segment_map(frame: SpectralFrame, s: Segment) -> NDArray[np.float64]:
    R = np.kron(np.eye(2), s.axes)
    out = np.zeros((12, 12))
    for k in range(2):
        out[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = R @ carry(s.ends[k] - frame.nodes[s.nodes[k]])
    return out


def _dofs(nodes: Sequence[int]) -> NDArray[np.int64]:
    return (6 * np.asarray(nodes)[:, None] + np.arange(6)).ravel()


def _projected(block: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    columns = np.flatnonzero(np.any(block, axis=0))
    return columns, block[:, columns]


def receptance(
    frame: SpectralFrame, frequency: NDArray[np.float64], responses: Sequence[Probe], forces: Sequence[Probe]
) -> NDArray[np.complex128]:
    """Return the receptances of a frame, (n_freq, n_out, n_in) [m/N].

    Parameters
    ----------
    frame : SpectralFrame
    frequency : ndarray (n_freq,)
        Above zero [Hz].
    responses, forces : sequence of Probe
        Forces act at nodes.

    Raises
    ------
    SpectralError
        For a force between nodes, or frequencies that are not above zero.
    """
    if any(p.node is None for p in forces):
        msg = "a force acts between nodes; put a node where it acts"
        raise SpectralError(msg)
    if not (np.asarray(frequency) > 0).all():
        msg = f"the lowest frequency is {np.min(frequency):g} Hz; all must be above 0"
        raise SpectralError(msg)
    assembly = Assembly.of(frame, (*responses, *forces))
    F = np.stack([assembly.at_node[id(p)] for p in forces], axis=1)
    out = np.empty((len(frequency), len(responses), len(forces)), dtype=complex)
    for start in range(0, len(frequency), _LINES_AT_ONCE):
        omega = 2 * np.pi * np.asarray(frequency[start : start + _LINES_AT_ONCE], dtype=float)
        Z = assembly.stiffness(omega)
        q = np.linalg.solve(Z, np.broadcast_to(F, (omega.size, *F.shape)).astype(complex))
        for i, p in enumerate(responses):
            out[start : start + omega.size, i] = (assembly.row(p, omega) @ q)[:, 0]
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A frame with the maps of its pieces, ready for any frequency."""

    frame: SpectralFrame
    T: NDArray[np.float64]  # (6 n_nodes, n_q)
    relative: dict[int, NDArray[np.int64]]  # relative motions of each connection within q
    # columns of q and the motion of each segment's ends, and of each body, by them
    maps: list[tuple[NDArray[np.int64], NDArray[np.float64]]]
    bodies: list[tuple[NDArray[np.int64], NDArray[np.float64]]]
    at_node: dict[int, NDArray[np.float64]]  # rows of the probes at nodes, by their ids

    @classmethod
    def of(cls, frame: SpectralFrame, probes: Sequence[Probe]) -> "Assembly":
        """Return the maps of a frame and of some probes."""
        T, relative = coordinates(frame)
        maps = [_projected(_segment_map(frame, s) @ T[_dofs(s.nodes)]) for s in frame.segments]
        bodies = [
            _projected(carry(b.location - frame.nodes[b.node]) @ T[_dofs([b.node])]) for b in frame.bodies
        ]
        at_node = {
            id(p): p.direction @ (_arm(frame, p) @ T[_dofs([p.node])])[:3]
            for p in probes
            if p.node is not None
        }
        return cls(frame, T, relative, maps, bodies, at_node)

    def stiffness(self, omega: Array) -> Array:
        """Return the dynamic stiffness (n, n_q, n_q) [N/m]."""
        frame, n_q = self.frame, self.T.shape[1]
        Z = np.zeros((omega.size, n_q, n_q), dtype=complex)
        for s, (columns, P) in zip(frame.segments, self.maps, strict=True):
            Z[:, columns[:, None], columns] += P.T @ segment_stiffness(s, omega) @ P
        for i, c in enumerate(frame.connections):
            free = [d for d in range(6) if not c.rigid[d]]
            Z_joint = _factor(c.law, omega) * c.K + 1j * omega[:, None, None] * c.C
            Z[:, self.relative[i][:, None], self.relative[i]] += Z_joint[:, free][:, :, free]
        for b, (columns, P) in zip(frame.bodies, self.bodies, strict=True):
            w = omega[:, None, None]
            Z[:, columns[:, None], columns] += (
                P.T @ (_factor(b.law, omega) * b.K + 1j * w * b.C - w**2 * b.M) @ P
            )
        return Z

    def row(self, p: Probe, omega: Array) -> Array:
        """Return what a probe reads of q, (n or 1, 1, n_q)."""
        if p.segment is None:
            return self.at_node[id(p)][None, None]
        s, (columns, P) = self.frame.segments[p.segment], self.maps[p.segment]
        row = (s.axes @ p.direction) @ segment_shape(s, omega, p.fraction) @ P
        out = np.zeros((omega.size, 1, self.T.shape[1]), dtype=complex)
        out[:, 0, columns] = row
        return out


def _factor(law: Law | None, omega: Array) -> Array:
    if law is None:
        return np.ones((1, 1, 1))
    factor = law(omega)
    if factor.ndim == 1:
        return factor[:, None, None]
    root = np.sqrt(factor + 0j)
    return root[:, :, None] * root[:, None, :]


def _arm(frame: SpectralFrame, p: Probe) -> NDArray[np.float64]:
    assert p.node is not None
    return np.eye(6) if p.location is None else carry(p.location - frame.nodes[p.node])
