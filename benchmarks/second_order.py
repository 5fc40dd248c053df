"""Second-order statics of lattices in Dovetail and OpenSees: what they find, and CPU seconds in one run.

    python -m benchmarks.second_order [--pieces N] [--repeat N] [points per side …]

Each top point of a cube carries a third of the load at which it buckles, and a small force sideways. Dovetail
iterates with the geometric stiffness of section forces. OpenSees takes its transformation `PDelta` and
Newton's method; it has no geometric stiffness within an element, so that its error falls with their length
squared.
"""

import argparse
import json
import subprocess
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.modes import block_of_cells
from benchmarks.peers.exchange import PEERS_PYTHON
from fem import Frame, LoadCase, Model, assemble, solve_second_order, solve_static
from fem.analysis.buckling import lowest_factor

PART, SIDEWAYS = 1 / 3, 1e-5
"""Vertical load relative to that of buckling, and horizontal relative to vertical load [-]."""

SCRIPT = """
import json, sys, time
import openseespy.opensees as ops
given = json.load(sys.stdin)
start = time.process_time()
ops.wipe()
ops.model("basic", "-ndm", 3, "-ndf", 6)
for k, (point, foot) in enumerate(zip(given["points"], given["feet"])):
    ops.node(k, *point)
    if foot:
        ops.fix(k, 1, 1, 1, 1, 1, 1)
ops.geomTransf("PDelta", 1, 0.0, 0.0, 1.0)
ops.geomTransf("PDelta", 2, 1.0, 0.0, 0.0)
for k, (line, upright) in enumerate(zip(given["lines"], given["upright"])):
    ops.element("elasticBeamColumn", k, *line, *given["section"], 2 if upright else 1)
ops.timeSeries("Linear", 1)
ops.pattern("Plain", 1, 1)
for k in given["loaded"]:
    ops.load(k, given["force"] * given["sideways"], 0.0, -given["force"], 0.0, 0.0, 0.0)
ops.constraints("Plain")
ops.numberer("AMD")
ops.system("UmfPack")
ops.test("NormDispIncr", 1e-12, 30)
ops.algorithm("Newton")
ops.integrator("LoadControl", 1.0)
ops.analysis("Static")
assert ops.analyze(1) == 0
seconds = time.process_time() - start
json.dump({"sway": ops.nodeDisp(given["loaded"][-1], 1), "seconds": seconds}, sys.stdout)
"""


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """A lattice with members of several elements, its loaded points, and the force on each [N]."""

    model: Model
    loaded: NDArray[np.int64]
    force: float

    @classmethod
    def of(cls, nx: int, ny: int, nz: int, pieces: int, force: float | None = None) -> "Loaded":
        """Load the top of a lattice of points 1 m apart, with a part of its buckling load unless given."""
        coarse = block_of_cells(nx, ny, nz)
        frame, *feet = coarse.effects
        assert isinstance(frame, Frame)
        bar = replace(next(iter(frame.members.values())), theory="euler-bernoulli")  # as OpenSees' element
        model = Model(coarse.mesh.split(pieces), (Frame(members=dict.fromkeys(frame.members, bar)), *feet))
        z = coarse.mesh.points[:, 2]
        loaded = np.flatnonzero(z == z.max())
        unit = cls(model, loaded, 1.0)
        if force is None:
            system = assemble(model)
            force = PART * lowest_factor(system, solve_static(system, unit.case))
        return cls(model, loaded, force)

    @property
    def case(self) -> LoadCase:
        """The load."""
        forces = {"x": SIDEWAYS * self.force, "z": -self.force}
        points = {(int(k), d): value for k in self.loaded for d, value in forces.items()}
        return LoadCase(name="top", points=points)

    def here(self) -> tuple[float, float]:
        """Return the sway of the last loaded point by Dovetail [m], and CPU seconds."""
        start = time.process_time()
        found = solve_second_order(self.model, self.case).solution
        return float(found.displacements[6 * self.loaded[-1], 0]), time.process_time() - start

    def by_opensees(self) -> tuple[float, float]:
        """Return the same by OpenSees."""
        mesh = self.model.mesh
        steel = next(iter(self.model.of_kind(Frame)[0].members.values()))
        s, E = steel.section, steel.material.E
        along = np.abs(mesh.points[mesh.lines[:, 1]] - mesh.points[mesh.lines[:, 0]])
        given = {
            "points": mesh.points.tolist(),
            "feet": (mesh.points[:, 2] == 0).tolist(),
            "lines": mesh.lines.tolist(),
            "upright": (along.argmax(axis=1) == 2).tolist(),
            "section": [s.A, E, steel.material.G, s.J, s.Iy, s.Iz],
            "loaded": self.loaded.tolist(),
            "force": self.force,
            "sideways": SIDEWAYS,
        }
        command = [PEERS_PYTHON, "-c", SCRIPT]
        out = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=True)
        found = json.loads(out.stdout)
        return float(found["sway"]), float(found["seconds"])


def main() -> None:
    """Print a line for each size."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("sizes", nargs="*", type=int, default=[8], help="points per side")
    parser.add_argument("--pieces", type=int, default=2, help="elements of each member")
    parser.add_argument("--repeat", type=int, default=1, help="runs of each, of which the least time counts")
    given = parser.parse_args()
    print("points     DOFs   Dovetail [s]   OpenSees [s]   ratio   difference of the sway")
    for n in given.sizes:
        loaded = Loaded.of(n, n, n, given.pieces)
        runs = [(loaded.here(), loaded.by_opensees()) for _ in range(given.repeat)]
        ours, theirs = runs[0][0][0], runs[0][1][0]
        our_seconds, their_seconds = (min(run[k][1] for run in runs) for k in range(2))
        print(
            f"{n:5d}³ {loaded.model.n_dof:9d}{our_seconds:14.2f}{their_seconds:15.2f}"
            f"{their_seconds / our_seconds:8.1f}{theirs / ours - 1:14.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
