"""Small frames made by hand that the tests of several folders use; tests/random_frames.py draws others."""

import numpy as np

from dovetail import load_study
from fem import (
    DIRECTIONS,
    FRF,
    AddedMass,
    Attachment,
    Damping,
    FractionalZener,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    MultiPointConstraint,
    PointMass,
    RigidLink,
    Section,
    Superelement,
    Support,
    TabulatedStiffness,
    Viscoelastic,
    assemble,
    compute_frf,
    solve_modes,
)
from fem.elements.splitting import split
from fem.io import matrices_of, write_npz
from tests.noise import complex_normal
from updating import sensor_rows
from updating.inference import with_higher_mass

STEEL = Material("steel", 210e9, 7850.0)
FLAT = Section.rectangle(0.03, 0.01)
"""30 mm along local y, 10 mm along local z: Iz > Iy."""


def fix(point, directions=DIRECTIONS, name=None):
    return Support(name=name or f"support{point}", point=point, fixed=tuple(directions))


def beam(
    n,
    length=1.0,
    *,
    effects=(),
    along=(1.0, 0.0, 0.0),
    section=FLAT,
    material=STEEL,
    theory="euler-bernoulli",
    **more,
):
    """Return a straight beam of n elements; points 0 and 1 are its ends, the others follow along it."""
    along = np.asarray(along, dtype=float) / np.linalg.norm(along)
    mesh = Mesh.from_lines([[0, 0, 0], length * along], [[0, 1]], {"beam": [0]}).split(n)
    properties = MemberProperties(material, section, theory=theory, **more)
    return Model(mesh, (Frame(members={"beam": properties}), *effects))


def planar(model, keep=("z", "ry")):
    """Return a model whose points all move in some directions only."""
    held = tuple(d for d in DIRECTIONS if d not in keep)
    have = {e.point for e in model.of_kind(Support)}
    more = [fix(p, held, f"plane{p}") for p in range(model.mesh.n_points) if p not in have]
    swap = [fix(e.point, {*e.fixed, *held}, e.name) if isinstance(e, Support) else e for e in model.effects]
    return Model(model.mesh, (*swap, *more), model.damping)


def cross_beam(size=0.05, *, eta=0.006, C=None, loss_factor=0.004):
    """Return two free beams of 0.8 m that cross, with an elastic joint between them."""
    points = [[-0.4, 0, 0], [0, 0, 0], [0.4, 0, 0], [0, -0.4, 0.01], [0, 0, 0.01], [0, 0.4, 0.01]]
    lines = [[0, 1], [1, 2], [3, 4], [4, 5]]
    mesh = Mesh.from_lines(points, lines, {"lower": [0, 1], "upper": [2, 3]}).refined(size)
    frame = Frame(members={name: MemberProperties(STEEL, FLAT) for name in mesh.members})
    joint = Joint(
        name="bolt",
        point1=1,
        point2=4,
        location=np.array([0, 0, 0.005]),
        eta=eta,
        K=np.diag([5e7, 5e7, 1e7, 3e3, 3e3, 5e3]),
        C=np.zeros((6, 6)) if C is None else C,
    )
    return Model(mesh, (frame, joint), Damping.structural(loss_factor))


def portal(size=0.1):
    """Return two clamped columns and a beam 20 mm above their ends, with rigid joints at the corners."""
    points = [[0, 0, 0], [0, 0, 0.5], [0.6, 0, 0], [0.6, 0, 0.5], [0, 0, 0.52], [0.6, 0, 0.52]]
    sets = {"left": [0], "right": [1], "beam": [2]}
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3], [4, 5]], sets).refined(size)
    frame = Frame(members={name: MemberProperties(STEEL, FLAT) for name in mesh.members})
    corners = tuple(
        Joint(
            name=f"corner{i}",
            point1=p,
            point2=q,
            location=np.add(points[p], [0, 0, 0.01]),
            rigid=DIRECTIONS,
        )
        for i, (p, q) in enumerate(((1, 4), (3, 5)))
    )
    feet = (fix(0, name="foot0"), fix(2, name="foot1"))
    return Model(mesh, (frame, *corners, *feet), Damping.structural(0.01))


def with_part():
    """Return a clamped beam of 0.4 m whose other 0.3 m are a superelement of twelve modes."""
    rest = beam(6, 0.3, along=(1, 2, -0.5), theory="timoshenko")
    part = matrices_of(assemble(rest)).placed(shift=0.4 * np.array([1, 2, -0.5]) / np.sqrt(5.25))
    near = beam(4, 0.4, along=(1, 2, -0.5), theory="timoshenko")
    tie = [Attachment(1, (0,))]
    return near.with_effect(
        Superelement.from_matrices("part", part, near.mesh, tie, n_modes=12, eta=0.01), fix(0)
    )


