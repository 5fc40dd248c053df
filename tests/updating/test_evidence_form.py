"""The form of frames: what lets it vary does what other sections and stiffer stretches do."""

import numpy as np
import pytest

from fem import Section, assemble, solve_modes
from fem.effects import ClampForm, SectionForm, ZoneForm
from tests.frames import FLAT, STEEL, beam, fix, frequencies, portal
from updating.inference import form_of


def tip_compliance(model, direction):
    system = assemble(model)
    dof = 6 * int(model.mesh.member_points(next(iter(model.mesh.members)))[-1]) + direction
    force = np.zeros(model.n_dof)
    force[dof] = 1.0
    reduced = system.Q.T @ force
    return float(force @ (system.Q @ np.linalg.solve(system.K.toarray(), reduced)))


def test_form_of_no_size_changes_nothing():
    model = portal()
    effects, nuisances = form_of(model)
    kinds = {e.kind for e in effects}
    assert kinds == {"section_form", "zone_form", "clamp_form"}
    assert {(n.effect, n.parameter) for n in nuisances} == {
        (e.name, p.name) for e in effects for p in e.parameters()
    }
    formed = model
    for e in effects:
        formed = formed.with_effect(e)
    np.testing.assert_allclose(frequencies(formed), frequencies(model), rtol=1e-9)


@pytest.mark.parametrize(("key", "local"), [("Iy", 2), ("Iz", 1)])
def test_a_section_that_is_stiffer_in_one_plane_gives_a_cantilever_that_is_so(key, local):
    """w = F L³ / (3 E I) + F L / (k G A): the part of bending falls with 1 + x."""
    model = beam(8).with_effect(fix(0))
    (form,) = (e for e in form_of(model)[0] if isinstance(e, SectionForm))
    axes = model.effect("frame").rotations(model.mesh)[0]
    direction = int(np.argmax(np.abs(axes[local])))
    L = model.mesh.member_length(next(iter(model.mesh.members)))
    I = getattr(FLAT, key)
    bending = L**3 / (3 * STEEL.E * I)
    before = tip_compliance(model, direction)
    after = tip_compliance(model.with_effect(form.with_values(**{key: 0.1})), direction)
    # K grows by 0.1 times its derivative, of which shear takes the second order.
    assert before - after == pytest.approx(bending * (1 - 1 / 1.1), rel=2e-3)


def test_a_section_that_gives_way_to_shear_gives_a_cantilever_that_does():
    """w = F L³ / (3 E I) + F L / (k G A): the part of shear grows with 1 + x."""
    L = 0.1
    model = beam(16, L, theory="timoshenko").with_effect(fix(0))
    (form,) = (e for e in form_of(model)[0] if isinstance(e, SectionForm))
    axes = model.effect("frame").rotations(model.mesh)[0]
    direction, G = int(np.argmax(np.abs(axes[1]))), STEEL.E / (2 + 2 * STEEL.nu)
    before = tip_compliance(model, direction)
    after = tip_compliance(model.with_effect(form.with_values(shear=0.01)), direction)
    assert after - before == pytest.approx(0.01 * L / (FLAT.ky * G * FLAT.A), rel=0.03)


def test_largest_shear_form_doubles_the_shear_flexibility():
    """K (1 - x) of elements that shear governs: x = 1/2 leaves half of their stiffness, 1 would leave none.

    With φ = 12 E I / (k G A l²) of an element, what it gives way grows by φ x / (1 - x φ / (1 + φ)).
    """
    n, L = 16, 0.1
    model = beam(n, L, theory="timoshenko").with_effect(fix(0))
    (form,) = (e for e in form_of(model)[0] if isinstance(e, SectionForm))
    (upper,) = (p.upper for p in form.parameters() if p.name == "shear")
    axes = model.effect("frame").rotations(model.mesh)[0]
    direction, G = int(np.argmax(np.abs(axes[1]))), STEEL.E / (2 + 2 * STEEL.nu)
    shear = L / (FLAT.ky * G * FLAT.A)
    phi = 12 * STEEL.E * FLAT.Iz / (FLAT.ky * G * FLAT.A * (L / n) ** 2)
    before = tip_compliance(model, direction)
    after = tip_compliance(model.with_effect(form.with_values(shear=upper)), direction)
    assert after - before == pytest.approx(shear * 0.5 / (1 - 0.5 * phi / (1 + phi)), rel=1e-6)
    assert after - before == pytest.approx(shear, rel=2 / phi)


def test_shear_that_is_uncertain_already_is_no_part_of_the_form():
    for section, uncertain in ((FLAT, True), (Section.hollow_rectangle(0.04, 0.03, 0.002), False)):
        model = beam(8, section=section, theory="timoshenko", effects=(fix(0),))
        (form,) = (e for e in form_of(model)[0] if isinstance(e, SectionForm))
        assert ("shear" in {p.name for p in form.parameters()}) == uncertain


def test_a_heavier_section_lowers_the_frequencies_of_bending():
    """ω ~ √(E I / ρ A): a slender beam whose area alone is larger by x vibrates 1/√(1 + x) as fast."""
    model = beam(8, effects=(fix(0),))
    (form,) = (e for e in form_of(model)[0] if isinstance(e, SectionForm))
    heavier = frequencies(model.with_effect(form.with_values(A=0.1)), 2)
    np.testing.assert_allclose(heavier * np.sqrt(1.1), frequencies(model, 2), rtol=1e-4)


