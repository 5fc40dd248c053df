"""Lowest eigenpairs of K φ = λ M φ by SLEPc, with K - σM factorised by MUMPS: a separate program.

    mpirun -n N python slepc_program.py FOLDER

It needs petsc4py, slepc4py and NumPy, and nothing of Dovetail, so that it runs under another Python: that of
a cluster or of Debian. :mod:`fem.linalg.processes` writes ``problem.json``, ``K.petsc`` and ``M.petsc`` into
the folder and reads ``found.json`` and ``vectors.npy``. All processes must see the folder.
"""

import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

FIRST = 1e-4
"""The first search goes to this part of the residual that is asked for, relative to the largest ν [-].

Some further steps cost less than a second search, which begins anew."""

METIS, SCOTCH, MINIMUM_FILL = 5, 3, 2
"""MUMPS' numbers of orderings."""

ROUNDING = 1e-16
"""Residuals are not below this part of the largest ν [-]."""

STEPS = 5
"""Steps of the power method that estimate the largest ν [-]."""

EQUAL = 1e-8
"""Values of ν closer than this, relatively, count as one repeated value."""

TRIES = 10
"""Searches at most for pairs that the count says were missed."""


def main(folder: Path) -> None:
    """Solve the problem of a folder."""
    import slepc4py  # pyright: ignore[reportMissingImports]

    slepc4py.init()
    from petsc4py import PETSc  # pyright: ignore[reportMissingImports]

    start_time = time.perf_counter()
    problem = json.loads(Path(folder, "problem.json").read_text())
    K, M = (_matrix(PETSc, folder / f"{name}.petsc") for name in "KM")
    first, last = K.getOwnershipRange()
    known = []
    for column in np.load(folder / "known.npy", mmap_mode="r").T:
        v = K.createVecLeft()
        v.setArray(column[first:last])
        known.append(v)
    n, shift = problem["n"], problem["shift"]
    eps = _solver(K, M, shift)
    n_below = eps.getST().getKSP().getPC().getFactorMatrix().getInertia()[0]
    factored = time.perf_counter()
    size = _largest(eps, M, known) if n_below == 0 else 0.0
    tolerance = problem["tolerance"]
    pairs = _search(eps, n, known, size, tolerance) if n_below == 0 else []
    n_known = len(known)
    for _ in range(TRIES if pairs else 0):
        lam = np.array([value for value, _, _ in pairs])
        k = _complete(lam, n, shift)
        if not k:
            break
        mu = lam[k - 1] + 0.1 * ((lam[k] if k < len(lam) else lam[k - 1] + abs(lam[k - 1])) - lam[k - 1])
        count = _count(PETSc, K, M, mu) - (n_known if mu > 0 else 0)
        if count <= k:
            break
        found = [v for _, v, _ in pairs]
        more = _search(eps, count - k, known + found, size, tolerance)
        pairs = sorted(pairs + more, key=lambda pair: pair[0])
    _write(PETSc, folder, pairs[: n + 1], n_below, start_time, factored, K)


def _matrix(PETSc: Any, file: Path) -> Any:
    A = PETSc.Mat().create()
    A.setType("aij")
    A.load(PETSc.Viewer().createBinary(str(file), "r"))
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    A.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
    return A


def _ordering(PETSc: Any) -> int:
    """Return the number of a nested dissection that this MUMPS was built with, or of minimum fill.

    Without METIS MUMPS chooses PORD, which fills slender structures five times as much as minimum fill.
    """
    options, key = PETSc.Options("probe_"), "mat_mumps_icntl_7"
    n = 1000
    for wanted in (METIS, SCOTCH):
        options[key] = wanted
        A = PETSc.Mat().createAIJ((n, n), nnz=3, comm=PETSc.COMM_SELF)
        for i in range(n):
            A.setValue(i, i, 2.0)
            if i:
                A.setValue(i, i - 1, -0.5)
                A.setValue(i - 1, i, -0.5)
        A.assemble()
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOptionsPrefix("probe_")
        ksp.setOperators(A)
        _factored(ksp)
        ksp.setUp()
        used = ksp.getPC().getFactorMatrix().getMumpsInfog(7)
        ksp.destroy()
        if used == wanted:
            return wanted
    return MINIMUM_FILL


def _options(PETSc: Any) -> None:
    options, ordering = PETSc.Options(), _ordering(PETSc)
    for prefix in ("", "st_"):  # of the count's solver, and of SLEPc's
        # The inertia needs the last front factorised without ScaLAPACK.
        options[f"{prefix}mat_mumps_icntl_13"] = 1
        options[f"{prefix}mat_mumps_icntl_24"] = 1  # PETSc gives no inertia without its count of null pivots
        options[f"{prefix}mat_mumps_icntl_7"] = ordering
        options[f"{prefix}mat_mumps_icntl_14"] = 40  # per cent of memory beyond the estimate, for pivots


def _factored(ksp: Any) -> None:
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")


