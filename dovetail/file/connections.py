"""Connections of a study's members: joints, viscoelastic elements, links, equations, foreign parts."""

import hashlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fem.io
from dovetail.file.geometry import Geometry
from dovetail.file.parts import read_axes
from dovetail.file.paths import CONDENSED
from dovetail.file.table import StudyTable, suggest
from fem.effects.joint import Joint, joint_unit
from fem.effects.rigid_link import MultiPointConstraint, RigidLink
from fem.effects.sprung_mass import SprungMass
from fem.effects.superelement import Superelement
from fem.effects.viscoelastic import LAWS, TabulatedStiffness, Viscoelastic
from fem.elements.frame import Frame
from fem.elements.part_faces import PartFaces
from fem.elements.part_ties import TIES, Attachment
from fem.io.atomic import replacing
from fem.io.faults import no_file
from fem.matrices import Matrices
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Effect

UNITS = {"ratio": "-", "tau": "s", "alpha": "-"}
"""Units of the laws' parameters."""


def read_joints(top: StudyTable, geometry: Geometry) -> tuple[Joint, ...]:
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


def _place(t: StudyTable, geometry: Geometry, what: str) -> dict[str, Any]:
    """Read both sides, location and axes of an element between two points."""
    point1 = _side(t, geometry, "1")
    point2 = _side(t, geometry, "2") if "point2" in t or "member2" in t else None
    if point1 is None or point1 == point2:
        t.refuse(
            "",
            f"both sides of the {what} are the same point; give point1 or member1 and "
            "position1, and a second side or none for the ground. Members that end on another are welded to "
            "it there, unless [mesh] has connect = false",
        )
    points = geometry.mesh.points
    middle = points[point1] if point2 is None else (points[point1] + points[point2]) / 2
    location = geometry.coordinates(t, "location") if "location" in t else middle
    return {"point1": point1, "point2": point2, "location": location, "axes": read_axes(t)}


def _side(t: StudyTable, geometry: Geometry, side: str) -> int | None:
    if f"point{side}" in t and f"member{side}" in t:
        t.refuse(f"point{side}", f"give either point{side}, or member{side} and position{side}")
    if f"point{side}" in t:
        return geometry.point(t, f"point{side}")
    member = geometry.member(t, f"member{side}")
    return geometry.point_on(member, geometry.position(t, f"position{side}", member))


def _joint_matrices(
    t: StudyTable, keys: tuple[str, ...] = ("K", "C", "D", "M")
) -> dict[str, NDArray[np.float64]]:
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


def read_sprung_masses(top: StudyTable, geometry: Geometry) -> tuple[SprungMass, ...]:
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


def read_viscoelastic(top: StudyTable, geometry: Geometry) -> tuple[Effect, ...]:
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
            t.refuse_without("k", f"element '{name}' has no static stiffness: give k or K", {"kx": 1.0})
        t.finish()
        with t.at():
            out.append(Viscoelastic(name=name, K=K, law=LAWS[law](**values), **place))
    return tuple(out)


def _stiffness_table(t: StudyTable) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
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


def read_rigid_links(top: StudyTable, geometry: Geometry) -> tuple[RigidLink, ...]:
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


def _points(t: StudyTable, geometry: Geometry, key: str) -> tuple[int, ...]:
    values = t.get(key)
    if not isinstance(values, list):
        t.refuse(key, "a list of places is needed")
    inner = StudyTable(t.source, (*t.path, key), {str(i): v for i, v in enumerate(values)})
    return tuple(geometry.free_point(inner, k) for k in inner.values)


def read_constraints(top: StudyTable, geometry: Geometry) -> tuple[MultiPointConstraint, ...]:
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


