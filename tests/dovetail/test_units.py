"""Units on pools of workers: the same numbers everywhere, killed workers, failures, stops and resumption."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from dovetail.units import (
    LOCK_FILE,
    PROCESS_ENDED,
    FolderError,
    Journal,
    Outcome,
    PoolError,
    ThisProcess,
    alone_in,
    duration,
    pool_of,
    read_records,
    work_through,
)

WITH_DASK = importlib.util.find_spec("distributed") is not None
needs_dask = pytest.mark.skipif(not WITH_DASK, reason="the extra 'cluster' (distributed) is not installed")

PROGRAM = """
import json, os, signal, sys, threading, time
from pathlib import Path
import numpy as np
from dovetail.units.pool import ThisProcess, pool_of

def draw(shared, unit):
    folder, seed = shared
    if unit == "broken":
        raise ValueError("no luck\\nat all")
    if unit == "deadly" and folder:
        os.kill(os.getpid(), signal.SIGKILL)
    if unit in (2, 3) and folder:
        Path(folder, f"{unit}-{os.getpid()}").touch()
        time.sleep(1.0 if len(list(Path(folder).glob(f"{unit}-*"))) == 1 else 0.0)
    A = np.random.default_rng((seed, hash(unit) if unit != "deadly" else 0)).normal(size=(40, 40))
    return [os.getpid(), float(np.linalg.eigvalsh(A + A.T)[0])]

def kill_one(folder):
    while not (seen := list(Path(folder).glob("2-*"))):
        time.sleep(0.02)
    os.kill(int(seen[0].name.partition("-")[2]), signal.SIGKILL)

if __name__ == "__main__":
    folder, kind, units = sys.argv[1], sys.argv[2], [0, 1, 2, 3, "broken", 4, 5, 6, 7, *sys.argv[3:]]
    alone = ThisProcess().outcomes(draw, ("", 5), units)
    expected = {o.unit: o.value[1] for o in alone if not o.failure}
    threading.Thread(target=kill_one, args=(folder,), daemon=True).start()
    def compute(**where):
        with pool_of(**where) as pool:
            return list(pool.outcomes(draw, (folder, 5), units))
    if kind == "local":
        got = compute(processes=2)
    else:
        from distributed import LocalCluster
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as two:
            got = compute(scheduler=two.scheduler_address)
    values = {o.unit: o.value[1] for o in got if not o.failure}
    print(json.dumps({
        "units": sorted(str(o.unit) for o in got), "failures": {o.unit: o.failure for o in got if o.failure},
        "same": all(values[u] == expected[u] for u in values), "n": len(values),
        "workers": len({o.value[0] for o in got if not o.failure}),
        "again": len(list(Path(folder).glob("2-*"))),
    }))
"""


def run_program(folder, *arguments):
    program = folder / "program.py"
    program.write_text(PROGRAM)
    marks = folder / "marks"
    marks.mkdir()
    path = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(program), str(marks), *arguments],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
@pytest.mark.parametrize(
    ("kind", "deadly"),
    [
        ("local", ()),
        pytest.param("local", ("deadly",), marks=pytest.mark.slow),
        pytest.param("dask", (), marks=[needs_dask, pytest.mark.slow]),
        pytest.param("dask", ("deadly",), marks=[needs_dask, pytest.mark.slow]),
    ],
)
def test_killing_a_worker_loses_nothing_and_changes_no_number(kind, deadly, tmp_path):
    """One of two workers is killed in a unit; that unit is computed again, and one that kills is listed."""
    got = run_program(tmp_path, kind, *deadly)
    assert got["units"] == sorted([*"01234567", "broken", *deadly])
    assert set(got["failures"]) == {"broken", *deadly}
    assert got["failures"]["broken"] == "no luck at all"
    assert all(got["failures"][unit].startswith(PROCESS_ENDED) for unit in deadly)
    assert got["n"] == 8
    assert got["same"]
    # The unit of the killed worker was begun twice; what Dask's workers hold goes with them as well.
    assert got["again"] == 2 if kind == "local" else got["again"] >= 2
    assert got["workers"] >= 2


def test_what_one_run_has_done_the_next_leaves_out(tmp_path):
    file, told, stops = tmp_path / "units.jsonl", [], [3]

    def square(factor, unit):
        if unit in stops:
            stops.remove(unit)
            raise KeyboardInterrupt
        return {"unit": unit, "square": np.float64(factor * unit**2)}

    def go_on():
        known = read_records(file, {"factor": 2})
        units = [u for u in range(6) if u not in {r["unit"] for r in known}]
        with closing(Journal(file, {"factor": 2})) as journal:
            work_through(
                ThisProcess(), square, 2, units, lambda o: journal.add(o.value), told.append, len(known)
            )

    with pytest.raises(KeyboardInterrupt, match="3 of 6 are done; the same command continues"):
        go_on()
    assert [s.done for s in told] == [1, 2, 3]
    with file.open("a") as half:
        half.write('{"unit": 3, "squ')  # the machine went down here
    go_on()
    assert [s.done for s in told] == [1, 2, 3, 4, 5, 6]
    assert told[-1].seconds_left == 0
    assert [r["square"] for r in read_records(file, {"factor": 2})] == [2.0 * u**2 for u in range(6)]


STOPPED = """
import signal, sys, time
from contextlib import closing
from pathlib import Path
from dovetail.units.folder import Journal
from dovetail.units.pool import pool_of
from dovetail.units.work import work_through

