"""Eigenpairs by SLEPc and MUMPS in separate processes, on one machine or several.

The environment variable ``DOVETAIL_MPI`` holds the command that starts them, such as
``mpirun -n 2 /usr/bin/python3``. Its Python needs petsc4py and slepc4py, and need not be the one that runs
Dovetail.
"""

import itertools
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scipy.sparse as sp

from fem.array_types import Floats
from fem.linalg.lanczos import TOLERANCE, RitzPairs
from fem.linalg.solvers import SLEPC, Factor, factorise

_LINES = 3
"""Last lines of a failed process that an error repeats."""


class ProcessesError(RuntimeError):
    """Processes that could not be started, or that failed."""


def is_chosen() -> bool:
    """Whether the environment asks for SLEPc."""
    return os.environ.get("DOVETAIL_SOLVER") == SLEPC


def command() -> tuple[str, ...]:
    """Return the command that starts Python in each process."""
    return tuple(shlex.split(os.environ.get("DOVETAIL_MPI", ""))) or (sys.executable,)


@dataclass(frozen=True, slots=True, eq=False)
class ProcessEigenpairs:
    """Result of the processes.

    Attributes
    ----------
    pairs : RitzPairs
    n_below : int
        Number of eigenvalues below the shift; the pairs are empty if there are any.
    cpu_seconds, peak_bytes : tuple
        Of each process.
    factor_seconds, seconds : float
        Time from reading the matrices until K - σM was factorised, and until the end, of the slowest [s].
    """

    pairs: RitzPairs
    n_below: int
    cpu_seconds: tuple[float, ...]
    peak_bytes: tuple[int, ...]
    factor_seconds: float
    seconds: float


def lowest_by_processes(
    K: Any, M: Any, shift: float, n: int, known: Floats, start: tuple[str, ...] | None = None
) -> ProcessEigenpairs:
    """Compute the n lowest eigenpairs besides known ones by Krylov-Schur iteration.

    The inertia of K - μM, with μ just above the last pair that is apart from the next, counts the eigenvalues
    below. Where it counts more than were found, the missing ones are searched for.

    Parameters
    ----------
    K, M : sparse (n_free, n_free)
    shift : float
        σ, below all eigenvalues.
    n : int
        Number of eigenpairs, those known left out.
    known : ndarray (n_free, k)
        M-orthonormal eigenvectors.
    start : tuple of str, optional
        Command that starts Python in each process; that of the environment unless given.

    Raises
    ------
    ProcessesError
        If they cannot be started, or fail.
    """
    start = start or command()
    with TemporaryDirectory(prefix="dovetail-") as name:
        folder = Path(name)
        write_petsc(folder / "K.petsc", K, like=M)
        write_petsc(folder / "M.petsc", M)
        np.save(folder / "known.npy", np.asfortranarray(known))
        problem = {"n": int(n), "shift": float(shift), "tolerance": TOLERANCE}
        (folder / "problem.json").write_text(json.dumps(problem))
        _run(start, folder)
        found = json.loads((folder / "found.json").read_text())
        vectors = np.load(folder / "vectors.npy")
    eigenvalues, residual = np.array(found["eigenvalues"]), np.array(found["residual"])
    if vectors.shape[1]:
        vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
    following = float(eigenvalues[n]) if len(eigenvalues) > n else np.inf
    usage = found["processes"]
    return ProcessEigenpairs(
        RitzPairs(eigenvalues[:n], vectors[:, :n], residual[:n], following),
        found["n_below"],
        tuple(p["cpu_seconds"] for p in usage),
        tuple(p["peak_bytes"] for p in usage),
        max(p["factor_seconds"] for p in usage),
        max(p["seconds"] for p in usage),
    )


