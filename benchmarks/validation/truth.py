"""Frames as the truth has them: members and attached parts, cut into exact pieces."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.spectral import Body, Connection, Law, Probe, Segment, SpectralFrame, receptance

Array = NDArray[Any]
RIGID = (True,) * 6


def _zeros() -> Array:
    return np.zeros((6, 6))


@dataclass(frozen=True, slots=True)
class Cut:
    """A place on a member: arc length from its first end [m]."""

    member: str
    position: float


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A part of a member that differs from the rest."""

    start: float  # arc lengths [m]
    stop: float
    E: float = 1.0  # factor of all stiffnesses [-]
    loss: float = 0.0  # loss factor in addition [-]
    mass: float = 0.0  # mass per length in addition, without rotary inertia [kg/m]


@dataclass(frozen=True, slots=True, eq=False)
class EndSpring:
    """One local direction of a member's end, or of a place within it, that is held by a spring."""

    position: float  # arc length [m]: 0, the length, or between for a crack
    direction: int  # of local x y z rx ry rz
    stiffness: float  # [N/m or N·m/rad]


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    """A straight member."""

    first: NDArray[np.float64]  # (3,) its ends [m]
    second: NDArray[np.float64]
    b: float  # width along local y, and height along local z, of its rectangle [m]
    h: float
    E: float  # [Pa]
    nu: float
    rho: float  # [kg/m³]
    loss: float  # loss factor [-]
    torsion: float = 1.0  # factor of the torsion constant [-]
    tension: float = 0.0  # [N]
    # mass per length in addition that moves along local y and along local z alone [kg/m]
    fluid: tuple[float, float] = (0.0, 0.0)
    zone1: float = 0.0  # lengths of rigid end zones [m]
    zone2: float = 0.0
    stretches: tuple[Stretch, ...] = ()  # not overlapping
    springs: tuple[EndSpring, ...] = ()

    @property
    def length(self) -> float:
        """Length from end to end [m]."""
        return float(np.linalg.norm(self.second - self.first))

    @property
    def mass(self) -> float:
        """Mass without additions [kg]."""
        return self.rho * self.b * self.h * self.length

    @property
    def axes(self) -> NDArray[np.float64]:
        """Local axes as rows: x along it, z in the plane of x and global Z (X for vertical members)."""
        x = (self.second - self.first) / self.length
        up = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < np.cos(np.radians(1.0)) else np.array([1.0, 0.0, 0.0])
        y = np.cross(up, x)
        y /= np.linalg.norm(y)
        return np.stack([x, y, np.cross(x, y)])

    def place(self, position: float) -> NDArray[np.float64]:
        """Return the coordinates of a position [m]."""
        return self.first + (self.second - self.first) * position / self.length


@dataclass(frozen=True, slots=True, eq=False)
class TrueJoint:
    """A joint between two members, or an elastic foot."""

    name: str
    first: Cut  # its sides; `second` is None for the ground
    second: Cut | None
    location: NDArray[np.float64]  # (3,) [m]
    K: Array  # (6, 6) stiffness of the elastic directions; C has dashpots, both sides share M
    rigid: tuple[bool, ...]
    C: Array = field(default_factory=_zeros)
    M: Array = field(default_factory=_zeros)
    law: Law | None = None  # complex factor of K
    # from the location to where each side's rigid arm ends, such as a hole beside the centre line [m]
    levers: tuple[NDArray[np.float64], NDArray[np.float64]] = field(
        default_factory=lambda: (np.zeros(3), np.zeros(3))
    )

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """Its sides on members."""
        return (self.first,) if self.second is None else (self.first, self.second)


@dataclass(frozen=True, slots=True, eq=False)
class TrueSupport:
    """A foot: a member's end that is held in the directions of ``rigid``, and by springs in the others."""

    name: str
    at: Cut
    rigid: tuple[bool, ...] = RIGID
    K: Array = field(default_factory=_zeros)
    C: Array = field(default_factory=_zeros)


