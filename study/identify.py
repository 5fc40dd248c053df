"""Identification of a joint of a study from its measurement, line by line."""

from dataclasses import replace
from typing import Any

import numpy as np

from fem.effects.joint import Joint, joint_unit
from fem.frf import compute_frf
from fem.model import DIRECTIONS, Model, directions_from
from fem.system import assemble
from joint import CoordinateSet, IdentificationError, Interface, JointIdentification, SubstructureFRF
from joint import identify_joint as solve_directly
from study.config import Study
from study.measured import sensor_rows
from study.table import StudyError, suggest
from updating.measurement import Measurement


def identify(
    study: Study, name: str, directions: str, measurement: str | None = None, amplification: float = 1e3
) -> tuple[JointIdentification, tuple[str, ...]]:
    """Identify a joint's dynamic stiffness in some directions of its relative motion.

    The substructures are the study's model without the joint's stiffness and damping in these directions; in
    the others it keeps those of the study. Their receptances are those of the model with elastic springs k in
    these directions, which are then taken out again, H = H' + H'_d (1/k - H'_dd)⁻¹ H'_d; so parts that
    nothing else connects need no treatment of their own.

    Parameters
    ----------
    study : Study
    name : str
        Name of a joint.
    directions : str
        Some of x y z rx ry rz, or all.
    measurement : str, optional
        Name of the measurement; the first unless given.
    amplification : float
        Largest amplification of errors of a line that counts [-].

    Returns
    -------
    JointIdentification
        ``z`` is the dynamic stiffness in the directions, (n_freq, p, p), global axes.
    tuple of str
        The directions.

    Raises
    ------
    StudyError
        For an unknown joint or measurement, or no measurement.
    IdentificationError
        If the sensors and excitations cannot determine it.
    """
    joints = {j.name: j for j in study.model.of_kind(Joint)}
    if name not in joints:
        msg = f"{study.path}: there is no joint '{name}'; {suggest(name, joints)}"
        raise StudyError(msg)
    wanted = directions_from(directions, "--directions")
    if not wanted:
        msg = "--directions: no direction is named; some of x y z rx ry rz are needed"
        raise StudyError(msg)
    measured = _measurement(study, measurement)
    lines = measured.frf.frequency > 0
    frf = measured.frf.select(lines=lines, band=study.band).as_kind("receptance")
    parts = _without(study.model, joints[name], wanted, measured, frf.frequency)
    try:
        found = solve_directly(parts, frf.frequency, frf.H, amplification_limit=amplification)
    except IdentificationError as reason:
        msg = f"joint '{name}' in {', '.join(wanted)}: {reason}"
        raise IdentificationError(msg) from reason
    return found, wanted


def _measurement(study: Study, name: str | None) -> Measurement:
    by_name = {m.name: m for m in study.measurements}
    if not by_name:
        msg = f"{study.path}: it has no [[measurements]]; the identification needs the measured assembly"
        raise StudyError(msg)
    if name is not None and name not in by_name:
        msg = f"{study.path}: there is no measurement '{name}'; {suggest(name, by_name)}"
        raise StudyError(msg)
    return by_name[name] if name is not None else study.measurements[0]


def _without(
    model: Model, joint: Joint, wanted: tuple[str, ...], measured: Measurement, frequency: Any
) -> SubstructureFRF:
    """Return the receptances of the model without a joint's stiffness in some directions."""
    index = [DIRECTIONS.index(d) for d in wanted]
    K, C, D = (np.array(X, dtype=float) for X in (joint.K, joint.C, joint.D))
    own = np.diag(K)[index]
    for X in (K, C, D):
        X[index, :] = 0.0
        X[:, index] = 0.0
    k = np.where(own > 0, own, _typical(model, wanted))
    K[index, index] = k
    # the loss factor multiplies all of K: put into D, so that the springs to be taken out have none
    D = D + joint.eta * (K - np.diag(np.isin(np.arange(6), index) * np.diag(K)))
    tied = replace(joint, K=K, C=C, D=D, eta=0.0, rigid=tuple(d for d in joint.rigid if d not in wanted))
    whole = replace(model, effects=tuple(tied if e.name == joint.name else e for e in model.effects))
    dofs, B = joint.relative(model)
    rows = np.zeros((len(index), model.n_dof))
    rows[:, dofs] = B[index]
    outputs, inputs = sensor_rows(model, measured.sensors), sensor_rows(model, measured.excitations)
    # the direct method is exact, and asks for damping without modal ratios
    method = "reduced" if model.damping.ratio.any() else "direct"
    H = compute_frf(
        assemble(whole),
        frequency,
        np.vstack([outputs, rows]),
        np.vstack([inputs, rows]),
        "receptance",
        method,
    ).H
    m, n = len(outputs), len(inputs)
    # the structure's own damping acts on these springs as on everything else
    omega = 2 * np.pi * frequency[:, None, None]
    z = np.diag(k) * (1 + 1j * (model.damping.loss_factor + omega * model.damping.beta))
    H = H + H[:, :, n:] @ np.linalg.solve(np.linalg.inv(z) - H[:, m:, n:], H[:, m:, :])
    interface = Interface(
        joint=CoordinateSet(tuple(f"{joint.name}:{d}" for d in wanted)),
        outputs=CoordinateSet(tuple(f"{s.name}:x" for s in measured.sensors)),
        inputs=CoordinateSet(tuple(f"{s.name}:x" for s in measured.excitations)),
    )
    return SubstructureFRF(frequency, interface, H[:, :m, :n], H[:, :m, n:], H[:, m:, :n], H[:, m:, n:])


def _typical(model: Model, directions: tuple[str, ...]) -> np.ndarray:
    """Return stiffnesses of the order of the members' own, E A / L and E I / L."""
    frame: Any = model.effect("frame")
    out = []
    for d in directions:
        values = [
            p.material.E
            * (p.section.A if d in "xyz" else p.section.Iy + p.section.Iz)
            / model.mesh.member_length(name)
            for name, p in frame.members.items()
        ]
        out.append(float(np.median(values)))
    return np.array(out)


def summarise(found: JointIdentification, directions: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return constant stiffness and damping of each direction: medians over the lines that count.

    z = k (1 + i eta) = k + i ω c; the scatter is 1.48 times the median absolute deviation of a line.
    """
    keep = found.regular
    omega = 2 * np.pi * found.frequency[keep]
    out = []
    for i, d in enumerate(directions):
        z = found.z[keep, i, i]
        k = float(np.median(z.real))
        out.append(
            {
                "direction": d,
                "k": k,
                "k_scatter": 1.4826 * float(np.median(np.abs(z.real - k))),
                "unit": joint_unit(d),
                "eta": float(np.median(z.imag)) / k if k else float("nan"),
                "c": float(np.median(z.imag / omega)),
                "unit_c": joint_unit(d, "c"),
            }
        )
    return out
