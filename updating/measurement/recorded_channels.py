"""Channels of time data as forces and responses in SI units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fem.analysis.frf import TRANSMISSIBILITY, FRFKind
from fem.array_types import Floats
from fem.io.time_data import TimeData, force_unit, motion_unit
from fem.io.units import size_of
from fem.summary import fields_summary
from updating.measurement.frf_estimation import EstimationError


@dataclass(frozen=True, slots=True, eq=False)
class RecordedChannels:
    """Forces and responses of a record, as :func:`updating.estimate_frf` takes them.

    Attributes
    ----------
    force, response : ndarray (n_samples, n)
        In SI units.
    inputs, outputs : tuple of str
        Labels.
    kind : str
        Of the FRFs.
    notes : tuple of str
        Channels whose units are assumed, or that may be clipped.
    of_motion : bool
        Whether motions are in place of forces.
    """

    force: Floats
    response: Floats
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    kind: str
    notes: tuple[str, ...] = ()
    of_motion: bool = False

    __repr__ = fields_summary


def recorded_channels(
    data: TimeData,
    forces: Sequence[str] | None = None,
    responses: Sequence[str] | None = None,
    *,
    scale: Mapping[str, float] | None = None,
    labels: Mapping[str, str] | None = None,
    kind: str | None = None,
) -> RecordedChannels:
    """Return the forces and responses of a record in SI units, by the units of its channels.

    A motion in place of a force makes FRFs to that motion. They have the kind of those to its acceleration
    (:attr:`fem.io.uff_types.Function.kind`), so two motions of one quantity have that of a transmissibility.

    Parameters
    ----------
    data : TimeData
        Of :func:`fem.io.time_data.read_time_data`.
    forces, responses : sequence of str, optional
        Channels; those in a unit of force, and the rest, unless given.
    scale : mapping of str to float, optional
        Factors of channels to SI units, such as N/V, in place of those of their units.
    labels : mapping of str to str, optional
        Labels of channels in the FRFs; their names unless given.
    kind : str, optional
        ``"receptance"``, ``"mobility"``, ``"accelerance"`` or ``"transmissibility"``; that of the units
        unless given.

    Raises
    ------
    EstimationError
        Without a force or a response, and for units that are none of a force or a motion, or do not fit the
        kind.
    """
    scale, labels = scale or {}, labels or {}
    for name in (*scale, *labels):
        data.channel(name)
    by_unit = [c for c, u in zip(data.channels, data.units, strict=True) if force_unit(u) is not None]
    forces = list(forces) if forces else by_unit
    if not forces:
        listed = ", ".join(f"{c} [{u or '-'}]" for c, u in zip(data.channels, data.units, strict=True))
        msg = f"{data.name}: no channel is in a unit of force; name the forces, of {listed}"
        raise EstimationError(msg)
    responses = list(responses) if responses else [c for c in data.channels if c not in forces]
    if not responses or set(forces) & set(responses):
        msg = (
            f"{data.name}: the forces are {', '.join(forces)}, the responses {', '.join(responses) or 'none'}"
        )
        raise EstimationError(msg)
    notes = list(data.notes)
    kinds: dict[str, FRFKind] = {}
    columns: dict[str, Floats] = {}
    for name in (*forces, *responses):
        at = data.channel(name)
        unit, is_force = data.units[at], name in forces
        motion, force = motion_unit(unit), force_unit(unit)
        if motion is not None:
            kinds[name] = motion[0]
        if not is_force and force is not None and name not in scale:
            msg = (
                f"{data.name}: the response {name} is in '{unit}', a unit of force; name it as a "
                "force, or give its scale, a factor to SI units"
            )
            raise EstimationError(msg)
        known = force if motion is None else motion[1]
        other = size_of(unit)
        if known is None and other is not None and any(other[1]) and name not in scale:
            msg = (
                f"{data.name}: channel {name} is in '{unit}', which is neither a force nor a motion; leave "
                "it out of the forces and responses, or give its scale, a factor to SI units"
            )
            raise EstimationError(msg)
        if name not in scale and known is None:
            of = "SI units" if not is_force or kind == TRANSMISSIBILITY else "N"
            notes.append(
                f"channel {name} of {data.name} has {f'the unit {unit!r}' if unit else 'no unit'} and is "
                f"taken to be in {of}; its scale, a factor to SI units, corrects that"
            )
        if data.full_scale is not None and (np.abs(data.values[:, at]) >= 0.999 * data.full_scale).any():
            notes.append(f"channel {name} of {data.name} reaches the end of its range: it may be clipped")
        columns[name] = scale.get(name, known or 1.0) * data.values[:, at]
    of, to = ({c: kinds.get(c) for c in part} for part in (responses, forces))
    found, of_motion = _kind(data, to, of, scale, kind)
    inputs, outputs = (tuple(labels.get(n, n) for n in part) for part in (forces, responses))
    force, response = (np.column_stack([columns[n] for n in part]) for part in (forces, responses))
    return RecordedChannels(force, response, inputs, outputs, found, tuple(notes), of_motion)


def _kind(
    data: TimeData,
    references: dict[str, FRFKind | None],
    responses: dict[str, FRFKind | None],
    scale: Mapping[str, float],
    kind: str | None,
) -> tuple[str, bool]:
    """Return the kind of the FRFs, and whether their references are motions in place of forces."""
    stated = {c: k for c, k in responses.items() if k is not None and c not in scale}
    if len(set(stated.values())) > 1 and kind is None:
        listed = ", ".join(f"{c} of {k}" for c, k in stated.items())
        msg = f"{data.name}: the responses are of several kinds ({listed}); name responses of one kind"
        raise EstimationError(msg)
    motions = {c: k for c, k in references.items() if k is not None and c not in scale}
    asked = kind == TRANSMISSIBILITY
    if not asked and (not motions or (kind is not None and all(c in scale for c in references))):
        return str(kind or next(iter(stated.values()), FRFKind.ACCELERANCE)), False
    labels = {c: data.units[data.channel(c)] for c in (*references, *responses)}
    of_force = [c for c in references if force_unit(labels[c]) is not None and c not in scale]
    if of_force:
        msg = (
            f"{data.name}: the reference {of_force[0]} is in '{labels[of_force[0]]}', a unit of force; "
            "a transmissibility refers to a motion, and references are either forces or motions"
        )
        raise EstimationError(msg)
    if kind is not None and not asked:
        name = next(iter(motions))
        msg = (
            f"{data.name}: the reference {name} is in '{labels[name]}', a unit of motion, and the kind "
            f"{kind} needs a force [N]; ask for a {TRANSMISSIBILITY}, or give its scale, a factor to N"
        )
        raise EstimationError(msg)
    of, to = (next(iter(k.values()), None) for k in (stated, motions))
    if len(set(motions.values())) > 1:
        listed = ", ".join(motions)
        msg = f"{data.name}: the references are different motions ({listed}); name references of one kind"
        raise EstimationError(msg)
    if of is None or to is None or of == to:
        return str(FRFKind.ACCELERANCE), True
    order = of.derivatives - to.derivatives + 2
    if asked or not 0 <= order <= 2:
        one, other = next(iter(stated)), next(iter(motions))
        msg = (
            f"{data.name}: {one} is in '{labels[one]}' and the reference {other} in '{labels[other]}'; a "
            "transmissibility needs two motions of one kind"
        )
        raise EstimationError(msg)
    return str(tuple(FRFKind)[order]), True
