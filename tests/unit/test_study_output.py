"""Folders appear whole or not at all; JSON holds what NumPy made."""

import json

import numpy as np
import pytest

from study.output import MARK, OutputError, Progress, result_folder, write_json


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
    from pathlib import Path

    write_json(Path("-"), {"x": 1})
    assert json.loads(capsys.readouterr().out) == {"x": 1}
    with pytest.raises(OutputError, match="no folder"):
        write_json(tmp_path / "none" / "a.json", {})


def test_no_progress_where_nobody_looks(capsys):
    progress = Progress()
    progress("fitting", 1, 3)
    progress.close()
    assert capsys.readouterr().err == ""
