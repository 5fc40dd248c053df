"""Stored results of the documentation: reused where nothing has changed, computed again where it has."""

import subprocess
import sys

import pytest

from docs.make import gallery, pages, stored
from docs.make.stored import Result, Store

PNG = bytes(range(256)) * 40


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store")


@pytest.fixture
def count():
    """Return a computation that counts its runs, in its text."""
    runs = []

    def compute():
        runs.append(0)
        return Result(f"run {len(runs)}: é", {"a/b.png": PNG})

    return compute


def test_a_result_is_computed_once_for_each_key(store, count):
    first = store.result(("a", "b"), count)
    assert store.result(("a", "b"), count) == first == Result("run 1: é", {"a/b.png": PNG})
    assert store.result(("ab",), count).text == "run 2: é"


def test_a_fresh_build_replaces_what_is_stored(store, count):
    store.result(("a",), count)
    assert Store(store.folder, fresh=True).result(("a",), count).text == "run 2: é"
    assert store.result(("a",), count).text == "run 2: é"


def damaged(content):
    """Yield a file cut short, an empty one, one that is no archive, and those with one wrong byte."""
    yield from (content[: len(content) // 2], b"", b"no archive", b"no\narchive")
    for place in range(0, len(content), 5):
        yield content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :]


def test_a_damaged_file_is_computed_again(store, count):
    store.result(("a",), count)
    (path,) = store.folder.iterdir()
    for wrong in damaged(path.read_bytes()):
        path.write_bytes(wrong)
        assert store.result(("a",), lambda: Result("again")) == Result("again")


def test_results_of_earlier_builds_are_removed(store, count):
    store.result(("a",), count)
    later = Store(store.folder)
    later.result(("b",), count)
    later.remove_unused()
    assert {p.name for p in store.folder.iterdir()} == later.used
    stored.NO_STORE.remove_unused()


@pytest.fixture
def program(monkeypatch):
    """Return a stand-in for the hash of the packages, by the first package that counts."""
    hashes = dict.fromkeys(stored.PACKAGES, "1")
    monkeypatch.setattr(gallery, "program", lambda first: hashes[first])
    monkeypatch.setattr(pages, "program", lambda: hashes["dovetail"])
    return hashes


def test_a_command_runs_again_only_when_an_input_has_changed(tmp_path, store, program):
    """The second command reads what the first has written."""
    folder = tmp_path / "examples" / "x"
    folder.mkdir(parents=True)
    log = tmp_path / "log"
    log.touch()
    (folder / "n.txt").write_text("3")
    (folder / "a.py").write_text(
        f"open({str(log)!r}, 'a').write('a'); open('m.txt', 'w').write(open('n.txt').read())"
    )
    (folder / "b.py").write_text(f"open({str(log)!r}, 'a').write('b'); print(2 * int(open('m.txt').read()))")
    text = "```console examples/x\n$ python a.py\n$ python b.py\n```\n"

    def built():
        before = log.read_text()
        page = pages.generate(text, "page.md", tmp_path, store).text
        return page.splitlines()[3], log.read_text().removeprefix(before)

    assert built() == ("6", "ab")
    assert built() == ("6", "")
    (folder / "n.txt").write_text("4")
    assert built() == ("8", "ab")
    program["dovetail"] = "2"
    assert built() == ("8", "ab")
    assert built() == ("8", "")


def test_an_example_runs_again_only_when_an_input_has_changed(tmp_path, store, program):
    examples, log, out = tmp_path / "examples", tmp_path / "log", tmp_path / "out"
    for folder in (examples, out):
        folder.mkdir()
    log.touch()
    (examples / "n.txt").write_text("3")
    path = examples / "10_x.py"
    code = (
        f'"""Draw."""\nimport tempfile\nopen({str(log)!r}, "a").write("x")\n'
        'print(open(__file__[:-7] + "n.txt").read())\nopen(tempfile.mkdtemp() + "/a.png", "w").close()\n'
    )
    path.write_text(code)

    def built():
        for picture in out.iterdir():
            picture.unlink()
        before = log.read_text()
        example = gallery.run(path, out, store)
        assert [p.name for p in out.iterdir()] == list(example.pictures) == ["10_x-a.png"]
        return example.output, log.read_text() != before

    assert built() == ("3", True)
    assert built() == ("3", False)
    (examples / "20_other.py").write_text("")
    program["dovetail"] = "2"  # it imports none of the packages
    assert built() == ("3", False)
    (examples / "n.txt").write_text("4")
    assert built() == ("4", True)
    path.write_text(code + "print(5)\n")
    assert built() == ("4\n5", True)
    program["fem"] = "2"
    assert built() == ("4\n5", True)


def test_processes_compile_modules_once_even_where_byte_code_is_not_wanted(monkeypatch):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    code = "import sys; print(sys.dont_write_bytecode, sys.pycache_prefix)"
    environment = pages.environment_of(stored.ROOT)
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.stdout.split() == ["False", str(stored.CACHE / "bytecode")]


@pytest.mark.parametrize(
    ("code", "package"),
    [
        ("import numpy", "fem"),
        ("from fem.io import read_mesh\nimport updating", "updating"),
        ("import fem\ndef f():\n    from viz.style import save", "viz"),
        ("import dovetail.cli, fem", "dovetail"),
    ],
)
def test_the_first_package_is_the_one_that_may_import_the_others(code, package):
    assert stored.first_package(code) == package


def test_every_file_of_the_packages_counts(tmp_path, monkeypatch):
    for name in (*stored.PACKAGES, "docs/make", "benchmarks/book"):
        (tmp_path / name).mkdir(parents=True)
    monkeypatch.setattr(stored, "ROOT", tmp_path)

    def changed(name, text):
        """Return which hashes a file changes: those of dovetail, of fem, and with the benchmark book."""
        before = [of() for of in hashes]
        (tmp_path / name).write_text(text)
        return [a != b for a, b in zip(before, (of() for of in hashes), strict=True)]

    of_program = stored.program.__wrapped__
    hashes = [of_program, lambda: of_program("fem"), lambda: of_program(book=True)]
    assert changed("fem/a.py", "x = 1") == [True, True, True]
    assert changed("fem/a.py", "x = 1") == [False, False, False]
    assert changed("dovetail/page.css", "a") == [True, False, True]
    assert changed("benchmarks/book/b.py", "a") == [False, False, True]
    before = of_program()
    monkeypatch.setattr(stored, "environment", lambda: "scipy 2")
    assert of_program() != before
