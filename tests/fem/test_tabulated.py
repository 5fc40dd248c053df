"""Tables of the matrices of a connection's inside, against the matrices themselves."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from fem.effects import ClampForm, SectionForm, ZoneForm
from fem.effects.zone_form import IN_PLANE, SOFTEST, STIFFEST
from fem.reduction import reduce_model
from fem.tabulated import ChebyshevTable


@pytest.fixture(scope="module")
def model():
    return make_case(3, "portal", "nothing").model


@pytest.mark.parametrize("kind", [ZoneForm, ClampForm])
def test_tables_give_values_and_slopes_of_the_effect(model, kind):
    effects = kind.propose(model)
    assert effects
    reduced = reduce_model(model, np.eye(model.n_dof)[:, :6], 500.0)
    bare = replace(reduced)
    bare._table_of = lambda effect: None
    rng = np.random.default_rng(0)
    for effect in effects:
        ends = {"u": (SOFTEST, STIFFEST), "plane": (-IN_PLANE, IN_PLANE), "mass": (-1.0, 1.0)}
        ends["inertia"] = ends["mass"]
        values = {p.name: float(rng.uniform(*ends[p.name])) for p in effect.parameters()}
        there = effect.with_values(**values)
        assert reduced._table_of(there) is not None
        pairs = [(reduced.value_of(there), bare.value_of(there))]
        pairs += [
            (reduced.derivative_of(there, name, x), bare.derivative_of(there, name, x))
            for name, x in values.items()
        ]
        for found, exact in pairs:
            for key in "KM":
                A, B = np.asarray(found.dense(key)), np.asarray(exact.dense(key))
                assert np.abs(A - B).max() <= 1e-6 * max(np.abs(B).max(), 1e-30)


@pytest.mark.parametrize("kind", [ZoneForm, ClampForm])
def test_tables_follow_the_form_of_sections(model, kind):
    """Against the effect on a model that has the changed sections, and differences of that."""
    model = model.with_effect(*SectionForm.propose(model))
    reduced = reduce_model(model, np.eye(model.n_dof)[:, :6], 500.0)
    for effect in kind.propose(model):
        there = effect.with_values(u=0.7)
        refs = reduced.follows(there)
        assert {ref[1] for ref in refs} >= {"Iy", "Iz", "J"}
        values = {ref: 0.3 - 0.1 * k for k, ref in enumerate(refs)}
        found = reduced.value_of(there, beside=values).dense("K")
        exact = reduced.value_of(there, model.with_values(values)).dense("K")
        assert np.abs(found - exact).max() <= 1e-6 * np.abs(exact).max()
        for ref, term in zip(refs, reduced.followed_derivatives_of(there, refs), strict=True):
            slope = term.dense("K")
            more = reduced.value_of(there, beside=values | {ref: values[ref] + 1.0}).dense("K")
            assert np.abs(slope - (more - found)).max() <= 1e-9 * np.abs(exact).max()


def test_a_table_errs_as_its_poles_say():
    """1 / (1 + e^-s) has its poles at ± iπ: on ± 4 the error is some 2.1^-28, 1e-9."""
    table = ChebyshevTable.of(-4.0, 4.0, lambda s: np.array([[1 / (1 + np.exp(-s))]]))
    for s in np.linspace(-4, 4, 33):
        value = 1 / (1 + np.exp(-s))
        assert table.at(s)[0, 0] == pytest.approx(value, abs=1e-8)
        assert table.slope(s)[0, 0] == pytest.approx(value * (1 - value), abs=1e-6)
