"""FRFs and measured modes of one structure in one fit."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from fem import assemble, first_modes
from tests.frames import write_study
from tests.studies import fit_problem
from updating import ModeTargets
from updating.inference import JointFunction, with_modes
from updating.inference.fitting import fit


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    study = load_study(write_study(tmp_path_factory.mktemp("joint"), 0.0))
    found = first_modes(assemble(study.model), 6)
    modes = ModeTargets.of(found.frequency[found.n_rigid :][:6] * 1.01, 1e-5)
    return replace(fit_problem(study), modes=modes)


def joint(problem):
    function = problem.function((), (), problem.lines_up_to(np.inf, 20))
    return function, with_modes(problem, function, np.inf)


def test_residuals_of_modes_stand_behind_those_of_frfs(problem):
    frf, both = joint(problem)
    assert isinstance(both, JointFunction)
    x, step = both.start + 0.002, 1e-6
    r, J = both(x, True)
    n = len(frf(x, False)[0])
    assert r[:n] == pytest.approx(frf(x, False)[0])
    assert len(r) == n + problem.modes.n
    for k in range(2):
        d = np.zeros(len(x))
        d[k] = step
        numeric = (both(x + d, False)[0] - both(x - d, False)[0]) / (2 * step)
        assert np.abs(numeric - J[k])[n:].max() < 1e-4 * np.abs(J[k, n:]).max()


def test_costs_of_both_add_and_their_weights_are_twice_the_slopes(problem):
    frf, both = joint(problem)
    levels = both.levels()
    v = 1.3 * levels.noise
    k = len(frf.levels().noise)
    assert levels.cost(v) == pytest.approx(levels.frf.cost(v[:k]) + levels.modes.cost(v[k:]))
    d = np.zeros(len(v))
    d[-1] = 1e-5 * v[-1]
    slope = (levels.cost(v + d) - levels.cost(v - d)) / (2 * d[-1])
    assert 2 * slope == pytest.approx(levels.weight(v)[-1], rel=1e-4)


def test_exact_frequencies_move_the_modulus_that_rough_frfs_leave_open(problem):
    """Frequencies 1 % higher are a modulus 2 % higher, or a density 2 % lower, in parts of their priors."""
    rough = replace(problem, data=replace(problem.data, noise=50 * problem.data.noise), model_error=0.0)
    ratio = {}
    for name, p in (("frfs", replace(rough, modes=None)), ("both", rough)):
        values = fit(p, n_lines=40).values
        ratio[name] = values["frame", "E:steel"] / values["frame", "rho:steel"]
    assert ratio["both"] / ratio["frfs"] > 1.01
