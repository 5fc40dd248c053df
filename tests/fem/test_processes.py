"""Modes by SLEPc and MUMPS in two processes, where they are installed: the same, all repeated ones too."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from benchmarks.modes import block_of_cells
from fem import assemble
from fem.analysis.modes import solve_modes
from fem.linalg.processes import ProcessesError, _reason, lowest_by_processes, write_petsc

DEBIAN = {
    f"{name}_DIR": str(path)
    for name in ("PETSC", "SLEPC")
    for path in Path("/usr/lib", f"{name.lower()}dir").glob(f"{name.lower()}3.*/*-real")
}
"""Folders of Debian's packages, whose Python is Debian's."""


@cache
def python() -> str:
    """Return a Python with slepc4py, or nothing."""
    for candidate in (sys.executable, "/usr/bin/python3"):
        clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        words = [candidate, "-c", "import slepc4py; slepc4py.init(); from petsc4py import PETSc"]
        if Path(candidate).exists() and not subprocess.run(words, env=clean, capture_output=True).returncode:
            return candidate
    return ""


@pytest.fixture
def two(monkeypatch):
    """Choose SLEPc in two processes, or skip the test."""
    for name, folder in DEBIAN.items():
        if name not in os.environ:
            monkeypatch.setenv(name, folder)
    if not shutil.which("mpirun") or not python():
        pytest.skip("mpirun, petsc4py and slepc4py are not installed")
    # Open MPI's own words for a machine of few cores, and for root in a container
    for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_mpi_yield_when_idle"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("OMPI_MCA_rmaps_base_oversubscribe", "1")
    monkeypatch.setenv("DOVETAIL_MPI", f"mpirun -n 2 {python()}")
    monkeypatch.setenv("DOVETAIL_SOLVER", "slepc")


@pytest.mark.slow
def test_two_processes_find_the_same_modes(two, monkeypatch):
    system = assemble(block_of_cells(4, 4, 5))  # a square tower: bending modes come in pairs
    theirs = solve_modes(system, 20)
    monkeypatch.delenv("DOVETAIL_SOLVER")
    ours = solve_modes(system, 20)
    np.testing.assert_allclose(theirs.frequency, ours.frequency, rtol=1e-9)
    X, M = system.Q.T @ theirs.shapes, system.M
    np.testing.assert_allclose(X.T @ (M @ X), np.eye(20), atol=1e-9)


def test_a_repeated_eigenvalue_is_found_as_often_as_it_is_there(two, monkeypatch):
    monkeypatch.setenv("DOVETAIL_MPI", python())  # one process
    path = sp.diags_array([-np.ones(79), np.full(80, 2.0), -np.ones(79)], offsets=[-1, 0, 1])
    K, M = sp.kron(sp.eye_array(9), path, format="csc"), sp.eye_array(720, format="csc")
    found = lowest_by_processes(K, M, -1e-3, 20, np.zeros((720, 0)))
    exact = np.repeat(2 - 2 * np.cos(np.arange(1, 4) * np.pi / 81), 9)[:20]
    np.testing.assert_allclose(found.pairs.eigenvalues, exact, rtol=1e-9)
    assert found.n_below == 0
    assert len(found.cpu_seconds) == 1
    assert lowest_by_processes(K, M, 0.01, 3, np.zeros((720, 0))).n_below == 18


def test_a_command_that_cannot_be_started_is_named():
    K = sp.eye_array(3, format="csc")
    with pytest.raises(ProcessesError, match="DOVETAIL_MPI='no-such-mpirun -n 2' cannot be started"):
        lowest_by_processes(K, K, -1.0, 1, np.zeros((3, 0)), ("no-such-mpirun", "-n", "2"))
    with pytest.raises(ProcessesError, match="lacks petsc4py or slepc4py"):
        lowest_by_processes(K, K, -1.0, 1, np.zeros((3, 0)), (sys.executable, "-I", "-S"))
    assert _reason("[0] Traceback\nx.Error: error code 62\n[0] PCSetUp()\n[0] no room\nmore") == (
        "x.Error: error code 62 [0] no room"
    )


def test_matrices_are_written_as_petsc_reads_them(tmp_path):
    """Its manual: the mark, rows, columns, entries; entries of each row; columns; values; all big-endian."""
    K = sp.csc_array(np.array([[2.0, 0.0], [0.0, 3.0]]))
    M = sp.csc_array(np.array([[1.0, 0.5], [0.5, 1.0]]))
    write_petsc(tmp_path / "K", K, like=M)
    data = (tmp_path / "K").read_bytes()
    head = np.frombuffer(data, ">i4", 10).tolist()
    assert head == [1211216, 2, 2, 4, 2, 2, 0, 1, 0, 1]
    assert np.frombuffer(data, ">f8", offset=40).tolist() == [2, 0, 0, 3]
