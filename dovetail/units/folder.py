"""Folders of results that grow unit by unit, so that a run that was stopped continues there."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dovetail.disk.locks import Lock, holder
from fem.io.atomic import WriteError, replacing

LOCK_FILE = ".lock"
"""File by which a run keeps others out of its folder, for as long as it lives."""

Record = dict[str, Any]


class FolderError(ValueError):
    """A folder that belongs to a run with other settings, or in which another one computes."""


@contextmanager
def alone_in(folder: Path, command: str) -> Iterator[None]:
    """Keep other runs out of a folder; its lock ends with the process, however that ends.

    Raises
    ------
    FolderError
        If another run computes there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lock = Lock.take(folder / LOCK_FILE)
    if lock is None:
        who = holder(folder / LOCK_FILE)
        msg = f"{folder}: another {command} computes here ({who}); wait for it, or choose another folder"
        raise FolderError(msg)
    try:
        yield
    finally:
        lock.release()


def json_lines(raw: bytes) -> list[Record]:
    """Return the records of lines of JSON, one each; empty lines are passed over.

    Raises
    ------
    ValueError
        For a line that is no record, by its number.
    """
    out = []
    for k, line in enumerate(raw.split(b"\n"), 1):
        try:
            record = json.loads(line) if line.strip() else {}
        except (ValueError, RecursionError) as reason:
            msg = f"line {k} is not JSON ({getattr(reason, 'msg', reason)})"
            raise ValueError(msg) from None
        if not isinstance(record, dict):
            msg = f"line {k} is not a record of JSON, such as {{...}}"
            raise ValueError(msg)
        out += [record] if record else []
    return out


def read_records(file: Path, settings: Mapping[str, Any]) -> list[Record]:
    """Return the records of a file, and cut off a line that was not written to its end.

    The first line holds the settings, each other one a record.

    Raises
    ------
    FolderError
        If the file belongs to other settings.
    """
    if not file.exists():
        return []
    raw = file.read_bytes()
    complete = raw[: raw.rfind(b"\n") + 1]
    if complete != raw:
        with replacing(file) as scratch:
            scratch.write_bytes(complete)
    try:
        lines = json_lines(complete)
    except ValueError as reason:
        msg = f"{file}: {reason}; it is not a file of this command"
        raise FolderError(msg) from None
    if not lines:
        return []
    have, want = lines[0].get("settings"), plain(dict(settings))
    if have != want:
        known = have if isinstance(have, dict) else {}
        different = sorted(k for k in {*known, *want} if known.get(k) != want.get(k))
        msg = (
            f"{file} was started with other settings ({', '.join(different)} differ"
            f"{'' if len(different) > 1 else 's'}); choose another folder"
        )
        raise FolderError(msg)
    return lines[1:]


class Journal:
    """A file of records, a JSON line each, that is only added to.

    Parameters
    ----------
    file : Path
    settings : mapping
        Written first into a new file.
    """

    def __init__(self, file: Path, settings: Mapping[str, Any]) -> None:
        self.file = file
        self._out: TextIO = file.open("a", encoding="utf-8")
        if file.stat().st_size == 0:
            self.add({"settings": dict(settings)})

    def add(self, record: Record) -> None:
        """Write a record, at once.

        Raises
        ------
        WriteError
            If the disk is full, for example; the next run cuts off the part that was written.
        """
        try:
            self._out.write(json.dumps(plain(record), ensure_ascii=False) + "\n")
            self._out.flush()
        except OSError as reason:
            raise WriteError(reason, self.file, False) from reason

    def close(self) -> None:
        """Close the file."""
        self._out.close()


def plain(value: Any) -> Any:
    """Turn tuples, arrays and NumPy numbers into JSON's types; numbers that are not finite into null."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
