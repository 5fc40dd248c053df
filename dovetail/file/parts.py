"""Materials, sections, members, supports and masses of a study."""

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from dovetail.file.geometry import Geometry
from dovetail.file.section_table import Sections, section_rows
from dovetail.file.table import StudyTable, as_vector, suggest
from fem.connection_damping import ConnectionDamping
from fem.effects.added_mass import AddedMass
from fem.effects.distributed_mass import DistributedMass
from fem.effects.joint import Joint
from fem.effects.shear_centre import ShearCentre, is_eccentric
from fem.effects.support import Support
from fem.elements.layout import local_axes
from fem.elements.properties import MASSES, THEORIES, MemberProperties
from fem.io import read_modes
from fem.io.faults import no_file
from fem.materials import Material
from fem.mesh import Mesh, merge_names
from fem.model import DIRECTIONS, Damping, Effect
from fem.sections.section import OPTIONS, SHAPES, Section

NUMBERED = re.compile(r"(curve|physical) \d+(\.\d+)?")
"""Names of members of a Gmsh file whose groups have none."""


def read_axes(t: StudyTable) -> np.ndarray:
    """Read axes of an element's own: its x, and a vector on the y side of its x-y plane."""
    if "axes" not in t:
        return np.eye(3)
    rows = t.get("axes")
    if not isinstance(rows, list) or len(rows) != 2:
        t.refuse("axes", "two vectors are needed: the x axis, and one in the x-y plane")
    x, v = (as_vector(t, "axes", row, 3, "-") for row in rows)
    z = np.cross(x, v)
    if np.linalg.norm(z) <= 1e-6 * np.linalg.norm(x) * np.linalg.norm(v) or not np.linalg.norm(x):
        t.refuse("axes", f"the vectors {rows[0]} and {rows[1]} are parallel or zero; they must span a plane")
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def read_materials(top: StudyTable) -> dict[str, Material]:
    """Read ``[materials.NAME]``."""
    out = {}
    for name, t in top.table("materials").named():
        with t.at():
            out[name] = Material(
                name,
                t.number("E", above=0, unit="Pa"),
                t.number("rho", above=0, unit="kg/m³"),
                t.number("nu", 0.3),
                t.number("loss_factor", 0.0, least=0),
            )
        t.finish()
    return out


def read_sections(top: StudyTable, folder: Path, notes: list[str]) -> Sections:
    """Read ``[sections.NAME]``, and the rows of the table that ``file`` names."""
    t = top.table("sections")
    rows: dict[str, StudyTable] = {}
    if isinstance(t.values.get("file"), str):
        path = folder / t.text("file")
        if not path.is_file():
            t.refuse("file", no_file(path))
        with t.at("file"):
            rows = section_rows(path, notes)
    written = {name: t.table(name) for name in t.values if name != "file" or not rows}
    return Sections(written, rows, read_section)


def read_section(t: StudyTable, label: str, nu: float) -> Section:
    """Read a section: a shape with its dimensions, or A, Iy, Iz, J, ky, kz, which go before it.

    Its shear coefficients are those for Poisson's ratio ``nu``, unless the table states another.
    """
    shape = t.text("shape", "", (*SHAPES, "polygon"))
    constants = ("A", "Iy", "Iz", "J")
    if not shape:
        if not any(key in t for key in constants):
            text = f"the section has neither a shape ({', '.join(SHAPES)}, polygon) nor A, Iy, Iz and J"
            t.refuse_without("shape", text, next(iter(SHAPES)))
        values: dict[str, Any] = {key: _constant(t, key) for key in constants}
        with t.at():
            section = Section(
                **values,
                ky=t.number("ky", 0.0, least=0),
                kz=t.number("kz", 0.0, least=0),
                label=label,
                Ip=t.number("Ip", 0.0, least=0, unit="m⁴"),
                angle=t.number("angle", 0.0, unit="rad"),
            )
        t.finish()
        return section
    if shape == "polygon":
        section = _polygon(t, label, nu)
    else:
        sizes: dict[str, float] = {
            key: t.integer(key, least=3) if key == "n" else t.number(key, above=0, unit="m")
            for key in SHAPES[shape]
        }
        for key in OPTIONS.get(shape, ()):
            if key == "nu":
                sizes[key] = t.number(key, nu)
            elif key in t:
                sizes[key] = t.number(key, least=0, unit="m")
        with t.at():
            section = Section.of_shape(shape, **sizes)
    given = {key: _constant(t, key) for key in constants if key in t}
    given |= {key: t.number(key, least=0) for key in ("ky", "kz") if key in t}
    if given and shape != "polygon":
        with t.at():
            section = replace(
                section,
                **given,
                Ip=0.0,
                shape="",
                dimensions={},
                label=f"{section.label}, {', '.join(given)} as given",
                estimated_k=section.estimated_k and not {"ky", "kz"} & set(given),
            )
    t.finish()
    return section


