"""Make the data of this folder with CalculiX.

Run `python tests/data/bracket/make_bracket.py` from the repository's root.

Wanted is `ccx` on the path (made with 2.20). Everything in the decks is in mm, t, s, N, MPa.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2]))

from fem.io.matrices import read_calculix, write_matrices  # noqa: E402

ALUMINIUM = (
    "*MATERIAL, NAME=AL\n*ELASTIC\n70000., 0.33\n*DENSITY\n2.7E-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=AL\n"
)
EXPORT = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n\n*END STEP\n"
HELD = "*BOUNDARY\nTOP, 1, 3\n"
N_MODES = 26
ASKED = 40
"""CalculiX stops at a tolerance of 1 %: of many modes asked for, the lowest have all their digits."""
GAP = 5.0
"""Between the faces of the two brackets [mm]."""


def bricks(counts, size, keep=lambda i, j, k: True, quadratic=True):
    """Return nodes (n, 3) and elements of a box of hexahedra, some left out; nodes count from 1."""
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    sides = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    number, nodes, elements = {}, [], []
    for i, j, k in np.ndindex(*counts):
        if not keep(i, j, k):
            continue
        at = [tuple(int(v) for v in np.add(c, (2 * i, 2 * j, 2 * k))) for c in corners]
        if quadratic:
            at += [tuple((p + q) // 2 for p, q in zip(at[a], at[b], strict=True)) for a, b in sides]
        for place in at:
            if place not in number:
                number[place] = len(nodes) + 1
                nodes.append([place[d] * size[d] / (2 * counts[d]) for d in range(3)])
        elements.append([number[place] for place in at])
    return np.array(nodes), elements


def bracket():
    """Return the bracket: two legs of 80 x 30 x 20 mm at a right angle, 14 elements C3D20."""
    return bricks((4, 2, 4), (80.0, 30.0, 80.0), lambda i, j, k: i == 0 or k == 0)


def face(nodes, axis, value):
    """Return the numbers of the nodes in a plane."""
    return (np.flatnonzero(abs(nodes[:, axis] - value) < 1e-6) + 1).tolist()


def deck(nodes, elements, kind, end, sets=(), first=""):
    """Return an input deck."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k}, {x:.10g}, {y:.10g}, {z:.10g}" for k, (x, y, z) in enumerate(nodes, start=1)]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=ALL")
    for k, element in enumerate(elements, start=1):
        cells = [str(v) for v in (k, *element)]
        lines += [", ".join(cells[:12]) + ("," if len(cells) > 12 else "")] + [", ".join(cells[12:])] * (
            len(cells) > 12
        )
    for name, numbers in sets:
        lines.append(f"*NSET, NSET={name}")
        lines += [", ".join(map(str, numbers[k : k + 12])) for k in range(0, len(numbers), 12)]
    return "\n".join(lines) + "\n" + ALUMINIUM + first + end


def run(folder, job, text):
    """Run CalculiX; return the natural frequencies that it prints [Hz]."""
    (folder / f"{job}.inp").write_text(text)
    done = subprocess.run(["ccx", job], cwd=folder, capture_output=True, text=True, check=False)
    if "Job finished" not in done.stdout or "*ERROR" in done.stdout:
        raise RuntimeError(done.stdout[-3000:])
    rows = [line.split() for line in (folder / f"{job}.dat").read_text().splitlines()]
    found = [float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()][:N_MODES]
    if found and not found[-1] > 0:
        raise RuntimeError(done.stdout[-3000:])
    return found


def rigid_matrix(places):
    """Return the translations (3 n, 6) of places in rigid motions about their mean."""
    out = np.zeros((3 * len(places), 6))
    for k, (x, y, z) in enumerate(places - places.mean(axis=0)):
        out[3 * k : 3 * k + 3] = [[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]]
    return out


def equations(A, dofs):
    """Return *EQUATION for A u = 0, solved for as many of the degrees of freedom as there are rows."""
    A = A.astype(float)
    pivots = []
    for row in range(len(A)):
        col = max((c for c in range(A.shape[1]) if c not in pivots), key=lambda c, row=row: abs(A[row, c]))
        pivots.append(col)
        A[row] /= A[row, col]
        for other in range(len(A)):
            if other != row:
                A[other] -= A[other, col] * A[row]
    text = []
    for row, col in enumerate(pivots):
        terms = [c for c in np.flatnonzero(abs(A[row]) > 1e-12) if c not in pivots]
        text.append(f"*EQUATION\n{len(terms) + 1}")
        cells = [f"{dofs[c][0]}, {dofs[c][1]}, {A[row, c]:.12e}" for c in (col, *terms)]
        text += [", ".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    return "\n".join(text) + "\n"


def rigid_face(nodes, numbers):
    """Return equations that keep nodes rigid among themselves."""
    T = rigid_matrix(nodes[np.array(numbers) - 1])
    U = np.linalg.svd(T, full_matrices=True)[0]
    return equations(U[:, 6:].T, [(n, d) for n in numbers for d in (1, 2, 3)])


def equal_averages(nodes, ones, others):
    """Return equations that make the mean rigid motions of two sets of nodes, about one point, the same."""
    places = [nodes[np.array(numbers) - 1] for numbers in (ones, others)]
    centre = np.vstack(places).mean(axis=0)
    rows = []
    for place, sign in zip(places, (1, -1), strict=True):
        T = rigid_matrix(np.vstack([place, 2 * centre - place]))[: 3 * len(place)]  # about the centre of both
        rows.append(sign * np.linalg.pinv(T))
    return equations(np.hstack(rows), [(n, d) for n in (*ones, *others) for d in (1, 2, 3)])


def main():
    """Write everything."""
    nodes, elements = bracket()
    ends = {"END": face(nodes, 0, 80.0), "TOP": face(nodes, 2, 80.0)}
    turned = nodes * [-1, -1, 1] + [160.0 + GAP, 30.0, 0.0]
    both = np.vstack([nodes, turned])
    pair = [*elements, *[[n + len(nodes) for n in e] for e in elements]]
    frequency = f"*STEP\n*FREQUENCY\n{ASKED}\n*END STEP\n"
    twins = [ends["END"], [n + len(nodes) for n in ends["END"]]]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = {
            "free": run(folder, "free", deck(nodes, elements, "C3D20", frequency)),
            "held_rigid": run(
                folder,
                "held",
                deck(
                    nodes, elements, "C3D20", frequency, ends.items(), HELD + rigid_face(nodes, ends["END"])
                ),
            ),
            "bolted_rigid": run(
                folder,
                "bolted",
                deck(
                    both,
                    pair,
                    "C3D20",
                    frequency,
                    ends.items(),
                    HELD + rigid_face(both, [*twins[0], *twins[1]]),
                ),
            ),
            "bolted_average": run(
                folder,
                "average",
                deck(both, pair, "C3D20", frequency, ends.items(), HELD + equal_averages(both, *twins)),
            ),
        }
        run(folder, "bracket", deck(nodes, elements, "C3D20", EXPORT, ends.items()))
        write_matrices(HERE / "bracket.npz", read_calculix(folder / "bracket.sti", units="mm-t-s"))
        box = bricks((3, 1, 1), (30.0, 20.0, 10.0), quadratic=False)
        run(folder, "brick", deck(*box, "C3D8", EXPORT, [("BOTTOM", face(box[0], 2, 0.0))]))
        for ending in ("inp", "sti", "mas", "dof"):
            shutil.copy(folder / f"brick.{ending}", HERE)
    results = {"nodes": ends, "gap_mm": GAP, "frequency_Hz": found}
    (HERE / "calculix.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
