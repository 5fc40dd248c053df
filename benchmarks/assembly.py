"""Time meshing and assembly of lattices and towers, against what NumPy needs to sort and write their entries.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.assembly [thousands of DOFs …]

Two references, of the same run, that know nothing of beams: they are given numbers as element matrices of K
and of M. `entries` sorts the (row, column) keys of all 144 entries of every element (np.argsort), and adds
up the values in that order (np.add.reduceat), for K and for M. `pairs` sorts the keys of the four pairs of
points of every element, and adds up 6x6 blocks. Neither forms an element, applies a support, or makes a
sparse matrix of the sums: `assemble` does, and its time includes that. Peak memory is what tracemalloc sees
while assembling, without mesh and model. Seconds depend on the machine; compare the ratios within a row.

`--stages 2000` goes through a cube and a tower of 10⁶ lines once, and prints CPU time and the process's peak
memory after each stage.
"""

import resource
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np

from fem import Frame, Joint, Material, MemberProperties, Mesh, Model, Section, Support, assemble, reassemble

STEEL = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01))


def lattice(thousands: float) -> tuple[Any, Any]:
    """Return points and lines of a cube of about so many thousand DOFs, 1 m between neighbours."""
    n = max(2, round((thousands * 1000 / 6) ** (1 / 3)))
    index = np.arange(n**3).reshape(n, n, n)
    lines = []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)
        lines.append(np.stack([a[:-1], a[1:]], axis=-1).reshape(-1, 2))
    return np.argwhere(index >= 0).astype(float), np.concatenate(lines)


def tower(thousands: float) -> tuple[Any, Any]:
    """Return points and lines of a slender square tower with a diagonal in each face of each storey."""
    storeys = max(2, round(thousands * 1000 / 24))
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    z = np.repeat(np.arange(storeys), 4)
    points = np.column_stack([np.tile(corner, (storeys, 1)), z])
    here = np.arange(4 * storeys).reshape(-1, 4)
    right = np.roll(here, -1, axis=1)
    pairs = [(here, right), (here[:-1], here[1:]), (here[:-1], right[1:])]
    return points, np.concatenate([np.stack(p, axis=-1).reshape(-1, 2) for p in pairs])


def seconds(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the time of a call [s], the shortest of several short ones, and what it returned."""
    times: list[float] = []
    while True:
        start = time.perf_counter()
        out = call()
        times.append(time.perf_counter() - start)
        if sum(times) > 0.3 or len(times) == 20:
            return min(times), out


def sorted_sums(rows: Any, columns: Any, values: Any) -> Any:
    """Return sums of values with equal rows and columns, of both of two sets of values."""
    keys = rows.ravel() * (rows.max() + 1) + columns.ravel()
    order = np.argsort(keys, kind="stable")
    start = np.flatnonzero(np.diff(keys[order], prepend=-1))
    return [np.add.reduceat(v.reshape(len(keys), -1)[order], start) for v in values]


def entries_reference(lines: Any) -> float:
    """Return the time to sort and sum all entries [s]."""
    dofs = (6 * lines[:, :, None] + np.arange(6)).reshape(-1, 12)
    values = [np.random.default_rng(i).random((len(lines), 144)) for i in range(2)]
    rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
    return seconds(lambda: sorted_sums(rows, columns, values))[0]


def pairs_reference(lines: Any) -> float:
    """Return the time to sort pairs of points and sum their blocks [s]."""
    values = [np.random.default_rng(i).random((len(lines), 4, 36)) for i in range(2)]
    rows, columns = np.repeat(lines, 2, axis=1), np.tile(lines, (1, 2))
    return seconds(lambda: sorted_sums(rows, columns, values))[0]


def row(name: str, points: Any, lines: Any) -> str:
    """Return one line of the table."""
    meshing, mesh = seconds(lambda: Mesh.from_lines(points, lines))
    splitting, _ = seconds(lambda: mesh.split(2))
    feet = [Support(name=f"s{i}", point=int(i)) for i in np.flatnonzero(points[:, 2] == 0)]
    spring = Joint(name="spring", point1=mesh.n_points - 1, location=points[-1], K=np.diag([1e5] * 6))
    frame = Frame(members=dict.fromkeys(mesh.members, STEEL))
    model = Model(mesh, (frame, spring, *feet))
    start = time.perf_counter()
    system = assemble(model)
    first = time.perf_counter() - start
    again = seconds(lambda: assemble(model))[0]
    stiffer = model.with_values({("frame", "E:steel"): 215e9})
    modulus = seconds(lambda: reassemble(system, stiffer))[0]
    softer = model.without_effect("spring")
    joint = seconds(lambda: reassemble(system, softer))[0]
    n_free, nnz = system.n_free, system.K.nnz
    pairs = pairs_reference(lines)
    entries = entries_reference(lines) if len(lines) < 200_000 else np.nan
    tracemalloc.start()
    assemble(model)
    peak = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    columns = [f"{meshing:9.3f}", f"{splitting:9.3f}", f"{first:9.3f}", f"{again:9.3f}", f"{modulus:9.3f}"]
    columns += [f"{joint:9.3f}", f"{again / pairs:9.2f}", f"{again / entries:9.2f}", f"{peak:9.0f}"]
    return f"{name:8s}{n_free:9d}{len(lines):9d}{nnz / 1e6:8.2f}" + "".join(columns)


def stages(name: str, points: Any, lines: Any) -> None:
    """Print the CPU time of each stage from lines to matrices, and the peak memory after it."""
    print(f"{name}: {len(lines)} lines, {6 * len(points)} DOFs")

    def stage(word: str, call: Callable[[], Any]) -> Any:
        start = time.process_time()
        made = call()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"  {word:9s}{time.process_time() - start:8.2f} s, peak {peak:6.2f} GiB", flush=True)
        return made

    mesh = stage("mesh", lambda: Mesh.from_lines(points, lines))
    foot = np.flatnonzero(points[:, 2] == 0)
    feet = stage("supports", lambda: [Support(name=f"s{i}", point=int(i)) for i in foot])
    frame = stage("frame", lambda: Frame(members=dict.fromkeys(mesh.members, STEEL)))
    model = stage("model", lambda: Model(mesh, (frame, *feet)))
    system = stage("assemble", lambda: assemble(model))
    softer = model.with_values({("frame", "E:steel"): 205e9})
    stage("new E", lambda: reassemble(system, softer))
    print(f"  {system.n_free} free, {system.K.nnz / 1e6:.1f} million entries of K")


if __name__ == "__main__" and "--stages" in sys.argv:
    for size in [float(a) for a in sys.argv[2:]] or [2000.0]:
        for kind in (lattice, tower):
            stages(kind.__name__, *kind(size))
elif __name__ == "__main__":
    print(
        "seconds of Mesh.from_lines, split(2), assemble (first, and with the pattern kept), reassemble with"
    )
    print(
        "another E and without a spring; assemble in units of the references; peak memory of assemble [MiB]\n"
    )
    print("          n_free    lines nnz/1e6     mesh    split assemble    again    new E   spring", end="")
    print("   /pairs /entries      MiB")
    for size in [float(a) for a in sys.argv[1:]] or [2.7, 27.7, 200, 1000]:
        for kind in (lattice, tower):
            print(row(kind.__name__, *kind(size)), flush=True)
