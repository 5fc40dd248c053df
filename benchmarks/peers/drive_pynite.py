"""Compute frames with PyNite; runs in the peers' environment.

Its members are Euler-Bernoulli beams, and their mass comes from loads: here from their weight, at gravity 1.
"""

import sys
import time
from importlib.metadata import version
from typing import Any

import numpy as np
from Pynite import FEModel3D  # pyright: ignore[reportMissingImports]

from benchmarks.peers.exchange import (
    EULER_BERNOULLI,
    PeerError,
    PeerFrame,
    PeerResult,
    on_positive_faces,
    serve,
)

DIRECTIONS = ("DX", "DY", "DZ", "RX", "RY", "RZ")
FORCES = ("FX", "FY", "FZ", "MX", "MY", "MZ")


def _distinct(names: tuple[str, ...], frame: PeerFrame) -> tuple[list[list[float]], list[int]]:
    rows, which = np.unique(
        np.column_stack([getattr(frame, name) for name in names]), axis=0, return_inverse=True
    )
    return rows.tolist(), which.ravel().tolist()


def build(frame: PeerFrame) -> Any:
    """Return PyNite's model."""
    model = FEModel3D()
    for i, at in enumerate(frame.points.tolist()):
        model.add_node(f"N{i}", *at)
    for i in np.flatnonzero(frame.fixed.any(axis=1)):
        model.def_support(f"N{i}", *frame.fixed[i].tolist())
    materials, material = _distinct(("E", "G", "rho"), frame)
    for i, (E, G, rho) in enumerate(materials):
        model.add_material(f"material {i}", E, G, E / (2 * G) - 1, rho)
    sections, section = _distinct(("A", "Iy", "Iz", "J"), frame)
    for i, (A, Iy, Iz, J) in enumerate(sections):
        model.add_section(f"section {i}", A, Iy, Iz, J)
    for k, (a, b) in enumerate(frame.lines.tolist()):
        words = (f"material {material[k]}", f"section {section[k]}")
        model.add_member(f"M{k}", f"N{a}", f"N{b}", *words)
        # turn the axes that PyNite chose about the member: z(θ) = z cos θ - y sin θ
        y, z = model.members[f"M{k}"].T()[1:3, :3]
        angle = np.arctan2(-frame.local_z[k] @ y, frame.local_z[k] @ z)
        model.members[f"M{k}"].rotation = float(np.degrees(angle))
        if frame.released[k].any():
            (y1, z1), (y2, z2) = frame.released[k].tolist()
            model.def_releases(f"M{k}", Ryi=y1, Rzi=z1, Ryj=y2, Rzj=z2)
    model.add_load_combo("static", {"joints": 1.0}, ["static"])
    model.add_load_combo("mass", {"weight": 1.0}, ["mass"])
    model.add_member_self_weight("FY", 1.0, "weight")
    for i in np.flatnonzero(frame.loads.any(axis=1)):
        for name, force in zip(FORCES, frame.loads[i].tolist(), strict=True):
            model.add_node_load(f"N{i}", name, force, "joints")
    for k in np.flatnonzero(frame.uniform.any(axis=1)):
        for name, force in zip(("Fx", "Fy", "Fz"), frame.uniform[k].tolist(), strict=True):
            model.add_member_dist_load(f"M{k}", name, force, force, case="joints")
    return model


def matrices(model: Any) -> tuple[Any, Any]:
    """Return K and M of all DOFs in the order of the nodes."""
    model.analyze_linear(combo_tags=["static"])  # numbers the nodes
    return model.Ke("static").toarray(), model.M("mass").toarray()


def within(model: Any, fraction: float) -> dict[str, Any]:
    """Return section forces and deflections at a fraction of each member.

    PyNite counts forces as those on negative faces, but for the moment about local y.
    """
    forces, deflections = [], []
    for member in model.members.values():
        x = fraction * member.L()
        shear = [-member.shear(d, x, "static") for d in ("Fy", "Fz")]
        moments = [member.moment("My", x, "static"), -member.moment("Mz", x, "static")]
        forces.append([-member.axial(x, "static"), *shear, -member.torque(x, "static"), *moments])
        deflections.append([member.deflection(d, x, "static") for d in ("dx", "dy", "dz")])
    return {"section_forces": np.array(forces, float), "deflections": np.array(deflections, float)}


def compute(frame: PeerFrame) -> PeerResult:
    """Compute one frame."""
    if frame.theory != EULER_BERNOULLI:
        msg = f"PyNite has no '{frame.theory}' members; it has {EULER_BERNOULLI}"
        raise PeerError(msg)
    found: dict[str, Any] = {}
    start = time.process_time()
    model = build(frame)
    found["build"] = time.process_time() - start
    if frame.matrices:
        found["K"], found["M"] = matrices(model)
    if frame.static:
        start = time.process_time()
        model.analyze_linear(combo_tags=["static"])
        found["static_seconds"] = time.process_time() - start
        nodes = [model.nodes[f"N{i}"] for i in range(len(frame.points))]
        found["displacements"] = np.array([[getattr(n, d)["static"] for d in DIRECTIONS] for n in nodes])
        forces = [model.members[f"M{k}"].f("static") for k in range(len(frame.lines))]
        found["end_forces"] = on_positive_faces(forces)
        found["reactions"] = np.array([[getattr(n, f"Rxn{f}")["static"] for f in FORCES] for n in nodes])
        if frame.within:
            found.update(within(model, frame.within))
    if frame.n_modes:
        start = time.process_time()
        model.analyze_modal(frame.n_modes, "mass")
        found["modes_seconds"] = time.process_time() - start
        found["frequency"] = np.sort(model.frequencies)
    return PeerResult(program=f"PyNite {version('PyNiteFEA')}", **found)


if __name__ == "__main__":
    serve(compute, sys.argv[1:])
