"""Time and memory of 20 modes by SLEPc and MUMPS in one and two processes, beside Dovetail's own solver.

    DOVETAIL_MPI="mpirun -n 2 /usr/bin/python3" python -m benchmarks.processes [--cube n …] [--tower n_free …]

The last word of `DOVETAIL_MPI` is a Python with slepc4py. A cube has n³ points; a tower has 4 x 4 columns and
as many storeys as give the number of coordinates. Each solver runs in processes of its own, from the same
files of K and M, so that peak memory is the solver's. Seconds are those of the processors, of all processes
together; compare the ratios within a row. `--processes 1 2` chooses the numbers of processes.

`--whole` computes modes as a user does, by `solve_modes` of a model, in a process of its own for each
number of SLEPc's processes, 0 for Dovetail's own solver. Peaks are those of that process with the model
alone, of that process, and of SLEPc's largest. The difference is the largest of the 20 frequencies from
those of the first row.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from benchmarks.modes import block_of_cells
from fem import Model, assemble, solve_modes
from fem.linalg.lanczos import lowest_eigenpairs
from fem.linalg.processes import command, lowest_by_processes
from fem.linalg.solvers import SLEPC, factorise, one_thread

N_MODES = 20


def shift_of(K, M) -> float:
    """Return a shift below all modes of a clamped structure, as small as rounding allows."""
    return -1e-14 * float(K.diagonal().sum() / M.diagonal().sum())


def solve_own(folder: Path) -> None:
    """Solve the problem of a folder by Dovetail's own solver, and write what it took."""
    K, M = (sp.load_npz(folder / f"{name}.npz") for name in "KM")
    shift, start = shift_of(K, M), time.process_time()
    with one_thread():
        factor = factorise(sp.csc_array(K - shift * M))
        factored = time.process_time()
        pairs = lowest_eigenpairs(factor.solve, M.tocsr(), shift, N_MODES)
    found = {
        "seconds": time.process_time() - start,
        "factor": factored - start,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "eigenvalues": pairs.eigenvalues[:N_MODES].tolist(),
    }
    np.save(folder / "own.npy", pairs.vectors[:, :N_MODES])
    (folder / "own.json").write_text(json.dumps(found))


def quotients(K, M, X) -> np.ndarray:
    """Return Rayleigh's quotients of vectors in extended precision."""
    squares = np.zeros((2, X.shape[1]), np.longdouble)
    for k, A in enumerate((sp.csr_array(K), sp.csr_array(M))):
        for first in range(0, A.shape[0], 4096):
            part = A[first : first + 4096].tocoo()
            values = part.data.astype(np.longdouble)
            for j in range(X.shape[1]):
                squares[k, j] += (values * X[first + part.row, j] * X[part.col, j]).sum()
    return (squares[0] / squares[1]).astype(float)


def rows(name: str, model, processes: list[int], extended: bool) -> None:
    """Print the lines of one model."""
    system = assemble(model)
    K, M, shift = system.K, system.M, shift_of(system.K, system.M)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for word, A in (("K", K), ("M", M)):
            sp.save_npz(folder / f"{word}.npz", A, compressed=False)
        subprocess.run([sys.executable, "-m", "benchmarks.processes", "--own", scratch], check=True)
        ours = json.loads((folder / "own.json").read_text())
        vectors = np.load(folder / "own.npy")
    lam, head = np.array(ours["eigenvalues"]), f"{name:>6}{system.n_free:9d}"
    exact = quotients(K, M, vectors) if extended else lam
    print(
        f"{head}  {'own':8}{ours['factor']:10.1f}{ours['seconds']:10.1f}{1.0:8.2f}"
        f"{ours['peak'] / 2**30:9.2f}{'':9}{np.abs(lam / exact - 1).max() / 2:12.1e}",
        flush=True,
    )
    python = command()[-1]
    for n in processes:
        start = (*command()[:-3], "-n", str(n), python)
        found = lowest_by_processes(K, M, shift, N_MODES, np.zeros((system.n_free, 0)), start)
        values = found.pairs.eigenvalues
        theirs = quotients(K, M, found.pairs.vectors) if extended else values
        seconds = sum(found.cpu_seconds)
        peak = [p / 2**30 for p in found.peak_bytes]
        print(
            f"{head}  {f'SLEPc {n}':8}{found.factor_seconds:10.1f}{seconds:10.1f}"
            f"{seconds / ours['seconds']:8.2f}{max(peak):9.2f}{sum(peak):9.2f}"
            f"{np.abs(values / exact - 1).max() / 2:12.1e}{np.abs(theirs / exact - 1).max() / 2:12.1e}",
            flush=True,
        )


