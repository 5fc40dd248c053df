"""Fresh cases of other codes: the truth agrees with closed forms and a third code; a case is complete."""

import json

import numpy as np
import pytest

from benchmarks.independent.convert import convert
from dovetail import load_study
from tests.peers.interpreter import run_peers
from tests.studies import fit_problem
from updating import assessed_fit

pytestmark = pytest.mark.peer

CANTILEVER = """
import json
from dataclasses import replace
import numpy as np
from benchmarks.independent.bodies import Bar
from benchmarks.independent.foreign.bench import Bench, Hidden
from benchmarks.independent.foreign.structure import connection_of, member_of, read
tframe = read()["tframe"]
given = {"start": [0.0, 0.0, 0.0], "axis": "x", "length": 0.6, "b": 0.03, "h": 0.01, "angle": 35.0}
members = {"A": member_of("A", given, {})}
clamp = {"F": connection_of("F", {"sides": [["A", 0.0]], "held": True}, members)}
alone = {"bodies": (("A",),), "members": members, "connections": clamp}
bar = replace(tframe, sensors=(("A", 0.6, "z"),), excitations=("A1z",), **alone)
bench = Bench(bar)
H = bench.receptances(Hidden(), np.array([0.1]))
print(json.dumps({"f": bench.frequencies(Hidden())[:12].tolist(), "H": float(H[0, 0, 0].real)}))
"""

MAST = """
import json
import numpy as np
from scipy.linalg import eigvalsh
from benchmarks.peers.drive_pynite import compute
from benchmarks.peers.exchange import EULER_BERNOULLI, PeerFrame
from benchmarks.independent.foreign.bench import Bench, Hidden
from benchmarks.independent.foreign.parts import constants
from benchmarks.independent.foreign.structure import E, NU, RHO, read
mast = read()["mast"]
bench = Bench(mast)
(body,) = mast.bodies
part = bench.part(body)
n, lines = len(part.points), part.lines
feet = [part.at[c.sides[0]] for c in mast.supports]
rows = np.array([constants(mast.members[m].section) for m, *_ in lines])
fixed = np.zeros((n, 6), dtype=bool)
fixed[feet] = True
loads = np.zeros((n, 6))
force = {s["name"]: s for s in mast.channels}["M22x"]
loads[part.at[force["member"], force["position"]], 0] = 1.0
same = {"E": E, "G": E / (2 + 2 * NU), "rho": RHO, "ky": 1.0, "kz": 1.0}
third = compute(PeerFrame(
    points=np.array(part.points), lines=np.array([line[2:] for line in lines]),
    local_z=np.array([mast.members[m].axes[2] for m, *_ in lines]),
    **{key: np.full(len(lines), value) for key, value in same.items()},
    **dict(zip(("A", "Iy", "Iz", "J"), rows.T)), fixed=fixed, loads=loads, uniform=np.zeros((len(lines), 3)),
    released=np.zeros((len(lines), 2, 2), dtype=bool), theory=EULER_BERNOULLI, static=True,
))
H = bench.receptances(Hidden(), np.array([0.1]))[0, :, mast.excitations.index("M22x")].real
places = [(part.at[s["member"], s["position"]], "xyz".index(s["direction"])) for s in mast.channels]
moved = [third.displacements[place] for place in places]
mass = Hidden(masses=(("X", 0.25, 0.2),))
free = ~np.repeat(np.isin(np.arange(n), feet), 6)
M = part.M.copy()
for dof in range(6 * part.at["X", 0.25], 6 * part.at["X", 0.25] + 3):
    M[dof, dof] += 0.2
direct = np.sqrt(eigvalsh(part.K[np.ix_(free, free)], M[np.ix_(free, free)])[:20]) / (2 * np.pi)
reduced = bench.frequencies(mass)[:20]
out = {"H": H, "third": np.array(moved), "reduced": reduced, "direct": direct}
print(json.dumps({key: value.tolist() for key, value in out.items()}))
"""


