"""Time the parts of an updating: an iteration on FRFs for two meshes, and mode sensitivities.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.updating [elements per member …]

Seconds depend on the machine; ratios are what to compare. An iteration is one evaluation with derivatives and
one without. `benchmarks.sensitivity` has the derivatives of 40 modes by 100 parameters in units of the modes.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from fem import Damping, Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble
from fem.effects import MemberStiffness
from updating.inference.frf_data import frf_data
from updating.inference.frf_residual import FRFResidual
from updating.inference.mode_data import mode_data
from updating.inference.mode_residual import mode_jacobian, mode_residual

LINES = np.linspace(5.0, 120.0, 250)
BAYS = 6


def tower(elements: int) -> Model:
    """Return a plane tower of six bays with a stiffness parameter for every member."""
    points = [[0.8 * side, 0, 0.6 * level] for level in range(BAYS + 1) for side in (0, 1)]
    lines = [[k, k + 2] for k in range(2 * BAYS)] + [[2 * k, 2 * k + 1] for k in range(1, BAYS + 1)]
    names = [f"m{i}" for i in range(len(lines))]
    mesh = Mesh.from_lines(points, lines, {n: [i] for i, n in enumerate(names)}).split(elements)
    part = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.04, 0.02))
    changes = [MemberStiffness(name=f"E:{n}", member=n, change=0.0) for n in names]
    feet = [Support(name=f"foot{p}", point=p) for p in (0, 1)]
    return Model(mesh, (Frame(members=dict.fromkeys(names, part)), *feet, *changes), Damping.modal(0.01))


def seconds(call: Callable[[], object], repeats: int = 1) -> float:
    """Return the shortest CPU time of a call [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def row(elements: int) -> tuple[float, str]:
    """Return the time of an iteration and one line of the table."""
    model = tower(elements)
    refs = [(e.name, "change") for e in model.of_kind(MemberStiffness)]
    outputs = [(p, d) for p in range(2, 2 * BAYS + 2, 2) for d in "xy"]
    inputs = [(2 * BAYS, "x"), (BAYS, "y")]
    data = frf_data(
        model, np.ones((LINES.size, len(outputs), 2)), lines=LINES, outputs=outputs, inputs=inputs, noise=0.01
    )
    values = np.zeros(len(refs))
    made: list[FRFResidual] = []
    basis = seconds(lambda: made.append(FRFResidual(data, model, refs)))
    residual = made[0]
    residual.evaluate(values, True)  # terms of linear parameters are projected once

    def iterate() -> None:
        residual.evaluate(values, True)
        residual.evaluate(values, False)

    iteration = seconds(iterate, 5)
    modes = mode_data(model, frequency=np.linspace(5.0, 60.0, 10))
    points: list[object] = []
    solved = seconds(lambda: points.append(mode_residual(modes, model)))
    slopes = seconds(lambda: mode_jacobian(modes, points[0], refs))  # type: ignore[arg-type]
    n_free = assemble(model).n_free
    n_basis = residual.reduced.basis.n_main
    times = f"{basis:10.3f}{iteration:11.4f}{solved:10.3f}{slopes:10.3f}"
    text = f"{n_free:8d}{n_basis:8d}{times}{slopes / solved:9.3f}"
    return iteration, text


if __name__ == "__main__":
    print(f"{3 * BAYS} members' stiffness, {LINES.size} lines, {2 * BAYS} x 2 FRFs; CPU seconds.")
    print("basis: made once for each point of departure; iteration: residuals and derivatives by the engine;")
    print("modes, slopes: 10 modes and their derivatives on the whole mesh, and their ratio\n")
    print("  n_free   basis      made  iteration     modes    slopes    ratio")
    times = []
    for count in [int(a) for a in sys.argv[1:]] or [10, 100]:
        seconds_of, text = row(count)
        times.append(seconds_of)
        print(text, flush=True)
    if len(times) > 1:
        print(f"\niterations, last mesh over first: {times[-1] / times[0]:.2f}")
