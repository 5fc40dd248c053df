"""What can be hidden: each kind draws a place and a strength, and says the truth in words of truth.json.

A kind is a function of a bench and a random generator. It returns what it hides, or None where the structure
has no place for it. Strengths are drawn wide; `draw` keeps those that show clearly.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.independent.casefiles import AXES, DIRECTIONS, fault, named
from benchmarks.independent.foreign.bench import Hidden
from benchmarks.independent.foreign.parts import Change, constants
from benchmarks.independent.foreign.structure import RHO, E

OUTER = 0.06
"""Positions are drawn between the ends' shares of a member's length [-]."""


@dataclass(frozen=True)
class Drawn:
    """One hidden thing, what truth.json says of it, and where it is, so that no two are at one place.

    A fault has the ``sensors`` whose FRFs it changes. Each part in ``each`` must show by itself.
    """

    hidden: Hidden
    truth: dict
    where: str
    sensors: tuple = ()
    each: tuple = ()


def draw_from(rng, things) -> Any:
    """Return one of some things, or None."""
    things = list(things)
    return things[rng.integers(len(things))] if things else None


def log_uniform(rng, low, high):
    return float(f"{10 ** rng.uniform(np.log10(low), np.log10(high)):.4g}")


def either(rng, low, high):
    """Return a value between two, of either sign."""
    return float(rng.choice([-1.0, 1.0])) * round(float(rng.uniform(low, high)), 4)


def soft_stiffness(bench, connection, i, rng):
    """Return a stiffness of a connection that gives way in a direction: some of EI/L or 12 EI/L³ there."""
    member, _ = connection.sides[-1]
    m = bench.structure.members[member]
    scale = E * min(section_of(m)[1:3]) * (1 / m.length if i >= 3 else 12 / m.length**3)
    if connection.held:
        return log_uniform(rng, 0.5 * scale, 200 * scale)
    return float(f"{connection.k[i] * 10 ** -rng.uniform(0.3, 1.8):.4g}")


def section_of(member):
    if member.bar is None:
        return constants(member.section)
    b, h = member.bar.b, member.bar.h
    return b * h, b * h**3 / 12, h * b**3 / 12, 0.2 * b * h**3


def mass_of(member):
    return RHO * section_of(member)[0] * member.length


def position(bench, member, rng):
    """Return a drawn place of a member where there is a node [m]."""
    length = bench.structure.members[member].length
    s = bench.positions(member)
    return float(draw_from(rng, s[(s > OUTER * length) & (s < (1 - OUTER) * length)]))


def connection(bench, rng, at_least_sides=1):
    return draw_from(rng, (c for c in bench.structure.connections.values() if len(c.sides) >= at_least_sides))


def member(bench, rng):
    return draw_from(rng, bench.structure.members.values())


def free_ends(structure):
    """Return (member, number of the end) of ends at which no other member and no connection is."""
    out = []
    for m in structure.members.values():
        for k, s in ((1, 0.0), (2, m.length)):
            touched = any(distance(o, m.at(s)) < 0.03 for o in structure.members.values() if o is not m)
            joined = any((m.name, s) == (n, t) for c in structure.connections.values() for n, t in c.sides)
            if not touched and not joined:
                out.append((m.name, k))
    return out


def distance(member, point):
    s = np.clip((point - member.start) @ member.axes[0], 0, member.length)
    return float(np.linalg.norm(member.at(s) - point))


# connections ----------------------------------------------------------------------------------------------


def connection_truth(c, values, loss=None):
    """Return the words of a connection that gives way in some directions."""
    words = {DIRECTIONS[i]: v for i, v in values.items()}
    magnitude = {"k": words} if loss is None else {"k": words, "loss_factor": loss}
    return {
        "type": "connection",
        "location": f"{'support' if c.held else 'joint'} {c.name}",
        "magnitude": magnitude,
    }


def soft_axis(bench, rng):
    """A joint or support that gives way in one direction."""
    c = connection(bench, rng)
    i = int(rng.integers(3, 6) if rng.uniform() < 0.75 else rng.integers(3))
    k = soft_stiffness(bench, c, i, rng)
    return Drawn(Hidden(stiffness={(c.name, i): k}), connection_truth(c, {i: k}), c.name)


def soft_axes(bench, rng):
    """A joint or support that gives way about two or three axes."""
    c = connection(bench, rng)
    axes = sorted(rng.choice([3, 4, 5], size=int(rng.integers(2, 4)), replace=False).tolist())
    k = {i: soft_stiffness(bench, c, i, rng) for i in axes}
    each = tuple(Hidden(stiffness={(c.name, i): k[i]}) for i in axes)
    return Drawn(
        Hidden(stiffness={(c.name, i): v for i, v in k.items()}), connection_truth(c, k), c.name, (), each
    )


def joint_loss(bench, rng):
    """A joint softer in one direction, with a loss factor there."""
    c = draw_from(rng, bench.structure.joints)
    if not c:
        return None
    i, eta = int(rng.integers(3, 6)), round(float(rng.uniform(0.1, 0.6)), 3)
    k = soft_stiffness(bench, c, i, rng)
    softer, lossy = Hidden(stiffness={(c.name, i): k}), Hidden(loss={(c.name, i): eta})
    return Drawn(softer | lossy, connection_truth(c, {i: k}, eta), c.name, (), (softer, lossy))


def joint_dashpot(bench, rng):
    """A viscous damper in one direction of a joint."""
    c = draw_from(rng, bench.structure.joints)
    if not c:
        return None
    i = int(rng.integers(3, 6))
    middle = 2 * np.pi * float(np.median(bench.structure.frequency))
    value = log_uniform(rng, 0.05 * c.k[i] / middle, 10 * c.k[i] / middle)
    words = named("joint_viscous_damping", c.name, DIRECTIONS[i], value=value, unit="N·m·s/rad")
    return Drawn(Hidden(dashpots={(c.name, i): value}), words, c.name)


def hole_beside(bench, rng):
    """A joint's hole beside the centre line of one part: a lever on that side alone."""
    c = connection(bench, rng, 2)
    if not c:
        return None
    k = int(rng.integers(2))
    m = bench.structure.members[c.sides[k][0]]
    if m.bar is None:
        half, across = 0.5 * m.section.get("b", m.section.get("d")), m.axes[1]
    else:
        half, across = 0.5 * m.bar.b, m.axes[1]
    e = either(rng, 0.3 * half, 0.8 * half)
    lever = tuple((e * across).round(9).tolist())
    place = {"location": f"joint {c.name}", "member": m.name, "magnitude": {"offset_m": list(lever)}}
    return Drawn(Hidden(levers={(c.name, k): lever}), {"type": "hole_beside"} | place, c.name)


