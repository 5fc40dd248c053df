"""Effects that alter members, at ends that are released, sprung, offset or tapered.

What alters an element and a release at its end are in series: each effect must act on the member as the
others leave it. The references are models that are built by hand: altered stretches are members, and the
springs at ends are joints between points at one place.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fem import (
    DIRECTIONS,
    Contribution,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    Support,
    assemble,
    compute_frf,
    lever_matrix,
    reassemble,
    solve_modes,
    sum_contributions,
)
from fem.effects import (
    ClampForm,
    Crack,
    EndRelease,
    MemberDamping,
    MemberDensity,
    MemberSection,
    MemberShear,
    MemberStiffness,
    MemberTorsion,
    Preload,
    RigidEndZone,
    SectionForm,
    SectionShear,
    SideSpring,
    SolidCorner,
    StiffnessLoss,
    ZoneForm,
)
from fem.effects.solid_corner import _Zone
from fem.elements.cut import cut
from fem.model import FollowsOthers
from fem.reduction import LocalChanges, ParametricFRF, reduce_model
from fem.sensitivity.matrices import differentiate_matrices
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
        "spring": SPRING,
        "section2": THIN,
        "offset1": np.array([0.0, 0.0, 0.02]),
        "rigid1": 0.04,
        "other": "rx",
    },
}


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
    options = {"section": BOX, **options, "spring1": springs, **more}
    return MemberProperties(Material("steel", E, RHO, loss_factor=0.01), theory=theory, **options)


def member(end, theory="timoshenko", **more):
    """Return the member alone."""
    mesh = Mesh.from_lines([[0, 0, 0], LENGTH * ALONG], [[0, 1]], {"beam": [0]}).split(N)
    return Model(mesh, (Frame(members={"beam": properties(end, theory, **more)}),))


def releases(end):
    """Return the releases of an end, as effects."""
    of = [] if end.get("stated") else [AXIS, *([end["other"]] if "other" in end else [])]
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
    for k, (a, b) in enumerate(pairwise(s)):
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
            Material(f"steel{k}", factor * E, RHO, loss_factor=0.01),
            **{"section": BOX, **part, **change},
            theory=theory,
        )
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
    """Return the flexibility (6, 6) of the origin, moved with a first point while a second one is held."""
    system = assemble(model.with_effect(Support(name="wall", point=second, fixed=DIRECTIONS)))
    rows = system.Q.tocsr()[6 * first : 6 * first + 6].toarray()
    F = rows @ np.linalg.solve(system.K.toarray(), rows.T)
    back = lever_matrix(-model.mesh.points[first])
    return back @ F @ back.T


def section_with(**factors):
    """Return the section with constants times factors."""
    return replace(BOX, **{key: f * getattr(BOX, key) for key, f in factors.items()})


def zone_of(end, u=-0.2, plane=0.0):
    zone = end.get("rigid1", 0.0)
    effect = ZoneForm(
        name="zone",
        zones=(("beam", zone, 0.11, 1),),
        place="end",
        frame=None,
        u=u,
        plane=plane,
        inside=((2, 4),),
    )
    return effect, [(zone, zone + 0.11, np.exp(u), {})]


def loss_of(end):
    effect = StiffnessLoss(name="loss", member="beam", position=h / 2, loss=0.4, width=h, length=LENGTH)
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
    """Check the flexibility of the first end against that of a model, a point there and the last one."""
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


def changes(frame):
    """Return effects on the whole member, each with the properties that it stands for."""
    cube, polar = 1.2**3, (1.2**3 * BOX.Iy + 1.2 * BOX.Iz) / (BOX.Iy + BOX.Iz)
    wider = section_with(A=1.2, Iy=cube, Iz=1.2, J=1.2**4 / polar)
    form = SectionForm(name="form", members=("beam",), frame=frame, Iy=-0.3, Iz=0.2, J=-0.1, sheared=False)
    shear = SectionShear(groups={"beam": ("beam",)}, directions={"beam": ("ky", "kz")})
    return {
        "member_section": (
            MemberSection(name="s", member="beam", direction="z", change=0.2),
            {"section": wider},
        ),
        "member_torsion": (
            MemberTorsion(name="J", member="beam", change=-0.4),
            {"section": section_with(J=0.6)},
        ),
        "member_shear": (
            MemberShear(name="k", member="beam", euler=False, share=4.0),
            {"section": section_with(ky=0.25, kz=0.25)},
        ),
        "section_shear": (
            shear.with_values(**{"ky:beam": 0.4, "kz:beam": 1.5}),
            {"section": section_with(ky=0.4, kz=1.5)},
        ),
        "section_form": (form, {"section": section_with(Iy=0.7, Iz=1.2, J=0.9)}),
    }


UNIFORM = [name for name in ENDS if "section2" not in ENDS[name]]


@pytest.mark.parametrize("end", UNIFORM)
@pytest.mark.parametrize("kind", list(changes(None)))
def test_a_member_with_another_section_is_the_one_built_by_hand(kind, end):
    end = ENDS[end]
    theory = "euler-bernoulli" if kind == "section_form" else "timoshenko"
    model = member(end, theory)
    effect, options = changes(model.of_kind(Frame)[0])[kind]
    rel = 1e-6
    if kind == "section_form" and ("beside" in end or "stated" in end):
        rel = 0.02  # it is linear, and a spring in series with the section is not: c (1 - c) 0.3² at most
        effect = effect.with_values(Iy=-0.03, Iz=0.02, J=-0.01)
        options = {"section": section_with(Iy=0.97, Iz=1.02, J=0.99)}
        rel = 2.5e-4
    compared(model.with_effect(effect, *releases(end)), built(end, theory=theory, **options), rel)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("end", ["released", "hinged", "two ways", "tapered"])
def test_a_tension_acts_behind_a_release_as_on_a_member_built_by_hand(end, first):
    """The geometric stiffness resists the turn of the whole element, which no release lets it have."""
    end = ENDS[end]
    pull = Preload(name="pull", member="beam", tension=-1e4, buckling=1e6)
    effects = (pull, *releases(end))[:: 1 if first else -1]
    by_hand, node, last = built(end)
    pulls = (Preload(name=f"pull {m}", member=m, tension=-1e4, buckling=1e6) for m in by_hand.mesh.members)
    compared(member(end).with_effect(*effects), (by_hand.with_effect(*pulls), node, last))


@pytest.mark.parametrize("end", ["released", "sprung", "offset", "tapered"])
def test_a_tension_is_that_of_a_member_that_states_it(end):
    end = ENDS[end]
    effect = Preload(name="pull", member="beam", tension=4e4, buckling=1e6)
    found = sums(member(end).with_effect(effect, *releases(end)))
    stated = member(end, pretension=4e4)
    for a, b in zip(found, sums(stated.with_effect(*releases(end))), strict=True):
        assert abs(a - b).max() <= 1e-12 * abs(b).max()


@pytest.mark.parametrize("end", ["released", "hinged", "tapered"])
def test_a_spring_beside_a_member_acts_behind_its_release(end):
    """The spring is at a node, so that its place moves alike in both."""
    end = ENDS[end]
    spring = SideSpring(
        name="side", member="beam", direction="z", position=h, stiffness=1e6, length=LENGTH, reference=1.0
    )
    by_hand, node, last = built(end)
    own = replace(spring, member="m0", position=h)
    compared(member(end).with_effect(spring, *releases(end)), (by_hand.with_effect(own), node, last))


def sums(model):
    """Return K, M and D of a model."""
    K, M, _, D = (X.toarray() for X in sum_contributions(model.contributions(), model.n_dof))
    return K, M, D


@pytest.mark.parametrize("end", ["released", "two ways", "offset", "beside sprung"])
@pytest.mark.parametrize("kind", ["member_section", "member_torsion", "member_density", "member_stiffness"])
def test_mass_and_damping_follow_the_slip_of_the_altered_member(kind, end):
    """Against a member that states its springs: the same element, so that all matrices are the same."""
    end = ENDS[end]
    model, rest = member(end), {}
    if kind in ("member_section", "member_torsion"):
        effect, options = changes(None)[kind]
        if kind == "member_section":
            options = {"section": replace(options["section"], Ip=BOX.Iy * 1.2**3 + BOX.Iz * 1.2)}
    elif kind == "member_density":
        effect, options = MemberDensity(name="rho", member="beam", change=0.4), {}
        rest = {"rho": 1.4 * RHO}
    else:
        effect, options = MemberStiffness(name="E", member="beam", change=-0.3), {}
        rest = {"E": 0.7 * E}
    springs = {d: end["spring"] for d in (AXIS, end.get("other", AXIS))} | end.get("beside", {})
    stated = member(end, spring1=springs, **options)
    (frame,) = stated.of_kind(Frame)
    stated = replace(
        stated, effects=(frame.with_values(**{f"{q}:steel": value for q, value in rest.items()}),)
    )
    found, expected = sums(model.with_effect(effect, *releases(end))), sums(stated)
    for X, Y in zip(found[:2], expected[:2], strict=True):
        assert abs(X - Y).max() <= 1e-9 * abs(Y).max()
    if "beside" not in end:  # stated springs have no loss, and a release has the material's
        assert abs(found[2] - 0.01 * found[0]).max() <= 1e-9 * abs(found[2]).max()


def crack_of_beam():
    """Return a crack 0.18 m along the beam."""
    start = {"position": 0.18, "compliance": 1e-4, "length": LENGTH, "reference": 1.0}
    return Crack(name="crack", member="beam", direction="ry", **start)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("end", ["released", "sprung", "offset", "all of it"])
def test_a_crack_beside_a_release_in_a_softer_zone_is_the_member_built_by_hand(end, order):
    end = ENDS[end]
    effect, stretches = zone_of(end)
    model = member(end)
    crack = crack_of_beam()
    effects = (with_frame(effect, model), *releases(end), crack)[::order]
    compared(model.with_effect(*effects), built(end, stretches, (0.18, "ry", 1e-4)))


# ------------------------------------------------------------------------------------------- in a structure


def corner(end, *effects, n=N):
    """Return a post and a rail that is welded to it, altered, and whose end may give way."""
    top = np.array([0, 0, 0.6])
    mesh = Mesh.from_lines([[0, 0, 0], LENGTH * ALONG, -top], [[2, 0], [0, 1]], {"post": [0], "beam": [1]})
    frame = Frame(members={"post": MemberProperties(Material("post", E, RHO), BOX), "beam": properties(end)})
    model = Model(mesh.refined(counts={"post": 2, "beam": n}), (frame, fix(2), fix(1, ("x", "y", "z"))))
    return model.with_effect(*(with_frame(e, model) for e in effects))


def frequencies(end, *effects):
    return solve_modes(assemble(corner(end, *effects, n=2 * N)), 5).frequency


MESH = 3e-4
SOFTER = ("zone_form", "clamp_form", "stiffness_loss", "member_stiffness", "member_torsion", "preload")
STIFFER = ("zone_form stiffer", "rigid_end_zone", "solid_corner")


ALTERED = {
    **{kind: (lambda end, make=make: make(end)[0]) for kind, make in STRETCHED.items()},
    **{
        kind: (lambda end, kind=kind: changes(None)[kind][0])
        for kind in ("member_section", "member_torsion", "member_shear", "section_form")
    },
    "member_density": lambda end: MemberDensity(name="rho", member="beam", change=0.4),
    "preload": lambda end: Preload(name="pull", member="beam", tension=-2e4, buckling=1e6),
}


@pytest.mark.parametrize("end", list(ENDS))
@pytest.mark.parametrize("kind", list(ALTERED))
def test_frequencies_lie_between_those_of_the_limits(kind, end):
    """A flexibility lowers all frequencies, to those of a hinge at most; what is softer does, too."""
    end = ENDS[end]
    effect, soft = ALTERED[kind](end), releases(end)
    above, below = (
        frequencies(end, effect, *(e.with_values(compliance=c) for e in soft)) for c in (0.0, 10.0)
    )
    found, none = frequencies(end, effect, *soft), frequencies(end, *soft)
    # a slip takes mass along as statics has it: that errs as consistent mass does, with (βh)⁴
    assert (found <= above * (1 + MESH)).all()
    assert (found >= below * (1 - MESH)).all()
    if kind in SOFTER:
        assert (found <= none * (1 + MESH)).all()
    if kind in STIFFER:
        assert (found >= none * (1 - MESH)).all()


@pytest.mark.parametrize("end", ["released", "sprung", "tapered"])
def test_a_softer_stretch_is_that_of_the_section_with_its_form(end):
    """All of a member that lies in a stretch has e^u times the stiffness of its section: K stays positive."""
    model, u = member(ENDS[end]), -1.5
    (frame,) = model.of_kind(Frame)
    form = SectionForm(name="form", members=("beam",), frame=frame, Iy=-0.3, Iz=0.2, J=-0.1, shear=0.9)
    zones = (("beam", 0.0, LENGTH, 1),)
    clamp = ClampForm(name="clamp", zones=zones, place="end", frame=frame, shares=((1.0,) * 6,), u=u)
    K, expected = (sums(model.with_effect(*some))[0] for some in ((form, clamp), (form,)))
    if "stated" not in ENDS[end]:
        assert abs(K - np.exp(u) * expected).max() <= 1e-9 * abs(expected).max()
    scale = np.sqrt(np.outer(np.diag(K), np.diag(K)))
    assert np.linalg.eigvalsh(K / scale).min() > -1e-12


# ------------------------------------------------------------------------------------------ reduced models


def both_ways():
    """Return a model with a form and candidates that are in series, in whichever of the two they are."""
    end = {"spring": SPRING}
    model = corner(end)
    zone = with_frame(zone_of(end)[0], model)
    (form,) = (e for e in (changes(model.of_kind(Frame)[0])["section_form"][0],))
    (soft,) = releases(end)
    stiff = MemberStiffness(name="stiff", member="beam", change=0.2)
    crack = crack_of_beam()
    every = {e.name: e for e in (zone, form, soft, stiff, crack)}
    return model, every


VALUES = {
    ("zone", "u"): 0.7,
    ("zone", "mass"): 0.3,
    ("zone", "plane"): -0.4,
    ("form", "Iy"): 0.1,
    ("form", "A"): -0.05,
    ("soft ry", "compliance"): 3e-4,
    ("stiff", "change"): -0.25,
    ("crack", "compliance"): 2e-4,
    ("crack", "position"): 0.21,
    ("frame", "E:steel"): 1.1 * E,
    ("frame", "rho:steel"): 0.9 * RHO,
}


def reduced(model):
    """Return a reduced model that is all of it, and unit forces."""
    forces = np.eye(model.n_dof)[
        :, assemble(model).Q.tocsr().indptr[1:] > assemble(model).Q.tocsr().indptr[:-1]
    ]
    return reduce_model(model, forces, 400.0), forces


@pytest.mark.parametrize("inside", [("zone", "form"), ("soft ry",), ("zone", "soft ry", "crack"), ()])
def test_a_reduced_model_is_the_model_with_its_candidates(inside):
    plain, every = both_ways()
    model = plain.with_effect(*(every[n] for n in inside))
    candidates = [e for n, e in every.items() if n not in inside]
    small, _ = reduced(model)
    outputs = np.eye(model.n_dof)[:, [6 * 3 + 1, 6 * 3 + 2, 6 * 4 + 2]]
    f, refs = np.linspace(20.0, 300.0, 7), list(VALUES)
    engine = ParametricFRF(small, outputs, outputs, f, refs, candidates)
    at = np.array([VALUES[r] for r in refs])
    zeta = np.zeros(len(f))
    H, slopes, _ = engine.evaluate(at, zeta)
    whole = model.with_effect(*candidates).with_values(VALUES)
    places = [(3, "y"), (3, "z"), (4, "z")]
    exact = compute_frf(assemble(whole), f, places, places, kind="receptance")
    assert abs(H - exact.H).max() <= 1e-4 * abs(exact.H).max()
    for k, ref in enumerate(refs):
        step = 1e-5 * max(abs(VALUES[ref]), 1e-3 if ref[0] != "frame" else 0)
        up, down = (
            engine.evaluate(at + s * step * np.eye(len(at))[k], zeta, gradient=False)[0] for s in (1, -1)
        )
        rough = (up - down) / (2 * step)
        assert abs(slopes[k] - rough).max() <= 1e-4 * abs(rough).max(), ref


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_steps_of_what_gives_way_are_those_of_another_cut(end):
    """The congruence by the element's step equals a cut of the element with that step."""
    plain = corner(end)
    (frame,) = plain.of_kind(Frame)
    others = [with_frame(zone_of(end)[0], plain), changes(frame)["section_form"][0]]
    others += [MemberStiffness(name="stiff", member="beam", change=0.2), *releases(end)]
    others += [Preload(name="pull", member="beam", tension=2e4, buckling=1e6)]
    others += [MemberDamping(name="lossy", member="beam", loss_factor=0.03)]
    # a crack inside of the first element, and one at its end
    cracks = [replace(crack_of_beam(), name=f"crack {at}", position=at) for at in (0.21, h)]
    twist = EndRelease(name="twist", member="beam", end=1, direction="rx", compliance=1e-4, reference=1.0)
    model = plain.with_effect(*others, *cracks, twist)
    model = model.with_values({ref: v for ref, v in VALUES.items() if ref in model.values()})
    n_seen = 0
    for soft in (e for e in model.effects if isinstance(e, FollowsOthers)):
        refs = [r for r in soft.refers_to(model) if r[0] != soft.name]
        stepped = {r: model.with_values({r: model.values()[r] + 1e-200j}) for r in refs}
        for ref, steps in zip(refs, soft.steps_by_others(model, stepped), strict=True):
            anew = soft.contribute(stepped[ref])
            for key in "KMD":
                found, expected = (
                    [np.imag(X) for c in parts if (X := getattr(c, key)) is not None]
                    for parts in (steps, anew)
                )
                now = [np.abs(X).max() for c in soft.contribute(model) if (X := getattr(c, key)) is not None]
                assert len(found) == len(expected) == len(now)
                for X, Y, size in zip(found, expected, now, strict=True):
                    n_seen += bool(Y.any())
                    rounding = 1e-13 * size * 1e-200 / max(abs(model.values()[ref]), 1e-3)
                    np.testing.assert_allclose(X, Y, rtol=0, atol=1e-9 * np.abs(Y).max() + rounding)
    assert n_seen > 20


