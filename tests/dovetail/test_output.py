"""Folders appear whole or not at all; JSON holds what NumPy made."""

import errno
import json
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from dovetail import OutputError, main
from dovetail.commands.answer import Answer
from dovetail.disk.output import MARK, Output, Progress, check_outputs, exchanged, result_folder, write_json
from dovetail.file import input_files
from fem.io import WriteError
from fem.io.atomic import replacing
from tests.frames import STUDY
from updating.inference.heartbeat import EndEarlyError, Lasting, ending_early


def test_a_new_folder_appears_at_the_end(tmp_path):
    out = tmp_path / "deep" / "out"
    with result_folder(out) as scratch:
        (scratch / "a.txt").write_text("a", encoding="utf-8")
        assert not out.exists()
    assert (out / "a.txt").read_text(encoding="utf-8") == "a"
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_an_error_leaves_nothing_behind(tmp_path):
    out = tmp_path / "out"

    def fill_half():
        with result_folder(out) as scratch:
            (scratch / "a.txt").write_text("a", encoding="utf-8")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fill_half()
    assert list(tmp_path.iterdir()) == []


def test_an_error_leaves_the_former_result(tmp_path):
    out = tmp_path / "out"
    with result_folder(out) as scratch:
        (scratch / "a.txt").write_text("a", encoding="utf-8")
    with pytest.raises(RuntimeError, match="stop"), result_folder(out):
        raise RuntimeError("stop")
    assert (out / "a.txt").exists()


def test_a_former_result_is_replaced_as_a_whole(tmp_path):
    out = tmp_path / "out"
    for name in ("a.txt", "b.txt"):
        with result_folder(out) as scratch:
            (scratch / name).write_text(name, encoding="utf-8")
    assert sorted(p.name for p in out.iterdir()) == sorted([MARK, "b.txt"])


def test_the_files_of_others_are_safe(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="--force"), result_folder(tmp_path):
        pass
    with result_folder(tmp_path, force=True) as scratch:
        (scratch / "a.txt").write_text("a", encoding="utf-8")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "mine.txt"]
    with pytest.raises(OutputError, match="is a file"), result_folder(tmp_path / "mine.txt"):
        pass


def test_an_empty_folder_may_be_filled(tmp_path):
    with result_folder(tmp_path / "out"):
        pass
    empty = tmp_path / "empty"
    empty.mkdir()
    with result_folder(empty) as scratch:
        (scratch / "a.txt").write_text("a", encoding="utf-8")
    assert (empty / "a.txt").exists()


def test_json(tmp_path, capsys):
    data = {
        "x": np.float64(1.5),
        "n": np.int64(3),
        "a": np.arange(2),
        "z": 1 + 2j,
        "bad": float("nan"),
        "t": (1, "ü"),
        "p": tmp_path,
    }
    write_json(tmp_path / "a.json", data)
    read = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert read == {
        "x": 1.5,
        "n": 3,
        "a": [0, 1],
        "z": {"re": 1.0, "im": 2.0},
        "bad": None,
        "t": [1, "ü"],
        "p": str(tmp_path),
    }
    write_json(None, data)
    write_json(Path("-"), {"x": 1})
    assert json.loads(capsys.readouterr().out) == {"x": 1}
    with pytest.raises(OutputError, match="no folder"):
        write_json(tmp_path / "none" / "a.json", {})


def test_no_progress_where_nobody_looks(capsys):
    progress = Progress()
    progress("fitting", 1, 3)
    progress.close()
    assert capsys.readouterr().err == ""


def test_a_piped_progress_prints_a_line_every_ten_seconds_and_what_is_known_so_far(capsys, monkeypatch):
    now = iter([0.0, 4.0, 5.0, 9.0, 16.0, 17.0])
    monkeypatch.setattr("time.monotonic", lambda: next(now))
    progress = Progress()
    progress("fitting")
    progress(Lasting("so far: no effect found"))
    for text in ("screening", "short fits", "full fits"):
        progress(text)
    assert capsys.readouterr().err == "00:05 so far: no effect found\n00:16 short fits\n"


