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
    product_of_laws,
    some_joint,
)
from benchmarks.validation.spectral import Law
from benchmarks.validation.truth import TrueFrame, TrueJoint, rigid_body
from fem.model import DIRECTIONS


def _joint_stiffness(directions: range) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = some_joint(rng, draft)
        if i is None:
            return None
        return soft_joint(draft, truth.joints[i], int(rng.choice(directions)))

    return draw


def soft_joint(draft: Draft, j: TrueJoint, d: int) -> Hidden:
    """Return a joint that gives way in a direction, or more so than it should."""

    def stiffness(a: float) -> float:
        return felt_stiffness(draft, j.first.member, d) / a if j.rigid[d] else float(j.K[d, d]) / (1 + a)

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        own = next(x for x in frame.joints if x.name == j.name)
        K = own.K.copy()
        K[d, d] = stiffness(a)
        return frame.with_joint(j.name, K=K, rigid=tuple(r and k != d for k, r in enumerate(own.rigid)))

    place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
    bounds = (0.03, 1e6) if j.rigid[d] else (0.1, 1e4)
    return Hidden("", place, bounds, change, lambda a: {"stiffness": stiffness(a)})


def _joint_coupled(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = some_joint(rng, draft, elastic=True)
    if i is None:
        return None
    j = truth.joints[i]
    d, e = [(1, 5), (2, 4), (0, 4), (2, 3), (1, 3), (0, 5)][int(rng.integers(6))]
    full = float(np.sqrt(j.K[d, d] * j.K[e, e])) * float(rng.choice([-1, 1]))

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        K = next(x for x in frame.joints if x.name == j.name).K.copy()
        K[d, e] = K[e, d] = a * full
        return frame.with_joint(j.name, K=K)

    place = Place(
        f"joint {j.name}, {DIRECTIONS[d]} with {DIRECTIONS[e]}",
        joint=j.name,
        pair=(DIRECTIONS[d], DIRECTIONS[e]),
    )
    sign = float(np.sign(full))
    return Hidden("", place, (0.01, 0.9), change, lambda a: {"coupling": sign * a})


def _joint_body(rotary: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = some_joint(rng, draft)
        if i is None:
            return None
        j = truth.joints[i]
        m = draft.frame.members[j.first.member]
        unit = m.mass * m.length**2 / 12 if rotary else m.mass

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            return frame.with_joint(j.name, M=rigid_body(0.0, a * unit) if rotary else rigid_body(a * unit))

        name = "inertia" if rotary else "mass"
        return Hidden(
            "", Place(f"joint {j.name}", joint=j.name), (1e-4, 1.0), change, lambda a: {name: a * unit}
        )

    return draw


def _joint_viscous(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = some_joint(rng, draft, elastic=True)
    if i is None:
        return None
    j, d = truth.joints[i], int(rng.integers(6))
    unit = float(j.K[d, d]) / middle_of_band(draft)
    place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
    return Hidden(
        "",
        place,
        (1e-3, 10.0),
        lambda frame, a: frame.with_joint(j.name, C=one_entry(d, a * unit)),
        lambda a: {"damping": a * unit},
    )


def _joint_law(
    law: Callable[[float, float], Law], values: Callable[[float, float], dict[str, float]]
) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = some_joint(rng, draft, elastic=True)
        if i is None:
            return None
        j, tau = truth.joints[i], float(1 / middle_of_band(draft) * rng.uniform(0.7, 1.4))
        return Hidden(
            "",
            Place(f"joint {j.name}", joint=j.name),
            (1e-2, 3.0),
            lambda frame, a: frame.with_joint(j.name, law=product_of_laws(j.law, law(a, tau))),
            lambda a: values(a, tau),
        )

    return draw


def _in_one_direction(
    law: Callable[[float, float], Law], values: Callable[[float, float], dict[str, float]]
) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = some_joint(rng, draft, elastic=True)
        if i is None:
            return None
        j, d = truth.joints[i], int(rng.integers(6))
        tau = float(rng.uniform(0.7, 1.4) / middle_of_band(draft))

        def own(a: float) -> Law:
            base, extra = j.law, law(a, tau)

            def factors(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
                out = np.ones((omega.size, 6), dtype=complex)
                out[:, d] = extra(omega)
                return out if base is None else out * base(omega)[:, None]

            return factors

        place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
        return Hidden(
            "",
            place,
            (1e-2, 10.0),
            lambda frame, a: frame.with_joint(j.name, law=own(a)),
            lambda a: values(a, tau),
        )

    return draw


def _zener(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * 1j * omega * tau / (1 + 1j * omega * tau)


def _fractional(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * np.sqrt(1j * omega * tau)


def _fractional_values(a: float, tau: float) -> dict[str, float]:
    """Return the strength at 100 Hz, as candidates state it, and the exponent."""
    return {"strength": float(a * np.sqrt(2 * np.pi * 100 * tau)), "exponent": 0.5}


def _joint_offset(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = some_joint(rng, draft, elastic=True)
    if i is None:
        return None
    j, d = truth.joints[i], int(rng.integers(3))
    arm = np.eye(3)[d] * draft.frame.members[j.first.member].length * float(rng.choice([-1, 1]))
    return Hidden(
        "",
        Place(f"joint {j.name}, along {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d]),
        (2e-3, 0.15),
        lambda frame, a: frame.with_joint(j.name, location=j.location + a * arm),
        lambda a: {"offset": a * float(arm[d])},
    )


AT_JOINTS = (
    Kind("joint_translation", ("joint_stiffness",), _joint_stiffness(range(3))),
    Kind("joint_rotation", ("joint_stiffness",), _joint_stiffness(range(3, 6))),
    Kind("joint_coupled", ("joint_coupling",), _joint_coupled),
    Kind("joint_mass", ("joint_mass",), _joint_body(rotary=False)),
    Kind("joint_inertia", ("joint_inertia",), _joint_body(rotary=True)),
    Kind("joint_viscous", ("joint_viscous_damping",), _joint_viscous),
    Kind(
        "joint_structural",
        ("joint_structural_damping",),
        _joint_law(lambda a, tau: constant_loss(a), lambda a, tau: {"loss_factor": a}),
    ),
    Kind(
        "joint_zener",
        ("joint_zener",),
        _in_one_direction(_zener, lambda a, tau: {"ratio": a, "tau": tau}),
    ),
    Kind(
        "joint_fractional",
        ("joint_fractional",),
        _in_one_direction(_fractional, _fractional_values),
    ),
    Kind("joint_offset", ("joint_offset",), _joint_offset),
)
"""Kinds at joints."""
