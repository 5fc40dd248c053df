"""Broken effects: each check of the contract notices its own."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from fem import Contribution, Effect, Frame, Parameter, Role, dofs_of
from fem.declarations import Site
from tests.fem.test_effects_contract import (
    CHECKS,
    MODELS,
    check_absent,
    check_derivatives,
    check_linear,
    check_place,
    check_references,
    check_rigid_motion,
    check_role,
    check_starts,
    check_symmetry,
)

# ------------------------------------------------------------------------- would a broken effect be noticed?


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Planted(Effect):
    """A grounded spring with one fault."""

    kind: ClassVar[str] = "planted"
    role: ClassVar[Role] = Role.STIFFNESS
    fault: str
    k: Any = 0.0
    width: float = 0.1

    @property
    def where(self) -> Site:
        return Site("" if self.fault == "place" else "here")

    def parameters(self):
        return (
            Parameter("k", "N/m", self.k, 0.0, -1.0 if self.fault == "bounds" else 0.0, 1e9, linear=True),
        )

    def contribute(self, model):
        b = np.zeros(12)
        b[[2, 8]] = 1.0, -1.0
        if self.fault == "rigid":
            b[8] = 0.0
        else:  # the motion of two points along their line is no strain of z
            d = model.mesh.points[1] - model.mesh.points[0]
            b[[3, 4]] = d[1], -d[0]
        K = self.k * np.outer(b, b)
        if self.fault == "asymmetric":
            K[2, 8] *= 1.1
        if self.fault == "absent":
            K = K + np.outer(b, b)
        if self.fault == "nonlinear":
            K = K * abs(np.real(self.k))
        if self.fault == "references":
            (frame,) = model.of_kind(Frame)
            K = K * frame.parameters()[0].value
        if self.fault == "derivative":
            K = np.real(self.k) * np.outer(b, b) + 0.9j * np.imag(self.k) * np.outer(b, b)
        return (Contribution(dofs_of([0, 1]).reshape(1, 12), K[None]),)

    def starts(self, scale):
        return ({"k": -5.0 if self.fault == "starts" else 5.0},)

    def locations(self, model):
        return model.mesh.points[[0]] + (7.0 if self.fault == "place" else 0.0)


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        ("asymmetric", check_symmetry),
        ("absent", check_absent),
        ("rigid", check_rigid_motion),
        ("nonlinear", check_linear),
        ("nonlinear", check_derivatives),
        ("derivative", check_derivatives),
        ("place", check_place),
        ("starts", check_starts),
        ("references", check_references),
    ],
)
def test_the_contract_notices(fault, check):
    model = MODELS["cross"]
    with pytest.raises(AssertionError):
        check(model, Planted(name="p", fault=fault))


def test_the_contract_notices_a_wrong_role(monkeypatch):
    monkeypatch.setattr(Planted, "role", Role.MASS)
    with pytest.raises(AssertionError, match=r"adds to \['K'\]"):
        check_role(MODELS["cross"], Planted(name="p", fault=""))


def test_the_contract_accepts_a_sound_effect():
    for check in CHECKS:
        check(MODELS["cross"], Planted(name="p", fault=""))
