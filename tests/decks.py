"""Decks made by hand, and the model that takes each card of them for itself."""

from itertools import pairwise

import numpy as np

from fem import (
    DIRECTIONS,
    AddedMass,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    MultiPointConstraint,
    RigidLink,
    Section,
    Support,
)
from fem.effects import DistributedMass
from fem.io import BarProperty, Bars, Body, Connection, Equation, FrameDeck, Link

STEEL = Material("steel", 210e9, 7850.0)
LIGHT = Material("light", 210e9, 1e-5)
FLAT = Section.rectangle(b=0.03, h=0.01)


def deck(points, ends, *properties, kinds=None, height=None, offsets=None, stiffness=None, **more):
    """Return a deck; bars are numbered 10, 20, … and nodes 1, 2, …"""
    n = len(ends)
    bars = Bars(
        numbers=10 * np.arange(1, n + 1),
        ends=np.array(ends),
        properties=np.zeros(n, dtype=int) if kinds is None else np.array(kinds),
        height=np.full((n, 3), np.nan) if height is None else height,
        offsets=np.zeros((n, 2, 3)) if offsets is None else offsets,
        stiffness=np.full((n, 2, 6), np.inf) if stiffness is None else stiffness,
    )
    points = np.array(points, dtype=float)
    named = properties or (BarProperty(name="property 3", material=STEEL, section=FLAT),)
    nodes = np.arange(1, len(points) + 1)
    return FrameDeck(file="frame.bdf", nodes=nodes, points=points, bars=bars, properties=named, **more)


def literal(d):
    """Return the model in which each bar is a member, and each node a point with its cards."""
    bars = d.bars
    mesh = Mesh.from_lines(d.points, bars.ends, {f"bar {k}": [k] for k in range(len(bars.ends))})
    members, effects = {}, []
    for k, kind in enumerate(bars.properties):
        p, (k1, k2) = d.properties[kind], bars.stiffness[k]
        members[f"bar {k}"] = MemberProperties(
            p.material,
            p.section,
            None if np.isnan(bars.height[k]).any() else bars.height[k],
            *bars.offsets[k],
            theory=p.theory,
            section2=p.section2,
            mass=p.mass,
            spring1=dict(zip(DIRECTIONS, k1, strict=True)),
            spring2=dict(zip(DIRECTIONS, k2, strict=True)),
        )
        if p.mass_per_length:
            effects.append(DistributedMass.over(mesh, f"bar {k}", members[f"bar {k}"], p.mass_per_length))
    for row, fixed in d.supports.items():
        effects.append(Support(name=f"s{row}", point=row, fixed=fixed))
    for b in d.bodies:
        effects.append(AddedMass(name=b.name, point=b.node, mass=b.mass, inertia=b.inertia, arm=b.arm))
    for c in d.connections:
        one, two = c.nodes
        ends = [row for row in c.nodes if row is not None]
        place = d.points[ends].mean(axis=0) if c.place is None else c.place
        effects.append(
            Joint(
                name=c.name,
                point1=one,
                point2=two,
                location=place,
                K=c.K,
                C=c.C,
                D=c.D,
                rigid=c.rigid,
                axes=c.axes,
            )
        )
    for e in d.links:
        effects.append(RigidLink(name=e.name, point=e.node, dependents=e.dependents, directions=e.directions))
    for e in d.equations:
        effects.append(MultiPointConstraint(name=e.name, terms=e.terms))
    return Model(mesh, (Frame(members=members), *effects))


def everything():
    """Return a portal whose deck has most of what decks have."""
    heights = np.linspace(0, 1, 5)
    feet = [[0, 0, z] for z in heights], [[2, 0, z] for z in heights]
    beam = [[x, 0, 1] for x in np.linspace(0, 2, 9)[1:-1]]
    more = [[0.5, 0.3, 1.2], [2, 0, -0.1], [1, 0, 1.5], [0, 0.2, 0.5], [0, -0.2, 0.5], [1.0, 0.4, 1.0]]
    chain = [4, *range(10, 17), 9]
    across = [(a, b) if k % 3 else (b, a) for k, (a, b) in enumerate(pairwise(chain))]
    ends = [*((k, k + 1) for k in range(4)), *((k, k + 1) for k in range(5, 9)), *across]
    stiffness, offsets = np.full((16, 2, 6), np.inf), np.zeros((16, 2, 3))
    stiffness[12, 1, 4], stiffness[5, 0, 4] = 0.0, 3e4
    offsets[8:] = [0, 0, 0.05]
    offsets[15, 0, 2] = 0.1
    height = np.full((16, 3), np.nan)
    height[8:], height[:4] = [0, 0.1, 1.0], [1, 0, 0]
    alu = Section(A=1e-3, Iy=2e-7, Iz=1e-7, J=1.5e-7, ky=0.8, kz=0.7, Ip=4e-7, angle=0.2)
    beam_property = BarProperty(
        name="property 4",
        material=Material("alu", 70e9, 2700.0, 0.33),
        section=alu,
        mass="lumped",
        mass_per_length=2.0,
        theory="euler-bernoulli",
    )
    K, arm = np.diag([1e5, 2e5, 3e5, 0, 0, 0]), np.array([0, 0.1, 0])
    full = K + np.diag([0, 0, 0, 1e4, 1e4, 1e4])
    skew = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]])
    rbe3 = tuple(
        Equation(name=f"RBE3 7 {d}", terms=((22, d, 1.0), (12, d, -0.5), (14, d, -0.5))) for d in DIRECTIONS
    )
    return deck(
        [*feet[0], *feet[1], *beam, *more],
        ends,
        BarProperty(name="property 3", material=STEEL, section=FLAT),
        beam_property,
        kinds=[0] * 8 + [1] * 8,
        height=height,
        offsets=offsets,
        stiffness=stiffness,
        supports={0: DIRECTIONS, 18: DIRECTIONS},
        bodies=(
            Body(name="CONM2 1", node=17, mass=1.0, inertia=np.diag([0.1, 0.2, 0.3]), arm=arm),
            Body(name="CONM2 2", node=19, mass=0.5),
            Body(name="CONM2 3", node=22, mass=0.5, inertia=0.01 * np.eye(3)),
        ),
        links=(
            Link(name="RBE2 1", node=10, dependents=(17,), directions=DIRECTIONS),
            Link(name="RBE2 2", node=20, dependents=(2, 21), directions=DIRECTIONS),
        ),
        connections=(
            Connection(name="CBUSH 1", nodes=(5, 18), K=full),
            Connection(name="CELAS2 2", nodes=(19, 12), K=K, place=np.array([1, 0, 1.5])),
            Connection(name="skew", nodes=(7, None), axes=skew, rigid=("x",)),
            Connection(name="CBUSH 3", nodes=(21, None), K=K, C=1e-3 * K),
        ),
        equations=rbe3,
        notes=("PCOMP 7 is left out",),
    )
