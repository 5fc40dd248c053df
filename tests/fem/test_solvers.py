"""Factorisations under attack: any pattern, indefinite, complex, singular; and block Lanczos on top."""

import importlib.util
import sys

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info

from fem import SingularMatrixError, SolverError
from fem.linalg.lanczos import EQUAL, lowest_eigenpairs
from fem.linalg.multifrontal import COLUMN_MAJOR, LEAF, plan_elimination
from fem.linalg.solvers import BACKENDS, factorise, one_thread

EPS = np.finfo(float).eps

INSTALLED = [name for name in BACKENDS if name != "pardiso" or importlib.util.find_spec("pypardiso")]
"""PARDISO is tested with the extra `accelerate`."""


def backward_error(A, x, b):
    """Return ‖Ax - b‖ / (‖A‖ ‖x‖ + ‖b‖) of the worst column, in maximum norms (Rigal and Gaches)."""
    norm = abs(A).sum(axis=1).max()
    return (abs(A @ x - b).max(axis=0) / (norm * abs(x).max(axis=0) + abs(b).max(axis=0))).max()


def random_matrix(n, degree, seed, kind="definite"):
    """Return a symmetric matrix with random entries; definite ones are dominated by their diagonal."""
    rng = np.random.default_rng(seed)
    i, j = rng.integers(0, n, (2, degree * n))
    values = rng.standard_normal(len(i)) + (1j * rng.standard_normal(len(i)) if kind == "complex" else 0)
    A = sp.coo_array((values, (i, j)), shape=(n, n))
    A = A + A.T
    weight = np.asarray(abs(A).sum(axis=1)).ravel() + 1
    sign = np.where(rng.random(n) < 0.5, 1, -1) if kind == "indefinite" else 1
    return sp.csc_array(A + sp.diags_array(sign * weight))


def grid(*shape):
    """Return the Laplacian of a grid of points, plus 1."""
    total = None
    for n in shape:
        line = sp.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1])
        total = line if total is None else sp.kronsum(line, total)
    return sp.csc_array(total + sp.eye_array(total.shape[0]))


@pytest.mark.parametrize("backend", INSTALLED)
@pytest.mark.parametrize("kind", ["definite", "indefinite", "complex"])
@settings(max_examples=25, deadline=None)
@given(n=st.integers(1, 400), degree=st.integers(0, 3), seed=st.integers(0, 2**32 - 1))
def test_any_pattern_is_solved_to_rounding(backend, kind, n, degree, seed):
    A = random_matrix(n, degree, seed, kind)
    b = np.random.default_rng(seed).standard_normal((n, 3))
    x = factorise(A, backend=backend).solve(b)
    # matrices dominated by their diagonal do not let entries grow: a few roundings for each of n steps
    assert backward_error(A, x, b) < 3 * n * EPS + 10 * EPS


@pytest.mark.parametrize(
    "A",
    [
        grid(1),
        grid(5),
        grid(3000),  # a chain
        grid(40, 41),
        grid(10, 11, 12),
        sp.csc_array(sp.eye_array(500)),  # nothing is coupled
        sp.csc_array(sp.block_diag([grid(30, 30), grid(2000), np.eye(7) + 1])),  # in parts
        sp.csc_array(np.eye(300) + np.ones((300, 300))),  # all is coupled
        sp.csc_array(sp.kron(grid(12, 12), np.eye(6) + 1)),  # six coordinates in each point
    ],
    ids=["one", "few", "chain", "plane", "cube", "diagonal", "parts", "full", "points"],
)
def test_grids(A):
    factor = factorise(A, backend="multifrontal")
    b = np.random.default_rng(0).standard_normal((A.shape[0], 2))
    x = factor.solve(b)
    assert backward_error(A, x, b) < 100 * EPS
    np.testing.assert_allclose(factor.solve(b[:, 0]), x[:, 0], rtol=1e-12, atol=1e-12 * abs(x).max())
    assert factor.count_negative() == 0


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["definite", "negative"])
def test_places_give_planes_as_separators(sign):
    """The last separator of a cube of n³ nodes, each coupled to 26 others, is a plane of n² nodes."""
    n = 12
    line = sp.diags_array([np.ones(n - 1), np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])
    coupled = sp.kron(sp.kron(line, line), line)
    A = sp.csc_array(sign * (sp.diags_array(np.asarray(coupled.sum(axis=1)).ravel() + 1.0) - coupled / 2))
    places = np.argwhere(np.ones((n, n, n))) * [0.1, 0.1, 0.1]
    last = [plan_elimination(A, places=at).fronts[-1] for at in (places, None)]
    assert last[0].last - last[0].first == n**2 < last[1].last - last[1].first
    # fronts of many coordinates have kernels of their own
    factor = factorise(A, backend="multifrontal", places=places)
    b = np.random.default_rng(0).standard_normal((n**3, 9))
    assert backward_error(A, factor.solve(b), b) < 100 * EPS
    assert factor.count_negative() == (0 if sign > 0 else n**3)