@dataclass(frozen=True, slots=True, eq=False)
class ForeignPart:
    """A part of another program as the study gives it, before it is reduced.

    Attributes
    ----------
    table : Table
        Where the study gives it, for messages.
    name : str
    matrices : Matrices
    attachments : tuple of Attachment
        To points of the mesh, one of their own each.
    joints : tuple of Joint
        From these points to places of the structure.
    n_modes, max_frequency : int, float or None
        Modes to keep, by their number or up to a frequency [Hz].
    held : bool
    eta : float
        Loss factor [-].
    folder : Path
        Of the study; a large part that has been condensed is kept there.
    faces : PartFaces or None
        The outer surface, for pictures.
    """

    table: StudyTable
    name: str
    matrices: Matrices
    attachments: tuple[Attachment, ...]
    joints: tuple[Joint, ...]
    n_modes: int | None
    max_frequency: float | None
    held: bool
    eta: float
    folder: Path
    faces: PartFaces | None

    def reduced(
        self, mesh: Mesh, highest: float, notes: list[str], *, with_modes: bool = False
    ) -> Superelement:
        """Return the part reduced to its points and modes; what looks odd is noted.

        ``with_modes`` says whether the eigenvalues of its modes up to twice ``highest`` [Hz] are uncertain.
        """
        part = self._reduced(mesh, highest, notes)
        return replace(part, n_uncertain=part.n_modes_below(2 * highest)) if with_modes else part

    def _reduced(self, mesh: Mesh, highest: float, notes: list[str]) -> Superelement:
        top = None if self.n_modes is not None else self.max_frequency or 2 * highest
        file, key = self.folder / f"{self.name}{CONDENSED}", ""
        if self.matrices.n >= WORTH_KEEPING:
            key = fingerprint(self.matrices, mesh, self.attachments, (self.n_modes, top, self.held))
            points = tuple(a.point for a in self.attachments)
            known = stored(file, key, self.name, self.matrices, points)
            if known is not None:
                notes.extend(known[1])
                return replace(known[0], eta=self.eta, faces=self.faces)
        with self.table.at(), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            out = Superelement.from_matrices(
                self.name,
                self.matrices,
                mesh,
                self.attachments,
                held=self.held,
                eta=self.eta,
                n_modes=self.n_modes,
                max_frequency=top,
                residual=self.n_modes is None,
                faces=self.faces,
            )
        messages = [str(w.message) for w in caught]
        if key:
            store(file, key, out, messages)
        notes.extend(messages)
        return out


def read_foreign_parts(top: StudyTable, geometry: Geometry, folder: Path) -> tuple[ForeignPart, ...]:
    """Read ``[[superelements]]``: parts from other programs, with a point of the mesh for each attachment."""
    out: list[ForeignPart] = []
    for t in top.tables("superelements"):
        path = folder / t.text("file")
        name = t.text("name", path.stem)
        if name == Frame.kind:
            t.refuse("name", f"'{name}' stands for the members; give the part another name")
        given = t.get("units", "SI")
        units = given if isinstance(given, str) else tuple(given)
        sets, deck = t.text("node_sets", ""), t.text("deck", "")
        for key, other in (("deck", deck), ("node_sets", sets)):
            if other and not (folder / other).is_file():
                t.refuse(key, no_file(folder / other))
        with t.at("file"):
            places = folder / deck if deck else None
            part = fem.io.read_matrices(path, units, deck=places)
        with t.at("node_sets"):
            known = fem.io.read_node_sets(folder / sets) if sets else {}
        attachments: list[Attachment] = []
        joints: list[Joint] = []
        for k, a in enumerate(t.tables("attach"), start=1):
            attachments.append(_attachment(a, geometry, part, known, f"{name}.{k}", joints))
        n_modes, max_frequency = (
            t.integer("modes", None, 0),
            t.number("max_frequency", None, above=0, unit="Hz"),
        )
        held, eta = t.flag("held", False), t.number("eta", 0.0, least=0)
        mesh, faces = t.text("mesh", ""), None
        if mesh:
            with t.at("mesh"):
                faces = fem.io.read_part_faces(folder / mesh, part, units, held=held)
        t.finish()
        found = (tuple(attachments), tuple(joints), n_modes, max_frequency, held, eta, folder, faces)
        out.append(ForeignPart(t, name, part, *found))
    return tuple(out)


