"""Time modes and FRFs of lattices, and what the choices in `fem.solvers` are worth.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.modes_and_frf [points per side …]

Seconds depend on the machine; ratios within a row are what to compare.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from fem import Damping, Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble
from fem.frf import compute_frf
from fem.modes import solve_modes
from fem.solvers import factorise


def lattice(n: int) -> Model:
    """Return a cube of n³ points 1 m apart, one element for each member, its lowest points clamped."""
    index = np.arange(n**3).reshape(n, n, n)
    lines = []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)
        lines.append(np.stack([a[:-1], a[1:]], axis=-1).reshape(-1, 2))
    points = np.argwhere(index >= 0).astype(float)
    mesh = Mesh.from_lines(points, np.concatenate(lines))
    steel = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01))
    feet = [Support(name=f"s{i}", point=int(i)) for i in np.flatnonzero(points[:, 2] == 0)]
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, steel)), *feet), Damping.structural(0.01))


def seconds(call: Callable[[], object]) -> float:
    """Return the time of one call [s]."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def row(n: int) -> str:
    """Return one line of the table."""
    model = lattice(n)
    system = assemble(model)
    build = seconds(lambda: assemble(model))
    shifted = sp.csc_matrix(system.K + system.M)
    ours, default = seconds(lambda: factorise(shifted)), seconds(lambda: splu(shifted))
    modes = seconds(lambda: solve_modes(system, 20))
    top = float(solve_modes(system, 20).frequency[12])
    f = np.linspace(1.0, top, 1000)
    rng = np.random.default_rng(0)
    out = [(int(p), "x") for p in rng.permutation(n**3)[:20]]
    reduced = seconds(lambda: compute_frf(system, f, out, out[:2]))
    direct = seconds(lambda: compute_frf(system, f[:3], out, out[:2], method="direct")) / 3 * len(f)
    columns = [f"{build:9.3f}", f"{ours:9.3f}", f"{default / ours:9.1f}", f"{modes:9.3f}", f"{reduced:9.3f}"]
    return f"{system.n_free:8d}" + "".join(columns) + f"{direct / reduced:12.0f}"


if __name__ == "__main__":
    print("20 modes; 20 x 2 FRFs at 1000 lines; times in seconds; splu: SciPy's defaults in units of ours;")
    print("direct: one factorisation for each line (from 3 of them) in units of the reduced FRFs\n")
    print("  n_free assemble   factor     splu    modes     FRFs      direct")
    for size in [int(a) for a in sys.argv[1:]] or [4, 6, 8, 10]:
        print(row(size), flush=True)
