"""Looks at candidates by measured modes: slopes of connections, and what a candidate leaves on its grid."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fem import Damping, Frame, MemberProperties, Mesh, Model, assemble, first_modes, solve_modes
from tests.frames import FLAT, STEEL, beam, fix
from tests.updating.test_evidence_modes import E, cantilever, measured
from updating import ModeTargets, build_mode_problem, propose
from updating.diagnosis.evidence import ModeRanking
from updating.forecast import Grid, Look, candidate_terms
from updating.forecast.grid import Little

MODULUS = "frame", "E:steel"


def look_at(model, data, noise=1e-4) -> Any:
    problem = build_mode_problem(model, measured(data, noise=noise), (E,), model_error=0.0)
    return Look.of(problem, problem.nominal(), None, 0, 0)


def every(model, kind) -> Any:
    return propose(model, [kind])


def test_the_slopes_of_a_connection_are_those_of_differences():
    model = cantilever()
    look = look_at(model, model)
    effects = every(model, "support_flexibility")
    assert len(effects) == 6
    n_seen = 0
    for effect in effects:
        (point, _), *_ = Grid.of(look.problem, effect).slight_points()
        effect = effect.with_values(**point)
        residuals = look.residuals
        at = residuals.function.modes_at(residuals.x, effect.released())
        r, _ = residuals.function.residuals(at.with_term(look.problem.reduced.value_of(effect)))
        changed = look.whitened(look.adapted((r - look.now)[None]))[0]
        slope = look.whitened(look.adapted(residuals.slopes()([effect])))[0]
        seen = np.linalg.norm(changed) > 1e-6  # torsion, which no sensor has, is not
        assert np.linalg.norm(slope - changed) < (1e-2 * np.linalg.norm(changed) if seen else 1e-6)
        n_seen += seen
    assert n_seen > 0


def test_a_crack_leaves_nothing_of_its_own_misfit_at_its_own_point():
    model = cantilever()
    crack = next(e for e in every(model, "crack") if e.direction == "ry")
    point = {"compliance": 0.2 * crack.reference, "position": 0.61}
    look = look_at(model, model.with_effect(crack.with_values(**point)))
    assert look.explained([Grid(crack, (point,))])[0] > 0.999


def angle() -> Model:
    """Return a clamped post with an arm that is welded to its top."""
    points = [[0, 0, 0], [0, 0, 0.5], [0.4, 0, 0.5]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2]], {"post": [0], "arm": [1]}).refined(0.05)
    frame = Frame(members={name: MemberProperties(STEEL, FLAT) for name in mesh.members})
    return Model(mesh, (frame, fix(0)), Damping.structural(0.01))


@pytest.mark.parametrize("softer", [1.0, 0.87], ids=["nominal", "fitted"])
def test_a_hinge_turns_what_has_mass_beside_any_modulus(softer):
    """Of a model whose modulus a fit has bent, its basis without any shape of the hinge."""
    model = angle()
    targets = ModeTargets.of(first_modes(assemble(model), 6).frequency[:6], 1e-3)
    problem = build_mode_problem(model, targets, (E,), model_error=0.0)
    base = replace(problem.nominal(), values={MODULUS: softer * model.values()[MODULUS]})
    changes = problem.changes_at(base, None, 0, 0)
    there = model.with_values(base.values)
    moved = 0
    for hinge in every(model, "end_release"):
        grid = Grid.of(problem, hinge)
        grid = replace(grid, points=grid.points[-3:])
        terms = candidate_terms(problem, base, grid)
        for point, term in zip(grid.points, terms, strict=True):
            at, (term,) = changes._with_lacking(changes.around((), term), [term])
            found = at.with_term(term).pairs(0).frequency[:6]
            true = solve_modes(assemble(there.with_effect(hinge.with_values(**point))), 6).frequency
            np.testing.assert_allclose(found, true, rtol=0.02)
            moved += bool(true[0] < 0.9 * changes.modes.pairs(0).frequency[0])
    assert moved > 3


@pytest.mark.parametrize("shapes", [True, False], ids=["shapes", "frequencies"])
def test_points_of_a_grid_together_are_those_one_by_one(shapes):
    """Of each kind, with what depends on frequency; one mass is less than none."""
    model = cantilever()
    problem = build_mode_problem(model, measured(model, shapes=shapes), (E,))
    changes = problem.changes_at(problem.nominal(), None, 0, 0)
    kinds = {effect.kind: effect for effect in propose(model)}
    n_laws = n_impossible = 0

    def law(omega):
        return (1 + 0.3j) * omega / (omega + 1000)

    for effect in kinds.values():
        points = Grid.of(problem, effect).points[::9]
        terms = candidate_terms(problem, problem.nominal(), Grid(effect, points))
        if effect.kind == "point_mass":
            terms = (*terms, terms[0].times(-1e6))
        if terms[-1].K is not None and terms[-1].L is not None:
            terms = (*terms, *(replace(t, K=None, laws=((law, t.K),)) for t in terms[-2:]))
        together = changes.by_terms(effect.released(), terms)
        alone = np.concatenate([changes.by_terms(effect.released(), [term]) for term in terms])
        n_laws += bool(terms[-1].laws)
        n_impossible += int(np.isnan(alone).any(axis=1).sum())
        assert np.array_equal(np.isnan(together), np.isnan(alone))
        assert np.nanmax(np.abs(together - alone)) < 1e-6, effect.kind
    assert n_laws > 0
    assert n_impossible == 1


def test_a_change_weaker_than_any_grid_is_ranked_first():
    model = cantilever()
    effect = next(e for e in every(model, "support_flexibility") if e.direction == "ry")
    stiffest = max(p["stiffness"] for p in Grid.of(look_at(model, model).problem, effect).points)
    true = effect.with_values(stiffness=10 * stiffest)
    look = look_at(model, model.with_effect(true), noise=1e-6)
    ranked = ModeRanking().screened(look.problem, look.base, every(model, "support_flexibility"), bool)
    assert ranked[0].effect.name == effect.name
    assert ranked[0].starts[0].values[0]["stiffness"] == pytest.approx(10 * stiffest, rel=0.05)


def test_a_look_at_few_points_of_grids_leaves_the_best_candidate_first():
    model = angle()
    kinds = "point_mass", "member_stiffness", "crack", "support_flexibility"
    effects = [e for kind in kinds for e in every(model, kind)]
    mass = next(e for e in effects if e.name == "point_mass:arm")
    true = model.with_effect(mass.with_values(mass=0.05, position=0.31))
    targets = ModeTargets.of(first_modes(assemble(true), 8).frequency[:8], 1e-3)
    problem = build_mode_problem(model, targets, (E,), model_error=0.0)
    few, all_ = (
        replace(ModeRanking(), n_fine=n).screened(problem, problem.nominal(), effects, lambda e: False)
        for n in (3, 0)
    )
    assert few[0].effect.name == all_[0].effect.name == mass.name
    assert few[0].starts[0].values == all_[0].starts[0].values
    assert {s.effect.name for s in few} == {s.effect.name for s in all_}
    thin = Grid.of(problem, mass).thinned(6).points
    assert len(thin) == 6
    assert len({p["position"] for p in thin}) > 1 < len({p["mass"] for p in thin})


@pytest.mark.parametrize("side", [0, 1])
def test_a_little_of_a_shifted_clamp_shortens_the_beam(side):
    """All natural frequencies of a cantilever of length L are as L⁻²: ln f changes by 2 δ / L."""
    model = beam(8, effects=(fix(side),))
    (shift,) = propose(model, ["support_shift"])
    f = first_modes(assemble(model), 4).frequency[:4]
    problem = build_mode_problem(model, ModeTargets.of(f, 1e-3))
    look = Look.of(problem, problem.nominal(), None, 0, 0)
    little = Little.of(Grid.of(problem, shift), {})
    (change,) = look.small_changes(little)
    (amount,) = (p["amount"] for p in little.points)
    np.testing.assert_allclose(change.real, 2 * abs(amount), rtol=0.05)
