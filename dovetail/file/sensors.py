"""Sensors and excitations of a study, and the channels of the measured files that belong to them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.geometry import TOUCH, Geometry
from dovetail.file.sensor_places import refuse_or_suspect_places
from dovetail.file.sensor_table import sensor_tables
from dovetail.file.table import StudyError, StudyTable, suggest
from fem.analysis.frf import FRFKind
from fem.io.uff_format import UffError, label_of, parse_label
from updating.measurement.base_motion import BaseMotion
from updating.measurement.measurement import MOTION, STRAIN, Sensor, place_sensors
from updating.measurement.reference_sensor import UnmeasuredForce
from updating.measurement.strain_gauge import StrainGauge

Nodes = Mapping[int, NDArray[np.float64]]
"""Coordinates of the nodes of the measured files [m]."""

Points = Mapping[str, NDArray[np.float64]]
"""Places by name [m]."""

Attempt = Callable[[], AbstractContextManager[None]]
"""Context in which a part of the study is read that a command may do without."""


@dataclass(frozen=True, slots=True)
class Convention:
    """How FRFs of a file are brought to e^{+iωt} and to their kind.

    Attributes
    ----------
    conjugate : bool
        The file has them for e^{-iωt}.
    phase : float
        Added to their phase [deg].
    kind : FRFKind or None
        Of a sensor that measures another kind than the file states; None for the file's.
    """

    conjugate: bool = False
    phase: float = 0.0
    kind: FRFKind | None = None


def read_convention(t: StudyTable, is_sensor: bool = False) -> Convention:
    """Read ``conjugate``, ``phase`` and, of a sensor, ``kind``."""
    kind = t.text("kind", None, [str(k) for k in FRFKind]) if is_sensor else None
    return Convention(
        t.flag("conjugate", False),
        t.number("phase", 0.0, unit="deg"),
        None if kind is None else FRFKind(kind),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """A sensor or an excitation, and how its channel may be called in the files.

    Attributes
    ----------
    sensor : Sensor
    table : Table
        Where it stands in the study.
    label : str
        Its name in the files, where the study gives it.
    node : int or None
        Its node in the files.
    near : tuple of int
        Nodes of the files at its place, where the study names none: for hints alone, as a test's axes need
        not be the model's.
    convention : Convention
        Of its FRFs beside the others'.
    """

    sensor: Sensor
    table: StudyTable
    label: str = ""
    node: int | None = None
    near: tuple[int, ...] = ()
    convention: Convention = Convention()

    @property
    def written(self) -> str:
        """Its label in written files: that of the study, or none."""
        axis = np.flatnonzero(np.abs(self.sensor.direction) > 1 - 1e-9)
        if self.label or self.node is None or not axis.size:
            return self.label
        return label_of(self.node, int(np.sign(self.sensor.direction[axis[0]])) * (int(axis[0]) + 1))

    def find(self, labels: Sequence[str]) -> tuple[str, float] | None:
        """Return its label among those of a file, and the sign that turns the reading into its direction."""
        if self.label in labels:
            return self.label, 1.0
        if self.sensor.name in labels:
            return self.sensor.name, 1.0
        axis = np.flatnonzero(np.abs(self.sensor.direction) > 1 - 1e-9)
        if self.label or self.node is None or not axis.size:
            return None
        d = int(axis[0]) + 1
        sense = float(np.sign(self.sensor.direction[axis[0]]))
        at = self.near if self.node is None else (self.node,)
        found = [
            (label, sign * sense)
            for n in at
            for sign in (1, -1)
            if (label := label_of(n, sign * d)) in labels
        ]
        # of several nodes at its place none is certainly its own
        return found[0] if found and (self.node is not None or len(found) == 1) else None


@dataclass(frozen=True, eq=False)
class ChannelReader:
    """Reads the sensors and excitations of a study, and puts points of the mesh where they sit.

    Attributes
    ----------
    top : StudyTable
    folder : Path
        Of the study.
    geometry : Geometry
    nodes : Nodes
    attempt : Attempt
    notes, suspicions : list of str
        Get a sentence on each assumption, and on each place that cannot be meant.
    """

    top: StudyTable
    folder: Path
    geometry: Geometry
    nodes: Nodes
    attempt: Attempt
    notes: list[str]
    suspicions: list[str]

    def sensors(self) -> list[Channel]:
        """Read ``[[sensors]]``."""
        out: list[Channel] = []
        seen: set[str] = set()
        for t in self._tables("sensors"):
            with self.attempt():
                found = list(self._channels_of(t, is_sensor=True))
                t.finish()
                for channel in found:
                    if channel.sensor.name in seen:
                        t.refuse(
                            "name" if "name" in t.values else "",
                            f"two sensors have the name '{channel.sensor.name}'; names must differ",
                        )
                    seen.add(channel.sensor.name)
                out += found
        return out

    def excitations(self, sensors: Sequence[Channel], base: NDArray[np.float64]) -> list[Channel]:
        """Read ``[[excitations]]``; ``base`` (3,) is where the base holds the structure [m]."""
        by_name = {c.sensor.name: c for c in sensors}
        out: list[Channel] = []
        for t in self._tables("excitations"):
            with self.attempt():
                refer = _reference(t, by_name)
                if "sensor" in t:
                    name = t.text("sensor")
                    if "base" in t:
                        t.refuse(
                            "base", "an excitation is at a sensor or moves the base; give one of the two"
                        )
                    if name not in by_name:
                        t.refuse("sensor", f"there is no sensor '{name}'; {suggest(name, by_name)}")
                    at, label = by_name[name], t.text("label", by_name[name].label)
                    if at.sensor.quantity != MOTION:
                        t.refuse(
                            "sensor",
                            f"'{name}' measures {at.sensor.quantity}; a force acts where a motion is",
                        )
                    found = [Channel(at.sensor, t, label, at.node, at.near, read_convention(t))]
                elif "base" in t:
                    found = [_base_motion(t, base)]
                elif not {"point", "points", "member", "node"} & {*t.values} and t.unread_like("sensor"):
                    t.refuse_without("sensor", "'sensor' is missing")
                else:
                    found = list(self._channels_of(t))
                found = [c if refer is None else _referred(c, refer) for c in found]
                t.finish()
                names = [c.sensor.name for c in (*out, *found)]
                if len(set(names)) < len(names):
                    t.refuse("", f"two excitations have the name '{names[-1]}'; names must differ")
                out += found
        moved = any(c.sensor.moves_base for c in out)
        for c in () if moved else sensors:
            if c.sensor.relative:
                c.table.refuse(
                    "relative",
                    'the base rests in this study; give the motion of the base: [[excitations]] base = "z"',
                )
        return out

    def of_labels(self, labels: Sequence[str], what: str) -> list[Channel]:
        """Make sensors of a universal file's own labels and nodes.

        Raises
        ------
        StudyError
            If a label is not that of a node, or the node has no coordinates.
        """
        top, nodes = self.top, self.nodes
        parsed = [_parsed(label) for label in labels]
        at_nodes = [StudyTable(top.source, top.path, {"node": node}) for node, _ in parsed]
        self._suspect(at_nodes, what)
        out = []
        for label, (node, d) in zip(labels, parsed, strict=True):
            if node > 0 and not nodes:
                top.refuse(
                    "",
                    f"there is no [[{what}]], and the measured files have no coordinates of node {node} "
                    f"(dataset 15 or 2411); give [[{what}]], or a file with them",
                )
            if node not in nodes or not 1 <= abs(d) <= 3:
                top.refuse(
                    "",
                    f"there is no [[{what}]], and the channel '{label}' of the measured files does "
                    f"not say where it is; give [[{what}]]",
                )
            direction = np.sign(d) * np.eye(3)[abs(d) - 1]
            sensor = self._placed(top, Sensor(label, nodes[node], direction))
            out.append(Channel(sensor, top, label, node))
        return out

    def _tables(self, key: str) -> list[StudyTable]:
        """Return the tables of a kind, and the rows of the files that some of them name."""
        out: list[StudyTable] = []
        for t in self.top.tables(key):
            with self.attempt():
                out += sensor_tables(t, self.folder, self.notes)
        self._suspect(out, key)
        return out

    def _suspect(self, tables: Sequence[StudyTable], what: str) -> None:
        self.suspicions.extend(refuse_or_suspect_places(tables, what, self.geometry.mesh, self.nodes))

    def _channels_of(self, t: StudyTable, is_sensor: bool = False) -> Iterator[Channel]:
        if is_sensor and t.text("quantity", MOTION, (MOTION, STRAIN)) == STRAIN:
            gauge = self._placed(t, read_strain_gauge(t, self.geometry))
            yield Channel(gauge, t, t.text("label", ""), convention=read_convention(t))
            return
        sign = t.number("sign", 1.0)
        if abs(sign) != 1:
            t.refuse("sign", f"{sign:g} is not allowed; 1 or -1 is needed")
        mass = t.number("mass", 0.0, least=0, unit="kg")
        gain = t.number("gain", 1.0, above=0)
        body = t.text("on", "")
        if body and "mass" in t:
            t.refuse("mass", "a sensor on a sprung mass is a part of that; add its mass there")
        relative = is_sensor and t.flag("relative", False)
        roving = is_sensor and t.flag("roving", False)
        if roving and "mass" not in t:
            t.refuse("roving", "a roving sensor acts by its mass; give mass, or leave roving out")
        convention = read_convention(t, is_sensor)
        # true: the place is beside the axis; or the vector from a place on it
        beside = isinstance(t.get("arm", None), bool) and t.flag("arm", False)
        given_arm = np.zeros(3) if isinstance(t.get("arm", False), bool) else t.vector("arm")
        if body and "arm" in t:
            t.refuse("arm", "a sensor on a sprung mass is at its centre; leave arm out")
        if "directions" in t:
            for key in ("name", "label", "direction"):
                if key in t:
                    t.refuse(
                        key,
                        f"one {key} does not fit several directions; leave it out, or write [[sensors]] "
                        "for each",
                    )
            words = list(t.text("directions").replace(" ", "").replace(",", ""))
            places = list(self._places(t))
        else:
            words = [t.get("direction")]
            places = list(self._places(t, many=False))
        for word_of_place, xyz, member, node in places:
            arm = given_arm
            if beside:
                foot = self._foot(t, xyz, member)
                xyz, arm = foot, xyz - foot
            for k, word in enumerate(words):
                direction = sign * t.direction("directions" if "directions" in t else "direction", word)
                name = t.text("name", f"{word_of_place}{word if isinstance(word, str) else ''}")
                if not name:
                    t.refuse("", "the sensor needs a name, for its place has none")
                channel_mass = mass if k == 0 else 0.0  # one body with several channels
                stated = Sensor(name, xyz, direction, member, gain, channel_mass, relative, body, arm, roving)
                sensor = self._placed(t, stated)
                near = () if node is not None else self._nodes_at(sensor.point)
                yield Channel(sensor, t, t.text("label", ""), node, near, convention)

    @cached_property
    def bodies(self) -> Points:
        """Where the sprung masses of the study are attached, by their names [m]."""
        tables = enumerate(self.top.tables("sprung_masses"), 1)
        return {t.text("name", f"sprung mass{k}"): self.geometry.coordinates(t) for k, t in tables}

    def _nodes_at(self, point: NDArray[np.float64]) -> tuple[int, ...]:
        """Return the nodes of the files at a place."""
        reach = TOUCH * self.geometry.mesh.size
        return tuple(n for n, xyz in self.nodes.items() if np.abs(xyz - point).max() <= reach)

    def _places(
        self, t: StudyTable, many: bool = True
    ) -> Iterator[tuple[str, NDArray[np.float64], str | None, int | None]]:
        """Return name, coordinates, member and node of each place in a table."""
        if many and ("points" in t or "nodes" in t):
            key = "points" if "points" in t else "nodes"
            values = t.get(key)
            if not isinstance(values, list) or not values:
                t.refuse(key, "a list is needed")
            names = t.texts("names", None)
            if names is not None and len(names) != len(values):
                t.refuse("names", f"{len(names)} names are given for {len(values)} {key}")
            for i, value in enumerate(values):
                inner = StudyTable(t.source, (*t.path, key, i), {key[:-1]: value})
                for word, xyz, member, node in self._places(inner, many=False):
                    yield names[i] if names else word, xyz, member, node
            return
        geometry, nodes, node = self.geometry, self.nodes, t.integer("node", None)
        if "on" in t:
            body = t.text("on")
            for key in ("point", "member", "position"):
                if key in t:
                    t.refuse(key, "a sensor on a sprung mass is at its centre; leave the place out")
            if body not in self.bodies:
                t.refuse("on", f"there is no sprung mass '{body}'; {suggest(body, self.bodies)}")
            yield body, self.bodies[body], None, node
        elif "point" in t:
            value = t.get("point")
            member = geometry.member(t.table("point")) if isinstance(value, dict) else None
            yield (
                (value if isinstance(value, str) else str(node or "")),
                geometry.coordinates(t),
                member,
                node,
            )
        elif "member" in t:
            member = geometry.member(t)
            yield str(node or ""), geometry.on_member(t), member, node
        elif node is not None:
            if node not in nodes:
                none = "have no coordinates of nodes (dataset 15 or 2411)"
                known = f"have {len(nodes)} nodes" if nodes else none
                (t.refuse if nodes else t.refuse_awaited)(
                    "node",
                    f"there is no node {node} in the measured files, which {known}; give point, or "
                    "member and position",
                )
            yield str(node), nodes[node], None, node
        else:
            t.refuse_without(
                "point",
                "a place is missing: give point, or member and position, or node (a number of the UFF file)",
            )

    def _foot(self, t: StudyTable, xyz: NDArray[np.float64], member: str | None) -> NDArray[np.float64]:
        """Return the point of a member, or of the nearest one, where the rigid arm to a place begins [m]."""
        mesh = self.geometry.mesh
        if not mesh.members:
            t.refuse("arm", "the structure has no members that could hold an arm")
        if member is None:
            member, s, _ = mesh.nearest_on_members(xyz)
            return mesh.point_at(mesh.locate(member, s))
        chain = mesh.points[mesh.member_points(member)]
        span = np.diff(chain, axis=0)
        along = np.clip(((xyz - chain[:-1]) * span).sum(axis=1) / (span**2).sum(axis=1), 0.0, 1.0)
        feet = chain[:-1] + along[:, None] * span
        return feet[np.argmin(np.linalg.norm(feet - xyz, axis=1))]

    def _placed(self, t: StudyTable, sensor: Sensor) -> Sensor:
        """Put a point of the mesh where a sensor sits, and the sensor on the member's axis."""
        geometry = self.geometry
        try:
            with t.at():
                geometry.mesh = place_sensors(geometry.mesh, (sensor,))
        except StudyError as reason:
            if geometry.mesh.members and not np.any(sensor.arm):
                msg = f"{reason}; arm = true connects one beside the axis by a rigid arm"
                raise StudyError(msg) from None
            raise
        if sensor.member is not None:  # a member's own point where several meet or lie close
            s = [
                float(np.linalg.norm(geometry.mesh.points[p] - sensor.point))
                for p in geometry.mesh.member_points(sensor.member)
            ]
            near = int(geometry.mesh.member_points(sensor.member)[int(np.argmin(s))])
            distance = min(s)
        else:
            near, distance = geometry.mesh.nearest_point(sensor.point)
        if distance > TOUCH * geometry.mesh.size:
            self.notes.append(
                f"sensor {sensor.name} is {1e3 * distance:.3g} mm off the axis and taken to sit on it"
            )
        return replace(sensor, point=geometry.mesh.points[near])


