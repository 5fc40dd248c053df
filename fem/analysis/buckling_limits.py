"""Influences on a load factor that linear buckling with these elements neglects."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from fem.analysis.warping import ACCURACY, line_work, warping_gains
from fem.array_types import Floats
from fem.effects.prestress import Prestress
from fem.effects.shear_centre import ShearCentre
from fem.elements.frame import Frame
from fem.model import Contribution, Model

if TYPE_CHECKING:
    from fem.analysis.statics import StaticSolution


def limits(
    loaded: Model, solution: "StaticSolution", column: int, factor: float, shape: Floats
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
        *_of_shear_centres(loaded, frame, share),
        *_of_warping(loaded, frame, shape),
        *_of_displacements(solution, column, factor, bent),
        *_of_parts(solution, column),
    )


def _line_work(model: Model, parts: tuple[Contribution, ...], shape: Floats) -> Floats:
    """Return xᵀ K x of each line on a shape x, (n_lines,)."""
    return line_work(model, parts, shape[:, None])[:, 0]


def _of_shear_centres(model: Model, frame: Frame, share: Mapping[str, float]) -> Iterator[str]:
    coupled = {e.member for e in model.of_kind(ShearCentre)}
    for member, part in share.items():
        section = frame.members[member].section
        away = float(np.hypot(*section.shear_centre))
        if part > ACCURACY and away > ACCURACY * np.sqrt(section.A):
            missing = (
                "Wagner's terms are"
                if member in coupled
                else ("Wagner's terms and the coupling of torsion with bending are")
            )
            yield (
                f"member '{member}' ({section.label}) has its shear centre {away:.3g} m from its centroid: "
                f"{missing} left out, and the load factor may be too high or too low"
            )


def _of_warping(model: Model, frame: Frame, shape: Floats) -> Iterator[str]:
    for member, k, gains in warping_gains(model, shape[:, None]):
        if gains[0] > ACCURACY:
            yield (
                f"member '{member}' ({frame.members[member].section.label}) resists warping (k = {k:.2g} for "
                "its length), which St Venant's torsion leaves out: this mode's load factor is too low by up "
                f"to {100 * gains[0]:.0f} %, and one with less twist may come first"
            )


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


def _strained(K: Floats, u: Floats) -> bool:
    """Tell whether motions (b, m) strain matrices (b, m, m) by more than the rounding of uᵀKu."""
    energy = np.einsum("bi,bij,bj->b", u, K, u)
    rounding = K.shape[1] * np.finfo(float).eps * np.einsum("bi,bij,bj->b", abs(u), abs(K), abs(u))
    return bool((energy > rounding).any())
