"""Modes by SLEPc and MUMPS in two processes, where they are installed: the same, all repeated ones too."""

import json
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
from fem import assemble, solve_modes
from fem.analysis.modes import DENSE_LIMIT
from fem.linalg.processes import ProcessesError, _reason, _run, lowest_by_processes, write_petsc
from fem.linalg.slepc_program import METIS, MINIMUM_FILL, SCOTCH

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


def test_two_processes_find_the_same_modes(two, monkeypatch):
    # a chain of lattice cells: few messages, each of which takes long where other work keeps the cores busy
    system = assemble(block_of_cells(2, 1, 30))
    assert system.n_free > DENSE_LIMIT  # smaller ones are solved here
    theirs = solve_modes(system, 4)
    monkeypatch.delenv("DOVETAIL_SOLVER")
    ours = solve_modes(system, 4)
    np.testing.assert_allclose(theirs.frequency, ours.frequency, rtol=1e-9)
    X, M = system.Q.T @ theirs.shapes, system.M
    np.testing.assert_allclose(X.T @ (M @ X), np.eye(4), atol=1e-9)


WITHOUT_ORDERINGS = """
import importlib.util, json, sys
from pathlib import Path

file, folder = Path(sys.argv[-2]), Path(sys.argv[-1])
spec = importlib.util.spec_from_file_location("program", file)
program = importlib.util.module_from_spec(spec)
spec.loader.exec_module(program)
for name in sys.argv[2:-2]:
    setattr(program, name, 7)  # MUMPS chooses itself, as it does where it lacks what it is asked for
solver = program._solver


def recorded(K, M, shift):
    from petsc4py import PETSc

    eps = solver(K, M, shift)
    factor = eps.getST().getKSP().getPC().getFactorMatrix()
    options = PETSc.Options()
    passed = [options.getInt(f"{prefix}mat_mumps_icntl_7") for prefix in ("", "st_")]
    if K.comm.rank == 0:
        used = [K.comm.size, *passed, factor.getMumpsIcntl(7), factor.getMumpsInfog(7)]
        Path(sys.argv[1]).write_text(json.dumps(used))
    return eps


program._solver = recorded
program.main(folder)
"""
"""Runs the program as if MUMPS lacked the orderings named, and writes what MUMPS was given and has used."""


@pytest.mark.parametrize("lacking", [("METIS", "SCOTCH"), ()], ids=["without", "as installed"])
def test_mumps_takes_minimum_fill_where_it_has_no_nested_dissection(two, lacking, tmp_path):
    (tmp_path / "program.py").write_text(WITHOUT_ORDERINGS)
    used = tmp_path / "used.json"
    start = ("mpirun", "-n", "2", python(), str(tmp_path / "program.py"), str(used), *lacking)
    n = 300
    K = sp.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1], format="csc")
    found = lowest_by_processes(K, sp.eye_array(n, format="csc"), -1e-6, 5, np.zeros((n, 0)), start)
    exact = 2 - 2 * np.cos(np.arange(1, 6) * np.pi / (n + 1))  # of a chain of equal springs and masses
    np.testing.assert_allclose(found.pairs.eigenvalues, exact, rtol=1e-9)
    n_processes, *orderings = json.loads(used.read_text())
    assert n_processes == 2
    assert len(set(orderings)) == 1  # passed to both solvers, taken by MUMPS, and used by it
    if lacking:
        assert orderings[0] == MINIMUM_FILL
    else:
        assert orderings[0] in (METIS, SCOTCH, MINIMUM_FILL)


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


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the stack")
def test_processes_have_as_much_stack_as_may_be(tmp_path):
    import resource

    before = resource.getrlimit(resource.RLIMIT_STACK)
    program = """
import resource, sys
from pathlib import Path
Path(sys.argv[2], "found.json").write_text(str(resource.getrlimit(resource.RLIMIT_STACK)))
"""
    _run((sys.executable, "-c", program), tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_STACK)
    assert (soft, hard) == before
    assert (tmp_path / "found.json").read_text() == str((hard, hard))