def _reference(t: StudyTable, by_name: Mapping[str, Channel]) -> Channel | None:
    """Read ``reference``: the sensor that responses to an unmeasured force refer to; None without one."""
    if "reference" not in t:
        return None
    if "base" in t:
        t.refuse("reference", "FRFs to a motion of the base refer to that; leave reference or base out")
    name = t.text("reference")
    if name not in by_name:
        t.refuse("reference", f"there is no sensor '{name}'; {suggest(name, by_name)}")
    sensor = by_name[name].sensor
    if sensor.quantity != MOTION:
        t.refuse("reference", f"'{name}' measures {sensor.quantity}; responses refer to a motion")
    if sensor.roving:
        t.refuse("reference", f"'{name}' is moved from place to place; a reference stays where it is")
    if (kind := by_name[name].convention.kind) is not None:
        t.refuse("reference", f"'{name}' has kind = \"{kind}\"; responses refer to an acceleration")
    for key in ("sign", "gain"):
        if key in t:
            t.refuse(key, f"the force is not measured, so that its {key} cancels; that of '{name}' counts")
    return by_name[name]


def _referred(force: Channel, reference: Channel) -> Channel:
    """Return an excitation whose force was not measured; its channel in the files is the reference's."""
    s, t = force.sensor, force.table
    name = t.text("name", f"reference {reference.sensor.name}") if "sensor" in t else s.name
    label = t.text("label", reference.label)
    return replace(
        reference,
        sensor=UnmeasuredForce.of(s, reference.sensor, name),
        table=t,
        label=label or ("" if reference.node is not None else reference.sensor.name),
        convention=force.convention,
    )


