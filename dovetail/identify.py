"""Identification of a joint of a study: the task and its measurement."""

from dataclasses import replace

from dovetail.file.contents import Study
from dovetail.file.table import StudyError, suggest
from fem.connection_damping import ConnectionDamping
from fem.directions import directions_from
from fem.effects.joint import Joint, Spread
from fem.model import Model
from joint.assembly import JointTask
from updating.measurement.measurement import Measurement


def read_task(study: Study, name: str, directions: str, measurement: str | None = None) -> JointTask:
    """Check the task for a joint.

    Parameters
    ----------
    study : Study
    name : str
        Name of a joint.
    directions : str
        Some of x y z rx ry rz, or all.
    measurement : str, optional
        Name of the measurement; the first unless given.

    Raises
    ------
    StudyError
        For an unknown joint or measurement, or no measurement.
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
    frf = measured.frf.select(lines=measured.frf.frequency > 0, band=study.band)
    model = _with_known(study, name)
    joint = model.effect(name)
    assert isinstance(joint, Joint)
    return JointTask(
        model, joint, wanted, measured.with_frf(frf), study.nuisances, study.damping_std, study.n_lines
    )


def _with_known(study: Study, name: str) -> Model:
    """Return the model whose joint has the stiffness of effects that are known for it.

    Beside a joint that is fitted, they would be taken for a part of all else.

    Raises
    ------
    StudyError
        For known effects of the joint that its matrices cannot say.
    """
    model = study.model
    for effect in study.model.effects:
        if isinstance(effect, ConnectionDamping):
            # the joint's own loss is identified: it must have no other
            model = model.without_effect(effect.name).with_effect(replace(effect, but=(*effect.but, name)))
        if effect.name == name or name not in (getattr(effect, "joint", ""), *getattr(effect, "joints", ())):
            continue
        if isinstance(effect, Spread):
            continue  # it says where the joint acts
        new = effect.merged_into(model.effect(name))
        if new is None:
            msg = (
                f"{study.path}: the effect '{effect.name}' in [[effects]] acts on joint '{name}'; an "
                "identified joint would come on top of it: take it out"
            )
            raise StudyError(msg)
        kept = (e for e in model.effects if e.name != effect.name)
        model = replace(model, effects=tuple(new if e.name == name else e for e in kept))
    return model


def _measurement(study: Study, name: str | None) -> Measurement:
    by_name = {m.name: m for m in study.measurements}
    if not by_name:
        msg = f"{study.path}: it has {study.lack_of_frfs}; the identification needs the measured assembly"
        raise StudyError(msg)
    if name is not None and name not in by_name:
        msg = f"{study.path}: there is no measurement '{name}'; {suggest(name, by_name)}"
        raise StudyError(msg)
    return by_name[name] if name is not None else study.measurements[0]
