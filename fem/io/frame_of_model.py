"""The deck of a model: what :func:`deck_of` gives, the writers of Nastran, Abaqus and ANSYS write.

Members become bars with the constants of their sections, joints and springs connections, bodies masses. An
effect without such a form becomes a connection or matrices on a few nodes, if its K, M, C and D are constant.
All else is named in the notes.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from fem.array_types import Floats, Ints
from fem.connection_damping import ConnectionDamping
from fem.effects.added_mass import AddedMass, PointMass
from fem.effects.crack import Crack, EndRelease
from fem.effects.distributed_mass import DistributedMass
from fem.effects.joint import Joint
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.effects.member_change import MemberDensity, MemberStiffness
from fem.effects.member_section import MemberSection, MemberTorsion
from fem.effects.moving_base import MovingBase
from fem.effects.places import frame_of, sheared_frame
from fem.effects.point_inertia import PointInertia
from fem.effects.proportional_damping import MassDamping, StiffnessDamping
from fem.effects.rigid_link import RigidLink
from fem.effects.section_form import SectionForm
from fem.effects.section_shear import SectionShear
from fem.effects.sprung_mass import SprungMass
from fem.elements.frame import Frame, nominal
from fem.elements.layout import CONSTANTS, layout_of
from fem.elements.lines import Lines
from fem.io.frame_deck import BarProperty, Bars, Body, Connection, Equation, Found, FrameDeck, Link
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Contribution, Effect, Model, lever_matrix
from fem.sections.section import Section

ROUNDING = 1e-9
"""Part of the largest entry of a matrix below which a difference is rounding [-]."""
FOLDED = (MemberStiffness, MemberDensity, MemberSection, MemberTorsion, SectionForm)
"""Effects that change the properties of bars."""
GLOBAL = (MassDamping, StiffnessDamping, MovingBase, ConnectionDamping)
"""Effects of all of the structure, which no card of a part represents."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NodeMatrices:
    """Matrices that act on the motions of some nodes, global axes.

    Attributes
    ----------
    name : str
    nodes : tuple of int
        Rows of the deck's nodes.
    K, M, C, D : ndarray (6 n, 6 n)
        Stiffness, mass, viscous and structural damping of n nodes, x y z rx ry rz of each [SI].
    """

    name: str
    nodes: tuple[int, ...]
    K: Floats
    M: Floats
    C: Floats
    D: Floats


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelDeck(FrameDeck):
    """A deck that was made of a model.

    Attributes
    ----------
    matrices : tuple of NodeMatrices
        Of effects that no other card stands for.
    part : bool
        Whether these are cards for a model that has others already, and not all of one.
    known, known_bars : frozenset of int
        Rows of nodes and bars that this model has already: of these the bars' properties alone are written.
    first : mapping of str to int
        First numbers that are free for new nodes (``"node"``), elements, properties, materials, coordinate
        systems and sets of constraints; 1 unless given.
    numbers : mapping of str to int
        Elements' numbers of bodies, connections and links by name, where they are given.
    bound : frozenset of (int, str)
        Row of a node and global direction that other cards of this model determine already.
    axes : mapping of int to ndarray (3, 3)
        Axes of the motions of nodes, as rows, by row of the node; global ones unless given.
    """

    matrices: tuple[NodeMatrices, ...] = ()
    part: bool = False
    known: frozenset[int] = frozenset()
    known_bars: frozenset[int] = frozenset()
    first: Mapping[str, int] = field(default_factory=dict)
    numbers: Mapping[str, int] = field(default_factory=dict)
    bound: frozenset[tuple[int, str]] = frozenset()
    axes: Mapping[int, Floats] = field(default_factory=dict)


@dataclass(slots=True)
class _DeckParts(Found):
    """What has been found of a model so far; ``joints`` are the rows of connections by name."""

    joints: dict[str, int] = field(default_factory=dict)
    matrices: list[NodeMatrices] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)

    def point(self, place: Floats, free: Sequence[str] = DIRECTIONS) -> int:
        """Add a node and return its row."""
        self.points.append(np.asarray(place, dtype=float))
        row = len(self.points) - 1
        if fixed := tuple(d for d in DIRECTIONS if d not in free):
            self.supports[row] = fixed
        return row


