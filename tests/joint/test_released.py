"""A structure without one of its joints, priors of the fit, and the joint of a study from its FRFs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.joint_noise import ARMS, parts
from dovetail import load_study, main
from dovetail.identify import read_task, write_proposal
from fem import Damping, Joint, assemble, compute_frf
from fem.reduction import reduce_model
from joint import ReleasedParts, couple, fit_joint, relative_coordinates, relative_form
from joint.assembly import identify
from joint.assembly_fit import estimate
from tests.frames import CROSSED_BEAMS
from updating import DampingCurve, Nuisance

STUDY = Path(__file__).parents[2] / "examples" / "cross-beam" / "study.toml"
LINES = np.arange(30.0, 400.0, 5.0)


@pytest.fixture(scope="module")
def released():
    """The cross-beam without its joint's rx and ry, with two materials' worth of doubt."""
    task = read_task(load_study(STUDY), "J", "rx,ry")
    model = task.tied().with_damping(Damping.structural(0.004))
    vectors = tuple(rows.T for rows in task.vectors())
    reduced = reduce_model(model, np.hstack(vectors), LINES[-1], margin=6.0, n_krylov=2, releasable=False)
    doubts = (Nuisance("frame", "E:steel", 0.02), Nuisance("J", "kz", 0.05))
    curve = DampingCurve(np.array([50.0, 300.0]), np.array([0.002, 0.004]), 0.5)
    return task, ReleasedParts.of(reduced, LINES, task.interface, vectors, task.springs, doubts, curve)


def test_the_springs_are_gone(released):
    """Without rx and ry, but with 2ζ on everything else, as the model without a stiffness there."""
    task, found = released
    joint = task.joint
    K = np.array(joint.K)
    K[[3, 4], [3, 4]] = 0.0
    zeta = np.exp(found.damping.hats(LINES[20:21]) @ np.log(found.damping.nominal))[0]
    D = joint.eta * K
    free = replace(joint, K=K, D=D, eta=0.0)
    model = task.model
    effects = tuple(free if isinstance(e, Joint) else e for e in model.effects)
    plain = replace(model, effects=effects).with_damping(Damping.structural(0.004 + 2 * zeta))
    outputs, inputs, rows = task.vectors()
    H = compute_frf(assemble(plain), LINES[20:21], outputs, inputs, "receptance", "direct").H
    # the basis leaves out what lies beyond six times the band: (1/6)² of a static part that it still has
    assert_allclose(found.at_mean.H_aa[20:21], H, atol=2e-4 * abs(H).max())
    H_bb = compute_frf(assemble(plain), LINES[20:21], rows, rows, "receptance", "direct").H
    assert_allclose(found.at_mean.H_bb[20:21], H_bb, atol=2e-3 * abs(H_bb).max())


def test_derivatives_are_those_of_differences(released):
    _, found = released
    assert found.names[:2] == ("frame E:steel", "J kz")
    x = np.array([0.3, -0.2, 0.1, 0.4])
    assert_allclose(found.standard(found.physical(x)), x, atol=1e-12)
    _, slopes = found.evaluate(x)
    h = 1e-2  # central differences: h² of the third derivative, 1e-4, and rounding over h, 2e-3 of kz at 1e-3
    for i in range(4):
        step = h * (np.arange(4) == i)
        up, down = found.evaluate(x + step)[0], found.evaluate(x - step)[0]
        for block in ("H_aa", "H_ab", "H_ba", "H_bb"):
            difference = (getattr(up, block) - getattr(down, block)) / (2 * h)
            slope = getattr(slopes[i], block)
            assert np.linalg.norm(slope - difference) <= 1e-3 * np.linalg.norm(difference) + 1e-12


def test_a_prior_holds_what_the_data_do_not_see_and_nothing_else():
    frequency = np.linspace(20.0, 800.0, 60)
    slim = parts(frequency, 3)
    form = relative_form(slim.interface.joint, relative_coordinates(*ARMS), "K", pattern=np.eye(6))
    theta = np.array([3e7, 2e7, 1e7, 900.0, 800.0, 500.0])
    H = couple(slim, form.Z(frequency, theta)).H_nn
    start = 1.3 * theta
    wide = (start, np.full(6, np.log(20.0)))
    found = fit_joint(form, slim, frequency, H, start, noise=1e-3, positive="K", prior=wide)
    # bias ≈ (relative std / log 20)² · ln 1.3 of each, far below the std
    assert (abs(found.values / theta - 1) < 0.3 * found.identifiability.relative + 1e-9).all()
    with pytest.raises(ValueError, match=r"the prior has a mean of shape \(5,\)"):
        fit_joint(form, slim, frequency, H, start, noise=1e-3, prior=(start[:5], np.ones(5)))
    with pytest.raises(ValueError, match="must be too"):
        fit_joint(form, slim, frequency, H, start, noise=1e-3, positive="K", prior=(-start, np.ones(6)))


def test_a_fit_starts_from_given_values_of_the_parts(released):
    task, found = released
    form = relative_form(task.interface.joint, np.eye(2), "K", pattern=np.eye(2), names=("rx", "ry"))
    theta, x = np.array([800.0, 2500.0]), np.array([0.4, -0.3, 0.2, -0.1])
    H = couple(found.evaluate(x)[0], form.Z(LINES, theta)).H_nn
    there = fit_joint(form, found, LINES, H, theta, noise=0.001, part_start=x, max_iterations=2)
    away = fit_joint(form, found, LINES, H, theta, noise=0.001, max_iterations=2)
    # the prior pulls by far less than the noise of 0.1 % at 74 lines
    assert there.chi2 < 1e-3 < away.chi2 / 10
    with pytest.raises(ValueError, match=r"part_start has shape \(3,\); \(4,\) finite values"):
        fit_joint(form, found, LINES, H, theta, noise=0.001, part_start=x[:3])


@pytest.mark.slow
def test_the_joint_of_the_example_from_measured_frfs(tmp_path):
    """Solids with noise, 200 N·m/rad hidden: line by line scatters, output error holds it in its interval."""
    study = replace(load_study(STUDY), band=(10.0, 500.0))
    task = read_task(study, "J", "rx")
    lines = identify(task)
    found = estimate(task, lines=lines)
    k, std = found.fit.values[0], found.fit.std[0]
    assert abs(k - 200) < 2.5 * std < 10
    spread = np.std(lines.z[lines.regular, 0, 0].real)
    assert spread > 50 * std
    (tmp_path / "sub").mkdir()
    effects = write_proposal(study, found, tmp_path / "sub" / "new.toml")
    assert effects[0].K[3, 3] == pytest.approx(k)
    assert load_study(tmp_path / "sub" / "new.toml").model.effect("J").K[3, 3] == pytest.approx(k, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 6.0, 0.15])
def test_three_directions_are_found_from_a_wrong_start(factor, monkeypatch):
    """Two forces do not allow lines by themselves, and the study's krx is 2 to 90 times too large."""
    study = replace(load_study(STUDY), band=(2.0, 1100.0))
    task = read_task(study, "J", "x,z,rx")
    springs = task.springs * factor ** np.array([1, -1, 1])
    monkeypatch.setattr(type(task), "springs", property(lambda _: springs))
    found = estimate(task, ("K",))
    values = dict(zip(found.fit.form.names, found.fit.values, strict=True))
    assert values["K rx rx"] == pytest.approx(200.0, abs=2.5 * found.fit.std[2])
    # stiff directions carry the difference between beams and solids
    assert values["K z z"] == pytest.approx(1e7, rel=0.06)
    assert found.misfit_db < 1.1


