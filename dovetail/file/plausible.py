"""Implausible values of a study with file, line and key: those of `fem.plausibility`, and those of tests."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from dovetail.file.geometry import TooManyElementsError
from dovetail.file.lines import Path
from dovetail.file.table import StudyError, StudyTable
from fem.mesh import Mesh
from fem.model import Model
from fem.plausibility import Suspicion, suspicions

HEAVIEST_SENSOR = 1.0
"""Seismic accelerometers weigh as much, others 0.2 to 50 g [kg]."""

Tree = Mapping[str, Any]


def implausible(top: StudyTable, model: Model, max_frequency: float) -> tuple[str, ...]:
    """Return the implausible values of a study and its model, one sentence each with its place.

    Parameters
    ----------
    top : Table
        The whole study.
    model : Model
    max_frequency : float
        Highest frequency of interest [Hz].
    """
    tree: Tree = top.values
    found = [(path_of(s, tree, model.mesh), _with_remedy(s, tree)) for s in suspicions(model, max_frequency)]
    found += [*_uncertain(tree.get("uncertain", {}), ("uncertain",)), *_sensors(tree)]
    return tuple(dict.fromkeys(f"{top.source.place(path)}: {text}" for path, text in found))


@contextmanager
def naming_implausible(odd: Sequence[str]) -> Iterator[None]:
    """Add the implausible values of a model to errors of computing with it, for they may be the cause."""
    try:
        yield
    except StudyError as reason:
        if not odd:
            raise
        msg = "; ".join([str(reason), *odd])
        raise StudyError(msg) from reason


def _with_remedy(s: Suspicion, tree: Tree) -> str:
    of_file = s.place == ("mesh",) and "file" in tree.get("mesh", {})
    return f"{s.message} ([mesh] scale = 0.001 converts a file in mm to metres)" if of_file else s.message


def path_of(s: Suspicion, tree: Tree, mesh: Mesh) -> Path:
    """Return the place in a study of the value that a suspicion names."""
    what, *names = s.place
    if what == "material":
        return ("materials", *names)
    if what == "section":
        return _section(tree, mesh, names[0])
    if what == "member":
        return (*holder(tree, mesh, *names), names[1])
    if what == "effect":
        return _effect(tree, *names)
    if what == "damping":
        key = "file" if names == ["modal"] and "file" in tree.get("damping", {}) else names[0]
        return ("damping", key)
    return ("mesh",) if "file" in tree.get("mesh", {}) else ("points",)


def path_of_request(reason: TooManyElementsError, tree: Tree, mesh: Mesh) -> Path:
    """Return where a study asks for more elements than are made."""
    if reason.key != "waves":
        key, _, of_member = reason.key.partition(" ")
        path = (*holder(tree, mesh, reason.member, key), key)
        return path if of_member or key == "elements" else ("mesh", key)
    for s in reason.suspicions:
        return path_of(s, tree, mesh)
    return ("frequency", "stop") if "stop" in tree.get("frequency", {}) else ("members", reason.member)


def holder(tree: Tree, mesh: Mesh, member: str, key: str) -> Path:
    """Return the table that gives a member a key: its own, that of its group, or ``[defaults]``."""
    members = tree.get("members", {})
    groups = [g for g, names in mesh.groups.items() if member in names]
    for name in (member, *groups):
        if key in members.get(name, {}):
            return ("members", name)
    return ("defaults",) if key in tree.get("defaults", {}) else ("members", member)


def _section(tree: Tree, mesh: Mesh, member: str) -> Path:
    path = (*holder(tree, mesh, member, "section"), "section")
    value: Any = tree
    for part in path:
        value = value.get(part, {}) if isinstance(value, dict) else {}
    if isinstance(value, str):
        return ("sections", value)
    known = tree.get("sections", {})
    return path if value or len(known) != 1 else ("sections", next(iter(known)))


def _effect(tree: Tree, name: str, key: str) -> Path:
    """Return where a study has an effect's value, as far as its name tells."""
    sensor = name.removeprefix("mass of sensor ")
    for kind in ("joints", "masses", "sprung_masses", "viscoelastic", "superelements", "effects", "sensors"):
        for i, one in enumerate(tree.get(kind, [])):
            if _name(kind, i, one) not in (name, sensor if kind == "sensors" else name):
                continue
            inner = "k" if kind == "joints" and key.startswith("k") and "k" in one else key
            deeper = (key,) if inner == "k" and isinstance(one["k"], dict) else ()
            return (kind, i, inner, *deeper)
    return ("sensors",) if sensor != name else ()


def _name(kind: str, i: int, one: Tree) -> str:
    """Return the name that a table has, or gets where it gives none."""
    if "name" in one:
        return str(one["name"])
    point = one.get("point")
    if kind == "masses":
        return f"mass at {point}" if isinstance(point, str) else f"mass{i + 1}"
    if kind == "sprung_masses":
        return f"sprung mass{i + 1}"
    return f"known {one.get('candidate', '')}" if kind == "effects" else f"{kind.removesuffix('s')}{i + 1}"


def _uncertain(t: Tree, path: Path) -> Iterator[tuple[Path, str]]:
    """Yield standard deviations above 1."""
    for key, value in t.items():
        if isinstance(value, dict):
            yield from _uncertain(value, (*path, key))
        elif isinstance(value, int | float) and value > 1:
            of = "of the logarithm, 1 for a factor of 2.7" if key == "damping" else "relative, 1 for 100 %"
            yield (
                (*path, key),
                f"a standard deviation of {value:g} is implausible: it is {of}; is it in per cent "
                f"({value / 100:g})?",
            )


def _sensors(tree: Tree) -> Iterator[tuple[Path, str]]:
    """Yield masses of sensors that are none."""
    for kind in ("sensors", "excitations"):
        for i, one in enumerate(tree.get(kind, [])):
            mass = one.get("mass", 0.0)
            if isinstance(mass, int | float) and mass > HEAVIEST_SENSOR:
                yield (
                    (kind, i, "mass"),
                    f"a sensor's mass of {mass:g} kg is implausible; accelerometers weigh up to "
                    f"{HEAVIEST_SENSOR:g} kg; is it in grams ({mass / 1000:g} kg)?",
                )
