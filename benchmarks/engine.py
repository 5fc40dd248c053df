"""Time the reduced engine that fits call thousands of times, on a cross-beam of ever finer mesh.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.engine
"""

import time
from collections.abc import Callable

import numpy as np

from fem import (
    Damping,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
    dof_vectors,
)
from fem.reduction import ParametricFRF, reduce_model, values_of

FREQUENCY = np.linspace(5.0, 1600.0, 400)
OUT = [(p, d) for p in range(6) for d in ("x", "y", "z")]
IN = [(0, "z"), (5, "x")]
REFS = [("bolt", f"k{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
REFS += [("frame", "E:steel"), ("frame", "rho:steel")]


def cross_beam(size: float) -> Model:
    """Return two free beams of 0.8 m that cross at an elastic joint."""
    points = [[-0.4, 0, 0], [0, 0, 0], [0.4, 0, 0], [0, -0.4, 0.01], [0, 0, 0.01], [0, 0.4, 0.01]]
    sets = {"lower": [0, 1], "upper": [2, 3]}
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [3, 4], [4, 5]], sets).refined(size)
    steel = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01))
    stiffness = np.diag([5e7, 5e7, 1e7, 3e3, 3e3, 5e3])
    joint = Joint(name="bolt", point1=1, point2=4, location=np.array([0, 0, 0.005]), K=stiffness)
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, steel)), joint), Damping.structural(0.004))


def seconds(call: Callable[[], object], repeat: int = 1) -> float:
    """Return the shortest of several times of a call [s]."""
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return best


def row(size: float) -> str:
    """Return one line of the table."""
    model = cross_beam(size)
    sides = np.eye(model.n_dof)[:, [6 * p + d for p in (1, 4) for d in range(6)]]
    out, inn = dof_vectors(model, OUT)[0], dof_vectors(model, IN)[0]
    forces = np.hstack([inn, sides])
    setup = seconds(lambda: reduce_model(model, forces, FREQUENCY[-1], margin=2.5))
    reduced = reduce_model(model, forces, FREQUENCY[-1], margin=2.5)
    engine = ParametricFRF(reduced, out, inn, FREQUENCY, REFS)
    x, zeta = values_of(model, REFS), np.zeros(FREQUENCY.size)
    plain = seconds(lambda: engine.evaluate(x, zeta, gradient=False), 5)
    slopes = seconds(lambda: engine.evaluate(x, zeta), 5)
    system = assemble(model)
    few = FREQUENCY[::40]
    direct = seconds(lambda: compute_frf(system, few, OUT, IN, method="direct"))
    direct *= FREQUENCY.size / few.size
    times = [f"{1e3 * t:10.1f}" for t in (setup, plain, slopes, direct)]
    line = f"{model.n_dof:8d}{reduced.basis.T.shape[1]:8d}" + "".join(times)
    return line + f"{direct / plain:10.0f}"


if __name__ == "__main__":
    what = f"{len(OUT)} x {len(IN)} FRFs at {FREQUENCY.size} lines, {len(REFS)} parameters"
    print(what + "; times in milliseconds;")
    print("direct: a factorisation for each line (from 10 of them); ratio: direct over the engine\n")
    print("   n_dof   basis     setup    engine +gradient    direct     ratio")
    for size in (0.1, 0.04, 0.01, 0.004):
        print(row(size), flush=True)
