"""FRFs and the bound of their error, against a solution of every line with the full matrices."""

import numpy as np
import pytest

from fem.effects.frame import Frame, MemberProperties
from fem.effects.joint import Joint
from fem.effects.viscoelastic import Viscoelastic
from fem.frf import compute_frf, dof_vectors
from fem.laws import Zener
from fem.mesh import Mesh
from fem.model import Damping, Model
from fem.modes import solve_modes
from fem.properties import Section
from fem.system import assemble
from tests.frames import FLAT, STEEL

AT = [(1, "x"), (1, "y"), (2, "z"), (3, "rx"), (4, "z"), (4, "ry")]
IN = [(2, "z"), (4, "x")]

DAMPING = {
    "undamped": Damping(),
    "structural": Damping.structural(0.01),
    "rayleigh": Damping.rayleigh(20.0, 1e-5),
    "modal": Damping.modal([0.01, 0.03], [0.0, 500.0]),
}


def frame(seed, *, free, local):
    """Return a frame with random points and sections, soft and stiff dampers, and a viscoelastic element."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.3, 0.3, (5, 3))
    points[:, 0] += np.arange(5)
    lines = np.array([[rng.integers(i), i] for i in range(1, 5)] + [[0, 4]])
    sections = [(FLAT, Section.circle(0.02), Section.tube(0.03, 0.002))[k] for k in rng.integers(0, 3, 5)]
    mesh = Mesh.from_lines(points, lines, {f"m{i}": [i] for i in range(5)}).split(3)
    effects = [Frame(members={f"m{i}": MemberProperties(STEEL, sections[i]) for i in range(5)})]
    if not free:
        effects.append(Joint(name="foot", point1=0, location=points[0], K=np.diag([1e5] * 3 + [1e3] * 3)))
    if local:
        scale = 10.0 ** rng.uniform(-1, 4)
        C = scale * np.diag([1.0, 0, 2.0, 0, 0.05, 0.1])
        K = np.diag([1e6, 1e5, 1e6, 1e3, 1e3, 1e3])
        effects += [
            Joint(name="damper", point1=1, point2=3, location=points[1], C=C),
            Viscoelastic(name="rubber", point1=3, point2=4, location=points[4], K=K, law=Zener(3.0, 1e-3)),
        ]
        if not free:
            effects.append(Joint(name="lossy", point1=2, location=points[2], K=0.1 * K, eta=0.3))
    return Model(mesh, tuple(effects))


def exact(system, f):
    """Return receptances by dense solutions; modal ratios on all modes of the undamped system."""
    out, inn = (system.Q.T @ dof_vectors(system.model, s)[0] for s in (AT, IN))
    more = np.zeros(system.K.shape)
    ratio = system.model.damping.ratio
    if ratio.any():
        modes = solve_modes(system, system.n_free)
        phi = system.M @ (system.Q.T @ modes.shapes)
        more = (phi * (2 * modes.omega * system.model.damping.ratio_at(modes.frequency))) @ phi.T
    H = []
    for w in 2 * np.pi * f:
        Z = system.dynamic_stiffness(w).toarray() + 1j * w * more
        scale = 1 / np.sqrt(abs(Z.diagonal()))
        H.append(out.T @ (scale[:, None] * np.linalg.solve(Z * np.outer(scale, scale), scale[:, None] * inn)))
    return np.array(H)


ROUNDING = 2e-8
"""Of the peak: the highest ω² is 10⁸ times the lowest that is asked for, and a resonance adds its 1/η."""


@pytest.mark.parametrize("method", ["reduced", "modal", "rough"])
@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize("local", [False, True], ids=["plain", "local"])
@pytest.mark.parametrize("free", [False, True], ids=["supported", "free"])
def test_the_bound_holds_and_is_of_use(free, local, damping, method):
    ratios = []
    for seed in range(2):
        system = assemble(frame(seed, free=free, local=local).with_damping(DAMPING[damping]))
        elastic = solve_modes(system, 20).frequency
        elastic = elastic[elastic > 1e-3 * elastic[-1]]
        # not at a resonance, where an undamped response is infinite
        f = np.setdiff1d(np.linspace(0.5 * elastic[0], elastic[8], 40), elastic)
        how = ("reduced", 0.3) if method == "rough" else (method, 1e-5)
        frf = compute_frf(system, f, AT, IN, "receptance", how[0], tolerance=how[1])
        H, accuracy = exact(system, f), frf.accuracy
        error, peak = abs(frf.H - H), abs(H).max(axis=0)
        assert (error <= accuracy.bound + ROUNDING * peak).all()
        if damping != "modal" and method != "modal":
            assert accuracy.reached
            assert (error.max(axis=0) <= how[1] * peak).all()
        seen = error.max(axis=0) > 100 * ROUNDING * peak
        ratios.append(accuracy.bound.max(axis=0)[seen] / error.max(axis=0)[seen])
    if damping != "modal" and (method == "rough" or not local):
        # Schwarz' inequality gives away the angle between what is left of a force and of a response, twice
        # where dampers pass it on.
        assert np.median(np.concatenate([np.ones(1), *ratios])) < (300 if local else 50)