def test_wide_fronts():
    """A full matrix is one front, above the size from which right-hand sides are copied by columns."""
    for kind in ("definite", "indefinite", "complex"):
        A = sp.csc_array(random_matrix(COLUMN_MAJOR + 40, 60, 3, kind).toarray())
        A = sp.csc_array(A + sp.csc_array(np.full(A.shape, 1e-3)))
        A = sp.csc_array(sp.block_array([[A, None], [None, grid(30, 30)]]))
        b = np.random.default_rng(0).standard_normal((A.shape[0], 3))
        factor = factorise(A, backend="multifrontal")
        assert any(front.last - front.first >= COLUMN_MAJOR for front in factor.plan.fronts)
        assert backward_error(A, factor.solve(b), b) < 1000 * EPS


def test_complex_forces_on_a_real_matrix():
    A, b = grid(30, 40), np.random.default_rng(0).standard_normal((1200, 2)) @ np.array([[1], [1j]])
    assert backward_error(A, factorise(A, backend="multifrontal").solve(b), b) < 100 * EPS


@pytest.mark.parametrize("backend", INSTALLED)
@settings(max_examples=25, deadline=None)
@given(
    shape=st.sampled_from([(50,), (20, 13), (6, 7, 5)]), where=st.floats(0.0, 1.0), seed=st.integers(0, 99)
)
def test_negative_eigenvalues_are_counted(backend, shape, where, seed):
    # Kx = λMx with random masses, as Sturm's count wants it
    K = grid(*shape)
    M = sp.diags_array(np.random.default_rng(seed).uniform(0.5, 2.0, K.shape[0]))
    lam = np.linalg.eigvalsh(K.toarray() / np.sqrt(np.outer(M.diagonal(), M.diagonal())))
    k = int(where * (len(lam) - 1))
    if k and lam[k] - lam[k - 1] < 1e-9 * lam[-1]:
        return
    mu = (lam[k - 1] + lam[k]) / 2 if k else 0.9 * lam[0]
    assert factorise(K - mu * M, backend=backend).count_negative() == k


@pytest.mark.parametrize("backend", INSTALLED)
def test_what_cannot_be_counted_is_refused(backend):
    with pytest.raises(ValueError, match="complex matrix"):
        factorise(grid(20) * (1 + 0.1j), backend=backend).count_negative()


def test_signs_of_pivots_off_the_diagonal_are_refused():
    swap = sp.csc_array(np.array([[0.0, 1.0], [1.0, 0.0]]))
    with pytest.raises(ValueError, match="left the diagonal"):
        factorise(swap, backend="superlu").count_negative()
    assert factorise(swap, backend="multifrontal").count_negative() == 1  # eigenvalues 1 and -1


@pytest.mark.parametrize("backend", INSTALLED)
def test_a_singular_matrix_is_an_error(backend):
    diagonal = np.ones(200)
    diagonal[77] = 0.0
    with pytest.raises(SingularMatrixError, match="of 200 equations is singular"):
        factorise(sp.csc_array(sp.diags_array(diagonal)), backend=backend)


