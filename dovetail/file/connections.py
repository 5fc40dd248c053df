"""Connections of a study's members: joints, viscoelastic elements, links, equations, foreign parts."""

import warnings
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.geometry import Geometry
from dovetail.file.parts import read_axes
from dovetail.file.table import Table, suggest
from fem.effects.joint import Joint, joint_unit
from fem.effects.rigid_link import MultiPointConstraint, RigidLink
from fem.effects.sprung_mass import SprungMass
from fem.effects.superelement import Superelement
from fem.effects.viscoelastic import LAWS, TabulatedStiffness, Viscoelastic
from fem.elements.part_ties import TIES, Attachment
from fem.io.abaqus import read_node_sets
from fem.io.matrices import read_matrices
from fem.model import DIRECTIONS, Effect

UNITS = {"ratio": "-", "tau": "s", "alpha": "-"}
"""Units of the laws' parameters."""


def read_joints(top: Table, geometry: Geometry) -> tuple[Joint, ...]:
    """Read ``[[joints]]``."""
    out: list[Joint] = []
    for t in top.tables("joints"):
        name = t.text("name", f"joint{len(out) + 1}")
        place = _place(t, geometry, "joint")
        rigid = t.directions("rigid", "")
        matrices: dict[str, Any] = dict(_joint_matrices(t))
        eta = t.number("eta", 0.0, least=0)
        t.finish()
        with t.at():
            out.append(Joint(name=name, eta=eta, rigid=rigid, **place, **matrices))
        if not (rigid or out[-1].elastic or out[-1].C.any() or out[-1].M.any()):
            t.refuse("", f"joint '{name}' does nothing: give k, K, C, M or rigid")
    return tuple(out)


def _place(t: Table, geometry: Geometry, what: str) -> dict[str, Any]:
    """Read both sides, location and axes of an element between two points."""
    point1 = _side(t, geometry, "1")
    point2 = _side(t, geometry, "2") if "point2" in t or "member2" in t else None
    if point1 is None or point1 == point2:
        t.refuse(
            "",
            f"both sides of the {what} are the same point; give point1 or member1 and "
            "position1, and a second side or none for the ground",
        )
    points = geometry.mesh.points
    middle = points[point1] if point2 is None else (points[point1] + points[point2]) / 2
    location = geometry.coordinates(t, "location") if "location" in t else middle
    return {"point1": point1, "point2": point2, "location": location, "axes": read_axes(t)}


def _side(t: Table, geometry: Geometry, side: str) -> int | None:
    if f"point{side}" in t and f"member{side}" in t:
        t.refuse(f"point{side}", f"give either point{side}, or member{side} and position{side}")
    if f"point{side}" in t:
        return geometry.point(t, f"point{side}")
    member = geometry.member(t, f"member{side}")
    return geometry.point_on(member, geometry.position(t, f"position{side}", member))


def _joint_matrices(t: Table, keys: tuple[str, ...] = ("K", "C", "D", "M")) -> dict[str, NDArray[np.float64]]:
    out = {key: t.matrix(key) for key in keys if key in t}
    for key in ("k", "c"):
        if key.upper() not in keys or key not in t:
            continue
        if key.upper() in out:
            t.refuse(key, f"give either {key} or {key.upper()}")
        inner = t.table(key)
        diagonal = [
            inner.number(
                f"{key}{d}",
                0.0,
                least=0,
                unit=("N/m" if key == "k" else "N·s/m") + (" or per radian")[: 14 * (len(d) > 1)],
            )
            for d in DIRECTIONS
        ]
        inner.finish()
        out[key.upper()] = np.diag(diagonal)
    return out


def read_sprung_masses(top: Table, geometry: Geometry) -> tuple[SprungMass, ...]:
    """Read ``[[sprung_masses]]``: by stiffness and damping, or by frequency and damping ratio."""
    out: list[SprungMass] = []
    for t in top.tables("sprung_masses"):
        name = t.text("name", f"sprung mass{len(out) + 1}")
        more: dict[str, Any] = {
            "name": name,
            "point": geometry.point(t),
            "mass": t.number("mass", above=0, unit="kg"),
            "arm": t.vector("arm", np.zeros(3)),
            "axes": read_axes(t),
        }
        if "frequency" in t:
            for key in ("k", "c", "inertia", "eta"):
                if key in t:
                    t.refuse(key, "give either frequency and zeta, or k, c, eta and inertia")
            frequency = t.number("frequency", above=0, unit="Hz")
            zeta = t.number("zeta", 0.0, least=0, unit="-")
            directions = t.directions("directions")
            t.finish()
            with t.at("directions"):
                out.append(SprungMass.tuned(frequency=frequency, zeta=zeta, directions=directions, **more))
            continue
        given = {key: np.diag(X) for key, X in _joint_matrices(t, ("K", "C")).items()}
        k, c = (
            {d: float(v) for d, v in zip(DIRECTIONS, given.get(key, np.zeros(6)), strict=True) if v}
            for key in "KC"
        )
        inertia = t.vector("inertia", np.zeros(3), unit="kg·m²")
        eta = t.number("eta", 0.0, least=0)
        t.finish()
        with t.at():
            out.append(SprungMass(k=k, c=c, eta=eta, inertia=np.diag(inertia), **more))
    return tuple(out)


