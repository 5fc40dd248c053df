"""How noise degrades each estimator of a joint: direct, average, output error.

The paper's two beams and a bolted joint: 6×6 K, C and D in relative motions, a mass with inertias, 67
parameters. Every FRF value has its own circular complex noise, relative to its size. Run it with one thread:

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.joint_noise [number of seeds] [lines]

With "parts" in place of numbers, the substructures are wrong in E by 0.1 and 1 %, and known to 2 %.
"""

import sys
import time
from collections.abc import Mapping, Sequence

import numpy as np

from fem import (
    DIRECTIONS,
    Damping,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
)
from joint import (
    CoordinateSet,
    Interface,
    ModelParts,
    Uncertain,
    coordinates_of,
    couple,
    fit_joint,
    identify_average,
    identify_joint,
    partition_frf,
    relative_coordinates,
    relative_form,
    stack_substructures,
    with_masses,
)

NODES = {"U": (0, 4, 12, 20), "D": (2, 6, 13, 15, 19)}
"""The paper's internal nodes 1 5 13 21 24 28 35 37 41, counted from 0 on each beam."""

AT = {"U": 10, "D": 0}
"""Nodes 11 and 22, where the joint is."""

ALL_NODES = {name: tuple(p for p in range(21) if p != at) for name, at in AT.items()}
"""All others: 240 coordinates."""

NEXT_NODES = {"U": (9,), "D": (1,)}
"""One beside the joint on each beam: 12 coordinates."""

STEEL = Material("steel", 210e9, 7850.0)
ARMS = ((0.0, 0.0, 0.005), (0.0, 0.0, -0.005))


def beam(along: tuple[float, float, float], E: float = STEEL.E) -> Model:
    """Return a free beam of the paper, 20 elements."""
    mesh = Mesh.from_lines([[0, 0, 0], 0.8 * np.array(along)], [[0, 1]], {"beam": [0]})
    points = [mesh.point_at(mesh.locate("beam", s)) for s in np.linspace(0, 0.8, 21)]
    mesh = Mesh.from_lines(points, [[i, i + 1] for i in range(20)], {"beam": range(20)})
    material = Material("steel", E, STEEL.rho)
    section = MemberProperties(material, Section.rectangle(0.03, 0.01), theory="euler-bernoulli")
    return Model(mesh, (Frame(members={"beam": section}),), Damping.structural(0.01))


def parts(
    frequency: np.ndarray,
    n_inputs: int | None,
    E: float = STEEL.E,
    nodes: Mapping[str, Sequence[int]] = NODES,
):
    """Return both beams side by side; ``n_inputs`` of the internal coordinates, or all, are inputs."""
    every = [f"{name}{p}:{d}" for name, points in nodes.items() for p in points for d in DIRECTIONS]
    at = range(len(every)) if n_inputs is None else np.linspace(2, len(every) - 1, n_inputs).astype(int)
    pick = [every[i] for i in at]
    out = []
    for name, along in (("U", (1.0, 0, 0)), ("D", (0, 1.0, 0))):
        system = assemble(beam(along, E))
        b = coordinates_of([f"{name}{AT[name]}"])
        a = CoordinateSet(tuple(label for label in every if label.startswith(name)))
        i = CoordinateSet(tuple(label for label in pick if label.startswith(name)))
        labels = (*a.labels, *b.labels)
        dofs = [(int(label[1:].split(":")[0]), label.split(":")[1]) for label in labels]
        H = compute_frf(system, frequency, dofs, dofs, "receptance").H
        both = CoordinateSet(labels)
        out.append(partition_frf(frequency, H, both, both, Interface(b, a, i)))
    return stack_substructures(*out)


def model_parts(frequency: np.ndarray, uncertain: Sequence[Uncertain]) -> ModelParts:
    """Return both beams as models with uncertain parameters, 54 responses and 6 inputs as in `parts`."""
    every = [(name, (p, d)) for name, points in NODES.items() for p in points for d in DIRECTIONS]
    pick = [every[i] for i in np.linspace(2, len(every) - 1, 6).astype(int)]
    models = {"U": beam((1.0, 0, 0)), "D": beam((0, 1.0, 0))}
    internal, inputs = (
        {name: [at for owner, at in chosen if owner == name] for name in models} for chosen in (every, pick)
    )
    return ModelParts.of(models, frequency, {n: [AT[n]] for n in models}, internal, uncertain, inputs)


