"""Make two states of plane frames whose model misses the first one.

    python -m benchmarks.independent.poor_baselines FOLDER FIRST:END

Natural frequencies of plane frames by OpenSees (Timoshenko beams, a fine mesh), with an error of the model
that both states have, and a change in the second one. Each case is a folder with `study.toml` and
`truth.json`. Runs under the peers' interpreter.
"""

import json
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import openseespy.opensees as ops  # pyright: ignore[reportMissingImports] - of .venv-peers

E, NU, RHO = 210e9, 0.3, 7850.0
PIECES = 24
"""Elements of a member."""
NOISE = 2e-4
"""Repeatability of frequencies, relative [-]."""
N_MODES = 7
MODULUS, DENSITY = 0.015, 0.004
"""Standard deviations of ln E and ln ρ of the structure from the model's [-]."""


@dataclass(frozen=True)
class Plane:
    """A plane frame of one rectangular section: what the model has of it, and what it has not.

    ``points`` are (x, z) [m]. ``supports`` name held directions. ``springs`` are (point, direction, stiffness
    [N/m, N·m/rad]); ``masses`` are (member, share of its length, kg); ``loss`` are (member, ends of a part as
    shares of its length, share of E that is left).
    """

    points: dict
    members: dict
    supports: dict
    section: tuple
    springs: tuple = ()
    masses: tuple = ()
    loss: tuple = ()
    soft: dict = field(default_factory=dict)
    modulus: float = 1.0
    density: float = 1.0


