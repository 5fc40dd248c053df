"""The converter of independent cases, and the studies that it makes of them."""

import json

import numpy as np
import pytest

from benchmarks.independent.convert import ConversionError, convert, main
from dovetail import load_study
from fem import assemble, solve_modes

CASES = (
    "a-frame-brace-in-tension",
    "a-frame-nothing-missing",
    "cross-beam-joint-soft-about-x",
    "cross-beam-joint-structural-damping",
    "cross-beam-mass-80g-at-U7",
    "cross-beam-nothing-missing",
    "cross-beam-two-sensor-faults",
    "lap-joint-nothing-missing",
    "lap-joint-soft-about-x",
    "portal-tower-nothing-missing",
    "portal-tower-soft-bases",
)


def nominal():
    """Return a small nominal.json of the format: two bars, one on the other, and a joint."""
    rect = {"type": "rect", "b": 0.02, "h": 0.01, "h_direction": [0, 0, 1]}
    return {
        "case": "small",
        "structure": "two bars",
        "units": "SI (m, N, kg, s, Pa, Hz)",
        "material": {"name": "steel", "E": 2.1e11, "nu": 0.3, "rho": 7850.0},
        "points": {"1": [0.0, 0.0, 0.0], "2": [0.6, 0.0, 0.0], "9": [0.3, 0.2, 0.02]},
        "members": [
            {"name": "P", "end1": [0, 0, 0], "end2": [0.6, 0, 0], "section": rect},
            {"name": "Q", "end1": [0.3, -0.2, 0.02], "end2": [0.3, 0.2, 0.02], "section": rect},
        ],
        "joints": [
            {
                "name": "J",
                "type": "elastic, 6 uncoupled springs in global directions, loss factor 0.02",
                "member1": "P",
                "s1": 0.3,
                "member2": "Q",
                "s2": 0.2,
                "location": [0.3, 0, 0.01],
                "k": {"kx": 1e7, "ky": 1e7, "kz": 1e7, "krx": 100.0, "kry": 100.0, "krz": 100.0},
            }
        ],
        "supports": [{"point": 1, "fixed": "all six"}],
        "sensors": [
            {"name": "tip", "node": 2, "direction": "z", "sign": -1, "member": "P", "position": 1.0},
            {"name": "9x", "node": 9, "direction": "x", "sign": 1, "member": "Q", "position": 0.4},
            {"name": "9z", "node": 9, "direction": "z", "sign": 1, "member": "Q", "position": 0.4},
        ],
        "excitations": [{"sensor": "tip"}],
        "frequency": {"start": 1, "stop": 100, "step": 1, "lines": 100},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": 0.004,
        "tolerances": "E +-2 %, rho +-0.5 %, joint data +-3 %, dimensions +-0.5 %",
        "files": [],
    }


def load(tmp_path, data):
    path = tmp_path / "study.toml"
    path.write_text(convert(data, tmp_path, path), encoding="utf-8")
    return load_study(path)


def test_a_joint_to_the_ground_and_welds_beside_joints(tmp_path):
    data = nominal()
    k = {"kx": 1e6, "ky": 1e6, "kz": 1e6, "krx": 50.0, "kry": 50.0, "krz": 50.0}
    foot = {"name": "F", "member1": "P", "s1": 0.6, "member2": "ground", "s2": 0.0, "location": [0.6, 0, 0]}
    data["joints"].append(foot | {"type": data["joints"][0]["type"], "k": k})
    rect = data["members"][0]["section"]
    data["members"].append(
        {
            "name": "R",
            "end1": [0.1, 0, 0],
            "end2": [0.1, 0, 0.3],
            "section": rect | {"h_direction": [1, 0, 0]},
        }
    )
    data["welded"] = (
        "all other connections welded (rigid); a rigid end zone of about 5 mm at every member end"
    )
    model = load(tmp_path, data).model
    assert model.effect("F").location.tolist() == [0.6, 0.0, 0.0]
    text = (tmp_path / "study.toml").read_text(encoding="utf-8")
    assert text.count("rigid1 = 0.005") == 1  # R meets P; the ends of P and Q meet nothing
    assert "rigid2" not in text
    data["joints"][-1]["member2"] = "floor"
    with pytest.raises(ConversionError, match="joint F: there is no member floor"):
        convert(data, tmp_path, tmp_path / "study.toml")


