"""Faults that a sensor may have, each compared with the others' prediction for its place."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats
from fem.elements.frame import Frame
from fem.mesh import Mesh
from fem.model import Model, dofs_of
from updating.inference.fit import FitProblem
from updating.measurement.measurement import Sensor
from updating.quality.corrections import Fault
from updating.quality.cross_prediction import CrossPrediction
from updating.quality.fault_hypotheses import FaultHypothesis, Series, factor_hypotheses, judge, valued
from updating.quality.misplaced import moved, other_places

SHIFT_LEAST = 0.02
"""Smallest distance from the stated place that is called a fault, in lengths of the member [-]."""


def sensor_hypotheses(problem: FitProblem, X: CrossPrediction, i: int) -> list[FaultHypothesis]:
    """Return the faults that sensor i alone may have."""
    name, series = problem.data.measurement.sensors[i].name, _series(X, i)
    # Smallest deviation of a gain from 1 that is called a fault, as a logarithm [-]
    out = factor_hypotheses(series, "sensor", name, np.linspace(-3, 3, 121), 0.06)
    if not out or not problem.data.measurement.sensors[i].directed:
        return out  # only the motion of a point is predicted in other directions and at other places
    before = series.losses(series.predicted)
    out += _tilt_hypotheses(problem, X, i, series, before)
    return out + _position_hypotheses(problem, X, i, series, before)


def _stated_place(mesh: Mesh, sensor: Sensor) -> tuple[str, float]:
    """Return a sensor's member and its position on it [m]."""
    if sensor.member not in mesh.members:
        member, position, _ = mesh.nearest_on_members(sensor.point)
        return member, position
    member = str(sensor.member)
    points = mesh.points[mesh.member_points(member)]
    nearest = int(np.argmin(np.linalg.norm(points - sensor.point, axis=1)))
    return member, float(mesh.member_positions(member)[nearest])


def _on_member(mesh: Mesh, sensor: Sensor) -> bool:
    """Whether the point that a sensor is at lies on a line, rather than on a reduced part."""
    return bool((mesh.lines == mesh.nearest_point(sensor.point)[0]).any())


def _tilt_hypotheses(
    problem: FitProblem, X: CrossPrediction, i: int, series: Series, before: Floats
) -> list[FaultHypothesis]:
    """Return tilts of sensor i about two axes, and about the axis that explains most."""
    model, sensor = problem.reduced.model, problem.data.measurement.sensors[i]
    point, _ = model.mesh.nearest_point(sensor.point)
    if _on_member(model.mesh, sensor):
        towards = np.array(_directions(model, sensor, _stated_place(model.mesh, sensor)[0]))
    else:
        towards = sensor.axes_across
    other = X.elsewhere(i, towards @ X.field.shapes[6 * point : 6 * point + 3])

    def tilted(a: Floats, motion: Complexes) -> Complexes:
        angle = a[:, None, None]
        return np.cos(angle) * series.predicted + np.sin(angle) * motion

    angles = np.radians(np.linspace(-80, 80, 41))
    turn = best_azimuth(lambda motion: float(series.losses(tilted(angles, motion)).sum(axis=1).min()), other)
    towards, other = (np.concatenate([x, np.tensordot(turn, x, (1, 0))]) for x in (towards, other))
    out, count = [], int(series.seen.sum())
    for direction, motion in zip(towards, other, strict=True):
        x, std, after = valued(angles, lambda a, m=motion: series.losses(tilted(a, m)))
        towards_it = tuple(map(float, direction))
        fault = Fault(
            "sensor_tilt", sensor.name, x, std, "rad", direction=towards_it, span=float(np.ptp(angles))
        )
        change = series.change(tilted(np.array([x]), motion)[0])
        # Smallest angle of a sensor's direction to the stated one that is called a fault [rad]
        out.append(judge(fault, x, 0.08, before, after, count, change))
    return out


