"""Effects that were found, put into the study file: the same model comes back."""

import numpy as np
import pytest

from dovetail import StudyError
from dovetail.file import effect_table
from fem import FRF, Environment, parameter_values, sum_contributions
from fem.effects import candidate_kinds
from tests.frames import STUDY
from tests.studies import study_from
from updating import Measurement, propose

JOINTED = (
    STUDY.replace(
        "[damping]",
        """[[joints]]
name = "bolt"
point1 = "tip"
point2 = "lug"
k = { kx = 1e6, ky = 2e6, kz = 3e6, krx = 500, kry = 600, krz = 700 }

[[joints]]
name = "pin"
point1 = "lug"
rigid = "x ry"

[damping]""",
    )
    .replace("[points]", "[points]\nlug = [0.4, 0, 0.51]\nend = [0.6, 0, 0.51]")
    .replace(
        "[materials.steel]",
        """[members.lug]
from = "lug"
to = "end"
material = "steel"
section = { shape = "channel", b = 0.03, h = 0.03, tf = 0.003, tw = 0.003 }
elements = 3

[materials.steel]""",
    )
)


def loaded(folder, text):
    return study_from(folder, text)


def candidates(study):
    names = [[s.name for s in group] for group in (study.sensors, study.excitations)]
    frf = FRF.from_arrays([1.0], np.ones((1, *map(len, names))), "receptance", *names)
    model = study.model.in_environment(*Environment)
    return propose(model, test=Measurement(frf, study.sensors, study.excitations), levels=True)


@pytest.mark.usefixtures("all_digits")
def test_every_kind_comes_back_from_a_study_file(tmp_path):
    study = loaded(tmp_path, JOINTED)
    first = {}
    for effect in candidates(study):
        first.setdefault(effect.kind, effect)
    # its joints tie members end to end, and none of them is a foot
    assert set(first) == set(candidate_kinds()) - {"joint_patch", "foot_shift"}
    changed = []
    for effect in first.values():
        values = parameter_values(effect)
        for p in effect.parameters():
            size = abs(p.value) or 0.01 * min(p.upper, 1.0)
            values[p.name] = float(np.clip(p.value + 0.1234567890123 * size, p.lower, p.upper))
        changed.append(effect.with_values(**values))
    again = loaded(tmp_path, JOINTED + "\n".join(effect_table(e, e.name) for e in changed))
    for effect in changed:
        back = again.model.effect(f"known {effect.name}")
        assert back.parameters() == effect.parameters()
        assert back.released() == effect.released()
        for X, Y in zip(
            *(sum_contributions(tuple(e.contribute(study.model)), study.model.n_dof) for e in (effect, back)),
            strict=True,
        ):
            assert (X != Y).nnz == 0
    # the search may propose all of them once more
    names = {e.name for e in candidates(again)}
    assert names.isdisjoint({e.name for e in again.model.effects})


def test_an_infinite_stiffness_is_rigid(tmp_path):
    study = loaded(tmp_path, f'{STUDY}\n[[effects]]\ncandidate = "crack:post.ry"\nstiffness = inf\n')
    assert study.model.effect("known crack:post.ry").parameters()[0].value == 0.0


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('candidate = "crak:post.ry"', "no kind of effect 'crak'; did you mean 'crack'"),
        ('candidate = "crack:post.rx"', "no candidate 'crack:post.rx'; the nearest are crack:post.r"),
        ('candidate = "joint_mass:bolt"', "no candidate 'joint_mass:bolt', nor another of this kind"),
        ('candidate = "crack:post.ry"\ncompliance = -1', "-1 rad/(N·m) is not between 0 and"),
        ('candidate = "crack:post.ry"\ncompliance = "soft"', "compliance"),
        ('candidate = "member_density:post"\nchange = -3', "change: -3 is not between -"),
        ('candidate = "crack:post.ry"\ndepth = 1', "depth: unknown key"),
        ('candidate = "crack:post.ry"\nname = "frame"', "two effects 'frame'"),
        ('candidate = "member_density:post"\nchange = inf', "change: inf is not allowed; a finite number"),
        ('candidate = "crack:post.ry"\ncompliance = inf', "compliance: inf is not allowed; a finite number"),
        ('candidate = "crack:post.ry"\nstiffness = nan', "stiffness: nan is not allowed; a finite number"),
        ("compliance = 1", "candidate"),
    ],
)
def test_entries_that_cannot_be_meant(tmp_path, entry, message):
    with pytest.raises(StudyError) as caught:
        loaded(tmp_path, f"{STUDY}\n[[effects]]\n{entry}\n")
    assert message in str(caught.value)
