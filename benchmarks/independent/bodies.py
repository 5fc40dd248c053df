"""Bodies of quadratic hexahedra: meshes of bars, their modes and responses, and what couples them.

The elements are scikit-fem's; nothing here comes from a beam code.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from benchmarks.independent.casefiles import AXES

E, NU, RHO = 210e9, 0.3, 7850.0
ELEMENT = 0.02
"""Length of an element [m]."""
ACROSS = 4, 2
"""Elements across a bar's width and height; with 2 and 1 torsion is 5 % too stiff."""
PATCH = 0.015
"""A joint holds what lies within this distance along a bar [m]."""
HIGHEST = 9000.0
"""Modes up to this frequency are kept [Hz]."""


@dataclass(frozen=True)
class Bar:
    """A bar of rectangular section along an axis, its h along z or, of one along z, along y [m].

    An angle turns its axis about z [degrees].
    """

    start: tuple[float, float, float]
    axis: str
    length: float
    b: float
    h: float
    angle: float = 0.0

    @property
    def rotation(self):
        """Local to global."""
        columns = {
            "x": ([1, 0, 0], [0, 1, 0], [0, 0, 1]),
            "y": ([0, 1, 0], [-1, 0, 0], [0, 0, 1]),
            "z": ([0, 0, 1], [1, 0, 0], [0, 1, 0]),
        }
        out = np.array(columns[self.axis], dtype=float).T
        if self.angle:
            c, s = np.cos(np.radians(self.angle)), np.sin(np.radians(self.angle))
            out = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ out
        return out

    def at(self, s):
        return (np.array(self.start) + self.rotation[:, 0] * s).round(9)


def assembled(mesh, modulus, density):
    """Return stiffness and mass, places (3, n) and directions (n,) of unknowns, and those of each element."""
    from skfem import Basis, BilinearForm, ElementHex2, ElementVector  # pyright: ignore[reportMissingImports]
    from skfem.helpers import ddot, dot, sym_grad, trace  # pyright: ignore[reportMissingImports]

    basis = Basis(mesh, ElementVector(ElementHex2()), intorder=4)

    @BilinearForm
    def stiffness(u, v, w):
        lame, shear = w.modulus * NU / ((1 + NU) * (1 - 2 * NU)), w.modulus / (2 * (1 + NU))
        a, b = sym_grad(u), sym_grad(v)
        return 2 * shear * ddot(a, b) + lame * trace(a) * trace(b)

    @BilinearForm
    def mass(u, v, w):
        return w.density * dot(u, v)

    def at_points(values):
        return np.repeat(np.asarray(values, dtype=float)[:, None], basis.dx.shape[1], axis=1)

    K = stiffness.assemble(basis, modulus=at_points(modulus)).tocsc()  # pyright: ignore[reportFunctionMemberAccess]
    M = mass.assemble(basis, density=at_points(density)).tocsc()  # pyright: ignore[reportFunctionMemberAccess]
    direction = np.empty(K.shape[0], dtype=int)
    for table in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs):
        for c in range(3):
            direction[table[c]] = c
    return K, M, basis.doflocs, direction, basis.element_dofs