def deck_of(model: Model, file: str = "model") -> ModelDeck:
    """Return the deck of a model; its notes name the effects that are not in it, and why.

    Bars are numbered as lines of the mesh, from 1, and nodes as points; a model of a deck has names of points
    such as ``"node 12"``, which give the numbers. Masses and cracks within a line get a
    node. Changes of sections that a fit has found to first order are changes of the constants.

    Parameters
    ----------
    model : Model
    file : str
        Name of the deck.
    """
    model, springs = with_places(model)
    parts = _DeckParts(points=list(model.mesh.points))
    bars, properties = _bars(model, springs)
    _add_constraints(model, parts)
    for effect in model.effects:
        _add_effect(effect, model, parts)
    return ModelDeck(
        file=file,
        nodes=_numbers(model.mesh, len(parts.points)),
        points=np.array(parts.points),
        bars=bars,
        properties=properties,
        supports=parts.supports,
        bodies=tuple(parts.bodies),
        connections=tuple(parts.connections),
        links=tuple(parts.links),
        equations=tuple(parts.equations),
        damping=model.damping,
        notes=tuple(parts.notes),
        matrices=tuple(parts.matrices),
    )


def _numbers(mesh: Mesh, n: int) -> Ints:
    """Return the numbers of n nodes: those that the names of points give, and others behind them."""
    named = {
        row: int(name[5:]) for name, row in mesh.point_names.items() if re.fullmatch(r"node \d{1,9}", name)
    }
    if not named:
        return np.arange(1, n + 1)
    free = count(max(named.values()) + 1)
    return np.array([named[row] if row in named else next(free) for row in range(n)])


def with_places(model: Model) -> tuple[Model, list[tuple[int, int, str, float]]]:
    """Return a model with points where members crack or carry masses, and springs at ends of lines.

    A spring is a line, its end 0 or 1, a local direction and a stiffness.
    """
    mesh = model.mesh
    for e in model.effects:
        if isinstance(e, PointMass | PointInertia | Crack):
            mesh = mesh.with_point_on(e.member, float(np.real(e.position)))
    model = model.with_mesh(mesh)
    springs = []
    for e in model.effects:
        if isinstance(e, Crack | EndRelease) and np.real(e.compliance) > 0:
            lines = mesh.members[e.member]
            at = len(lines) - 1 if isinstance(e, EndRelease) and e.end == 2 else 0
            end = int(isinstance(e, EndRelease) and e.end == 2)
            if isinstance(e, Crack):
                at = int(np.argmin(np.abs(mesh.member_positions(e.member)[:-1] - float(e.position))))
            springs.append((int(lines[at]), end, e.direction, 1 / float(e.compliance)))
    return model, springs


def _bars(model: Model, springs: list[tuple[int, int, str, float]]) -> tuple[Bars, tuple[BarProperty, ...]]:
    """Return the bars of all lines, and their properties: one of each member, or of each line of a taper."""
    mesh, frame = model.mesh, sheared_frame(model)
    g, layout = frame.lines(mesh, np.arange(mesh.n_lines)), layout_of(frame.members, mesh)
    stiffness = np.full((mesh.n_lines, 12), np.inf)
    soft = layout.soft >= 0
    stiffness[soft] = layout.ends[layout.soft[soft]]
    stiffness = stiffness.reshape(-1, 2, 6)
    for line, end, direction, k in springs:
        cell = line, end, DIRECTIONS.index(direction)
        stiffness[cell] = 1 / (1 / stiffness[cell] + 1 / k) if stiffness[cell] > 0 else 0.0
    found: list[BarProperty] = []
    which = np.zeros(mesh.n_lines, dtype=np.int64)
    for member, lines in mesh.members.items():
        for line in lines:
            if line == lines[0] or g.tapered[line]:
                found.append(_property(model, frame, g, int(line), member, layout.along[line]))
            which[line] = len(found) - 1
    bars = Bars(
        numbers=np.arange(1, mesh.n_lines + 1),
        ends=mesh.lines,
        properties=which,
        height=g.R[:, 2],
        offsets=g.end,
        stiffness=stiffness,
    )
    return bars, tuple(found)


def _property(model: Model, frame: Frame, g: Lines, line: int, member: str, along: Floats) -> BarProperty:
    p, factor = frame.members[member], _factors(model, member)
    at = {"E": float(g.E[line]) * factor["E"], "rho": float(g.rho[line]) * factor["rho"]}
    name = p.material.name if factor["E"] == factor["rho"] == 1 else f"{p.material.name} of {member}"
    sections: list[Section | None] = [p.section, None]
    if p.section2 is not None:
        sections = [Section.between(p.section, p.section2, float(x)) for x in along]
    plain: dict[str, float] = {key: float(getattr(g, key)[line]) for key in ("ky", "kz")}
    return BarProperty(
        name=member,
        material=replace(p.material, name=name, **at),
        section=_section(sections[0], factor, plain if p.section2 is None else {}),
        section2=None if sections[1] is None else _section(sections[1], factor, {}),
        theory=p.theory,
        mass=p.mass,
        mass_per_length=sum(float(e.mass) for e in model.of_kind(DistributedMass) if _along(e, member)),
    )


