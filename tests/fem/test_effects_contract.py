"""What every effect promises, walked over all kinds on three models; a new one is met by itself."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fem import (
    Frame,
    Joint,
    LoadCase,
    Material,
    Role,
    Section,
    assemble,
    compute_frf,
    differentiate_frf,
    differentiate_modes,
    lever_matrix,
    parameter_values,
    prestressed,
    solve_modes,
    solve_static,
)
from fem.effects import (
    MassDamping,
    Plane,
    SectionShear,
    Spin,
    SprungMass,
    StiffnessDamping,
    candidate_kinds,
    effect_classes,
)
from fem.effects.moving_base import base_moved
from fem.model import Instruments
from tests.frames import beam, braced, cross_beam, fix, mounted, portal, welded, with_part

SHEAR = SectionShear(
    groups={"upper": ("upper",), "lower": ("lower",)}, directions={"upper": ("ky", "kz"), "lower": ("k",)}
)

MODELS = {
    "cross": cross_beam(0.1),
    # shear coefficients that the model's sections do not have
    "sheared": cross_beam(0.1).with_effect(
        SHEAR.with_values(**{"ky:upper": 1.7, "kz:upper": 0.6, "k:lower": 1.3})
    ),
    "portal": portal(0.2),
    # one member, rigid zones, offsets, a material with a loss factor, at an odd angle
    "cantilever": beam(
        5,
        0.7,
        effects=(fix(0, name="wall"),),
        along=(1, 2, -0.5),
        theory="timoshenko",
        material=Material("damped", 70e9, 2700.0, loss_factor=0.02),
        rigid1=0.05,
        offset1=np.array([0, 0, 0.02]),
        offset2=np.array([0.01, 0, -0.03]),
    ),
    "mounts": mounted(),
    # two members: one tapers, is on springs and hinged, its mass in lumps; the other is a bar in one piece
    "options": braced(),
    # ends of solid bars on others, one with a rigid zone
    "welded": welded(0.15, rigid1=0.004),
    "part": with_part(),
    # on an elastic foot, with an absorber
    "footed": beam(5).with_effect(
        Joint(
            name="foot",
            point1=2,
            location=np.array([0.4, 0.0, -0.01]),
            K=np.diag([2e6, 3e6, 4e6, 5e2, 7e2, 9e2]),
        ),
        SprungMass(
            name="absorber",
            point=3,
            mass=0.2,
            k={"x": 2e4, "z": 3e4, "ry": 40.0},
            c={"z": 8.0},
            eta=0.02,
            inertia=np.diag([1e-4, 2e-4, 1e-4]),
            arm=np.array([0.01, 0.0, 0.03]),
            axes=np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]),
        ),
    ),
    # all six section forces in each member
    "loaded": prestressed(portal(0.2), solve_static(assemble(portal(0.2)), LoadCase(gravity=(3, 4, -9.81)))),
}
GROUNDED = {
    "support_flexibility",
    "foundation",
    "foundation_dashpot",
    "ground_spring",
    "ground_damper",
    "side_spring",
}
GROUNDED |= {"stinger", "driver_form", "foot_shift", "support_shift"}
"""Kinds that may hold a rigid body."""

TURNED = {"preload", "prestress", "rotor", "spin", "joint_hole", "part_shift"}
"""Kinds that resist its rotations: a force or an angular momentum that keeps its direction, or a part that
lies elsewhere than the mesh has it, so that the rotation of the mesh is none of the structure."""

BRAKED = {"mass_damping"}
"""Kinds that brake a rigid body."""

OF_ALL = {"mass_damping", "stiffness_damping"}
"""Kinds that are formed of all other effects or all joints, in a fit of those at nominal values."""

DIFFERENCES = {"member_section", "member_shear", "member_torsion", "shear_centre"}
"""Kinds that are what other sections, or another axis of twist, add."""


QUANTITY = re.compile(r"`(\w+)` \[([^\]]+)\]")
"""A parameter and its units in the documentation's entry of an effect."""