def test_the_first_ctrl_c_ends_a_search_early_and_the_second_one_interrupts(capsys):
    progress, before = Progress(), signal.getsignal(signal.SIGINT)
    with progress.ending_early():
        signal.raise_signal(signal.SIGINT)
        progress("reducing the model")
        assert "Ctrl-C once more" in capsys.readouterr().err
        with ending_early(), pytest.raises(EndEarlyError):
            progress("fitting")
        progress("concluding")
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_work_that_was_ended_early_has_the_exit_code_1(monkeypatch, tmp_path, capsys):
    def ended(options, progress):
        return Answer(None, ["so far"], finished=False)

    monkeypatch.setattr("dovetail.commands.diagnose.run", ended)
    assert main(["diagnose", str(tmp_path / "study.toml")]) == 1
    assert capsys.readouterr().out == "so far\n"


def test_progress_on_a_terminal_is_one_line_that_is_taken_away(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "60")
    progress = Progress()
    progress("fitting " + 60 * "x", 1, 4)
    progress("done", 4, 4)
    progress.close()
    _, long, short, blank, last = capsys.readouterr().err.split("\r")
    assert long == f"fitting xxxxxxxx {7 * '#':30}  25 % 00:00"
    assert len(long) == 59
    assert short == f"done {30 * '#'} 100 % 00:00".ljust(len(long))
    assert blank == " " * len(short.rstrip())
    assert last == ""


# What is read is never written over


