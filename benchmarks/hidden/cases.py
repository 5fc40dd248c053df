"""Random frames with a hidden effect, simulated on a finer mesh with noise.

The truth comes from Dovetail's beams: these cases measure the search, not the beams. `benchmarks/independent`
has truths of other codes.
"""

from dataclasses import dataclass, replace

import numpy as np

import fem
from fem.effects import candidate_kinds
from updating import Measurement, Nuisance, Sensor, place_sensors, propose

FAMILIES = ("cross", "portal", "lap")
DRAWN = (
    "joint_stiffness",
    "joint_structural_damping",
    "joint_viscous_damping",
    "member_density",
    "member_stiffness",
    "point_mass",
    "preload",
    "stiffness_loss",
    "support_flexibility",
)
"""Kinds that are drawn unless one is asked for."""


@dataclass(frozen=True)
class Case:
    """A model as an analyst has it, the measurement, and what is hidden (None for nothing)."""

    seed: int
    family: str
    model: fem.Model
    measurement: Measurement
    nuisances: tuple
    hidden: object


def make_case(seed, family=None, kind=None):
    """Draw a case; ``kind`` is a kind of effect, or "nothing"."""
    rng = np.random.default_rng(seed)
    family = family or str(rng.choice(FAMILIES))
    E, rho = 70e9 * rng.choice([1, 3]), 0.0
    rho = 2700.0 if E < 1e11 else 7850.0
    build = {"cross": _cross, "portal": _portal, "lap": _lap}[family]
    points, lines, sets, section, joints, supports, drives, top = build(rng)
    material = fem.Material("metal", E, rho)
    mesh = fem.Mesh.from_lines(points, lines, sets)
    for j in joints:
        mesh = mesh.with_point_on(j["a"], j["sa"], j["name"] + "1").with_point_on(
            j["b"], j["sb"], j["name"] + "2"
        )
    sensors = tuple(_sensors(mesh, rng, family))
    mesh = place_sensors(mesh, sensors)
    effects = [fem.Frame(members={m: fem.MemberProperties(material, section) for m in mesh.members})]
    effects += [fem.Support(name=f"S{i + 1}", point=mesh.nearest_point(p)[0]) for i, p in enumerate(supports)]
    for j in joints:
        a, b = (mesh.point_names[j["name"] + s] for s in "12")
        effects.append(
            fem.Joint(
                name=j["name"],
                point1=a,
                point2=b,
                location=(mesh.points[a] + mesh.points[b]) / 2,
                K=np.diag(j["k"]) if "k" in j else np.zeros((6, 6)),
                rigid=() if "k" in j else ("x", "y", "z", "rx", "ry", "rz"),
            )
        )
    mesh = mesh.refined(size=mesh.size / 40)
    model = fem.Model(mesh, tuple(effects), fem.Damping.modal(0.004))
    candidates = propose(model)
    if kind is None:
        kind = str(rng.choice([*sorted({c.kind for c in candidates if c.kind in DRAWN}), "nothing"]))
    if kind not in (*candidate_kinds(), "nothing"):
        raise ValueError(kind)
    hidden = _draw(rng, [c for c in candidates if c.kind == kind], model) if kind != "nothing" else None
    # What the analyst does not know: modulus, density, joint and damping.
    values = {}
    for ref, value in model.values().items():
        if ref[0] == "frame":
            values[ref] = value * (1 + 0.01 * rng.standard_normal())
        elif ref[1].startswith("k") and (hidden is None or ref not in hidden.replaces()):
            values[ref] = value * (1 + 0.02 * rng.standard_normal())
    zeta = 0.004 * rng.uniform(0.6, 1.6) * (1 + 0.3 * np.sin(np.linspace(0, 5, 12) + rng.uniform(0, 6)))
    truth = replace(
        model.with_values(values),
        mesh=mesh.split(2),
        damping=fem.Damping.modal(zeta, np.linspace(0, top, 12)),
    )
    if hidden is not None:
        truth = truth.with_effect(hidden)
    driving = tuple(sensors[i] for i in drives(len(sensors)))
    vectors = [np.array([_row(truth, s) for s in group]) for group in (sensors, driving)]
    f = np.linspace(top / 300, top, 600)
    exact = fem.compute_frf(fem.assemble(truth), f, *vectors)
    noise = rng.standard_normal((4, *exact.H.shape))
    peak = np.abs(exact.H).max(axis=0)
    H = exact.H * (1 + 0.01 * (noise[0] + 1j * noise[1])) + 3e-4 * peak * (noise[2] + 1j * noise[3])
    frf = fem.FRF.from_arrays(f, H, exact.kind, [s.name for s in sensors], [s.name for s in driving])
    nuisances = [Nuisance("frame", "E:metal", 0.02), Nuisance("frame", "rho:metal", 0.01)]
    nuisances += [Nuisance(n, p, 0.03) for n, p in values if n != "frame"]
    return Case(seed, family, model, Measurement(frf, sensors, driving), tuple(nuisances), hidden)


