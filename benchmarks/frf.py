"""Time FRFs: of lattices against their modes, of a joint's change, and of a full receptance matrix.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.frf [points per side …]

Seconds depend on the machine; ratios within a row are what to compare.
"""

import sys
import time

import numpy as np

from benchmarks.engine import cross_beam, seconds
from benchmarks.lattice import lattice
from fem import Joint, assemble, compute_frf, dof_vectors, frf_blocks, solve_modes
from fem.reduction import LocalChanges, ParametricFRF, reduce_model


def lattice_row(n: int, damped: bool) -> str:
    """Return one line of the table of lattices: 20 × 2 FRFs at 1000 lines up to the 13th mode."""
    model = lattice(n)
    if damped:
        top, C = n**3 - 1, np.diag([300.0, 200.0, 100.0, 1.0, 1.0, 1.0])
        place = model.mesh.points[top]
        model = model.with_effect(Joint(name="damper", point1=top, point2=top - 2, location=place, C=C))
    system = assemble(model)
    modes = seconds(lambda: solve_modes(system, 20))
    f = np.linspace(1.0, float(solve_modes(system, 20).frequency[12]), 1000)
    out = [(int(p), "x") for p in np.random.default_rng(0).permutation(n**3)[:20]]
    out = [(p, d) for p, d in out if model.mesh.points[p, 2] > 0]
    frf = compute_frf(system, f, out, out[:2])
    reduced = seconds(lambda: compute_frf(system, f, out, out[:2]))
    some = np.array([100, 555, 999])
    start = time.perf_counter()
    exact = compute_frf(system, f[some], out, out[:2], method="direct").H
    direct = (time.perf_counter() - start) / some.size * f.size
    error = (abs(frf.H[some] - exact) / abs(frf.H).max(axis=0)).max()
    assert frf.accuracy is not None
    line = (
        f"{system.n_free:8d}{'yes' if damped else 'no':>7s}{modes:9.2f}{reduced:9.2f}{reduced / modes:8.2f}"
    )
    return line + f"{frf.accuracy.n_vectors:9d}{error:10.1e}{frf.accuracy.worst:10.1e}{direct / reduced:9.0f}"


def joint_change() -> str:
    """Return the time of a change of a joint's six stiffnesses, 20 × 2 FRFs at 1600 lines, 252 DOFs."""
    model = cross_beam(0.04)
    f = np.linspace(5.0, 1600.0, 1600)
    out = dof_vectors(model, [(p, d) for p in range(6) for d in "xyz"] + [(0, "rx"), (5, "rz")])[0]
    inn = dof_vectors(model, [(0, "z"), (5, "x")])[0]
    sides = np.eye(model.n_dof)[:, [6 * p + d for p in (1, 4) for d in range(6)]]
    reduced = reduce_model(model, np.hstack([inn, sides]), f[-1], margin=2.5)
    engine = ParametricFRF(reduced, out, inn, f, [])
    full = seconds(lambda: engine.evaluate(np.zeros(0), np.zeros(f.size), gradient=False), 10)
    state = LocalChanges.of(engine, np.zeros(0), np.zeros(f.size))
    K = np.diag([5e7, 5e7, 1e7, 3e3, 3e3, 5e3])
    changes = [
        Joint(name="change", point1=1, point2=4, location=np.array([0, 0, 0.005]), K=x * K)
        for x in np.linspace(0.1, 1.0, 20)
    ]
    one = min(seconds(lambda c=c: state.receptances([c])) for c in changes * 3)
    return (
        f"{model.n_dof} DOFs: {1e3 * one:.2f} ms; all parameters anew, without gradient: {1e3 * full:.2f} ms"
    )


def full_matrix() -> str:
    """Return the rate of a full receptance matrix, in units of that of a large real product.

    Counted are the two real products that it takes of all modes without use of symmetry, 2 · 2 n² m for each
    line.
    """
    system = assemble(cross_beam(0.04))
    n = system.model.n_dof
    f = np.linspace(5.0, 1600.0, 1600)
    A = np.random.default_rng(0).standard_normal((1500, 1500))
    B = np.empty_like(A)

    def run() -> None:
        for _ in frf_blocks(system, f, range(n), range(n), "receptance"):
            pass

    rates = []
    for _ in range(3):  # side by side, as other work on the machine comes and goes
        gemm = 2 * 1500**3 / seconds(lambda: np.matmul(A, A, out=B), 2)
        rates.append((4.0 * n**2 * system.n_free * f.size / seconds(run), gemm))
    rate, gemm = max(rates, key=lambda r: r[0] / r[1])
    return f"{n} x {n} x {f.size}: {rate / 1e9:.1f} GFlop/s, {rate / gemm:.2f} of dgemm's {gemm / 1e9:.1f}"


if __name__ == "__main__":
    print("a joint's change,", joint_change(), flush=True)
    print("full receptance,", full_matrix(), flush=True)
    print(
        "\nlattices: 20 modes, and 20 x 2 FRFs at 1000 lines; times in seconds; error and bound of the peak;"
    )
    print("direct: one factorisation for each line (from 3 of them) in units of the FRFs\n")
    print("  n_free damper    modes     FRFs   ratio  vectors     error     bound   direct")
    for size in [int(a) for a in sys.argv[1:]] or [6, 10]:
        for damped in (False, True):
            print(lattice_row(size, damped), flush=True)
