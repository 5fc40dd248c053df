"""The structure of a study to start from: a Nastran, Abaqus or ANSYS deck's, or a mesh with placeholders.

A deck's mesh is written as a file beside the study, in metres, with members and named nodes; its sections,
supports, masses and connections are tables of the study. Read again, they are `fem.io.read_model`'s model.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.toml import CONVERTED_DIGITS, rounded, toml_comment, toml_key, toml_table, toml_value
from dovetail.file.uncertain import assumed_tables
from fem.checks import with_ties_known
from fem.effects.added_mass import AddedMass
from fem.effects.distributed_mass import DistributedMass
from fem.effects.joint import Joint
from fem.effects.rigid_link import MultiPointConstraint, RigidLink
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.io.abaqus import abaqus_text
from fem.io.deck_units import DeckUnits, likely_units
from fem.io.frame_deck import FrameDeck
from fem.io.frame_model import model_of, read_deck
from fem.io.meshfile import check_names, read_mesh
from fem.io.programs import program_of
from fem.mesh import Mesh, MeshError, free_name
from fem.model import DIRECTIONS, Damping, Model
from fem.plausibility import si_number
from fem.sections.section import Section
from updating.measurement.matching import SCALES

MESH = "mesh.inp"
"""Name of the mesh file beside the study."""

Values = dict[str, Any]

_PLACEHOLDERS = """\
[materials.steel] # change
E = 210e9
rho = 7850.0

[sections.flat] # change; circle (d), tube (d, t), hollow_rectangle (b, h, t), i_section (b, h, tf, tw), ...
shape = "rectangle"
b = 0.030
h = 0.010

[defaults] # for every member that does not say otherwise, under [members.NAME]
material = "steel"
section = "flat"

# [[supports]] # without any the structure is free
# point = [0.0, 0.0, 0.0]
# fixed = "all"

[damping]
modal = 0.01 # change
"""


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """The structure of a study: its tables from ``[mesh]`` to ``[damping]``.

    Attributes
    ----------
    mesh : Mesh
    text : str
    files : dict of str to str
        Texts of files beside the study, by name.
    complete : bool
        Whether the tables are those of a deck; materials, sections, supports and damping are placeholders
        otherwise.
    notes : tuple of str
    units_hint : str
        Units that the deck's materials look like, if they are implausible as read.
    """

    mesh: Mesh
    text: str
    files: dict[str, str]
    complete: bool
    notes: tuple[str, ...] = ()
    units_hint: str = ""


def read_structure(
    file: Path,
    folder: Path,
    *,
    units: str | Sequence[float] = "SI",
    mesh_will_do: bool = False,
) -> Structure:
    """Return the structure of a deck with sections, or of a mesh.

    Parameters
    ----------
    file, folder : Path
        The deck or the mesh, and the folder of the study.
    units : str or (length, mass, time)
        Of a deck, such as ``"mm-t-s"``; of a mesh's coordinates, such as ``"mm"``, with which a deck is read
        as a mesh.
    mesh_will_do : bool
        Whether a deck that is no model is read as a mesh.

    Raises
    ------
    MeshError
        If the file cannot be read.
    """
    notes: list[str] = []
    unit = SCALES.get(units) if isinstance(units, str) else None
    sizes = DeckUnits.of("SI" if unit else units)  # wrong ones are no reason to read a deck as a mesh
    scale = unit or sizes.length
    is_deck = program_of(file) is not None
    if is_deck and unit:
        notes.append(f"the deck is read as a mesh in {units}: for its sections give units such as mm-t-s")
    elif is_deck:
        try:
            deck = read_deck(file, units)
            if deck.properties:
                made = _of_deck(deck, sizes)
                table = toml_table("[source]", {"file": named_from(folder, file), "units": _units(units)})
                return replace(
                    made,
                    text=f"{table.rstrip()} # the deck; dovetail export keeps its numbers\n\n{made.text}",
                )
        except MeshError as reason:
            if not mesh_will_do or units != "SI":  # who states a deck's units wants its sections
                raise
            notes.append(f"the deck is read as a mesh: {reason}")
    mesh = read_mesh(file, scale)
    table = {"file": named_from(folder, file), **({"scale": scale} if scale != 1 else {})}
    return Structure(mesh, f"{toml_table('[mesh]', table)}\n{_PLACEHOLDERS}", {}, False, tuple(notes))


def named_from(folder: Path, path: Path) -> str:
    """Return the path of a file as a study in a folder names it."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def _units(units: str | Sequence[float]) -> str | list[float]:
    return units if isinstance(units, str) else [float(x) for x in units]