def _cross(rng):
    a, b, gap = rng.uniform(0.6, 1.0), rng.uniform(0.5, 0.9), 0.02
    sa, sb = a * rng.uniform(0.35, 0.65), b * rng.uniform(0.25, 0.6)
    points = [[0, 0, gap / 2], [a, 0, gap / 2], [sa, -sb, -gap / 2], [sa, b - sb, -gap / 2]]
    k = np.array([5e7, 5e7, 1e7, 3e3, 3e3, 5e3]) * rng.uniform(0.5, 2, 6)
    joint = {"name": "J", "a": "U", "b": "D", "sa": sa, "sb": sb, "k": k}
    section = fem.Section.rectangle(rng.uniform(0.025, 0.04), rng.uniform(0.008, 0.012))
    return points, [[0, 1], [2, 3]], {"U": [0], "D": [1]}, section, [joint], [], lambda n: (0, n - 2), 1500.0


def _lap(rng):
    a, b, h = rng.uniform(0.5, 0.8), rng.uniform(0.3, 0.5), 0.008
    sa = a * rng.uniform(0.3, 0.7)
    points = [[0, 0, -h / 2], [a, 0, -h / 2], [sa, -0.02, h / 2], [sa, b, h / 2]]
    joint = {"name": "J", "a": "A", "b": "B", "sa": sa, "sb": 0.02}
    section = fem.Section.rectangle(0.04, h)
    return points, [[0, 1], [2, 3]], {"A": [0], "B": [1]}, section, [joint], [], lambda n: (0, n - 1), 1500.0


def _portal(rng):
    w, h = rng.uniform(0.4, 0.7), rng.uniform(0.4, 0.7)
    points = [[0, 0, 0], [0, 0, h], [w, 0, h], [w, 0, 0], [w, 0.3, h]]
    sets = {"left": [0], "beam": [1], "right": [2], "arm": [3]}
    section = fem.Section.rectangle(rng.uniform(0.015, 0.03), rng.uniform(0.012, 0.02))
    supports = [points[0], points[3]]
    return points, [[0, 1], [1, 2], [3, 2], [2, 4]], sets, section, [], supports, lambda n: (0, n // 2), 600.0


def _sensors(mesh, rng, family):
    for m in mesh.members:
        length = mesh.member_length(m)
        for i, s in enumerate(np.linspace(0.08, 1.0, 6 if family != "portal" else 4)):
            p = mesh.point_at(mesh.locate(m, s * length))
            along = mesh.points[mesh.member_points(m)[-1]] - mesh.points[mesh.member_points(m)[0]]
            across = [d for d in np.eye(3) if abs(d @ along) < 0.5 * length]
            for d in across if family == "portal" else [np.eye(3)[2]]:
                yield Sensor(f"{m}{i + 1}{'xyz'[int(np.argmax(d))]}", p, d)


def _row(model, sensor):
    point, _ = model.mesh.nearest_point(sensor.point)
    row = np.zeros(model.n_dof)
    row[6 * point : 6 * point + 3] = sensor.direction
    return row


def _draw(rng, candidates, model):
    """Give a random candidate a strength that shows but need not be large."""
    effect = candidates[rng.integers(len(candidates))]
    values = {}
    for p in effect.parameters():
        if p.name == "position":
            values[p.name] = rng.uniform(
                p.lower + 0.05 * (p.upper - p.lower), p.upper - 0.05 * (p.upper - p.lower)
            )
        elif p.name == "stiffness" and effect.kind in DRAWN:
            soft = p.absent if np.isfinite(p.absent) else 3e4 if "r" in effect.direction else 3e7
            values[p.name] = soft * 10 ** rng.uniform(-1.8, -0.7)
        elif p.name == "damping":
            values[p.name] = effect.reference * 10 ** rng.uniform(-3.5, -2.5)
        elif p.name == "tension":
            values[p.name] = effect.buckling * rng.choice([-0.4, 1.0, 3.0])
        elif effect.kind not in DRAWN:
            values[p.name] = _between(rng, [s[p.name] for s in effect.starts(lambda key: 1e6)])
        else:
            reach = {
                "mass": (0.02, 0.12),
                "change": (0.06, 0.3),
                "loss": (0.3, 0.8),
                "loss_factor": (0.1, 0.5),
            }
            low, high = reach[p.name]
            size = rng.uniform(low, high) * getattr(effect, "scale", 1.0)
            values[p.name] = size * (rng.choice([-1, 1]) if p.name == "change" else 1)
    return effect.with_values(**values)


def _between(rng, grid):
    """Draw a value from the upper half of a grid's sizes, of either sign where the grid has both."""
    values = np.array(sorted(set(grid)))
    values = values[np.argsort(np.abs(values))]
    low, high = np.abs(values[len(values) // 2]), np.abs(values[-2 if len(values) > 2 else -1])
    size = float(np.exp(rng.uniform(*np.log([min(low, high), max(low, high)]))))
    return size * float(np.sign(rng.choice(values)))
