"""OpenSees and PyNite agree with Dovetail on random frames as far as rounding allows.

The formulation is the same: members with Hermite's cubics, or those of Friedman and Kosmatka, consistent
mass, and for the rotary inertia about the axis the torsion constant J, as the others have it. Where Dovetail
has the polar moment instead, the difference is predicted.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
from numpy.typing import NDArray

from benchmarks.peers.drive_dovetail import compute, model_of
from benchmarks.peers.exchange import (
    EULER_BERNOULLI,
    TIMOSHENKO,
    PeerError,
    PeerFrame,
    PeerResult,
    run,
    with_changes,
)
from fem import assemble, solve_modes, sum_contributions
from tests.peers.frames import EPS, blocks, forces_of_uniform_loads, magnitudes, peer_frame, single_member

pytestmark = pytest.mark.peer

SEEDS = range(12)
PAIRS = [
    ("drive_opensees", EULER_BERNOULLI),
    ("drive_pynite", EULER_BERNOULLI),
    ("drive_opensees", TIMOSHENKO),
]
ROUNDINGS = 20
"""Roundings in an entry of a member's matrix: eight in two products with a rotation, which have three terms;
eight in two shape functions of four terms, and four in the sum over as many Gauss points."""
CONVERGED = 1e-11
"""What OpenSees' ARPACK leaves of a frequency: its stopping test cannot be set, and 5e-12 was the most
seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Rounding:
    """How far results may be apart if every entry of K, M and f is rounded some times, to first order.

    From K δu = δf - δK u and δλ = φᵀ (δK - λ δM) φ, with the sizes of the terms that are summed.
    """

    displacement: NDArray[np.float64]  # of free DOFs
    reaction: NDArray[np.float64]  # of supported DOFs
    end_force: NDArray[np.float64]  # (m, 2, 2): of forces and of moments on both ends
    frequency: NDArray[np.float64]  # relative


def rounding(frame: PeerFrame, displacements: NDArray[np.float64]) -> Rounding:
    free = ~frame.fixed.ravel()
    model = model_of(frame)
    K, M = (X.toarray() for X in sum_contributions(model.contributions(), model.n_dof)[:2])
    # condensing a release adds and takes off what the held member has
    held = model_of(with_changes(frame, released=np.zeros_like(frame.released))).contributions()
    sizes = magnitudes(held, model.n_dof)
    on_ends = forces_of_uniform_loads(frame)
    load = np.abs(frame.loads.ravel())
    for ends, part in zip(model.mesh.lines, on_ends, strict=True):
        load[(6 * ends[:, None] + np.arange(6)).ravel()] += part
    force = ROUNDINGS * EPS * (sizes[0] @ np.abs(displacements.ravel()) + load)
    inside = np.ix_(free, free)
    u = np.abs(np.linalg.inv(K[inside])) @ force[free]
    reaction = force[~free] + np.abs(K[np.ix_(~free, free)]) @ u
    (members,) = held
    moved = np.zeros(free.size)
    moved[free] = u
    moved += ROUNDINGS * EPS * np.abs(displacements.ravel())
    on_member = np.einsum("mij,mj->mi", [blocks(k) for k in np.asarray(members.K)], moved[members.dofs])
    on_member = (on_member + ROUNDINGS * EPS * on_ends).reshape(-1, 2, 2, 3).max(axis=-1)
    squares, phi = sla.eigh(K[inside], M[inside], subset_by_index=(0, frame.n_modes - 1))
    terms = [np.einsum("ik,ij,jk->k", abs(phi), X[inside], abs(phi)) for X in sizes]
    # a shifted inverse knows the lowest best
    relative = terms[0] / squares + terms[1] + squares / squares[0]
    return Rounding(u, reaction, on_member, ROUNDINGS * EPS * relative / 2)