def _attachment(
    t: StudyTable,
    geometry: Geometry,
    part: Matrices,
    known: Mapping[str, tuple[int, ...]],
    default: str,
    joints: list[Joint],
) -> Attachment:
    """Read an attachment, and add the joint to the place that it names."""
    name = t.text("name", default)
    if "node_set" in t:
        named = t.text("node_set")
        if named.upper() not in known:
            t.refuse("node_set", f"there is no node set '{named}'; {suggest(named.upper(), known)}")
        nodes = known[named.upper()]
    else:
        nodes = tuple(int(n) for n in t.vector("nodes", size=None, unit="-"))
    tie, place = t.text("tie", "rigid", TIES), geometry.point(t) if "point" in t else None
    if name in geometry.mesh.point_names or name in geometry.places:
        t.refuse("name", f"there is a point '{name}' already; give the attachment another name")
    if place is None:
        with t.at("nodes"):
            xyz = np.mean([part.place_of(node) for node in nodes], axis=0)
    else:
        xyz = geometry.mesh.points[place]
    geometry.mesh = geometry.mesh.with_point(xyz, name)
    end = geometry.mesh.point_names[name]
    if place is not None:
        matrices: dict[str, Any] = dict(_joint_matrices(t))
        rigid = t.directions("rigid", "" if "K" in matrices else "all")
        eta, axes = t.number("eta", 0.0, least=0), read_axes(t)
        with t.at():
            joint = Joint(
                name=name, point1=place, point2=end, location=xyz, axes=axes, eta=eta, rigid=rigid, **matrices
            )
        joints.append(joint)
    t.finish()
    with t.at():
        return Attachment(end, nodes, tie)


# Condensed parts in files next to the study, so that the next command does not condense them again ----------


WORTH_KEEPING = 20_000
"""Rows of a part from which it takes seconds to condense."""

FORMAT = 1
"""Raised where the reduction or the arrays change: files of other formats are made anew."""

_ARRAYS = ("K", "M", "C", "D", "recovery", "fixed_frequency", "left_out")
_NUMBERS = ("limit", "order", "reach")


def fingerprint(
    part: Matrices, mesh: Mesh, attachments: Sequence[Attachment], settings: Sequence[Any]
) -> str:
    """Return a digest of everything that a condensed part follows from."""
    digest = hashlib.sha256(repr((FORMAT, *settings)).encode())
    for X in (part.K, part.M, part.C, part.D):
        for array in () if X is None else (X.data, X.indices, X.indptr):
            digest.update(np.ascontiguousarray(array).tobytes())
    for array in (part.node, part.direction, part.nodes, part.points):
        digest.update(np.ascontiguousarray(array).tobytes())
    for a in attachments:
        digest.update(repr((a.point, a.nodes, a.tie, a.weights, mesh.points[a.point].tolist())).encode())
    return digest.hexdigest()


def stored(
    file: Path, key: str, name: str, part: Matrices, points: tuple[int, ...]
) -> tuple[Superelement, list[str]] | None:
    """Return the condensed part of a file and its notes; None if it is missing or of something else."""
    try:
        with np.load(file, allow_pickle=False) as arrays:
            if str(arrays["key"]) != key:
                return None
            values: dict[str, Any] = {k: arrays[k] for k in _ARRAYS if k in arrays}
            values |= {k: arrays[k].item() for k in _NUMBERS}
            notes = arrays["notes"].tolist()
    except Exception:  # damaged archives raise whatever zipfile, zlib and numpy come upon
        return None
    return Superelement(name=name, points=points, part=part, **values), notes


def store(file: Path, key: str, part: Superelement, notes: Sequence[str]) -> None:
    """Write a condensed part with its notes; a folder that cannot be written to is no fault."""
    known = {f.name: getattr(part, f.name) for f in fields(part)}
    arrays: dict[str, Any] = {k: np.asarray(known[k]) for k in (*_ARRAYS, *_NUMBERS) if known[k] is not None}
    arrays |= {"key": np.array(key), "notes": np.array(notes, dtype=str)}
    try:
        with replacing(file) as scratch, scratch.open("wb") as out:
            np.savez(out, **arrays)
    except OSError:
        return