SPOTS = """
import json
import numpy as np
from benchmarks.independent import bodies
from benchmarks.independent.foreign.bench import Bench, Hidden
from benchmarks.independent.foreign.parts import Place
from benchmarks.independent.foreign.real import Instruments, off_axis
from benchmarks.independent.foreign.structure import FRESH, STRUCTURES, read

def moved(x):
    return np.array([0.1, 0.2, 0.3]) + np.cross([1.0, -2.0, 0.5], x.T)

bar = bodies.Bar((0.1, 0.2, 0.0), "x", 0.3, 0.02, 0.012, 35.0)
class Plain:
    E = rho = weaker = {}
    changed = staticmethod(lambda name, bar: bar)
body = bodies.bar_alone("A", bar, Plain)
x = body.places
bent = np.array([x[1] * x[2], x[0] ** 2, x[0] * x[2] ** 2]) + moved(x).T  # what quadratic shapes hold
unknowns = bent[body.direction, np.arange(x.shape[1])]
point = np.array(bar.at(0.1234)) + bar.rotation @ [0.0, 0.0047, -0.0033]
solid = body.spot("A", point).T @ unknowns
a, b, c = point
out = {"solid": solid, "solid_true": moved(point) + [b * c, a**2, a * c**2]}

tower = read(FRESH)["tower"]
bench = Bench(tower)
s, spot = off_axis(tower.members["G1"], 0.26, (0.0031, 0.002, -0.001))
place = Place("G1", s, spot=spot)
part = bench.part(tower.body_of["G1"], Hidden(), bench.cuts([place], Hidden()))
u = np.hstack([moved(np.array(part.points).T), np.tile([1.0, -2.0, 0.5], (len(part.points), 1))]).ravel()
out |= {"beam": part.motion(place).T @ u, "beam_true": moved(np.array(spot))}

mast = read(STRUCTURES)["mast"]  # a body of a sensor, and a driver, against point masses of the bench
bench = Bench(mast)
plain = bench.accelerances(Hidden(), 20)
force, at = mast.excitations[0], {s["name"]: s for s in mast.channels}
member, s = at[force]["member"], at[force]["position"]
masses = {(m, t): 0.01 for m, t, _ in mast.sensors}
zero = {s["name"]: (0.0, 0.0, 0.0) for s in mast.channels}
test = Instruments(offsets=zero, masses=masses, drivers={force: 0.02})
points = tuple((m, t, 0.01) for m, t, _ in mast.sensors) + ((member, s, 0.02),)
H = [bench.accelerances(Hidden(), 20, test=test), bench.accelerances(Hidden(masses=points), 20), plain]
out["masses"] = np.abs(H[0] - H[1]).max() / np.abs(H[1] - H[2]).max()
k = 2e3
axes = [d for d in "xyz" if d != at[force]["direction"]]
springs = Hidden(springs=tuple((member, s, d, k) for d in axes))
test = Instruments(stingers={force: k})
H = [bench.accelerances(Hidden(), 20, test=test), bench.accelerances(springs, 20), plain]
out["stinger"] = np.abs(H[0] - H[1]).max() / np.abs(H[1] - H[2]).max()
print(json.dumps({key: np.asarray(value).tolist() for key, value in out.items()}))
"""

NOTHING = """
import sys
from pathlib import Path
import numpy as np
from benchmarks.independent.casefiles import with_noise, write_files
from benchmarks.independent.foreign.bench import Bench, Hidden
from benchmarks.independent.foreign.structure import FURTHER, nominal_of, read
structure, rng = read(FURTHER)["{name}"], np.random.default_rng([0, 0])
H = with_noise(Bench(structure).accelerances(Hidden()), rng)
write_files(Path("{folder}"), nominal_of("{name}", structure, rng), structure.frequency, H)
"""

