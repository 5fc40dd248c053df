"""Line meshes: points, two-node lines, and members, which are named chains of lines.

A position on a member is an arc length in metres from its first end, so that sensors, joints and effects keep
their place when the mesh is refined.
"""

from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain, islice
from itertools import count as numbers_from
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from fem.chains import chains_of
from fem.recent import Recent
from fem.summary import counted, listed, summary

MOST_LINES = 5_000_000
"""Lines that a mesh is divided into at most; its matrices would take some ten GB."""
_KEPT = 10_000
"""Number of arrays that a mesh keeps, one for a member."""


class MeshError(ValueError):
    """An invalid mesh; the message names the place."""


class MeshWarning(UserWarning):
    """One warning with all omissions of a reader; the mesh keeps its sentences as ``notes``."""


@dataclass(frozen=True, slots=True)
class Location:
    """A place on a line of the mesh.

    Attributes
    ----------
    line : int
        Index of the line.
    xi : float
        Fraction of the line's length from its first point, 0 to 1 [-].
    """

    line: int
    xi: float


@dataclass(frozen=True, slots=True, eq=False)
class FileNumbers:
    """Numbers of nodes and elements in the file of a mesh, by their places.

    By places, as refined and merged meshes have other points and lines than the file.

    Attributes
    ----------
    nodes : ndarray of int (n,)
    points : ndarray (n, 3)
        Of the nodes [m].
    elements : ndarray of int (m,)
    ends : ndarray of int (m, 2)
        Rows of the nodes at both ends of each element.
    """

    nodes: Ints
    points: Floats
    elements: Ints
    ends: Ints

    def nearest_node(self, xyz: ArrayLike) -> tuple[int, float]:
        """Return the number of the node nearest to given coordinates, and its distance [m]."""
        distance = np.linalg.norm(self.points - np.asarray(xyz, dtype=float), axis=1)
        row = int(np.argmin(distance))
        return int(self.nodes[row]), float(distance[row])

    def element_at(self, xyz: ArrayLike, reach: float) -> tuple[int, tuple[int, int]] | None:
        """Return number and nodes of the element within ``reach`` [m] of coordinates; None without one."""
        a, b = self.points[self.ends[:, 0]], self.points[self.ends[:, 1]]
        xyz, t = np.asarray(xyz, dtype=float), b - a
        length = np.maximum(np.einsum("ij,ij->i", t, t), 1e-300)
        xi = np.clip(np.einsum("ij,ij->i", xyz - a, t) / length, 0.0, 1.0)
        distance = np.linalg.norm(a + xi[:, None] * t - xyz, axis=1)
        row = int(np.argmin(distance)) if len(distance) else 0
        if not len(distance) or distance[row] > reach:
            return None
        first, second = self.nodes[self.ends[row]].tolist()
        return int(self.elements[row]), (first, second)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A frame's lines in space.

    Attributes
    ----------
    points : ndarray (n_points, 3)
        Coordinates [m].
    lines : ndarray of int (n_lines, 2)
        Point indices, counted from 0, in the direction of the member they belong to.
    members : mapping of str to ndarray of int
        Line indices of each member, in order from its first end to its second.
    groups : mapping of str to tuple of str
        Names that stand for several members (a cell set that was split into chains, for example).
    point_names : mapping of str to int
        Names of points.
    notes : tuple of str
        Omissions and suspicions of the reader, a sentence each; changed copies keep them.
    numbers : FileNumbers or None
        Numbers of nodes and elements in the file; changed copies keep them.
    kept : Recent
        Arrays that follow from the mesh alone and are asked for many times: positions along members, and the
        pattern of its matrices. Changed copies have others.
    """

    points: Floats
    lines: Ints
    members: Mapping[str, Ints]
    groups: Mapping[str, tuple[str, ...]]
    point_names: Mapping[str, int]
    notes: tuple[str, ...] = ()
    numbers: FileNumbers | None = None
    kept: Recent = field(default_factory=lambda: Recent(_KEPT), init=False, repr=False)

    def __repr__(self) -> str:
        """Return points, lines, members and the size on one line."""
        size = " × ".join(f"{x:.4g}" for x in np.ptp(self.points, axis=0)) if len(self.points) else "0"
        members = f"{counted(len(self.members), 'member')} ({listed(self.members)})"
        lines = f"{counted(self.n_points, 'point')}, {counted(self.n_lines, 'line')}"
        return summary(self, f"{members}, {lines}, within {size} m")

    @classmethod
    def from_lines(
        cls,
        points: ArrayLike,
        lines: ArrayLike,
        sets: Mapping[str, ArrayLike] | None = None,
        point_names: Mapping[str, int] | None = None,
        notes: Iterable[str] = (),
    ) -> "Mesh":
        """Build a mesh from points and lines in any order and direction.

        Each set becomes a member. A set that branches or is in several pieces becomes one member for each
        chain, named ``set.1``, ``set.2``, …, and the set's name becomes a group. The lines that are in no set
        form the set ``"frame"``, or ``"frame.rest"`` where a set has that name. Names of chains pass over
        numbers that a set's name has taken.

        Parameters
        ----------
        points : array_like (n_points, 3)
            Coordinates [m].
        lines : array_like of int (n_lines, 2)
            Point indices, counted from 0.
        sets : mapping of str to array_like of int, optional
            Line indices of each set; no line may be in two sets.
        point_names : mapping of str to int, optional
            Names of points.
        notes : iterable of str, optional
            Omissions and suspicions of a reader.

        Raises
        ------
        MeshError
            For coordinates that are not finite, indices out of range, lines of zero length, or lines that
            are in two sets.
        """
        points = np.array(points, dtype=float, ndmin=2)
        lines = np.array(lines, dtype=np.int64, ndmin=2)
        _check_lines(points, lines)
        owner, names = _owners(sets or {}, len(lines))
        order, length, turned = chains_of(points, lines, owner)
        lines[turned] = lines[turned][:, ::-1]
        n_chains = np.bincount(owner[order[np.cumsum(length) - length]], minlength=len(names))
        chains = iter(_parts(order, length))
        taken = set(names)
        members: dict[str, Ints] = {}
        groups: dict[str, tuple[str, ...]] = {}
        for name, count in zip(names, n_chains.tolist(), strict=True):
            if count == 1:
                members[name] = next(chains)
            elif count:
                groups[name] = tuple(_numbered(name, count, taken))
                members.update((part, next(chains)) for part in groups[name])
        return cls._frozen(points, lines, members, groups, dict(point_names or {}), tuple(notes))

    @classmethod
    def of_points(cls, points: ArrayLike, point_names: Mapping[str, int] | None = None) -> "Mesh":
        """Build a mesh without lines, of points (n, 3) [m] that reduced parts and joints connect."""
        xyz = np.array(points, dtype=float).reshape(-1, 3)
        return cls._frozen(xyz, np.zeros((0, 2), dtype=np.int64), {}, {}, dict(point_names or {}), ())

    @classmethod
    def _frozen(
        cls,
        points: Floats,
        lines: Ints,
        members: Mapping[str, Ints],
        groups: Mapping[str, tuple[str, ...]],
        point_names: Mapping[str, int],
        notes: tuple[str, ...],
        numbers: FileNumbers | None = None,
    ) -> "Mesh":
        for array in (points, lines, *members.values()):
            array.flags.writeable = False
        return cls(
            points,
            lines,
            MappingProxyType(dict(members)),
            MappingProxyType(dict(groups)),
            MappingProxyType(dict(point_names)),
            notes,
            numbers,
        )

    def _changed(
        self, points: Floats, lines: Ints, members: Mapping[str, Ints], names: Mapping[str, int]
    ) -> "Mesh":
        return self._frozen(points, lines, members, self.groups, names, self.notes, self.numbers)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def n_lines(self) -> int:
        """Number of lines."""
        return len(self.lines)

    @property
    def size(self) -> float:
        """Largest extent along a coordinate axis [m]."""
        return float(np.ptp(self.points, axis=0).max())

    def lengths(self) -> Floats:
        """Return the length of each line, shape (n_lines,) [m]."""
        return np.linalg.norm(self.points[self.lines[:, 1]] - self.points[self.lines[:, 0]], axis=1)

    def members_of(self, name: str) -> tuple[str, ...]:
        """Return the members that a member's or a group's name stands for.

        Raises
        ------
        MeshError
            If neither a member nor a group has the name.
        """
        if name in self.members:
            return (name,)
        if name in self.groups:
            return self.groups[name]
        known = ", ".join([*self.members, *self.groups])
        msg = f"there is no member or group '{name}'; the mesh has {known}"
        raise MeshError(msg)

    def member_points(self, name: str) -> Ints:
        """Return the point indices along a member, shape (n_lines_of_member + 1,)."""
        (member,) = self.members_of(name) if name in self.members else self._single(name)
        lines = self.lines[self.members[member]]
        return np.concatenate([lines[:, 0], lines[-1:, 1]])

    def _single(self, name: str) -> tuple[str]:
        found = self.members_of(name)
        if len(found) != 1:
            msg = f"'{name}' stands for {len(found)} members ({', '.join(found)}); name one of them"
            raise MeshError(msg)
        return (found[0],)

    def member_positions(self, name: str) -> Floats:
        """Return the arc length of each of a member's points from its first end [m]; the mesh keeps it."""
        return self.kept.get(("positions", name), lambda: self._positions(name))

    def _positions(self, name: str) -> Floats:
        chain = self.points[self.member_points(name)]
        steps = np.linalg.norm(np.diff(chain, axis=0), axis=1)
        positions = np.concatenate([[0.0], np.cumsum(steps)])
        positions.flags.writeable = False
        return positions

    def member_length(self, name: str) -> float:
        """Return the length of a member [m]."""
        return float(self.member_positions(name)[-1])

    def locate(self, member: str, position: float) -> Location:
        """Find the line and the fraction of it at an arc length along a member.

        Parameters
        ----------
        member : str
            Name of a member.
        position : float
            Arc length from the member's first end [m].

        Raises
        ------
        MeshError
            If the position lies outside the member.
        """
        (name,) = self._single(member)
        s = self.member_positions(name)
        slack = 1e-6 * s[-1]
        if not -slack <= position <= s[-1] + slack:
            msg = f"position {position:g} m lies outside member '{name}', which is 0 to {s[-1]:g} m long"
            raise MeshError(msg)
        k = int(np.clip(np.searchsorted(s, position, side="right") - 1, 0, len(s) - 2))
        xi = float(np.clip((position - s[k]) / (s[k + 1] - s[k]), 0.0, 1.0))
        return Location(int(self.members[name][k]), xi)

    def point_at(self, location: Location) -> Floats:
        """Return the coordinates of a location, shape (3,) [m]."""
        a, b = self.points[self.lines[location.line]]
        return a + location.xi * (b - a)

    def member_of_line(self) -> NDArray[np.object_]:
        """Return the name of the member of each line, shape (n_lines,)."""
        chains, member = self.chains()
        names = np.empty(self.n_lines, dtype=object)
        names[chains] = np.array(list(self.members), dtype=object)[member]
        return names

    def chains(self) -> tuple[Ints, Ints]:
        """Return the lines of all members one after the other, and the number of the member of each."""
        chains = list(self.members.values())
        length = np.fromiter(map(len, chains), dtype=np.int64, count=len(chains))
        lines = np.concatenate([np.zeros(0, dtype=np.int64), *chains])
        return lines, np.repeat(np.arange(len(chains)), length)

    def arc_fractions(self) -> Floats:
        """Return where each line begins and ends along its member, 0 to 1 of its length, (n_lines, 2) [-]."""
        out, (chains, member) = self.arc_lengths(), self.chains()
        last = np.searchsorted(member, np.arange(len(self.members)), side="right") - 1
        out[chains] /= out[chains[last], 1][member, None]
        return out

    def arc_lengths(self) -> Floats:
        """Return where each line begins and ends along its member, (n_lines, 2) [m]."""
        chains, member = self.chains()
        start = np.searchsorted(member, np.arange(len(self.members) + 1))
        length, count = self.lengths(), np.diff(start)
        out = np.zeros((self.n_lines, 2))
        for n in np.unique(count):  # members of equally many lines together
            rows = chains[start[:-1][count == n][:, None] + np.arange(n)]
            s = np.cumsum(length[rows], axis=1)
            out[rows, 1] = s
            out[rows[:, 1:], 0] = s[:, :-1]
        return out

    def nearest_point(self, xyz: ArrayLike) -> tuple[int, float]:
        """Return the index of the point nearest to given coordinates, and its distance [m]."""
        distance = np.linalg.norm(self.points - np.asarray(xyz, dtype=float), axis=1)
        index = int(np.argmin(distance))
        return index, float(distance[index])

    def nearest_on_members(self, xyz: ArrayLike) -> tuple[str, float, float]:
        """Return the member nearest to given coordinates, the position on it [m] and the distance [m]."""
        xyz = np.asarray(xyz, dtype=float)
        chains, member = self.chains()
        a = self.points[self.lines[chains, 0]]
        t = self.points[self.lines[chains, 1]] - a
        xi = np.clip(np.einsum("ij,ij->i", xyz - a, t) / np.einsum("ij,ij->i", t, t), 0.0, 1.0)
        distance = np.linalg.norm(a + xi[:, None] * t - xyz, axis=1)
        best = int(np.flatnonzero(distance <= distance.min() + 1e-12)[0])
        name = list(self.members)[member[best]]
        s, k = self.member_positions(name), best - int(np.searchsorted(member, member[best]))
        return name, float(s[k] + xi[best] * (s[k + 1] - s[k])), float(distance[best])

    def with_free_point(self, xyz: ArrayLike, name: str | None = None) -> "Mesh":
        """Return a mesh with a last point (3,) [m] on no line, for links, masses and joints."""
        points = np.vstack([self.points, np.asarray(xyz, dtype=float)])
        names = {**self.point_names, **({} if name is None else {name: self.n_points})}
        return self._changed(points, self.lines.copy(), self.members, names)

    def with_point_on(self, member: str, position: float, name: str | None = None) -> "Mesh":
        """Return a mesh with a point at a position along a member, splitting a line where there is none yet.

        Existing points keep their indices. A point nearer than 1e-6 of the member's length is used as it is.
        """
        (chain,) = self._single(member)
        s = self.member_positions(chain)
        location = self.locate(chain, position)
        near = int(np.argmin(np.abs(s - position)))
        names = dict(self.point_names)
        if abs(s[near] - position) <= 1e-6 * s[-1]:
            if name is None:
                return self
            names[name] = int(self.member_points(chain)[near])
            return self._changed(self.points, self.lines, self.members, names)
        points = np.vstack([self.points, self.point_at(location)])
        new = self.n_points
        a, b = self.lines[location.line]
        lines = np.vstack([self.lines, [new, b]])
        lines[location.line] = [a, new]
        rows = self.members[chain]
        at = int(np.flatnonzero(rows == location.line)[0])
        members = dict(self.members)
        members[chain] = np.insert(rows, at + 1, self.n_lines)
        if name is not None:
            names[name] = new
        return self._changed(points, lines, members, names)

    def with_point(self, xyz: ArrayLike, name: str) -> "Mesh":
        """Return a mesh with one more point, on no line; existing points keep their indices."""
        points = np.vstack([self.points, np.asarray(xyz, dtype=float)])
        names = {**self.point_names, name: self.n_points}
        return self._changed(points, self.lines, self.members, names)

    def refined(self, size: float | None = None, counts: Mapping[str, int] | None = None) -> "Mesh":
        """Return a mesh with more lines along the members; existing points keep their indices.

        Parameters
        ----------
        size : float, optional
            Largest length of a line [m].
        counts : mapping of str to int, optional
            Least number of lines of a member or of each member of a group; it goes before ``size``.
        """
        if size is not None and not size > 0:
            msg = f"the element size is {size}; it must be positive [m]"
            raise MeshError(msg)
        length = self.lengths()
        pieces = np.ones(self.n_lines)
        if size is not None:
            pieces = np.maximum(1, np.ceil(length / size - 1e-9))
        for name, count in (counts or {}).items():
            if count < 1:
                msg = f"the element count of '{name}' is {count}; it must be at least 1"
                raise MeshError(msg)
            for member in self.members_of(name):
                rows = self.members[member]
                share = length[rows] / length[rows].sum() * count
                pieces[rows] = np.maximum(1, np.ceil(share - 1e-6))
        return self.split(pieces)

    def split(self, pieces: ArrayLike, ends: ArrayLike = 0.0) -> "Mesh":
        """Return a mesh in which line i is divided into ``pieces[i]`` lines.

        Parameters
        ----------
        pieces : int or ndarray of int (n_lines,)
        ends : ndarray (n_lines, 2), optional
            Fractions of each line at its two ends that the first and the last piece have in addition [-];
            the rest of the line is divided into equal lengths.
        """
        asked = np.broadcast_to(np.asarray(pieces, dtype=float), (self.n_lines,))
        if not asked.sum() <= max(MOST_LINES, self.n_lines):
            row = int(np.argmax(asked))
            msg = (
                f"the mesh would have {asked.sum():.4g} lines, and at most {MOST_LINES} are made; line {row} "
                f"of {self.lengths()[row]:.4g} m asks for the most, {asked[row]:.4g}: give larger elements"
            )
            raise MeshError(msg)
        if not (asked >= 1).all():
            msg = f"a line cannot be divided into {asked.min():g} pieces; at least 1 is needed"
            raise MeshError(msg)
        pieces = asked.astype(np.int64)
        if (pieces == 1).all():
            return self
        a, b = self.points[self.lines[:, 0]], self.points[self.lines[:, 1]]
        of, step = _counted(pieces - 1)
        first, last = np.moveaxis(np.broadcast_to(np.asarray(ends, dtype=float), (self.n_lines, 2)), 1, 0)
        along = first[of] + (1 - first - last)[of] * ((step + 1) / pieces[of])
        inner = a[of] + along[:, None] * (b - a)[of]
        # the points inside a line are numbered one after the other, line by line
        before = self.n_points + np.cumsum(pieces - 1) - (pieces - 1)
        of, step = _counted(pieces)
        lines = (before[of] + step)[:, None] + [-1, 0]
        first, last = step == 0, step == pieces[of] - 1
        lines[first, 0], lines[last, 1] = self.lines[of[first], 0], self.lines[of[last], 1]
        chains, member = self.chains()
        of, step = _counted(pieces[chains])
        rows = (np.cumsum(pieces) - pieces)[chains[of]] + step
        members = dict(zip(self.members, _parts(rows, np.bincount(member[of])), strict=True))
        points = np.vstack([self.points, inner])
        return self._changed(points, lines, members, self.point_names)