class Body:
    """Mass and stiffness of bars, and what forces at places of them do."""

    def __init__(self, bars, mesh, modulus, density):
        """Assemble a mesh in global coordinates."""
        self.bars = bars
        self.K, self.M, self.places, self.direction, self.elements = assembled(mesh, modulus, density)

    def local(self, name):
        """Return the places (3, n) of unknowns in a bar's own axes."""
        bar = self.bars[name]
        return bar.rotation.T @ (self.places - np.array(bar.start)[:, None])

    def point(self, name, s):
        """Return global displacements (n, 3) of the point of a bar's axis there."""
        x, y, z = self.local(name)
        (at,) = np.nonzero((np.abs(x - s) < 1e-7) & (np.abs(y) < 1e-7) & (np.abs(z) < 1e-7))
        if len(at) != 3:
            msg = f"there is no node on the axis of {name} at {s} m"
            raise ValueError(msg)
        P = np.zeros((len(x), 3))
        P[at] = np.eye(3)[self.direction[at]]
        return P

    def spot(self, name, point):
        """Return global displacements (n, 3) of any point (3,) of a bar, by the shapes of its element."""
        bar = self.bars[name]
        nodes = self.local(name)[:, self.elements]  # (3, 81, n_elements), boxes in the bar's axes
        low, high = nodes.min(axis=1), nodes.max(axis=1)
        x = (bar.rotation.T @ (point - np.array(bar.start)))[:, None]
        inside = ((x > low - 1e-9) & (x < high + 1e-9)).all(axis=0)
        if not inside.any():
            msg = f"the point {point} m is not in {name}"
            raise ValueError(msg)
        k = int(np.argmax(inside))
        size = (high - low)[:, k]
        xi, at = (x[:, 0] - low[:, k]) / size, (nodes[:, :, k] - low[:, [k]]) / size[:, None]
        shapes = {0: (1 - xi) * (1 - 2 * xi), 1: 4 * xi * (1 - xi), 2: xi * (2 * xi - 1)}
        N = np.prod([[shapes[n][d] for n in np.rint(2 * at[d]).astype(int)] for d in range(3)], axis=0)
        P = np.zeros((self.places.shape[1], 3))
        unknowns = self.elements[:, k]
        P[unknowns] = N[:, None] * np.eye(3)[self.direction[unknowns]]
        return P

    def near(self, name, s, reach, disc=None):
        """Return the unknowns of a bar within a distance of a place along it, or of a point on its face."""
        x, y, z = self.local(name)
        bar = self.bars[name]
        if disc is not None:
            middle = bar.rotation.T @ (disc - np.array(bar.start))
            face = np.abs(z - middle[2]) < 1e-6
            return np.flatnonzero(face & (np.hypot(x - middle[0], y - middle[1]) < reach + 1e-9))
        within = (np.abs(y) < 0.5 * bar.b + 1e-9) & (np.abs(z) < 0.5 * bar.h + 1e-9)
        return np.flatnonzero(within & (np.abs(x - s) < reach + 1e-9))

    def patch(self, name, s, about, reach=PATCH, disc=None):
        """Return the mean motion (n, 6) of what lies near s on a bar, in global directions about a point."""
        near = self.near(name, s, reach, disc)
        P = np.zeros((self.places.shape[1], 6))
        P[near] = np.linalg.pinv(self.rigid(near, about)).T
        return P

    def rigid(self, unknowns, about):
        """Return what motions (6,) of a rigid body are there, in global directions about a point."""
        arm, along = self.places[:, unknowns].T - about, np.eye(3)[self.direction[unknowns]]
        return np.hstack([along, np.cross(arm, along)])

    def hold(self, structure, soft, discs=()):
        """Clamp the first ends of bars that are held, but those that are soft move as rigid bodies.

        So do discs: unknowns and a point about which they move.

        Return what the unknowns (n, n_left) are by those that are left: with a soft base that is as good as
        rigid an end is clamped, and nothing else in it gives way.
        """
        n = self.K.shape[0]
        moves, rigid = np.ones(n, dtype=bool), []
        for name in structure.held:
            face = self.near(name, 0.0, 0.0)
            moves[face] = False
            rigid += [(face, self.bars[name].at(0.0))] if name in soft else []
        faces = []
        for unknowns, about in (*rigid, *discs):
            moves[unknowns] = False
            faces.append(np.zeros((n, 6)))
            faces[-1][unknowns] = self.rigid(unknowns, about)
        T = sp.hstack([sp.eye(n, format="csc")[:, moves], *map(sp.csc_matrix, faces)], format="csc")
        self.K, self.M = ((T.T @ X @ T).tocsc() for X in (self.K, self.M))
        return T

    def reduced(self, forces, n_modes, free):
        """Return squared frequencies and M-orthonormal vectors of modes and responses to forces."""
        shift = (2 * np.pi * 150) ** 2
        solved = sla.splu((self.K + shift * self.M).tocsc())
        inverse = sla.LinearOperator(self.K.shape, solved.solve)
        start = np.ones(self.K.shape[0])  # a drawn one would make results differ from run to run
        squares, V = sla.eigsh(self.K, k=n_modes, M=self.M, sigma=-shift, OPinv=inverse, v0=start)
        X = np.hstack([V[:, squares < (2 * np.pi * HIGHEST) ** 2], solved.solve(forces)])
        Q, _ = np.linalg.qr(X / np.sqrt(np.einsum("ij,ij->j", X, self.M @ X)))
        squares, U = la.eigh(Q.T @ (self.K @ Q), Q.T @ (self.M @ Q))
        if free:
            squares[:6] = 0.0
        return np.maximum(squares, 0.0), Q @ U


def bar_alone(name, bar, hidden, cuts=()):
    """Return one bar as a body, with more cuts along it [m]."""
    from skfem import MeshHex  # pyright: ignore[reportMissingImports]

    bar = hidden.changed(name, bar)
    n = round(bar.length / ELEMENT)
    grid = (
        np.unique(np.round([*np.linspace(0, bar.length, n + 1), *cuts], 9)),
        np.linspace(-bar.b / 2, bar.b / 2, ACROSS[0] + 1),
        np.linspace(-bar.h / 2, bar.h / 2, ACROSS[1] + 1),
    )
    mesh = MeshHex.init_tensor(*grid)
    along = mesh.p[0, mesh.t].mean(axis=0)
    mesh = MeshHex(bar.rotation @ mesh.p + np.array(bar.start)[:, None], mesh.t)
    return Body({name: bar}, mesh, modulus_of(name, along, hidden), density_of(name, along, hidden))


def modulus_of(name, along, hidden):
    """Return Young's modulus of elements at places along a bar."""
    out = np.full(len(along), E * hidden.E.get(name, 1.0))
    if name in hidden.weaker:
        start, end, factor = hidden.weaker[name]
        inside = (along > start) & (along < end)
        if not inside.any():
            msg = f"no element of {name} lies between {start} and {end} m"
            raise ValueError(msg)
        out[inside] *= factor
    return out


