"""The cases of solid elements: bars vibrate as closed forms say, and a case becomes a study that fits."""

import json

import numpy as np
import pytest

from benchmarks.independent.convert import convert
from dovetail import load_study
from tests.peers.interpreter import run_peers
from tests.studies import fit_problem
from updating import assessed_fit

pytestmark = [pytest.mark.peer, pytest.mark.slow]

DRIVER = """
import json
import numpy as np
from benchmarks.independent import bodies, solids
bar = bodies.Bar((0.0, 0.0, 0.0), "y", 1.0, 0.03, 0.01)
solid = bodies.bar_alone("B", bar, solids.Hidden())
about = np.array([0.0, 0.5, 0.02])
ends = np.hstack([solid.point("B", 0.0), solid.patch("B", 0.5, about)])
squares, V = solid.reduced(ends, solids.N_MODES, free=True)
weights = V.T @ (solid.M @ V)
rigid = np.zeros((len(solid.direction), 3))
rigid[np.arange(len(rigid)), solid.direction] = 1.0
turn = np.cross([0.0, 0.0, 1.0], solid.places.T - about)  # about z at the patch's point
moved = turn[np.arange(len(turn)), solid.direction]
gate = bodies.welded(solids.STRUCTURES["gate"], solids.Hidden())
along_x = (gate.direction == 0).astype(float)
table = bodies.welded(solids.STRUCTURES["table"], solids.Hidden(weaker={"X1": (0.1, 0.14, 0.5)}))
feet = len(table.direction) - table.hold(solids.STRUCTURES["table"], set()).shape[1]
g, friction = -2e-4 - 1e-4j, lambda a: solids.LAWS["friction"](a, 3.0)
cubic = lambda a: solids.LAWS["cubic"](a, 1e9)
grid = (np.arange(4000) + 0.5) * 2 * np.pi / 4000
moved_by = 0.7e-3 * np.sin(grid)
beyond = 5e4 * np.sign(moved_by) * np.maximum(np.abs(moved_by) - 0.4e-3, 0.0)
omega, pair = np.array([100.0, 2000.0]), {("J", "rx", "ry"): 0.6}
cross = solids.STRUCTURES["cross"]
whole = lambda *place: np.eye(6)
rotor = solids.Hidden(rotors=(("U", 0.8, (0.0, 0.0, 1.0), 0.3),))
((_, C),) = solids.attachments(cross, rotor, omega, whole)
Z = solids.joint_stiffness("J", cross, solids.Hidden(couplings=pair), omega)
print(json.dumps({
    "sliding": solids.amplitudes(friction, 1e-3, g),
    "held": solids.amplitudes(friction, 5e-4, g),
    "leaning": [abs(a * abs(1 + cubic(a) * g) / 1e-4 - 1) for a in solids.amplitudes(cubic, 1e-4, g)],
    "gap": [float(solids.gap(0.7e-3, 5e4, 0.4e-3)), float((beyond * np.sin(grid)).mean() * 2 / 0.7e-3)],
    "rotor": (C[1] / 2000j).real.tolist(),
    "coupled": float(Z[0, 3, 4].real),
    "frequency": (np.sqrt(squares) / (2 * np.pi)).tolist(),
    "orthonormal": float(np.abs(weights - np.eye(len(weights))).max()),
    "mass": float(rigid[:, 0] @ (solid.M @ rigid[:, 0])),
    "patch": (ends[:, 3:].T @ moved).tolist(),
    "gate": float(along_x @ (gate.M @ along_x)),
    "feet": feet,
}))
"""


@pytest.fixture(scope="module")
def bar():
    return json.loads(run_peers("-c", DRIVER).stdout)


def test_a_bar_of_solids_has_the_frequencies_of_a_slender_beam(bar):
    E, rho, length = 210e9, 7850.0, 1.0
    f = np.array(bar["frequency"])
    assert np.abs(f[:6]).max() < 0.1
    for h in (0.01, 0.03):  # free ends, Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1
        expected = 4.730041**2 / (2 * np.pi * length**2) * np.sqrt(E * h**2 / 12 / rho)
        assert np.abs(f / expected - 1).min() < 0.005
    assert np.abs(f / (np.sqrt(E / rho) / (2 * length)) - 1).min() < 0.001
    # torsion: J = 0.26332 b h³ for sides of 3 to 1, Timoshenko & Goodier, Theory of Elasticity, section 109
    polar, J = 0.03 * 0.01 * (0.03**2 + 0.01**2) / 12, 0.26332 * 0.03 * 0.01**3
    torsion = np.sqrt(E / 2.6 * J / (rho * polar)) / (2 * length)
    assert np.abs(f / torsion - 1).min() < 0.004
    assert bar["orthonormal"] < 1e-8
    assert bar["mass"] == pytest.approx(rho * 0.03 * 0.01 * length)


def test_a_joint_takes_the_mean_motion_of_what_it_holds(bar):
    assert bar["patch"] == pytest.approx([0, 0, 0, 0, 0, 1], abs=1e-12)


def test_a_joint_couples_two_directions_and_a_rotor_two_turns(bar):
    assert bar["coupled"] == pytest.approx(0.6 * 3e3)
    assert np.array(bar["rotor"]) == pytest.approx(0.3 * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]))


def test_steady_motion_where_stiffness_depends_on_amplitude(bar):
    """Dry friction slides with a² - 2 c a Im g + c² |g|² = free², c = 4F/π, and holds what is below c |g|."""
    c, g, free = 12 / np.pi, -2e-4 - 1e-4j, 1e-3
    a = c * g.imag + np.sqrt((c * g.imag) ** 2 + free**2 - (c * abs(g)) ** 2)
    assert bar["sliding"] == pytest.approx([a])
    assert bar["held"] == []
    assert max(bar["leaning"]) < 1e-9
    assert bar["gap"][0] == pytest.approx(bar["gap"][1], rel=1e-5)


def test_welded_bars_are_one_body(bar):
    """What lies in two bars counts once; a foot has 5 x 5 nodes of 3 unknowns."""
    bars = ((0.6, 0.02, 0.02), (0.52, 0.02, 0.02), (0.4, 0.02, 0.012), (0.4, 0.02, 0.02))
    twice = 2 * 0.01 * 0.02 * (0.012 + 0.02)
    assert bar["gate"] == pytest.approx(7850.0 * (sum(a * b * c for a, b, c in bars) - twice))
    assert bar["feet"] == 4 * 25 * 3


@pytest.mark.slow
def test_a_case_becomes_a_study_whose_model_comes_near(tmp_path):
    run_peers("-m", "benchmarks.independent.solids", str(tmp_path), "cross-nothing")
    assert json.loads((tmp_path / "truth.json").read_text(encoding="utf-8")).keys() == {"cross-nothing"}
    case, study = tmp_path / "cross-nothing", tmp_path / "study.toml"
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    study.write_text(convert(nominal, case, study), encoding="utf-8")
    problem = fit_problem(load_study(study))
    fitted = assessed_fit(problem)
    assert fitted.fit_db < 2.0  # 1.5, most of it near 3 kHz
    low = problem.lines_up_to(500.0, 100)
    assert problem.level(problem.log_ratio(fitted, low), low) < 0.2
