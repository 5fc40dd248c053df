"""Compute frames with OpenSeesPy; runs in the peers' environment.

Euler-Bernoulli members are `elasticBeamColumn`, Timoshenko ones `ElasticTimoshenkoBeam`, both with consistent
mass. Modes by ARPACK, which uses the system of equations chosen for statics.
"""

import sys
import time
from typing import Any

import numpy as np
import openseespy.opensees as ops  # pyright: ignore[reportMissingImports]

from benchmarks.peers.exchange import (
    EULER_BERNOULLI,
    TIMOSHENKO,
    PeerError,
    PeerFrame,
    PeerResult,
    on_positive_faces,
    serve,
    with_changes,
)

OPTIONS = "SparseGEN RCM -genBandArpack"


def build(frame: PeerFrame) -> None:
    """Make OpenSees' one model."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, at in enumerate(frame.points.tolist(), 1):
        ops.node(tag, *at)
    for i in np.flatnonzero(frame.fixed.any(axis=1)):
        ops.fix(int(i) + 1, *frame.fixed[i].astype(int).tolist())
    axes, transformation = np.unique(frame.local_z, axis=0, return_inverse=True)
    for tag, axis in enumerate(axes.tolist(), 1):
        ops.geomTransf("Linear", tag, *axis)
    columns = [getattr(frame, name).tolist() for name in ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz")]
    ends = frame.lines.tolist()
    turn = (transformation.ravel() + 1).tolist()
    # 0 none, 1 first end, 2 second end, 3 both
    codes = (frame.released * np.array([1, 2])[None, :, None]).sum(axis=1).tolist()
    for k, (E, G, rho, A, Iy, Iz, J, ky, kz) in enumerate(zip(*columns, strict=True)):
        head: list[Any] = [k + 1, ends[k][0] + 1, ends[k][1] + 1]
        mass = ["-mass", rho * A, "-cMass"]
        if frame.theory == TIMOSHENKO:
            ops.element("ElasticTimoshenkoBeam", *head, E, G, A, J, Iy, Iz, ky * A, kz * A, turn[k], *mass)
        else:
            release = ["-releasey", codes[k][0], "-releasez", codes[k][1]] if any(codes[k]) else []
            ops.element("elasticBeamColumn", *head, A, E, G, J, Iy, Iz, turn[k], *mass, *release)


def apply_loads(frame: PeerFrame) -> None:
    """Add the forces on points and along members."""
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    for i in np.flatnonzero(frame.loads.any(axis=1)):
        ops.load(int(i) + 1, *frame.loads[i].tolist())
    for k in np.flatnonzero(frame.uniform.any(axis=1)):
        wx, wy, wz = frame.uniform[k].tolist()
        ops.eleLoad("-ele", int(k) + 1, "-type", "-beamUniform", wy, wz, wx)


def matrices(n: int) -> tuple[Any, Any]:
    """Return K and M of all DOFs in the order of the nodes, (n, n)."""
    ops.system("FullGeneral")
    ops.numberer("Plain")
    ops.constraints("Plain")
    ops.algorithm("Linear")
    out = []
    for mass, stiffness in ((0.0, 1.0), (1.0, 0.0)):
        ops.integrator("GimmeMCK", mass, 0.0, stiffness)
        ops.analysis("Transient")
        ops.analyze(1, 0.0)  # solving may fail, a free body's K is singular; the matrix is there
        out.append(np.array(ops.printA("-ret")).reshape(n, n))
    ops.wipeAnalysis()
    return out[0], out[1]


def choose(frame: PeerFrame) -> str:
    """Choose the system of equations and its numbering; return the eigensolver's name."""
    system, numberer, eigensolver = (frame.options or OPTIONS).split()
    ops.system(system)
    ops.numberer(numberer)
    ops.constraints("Plain")
    ops.integrator("LoadControl", 1.0)
    ops.algorithm("Linear")
    ops.analysis("Static")
    return eigensolver


def responses_in_time(frame: PeerFrame) -> Any:
    """Step the built model by the average acceleration; return the watched displacements (n_t, k)."""
    system, numberer, _ = (frame.options or OPTIONS).split()
    ops.timeSeries("Path", 1, "-dt", frame.step, "-values", *frame.history.tolist())
    ops.pattern("Plain", 1, 1)
    for i in np.flatnonzero(frame.loads.any(axis=1)):
        ops.load(int(i) + 1, *frame.loads[i].tolist())
    ops.rayleigh(frame.alpha, 0.0, frame.beta, 0.0)
    ops.system(system)
    ops.numberer(numberer)
    ops.constraints("Plain")
    ops.algorithm("Linear", "-factorOnce")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    places = [divmod(int(w), 6) for w in frame.watched]
    out = np.zeros((frame.history.size, len(places)))
    for k in range(1, frame.history.size):
        failed = ops.analyze(1, frame.step)
        if failed:
            msg = f"OpenSees' step {k} ended with {failed}"
            raise PeerError(msg)
        out[k] = [ops.nodeDisp(i + 1, d + 1) for i, d in places]
    return out


def compute(frame: PeerFrame) -> PeerResult:
    """Compute one frame."""
    if frame.theory not in (EULER_BERNOULLI, TIMOSHENKO):
        msg = f"the beam theory is '{frame.theory}'; allowed are {EULER_BERNOULLI}, {TIMOSHENKO}"
        raise PeerError(msg)
    n, found = len(frame.points), {}
    if frame.matrices:
        build(with_changes(frame, fixed=np.zeros_like(frame.fixed)))
        found["K"], found["M"] = matrices(6 * n)
    start = time.process_time()
    build(frame)
    found["build"] = time.process_time() - start
    if frame.static:
        apply_loads(frame)
        choose(frame)
        start = time.process_time()
        failed = ops.analyze(1)
        ops.reactions()
        found["static_seconds"] = time.process_time() - start
        if failed:
            msg = f"OpenSees' static analysis ended with {failed}"
            raise PeerError(msg)
        found["displacements"] = np.array([ops.nodeDisp(i + 1) for i in range(n)])
        found["end_forces"] = on_positive_faces(
            [ops.eleResponse(k + 1, "localForce") for k in range(len(frame.lines))]
        )
        found["reactions"] = np.array([ops.nodeReaction(i + 1) for i in range(n)]) * frame.fixed
    if frame.n_modes and not frame.history.size:
        build(frame)  # anew: where members are loaded, OpenSees crashes in search of modes
        eigensolver = choose(frame)
        start = time.process_time()
        squares = np.array(ops.eigen(eigensolver, frame.n_modes))
        found["modes_seconds"] = time.process_time() - start
        # the negative square that a failed factorisation gives must not pass for a frequency
        found["frequency"] = np.where(squares > 0, np.sqrt(np.abs(squares)), np.nan) / (2 * np.pi)
    if frame.history.size:
        build(frame)
        start = time.process_time()
        found["responses"] = responses_in_time(frame)
        found["transient_seconds"] = time.process_time() - start
    return PeerResult(program=f"OpenSees {ops.version()}", **found)


if __name__ == "__main__":
    serve(compute, sys.argv[1:])
