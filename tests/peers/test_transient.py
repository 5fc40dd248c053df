"""OpenSees and Dovetail step random frames in time alike: the average acceleration, Rayleigh damping."""

import numpy as np
import pytest

from benchmarks.peers.drive_dovetail import compute
from benchmarks.peers.exchange import EULER_BERNOULLI, PEERS_PYTHON, TIMOSHENKO, run, with_changes
from tests.peers.frames import peer_frame

pytestmark = pytest.mark.peer

SEEDS = range(4)


def in_time(seed, theory, per_period=10, periods=20):
    """Return a random frame that is loaded by a smooth pulse, with three of its directions watched.

    Steps are a part of the first period, however fast the other modes are.
    """
    frame = peer_frame(seed, theory)
    found = compute(with_changes(frame, n_modes=1, static=False))
    first = 1 / found.frequency[0]
    t = np.arange(periods * per_period + 1) * first / per_period
    watched = np.flatnonzero(~frame.fixed.ravel())[[0, 7, -1]]
    return with_changes(
        frame,
        n_modes=0,
        static=False,
        uniform=np.zeros_like(frame.uniform),
        history=np.sin(np.pi * np.minimum(t / (3 * first), 1)) ** 2,
        step=float(t[1]),
        alpha=0.05 / first,
        beta=1e-3 * first,
        watched=watched,
    )


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """Return frames and OpenSees' responses: random ones, then one with smaller and smaller steps."""
    frames = [in_time(seed, theory) for seed in SEEDS for theory in (EULER_BERNOULLI, TIMOSHENKO)]
    frames += [in_time(0, EULER_BERNOULLI, n, 4) for n in (100, 200)]
    found = run("drive_opensees", frames, tmp_path_factory.mktemp("opensees"), PEERS_PYTHON)
    return [(frame, other.responses) for frame, other in zip(frames, found, strict=True)]


def test_steps_agree_as_far_as_rounding_allows(stepped):
    """A step solves equations of condition 1e6 or so; the damped motion forgets their errors."""
    for frame, theirs in stepped[:-2]:
        size = np.abs(theirs).max(axis=0)
        assert size.min() > 0
        assert (np.abs(compute(frame).responses - theirs).max(axis=0) / size).max() < 1e-8


def test_opensees_converges_to_all_modes(stepped):
    """OpenSees' steps err by their square; modes step exactly, and all of them are the limit."""
    errors = []
    for frame, theirs in stepped[-2:]:
        exact = compute(with_changes(frame, way="modal", n_modes=int((~frame.fixed).sum()))).responses
        errors.append((np.abs(theirs - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