def _position_hypotheses(
    problem: FitProblem, X: CrossPrediction, i: int, series: Series, before: Floats
) -> list[FaultHypothesis]:
    """Return the best other place of sensor i: on its member or, if it is on none, of the test."""
    model, sensor = problem.reduced.model, problem.data.measurement.sensors[i]
    mesh, frames = model.mesh, model.of_kind(Frame)
    count = int(series.seen.sum())
    if not frames or not _on_member(mesh, sensor):
        places = other_places(problem, sensor)
        if not places:
            return []
        motion = np.einsum("d,pdr->pr", sensor.direction, X.field.shapes[dofs_of([*places])[:, :3]])
        predicted = X.elsewhere(i, motion)
        each = series.losses(predicted)
        best = int(np.argmin(each.sum(axis=1)))
        point, name = list(places.items())[best]
        fault = moved(problem, sensor, "sensor_position", point, name)
        change = series.change(predicted[best])
        return [judge(fault, fault.value / mesh.size, SHIFT_LEAST, before, each[best], count, change)]
    member, position = _stated_place(mesh, sensor)
    length = mesh.member_length(member)

    def at(s: Floats) -> Complexes:
        dofs, N = frames[0].interpolate(mesh, [mesh.locate(member, float(x)) for x in s])
        motion = np.einsum("d,ndk->nk", sensor.direction, N[:, :3])
        return X.elsewhere(i, np.einsum("nk,nkr->nr", motion, X.field.shapes[dofs]))

    x, std, after = valued(np.linspace(0, length, 41), lambda s: series.losses(at(s)))
    fault = Fault("sensor_position", sensor.name, x - position, std, "m", member, span=length)
    size, change = (x - position) / length, series.change(at(np.array([x]))[0])
    return [judge(fault, size, SHIFT_LEAST, before, after, count, change)]


def swap_hypotheses(
    problem: FitProblem, X: CrossPrediction, suspects: Sequence[int]
) -> list[FaultHypothesis]:
    """Return the pairs of suspects whose labels may be exchanged, each predicted from all others."""
    sensors = problem.data.measurement.sensors
    names = [s.name for s in sensors]
    out = []
    for b, i in enumerate(suspects):
        for j in suspects[:b]:
            if sensors[i].quantity != sensors[j].quantity:
                continue
            seen = X.seen[:, [i, j]] & X.seen[:, [j, i]]
            count = int(seen.sum())
            if count < 20:
                continue
            predicted, variance = X.without((i, j))
            sigma = np.sqrt(variance) / np.maximum(np.abs(predicted), 1e-300)
            losses = []
            for pair in ([i, j], [j, i]):
                series = Series.of(X.field.frequency, X.measured[:, pair], predicted, sigma, seen)
                losses.append(series.losses(series.predicted))
            fault = Fault("sensor_swap", names[i], 0.0, 0.0, "-", names[j])
            out.append(judge(fault, 1.0, 0.0, losses[0], losses[1], count))
    return out


def _series(X: CrossPrediction, i: int) -> Series:
    predicted = X.predicted[:, i]
    sigma = np.sqrt(X.variance[:, i]) / np.maximum(np.abs(predicted), 1e-300)
    return Series(X.field.frequency, X.measured[:, i], predicted, sigma, X.seen[:, i])


def _directions(model: Model, sensor: Sensor, member: str) -> tuple[Floats, Floats]:
    """Return unit vectors square to a sensor's direction, the first in its plane with the member's axis."""
    mesh = model.mesh
    points = mesh.points[mesh.member_points(member)]
    k = int(np.argmin(np.linalg.norm(points - sensor.point, axis=1)))
    axis = points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)]
    d = np.asarray(sensor.direction) / np.linalg.norm(sensor.direction)
    towards: Any = axis / np.linalg.norm(axis)
    towards = towards - (towards @ d) * d
    if np.linalg.norm(towards) < 0.1:  # along the member: any two directions
        unit = np.eye(3)[int(np.argmin(np.abs(d)))]
        towards = unit - (unit @ d) * d
    towards = towards / np.linalg.norm(towards)
    return towards, np.asarray(np.cross(towards, d), dtype=float)


def best_azimuth(least: Callable[[Complexes], float], motions: Complexes) -> Floats:
    """Return the direction in the plane of two motions with the least loss, (1, 2): to 15°, then to 3°."""
    best, width = 0.0, np.radians(75)
    for step in np.radians([15.0, 3.0]):
        tried = best + np.arange(-width, width + 0.5 * step, step)
        turns = np.stack([np.cos(tried), np.sin(tried)], axis=1)
        k = int(np.argmin([least(np.tensordot(t, motions, (0, 0))) for t in turns]))
        best, width = float(tried[k]), step
    return np.array([[np.cos(best), np.sin(best)]])
