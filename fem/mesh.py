"""Line meshes: points, two-node lines, and members, which are named chains of lines.

A position on a member is an arc length in metres from its first end, so that sensors, joints and effects keep
their place when the mesh is refined.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray


class MeshError(ValueError):
    """A mesh that cannot be what the user meant; the message names the place."""


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
    """

    points: NDArray[np.float64]
    lines: NDArray[np.int64]
    members: Mapping[str, NDArray[np.int64]]
    groups: Mapping[str, tuple[str, ...]]
    point_names: Mapping[str, int]

    @classmethod
    def from_lines(
        cls,
        points: ArrayLike,
        lines: ArrayLike,
        sets: Mapping[str, ArrayLike] | None = None,
        point_names: Mapping[str, int] | None = None,
    ) -> "Mesh":
        """Build a mesh from points and lines in any order and direction.

        Each set becomes a member. A set that branches or is in several pieces becomes one member for each
        chain, named ``set.1``, ``set.2``, …, and the set's name becomes a group. The lines that are in no set
        form the set ``"frame"``.

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

        Raises
        ------
        MeshError
            For coordinates that are not finite, indices out of range, lines of zero length, or lines that
            are in two sets.
        """
        points = np.array(points, dtype=float, ndmin=2)
        lines = np.array(lines, dtype=np.int64, ndmin=2)
        if lines.size == 0:
            msg = "the mesh has no lines; a frame needs at least one two-node line"
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
            msg = (
                f"line {row} refers to point {node}, but the mesh has {len(points)} points; "
                "points count from 0"
            )
            raise MeshError(msg)
        length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
        size = float(np.ptp(points, axis=0).max())
        if (length <= 1e-9 * size).any():
            row = int(np.argmin(length))
            msg = f"line {row} between points {lines[row, 0]} and {lines[row, 1]} has zero length"
            raise MeshError(msg)

        sets = {name: np.unique(np.asarray(rows, dtype=np.int64)) for name, rows in (sets or {}).items()}
        owner: dict[int, str] = {}
        for name, rows in sets.items():
            for row in rows:
                if not 0 <= row < len(lines):
                    msg = (
                        f"set '{name}' refers to line {row}, but the mesh has {len(lines)} lines, "
                        "counted from 0"
                    )
                    raise MeshError(msg)
                if row in owner:
                    msg = (
                        f"line {row} is in the sets '{owner[row]}' and '{name}'; a line belongs to one member"
                    )
                    raise MeshError(msg)
                owner[int(row)] = name
        rest = np.array([row for row in range(len(lines)) if row not in owner], dtype=np.int64)
        if rest.size:
            sets["frame"] = rest

        members: dict[str, NDArray[np.int64]] = {}
        groups: dict[str, tuple[str, ...]] = {}
        for name, rows in sets.items():
            if not rows.size:
                continue
            chains = _chains(points, lines, rows)
            names = [name] if len(chains) == 1 else [f"{name}.{i}" for i in range(1, len(chains) + 1)]
            if len(chains) > 1:
                groups[name] = tuple(names)
            for member, (chain, flipped) in zip(names, chains, strict=True):
                lines[chain[flipped]] = lines[chain[flipped]][:, ::-1]
                members[member] = chain
        return cls._frozen(points, lines, members, groups, dict(point_names or {}))

    @classmethod
    def _frozen(
        cls,
        points: NDArray[np.float64],
        lines: NDArray[np.int64],
        members: Mapping[str, NDArray[np.int64]],
        groups: Mapping[str, tuple[str, ...]],
        point_names: Mapping[str, int],
    ) -> "Mesh":
        for array in (points, lines, *members.values()):
            array.flags.writeable = False
        return cls(
            points,
            lines,
            MappingProxyType(dict(members)),
            MappingProxyType(dict(groups)),
            MappingProxyType(dict(point_names)),
        )

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

    def lengths(self) -> NDArray[np.float64]:
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

    def member_points(self, name: str) -> NDArray[np.int64]:
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

    def member_positions(self, name: str) -> NDArray[np.float64]:
        """Return the arc length of each of a member's points from its first end [m]."""
        chain = self.points[self.member_points(name)]
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])

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

    def point_at(self, location: Location) -> NDArray[np.float64]:
        """Return the coordinates of a location, shape (3,) [m]."""
        a, b = self.points[self.lines[location.line]]
        return a + location.xi * (b - a)

    def member_of_line(self) -> NDArray[np.object_]:
        """Return the name of the member of each line, shape (n_lines,)."""
        names = np.empty(self.n_lines, dtype=object)
        for name, rows in self.members.items():
            names[rows] = name
        return names

    def chains(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the lines of all members one after the other, and the number of the member of each."""
        chains = list(self.members.values())
        length = np.fromiter(map(len, chains), dtype=np.int64, count=len(chains))
        return np.concatenate(chains), np.repeat(np.arange(len(chains)), length)

    def arc_fractions(self) -> NDArray[np.float64]:
        """Return where each line begins and ends along its member, 0 to 1 of its length, (n_lines, 2) [-]."""
        chains, member = self.chains()
        start = np.searchsorted(member, np.arange(len(self.members) + 1))
        length, count = self.lengths(), np.diff(start)
        out = np.zeros((self.n_lines, 2))
        for n in np.unique(count):  # members of equally many lines together
            rows = chains[start[:-1][count == n][:, None] + np.arange(n)]
            s = np.cumsum(length[rows], axis=1)
            out[rows, 1] = s / s[:, -1:]
            out[rows[:, 1:], 0] = s[:, :-1] / s[:, -1:]
        return out

    def nearest_point(self, xyz: ArrayLike) -> tuple[int, float]:
        """Return the index of the point nearest to given coordinates, and its distance [m]."""
        distance = np.linalg.norm(self.points - np.asarray(xyz, dtype=float), axis=1)
        index = int(np.argmin(distance))
        return index, float(distance[index])

    def nearest_on_members(self, xyz: ArrayLike) -> tuple[str, float, float]:
        """Return the member nearest to given coordinates, the position on it [m] and the distance [m]."""
        xyz = np.asarray(xyz, dtype=float)
        best = ("", 0.0, np.inf)
        for name, rows in self.members.items():
            a = self.points[self.lines[rows, 0]]
            t = self.points[self.lines[rows, 1]] - a
            xi = np.clip(np.einsum("ij,ij->i", xyz - a, t) / np.einsum("ij,ij->i", t, t), 0.0, 1.0)
            distance = np.linalg.norm(a + xi[:, None] * t - xyz, axis=1)
            k = int(np.argmin(distance))
            if distance[k] < best[2] - 1e-12:
                s = self.member_positions(name)
                best = (name, float(s[k] + xi[k] * (s[k + 1] - s[k])), float(distance[k]))
        return best

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
            return self._frozen(self.points, self.lines, self.members, self.groups, names)
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
        return self._frozen(points, lines, members, self.groups, names)

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
        pieces = np.ones(self.n_lines, dtype=np.int64)
        if size is not None:
            pieces = np.maximum(1, np.ceil(length / size - 1e-9)).astype(np.int64)
        for name, count in (counts or {}).items():
            if count < 1:
                msg = f"the element count of '{name}' is {count}; it must be at least 1"
                raise MeshError(msg)
            for member in self.members_of(name):
                rows = self.members[member]
                share = length[rows] / length[rows].sum() * count
                pieces[rows] = np.maximum(1, np.ceil(share - 1e-6)).astype(np.int64)
        return self.split(pieces)

    def split(self, pieces: ArrayLike) -> "Mesh":
        """Return a mesh in which line i is divided into ``pieces[i]`` equal lines."""
        pieces = np.broadcast_to(np.asarray(pieces, dtype=np.int64), (self.n_lines,))
        if (pieces == 1).all():
            return self
        points = [self.points]
        lines: list[NDArray[np.int64]] = []
        rows_of: list[NDArray[np.int64]] = []
        n_points, n_lines = self.n_points, 0
        for (a, b), n in zip(self.lines, pieces, strict=True):
            xi = np.arange(1, n)[:, None] / n
            points.append(self.points[a] + xi * (self.points[b] - self.points[a]))
            chain = np.concatenate([[a], np.arange(n_points, n_points + n - 1), [b]])
            lines.append(np.column_stack([chain[:-1], chain[1:]]))
            rows_of.append(np.arange(n_lines, n_lines + n))
            n_points += n - 1
            n_lines += n
        members = {name: np.concatenate([rows_of[r] for r in rows]) for name, rows in self.members.items()}
        return self._frozen(np.vstack(points), np.vstack(lines), members, self.groups, self.point_names)


def _chains(
    points: NDArray[np.float64], lines: NDArray[np.int64], rows: NDArray[np.int64]
) -> list[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Split a set of lines into chains; return the ordered rows of each and which of them are reversed."""
    at: dict[int, list[int]] = {}
    for line in rows.tolist():
        for p in lines[line]:
            at.setdefault(int(p), []).append(line)

    def goes_on(point: int, row: int) -> int | None:
        """Return the row that continues a chain beyond a point.

        It is the only other one there, and meets the chain without a sharp corner.
        """
        others = [r for r in at[point] if r != row]
        if len(others) != 1:
            return None
        u = _direction(points, lines[row], point)
        v = _direction(points, lines[others[0]], point)
        return others[0] if u @ v < -0.5 else None

    free = set(rows.tolist())
    chains: list[tuple[NDArray[np.int64], NDArray[np.bool_]]] = []
    for seed in rows.tolist():
        if seed not in free:
            continue
        start, point = seed, int(lines[seed, 0])
        seen = {start}
        while (back := goes_on(point, start)) is not None and back not in seen:
            start = back
            seen.add(back)
            point = _other(lines[back], point)
        chain, flips = [], []
        row: int | None = start
        while row is not None and row in free:
            free.discard(row)
            chain.append(row)
            flips.append(bool(lines[row, 0] != point))
            point = _other(lines[row], point)
            row = goes_on(point, row)
        order, flipped = np.array(chain, dtype=np.int64), np.array(flips, dtype=bool)
        if flipped.mean() > 0.5:  # keep the direction that most lines of the file have
            order, flipped = order[::-1].copy(), ~flipped[::-1]
        chains.append((order, flipped))
    return chains


def _other(line: NDArray[np.int64], point: int) -> int:
    return int(line[1] if line[0] == point else line[0])


def _direction(points: NDArray[np.float64], line: NDArray[np.int64], origin: int) -> NDArray[np.float64]:
    t = points[_other(line, origin)] - points[origin]
    return t / np.linalg.norm(t)


def merge_names(names: Iterable[str]) -> str:
    """Join names for a message: ``a, b and c``."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
