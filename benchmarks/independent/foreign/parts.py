"""Parts of a structure by another code, reduced to modes and responses: scikit-fem's solids, OpenSees' beams.

A part gives squared frequencies and M-orthonormal vectors that hold its free modes and the responses to
forces at places. What is changed within a member is assembled anew; what acts from outside is no part of it.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as sla

from benchmarks.independent import bodies
from benchmarks.independent import solids as bars
from benchmarks.independent.foreign.structure import NU, RHO, E

N_MODES, N_MODES_WELDED, N_MODES_BEAMS = 60, 100, 160
SHIFT = (2 * np.pi * 150) ** 2
"""Responses are those of K + shift M, which free parts have, too [rad²/s²]."""
DEPENDENT = 1e-9
"""A column adds nothing where this share of it is left beside the others."""
PIECES = 12
"""Elements of a member of beams, at least."""
CLOSE = 1e-3
"""Nodes are at least this share of a member's length apart [-]."""
SHEAR = {"rhs": 0.45, "round": 0.886, "tube": 0.53}
"""Shear coefficients of OpenSees' sections, in both directions [-]."""


@dataclass(frozen=True)
class Change:
    """Factors of a member: of E, ρ, width and height; a notch; a tension [N]."""

    E: float = 1.0
    rho: float = 1.0
    b: float = 1.0
    h: float = 1.0
    notch: tuple = ()  # from, to [m], factor of E
    tension: float = 0.0


@dataclass(frozen=True)
class Place:
    """A point of an axis or, about a point, the six mean motions of what lies within a reach along it [m].

    A ``spot`` is a point beside the axis, global [m]: its displacements there.
    """

    member: str
    s: float
    about: tuple = ()
    reach: float = 0.0
    spot: tuple = ()


class Part:
    """What both codes share: K, M, modes and the solver are set by them."""

    def __init__(self, K, M, n_modes, solve, modes):
        self.K, self.M, self.n_modes, self.solve, self.modes = K, M, n_modes, solve, modes
        self.responses, self.known = {}, {}

    def motion(self, place):
        """Return displacements or mean motions (n, 3 or 6) of a place by the part's unknowns."""
        raise NotImplementedError

    def positions(self, member):
        """Return where along a member there are nodes [m]."""
        raise NotImplementedError

    def reduced(self, places):
        """Return squared frequencies [rad²/s²] and the motions of places in these coordinates."""
        key = tuple(places)
        if key not in self.known:
            self.known[key] = self.reduction(places)
        return self.known[key]

    def reduction(self, places):
        """Return what `reduced` keeps."""
        motions = {place: self.motion(place) for place in places}
        for place, P in motions.items():
            if place not in self.responses:
                self.responses[place] = self.solve(P)
        X = np.hstack([self.modes, *(self.responses[place] for place in places)])
        X = X / np.sqrt(np.einsum("ij,ij->j", X, self.M @ X))
        Q, R, _ = la.qr(X, mode="economic", pivoting=True, check_finite=False)
        Q = Q[:, np.abs(np.diag(R)) > DEPENDENT * np.abs(R[0, 0])]
        squares, U = la.eigh(Q.T @ (self.K @ Q), Q.T @ (self.M @ Q))
        squares[:6] = 0.0  # a part is free: what holds it acts from outside
        return np.maximum(squares, 0.0), {place: U.T @ (Q.T @ P) for place, P in motions.items()}


class Solid(Part):
    """A body of quadratic hexahedra: one bar, or bars welded at right angles."""

    def __init__(self, structure, body, changes, cuts):
        self.structure = structure
        changed = {m: changes[m] for m in body if m in changes}
        factors = {
            key: {m: getattr(c, key) for m, c in changed.items() if getattr(c, key) != 1.0}
            for key in ("E", "rho", "b", "h")
        }
        hidden = bars.Hidden(weaker={m: c.notch for m, c in changed.items() if c.notch}, **factors)
        own = {m: structure.members[m].bar for m in body}
        if len(body) == 1:
            (name,) = body
            marks = [s for _, s in cuts] + [s for m in hidden.weaker.values() for s in m[:2]]
            self.body = bodies.bar_alone(name, own[name], hidden, marks)
        else:
            sensors = [place for place in structure.sensors if place[0] in body]
            sensors += [side for c in structure.connections.values() for side in c.sides if side[0] in body]
            welded = bars.Structure(own, (), (*sensors, *cuts), (), 0.0)
            self.body = bodies.welded(welded, hidden)
        K, M = self.body.K, self.body.M
        solved = sla.splu((K + SHIFT * M).tocsc())
        n_modes = N_MODES if len(body) == 1 else N_MODES_WELDED
        inverse = sla.LinearOperator(K.shape, solved.solve)
        _, V = sla.eigsh(K, k=n_modes, M=M, sigma=-SHIFT, OPinv=inverse, v0=np.ones(K.shape[0]))
        super().__init__(K, M, n_modes, solved.solve, V)

    def motion(self, place):
        if place.spot:
            return self.body.spot(place.member, np.array(place.spot))
        if place.about:
            return self.body.patch(place.member, place.s, np.array(place.about), place.reach)
        return self.body.point(place.member, place.s)

    def positions(self, member):
        x, y, z = self.body.local(member)
        on_axis = x[(np.abs(y) < 1e-7) & (np.abs(z) < 1e-7)]
        length = self.structure.members[member].length
        return np.unique(on_axis[(on_axis > -1e-7) & (on_axis < length + 1e-7)].round(9))