KEYS = ("K", "M", "C", "D", "storage", "loss")


def candidates(model, kind):
    """Return the candidates of a kind, in a test with sensors along the structure and two excitations."""
    n = model.mesh.n_points
    sensors, drivers = np.arange(1, n, 2), np.array([1, n - 1])
    axes = np.eye(3)
    slanted = np.array([0.6, 0.0, 0.8])
    test = Instruments(sensors, axes[np.arange(len(sensors)) % 3], drivers, np.array([axes[2], slanted]))
    return effect_classes()[kind].propose(model.with_instruments(test))


NOT_PROPOSED = (
    MassDamping(name="alpha", alpha=1.0),
    StiffnessDamping(name="beta", beta=1e-5),
    SHEAR,
)
"""Effects of kinds that a search does not propose, on the crossed beams."""

SHAFT = beam(
    3,
    0.6,
    along=(1, 2, -0.5),
    section=Section.circle(0.02),
    section2=Section.circle(0.03),
    theory="timoshenko",
    rigid1=0.05,
    offset1=np.array([0, 0, 0.02]),
    spring2={"ry": 2e3},
    spin=-1.5,
)
"""A tapered shaft, which may spin."""


OPEN = beam(
    4,
    0.9,
    effects=(fix(0, name="wall"),),
    along=(1, -2, 0.5),
    material=Material("damped", 70e9, 2700.0, loss_factor=0.02),
    section=Section.channel(0.05, 0.1, 0.006, 0.004),
    section2=Section.channel(0.03, 0.06, 0.006, 0.004),
    rigid1=0.05,
    offset1=np.array([0, 0, 0.02]),
    offset2=np.array([0.01, 0, -0.03]),
)
"""A tapered channel, which twists beside its centroid."""


