"""Compute frames with Dovetail, as the other drivers do with their programs."""

import sys
import time
from typing import Any

import numpy as np

from benchmarks.peers.exchange import PeerFrame, PeerResult, serve
from fem import (
    DIRECTIONS,
    Damping,
    Excitation,
    Frame,
    LineLoad,
    LoadCase,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    StaticSolution,
    Support,
    assemble,
    solve_modes,
    solve_static,
    solve_transient,
    sum_contributions,
)


def model_of(frame: PeerFrame, *, polar: bool = False) -> Model:
    """Return a model of the frame.

    The other programs' members oppose a spin about their axis with the torsion constant J in place of the
    polar moment Iy + Iz; with ``polar`` they have the polar moment.
    """
    materials: dict[tuple[float, float, float], Material] = {}
    sections: dict[tuple[float, ...], Section] = {}
    members = {}
    for k in range(len(frame.lines)):
        E, G, rho = constants = float(frame.E[k]), float(frame.G[k]), float(frame.rho[k])
        material = materials.setdefault(
            constants, Material(f"material {len(materials)}", E, rho, E / (2 * G) - 1)
        )
        A, Iy, Iz, J, ky, kz = key = tuple(
            float(getattr(frame, name)[k]) for name in ("A", "Iy", "Iz", "J", "ky", "kz")
        )
        section = sections.setdefault(key, Section(A, Iy, Iz, J, ky, kz, Ip=0.0 if polar else J))
        first, second = (
            tuple(d for d, free in zip(("ry", "rz"), end, strict=True) if free) for end in frame.released[k]
        )
        members[f"m{k}"] = MemberProperties(
            material,
            section,
            orientation=frame.local_z[k],
            theory=frame.theory,
            release1=first,
            release2=second,
        )
    mesh = Mesh.from_lines(frame.points, frame.lines, {f"m{k}": [k] for k in range(len(frame.lines))})
    supports = (
        Support(
            name=f"support{i}",
            point=int(i),
            fixed=tuple(d for d, is_fixed in zip(DIRECTIONS, frame.fixed[i], strict=True) if is_fixed),
        )
        for i in np.flatnonzero(frame.fixed.any(axis=1))
    )
    return Model(mesh, (Frame(members=members), *supports))


def load_of(frame: PeerFrame) -> LoadCase:
    """Return the forces on points and along members."""
    along = tuple(
        LineLoad(member=f"m{k}", force1=frame.uniform[k], axes="local")
        for k in np.flatnonzero(frame.uniform.any(axis=1))
    )
    return LoadCase(points=frame.loads.ravel(), members=along)


def within(frame: PeerFrame, solution: StaticSolution) -> dict[str, Any]:
    """Return section forces and deflections at a fraction of each member."""
    mesh = solution.model.mesh
    (beams,) = solution.model.of_kind(Frame)
    turn, forces, deflections = beams.rotations(mesh), [], []
    for k in range(mesh.n_lines):
        at = [frame.within * mesh.member_length(f"m{k}")]
        forces.append(solution.internal_forces(f"m{k}", at)[0, :, 0])
        deflections.append(turn[k] @ solution.displacements_along(f"m{k}", at)[0, :3, 0])
    return {"section_forces": np.array(forces), "deflections": np.array(deflections)}


def compute(frame: PeerFrame) -> PeerResult:
    """Compute one frame."""
    found: dict[str, Any] = {}
    start = time.process_time()
    model = model_of(frame)
    found["build"] = time.process_time() - start
    if frame.matrices:
        K, M, _, _ = sum_contributions(model.contributions(), model.n_dof)
        found["K"], found["M"] = K.toarray(), M.toarray()
    if frame.static:
        start = time.process_time()
        solution = solve_static(assemble(model), load_of(frame))
        found["static_seconds"] = time.process_time() - start
        found["displacements"] = solution.displacements[:, 0].reshape(-1, 6)
        found["end_forces"] = solution.line_forces[..., 0]
        found["reactions"] = np.zeros_like(frame.loads)
        for (support, direction), force in solution.reactions.items():
            found["reactions"][int(support.removeprefix("support")), DIRECTIONS.index(direction)] = force[0]
        if frame.within:
            found.update(within(frame, solution))
    if frame.n_modes and not frame.history.size:
        start = time.process_time()
        found["frequency"] = solve_modes(assemble(model), frame.n_modes).frequency
        found["modes_seconds"] = time.process_time() - start
    if frame.history.size:
        damped = Model(model.mesh, model.effects, Damping.rayleigh(frame.alpha, frame.beta))
        t = frame.step * np.arange(frame.history.size)
        start = time.process_time()
        excitation = Excitation.of(damped, t, frame.loads.ravel(), frame.history)
        modes = frame.n_modes or None
        watched = frame.watched.tolist()
        found["responses"] = solve_transient(
            assemble(damped), excitation, watched, method=frame.way, n_modes=modes
        ).displacement
        found["transient_seconds"] = time.process_time() - start
    return PeerResult(program="Dovetail", **found)


if __name__ == "__main__":
    serve(compute, sys.argv[1:])
