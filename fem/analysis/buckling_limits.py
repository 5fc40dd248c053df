"""Influences on a load factor that linear buckling with these elements neglects."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.effects.prestress import Prestress
from fem.elements.frame import Frame
from fem.elements.stretches import stiffness_of_stretch
from fem.model import Contribution, Model
from fem.sections.section import Section

if TYPE_CHECKING:
    from fem.analysis.statics import StaticSolution

ACCURACY = 0.01
"""Relative error of a load factor that is worth a warning [-]."""


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


def limits(
    loaded: Model, solution: "StaticSolution", column: int, factor: float, shape: NDArray[np.float64]
) -> tuple[str, ...]:
    """Return a sentence on each thing left out that may change a load factor by more than `ACCURACY`.

    Parameters
    ----------
    loaded : Model
        With the effect ``"prestress"`` of the static solution's column.
    solution : StaticSolution
    column : int
    factor : float
        Load factor [-].
    shape : ndarray (n_dof,)
        Buckling shape.
    """
    stress = loaded.effect("prestress")
    (frame,) = loaded.of_kind(Frame)
    assert isinstance(stress, Prestress)
    work = _line_work(loaded, stress.contribute(loaded), shape)
    alone = _line_work(loaded, stress.axial().contribute(loaded), shape)
    total = max(abs(work).sum(), 1e-300)
    share = {m: abs(work[rows]).sum() / total for m, rows in loaded.mesh.members.items()}
    bent = abs(work - alone).sum() / max((abs(work - alone) + abs(alone)).sum(), 1e-300)
    return (
        *_of_shear_centres(frame, share),
        *_of_warping(loaded, frame, shape),
        *_of_displacements(solution, column, factor, bent),
        *_of_parts(solution, column),
    )


def _line_work(
    model: Model, parts: tuple[Contribution, ...], shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return xᵀ K x of each line on a shape x, (n_lines,)."""
    out = np.zeros(model.mesh.n_lines)
    for c in parts:
        if c.lines is not None and c.K is not None:
            at = shape[c.dofs]
            np.add.at(out, c.lines, np.einsum("bi,bij,bj->b", at, np.real(c.K), at))
    return out


def _of_shear_centres(frame: Frame, share: Mapping[str, float]) -> Iterator[str]:
    for member, part in share.items():
        section = frame.members[member].section
        away = float(np.hypot(*section.shear_centre))
        if part > ACCURACY and away > ACCURACY * np.sqrt(section.A):
            yield (
                f"member '{member}' ({section.label}) has its shear centre {away:.3g} m from its centroid, "
                "which the elements take to be one: Wagner's terms and the coupling of torsion with bending "
                "are left out, and the load factor may be too high or too low"
            )


def _of_warping(model: Model, frame: Frame, shape: NDArray[np.float64]) -> Iterator[str]:
    """Warping adds k² = π²E Iw/(G J L²) to the torsion of a half-wave of the member's length."""
    elastic = frame.contribution_of(model, np.arange(model.mesh.n_lines))
    strain = max(_line_work(model, elastic, shape).sum(), 1e-300)
    for member in model.mesh.members:
        p, length = frame.members[member], model.mesh.member_length(member)
        if p.theory == "bar" or p.section.shape not in WARPING:
            continue
        k2 = np.pi**2 * 2 * (1 + p.material.nu) * _warping(p.section) / (p.section.J * length**2)
        whole = np.asarray(0.0), np.asarray(length)
        twist = stiffness_of_stretch(frame, model, member, *whole, (0, 0, 0, 1, 0, 0))
        rows = model.mesh.members[member]
        gain = k2 * _line_work(model, (replace(twist, lines=rows),), shape).sum() / strain
        if gain > ACCURACY:
            yield (
                f"member '{member}' ({p.section.label}) resists warping (k = {np.sqrt(k2):.2g} for its "
                f"length), which St Venant's torsion leaves out: this mode's load factor is too low by up to "
                f"{100 * gain:.0f} %, and one with less twist may come first"
            )


def _warping(section: Section) -> float:
    return WARPING[section.shape](section.dimensions)


def _of_displacements(solution: "StaticSolution", column: int, factor: float, bent: float) -> Iterator[str]:
    """Bending beforehand changes lateral buckling in its first order, axial forces' in its second."""
    mesh = solution.model.mesh
    points = mesh.points[mesh.lines]
    along = points[:, 1] - points[:, 0]
    u = solution.displacements[: 6 * mesh.n_points, column].reshape(-1, 6)[:, :3][mesh.lines]
    length = np.linalg.norm(along, axis=1)
    turn = np.linalg.norm(np.cross(along, u[:, 1] - u[:, 0]), axis=1) / length**2
    rotation = abs(factor) * float(turn.max())
    error = bent * rotation + rotation**2
    if error > ACCURACY:
        member = mesh.member_of_line()[int(turn.argmax())]
        yield (
            f"at the load factor {factor:.4g} the load alone has turned member '{member}' by "
            f"{rotation:.2g} rad; linear buckling leaves out displacements before it, so that the factor is "
            f"uncertain by about {min(100 * error, 100):.0f} %"
        )


def _of_parts(solution: "StaticSolution", column: int) -> Iterator[str]:
    u = solution.displacements[:, column]
    for part in (e for e in solution.model.effects if e.reduced_part):
        strained = any(
            c.static is not None and _strained(np.real(c.static), u[c.dofs])
            for c in part.contribute(solution.model)
        )
        if strained:
            yield (
                f"the reduced part '{part.name}' carries load, but its matrices say nothing about its "
                "geometric stiffness, which is left out"
            )


def _strained(K: NDArray[np.float64], u: NDArray[np.float64]) -> bool:
    """Tell whether motions (b, m) strain matrices (b, m, m) by more than the rounding of uᵀKu."""
    energy = np.einsum("bi,bij,bj->b", u, K, u)
    rounding = K.shape[1] * np.finfo(float).eps * np.einsum("bi,bij,bj->b", abs(u), abs(K), abs(u))
    return bool((energy > rounding).any())
