"""The least-squares loop and the robust loss, against SciPy's, and where the model has no response."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.special import pseudo_huber as half_pseudo_huber

from tests.updating.test_numerics import seeds
from updating.least_squares import (
    Control,
    Linearisation,
    Stop,
    Tolerance,
    minimise,
    pseudo_huber,
    pseudo_huber_weight,
    step_within,
)
from updating.least_squares.levenberg_marquardt import promised_gain

FREE = (np.full(2, -np.inf), np.full(2, np.inf))


@dataclass
class Point:
    x: np.ndarray
    cost: float


class Squares:
    """Half a sum of squares of residuals r(x) with the Jacobian J(x), (m, n)."""

    def __init__(self, r, J, possible=lambda x: True):
        self.r, self.J, self.possible = r, J, possible

    def at(self, x, near=None):
        return Point(x, 0.5 * float(self.r(x) @ self.r(x))) if self.possible(x) else None

    def linearised(self, point):
        r, J = self.r(point.x), self.J(point.x)
        return Linearisation(J.T @ r, J.T @ J)


@dataclass(frozen=True, eq=False)
class KeptLinearisation(Linearisation):
    """A linearisation that lends its Jacobian to points near by."""

    objective: "Squares"
    J: np.ndarray

    def again(self, point):
        return KeptLinearisation(self.J.T @ self.objective.r(point.x), self.matrix, self.objective, self.J)


class KeptSquares(Squares):
    """The same, which keeps its Jacobians and counts them."""

    n_made = 0

    def linearised(self, point):
        self.n_made += 1
        r, J = self.r(point.x), self.J(point.x)
        return KeptLinearisation(J.T @ r, J.T @ J, self, J)


ROSENBROCK = (
    lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
    lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
)


def control(**more):
    keys = {"reach": lambda x: np.full(len(x), np.inf), "max_iterations": 300}
    keys |= {"promised_gain": Tolerance(1e-14), "actual_gain": Tolerance(), **more}
    return Control(**keys)


def run(objective, start, bounds=FREE, **more):
    return minimise(objective, objective.at(np.array(start)), bounds, control(**more))


@pytest.mark.parametrize("upper", [(np.inf, np.inf), (0.5, np.inf), (np.inf, 0.3), (-1.0, 2.0)])
def test_a_valley_is_followed_to_the_minimum_within_bounds(upper):
    high = np.array(upper)
    start = np.minimum([-1.2, 1.0], high)
    found = run(Squares(*ROSENBROCK), start, (np.full(2, -5.0), high))
    inside = np.clip(start, -4.99, high - 0.01)  # SciPy's starts lie strictly within
    expected = least_squares(*ROSENBROCK[:1], inside, jac=ROSENBROCK[1], bounds=(-5.0, high), xtol=1e-15)
    assert_allclose(found.point.x, expected.x, atol=1e-6)
    assert found.stop is Stop.CONVERGED


def test_derivatives_serve_while_steps_gain_what_they_promise():
    # nearly linear: each step is promised well, and the residuals alone are new
    def r(x):
        return np.array([x[0] + 0.02 * x[0] ** 2 - 1.0, x[1] + 0.01 * x[0] * x[1] + 2.0])

    def J(x):
        return np.array([[1 + 0.04 * x[0], 0.0], [0.01 * x[1], 1 + 0.01 * x[0]]])

    plain, kept = Squares(r, J), KeptSquares(r, J)
    expected, found = run(plain, [3.0, 3.0], damping=0.3), run(kept, [3.0, 3.0], damping=0.3)
    assert_allclose(found.point.x, expected.point.x, atol=1e-6)
    assert kept.n_made < found.n_iterations


@pytest.mark.parametrize("limit", ["promised_gain", "actual_gain"])
def test_derivatives_of_another_point_do_not_end_it(limit):
    # where a kept gradient says that nothing is left to gain, new derivatives see that there is
    start = [-1.2, 1.0]
    plain, kept = (
        run(kind(*ROSENBROCK), start, **{limit: Tolerance(1e-3)}) for kind in (Squares, KeptSquares)
    )
    assert kept.point.cost < max(plain.point.cost, 1e-3)
    free = np.ones(2, dtype=bool)
    last = Squares(*ROSENBROCK).linearised(kept.point)
    assert promised_gain(last, free) < 1e-2


def test_steps_do_not_depend_on_units():
    unit = np.array([1e6, 1e-6])
    plain = run(Squares(*ROSENBROCK), [-1.2, 1.0])
    scaled = Squares(lambda x: ROSENBROCK[0](x / unit), lambda x: ROSENBROCK[1](x / unit) / unit)
    found = run(scaled, np.array([-1.2, 1.0]) * unit)
    assert found.n_iterations == plain.n_iterations
    assert_allclose(found.point.x / unit, plain.point.x, rtol=1e-8)


def test_a_trial_without_a_response_shortens_the_step():
    # the full first step to 4 lies where there is nothing, and the minimum at the last place with something
    objective = Squares(lambda x: x - 4.0, lambda x: np.eye(1), lambda x: x[0] < 3.0)
    bounds = (np.array([-9.0]), np.array([9.0]))
    found = run(objective, [0.0], bounds, max_trials=40)
    assert found.stop is Stop.NO_DESCENT
    assert 2.9 < found.point.x[0] < 3.0


def test_no_step_is_longer_than_its_reach_and_cut_steps_do_not_end_it():
    path = []
    objective = Squares(lambda x: x - [100.0, 1.0], lambda x: np.eye(2))
    minimise(
        objective,
        objective.at(np.zeros(2)),
        FREE,
        control(reach=lambda x: np.array([2.0, np.inf]), actual_gain=Tolerance(1e9)),
        lambda point, length: path.append(point.x),
    )
    steps = np.diff([np.zeros(2), *path], axis=0)
    assert np.abs(steps[:, 0]).max() <= 2.0
    assert_allclose(path[-1], [100.0, 1.0], atol=1e-4)


def test_a_step_that_gains_much_less_than_expected_need_not_end_it():
    # steps cross the curved valley at x < 0, where they gain a fifth of what the quadratic model says
    keys = {"actual_gain": Tolerance(0.01), "damping": 1e-3}
    early = run(Squares(*ROSENBROCK), [-2.0, 4.0], **keys)
    late = run(Squares(*ROSENBROCK), [-2.0, 4.0], least_gain_ratio=0.2, **keys)
    assert early.stop is late.stop is Stop.CONVERGED
    assert early.point.cost > 0.1
    assert late.point.cost < 1e-5


@pytest.mark.parametrize(
    ("low", "high", "slope", "stop"),
    [
        ([2.0, 2.0], [3.0, 3.0], 1.0, Stop.AT_BOUNDS),
        ([0.0, 0.0], [0.0, 0.0], 1.0, Stop.AT_BOUNDS),
        ([-1.0, -1.0], [9.0, 9.0], 0.0, Stop.NO_INFLUENCE),
    ],
)
def test_the_end_says_why_nothing_can_move(low, high, slope, stop):
    objective = Squares(lambda x: slope * x - 1.0, lambda x: slope * np.eye(2))
    assert run(objective, low, (np.array(low), np.array(high))).stop is stop


def test_it_says_when_iterations_or_evaluations_ran_out():
    assert run(Squares(*ROSENBROCK), [-1.2, 1.0], max_iterations=3).stop is Stop.OUT_OF_ITERATIONS
    found = run(Squares(*ROSENBROCK), [-1.2, 1.0], max_evaluations=4)
    assert found.stop is Stop.OUT_OF_ITERATIONS


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.floats(-1e3, 1e3), st.floats(1e-2, 1e2))
def test_the_loss_is_twice_that_of_scipy_and_its_weight_the_derivative_by_the_square(r, turn):
    value = pseudo_huber(np.array([r]), turn)[0]
    # √(1 + t) - 1 loses digits where t is small: ε, beside t
    assert value == pytest.approx(2 * half_pseudo_huber(turn, abs(r)), rel=1e-9, abs=4e-16 * turn**2)
    h = 1e-4 * (turn**2 + r**2)
    ends = [pseudo_huber(np.sqrt(np.array([r**2 + s])), turn)[0] for s in (0.0, 2 * h)]
    middle = np.sqrt(np.array([r**2 + h]))
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(pseudo_huber_weight(middle, turn)[0], rel=1e-6)


def test_complex_residuals_count_by_their_magnitude():
    r = np.array([3 + 4j, -5.0, 5j])
    assert_allclose(pseudo_huber(r, 0.5), pseudo_huber(np.array([5.0]), 0.5)[0])


@settings(max_examples=300, derandomize=True, deadline=None)
@given(seeds, st.integers(1, 6), st.floats(0.0, 4.0))
def test_a_step_within_limits_is_better_than_a_shortened_one(seed, n, decades):
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    H = (Q * 10 ** rng.uniform(-decades / 2, decades / 2, n)) @ Q.T
    goal = 3 * rng.standard_normal(n) * 10 ** rng.uniform(-1, 1)
    g = -H @ goal
    lower, upper = -rng.uniform(0, 1, n), rng.uniform(0, 1, n)  # also none to one side
    step = step_within(goal, H, (lower, upper))
    assert ((step >= lower) & (step <= upper)).all()
    inside = (step > lower) & (step < upper)
    np.testing.assert_allclose((H @ step + g)[inside], 0, atol=1e-9 * np.abs(g).max())

    def model(p):
        return 0.5 * p @ H @ p + g @ p

    shortened = goal * min(1.0, (np.where(goal > 0, upper, lower) / goal).min())
    assert model(step) <= model(shortened) + 1e-9 * abs(model(goal))


def test_a_step_within_limits_does_not_leave_a_valley():
    across, along = np.array([3.0, 1.0]) / np.sqrt(10), np.array([1.0, -3.0]) / np.sqrt(10)
    H = 1e4 * np.outer(across, across) + 1e-2 * np.outer(along, along)
    goal = np.array([10.0, -30.0])
    step = step_within(goal, H, (-np.ones(2), np.ones(2)))
    np.testing.assert_allclose(step, [1 / 3, -1], rtol=1e-3)