def _along(e: Effect, member: str = "") -> bool:
    """Whether an effect is a mass per length on all of a member, or of this one."""
    if not isinstance(e, DistributedMass) or type(e) is not DistributedMass or member not in ("", e.member):
        return False
    return abs(e.position - e.length / 2) <= ROUNDING * e.length and e.width >= (1 - ROUNDING) * e.length


def _section(section: Any, factor: dict[str, float], shear: dict[str, float]) -> Section:
    """Return a section by its constants about its principal axes, with factors of these."""
    constants: dict[str, Any] = {key: getattr(section, key) for key in CONSTANTS} | shear
    constants = {key: value * factor.get(key, 1.0) for key, value in constants.items()}
    return Section(**constants, label=section.label)


def _factors(model: Model, member: str) -> dict[str, float]:
    """Return the factors of a member's constants that effects of it make together [-]."""
    out: dict[str, float] = dict.fromkeys(("E", "rho", *CONSTANTS), 1.0)
    frame = frame_of(model)
    material = frame.members[member].material
    for e in model.effects:
        more: dict[str, float] = {}
        if isinstance(e, MemberStiffness | MemberDensity) and e.member == member:
            of = {
                f: f.values.get(f"{e.of}:{material.name}", getattr(material, e.of))
                for f in (frame, nominal(frame))
            }
            more = {e.of: 1 + e.change * of[nominal(frame)] / of[frame]}
        elif isinstance(e, MemberTorsion) and e.member == member:
            more = {"J": 1 + e.change}
        elif isinstance(e, MemberSection) and e.member == member:
            more = e.factors(frame.members[member].section)
        elif isinstance(e, SectionForm) and member in e.members:
            more = {key: 1 + getattr(e, key) for key in ("Iy", "Iz", "J")} | {"rho": 1 + e.A}
            more |= dict.fromkeys(("ky", "kz"), 1 / (1 + e.shear))
            s = frame.members[member].section
            more["Ip"] = (more["Iy"] * s.Iy + more["Iz"] * s.Iz) / (s.Iy + s.Iz)
        out |= {key: out[key] * float(np.real(value)) for key, value in more.items()}
    return out


