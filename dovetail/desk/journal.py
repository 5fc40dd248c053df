"""The desk's journal: a file beside the study from which a desk that was closed or killed goes on."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.desk.state import DeskState, History, Stair
from dovetail.file.faults import UNITS
from fem.io.atomic import replacing
from fem.model import Effect, parameter_values
from updating.live.hypothesis import Hypothesis
from updating.measurement.channel_errors import N_ERRORS
from updating.quality.corrections import Fault

SCHEMA = "dovetail-desk/1"


class JournalError(ValueError):
    """A journal that belongs to another study, or that nobody can read."""


def journal_of(study: Path) -> Path:
    """Return where a study's journal is: a hidden file beside it."""
    return study.with_name(f".{study.stem}.desk.json")


def write_journal(path: Path, history: History, study_text: str) -> None:
    """Write a history, whole or not at all.

    Parameters
    ----------
    path : Path
    history : History
    study_text : str
        The study's text: the journal belongs to it.
    """
    data = {
        "schema": SCHEMA,
        "study": _mark(study_text),
        "at": history.at,
        "states": [_plain_state(s) for s in history.states],
    }
    with replacing(path) as scratch:
        scratch.write_text(json.dumps(data, ensure_ascii=False), encoding="utf-8")


def read_journal(path: Path, study_text: str, candidates: Mapping[str, Effect]) -> History:
    """Return the history that a journal holds; fits in it come back as values.

    Raises
    ------
    JournalError
        If it was written for another text of the study, or is no journal.
    OSError
        If it cannot be read.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["schema"] != SCHEMA:
            msg = f"{path}: its schema is {data['schema']}; this program reads {SCHEMA}"
            raise JournalError(msg)
        if data["study"] != _mark(study_text):
            msg = f"{path}: the study has changed since this journal was written"
            raise JournalError(msg)
        states = tuple(_state(s, candidates) for s in data["states"])
        return History(states, range(len(states))[data["at"]])
    except (JournalError, OSError):
        raise
    except Exception as reason:  # a damaged journal raises whatever JSON and its values come upon
        msg = f"{path}: this is no journal of a desk ({type(reason).__name__}: {reason})"
        raise JournalError(msg) from reason


def set_aside(path: Path) -> Path:
    """Give a journal that does not fit a name that is free, and return that."""
    old, k = path.with_suffix(".old.json"), 1
    while old.exists():
        old, k = path.with_suffix(f".old{k + 1}.json"), k + 1
    os.replace(path, old)
    return old


def _mark(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _plain_state(s: DeskState) -> dict[str, Any]:
    return {
        "label": s.label,
        "hypothesis": _plain(s.hypothesis),
        "stairs": [asdict(x) for x in s.stairs],
        "other": None if s.other is None else _plain(s.other),
        "other_stairs": [asdict(x) for x in s.other_stairs],
    }


def _plain(h: Hypothesis) -> dict[str, Any]:
    return {
        "effects": [{"name": e.name, "values": _numbers(parameter_values(e))} for e in h.effects],
        "values": [[*ref, float(v)] for ref, v in h.values.items()],
        "zeta": h.zeta.tolist(),
        "faults": [asdict(f) for f in h.faults],
        "off": sorted(h.off),
        "held_out": sorted(h.held_out),
        "channels": h.channels.tolist(),
    }


def _numbers(values: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(v) for name, v in values.items()}


def _state(d: Mapping[str, Any], candidates: Mapping[str, Effect]) -> DeskState:
    other = d["other"]
    return DeskState(
        str(d["label"]),
        _hypothesis(d["hypothesis"], candidates),
        _stairs(d["stairs"]),
        None if other is None else _hypothesis(other, candidates),
        _stairs(d["other_stairs"]),
    )


def _stairs(steps: Sequence[Mapping[str, Any]]) -> tuple[Stair, ...]:
    return tuple(Stair(str(x["label"]), float(x["fit_db"]), float(x["held_out_db"])) for x in steps)


def _fault(f: Mapping[str, Any]) -> Fault:
    return Fault(**{**f, "direction": tuple(f["direction"]), "shift": tuple(f.get("shift", ()))})


def _hypothesis(d: Mapping[str, Any], candidates: Mapping[str, Effect]) -> Hypothesis:
    numbers = [v for e in d["effects"] for v in e["values"].values()] + [v for _, _, v in d["values"]]
    numbers += [
        v
        for f in d["faults"]
        for v in (f["value"], f["std"], f["span"], *f["direction"], *f.get("shift", ()))
    ]
    channels = np.array(d.get("channels", []), dtype=float).reshape(-1, N_ERRORS)
    if not np.isfinite(np.array([*numbers, *d["zeta"], *channels.ravel()], dtype=float)).all():
        msg = "a value of the model or of a fault is not finite"
        raise ValueError(msg)
    if unknown := {f["kind"] for f in d["faults"]} - set(UNITS):
        msg = f"there is no fault of the kind '{unknown.pop()}'; there are {', '.join(UNITS)}"
        raise ValueError(msg)
    return Hypothesis(
        tuple(candidates[e["name"]].with_values(**e["values"]) for e in d["effects"]),
        {(str(a), str(b)): float(v) for a, b, v in d["values"]},
        np.array(d["zeta"], dtype=float),
        tuple(_fault(f) for f in d["faults"]),
        frozenset(d["off"]),
        held_out=frozenset(d.get("held_out", ())),
        channels=channels,
    )
