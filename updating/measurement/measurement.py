"""Measurements: FRFs with the sensors and excitations that they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF, FRFKind, References
from fem.array_types import Floats, Ints
from fem.effects.added_mass import AddedMass
from fem.effects.moving_base import MovingBase, base_moved
from fem.mesh import Mesh
from fem.model import Instruments, Model, ModelError, dofs_of, lever_matrix
from fem.summary import counted, span, summary
from updating.measurement.channel_errors import (
    DIRECTION,
    GAIN,
    N_ERRORS,
    POSITION,
    USUAL,
    ChannelErrors,
)
from updating.measurement.noise import noise_from_coherence

MOTION, STRAIN = "motion", "strain"
"""Quantities that a channel may read."""


LEAST_LINES = 10
"""Data of fewer lines are not compared: blocks of them are held out and compared with one another."""


class MeasurementError(ValueError):
    """Measured data that do not fit the sensors, the units or one another."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """A translational sensor or exciter at a place on the structure.

    Another kind of channel is a subclass in a file of its own, with a ``row`` and a ``quantity``.

    Attributes
    ----------
    name : str
        Label in the FRFs, such as ``"U1z"``.
    point : ndarray (3,)
        Coordinates [m].
    direction : ndarray (3,)
        Unit vector of its positive reading, the sign included.
    member : str or None
        Member that it sits on; None for the nearest.
    gain : float
        Its reading over the true value [-].
    mass : float
        Mass that it adds to the structure, which :func:`with_sensor_masses` puts into a model [kg]. Of a
        triaxial sensor one channel has it.
    relative : bool
        Whether its reading is relative to a base that moves, as that of a sensor which the base carries.
    body : str
        Name of the sprung mass that carries it: its reading is the motion of that mass's centre, and its
        point is where the mass is attached. Empty on the structure itself.
    arm : ndarray (3,)
        From its point to where it is, beside the axis: a rigid arm connects the two [m].
    roving : bool
        Whether it was moved from place to place: its mass is on the structure only while it reads.
    """

    name: str
    point: Floats
    direction: Floats
    member: str | None = None
    gain: float = 1.0
    mass: float = 0.0
    relative: bool = False
    body: str = ""
    arm: Floats = field(default_factory=lambda: np.zeros(3))
    roving: bool = False

    quantity: ClassVar[str] = MOTION
    """Readings of a motion have the time derivatives of the FRFs' kind; others have none."""
    directed: ClassVar[bool] = True
    """Whether it reads the motion of its point along ``direction``, and by its build some of that across."""
    signal_unit: ClassVar[str] = "N"
    """Unit of what an excitation of this kind does in time."""
    per_acceleration: ClassVar[str] = ""
    """Whose unit acceleration FRFs to an excitation of this kind are for, in a word; none for unit force."""
    moves_base: ClassVar[bool] = False
    """Whether an excitation of this kind moves the base along ``direction``."""

    def reference_sensor(self) -> "Sensor | None":
        """Return the sensor whose acceleration FRFs to this excitation refer to; None where it is known.

        Such FRFs have the zeros of that sensor's FRF for poles, in place of the structure's poles.
        """
        return None

    def as_force(self) -> "Sensor":
        """Return the excitation with FRFs per unit force, where it is a force of unknown size."""
        return self

    def row(self, model: Model) -> Floats:
        """Return the reading, or the force of an exciter, as a combination of DOFs, shape (n_dof,).

        Raises
        ------
        MeasurementError
            As :func:`sensor_rows`.
        """
        row, ground = np.zeros(model.n_dof), model.ground
        dofs, motion = _motion_at(model, self)
        row[dofs] = self.gain * (np.asarray(self.direction) @ motion)
        if self.relative and ground is not None:
            row[ground.dofs] = -self.gain * (ground.directions @ np.asarray(self.direction))
        return row

    @property
    def axes_across(self) -> Floats:
        """Two unit vectors (2, 3) across the direction; the three are right-handed."""
        d = np.asarray(self.direction, dtype=float)
        t = np.linalg.svd([d])[2][1]
        return np.array([t, np.cross(d, t)])

    def misread(self, model: Model) -> Floats:
        """Return the change of the reading for a unit of each error of :class:`ChannelErrors`, (n_dof, 5).

        Turned towards t it reads θ t·u besides, to first order; shifted by s, d·(φ × s), as sections stay
        plane. One that does not read the motion of a point has an error of its gain alone.

        Raises
        ------
        MeasurementError
            As :func:`sensor_rows`.
        """
        out = np.zeros((model.n_dof, N_ERRORS))
        out[:, GAIN] = self.row(model)[:, None]
        if not self.directed:
            return out
        axes = self.axes_across
        out[:, DIRECTION] = np.stack([replace(self, direction=t).row(model) for t in axes], axis=1)
        if not self.body:  # the motion of a body is that of its centre
            turns = dofs_of(sensor_point(model.mesh, self))[3:]
            out[turns, POSITION] = self.gain * np.cross(axes, self.direction).T
        return out

    def placed(self, mesh: Mesh, tolerance: float) -> Mesh:
        """Return a mesh with the points that the reading needs: one at the sensor.

        Raises
        ------
        MeasurementError
            If it is farther from its member, or the nearest one, than the tolerance [m].
        """
        _, distance = mesh.nearest_point(self.point)
        if distance <= 1e-6 * mesh.size:
            return mesh
        if not mesh.members:
            msg = f"sensor '{self.name}' at {np.asarray(self.point).tolist()} m is at no point of a part"
            raise MeasurementError(msg)
        member, position, distance = mesh.nearest_on_members(self.point)
        self._refuse_distant(member, distance, tolerance)
        return mesh.with_point_on(member, position)

    def on_member(self, mesh: Mesh, tolerance: float) -> tuple[str, float]:
        """Return the member that it sits on, and its arc length there [m].

        Raises
        ------
        MeasurementError
            If it is farther from that member than the tolerance [m].
        """
        if self.member is None:
            member, position, distance = mesh.nearest_on_members(self.point)
        else:
            (member,) = mesh.members_of(self.member)
            chain, s = mesh.points[mesh.member_points(member)], mesh.member_positions(member)
            t = np.diff(chain, axis=0)
            xi = np.clip(((self.point - chain[:-1]) * t).sum(axis=1) / (t**2).sum(axis=1), 0.0, 1.0)
            away = np.linalg.norm(chain[:-1] + xi[:, None] * t - self.point, axis=1)
            k = int(np.argmin(away))
            position, distance = float(s[k] + xi[k] * (s[k + 1] - s[k])), float(away[k])
        self._refuse_distant(member, distance, tolerance)
        return member, position

    def _refuse_distant(self, member: str, distance: float, tolerance: float) -> None:
        """Raise a MeasurementError for a sensor that is too far from a member."""
        if distance > tolerance:
            of = "nearest member" if self.member is None else "member"
            msg = (
                f"sensor '{self.name}' at {np.asarray(self.point).tolist()} m is {distance:.3g} m from the "
                f"{of} '{member}'; at most {tolerance:.3g} m is allowed"
            )
            raise MeasurementError(msg)