def mounted_along(bench, rng):
    """A part with one joint is mounted further along; its sensors move with it."""
    able = []
    for c in bench.structure.connections.values():
        if len(c.sides) != 2:
            continue
        for k, (m, s) in enumerate(c.sides):
            body = bench.structure.body_of[m]
            ties = [o for o in bench.structure.connections.values() if any(n in body for n, _ in o.sides)]
            inside = 0.035 < s < bench.structure.members[m].length - 0.035
            able += [(c, k)] if len(ties) == 1 and len(body) == 1 and inside else []
    if not able:
        return None
    c, k = draw_from(rng, able)
    m, _ = c.sides[k]
    step = float(rng.choice([-0.03, -0.02, -0.01, 0.01, 0.02, 0.03]))
    place = {"location": f"joint {c.name}", "member": m, "magnitude": {"along_m": step}}
    return Drawn(Hidden(shifts={(c.name, k): step}), {"type": "mounted_along"} | place, c.name)


def settled_elsewhere(bench, rng):
    """A support, clamp or foot, holds its member at another place."""
    c = draw_from(rng, (c for c in bench.structure.connections.values() if len(c.sides) == 1))
    if not c:
        return None
    (m, s), length = c.sides[0], bench.structure.members[c.sides[0][0]].length
    step = float(rng.choice([0.01, 0.02, 0.03, 0.04]))
    if s > 0.5 * length or (s > 0.045 and rng.uniform() < 0.5):
        step = -step
    place = {"location": f"{'support' if c.held else 'joint'} {c.name}", "member": m}
    return Drawn(
        Hidden(shifts={(c.name, 0): step}),
        {"type": "settled_elsewhere", **place, "magnitude": {"along_m": step}},
        c.name,
    )


# members --------------------------------------------------------------------------------------------------


def point_mass(bench, rng):
    m = member(bench, rng)
    s, mass = position(bench, m.name, rng), log_uniform(rng, 0.02 * mass_of(m), 0.6 * mass_of(m))
    words = named("point_mass", m.name, value=mass, unit="kg", position=s, length=m.length)
    return Drawn(Hidden(masses=((m.name, s, mass),)), words, m.name)