def _polygon(t: StudyTable, label: str, nu: float) -> Section:
    """Read an outline with holes: J, ky and kz as given, or by finite elements where J is not."""
    outlines = [t.get("outer"), *t.get("holes", [])]
    for key in ("A", "Iy", "Iz"):
        if key in t:
            t.refuse(key, "the polygon already defines it; leave out either this key or the shape")
    with t.at("outer"):
        try:
            outer, *holes = (np.array(outline, dtype=float) for outline in outlines)
        except (ValueError, TypeError):
            t.refuse(
                "outer", "a list of corners [y, z] is needed, and a list of such lists for the holes [m]"
            )
        if "J" in t:
            ky, kz = t.number("ky", 0.0, least=0), t.number("kz", 0.0, least=0)
            return Section.polygon(outer, holes, J=_constant(t, "J"), ky=ky, kz=kz, label=label or "polygon")
        if "ky" in t or "kz" in t:
            t.refuse("", "the polygon has ky or kz but no J; give J too, or none of them")
        return Section.arbitrary(outer, holes, nu=t.number("nu", nu), label=label or "arbitrary section")


def _constant(t: StudyTable, key: str) -> float:
    return t.number(key, above=0, unit="m²" if key == "A" else "m⁴")


def note_shear_centres(members: Mapping[str, MemberProperties], coupled: Container[str] = ()) -> list[str]:
    """Return a note on each section whose shear centre is not its centroid: the elements take it to be.

    ``coupled`` has the names of candidates that are known to be there.
    """
    out: dict[str, str] = {}
    for name, member in members.items():
        y, z = member.section.shear_centre
        if is_eccentric(member) and f"{ShearCentre.kind}:{name}" not in coupled:
            out.setdefault(
                member.section.label,
                f"section {member.section.label} (member '{name}' …) has its shear centre "
                f"{np.hypot(y, z):.3g} m from its centroid; it is assumed to twist about the centroid, "
                f"so that bending and torsion are not coupled; [[effects]] candidate = "
                f'"{ShearCentre.kind}:{name}" couples them',
            )
    return list(out.values())


def note_one_sided(members: Mapping[str, MemberProperties]) -> list[str]:
    """Return a note on bars that carry tension or compression alone."""
    names = tuple(name for name, member in members.items() if member.only)
    if not names:
        return []
    return [
        f"{merge_names(names)} may go slack in dovetail static alone; all other analyses take bars that "
        "carry tension and compression"
    ]


def _with_key(tables: Sequence[StudyTable], key: str) -> StudyTable | None:
    """Return the first table that has a key."""
    return next((t for t in tables if key in t), None)


def read_members(
    top: StudyTable,
    mesh: Mesh,
    inline: bool,
    materials: Mapping[str, Material],
    sections: Sections,
) -> tuple[
    dict[str, MemberProperties], dict[str, tuple[float | None, int | None]], tuple[DistributedMass, ...]
]:
    """Read the properties of every member of the mesh, element sizes and counts, and masses per length."""
    members, defaults = top.table("members"), top.table("defaults")
    tables = dict(members.named())
    for name, table in tables.items():
        if inline:
            for end in ("from", "to"):
                table.get(end)
        elif name not in mesh.members and name not in mesh.groups:
            known = [*mesh.members, *mesh.groups]
            unnamed = all(NUMBERED.fullmatch(one) for one in mesh.members)
            hint = "; the mesh has no named physical group of curves: is one missing?" if unnamed else ""
            members.refuse(name, f"the mesh has no member or group '{name}'; {suggest(name, known)}{hint}")
    out, sizes, layers = {}, {}, []
    for name in mesh.members:
        member_table = tables.get(name, members)
        groups = [tables[g] for g, names in mesh.groups.items() if name in names and g in tables]
        chain = [*([tables[name]] if name in tables else []), *groups, defaults]
        out[name] = _properties(chain, member_table, name, materials, sections)
        points = mesh.points[mesh.lines[mesh.members[name]]]
        holder = _with_key(chain, "orientation") or member_table
        with holder.at("orientation"):
            local_axes(points[:, 1] - points[:, 0], out[name].orientation, name)
        zones, length = out[name].rigid1 + out[name].rigid2, mesh.member_length(name)
        if zones >= 0.999 * length:
            member_table.refuse(
                "",
                f"the rigid end zones of member '{name}' are {zones:g} m long together; it has {length:g} m",
            )
        sizes[name] = _element_size(chain)
        layer = _with_key(chain, "mass_per_length")
        mass = 0.0 if layer is None else layer.number("mass_per_length", least=0, unit="kg/m")
        if mass:
            layers.append(DistributedMass.over(mesh, name, out[name], mass))
    for table in (*tables.values(), defaults):
        table.finish()
    sections.check_unused()
    return out, sizes, tuple(layers)


