"""Time modes of cubic lattices and slender towers against SciPy's SuperLU and ARPACK.

Run it with one thread:

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.modes [--grid n …] [--tower n_free …] [--storeys n_free …]

A grid has n³ points, its lowest clamped; a tower has 4 x 4 columns and as many storeys as give the number of
coordinates. Both have members of one element. `--storeys` is the tower put together from the matrices of one
storey, without a model, to try sizes up to `--storeys 3000000`. `--alone` leaves out the reference.

Seconds are those of the processor. They depend on the machine; ratios within a row are what to compare.
"""

import argparse
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from fem.linalg.lanczos import lowest_eigenpairs
from fem.linalg.solvers import factorise, one_thread


def block_of_cells(nx: int, ny: int, nz: int) -> Model:
    """Return a lattice of points 1 m apart, one element for each member, its lowest points clamped."""
    index = np.arange(nx * ny * nz).reshape(nz, ny, nx).transpose(2, 1, 0)
    lines = []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)
        lines.append(np.stack([a[:-1], a[1:]], axis=-1).reshape(-1, 2))
    points = np.empty((index.size, 3))
    points[index.ravel()] = np.argwhere(index >= 0)
    joined = np.concatenate(lines)
    joined = joined[(points[joined, 2] > 0).any(axis=1)]
    mesh = Mesh.from_lines(points, joined)
    steel = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01))
    feet = [Support(name=f"s{i}", point=int(i)) for i in np.flatnonzero(points[:, 2] == 0)]
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, steel)), *feet))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor's time of one call [s], and its result."""
    start = time.process_time()
    result = call()
    return time.process_time() - start, result


def reference(K: Any, M: Any, n: int) -> tuple[float, float, np.ndarray]:
    """Return the times of SuperLU and of ARPACK, and the frequencies."""
    factor, lu = timed(
        lambda: splu(
            sp.csc_matrix(K),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    )
    inverse = LinearOperator(K.shape, matvec=lu.solve, dtype=float)
    arpack, (found, _) = timed(lambda: eigsh(K, k=n, M=M, sigma=0.0, OPinv=inverse, tol=1e-12))
    return factor, arpack, np.sqrt(found) / (2 * np.pi)


def row(name: str, model: Model, n: int, alone: bool) -> str:
    """Return one line of the table."""
    build, system = timed(lambda: assemble(model))
    factoring, factor = timed(lambda: factorise(system.K))
    single, _ = timed(lambda: [factor.solve(np.ones(system.n_free)) for _ in range(4)])

    ours, modes = timed(lambda: solve_modes(system, n))
    words = f"{name:>8}{system.n_free:9d}{build:10.2f}{factoring:9.3f}{single / 4:9.4f}{ours:9.3f}"
    words += f"{ours / (factoring + 16 * single):9.2f}"
    if not alone:
        superlu, arpack, frequency = reference(system.K, system.M, n)
        words += f"{superlu:10.3f}{arpack:9.3f}{(superlu + arpack) / ours:8.1f}"
        words += f"{abs(modes.frequency / frequency - 1).max():10.0e}"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return f"{words}   peak {peak:.2f} GiB"


def storeys(n: int) -> tuple[Any, Any]:
    """Return K and M of a tower of n storeys, from those of one of five."""
    small = assemble(block_of_cells(4, 4, 6))
    out = []
    for A in (small.K.tocsc(), small.M.tocsc()):
        diagonal, top, below = A[96:192, 96:192], A[-96:, -96:], A[192:288, 96:192]
        chain = sp.eye_array(n, k=-1, format="coo")
        last = sp.coo_array(([1.0], ([n - 1], [n - 1])), shape=(n, n))
        matrix = sp.kron(sp.eye_array(n), diagonal) + sp.kron(last, top - diagonal)
        out.append(sp.csc_array(matrix + sp.kron(chain, below) + sp.kron(chain.T, below.T)))
    return out[0], out[1]


def row_of_storeys(n_free: int, n: int) -> str:
    """Return one line of the table."""
    build, (K, M) = timed(lambda: storeys(n_free // 96))
    shift = -1e-14 * float(K.diagonal().sum() / M.diagonal().sum())
    factoring, factor = timed(lambda: factorise(K - shift * M))
    single, _ = timed(lambda: [factor.solve(np.ones(len(K.indptr) - 1)) for _ in range(4)])
    lanczos, pairs = timed(lambda: lowest_eigenpairs(factor.solve, M.tocsr(), shift, n))
    words = f" storeys{K.shape[0]:9d}{build:10.2f}{factoring:9.3f}{single / 4:9.4f}{factoring + lanczos:9.3f}"
    words += f"{(factoring + lanczos) / (factoring + 16 * single):9.2f}"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    high = np.sqrt(pairs.eigenvalues[-1]) / (2 * np.pi)
    return f"{words}   peak {peak:.2f} GiB, mode {n} at {high:.6g} Hz, residual {pairs.residual.max():.0e}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="time modes of lattices and towers")
    parser.add_argument("--grid", type=int, nargs="*", default=[])
    parser.add_argument("--tower", type=int, nargs="*", default=[])
    parser.add_argument("--storeys", type=int, nargs="*", default=[])
    parser.add_argument("--modes", type=int, default=20)
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    if not given.grid and not given.tower and not given.storeys:
        given.grid, given.tower = [8, 12, 17], [30_000]
    head = "   model   n_free  assemble   factor  1 solve    modes  / f+64s"
    print(head + ("" if given.alone else "   SuperLU   ARPACK  ratio  difference"))
    for n in given.grid:
        print(row("grid", block_of_cells(n, n, n), given.modes, given.alone), flush=True)
    for n in given.tower:
        print(row("tower", block_of_cells(4, 4, n // 96 + 1), given.modes, given.alone), flush=True)
    for n in given.storeys:
        with one_thread():
            print(row_of_storeys(n, given.modes), flush=True)


if __name__ == "__main__":
    main()
