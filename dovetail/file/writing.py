"""A study's text with other values of its model: parameters, damping, found effects, faults, element sizes.

The one way in which a study is written, by ``run``, ``update`` and ``identify-joint``: values are put where
the text has them, comments and order stay, and a part without a place gets a table of its own.
"""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from dovetail.file.effects import effect_table, written_values
from dovetail.file.lines import Path, Places, places_of
from dovetail.file.toml import FITTED_DIGITS, rounded, toml_key, toml_table, with_values, without
from fem.model import DIRECTIONS, Damping, Effect, Model, ParameterRef, parameter_values

Tree = Mapping[str, Any]


def with_parameters(text: str, values: Mapping[ParameterRef, float]) -> str:
    """Return a study's text with other values of parameters, by effect and parameter.

    Where the text has a place for a value it is put there; the others are put into ``[values]``.
    """
    tree, places = tomllib.loads(text), places_of(text)
    changes: dict[Path, Any] = {}
    rest: dict[str, dict[str, float]] = {}
    for (effect, name), value in rounded(values).items():
        spots = _spots(effect, name, tree, places)
        if spots:
            changes |= dict.fromkeys(spots, value)
        else:
            rest.setdefault(effect, {})[name] = value
    text = with_values(text, changes)
    for effect, parameters in rest.items():
        here = tree.get("values", {}).get(effect)
        if here is None:
            text = text.rstrip("\n") + "\n\n" + toml_table(f"[values.{toml_key(effect)}]", parameters)
        else:
            text = with_values(text, {("values", effect, k): v for k, v in parameters.items()})
    return text


def rebased_values(model: Model, effects: Iterable[Effect]) -> dict[ParameterRef, float]:
    """Return the parameters of a model's effects that change when its present values become nominal ones."""
    out = {}
    for effect in effects:
        if effect.rebased(model) is not effect:
            new = parameter_values(effect.rebased(model))
            out |= {(effect.name, name): float(value) for name, value in new.items()}
    return out


def _spots(effect: str, name: str, tree: Tree, places: Places) -> list[Path]:
    """Return where the text has a parameter's value; none if it has no place for it."""
    known = places.values
    if ("values", effect, name) in known:
        return [("values", effect, name)]
    if effect == "frame" and ":" in name:
        key, material = name.split(":", 1)
        return [p for p in [("materials", material, key)] if p in known]
    if (form := ("fitted_form", effect.removeprefix("known "))) in known:
        return [(*form, name)]
    for i, one in enumerate(_tables(tree, "effects")):
        if effect == one.get("name", f"known {one.get('candidate', '')}"):
            return [("effects", i, name)]  # also where it is left at its default
    for kind in ("joints", "masses", "sprung_masses", "viscoelastic"):
        for i, one in enumerate(_tables(tree, kind)):
            if _name_of(kind, i, one) == effect:
                spots: list[Path] = [(kind, i, name), (kind, i, "k", name), (kind, i, "c", name)]
                if name[:1] == "k" and name[1:] in DIRECTIONS:
                    d = DIRECTIONS.index(name[1:])
                    spots += [(kind, i, "K", d, d), (kind, i, "K", d)]
                return [p for p in spots if p in known][:1]
    for i, one in enumerate(_tables(tree, "sensors")):
        alone = "directions" not in one and effect == f"mass of sensor {one.get('name', '')}"
        if alone and ("sensors", i, name) in known:
            return [("sensors", i, name)]
    return []


def _tables(tree: Tree, key: str) -> list[Any]:
    found = tree.get(key, [])
    return found if isinstance(found, list) else []  # sensors may be in a file of their own


def _name_of(kind: str, i: int, one: Mapping[str, Any]) -> str:
    """Return the name of a joint, a mass or an element."""
    if "name" in one:
        return one["name"]
    if kind == "sprung_masses":
        return f"sprung mass{i + 1}"
    if kind != "masses":
        return f"{kind[:-1]}{i + 1}"
    point = one.get("point")
    return f"mass at {point}" if isinstance(point, str) else f"mass{i + 1}"


def with_damping(text: str, damping: Damping, connections: tuple[np.ndarray, np.ndarray] | None) -> str:
    """Return a study's text with other modal damping ratios; Rayleigh damping and loss factors stay.

    Parameters
    ----------
    text : str
    damping : Damping
        Its modal ratios are written.
    connections : (ndarray, ndarray) or None
        Frequencies [Hz] and ratios of connections that are damped otherwise; None keeps those of the text.
    """
    modal: dict[str, Any] = {"frequency": damping.frequency, "ratio": damping.ratio}
    modal |= {"between": "powers"} if damping.powers else {}
    changes: dict[Path, Any] = {("damping", "modal"): modal}
    if connections is not None:
        changes["damping", "connections"] = dict(zip(("frequency", "ratio"), connections, strict=True))
    known = places_of(text)
    text = without(text, ("damping", "file"), *(p for p in changes if p in known.headers))
    return with_values(text, rounded(changes))


def with_effects(text: str, effects: Sequence[Effect], *, since_baseline: bool = False) -> str:
    """Return a study's text with effects that were found: ``[[effects]]``, those of its form in one table.

    One that gives a known effect of the text another value changes that, unless it has come since the
    baseline, before which the known one has its value.
    """
    forms = {e.name.removeprefix("known "): written_values(e) for e in effects if e.is_form}
    text = with_values(text, {("fitted_form", name): values for name, values in forms.items()})
    for effect in (e for e in effects if not e.is_form):
        candidate = effect.name.removeprefix("known ")
        entries = _tables(tomllib.loads(text), "effects")
        names = [e.get("name", f"known {e['candidate']}") for e in entries]
        same = [i for i, e in enumerate(entries) if e["candidate"] == candidate]
        values = parameter_values(effect)
        instead = [(names.index(name), key) for name, key in effect.replaces() if name in names]
        same = [i for i in same if entries[i].get("since_baseline", False) == since_baseline]
        if instead and {i for i, _ in instead} <= set(same) and instead[0][1] in values:
            i, key = instead[0]
            text = with_values(text, {("effects", i, key): rounded(float(values[key]))})
            continue
        name = f"known {candidate}"
        number = 2
        while name in names:
            name, number = f"known {candidate} ({number})", number + 1
        given_name = "" if name == f"known {candidate}" else name
        table = effect_table(effect, candidate, given_name, since_baseline=since_baseline)
        text = text.rstrip("\n") + "\n\n" + table
    return text


def with_element_sizes(text: str, sizes: Mapping[str, float]) -> str:
    """Return a study's text with the sizes of elements that it leaves open [m], rounded up.

    So the mesh stays when moduli and densities change, by which sizes are chosen otherwise.

    Parameters
    ----------
    text : str
    sizes : mapping of str to float
        By member.
    """
    if not sizes:
        return text
    # a smaller size could make one element more
    sizes = {m: rounded(size * (1 + 0.5 * 10.0 ** (1 - FITTED_DIGITS))) for m, size in sizes.items()}
    if len(set(sizes.values())) == 1:
        return with_values(text, {("mesh", "element_size"): next(iter(sizes.values()))})
    places = places_of(text)
    changes: dict[Path, Any] = {}
    for member, size in sizes.items():
        if ("members", member) in places.headers or ("members", member) in places.values:
            changes["members", member, "element_size"] = size
        else:
            text = (
                text.rstrip("\n")
                + "\n\n"
                + toml_table(f"[members.{toml_key(member)}]", {"element_size": size})
            )
    return with_values(text, changes)