@pytest.mark.parametrize("tried", ["zone", "form", "soft ry", "stiff", "crack"])
def test_a_candidate_that_is_tried_beside_others_is_in_series_with_them(tried):
    plain, every = both_ways()
    others = [e for n, e in every.items() if n != tried]
    model = plain.with_effect(*others[:2])
    small, _ = reduced(model)
    outputs = np.eye(model.n_dof)[:, [6 * 3 + 1, 6 * 3 + 2]]
    f, zeta = np.linspace(20.0, 300.0, 7), np.full(7, 0.01)
    engines = [
        ParametricFRF(small, outputs, outputs, f, [r for r in VALUES if r[0] != tried], others[2:]),
        ParametricFRF(small, outputs, outputs, f, list(VALUES), [*others[2:], every[tried]]),
    ]
    at = [np.array([VALUES[r] for r in engine.refs]) for engine in engines]
    now = every[tried].with_values(**{p: v for (n, p), v in VALUES.items() if n == tried})
    (found,) = LocalChanges.of(engines[0], at[0], zeta).receptances([now])
    expected = engines[1].evaluate(at[1], zeta, gradient=False)[0]
    # of a form that acts on a whole member the strongest twelve motions are kept
    assert abs(found - expected).max() <= (1e-2 if tried == "form" else 1e-3) * abs(expected).max()