def _solver(K: Any, M: Any, shift: float) -> Any:
    """Return SLEPc's solver with K - σM factorised."""
    from petsc4py import PETSc  # pyright: ignore[reportMissingImports]
    from slepc4py import SLEPc  # pyright: ignore[reportMissingImports]

    _options(PETSc)
    eps = SLEPc.EPS().create(K.comm)
    eps.setOperators(K, M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(shift)
    # Relative to λ, as in SLEPc's default test, the residual of the inverse would depend on the unit of time.
    eps.setConvergenceTest(SLEPc.EPS.Conv.ABS)
    st = eps.getST()
    st.setType("sinvert")
    st.setShift(shift)
    st.setMatStructure(PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    _factored(st.getKSP())
    eps.setUp()
    return eps


def _largest(eps: Any, M: Any, known: list[Any]) -> float:
    """Return about the largest ν of the vectors that are M-orthogonal to those known."""
    ksp, x, y = eps.getST().getKSP(), M.createVecLeft(), M.createVecLeft()
    x.setRandom()
    largest = 1.0
    for _ in range(STEPS):
        M.mult(x, y)
        for v in known:
            x.axpy(-v.dot(y), v)
        M.mult(x, y)
        norm = x.dot(y) ** 0.5
        y.scale(1 / norm)
        ksp.solve(y, x)
        largest = abs(x.dot(y))
    return float(largest)


def _search(
    eps: Any, n: int, known: list[Any], size: float, tolerance: float
) -> list[tuple[float, Any, float]]:
    """Return n pairs besides those known, and further ones that SLEPc has found, with their residuals."""
    K, shift = eps.getOperators()[0], eps.getTarget()
    eps.setDeflationSpace(known)
    worst, absolute = np.inf, FIRST * tolerance * size
    while absolute > ROUNDING * size:
        eps.setDimensions(min(n + 1, K.getSize()[0] - len(known)))  # also takes SLEPc back to its beginning
        eps.setTolerances(absolute, 1000)
        eps.solve()
        v, out = K.createVecLeft(), []
        for i in range(eps.getConverged()):
            value = eps.getEigenpair(i, v).real
            out.append((value, v.copy(), float(eps.getErrorEstimate(i) * abs(value - shift))))
        out.sort(key=lambda pair: pair[0])
        worst = max((residual for _, _, residual in out[:n]), default=np.inf)
        if worst <= tolerance:
            return out
        smallest = 1 / (out[min(n, len(out)) - 1][0] - shift) if out else size
        absolute = min(absolute / 2, tolerance * smallest / 2)
    msg = f"residuals of {worst:.1e} remain, where {tolerance:.0e} is asked for"
    raise ArithmeticError(msg)


def _complete(lam: Any, n: int, shift: float) -> int:
    """Return of how many of the first n pairs the last is apart from the next, so that it can be counted."""
    nu = 1 / (np.asarray(lam) - shift)
    apart = np.append(nu[1:] < nu[:-1] * (1 - 100 * EQUAL), len(nu) <= n)
    return int(np.flatnonzero(apart).max(initial=-1)) + 1


def _count(PETSc: Any, K: Any, M: Any, mu: float) -> int:
    """Return the number of eigenvalues below μ, by the inertia of K - μM."""
    A = K.copy()
    A.axpy(-mu, M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOperators(A)
    _factored(ksp)
    ksp.setUp()
    count = ksp.getPC().getFactorMatrix().getInertia()[0]
    ksp.destroy()
    return int(count)


def _write(
    PETSc: Any, folder: Path, pairs: list[Any], n_below: int, start_time: float, factored: float, K: Any
) -> None:
    comm, file = PETSc.COMM_WORLD, folder / "vectors.npy"
    size, (first, last) = K.getSize()[0], K.getOwnershipRange()
    if comm.rank == 0:
        np.lib.format.open_memmap(file, "w+", float, (size, len(pairs)), fortran_order=True).flush()
    comm.barrier()
    if pairs:
        vectors = np.lib.format.open_memmap(file, "r+")
        for k, (_, v, _) in enumerate(pairs):
            vectors[first:last, k] = v.getArray()
        vectors.flush()
    used = resource.getrusage(resource.RUSAGE_SELF)
    usage = {
        "cpu_seconds": used.ru_utime + used.ru_stime,
        "peak_bytes": 1024 * used.ru_maxrss,
        "factor_seconds": factored - start_time,
        "seconds": time.perf_counter() - start_time,
    }
    Path(folder, f"process-{comm.rank}.json").write_text(json.dumps(usage))
    comm.barrier()
    if comm.rank == 0:
        found = {
            "eigenvalues": [value for value, _, _ in pairs],
            "residual": [error for _, _, error in pairs],
            "n_below": int(n_below),
            "processes": [
                json.loads(Path(folder, f"process-{k}.json").read_text()) for k in range(comm.size)
            ],
        }
        Path(folder, "found.json").write_text(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