EXACT = """
import json
import numpy as np
from types import SimpleNamespace
from benchmarks.independent.foreign.bench import Bench, Hidden
from benchmarks.independent.foreign.structure import {file}, nominal_of, read
structure = read({file})["{name}"]
nominal = nominal_of("{name}", structure, SimpleNamespace(uniform=lambda low, high: 0.0))
frequency = Bench(structure).frequencies(Hidden())
frequency = frequency[frequency < structure.frequency[-1]].tolist()
print(json.dumps(dict(nominal=nominal, frequency=frequency)))
"""


def answer(code):
    lines = run_peers("-c", code).stdout.splitlines()
    return json.loads(next(line for line in lines if line.startswith("{")))


@pytest.mark.slow
def test_a_cantilever_of_solids_agrees_with_its_closed_form():
    """Blevins, table 8-1: β₁L = 1.8751, β₂L = 4.6941; static L³/(3 E I).

    A clamp holds a section's mean motion, so that the bar is longer by a share of its height; one length must
    explain the static deflection and both frequencies. Turning the bar changes nothing.
    """
    out = answer(CANTILEVER)
    E, rho, length, b, h = 210e9, 7850.0, 0.6, 0.03, 0.01
    f = np.array(out["f"])
    longer = (3 * E * b * h**3 / 12 * out["H"]) ** (1 / 3)
    assert 0 < longer - length < 0.2 * h
    for beta in (1.87510407, 4.69409113):
        expected = beta**2 / (2 * np.pi * longer**2) * np.sqrt(E * h**2 / 12 / rho)
        assert np.abs(f / expected - 1).min() < 0.001


def test_the_mast_agrees_with_a_third_code_and_the_reduction_with_full_matrices():
    """PyNite has no shear: members of twenty diameters and more bend 1 % more with it."""
    out = answer(MAST)
    H, third = np.array(out["H"]), np.array(out["third"])
    assert np.abs(H - third).max() < 0.01 * np.abs(third).max()
    np.testing.assert_allclose(out["reduced"], out["direct"], rtol=1e-6)


@pytest.mark.slow
def test_a_case_is_complete_and_its_model_comes_near_the_noise(tmp_path):
    """Beams of another program, joints off by 10 %, E and ρ by 2 %: fitted, no more than noise is left."""
    command = ("-m", "benchmarks.independent.foreign", str(tmp_path), "--structures", "cycle", "--cases", "2")
    run_peers(*command, "--seed", "1")
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    (name,) = (k for k, t in truth.items() if t["sort"] == "nothing")
    case = tmp_path / name
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    study = tmp_path / "study.toml"
    study.write_text(convert(nominal, case, study), encoding="utf-8")
    problem = fit_problem(load_study(study))
    assert assessed_fit(problem).fit_db < 1.3 * problem.data.noise_db  # 0.42 of 0.43 dB
    assert abs(nominal["material"]["E"] / 210e9 - 1) <= 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("name", "left"), [("gantry", 1.3), ("kneed", 1.7)])
def test_the_model_of_a_further_structure_comes_near_the_noise_where_nothing_is_hidden(name, left, tmp_path):
    """Left are 0.57 dB of 0.49, and 0.73 of 0.49; the study states no shear coefficients."""
    run_peers("-c", NOTHING.format(name=name, folder=tmp_path))
    nominal = json.loads((tmp_path / "nominal.json").read_text(encoding="utf-8"))
    study = tmp_path / "study.toml"
    study.write_text(convert(nominal, tmp_path, study), encoding="utf-8")
    problem = fit_problem(load_study(study))
    assert assessed_fit(problem).fit_db < left * problem.data.noise_db


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("LATER", "trestle"),
        ("LATER", "jib"),
        ("LATER", "cage"),
        ("FRESH", "table"),
        ("FRESH", "tower"),
        ("NEWEST", "arch"),
        ("UNSEEN", "barrow"),
        ("UNSEEN", "ironing"),
        ("SEALED", "trolley"),
        ("SEALED", "walker"),
    ],
)
def test_natural_frequencies_of_a_later_structure_agree_where_the_model_is_exact(file, name, tmp_path):
    """The study states no shear coefficients: 0.2 % rms, 0.6 % at most; solids 1.2 to 2.2 % rms."""
    out = answer(EXACT.format(file=file, name=name))
    study = tmp_path / "study.toml"
    measured = out["nominal"] | {"files": []}
    study.write_text(convert(measured, tmp_path, study), encoding="utf-8")
    found = load_study(study).solve_modes(len(out["frequency"])).frequency
    np.testing.assert_allclose(found, out["frequency"], rtol=0.006)


