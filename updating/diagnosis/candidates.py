"""Candidates: what may be missing from a model."""

from collections.abc import Sequence

from fem.effects import candidate_kinds, effect_classes
from fem.effects.plane import in_plane
from fem.model import Effect, Model, applicable
from updating.measurement.measurement import Measurement, instruments_on


def propose(
    model: Model,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    test: Measurement | None = None,
    *,
    levels: bool = False,
) -> tuple[Effect, ...]:
    """Return all candidates of some kinds (default: all that the program knows) for a model.

    With a measurement there are also those of its instruments: masses of sensors, stingers. Those that
    depend on amplitude come where there are several ``levels`` of force.

    Raises
    ------
    ValueError
        For a kind that does not exist.
    """
    known = candidate_kinds()
    for kind in (*(kinds or ()), *exclude):
        if kind not in known:
            msg = f"there is no candidate kind '{kind}'; allowed are {', '.join(known)}"
            raise ValueError(msg)
    classes = [effect_classes()[kind] for kind in (kinds or known) if kind not in exclude]
    classes = [cls for cls in classes if levels or not cls.amplitude_dependent]
    if test is None:
        found = applicable((e for cls in classes for e in cls.propose(model)), model)
    else:
        instruments = instruments_on(model.mesh, test)
        found = applicable((e for cls in classes for e in cls.propose_for_test(model, instruments)), model)
    return in_plane(model, found)
