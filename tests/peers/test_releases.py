"""Members with released ends: statics agree, and the programs' masses differ in a way that is predicted.

Dovetail's mass is that of the shapes that a released member takes. OpenSees keeps the mass of the member with
both ends held, on the rotations of the nodes. PyNite condenses the mass matrix as if it were a stiffness.
"""

import numpy as np
import pytest
import scipy.linalg as sla

from benchmarks.peers.drive_dovetail import compute, model_of
from benchmarks.peers.exchange import PeerFrame, run, with_changes
from fem import assemble, solve_modes, sum_contributions
from tests.peers.frames import peer_frame, random_releases, single_member
from tests.peers.test_agreement import assert_statics_agree

pytestmark = pytest.mark.peer

SEEDS = range(8)
SIZES = (4, 8, 16)
PROGRAMS = ("drive_opensees", "drive_pynite")


def released_frame(seed: int) -> PeerFrame:
    frame = peer_frame(seed)
    return with_changes(frame, released=random_releases(frame, seed))


def column(n: int) -> PeerFrame:
    """Return a beam between two clamped points in n members, released at its ends: pinned in bending."""
    frame = single_member(3)
    points = np.linspace(0, 3, n + 1)[:, None] * frame.points[1]
    rows = {
        name: np.repeat(getattr(frame, name), n, axis=0)
        for name in ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz", "local_z", "uniform")
    }
    released = np.zeros((n, 2, 2), dtype=bool)
    released[0, 0] = released[-1, 1] = True
    fixed = np.zeros((n + 1, 6), dtype=bool)
    fixed[[0, -1]] = True
    return with_changes(
        frame,
        **rows,
        points=points - points[0],
        lines=np.column_stack([np.arange(n), np.arange(1, n + 1)]),
        fixed=fixed,
        loads=np.zeros((n + 1, 6)),
        released=released,
        matrices=False,
        n_modes=2,
    )


def frequencies_with(frame: PeerFrame, M: np.ndarray) -> np.ndarray:
    """Return the frequencies that Dovetail's stiffness and a mass matrix (n_dof, n_dof) have."""
    model, free = model_of(frame), np.flatnonzero(~frame.fixed.ravel())
    K = sum_contributions(model.contributions(), model.n_dof)[0].toarray()
    inside = np.ix_(free, free)
    squares = sla.eigh(K[inside], M[inside], eigvals_only=True, subset_by_index=(0, frame.n_modes - 1))
    return np.sqrt(squares) / (2 * np.pi)


def mass_as_held(frame: PeerFrame) -> np.ndarray:
    """Return the mass with no end released."""
    model = model_of(with_changes(frame, released=np.zeros_like(frame.released)))
    return sum_contributions(model.contributions(), model.n_dof)[1].toarray()


def mass_condensed(frame: PeerFrame) -> np.ndarray:
    """Return the mass of members from which released rotations r are taken by m_kk - m_kr m_rr⁻¹ m_rk."""
    M = np.zeros((6 * len(frame.points),) * 2)
    for k, ends in enumerate(frame.lines):
        alone = {
            name: getattr(frame, name)[k : k + 1]
            for name in ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz", "local_z", "uniform", "released")
        }
        member = with_changes(
            frame,
            **alone,
            points=frame.points[ends],
            lines=np.array([[0, 1]]),
            fixed=frame.fixed[ends],
            loads=frame.loads[ends],
        )
        x = np.diff(member.points, axis=0)[0] / np.linalg.norm(np.diff(member.points, axis=0))
        z = member.local_z[0]
        T = np.kron(np.eye(4), np.array([x, np.cross(z, x), z]))
        m = T @ mass_as_held(member) @ T.T
        free = np.zeros((2, 6), dtype=bool)
        free[:, 4:] = member.released[0]
        r, kept = np.flatnonzero(free.ravel()), np.flatnonzero(~free.ravel())
        condensed = np.zeros((12, 12))
        condensed[np.ix_(kept, kept)] = m[np.ix_(kept, kept)]
        if r.size:
            condensed[np.ix_(kept, kept)] -= (
                m[np.ix_(kept, r)] @ np.linalg.inv(m[np.ix_(r, r)]) @ m[np.ix_(r, kept)]
            )
        at = (6 * ends[:, None] + np.arange(6)).ravel()
        M[np.ix_(at, at)] += T.T @ condensed @ T
    return M


MASS = {"drive_opensees": mass_as_held, "drive_pynite": mass_condensed}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("releases")
    frames = [*map(released_frame, SEEDS), *map(column, SIZES)]
    return {driver: run(driver, frames, folder) for driver in PROGRAMS}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("driver", PROGRAMS)
def test_statics_agree(results, driver, seed):
    assert_statics_agree(released_frame(seed), results[driver][seed])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("driver", PROGRAMS)
def test_their_mass_explains_their_frequencies(results, driver, seed):
    frame, theirs = released_frame(seed), results[driver][seed]
    np.testing.assert_allclose(theirs.frequency, frequencies_with(frame, MASS[driver](frame)), rtol=1e-8)
    ours = compute(frame)
    assert abs(theirs.frequency / ours.frequency - 1).max() > 1e-3  # there is something to explain


def test_a_translation_moves_the_whole_mass():
    """With both released at one end, PyNite's member keeps 114 of 420 parts of its mass across its axis."""
    frame = with_changes(single_member(1), released=np.array([[[True, True], [False, False]]]))
    model = model_of(frame)
    ours = sum_contributions(model.contributions(), model.n_dof)[1].toarray()
    length = np.linalg.norm(frame.points[1] - frame.points[0])
    mass = (frame.rho * frame.A)[0] * length
    across = np.tile([*frame.local_z[0], 0, 0, 0], 2)
    assert across @ ours @ across == pytest.approx(mass, rel=1e-12)
    assert across @ mass_as_held(frame) @ across == pytest.approx(mass, rel=1e-12)
    assert across @ mass_condensed(frame) @ across == pytest.approx(mass * (420 - 35**2 / 4) / 420, rel=1e-12)


@pytest.mark.parametrize("n", SIZES)
def test_a_pinned_beam_decides(results, n):
    """Dovetail has the error of its elements, (βh)⁴/1440 with β = π/L; the others' masses cost far more."""
    frame = column(n)
    length = np.linalg.norm(frame.points[-1])
    I = min(frame.Iy[0], frame.Iz[0])
    exact = np.pi / (2 * length**2) * np.sqrt(frame.E[0] * I / (frame.rho[0] * frame.A[0]))
    error = {
        driver: found[len(SEEDS) + SIZES.index(n)].frequency[0] / exact - 1
        for driver, found in results.items()
    }
    ours = solve_modes(assemble(model_of(frame)), 1).frequency[0] / exact - 1
    assert ours == pytest.approx((np.pi / n) ** 4 / 1440, rel=(2 / n) ** 2)  # the next order
    assert min(error.values()) > 50 * ours
