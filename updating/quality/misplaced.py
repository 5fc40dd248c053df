"""Forces at wrong places, of which a test has too few to check one another, and by reciprocity sensors.

The motion of the structure shows where a force acts. The readings of a line are compared with the model's
field for a force at each place, which is as uncertain as all readings show
(:mod:`updating.quality.cross_prediction`). With the scale of its covariance S fitted to each line, the
likelihood of n complex readings with residuals d is (dᴴ S⁻¹ d)⁻ⁿ, up to a constant. Neighbouring lines are
not independent: of all lines as many count as the band has independent data.
"""

from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.model import dofs_of
from updating.inference.fit import FitProblem
from updating.measurement.measurement import Sensor
from updating.quality.corrections import Fault, log_odds_against
from updating.quality.cross_prediction import CrossPrediction


def other_places(problem: FitProblem, channel: Sensor) -> dict[int, str]:
    """Return the points where a channel may be instead, those of the test, and what to call them.

    They are the named points of the mesh and those that have a channel: tests are mixed up by these.
    """
    mesh, m = problem.reduced.model.mesh, problem.data.measurement
    out = {int(p): f"point {name}" for name, p in mesh.point_names.items()}
    for c in (*m.sensors, *m.excitations, *m.other_sensors, *m.other_excitations):
        point, distance = mesh.nearest_point(c.point)
        if c.directed and distance <= 1e-6 * mesh.size:
            out.setdefault(point, f"the place of {c.name}")
    far = np.linalg.norm(mesh.points - channel.point, axis=1) > 1e-6 * mesh.size
    return {p: name for p, name in out.items() if far[p]}


def moved(problem: FitProblem, channel: Sensor, kind: str, point: int, name: str) -> Fault:
    """Return the fault of a channel that is at a point of the mesh in place of the stated one."""
    shift = problem.reduced.model.mesh.points[point] - np.asarray(channel.point)
    distance = float(np.linalg.norm(shift))
    return Fault(kind, channel.name, distance, 0.0, "m", name, shift=tuple(shift.tolist()))


def misplaced_force(problem: FitProblem, X: CrossPrediction, j: int) -> tuple[float, Fault] | None:
    """Return the most probable other place of force j, and by how much it is more probable [nats].

    None where no place of the test explains the readings better than the stated one.
    """
    model, m = problem.reduced.model, problem.data.measurement
    force = m.excitations[j]
    places = other_places(problem, force)
    if not force.directed or force.body or not places:
        return None
    points = [*places, model.mesh.nearest_point(force.point)[0]]
    F = np.zeros((model.n_dof, len(points)))
    F[dofs_of(points)[:, :3].T, np.arange(len(points))] = force.gain * np.asarray(force.direction)[:, None]
    likelihood = _log_likelihoods(problem, X, j, F)
    gain = likelihood[:-1] - likelihood[-1] - np.log(len(places)) - log_odds_against(len(m.excitations))
    best = int(np.argmax(gain))
    if not gain[best] > 0:
        return None
    return float(gain[best]), moved(problem, force, "excitation_position", points[best], places[points[best]])


def _log_likelihoods(problem: FitProblem, X: CrossPrediction, j: int, forces: Floats) -> Floats:
    """Return the log likelihood of the readings of force j for other forces (n_dof, n), each (n,)."""
    mean = X.field.respond(forces)
    y, seen = X.measured[:, :, j], X.seen[:, :, j]
    d: Any = np.where(seen[:, :, None], y[:, :, None] - X.rows @ mean, 0.0)
    S = X.inverse[:, j]
    size = np.einsum("lon,lon->ln", d.conj(), S @ d, optimize=True).real
    count = seen.sum(axis=1)
    told = count > 0
    each = -count[told, None] * np.log(np.maximum(size[told], 1e-300))
    return each.mean(axis=0) * problem.n_independent() / problem.data.n_parts