def read_viscoelastic(top: Table, geometry: Geometry) -> tuple[Effect, ...]:
    """Read ``[[viscoelastic]]``: elements with a law, or with a table of complex stiffnesses."""
    out: list[Effect] = []
    for t in top.tables("viscoelastic"):
        name = t.text("name", f"viscoelastic{len(out) + 1}")
        place = _place(t, geometry, "element")
        law = t.text("law", choices=(*LAWS, "table"))
        if law == "table":
            frequency, K = _stiffness_table(t)
            t.finish()
            with t.at():
                out.append(TabulatedStiffness(name=name, frequency=frequency, K=K, **place))
            continue
        values = {f.name: t.number(f.name, above=0, unit=UNITS[f.name]) for f in fields(LAWS[law])}
        K = _joint_matrices(t, ("K",)).get("K")
        if K is None or not K.any():
            t.refuse("", f"element '{name}' has no static stiffness: give k or K")
        t.finish()
        with t.at():
            out.append(Viscoelastic(name=name, K=K, law=LAWS[law](**values), **place))
    return tuple(out)


def _stiffness_table(t: Table) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Read ``table``: frequencies, and storage and loss of some of kx … krz."""
    table = t.table("table")
    frequency = table.vector("frequency", size=None, unit="Hz")
    K = np.zeros((len(frequency), 6, 6), dtype=complex)
    for i, d in enumerate(DIRECTIONS):
        if f"k{d}" not in table:
            continue
        inner = table.table(f"k{d}")
        storage, loss = (
            inner.vector(key, size=len(frequency), unit=joint_unit(d)) for key in ("storage", "loss")
        )
        inner.finish()
        K[:, i, i] = storage + 1j * loss
    table.finish()
    if not K.any():
        known = ", ".join(f"k{d}" for d in DIRECTIONS)
        table.refuse("", f"the table has no stiffness: give storage and loss of some of {known}")
    return frequency, K


def read_rigid_links(top: Table, geometry: Geometry) -> tuple[RigidLink, ...]:
    """Read ``[[rigid_links]]``."""
    out: list[RigidLink] = []
    for t in top.tables("rigid_links"):
        name = t.text("name", f"link{len(out) + 1}")
        point = geometry.point(t)
        dependents = _points(t, geometry, "dependents")
        directions = t.directions("directions", "all")
        t.finish()
        with t.at():
            out.append(RigidLink(name=name, point=point, dependents=dependents, directions=directions))
    return tuple(out)


def _points(t: Table, geometry: Geometry, key: str) -> tuple[int, ...]:
    values = t.get(key)
    if not isinstance(values, list):
        t.refuse(key, "a list of places is needed")
    inner = Table(t.source, (*t.path, key), {str(i): v for i, v in enumerate(values)})
    return tuple(geometry.point(inner, k) for k in inner.values)


def read_constraints(top: Table, geometry: Geometry) -> tuple[MultiPointConstraint, ...]:
    """Read ``[[constraints]]``: linear equations between displacements and rotations of points."""
    out: list[MultiPointConstraint] = []
    for t in top.tables("constraints"):
        name = t.text("name", f"constraint{len(out) + 1}")
        terms = []
        for term in t.tables("terms"):
            terms.append(
                (geometry.point(term), term.text("direction", choices=DIRECTIONS), term.number("coefficient"))
            )
            term.finish()
        t.finish()
        with t.at():
            out.append(MultiPointConstraint(name=name, terms=tuple(terms)))
    return tuple(out)


def read_superelements(
    top: Table, geometry: Geometry, folder: Path, highest: float, notes: list[str]
) -> tuple[Superelement, ...]:
    """Read ``[[superelements]]``: parts from other programs, tied to points of the frame."""
    out: list[Superelement] = []
    for t in top.tables("superelements"):
        file = t.text("file")
        path = folder / file
        name = t.text("name", path.stem)
        units = t.get("units", "SI")
        sets, deck = t.text("node_sets", ""), t.text("deck", "")
        for key, other in (("deck", deck), ("node_sets", sets)):
            if other and not (folder / other).is_file():
                t.refuse(key, f"there is no file '{folder / other}'")
        with t.at("file"):
            places = folder / deck if deck else None
            part = read_matrices(path, units if isinstance(units, str) else tuple(units), deck=places)
        with t.at("node_sets"):
            known = read_node_sets(folder / sets) if sets else {}
        attachments = [_attachment(a, geometry, known) for a in t.tables("attach")]
        n_modes = t.whole("modes", None, 0)
        top_mode = t.number("max_frequency", 2 * highest, above=0, unit="Hz")
        held, eta = t.flag("held", False), t.number("eta", 0.0, least=0)
        t.finish()
        with t.at(), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            out.append(
                Superelement.from_matrices(
                    name, part, geometry.mesh, attachments, held=held, eta=eta, n_modes=n_modes,
                    max_frequency=None if n_modes is not None else top_mode,
                )
            )  # fmt: skip
        notes.extend(str(w.message) for w in caught)
    return tuple(out)


def _attachment(t: Table, geometry: Geometry, known: Mapping[str, tuple[int, ...]]) -> Attachment:
    point = geometry.point(t)
    if "node_set" in t:
        name = t.text("node_set")
        if name.upper() not in known:
            t.refuse("node_set", f"there is no node set '{name}'; {suggest(name.upper(), known)}")
        nodes = known[name.upper()]
    else:
        nodes = tuple(int(n) for n in t.vector("nodes", size=None, unit="-"))
    tie = t.text("tie", "rigid", TIES)
    t.finish()
    with t.at():
        return Attachment(point, nodes, tie)