def study_with_files(folder):
    """Write a study whose mesh, with an include, and measurement are files; return it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "nodes of it.txt").write_text("1, 0, 0, 0\n2, 1, 0, 0\n", encoding="utf-8")
    (folder / "mesh.inp").write_text('*NODE, INPUT="nodes of it.txt"\n*ELEMENT, TYPE=B31\n1, 1, 2\n', "utf-8")
    for name in ("frf.npz", "again.npz", "part.K.mtx", "part.M.mtx"):
        (folder / name).write_bytes(b"never to be lost")
    (folder / "s.toml").write_text(
        '[mesh]\nfile = "mesh.inp"\n[[measurements]]\nfile = "frf.npz"\nrepeats = ["again.npz"]\n'
        '[[superelements]]\nfile = "part.mtx"\n',
        encoding="utf-8",
    )
    return folder / "s.toml"


INPUTS = {
    "s.toml": "the study itself",
    "mesh.inp": "the mesh of s.toml",
    "nodes of it.txt": "included by the mesh of s.toml",
    "frf.npz": "a measurement of s.toml",
    "again.npz": "a repeated measurement of s.toml",
    "part.M.mtx": "the matrices of a part of s.toml",
}


@pytest.mark.parametrize(("name", "what"), INPUTS.items())
@pytest.mark.parametrize("spelling", ["plain", "dots", "hard link", "symbolic link"])
def test_an_input_is_refused_as_output(tmp_path, name, what, spelling):
    study = study_with_files(tmp_path / "in put")
    target = study.parent / name
    if spelling == "dots":
        target = study.parent / ".." / study.parent.name / "." / name
    elif spelling == "hard link":
        (tmp_path / "other").hardlink_to(target)
        target = tmp_path / "other"
    elif spelling == "symbolic link":
        (tmp_path / "other").symlink_to(target)
        target = tmp_path / "other"
    before = (study.parent / name).read_bytes()
    inputs, output = input_files(study), Output("--json", target)
    with pytest.raises(OutputError) as caught:
        check_outputs(inputs, output)
    assert str(caught.value) == f"--json {target} is {what}, which would be overwritten; give another file"
    assert (study.parent / name).read_bytes() == before
    check_outputs(input_files(study), Output("--json", tmp_path / "free.json"))


def test_a_result_folder_that_holds_an_input_is_refused(tmp_path):
    out = tmp_path / "out"
    with result_folder(out) as scratch:
        (scratch / "found.toml").write_text('[measurements]\nfile = "frf.npz"\n', encoding="utf-8")
    with pytest.raises(OutputError, match=r"out holds found.toml, the study itself, and would be replaced"):
        check_outputs(input_files(out / "found.toml"), Output("--out", out, ("report.html",)))
    (out / MARK).unlink()
    study = out / "found.toml"
    check_outputs(input_files(study), Output("--out", out, ("report.html",)))  # with --force, beside it
    with pytest.raises(OutputError, match=r"would overwrite found.toml, the study itself"):
        check_outputs(input_files(study), Output("--out", out, ("report.html", "found.toml")))


def test_two_outputs_at_one_place_are_refused(tmp_path):
    one, two = Output("--json", tmp_path / "a"), Output("--out", tmp_path / "." / "a")
    with pytest.raises(OutputError, match="are the same place"):
        check_outputs((), one, two)
    folder, file = Output("--out", tmp_path, ("result.json",)), Output("--json", tmp_path / "result.json")
    with pytest.raises(OutputError, match="are the same place"):
        check_outputs((), folder, file)
    check_outputs((), Output("--json", Path("/dev/null")), Output("--out", Path("/dev/null")))
    check_outputs((), Output("--json", Path("-")), Output("--out", Path("-")))


@pytest.mark.parametrize("command", ["modes", "frf", "check", "compare", "update", "run"])
def test_commands_refuse_before_they_compute(tmp_path, capsys, command):
    study = study_with_files(tmp_path)
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    more = {"frf": ["--out", str(tmp_path / "f.csv")], "run": ["--out", str(tmp_path / "out")]}
    more["update"] = more["run"]
    assert main([command, str(study), "--json", str(study), *more.get(command, [])]) == 2
    assert "is the study itself, which would be overwritten" in capsys.readouterr().err
    if command == "frf":
        assert main([command, str(study), "--out", str(tmp_path / "frf.npz")]) == 2
        assert "a measurement of s.toml" in capsys.readouterr().err
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_study_that_is_there_is_not_started_anew(tmp_path, capsys):
    (tmp_path / "study.toml").write_text("my own work", encoding="utf-8")
    assert main(["new", str(tmp_path), "--force"]) == 2
    assert "study.toml exists and would be overwritten" in capsys.readouterr().err
    assert (tmp_path / "study.toml").read_text(encoding="utf-8") == "my own work"


# Devices, links, permissions, full disks


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write_json(pipe, {"x": 1})
    reader.join(10)
    assert json.loads(got[0]) == {"x": 1}
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux")
def test_devices_stay_devices():
    write_json(Path("/dev/null"), {"x": 1})
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    with pytest.raises(WriteError) as caught:
        write_json(Path("/dev/full"), {"x": 1})
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, "/dev/full")
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)


def test_what_standard_output_goes_to_is_written_on(tmp_path):
    """A shell's file is not replaced under it: what is printed later would go to the former one."""
    code = (
        "import sys; from pathlib import Path; from dovetail.disk.output import write_json\n"
        "print('first', flush=True); write_json(Path(sys.argv[1]), {'x': 1}); print('last')"
    )
    for target in ("/dev/stdout", str(tmp_path / "out.txt")):
        if not Path("/dev/stdout").exists():
            continue
        with (tmp_path / "out.txt").open("wb") as out:
            subprocess.run([sys.executable, "-c", code, target], stdout=out, check=True)
        assert (tmp_path / "out.txt").read_text(encoding="utf-8") == 'first\n{\n  "x": 1\n}\nlast\n'


