"""Time derivatives of modes with respect to many members' moduli against the solution of the modes.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.sensitivity [points per side …]

Seconds depend on the machine; ratios within a row are what to compare.
"""

import sys
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from benchmarks.lattice import lattice
from fem import Frame, MemberProperties, Model, assemble, differentiate_modes
from fem.analysis.modes import solve_eigenpairs
from fem.effects import MemberStiffness

N_MODES, N_PARAMETERS, N_SENSORS = 40, 100, 20


def changed_lattice(n: int) -> Model:
    """Return the lattice with the moduli of its beams, n points long, in part as parameters."""
    plain = lattice(n)
    index = np.arange(n**3).reshape(n, n, n)
    first = {tuple(line): k for k, line in enumerate(plain.mesh.lines.tolist())}
    members = {}
    for axis in range(3):
        for i, chain in enumerate(np.moveaxis(index, axis, -1).reshape(-1, n).tolist()):
            members[f"{'xyz'[axis]}{i}"] = [first[pair] for pair in pairwise(chain)]
    mesh = type(plain.mesh).from_lines(plain.mesh.points, plain.mesh.lines, members)
    steel: MemberProperties = next(iter(plain.of_kind(Frame)[0].members.values()))
    others = [e for e in plain.effects if not isinstance(e, Frame)]
    names = np.random.default_rng(0).permutation(list(members))[:N_PARAMETERS]
    changes = [MemberStiffness(name=f"E:{m}", member=str(m), change=0.0) for m in names]
    return Model(mesh, (Frame(members=dict.fromkeys(members, steel)), *others, *changes), plain.damping)


def seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of one call [s]."""
    start = time.process_time()
    call()
    return time.process_time() - start


def row(n: int) -> str:
    """Return one line of the table."""
    model = changed_lattice(n)
    system = assemble(model)
    refs = [(e.name, "change") for e in model.of_kind(MemberStiffness)]
    rng = np.random.default_rng(1)
    sensors = [
        (int(p), d) for p, d in zip(n + rng.permutation(n**3 - n), "xyz" * n**3, strict=False) if p % n
    ]
    modes = seconds(lambda: solve_eigenpairs(system, N_MODES))
    guarded = N_MODES + N_MODES // 4
    more = seconds(lambda: solve_eigenpairs(system, guarded))
    pairs = solve_eigenpairs(system, guarded)
    values = seconds(lambda: differentiate_modes(system, refs, N_MODES, pairs=pairs))
    result = None

    def shapes() -> None:
        nonlocal result
        result = differentiate_modes(system, refs, N_MODES, pairs=pairs, outputs=sensors[:N_SENSORS])

    at_sensors = seconds(shapes)
    one = seconds(lambda: differentiate_modes(system, refs[:1], N_MODES, pairs=pairs, outputs="all"))
    times = "".join(f"{t:10.2f}" for t in (modes, more, values, at_sensors, one))
    assert result is not None
    return f"{system.n_free:8d}{times}{values / modes:10.3f}{at_sensors / modes:10.3f}{result.error:10.1e}"


if __name__ == "__main__":
    print(f"{N_MODES} modes, {N_PARAMETERS} members' moduli, shapes at {N_SENSORS} sensors; CPU seconds.")
    print(
        f"more: {N_MODES // 4} more modes, which the shapes' derivatives start from; values: derivatives of"
    )
    print("the frequencies; sensors: with those of the shapes there; one: all DOFs, one parameter;")
    print("ratios: values and sensors in units of the modes\n")
    print("  n_free     modes      more    values   sensors       one     ratio     ratio     error")
    for size in [int(a) for a in sys.argv[1:]] or [8, 12, 17]:
        print(row(size), flush=True)
