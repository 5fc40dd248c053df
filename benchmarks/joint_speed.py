"""Time the joint package: direct solution, output error, LM-FBS; ratios against plain references in one run.

OPENBLAS_NUM_THREADS=1 python -m benchmarks.joint_speed
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.joint_noise import ALL_NODES, ARMS, noisy, parts, truth
from fem import DIRECTIONS, FRF, assemble, compute_frf
from joint import (
    couple,
    couple_frf,
    fit_joint,
    identify_joint,
    relative_coordinates,
    relative_form,
    with_masses,
)


def seconds(*calls: Callable[[], object], repeat: int = 5) -> np.ndarray:
    """Return the shortest of several times of each call [s], taken in turn to share a busy machine."""
    best = np.full(len(calls), np.inf)
    for _ in range(repeat):
        for k, call in enumerate(calls):
            start = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - start)
    return best


def direct(n_lines: int, n_blocks: int) -> None:
    """Time the direct solution with all 240 internal coordinates against the decompositions it needs.

    Lines are taken in blocks, as receptances of 240 x 240 need 0.9 MB for each.
    """
    total = np.zeros(4)
    for frequency in np.array_split(np.linspace(20.0, 3200.0, n_lines), n_blocks):
        total += _direct(frequency)
    needed, with_noise, exact, text = total
    print(f"direct solution, 240 internal coordinates, {n_lines} lines: {with_noise:.2f} s, with noise;")
    print(f"  two SVDs {needed:.2f} s, ratio {with_noise / needed:.1f}; without noise {exact / needed:.1f};")
    print(f"  A⁺ C B⁺ with pinv, line by line: {text:.2f} s\n")


def _direct(frequency: np.ndarray) -> np.ndarray:
    full = parts(frequency, None, nodes=ALL_NODES)
    form = with_masses(relative_form(full.interface.joint, relative_coordinates(*ARMS)), ARMS)
    exact = couple(full, form.Z(frequency, truth(form))).H_nn
    measured = noisy(exact, 1e-4, np.random.default_rng(0))

    def needed() -> None:
        for tall in (full.H_ab, full.H_ba.mT):
            np.linalg.svd(tall, full_matrices=False)

    def ours(H: np.ndarray) -> Callable[[], object]:
        return lambda: identify_joint(full, frequency, H, amplification_limit=np.inf)

    def plain() -> None:
        for k in range(len(frequency)):
            C = full.H_aa[k] - measured[k]
            A = np.linalg.pinv(full.H_ab[k])
            A @ C @ np.linalg.pinv(full.H_ba[k] - full.H_bb[k] @ A @ C)

    return seconds(needed, ours(measured), ours(exact), plain)


def output_error(n_lines: int) -> None:
    """Time the fit of 67 parameters to 54 x 6 FRFs."""
    frequency = np.linspace(20.0, 3200.0, n_lines)
    slim = parts(frequency, 6)
    form = with_masses(relative_form(slim.interface.joint, relative_coordinates(*ARMS)), ARMS)
    theta = truth(form)
    measured = noisy(couple(slim, form.Z(frequency, theta)).H_nn, 0.01, np.random.default_rng(0))
    start = time.process_time()
    fit_joint(form, slim, frequency, measured, 1.2 * theta, noise=0.01)
    spent = time.process_time() - start
    print(f"output error, {len(theta)} parameters, 54 x 6 FRFs, {n_lines} lines: {spent:.1f} s of a core\n")


def lm_fbs(n_lines: int) -> None:
    """Time the coupling of 30 + 30 DOFs at 6 against the formula as it is usually written."""
    from benchmarks.joint_noise import beam

    frequency = np.linspace(20.0, 3200.0, n_lines)
    frfs = []
    for name, along in (("A", (1.0, 0, 0)), ("B", (0, 1.0, 0))):
        dofs = [(p, d) for p in (0, 5, 10, 15, 20) for d in DIRECTIONS]
        H = compute_frf(assemble(beam(along)), frequency, dofs, dofs, "receptance").H
        labels = [f"{name}{p}{d}" for p, d in dofs]
        frfs.append(FRF.from_arrays(frequency, H, "receptance", labels, labels))
    pairs = [(f"A10{d}", f"B0{d}") for d in DIRECTIONS]

    def plain():
        Y = np.zeros((n_lines, 60, 60), dtype=complex)
        Y[:, :30, :30], Y[:, 30:, 30:] = frfs[0].H, frfs[1].H
        B = np.zeros((6, 60))
        for i, (a, b) in enumerate(pairs):
            B[i, frfs[0].outputs.index(a)], B[i, 30 + frfs[1].outputs.index(b)] = 1, -1
        return Y - Y @ B.T @ np.linalg.pinv(B @ Y @ B.T) @ B @ Y

    difference = np.abs(couple_frf(frfs, pairs).frf.H - plain()).max() / np.abs(plain()).max()
    ours, reference = seconds(lambda: couple_frf(frfs, pairs), plain, repeat=15)
    print(f"LM-FBS, 30 + 30 DOFs, 6 at the interface, {n_lines} lines: {ours:.3f} s;")
    print(f"  with pinv {reference:.3f} s, ratio {reference / ours:.1f};")
    print(f"  largest difference {difference:.0e} of the largest FRF")


if __name__ == "__main__":
    direct(1600, 8)
    output_error(1600)
    lm_fbs(1600)
