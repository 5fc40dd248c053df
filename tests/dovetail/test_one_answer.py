"""Everything that computes FRFs of one study gets the same: desk, report, found.toml, ``frf`` and ``compare``."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from dovetail.cli import main
from dovetail.desk.saving import by_hand, held_out_of, live_model, save_study
from dovetail.pipeline import fit_problem
from fem.effects import candidate_kinds
from fem.effects.crack import EndRelease
from tests.dovetail.test_effects import candidates
from tests.frames import write_study
from updating.correlation import compare
from updating.live.hypothesis import Hypothesis
from updating.quality.corrections import Fault

RELEASE = "end_release:post.2.ry"
FORM = {"u": -0.051, "mass": 0.2, "plane": 0.1, "Iy": 0.06, "A": -0.02, "J": 0.05, "shear": 0.1, "Iz": -0.04}
"""Values of the form's parameters: a corner that is softer, and other sections."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("one")
    soft = EndRelease(name="soft", member="post", end=2, direction="ry", compliance=1.25e-4, reference=1.0)
    return load_study(write_study(folder, mass=0.05, others=(soft,)))


@pytest.fixture(scope="module")
def live(study):
    return live_model(study)


def some(effect):
    """Return an effect of a size that a diagnosis may find."""
    start = effect.starts(lambda key: 1e5)
    return effect.with_values(**start[len(start) // 2])


def first_of_each(study):
    known = {}
    for effect in candidates(study):
        known.setdefault(effect.kind, effect)
    return known


def hypothesis(study, live, kind, form, fault):
    """Return a hypothesis with an effect beside a release, with the form and a fault."""
    found = {e.name: e for e in candidates(study)}
    effects = [found[RELEASE].with_values(compliance=1.3e-4)]
    if kind != "end_release":
        own = [e for e in found.values() if e.kind == kind]
        # where the release is, if the kind has a place there
        effects.append(some(next((e for e in own if getattr(e, "member", "post") == "post"), own[0])))
    h = replace(Hypothesis.nominal(live.problem), held_out=held_out_of(study))
    for effect in effects:
        h = h.with_effect(effect)
    if form:
        h = live.with_form(h)
        for ref in list(h.values):
            if ref[0].startswith(("zone_form", "section_form", "clamp_form")):
                h = h.with_uncertain(ref, FORM[ref[1]])
    return h.with_fault(Fault("sensor_gain", "A", 1.1, 0.0)) if fault else h


@pytest.mark.parametrize("form", [False, True])
@pytest.mark.parametrize("kind", sorted(set(candidate_kinds()) & set(first_of_each_kind)))
def test_all_agree(tmp_path, study, live, kind, form):
    h = hypothesis(study, live, kind, form, fault=form)
    shown = live.evaluate(h)