def _run(start: tuple[str, ...], folder: Path) -> None:
    program = Path(__file__).with_name("slepc_program.py")
    # A path of packages for this Python would lead another one to libraries that it cannot load.
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    words = shlex.join(start)
    try:
        with _largest_stack():
            done = subprocess.run(
                [*start, str(program), str(folder)],
                env=environment | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
                capture_output=True,
                text=True,
                check=False,
            )
    except OSError as reason:
        msg = f"DOVETAIL_MPI='{words}' cannot be started ({reason.strerror})"
        raise ProcessesError(msg) from None
    if done.returncode or not (folder / "found.json").is_file():
        if "No module named" in done.stderr:
            msg = (
                f"the Python of DOVETAIL_MPI='{words}' lacks petsc4py or slepc4py; docs/scale.md describes "
                "how they are installed"
            )
            raise ProcessesError(msg)
        msg = f"SLEPc ended with {done.returncode}: {_reason(done.stderr)}"
        raise ProcessesError(msg)


@contextmanager
def _largest_stack() -> Iterator[None]:
    """Start processes with as much stack as may be: with 8 MB MUMPS crashed in two at 3 million DOFs."""
    if sys.platform == "win32":
        yield
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_STACK)
    resource.setrlimit(resource.RLIMIT_STACK, (hard, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_STACK, (soft, hard))


def _reason(text: str) -> str:
    """Return the Python error of the first process that failed, or the last lines of all."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    for k, line in enumerate(lines):
        if re.match(r"[\w.]+(Error|Exception)\b", line):
            # PETSc's message is the last of the lines that begin with a process's number.
            numbered = list(itertools.takewhile(lambda other: other.startswith("["), lines[k + 1 :]))
            return " ".join([line, *numbered[-1:]])
    return " | ".join(lines[-_LINES:]) or "no message"


def write_petsc(file: Path, A: Any, like: Any = None) -> None:
    """Write a sparse matrix as PETSc reads it, with explicit zeros where another one has entries.

    Parameters
    ----------
    file : Path
    A : sparse (n, n)
        Symmetric.
    like : sparse (n, n), optional

    Raises
    ------
    ProcessesError
        For more entries than PETSc's usual 32-bit integers count.
    """
    A = sp.csr_array(A)
    if like is not None:
        ones = sp.csr_array(like)
        ones = sp.csr_array((np.ones(ones.nnz), ones.indices, ones.indptr), shape=ones.shape)
        pattern = sp.csr_array((np.ones(A.nnz), A.indices, A.indptr), shape=A.shape) + ones
        pattern.sort_indices()
        A = _spread(A, pattern)
    A.sort_indices()
    if A.nnz >= 2**31:
        msg = f"the matrix has {A.nnz} entries; PETSc with 32-bit integers takes at most {2**31 - 1}"
        raise ProcessesError(msg)
    with file.open("wb") as out:
        # PETSc's mark of a matrix in a file
        np.array([1211216, *A.shape, A.nnz], ">i4").tofile(out)
        np.diff(A.indptr).astype(">i4").tofile(out)
        A.indices.astype(">i4").tofile(out)
        A.data.astype(">f8").tofile(out)


def _spread(A: Any, pattern: Any) -> Any:
    """Return A with all entries of a pattern that contains those of A."""
    rows = np.repeat(np.arange(A.shape[0], dtype=np.int64), np.diff(pattern.indptr))
    keys = rows * A.shape[1] + pattern.indices
    A = A.copy()
    A.sort_indices()
    entries = np.repeat(np.arange(A.shape[0], dtype=np.int64), np.diff(A.indptr)) * A.shape[1] + A.indices
    data = np.zeros(pattern.nnz)
    data[np.searchsorted(keys, entries)] = A.data
    return sp.csr_array((data, pattern.indices, pattern.indptr), shape=A.shape)


def late_factor(A: Any) -> Factor:
    """Return the factor of a matrix, made in this process when it is first used."""
    made: list[Factor] = []

    def factor() -> Factor:
        if not made:
            made.append(factorise(A))
        return made[0]

    return Factor(lambda b: factor().solve(b), lambda: factor().count_negative(), SLEPC, matrix=A)
