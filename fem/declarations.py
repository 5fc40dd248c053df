"""Declarations of an effect, so that no other code asks for its class: role, marker, documentation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Flag, StrEnum, auto
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from fem.array_types import Floats
from fem.lengths import length_text

StiffnessAt = Callable[[tuple[str, str]], float]
"""The stiffness that the structure opposes to a released constraint, by its key [N/m, N·m/rad]."""
Contains = Mapping[str, Callable[[Any], dict[str, float]]]
"""Kinds of effect, each with a function that returns its parameters, of an effect that contains it."""


class Role(Flag):
    """Which part of a model an effect belongs to; several for one that is, say, a spring and a dashpot."""

    STIFFNESS = auto()
    """Adds to K, and to D the material damping that goes with it."""
    MASS = auto()
    """Adds to M."""
    DISSIPATION = auto()
    """Adds to C and D, or has a law of stiffness and loss."""
    GYROSCOPIC = auto()
    """Adds a skew C, which does no work."""
    GEOMETRY = auto()
    """Moves, lengthens or stiffens parts whose size or place the model simplifies."""
    CONSTRAINT = auto()
    """Ties or holds DOFs."""
    INITIAL_STRESS = auto()
    """Adds the geometric stiffness of forces that are there before the structure vibrates."""

    @property
    def words(self) -> str:
        """The parts in words, such as ``"stiffness and dissipation"``."""
        return " and ".join(str(r.name).lower().replace("_", " ") for r in self)


class Environment(StrEnum):
    """Situation of a structure without which some kinds of effect do not exist: a word and its meaning."""

    meaning: str

    FLUID = "fluid", "a liquid around members or in them"
    ROTATION = "rotation", "something turns while the structure is tested"
    ELASTOMER = "elastomer", "rubber, gaskets or adhesives in connections"

    def __new__(cls, word: str, meaning: str) -> "Environment":
        """Make a member of a word and its meaning."""
        out = str.__new__(cls, word)
        out._value_, out.meaning = word, meaning
        return out


class Marker(NamedTuple):
    """How a picture marks an effect: names of a shape and a colour that the drawing knows."""

    shape: str
    colour: str


@dataclass(frozen=True, slots=True)
class Entry:
    """The row of an effect in tables of the documentation, in Markdown.

    Attributes
    ----------
    quantities : str
        Its parameters with their units.
    meaning : str
        Its physics in a phrase.
    places : str
        Where a search proposes it.
    """

    quantities: str
    meaning: str
    places: str


SUPPORT_MARKER = Marker("triangle", "support")
"""How pictures mark rigid supports, of whatever kind of effect."""


class ArmForce(NamedTuple):
    """A force at the end of a rigid arm that a point of the mesh holds.

    ``arm`` leads from the point to the end (3,) [m]; ``force`` is that of the point on the end (3,) [N].
    """

    point: int
    arm: Floats
    force: Floats


_STILL = np.zeros((0, 3))
_STILL.flags.writeable = False


class Site(str):
    """Where an effect is, in words that know their parts, such as ``member U at 0.600 m, rz``.

    Parameters
    ----------
    thing : str
        What it acts on, such as ``"joint J"`` or ``"member U"``.
    position : float, optional
        Along a member [m].
    detail : str
        A direction, or which member of a joint.
    """

    __slots__ = ("at", "detail", "thing")
    thing: str
    at: str
    detail: str

    def __new__(cls, thing: str, position: Any = None, detail: str = "") -> Self:
        """Return the words; a position may be in words already."""
        at = position if isinstance(position, str) else ""
        at = at if position is None or at else length_text(float(np.real(position)))
        self = super().__new__(cls, f"{thing}{' at ' * bool(at)}{at}{', ' * bool(detail)}{detail}")
        self.thing, self.at, self.detail = thing, at, detail
        return self

    def __getnewargs__(self) -> Any:
        """Return what a copy in another process is made of."""
        return self.thing, self.at or None, self.detail


class Internal(NamedTuple):
    """Coordinates of an effect in addition to those of the mesh's points.

    Attributes
    ----------
    n : int
        Their number.
    ground : ndarray (k, 3)
        Directions in which the first k of them move all supports and grounds.
    body : (int, ndarray (3, 6 + n)) or None
        Of a body on which sensors may be: the point that carries it, and its translation by the six DOFs of
        that point and the coordinates.
    """

    n: int = 0
    ground: Floats = _STILL
    body: tuple[int, Floats] | None = None


NO_INTERNAL = Internal()
"""Of effects that act on the mesh's points alone."""


@dataclass(frozen=True, slots=True)
class Relevant:
    """What a user calls a relevant size of an effect, by what it changes.

    Attributes
    ----------
    connections : float
        Share of its stiffness that a connection lacks; of a rigid one the flexibility that it has, as a share
        of all there with its surroundings' [-].
    members : float
        Share of a member's stiffness, mass per length or depth; of a tension that of the buckling load [-].
    cracks : float
        Depth of a crack, in parts of the section's [-].
    masses : float
        Of an added mass, in parts of the structure's [-].
    """

    connections: float = 0.3
    members: float = 0.1
    cracks: float = 0.25
    masses: float = 0.02

    def softness(self, surroundings: float) -> float:
        """Return the stiffness of a connection that is rigid in the model, by that of its surroundings."""
        return surroundings * (1 - self.connections) / self.connections


class Yardstick(Protocol):
    """Sizes of a structure by which an effect judges whether its values are plausible."""

    @property
    def most_mass(self) -> float:
        """Mass whose weight no member carries [kg]; infinite where it is not known."""
        ...

    @property
    def size(self) -> float:
        """Largest extent [m]."""
        ...

    def odd_stiffness(self, direction: str, stiffness: float) -> str:
        """Return in words why a stiffness in x … rz is absurd, or an empty string [N/m, N·m/rad]."""
        ...


@dataclass(frozen=True, slots=True)
class SectionTolerance:
    """How well the sections of some members are known, in standard deviations.

    Attributes
    ----------
    members : tuple of str
        All unless given.
    size : float or None
        Of each dimension of a shape, outer sizes and thicknesses of walls [m]; as usual for None.
    shares : mapping of str to float
        Of mass per length ``A``, bending ``Iy``, ``Iz``, torsion ``J`` and ``shear`` flexibility, relative
        [-]. What is stated here does not follow from ``size``.
    """

    members: tuple[str, ...] = ()
    size: float | None = None
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PriorBelief:
    """What is believed of missing effects, and of the form, before a test.

    Attributes
    ----------
    missing : float or None
        Probability that something is missing; as usual for None [-].
    weights : mapping of str to float
        How many times as probable as usual effects of a kind are, beside others at their place [-].
    form : mapping of str to mapping of str to (float, float)
        Mean and standard deviation of parameters of the form, by place (section, corner, joint, clamp) and
        name; as usual for others [unit of the parameter].
    """

    missing: float | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    form: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
