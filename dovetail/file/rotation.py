"""Read ``[rotation]``: the speed of the members that spin."""

import numpy as np

from dovetail.file.geometry import Geometry
from dovetail.file.table import StudyTable
from fem.analysis.unbalance import Unbalance
from fem.effects.spin import Spin, refusals, spinning
from fem.model import Model, ModelError

SPIN = "spin"
"""Name of the effect of a study's members that spin."""

RPM = 2 * np.pi / 60
"""One turn a minute [rad/s]."""


def read_rotation(top: StudyTable, model: Model, notes: list[str]) -> Model:
    """Return the model with the gyroscopic effect at the study's speed, if it states one."""
    t = top.table("rotation")
    rpm = t.number("rpm", None, unit="1/min")
    t.finish()
    shafts = spinning(model)
    if rpm is not None and not shafts:
        t.refuse("rpm", "no member has a spin; give such as spin = 1.0 in [members.NAME]")
    for where, why in refusals(model):
        top.refuse("members", f"{where} cannot spin: {why}")
    if rpm:
        with t.at("rpm"):
            return at_speed(model, rpm)
    if shafts and rpm is None:
        notes.append(
            f"no [rotation] rpm is given: members with a spin ({', '.join(shafts)}) stand still, but for the "
            "speeds of dovetail campbell and unbalance, and of --rpm"
        )
    return model


def read_unbalances(top: StudyTable, geometry: Geometry) -> tuple[Unbalance, ...]:
    """Read ``[[unbalances]]``."""
    out = []
    for t in top.tables("unbalances"):
        out.append(
            Unbalance(
                point=geometry.point(t),
                moment=t.number("moment", above=0, unit="kg·m"),
                angle=np.radians(t.number("angle", 0.0, unit="deg")),
            )
        )
        t.finish()
    return tuple(out)


def at_speed(model: Model, rpm: float) -> Model:
    """Return a model whose shafts turn at a speed [1/min].

    Raises
    ------
    ModelError
        If no member has a spin.
    """
    if not spinning(model):
        msg = "no member has a spin; give such as spin = 1.0 in [members.NAME] of the study"
        raise ModelError(msg)
    return at_rest(model).with_effect(Spin(name=SPIN, speed=rpm * RPM))


def at_rest(model: Model) -> Model:
    """Return a model whose shafts do not turn."""
    return model.without_effect(*(e.name for e in model.of_kind(Spin)))
