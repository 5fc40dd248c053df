"""Random frames as other programs read them, and what rounding may do to their results."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.exchange import EULER_BERNOULLI, PeerFrame, with_changes
from fem import Frame
from tests.random_frames import metal_block, random_frame

EPS = float(np.finfo(float).eps)


def peer_frame(seed: int, theory: str = EULER_BERNOULLI) -> PeerFrame:
    """Return a random frame with random supports and forces, as it is written for other programs."""
    rng = np.random.default_rng([seed, 1])  # not the numbers that the frame itself is drawn with
    n = int(rng.integers(4, 13))
    m = n - 1 + n // 2
    model = random_frame(
        seed, metal_block(theory), n_points=n, loops=n // 2, foot=False, flip=rng.random(m) < 0.5
    )
    ((beams,), mesh) = model.of_kind(Frame), model.mesh
    parts = [beams.members[f"m{k}"] for k in range(m)]
    materials = {name: np.array([getattr(p.material, name) for p in parts]) for name in ("E", "G", "rho")}
    sections = {
        name: np.array([getattr(p.section, name) for p in parts])
        for name in ("A", "Iy", "Iz", "J", "ky", "kz")
    }
    fixed = rng.random((n, 6)) < 0.1
    fixed[0] = True
    return PeerFrame(
        points=mesh.points,
        lines=mesh.lines,
        local_z=beams.rotations(mesh)[:, 2],
        **materials,
        **sections,
        fixed=fixed,
        loads=rng.standard_normal((n, 6)) * np.repeat([1000.0, 100.0], 3),
        uniform=rng.normal(0, 300.0, (m, 3)) * (rng.random((m, 1)) < 0.5),
        released=np.zeros((m, 2, 2), dtype=bool),
        theory=theory,
        within=float(rng.uniform(0.1, 0.9)),
        n_modes=min(10, int((~fixed).sum()) // 3),
    )


def random_releases(frame: PeerFrame, seed: int) -> NDArray[np.bool_]:
    """Return releases of members' ends that leave no mechanism: a tree of members keeps all of its ends."""
    rng = np.random.default_rng(seed)
    released = rng.random((len(frame.lines), 2, 2)) < 0.6
    reached = np.zeros(len(frame.points), dtype=bool)
    reached[0] = True
    for _ in frame.points:
        for k, ends in enumerate(frame.lines):
            if reached[ends].sum() == 1:
                released[k], reached[ends] = False, True
    return released


def single_member(seed: int, theory: str = EULER_BERNOULLI) -> PeerFrame:
    """Return one clamped member of a random frame, of which K and M are wanted."""
    frame = peer_frame(seed, theory)
    rows = {
        name: getattr(frame, name)[:1]
        for name in ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz", "local_z", "uniform", "released")
    }
    fixed = np.zeros((2, 6), dtype=bool)
    fixed[0] = True
    return with_changes(
        frame,
        **rows,
        points=frame.points[frame.lines[0]],
        lines=np.array([[0, 1]]),
        fixed=fixed,
        loads=np.zeros((2, 6)),
        matrices=True,
        static=False,
        n_modes=0,
    )


def magnitudes(contributions, n_dof: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sums of the absolute values of the elements' stiffness and mass, (n_dof, n_dof).

    An entry of K is a sum, and its rounding is in proportion to the terms, however much of them cancels.
    """
    K, M = np.zeros((n_dof, n_dof)), np.zeros((n_dof, n_dof))
    for part in contributions:
        for at, k, m in zip(part.dofs, part.K, part.M, strict=True):
            K[np.ix_(at, at)] += blocks(k)
            M[np.ix_(at, at)] += blocks(m)
    return K, M


def forces_of_uniform_loads(frame: PeerFrame) -> NDArray[np.float64]:
    """Return the sizes (m, 12) of the forces and moments that hold the ends of loaded members."""
    length = np.linalg.norm(np.diff(frame.points[frame.lines], axis=1)[:, 0], axis=1)
    largest = length * np.abs(frame.uniform).max(axis=1)
    return np.tile(np.repeat(np.column_stack([largest / 2, length * largest / 12]), 3, axis=1), 2)


def blocks(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest entry of each 3 by 3 block, in all of the block's places: a rotation mixes them."""
    size = np.abs(matrix).reshape(4, 3, 4, 3).max(axis=(1, 3))
    return np.kron(size, np.ones((3, 3)))
