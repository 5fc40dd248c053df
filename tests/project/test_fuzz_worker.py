"""The fuzz harness notices what a reader must not do; the formats themselves are run by `make fuzz`."""

import os
import signal
import sys
import time

import pytest

from benchmarks.fuzz import worker
from fem.io import TableError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux: /proc and fork")


def target(read):
    return worker.Target("test", "f.txt", lambda folder: [b"1 2\n3 4\n"], read)


def failures(read, tmp_path, count=3):
    done, found = worker.run(target(read), [b"1 2\n3 4\n"], 1, count, tmp_path)
    assert done == count
    return found


def answers(path):
    raise TableError("f.txt: no")


def foreign(path):
    return {}["key"]


def dies(path):
    os.kill(os.getpid(), signal.SIGSEGV)


def grows(path):
    return b"x" * (3 << 30)


def hangs(path):
    while True:
        pass


def test_an_error_of_our_own_is_an_answer(tmp_path):
    assert failures(answers, tmp_path) == []


@pytest.mark.parametrize(
    ("read", "what"), [(foreign, "KeyError"), (dies, "signal SIGSEGV"), (grows, "MemoryError")]
)
def test_each_input_without_an_answer_is_named(tmp_path, read, what):
    found = failures(read, tmp_path)
    assert [f.index for f in found] == [0, 1, 2]
    assert all(f.what.startswith(what) for f in found)


def test_an_input_that_takes_too_long_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "MOST_SECONDS", 0.2)
    (found,) = failures(hangs, tmp_path, count=1)
    assert found.what == "more than 0.2 s"


def test_a_process_that_hangs_in_compiled_code_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "SILENCE", 0.5)
    (found,) = failures(lambda path: time.sleep(60), tmp_path, count=1)
    assert found.what == "no answer within 0.5 s"


def test_inputs_are_the_same_every_time_and_differ():
    seeds = [b"*NODE\n1, 0., 0., 0.\n2, 0., 0., 1.\n"]
    inputs = [worker.input_of(target(answers), seeds, 5, k) for k in range(50)]
    assert inputs == [worker.input_of(target(answers), seeds, 5, k) for k in range(50)]
    assert len(set(inputs)) > 40