def chain(n_members, n, effects=(), *, length=1.0, section=FLAT, stiffness=0.0):
    """Return members in a line, joined by hinges that pass forces and, by a stiffness [N·m/rad], moments."""
    points = [[i * length, 0, 0] for m in range(n_members) for i in (m, m + 1)]
    lines = [[2 * m, 2 * m + 1] for m in range(n_members)]
    mesh = Mesh.from_lines(points, lines, {f"m{m}": [m] for m in range(n_members)}).split(n)
    frame = Frame(members={name: MemberProperties(STEEL, section) for name in mesh.members})
    hinges = tuple(
        Joint(
            name=f"hinge{m}",
            point1=2 * m + 1,
            point2=2 * m + 2,
            location=np.array([(m + 1) * length, 0, 0]),
            K=np.diag([0, 0, 0, stiffness, stiffness, stiffness]),
            rigid=("x", "y", "z"),
        )
        for m in range(n_members - 1)
    )
    return Model(mesh, (frame, *hinges, *effects))


TURNED = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]])
"""Axes at 53° to the global ones."""


def braced(n=4):
    """Return a mast that tapers, with lumped mass, springs and a hinge, and a bar that stays it."""
    points = [[0, 0, 0], [0.1, 0.05, 0.8], [0.5, 0.2, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 1]], {"mast": [0], "stay": [1]}).refined(counts={"mast": n})
    mast = MemberProperties(
        STEEL,
        FLAT,
        section2=Section.rectangle(0.02, 0.015),
        mass="lumped",
        spring1={"ry": 2e3, "rx": 500.0},
        release1=("rz",),
        spring2={"z": 1e6},
    )
    frame = Frame(members={"mast": mast, "stay": MemberProperties(STEEL, FLAT, theory="bar")})
    return Model(mesh, (frame, fix(0, name="foot"), fix(2, ("x", "y", "z"), "anchor")))


def mounted(size=0.1):
    """Return a beam on a rubber mount, with a tabulated mount, a turned spring, and tied points beside it."""
    points = [[0, 0, 0], [0.6, 0, 0], [0, 0.04, 0], [0.6, 0.04, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"first": [0], "second": [1]}).refined(size)
    frequency = np.array([10.0, 60.0, 300.0])
    base = np.diag([4e5, 3e5, 9e5, 800.0, 700.0, 600.0])
    base[0, 4] = base[4, 0] = 3e3
    table = np.array([(1 + 0.1j) * base, (1.2 + 0.2j) * base, (1.4 + 0.25j) * base + 1e3j * np.eye(6)])
    return Model(
        mesh,
        (
            Frame(members={name: MemberProperties(STEEL, FLAT) for name in mesh.members}),
            Viscoelastic(
                name="rubber",
                point1=0,
                point2=2,
                location=np.array([0, 0.02, 0.01]),
                axes=TURNED,
                K=np.diag([1e5, 2e5, 3e5, 100.0, 200.0, 300.0]),
                law=FractionalZener(6.0, 1e-4, 0.5),
            ),
            TabulatedStiffness(
                name="mount",
                point1=1,
                point2=3,
                location=np.array([0.6, 0.02, 0]),
                frequency=frequency,
                K=table,
                factor=1.1,
            ),
            Joint(
                name="spring",
                point1=4,
                point2=9,
                location=np.array([0.1, 0.02, 0]),
                axes=TURNED,
                K=np.diag([1e4, 0, 0, 0, 0, 0]),
            ),
            RigidLink(name="link", point=5, dependents=(6,)),
            MultiPointConstraint(name="tie", terms=((7, "z", 1.0), (12, "z", -1.0))),
            AddedMass(name="lump", point=3, mass=0.4, arm=np.array([0.01, 0, 0.02])),
        ),
        Damping.structural(0.004),
    )


def welded(size=0.05, **beam):
    """Return a clamped column that a beam ends on, and an arm at the beam's other end, of solid bars."""
    points = [[0, 0, 0], [0, 0, 0.3], [0, 0, 0.42], [0.35, 0, 0.3], [0.35, 0.25, 0.3]]
    lines = [[0, 1], [1, 2], [1, 3], [3, 4]]
    mesh = Mesh.from_lines(points, lines, {"column": [0, 1], "beam": [2], "arm": [3]}).refined(size)
    column = MemberProperties(STEEL, Section.rectangle(0.03, 0.02), orientation=(1, 0, 0))
    frame = Frame(
        members={
            "column": column,
            "beam": MemberProperties(STEEL, Section.rectangle(0.02, 0.016), **beam),
            "arm": MemberProperties(STEEL, Section.rectangle(0.02, 0.012)),
        }
    )
    return Model(mesh, (frame, fix(0, name="foot")))


