"""Simulate the hammer test of frame.bdf by OpenSees, with one connection that the deck does not have.

    python examples/missing-card/simulate.py    # needs openseespy

The truth shares no code with Dovetail: K and M are those of OpenSees' Timoshenko beams of 50 mm. Young's
modulus is 1 % below the deck's and the damping is modal. The bolts at one end of the crossbeam let it turn.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import openseespy.opensees as ops  # pyright: ignore[reportMissingImports]
from scipy.linalg import eigh

from fem import FRF
from fem.io import Points, write_uff

HIDDEN = 8e3
"""Rotational stiffness about x between the crossbeam and the ring at (0.45, 0, 0.8) m [N·m/rad]."""
E, RHO, NU = 0.99 * 210e9, 7850.0, 0.3
ZETA = 0.008
PIECE = 0.05
"""Length of an element [m]."""
RIGID = 1e10, 1e8
"""Stiffness of the connection in its other directions [N/m, N·m/rad]."""
FOOT = (4e6, 4e6, 15e6, 2e3, 2e3, 1e3)
BODY = 18.0, (0.0, 0.0, 0.09), (0.04, 0.06, 0.06)
"""Mass [kg], arm [m] and inertia [kg·m²] of the pump."""


def tube(b, h, t):
    """Return A, I of bending along h, I along b, J (Bredt) and the shear coefficient."""
    inner = b - 2 * t, h - 2 * t
    wall = 2 * t * ((b - t) * (h - t)) ** 2 / (b + h - 2 * t)
    both = [(x * y**3 - u * v**3) / 12 for x, y, u, v in ((b, h, *inner), (h, b, *inner[::-1]))]
    return b * h - inner[0] * inner[1], *both, wall, 0.45


ROD = (np.pi * 0.01**2, np.pi * 0.01**4 / 4, np.pi * 0.01**4 / 4, np.pi * 0.01**4 / 2, 0.89)
COLUMN, RING, CROSS = tube(0.05, 0.05, 0.003), tube(0.04, 0.06, 0.003), tube(0.03, 0.05, 0.003)
FEET = [(0, 0, 0), (0.9, 0, 0), (0.9, 0.6, 0), (0, 0.6, 0)]
TOP = [(x, y, 0.8) for x, y, _ in FEET]
FRONT, BACK, UP = (0.45, 0, 0.8), (0.45, 0.6, 0.8), (0, 0, 1)
LINES = [(COLUMN, FEET[k], TOP[k], (1, 0, 0)) for k in range(4)]
LINES += [(RING, a, b, UP) for a, b in ((TOP[0], FRONT), (FRONT, TOP[1]), (TOP[1], TOP[2]))]
LINES += [(RING, a, b, UP) for a, b in ((TOP[2], BACK), (BACK, TOP[3]), (TOP[3], TOP[0]))]
LINES += [(CROSS, FRONT, BACK, UP), (ROD, FEET[3], TOP[2], (0, 1, 0))]

PLACES = {  # node of the test: position [m], directions of its accelerometers
    1: ((0, 0, 0.8), "xy"),
    2: ((0.9, 0, 0.8), "y"),
    3: ((0.9, 0.6, 0.8), "x"),
    4: ((0.45, 0.15, 0.8), "xz"),
    5: ((0.45, 0.45, 0.8), "z"),
    6: ((0.9, 0.3, 0.8), "z"),
    7: ((0.9, 0.6, 0.4), "xy"),
    8: ((0.45, 0.6, 0.4), "z"),
}
HAMMER = ("1x", "2y", "4z")
FREQUENCY = np.arange(5.0, 150.25, 0.5)


def matrices(hidden=HIDDEN):
    """Return K [N/m] and M [kg] by OpenSees, (n, n), and the node of each place."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    nodes, n_elements = {}, 0

    def node(p):
        key = tuple(np.round(p, 9).tolist())
        if key not in nodes:
            nodes[key] = len(nodes) + 1
            ops.node(nodes[key], *key)
        return nodes[key]

    for k, ((A, Ih, Ib, J, shear), a, b, h_axis) in enumerate(LINES, 1):
        n = round(np.linalg.norm(np.subtract(b, a)) / PIECE)
        tags = [node(p) for p in np.linspace(a, b, n + 1)]
        if (a, b) == (FRONT, BACK):  # the bolted end has a node of its own
            tags[0] = len(nodes) + 1
            nodes["end"] = tags[0]
            ops.node(tags[0], *FRONT)
        x = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        ops.geomTransf("Linear", k, *np.cross(x, h_axis).tolist())
        for i, j in pairwise(tags):  # h is along local y
            n_elements += 1
            G = E / 2 / (1 + NU)
            section = (E, G, A, J, Ib, Ih, shear * A, shear * A)
            per_length = ("-mass", RHO * A, "-cMass")
            ops.element("ElasticTimoshenkoBeam", n_elements, i, j, *section, k, *per_length)
    ops.system("FullGeneral")
    ops.numberer("Plain")
    ops.constraints("Plain")
    ops.algorithm("Linear")
    out = []
    for mass, stiffness in ((0.0, 1.0), (1.0, 0.0)):
        ops.integrator("GimmeMCK", mass, 0.0, stiffness)
        ops.analysis("Transient")
        ops.analyze(1, 0.0)  # solving fails, as K is singular without the feet; the matrix is there
        out.append(np.array(ops.printA("-ret")).reshape(6 * len(nodes), 6 * len(nodes)))
    K, M = out
    for p in FEET:
        i = 6 * (node(p) - 1)
        K[range(i, i + 6), range(i, i + 6)] += FOOT
    spring = np.diag([RIGID[0]] * 3 + [hidden, RIGID[1], RIGID[1]])
    pair = [6 * (tag - 1) + d for tag in (node(FRONT), nodes["end"]) for d in range(6)]
    K[np.ix_(pair, pair)] += np.block([[spring, -spring], [-spring, spring]])
    mass, (rx, ry, rz), inertia = BODY
    arm = np.eye(6)
    arm[:3, 3:] = [[0, rz, -ry], [-rz, 0, rx], [ry, -rx, 0]]
    i = 6 * (node((0.45, 0.3, 0.8)) - 1)
    M[i : i + 6, i : i + 6] += arm.T @ np.diag([mass] * 3 + list(inertia)) @ arm
    return K, M, {n: node(p) for n, (p, _) in PLACES.items()}


