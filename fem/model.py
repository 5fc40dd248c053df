"""Models: a mesh and the effects on it, everything that enters K, M, C and D.

An effect is the extension point of Dovetail. The frame itself, a joint, a support, an added mass or a loss of
stiffness are effects, one file each in ``fem.effects``. Effects are additive and know nothing of one another.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from fem.declarations import (
    NO_INTERNAL,
    Contains,
    Entry,
    Environment,
    Internal,
    Marker,
    PriorBelief,
    Relevant,
    Role,
    SectionTolerance,
    Site,
    StiffnessAt,
    Yardstick,
)
from fem.ground import MovingGround
from fem.mesh import Mesh
from fem.summary import damping_summary, effect_summary, fields_summary, model_summary, span

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""The six degrees of freedom of a point, in their order."""

Array = NDArray[Any]
ParameterRef = tuple[str, str]
"""The name of an effect and the name of one of its parameters."""

Law = Callable[[Floats], tuple[Array, Array]]
"""A dependence on frequency: from ω (n,) [rad/s] to the real and imaginary factors of a stiffness, (n,)."""


class ModelError(ValueError):
    """A model that cannot be built; the message names the place."""


def refuse_negative(effect: str, **values: tuple[Any, str]) -> None:
    """Raise a ModelError for values, each with its unit, that are negative or no numbers."""
    for key, (value, unit) in values.items():
        if not np.real(value) >= 0:
            msg = f"'{effect}': its {key} is {np.real(value):g} {unit}; it cannot be negative"
            raise ModelError(msg)


def dofs_of(points: ArrayLike) -> Ints:
    """Return the DOF numbers of points: ``6 p + d``, shape (..., 6)."""
    return 6 * np.asarray(points, dtype=np.int64)[..., None] + np.arange(6)


_RECIPROCALS = {
    ("compliance", "m/N"): ("stiffness", "N/m"),
    ("compliance", "rad/(N·m)"): ("stiffness", "N·m/rad"),
}


def reciprocal_form(name: str, unit: str) -> tuple[str, str] | None:
    """Return name and unit of a spring's parameter as 1/value: a stiffness for a compliance, and back."""
    return (_RECIPROCALS | {form: key for key, form in _RECIPROCALS.items()}).get((name, unit))


