"""Derivatives of modes and FRFs against closed forms, homogeneity and differences with a predicted error.

Every effect's own derivatives are held against a complex step in `test_effects_contract.py`.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import (
    AddedMass,
    Contribution,
    Damping,
    Effect,
    FRFError,
    ModelError,
    Parameter,
    Role,
    Section,
    assemble,
    compute_frf,
    differentiate_frf,
    differentiate_modes,
    dofs_of,
    solve_modes,
)
from fem.analysis.modes import solve_eigenpairs
from fem.declarations import Site
from fem.effects import MemberStiffness, SupportFlexibility
from fem.sensitivity.matrices import differentiate_matrices
from tests.frames import beam, cross_beam, fix, portal

SQUARE = Section.rectangle(0.02, 0.02)
TIP = (0.6, 0.8)
"""Direction of the brace in y and z."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Brace(Effect):
    """A spring from a point to the ground, askew in the plane of y and z."""

    kind: ClassVar[str] = "brace"
    role: ClassVar[Role] = Role.STIFFNESS
    point: int = 1
    k: Any = 0.0

    @property
    def where(self):
        return Site("here")

    def parameters(self):
        return (Parameter("k", "N/m", self.k, 0.0, 0.0, np.inf, linear=True),)

    def contribute(self, model):
        b = np.array([0.0, *TIP, 0.0, 0.0, 0.0])
        return (Contribution(dofs_of([self.point]), self.k * np.outer(b, b)[None]),)


def square(k=0.0, section=SQUARE):
    """Return a cantilever whose modes along y and z are pairs unless a brace of k [N/m] splits them."""
    return beam(8, effects=(fix(0), Brace(name="brace", k=k)), section=section)


def homogeneous(model):
    """Check what follows from Z being proportional to E and ρ of the one material together."""
    system = assemble(model)
    refs = [("frame", "E:steel"), ("frame", "rho:steel")]
    E, rho = (model.values()[ref] for ref in refs)
    n = 4 + system.rigid.shape[1]
    result = differentiate_modes(system, refs, n, outputs="all")
    lam, phi = result.modes.omega**2, result.modes.shapes
    near = 1e-9 * lam.max()
    np.testing.assert_allclose(E * result.eigenvalue[0], lam, atol=near)
    np.testing.assert_allclose(rho * result.eigenvalue[1], -lam, atol=near)
    top = np.abs(phi).max()
    np.testing.assert_allclose(E * result.shapes[0], 0 * phi, atol=1e-7 * top)
    np.testing.assert_allclose(rho * result.shapes[1], -phi / 2, atol=1e-7 * top)
    elastic = slice(system.rigid.shape[1], None)
    frequency = result.modes.frequency[elastic]
    np.testing.assert_allclose(2 * E * result.frequency[0, elastic], frequency, rtol=1e-8)
    assert np.isnan(result.frequency[:, : system.rigid.shape[1]]).all()


def test_moduli_and_densities_scale_all_modes():
    homogeneous(beam(8, effects=(fix(0),)))
    homogeneous(portal(0.1))
    homogeneous(beam(8, section=SQUARE))  # free, and all bending in pairs


@settings(max_examples=10)
@given(st.integers(2, 8), st.floats(0.3, 3.0), st.floats(0.3, 3.0))
def test_any_beam_scales_with_its_material(n, width, height):
    homogeneous(beam(n, 0.8, effects=(fix(0),), section=Section.rectangle(0.02 * width, 0.01 * height)))


@pytest.mark.parametrize("method", ["direct", "reduced"])
@pytest.mark.parametrize(
    "damping", [Damping.structural(0.01), Damping.rayleigh(2.0, 1e-6)], ids=["structural", "rayleigh"]
)
def test_frfs_scale_with_the_material(method, damping):
    # Z = E Z_E + ρ Z_ρ, so that E dH/dE + ρ dH/dρ = -H
    model = portal(0.1).with_damping(damping)
    refs = [("frame", "E:steel"), ("frame", "rho:steel")]
    f = np.linspace(5.0, 300.0, 40)
    result = differentiate_frf(
        assemble(model), f, [(8, "x"), (10, "z")], [(8, "y"), (9, "x")], refs, method=method
    )
    values = np.array([model.values()[ref] for ref in refs])
    level = np.sqrt((abs(result.frf.H) ** 2).mean(axis=0))
    total = np.tensordot(values, result.dH, 1)
    # Galerkin's projection keeps the proportion exactly; what is left is rounding
    assert (abs(total + result.frf.H) <= 1e-6 * level.max()).all()
    expected = compute_frf(assemble(model), f, [(8, "x"), (10, "z")], [(8, "y"), (9, "x")], method="direct").H
    assert (abs(result.frf.H - expected) <= 1e-4 * level.max()).all()