def _add_constraints(model: Model, parts: _DeckParts) -> None:
    """Add supports, and the equations that neither joints nor rigid links state."""
    n = 6 * model.mesh.n_points
    fixed: dict[int, set[str]] = {}
    for c in model.constraints():
        owner = model.effect(c.key[0])
        if len(c.dofs) == 1 and c.dofs[0] < n:
            fixed.setdefault(int(c.dofs[0]) // 6, set()).add(DIRECTIONS[int(c.dofs[0]) % 6])
        elif isinstance(owner, RigidLink) or (isinstance(owner, Joint) and _joins(owner, model)):
            continue
        elif (c.dofs < n).all():
            terms = tuple(
                (int(d) // 6, DIRECTIONS[int(d) % 6], float(a))
                for d, a in zip(c.dofs, c.coefficients, strict=True)
                if a
            )
            parts.equations.append(Equation(name=" ".join(c.key), terms=terms))
        else:
            parts.notes.append(f"{c.key[0]}: its constraint {c.key[1]} has coordinates that are no node's")
    parts.supports.update({p: tuple(d for d in DIRECTIONS if d in fixed[p]) for p in sorted(fixed)})


def _joins(joint: Joint, model: Model) -> bool:
    """Whether a joint acts on its two points, and is not spread over members."""
    return len(joint.relative(model)[0]) == (6 if joint.point2 is None else 12)


def _add_effect(effect: Effect, model: Model, parts: _DeckParts) -> None:
    """Add one effect to the parts of a deck."""
    if isinstance(effect, (*FOLDED, SectionShear, Crack, EndRelease)) or _along(effect):
        return
    if isinstance(effect, GLOBAL):
        parts.notes.append(
            f"{effect.name}: {effect.where}: not in this file: no card stands for {effect.kind}"
        )
    elif isinstance(effect, RigidLink):
        e = effect
        link = Link(name=e.name, node=e.point, dependents=e.dependents, directions=e.directions)
        parts.links.append(link)
    elif isinstance(effect, AddedMass):
        e, m = effect, float(effect.mass)
        parts.bodies.append(Body(name=e.name, node=e.point, mass=m, inertia=e.inertia, arm=e.arm))
    elif isinstance(effect, PointMass | PointInertia):
        mesh, I = model.mesh, getattr(effect, "inertia", 0.0) * np.eye(3)
        near = np.argmin(np.abs(mesh.member_positions(effect.member) - float(effect.position)))
        node = int(mesh.member_points(effect.member)[near])
        parts.bodies.append(
            Body(name=effect.name, node=node, mass=float(getattr(effect, "mass", 0.0)), inertia=I)
        )
    elif isinstance(effect, SprungMass):
        _add_sprung_mass(effect, model, parts)
    else:
        if isinstance(effect, Joint) and _joins(effect, model):
            parts.joints[effect.name] = len(parts.connections)
            parts.connections.append(_of_joint(effect, model))
        _add_contributions(effect, model, parts)


def _of_joint(joint: Joint, model: Model) -> Connection:
    constrained = {c.key[1] for c in model.constraints() if c.key[0] == joint.name}
    rigid = np.array([d in joint.rigid for d in DIRECTIONS])
    K, C, D = (
        np.where(rigid[:, None] | rigid, 0.0, X) for X in (joint.K, joint.C, joint.D + joint.eta * joint.K)
    )
    return Connection(
        name=joint.name,
        nodes=(joint.point1, joint.point2),
        K=K,
        C=C,
        D=D,
        axes=joint.axes,
        place=joint.location,
        rigid=tuple(d for d in joint.rigid if d in constrained),
    )


def _add_sprung_mass(e: SprungMass, model: Model, parts: _DeckParts) -> None:
    """Add a node with the body at its centre, and the springs that it is on."""
    place = model.mesh.points[e.point] + e.arm
    node = parts.point(place)
    parts.bodies.append(
        Body(name=e.name, node=node, mass=float(e.mass), inertia=e.axes.T @ e.inertia @ e.axes)
    )
    K, C = (np.diag([float(of.get(d, 0.0)) for d in DIRECTIONS]) for of in (e.k, e.c))
    rigid = tuple(d for d in DIRECTIONS if d not in e.k)
    parts.connections.append(
        Connection(
            name=e.name, nodes=(node, e.point), K=K, C=C, D=e.eta * K, axes=e.axes, place=place, rigid=rigid
        )
    )


def _add_contributions(effect: Effect, model: Model, parts: _DeckParts) -> None:
    """Add what an effect contributes to K, M, C and D on the nodes that it acts on."""
    node_of = _internal_nodes(effect, model, parts)
    for c in effect.contribute(model):
        if isinstance(effect, Frame) and c.K is not None and c.M is not None:
            continue  # the bars
        if isinstance(effect, Joint) and c.M is None and _joins(effect, model):
            continue  # the connection
        if c.law is not None:
            parts.notes.append(
                f"{effect.name}: {effect.where}: it depends on frequency; the deck has its stiffness at 0 Hz"
            )
        elif isinstance(effect, AmplitudeDependent):
            parts.notes.append(
                f"{effect.name}: {effect.where}: it depends on amplitude; the deck has its matrices at one"
            )
        for nodes, X in _elements(c, node_of):
            if any(np.abs(Y - Y.T).max() > ROUNDING * np.abs(Y).max() for Y in X.values()):
                parts.notes.append(
                    f"{effect.name}: {effect.where}: not in this file: its matrices are not symmetric"
                )
                break
            _add_matrices(effect, parts, nodes, X)


def _internal_nodes(effect: Effect, model: Model, parts: _DeckParts) -> dict[int, tuple[int, int]]:
    """Return the node and direction of each internal coordinate of an effect: nodes are made for them."""
    if not effect.internal.n:
        return {}
    dofs, out = model.internal_dofs(effect.name), {}
    for k in range(0, len(dofs), 6):
        node = parts.point(np.zeros(3), DIRECTIONS[: len(dofs) - k])
        out |= {int(dof): (node, i) for i, dof in enumerate(dofs[k : k + 6])}
    return out


def _elements(
    c: Contribution, node_of: dict[int, tuple[int, int]]
) -> Iterator[tuple[tuple[int, ...], dict[str, Floats]]]:
    """Yield nodes and matrices (6 n, 6 n) of each element of a contribution."""
    for k, dofs in enumerate(c.dofs):
        at = [node_of.get(int(d), (int(d) // 6, int(d) % 6)) for d in dofs]
        nodes = tuple(dict.fromkeys(node for node, _ in at))
        rows = np.array([6 * nodes.index(node) + d for node, d in at])
        out = {}
        for key in "KMCD":
            X = c.static if key == "K" else getattr(c, key)
            out[key] = np.zeros((6 * len(nodes), 6 * len(nodes)))
            if X is not None:
                np.add.at(out[key], (rows[:, None], rows), np.real(X[k]))
        yield nodes, out


def _add_matrices(effect: Effect, parts: _DeckParts, nodes: tuple[int, ...], X: dict[str, Floats]) -> None:
    """Add matrices of nodes as a connection and a body where they are those of one, else as they are."""
    points, zero = np.array([parts.points[n] for n in nodes]), np.zeros_like(X["K"])
    springs = {key: X[key] for key in "KCD" if X[key].any()}
    if springs and (len(nodes) == 1 or (len(nodes) == 2 and _costs_nothing(points, springs))):
        _add_connection(effect, parts, nodes, {key: Y[:6, :6] for key, Y in springs.items()})
        X |= dict.fromkeys("KCD", zero)
    if len(nodes) == 1 and X["M"].any() and (body := _body(effect.name, nodes[0], X["M"])) is not None:
        parts.bodies.append(body)
        X |= {"M": zero}
    if any(Y.any() for Y in X.values()):
        parts.matrices.append(NodeMatrices(name=effect.name, nodes=nodes, **X))


def _costs_nothing(points: Floats, springs: dict[str, Floats]) -> bool:
    """Whether rigid motions of two points cost no force: springs between them have such matrices."""
    motions = np.vstack([np.eye(6), lever_matrix(points[1] - points[0])])
    return all(
        np.abs(Y @ motions).max() <= ROUNDING * np.abs(Y).max() * max(1.0, np.abs(motions).max())
        for Y in springs.values()
    )


def _add_connection(effect: Effect, parts: _DeckParts, nodes: tuple[int, ...], springs: Any) -> None:
    """Add matrices (6, 6) at the first node to the effect's joint, if it has one there, else a connection."""
    first, second = (*nodes, None)[:2]
    place = parts.points[nodes[0]]
    names = getattr(effect, "joints", (getattr(effect, "joint", effect.name),))
    for k in (parts.joints[name] for name in names if name in parts.joints):
        c = parts.connections[k]
        if c.nodes == (first, second) and c.place is not None:
            # (6, 6) of the relative motion at the connection's place and in its axes
            T = lever_matrix(place - c.place) @ np.kron(np.eye(2), c.axes.T)
            more: Any = {key: getattr(c, key) + _clean(T.T @ Y @ T) for key, Y in springs.items()}
            parts.connections[k] = replace(c, name=f"{c.name} with {effect.name}", **more)
            return
    parts.connections.append(Connection(name=effect.name, nodes=(nodes[0], second), place=place, **springs))


def _clean(X: Floats) -> Floats:
    """Return a matrix without entries that are rounding."""
    size = np.sqrt(np.abs(np.outer(np.diag(X), np.diag(X)))) + 1e-3 * np.abs(X).max()
    return np.where(np.abs(X) > ROUNDING * size, X, 0.0)


def _body(name: str, node: int, M: Floats) -> Body | None:
    """Return the rigid body with a mass matrix (6, 6) at a node; None if there is none."""
    m = float(M[0, 0])
    if m < 0 or np.abs(M[:3, :3] - m * np.eye(3)).max() > ROUNDING * max(m, 1e-300):
        return None
    S = M[3:, :3] / m if m > 0 else np.zeros((3, 3))
    arm = np.array([S[2, 1], S[0, 2], S[1, 0]])
    T = lever_matrix(arm)
    inertia = M[3:, 3:] - m * T[:3, 3:].T @ T[:3, 3:]
    G = np.zeros((6, 6))
    G[:3, :3], G[3:, 3:] = m * np.eye(3), inertia
    scale = np.abs(M).max()
    if np.abs(T.T @ G @ T - M).max() > ROUNDING * scale or np.linalg.eigvalsh(inertia)[0] < -ROUNDING * scale:
        return None
    return Body(name=name, node=node, mass=m, inertia=_clean(inertia), arm=arm)