def inverse(value: float) -> float:
    """Return 1/value, infinite for 0: a rigid connection has no compliance."""
    return 1 / value if value else float("inf")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    Attributes
    ----------
    name, unit : str
        Name, and SI unit (``"-"`` for none).
    value : float
        Present value.
    absent : float
        The value at which the effect is not there.
    lower, upper : float
        Bounds for estimation.
    log : bool
        True if it is estimated on a logarithmic scale (positive quantities).
    linear : bool
        True if K, M, C and D are affine functions of all the effect's linear parameters together while the
        others are fixed.
    position : bool
        True if it is an arc length along the effect's member, which says where the effect is.
    usual_change : float
        Change of a form's parameter from which it is unusual, whatever its prior [its unit].
    in_words : callable or None
        Gives a value in words of the field, where the number alone tells an engineer little.
    """

    name: str
    unit: str
    value: float
    absent: float
    lower: float
    upper: float
    log: bool = False
    linear: bool = False
    position: bool = False
    usual_change: float = float("inf")
    in_words: Callable[[float], str] | None = field(default=None, compare=False)

    @property
    def reciprocal(self) -> "Parameter | None":
        """The parameter as 1/value where an engineer may give that; None where it has no such form."""
        form, words = reciprocal_form(self.name, self.unit), self.in_words
        if form is None:
            return None
        return replace(
            self,
            name=form[0],
            unit=form[1],
            value=inverse(self.value),
            absent=inverse(self.absent),
            lower=inverse(self.upper),
            upper=inverse(self.lower),
            linear=False,
            in_words=None if words is None else lambda value: words(inverse(value)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Contribution:
    """Element matrices of one kind, in batches.

    Attributes
    ----------
    dofs : ndarray of int (b, m)
        Global DOF numbers of each of the b elements.
    K, M, C, D : ndarray (b, m, m) or None
        Stiffness, mass, viscous and structural damping; Z = K + iD + iωC - ω²M. Of elements that all have one
        symmetric matrix it may be broadcast (`numpy.broadcast_to`): it is then projected as one.
    law : Law or None
        Dependence on frequency: Z = (storage(ω) + i loss(ω)) K, with M, C and D None. Both are real functions
        of real parameters, so that the complex steps of derivatives pass through each.
    lines : ndarray of int (b,) or None
        Lines of the mesh that the elements are on, with their points' DOFs in order; None for others.
    xi : ndarray (b,) or None
        Fractions of their lines at which the masses of the elements are, where each is at one place.
    """

    dofs: Ints
    K: Array | None = None
    M: Array | None = None
    C: Array | None = None
    D: Array | None = None
    law: Law | None = field(default=None, kw_only=True)
    lines: Ints | None = field(default=None, kw_only=True)
    xi: Floats | None = field(default=None, kw_only=True)

    __repr__ = fields_summary

    def elements_at(self, dofs: Ints) -> "Iterator[Contribution]":
        """Yield those of the elements that have these DOFs (m,), each alone."""
        if self.dofs.shape[1] == dofs.size:
            for k in np.flatnonzero((self.dofs == dofs).all(axis=1)):
                yield self.element(int(k))

    def element(self, k: int) -> "Contribution":
        """Return one of the elements alone."""
        parts: dict[str, Any] = {X: None if (all_ := getattr(self, X)) is None else all_[[k]] for X in "KMCD"}
        return Contribution(self.dofs[[k]], **parts, law=self.law)

    @property
    def static(self) -> Array | None:
        """Stiffness at ω = 0, (b, m, m) or None."""
        if self.law is None or self.K is None:
            return self.K
        return self.law(np.zeros(1))[0][0] * self.K


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """One linear homogeneous equation between DOFs: Σ coefficients · u[dofs] = 0.

    Attributes
    ----------
    key : (str, str)
        Name of the effect that it belongs to and its direction there, such as ``("base", "ry")``.
    dofs : ndarray of int (m,)
        Global DOF numbers.
    coefficients : ndarray (m,)
        Coefficients [-] or lever arms [m].
    releasable : bool
        Whether another effect may replace it by a spring.
    everywhere : bool
        Whether it takes a motion away from all of the structure, as that out of the plane of a planar model:
        it is no support, and its force no reaction.
    location : ndarray (3,) or None
        Place at which its force acts, and to which rigid arms lead from its points [m].
    """

    key: tuple[str, str]
    dofs: Ints
    coefficients: Floats
    releasable: bool = True
    everywhere: bool = False
    location: Floats | None = None

    __repr__ = fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class Instruments:
    """Where a test measures and excites: points of the mesh and unit directions.

    Attributes
    ----------
    sensors : ndarray of int (n_out,)
        Point of each response.
    sensor_directions : ndarray (n_out, 3)
    drivers : ndarray of int (n_in,)
        Point of each force.
    driver_directions : ndarray (n_in, 3)
    """

    sensors: Ints
    sensor_directions: Floats
    drivers: Ints
    driver_directions: Floats


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Effect(ABC):
    """A physical effect: frozen data, named parameters, additive contributions.

    Subclasses are frozen dataclasses. A parameter is a field of the same name, unless the subclass
    overrides :meth:`with_values`.

    Attributes
    ----------
    name : str
        Unique within a model.
    reciprocal : bool
        Whether K, M, C and D are symmetric, so that forces and responses may change places.
    amplitude_dependent : bool
        Whether its matrices are those of one amplitude of vibration.
    connection : bool
        Whether its stiffness is that of a connection, such as a joint, a mount or a support, and may be
        damped otherwise than the members'.
    role : Role
        Which part of a model it belongs to.
    within_members : bool
        Whether its elements are those of lines of the mesh, so that it does not hold the structure.
    gives_way : bool
        Whether it depends on other effects of an element (:meth:`refers_to`): is a flexibility in series with
        what they alter (:meth:`alters`), changes a part of it in proportion, or acts at a place within an
        element where others give way.
    reduced_part : bool
        Whether it is a part given by matrices, of whose mass and inner forces nothing else is known.
    marker : Marker or None
        How pictures mark it; the drawing chooses where it is None.
    is_form : bool
        Whether it is the size of connections, which centre lines leave out: uncertain in every model.
    is_marked : bool
        Whether pictures mark its places; not what is known of whole members only roughly.
    separable : bool
        Whether its matrices are a sum of functions of one parameter each, positive ones, that are 0 at their
        nominal values.
    environment : Environment or None
        Situation of a structure without which it does not exist; None if it may be anywhere.
    contains : mapping of str to callable
        Kinds of effect that it is the same as, at their place, where its further parameters are absent; each
        with a function of the effect that returns the values at which that kind does most of the same.
    statement : str
        Sentence of a finding: a format string with the fields of `dovetail.report.words.sentence`.
    entry : Entry or None
        Its row in the documentation; of kinds that a search proposes.
    """

    kind: ClassVar[str]
    role: ClassVar[Role]
    reciprocal: ClassVar[bool] = True
    amplitude_dependent: ClassVar[bool] = False
    connection: ClassVar[bool] = False
    within_members: ClassVar[bool] = False
    reduced_part: ClassVar[bool] = False
    marker: ClassVar[Marker | None] = None
    gives_way: ClassVar[bool] = False
    statement: ClassVar[str] = ""
    is_form: ClassVar[bool] = False
    is_marked: ClassVar[bool] = True
    separable: ClassVar[bool] = False
    environment: ClassVar[Environment | None] = None
    contains: ClassVar[Contains] = {}
    entry: ClassVar[Entry | None] = None
    name: str

    def __init_subclass__(cls) -> None:
        if "__repr__" not in cls.__dict__:  # otherwise a dataclass would print all of its arrays
            cls.__repr__ = effect_summary

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters that may be estimated, with their present values."""

    @property
    @abstractmethod
    def where(self) -> Site:
        """Where on the structure it is, in words that know their parts."""

    @property
    def internal(self) -> Internal:
        """Coordinates in addition to the points' (modes of a reduced part, for example)."""
        return NO_INTERNAL

    def with_values(self, **values: Any) -> Self:
        """Return a copy with other parameter values; complex values are carried for derivatives."""
        return replace(self, **values)

    def contribute(self, model: "Model") -> Iterable[Contribution]:
        """Return its contributions to K, M, C and D, or yield them in parts that need little memory.

        It must accept complex parameter values, for complex-step derivatives.
        """
        return ()

    def constraints(self, model: "Model") -> tuple[Constraint, ...]:
        """Return the linear constraints that it imposes."""
        return ()

    def tabulated(self, model: "Model") -> Any:
        """Return tables of its matrices (:class:`fem.tabulated.TabulatedEffect`), None unless it has some."""
        return None

    def released(self) -> tuple[tuple[str, str], ...]:
        """Return the keys of other effects' constraints that it replaces by springs."""
        return ()

    def replaces(self) -> tuple[ParameterRef, ...]:
        """Return the parameters of other effects that this one stands for.

        They stay fixed while this one is estimated.
        """
        return ()

    def refers_to(self, model: "Model") -> tuple[ParameterRef, ...]:
        """Return the parameters of other effects on which its matrices depend.

        A crack takes its element's stiffness in part, an eccentric joint moves the joint's springs: when
        these change, so does the effect's contribution.
        """
        return ()

    @classmethod
    def propose(cls, model: "Model") -> tuple["Effect", ...]:
        """Return candidates of this kind for a model, each at a value from which an estimation may start.

        Kinds that belong to instruments (masses of sensors, stingers) look at ``model.instruments``.
        """
        return ()

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return a grid of parameter values, one mapping for each point.

        An estimation starts at the best of them.

        Parameters
        ----------
        scale : callable
            Gives the stiffness that the rest of the structure opposes to a unit violation of a constraint,
            by its key [N/m, N·m/rad].
        """
        return (parameter_values(self),)

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the value of the first parameter that a user calls relevant; None where none is stated.

        Parameters
        ----------
        sizes : Relevant
        mass : float
            Of the structure [kg].
        scale : callable
            As of :meth:`starts`.
        """
        return None

    def rebased(self, model: "Model") -> Self:
        """Return the same effect for a model that states the values of this one as its nominal ones.

        Parameters relative to a nominal value are then relative to another.
        """
        return self

    def locations(self, model: "Model") -> Floats:
        """Return points to mark in a picture, shape (n, 3) [m]."""
        return np.empty((0, 3))

    def added_to(self, model: "Model") -> "Model":
        """Return a model with it; an effect that stands for values of others changes these, too."""
        return model.with_effect(self)

    def alters(self, model: "Model", member: str, line: int | None = None) -> bool:
        """Whether it changes elements of a member, or that on one of its lines.

        What gives way at a member's end or within it is in series with such changes
        (`fem.effects.giving_way`).
        """
        return False

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield parameters or fields whose values are implausible, each with a sentence that says why."""
        yield from ()


class FollowsOthers(Effect):
    """An effect whose derivatives by other effects' parameters cost less than its matrices."""

    __slots__ = ()

    @abstractmethod
    def steps_by_others(
        self, model: "Model", stepped: "Mapping[ParameterRef, Model]"
    ) -> "list[tuple[Contribution, ...]]":
        """Return its contributions in models that differ by a complex step of a parameter of another effect.

        Only their imaginary parts count.

        Parameters
        ----------
        model : Model
            Without a step.
        stepped : mapping of (effect, parameter) to Model
        """