def _base_motion(t: StudyTable, base: NDArray[np.float64]) -> Channel:
    """Return an excitation that is the acceleration of the base along ``base``."""
    word, sign = t.get("base"), t.number("sign", 1.0)
    if abs(sign) != 1:
        t.refuse("sign", f"{sign:g} is not allowed; 1 or -1 is needed")
    name = t.text("name", f"base {word}" if isinstance(word, str) else "base")
    direction = sign * t.direction("base", word)
    motion = BaseMotion(name, base, direction, gain=t.number("gain", 1.0, above=0))
    return Channel(motion, t, t.text("label", ""), t.integer("node", None), (), read_convention(t))


def _parsed(label: str) -> tuple[int, int]:
    """Return node and direction of a label, (-1, 0) of one that has none."""
    try:
        return parse_label(label)
    except UffError:
        return -1, 0


def read_strain_gauge(t: StudyTable, geometry: Geometry) -> StrainGauge:
    """Read a gauge along a member, as it is stated: no point of the mesh is put there.

    Parameters
    ----------
    t : Table
        With ``name``, ``offset``, and ``member`` and ``position``, or ``point`` and perhaps ``member``;
        ``sign`` and ``gain`` are as for other sensors.
    geometry : Geometry

    Raises
    ------
    StudyError
        For a key that is missing or wrong.
    """
    name, offset = t.text("name"), t.vector("offset", size=2)
    sign, gain = t.number("sign", 1.0), t.number("gain", 1.0, above=0)
    if abs(sign) != 1:
        t.refuse("sign", f"{sign:g} is not allowed; 1 or -1 is needed")
    if "point" in t:
        if "position" in t:
            t.refuse("position", "the gauge has a point; give point, or member and position")
        xyz = geometry.coordinates(t)
        member = geometry.member(t) if "member" in t else geometry.mesh.nearest_on_members(xyz)[0]
    elif "member" in t:
        xyz, member = geometry.on_member(t), geometry.member(t)
    else:
        t.refuse_without("point", "the place of the gauge is missing: give member and position, or point")
    mesh = geometry.mesh
    k = int(np.argmin(np.linalg.norm(mesh.points[mesh.member_points(member)] - xyz, axis=1)))
    a, b = mesh.points[mesh.lines[mesh.members[member][max(k - 1, 0)]]]
    axis = sign * (b - a) / np.linalg.norm(b - a)
    return StrainGauge(name, xyz, axis, member, gain, offset=(float(offset[0]), float(offset[1])))