def some(effects):
    """Yield the middle one of the candidates of a kind; the first and the last for `make long`."""
    n = len(effects)
    for i in sorted({0, n // 2, n - 1}) if n else ():
        yield effects[i], () if i == n // 2 else pytest.mark.long


CASES = [
    pytest.param(model, effect, id=f"{name}-{effect.name}", marks=marks)
    for name, model in MODELS.items()
    for kind in candidate_kinds()
    # beside the mast's own softness a support of 1e9 N/m cannot be seen; "loaded" is a prestressed "portal"
    if name != "options" or kind not in ("support_flexibility", "foundation", "foundation_dashpot")
    if name != "loaded"
    if kind != "joint_patch"  # adds nothing by itself: see test_effects_patch.py
    for effect, marks in some(candidates(model, kind))
]
CASES += [pytest.param(MODELS["cross"], effect, id=f"cross-{effect.name}") for effect in NOT_PROPOSED]
SPIN = Spin(name="spin", speed=40.0)
CASES.append(pytest.param(SHAFT, SPIN, id="shaft-spin"))
CASES += [pytest.param(OPEN, e, id=f"open-{e.name}") for e in candidates(OPEN, "shear_centre")]
SHAKEN = base_moved(braced(), np.array([[1.0, 0, 0], [0, 0.6, 0.8]]))
"""A frame on a base that moves."""

PLANE = Plane(name="plane", plane="xz")
"""It has constraints alone: see test_plane.py."""
OWN = [
    pytest.param(model, effect, id=f"{name}-{effect.name}")
    for name, model in (*MODELS.items(), ("shaken", SHAKEN))
    for effect in model.effects
]


def matrices(effect, model):
    """Return an effect's K, M, C, D and what its laws make of K at 80 Hz, complex where its values are.

    Shape (6, n_dof, n_dof); K is static, the last two are storage and loss.
    """
    out = np.zeros((len(KEYS), model.n_dof, model.n_dof), dtype=complex)
    for part in effect.contribute(model):
        of_law = (None, None)
        if part.law is not None:
            of_law = [factor[0] * part.K for factor in part.law(np.array([2 * np.pi * 80.0]))]
        for k, X in enumerate((part.static, part.M, part.C, part.D, *of_law)):
            if X is not None:
                np.add.at(out[k], (part.dofs[:, :, None], part.dofs[:, None, :]), X)
    return out if np.iscomplexobj(out) else out.astype(complex)


def generic(effect):
    """Return an effect with values of no special kind, inside the bounds: what a fit meets on its way."""
    values = {}
    for i, p in enumerate(effect.parameters()):
        size = abs(p.value) or (min(abs(p.upper), 1.0) if np.isfinite(p.upper) else 1.0)
        values[p.name] = float(np.clip(p.value + (0.137 + 0.01 * i) * size, p.lower, p.upper))
    return effect.with_values(**values)


def check_absent(model, effect):
    absent = {p.name: p.absent for p in effect.parameters()}
    if all(np.isfinite(v) for v in absent.values()):
        if effect.released():  # a clamp that is moved, in place of constraints
            check_held(model, effect.with_values(**absent))
            return
        assert not matrices(effect.with_values(**absent), model).any(), (
            "there, though every value says absent"
        )
        return
    # Absent at infinite stiffness: what is left is a compliance 1/(k + k0), k0 the structure's own stiffness.
    (p,) = (p for p in effect.parameters() if not np.isfinite(p.absent))
    first = 1e9 if p.unit == "N/m" else 1e5
    at = [(point, d) for point in (1, model.mesh.n_points - 1) for d in ("x", "y", "z")]

    def receptance(model):
        return compute_frf(assemble(model), [3.0], at, at, kind="receptance", method="direct").H[0]

    rigid = receptance(model)
    soft, stiff = (
        receptance(model.with_effect(effect.with_values(**{p.name: k}))) - rigid for k in (first, 10 * first)
    )
    seen = abs(soft) > 1e-6 * abs(rigid).max()
    assert seen.any(), "releases nothing"
    assert abs(soft).max() < 0.2 * abs(rigid).max(), "does not become rigid"
    ratio = soft[seen] / stiff[seen]
    # (10 k + k0)/(k + k0), and k0 is at most a tenth of k here: EA/L of an element, 4 EI/L; several springs
    # have several k0, whose differences may show where their parts nearly cancel
    assert ((abs(ratio) > 10.1 / 1.1) & (abs(ratio) < 10.3)).all(), "does not become rigid"


def check_held(model, effect):
    """A clamp where the model has it holds as the model's does."""
    at = [(point, d) for point in (1, model.mesh.n_points - 1) for d in ("x", "y", "z")]
    H = [
        compute_frf(assemble(m), [3.0], at, at, kind="receptance", method="direct").H[0]
        for m in (model, model.with_effect(effect))
    ]
    assert abs(H[1] - H[0]).max() < 1e-6 * abs(H[0]).max(), "does not hold where the model is held"


def check_symmetry(model, effect):
    X = matrices(generic(effect), model)
    assert X.any(), "adds nothing"
    for k in range(len(KEYS)):
        other = X[k].T if effect.reciprocal else -X[k].T
        assert abs(X[k] - other).max() <= 1e-14 * abs(X[k]).max(), f"{KEYS[k]} is not symmetric"


def check_rigid_motion(model, effect):
    on_foot = any(j.point1 is None or j.point2 is None for j in model.of_kind(Joint))
    if effect.kind in GROUNDED or on_foot:
        return
    motions = np.vstack([lever_matrix(p - model.mesh.points.mean(axis=0)) for p in model.mesh.points])
    motions = np.vstack([motions, np.zeros((model.n_dof - len(motions), 6))])  # coordinates inside stay
    motions = motions[:, :3] if effect.kind in TURNED else motions
    # what is a difference of two members' matrices rounds like these
    (frame,) = model.of_kind(Frame)
    rounding = 1e-15 * abs(matrices(frame, model)[0]).max() if effect.kind in DIFFERENCES else 0.0
    for X in matrices(generic(effect), model)[[0, 2, 3, 4, 5]]:
        if effect.kind in BRAKED:
            continue
        bound = 1e-13 * max(abs(X).max(), 1e-300) + rounding
        assert abs(X @ motions).max() <= bound, "resists a rigid motion"


def check_derivatives(model, effect):
    effect = generic(effect)
    (frame,) = model.of_kind(Frame)
    # what is a difference of two members' matrices rounds like these
    whole = (
        abs(matrices(frame, model)).max(axis=(1, 2)) if effect.kind in DIFFERENCES else np.zeros(len(KEYS))
    )
    for p in effect.parameters():
        step = 1e-5 * (abs(p.value) or 1.0)
        exact = np.imag(matrices(effect.with_values(**{p.name: p.value + 1e-200j}), model)) / 1e-200

        def at(value, name=p.name):
            return matrices(effect.with_values(**{name: value}), model).real

        here = at(p.value)
        near = (at(p.value + step) - at(p.value - step)) / (2 * step)
        far = (at(p.value + 2 * step) - at(p.value - 2 * step)) / (4 * step)
        # Central differences err by step² f‴/6, a third of what the two differ by; the rest is rounding.
        for k in range(len(KEYS)):
            rounding = (1e-13 * abs(here[k]).max() + 1e-15 * whole[k]) / step
            bound = abs(far - near)[k].max() + rounding
            assert abs(exact - near)[k].max() <= bound, f"derivative of {KEYS[k]} by {p.name}"


def check_linear(model, effect):
    effect = generic(effect)
    for p in effect.parameters():
        if not p.linear:
            continue
        step = 0.1 * (abs(p.value) or 1.0)
        X = [matrices(effect.with_values(**{p.name: p.value + i * step}), model).real for i in range(3)]
        bend = X[0] - 2 * X[1] + X[2]
        assert abs(bend).max() <= 1e-13 * max(abs(x).max() for x in X), f"is not affine in {p.name}"


def check_values(model, effect):
    names = [p.name for p in effect.parameters()]
    assert len(set(names)) == len(names)
    for p in effect.parameters():
        assert p.lower <= p.value <= p.upper, f"{p.name} starts outside its bounds"
        assert p.unit, f"{p.name} has no unit"
    changed = generic(effect)
    same = effect.with_values(**parameter_values(effect))
    np.testing.assert_array_equal(matrices(same, model), matrices(effect, model))
    back = changed.with_values(**parameter_values(effect))
    np.testing.assert_array_equal(matrices(back, model), matrices(effect, model))
    assert all(a.value != b.value for a, b in zip(changed.parameters(), effect.parameters(), strict=True))
    assert changed.name == effect.name
    assert type(changed) is type(effect)


def check_place(model, effect):
    assert effect.where
    places = effect.locations(model)
    assert places.shape[1] == 3
    assert len(places) >= 1
    for place in places:
        # a joint's place may lie off the members' axes, by its lever arms; no farther than a section is wide
        assert model.mesh.nearest_on_members(place)[2] <= 0.03, "lies off the structure"


def check_starts(model, effect):
    starts = effect.starts(lambda key: 1e6)
    assert starts
    known = {p.name: p for p in effect.parameters()}
    for values in starts:
        assert values.keys() <= known.keys()
        for name, value in values.items():
            assert known[name].lower <= value <= known[name].upper, f"{name} = {value} is outside its bounds"


def check_references(model, effect):
    # What a fit varies beside the effect may change its matrices too; then it has to say so.
    if effect.kind in OF_ALL:
        return
    effect = generic(effect)
    for other in model.effects:
        for p in other.parameters():
            ref = (other.name, p.name)
            changed = model.with_values({ref: p.value * (1 + 1e-200j) if p.value else 1e-200j})
            if np.imag(matrices(effect, changed)).any():
                assert ref in effect.refers_to(model), f"does not say that it depends on {ref}"


MATRICES = {
    Role.STIFFNESS: {"K", "M", "D", "storage"},  # an element that bends otherwise spreads its mass otherwise
    Role.MASS: {"M"},
    Role.DISSIPATION: {"C", "D", "loss"},
    Role.GYROSCOPIC: {"C"},
    Role.INITIAL_STRESS: {"K"},
    Role.GEOMETRY: {"K", "M", "D"},
}
"""Matrices to which effects of each role may add."""


def check_role(model, effect):
    X = matrices(generic(effect), model)
    there = {key for key, x in zip(KEYS, X, strict=True) if x.any()}
    assert there <= set().union(*(MATRICES[role] for role in effect.role)), f"adds to {sorted(there)}"
    if not effect.role & (Role.MASS | Role.GEOMETRY):
        x, y, z = (np.arange(model.n_dof) % 6 == i for i in range(3))
        size = abs(X[1]).max()
        assert all(abs(X[1][d][:, d].sum()) <= 1e-12 * model.n_dof * size for d in (x, y, z)), "has a mass"


def check_position(model, effect):
    for p in effect.parameters():
        assert p.position == (p.name == "position")
        if p.position:
            assert 0 <= p.lower < p.upper <= model.mesh.member_length(effect.member)


def check_connection(model, effect):
    """Stiffness that vanishes with a joint's is the joint's, and damped as joints are."""
    name = getattr(effect, "joint", None)
    if not isinstance(name, str):
        return
    slack = tuple(replace(e, K=1e-9 * e.K) if e.name == name else e for e in model.effects)
    before, after = (
        np.abs(matrices(generic(effect), m)[0]).max() for m in (model, replace(model, effects=slack))
    )
    if before > 0 and after < 1e-6 * before:
        assert effect.connection


CHECKS = (check_absent, check_symmetry, check_rigid_motion, check_derivatives, check_linear)
CHECKS += (
    check_values,
    check_place,
    check_starts,
    check_references,
    check_role,
    check_position,
    check_connection,
)


@pytest.mark.parametrize(("model", "effect"), CASES)
def test_candidate_keeps_the_contract(model, effect):
    for check in CHECKS:
        check(model, effect)


@pytest.mark.parametrize(("model", "effect"), OWN)
def test_effects_of_a_model_keep_the_contract(model, effect):
    check_derivatives(model, effect)
    check_linear(model, effect)
    if effect.parameters():
        check_symmetry(model, effect)
        check_rigid_motion(model, effect)


@pytest.mark.parametrize("name", MODELS)
def test_names_are_unique_and_differ_from_the_models(name):
    model = MODELS[name]
    names = [e.name for kind in candidate_kinds() for e in candidates(model, kind)]
    names += [e.name for e in model.effects]
    assert len(set(names)) == len(names)


def test_every_kind_is_proposed_somewhere():
    met = {
        effect.kind
        for model in (*MODELS.values(), OPEN)
        for k in candidate_kinds()
        for effect in candidates(model, k)
    }
    assert met == set(candidate_kinds())
    own = {effect.kind for model in (*MODELS.values(), SHAKEN) for effect in model.effects}
    own |= {effect.kind for effect in (*NOT_PROPOSED, SPIN, PLANE)}
    assert met | own - {Frame.kind} == set(effect_classes()), "a kind is on no model of this file"
    assert not {effect.kind for effect in NOT_PROPOSED} & met


# ------------------------------------------------------------- derivatives of frequencies, shapes and FRFs


def changed(model, effect):
    """Return a model in which an effect stands for its namesake, or is added."""
    if effect.name not in {e.name for e in model.effects}:
        return model.with_effect(effect)
    return replace(model, effects=tuple(effect if e.name == effect.name else e for e in model.effects))


def stepped(model, effect, ref, of):
    """Return what a function makes of effects and model, summed, with a complex step of one parameter."""
    model = model.with_values({(effect.name, ref): parameter_values(effect)[ref] + 1e-200j})
    return sum(of(e, model) for e in model.effects)


def complex_newton(K, M, lam, phi):
    """Return derivatives of eigenvalues and basis of a set of modes, by Newton's method on a complex step.

    One step for K φ = M φ B with φ₀ᵀ M₀ φ fixed takes the imaginary parts of K and M over to B and φ exactly,
    as their squares vanish. The basis is then turned to the normalisation with φᵀ M dφ = -½ φᵀ dM φ.
    """
    n, s = phi.shape
    residual = K @ phi - M @ phi * lam
    scale = np.concatenate([1 / np.sqrt(K.real.diagonal()), np.ones(s)])
    dphi, B = np.zeros((n, s)), np.zeros((s, s))
    for j in range(s):
        border = M @ phi
        J = np.block([[K - lam[j] * M, -border], [border.T, np.zeros((s, s))]])
        rhs = np.concatenate([-residual[:, j], np.zeros(s)])
        step = scale * np.linalg.solve(scale[:, None] * J * scale, scale * rhs)
        dphi[:, j], B[:, j] = step.imag[:n] / 1e-200, step.imag[n:] / 1e-200
    dM = phi.T @ (M.imag / 1e-200) @ phi
    return np.linalg.eigvals(B).real, dphi - phi @ dM / 2


def check_mode_sensitivity(model, effect, system, n=4):
    Q = system.Q.toarray()
    refs = [(effect.name, p.name) for p in effect.parameters()]
    n += system.rigid.shape[1]
    result = differentiate_modes(system, refs, n, outputs="all")
    some = np.random.default_rng(0).standard_normal((3, model.n_dof))
    seen = differentiate_modes(system, refs, n, outputs=some)
    phi, lam = Q.T @ result.modes.shapes, result.modes.omega**2
    together = {int(k): s.modes for s in result.sets for k in s.modes}
    # An ω² is known to 1e-16 of the highest, and a shape turns by that over the distance to the next ω².
    rounding = 2e-16 * (abs(system.K.diagonal()) / np.maximum(system.M.diagonal(), 1e-9)).max()
    others = solve_modes(system, len(lam) + 6).omega ** 2
    for i, p in enumerate(effect.parameters()):
        K, M = Q.T @ stepped(model, effect, p.name, matrices)[:2] @ Q
        per_one = 1 / (abs(p.value) or 1.0)  # what a change of the parameter by its own size makes
        for k in range(len(lam)):
            g = together.get(k, np.array([k]))
            if k != g[0]:
                continue
            slope, dphi = complex_newton(K, M, lam[g], phi[:, g])
            far = np.delete(others, g) if g[-1] < len(others) else others
            turn = 30 * rounding / abs(far - lam[k]).min()
            bound = 30 * rounding * per_one + (turn + 1e-9) * abs(slope).max()
            difference = np.sort(result.eigenvalue[i, g]) - np.sort(slope)
            assert abs(difference).max() <= bound, f"dω² of mode {k + 1} by {p.name}"
            exact = Q @ dphi
            bound = (turn + 1e-7) * abs(exact).max() + turn * abs(phi[:, g]).max() * per_one
            assert abs(result.shapes[i][:, g] - exact).max() <= bound, f"shape of mode {k + 1} by {p.name}"
            difference = abs(seen.shapes[i][:, g] - some @ exact).max()
            assert difference <= bound * abs(some).sum(axis=1).max(), f"mode {k + 1} at outputs by {p.name}"


def dynamic(effect, model):
    """Return the real and the imaginary part of an effect's Z at 80 Hz, (2, n_dof, n_dof), either complex."""
    omega, eta = 2 * np.pi * 80.0, model.damping.loss_factor
    K, M, C, D, *_ = matrices(effect, model)
    out = np.stack([K - omega**2 * M, eta * K + D + omega * C])
    for part in effect.contribute(model):
        if part.law is not None:
            storage, loss = part.law(np.array([omega]))
            for X, change in zip(out, (storage[0] * part.K - part.static, loss[0] * part.K), strict=True):
                np.add.at(X, (part.dofs[:, :, None], part.dofs[:, None, :]), change)
    return out


def check_frf_sensitivity(model, effect, system):
    Q = system.Q.toarray()
    refs = [(effect.name, p.name) for p in effect.parameters()]
    out, inn = np.random.default_rng(0).standard_normal((2, 2, model.n_dof))
    direct, reduced = (
        differentiate_frf(system, [80.0], out, inn, refs, "receptance", method)
        for method in ("direct", "reduced")
    )
    forces = np.vstack([Q.T @ inn.T, np.zeros((system.n_free, 2))])
    for i, p in enumerate(effect.parameters()):
        real, imag = Q.T @ stepped(model, effect, p.name, dynamic) @ Q
        # (A + iB) u = f as real equations, which leaves the complex step to the parameter
        u = np.linalg.solve(np.block([[real, -imag], [imag, real]]), forces).reshape(2, -1, 2)
        exact, slope = (out @ Q @ (x[0] + 1j * x[1]) for x in (u.real, u.imag / 1e-200))
        level, per_one = abs(exact).max(), 1 / (abs(p.value) or 1.0)
        # rounding: 1e-16 of the highest ω² is some 1e-8 of what decides a response at 80 Hz
        assert abs(direct.frf.H[0] - exact).max() <= 1e-8 * level
        bound = 1e-7 * abs(slope).max() + 1e-9 * level * per_one
        assert abs(direct.dH[i, 0] - slope).max() <= bound, f"dH by {p.name}, direct"
        # six Krylov vectors and modes up to 2.5 times the line's frequency leave (1/2.5)^12 of higher modes
        # loads of a loss all along a member are not in the basis, and its modes above 2.5 times the line's
        # frequency respond to them like (1/2.5)² of those below
        spread = 2.5**-2 * p.value if effect.kind == "member_damping" else 0.0
        # shear counts more the shorter the wave: by k² ~ ω
        short = 2.5 if p.name == "shear" else 1.0
        bound = (2e-4 * short + spread) * abs(slope).max() + 1e-8 * level * per_one
        assert abs(reduced.dH[i, 0] - slope).max() <= bound, f"dH by {p.name}, reduced"


def first_of_each_kind(cases):
    """Return one case of each kind on each model, and all of a model's own effects."""
    out = {}
    for case in cases:
        _, effect = case.values
        if effect.parameters() and effect.reciprocal:
            key = case.id.partition("-")[0], effect.kind
            out.setdefault(key, pytest.param(*case.values, id=case.id))
    return list(out.values())


WITH_PARAMETERS = [*first_of_each_kind(CASES), *(case for case in OWN if case.values[1].parameters())]


@pytest.mark.parametrize(("model", "effect"), WITH_PARAMETERS)
def test_modes_and_frfs_have_the_derivatives_of_a_complex_step(model, effect):
    effect = generic(effect)
    model = changed(model, effect)
    system = assemble(model)
    check_mode_sensitivity(model, effect, system)
    check_frf_sensitivity(model, effect, system)


@pytest.mark.parametrize("kind", candidate_kinds())
def test_the_documentation_names_the_parameters_of_a_kind(kind):
    """All of them, each with the units that it has on some model."""
    entry = effect_classes()[kind].entry
    there = {}
    for effect in (e for model in (*MODELS.values(), OPEN) for e in candidates(model, kind)):
        for p in effect.parameters():
            there.setdefault(p.name, set()).add(p.unit)
    listed = {name: set(units.split(" or ")) for name, units in QUANTITY.findall(entry.quantities)}
    assert listed.keys() == there.keys()
    for name, units in there.items():
        assert units <= listed[name]
    assert entry.meaning
    assert entry.places
