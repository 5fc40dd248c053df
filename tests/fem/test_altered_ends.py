"""Effects that alter members, at ends that are released, sprung, offset or tapered.

What alters an element and a release at its end are in series: each effect must act on the member as the
others leave it. The references are models that are built by hand: altered stretches are members, and the
springs at ends are joints between points at one place.
"""

from dataclasses import replace

import numpy as np
import pytest

from fem.analysis.modes import solve_modes
from fem.effects.clamp_form import ClampForm
from fem.effects.crack import Crack, EndRelease
from fem.effects.ground_spring import GroundSpring
from fem.effects.joint import Joint
from fem.effects.member_change import MemberDensity, MemberStiffness
from fem.effects.member_section import MemberSection, MemberShear, MemberTorsion
from fem.effects.preload import Preload
from fem.effects.rigid_end_zone import RigidEndZone
from fem.effects.section_form import SectionForm
from fem.effects.section_shear import SectionShear
from fem.effects.solid_corner import SolidCorner, _Zone
from fem.effects.stiffness_loss import StiffnessLoss
from fem.effects.support import Support
from fem.effects.zone_form import ZoneForm
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Model, lever_matrix
from fem.sections.section import Section
from fem.system import assemble, sum_contributions
from tests.frames import fix

E, RHO = 210e9, 7850.0
BOX = Section.hollow_rectangle(0.06, 0.04, 0.003)
THIN = Section.hollow_rectangle(0.04, 0.03, 0.002)
WIDTHS = BOX, THIN
ALONG = np.array([0.6, 0.0, 0.8])
N, LENGTH = 3, 0.9
h = LENGTH / N
SPRING = 8e3
"""Stiffness of the end's spring [N·m/rad]: a member's length L opposes 4 E I / L of some 10⁵."""
AXIS = "ry"
AT = DIRECTIONS.index(AXIS)
ENDS = {
    "released": {"spring": SPRING},
    "hinged": {"spring": 1.0},
    "two ways": {"spring": SPRING, "other": "rz"},
    "sprung": {"spring": SPRING, "stated": True},
    "beside sprung": {"spring": SPRING, "beside": {"rz": 5e3}},
    "offset": {"spring": SPRING, "offset1": np.array([0.0, 0.03, 0.02]), "rigid1": 0.04},
    "tapered": {"spring": SPRING, "section2": THIN},
    "all of it": {
        "spring": SPRING, "section2": THIN, "offset1": np.array([0.0, 0.0, 0.02]), "rigid1": 0.04,
        "other": "rx",
    },
}  # fmt: skip


def section(x):
    """Return the tapered section at a fraction of the member."""
    return Section.between(*WIDTHS, x)


def properties(end, theory="timoshenko", **more):
    """Return the properties of the altered member; a stated end has its spring there."""
    options = {k: v for k, v in end.items() if k in ("offset1", "rigid1", "section2")}
    if "offset1" in options:
        options["offset2"] = options["offset1"]
    springs = {AXIS: end["spring"]} if end.get("stated") else {}
    springs |= end.get("beside", {})
    return MemberProperties(
        Material("steel", E, RHO, loss_factor=0.01), BOX, theory=theory,
        **{**options, "spring1": springs, **more},
    )  # fmt: skip


def member(end, theory="timoshenko", **more):
    """Return the member alone."""
    mesh = Mesh.from_lines([[0, 0, 0], LENGTH * ALONG], [[0, 1]], {"beam": [0]}).split(N)
    return Model(mesh, (Frame(members={"beam": properties(end, theory, **more)}),))


def releases(end):
    """Return the releases of an end, as effects."""
    if end.get("stated"):
        return ()
    of = [AXIS, *([end["other"]] if "other" in end else [])]
    return tuple(
        EndRelease(
            name=f"soft {d}", member="beam", end=1, direction=d, compliance=1 / end["spring"], reference=1.0
        )
        for d in of
    )


def built(end, stretches=(), crack=None, theory="timoshenko", start=None, **more):
    """Return the member in pieces, each with its properties, and its end's springs as joints.

    ``stretches`` are (first, last, factor of E, change of the properties); a crack is (place, axis,
    compliance).
    """
    taper = "section2" in end
    offset, zone = end.get("offset1", np.zeros(3)), end.get("rigid1", 0.0)
    cuts = {zone, *np.linspace(0, LENGTH, N + 1)[1:]}
    for a, b, *_ in stretches:
        cuts |= {max(a, zone), b}
    if crack:
        cuts.add(crack[0])
    s = np.unique(np.round(sorted(cuts), 12))
    points = [offset + x * ALONG for x in s]
    lines, members = [], {}
    at, joints = 0, []
    extra = []
    for k, (a, b) in enumerate(zip(s, s[1:], strict=False)):
        factor = 1.0
        change = dict(more)
        for first, last, times, options in stretches:
            if first <= (a + b) / 2 <= last:
                factor *= times
                change |= options
        first = at
        if crack and abs(a - crack[0]) < 1e-9:
            extra.append(points[k])
            first = len(points) + len(extra) - 1
            joints.append((at, first, crack[1], 1 / crack[2], points[k]))
        lines.append([first, k + 1])
        part = {"section": section(a / LENGTH), "section2": section(b / LENGTH)} if taper else {}
        own = MemberProperties(
            Material(f"steel{k}", factor * E, RHO, loss_factor=0.01), **{"section": BOX, **part, **change},
            theory=theory,
        )  # fmt: skip
        members[f"m{k}"] = own
        at = k + 1
    node = len(points) + len(extra)  # of the member's first end, at the place of point 0 behind the springs
    stiff = dict.fromkeys(DIRECTIONS, np.inf) | {AXIS: end["spring"]}
    if "other" in end:
        stiff[end["other"]] = end["spring"]
    stiff |= end.get("beside", {})
    mesh = Mesh.from_lines([*points, *extra, points[0]], lines, {f"m{k}": [k] for k in range(len(lines))})
    frame = Frame(members=members)
    R = frame.rotations(mesh, [0])[0]
    out = [joint("end", node, 0, points[0], R, stiff)]
    for k, (p, q, d, stiffness, place) in enumerate(joints):
        out.append(joint(f"crack{k}", p, q, place, R, {**dict.fromkeys(DIRECTIONS, np.inf), d: stiffness}))
    return Model(mesh, (frame, *out)), node, len(s) - 1