def parameter_values(effect: Effect) -> dict[str, float]:
    """Return the present values of an effect's parameters by name."""
    return {p.name: p.value for p in effect.parameters()}


def covers(effect: Effect, other: Effect) -> bool:
    """Whether an effect does the same as another one at its place, and more (:attr:`Effect.contains`)."""
    free = {"name", *parameter_values(effect), *parameter_values(other)}
    both = {f.name for f in fields(effect)} & {f.name for f in fields(other)} - free
    return other.kind in effect.contains and all(getattr(effect, k) == getattr(other, k) for k in both)


@dataclass(frozen=True, slots=True, eq=False)
class Damping:
    """Damping of the structure; local dampers are effects.

    Attributes
    ----------
    frequency : ndarray (n,)
        Frequencies at which the modal damping ratio is given [Hz]; linear in between, constant outside.
    ratio : ndarray (n,)
        Modal damping ratio ζ [-].
    powers : bool
        Whether the ratio is a power of frequency between these, rather than linear in it.
    alpha, beta : float
        Rayleigh damping C = alpha M + beta K [1/s, s].
    loss_factor : float
        Structural damping D = loss_factor · K [-].
    """

    frequency: Floats = field(default_factory=lambda: np.zeros(1))
    ratio: Floats = field(default_factory=lambda: np.zeros(1))
    alpha: float = 0.0
    beta: float = 0.0
    loss_factor: float = 0.0
    powers: bool = False

    __repr__ = damping_summary

    def __post_init__(self) -> None:
        for key in ("ratio", "alpha", "beta", "loss_factor"):
            value = np.real(getattr(self, key))
            if not (np.isfinite(value) & (value >= 0)).all():
                msg = f"the damping's {key} is {getattr(self, key)}; it cannot be negative"
                raise ModelError(msg)

    @classmethod
    def modal(
        cls, ratio: ArrayLike, frequency: ArrayLike | None = None, *, powers: bool = False
    ) -> "Damping":
        """Modal damping: one ratio, or ratios at frequencies [Hz].

        Raises
        ------
        ModelError
            For ratios outside 0 to 1, or frequencies that do not fit them or do not increase.
        """
        ratio = np.array(ratio, dtype=float, ndmin=1)
        frequency = np.zeros(1) if frequency is None else np.array(frequency, dtype=float, ndmin=1)
        if ratio.shape != frequency.shape or ratio.ndim != 1 or (np.diff(frequency) <= 0).any():
            msg = (
                f"{ratio.size} damping ratios need {ratio.size} increasing frequencies, found "
                f"{frequency.size}"
            )
            raise ModelError(msg)
        if not ((ratio >= 0) & (ratio < 1)).all():
            msg = (
                f"the damping ratios are {span(ratio)}, and lie between 0 and 1; if they are in per cent, "
                "divide them by 100 (1 % is 0.01)"
            )
            raise ModelError(msg)
        if powers and not ((ratio > 0).all() and (frequency > 0).all()):
            msg = "damping ratios that are powers of frequency are given above 0, at frequencies above 0 Hz"
            raise ModelError(msg)
        return cls(frequency, ratio, powers=powers)

    @classmethod
    def rayleigh(cls, alpha: float, beta: float) -> "Damping":
        """Rayleigh damping C = alpha M + beta K [1/s, s]."""
        return cls(alpha=alpha, beta=beta)

    @classmethod
    def structural(cls, loss_factor: float) -> "Damping":
        """Structural damping D = loss_factor K [-]."""
        return cls(loss_factor=loss_factor)

    def without_modal(self) -> "Damping":
        """Return the damping without modal ratios."""
        return replace(self, frequency=np.zeros(1), ratio=np.zeros(1), powers=False)

    def ratio_at(self, frequency: ArrayLike) -> Floats:
        """Return the modal damping ratio at frequencies [Hz]."""
        f = np.asarray(frequency, dtype=float)
        if not self.powers:
            return np.interp(f, self.frequency, self.ratio)
        return power_between(f, self.frequency, self.ratio)