def _properties(
    chain: Sequence[StudyTable],
    member_table: StudyTable,
    name: str,
    materials: Mapping[str, Material],
    sections: Sections,
) -> MemberProperties:
    """Read a member's properties, each from the first table of its chain that has it."""

    def read(key: str, how: Any, default: Any) -> Any:
        holder = _with_key(chain, key)
        return default if holder is None else how(holder)

    def refuse_without(key: str, known: Mapping[str, Any]) -> NoReturn:
        text = f"member '{name}' has no {key}; give it one, or one to [defaults]; {suggest('', known)}"
        next((t for t in chain if t.unread_like(key)), member_table).refuse_without(key, text)

    material = read("material", lambda t: _named(t, "material", materials), None)
    if material is None:
        if len(materials) != 1:
            refuse_without("material", materials)
        (material,) = materials.values()
    section = read("section", lambda t: _section(t, "section", sections, material.nu), None)
    if section is None:
        if len(sections) != 1:
            refuse_without("section", sections)
        (only,) = sections
        section = sections.section(only, material.nu)
    zero = np.zeros(3)
    orientation = read("orientation", lambda t: t.direction("orientation"), None)
    with member_table.at():
        return MemberProperties(
            material,
            section,
            orientation,
            read("offset1", lambda t: t.vector("offset1"), zero),
            read("offset2", lambda t: t.vector("offset2"), zero),
            read("rigid1", lambda t: t.number("rigid1", least=0, unit="m"), 0.0),
            read("rigid2", lambda t: t.number("rigid2", least=0, unit="m"), 0.0),
            read("theory", lambda t: t.text("theory", choices=THEORIES), "timoshenko"),
            section2=read("section2", lambda t: _section(t, "section2", sections, material.nu), None),
            mass=read("mass", lambda t: t.text("mass", choices=MASSES), "consistent"),
            release1=read("release1", lambda t: t.directions("release1"), ()),
            release2=read("release2", lambda t: t.directions("release2"), ()),
            spring1=read("spring1", lambda t: _springs(t, "spring1"), {}),
            spring2=read("spring2", lambda t: _springs(t, "spring2"), {}),
            pretension=read("pretension", lambda t: t.number("pretension", unit="N"), 0.0),
            spin=read("spin", lambda t: t.number("spin", unit="-"), 0.0),
            only=read("only", lambda t: t.text("only", choices=("tension", "compression")), ""),
        )


def _springs(t: StudyTable, key: str) -> dict[str, float]:
    """Read ``{ ry = 2e4 }``: stiffness of an end's connection in local directions."""
    inner = t.table(key)
    units = {d: "N·m/rad" if d.startswith("r") else "N/m" for d in DIRECTIONS}
    springs = {d: inner.number(d, least=0, unit=units[d]) for d in DIRECTIONS if d in inner}
    inner.finish()
    return springs


def _named(t: StudyTable, key: str, known: Mapping[str, Any], what: str = "") -> Any:
    name = t.text(key)
    if name not in known:
        t.refuse(key, f"there is no {what or key} '{name}'; {suggest(name, known)}")
    return known[name]


def _section(t: StudyTable, key: str, sections: Sections, nu: float) -> Section:
    if isinstance(t.values[key], dict):
        return read_section(t.table(key), "", nu)
    name = t.text(key)
    _named(t, key, sections, "section")
    return sections.section(name, nu)


def _element_size(chain: Sequence[StudyTable]) -> tuple[float | None, int | None]:
    size, count = _with_key(chain, "element_size"), _with_key(chain, "elements")
    return (
        None if size is None else size.number("element_size", above=0, unit="m"),
        None if count is None else count.integer("elements"),
    )