def test_a_mass_lowers_a_frequency_by_what_moves_there():
    # dω²/dm = -ω² φ² of the point's three translations, and dH/dm = ω² H_oa H_ai
    model = beam(8, effects=(fix(0), AddedMass(name="lump", point=4, mass=0.1)))
    system = assemble(model)
    ref = [("lump", "mass")]
    result = differentiate_modes(system, ref, 5)
    assert result.shapes is None
    at = result.modes.shapes[[24, 25, 26]]
    expected = -(result.modes.omega**2) * (at**2).sum(axis=0)
    np.testing.assert_allclose(result.eigenvalue[0], expected, rtol=1e-10)
    f = np.array([11.0, 90.0, 400.0])
    here, there = [(4, d) for d in "xyz"], [(1, "z"), (6, "y")]
    damped = assemble(model.with_damping(Damping.structural(0.02)))
    slope = differentiate_frf(damped, f, there, there, ref, "receptance", "direct").dH[0]
    H = compute_frf(damped, f, here, there, "receptance", "direct").H
    exact = (2 * np.pi * f[:, None, None]) ** 2 * np.swapaxes(H, 1, 2) @ H
    np.testing.assert_allclose(slope, exact, atol=1e-9 * abs(exact).max(axis=(1, 2)).min())


# ---------------------------------------------------------------------------------- close and repeated modes


def test_a_brace_splits_a_pair_by_what_its_eigenvalues_say():
    system = assemble(square())
    result = differentiate_modes(system, [("brace", "k")], 4)
    tip = result.modes.shapes[[7, 8]]
    assert [list(s.modes) for s in result.sets] == [[0, 1], [2, 3]]
    for s, slopes in zip(result.sets, (result.eigenvalue[0, :2], result.eigenvalue[0, 2:]), strict=True):
        # S = b bᵀ with the pair's motion b along the brace: 0 and |b|²
        b = TIP @ tip[:, s.modes]
        np.testing.assert_allclose(s.matrix[0], np.outer(b, b), atol=1e-12 * (b @ b))
        np.testing.assert_allclose(slopes, [0.0, b @ b], atol=1e-12 * (b @ b))


def test_the_split_pair_follows_finite_differences():
    result = differentiate_modes(assemble(square()), [("brace", "k")], 2)

    def after(k):
        return solve_eigenpairs(assemble(square(k)), 2).eigenvalues

    k = 100.0
    start, near, far = after(0.0), after(k), after(2 * k)
    # Forward differences err by k λ''/2 + …, which that of twice the step exceeds by as much again.
    error = (near - start) / k - result.eigenvalue[0]
    predicted = (far - start) / (2 * k) - (near - start) / k
    rounding = 1e-9 * start.max() / k
    np.testing.assert_allclose(error, predicted, rtol=0.02, atol=rounding)
    assert abs(predicted).max() > 100 * rounding


@pytest.mark.parametrize("section", [SQUARE, Section.rectangle(0.02, 0.020002)], ids=["repeated", "close"])
def test_frequencies_of_a_set_are_good_to_second_order_whatever_the_gap(section):
    # 1e-4 in height is 2e-4 in ω²: steps below, at and above the gap
    system = assemble(square(0.0, section))
    (first, *_) = differentiate_modes(system, [("brace", "k")], 2, close=1e-3).sets
    tip = solve_modes(system, 2).shapes[[7, 8]]
    lift = (np.array(TIP) @ tip) @ (np.array(TIP) @ tip)
    gap = 2e-4 * first.eigenvalues[0]
    for step in np.array([0.3, 1.0, 3.0, 10.0]) * gap / lift:
        errors = [
            np.abs(
                solve_modes(assemble(square(t, section)), 2).frequency - first.frequencies_after(0, t)
            ).max()
            for t in (step, 2 * step)
        ]
        rounding = 1e-9 * solve_modes(system, 2).frequency[0]
        assert errors[1] <= 4.5 * errors[0] + rounding
        # Σ (dK_1k step)² / (λ_k - λ_1) over the modes beyond; all move the tip alike, and λ_k > 39 λ_1
        slope = 8 * np.pi**2 * solve_modes(system, 2).frequency[0]
        assert slope * errors[0] <= (step * lift) ** 2 / (30 * first.eigenvalues[0]) + slope * rounding