def test_links_are_followed_and_permissions_kept(tmp_path):
    real = tmp_path / "real" / "a.json"
    real.parent.mkdir()
    real.write_text("old", encoding="utf-8")
    real.chmod(0o640)
    link = tmp_path / "link.json"
    link.symlink_to(real)
    write_json(link, {"x": 1})
    assert link.is_symlink()
    assert json.loads(real.read_text(encoding="utf-8")) == {"x": 1}
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    dangling = tmp_path / "new.json"
    dangling.symlink_to(tmp_path / "real" / "b.json")
    write_json(dangling, {})
    assert (tmp_path / "real" / "b.json").is_file()


def test_a_folder_of_results_may_be_a_link(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk", target_is_directory=True)
    for text in "ab":
        with result_folder(tmp_path / "out") as scratch:
            (scratch / "x").write_text(text, encoding="utf-8")
    assert (tmp_path / "out").is_symlink()
    assert (tmp_path / "disk" / "x").read_text(encoding="utf-8") == "b"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["disk", "out"]


def no_space(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_is_named_and_leaves_the_old_file(tmp_path):
    file = tmp_path / "a.json"
    write_json(file, {"old": 1})
    with pytest.raises(WriteError) as caught, replacing(file):
        no_space()
    assert caught.value.filename == str(file)
    assert (
        str(caught.value.strerror) == "No space left on device; the file that was there before is unchanged"
    )
    assert json.loads(file.read_text(encoding="utf-8")) == {"old": 1}
    out = tmp_path / "out"
    with result_folder(out) as scratch:
        (scratch / "a").write_text("old", encoding="utf-8")

    def fill():
        with result_folder(out) as scratch:
            raise OSError(errno.ENOSPC, "No space left on device", str(scratch / "frf.npz"))

    with pytest.raises(WriteError) as caught:
        fill()
    assert caught.value.filename == str(out / "frf.npz")
    assert (out / "a").read_text(encoding="utf-8") == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "out"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux")
def test_a_full_disk_is_no_fault_of_the_input(tmp_path, capsys):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    assert main(["modes", str(tmp_path / "study.toml"), "--quiet", "--json", "/dev/full"]) == 1
    assert capsys.readouterr().err == "dovetail: /dev/full: No space left on device\n"


# Exchange, and what killed processes leave


@pytest.mark.parametrize("portable", [False, True])
def test_an_old_result_is_exchanged(tmp_path, monkeypatch, portable):
    if portable:
        monkeypatch.setattr("dovetail.disk.output.exchanged", lambda one, two: False)
    out = tmp_path / "out"
    for text in "ab":
        with result_folder(out) as scratch:
            (scratch / text).write_text(text, encoding="utf-8")
    assert sorted(p.name for p in out.iterdir()) == [MARK, "b"]
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs renameat2")
def test_there_is_a_result_at_every_moment(tmp_path):
    out, stop, missed = tmp_path / "out", threading.Event(), []

    def look():
        while not stop.is_set():
            if not (out / "a").exists():
                missed.append(1)

    with result_folder(out) as scratch:
        (scratch / "a").write_text("0", encoding="utf-8")
    if not exchanged(out, out):
        pytest.skip("this file system cannot exchange names")
    watcher = threading.Thread(target=look)
    watcher.start()
    for k in range(50):
        with result_folder(out) as scratch:
            (scratch / "a").write_text(str(k), encoding="utf-8")
    stop.set()
    watcher.join()
    assert not missed


KILLED = """
import os, signal, sys
from pathlib import Path
from dovetail.disk import output
out, when = Path(sys.argv[1]), sys.argv[2]
kill = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
if when == "between":  # the two renamings of a system that cannot exchange
    output.exchanged = lambda one, two: False
    rename = Path.rename
    def renamed(self, target):
        rename(self, target)
        if Path(target).name == "old":
            kill()
    Path.rename = renamed
with output.result_folder(out) as scratch:
    (scratch / "new").write_text("half")
    if when == "inside":
        kill()
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a kill that nothing catches")
@pytest.mark.parametrize("when", ["inside", "between"])
def test_a_killed_run_loses_nothing_and_is_tidied(tmp_path, when):
    out = tmp_path / "out[1]"
    with result_folder(out) as scratch:
        (scratch / "mine").write_text("old", encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", KILLED, str(out), when], check=False)
    assert done.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == (2 if when == "inside" else 1)

    def fail():
        with result_folder(out):
            assert sum(p.name.startswith(".") for p in tmp_path.iterdir()) == 1  # its own
            assert (out / "mine").read_text(encoding="utf-8") == "old"
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    assert [p.name for p in tmp_path.iterdir()] == ["out[1]"]


def test_what_a_living_run_has_made_stays(tmp_path):
    out = tmp_path / "out"
    with result_folder(out) as first:
        (first / "a").write_text("first", encoding="utf-8")
        with result_folder(out) as second:
            (second / "a").write_text("second", encoding="utf-8")
        assert first.is_dir()
    assert (out / "a").read_text(encoding="utf-8") == "first"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


KILLED_FILE = """
import os, signal, sys
from fem.io.atomic import replacing
with replacing(sys.argv[1]) as scratch:
    scratch.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def aged(path):
    """Make a file or folder look as if it were two minutes old."""
    os.utime(path, (path.stat().st_atime - 120, path.stat().st_mtime - 120))
    return path


def written(target):
    with replacing(target) as scratch:
        scratch.write_text("whole", encoding="utf-8")


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a kill that nothing catches")
def test_temporary_file_of_a_killed_process_is_removed_by_the_next_run(tmp_path):
    target = tmp_path / "frf.csv"
    done = subprocess.run([sys.executable, "-c", KILLED_FILE, str(target)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 2  # the file and its lock
    mine = tmp_path / ".frf.csv-notes.csv"
    mine.touch()
    (tmp_path / ".frf.csv-abcd1234.new").touch()  # killed before it was locked
    aged(tmp_path / ".frf.csv-abcd1234.new")
    written(target)
    assert sorted(p.name for p in tmp_path.iterdir()) == [mine.name, target.name]


def test_hdf5_may_lock_what_it_writes(tmp_path):
    h5py = pytest.importorskip("h5py")
    with replacing(tmp_path / "a.h5") as scratch, h5py.File(scratch, "w") as file:
        file["x"] = 1.0
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_temporary_file_of_a_living_process_stays(tmp_path):
    target = tmp_path / "frf.csv"
    with replacing(target) as scratch:
        written(target)
        assert scratch.exists()
        scratch.write_text("last", encoding="utf-8")
    assert target.read_text(encoding="utf-8") == "last"
    assert [p.name for p in tmp_path.iterdir()] == ["frf.csv"]


@pytest.mark.parametrize("names", [[], ["owner.new"], ["owner.new", "mine"]])
def test_folder_of_a_process_killed_before_its_lock_is_removed(tmp_path, names):
    scratch = tmp_path / ".out-abcd1234"
    scratch.mkdir()
    for name in names:
        (scratch / name).touch()
    aged(scratch)
    with result_folder(tmp_path / "out") as new:
        (new / "a").touch()
    assert scratch.exists() == ("mine" in names)


ENDED = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a terminal, wherever the tests run
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
import dovetail.file.template as template
from dovetail.cli import main
def write(folder):
    (folder / "study.toml").write_text("half")
    print("inside", flush=True)
    time.sleep(60)
template.write_template = write
sys.exit(main(["new", sys.argv[1]]))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs signals of POSIX")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_run_that_is_told_to_end_leaves_nothing(tmp_path, name):
    number = signal.Signals[name]
    command = [sys.executable, "-c", ENDED, str(tmp_path / "s")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "inside\n"
        assert len(list(tmp_path.iterdir())) == 1
        process.send_signal(number)
        errors = process.communicate(timeout=30)[1]
    assert list(tmp_path.iterdir()) == []
    assert process.returncode == (1 if name == "SIGINT" else 128 + number)
    assert errors == f"dovetail: {'interrupted' if name == 'SIGINT' else f'ended by {name}'}\n"
