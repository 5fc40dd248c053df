"""The mesh of a study: from a file, or from points and members written into the study."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.table import StudyTable, as_vector, suggest
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.io import read_mesh
from fem.io.faults import no_file
from fem.mesh import Mesh, MeshError, MeshWarning, merge_names
from fem.model import Model
from fem.plausibility import USUAL_SOUND, Suspicion, si_number, suspicions, suspicions_of_material
from fem.sections.section import Section

TOUCH = 1e-6
"""Points nearer than this part of the structure's size are one place."""

MOST_ELEMENTS = 30_000
"""Elements of a mesh, unless the study allows more: their modes take some seconds and 0.6 GB."""


LEAST_ELEMENTS = 4
"""Elements of a member without a taper, whatever its waves."""
PER_OTHER_WAVE = 32
"""Elements per shortest axial or torsional wave, whose error is (2π/32)²/24 = 1.6e-3."""

SHEAR_ERROR = 5e-4
"""Relative error of a frequency that the shear of bending waves, or axes that turn, may have [-]."""


class TooManyElementsError(MeshError):
    """A study whose mesh would have more elements than are made.

    Attributes
    ----------
    member : str
        The member that asks for the most.
    key : str
        Cause: ``"elements"``, ``"element_size"``, or ``"waves"`` for their length.
    suspicions : tuple of Suspicion
        Implausible values of the members, where waves are the cause.
    """

    def __init__(self, message: str, member: str, key: str, suspicions: tuple[Suspicion, ...] = ()) -> None:
        super().__init__(message)
        self.member, self.key, self.suspicions = member, key, suspicions


