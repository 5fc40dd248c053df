"""Properties of a member: material, section, beam theory, mass, offsets, rigid zones and end connections."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.materials import Material
from fem.model import DIRECTIONS, ModelError
from fem.sections.section import Section
from fem.summary import fields_summary

THEORIES = ("timoshenko", "euler-bernoulli", "bar")
MASSES = ("consistent", "higher-order", "lumped", "lumped-slender")
LUMPED = ("lumped", "lumped-slender")


@dataclass(frozen=True, slots=True, eq=False)
class MemberProperties:
    """Material, section, orientation, beam theory, mass and end connections of a member.

    Attributes
    ----------
    material : Material
    section : Section
        Of the member, or at its first end.
    orientation : ndarray (3,) or None
        A vector that, with the member's axis, spans the plane of the section's height (local z). Global Z,
        or global X for members within 1° of vertical, unless given.
    offset1, offset2 : ndarray (3,)
        From the mesh's line to the member's axis at the first and second end, global, linear in between [m].
    rigid1, rigid2 : float
        Lengths of the rigid end zones [m]; they have the member's mass.
    theory : str
        ``"timoshenko"`` (shear and rotary inertia), ``"euler-bernoulli"`` (neither) or ``"bar"`` (axial
        stiffness alone, mass in all translations). A cable is a bar of several elements with a pretension;
        it does not sag.
    section2 : Section or None
        At the second end of a tapered member. The elements integrate the taper (`fem.elements.tapered`), so
        that errors fall with the element size as those of prismatic members do.
    mass : str
        ``"consistent"`` (of the shape functions); ``"higher-order"``, which adds the
        motion within an element that its inertia makes in stretching, torsion and shear, and so removes
        most of the mesh's error; or ``"lumped"``: at each node half of an element's mass, of its rotary
        inertia about x and, with the Timoshenko theory, of that of bending. No inertia m L² comes with it:
        without one, bending frequencies err by order h⁴ instead of h². ``"lumped-slender"`` leaves
        out the rotary inertia of bending, also with the Timoshenko theory, as Nastran's bars do.
    release1, release2 : tuple of str
        Local directions (x y z rx ry rz) in which the first and second end is free: hinges and sliders.
    spring1, spring2 : mapping of str to float
        Stiffness of the connection of the first and second end in local directions: rigid unless given;
        0 is a release [N/m, N·m/rad].
    pretension : float
        Axial force of the state about which the member vibrates, positive in tension [N].
    spin : float
        Speed at which the member turns about its axis, positive from its first to its second end, relative to
        that of the rotation: 0 of one that does not turn (`fem.effects.spin`) [-].
    only : str
        ``"tension"`` or ``"compression"``: a bar that carries this alone, and goes slack otherwise. Statics
        iterate (`fem.analysis.one_sided`); all other analyses take a bar that carries both.
    """

    material: Material
    section: Section
    orientation: Floats | None = None
    offset1: Floats = field(default_factory=lambda: np.zeros(3))
    offset2: Floats = field(default_factory=lambda: np.zeros(3))
    rigid1: float = 0.0
    rigid2: float = 0.0
    theory: str = "timoshenko"
    section2: Section | None = None
    mass: str = "consistent"
    release1: tuple[str, ...] = ()
    release2: tuple[str, ...] = ()
    spring1: Mapping[str, float] = field(default_factory=dict)
    spring2: Mapping[str, float] = field(default_factory=dict)
    pretension: float = 0.0
    spin: float = 0.0
    only: str = ""

    __repr__ = fields_summary

    def __post_init__(self) -> None:
        for name, value, allowed in (("beam theory", self.theory, THEORIES), ("mass", self.mass, MASSES)):
            if value not in allowed:
                msg = f"the {name} is '{value}'; allowed are {', '.join(allowed)}"
                raise ModelError(msg)
        if self.rigid1 < 0 or self.rigid2 < 0:
            msg = f"rigid end zones are {self.rigid1:g} and {self.rigid2:g} m; they cannot be negative"
            raise ModelError(msg)
        if not np.isfinite(self.pretension):
            msg = f"the pretension is {self.pretension}; it must be a finite number [N]"
            raise ModelError(msg)
        if not np.isfinite(self.spin):
            msg = f"the spin is {self.spin}; it must be a finite number, relative to the speed [-]"
            raise ModelError(msg)
        if self.only not in ("", "tension", "compression"):
            msg = f"it carries only '{self.only}'; allowed are tension and compression"
            raise ModelError(msg)
        if self.only and self.theory != "bar":
            msg = f"it carries only {self.only}, and its theory is '{self.theory}'; take 'bar'"
            raise ModelError(msg)
        if self.section2 is not None:
            Section.between(self.section, self.section2, 0.5)
        _check_ends(self)

    @property
    def end_stiffness(self) -> Floats:
        """Stiffness of the connections of both ends in local directions, inf where rigid, shape (12,)."""
        k = np.full(12, np.inf)
        for end, (free, springs) in enumerate(((self.release1, self.spring1), (self.release2, self.spring2))):
            for d, value in ({**dict.fromkeys(free, 0.0), **springs}).items():
                k[6 * end + DIRECTIONS.index(d)] = value
        return k


STRAINS = {
    "stretching": (("x",), 1),
    "torsion": (("rx",), 1),
    "bending in x-z": (("z", "ry"), 2),
    "bending in x-y": (("y", "rz"), 2),
}
"""Kinds of strain: the local directions that cause each, and its number of rigid-body motions."""


def _check_ends(p: MemberProperties) -> None:
    """Refuse directions that do not exist, are given twice, or leave the member a mechanism."""
    for end, (free, springs) in enumerate(((p.release1, p.spring1), (p.release2, p.spring2)), start=1):
        for d in (*free, *springs):
            if d not in DIRECTIONS:
                msg = f"end {end} is released in '{d}'; allowed are {', '.join(DIRECTIONS)} (local axes)"
                raise ModelError(msg)
            if d in free and d in springs:
                msg = f"end {end} has both a release and a spring in {d}; give one of them"
                raise ModelError(msg)
        for d, k in springs.items():
            if not k >= 0:
                msg = f"the spring of end {end} in {d} is {k}; it must be at least 0 (inf is rigid)"
                raise ModelError(msg)
    if p.theory == "bar" and (p.release1 or p.release2 or p.spring1 or p.spring2):
        msg = "a bar has no moments to release, and nothing but its axial stiffness; leave its releases out"
        raise ModelError(msg)
    k = p.end_stiffness
    for strain, (directions, n) in STRAINS.items():
        free = [
            f"{d} at end {e + 1}" for e in (0, 1) for d in directions if k[6 * e + DIRECTIONS.index(d)] == 0
        ]
        both = len([w for w in free if w.startswith(f"{directions[0]} ")]) == 2
        if len(free) > n or both:
            msg = f"with {', '.join(free)} released, nothing holds the member's {strain}; release fewer"
            raise ModelError(msg)
