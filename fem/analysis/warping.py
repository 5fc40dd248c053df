"""Warping of open sections, which St Venant's torsion leaves out: how much stiffer it would make motions."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.elements.frame import Frame
from fem.elements.stretches import stiffness_of_stretch
from fem.model import Contribution, Model
from fem.sections.section import Section

ACCURACY = 0.01
"""Relative error of a load factor or a frequency that is worth a warning [-]."""


def _i_warping(d: Mapping[str, float]) -> float:
    return _flanges(d["tf"], d["b"], d["tf"], d["b"], d["h"])


def _unequal_i_warping(d: Mapping[str, float]) -> float:
    return _flanges(d["tf1"], d["b1"], d["tf2"], d["b2"], d["h"])


def _flanges(t1: float, b1: float, t2: float, b2: float, h: float) -> float:
    one, two = t1 * b1**3 / 12, t2 * b2**3 / 12
    return (h - (t1 + t2) / 2) ** 2 * one * two / (one + two)


def _channel_warping(d: Mapping[str, float]) -> float:
    b, h, tf, tw = d["b"] - d["tw"] / 2, d["h"] - d["tf"], d["tf"], d["tw"]
    return tf * b**3 * h**2 / 12 * (3 * b * tf + 2 * h * tw) / (6 * b * tf + h * tw)


WARPING: Mapping[str, Callable[[Mapping[str, float]], float]] = {
    "i_section": _i_warping,
    "unequal_i_section": _unequal_i_warping,
    "channel": _channel_warping,
}
"""Warping constants Iw of open shapes [m⁶]: Timoshenko and Gere, *Theory of Elastic Stability*, 2nd ed. 1961,
table A-3. Walls that all meet in one point (angles, T, cruciforms) have next to none."""


def warping_constant(section: Section) -> float:
    """Return Iw of a section with one of the shapes of `WARPING` [m⁶]."""
    return WARPING[section.shape](section.dimensions)


def line_work(model: Model, parts: tuple[Contribution, ...], shapes: Floats) -> Floats:
    """Return xᵀ K x of each line on shapes x (n_dof, k), (n_lines, k)."""
    out = np.zeros((model.mesh.n_lines, shapes.shape[1]))
    for c in parts:
        if c.lines is not None and c.K is not None:
            at = shapes[c.dofs]
            np.add.at(out, c.lines, np.einsum("bik,bij,bjk->bk", at, np.real(c.K), at))
    return out


def warping_gains(model: Model, shapes: Floats) -> Iterator[tuple[str, float, Floats]]:
    """Yield members that resist warping, k, and the part by which that raises xᵀKx of each shape at most.

    Warping adds k² = π²E Iw/(G J L²) to the torsion of a half-wave of the member's length L.

    Parameters
    ----------
    model : Model
    shapes : ndarray (n_dof, n)
    """
    frames = model.of_kind(Frame)
    if not any(_resists(frame, m) for frame in frames for m in frame.members):
        return
    (frame,) = frames
    elastic = frame.contribution_of(model, np.arange(model.mesh.n_lines))
    strain = np.maximum(line_work(model, elastic, shapes).sum(axis=0), 1e-300)
    for member in model.mesh.members:
        if not _resists(frame, member):
            continue
        p, length = frame.members[member], model.mesh.member_length(member)
        k2 = np.pi**2 * 2 * (1 + p.material.nu) * warping_constant(p.section) / (p.section.J * length**2)
        ends = np.asarray(0.0), np.asarray(length)
        twist = stiffness_of_stretch(frame, model, member, *ends, (0, 0, 0, 1, 0, 0))
        rows = model.mesh.members[member]
        work = line_work(model, (replace(twist, lines=rows),), shapes).sum(axis=0)
        yield member, float(np.sqrt(k2)), k2 * work / strain


def _resists(frame: Frame, member: str) -> bool:
    return frame.members[member].theory != "bar" and frame.members[member].section.shape in WARPING


def warped_modes(model: Model, modes: Modes) -> tuple[str, ...]:
    """Return a sentence for each member whose warping may raise frequencies by more than `ACCURACY`."""
    elastic = np.arange(modes.n_rigid, modes.n_modes)
    if not elastic.size:
        return ()
    out = []
    for member, k, gain in warping_gains(model, np.real(modes.shapes[:, elastic]).astype(float)):
        rise = np.sqrt(1 + gain) - 1
        seen = elastic[rise > ACCURACY]
        if not seen.size:
            continue
        label = model.of_kind(Frame)[0].members[member].section.label
        which = ", ".join(str(i + 1) for i in seen[:8]) + (" …" if len(seen) > 8 else "")
        out.append(
            f"member '{member}' ({label}) resists warping (k = {k:.2g} for its length), which St Venant's "
            f"torsion leaves out: mode{'' if len(seen) == 1 else 's'} {which} may "
            f"be too low by up to {100 * rise.max():.0f} %"
        )
    return tuple(out)