CROSS = (
    CROSSED_BEAMS
    + """
[damping]
loss_factor = 0.0004
[frequency]
start = 10
stop = 400
step = 3
[[joints]] # between the beams
name = "J"
member1 = "U"
position1 = 0.45
member2 = "D"
position2 = 0.25
k = {k}
[[sensors]]
points = [[0.0, 0, 0.01], [0.8, 0, 0.01], [0.45, -0.25, -0.01], [0.45, 0.55, -0.01]]
names = ["a", "b", "c", "d"]
directions = "z"
[[excitations]]
sensor = "az"
[[excitations]]
sensor = "cz"
"""
)
SPRINGS = "{ kx = 5e7, ky = 5e7, kz = 1e7, kry = 3000, krz = 5000 }"
RUBBER = """
[[viscoelastic]]
name = "pad"
member1 = "U"
position1 = 0.45
member2 = "D"
position2 = 0.25
law = "zener"
k = { krx = 400.0 }
ratio = 2.0
tau = 0.001
"""


def test_a_law_becomes_an_element_of_the_study(tmp_path):
    """FRFs of a joint of rubber about x, in a study that takes it for a spring.

    The structure's own loss, 4e-4 of the stiffness, is in Z too, and no law has a place for it; ten times
    that makes the static stiffness 1 % low.
    """
    (tmp_path / "true.toml").write_text(CROSS.replace("{k}", SPRINGS) + RUBBER, encoding="utf-8")
    data = tmp_path / "m.npz"
    assert (
        main(["frf", str(tmp_path / "true.toml"), "--out", str(data), "--kind", "receptance", "--quiet"]) == 0
    )
    known = "[uncertain]\nE = 0\nrho = 0\njoints = 0\ndamping = 0.01\n"
    text = CROSS.replace("{k}", SPRINGS.replace("kry", "krx = 2980.0, kry"))
    text += f'{known}[[measurements]]\nfile = "m.npz"\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    study = load_study(tmp_path / "study.toml")
    task = read_task(study, "J", "rx")
    found = estimate(task, ("zener",), accuracy=0.0)
    write_proposal(study, found, tmp_path / "new.toml")
    model = load_study(tmp_path / "new.toml").model
    element = model.effect("J.rx")
    assert element.K[3, 3] == pytest.approx(400, rel=0.01)
    assert element.law.ratio == pytest.approx(2.0, rel=0.02)
    assert element.law.tau == pytest.approx(1e-3, rel=0.02)
    assert model.effect("J").K[3, 3] == 0