def truth(form, seed: int = 1):
    """Return 67 values: stiffness of a bolted joint, damping beside it, 50 g."""
    rng = np.random.default_rng(seed)
    arm = np.diag([1, 1, 1, 0.02, 0.02, 0.02])

    def matrix(low: float, high: float):
        Q = np.linalg.qr(rng.standard_normal((6, 6)))[0] * np.sqrt(np.geomspace(low, high, 6))
        return B.T @ (arm @ Q @ Q.T @ arm) @ B

    B = relative_coordinates(*ARMS)
    theta = form.values_of(K=matrix(1e6, 3e7), C=matrix(20, 200), D=matrix(2e4, 1e6))
    theta[63:] = 0.05, 1e-5, 2e-5, 1.5e-5
    return theta


def full_joint(seed: int = 5):
    """Return full symmetric positive definite K, M, C and D (12, 12), rotations at an arm of 20 mm."""
    rng = np.random.default_rng(seed)
    arm = np.diag([1, 1, 1, 0.02, 0.02, 0.02] * 2)

    def coupled(low: float, high: float):
        Q = np.linalg.qr(rng.standard_normal((12, 12)))[0] * np.sqrt(np.geomspace(low, high, 12))
        return arm @ Q @ Q.T @ arm

    return coupled(1e6, 1e8), coupled(0.05, 0.3), coupled(10, 200), coupled(1e4, 1e6)


def noisy(H: np.ndarray, level: float, rng: np.random.Generator):
    """Return H with circular complex noise of standard deviation level · |H|."""
    return H * (1 + level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2))