def main():
    """Write frf.uff."""
    K, M, node = matrices()
    w2, phi = eigh(K, M, subset_by_index=[0, 149])
    print(np.sqrt(w2[:20]) / 2 / np.pi)
    channels = [f"{n}{d}" for n, (_, directions) in PLACES.items() for d in directions]
    at = {c: phi[6 * (node[int(c[:-1])] - 1) + "xyz".index(c[-1])] for c in channels}
    out, force = (np.array([at[c] for c in names]) for names in (channels, HAMMER))
    w, wn = 2 * np.pi * FREQUENCY[:, None], np.sqrt(w2)
    gain = -(w**2) / (wn**2 - w**2 + 2j * ZETA * wn * w)
    H = np.einsum("im,fm,jm->fij", out, gain, force)
    noise = np.random.default_rng(7).standard_normal((2, *H.shape))
    H *= 1 + 0.01 * (noise[0] + 1j * noise[1])
    frf = FRF.from_arrays(FREQUENCY, H, "accelerance", channels, list(HAMMER))
    geometry = Points(np.array(list(PLACES)), np.array([p for p, _ in PLACES.values()], dtype=float))
    labels = {c: f"{c[:-1]}{c[-1].upper()}+" for c in channels}
    write_uff(Path(__file__).parent / "frf.uff", frf, geometry=geometry, double=False, dofs=labels)


if __name__ == "__main__":
    main()
