"""Identification of a joint of a study: the task, and a copy of the study file with the joint in it."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.disk.output import Output, check_outputs
from dovetail.file.config import load_study
from dovetail.file.contents import StudyContents
from dovetail.file.lines import key_lines
from dovetail.file.paths import input_files, with_paths
from dovetail.file.table import StudyError, suggest
from dovetail.file.toml import toml_value, without
from fem.connection_damping import ConnectionDamping
from fem.directions import directions_from
from fem.effects.joint import Joint, Spread
from fem.effects.viscoelastic import Viscoelastic
from fem.io.atomic import replacing
from fem.model import DIRECTIONS, Effect, Model
from joint.assembly import JointTask
from joint.assembly_fit import Estimate
from joint.form import LAWS
from updating.measurement.measurement import Measurement

SIDES = (*(f"{key}{k}" for k in (1, 2) for key in ("member", "position", "point")), "location", "axes")
"""Keys that say where a joint is."""

_HEADER = re.compile(r"\s*\[.*\]\s*(#.*)?$")


def read_task(study: StudyContents, name: str, directions: str, measurement: str | None = None) -> JointTask:
    """Check the task for a joint.

    Parameters
    ----------
    study : Study
    name : str
        Name of a joint.
    directions : str
        Some of x y z rx ry rz, or all.
    measurement : str, optional
        Name of the measurement; the first unless given.

    Raises
    ------
    StudyError
        For an unknown joint or measurement, or no measurement.
    """
    joints = {j.name: j for j in study.model.of_kind(Joint)}
    if name not in joints:
        msg = f"{study.path}: there is no joint '{name}'; {suggest(name, joints)}"
        raise StudyError(msg)
    wanted = directions_from(directions, "--directions")
    if not wanted:
        msg = "--directions: no direction is named; some of x y z rx ry rz are needed"
        raise StudyError(msg)
    measured = _measurement(study, measurement)
    frf = measured.frf.select(lines=measured.frf.frequency > 0, band=study.band)
    model = _with_known(study, name)
    joint = model.effect(name)
    assert isinstance(joint, Joint)
    return JointTask(
        model, joint, wanted, measured.with_frf(frf), study.nuisances, study.damping_std, study.n_lines
    )


def _with_known(study: StudyContents, name: str) -> Model:
    """Return the model whose joint has the stiffness of effects that are known for it.

    Beside a joint that is fitted, they would be taken for a part of all else.

    Raises
    ------
    StudyError
        For known effects of the joint that its matrices cannot say.
    """
    model = study.model
    for effect in study.model.effects:
        if isinstance(effect, ConnectionDamping):
            # the joint's own loss is identified: it must have no other
            model = model.without_effect(effect.name).with_effect(replace(effect, but=(*effect.but, name)))
        if effect.name == name or name not in (getattr(effect, "joint", ""), *getattr(effect, "joints", ())):
            continue
        if isinstance(effect, Spread):
            continue  # it says where the joint acts
        (joint,) = (j for j in model.of_kind(Joint) if j.name == name)
        new = _with_stiffness_of(effect, joint, model)
        if new is None:
            msg = (
                f"{study.path}: the effect '{effect.name}' in [[effects]] acts on joint '{name}'; an "
                "identified joint would come on top of it: take it out"
            )
            raise StudyError(msg)
        kept = (e for e in model.effects if e.name != effect.name)
        model = replace(model, effects=tuple(new if e.name == name else e for e in kept))
    return model


def _with_stiffness_of(effect: Effect, joint: Joint, model: Model) -> Joint | None:
    """Return a joint with the stiffness that an effect adds to it; None where the effect does more."""
    dofs, B = joint.relative(model)
    at_joint, free = np.linalg.pinv(B), np.array([d not in joint.rigid for d in DIRECTIONS])
    K = np.where(np.outer(free, free), joint.K, 0.0)
    for c in effect.contribute(model):
        if c.K is None or c.law or c.M is not None or c.C is not None or not np.array_equal(c.dofs, [dofs]):
            return None
        lossy = 0 * c.K if c.D is None else c.D
        if np.abs(lossy - joint.eta * c.K).max() > 1e-9 * np.abs(c.K).max():
            return None
        K = K + at_joint.T @ c.K[0] @ at_joint
    released = {direction for name, direction in effect.released() if name == joint.name}
    return replace(joint, K=K, rigid=tuple(d for d in joint.rigid if d not in released))


def _measurement(study: StudyContents, name: str | None) -> Measurement:
    by_name = {m.name: m for m in study.measurements}
    if not by_name:
        msg = f"{study.path}: it has {study.lack_of_frfs}; the identification needs the measured assembly"
        raise StudyError(msg)
    if name is not None and name not in by_name:
        msg = f"{study.path}: there is no measurement '{name}'; {suggest(name, by_name)}"
        raise StudyError(msg)
    found = by_name[name] if name is not None else study.measurements[0]
    if not found.has_structure_poles:
        msg = (
            f"{study.path}: the FRFs of {found.name} refer to a sensor; a joint is identified from FRFs per "
            "force"
        )
        raise StudyError(msg)
    return found


def proposed(found: Estimate) -> tuple[Effect, ...]:
    """Return the joint as identified, and an element for each direction with a viscoelastic law.

    Parameters that the data do not determine, and damping below zero, stay as in the study. The structure's
    own damping, which acts on the joint too, is subtracted from the identified one.

    Parameters
    ----------
    found : Estimate
    """
    task, fit = found.task, found.fit
    joint, damping = task.joint, task.model.damping
    shared = damping.loss_factor + 2 * float(np.mean(damping.ratio_at(fit.frequency)))
    values = {
        name: float(value)
        for name, value in zip(fit.form.names, fit.values, strict=True)
        if found.determined(name)
    }
    K, C, D = (np.array(X, dtype=float) for X in (joint.K, joint.C, joint.D))
    rigid, eta, out = joint.rigid, joint.eta, []
    for name in fit.form.names:
        kind, a, b = name.split(" ")[:3]
        i, j = DIRECTIONS.index(a), DIRECTIONS.index(b)
        if kind == "K" and name in values:
            K[i, j] = K[j, i] = values[name]
            rigid = tuple(d for d in rigid if d != a) if a == b else rigid
    loss_now = D + eta * K
    changed = False
    for d in task.directions:
        i = DIRECTIONS.index(d)
        known = {kind: values.get(f"{kind} {d} {d}") for kind in "KCD"}
        if f"K {d} {d}" in fit.form.names and known["K"] is not None:
            if (value := known["D"]) is not None and value > 0:
                loss_now[i, i], changed = max(value - shared * K[i, i], 0.0), True
            if (value := known["C"]) is not None and value > 0:
                C[i, i] = max(value - damping.beta * K[i, i], 0.0)
        for law in LAWS:
            names = [n for n in fit.form.names if n.startswith(f"{law} {d} {d}")]
            if not names or not all(found.determined(n) for n in names):
                continue
            stiffness = np.zeros((6, 6))
            stiffness[i, i] = values[names[0]]
            inner = {n.rpartition(" ")[2]: values[n] for n in names[1:]}
            out.append(
                Viscoelastic(
                    name=f"{joint.name}.{d}",
                    K=stiffness,
                    law=LAWS[law](**inner),
                    point1=joint.point1,
                    point2=joint.point2,
                    location=joint.location,
                    axes=joint.axes,
                )
            )
            K[i, :] = K[:, i] = C[i, :] = C[:, i] = loss_now[i, :] = loss_now[:, i] = 0.0
            D[i, :] = D[:, i] = 0.0
            rigid = tuple(x for x in rigid if x != d)
    if changed:
        D, eta = loss_now, 0.0
    return replace(joint, K=K, C=C, D=D, eta=eta, rigid=rigid), *out


def write_proposal(study: StudyContents, found: Estimate, path: Path) -> tuple[Effect, ...]:
    """Write the study with the identified joint in it, ready to run.

    The text is the study's own; only the joint's keys are replaced. It is read back before it takes its
    place.

    Parameters
    ----------
    study : Study
    found : Estimate
    path : Path
        A .toml file; other files that the study names are named from there.

    Returns
    -------
    tuple of Effect
        Effects of the new study.

    Raises
    ------
    StudyError
        If the study does not give its joints as [[joints]] tables, or the copy cannot be read.
    """
    effects = proposed(found)
    check_outputs(input_files(study.path), Output("the proposed study", path))
    joint = effects[0]
    assert isinstance(joint, Joint)
    text = _with_joint(study, joint)
    for element in effects[1:]:
        assert isinstance(element, Viscoelastic)
        text += _viscoelastic(study, joint.name, element)
    text = with_paths(_without_known(text, found.task.model), study.path.parent, path.parent)
    with replacing(path) as scratch:
        scratch.write_bytes(text.encode())
        model = load_study(scratch).model
        for effect in effects:
            written: Any = model.effect(effect.name)
            for key in "KCD":
                want, have = (np.asarray(getattr(e, key, np.zeros(1))) for e in (effect, written))
                if not np.allclose(want, have, rtol=1e-5, atol=1e-9 * max(1.0, float(np.abs(want).max()))):
                    msg = f"{path}: {key} of '{effect.name}' could not be written into the study's text"
                    raise StudyError(msg)
    return effects


def _without_known(text: str, model: Model) -> str:
    """Return a text without the known effects whose stiffness the joint has by now, as comments."""
    obsolete = [
        ("effects", i)
        for i, one in enumerate(tomllib.loads(text).get("effects", []))
        if one.get("name", f"known {one['candidate']}") not in {e.name for e in model.effects}
    ]
    return without(text, *reversed(obsolete))


def _joint_index(study: StudyContents, name: str) -> int:
    tables = tomllib.loads(study.text).get("joints", [])
    for i, table in enumerate(tables):
        if table.get("name", f"joint{i + 1}") == name:
            return i
    msg = f"{study.path}: there is no [[joints]] table for '{name}'"
    raise StudyError(msg)


def _headers(lines: list[str]) -> list[int]:
    """Return which lines, from 0, begin a table: the text before each is a whole TOML text."""
    found = []
    for k, line in enumerate(lines):
        if not _HEADER.match(line):
            continue
        try:
            tomllib.loads("\n".join(lines[:k]))
        except tomllib.TOMLDecodeError:
            continue
        found.append(k)
    return found


def _without_key(lines: list[str], at: int, headers: list[int]) -> None:
    """Turn a key and its value, or a table of its own, into comments."""
    if at in headers:
        end = next((h for h in headers if h > at), len(lines))
        while end > at + 1 and not lines[end - 1].strip():
            end -= 1
    else:
        end = at + 1
        while end < len(lines):
            try:
                tomllib.loads("\n".join(lines[at:end]))
                break
            except tomllib.TOMLDecodeError:
                end += 1
    for k in range(at, end):
        lines[k] = f"# {lines[k]}"


def _with_joint(study: StudyContents, joint: Joint) -> str:
    index = _joint_index(study, joint.name)
    lines, places = study.text.split("\n"), key_lines(study.text)
    headers = _headers(lines)
    start = places["joints", index] - 1
    if start not in headers:
        msg = f"{study.path}: the joint '{joint.name}' is not a [[joints]] table of its own; write it as one"
        raise StudyError(msg)
    for key in ("k", "K", "c", "C", "D", "eta", "rigid"):
        if ("joints", index, key) in places:
            _without_key(lines, places["joints", index, key] - 1, headers)
    if not joint.eta and (place := places.get(("uncertain", "joint", joint.name, "eta"))):
        _without_key(lines, place - 1, headers)
    lines.insert(
        start + 1, "\n".join(["# as identified; the former lines follow as comments", *_keys(joint)])
    )
    return "\n".join(lines)


def _keys(joint: Joint) -> list[str]:
    out = []
    for key in "KCD":
        X = np.asarray(getattr(joint, key), dtype=float)
        diagonal = np.diag(X)
        if not X.any():
            continue
        if (diagonal[:, None] * np.eye(6) != X).any():
            out.append(f"{key} = [{', '.join(_list(row) for row in X)}]")
        elif key == "D":
            out.append(f"D = {_list(diagonal)}")
        else:
            low = key.lower()
            pairs = (f"{low}{d} = {v:.6g}" for d, v in zip(DIRECTIONS, diagonal, strict=True) if v)
            out.append(f"{low} = {{ {', '.join(pairs)} }}")
    if joint.eta:
        out.append(f"eta = {joint.eta:.6g}")
    if joint.rigid:
        out.append(f"rigid = {toml_value(' '.join(joint.rigid))}")
    return out


def _list(values: Any) -> str:
    return "[" + ", ".join(f"{float(v):.6g}" if v else "0.0" for v in values) + "]"


def _viscoelastic(study: StudyContents, name: str, element: Viscoelastic) -> str:
    table = tomllib.loads(study.text)["joints"][_joint_index(study, name)]
    place = [f"{key} = {toml_value(table[key])}" for key in SIDES if key in table]
    law = next(word for word, kind in LAWS.items() if isinstance(element.law, kind))
    inner = [
        f"{key} = {getattr(element.law, key):.6g}"
        for key in ("ratio", "tau", "alpha")
        if hasattr(element.law, key)
    ]
    k = ", ".join(
        f"k{d} = {v:.6g}"
        for d, v in zip(DIRECTIONS, np.diag(np.asarray(element.K, dtype=float)), strict=True)
        if v
    )
    rows = ["", "# as identified", "[[viscoelastic]]", f"name = {toml_value(element.name)}", *place]
    return "\n".join([*rows, f'law = "{law}"', f"k = {{ {k} }}", *inner, ""])