def _counted(counts: Ints) -> tuple[Ints, Ints]:
    """Return each index as often as its count says, and 0, 1, … for each."""
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)


def _parts(rows: Ints, counts: Ints) -> list[Ints]:
    """Return an array, which becomes read-only, in parts of so many entries."""
    rows.flags.writeable = False
    ends = np.cumsum(counts).tolist()
    return [rows[i:j] for i, j in zip([0, *ends[:-1]], ends, strict=True)]


def _check_lines(points: Floats, lines: Ints) -> None:
    """Refuse an invalid mesh: coordinates that are not numbers, lines without points or length."""
    if lines.size == 0:
        msg = "the mesh has no lines; a frame needs at least one two-node line"
        raise MeshError(msg)
    if lines.ndim != 2 or lines.shape[1] != 2:
        msg = f"lines have shape {lines.shape}; (n_lines, 2) is expected"
        raise MeshError(msg)
    if points.ndim != 2 or points.shape[1] != 3:
        msg = f"points have shape {points.shape}; (n_points, 3) is expected"
        raise MeshError(msg)
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        msg = f"point {bad} has a coordinate that is not a finite number: {points[bad].tolist()}"
        raise MeshError(msg)
    outside = (lines < 0) | (lines >= len(points))
    if outside.any():
        row = int(np.flatnonzero(outside.any(axis=1))[0])
        node = int(lines[row][outside[row]][0])
        msg = f"line {row} refers to point {node}, but the mesh has {len(points)} points; points count from 0"
        raise MeshError(msg)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
        size = float(np.ptp(points, axis=0).max())
    if not (np.isfinite(length).all() and np.isfinite(size)):
        bad = int(np.argmax(np.abs(points).max(axis=1)))
        msg = f"point {bad} is so far away that lengths overflow: {points[bad].tolist()} m"
        raise MeshError(msg)
    if (length <= 1e-9 * size).any():
        row = int(np.argmin(length))
        msg = f"line {row} between points {lines[row, 0]} and {lines[row, 1]} has zero length"
        raise MeshError(msg)