@pytest.mark.parametrize("section", [SQUARE, Section.rectangle(0.02, 0.0200002)], ids=["repeated", "close"])
def test_the_space_of_a_set_follows_central_differences(section):
    # P = ΦΦᵀ does not depend on the basis; dP = dΦ Φᵀ + Φ dΦᵀ
    k = 400.0
    result = differentiate_modes(
        assemble(square(0.0, section)), [("brace", "k")], 2, outputs="all", close=1e-3
    )
    phi, dphi = result.modes.shapes, result.shapes[0]
    exact = dphi @ phi.T + phi @ dphi.T

    def projector(k):
        shapes = solve_modes(assemble(square(k, section)), 2).shapes
        return shapes @ shapes.T

    near = (projector(k) - projector(-k)) / (2 * k)
    far = (projector(2 * k) - projector(-2 * k)) / (4 * k)
    # k² P‴/6, a third of what the two differ by
    rounding = 1e-9 * np.abs(projector(0.0)).max() / k
    assert np.abs(near - exact - (far - near) / 3).max() <= 0.05 * np.abs(far - near).max() + rounding
    assert np.abs(far - near).max() > 3 * rounding


def test_derivatives_of_a_space_stay_finite_where_those_of_single_modes_do_not():
    sizes = {}
    for height in (0.02, 0.0200002, 0.020002):
        system = assemble(square(0.0, Section.rectangle(0.02, height)))
        together = differentiate_modes(system, [("brace", "k")], 2, outputs="all", close=1e-3)
        sizes[height] = np.abs(together.shapes).max()
        if height == 0.02:
            continue
        alone = differentiate_modes(system, [("brace", "k")], 2, outputs="all")
        assert not alone.sets
        # what a single mode has more is its rotation within the pair, S_kj / (λ_j - λ_k)
        (pair,) = together.sets
        S, lam, phi = pair.matrix[0], pair.eigenvalues, together.modes.shapes
        turn = np.array([[0, S[0, 1] / (lam[1] - lam[0])], [S[1, 0] / (lam[0] - lam[1]), 0]])
        expected = together.shapes[0] + phi @ turn
        np.testing.assert_allclose(abs(alone.shapes[0]), abs(expected), atol=1e-4 * np.abs(expected).max())
        assert np.abs(alone.shapes).max() > 100 * sizes[height]
    assert max(sizes.values()) < 1.5 * min(sizes.values())


def test_a_pair_that_stays_one_has_equal_derivatives():
    result = differentiate_modes(assemble(square()), [("frame", "E:steel")], 2)
    np.testing.assert_allclose(np.diff(result.eigenvalue[0]), 0.0, atol=1e-9 * result.eigenvalue[0, 0])


def test_a_set_is_completed_or_refused():
    system = assemble(square())
    assert differentiate_modes(system, [("brace", "k")], 1).eigenvalue.shape == (1, 2)
    with pytest.raises(
        ModelError, match="mode 3 belongs to a set of repeated modes, 3 to 4 and perhaps more"
    ):
        differentiate_modes(system, [("brace", "k")], 3, pairs=solve_eigenpairs(system, 4))
    with pytest.raises(ModelError, match="at least one more is needed"):
        differentiate_modes(system, [("brace", "k")], 4, pairs=solve_eigenpairs(system, 4))
    # three of the four modes of two pairs, and a fourth far above: the load's own sequence meets the partner
    pairs = solve_eigenpairs(system, 5)
    torn = replace(pairs, eigenvalues=pairs.eigenvalues[[0, 1, 2, 4]], vectors=pairs.vectors[:, [0, 1, 2, 4]])
    with pytest.raises(ModelError, match="modes beyond the 4 computed ones are as low as the last of the 3"):
        differentiate_modes(system, [("brace", "k")], 3, pairs=torn, outputs=[(4, "y"), (4, "z")])