def joint(name, one, two, place, R, stiff):
    K = np.diag([0.0 if np.isinf(stiff[d]) else stiff[d] for d in DIRECTIONS])
    rigid = tuple(d for d in DIRECTIONS if np.isinf(stiff[d]))
    return Joint(name=name, point1=one, point2=two, location=np.asarray(place), axes=R, K=K, rigid=rigid)


def flexibility(model, first, second):
    """Return the flexibility (6, 6) of a motion of the origin, with a first point, while a second one is held."""
    system = assemble(model.with_effect(Support(name="wall", point=second, fixed=DIRECTIONS)))
    rows = system.Q.tocsr()[6 * first : 6 * first + 6].toarray()
    F = rows @ np.linalg.solve(system.K.toarray(), rows.T)
    back = lever_matrix(-model.mesh.points[first])
    return back @ F @ back.T


def stretch(a, b, **factors):
    return (a, b, 1.0, {"section": scaled(BOX, **factors)})


def scaled(s, **factors):
    """Return a section with constants times factors."""
    changed = {key: f * getattr(s, key) for key, f in factors.items()}
    return replace(s, **changed)


FRAMES = {}


def frame_of(end):
    (frame,) = member(end).of_kind(Frame)
    return frame


def zone_of(end, u=-0.2, plane=0.0):
    zone = end.get("rigid1", 0.0)
    effect = ZoneForm(
        name="zone", zones=(("beam", zone, 0.11, 1),), place="end", frame=None, u=u, plane=plane,
        inside=((2, 4),),
    )  # fmt: skip
    return effect, [(zone, zone + 0.11, np.exp(u), {})]


def loss_of(end):
    effect = StiffnessLoss(
        name="loss", member="beam", position=h / 2, loss=0.4, width=h, length=LENGTH
    )
    return effect, [(0, h, 0.6, {})]


def zone_end(end):
    zone = end.get("rigid1", 0.0)
    effect = RigidEndZone(name="rigid", ends=(("beam", 1),), length=0.07, longest=0.2)
    return effect, [(zone, zone + 0.07, 100.0, {})]


def corner_of(end):
    zone = end.get("rigid1", 0.0)
    part = _Zone("beam", zone, 1, 0.08, 1.0, 0.0, 0.2)
    effect = SolidCorner(name="corner", zones=(part,), n_corners=1, size=1.0, rigid_zone_factor=0.5)
    return effect, [(zone, zone + 0.04, 100.0, {})]


def clamp_of(end):
    zone = end.get("rigid1", 0.0)
    effect = ClampForm(
        name="clamp", zones=(("beam", zone, 0.06, 1),), place="end", frame=None, shares=((1.0,) * 6,), u=-0.8
    )
    return effect, [(zone, zone + 0.06, np.exp(-0.8), {})]


def stiffness_of(end):
    return MemberStiffness(name="E", member="beam", change=-0.3), [(0, LENGTH, 0.7, {})]


STRETCHED = {
    "zone_form": zone_of,
    "zone_form stiffer": lambda end: zone_of(end, 1.2),
    "clamp_form": clamp_of,
    "stiffness_loss": loss_of,
    "rigid_end_zone": zone_end,
    "solid_corner": corner_of,
    "member_stiffness": stiffness_of,
}
"""Effects that are another Young's modulus along a stretch."""


def with_frame(effect, model):
    (frame,) = model.of_kind(Frame)
    return replace(effect, frame=frame) if "frame" in type(effect).__dataclass_fields__ else effect


def compared(model, by_hand, rel=1e-6):
    """Check the flexibility of the member's first end against that of a model, its point there and the last."""
    found, expected = flexibility(model, 0, 1), flexibility(*by_hand)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (abs(found - expected) <= rel * size).all()


@pytest.mark.parametrize("end", list(ENDS))
def test_an_end_without_alterations_is_the_one_built_by_hand(end):
    end = ENDS[end]
    model = member(end)
    compared(model.with_effect(*releases(end)), built(end))


@pytest.mark.parametrize("end", list(ENDS))
@pytest.mark.parametrize("kind", list(STRETCHED))
def test_a_stretch_with_another_stiffness_is_the_member_built_by_hand(kind, end):
    end = ENDS[end]
    if kind == "stiffness_loss" and "rigid1" in end:
        pytest.skip("a stretch that ends within its element is stiffer than one by the flexibility")
    effect, stretches = STRETCHED[kind](end)
    model = member(end)
    model = model.with_effect(with_frame(effect, model), *releases(end))
    compared(model, built(end, stretches))