def _of_deck(deck: FrameDeck, units: DeckUnits) -> Structure:
    model = with_ties_known(model_of(deck))
    mesh = model.mesh
    check_names([*mesh.members, *mesh.groups], deck.file)
    counts = [
        f"{deck.file}: {mesh.n_points} nodes and {mesh.n_lines} bars in {len(mesh.members)} members",
        *(
            f"{n} {words}"
            for kind, words in _WORDS.items()
            if (n := sum(type(e) is kind for e in model.effects))
        ),
    ]
    comments = "".join(f"{toml_comment(note)}\n" for note in mesh.notes)
    text = f"{comments}\n{tables_of(model, deck.damping)}" if comments else tables_of(model, deck.damping)
    hint = _units_hint(deck, units)
    notes = (*([hint] if hint else []), ", ".join(counts), *mesh.notes)
    return Structure(mesh, text, {MESH: abaqus_text(mesh)}, True, notes, hint)


def _units_hint(deck: FrameDeck, units: DeckUnits) -> str:
    """Return the units that a deck's materials look like; empty if they are plausible as read."""
    materials = list({p.material.name: p.material for p in deck.properties}.values())
    likely = likely_units(materials, units)
    if not likely:
        return ""
    E = materials[0].E
    meant = E * DeckUnits.of(likely).stress / units.stress
    return (
        f"{deck.file} looks like a deck in {likely}: give --units {likely}, which makes E of "
        f"{materials[0].name} {si_number(meant)} Pa instead of {si_number(E)} Pa"
    )


_WORDS = {
    Support: "supports",
    AddedMass: "masses",
    Joint: "joints",
    RigidLink: "rigid links",
    MultiPointConstraint: "constraints",
}


# Tables -----------------------------------------------------------------------------------------------------


def tables_of(model: Model, damping: Damping | None) -> str:
    """Return the tables of a model whose mesh is the file ``MESH``.

    Parameters
    ----------
    model : Model
        Of :func:`fem.io.frame_model.model_of`.
    damping : Damping or None
        None writes a placeholder.
    """
    mesh = model.mesh
    (frame,) = model.of_kind(Frame)
    layers = {e.member: e.mass for e in model.of_kind(DistributedMass)}
    size = float(f"{1.001 * mesh.lengths().max():.4g}")
    table = toml_table("[mesh]", {"file": MESH, "element_size": size}).rstrip("\n")
    lone = len(np.unique(mesh.lines)) < mesh.n_points
    blocks = [
        f"{table} # the deck's elements; without this key, as many as accuracy needs"
        + ("\nfree_points = true # nodes on no bar, which masses, joints and links hold" if lone else "")
    ]
    blocks += [
        _converted(
            f"[materials.{toml_key(m.name)}]",
            {"E": m.E, "rho": m.rho, "nu": m.nu} | ({"loss_factor": m.loss_factor} if m.loss_factor else {}),
        )
        for m in frame.materials.values()
    ]
    sections, members = _members(mesh, frame.members, layers)
    blocks += [_converted(f"[sections.{toml_key(name)}]", _section(s)) for name, s in sections.items()]
    blocks += [_converted(header, values) for header, values in members]
    names = {point: name for name, point in mesh.point_names.items()}
    for effect in model.effects:
        blocks += [_converted(f"[[{header}]]", values) for header, values in _tables(effect, mesh, names)]
    blocks.append(_damping(damping))
    return "\n".join(block.rstrip("\n") + "\n" for block in blocks)


