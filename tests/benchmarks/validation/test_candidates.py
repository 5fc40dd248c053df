"""Every hidden kind against the candidate that should find it: with true parameters it does the same.

Moduli, densities and joints of the truth are not the nominal ones, and the model has them as they are.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import fem
from benchmarks.validation.frames import build_model, constant_loss, draw_draft, sensors_of
from benchmarks.validation.hidden import EFFECTS, KINDS, SETS, draw_hidden
from benchmarks.validation.judging import same_place
from fem import DIRECTIONS, assemble
from tests.frames import rows_at
from updating import Measurement, propose
from updating.correlation import log_ratio

ETA = 0.02
STIFFER, LIGHTER, JOINTS = 1.15, 0.9, (1.3, 0.8, 1.2, 0.75, 1.3, 0.8)
"""Truth in parts of nominal: E, density, and the stiffnesses of joints."""
FAMILY = {
    "joint": "cross",
    "support": "angle",
    "foot": "angle",
    "part": "cross",
    "end": "bracket",
    "rigid": "bracket",
}
MOUNTED = tuple(k for pool in SETS["mounting"] for k in pool if k not in EFFECTS)
# The truth's stretch is not exactly a tenth of the member.
NOT_BY_VALUE = ("stiffness_loss",)


@lru_cache
def frame(family, number, elastic_feet=False):
    """Return a test, its truth, which deviates and has one loss factor, and the model with its values."""
    draft = draw_draft(np.random.default_rng([9, number]), family, small=True, elastic_feet=elastic_feet)
    law = constant_loss(ETA)
    truth = replace(
        draft.frame,
        members={
            n: replace(m, E=STIFFER * m.E, rho=LIGHTER * m.rho, loss=ETA)
            for n, m in draft.frame.members.items()
        },
        joints=tuple(replace(j, K=j.K * np.diag(JOINTS), law=law) for j in draft.frame.joints),
        attached=tuple(replace(a, law=law) for a in draft.frame.attached),
    )
    model = build_model(draft.frame, draft.materials, draft.sensors, 40)
    materials = set(draft.materials.values())
    nominal, values = model.values(), {}
    for name in materials:
        values["frame", f"E:{name}"] = STIFFER * nominal["frame", f"E:{name}"]
        values["frame", f"rho:{name}"] = LIGHTER * nominal["frame", f"rho:{name}"]
    for j in truth.joints:
        values |= {
            (j.name, f"k{d}"): float(k)
            for d, k, rigid in zip(DIRECTIONS, np.diag(j.K), j.rigid, strict=True)
            if not rigid
        }
    return draft, truth, model.with_values(values).with_damping(fem.Damping.structural(ETA))


def level(H, base, heard):
    return float(np.sqrt(np.mean(np.abs(log_ratio(H, base)[heard]) ** 2)))


def drawn(kind):
    """Return a hidden effect and an amplitude at which the FRFs change by 0.3 nepers."""
    for k in range(12):
        draft, truth, model = frame(FAMILY.get(kind.split("_")[0], "tee"), k // 4, KINDS[kind].elastic_feet)
        hidden = draw_hidden(np.random.default_rng(k), kind, draft, truth)
        if hidden is None:
            continue
        f = draft.frequency[3::25]
        base = truth.frf(f, draft.sensors, draft.drives)
        heard = np.abs(base) > 1e-3 * np.abs(base).max()
        for a in map(float, np.geomspace(*hidden.bounds, 12)):
            H = hidden.change(truth, a).frf(f, draft.sensors, draft.drives)
            if level(H, base, heard) > 0.3:
                return draft, model, hidden, a, f, H, heard, level(H, base, heard)
    raise AssertionError(kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k for k in (*EFFECTS, *MOUNTED) if k not in NOT_BY_VALUE])
def test_the_right_candidate_with_the_true_parameters_does_what_the_hidden_effect_does(kind):
    draft, model, hidden, a, f, H, heard, change = drawn(kind)
    values = hidden.values(a)
    frf = fem.FRF.from_arrays(
        f, H, "receptance", [s.name for s in draft.sensors], [d.name for d in draft.drives]
    )
    test = Measurement(frf, sensors_of(draft.frame, draft.sensors), sensors_of(draft.frame, draft.drives))
    kinds = KINDS[kind].found_as
    left = []
    for candidate in propose(model, kinds=kinds, test=test):
        names = [p.name for p in candidate.parameters()]
        if set(names) - set(values):
            continue
        effect = candidate.with_values(**{n: values[n] for n in names})
        if same_place(effect, model, hidden.place):
            system = assemble(model.with_effect(effect), reciprocal=False)
            parts = [rows_at(model, draft.frame, group) for group in (draft.sensors, draft.drives)]
            left.append(level(fem.compute_frf(system, f, *parts, "receptance", method="direct").H, H, heard))
    # What is left is the mesh, a loss factor that the model gives to added springs too, and the two sides of
    # a joint as the place of a spring to ground: at most 0.2 of the change; another effect leaves all of it.
    assert left
    assert min(left) < 0.2 * change