def relative(X: np.ndarray, Y: np.ndarray) -> float:
    """Return ‖X - Y‖ / ‖Y‖ with rotations at an arm of 20 mm."""
    arm = np.tile([1, 1, 1, 50.0, 50.0, 50.0], X.shape[-1] // 6)
    scale = np.outer(arm, arm)
    return float(np.linalg.norm((X - Y) * scale) / np.linalg.norm(Y * scale))


def study(n_seeds: int, n_lines: int) -> None:
    """Print the table."""
    frequency = np.linspace(20.0, 3200.0, n_lines)
    square, slim = parts(frequency, None), parts(frequency, 6)
    form = with_masses(relative_form(square.interface.joint, relative_coordinates(*ARMS)), ARMS)
    theta = truth(form)
    Z = form.Z(frequency, theta)
    exact = {"square": couple(square, Z).H_nn, "slim": couple(slim, Z).H_nn}
    print(f"{n_lines} lines, {n_seeds} seeds; direct and average from 54 x 54 FRFs, output error from 54 x 6")
    print("medians over seeds of relative errors; Z over all lines\n")
    print("noise    estimator        Z        K        M        C        D   H_nn   seconds")
    for level in (0.001, 0.01, 0.03):
        rows: dict[str, list[list[float]]] = {"direct": [], "average": [], "output error": []}
        errors, cover = [], []
        for seed in range(n_seeds):
            rng = np.random.default_rng([seed, int(1e4 * level)])
            measured = noisy(exact["square"], level, rng)
            start = time.perf_counter()
            found = identify_joint(square, frequency, measured, amplification_limit=np.inf)
            again = couple(square, found.Z).H_nn
            rows["direct"].append(
                [
                    relative(found.Z, Z),
                    *[np.nan] * 4,
                    relative_H(again, exact["square"]),
                    time.perf_counter() - start,
                ]
            )
            start = time.perf_counter()
            mean = identify_average(square, frequency, measured, form, misfit_limit=np.inf)
            again = couple(square, mean.Z(frequency)).H_nn
            rows["average"].append(
                errors_of(form, mean.values, theta, frequency, again, exact["square"], start)
            )
            start = time.perf_counter()
            slim_data = noisy(exact["slim"], level, rng)
            fit = fit_joint(form, slim, frequency, slim_data, mean.values, noise=level)
            rows["output error"].append(
                errors_of(form, fit.values, theta, frequency, fit.H, exact["slim"], start)
            )
            errors.append((fit.values - theta) / fit.std)
            lo, hi = fit.interval().T
            cover.append((lo <= theta) & (theta <= hi))
        for name, values in rows.items():
            middle = np.median(np.array(values), axis=0)
            print(
                f"{level:5.1%}    {name:13s}" + "".join(f"{v:9.1e}" for v in middle[:6]) + f"{middle[6]:8.2f}"
            )
        spread = np.sqrt((np.array(errors) ** 2).mean())
        print(
            f"         output error: errors {spread:.3f} times the stated deviation, 95 % intervals hold "
            f"{np.mean(cover):.1%} of the truths\n",
            flush=True,
        )


def relative_H(H: np.ndarray, exact: np.ndarray) -> float:
    """Return the error of rebuilt receptances, each relative to its own root mean square."""
    rms = np.sqrt((np.abs(exact) ** 2).mean(axis=0))
    return float(np.sqrt((np.abs((H - exact) / rms) ** 2).mean()))


def errors_of(form, values, theta, frequency, H, exact, start) -> list[float]:
    """Return errors of Z, K, M, C, D and the rebuilt receptances, and the time since a start."""
    Z = [form.Z(frequency, v) for v in (values, theta)]
    out = [relative(*Z)]
    out += [relative(form.matrix(kind, values), form.matrix(kind, theta)) for kind in "KMCD"]
    return [*out, relative_H(H, exact), time.perf_counter() - start]


def wrong_parts(n_seeds: int, n_lines: int) -> None:
    """Print what becomes of the joint where the substructures' moduli are wrong."""
    frequency = np.linspace(20.0, 3200.0, n_lines)
    models = model_parts(frequency, [Uncertain(name, "frame", "E:steel", 0.02) for name in ("U", "D")])
    form = with_masses(relative_form(models.at_mean.interface.joint, relative_coordinates(*ARMS)), ARMS)
    theta = truth(form)
    K = form.matrix("K", theta)
    print(
        f"{n_lines} lines, {n_seeds} seeds, 1 % of noise, 54 x 6 FRFs; E of both beams wrong, known to 2 %\n"
    )
    print(
        "E wrong by   K median    worst   errors / deviation   95 % intervals hold   K, parts exact   misfit"
    )
    for wrong in (0.001, 0.01):
        exact = couple(parts(frequency, 6, STEEL.E * (1 + wrong)), form.Z(frequency, theta)).H_nn
        off, errors, cover, blind = [], [], [], []
        for seed in range(n_seeds):
            measured = noisy(exact, 0.01, np.random.default_rng([seed, 7]))
            fit = fit_joint(form, models, frequency, measured, 1.05 * theta, noise=0.01)
            off.append(relative(form.matrix("K", fit.values), K))
            errors.append((fit.values - theta) / fit.std)
            low, high = fit.interval().T
            cover.append((low <= theta) & (theta <= high))
            if seed < 3:
                taken = fit_joint(form, models.at_mean, frequency, measured, fit.values, noise=0.01)
                blind.append((relative(form.matrix("K", taken.values), K), np.sqrt(taken.chi2)))
        K_blind, misfit = np.median(blind, axis=0)
        print(
            f"{wrong:9.1%}   {np.median(off):9.1e}{max(off):9.1e}"
            f"{np.sqrt((np.array(errors) ** 2).mean()):16.3f}"
            f"{np.mean(cover):22.1%}{K_blind:19.1e}{misfit:9.1f}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["parts"]:
        wrong_parts(50, 80)
        sys.exit()
    numbers = [int(a) for a in sys.argv[1:]]
    study(numbers[0] if numbers else 50, numbers[1] if len(numbers) > 1 else 200)