def assert_statics_agree(frame: PeerFrame, theirs: PeerResult) -> None:
    ours = compute(frame)
    allowed = rounding(frame, ours.displacements)
    free = ~frame.fixed.ravel()
    assert (abs(theirs.displacements - ours.displacements).ravel()[free] <= allowed.displacement).all()
    assert (theirs.displacements.ravel()[~free] == 0).all()
    assert (abs(theirs.reactions - ours.reactions).ravel()[~free] <= allowed.reaction).all()
    apart = abs(theirs.end_forces - ours.end_forces).reshape(-1, 2, 2, 3).max(axis=-1)
    assert (apart <= allowed.end_force).all()
    # rounding allows little: nine digits of what moves or holds most
    for kind in (slice(0, 3), slice(3, 6)):
        for name in ("displacements", "reactions", "end_forces"):
            a, b = getattr(theirs, name)[..., kind], getattr(ours, name)[..., kind]
            assert abs(a - b).max() < 1e-9 * abs(b).max()
        if theirs.program.startswith("PyNite"):
            a, b = theirs.section_forces[:, kind], ours.section_forces[:, kind]
            assert abs(a - b).max() < 1e-9 * abs(b).max()
    if theirs.program.startswith("PyNite"):
        assert abs(theirs.deflections - ours.deflections).max() < 1e-9 * abs(ours.deflections).max()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Return each program's results for all seeds, by driver and theory."""
    folder = tmp_path_factory.mktemp("peers")
    return {
        (driver, theory): run(driver, [peer_frame(seed, theory) for seed in SEEDS], folder)
        for driver, theory in PAIRS
    }


@pytest.fixture(scope="module")
def members(tmp_path_factory):
    """Return each program's matrices of single members, by driver and theory."""
    folder = tmp_path_factory.mktemp("members")
    return {
        (driver, theory): run(driver, [single_member(seed, theory) for seed in range(10)], folder)
        for driver, theory in PAIRS
    }


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_matrices_of_a_member_agree_entry_by_entry(members, pair, seed):
    """All of it: which terms of mass a program has, and how it turns the axes."""
    frame, theirs = single_member(seed, pair[1]), members[pair][seed]
    ours, sizes = compute(frame), magnitudes(model_of(frame).contributions(), 12)
    assert (abs(theirs.K - ours.K) <= ROUNDINGS * EPS * sizes[0]).all()
    assert (abs(theirs.M - ours.M) <= ROUNDINGS * EPS * sizes[1]).all()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_displacements_reactions_and_end_forces_agree(results, pair, seed):
    assert_statics_agree(peer_frame(seed, pair[1]), results[pair][seed])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_frequencies_agree(results, pair, seed):
    frame, theirs = peer_frame(seed, pair[1]), results[pair][seed]
    ours = compute(frame)
    allowed = rounding(frame, ours.displacements).frequency + CONVERGED
    assert (abs(theirs.frequency / ours.frequency - 1) <= allowed).all()
    assert allowed.max() < 1e-6  # six digits, whatever the frame


@pytest.mark.parametrize("seed", range(10))
def test_the_polar_moment_explains_the_difference(results, seed):
    """Dovetail's rotary inertia about the axis has Iy + Iz, the others' J: take that off, and they agree.

    On all modes of the one, K = Ω² and M = I + Φᵀ ΔM Φ are those of the other.
    """
    frame = peer_frame(seed)
    theirs = results["drive_opensees", EULER_BERNOULLI][seed]
    system = assemble(model_of(frame, polar=True))
    modes = solve_modes(system, system.n_free)
    length = np.linalg.norm(frame.points[frame.lines[:, 1]] - frame.points[frame.lines[:, 0]], axis=1)
    less = np.zeros((6 * len(frame.points),) * 2)
    for k, ends in enumerate(frame.lines):
        axis = (frame.points[ends[1]] - frame.points[ends[0]]) / length[k]
        rotations = (6 * ends[:, None] + np.arange(3, 6)).ravel()
        inertia = frame.rho[k] * (frame.J - frame.Iy - frame.Iz)[k] * length[k]
        block = inertia * np.kron([[1 / 3, 1 / 6], [1 / 6, 1 / 3]], np.outer(axis, axis))
        less[np.ix_(rotations, rotations)] += block
    changed = np.eye(modes.n_modes) + modes.shapes.T @ less @ modes.shapes
    squares = sla.eigh(np.diag(modes.omega**2), changed, eigvals_only=True)[: frame.n_modes]
    predicted = np.sqrt(squares) / (2 * np.pi)
    difference = theirs.frequency / modes.frequency[: frame.n_modes] - 1
    assert difference.max() > 1e-5  # there is something to explain
    assert difference.min() > -1e-9  # less inertia, higher frequencies
    np.testing.assert_allclose(theirs.frequency, predicted, rtol=1e-8)


def test_a_program_that_fails_says_so(tmp_path):
    with pytest.raises(PeerError, match="PyNite has no 'timoshenko' members"):
        run("drive_pynite", [single_member(0, TIMOSHENKO)], tmp_path)


def test_the_driver_of_dovetail_gives_what_it_computes(tmp_path):
    frame = peer_frame(0)
    (result,) = run("drive_dovetail", [frame], tmp_path, Path(sys.executable))
    np.testing.assert_array_equal(result.frequency, compute(frame).frequency)