def test_a_plan_serves_matrices_of_its_pattern_and_no_others():
    A = grid(40, 40)
    first = factorise(A, backend="multifrontal")
    again = factorise(sp.csc_array(A * 2 - 3j * sp.eye_array(1600)), first, backend="multifrontal")
    assert again.plan is first.plan
    other = grid(1600)
    new = factorise(other, first, backend="multifrontal")
    assert new.plan is not first.plan
    b = np.ones(1600)
    assert abs(other @ new.solve(b) - b).max() < 1e-10


def test_duplicate_entries_are_summed_and_the_matrix_stays_as_it_is():
    A = sp.csc_array((np.ones(4), np.array([0, 0, 1, 1]), np.array([0, 2, 4])), shape=(2, 2))
    x = factorise(A, backend="multifrontal").solve(np.array([2.0, 4.0]))
    np.testing.assert_allclose(x, [1, 2], rtol=1e-15)
    assert A.nnz == 4


def test_fronts_are_as_small_as_nested_dissection_makes_them():
    # Level sets of distances from a corner of a cube of n³ points have at most 3n²/4 + 1 of them, from other
    # places no more than a few per cent more than n².
    n = 14
    plan = plan_elimination(grid(n, n, n))
    assert max(f.last - f.first for f in plan.fronts) <= max(n**2, LEAF)
    assert sorted(plan.permutation) == list(range(n**3))
    # George: O(n log n) entries in a plane grid, 31/8 n² log₂ n for n² points in his order
    m = 64
    plan = plan_elimination(grid(m, m), leaf=8)
    entries = sum((f.last - f.first) * ((f.last - f.first + 1) / 2 + len(f.boundary)) for f in plan.fronts)
    assert entries < 31 / 8 * m**2 * np.log2(m) * 1.5
    # a chain: three coordinates for each, whatever its length
    plan = plan_elimination(grid(5000), leaf=1)
    assert max(f.last - f.first for f in plan.fronts) == 1
    assert max(len(f.boundary) for f in plan.fronts) <= 2


def test_the_backend_can_be_chosen(monkeypatch):
    A = grid(20, 20)
    assert factorise(A).backend == "superlu"
    assert factorise(grid(40, 40)).backend == "multifrontal"
    assert factorise(A, backend="multifrontal").backend == "multifrontal"
    monkeypatch.setenv("DOVETAIL_SOLVER", "multifrontal")
    assert factorise(A).backend == "multifrontal"
    monkeypatch.setenv("DOVETAIL_SOLVER", "mumps")
    with pytest.raises(ValueError, match="no solver 'mumps'; there are superlu, multifrontal"):
        factorise(A)


def test_one_thread_within_and_as_many_as_before_after():
    def threads():
        return [lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"]

    before = threads()
    with one_thread():
        assert set(threads()) == {1}
    assert threads() == before


def laplace(n):
    """Return the exact eigenvalues of `grid(n)`."""
    return 3 - 2 * np.cos(np.arange(1, n + 1) * np.pi / (n + 1))


@pytest.mark.parametrize("copies", [1, 7, 8, 9, 20])
@pytest.mark.parametrize("n", [1, 12, 45])
def test_eigenvalues_repeated_more_often_than_the_block_has_vectors(copies, n):
    K = sp.csc_array(sp.kron(sp.eye_array(copies), grid(60)))
    pairs = lowest_eigenpairs(factorise(K).solve, sp.eye_array(60 * copies, format="csr"), 0.0, n, block=8)
    exact = np.repeat(laplace(60), copies)[:n]
    # |Δλ| ≤ residual · λ at most, and its square over the gap to others: all to rounding here
    np.testing.assert_allclose(pairs.eigenvalues[:n], exact, rtol=1e-12)
    X = pairs.vectors
    np.testing.assert_allclose(X.T @ X, np.eye(X.shape[1]), atol=1e-9)
    assert (pairs.residual < 1e-9).all()


def test_close_eigenvalues_are_told_apart():
    # ten copies with stiffness apart by 1e-7, ten times what counts as equal
    scale = 1 + 10 * EQUAL * np.arange(10)
    K = sp.csc_array(sp.kron(sp.diags_array(scale), grid(60)))
    pairs = lowest_eigenpairs(factorise(K).solve, sp.eye_array(600, format="csr"), 0.0, 15, block=4)
    exact = np.sort(np.outer(laplace(60), scale).ravel())[:15]
    np.testing.assert_allclose(pairs.eigenvalues[:15], exact, rtol=EQUAL / 100)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 30), limit=st.floats(0.0, 2.0))