def rotary_inertia(bench, rng):
    m = member(bench, rng)
    s, J = position(bench, m.name, rng), log_uniform(rng, 1e-5 * mass_of(m), 5e-3 * mass_of(m))
    words = named("point_inertia", m.name, value=J, unit="kg·m²", position=s, length=m.length)
    return Drawn(Hidden(inertias=((m.name, s, J),)), words, m.name)


def notch(bench, rng):
    """A stretch of a member with less of E."""
    m = member(bench, rng)
    s, width = position(bench, m.name, rng), float(rng.choice([0.01, 0.015, 0.02]))
    start, end = (round(max(s - width, 0.002), 4), round(min(s + width, m.length - 0.002), 4))
    left = round(float(rng.uniform(0.12, 0.6)), 3)
    words = named(
        ("crack", "stiffness_loss"), m.name, value=round(1 - left, 3), unit="-",
        position=round(0.5 * (start + end), 4), length=m.length,
    )  # fmt: skip
    return Drawn(Hidden(changes={m.name: Change(notch=(start, end, left))}), words, m.name)


def member_stiffness(bench, rng):
    m, change = member(bench, rng), either(rng, 0.05, 0.2)
    words = named("member_stiffness", m.name, value=change, unit="-")
    return Drawn(Hidden(changes={m.name: Change(E=1 + change)}), words, m.name)


def member_density(bench, rng):
    m, change = member(bench, rng), either(rng, 0.05, 0.2)
    words = named("member_density", m.name, value=change, unit="-")
    return Drawn(Hidden(changes={m.name: Change(rho=1 + change)}), words, m.name)


def member_section(bench, rng):
    """A bar of solids of another width or height than stated."""
    if not bench.structure.solid:
        return None
    m, change, size = member(bench, rng), either(rng, 0.03, 0.12), draw_from(rng, "bh")
    words = named(
        "member_section", m.name, "along", "local", "z" if size == "h" else "y", value=change, unit="-"
    )
    return Drawn(Hidden(changes={m.name: Change(**{size: 1 + change})}), words, m.name)


def rod_preload(bench, rng):
    """A tension in a rod of a frame of beams."""
    m = draw_from(rng, (m for m in bench.structure.members.values() if m.section["type"] == "round"))
    if not m:
        return None
    euler = np.pi**2 * E * section_of(m)[1] / m.length**2
    force = log_uniform(rng, 0.1 * euler, 3 * euler)
    words = named("preload", m.name, value=force, unit="N")
    return Drawn(Hidden(changes={m.name: Change(tension=force)}), words, m.name)


def to_ground(bench, rng, kind):
    """A spring or a dashpot between a free end and the ground."""
    ends = free_ends(bench.structure)
    if not ends:
        return None
    name, k = draw_from(rng, ends)
    m, d = bench.structure.members[name], str(draw_from(rng, AXES))
    s = 0.0 if k == 1 else m.length
    s = float(min(bench.positions(name), key=lambda x: abs(x - s)))
    scale = 12 * E * section_of(m)[1] / m.length**3
    if kind == "ground_spring":
        value, unit = log_uniform(rng, 0.1 * scale, 30 * scale), "N/m"
    else:
        middle = 2 * np.pi * float(np.median(bench.structure.frequency))
        value, unit = log_uniform(rng, 0.02 * mass_of(m) * middle, mass_of(m) * middle), "N·s/m"
    words = named(kind, "end", str(k), "of", name, d, value=value, unit=unit)
    key = "springs" if kind == "ground_spring" else "dampers"
    return Drawn(Hidden(**{key: ((name, s, d, value),)}), words, name)


def ground_spring(bench, rng):
    return to_ground(bench, rng, "ground_spring")


def ground_damper(bench, rng):
    return to_ground(bench, rng, "ground_damper")


# sensors --------------------------------------------------------------------------------------------------


def free_sensor(bench, rng):
    """Return a sensor at which no force acts."""
    return draw_from(
        rng, (s for s in bench.structure.channels if s["name"] not in bench.structure.excitations)
    )


def sensor_sign(bench, rng):
    name = free_sensor(bench, rng)["name"]
    return Drawn(Hidden(gains={name: -1.0}), fault(name, factor=-1), name, (name,))


def sensor_gain(bench, rng):
    name, gain = (
        free_sensor(bench, rng)["name"],
        round(float(draw_from(rng, (0.8, 1.25)) * rng.uniform(0.92, 1.08)), 3),
    )
    return Drawn(Hidden(gains={name: gain}), fault(name, factor=gain), name, (name,))