def power_between(f: Floats, frequency: Floats, value: Floats) -> Floats:
    """Return positive values as powers of frequency between those where they are given, constant outside."""
    at = np.log(np.maximum(f, 1e-9 * frequency[0]))
    return np.exp(np.interp(at, np.log(frequency), np.log(value)))


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A mesh and everything on it.

    Attributes
    ----------
    mesh : Mesh
        Points, lines, members.
    effects : tuple of Effect
        Frame, supports, joints, masses, …
    damping : Damping
        Damping of the structure.
    environment : frozenset of Environment
        Situation of the structure, as far as it is stated: which effects it may lack.
    tolerances : tuple of SectionTolerance
        How well sections are known; of two for one member the last counts.
    belief : PriorBelief
        How probable it is that something is missing, before any test.
    instruments : Instruments or None
        Sensors and drivers of a test, by which kinds of effect that belong to these are proposed.
    ground : MovingGround or None
        What supports and springs to the ground rest on, if it moves.
    """

    mesh: Mesh
    effects: tuple[Effect, ...]
    damping: Damping = field(default_factory=Damping)
    environment: frozenset[Environment] = frozenset()
    tolerances: tuple[SectionTolerance, ...] = ()
    belief: PriorBelief = field(default_factory=PriorBelief)
    instruments: Instruments | None = field(default=None, repr=False)
    ground: MovingGround | None = field(default=None, init=False, repr=False)

    __repr__ = model_summary

    def __post_init__(self) -> None:
        seen: set[str] = set()
        for effect in self.effects:
            if effect.name in seen:
                msg = f"two effects have the name '{effect.name}'; names must differ"
                raise ModelError(msg)
            seen.add(effect.name)
        object.__setattr__(self, "ground", MovingGround.of(self))

    @property
    def n_dof(self) -> int:
        """Number of DOFs before constraints: 6 for each point, then the effects' internal coordinates."""
        return 6 * self.mesh.n_points + sum(e.internal.n for e in self.effects)

    def internal_dofs(self, name: str) -> Ints:
        """Return the DOF numbers of an effect's internal coordinates, shape (n_internal,).

        Raises
        ------
        ModelError
            If there is no such effect.
        """
        effect, start = self.effect(name), 6 * self.mesh.n_points
        start += sum(e.internal.n for e in self.effects[: self.effects.index(effect)])
        return np.arange(start, start + effect.internal.n)

    def effect(self, name: str) -> Effect:
        """Return the effect with a name.

        Raises
        ------
        ModelError
            If there is none.
        """
        for effect in self.effects:
            if effect.name == name:
                return effect
        msg = f"the model has no effect '{name}'; it has {', '.join(e.name for e in self.effects)}"
        raise ModelError(msg)

    def of_kind(self, kind: type[Effect]) -> tuple[Any, ...]:
        """Return the effects of a class."""
        return tuple(e for e in self.effects if isinstance(e, kind))

    def with_effect(self, *effects: Effect) -> "Model":
        """Return a model with more effects."""
        return replace(self, effects=(*self.effects, *effects))

    def without_effect(self, *names: str) -> "Model":
        """Return a model without some effects."""
        for name in names:
            self.effect(name)
        return replace(self, effects=tuple(e for e in self.effects if e.name not in names))

    def with_damping(self, damping: Damping) -> "Model":
        """Return a model with other damping."""
        return replace(self, damping=damping)

    def in_environment(self, *more: Environment) -> "Model":
        """Return a model that states more of its situation."""
        return replace(self, environment=self.environment.union(more))

    def with_tolerances(self, *tolerances: SectionTolerance) -> "Model":
        """Return a model whose sections are known so well."""
        return replace(self, tolerances=(*self.tolerances, *tolerances))

    def tolerances_of(self, member: str) -> tuple[SectionTolerance, ...]:
        """Return how well the section of a member is known; what comes later counts."""
        return tuple(t for t in self.tolerances if not t.members or member in t.members)

    def with_belief(self, belief: PriorBelief) -> "Model":
        """Return a model in which missing effects are believed to be so probable."""
        return replace(self, belief=belief)

    def with_instruments(self, instruments: Instruments) -> "Model":
        """Return a model on which a test has sensors and drivers."""
        return replace(self, instruments=instruments)

    def with_mesh(self, mesh: Mesh) -> "Model":
        """Return a model on another mesh of the same points and members, a refined one for example."""
        return replace(self, mesh=mesh)

    def values(self) -> dict[ParameterRef, float]:
        """Return the present value of every parameter of every effect."""
        return {(e.name, p.name): p.value for e in self.effects for p in e.parameters()}

    def with_values(self, values: Mapping[ParameterRef, Any]) -> "Model":
        """Return a model with other parameter values, named by effect and parameter.

        Raises
        ------
        ModelError
            If an effect or a parameter is unknown.
        """
        by_effect: dict[str, dict[str, Any]] = {}
        for (name, parameter), value in values.items():
            known = [p.name for p in self.effect(name).parameters()]
            if parameter not in known:
                msg = f"effect '{name}' has no parameter '{parameter}'; it has {', '.join(known) or 'none'}"
                raise ModelError(msg)
            by_effect.setdefault(name, {})[parameter] = value
        return replace(
            self,
            effects=tuple(
                e.with_values(**by_effect[e.name]) if e.name in by_effect else e for e in self.effects
            ),
        )

    def contributions(self) -> tuple[Contribution, ...]:
        """Return the contributions of all effects."""
        return tuple(c for effect in self.effects for c in self.parts_of(effect))

    def parts_of(self, effect: Effect) -> tuple[Contribution, ...]:
        """Return the contributions of an effect; those that the ground holds are relative to its motion."""
        return self.resisted(effect.contribute(self))

    def resisted(self, contributions: Iterable[Contribution]) -> tuple[Contribution, ...]:
        """Return contributions, those that the ground holds relative to its motion."""
        ground = self.ground
        return tuple(c if ground is None else ground.resisted(c) for c in contributions)

    def batches(self) -> Iterator[Contribution]:
        """Return the contributions of all effects in parts that need little memory at a time."""
        for effect in self.effects:
            for part in effect.contribute(self):
                yield part if self.ground is None else self.ground.resisted(part)

    def constraints(self) -> tuple[Constraint, ...]:
        """Return the constraints of all effects, without those that an effect has released."""
        released = {key for effect in self.effects for key in effect.released()}
        active = (c for e in self.effects for c in e.constraints(self) if c.key not in released)
        ground = self.ground
        return tuple(active) if ground is None else tuple(ground.constrained(c) for c in active)


def applicable(effects: Iterable[Effect], model: Model) -> tuple[Effect, ...]:
    """Return the effects that a model has room for: it has all constraints that they would release.

    Constraints that another effect has released do not count.
    """
    keys = {c.key for c in model.constraints()}
    return tuple(e for e in effects if keys.issuperset(e.released()))


_UNIT_SKEW = np.cross(np.eye(3), np.eye(3)[:, None])


def skew(v: ArrayLike) -> Floats:
    """Return matrices of the cross product, S(v) w = v × w, shape (…, 3, 3), for vectors (…, 3)."""
    return np.tensordot(np.asarray(v, dtype=float), _UNIT_SKEW, 1)


def lever_matrix(arm: ArrayLike) -> Floats:
    """Return the rigid-body maps from a point's six DOFs to places at lever arms (…, 3), shape (…, 6, 6).

    u' = u + θ × arm, θ' = θ; arm [m].
    """
    T = np.tile(np.eye(6), (*np.shape(arm)[:-1], 1, 1))
    T[..., :3, 3:] = -skew(arm)
    return T