def test_a_stiffer_stretch_gives_way_less_by_its_share_of_the_flexibility():
    """A cantilever's tip: ∫ x² / (E I) dx, of which the stretch at the clamp keeps e^-u."""
    model = beam(8).with_effect(fix(0))
    member = next(iter(model.mesh.members))
    L, z, u = model.mesh.member_length(member), 0.13, 1.2
    zone = ZoneForm(
        name="zone", zones=((member, 0.0, z, 1),), place="clamp", frame=model.effect("frame"), u=u
    )
    axes = model.effect("frame").rotations(model.mesh)[0]
    direction = int(np.argmax(np.abs(axes[2])))
    lost = (L**3 - (L - z) ** 3) / (3 * STEEL.E * FLAT.Iy) * (1 - np.exp(-u))
    change = tip_compliance(model, direction) - tip_compliance(model.with_effect(zone), direction)
    assert change == pytest.approx(lost, rel=2e-3)


def test_a_connection_that_turns_carries_the_inertia_of_its_stretches():
    """Where the mesh turns about a point as a rigid body, θᵀ M θ grows by a share of ∫ m s² ds."""
    model = portal()
    corner = next(e for e in form_of(model)[0] if isinstance(e, ZoneForm))
    turned = np.zeros((len(model.mesh.points), 6))
    turned[:, 3] = 1.0
    turned[:, :3] = np.cross([1.0, 0.0, 0.0], model.mesh.points)
    *_, gained = corner.with_values(inertia=0.3).contribute(model)
    energy = sum(q @ M @ q for M, q in zip(gained.M, turned.ravel()[gained.dofs], strict=True))
    frame = model.effect("frame")
    integral = sum(frame.mass_per_length(m) * z**3 / 3 for m, _, z, _ in corner.zones)
    assert energy == pytest.approx(0.3 * integral, rel=1e-9)


def test_a_clamp_may_give_way_as_on_an_elastic_half_space():
    """A rigid square of side b rocks on a half-space with K = 3.6 G (b/2)³ / (1 - ν) (Dobry and Gazetas)."""
    b, L, nu = 0.02, 1.0, 0.3
    model = beam(8, L, section=Section.rectangle(b, b), effects=(fix(0),))
    (clamp,) = (e for e in form_of(model)[0] if isinstance(e, ClampForm))
    rocking = 3.6 * STEEL.E / (2 + 2 * nu) * (b / 2) ** 3 / (1 - nu)
    u = -np.log(1 + STEEL.E * b**4 / 12 / (rocking * b / 4))
    assert clamp.parameters()[0].lower < u < -0.5
    soft, stiff = (tip_compliance(m, 2) for m in (model.with_effect(clamp.with_values(u=u)), model))
    assert soft - stiff == pytest.approx(L**2 / rocking, rel=b / L)  # the stretch turns b/8 from the clamp


def test_a_flat_gives_way_at_its_clamp_by_its_depth_in_each_plane():
    """Both planes gain length in proportion to the depth: what turns is δ L² / (E I), δ ~ h."""
    model = beam(8, effects=(fix(0),))
    (clamp,) = (e for e in form_of(model)[0] if isinstance(e, ClampForm))
    soft = model.with_effect(clamp.with_values(u=-1.0))
    axes = model.effect("frame").rotations(model.mesh)[0]
    y, z = (int(np.argmax(np.abs(axes[k]))) for k in (1, 2))
    turned = [
        (tip_compliance(soft, d) - tip_compliance(model, d)) * STEEL.E * I
        for d, I in ((y, FLAT.Iz), (z, FLAT.Iy))
    ]
    assert turned[0] / turned[1] == pytest.approx(0.03 / 0.01, rel=0.01)


def test_a_support_that_lets_turn_has_no_form():
    model = beam(8, effects=(fix(0, ("x", "y", "z")),))
    assert not [e for e in form_of(model)[0] if isinstance(e, ClampForm)]


def test_a_corner_is_stiffer_in_its_plane_alone():
    """A portal lies in a plane: out of it bending stays as it is, in it ``plane`` does as ``u`` does."""
    model = portal()
    corner = next(e for e in form_of(model)[0] if isinstance(e, ZoneForm))
    normal = int(np.argmin(np.ptp(model.mesh.points, axis=0)))

    def shapes_of(effect):
        modes = solve_modes(assemble(model.with_effect(effect)), n=6)
        motion = np.abs(modes.shapes.reshape(-1, 6, 6))
        across = motion[:, normal].max(axis=0) > np.delete(motion[:, :3], normal, axis=1).max(axis=(0, 1))
        return modes.frequency, across

    (plain, across), (stiff, same) = shapes_of(corner), shapes_of(corner.with_values(plane=1.0))
    assert across.any()
    assert not across.all()
    assert np.array_equal(across, same)
    assert (stiff[~across] > plain[~across] * 1.0001).any()
    np.testing.assert_allclose(stiff[across], plain[across], rtol=1e-9)
    in_all = shapes_of(corner.with_values(u=1.0))[0]
    np.testing.assert_allclose(in_all[~across], stiff[~across], rtol=2e-3)