def _owners(sets: Mapping[str, ArrayLike], n_lines: int) -> tuple[Ints, list[str]]:
    """Return the number of the set of each line, and the names of the sets with that of the rest."""
    names = list(sets)
    parts = [np.asarray(rows, dtype=np.int64).ravel() for rows in sets.values()]
    rows = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
    number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    outside = np.flatnonzero((rows < 0) | (rows >= n_lines))
    if outside.size:
        msg = (
            f"set '{names[number[outside[0]]]}' refers to line {rows[outside[0]]}, but the mesh has "
            f"{n_lines} lines, counted from 0"
        )
        raise MeshError(msg)
    owner = np.full(n_lines, -1)
    owner[rows[::-1]] = number[::-1]  # of several sets the first
    twice = np.flatnonzero(owner[rows] != number)
    if twice.size:
        row = rows[twice[0]]
        msg = (
            f"line {row} is in the sets '{names[owner[row]]}' and '{names[number[twice[0]]]}'; "
            "a line belongs to one member"
        )
        raise MeshError(msg)
    owner[owner < 0] = len(names)
    return owner, [*names, free_name("frame", "frame.rest", names)]


def free_name(first: str, second: str, taken: Container[str]) -> str:
    """Return the first of ``first``, ``second``, ``second.2``, ``second.3``, … that is not taken."""
    numbered = (f"{second}.{k}" for k in numbers_from(2))
    return next(name for name in chain((first, second), numbered) if name not in taken)


def _numbered(name: str, n: int, taken: Container[str]) -> Iterator[str]:
    """Give ``name.1``, ``name.2``, …, passing over those that are taken."""
    return islice((part for k in numbers_from(1) if (part := f"{name}.{k}") not in taken), n)


def merge_names(names: Iterable[str]) -> str:
    """Join names for a message: ``a, b and c``."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def merge_advice(gap: float) -> str:
    """Say what to do about points that lie up to a distance [m] apart and are not connected."""
    tolerance = max(1.2 * gap, 1e-12)  # the digits that are left out do not make it shorter than the distance
    return (
        f"if they are one point, make them one (merge_tolerance = {tolerance:.2g} [m] does so in a mesh "
        "file); if not, tie them with a joint"
    )
