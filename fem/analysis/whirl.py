"""Whirl of rotors: in which sense, and how round, the axes of rotors turn in a mode."""

import numpy as np

from fem.array_types import Complexes, Floats
from fem.declarations import Role
from fem.model import Model

AT_REST = 1e-12
"""Part of a mode's energy below which its gyroscopic work is rounding: no rotor's axis turns [-]."""

PLANAR = 1e-6
"""Size of the whirl below which its sense is rounding [-]."""


def whirl(model: Model, poles: Complexes, shapes: Complexes) -> Floats:
    """Return the whirl of modes: 1 forward in circles, 0 in a plane, -1 backward in circles.

    The rotations of a rotor's axis describe an ellipse. Its circularity, positive in the sense of the spin,
    is averaged with the weight of the angular momentum: xᴴ(iG)x / xᴴ|G|x, G the skew matrix and |G| its
    absolute value element by element. Frequencies of forward modes grow with the momenta.

    Parameters
    ----------
    model : Model
    poles : ndarray of complex (n,)
        s, with Im s ≥ 0 [rad/s].
    shapes : ndarray of complex (n_dof, n)
        With the modal A of :class:`fem.analysis.complex_modes.ComplexModes`.

    Returns
    -------
    ndarray (n,)
        NaN of modes that tilt no rotor's axis, and of models without rotors.
    """
    n = shapes.shape[1]
    work, most = np.zeros(n), np.zeros(n)
    for effect in model.effects:
        if Role.GYROSCOPIC not in effect.role:
            continue
        for c in effect.contribute(model):
            if c.C is None:
                continue
            values, vectors = np.linalg.eigh(0.5j * (c.C - np.swapaxes(c.C, 1, 2)))
            size = np.abs(np.einsum("bji,bjn->bin", vectors.conj(), shapes[c.dofs])) ** 2
            work += np.einsum("bi,bin->n", values, size)
            most += np.einsum("bi,bin->n", np.abs(values), size)
    turns = most > AT_REST * np.abs(poles)  # modal A of 2i Im s: an energy of about |s|²
    return np.divide(work, most, out=np.full(n, np.nan), where=turns)


def whirl_name(value: float) -> str:
    """Return ``"forward"``, ``"backward"`` or ``"planar"``; an empty string of NaN."""
    if np.isnan(value):
        return ""
    if abs(value) < PLANAR:
        return "planar"
    return "forward" if value > 0 else "backward"
