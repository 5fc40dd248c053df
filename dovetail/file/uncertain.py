"""Read the uncertainties of a model's parameters: the table ``[uncertain]``."""

from collections.abc import Iterable, Mapping

import numpy as np

from dovetail.file.settings import SHARES
from dovetail.file.table import StudyTable
from fem.effects.joint import Joint
from fem.effects.section_shear import SectionShear
from fem.effects.superelement import Superelement
from fem.elements.frame import Frame
from fem.materials import Material
from fem.model import DIRECTIONS, Model
from updating.inference.belief import FORM_SECTION
from updating.inference.parameters import Nuisance
from updating.inference.patches import with_turning
from updating.measurement.channel_errors import USUAL

MASS_SHARE = 0.4
"""Standard deviation of a part's mass in those of its stiffness [-]: 2 % where that is 5 %."""

SHEAR_STD = 0.3
"""Relative standard deviation of shear coefficients of sections with walls, unless the study gives it."""
USUAL_STD = {"E": 0.02, "rho": 0.01, "joints": 0.05, "parts": 0.05, "shear": SHEAR_STD, "damping": 0.5}
"""Relative standard deviations that are assumed unless the study gives them."""


def assumed_tables() -> str:
    """Return tables of all tolerances that a study assumes, those of materials and damping as values."""
    std, of_test = USUAL_STD, USUAL
    form = [f"{word} = {FORM_SECTION[keys[0]]}" for word, keys in SHARES.items()]
    return f"""\
[uncertain] # relative standard deviations; a line behind a # states what is assumed without it
E = {std["E"]}
rho = {std["rho"]}
damping = {std["damping"]} # of its logarithm
# joints = {std["joints"]} # each stiffness of each joint
# parts = {std["parts"]} # stiffness of parts of other programs; their mass {MASS_SHARE} of it
# shear = {std["shear"]} # shear coefficients of sections with walls

# [form] # relative standard deviations of sections
{"".join(f"# {line}" + chr(10) for line in form)}
# [channel_errors] # standard deviations of the test
# gain = {of_test.gain} # relative, of sensitivities
# direction = {np.degrees(of_test.direction):g} # °
# position = {of_test.position} # m
# sensor_mass = {of_test.sensor_mass} # kg
# driver_mass = {of_test.driver_mass} # kg
# stinger = {of_test.stinger} # N/m, across the force
"""


def read_uncertain(top: StudyTable, model: Model, notes: list[str]) -> tuple[tuple[Nuisance, ...], float]:
    """Read ``[uncertain]``: relative standard deviations; 0 for a known parameter."""
    t = top.table("uncertain")
    std = {key: t.number(key, None, least=0) for key in USUAL_STD}
    shear, parts, joints = model.of_kind(SectionShear), model.of_kind(Superelement), model.of_kind(Joint)
    there = {"E": bool(model.mesh.members), "rho": bool(model.mesh.members), "parts": bool(parts)}
    there |= {"joints": any(j.elastic for j in joints), "shear": bool(shear)}
    assumed = [key for key, value in std.items() if value is None and there.get(key, True)]
    words = {
        "E": "E 2 %",
        "rho": "density 1 %",
        "joints": "joint stiffness 5 %",
        "parts": "stiffness of parts of other programs 5 %, their mass 2 %",
        "shear": f"shear coefficients of walls {SHEAR_STD:.0%}".replace("%", " %"),
        "damping": "damping a factor of 1.6 (0.5 of its logarithm)",
    }
    if assumed:
        notes.append(
            "default standard deviations, for those that are not given: "
            f"{', '.join(words[key] for key in assumed)}"
        )
    std = {key: USUAL_STD[key] if value is None else value for key, value in std.items()}
    frame = model.effect("frame")
    materials: dict[str, Material] = frame.materials if isinstance(frame, Frame) else {}
    out = _of_materials(t.table("materials"), materials, std)
    out += _of_joints(t.table("joint"), joints, std["joints"])
    out += _of_parts(t.table("part"), parts, std["parts"], t.number("part_modes", 0.0, least=0))
    t.finish()
    out += [Nuisance(e.name, p.name, std["shear"]) for e in shear for p in e.parameters()]
    return with_turning([n for n in out if n.std > 0], model), std["damping"]


def with_shear(top: StudyTable, model: Model) -> Model:
    """Return a model whose shear coefficients of walls can be fitted, unless they are stated as known."""
    shear, std = SectionShear.of(model), top.table("uncertain").number("shear", SHEAR_STD, least=0)
    return model.with_effect(shear) if shear and std else model


def mode_std(top: StudyTable, part: str) -> float:
    """Return the relative standard deviation of the eigenvalues of a part's fixed-interface modes."""
    t = top.table("uncertain")
    return t.table("part").table(part).number("modes", t.number("part_modes", 0.0, least=0), least=0)


def _of_materials(t: StudyTable, materials: Iterable[str], std: Mapping[str, float]) -> list[Nuisance]:
    out = []
    for name in materials:
        inner = t.table(name)
        for key in ("E", "rho"):
            out.append(Nuisance("frame", f"{key}:{name}", inner.number(key, std[key], least=0)))
        inner.finish()
    t.finish()
    return out


def _of_parts(t: StudyTable, parts: Iterable[Superelement], std: float, modes: float) -> list[Nuisance]:
    """Read the table of parts; a mass is known better than a stiffness, by :data:`MASS_SHARE`."""
    out = []
    for part in parts:
        inner = t.table(part.name)
        out.append(Nuisance(part.name, "stiffness", inner.number("stiffness", std, least=0)))
        out.append(Nuisance(part.name, "mass", inner.number("mass", MASS_SHARE * std, least=0)))
        each = inner.number("modes", modes, least=0)
        out += [Nuisance(part.name, f"mode{k + 1}", each) for k in range(part.n_uncertain)]
        inner.finish()
    t.finish()
    return out


def _of_joints(t: StudyTable, joints: Iterable[Joint], std: float) -> list[Nuisance]:
    out = []
    for joint in joints:
        inner = t.table(joint.name)
        all_k = inner.number("k", std, least=0)
        for d in DIRECTIONS:
            value = inner.number(f"k{d}", all_k, least=0)
            if d in joint.elastic:
                out.append(Nuisance(joint.name, f"k{d}", value))
            elif f"k{d}" in inner.values:
                inner.refuse(
                    f"k{d}",
                    f"joint '{joint.name}' has no stiffness in {d}; elastic are "
                    f"{', '.join(joint.elastic) or 'none'}",
                )
        eta = inner.number("eta", 0.0, least=0)
        if eta and not joint.eta:
            inner.refuse("eta", f"joint '{joint.name}' has no loss factor")
        out.append(Nuisance(joint.name, "eta", eta))
        inner.finish()
    t.finish()
    return out