def model_of(kind: str, size: int) -> Model:
    """Return the cube of size³ points, or the tower of about as many coordinates."""
    return block_of_cells(size, size, size) if kind == "cube" else block_of_cells(4, 4, size // 96 + 1)


def user(kind: str, size: int) -> dict:
    """Compute 20 modes by the solver that the environment chooses, and return what it took."""
    start = time.process_time()
    system = assemble(model_of(kind, size))
    built, peak = time.process_time(), peak_memory()
    started = time.perf_counter()
    modes = solve_modes(system, N_MODES)
    others = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "n_free": system.n_free,
        "model": built - start,
        "model_peak": peak,
        "modes": time.process_time() - built + others.ru_utime + others.ru_stime,
        "wall": time.perf_counter() - started,
        "peak": peak_memory(),
        "others": others.ru_maxrss * 1024,
        "frequency": modes.frequency.tolist(),
    }


def peak_memory() -> int:
    """Return the peak memory of this process [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def print_model_times(kind: str, size: int, processes: list[int]) -> None:
    """Print the lines of one model, each solver in a process of its own."""
    first = None
    for n in processes:
        chosen = {"DOVETAIL_MPI": " ".join((*command()[:-3], "-n", str(n), command()[-1]))}
        chosen |= {"DOVETAIL_SOLVER": SLEPC}
        words = [sys.executable, "-m", "benchmarks.processes", "--user", kind, str(size)]
        done = subprocess.run(
            words, env=os.environ | (chosen if n else {}), check=True, stdout=subprocess.PIPE, text=True
        )
        found = json.loads(done.stdout)
        frequency = np.array(found["frequency"])
        first = frequency if first is None else first
        print(
            f"{kind:>6}{found['n_free']:9d}  {f'SLEPc {n}' if n else 'own':8}"
            f"{found['model']:10.1f}{found['modes']:10.1f}{found['wall']:10.1f}"
            f"{found['model_peak'] / 2**30:9.2f}{found['peak'] / 2**30:9.2f}"
            f"{(found['others'] if n else 0) / 2**30:9.2f}"
            f"{frequency[0]:14.8g}{np.abs(frequency / first - 1).max():12.1e}",
            flush=True,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="time modes by SLEPc and MUMPS")
    parser.add_argument("--cube", type=int, nargs="*", default=[])
    parser.add_argument("--tower", type=int, nargs="*", default=[])
    parser.add_argument("--processes", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--extended", action="store_true", help="compare in extended precision")
    parser.add_argument("--whole", action="store_true", help="models and modes as a user computes them")
    parser.add_argument("--own", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--user", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.user:
        print(json.dumps(user(given.user[0], int(given.user[1]))))
        return
    if given.whole:
        print(
            " model   n_free  solver   model [s] modes [s]  wall [s]   model    peak    SLEPc [GiB]"
            "  first [Hz]  difference"
        )
        for kind, sizes in (("cube", given.cube), ("tower", given.tower)):
            for size in sizes:
                print_model_times(kind, size, given.processes)
        return
    if given.own:
        solve_own(given.own)
        return
    print(" model   n_free  solver     factor [s] CPU [s]   ratio  largest  together [GiB]  difference")
    for n in given.cube or ([] if given.tower else [12, 17]):
        rows("cube", model_of("cube", n), given.processes, given.extended)
    for n in given.tower or ([] if given.cube else [30_000]):
        rows("tower", model_of("tower", n), given.processes, given.extended)


if __name__ == "__main__":
    main()
