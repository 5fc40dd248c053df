"""All who compute FRFs of one study get the same: desk, report, found.toml, ``frf`` and ``compare``."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.desk import by_hand, held_out_of, live_model, save_study
from fem import FRF, assemble, compute_frf
from fem.effects import EndRelease, candidate_kinds, effect_classes
from fem.io import write_npz
from tests.dovetail.test_effects import JOINTED, candidates
from tests.studies import fit_problem
from updating import Fault, sensor_rows
from updating.live import Hypothesis

TEXT = JOINTED.replace("elements =", 'mass = "higher-order"\nelements =')
"""With the mass that fits take: ``frf`` takes that of the file, and would have the mesh's error more."""
RELEASE = "end_release:post.2.ry"
FORM = {"u": -0.051, "mass": 0.2, "inertia": 0.3, "plane": 0.1, "A": -0.02, "Iy": 0.06, "Iz": -0.04}
FORM |= {"J": 0.05, "shear": 0.1}
"""Values of the form's parameters: a corner that is softer, and other sections."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    file = tmp_path_factory.mktemp("one") / "study.toml"
    file.write_text(TEXT, encoding="utf-8")
    study = load_study(file)
    soft = EndRelease(name="soft", member="post", end=2, direction="ry", compliance=1.25e-4, reference=1.0)
    frequency = np.arange(4.0, 400.0, 2.0)
    rows = [sensor_rows(study.model, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(study.model.with_effect(soft)), frequency, *rows).H
    rng = np.random.default_rng(3)
    H = H * (1 + 0.003 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)))
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    write_npz(file.parent / "frf.npz", FRF.from_arrays(frequency, H, "accelerance", *names))
    file.write_text(TEXT + '\n[[measurements]]\nfile = "frf.npz"\n', encoding="utf-8")
    return load_study(file)


@pytest.fixture(scope="module")
def live(study):
    return live_model(study)


def some(effect):
    """Return an effect of a size that a diagnosis may find."""
    start = effect.starts(lambda key: 1e5)
    return effect.with_values(**start[len(start) // 2])


@pytest.fixture(scope="module")
def found(study):
    """Return the candidates by name."""
    return {e.name: e for e in candidates(study)}


def hypothesis(study, live, found, kind, form, fault):
    """Return a hypothesis with an effect beside a release, with the form and a fault."""
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


OTHERWISE = {
    "joint_cubic", "joint_friction", "joint_gap",  # depend on a level of force
    "joint_patch", "foot_shift",  # alter the joints, or have no place here
    "support_shift",  # its clamp in a softer stretch leaves no mass
    "shear_centre",  # needs smaller elements with the form: `compare` cuts them, and `frf` does not
}  # fmt: skip
FORMS = {"section_form", "zone_form", "clamp_form", "solid_corner", "sensor_form", "driver_form"}
KINDS = sorted(set(candidate_kinds()) - OTHERWISE - FORMS)


def one_of_each_role(kinds):
    """Yield kinds of effect; all but the first of each role for `make long`."""
    roles = set()
    for kind in kinds:
        role = effect_classes()[kind].role
        yield pytest.param(kind, marks=pytest.mark.long if role in roles else ())
        roles.add(role)


@pytest.mark.parametrize("kind", ["end_release", *one_of_each_role(KINDS)])
def test_all_who_compute_the_frfs_of_a_study_agree(tmp_path, study, live, found, kind, request):
    """Beside a release at a welded end, with the form, whose corner is softer there, and a fault."""
    plain = request.node.name.endswith("end_release0]")
    h = hypothesis(study, live, found, kind, form=not plain, fault=not plain)
    shown = live.evaluate(h)
    save_study(study, live, h, tmp_path / "found.toml")
    assert main(["compare", str(tmp_path / "found.toml"), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    printed = json.loads((tmp_path / "c.json").read_text())
    # bases that know an effect beforehand hold more of what it does
    assert printed["error_db"] == pytest.approx(shown.result.fit_db, rel=5e-3)
    assert printed["all_lines_db"] == pytest.approx(shown.comparison.total_db, rel=5e-3)
    report = by_hand(study, live, Hypothesis.nominal(live.problem), h, 0.0)
    assert report.steps[-1].fit_db == pytest.approx(shown.result.fit_db, rel=1e-6)
    saved = load_study(tmp_path / "found.toml")
    problem = fit_problem(saved)
    fitted = problem.frf(problem.nominal())
    computed = saved.frf().select(outputs=fitted.outputs, inputs=fitted.inputs)
    apart = abs(20 * np.log10(abs(computed.H / fitted.H)))
    # beside resonances the two damp in one way: fits by ζ at each line, full models by that of each mode
    assert np.median(apart) < 0.02
    assert np.quantile(apart, 0.9) < 0.2
