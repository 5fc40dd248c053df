"""``[estimates]`` of a study file: standard deviations of fitted values, and the values before."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from dovetail.file.lines import places_of
from dovetail.file.table import StudyTable
from dovetail.file.toml import rounded, toml_key, toml_value

HEADER = "[estimates]  # of fits: standard deviations, and values before; dovetail export reads them"


@dataclass(frozen=True, slots=True)
class FittedEstimate:
    """What a fit says of a parameter beside its value.

    Attributes
    ----------
    std : float
        Standard deviation, NaN where there is none, as at a bound [``unit``].
    before : float
        Value before the fit; NaN of an effect that was added [``unit``].
    outside : bool
        Of the form of a frame: whether it is outside its usual range, so that reports name it.
    unit : str
    """

    std: float = math.nan
    before: float = math.nan
    outside: bool = False
    unit: str = ""


def read_estimates(top: StudyTable) -> dict[str, FittedEstimate]:
    """Read ``[estimates]``, by candidate or effect and parameter: ``"point_mass:beam.mass"``.

    A key without a parameter is a kind of effects, with deviations by the rest of their names.
    """
    out = {}
    for name, t in top.table("estimates").named():
        if "." not in name:
            rest = {key: t.number(key, least=0) for key in t.values}
            out |= {f"{name}{key}": FittedEstimate(std) for key, std in rest.items()}
            t.finish()
            continue
        outside = t.flag("outside", False)
        out[name] = FittedEstimate(t.number("std", math.nan, least=0), t.number("before", math.nan), outside)
        t.finish()
    return out


def estimate_key(effect: str, parameter: str) -> str:
    """Return the name of a parameter in ``[estimates]``: that of a known effect is its candidate's."""
    return f"{effect.removeprefix('known ')}.{parameter}"


def merged(old: Mapping[str, FittedEstimate], new: Mapping[str, FittedEstimate]) -> dict[str, FittedEstimate]:
    """Return the estimates of a later fit, with values before the first one."""
    first = {name: e.before for name, e in old.items() if not math.isnan(e.before)}
    return {**old, **{name: replace(e, before=first.get(name, e.before)) for name, e in new.items()}}


def _kind_and_rest(name: str) -> tuple[str, str]:
    """Return ``point_mass`` and ``:beam.mass`` of ``point_mass:beam.mass``; ``J`` and ``.kx`` of ``J.kx``."""
    at = min(k for k in (name.find(":"), name.find("."), len(name)) if k >= 0)
    return name[:at], name[at:]


def with_estimates(text: str, estimates: Mapping[str, FittedEstimate]) -> str:
    """Return a study's text with a table of estimates in place of the one that it has."""
    places = places_of(text)
    if ("estimates",) in places.headers:
        start, end = places.headers["estimates",]
        end = max([end, *(b for path, (_, b) in places.pairs.items() if path[:-1] == ("estimates",))])
        rest = text[end:].partition("\n")[2].lstrip("\n")  # comments after the last entry stay
        text = f"{text[:start].rstrip()}\n\n{rest}"
    lines, alone = [HEADER], {}
    for name, e in estimates.items():
        if math.isnan(e.before) and not e.outside:
            if math.isfinite(e.std):
                kind, key = _kind_and_rest(name)
                alone.setdefault(kind, {})[key] = rounded(e.std, 3)
            continue
        known = {"before": e.before, "std": rounded(e.std, 3)}
        values = {key: value for key, value in known.items() if math.isfinite(value)}
        values |= {"outside": True} if e.outside else {}
        if values:
            lines.append(
                f"{toml_key(name)} = {toml_value(values)}{f'  # {e.unit}' * (e.unit not in ('', '-'))}"
            )
    # a line for each kind: a frame has a hundred parameters of its form
    lines += [f"{toml_key(kind)} = {toml_value(stds)}" for kind, stds in alone.items()]
    return text.rstrip("\n") + "\n" + ("\n" + "\n".join(lines) + "\n" if len(lines) > 1 else "")
