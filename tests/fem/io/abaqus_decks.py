"""Abaqus decks that the tests of :mod:`fem.io.abaqus_frame` share."""

import numpy as np

from fem import assemble, solve_modes
from fem.io import DeckUnits, model_of
from fem.io.abaqus_frame import read_abaqus_frame

E, RHO, L = 2.1e11, 7800.0, 2.0
STEEL = f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{E}, 0.3\n*DENSITY\n{RHO}\n"
RECT = "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.03\n0, 0, -1\n"
CLAMPED = "*BOUNDARY\n1, ENCASTRE\n"


def line(n=10, kind="B33", end=(L, 0.0, 0.0)):
    """Return nodes 1 … n + 1 from the origin to a place, and elements of the set BAR."""
    places = np.linspace(np.zeros(3), end, n + 1).tolist()
    nodes = "".join(f"{k}, {x!r}, {y!r}, {z!r}\n" for k, (x, y, z) in enumerate(places, 1))
    elements = "".join(f"{k}, {k}, {k + 1}\n" for k in range(1, n + 1))
    return f"*NODE\n{nodes}*ELEMENT, TYPE={kind}, ELSET=BAR\n{elements}"


def deck_of(folder, text, units=None):
    """Return the deck of a text."""
    path = folder / "a.inp"
    path.write_text(text)
    return read_abaqus_frame(path, units or DeckUnits())


def frequencies(folder, text, n=4, units=None, size=None):
    """Return natural frequencies of a text's model [Hz]."""
    model = model_of(deck_of(folder, text, units))
    if size is not None:
        model = model.with_mesh(model.mesh.refined(size))
    return solve_modes(assemble(model), n).frequency


def cantilever(k, I, A, length=L):
    """Return the k-th bending frequency of a slender cantilever [Hz]."""
    root = (1.875104069, 4.694091133, 7.854757438)[k]
    return (root / length) ** 2 * np.sqrt(E * I / (RHO * A)) / (2 * np.pi)