def test_a_test_that_is_not_as_described_acts_as_the_same_masses_springs_and_places():
    """Spots are exact for rigid motion, of solids for all that their shapes hold."""
    out = {key: np.array(value) for key, value in answer(SPOTS).items()}
    np.testing.assert_allclose(out["solid"], out["solid_true"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(out["beam"], out["beam_true"], rtol=0, atol=1e-12)
    assert out["masses"] < 1e-5
    assert out["stinger"] < 1e-5


@pytest.mark.slow
def test_a_real_test_leaves_other_cases_and_what_is_hidden_as_they_are(tmp_path):
    def made(folder, *more):
        arguments = ("--structures", "tower", "--seed", "3", "--cases", "3", *more)
        run_peers("-m", "benchmarks.independent.foreign", str(tmp_path / folder), *arguments)
        truth = json.loads((tmp_path / folder / "truth.json").read_text(encoding="utf-8"))
        return truth, {name: (tmp_path / folder / name / "frf.uff").read_bytes() for name in truth}

    (plain, frfs), (truth, others) = made("plain"), made("real", "--test", "real")
    real = {name for name, t in truth.items() if t["test"] == "real"}
    assert 1 <= len(real) <= 2
    for name, t in truth.items():
        *shown, test = t["shows"]
        assert plain[name].items() <= (t | {"shows": shown}).items()
        assert (frfs[name] != others[name]) == (name in real)
        assert (test["change_db"] > 1) == (name in real)


@pytest.mark.slow
def test_cases_of_modes_are_studies_with_what_their_truth_says(tmp_path):
    command = ("-m", "benchmarks.independent.foreign.modes", str(tmp_path), "--structures", "tower")
    run_peers(*command, "--seed", "3", "--cases", "10")
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    assert 1 <= sum(t["effects"][0]["type"] == "none" for t in truth.values()) <= 3
    assert sum(t["sort"] == "states" for t in truth.values()) == 4
    assert sum(t["shapes"] for t in truth.values()) == 5
    for name, t in truth.items():
        nominal = json.loads((tmp_path / name / "nominal.json").read_text(encoding="utf-8"))
        path = tmp_path / f"{name}.toml"
        path.write_text(convert(nominal, tmp_path / name, path), encoding="utf-8")
        study = load_study(path)
        assert (study.baseline is not None) == (t["sort"] == "states")
        assert 8 <= len(study.modes.modes.frequency) <= 16
        assert bool(study.modes.sensors) == t["shapes"]
        for reading in t["readings"]:
            modes = study.modes if reading["file"] == "modes.csv" else study.baseline
            assert np.isclose(modes.modes.frequency, reading["read_Hz"], rtol=0.02).any()


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["mast", "tower"])
def test_a_seed_makes_the_same_files_and_a_stopped_run_goes_on(structure, tmp_path):
    def made(folder, n):
        command = (
            "-m",
            "benchmarks.independent.foreign",
            str(folder),
            "--structures",
            structure,
            "--seed",
            "3",
        )
        run_peers(*command, "--cases", str(n))
        files = (p for p in folder.rglob("*") if p.is_file())
        return {p.relative_to(folder): p.read_bytes() for p in files}

    once = made(tmp_path / "a", 3)
    made(tmp_path / "b", 1)
    assert made(tmp_path / "b", 3) == once
    assert len(once) == 1 + 3 * 2