def test_residuals_bound_the_error(seed, n, limit):
    rng = np.random.default_rng(seed)
    K = grid(9, 8, 7)
    M = sp.csr_array(sp.diags_array(rng.uniform(0.1, 1.0, K.shape[0])))
    shift = -0.3
    pairs = lowest_eigenpairs(factorise(K - shift * M).solve, M, shift, n, limit)
    exact = sla.eigvalsh(K.toarray(), M.toarray())
    assert len(pairs.eigenvalues) == max(n, (exact <= limit).sum() + 1)
    lam = exact[: len(pairs.eigenvalues)]
    assert (abs(pairs.eigenvalues - lam) <= pairs.residual * (lam - shift) + 1e-14 * exact[-1]).all()
    assert pairs.following >= exact[len(lam)] * (1 - 1e-12)


def test_directions_without_mass_have_no_mode():
    K, mass = grid(400), np.zeros(400)
    mass[[10, 200, 390]] = [1.0, 2.0, 3.0]
    pairs = lowest_eigenpairs(factorise(K).solve, sp.csr_array(sp.diags_array(mass)), 0.0, 5)
    at = np.flatnonzero(mass)
    flexibility = np.linalg.inv(K.toarray())[np.ix_(at, at)]
    exact = np.sort(1 / sla.eigvals(flexibility @ np.diag(mass[at])).real)
    np.testing.assert_allclose(pairs.eigenvalues, exact, rtol=1e-12)


def test_known_vectors_are_left_out():
    K, M = grid(30, 31), sp.eye_array(930, format="csr")
    solve = factorise(K).solve
    first = lowest_eigenpairs(solve, M, 0.0, 6)
    rest = lowest_eigenpairs(solve, M, 0.0, 6, known=first.vectors[:, :4])
    both = lowest_eigenpairs(solve, M, 0.0, 10)
    np.testing.assert_allclose(rest.eigenvalues, both.eigenvalues[4:], rtol=1e-11)


def test_pardiso_solves_and_counts_like_the_others():
    """With the extra `accelerate`: the same solutions to rounding, and the same inertia."""
    pytest.importorskip("pypardiso", reason="PARDISO comes with the extra accelerate")
    rng = np.random.default_rng(3)
    n = 400
    A = sp.random_array((n, n), density=0.01, rng=rng, format="csr")
    A = sp.csc_array(A + A.T + sp.diags_array(rng.choice([-3.0, 4.0], n)))
    ours, theirs = factorise(A, backend="multifrontal"), factorise(A, backend="pardiso")
    b = rng.standard_normal((n, 5))
    # relative residuals of a backward stable solution are a few roundings times the growth of the pivots
    for right in (b, b[:, 0], b + 2j * b[::-1]):
        x = theirs.solve(right)
        assert x.shape == right.shape
        assert np.linalg.norm(A @ x - right) < 1e-12 * np.linalg.norm(right) * n
    assert (
        theirs.count_negative() == ours.count_negative() == int((np.linalg.eigvalsh(A.toarray()) < 0).sum())
    )
    assert factorise(A * (1 + 0.1j), backend="pardiso").backend == "multifrontal"


def test_pardiso_says_where_it_comes_from(monkeypatch):
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    with pytest.raises(ImportError, match="pip install pypardiso"):
        factorise(sp.eye_array(4, format="csc"), backend="pardiso")


def test_a_solver_that_is_not_there_is_named_with_those_that_are(monkeypatch):
    monkeypatch.setenv("DOVETAIL_SOLVER", "mumps")
    with pytest.raises(SolverError, match="no solver 'mumps'; there are superlu, multifrontal, pardiso, and"):
        factorise(grid(3))