def sensor_swap(bench, rng):
    first, second = (free_sensor(bench, rng)["name"] for _ in range(2))
    if first == second:
        return None
    return Drawn(Hidden(swaps=((first, second),)), fault(first, swapped_with=second), first, (first, second))


def sensor_tilt(bench, rng):
    s = free_sensor(bench, rng)
    towards = draw_from(rng, (d for d in AXES if d != s["direction"]))
    angle = round(float(np.radians(rng.uniform(12, 30))), 4)
    return Drawn(
        Hidden(tilts={s["name"]: (towards, angle)}), fault(s["name"], tilt_rad=angle), s["name"], (s["name"],)
    )


def sensor_moved(bench, rng):
    s = free_sensor(bench, rng)
    places = bench.positions(s["member"])
    near = np.abs(places - s["position"])
    place = draw_from(rng, places[(near > 0.015) & (near < 0.06)])
    if place is None:
        return None
    moved = abs(round(float(place) - s["position"], 6))
    return Drawn(
        Hidden(places={s["name"]: float(place)}), fault(s["name"], moved_m=moved), s["name"], (s["name"],)
    )


# outside the kinds of the open test ------------------------------------------------------------------------


def outside(what, place, **magnitude):
    """Return what truth.json says of an effect that no kind of the open test describes."""
    return {"type": "outside", "what": what, "location": place, "magnitude": magnitude}


def tie(bench, rng):
    """A spring between two members that nothing joins there."""
    one, other = member(bench, rng), member(bench, rng)
    if one is other:
        return None
    s, t = position(bench, one.name, rng), position(bench, other.name, rng)
    d = str(draw_from(rng, AXES))
    scale = 12 * E * min(section_of(m)[1] / m.length**3 for m in (one, other))
    k = log_uniform(rng, 0.3 * scale, 100 * scale)
    words = outside(
        "spring between two members", f"{one.name} {other.name}", positions_m=[s, t], direction=d, k=k
    )
    return Drawn(Hidden(ties=((one.name, s, other.name, t, d, k),)), words, one.name)


def absorber(bench, rng):
    """A mass on a spring with a resonance in the band: something loose, or an instrument on rubber."""
    m = member(bench, rng)
    s, d = position(bench, m.name, rng), str(draw_from(rng, AXES))
    mass = log_uniform(rng, 0.03 * mass_of(m), 0.6 * mass_of(m))
    f = round(float(rng.uniform(0.15, 0.7) * bench.structure.frequency[-1]), 2)
    eta = round(float(rng.uniform(0.01, 0.1)), 3)
    words = outside(
        "mass on a spring", m.name, position_m=s, direction=d, mass=mass, frequency_Hz=f, loss_factor=eta
    )
    k = mass * (2 * np.pi * f) ** 2
    return Drawn(Hidden(absorbers=((m.name, s, d, mass, k, eta),)), words, m.name)


def coupled_joint(bench, rng):
    """A joint that is softer in two directions, which are coupled."""
    c = draw_from(rng, bench.structure.joints)
    i, j = int(rng.integers(3)), int(rng.integers(3, 6))
    share = either(rng, 0.5, 0.95)
    k = {n: soft_stiffness(bench, c, n, rng) for n in (i, j)}
    words = outside(
        "coupled directions of a joint", c.name, directions=[DIRECTIONS[i], DIRECTIONS[j]], share=share,
        k=list(k.values()),
    )  # fmt: skip
    soft = Hidden(stiffness={(c.name, n): v for n, v in k.items()})
    coupled = Hidden(couplings={(c.name, i, j): share})
    return Drawn(soft | coupled, words, c.name, (), (soft, coupled))


OUTSIDE = (tie, absorber, coupled_joint)
CONNECTIONS = (soft_axes, soft_axis)
GEOMETRY = (hole_beside, mounted_along, settled_elsewhere)
FAULTS = (sensor_sign, sensor_gain, sensor_swap, sensor_tilt, sensor_moved)
LAWS = (joint_loss, joint_dashpot)
MEMBERS = (
    point_mass, rotary_inertia, notch, member_stiffness, member_density, member_section, rod_preload,
    ground_spring, ground_damper,
)  # fmt: skip


def sensor_fault(bench, rng):
    return draw_from(rng, FAULTS)(bench, rng)


EVERY = (*CONNECTIONS, *LAWS, *GEOMETRY, *MEMBERS, sensor_fault, sensor_fault)
"""All kinds; two of nineteen are faults of sensors."""