@dataclass(frozen=True, slots=True, eq=False)
class Combination(Sensor):
    """A reading, or a force, as a combination of the DOFs of the mesh's points.

    Attributes
    ----------
    factors : ndarray (6 n_points,)
    """

    factors: Floats = field(default_factory=lambda: np.zeros(0))

    directed: ClassVar[bool] = False

    def row(self, model: Model) -> Floats:
        """Return the factors, 0 for DOFs that are not of the mesh's points, shape (n_dof,)."""
        row = np.zeros(model.n_dof)
        row[: len(self.factors)] = self.gain * self.factors
        return row


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Measured FRFs with their sensors and excitations.

    Attributes
    ----------
    frf : FRF
        Its ``outputs`` are the names of ``sensors`` and its ``inputs`` those of ``excitations``, in order.
    sensors, excitations : tuple of Sensor
        Where the rows and columns of the FRFs are on the structure.
    force_level : float or None
        Amplitude of the exciting force, to tell levels apart [N].
    name : str
        File or label for reports.
    coherence : ndarray (n_freq, n_out, n_in) or None
        γ² of each value of the FRFs, 0 to 1; NaN where it was not measured [-].
    averages : int or None
        Independent averages behind the FRFs and their coherence.
    scatter : ndarray (n_freq, n_out, n_in) or None
        Relative standard deviation of the FRFs in each part, where it is known otherwise: from repeats
        (:func:`updating.measurement.noise.noise_from_repeats`) for example; NaN where it is not [-].
    compared : ndarray (n_freq, n_out, n_in) or None
        1 for values that count in a comparison and 0 for others, as an earlier one has chosen; NaN for those
        of which it has said nothing.
    pieces : int
        Into how many each element is cut that is compared with them; 0 where the data decide.
    phase : bool
        Whether the FRFs have phases; without, they are amplitudes.
    viscous : bool
        Whether fits begin with viscous modal damping between resonances, as an earlier one has chosen, rather
        than with that of a loss factor.
    held_out : tuple of (float, float)
        Bands that no fit sees, ends included; without any, fits leave every fourth block of lines out [Hz].
    errors : ChannelErrors
        How far sensors and excitations may be from what they are said to be.
    other_sensors, other_excitations : tuple of Sensor
        Those of the test that are not in these FRFs.
    """

    frf: FRF
    sensors: tuple[Sensor, ...]
    excitations: tuple[Sensor, ...]
    force_level: float | None = None
    name: str = "measured"
    coherence: Floats | None = None
    averages: int | None = None
    scatter: Floats | None = None
    compared: Floats | None = None
    pieces: int = 0
    phase: bool = True
    viscous: bool = False
    held_out: tuple[tuple[float, float], ...] = ()
    errors: ChannelErrors = USUAL
    other_sensors: tuple[Sensor, ...] = ()
    other_excitations: tuple[Sensor, ...] = ()

    def __repr__(self) -> str:
        """Return the file, the FRFs and their noise, as far as it is known, on one line."""
        frf, name = self.frf, f"'{self.name}' " if self.name else ""
        known = [w for w in ("coherence", "scatter") if getattr(self, w) is not None]
        noise = f"; with {' and '.join(known)}" if known else ""
        lines = f"{counted(frf.n_freq, 'line')}, {span(frf.frequency, 'Hz')}"
        ends = f"{counted(len(self.sensors), 'sensor')}, {counted(len(self.excitations), 'excitation')}"
        return summary(self, f"{name}{frf.quantity} [{frf.unit}]: {ends}, {lines}{noise}")

    def __post_init__(self) -> None:
        known = {"coherence": self.coherence, "scatter": self.scatter, "choice of values": self.compared}
        for word, values in known.items():
            if values is not None and np.shape(values) != self.frf.H.shape:
                msg = (
                    f"the {word} of '{self.name}' has shape {np.shape(values)}, its FRFs {self.frf.H.shape}; "
                    "they must agree"
                )
                raise MeasurementError(msg)
        if self.scatter is not None and (self.scatter < 0).any():
            low = np.nanmin(self.scatter)
            msg = f"the scatter of '{self.name}' is as low as {low:.3g}; a standard deviation is at least 0"
            raise MeasurementError(msg)
        if self.averages is not None and self.averages < 1:
            msg = f"'{self.name}' has {self.averages} averages; at least 1 is needed"
            raise MeasurementError(msg)
        if self.coherence is not None and ((self.coherence < 0) | (self.coherence > 1)).any():
            low, high = np.nanmin(self.coherence), np.nanmax(self.coherence)
            msg = f"the coherence of '{self.name}' runs from {low:.3g} to {high:.3g}; 0 to 1 is allowed"
            raise MeasurementError(msg)
        strains = tuple(s.name for s in self.sensors if s.quantity == STRAIN)
        if set(strains) != set(self.frf.strain):
            msg = (
                f"the FRFs of '{self.name}' have the strains {', '.join(self.frf.strain) or 'none'}, the "
                f"strain gauges are {', '.join(strains) or 'none'}; they must agree: FRF.from_arrays(…, "
                "strain=…)"
            )
            raise MeasurementError(msg)
        for word, have, want in (
            ("responses", self.frf.outputs, self.sensors),
            ("forces", self.frf.inputs, self.excitations),
        ):
            if have != tuple(s.name for s in want):
                msg = (
                    f"the FRF's {word} are {', '.join(have)}, the sensors' names "
                    f"{', '.join(s.name for s in want)}"
                )
                raise MeasurementError(msg)

    def with_frf(self, frf: FRF) -> "Measurement":
        """Return a measurement with other data of the same or fewer sensors, excitations and lines.

        Estimates of the noise follow; at lines that were not measured they are unknown.
        """
        by_out = {s.name: s for s in self.sensors}
        by_in = {s.name: s for s in self.excitations}
        return replace(
            self,
            frf=frf,
            sensors=tuple(by_out[n] for n in frf.outputs),
            excitations=tuple(by_in[n] for n in frf.inputs),
            other_sensors=(*self.other_sensors, *(s for n, s in by_out.items() if n not in frf.outputs)),
            other_excitations=(
                *self.other_excitations,
                *(s for n, s in by_in.items() if n not in frf.inputs),
            ),
            coherence=None if self.coherence is None else at_values_of(self.coherence, self.frf, frf),
            scatter=None if self.scatter is None else at_values_of(self.scatter, self.frf, frf),
            compared=None if self.compared is None else at_values_of(self.compared, self.frf, frf),
        )

    @property
    def moving_forces(self) -> bool:
        """Whether forces are at more places than responses, as those of a roving hammer."""
        return len(self.excitations) > len(self.sensors)

    @property
    def has_transpose(self) -> bool:
        """Whether forces and responses may be exchanged by reciprocity: all are of motions of points."""
        channels = (*self.sensors, *self.excitations)
        return not any(
            c.per_acceleration or c.quantity != MOTION or (c.roving and c.mass > 0) for c in channels
        )

    @property
    def has_structure_poles(self) -> bool:
        """Whether the FRFs have the poles of the structure, so that its modes can be identified in them."""
        return all(e.reference_sensor() is None for e in self.excitations)

    @property
    def roving_masses(self) -> tuple[tuple[Ints, Sensor, float], ...]:
        """Masses of roving sensors, as of :func:`roving_masses`."""
        return roving_masses(self.sensors)

    def transposed(self) -> "Measurement":
        """Return the same with forces at the sensors and sensors where forces were (Maxwell: Hᵀ = H)."""
        frf, errors = self.frf, self.errors
        turned = FRF.from_arrays(frf.frequency, np.swapaxes(frf.H, 1, 2), frf.kind, frf.inputs, frf.outputs)
        known = {key: getattr(self, key) for key in ("coherence", "scatter", "compared")}
        arrays = {key: None if x is None else np.swapaxes(x, 1, 2) for key, x in known.items()}
        return replace(
            self,
            frf=turned,
            sensors=self.excitations,
            excitations=self.sensors,
            other_sensors=self.other_excitations,
            other_excitations=self.other_sensors,
            errors=replace(errors, sensors=errors.excitations, excitations=errors.sensors),
            **arrays,
        )

    @property
    def channel_errors(self) -> Floats:
        """Known errors of sensors and excitations behind them, (n_sensors + n_excitations, 5)."""
        none = (0.0,) * N_ERRORS
        known = [self.errors.sensors.get(s.name, none) for s in self.sensors]
        known += [self.errors.excitations.get(e.name, none) for e in self.excitations]
        return np.array(known)

    def with_channel_errors(self, errors: Floats) -> "Measurement":
        """Return a measurement whose channels have known errors, as :attr:`channel_errors` gives them."""
        n = len(self.sensors)
        groups = ((self.sensors, errors[:n]), (self.excitations, errors[n:]))
        sensors, excitations = (
            {c.name: tuple(row) for c, row in zip(channels, rows.tolist(), strict=False) if any(row)}
            for channels, rows in groups
        )
        return replace(self, errors=replace(self.errors, sensors=sensors, excitations=excitations))

    @property
    def noise(self) -> Floats | None:
        """Estimated relative noise of ln|H|, (n_freq, n_out, n_in); None without an estimate [-].

        From ``scatter``, or else from coherence and averages; NaN for values of which nothing is known.
        """
        if self.scatter is not None:
            return self.scatter
        if self.coherence is None or self.averages is None:
            return None
        known = np.isfinite(self.coherence)
        noise = noise_from_coherence(np.where(known, self.coherence, 1.0), self.averages)
        return np.where(known, noise, np.nan)

    @property
    def noise_source(self) -> str:
        """Where the noise is known from, in words."""
        if self.scatter is not None:
            return "the scatter of repeats"
        if self.coherence is not None and self.averages is not None:
            return f"the coherence over {self.averages} averages"
        return "the scatter between neighbouring lines"


def usable_lines(measurement: Measurement, band: tuple[float, float] | None) -> FRF:
    """Return the FRFs of a measurement in a band [Hz].

    Raises
    ------
    MeasurementError
        If there are fewer than ``LEAST_LINES`` lines above 0 Hz.
    """
    frf = measurement.frf.select(band=band) if band else measurement.frf
    n_usable = int((frf.frequency > 0).sum())
    if n_usable < LEAST_LINES:
        msg = (
            f"'{measurement.name}' has {n_usable} line(s) above 0 Hz in the band; at least {LEAST_LINES} are "
            "needed to compare a model with it"
        )
        raise MeasurementError(msg)
    return frf


def at_values_of(values: Floats, have: FRF, want: FRF) -> Floats:
    """Return an array of some FRFs' values at the values of others, NaN where there is none.

    Parameters
    ----------
    values : ndarray (n_freq, n_out, n_in)
        Of ``have``.
    have, want : FRF
        The second has channels of the first.
    """
    line = np.clip(np.searchsorted(have.frequency, want.frequency), 0, have.n_freq - 1)
    same = have.frequency[line] == want.frequency
    rows, columns = (
        [getattr(have, key).index(name) for name in getattr(want, key)] for key in ("outputs", "inputs")
    )
    out = values[line][:, rows][:, :, columns]
    return np.where(same[:, None, None], out, np.nan)


def place_sensors(mesh: Mesh, sensors: tuple[Sensor, ...], tolerance: float | None = None) -> Mesh:
    """Return a mesh with a point at every sensor, by splitting lines; existing points keep their indices.

    Parameters
    ----------
    mesh : Mesh
    sensors : tuple of Sensor
    tolerance : float, optional
        Largest distance of a sensor from the member's axis [m]; 2 % of the mesh's size unless given.

    Raises
    ------
    MeasurementError
        If a sensor is farther from every member.
    """
    tolerance = 0.02 * mesh.size if tolerance is None else tolerance
    for sensor in sensors:
        mesh = sensor.placed(mesh, tolerance)
    return mesh


def with_sensor_masses(model: Model, sensors: Sequence[Sensor]) -> Model:
    """Return a model with the masses of sensors, as point masses where they sit.

    A sensor is known by its name: one that also measures where a force acts, or whose mass the model has
    already, is added once. That of a roving one is left out (:func:`roving_masses`).

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor.
    sensors : sequence of Sensor

    Raises
    ------
    MeasurementError
        If a mass is negative or not finite, or the mesh has no point where the sensor sits.
    """
    known = {e.name for e in model.effects}
    masses: dict[str, AddedMass] = {}
    for s in sensors:
        name = f"mass of sensor {s.name}"
        if s.body and s.mass:
            msg = (
                f"sensor '{s.name}' has the mass {s.mass} kg on the sprung mass '{s.body}'; add it to that "
                "mass"
            )
            raise MeasurementError(msg)
        if not (np.isfinite(s.mass) and s.mass >= 0):
            msg = f"sensor '{s.name}' has the mass {s.mass} kg; it must be finite and not negative"
            raise MeasurementError(msg)
        if s.mass > 0 and not s.roving and name not in known:
            masses[name] = AddedMass(name=name, point=sensor_point(model.mesh, s), mass=s.mass, arm=s.arm)
    return replace(model, effects=(*model.effects, *masses.values())) if masses else model


def with_mass_of(model: Model, sensor: Sensor, mass: float) -> Model:
    """Return a model with a mass [kg] where a sensor sits."""
    point = sensor_point(model.mesh, sensor)
    return model.with_effect(AddedMass(name=f"mass of sensor {sensor.name}", point=point, mass=mass))


def roving_masses(sensors: Sequence[Sensor]) -> tuple[tuple[Ints, Sensor, float], ...]:
    """Return rows, one of the sensors and the mass [kg] of each place of a roving sensor that has a mass."""
    places: dict[tuple[float, ...], list[int]] = {}
    for i, s in enumerate(sensors):
        if s.roving:
            places.setdefault(tuple(np.round(s.point, 9).tolist()), []).append(i)
    masses = [(rows, sum(sensors[i].mass for i in rows)) for rows in places.values()]
    return tuple((np.array(rows), sensors[rows[0]], mass) for rows, mass in masses if mass > 0)


def with_moving_base(model: Model, excitations: Sequence[Sensor]) -> Model:
    """Return a model on a base that moves as some of the excitations say; the same where none does.

    Raises
    ------
    MeasurementError
        If nothing holds the structure to the base, or a direction is a combination of others.
    """
    directions = [np.asarray(e.direction, dtype=float) for e in excitations if e.moves_base]
    if not directions or model.ground is not None:
        return model
    try:
        return base_moved(model, np.array(directions))
    except ModelError as reason:
        raise MeasurementError(str(reason)) from reason


def quantity_of(kind: FRFKind, excitation: Sensor) -> tuple[str, str]:
    """Return name and SI unit of the FRFs of a kind to an excitation: per force, or per acceleration."""
    return kind.to_base if excitation.per_acceleration else (str(kind), kind.unit)


def with_resting_base(model: Model) -> Model:
    """Return a model whose supports and grounds rest."""
    return model.without_effect(*(e.name for e in model.of_kind(MovingBase)))


def with_instruments(model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]) -> Model:
    """Return a model with the masses of its instruments, on a base that moves where an excitation is such."""
    every = (*sensors, *excitations, *references_of(excitations))
    return with_moving_base(with_sensor_masses(model, every), excitations)


def references_of(excitations: Sequence[Sensor]) -> tuple[Sensor, ...]:
    """Return the sensors that FRFs to some excitations refer to, each once."""
    found = (e.reference_sensor() for e in excitations)
    return tuple({s.name: s for s in found if s is not None}.values())


def outputs_of(
    sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> tuple[tuple[Sensor, ...], References | None]:
    """Return sensors and behind them those that the excitations refer to, and what divides what.

    None where all FRFs are per unit force or motion of the base.
    """
    references = references_of(excitations)
    if not references:
        return tuple(sensors), None
    row = {s.name: len(sensors) + k for k, s in enumerate(references)}
    found = [e.reference_sensor() for e in excitations]
    rows = np.array([-1 if s is None else row[s.name] for s in found], dtype=np.int64)
    return (*sensors, *references), References(len(sensors), rows)


def sensor_point(mesh: Mesh, sensor: Sensor) -> int:
    """Return the point of a mesh where a sensor sits: the nearest one, of its member if it has one.

    Raises
    ------
    MeasurementError
        If it is farther than 2 % of the mesh's size (see :func:`place_sensors`).
    """
    if sensor.member is None:
        point, distance = mesh.nearest_point(sensor.point)
    else:
        points = mesh.member_points(sensor.member)
        away = np.linalg.norm(mesh.points[points] - sensor.point, axis=1)
        point, distance = int(points[np.argmin(away)]), float(away.min())
    if distance > 0.021 * mesh.size:
        msg = f"sensor '{sensor.name}' is {distance:.3g} m from the nearest point of the mesh"
        raise MeasurementError(msg)
    return point


def instruments_on(mesh: Mesh, measurement: Measurement) -> Instruments:
    """Return where a test's sensors of motion and its excitations are, as points of a mesh.

    Those whose FRFs are held out are on the structure, too; a roving sensor is not at all its places.
    """

    def places(group: tuple[Sensor, ...]) -> tuple[Ints, Floats]:
        points = np.array([sensor_point(mesh, s) for s in group], dtype=np.int64)
        return points, np.array([s.direction for s in group], dtype=float).reshape(-1, 3)

    every = (*measurement.sensors, *measurement.other_sensors)
    sensors = tuple(s for s in directed_of(every) if not s.roving)
    forces = directed_of((*measurement.excitations, *measurement.other_excitations))
    return Instruments(*places(sensors), *places(forces))


def motions_of(sensors: Sequence[Sensor]) -> tuple[Sensor, ...]:
    """Return those sensors that read a motion."""
    return tuple(s for s in sensors if s.quantity == MOTION)


def directed_of(sensors: Sequence[Sensor]) -> tuple[Sensor, ...]:
    """Return those sensors that read the motion of a point along a direction."""
    return tuple(s for s in sensors if s.directed)


def shapes_like_motions(
    shapes: NDArray[Any], sensors: Sequence[Sensor]
) -> tuple[NDArray[Any], tuple[Sensor, ...]]:
    """Return shapes whose rows are alike in size for all quantities, and the sensors that read so.

    A shape of motions [m] and strains [-] would otherwise be one of motions alone. All rows of a quantity get
    one factor, the power of 2 that brings their root mean square nearest to that of the motions: the same for
    two states of a structure. It becomes part of the gain, so that computed shapes have it as well.

    Parameters
    ----------
    shapes : ndarray (n_out, n_modes)
        NaN where nothing was measured.
    sensors : sequence of Sensor
        Of the rows.
    """
    quantity = np.array([s.quantity for s in sensors])
    if not len(shapes) or len(set(quantity)) < 2:
        return shapes, tuple(sensors)
    factor = np.ones(len(sensors))
    size = {q: np.sqrt(np.nanmean(np.abs(shapes[quantity == q]) ** 2)) for q in set(quantity)}
    reference = size.get(MOTION, 1.0)
    for q, rms in size.items():
        if rms > 0 and reference > 0:
            factor[quantity == q] = 2.0 ** np.round(np.log2(reference / rms))
    like = (replace(s, gain=s.gain * f) for s, f in zip(sensors, factor.tolist(), strict=True))
    return shapes * factor[:, None], tuple(like)


def at_one_place(sensor: Sensor, excitation: Sensor, tolerance: float) -> float:
    """Return 1 or -1 if a sensor reads the motion of a force's place, along or against the force, else 0.

    Of an excitation whose force is unknown it is 0: its FRFs are no driving-point FRFs.

    Parameters
    ----------
    sensor, excitation : Sensor
    tolerance : float
        Largest distance [m].
    """
    cosine = float(np.dot(sensor.direction, excitation.direction))
    apart = np.asarray(sensor.point) + sensor.arm - excitation.point - excitation.arm
    near = np.linalg.norm(apart) <= tolerance
    alike = sensor.directed and excitation.directed and not excitation.per_acceleration
    return float(np.sign(cosine)) if near and alike and abs(cosine) > 0.999 else 0.0


def sensor_rows(model: Model, sensors: Sequence[Sensor]) -> Floats:
    """Return each sensor's reading, or each excitation's force, as a row of combinations of DOFs, (n, n_dof).

    Raises
    ------
    MeasurementError
        If the mesh has no point where a sensor sits (:func:`place_sensors`), the model lacks the sprung mass
        that carries one, or the base of a motion of it rests in the model; and as the ``row`` of a
        channel of another kind says.
    """
    return np.array([s.row(model) for s in sensors]).reshape(len(sensors), model.n_dof)


def _motion_at(model: Model, sensor: Sensor) -> tuple[Ints, Floats]:
    """Return DOFs, and the translation (3, n) of a sensor's place by them."""
    if not sensor.body:
        dofs = dofs_of(sensor_point(model.mesh, sensor))
        return (dofs, lever_matrix(sensor.arm)[:3]) if np.any(sensor.arm) else (dofs[:3], np.eye(3))
    body = next((e.internal.body for e in model.effects if e.name == sensor.body), None)
    if body is None:
        msg = f"sensor '{sensor.name}' is on the sprung mass '{sensor.body}', which the model does not have"
        raise MeasurementError(msg)
    point, motion = body
    return np.append(dofs_of(point), model.internal_dofs(sensor.body)), motion