def _converted(header: str, values: Values) -> str:
    """Return a table without the last digits of numbers, in which conversions of units err."""
    return toml_table(header, rounded(values, CONVERTED_DIGITS))


def _members(
    mesh: Mesh, members: Mapping[str, MemberProperties], layers: Mapping[str, float]
) -> tuple[dict[str, Section], list[tuple[str, Values]]]:
    """Return sections by name, and the tables of members: what all or a group share is written once."""
    sections: dict[str, Section] = {}
    known: dict[str, str] = {}
    group_of = {member: group for group, parts in mesh.groups.items() for member in parts}

    def named(section: Section, name: str) -> str:
        key = repr(rounded(_section(section), CONVERTED_DIGITS))
        if key not in known:
            known[key] = free_name(name, name, sections)
            sections[known[key]] = section
        return known[key]

    each: dict[str, Values] = {}
    for name in mesh.members:
        p, kind = members[name], group_of.get(name, name)
        each[name] = {"material": p.material.name, "section": named(p.section, kind)}
        if p.section2 is not None:
            each[name]["section2"] = named(p.section2, f"{kind} second end")
        each[name] |= _member(p)
        if name in layers:
            each[name]["mass_per_length"] = layers[name]
    shared = _common(each.values())
    tables = [("[defaults]", shared)] if shared and len(each) > 1 else []
    for name in dict.fromkeys(group_of.get(name, name) for name in each):
        parts = mesh.groups.get(name, (name,))
        common = _common([each[part] for part in parts])
        tables.append((f"[members.{toml_key(name)}]", _without(common, shared if len(each) > 1 else {})))
        tables += [(f"[members.{toml_key(part)}]", _without(each[part], common)) for part in parts]
    return sections, [(header, values) for header, values in tables if values]


def _common(tables: Any) -> Values:
    first, *others = tables
    return {k: v for k, v in first.items() if all(k in t and t[k] == v for t in others)}


def _without(values: Values, known: Values) -> Values:
    return {k: v for k, v in values.items() if k not in known}


def _member(p: MemberProperties) -> Values:
    out: Values = {}
    if p.orientation is not None:
        out["orientation"] = _direction(p.orientation)
    if p.theory != "timoshenko":
        out["theory"] = p.theory
    if p.mass != "consistent":
        out["mass"] = p.mass
    for end in "12":
        if getattr(p, f"offset{end}").any():
            out[f"offset{end}"] = getattr(p, f"offset{end}").tolist()
        if getattr(p, f"release{end}"):
            out[f"release{end}"] = " ".join(getattr(p, f"release{end}"))
        if getattr(p, f"spring{end}"):
            out[f"spring{end}"] = dict(getattr(p, f"spring{end}"))
    return out


def _direction(v: np.ndarray) -> str | list[float]:
    axis = int(np.argmax(np.abs(v)))
    if not np.delete(v, axis).any():
        return ("-" if v[axis] < 0 else "") + "xyz"[axis]
    return v.tolist()


def _section(s: Section) -> Values:
    """Return a section by its shape if that gives the same constants, else by these."""
    keys = ("A", "Iy", "Iz", "J", "ky", "kz", "Ip", "angle")
    if s.shape:
        shape = Section.of_shape(s.shape, **s.dimensions)
        if np.allclose([getattr(s, k) for k in keys], [getattr(shape, k) for k in keys], rtol=1e-13, atol=0):
            return {"shape": s.shape, **s.dimensions}
    out = {k: getattr(s, k) for k in keys}
    if abs(s.Ip - s.Iy - s.Iz) <= 1e-13 * s.Ip:
        del out["Ip"]
    return {k: v for k, v in out.items() if v or k not in ("ky", "kz", "angle")}