# ------------------------------------------------------------------------------------------------- the rest


def test_outputs_are_rows_of_all_dofs():
    model = cross_beam(0.1).with_effect(MemberStiffness(name="c", member="lower", change=0.1))
    system = assemble(model)
    whole = differentiate_modes(system, None, 10, outputs="all")
    assert whole.refs == tuple(model.values())
    rows = np.random.default_rng(0).standard_normal((3, model.n_dof))
    part = differentiate_modes(system, None, 10, outputs=rows)
    values = np.array([abs(v) or 1.0 for v in model.values().values()])[:, None, None]
    scale = np.abs(rows @ whole.modes.shapes).max()
    np.testing.assert_allclose(values * part.shapes, values * (rows @ whole.shapes), atol=1e-7 * scale)
    np.testing.assert_array_equal(part.eigenvalue, whole.eigenvalue)
    point = differentiate_modes(system, None, 10, outputs=[(3, "z"), 7])
    np.testing.assert_allclose(values * point.shapes, values * whole.shapes[:, [20, 7]], atol=1e-7 * scale)
    assert part.error <= 1e-8


def test_more_modes_leave_derivatives_as_they_are():
    # exact means that the modes at hand are only a means
    model = portal(0.05).with_effect(MemberStiffness(name="c", member="beam", change=0.2))
    system = assemble(model)
    refs = [("c", "change")]
    few = differentiate_modes(system, refs, 3, outputs="all", pairs=solve_eigenpairs(system, 4))
    many = differentiate_modes(system, refs, 3, outputs="all", pairs=solve_eigenpairs(system, 40))
    signs = np.sign((few.modes.shapes * many.modes.shapes).sum(axis=0))
    np.testing.assert_allclose(few.shapes, many.shapes * signs, atol=1e-7 * np.abs(many.shapes).max())


def test_only_elements_that_change_are_kept():
    model = portal(0.1).with_effect(MemberStiffness(name="c", member="beam", change=0.2))
    (part,) = differentiate_matrices(model, ("c", "change"))
    assert len(part.dofs) == len(model.mesh.members["beam"])
    assert part.M is None
    (part,) = differentiate_matrices(model, ("frame", "rho:steel"))
    assert part.K is None


def test_modal_damping_is_taken_line_by_line():
    model = portal(0.1).with_damping(Damping.modal(0.01))
    refs, at = [("frame", "E:steel")], [(8, "x")]
    f = np.array([20.0, 60.0, 140.0])
    with pytest.raises(FRFError, match="direct method needs damping matrices"):
        differentiate_frf(assemble(model), f, at, at, refs, method="direct")
    reduced = differentiate_frf(assemble(model), f, at, at, refs)
    same = assemble(model.with_damping(Damping.structural(0.02)))
    direct = differentiate_frf(same, f, at, at, refs, method="direct")
    np.testing.assert_allclose(reduced.dH, direct.dH, rtol=1e-3)


def test_what_has_no_derivative_is_refused_by_name():
    system = assemble(portal(0.1))
    with pytest.raises(ModelError, match=r"effect 'frame' has no parameter 'nu'; it has E:steel, rho:steel"):
        differentiate_modes(system, [("frame", "nu")], 3)
    with pytest.raises(ModelError, match="the model has no effect 'x'"):
        differentiate_frf(system, [1.0], [8], [8], [("x", "y")])
    with pytest.raises(ModelError, match="the outputs are 'some'; allowed are all"):
        differentiate_modes(system, [], 3, outputs="some")
    with pytest.raises(FRFError, match="the FRF method is 'modal'; allowed are reduced, direct"):
        differentiate_frf(system, [1.0], [8], [8], [], method="modal")
    soft = SupportFlexibility(name="soft", supports=("foot0",), direction="z", stiffness=np.inf)
    with pytest.raises(ModelError, match="parameter 'stiffness' of effect 'soft' is inf"):
        differentiate_matrices(system.model.with_effect(soft), ("soft", "stiffness"))
    with pytest.raises(FRFError, match="receptance is infinite"):
        differentiate_frf(assemble(cross_beam(0.1)), [0.0], [8], [8], [("bolt", "kz")], "receptance")
