"""A joint in its assembly: the task of identifying it, and its dynamic stiffness line by line.

The substructures are the model of the whole assembly without the joint.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.analysis.frf_solver import compute_frf
from fem.array_types import Floats
from fem.effects.joint import Joint, joint_unit
from fem.model import DIRECTIONS, Model
from fem.system import assemble
from joint.identification import JointIdentification, JointIdentificationError
from joint.identification import identify_joint as solve_directly
from joint.interface import CoordinateSet, Interface, SubstructureFRF
from updating.inference.parameters import Nuisance
from updating.measurement.measurement import Measurement, sensor_rows


@dataclass(frozen=True, slots=True, eq=False)
class JointTask:
    """The task of identifying a joint of a model whose assembly was measured.

    Attributes
    ----------
    model : Model
        Of the assembly, with the joint.
    joint : Joint
    directions : tuple of str
        Relative motions whose dynamic stiffness is asked for.
    measurement : Measurement
        Of the assembly, with the lines that count, above 0 Hz.
    uncertain : tuple of Nuisance
        Parameters of the model that are known only roughly.
    damping_std : float
        Standard deviation of the logarithm of the damping [-].
    n_lines : int or None
        Lines that are fitted at most; ``MOST_LINES`` unless given.
    """

    model: Model
    joint: Joint
    directions: tuple[str, ...]
    measurement: Measurement
    uncertain: tuple[Nuisance, ...] = ()
    damping_std: float = 0.5
    n_lines: int | None = None

    @property
    def index(self) -> list[int]:
        """Places of the directions among x y z rx ry rz."""
        return [DIRECTIONS.index(d) for d in self.directions]

    @property
    def interface(self) -> Interface:
        """Names of relative motions, responses and inputs."""
        m = self.measurement
        return Interface(
            joint=CoordinateSet(tuple(f"{self.joint.name}:{d}" for d in self.directions)),
            outputs=CoordinateSet(tuple(f"{s.name}:x" for s in m.sensors)),
            inputs=CoordinateSet(tuple(f"{s.name}:x" for s in m.excitations)),
        )

    @property
    def springs(self) -> Floats:
        """Springs of the directions: the model's, or as stiff as the members themselves, (p,)."""
        stiffness = np.diag(np.asarray(self.joint.K, dtype=float))[self.index]
        rigid = [d in self.joint.rigid for d in self.directions]
        return np.where((stiffness > 0) & ~np.array(rigid), stiffness, _typical(self.model, self.directions))

    def tied(self) -> Model:
        """Return the model with elastic springs, and nothing else, in the directions of the joint."""
        index, joint = self.index, self.joint
        K, C, D = (np.array(X, dtype=float) for X in (joint.K, joint.C, joint.D))
        for X in (K, C, D):
            X[index, :] = 0.0
            X[:, index] = 0.0
        # the loss factor multiplies all of K: put into D, so that the springs to be taken out have none
        D = D + joint.eta * K
        K[index, index] = self.springs
        rigid = tuple(d for d in joint.rigid if d not in self.directions)
        elastic = replace(joint, K=K, C=C, D=D, eta=0.0, rigid=rigid)
        model = self.model
        return replace(model, effects=tuple(elastic if e.name == joint.name else e for e in model.effects))

    def vectors(self) -> tuple[Floats, ...]:
        """Responses, inputs and relative motions as rows of combinations of degrees of freedom."""
        model, m = self.model, self.measurement
        dofs, B = self.joint.relative(model)
        rows = np.zeros((len(self.index), model.n_dof))
        rows[:, dofs] = B[self.index]
        return sensor_rows(model, m.sensors), sensor_rows(model, m.excitations), rows

    def nuisances(self) -> tuple[Nuisance, ...]:
        """Return the uncertain parameters besides the directions asked for."""
        asked = {f"k{d}" for d in self.directions} | {"eta"}
        return tuple(n for n in self.uncertain if not (n.effect == self.joint.name and n.parameter in asked))


def identify(task: JointTask, amplification: float = 1e3) -> JointIdentification:
    """Identify a joint's dynamic stiffness in some directions of its relative motion, line by line.

    The substructures are the model without the joint's stiffness and damping in these directions; in
    the others it keeps those of the model. Their receptances are those of the model with elastic springs k in
    these directions, which are then taken out again, H = H' + H'_d (1/k - H'_dd)⁻¹ H'_d; so parts that
    nothing else connects need no treatment of their own.

    Parameters
    ----------
    task : JointTask
    amplification : float
        Largest amplification of errors of a line that counts [-].

    Returns
    -------
    JointIdentification
        ``z`` is the dynamic stiffness in the directions, (n_freq, p, p), the joint's axes.

    Raises
    ------
    JointIdentificationError
        If the sensors and excitations cannot determine it.
    """
    frf = task.measurement.frf.as_kind("receptance")
    try:
        return solve_directly(_without(task), frf.frequency, frf.H, amplification_limit=amplification)
    except JointIdentificationError as reason:
        msg = f"joint '{task.joint.name}' in {', '.join(task.directions)}: {reason}"
        raise JointIdentificationError(msg) from reason


def _without(task: JointTask) -> SubstructureFRF:
    """Return the receptances of the model without a joint's stiffness in some directions."""
    model, frequency, k = task.model, task.measurement.frf.frequency, task.springs
    outputs, inputs, rows = task.vectors()
    # the direct method is exact, and asks for damping without modal ratios
    method = "reduced" if model.damping.ratio.any() else "direct"
    H = compute_frf(
        assemble(task.tied()),
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
    return SubstructureFRF(frequency, task.interface, H[:, :m, :n], H[:, :m, n:], H[:, m:, :n], H[:, m:, n:])


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