def slow(folder, unit):
    if unit > 1:
        Path(folder, str(unit)).touch()
        time.sleep(600)
    return {"unit": unit}

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    folder = sys.argv[1]
    with pool_of(2) as pool, closing(Journal(Path(folder, "units.jsonl"), {})) as journal:
        try:
            work_through(pool, slow, folder, range(9), lambda o: journal.add(o.value))
        except KeyboardInterrupt:
            sys.exit(1)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send these signals to another process")
@pytest.mark.parametrize(
    ("name", "to_all", "code"),
    [
        pytest.param("SIGTERM", False, -15, marks=pytest.mark.slow),
        pytest.param("SIGINT", False, 1, marks=pytest.mark.slow),
        ("SIGINT", True, 1),
    ],
    ids=["terminated", "interrupted", "Ctrl-C"],
)
def test_a_run_that_is_stopped_leaves_no_processes_and_its_records(name, to_all, code, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(STOPPED)
    run = subprocess.Popen(
        [sys.executable, str(program), str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        until = time.monotonic() + 60
        while not all((tmp_path / unit).exists() for unit in "23"):  # both workers sleep
            assert run.poll() is None, run.communicate()[1]
            assert time.monotonic() < until
            time.sleep(0.05)
        (os.killpg if to_all else os.kill)(run.pid, getattr(signal, name))
        # All of its processes hold this pipe: it ends when the last of them has ended, not after 600 s.
        _, errors = run.communicate(timeout=30)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
        run.communicate()
    assert run.returncode == code
    assert "Traceback" not in errors
    assert {r["unit"] for r in read_records(tmp_path / "units.jsonl", {})} == {0, 1}


def test_two_runs_in_one_folder_do_not_both_compute(tmp_path):
    """The lock goes with the process that has it, however that ends."""
    code = (
        "import sys, time; from pathlib import Path; from dovetail.disk.locks import Lock\n"
        "lock = Lock.take(Path(sys.argv[1])); print('locked', flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / LOCK_FILE)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "locked\n"
        words = rf"another ensemble computes here \(process {other.pid} on"
        with pytest.raises(FolderError, match=words), alone_in(tmp_path, "ensemble"):
            pass
        other.kill()
    with alone_in(tmp_path, "ensemble"):
        pass


def test_failures_are_returned_with_reasons_and_the_rest_goes_on():
    kept = []
    failures = work_through(ThisProcess(), lambda shared, unit: shared / unit, 6, [1, 0, 2], kept.append)
    assert [(o.unit, o.failure) for o in failures] == [(0, "ZeroDivisionError: division by zero")]
    assert "test_units.py" in failures[0].traceback
    assert [o.value for o in kept] == [6, None, 3]
    assert kept[0] == Outcome(1, 6)


def test_workers_that_cannot_be_had_are_refused():
    with pytest.raises(PoolError, match="both given"), pool_of(2, "tcp://localhost:1"):
        pass
    if not WITH_DASK:
        with pytest.raises(PoolError, match=r"pip install distributed"), pool_of(None, "tcp://x:1"):
            pass


def test_time_left_is_said_in_its_unit():
    assert [duration(s) for s in (3.2, 125, 7200)] == ["3 s", "2 min", "2.0 h"]


@needs_dask
def test_a_scheduler_file_that_does_not_come_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("dovetail.units.cluster.CONNECT_SECONDS", 0.0)
    with (
        pytest.raises(PoolError, match=r"nowhere\.json: there is no such file"),
        pool_of(None, str(tmp_path / "nowhere.json")),
    ):
        pass