def test_a_model_that_is_assembled_anew_is_in_series_with_what_is_new():
    plain, every = both_ways()
    before = plain.with_effect(every["soft ry"], every["stiff"])
    for after in (
        before.with_effect(every["zone"]),
        before.without_effect("stiff"),
        before.with_values({("stiff", "change"): 0.5}),
    ):
        again, fresh = reassemble(assemble(before), after), assemble(after)
        for key in "KM":
            X, Y = (getattr(s, key).toarray() for s in (again, fresh))
            assert abs(X - Y).max() <= 1e-12 * abs(Y).max()


def test_the_derivatives_of_a_model_are_those_of_all_that_is_in_series():
    plain, every = both_ways()
    model = plain.with_effect(*every.values())
    for ref in VALUES:
        parts = differentiate_matrices(model, ref)
        found = sum_contributions(tuple(Contribution(p.dofs, p.K, p.M) for p in parts), model.n_dof)[:2]
        value = model.values()[ref]
        step = 1e-4 * max(abs(value), 1e-3 if ref[1] == "compliance" else 0.1)
        up, down = (sums(model.with_values({ref: value + s * step}))[:2] for s in (1, -1))
        for X, a, b in zip(found, up, down, strict=True):
            rough = (a - b) / (2 * step)
            rounding = 1e-15 * abs(a).max() / step
            assert abs(X.toarray() - rough).max() <= 1e-5 * abs(rough).max() + rounding, ref


def test_what_gives_way_in_series_is_cut_once_for_a_model(monkeypatch):
    """Each is in series with those before it, which are not computed again for each one behind them."""
    soft = [
        EndRelease(name=d, member="beam", end=1, direction=d, compliance=1e-4, reference=1e-4)
        for d in ("rx", "ry", "rz")
    ]
    model, cuts = corner({}, n=1).with_effect(*soft), []
    monkeypatch.setattr("fem.effects.giving_way.cut", lambda *args: cuts.append(args) or cut(*args))
    model.contributions()
    assert len(cuts) == len(soft)
