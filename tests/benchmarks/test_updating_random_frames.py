"""Random frames whose moduli and density are 10 to 20 % wrong, measured with 1 % noise on a finer mesh."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import binom, norm

import fem
from fem.effects import MemberStiffness
from tests.frames import STEEL
from tests.random_frames import random_frame
from updating import Ending, update

NOISE, RATIO = 0.01, 0.01
RHO = ("frame", "rho:steel")
FRAMES = {"loss factor": range(12), "modal": range(12, 18)}
"""Seeds by the truth's damping: the form that the engine has between resonances, or the model's own."""

LEVEL = 0.9


@dataclass(frozen=True, eq=False)
class Measured:
    """A frame as it is thought to be, its true parameters, and a measurement of it."""

    model: fem.Model
    refs: list
    truth: np.ndarray
    frf: fem.FRF
    outputs: list
    inputs: list


def bars(rng):
    """Return what gives all members of a frame one steel section."""
    section = fem.Section.rectangle(*rng.uniform(0.02, 0.03, 2))
    return lambda _: fem.MemberProperties(STEEL, section, theory="euler-bernoulli")


def measure(seed, elements=12, n_lines=300, modal=False):
    """Return a clamped chain of four members in space, whose truth is computed on a mesh twice as fine.

    Its damping is that of a loss factor, which is the engine of fits' own form between resonances, or modal.
    """
    rng = np.random.default_rng([seed, 1])  # not the numbers that the frame itself is drawn with
    frame = random_frame(seed, bars(rng), loops=0, reach=1, course="zxyz", spread=0.2, size=0.5)
    changes = tuple(MemberStiffness(name=f"d{i}", member=f"m{i}", change=0.0) for i in range(4))
    whole = frame.with_effect(*changes).with_damping(fem.Damping.modal(0.7 * RATIO))
    model = whole.with_mesh(frame.mesh.split(elements))
    refs = [*((e.name, "change") for e in changes), RHO]
    wrong = rng.uniform(0.1, 0.2, 5) * rng.choice([-1, 1], 5)
    truth = np.append(wrong[:4], 7850 * (1 + wrong[4]))
    real = whole.with_mesh(frame.mesh.split(2 * elements)).with_values(dict(zip(refs, truth, strict=True)))
    real = real.with_damping(fem.Damping.modal(RATIO) if modal else fem.Damping.structural(2 * RATIO))
    system = fem.assemble(real)
    frequency = fem.solve_modes(system, n=8).frequency
    lines = np.linspace(0.5 * frequency[0], 1.05 * frequency[6], n_lines)
    # points keep their numbers when the mesh is split
    outputs = [(p, d) for p in (1, 2, 3, 4) for d in "xyz"]
    inputs = [(3, "x"), (4, "y")]
    H = fem.compute_frf(system, lines, outputs, inputs, tolerance=1e-7).H
    a, b = rng.standard_normal((2, *H.shape))
    frf = fem.FRF.from_arrays(lines, H * (1 + NOISE * (a + 1j * b)))
    return Measured(model, refs, truth, frf, outputs, inputs)


@pytest.fixture(scope="module", params=FRAMES)
def updated(request):
    out = []
    for seed in FRAMES[request.param]:
        frame = measure(seed, modal=request.param == "modal")
        priors = dict.fromkeys(frame.refs, 0.2)
        out.append(
            (
                frame,
                update(
                    frame.model,
                    priors,
                    frf=frame.frf,
                    outputs=frame.outputs,
                    inputs=frame.inputs,
                    noise=NOISE,
                    model_error=0.0,
                ),
            )
        )
    return out


def test_parameters_are_recovered_within_three_per_mille(updated):
    for frame, result in updated:
        assert result.ending is Ending.CONVERGED, result.messages
        scale = np.append(1 + frame.truth[:4], frame.truth[4])
        assert np.abs((result.values[:5] - frame.truth) / scale).max() < 3e-3
        # ratios at frequencies, linear between: the truth's is the same everywhere
        ratios = result.values[5:]
        assert np.abs(ratios / RATIO - 1).max() < 5 * (result.std[5:] / ratios).max()


def test_what_is_left_is_the_noise(updated):
    for frame, result in updated:
        n = 2 * frame.frf.H.size
        # mean square of n normal residuals less those that the fit takes; 5 deviations
        assert abs(result.misfit["frf"] - 1) < 5 * np.sqrt(2 / n) + 0.02  # and 2 % of noise in ln(1 + noise)


def test_intervals_hold_as_often_as_they_say(updated):
    # Errors of the five parameters of a frame are correlated; turned by the stated covariance they are not,
    # and then each is a trial of its own. The mesh errs by a tenth of a deviation at most.
    half = norm.ppf(0.5 + LEVEL / 2)
    inside, trials = 0, 0
    for frame, result in updated:
        L = np.linalg.cholesky(result.covariance[:5, :5] / np.outer(result.std[:5], result.std[:5]))
        z = np.linalg.solve(L, (result.values[:5] - frame.truth) / result.std[:5])
        inside += int((np.abs(z) < half).sum())
        trials += 5
    low, high = binom.ppf([1e-3, 1 - 1e-3], trials, LEVEL)
    assert low <= inside <= high, (inside, trials)


def test_each_interval_alone_holds_as_predicted_from_the_correlations(updated):
    rng = np.random.default_rng(0)
    half = norm.ppf(0.975)
    inside, drawn = 0, np.zeros(4000)
    for frame, result in updated:
        inside += sum(
            low <= truth <= high
            for truth, (low, high) in zip(
                frame.truth, (p.interval(0.95) for p in result.parameters[:5]), strict=True
            )
        )
        z = rng.multivariate_normal(np.zeros(5), result.correlation[:5, :5], len(drawn))
        drawn += (np.abs(z) < half).sum(axis=1)
    low, high = np.quantile(drawn, [1e-3, 1 - 1e-3])
    assert low <= inside <= high, (inside, 5 * len(updated))


def test_a_start_far_off_is_enough():
    """Two members 60 % too soft and two 150 % too stiff: fits to damped FRFs come from there."""
    frame = measure(33)
    wrong = frame.model.with_values(dict(zip(frame.refs, [-0.6, -0.6, 1.5, 1.5, 7850.0], strict=True)))
    result = update(
        wrong,
        dict.fromkeys(frame.refs, 0.5),
        frf=frame.frf,
        outputs=frame.outputs,
        inputs=frame.inputs,
        noise=NOISE,
        model_error=0.0,
    )
    assert result.misfit["frf"] < 1.1
    scale = np.append(1 + frame.truth[:4], frame.truth[4])
    assert np.abs((result.values[:5] - frame.truth) / scale).max() < 3e-3