def density_of(name, along, hidden):
    return np.full(len(along), RHO * hidden.rho.get(name, 1.0))


def welded(structure, hidden):
    """Return all bars as one body: the elements of a grid that lie in one of them, in the first if in two."""
    from skfem import MeshHex  # pyright: ignore[reportMissingImports]

    bars = {name: hidden.changed(name, bar) for name, bar in structure.bars.items()}
    boxes, cuts = {}, [set(), set(), set()]
    for name, bar in bars.items():
        half = np.abs(bar.rotation) @ [0, bar.b / 2, bar.h / 2]
        boxes[name] = (
            np.minimum(bar.at(0.0), bar.at(bar.length)) - half,
            np.maximum(bar.at(0.0), bar.at(bar.length)) + half,
        )
        for axis in range(3):
            cuts[axis] |= {boxes[name][0][axis], boxes[name][1][axis], bar.at(0.0)[axis]}
    for name, s, *_ in (*structure.sensors, *hidden.points, *hidden.turning):
        for axis, x in enumerate(bars[name].at(s)):
            cuts[axis].add(x)
    for name, (start, end, _) in hidden.weaker.items():
        for s in (start, end):
            cuts[AXES.index(bars[name].axis)].add(bars[name].at(s)[AXES.index(bars[name].axis)])
    grid = []
    for each in cuts:
        marks = np.unique(np.round(sorted(each), 9))
        parts = [np.linspace(a, b, max(1, round((b - a) / ELEMENT)) + 1)[:-1] for a, b in pairwise(marks)]
        grid.append(np.append(np.concatenate(parts), marks[-1]))
    mesh = MeshHex.init_tensor(*grid)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    modulus, density = np.zeros(middle.shape[1]), np.zeros(middle.shape[1])
    for name, (low, high) in reversed(boxes.items()):
        inside = ((middle > low[:, None]) & (middle < high[:, None])).all(axis=0)
        bar = bars[name]
        along = (bar.rotation.T @ (middle[:, inside] - np.array(bar.start)[:, None]))[0]
        modulus[inside], density[inside] = modulus_of(name, along, hidden), density_of(name, along, hidden)
    kept = np.flatnonzero(density)
    used, t = np.unique(mesh.t[:, kept], return_inverse=True)
    mesh = MeshHex(mesh.p[:, used], t.reshape(8, -1))
    return Body(bars, mesh, modulus[kept], density[kept])


def coupled(squares, more_loss, zeta, parts, out, inputs, omega):
    """Return FRFs (n_freq, n_out, n_in) of modal coordinates that dynamic stiffnesses tie, line by line.

    Parameters
    ----------
    squares, more_loss, zeta : ndarray (n,)
        Squared frequencies [rad²/s²], loss factors beside the modal damping, and damping ratios.
    parts : list of (ndarray (n, m), ndarray (n_freq, m, m))
        Motions, and the dynamic stiffness between them.
    out, inputs : ndarray (n, n_out), (n, n_in)
        What is read and where forces act.
    omega : ndarray (n_freq,)
        [rad/s].
    """
    C = np.hstack([vectors for vectors, _ in parts] or [np.zeros((len(squares), 0))])
    Z = np.zeros((len(omega), C.shape[1], C.shape[1]), dtype=complex)
    first = 0
    for _, dynamic in parts:
        at = slice(first, first + dynamic.shape[-1])
        Z[:, at, at] = dynamic
        first = at.stop
    H = np.empty((len(omega), out.shape[1], inputs.shape[1]), dtype=complex)
    for k, w in enumerate(omega):
        modal = 1 / (squares * (1 + 1j * more_loss) + 2j * zeta * np.sqrt(squares) * w - w**2)
        left, right = C.T * modal, modal[:, None] * inputs
        forces = np.linalg.solve(np.eye(C.shape[1]) + Z[k] @ (left @ C), Z[k] @ (C.T @ right))
        H[k] = out.T @ right - (out.T * modal) @ (C @ forces)
    return H


def zeta_of(damping, squares):
    """Return damping ratios: their mean and, over frequency, the period of what they vary by [-, Hz]."""
    mean, period = damping
    f = np.sqrt(squares) / (2 * np.pi)
    return mean * (1 + 0.35 * np.sin(2 * np.pi * f / period + 0.7))


def geometric_stiffness(axes, h, force):
    """Return the geometric stiffness (12, 12) of cubic shapes (Przemieniecki 1968, section 15.2)."""
    k = force / (30 * h) * np.array(
        [[36, 3 * h, -36, 3 * h], [3 * h, 4 * h * h, -3 * h, -h * h],
         [-36, -3 * h, 36, -3 * h], [3 * h, -h * h, -3 * h, 4 * h * h]]
    )  # fmt: skip
    local = np.zeros((12, 12))
    for dofs, turn in (([1, 5, 7, 11], 1), ([2, 4, 8, 10], -1)):
        sign = np.array([1, turn, 1, turn])
        local[np.ix_(dofs, dofs)] += sign[:, None] * k * sign
    T = np.kron(np.eye(4), axes)
    return T.T @ local @ T