def test_a_small_case(tmp_path):
    study = load(tmp_path, nominal())
    assert [s.name for s in study.sensors] == ["tip", "9x", "9z"]
    np.testing.assert_allclose(study.sensors[0].direction, [0, 0, -1])
    joint = study.model.effect("J")
    assert joint.eta == 0.02
    np.testing.assert_allclose(joint.location, [0.3, 0, 0.01])
    std = {(n.effect, n.parameter): n.std for n in study.nuisances}
    assert (std["frame", "E:steel"], std["frame", "rho:steel"], std["J", "krx"]) == (0.02, 0.005, 0.03)


def test_rigid_zones_are_at_ends_that_meet_and_are_not_held(tmp_path):
    data = nominal()
    data["members"][1] |= {"end1": [0.3, 0, 0], "end2": [0.3, 0.4, 0]}
    data["joints"] = (
        "all beams welded (rigid); all connections welded (rigid): zone of about 4.5 mm at every member end"
    )
    data["sensors"] = data["sensors"][:1]
    members = load(tmp_path, data).model.effect("frame").members
    assert (members["P"].rigid1, members["P"].rigid2) == (0.0, 0.0)
    assert (members["Q"].rigid1, members["Q"].rigid2) == (0.0045, 0.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gravity": 9.81}, "'gravity' is not understood"),
        ({"units": "mm"}, "SI is expected"),
        ({"preload": "2 kN in P"}, "preload"),
        ({"supports": "on foam"}, "supports 'on foam'"),
        ({"supports": [{"point": 1, "fixed": "somewhat"}]}, "'somewhat'"),
        ({"supports": [{"point": 77, "fixed": "all six"}]}, "no point 77"),
        ({"joints": "glued"}, "joints 'glued"),
        ({"joints": "all connections welded (rigid), with a rigid end zone"}, "'N mm at every member end'"),
        ({"tolerances": "E +-2 %, G +-5 %"}, "'G +-5 %'"),
        ({"response": "mobility, (mm/s)/N"}, "mobility"),
        ({"files": ["other.uff"]}, "other.uff"),
        ({"excitations": [{"sensor": "hip"}]}, "no sensor hip"),
        (
            {
                "sensors": [
                    {"name": "s", "node": 2, "direction": "z", "sign": 1, "member": "P", "position": 0.5}
                ]
            },
            "not on P at 0.5",
        ),
        (
            {
                "sensors": [
                    {"name": "s", "node": 9, "direction": "z", "sign": 1, "member": "P", "position": 0.3}
                ]
            },
            "not on P",
        ),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path, change, words):
    with pytest.raises(ConversionError, match=words.replace("(", r"\(").replace("+", r"\+")):
        convert(nominal() | change, tmp_path, tmp_path / "study.toml")


@pytest.mark.parametrize("key", ["type", "section"])
def test_unknown_joints_and_sections_are_refused(tmp_path, key):
    data = nominal()
    if key == "type":
        data["joints"][0]["type"] = "viscous"
    else:
        data["members"][0]["section"]["type"] = "hexagon"
    with pytest.raises(ConversionError, match="not understood"):
        convert(data, tmp_path, tmp_path / "study.toml")


def test_the_command_line(tmp_path, capsys):
    assert main([str(tmp_path / "none.json"), str(tmp_path / "s.toml")]) == 2
    assert "none.json" in capsys.readouterr().err
    (tmp_path / "n.json").write_text(json.dumps(nominal()), encoding="utf-8")
    assert main([str(tmp_path / "n.json"), str(tmp_path / "s.toml")]) == 0
    load_study(tmp_path / "s.toml")


@pytest.mark.shared("data/independent-cases")
@pytest.mark.parametrize("case", CASES)
def test_frequencies_of_the_cases(shared, tmp_path, case):
    """Nominal E and ρ are 1-2 % off and solids have stiff corners: the frequencies agree within 3 %."""
    folder = shared / "data" / "independent-cases"
    assert main([str(folder / case / "nominal.json"), str(tmp_path / "study.toml")]) == 0
    study = load_study(tmp_path / "study.toml")
    found = solve_modes(assemble(study.model), n=12)
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))[case]
    np.testing.assert_allclose(found.frequency[found.n_rigid :][:5], truth["f_first5_no_effect"], rtol=0.03)
    nodes = json.loads((folder / case / "nominal.json").read_text(encoding="utf-8"))["sensors"]
    assert study.measurements[0].frf.outputs == tuple(s["name"] for s in nodes)