def _tables(effect: Any, mesh: Mesh, names: Mapping[int, str]) -> Iterator[tuple[str, Values]]:
    """Yield the table of an effect; the members' tables have the frame and the layers of mass."""
    if isinstance(effect, Support):
        yield "supports", _named(effect.name, names[effect.point]) | {"fixed": _directions(effect.fixed)}
    elif isinstance(effect, AddedMass):
        more = {k: getattr(effect, k).tolist() for k in ("inertia", "arm") if getattr(effect, k).any()}
        head = {"name": effect.name, "point": names[effect.point], "mass": effect.mass}
        yield "masses", head | more
    elif isinstance(effect, Joint):
        yield "joints", _joint(effect, mesh, names)
    elif isinstance(effect, RigidLink):
        more = {} if len(effect.directions) == 6 else {"directions": _directions(effect.directions)}
        dependents = [names[p] for p in effect.dependents]
        head = {"name": effect.name, "point": names[effect.point], "dependents": dependents}
        yield "rigid_links", head | more
    elif isinstance(effect, MultiPointConstraint):
        terms = [{"point": names[p], "direction": d, "coefficient": c} for p, d, c in effect.terms]
        yield "constraints", {"name": effect.name, "terms": terms}


def _named(name: str, point: str) -> Values:
    return {"point": point} if name == point else {"name": name, "point": point}


def _joint(joint: Joint, mesh: Mesh, names: Mapping[int, str]) -> Values:
    out: Values = {"name": joint.name, "point1": names[joint.point1]}
    if joint.point2 is not None:
        out["point2"] = names[joint.point2]
    sides = [p for p in (joint.point1, joint.point2) if p is not None]
    if np.abs(joint.location - mesh.points[sides].mean(axis=0)).max() > 0:
        out["location"] = joint.location.tolist()
    if not np.array_equal(joint.axes, np.eye(3)):
        out["axes"] = joint.axes[:2].tolist()
    if joint.rigid:
        out["rigid"] = _directions(joint.rigid)
    for key in "KCD":
        X = np.asarray(getattr(joint, key))
        if key != "D" and np.array_equal(X, np.diag(np.diag(X))) and (np.diag(X) >= 0).all():
            lower = key.lower()
            values = {f"{lower}{d}": v for d, v in zip(DIRECTIONS, np.diag(X).tolist(), strict=True) if v}
            out |= {lower: values} if values else {}
        elif X.any():
            out[key] = X.tolist()
    return out


def _directions(directions: Sequence[str]) -> str:
    return "all" if len(directions) == 6 else " ".join(directions)


def _damping(damping: Damping | None) -> str:
    if damping is None:
        return "[damping] # the deck has none\nmodal = 0.01 # change\n"
    out: Values = {k: v for k in ("alpha", "beta", "loss_factor") if (v := getattr(damping, k))}
    if damping.ratio.any() or not out:
        modal: Any = float(damping.ratio[0])
        if len(damping.ratio) > 1:
            modal = {"frequency": damping.frequency.tolist(), "ratio": damping.ratio.tolist()}
            modal |= {"between": "powers"} if damping.powers else {}
        out["modal"] = modal
    return toml_table("[damping]", out)


# A study without a test -------------------------------------------------------------------------------------

_STUBS = """\
# What a test adds: where it measures and excites, and its FRFs.
#
# [[sensors]]
# name = "tip"
# point = {point}
# direction = "z"
#
# [[excitations]]
# name = "hammer"
# point = {point}
# direction = "z"
#
# [[measurements]]
# file = "frf.uff"
"""


def study_text(structure: Structure, name: str) -> str:
    """Return the text of a study of a structure alone."""
    point = next(iter(structure.mesh.point_names), None)
    place = structure.mesh.points[0].tolist() if point is None else point
    change = "" if structure.complete else ": material, section, supports and damping are placeholders"
    return f"""\
{toml_comment(f"A study of {name}{change}.")}
#
#   dovetail check study.toml      what is wrong or missing
#   dovetail modes study.toml      natural frequencies of the model
#
# Units are SI: m, kg, s, N, Pa, Hz. docs/study-file.md says what may stand here.

[study]
name = {toml_value(Path(name).stem)}

{structure.text}
{_STUBS.replace("{point}", toml_value(place))}
{assumed_tables()}"""