@dataclass(frozen=True, slots=True, eq=False)
class Attached:
    """A body, springs or dashpots to ground at a place on a member, with an arm to where they act [m]."""

    at: Cut
    arm: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    M: Array = field(default_factory=_zeros)
    C: Array = field(default_factory=_zeros)
    K: Array = field(default_factory=_zeros)
    law: Law | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A sensor or exciter on a member: its place and direction."""

    name: str
    at: Cut
    direction: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class TrueFrame:
    """A frame as it really is."""

    members: dict[str, Member]  # ends at one place are welded
    joints: tuple[TrueJoint, ...] = ()
    supports: tuple[TrueSupport, ...] = ()
    attached: tuple[Attached, ...] = ()
    alpha: float = 0.0  # Rayleigh damping of all members [1/s, s]
    beta: float = 0.0

    def with_member(self, name: str, **changes: Any) -> "TrueFrame":
        """Return a frame with one member changed."""
        return replace(self, members={**self.members, name: replace(self.members[name], **changes)})

    def with_joint(self, name: str, **changes: Any) -> "TrueFrame":
        """Return a frame with one joint changed."""
        return replace(
            self, joints=tuple(replace(j, **changes) if j.name == name else j for j in self.joints)
        )

    def with_support(self, name: str, **changes: Any) -> "TrueFrame":
        """Return a frame with one support changed."""
        return replace(
            self, supports=tuple(replace(s, **changes) if s.name == name else s for s in self.supports)
        )

    def with_attached(self, *attached: Attached) -> "TrueFrame":
        """Return a frame with more on it."""
        return replace(self, attached=(*self.attached, *attached))

    def place(self, at: Cut) -> NDArray[np.float64]:
        """Return the coordinates of a place on a member [m]."""
        return self.members[at.member].place(at.position)

    def frf(
        self, frequency: NDArray[np.float64], sensors: Sequence[Reading], drives: Sequence[Reading]
    ) -> NDArray[np.complex128]:
        """Return exact receptances, (n_freq, n_out, n_in) [m/N]."""
        cutter = _Cutter(self, [d.at for d in drives])
        responses = [cutter.probe(s) for s in sensors]
        forces = [cutter.probe(d) for d in drives]
        return receptance(cutter.frame(), frequency, responses, forces)

    def pieces(self, cuts: Sequence[Cut], sensors: Sequence[Reading]) -> tuple[SpectralFrame, list[Probe]]:
        """Return the frame in exact pieces, with nodes at some cuts, and where sensors are on them."""
        cutter = _Cutter(self, cuts)
        return cutter.frame(), [cutter.probe(s) for s in sensors]


def rectangle_constants(b: float, h: float) -> tuple[float, float, float, float]:
    """Return A, Iy, Iz and J of a rectangle; J from the series of Timoshenko & Goodier, art. 109."""
    long, short = max(b, h), min(b, h)
    n = np.arange(1, 200, 2)
    J = (
        long
        * short**3
        * (1 / 3 - 64 / np.pi**5 * short / long * np.sum(np.tanh(n * np.pi * long / (2 * short)) / n**5))
    )
    return b * h, b * h**3 / 12, h * b**3 / 12, float(J)


SHEAR = 5 / 6
"""Shear coefficient of a rectangle (Reissner)."""


class _Cutter:
    """Cuts members where something sits, numbers the nodes, and collects pieces and connections."""

    def __init__(self, frame: TrueFrame, forces: Sequence[Cut]) -> None:
        self._frame = frame
        self._nodes: list[NDArray[np.float64]] = []
        self._corner: dict[tuple[float, ...], int] = {}
        self._node_at: dict[tuple[str, float], int] = {}
        self._pieces: list[tuple[str, float, float]] = []
        self._segments: list[Segment] = []
        self._bodies: list[Body] = []
        self._connections: list[Connection] = []
        cuts = [*forces, *(a.at for a in frame.attached), *(s.at for s in frame.supports)]
        cuts += [c for j in frame.joints for c in j.cuts]
        for name, member in frame.members.items():
            self._cut(name, member, [c.position for c in cuts if c.member == name])
        for j in frame.joints:
            nodes = [self._node(c) for c in j.cuts]
            ends = [j.location + lever for lever in j.levers[: len(nodes)]]
            first = None if j.second is None else nodes[0]
            self._connections.append(
                Connection(first, nodes[-1], ends[-1], np.eye(3), j.rigid, j.K, j.C, j.law, ends[0])
            )
            if j.M.any():
                self._bodies += [
                    Body(node, end, j.M / len(nodes), _zeros(), _zeros())
                    for node, end in zip(nodes, ends, strict=True)
                ]
        for s in frame.supports:
            node = self._node(s.at)
            self._connections.append(Connection(None, node, self._nodes[node], np.eye(3), s.rigid, s.K, s.C))
        for a in frame.attached:
            node = self._node(a.at)
            self._bodies.append(Body(node, self._nodes[node] + a.arm, a.M, a.C, a.K, a.law))

    def frame(self) -> SpectralFrame:
        """Return the pieces."""
        return SpectralFrame(
            np.array(self._nodes), tuple(self._segments), tuple(self._connections), tuple(self._bodies)
        )

    def probe(self, reading: Reading) -> Probe:
        """Return where a sensor or exciter is on the pieces."""
        name, position = reading.at.member, self._snap(reading.at)
        node = self._node_at.get((name, position))
        if node is not None:
            return Probe(reading.direction, node=node)
        member = self._frame.members[name]
        for inside, end in (
            (position < member.zone1, 0.0),
            (position > member.length - member.zone2, member.length),
        ):
            if inside:
                return Probe(
                    reading.direction, node=self._node_at[name, end], location=member.place(position)
                )
        for i, (of, start, stop) in enumerate(self._pieces):
            if of == name and start < position < stop:
                return Probe(reading.direction, segment=i, fraction=(position - start) / (stop - start))
        msg = f"no piece of member {name} holds position {position:g} m; it is {member.length:g} m long"
        raise ValueError(msg)

    def _snap(self, at: Cut) -> float:
        L = self._frame.members[at.member].length
        near = [p for of, p in self._node_at if of == at.member and abs(p - at.position) < 1e-9 * L]
        return near[0] if near else at.position

    def _node(self, at: Cut) -> int:
        return self._node_at[at.member, self._snap(at)]

    def _new(self, place: NDArray[np.float64]) -> int:
        self._nodes.append(place)
        return len(self._nodes) - 1

    def _end(self, place: NDArray[np.float64]) -> int:
        key = tuple(np.round(place, 9) + 0.0)
        if key not in self._corner:
            self._corner[key] = self._new(place)
        return self._corner[key]

    def _cut(self, name: str, m: Member, positions: Sequence[float]) -> None:
        L, axes = m.length, m.axes
        inner = [*positions, *(p for s in m.stretches for p in (s.start, s.stop))]
        inner += [s.position for s in m.springs]
        stops = [0.0]
        for p in sorted(inner):
            if p > stops[-1] + 1e-9 * L and p < L * (1 - 1e-9):
                stops.append(float(p))
        stops.append(L)
        springs = {
            min(range(len(stops)), key=lambda i, s=s: abs(stops[i] - s.position)): s for s in m.springs
        }
        before: list[int] = []  # node that ends the piece before a stop, and the one that begins the next
        after: list[int] = []
        for i, p in enumerate(stops):
            place = m.place(p)
            node = self._end(place) if i in (0, len(stops) - 1) else self._new(place)
            self._node_at[name, p] = node
            other = node
            if i in springs:
                other = self._new(place)
                d = springs[i].direction
                K = _zeros()
                K[d, d] = springs[i].stiffness
                rigid = tuple(k != d for k in range(6))
                self._connections.append(Connection(node, other, place, axes, rigid, K, _zeros()))
            # At the last stop the piece before it hangs on the spring; elsewhere the piece after it.
            last = i == len(stops) - 1
            before.append(other if last else node)
            after.append(other)
        for i, (start, stop) in enumerate(pairwise(stops)):
            begin, end = max(start, m.zone1), min(stop, L - m.zone2)
            self._pieces.append((name, begin, end))
            nodes = (after[i], before[i + 1])
            self._segments.append(self._segment(m, nodes, begin, end, axes))
            for zone_start, zone_stop, node in ((start, begin, nodes[0]), (end, stop, nodes[1])):
                if zone_stop > zone_start:
                    self._bodies += self._zone(m, zone_start, zone_stop, node)

    def _segment(self, m: Member, nodes: tuple[int, int], start: float, stop: float, axes: Array) -> Segment:
        A, Iy, Iz, J = rectangle_constants(m.b, m.h)
        middle = (start + stop) / 2
        part = next((s for s in m.stretches if s.start < middle < s.stop), Stretch(0.0, 0.0))
        E = m.E * part.E * (1 + 1j * (m.loss + part.loss))
        G = E / (2 * (1 + m.nu))
        mass = np.full(3, m.rho * A + part.mass)
        mass[1:] += m.fluid
        return Segment(
            nodes,
            np.stack([m.place(start), m.place(stop)]),
            axes,
            E * A,
            G * J * m.torsion,
            E * Iy,
            E * Iz,
            SHEAR * G * A,
            SHEAR * G * A,
            mass,
            m.rho * np.array([Iy + Iz, Iy, Iz]),
            m.tension,
            self._frame.alpha,
            self._frame.beta,
        )

    def _zone(self, m: Member, start: float, stop: float, node: int) -> list[Body]:
        """Return a rigid zone's mass; two Gauss points are exact for products of linear motions."""
        A, Iy, Iz, _ = rectangle_constants(m.b, m.h)
        R = m.axes
        M = np.zeros((6, 6))
        M[:3, :3] = m.rho * A * np.eye(3)
        M[3:, 3:] = m.rho * R.T @ np.diag([Iy + Iz, Iy, Iz]) @ R
        middle, half = (start + stop) / 2, (stop - start) / 2
        return [
            Body(node, m.place(middle + s * half / np.sqrt(3)), half * M, _zeros(), _zeros()) for s in (-1, 1)
        ]


def rigid_body(mass: float, inertia: float = 0.0) -> Array:
    """Return the matrix of a rigid body: mass [kg] and one moment of inertia about all axes [kg·m²]."""
    return np.diag([mass] * 3 + [inertia] * 3)