@dataclass(slots=True)
class Geometry:
    """The mesh as far as it has been built, and the names of places on it.

    Attributes
    ----------
    mesh : Mesh
    places : dict of str to ndarray (3,)
        Coordinates of the study's named points [m].
    """

    mesh: Mesh
    places: dict[str, NDArray[np.float64]] = field(default_factory=dict)

    def coordinates(self, table: StudyTable, key: str = "point") -> NDArray[np.float64]:
        """Return the coordinates of a place given as name, coordinates or ``{member, position}``."""
        value = table.get(key)
        if isinstance(value, str):
            if value in self.mesh.point_names:
                return self.mesh.points[self.mesh.point_names[value]]
            if value in self.places:
                return self.places[value]
            table.refuse(
                key,
                f"there is no point '{value}'; {suggest(value, {**self.places, **self.mesh.point_names})}",
            )
        if isinstance(value, dict):
            return self.on_member(table.table(key))
        return as_vector(table, key, value, 3, "m")

    def group(self, name: Any) -> dict[str, int]:
        """Return the points of a set of the mesh by name, ``base.1``, ``base.2``, …; none for others."""
        names = self.mesh.point_names
        if not isinstance(name, str) or name in names or name in self.places:
            return {}
        ends = {full: full.rpartition(".") for full in names}
        return {full: names[full] for full, end in ends.items() if end[0] == name and end[2].isdigit()}

    def on_member(
        self, table: StudyTable, member: str = "member", position: str = "position"
    ) -> NDArray[np.float64]:
        """Return the coordinates of a place on a member; a table of its own is finished."""
        name = self.member(table, member)
        s = self.position(table, position, name)
        if table.values.keys() <= {member, position}:
            table.finish()
        with table.at(position):
            return self.mesh.point_at(self.mesh.locate(name, s))

    def member(self, table: StudyTable, key: str = "member") -> str:
        """Return the name of one member."""
        name = table.text(key)
        members = self.mesh.groups.get(name, (name,))
        if len(members) != 1 or members[0] not in self.mesh.members:
            if len(members) > 1:
                table.refuse(key, f"'{name}' is the group of {merge_names(members)}; name one of them")
            table.refuse(key, f"there is no member '{name}'; {suggest(name, self.mesh.members)}")
        return members[0]

    def members(self, table: StudyTable, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
        """Return members from a name, the name of a group, or a list of both, at the key ``member``."""
        if default is not None and "member" not in table:
            return default
        value = table.get("member")
        names = [value] if isinstance(value, str) else value
        if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
            table.refuse(
                "member", f"{value!r} is not allowed; a name of a member or group, or a list of them"
            )
        out: list[str] = []
        for name in names:
            found = self.mesh.groups.get(name, (name,))
            if not all(m in self.mesh.members for m in found):
                table.refuse("member", f"there is no member '{name}'; {suggest(name, self.mesh.members)}")
            out += found
        twice = tuple(dict.fromkeys(m for m in out if out.count(m) > 1))
        if twice:
            table.refuse("member", f"{merge_names(twice)} would be counted twice by one entry")
        return tuple(out)

    def position(self, table: StudyTable, key: str, member: str) -> float:
        """Return an arc length along a member [m]."""
        length = self.mesh.member_length(member)
        value = table.get(key)
        words = {"start": 0.0, "middle": length / 2, "end": length}
        if isinstance(value, str):
            if value not in words:
                table.refuse(key, f"'{value}' is not allowed; a number [m], start, middle or end is needed")
            return words[value]
        s = table.number(key, least=0.0, unit="m")
        if s > length * (1 + TOUCH):
            table.refuse(key, f"{s:g} m is beyond the end of member '{member}', which is {length:g} m long")
        return min(s, length)

    def point(self, table: StudyTable, key: str = "point") -> int:
        """Return the index of a point of the mesh at a place, putting one there if needed."""
        value = table.get(key)
        if isinstance(value, str) and value in self.mesh.point_names:
            return self.mesh.point_names[value]
        if isinstance(value, dict):
            inner = table.table(key)
            name = self.member(inner)
            return self.point_on(name, self.position(inner, "position", name))
        xyz = self.coordinates(table, key)
        if self.mesh.n_points:
            near, distance = self.mesh.nearest_point(xyz)
            if distance <= TOUCH * self.mesh.size:
                return near
        if not self.mesh.members:
            table.refuse(
                key, f"{value!r} is no place of a part; give the name of an attachment without point"
            )
        member, s, distance = self.mesh.nearest_on_members(xyz)
        if distance > TOUCH * self.mesh.size:
            table.refuse(
                key,
                f"{value!r} is not on the structure: it is {distance:.3g} m from the nearest member, "
                f"'{member}', at {s:.4g} m along it",
            )
        return self.point_on(member, s)

    def free_point(self, table: StudyTable, key: str) -> int:
        """Return the same as :meth:`point`, with a point of its own at a place beside all members."""
        value = table.get(key)
        if self.mesh.members and (
            isinstance(value, list) or (isinstance(value, str) and value in self.places)
        ):
            xyz = self.coordinates(table, key)
            reach = TOUCH * self.mesh.size
            if min(self.mesh.nearest_point(xyz)[1], self.mesh.nearest_on_members(xyz)[2]) > reach:
                self.mesh = self.mesh.with_free_point(xyz, value if isinstance(value, str) else None)
                return self.mesh.n_points - 1
        return self.point(table, key)

    def point_on(self, member: str, position: float) -> int:
        """Return the index of a point of the mesh at a position on a member, putting one there if needed."""
        self.mesh = self.mesh.with_point_on(member, position)
        s = self.mesh.member_positions(member)
        return int(self.mesh.member_points(member)[np.argmin(np.abs(s - position))])


def read_geometry(top: StudyTable, folder: Path, notes: list[str]) -> Geometry:
    """Read ``[mesh]``, ``[points]`` and the ends of ``[members]``."""
    mesh, points, members = top.table("mesh"), top.table("points"), top.table("members")
    file = mesh.text("file", "")
    scale = mesh.number("scale", 1.0, above=0.0)
    tolerance = mesh.number("merge_tolerance", None, least=0.0, unit="m")
    connect, free = mesh.flag("connect", True), mesh.flag("free_points", False)
    if file:
        if points.values:
            points.refuse("", "[points] and [mesh] file both define the geometry; remove one of them")
        path = folder / file
        if not path.is_file():
            mesh.refuse("file", no_file(path))
        with mesh.at("file"), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            sets = mesh.text("sets", None)
            read = read_mesh(path, scale, tolerance, sets, free_points=free)
        notes.extend(str(w.message) for w in caught if w.category is not MeshWarning)  # the mesh keeps those
        return Geometry(read)
    for key in ("scale", "merge_tolerance", "sets", "free_points"):
        if key in mesh:
            mesh.refuse(key, "it belongs to a mesh file, and [mesh] gives no file")
    if mesh.unread_like("file"):
        mesh.refuse_without("file", "'file' is missing")
    places = {key: points.vector(key) for key in points.values}
    if not members.values and "superelements" in top:
        return Geometry(Mesh.of_points([]), places)
    if not members.values:
        top.refuse(
            "",
            "there is no structure: give [mesh] file, or [points] and [members.NAME] with from and to, or "
            "[[superelements]]",
        )
    return Geometry(_inline_mesh(members, places, connect, notes), places)


def _inline_mesh(
    members: StudyTable, places: dict[str, NDArray[np.float64]], connect: bool, notes: list[str]
) -> Mesh:
    ends: list[NDArray[np.float64]] = []
    names: dict[str, int] = {}
    pairs: dict[str, tuple[int, int]] = {}

    def end(table: StudyTable, key: str) -> int:
        value = table.get(key)
        if isinstance(value, str):
            if value not in places:
                table.refuse(key, f"there is no point '{value}'; {suggest(value, places)}")
            if value not in names:
                names[value] = len(ends)
                ends.append(places[value])
            return names[value]
        xyz = as_vector(table, key, value, 3, "m")
        for k, other in enumerate(ends):
            if k not in names.values() and np.linalg.norm(other - xyz) <= 1e-9 * (1 + np.abs(xyz).max()):
                return k
        ends.append(xyz)
        return len(ends) - 1

    for name, table in members.named():
        pairs[name] = (end(table, "from"), end(table, "to"))
    xyz = np.array(ends)
    size = float(np.ptp(xyz, axis=0).max())
    for name, (a, b) in pairs.items():
        if np.linalg.norm(xyz[b] - xyz[a]) <= max(TOUCH * size, 1e-12):
            members.refuse(name, f"the member has no length: both ends are at {xyz[a].tolist()} m")
    if connect:
        xyz, number = _one_point_a_weld(xyz, pairs.values(), TOUCH * size)
        pairs = {name: (number[a], number[b]) for name, (a, b) in pairs.items()}
        names = {name: number[k] for name, k in names.items()}
    lines: list[tuple[int, int]] = []
    sets: dict[str, list[int]] = {}
    welds: dict[str, list[str]] = {}
    for name, (a, b) in pairs.items():
        between = _ends_on(xyz, a, b, TOUCH * size) if connect else []
        for k in between:
            welds.setdefault(name, []).extend(other for other, pair in pairs.items() if k in pair)
        chain = [a, *between, b]
        sets[name] = list(range(len(lines), len(lines) + len(chain) - 1))
        lines += list(pairwise(chain))
    if welds:
        words = "; ".join(f"{', '.join(dict.fromkeys(others))} on {name}" for name, others in welds.items())
        notes.append(f"members that end on another are welded to it there: {words}")
    with members.at():
        return Mesh.from_lines(xyz, lines, sets, names)


def _one_point_a_weld(
    xyz: NDArray[np.float64], pairs: Iterable[tuple[int, int]], tolerance: float
) -> tuple[NDArray[np.float64], list[int]]:
    """Return the points of which those at one place inside a member are one, and the new number of each.

    All of them are welded to that member there, so that they are names of one point.
    """
    same = list(range(len(xyz)))
    for a, b in pairs:
        for first, second in pairwise(_ends_on(xyz, a, b, tolerance)):
            if np.linalg.norm(xyz[second] - xyz[first]) <= 2 * tolerance:
                same[second] = same[first]
    kept = sorted(set(same))
    return xyz[kept], [kept.index(k) for k in same]


def _ends_on(xyz: NDArray[np.float64], a: int, b: int, tolerance: float) -> list[int]:
    """Return the points inside a member, in order along it."""
    t = xyz[b] - xyz[a]
    length = float(np.linalg.norm(t))
    s = (xyz - xyz[a]) @ t / length
    distance = np.linalg.norm(xyz - xyz[a] - np.outer(s, t / length), axis=1)
    inside = np.flatnonzero((distance <= tolerance) & (s > tolerance) & (s < length - tolerance))
    return [int(k) for k in inside[np.argsort(s[inside])] if k not in (a, b)]


def refine(
    mesh: Mesh,
    properties: dict[str, MemberProperties],
    max_frequency: float,
    size: float | None,
    by_member: dict[str, tuple[float | None, int | None]],
    most: int | None = None,
) -> tuple[Mesh, NDArray[np.float64]]:
    """Return the mesh with elements short enough, and the lengths aimed at, member by member.

    Parameters
    ----------
    mesh : Mesh
    properties : dict of str to MemberProperties
        By member.
    max_frequency : float
        Highest frequency of interest [Hz].
    size : float, optional
        Element size of all members [m]; by wavelength unless given.
    by_member : dict of str to (float or None, int or None)
        Element size [m] or count of single members.
    most : int, optional
        Most elements in all; the mesh's own lines are never too many. Unless given, ``MOST_ELEMENTS``, and of
        materials whose speed of sound is implausible no more than the usual one asks for.

    Raises
    ------
    TooManyElementsError
        If there would be more; the message names the member that asks for the most, and why it does.
    """
    length = mesh.lengths()
    pieces = np.ones(mesh.n_lines)
    sizes: dict[str, tuple[float, str]] = {}
    for name, rows in mesh.members.items():
        p, total = properties[name], float(length[rows].sum())
        h, key = _aimed_size(p, total, max_frequency, size, by_member.get(name, (None, None)))
        sizes[name] = (h, key)
        n = np.maximum(1, np.ceil(length[rows] / h - 1e-6))
        for zone, k in ((p.rigid1, 0), (p.rigid2, -1)):
            if zone > 0:  # the zone must fit into the element at its end, with as much flexible length again
                n[k] = max(1, min(n[k], int(length[rows[k]] / (2 * zone))))
        pieces[rows] = n
    refined = _Refined(mesh, properties, max_frequency, sizes, pieces)
    if not pieces.sum() <= max(most or MOST_ELEMENTS, mesh.n_lines):
        raise refined.too_many(most or MOST_ELEMENTS)
    if most is None:
        refined.refuse_slow_waves()
    return mesh.split(pieces), np.array([h for h, _ in sizes.values()])


def _aimed_size(
    p: MemberProperties,
    total: float,
    max_frequency: float,
    size: float | None,
    of_member: tuple[float | None, int | None],
) -> tuple[float, str]:
    """Return the element size of a member, and its cause: a key of the study, or waves."""
    member_size, count = of_member
    if count is not None:
        return total / count, "elements"
    if member_size is not None:
        return member_size, "element_size of the member"
    if p.theory == "bar" and p.pretension == 0:  # between its elements it would be a mechanism
        return total, "elements"
    if size is not None:
        return size, "element_size"
    return min(element_size(p, max_frequency), total / _least_elements(p)), "waves"


@dataclass(frozen=True, slots=True, eq=False)
class _Refined:
    """Numbers of elements of the lines of a mesh, and the sizes aimed at with their causes, by member."""

    mesh: Mesh
    properties: dict[str, MemberProperties]
    max_frequency: float
    sizes: dict[str, tuple[float, str]]
    pieces: NDArray[np.float64]

    def too_many(self, most: int) -> TooManyElementsError:
        """Return the error that names the member that asks for the most elements, and why it does."""
        counts = {name: float(self.pieces[rows].sum()) for name, rows in self.mesh.members.items()}
        name = max(counts, key=lambda each: counts[each])
        (h, key), p = self.sizes[name], self.properties[name]
        text = (
            f"the mesh would have {self.pieces.sum():.4g} elements, and at most {most} are made ([mesh] "
            f"max_elements): member '{name}' asks for the most, {counts[name]:.4g} of {1e3 * h:.3g} mm"
        )
        if key != "waves":
            return TooManyElementsError(f"{text}, by {key}; give larger elements, or allow more", name, key)
        m, s = p.material, p.section
        odd = suspicions(Model(self.mesh, (Frame(members=self.properties),)))
        what = (
            f"for waves at {self.max_frequency:g} Hz with E = {si_number(m.E)} Pa, rho = {si_number(m.rho)} "
            f"kg/m³, A = {s.A:.3g} m², Iy = {s.Iy:.3g}, Iz = {s.Iz:.3g} and J = {s.J:.3g} m⁴"
        )
        cause = "".join(f"{each.message}; " for each in odd)  # the count is what follows from it
        advice = "" if odd else "check these values; or "
        text = f"{cause}{text}, {what}; {advice}lower the frequency range, give element_size, or allow more"
        return TooManyElementsError(text, name, key, odd)

    def refuse_slow_waves(self) -> None:
        """Refuse a mesh that only an implausible material makes fine: it would take minutes."""
        materials = {id(p.material): p.material for p in self.properties.values()}
        odd = {k: some for k, m in materials.items() if (some := tuple(suspicions_of_material(m)))}
        for name, (_, key) in self.sizes.items():
            p = self.properties[name]
            if key != "waves" or id(p.material) not in odd:
                continue
            rows, m = self.mesh.members[name], p.material
            length = float(self.mesh.lengths()[rows].sum())
            usual = replace(p, material=replace(m, E=m.rho * USUAL_SOUND**2))
            size = min(element_size(usual, self.max_frequency), length / _least_elements(p))
            n, enough = int(self.pieces[rows].sum()), int(np.ceil(length / size - 1e-6))
            if n > max(enough, len(rows)):
                reasons = odd[id(m)]
                text = (
                    f"{'; '.join(s.message for s in reasons)}; member '{name}' would have {n} elements for "
                    f"waves at {self.max_frequency:g} Hz, and {enough} with the usual speed of sound; "
                    "correct the value, or give element_size if it is meant"
                )
                raise TooManyElementsError(text, name, key, reasons)


def element_size(p: MemberProperties, frequency: float) -> float:
    """Return an element size by the shortest waves of a member at a frequency [m].

    Bending: λ = 2π/k, k⁴ = ρA ω²/EI, of an Euler-Bernoulli beam; where shear takes the part φ/(1 + φ) of the
    slope, φ = EI k²/kGA, elements are too stiff by (kh)²/24 of that. Torsion and tension: λ = c/f; a bar
    under tension is a string. Of a taper, the end with the shorter waves.
    """
    ends = (p.section,) if p.section2 is None else (p.section, p.section2)
    return min(_size_of_section(p, s, frequency) for s in ends)


def _size_of_section(p: MemberProperties, s: Section, frequency: float) -> float:
    m, omega = p.material, 2 * np.pi * frequency
    if p.theory == "bar":
        strain = min(max(p.pretension, 0.0) / (m.E * s.A), 1.0) or 1.0
        return float(np.sqrt(strain * m.E / m.rho) / frequency / PER_OTHER_WAVE)
    sizes = [np.sqrt(min(m.E, m.G * s.J / s.Ip) / m.rho) / frequency / PER_OTHER_WAVE]
    for I, k in ((s.Iy, s.kz), (s.Iz, s.ky)):
        wave = (m.rho * s.A / (m.E * I)) ** 0.25 * np.sqrt(omega)  # the square of a slip may overflow
        # Elements per shortest bending wave: too stiff by (2π/12)⁴/1440 = 5e-5 in frequency there
        sizes.append(2 * np.pi / wave / 12)
        phi = m.E * I * wave**2 / (k * m.G * s.A) if k > 0 and p.theory == "timoshenko" else 0.0
        if phi > 0:
            sizes.append(np.sqrt(24 * SHEAR_ERROR * (1 + phi) / phi) / wave)
    return float(min(sizes))


def _least_elements(p: MemberProperties) -> int:
    """Return the fewest elements of a member: under a taper more, as waves at its thin end are shorter.

    Wave numbers of bending go with the root of the radius of gyration. Principal axes that turn by Δα along
    the member are straight in each element, which errs by (Δα/n)² I₁/I₂ / 24 in a frequency.
    """
    if p.section2 is None:
        return LEAST_ELEMENTS
    radii = [[s.Iy / s.A, s.Iz / s.A] for s in (p.section, p.section2)]
    ratio = np.max(np.max(radii, axis=0) / np.min(radii, axis=0)) ** 0.25
    turn = abs(p.section2.angle - p.section.angle)
    uneven = max(max(s.Iy, s.Iz) / min(s.Iy, s.Iz) for s in (p.section, p.section2))
    turning = turn * np.sqrt(uneven / (24 * SHEAR_ERROR))
    return int(np.ceil(max(LEAST_ELEMENTS * ratio, turning) - 1e-9))


def describe_sizes(sizes: Sequence[float] | NDArray[Any]) -> str:
    """Return a range of sizes in words."""
    low, high = float(np.min(sizes)), float(np.max(sizes))
    return f"{1e3 * low:.3g} mm" if high <= 1.01 * low else f"{1e3 * low:.3g} to {1e3 * high:.3g} mm"