class Beams(Part):
    """Timoshenko members of OpenSees that meet in points."""

    def __init__(self, structure, body, changes, cuts):
        self.members = {m: structure.members[m] for m in body}
        wanted = {m: set(np.linspace(0, member.length, PIECES + 1)) for m, member in self.members.items()}
        sides = [side for c in structure.connections.values() for side in c.sides]
        for m, s, *_ in (*structure.sensors, *sides, *cuts):
            if m in body:
                wanted[m].add(s)
        for m, change in changes.items():
            if m in body and change.notch:
                wanted[m] |= set(change.notch[:2])
        self.points, self.at, self.lines = [], {}, []
        known = {}
        for m, marks in wanted.items():
            ids = []
            for s in apart(sorted(marks), self.members[m].length):
                key = tuple(np.round(self.members[m].at(s), 5))
                if key not in known:
                    known[key] = len(self.points)
                    self.points.append(self.members[m].at(s))
                self.at[m, round(s, 6)] = known[key]
                ids.append((s, known[key]))
            self.lines += [(m, 0.5 * (s + t), i, j) for (s, i), (t, j) in itertools.pairwise(ids)]
        K, M = self.matrices(changes)
        n_modes = min(N_MODES_BEAMS, len(K) - 1)
        _, V = la.eigh(K, M, subset_by_index=[0, n_modes - 1])
        factor = la.cho_factor(K + SHIFT * M)
        super().__init__(K, M, n_modes, lambda P: la.cho_solve(factor, P), V)

    def matrices(self, changes):
        """Return K and M of OpenSees, with tensions."""
        from benchmarks.peers.drive_opensees import build, matrices
        from benchmarks.peers.exchange import TIMOSHENKO, PeerFrame

        rows = []
        for m, s, _, _ in self.lines:
            change, section = changes.get(m, Change()), self.members[m].section
            factor = change.E
            if change.notch and change.notch[0] < s < change.notch[1]:
                factor *= change.notch[2]
            k = SHEAR[section["type"]]
            rows.append((factor * E, factor * E / (2 + 2 * NU), change.rho * RHO, *constants(section), k, k))
        names = ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz")
        n = len(self.points)
        frame = PeerFrame(
            points=np.array(self.points),
            lines=np.array([line[2:] for line in self.lines]),
            local_z=np.array([self.members[m].axes[2] for m, *_ in self.lines]),
            fixed=np.zeros((n, 6), dtype=bool),
            loads=np.zeros((n, 6)),
            uniform=np.zeros((0, 3)),
            released=np.zeros((len(self.lines), 2, 2), dtype=bool),
            theory=TIMOSHENKO,
            matrices=True,
            **dict(zip(names, np.array(rows).T, strict=True)),
        )
        build(frame)
        K, M = (0.5 * (X + X.T) for X in matrices(6 * n))
        for m, _, i, j in self.lines:
            if m in changes and changes[m].tension:
                h = float(np.linalg.norm(np.subtract(self.points[j], self.points[i])))
                dofs = np.concatenate([6 * i + np.arange(6), 6 * j + np.arange(6)])
                K[np.ix_(dofs, dofs)] += bodies.geometric_stiffness(
                    self.members[m].axes, h, changes[m].tension
                )
        return K, M

    def motion(self, place):
        s = place.s
        if place.spot:  # a node closer than `CLOSE` serves as well: what it misses is the curvature between
            s = min(self.positions(place.member), key=lambda x: abs(x - place.s))
        i = self.at[place.member, round(s, 6)]
        P = np.zeros((6 * len(self.points), 6))
        P[6 * i : 6 * i + 6] = np.eye(6)
        if not (place.about or place.spot):
            return P[:, :3]
        arm = np.array(place.about or place.spot) - self.points[i]
        P[6 * i + 3 : 6 * i + 6, :3] = np.cross(np.eye(3), arm)  # u at the end of the arm: u + θ × arm
        return P[:, :3] if place.spot else P

    def positions(self, member):
        return np.array(sorted(s for m, s in self.at if m == member))


def apart(marks, length):
    """Return marks without those closer than `CLOSE` of the length to the one before."""
    out = [marks[0]]
    for s in marks[1:]:
        if s - out[-1] > CLOSE * length:
            out.append(s)
    return out


def constants(section):
    """Return A, Iy, Iz, J of a section of nominal.json."""
    match section["type"]:
        case "round" | "tube":
            d = section["d"]
            inner = d - 2 * section.get("t", d / 2)
            I = np.pi / 64 * (d**4 - inner**4)
            return np.pi / 4 * (d**2 - inner**2), I, I, 2 * I
        case "rhs":
            b, h, t = section["b"], section["h"], section["t"]
            c, g = b - 2 * t, h - 2 * t
            return b * h - c * g, (b * h**3 - c * g**3) / 12, (h * b**3 - g * c**3) / 12, section["J"]
    msg = f"section type '{section['type']}' is not understood; round, tube and rhs are"
    raise ValueError(msg)
