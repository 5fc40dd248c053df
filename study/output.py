"""What the commands write: folders whole or not at all, JSON, progress."""

import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fem.io.atomic import replacing

MARK = ".dovetail"
"""File that tells a folder of ours from others."""


class OutputError(ValueError):
    """A place where nothing can be written without destroying something."""


@contextmanager
def result_folder(path: Path, force: bool = False) -> Iterator[Path]:
    """Give a temporary folder beside ``path``, which takes its place when the block ends without an error.

    A folder that an earlier run made is replaced. One with other files is refused, or with ``force`` kept:
    what is new goes into it and replaces files of the same names.

    Raises
    ------
    OutputError
        If ``path`` is a file, or a folder with files that are not ours.
    """
    if path.exists() and not path.is_dir():
        msg = f"{path} is a file; give a folder to write into"
        raise OutputError(msg)
    ours = not path.exists() or (path / MARK).is_file() or not any(path.iterdir())
    if not ours and not force:
        msg = (
            f"{path} holds files that are not results of dovetail; choose another folder, or "
            "give --force to write into it"
        )
        raise OutputError(msg)
    path.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{path.name}-", dir=path.parent))
    try:
        scratch.chmod(0o777 & ~_umask())
        yield scratch
        (scratch / MARK).write_text(
            "This folder is written by dovetail and replaced as a whole.\n", encoding="utf-8"
        )
        if ours:
            _replace(scratch, path)
        else:
            (scratch / MARK).unlink()
            shutil.copytree(scratch, path, dirs_exist_ok=True)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _replace(scratch: Path, path: Path) -> None:
    if not path.exists():
        scratch.rename(path)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}-old-", dir=path.parent))
    path.rename(old / path.name)
    try:
        scratch.rename(path)
    except OSError:
        (old / path.name).rename(path)
        raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    import os

    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_writable(*paths: Path | None) -> None:
    """Refuse files whose folder is not there, before anything is computed for them.

    Raises
    ------
    OutputError
        For the first of them, or for one that is a folder.
    """
    for path in paths:
        if path is None or str(path) == "-":
            continue
        if not path.parent.is_dir():
            msg = f"{path}: there is no folder {path.parent} to write it into"
            raise OutputError(msg)
        if path.is_dir():
            msg = f"{path} is a folder; give a file"
            raise OutputError(msg)


def write_json(path: Path | None, data: Any) -> None:
    """Write data as JSON to a file, whole or not at all; to standard output for ``-``; nowhere for None."""
    if path is None:
        return
    text = json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if str(path) == "-":
        sys.stdout.write(text)
        return
    check_writable(path)
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _plain(value: Any) -> Any:
    """Turn arrays, tuples and NumPy numbers into what JSON knows; numbers that are not finite into null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, complex):
        return {"re": _plain(value.real), "im": _plain(value.imag)}
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


class Progress:
    """A progress bar on a terminal; nothing where the output is piped or quiet is asked for.

    Call it with what is being done, and with how much of how much where that is known.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._show = not quiet and sys.stderr.isatty()
        self._bar: Any = None

    def __call__(self, text: str, done: float = 0, total: float | None = None) -> None:
        """Show a step."""
        if not self._show:
            return
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                file=sys.stderr,
                leave=False,
                dynamic_ncols=True,
                bar_format="{desc} {bar:30} {percentage:3.0f} % {elapsed}",
            )
        self._bar.set_description_str(text, refresh=False)
        self._bar.total = total or 1
        self._bar.n = min(done, self._bar.total)
        self._bar.refresh()

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
