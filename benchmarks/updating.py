"""Time the parts of an updating: iterations on FRFs and on modes for two meshes.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.updating [elements per member …]

Seconds depend on the machine; ratios are what to compare. An iteration is one evaluation with derivatives and
one without. `benchmarks.sensitivity` has the derivatives of 40 modes by 100 parameters in units of the modes.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fem import Damping, Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble
from fem.effects import MemberStiffness
from updating import Unknown, build_mode_problem, build_problem, frf_data, mode_data
from updating.inference.problem import Problem

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
    asked = [Unknown(((e.name, "change"),)) for e in model.of_kind(MemberStiffness)]
    places = [(p, d) for p in range(2, 2 * BAYS + 2, 2) for d in "xy"], [(2 * BAYS, "x"), (BAYS, "y")]
    H = np.ones((LINES.size, len(places[0]), 2))
    data = frf_data(model, H, lines=LINES, outputs=places[0], inputs=places[1], noise=0.01)
    made: list[Problem[Any]] = []
    basis = seconds(lambda: made.append(build_problem(model, data, asked, model_error=0.0)))
    iteration, of_modes = _iteration(made[0]), mode_data(model, frequency=np.linspace(5.0, 60.0, 10))
    by_modes = _iteration(build_mode_problem(model, of_modes, asked, model_error=0.0))
    n_free, n_basis = assemble(model).n_free, made[0].reduced.basis.n_main
    return iteration, f"{n_free:8d}{n_basis:8d}{basis:10.3f}{iteration:11.4f}{by_modes:11.4f}"


def _iteration(problem: Problem[Any]) -> float:
    """Return the time of one evaluation with derivatives and one without [s]."""
    function = problem.function((), (), problem.lines_up_to(np.inf, LINES.size))
    x = function.start
    function(x, True)  # terms of linear parameters are projected once
    steps = iter(1e-6 * np.arange(1, 100))

    def iterate() -> None:
        function(x + next(steps), True)
        function(x + next(steps), False)

    return seconds(iterate, 5)


if __name__ == "__main__":
    print(f"{3 * BAYS} members' stiffness, {LINES.size} lines, {2 * BAYS} x 2 FRFs; CPU seconds.")
    print(
        "basis: made once for each point of departure; iterations: residuals of FRFs, and of ten modes, and"
    )
    print("their derivatives\n")
    print("  n_free   basis      made       FRFs      modes")
    times = []
    for count in [int(a) for a in sys.argv[1:]] or [10, 100]:
        seconds_of, text = row(count)
        times.append(seconds_of)
        print(text, flush=True)
    if len(times) > 1:
        print(f"\niterations, last mesh over first: {times[-1] / times[0]:.2f}")
