"""A table: a plate of solid elements joins four legs of beams as one superelement."""

import tempfile
from itertools import product
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import fem
from fem.elements.part_faces import PartFaces
from fem.matrices import Matrices
from viz import render_mode

steel, section = fem.Material("steel", E=210e9, rho=7850.0, nu=0.3), fem.Section.circle(0.012)
mu, lame = steel.G, 2 * steel.G * steel.nu / (1 - 2 * steel.nu)  # Lamé's parameters [Pa]
a, h, L = 0.6, 0.02, 0.5  # side and thickness of the plate, length of the legs [m]


def along(length, n):
    """Return the integrals of products of quadratic shape functions and of their slopes on n elements."""
    (t, w), out = np.polynomial.legendre.leggauss(3), np.zeros((2, 2, 2 * n + 1, 2 * n + 1))
    slopes = np.array([t - 0.5, -2 * t, t + 0.5]) * 2 * n / length
    N = np.array([[t * (t - 1) / 2, 1 - t**2, t * (t + 1) / 2], slopes])
    for k in range(0, 2 * n, 2):
        out[:, :, k : k + 3, k : k + 3] += np.einsum("aiq,bjq,q->abij", N, N, w * length / 2 / n)
    return out


def over(i, j):
    """Return the integrals over the plate, of slopes along i on the left and along j on the right."""
    x, y, z = (g[int(i == k), int(j == k)] for k, g in enumerate((along(a, 8), along(a, 8), along(h, 1))))
    return sp.kron(x, sp.kron(y, z), "csr")


# Another program would write K and M of its plate. On a regular grid they are Kronecker products.
same = mu * sum(over(k, k) for k in range(3))
K = [[lame * over(i, j) + mu * over(j, i) + (i == j) * same for j in range(3)] for i in range(3)]
M = sp.csr_array(sp.kron(np.eye(3), steel.rho * over(None, None)))
places = np.array(list(product(np.linspace(0, a, 17), np.linspace(0, a, 17), (0, h / 2, h))))
node = np.arange(len(places)).reshape(17, 17, 3)
rows = np.tile(node.ravel(), 3), np.repeat([1, 2, 3], node.size), node.ravel(), places
plate = Matrices(sp.csr_array(sp.block_array(K)), M, None, None, *rows)
quads = [node[i : i + 2, j : j + 2, 2].ravel()[[0, 2, 3, 1]] for i, j in product(range(16), repeat=2)]
legs, corners = {f"leg {k}": [k] for k in range(4)}, list(product((slice(3), slice(-3, None)), repeat=2))
points = [[a * (i.start is not None), a * (j.start is not None), z] for i, j in corners for z in (-L, 0)]
mesh = fem.Mesh.from_lines(points, [[2 * k, 2 * k + 1] for k in range(4)], legs).refined(size=0.05)
below = [tuple(node[i, j, 0].ravel().tolist()) for i, j in corners]  # nodes that sit on the legs
ties = [fem.Attachment(2 * k + 1, nodes, "average") for k, nodes in enumerate(below)]
faces = PartFaces.of_cells(plate, places, [("quad", np.array(quads))])  # for pictures
part = fem.Superelement.from_matrices("plate", plate, mesh, ties, max_frequency=500.0, faces=faces)
frame = fem.Frame(members=dict.fromkeys(legs, fem.MemberProperties(steel, section)))
model = fem.Model(mesh, (frame, part, *(fem.Support(name=f"foot {k}", point=2 * k) for k in range(4))))
modes = fem.solve_modes(fem.assemble(model), n=8)
print(f"picture in {render_mode(model, modes, 3, Path(tempfile.mkdtemp()) / 'mode.png')}")
mass = steel.rho * (a**2 * h + 4 * 13 / 35 * section.A * L)  # with that of bending legs
sway = np.sqrt(4 * 12 * steel.E * section.Iy / L**3 / mass) / 2 / np.pi  # of a rigid plate
print(f"the table sways at {modes.frequency[0]:.3f} Hz, with a rigid plate at {sway:.3f} Hz")
assert 0.99 * sway < modes.frequency[0] < sway