STUDY = """
[study]
name = "bent <bar>"
description = "Two members & a hidden mass"

[points]
foot = [0, 0, 0]
knee = [0, 0, 0.5]
tip = [0.4, 0, 0.5]

[members.post]
from = "foot"
to = "knee"
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }
elements = 6

[members.arm]
from = "knee"
to = "tip"
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }
elements = 6

[materials.steel]
E = 210e9
rho = 7850
nu = 0.3

[[supports]]
point = "foot"

[damping]
modal = 0.01

[[sensors]]
member = "post"
position = 0.25
name = "P"
direction = "x"

[[sensors]]
point = "knee"
name = "K"
direction = "x"

[[sensors]]
point = "tip"
name = "T"
direction = "z"

[[sensors]]
member = "arm"
position = 0.2
name = "A"
direction = "z"

[[excitations]]
sensor = "T"

[[excitations]]
sensor = "K"

[candidates]
kinds = ["point_mass", "member_stiffness"]

[fit]
held_out = ["K", "sensor P"]
"""
"""A bent frame of two members with four sensors, and nothing measured."""

_MEASURED = '\n[[measurements]]\nfile = "frf.npz"\n'


def measured_frf(study, model, frequency):
    """Return accelerances of a model at a study's sensors and excitations, with 0.3 % of noise."""
    rows = [sensor_rows(study.model, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(model), frequency, *rows).H
    H = H * (1 + 0.003 * complex_normal(np.random.default_rng(3), H.shape))
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    return FRF.from_arrays(frequency, H, "accelerance", *names)


def write_study(folder, mass=0.25, at=0.3, others=()):
    """Write the study and FRFs of it with what it does not know, a mass and others; return its path."""
    file = folder / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    study = load_study(file)
    hidden = PointMass(name="hidden", member="arm", position=at, mass=mass)
    model = study.model.with_effect(*([hidden] if mass else []), *others)
    write_npz(folder / "frf.npz", measured_frf(study, model, np.arange(4.0, 400.0, 2.0)))
    file.write_text(STUDY + _MEASURED, encoding="utf-8")
    return file


def frequencies(model, n=6):
    """Return the lowest natural frequencies of a model [Hz]."""
    return solve_modes(assemble(model), n).frequency


def rows_at(model, frame, readings):
    """Return rows (n, n_dof) that read the motions of a true frame's readings from a model of it."""
    R = np.zeros((len(readings), model.n_dof))
    for row, r in zip(R, readings, strict=True):
        point, distance = model.mesh.nearest_point(frame.place(r.at))
        assert distance < 1e-9
        row[6 * point : 6 * point + 3] = r.direction
    return R


MAST = """\
[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.0]

[members.mast]
from = "foot"
to = "tip"
section = { shape = "rectangle", b = 0.03, h = 0.01 }

[materials.steel]
E = 210e9
rho = 7850.0

[[supports]]
point = "foot"
"""
"""A mast of 1 m on a support, of a study."""

MAST_SENSORS = """
[[sensors]]
name = "tip"
point = "tip"
direction = "x"

[[sensors]]
name = "middle"
point = [0.0, 0.0, 0.55]
direction = "x"

[[sensors]]
name = "low"
point = [0.0, 0.0, 0.3]
direction = "x"
"""
"""Three sensors on it; keys that follow belong to the lowest."""

FLAT_STEEL = """
[materials.steel]
E = 210e9
rho = 7850.0

[sections.flat]
shape = "rectangle"
b = 0.03
h = 0.01
"""
"""Material and section of a study: STEEL and FLAT."""

CROSSED_BEAMS = f"""{FLAT_STEEL}[members.U]
from = [0, 0, 0.01]
to = [0.8, 0, 0.01]
[members.D]
from = [0.45, -0.25, -0.01]
to = [0.45, 0.55, -0.01]
"""
"""Two beams of a study that cross at 0.45 m and 0.25 m, without a joint."""


def on_fine_mesh(model):
    """Return a model on elements a quarter as long, whose mesh errs no more than that of fits."""
    return split(with_higher_mass(model), 4)