def read_supports(top: StudyTable, geometry: Geometry) -> tuple[Effect, ...]:
    """Read ``[[supports]]``; those with axes of their own are joints to the ground.

    One at a set of points of the mesh means one at each of them.
    """
    out: list[Effect] = []
    for t in top.tables("supports"):
        value = t.get("point")
        points = geometry.group(value) or {"": geometry.point(t)}
        name = t.text("name", value if isinstance(value, str) else f"support{len(out) + 1}")
        fixed = t.directions("fixed", "all")
        if not fixed:
            t.refuse(
                "fixed", "no direction is fixed; name some of x y z rx ry rz, all, translations, rotations"
            )
        axes = read_axes(t)
        t.finish()
        for full, point in points.items():
            each = name + full.removeprefix(str(value))
            if np.array_equal(axes, np.eye(3)):
                out.append(Support(name=each, point=point, fixed=fixed))
            else:
                where = geometry.mesh.points[point]
                out.append(Joint(name=each, point1=point, location=where, axes=axes, rigid=fixed))
    return tuple(out)


def read_masses(top: StudyTable, geometry: Geometry) -> tuple[AddedMass, ...]:
    """Read ``[[masses]]``."""
    out: list[AddedMass] = []
    for t in top.tables("masses"):
        value = t.get("point")
        name = t.text("name", f"mass at {value}" if isinstance(value, str) else f"mass{len(out) + 1}")
        inertia = np.zeros((3, 3))
        if "inertia" in t:
            rows = t.get("inertia")
            inertia = (
                t.matrix("inertia", 3) if isinstance(rows, list) else t.number("inertia", least=0) * np.eye(3)
            )
            least = np.linalg.eigvalsh((inertia + inertia.T) / 2)[0]
            if least < -1e-9 * np.abs(inertia).max() or not np.allclose(inertia, inertia.T):
                t.refuse(
                    "inertia", "the tensor must be symmetric and have no negative principal value [kg·m²]"
                )
        mass = AddedMass(
            name=name,
            point=geometry.point(t),
            mass=t.number("mass", least=0, unit="kg"),
            inertia=inertia,
            arm=t.vector("arm", np.zeros(3)),
            spins=t.flag("spins", True),
        )
        t.finish()
        out.append(mass)
    return tuple(out)


def read_damping(
    top: StudyTable, folder: Path, notes: list[str]
) -> tuple[Damping, tuple[ConnectionDamping, ...]]:
    """Read ``[damping]``; a file of modes gives their ratios over frequency.

    Beside the structure's damping there is that of connections, if they are damped otherwise.
    """
    t = top.table("damping")
    if not t.values:
        for key in ("modal", "file", "alpha", "beta", "loss_factor", "connections"):
            t.get(key, None)
        notes.append("no damping is given: a modal damping ratio of 0.5 % is assumed for all modes")
        return Damping.modal(0.005), ()
    ratio, frequency, powers = np.zeros(1), np.zeros(1), False
    if "modal" in t and "file" in t:
        t.refuse("file", "give either modal, ratios, or file, with modes that have them")
    if "file" in t:
        frequency, ratio = _ratios_of_file(t, folder)
    elif "modal" in t and isinstance(t.get("modal"), dict):
        inner = t.table("modal")
        ratio, frequency = (
            inner.vector("ratio", size=None, unit="-"),
            inner.vector("frequency", size=None, unit="Hz"),
        )
        powers = inner.text("between", "lines", ("lines", "powers")) == "powers"
        inner.finish()
    elif "modal" in t:
        ratio = np.array([t.number("modal", least=0)])
    with t.at("file" if "file" in t else "modal"):
        modal = Damping.modal(ratio, frequency, powers=powers)
    others: tuple[ConnectionDamping, ...] = ()
    if "connections" in t:
        inner = t.table("connections")
        f = inner.vector("frequency", size=None, unit="Hz")
        zeta = inner.vector("ratio", size=None, unit="-")
        inner.finish()
        with t.at("connections"):
            Damping.modal(zeta, f, powers=True)  # its error names the fault
        others = (ConnectionDamping(frequency=f, ratio=zeta),)
    damping = Damping(
        modal.frequency,
        modal.ratio,
        t.number("alpha", 0.0, least=0, unit="1/s"),
        t.number("beta", 0.0, least=0, unit="s"),
        t.number("loss_factor", 0.0, least=0),
        powers,
    )
    t.finish()
    return damping, others


def _ratios_of_file(t: StudyTable, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and damping ratios of the modes in a file, for instance identified ones."""
    path = folder / t.text("file")
    if not path.is_file():
        t.refuse("file", no_file(path))
    with t.at("file"):
        modes = read_modes(path)
    if modes.zeta is None or not (modes.frequency > 0).any():
        t.refuse("file", f"{path.name} has no damping ratios of modes above 0 Hz")
    rising = np.argsort(modes.frequency, kind="stable")
    f, zeta = modes.frequency[rising], modes.zeta[rising]
    f, first = np.unique(f[f > 0], return_index=True)  # of equal frequencies, the first
    return f, zeta[len(zeta) - (modes.frequency > 0).sum() :][first]