def frequencies(plane, n=N_MODES):
    """Return the first natural frequencies of a plane frame [Hz]."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    number = {name: k + 1 for k, name in enumerate(plane.points)}
    for name, tag in number.items():
        ops.node(tag, *map(float, plane.points[name]))
    b, h = plane.section
    A, inertia, e, rho = b * h, b * h**3 / 12, E * plane.modulus, RHO * plane.density
    tag, spring = 100, 10_000
    for name, (start, end) in plane.members.items():
        p, q = np.array(plane.points[start]), np.array(plane.points[end])
        ops.geomTransf("Linear", tag)
        nodes = [number[start]]
        for k in range(1, PIECES):
            ops.node(tag + k, *map(float, p + (q - p) * k / PIECES))
            nodes.append(tag + k)
        nodes.append(number[end])
        left = np.ones(PIECES)
        for member, s0, s1, share in plane.loss:
            if member == name:
                at = (np.arange(PIECES) + 0.5) / PIECES
                left[(at > s0) & (at < s1)] = share
        for k in range(PIECES):
            ops.element(
                "ElasticTimoshenkoBeam", tag + k, nodes[k], nodes[k + 1], e * left[k],
                e * left[k] / (2 * (1 + NU)), A, inertia, 5 / 6 * A, tag, "-mass", rho * A, "-cMass",
            )  # fmt: skip
        for member, s, kg in plane.masses:
            if member == name:
                ops.mass(nodes[round(s * PIECES)], kg, kg, 0.0)
        tag += 100
    dofs = {"x": 1, "z": 2, "ry": 3}
    for name, held in plane.supports.items():
        grounded = [(p, d, k) for p, d, k in plane.springs if p == name]
        ops.fix(number[name], *(int(d in held and (name, d) not in plane.soft) for d in dofs))
        grounded += [(p, d, k) for (p, d), k in plane.soft.items() if p == name]
        spring = _grounded(number[name], plane.points[name], grounded, dofs, spring)
    for name in plane.points:
        if name not in plane.supports:
            grounded = [(p, d, k) for p, d, k in plane.springs if p == name]
            spring = _grounded(number[name], plane.points[name], grounded, dofs, spring)
    lam = np.array(ops.eigen("-genBandArpack", n))
    return np.sqrt(lam) / (2 * np.pi)


def _grounded(node, point, springs, dofs, tag):
    """Add springs to the ground at a node, and return the next free number."""
    if not springs:
        return tag
    ops.node(tag, *map(float, point))
    ops.fix(tag, 1, 1, 1)
    for k, (_, d, stiffness) in enumerate(springs):
        ops.uniaxialMaterial("Elastic", tag + k, float(stiffness))
        ops.element("zeroLength", tag + k, tag, node, "-mat", tag + k, "-dir", dofs[d] if d != "ry" else 6)
    return tag + 10


def portal(rng):
    """Return a portal of two unequal columns on pinned feet."""
    left, right, span = rng.uniform(0.45, 0.65), rng.uniform(0.3, 0.42), rng.uniform(0.6, 0.8)
    points = {"a": (0, 0), "b": (0, left), "c": (span, left), "d": (span, left - right)}
    members = {"left": ("a", "b"), "rail": ("b", "c"), "right": ("d", "c")}
    return Plane(points, members, {"a": ("x", "z"), "d": ("x", "z")}, (0.03, rng.uniform(0.012, 0.02)))


def bracket(rng):
    """Return a clamped post with an arm."""
    post, arm = rng.uniform(0.5, 0.7), rng.uniform(0.35, 0.5)
    points = {"a": (0, 0), "b": (0, post), "c": (arm, post)}
    members = {"post": ("a", "b"), "arm": ("b", "c")}
    return Plane(points, members, {"a": ("x", "z", "ry")}, (0.04, rng.uniform(0.014, 0.022)))


def beam(rng):
    """Return a beam on two supports with an overhang."""
    one, two = rng.uniform(0.6, 0.8), rng.uniform(0.3, 0.45)
    points = {"a": (0, 0), "b": (one, 0), "c": (one + two, 0)}
    members = {"field": ("a", "b"), "overhang": ("b", "c")}
    return Plane(points, members, {"a": ("x", "z"), "b": ("z",)}, (0.04, rng.uniform(0.012, 0.02)))


FRAMES = {"portal": portal, "bracket": bracket, "beam": beam}
WORTH = 50.0, 400.0
"""Largest shift of a frequency by the error common to both states, in standard deviations beyond what a
common factor of all frequencies explains: at least, and at most."""
CAUSES = ("ground_spring", "side_spring", "support_flexibility", "foundation")
"""Kinds that stand for what holds or lets go of a foot."""
CHANGE = 15.0, 100.0
"""The same of the change."""


def stiffness_of(plane):
    """Return E I / L of the first member [N·m]."""
    b, h = plane.section
    p, q = (np.array(plane.points[k], dtype=float) for k in next(iter(plane.members.values())))
    return E * b * h**3 / 12 / float(np.linalg.norm(q - p))


def causes(name, plane, rng):
    """Return errors of the model that both states have, by size."""
    k = stiffness_of(plane)
    if name == "bracket":
        return lambda s: replace(plane, soft={("a", "ry"): k / s}), {"cause": "foot a gives way about y"}
    if name == "portal" and rng.random() < 0.5:
        return (
            lambda s: replace(plane, springs=(("d", "ry", s * k),)),
            {"cause": "foot d is held about y"},
        )
    return lambda s: replace(plane, springs=(("a", "ry", s * k),)), {"cause": "foot a is held about y"}


def changes(plane, rng):
    """Return changes by size, and what they are."""
    member = str(rng.choice(list(plane.members)))
    if rng.random() < 0.5:
        at = float(rng.uniform(0.25, 0.85))
        return (
            lambda p, s: replace(p, masses=((member, at, s * 0.3),)),
            {"change": "mass", "member": member, "at": at},
        )
    start = float(rng.choice([0.25, 0.375, 0.5]))
    return (
        lambda p, s: replace(p, loss=((member, start, start + 0.25, 1 / (1 + s)),)),
        {"change": "loss", "member": member, "at": start},
    )


def shift(one, two):
    """Return by how many standard deviations frequencies differ at most, beside a common factor."""
    r = np.log(two / one)
    return float(np.abs(r - r.mean()).max() / NOISE)


def sized(of, target, low=1e-4, high=10.0):
    """Return the size at which a growing function reaches a value."""
    for _ in range(40):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if of(middle) < target else (low, middle)
    return float(np.sqrt(low * high))


def draw(name, seed, what):
    """Return a case: the plane that the model has, both states' frequencies, and what is hidden.

    ``what`` says what there is: "poor" a poor baseline with a change, "same" without one, "good" a change
    of a good model.
    """
    rng = np.random.default_rng([seed, list(FRAMES).index(name), ["poor", "same", "good"].index(what)])
    plane = FRAMES[name](rng)
    f = frequencies(plane)
    cause, told = causes(name, plane, rng)
    size = sized(lambda s: shift(f, frequencies(cause(s))), rng.uniform(*WORTH))
    change, more = changes(plane, rng)
    true = cause(size) if what != "good" else plane
    g = frequencies(true)
    weight = sized(lambda s: shift(g, frequencies(change(true, s))), rng.uniform(*CHANGE))
    moduli = {"modulus": 1 + MODULUS * rng.standard_normal(), "density": 1 + DENSITY * rng.standard_normal()}
    first = replace(true, **moduli)
    second = change(first, weight) if what != "same" else first
    states = [frequencies(s) * (1 + NOISE * rng.standard_normal(N_MODES)) for s in (first, second)]
    truth = {"form": seed % 2 == 0, "withheld": what == "poor" and seed % 3 == 2}
    truth |= {"frame": name, "seed": seed, "what": what, "size": size, "weight": weight, **told, **more}
    truth["states"] = [s.tolist() for s in states]
    return plane, states, truth


def study(plane, states, name, *, form, withheld):
    """Return the text of a study.

    Without ``form`` its model is stated to be right. Kinds that stand for the error that both states have
    may be ``withheld``.
    """
    lines = ["[study]", f'name = "{name}"', "", "[mesh]", 'plane = "xz"', "", "[points]"]
    lines += [f"{k} = [{x}, 0.0, {z}]" for k, (x, z) in plane.points.items()]
    lines += ["", "[members]"]
    lines += [f'{k} = {{ from = "{a}", to = "{b}" }}' for k, (a, b) in plane.members.items()]
    b, h = plane.section
    lines += ["", "[materials.steel]", "E = 210e9", "rho = 7850.0", ""]
    lines += ["[sections.bar]", 'shape = "rectangle"', f"b = {b}", f"h = {h}", "nu = 0.0", ""]
    for k, held in plane.supports.items():
        lines += ["[[supports]]", f'name = "{k}"', f'point = "{k}"', f"fixed = {json.dumps(held)}", ""]
    for table, f in zip(("baseline", "modes"), states, strict=True):
        lines += [f"[{table}]", f"frequency = {np.round(f, 5).tolist()}", f"frequency_std = {NOISE}"]
        lines += [""]
    lines += ["[uncertain]", "E = 0.03", "rho = 0.01", ""]
    lines += [] if form else ["[fit]", "form = false", ""]
    lines += ["[candidates]", f"exclude = {json.dumps(CAUSES)}"] if withheld else []
    return "\n".join(lines) + "\n"


def write(folder, seeds):
    """Write all cases of some seeds."""
    for seed in seeds:
        for name in FRAMES:
            for what in ("poor", "same", "good"):
                plane, states, truth = draw(name, seed, what)
                there = folder / f"{name}-{what}-{seed}"
                there.mkdir(parents=True, exist_ok=True)
                (there / "study.toml").write_text(
                    study(plane, states, there.name, form=truth["form"], withheld=truth["withheld"]),
                    encoding="utf-8",
                )
                (there / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]), range(*map(int, sys.argv[2].split(":"))))
