"""Effects that may be hidden at joints."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.frames import Draft, Generator, constant_loss
from benchmarks.validation.hiding import (
    Draw,
    Hidden,
    Kind,
    Place,
    felt_stiffness,
    middle_of_band,
    one_entry,
    some_body,
)
from benchmarks.validation.spectral import Law
from benchmarks.validation.truth import TrueFrame, TrueJoint
from fem import DIRECTIONS

DrawAtJoint = Callable[[Generator, Draft, TrueJoint], Hidden]


def _at_joint(draw: DrawAtJoint, elastic: bool = False) -> Draw:
    """Return what draws something at any joint of a frame, or at any elastic one."""

    def drawn(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        allowed = [i for i, j in enumerate(truth.joints) if not (elastic and j.rigid[0])]
        return draw(rng, draft, truth.joints[int(rng.choice(allowed))]) if allowed else None

    return drawn


def _along(j: TrueJoint, d: int, words: str = "") -> Place:
    return Place(f"joint {j.name}, {words}{DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])


def _joint_stiffness(directions: range) -> Draw:
    return _at_joint(lambda rng, draft, j: soft_joint(draft, j, int(rng.choice(directions))))


def soft_joint(draft: Draft, j: TrueJoint, d: int) -> Hidden:
    """Return a joint that gives way in a direction, or more so than it should."""

    def stiffness(a: float) -> float:
        return felt_stiffness(draft, j.first.member, d) / a if j.rigid[d] else float(j.K[d, d]) / (1 + a)

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        joint = next(x for x in frame.joints if x.name == j.name)
        K = joint.K.copy()
        K[d, d] = stiffness(a)
        return frame.with_joint(j.name, K=K, rigid=tuple(r and k != d for k, r in enumerate(joint.rigid)))

    bounds = (0.03, 1e6) if j.rigid[d] else (0.1, 1e4)
    return Hidden(_along(j, d), bounds, change, lambda a: {"stiffness": stiffness(a)})


def _joint_coupled(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
    d, e = [(1, 5), (2, 4), (0, 4), (2, 3), (1, 3), (0, 5)][int(rng.integers(6))]
    full = float(np.sqrt(j.K[d, d] * j.K[e, e])) * float(rng.choice([-1, 1]))

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        K = next(x for x in frame.joints if x.name == j.name).K.copy()
        K[d, e] = K[e, d] = a * full
        return frame.with_joint(j.name, K=K)

    pair = DIRECTIONS[d], DIRECTIONS[e]
    place = Place(f"joint {j.name}, {pair[0]} with {pair[1]}", joint=j.name, pair=pair)
    return Hidden(place, (0.01, 0.9), change, lambda a: {"coupling": float(np.sign(full)) * a})


def _joint_body(rotary: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
        body, unit = some_body(draft.frame.members[j.first.member], rotary)
        return Hidden(
            Place(f"joint {j.name}", joint=j.name),
            (1e-4, 1.0),
            lambda frame, a: frame.with_joint(j.name, M=a * body),
            lambda a: {"inertia" if rotary else "mass": a * unit},
        )

    return _at_joint(draw)


def _joint_viscous(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
    d = int(rng.integers(6))
    unit = float(j.K[d, d]) / middle_of_band(draft)
    return Hidden(
        _along(j, d),
        (1e-3, 10.0),
        lambda frame, a: frame.with_joint(j.name, C=one_entry(d, a * unit)),
        lambda a: {"damping": a * unit},
    )


def _joint_structural(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
    rng.uniform()  # keeps the cases of a seed
    base = j.law or constant_loss(0.0)
    return Hidden(
        Place(f"joint {j.name}", joint=j.name),
        (1e-2, 3.0),
        lambda frame, a: frame.with_joint(j.name, law=lambda omega: base(omega) * constant_loss(a)(omega)),
        lambda a: {"loss_factor": a},
    )


def _in_one_direction(
    law: Callable[[float, float], Law], values: Callable[[float, float], dict[str, float]]
) -> Draw:
    def draw(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
        d, tau = int(rng.integers(6)), float(rng.uniform(0.7, 1.4) / middle_of_band(draft))
        base = j.law or constant_loss(0.0)

        def joint_law(a: float) -> Law:
            def factors(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
                out = np.ones((omega.size, 6), dtype=complex)
                out[:, d] = law(a, tau)(omega)
                return out * base(omega)[:, None]

            return factors

        return Hidden(
            _along(j, d),
            (1e-2, 10.0),
            lambda frame, a: frame.with_joint(j.name, law=joint_law(a)),
            lambda a: values(a, tau),
        )

    return _at_joint(draw, elastic=True)


def _zener(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * 1j * omega * tau / (1 + 1j * omega * tau)


def _fractional(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * np.sqrt(1j * omega * tau)


def _fractional_values(a: float, tau: float) -> dict[str, float]:
    """Return the strength at 100 Hz, as candidates state it, and the exponent."""
    return {"strength": float(a * np.sqrt(2 * np.pi * 100 * tau)), "exponent": 0.5}


def _joint_offset(rng: Generator, draft: Draft, j: TrueJoint) -> Hidden:
    d = int(rng.integers(3))
    arm = np.eye(3)[d] * draft.frame.members[j.first.member].length * float(rng.choice([-1, 1]))
    return Hidden(
        _along(j, d, "along "),
        (2e-3, 0.15),
        lambda frame, a: frame.with_joint(j.name, location=j.location + a * arm),
        lambda a: {"offset": a * float(arm[d])},
    )


AT_JOINTS = (
    Kind("joint_translation", ("joint_stiffness",), _joint_stiffness(range(3))),
    Kind("joint_rotation", ("joint_stiffness",), _joint_stiffness(range(3, 6))),
    Kind("joint_coupled", ("joint_coupling",), _at_joint(_joint_coupled, elastic=True)),
    Kind("joint_mass", ("joint_mass",), _joint_body(rotary=False)),
    Kind("joint_inertia", ("joint_inertia",), _joint_body(rotary=True)),
    Kind("joint_viscous", ("joint_viscous_damping",), _at_joint(_joint_viscous, elastic=True)),
    Kind("joint_structural", ("joint_structural_damping",), _at_joint(_joint_structural, elastic=True)),
    Kind("joint_zener", ("joint_zener",), _in_one_direction(_zener, lambda a, tau: {"ratio": a, "tau": tau})),
    Kind("joint_fractional", ("joint_fractional",), _in_one_direction(_fractional, _fractional_values)),
    Kind("joint_offset", ("joint_offset",), _at_joint(_joint_offset, elastic=True)),
)
"""Kinds at joints."""
