"""Joints of finite extent: flats that lie on each other touch over an area, not in a point."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from fem.array_types import Floats, Ints
from fem.declarations import Entry, Marker, Role, Site, StiffnessAt
from fem.effects.joint import Joint, PointPair, Spread
from fem.effects.places import frame_of, is_bar, section_extent
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Contribution, Model, Parameter, ParameterRef, lever_matrix
from fem.recent import Recent

_LEAST_SINE = 0.35
"""Members that meet at a smaller angle lie along each other: such joints are left as they are."""
_MOTIONS = 256
"""Mean motions that are kept: of two sides of each joint at the last few sizes."""
_Rows = tuple[Ints, Floats]


class _Side(NamedTuple):
    """A side of a joint: its point, the member and the arc length where that is, half the other's breadth."""

    point: int
    member: str
    position: float
    half: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointPatch(Spread):
    """Joints between members that lie on each other act on the mean motion of a stretch of each.

    The stretch is as long as the other member is broad there, times ``size``. Its motion is that rigid one
    which leaves the least squares of its cross-sections' other motions, ∫∫ |u - u₀ - θ × r|² dA dx: as an
    interpolating (RBE3) element in programs for solids. A member that ends in a joint is as if shorter
    by up to a third of half the stretch, in bending and in torsion.

    The motion is that of elements as the frame has them: what gives way within a stretch, as cracks and end
    releases do, does not change it.

    In their plane flats turn about a patch that is smaller than they are broad: a rigid disc of radius a in a
    large plate of thickness h turns by T / 4πGa²h (Lamé's solution, u_φ ~ 1/r). Where a joint is rigid about
    the normal of its flats, ``twist`` times that of both flats in series, with half the other's breadth for
    a, stands in place of rigid: see :func:`with_patch`.

    Attributes
    ----------
    sides : tuple of (_Side, _Side)
        Of each joint.
    joints : tuple of str
        Names.
    size : float
        Length of the stretches over the breadth of the other member [-].
    twist : float
        Stiffness about the normal over that of discs as broad as the members [-]; 0 stands for rigid.
    motions : Recent
        Mean motions of sides, which each joint asks for in every direction and derivative. Copies with other
        values share it.
    """

    kind: ClassVar[str] = "joint_patch"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "sky")
    statement: ClassVar[str] = "{thing} {act} over an area"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`size` [-], `twist` [-]",
        meaning=(
            "joints that act on the mean motion of a stretch of each member, `size` times as long as "
            "the other one is broad; where `twist` is not 0, joints that are rigid otherwise turn "
            "about the normal of the flats, with `twist` times the stiffness of discs as broad as the "
            "members. A study states it; no search proposes it"
        ),
        places="all joints between members that lie on each other and cross, together",
    )
    sides: tuple[tuple[_Side, _Side], ...]
    joints: tuple[str, ...]
    size: float = 0.0
    twist: float = 0.0
    motions: Recent = field(default_factory=lambda: Recent(_MOTIONS), repr=False)

    @property
    def where(self) -> Site:
        """The joints."""
        return Site(f"joint{'s' if len(self.joints) > 1 else ''} {', '.join(self.joints)}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the size, and the stiffness about the normal."""
        return (
            Parameter("size", "-", self.size, 0.0, 0.0, 2.0),
            Parameter("twist", "-", self.twist, 0.0, 0.0, 100.0),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return nothing: the joints themselves act otherwise."""
        return ()

    def mean(self, model: Model, point: int, other: int | None) -> _Rows | None:
        """Return the mean motion of a patch."""
        for one, two in self.sides:
            for side, opposite in ((one, two), (two, one)):
                if (side.point, opposite.point) == (point, other) and self.size > 0:
                    return self._mean(model, side)
        return None

    def _mean(self, model: Model, side: _Side) -> _Rows:
        mesh, frame = model.mesh, frame_of(model)
        size = float(np.real(self.size))
        # Not the frame itself: moduli of a fit make another one, and leave the motion as it is.
        key = (side, size, mesh, frame.members[side.member])
        return self.motions.get(key, lambda: _mean_motion(model, side, size * side.half))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """As broad as the other member, half that, and more."""
        return ({"size": 1.0}, {"size": 0.5}, {"size": 1.4})

    def turning(self, model: Model) -> dict[ParameterRef, float]:
        """Return the stiffnesses about their normal of joints that are rigid otherwise [N·m/rad].

        Those of discs as broad as the members, ``twist`` = 1; none of joints whose axes are askew.
        """
        out = {}
        for name, pair in zip(self.joints, self.sides, strict=True):
            joint = model.effect(name)
            assert isinstance(joint, Joint)
            axes = [_axes(model, side) for side in pair]
            across = np.cross(axes[0][0], axes[1][0])
            across /= np.linalg.norm(across)
            # An axis of a joint is the normal of its flats from this cosine
            (about,) = np.nonzero(np.abs(joint.axes @ across) > 0.99)
            if about.size:
                gives = sum(1 / _disc(model, side, R, across) for side, R in zip(pair, axes, strict=True))
                out[name, f"k{DIRECTIONS[3 + int(about[0])]}"] = 1 / gives
        return out

    def added_to(self, model: Model) -> Model:
        """Return a model whose joints turn about their normals if the patches have a ``twist``."""
        return with_patch(model, self)

    def fitted_in(self, model: Model) -> Self:
        """Return patches whose ``twist`` is that of a model's joints, the geometric mean of several."""
        known = model.values()
        turning = {ref: k for ref, k in self.turning(model).items() if ref in known}
        if not self.twist or not turning:
            return self
        ratios = [float(np.real(known[ref])) / k for ref, k in turning.items()]
        return self.with_values(twist=float(np.exp(np.mean(np.log(ratios)))))

    def lengths(self) -> tuple[float, float]:
        """Return the shortest and the longest stretch, cut nowhere [m]."""
        every = [2 * float(np.real(self.size)) * side.half for pair in self.sides for side in pair]
        return min(every), max(every)

    @classmethod
    def propose(cls, model: Model) -> tuple["JointPatch", ...]:
        """All joints between members that lie on each other and cross, unless they have patches."""
        if not model.of_kind(Frame) or model.of_kind(cls):
            return ()
        found = {e.name: pair for e in model.of_kind(Joint) if (pair := _sides(model, e))}
        if not found:
            return ()
        return (cls(name="joint_patch:all", sides=tuple(found.values()), joints=tuple(found)),)

    def locations(self, model: Model) -> Floats:
        """Return the points of the joints."""
        return model.mesh.points[[side.point for pair in self.sides for side in pair]]


def _sides(model: Model, element: PointPair) -> tuple[_Side, _Side] | None:
    """Return the sides of an element between members that cross, one on top of the other; None of others."""
    if element.point2 is None:
        return None
    one, two = _member_at(model, element.point1), _member_at(model, element.point2)
    if one is None or two is None or one[0] == two[0]:
        return None
    (along1, *_), (along2, *_) = axes = [
        frame_of(model).rotations(model.mesh, [line])[0] for _, _, line in (one, two)
    ]
    across = np.cross(along1, along2)
    sine = float(np.linalg.norm(across))
    if sine < _LEAST_SINE:
        return None
    across /= sine
    apart = model.mesh.points[element.point2] - model.mesh.points[element.point1]
    touching = sum(section_extent(model, end[0], R, across) for end, R in zip((one, two), axes, strict=True))
    # The way from one axis to the other goes across both members by at least this cosine
    # The length of the way is less than this multiple of that at which they touch
    if not 0.7 * np.linalg.norm(apart) < abs(apart @ across) < 1.5 * touching:
        return None
    half1 = section_extent(model, two[0], axes[1], along1) / sine
    half2 = section_extent(model, one[0], axes[0], along2) / sine
    return _Side(element.point1, *one[:2], half1), _Side(element.point2, *two[:2], half2)


def with_patch(model: Model, patch: JointPatch) -> Model:
    """Return a model with patches, whose joints turn about their normals if the patches have a ``twist``.

    Joints that are elastic about it stay as they are.
    """
    effects = list(model.effects)
    for (name, key), stiffness in patch.turning(model).items() if patch.twist > 0 else ():
        k = [e.name for e in effects].index(name)
        joint, d = effects[k], key[1:]
        if isinstance(joint, Joint) and d in joint.rigid:
            at = DIRECTIONS.index(d)
            K = np.array(joint.K, dtype=float)
            K[at, :], K[:, at] = 0.0, 0.0
            K[at, at] = patch.twist * stiffness
            effects[k] = replace(joint, K=K, rigid=tuple(r for r in joint.rigid if r != d))
    return replace(model, effects=tuple(effects)).with_effect(patch)


def turning_parameters(model: Model) -> tuple[ParameterRef, ...]:
    """Return the stiffnesses about the normal that joints have of patches with a ``twist``."""
    values = model.values()
    return tuple(
        ref
        for patch in model.of_kind(JointPatch)
        for ref, k in patch.turning(model).items()
        if patch.twist > 0 and np.isclose(values.get(ref, 0.0), patch.twist * k, rtol=1e-9)
    )


def _axes(model: Model, side: _Side) -> Floats:
    """Return the axes of a side's member there, as rows."""
    line = model.mesh.locate(side.member, side.position).line
    return frame_of(model).rotations(model.mesh, [line])[0]


def _disc(model: Model, side: _Side, axes: Floats, across: Floats) -> float:
    """Return the stiffness with which a flat holds a disc as broad as the other against turning in its plane.

    4πGa²h [N·m/rad]; h is the area of its section over its breadth.
    """
    properties = frame_of(model).members[side.member]
    breadth = 2 * section_extent(model, side.member, axes, np.real(np.cross(across, axes[0])))
    thickness = properties.section.A / breadth
    return 4 * np.pi * properties.material.G * side.half**2 * thickness


def _member_at(model: Model, point: int) -> tuple[str, float, int] | None:
    """Return the only member that has a point, the arc length there, and a line of it that ends there.

    None of bars, of members that taper, of such with a hinge or a spring at an end, which a patch would reach
    over, and of such with rigid end zones, which have the same effect.
    """
    found = []
    for name, lines in model.mesh.members.items():
        (at,) = np.nonzero(model.mesh.member_points(name) == point)
        if at.size:
            k = int(at[0])
            s = float(model.mesh.member_positions(name)[k])
            found.append((name, s, int(lines[min(k, len(lines) - 1)])))
    if len(found) != 1:
        return None
    p = frame_of(model).members[found[0][0]]
    loose = bool((p.end_stiffness < np.inf).any())
    zones = bool(p.rigid1 or p.rigid2)
    return None if loose or zones or p.section2 is not None or is_bar(model, found[0][0]) else found[0]


def _mean_motion(model: Model, side: _Side, reach: float) -> _Rows:
    """Return DOFs (n,) and rows (6, n) of the mean motion of a stretch of a member, at the side's point."""
    mesh, frame = model.mesh, frame_of(model)
    first = max(side.position - reach, 0.0)
    last = min(side.position + reach, mesh.member_length(side.member))
    # Points of Gauss along a patch
    x, weight = np.polynomial.legendre.leggauss(7)
    places = [mesh.locate(side.member, float(s)) for s in (first + last) / 2 + (last - first) / 2 * x]
    dofs, N = frame.interpolate(mesh, places)
    every = np.unique(np.concatenate(dofs))
    section = frame.members[side.member].section
    radii = np.sqrt(np.array([section.Iz, section.Iy]) / section.A)
    axes = frame.rotations(mesh, [place.line for place in places])
    moved, rigid, weights = [], [], []
    for line_dofs, motion, place, (_, y, z), w in zip(dofs, N, places, axes, weight, strict=True):
        rows = np.zeros((6, len(every)))
        rows[:, np.searchsorted(every, line_dofs)] = motion
        for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            off = a * radii[0] * y + b * radii[1] * z
            moved.append(lever_matrix(off)[:3] @ rows)
            rigid.append(lever_matrix(mesh.point_at(place) + off - mesh.points[side.point])[:3])
            weights += 3 * [w]
    root = np.sqrt(weights)[:, None]
    mean = np.linalg.lstsq(root * np.vstack(rigid), root * np.vstack(moved), rcond=None)[0]
    return every, mean
