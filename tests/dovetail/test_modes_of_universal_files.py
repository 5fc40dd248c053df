"""Modes and nodes in universal files that pyuff writes, as a study reads them: shapes in closed form."""

import json

import numpy as np
import pytest
import pyuff

from dovetail import StudyError, load_study, main
from tests.studies import study_file

E, RHO, B, H, L = 70e9, 2700.0, 0.03, 0.01, 1.0
STUDY = """
[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.0]

[members.beam]
from = "foot"
to = "tip"
theory = "euler-bernoulli"
orientation = "x"

[materials.aluminium]
E = 70e9
rho = 2700.0

[sections.bar]
shape = "rectangle"
b = 0.03
h = 0.01

[[supports]]
point = "foot"

[modes]
file = "modes.uff"
"""
NODES = np.arange(101, 107)
HEIGHTS = np.array([0.15, 0.3, 0.45, 0.6, 0.8, 1.0])  # [m]
ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382])  # of cos x cosh x = -1
FREQUENCY = ROOTS**2 / (2 * np.pi * L**2) * np.sqrt(E * H**2 / 12 / RHO)
ZETA = np.array([0.004, 0.005, 0.006])


def shapes():
    """Return the shapes of a clamped and free Euler-Bernoulli beam at the nodes, complex and unscaled."""
    x, a = np.outer(HEIGHTS, ROOTS / L), (np.cosh(ROOTS) + np.cos(ROOTS)) / (np.sinh(ROOTS) + np.sin(ROOTS))
    phi = np.cosh(x) - np.cos(x) - a * (np.sinh(x) - np.sin(x))
    return phi * np.array([3.0, 0.02, 40.0]) * np.exp(1j * np.array([0.4, -2.0, 1.1]))


def nodes(dataset, length):
    """Return a dataset of nodes in a unit of which ``length`` are a metre."""
    ones = np.ones(len(NODES), dtype=int)
    make = pyuff.prepare_15 if dataset == 15 else pyuff.prepare_2411
    zero = 0.0 * HEIGHTS
    return make(node_nums=NODES, def_cs=ones, disp_cs=ones, color=ones, x=zero, y=zero, z=length * HEIGHTS)


def units(length):
    """Return dataset 164."""
    return pyuff.prepare_164(
        units_code=9,
        units_description="own",
        temp_mode=1,
        length=length,
        force=1.0,
        temp=1.0,
        temp_offset=0.0,
    )


def mode(k, dataset):
    """Return a complex mode, the second one without values at node 103."""
    keep = NODES != 103 if k == 1 else np.ones(len(NODES), dtype=bool)
    phi, zero = shapes()[keep, k], np.zeros(keep.sum(), dtype=complex)
    omega = 2 * np.pi * FREQUENCY[k]
    pole = omega * (-ZETA[k] + 1j * np.sqrt(1 - ZETA[k] ** 2))
    lines = {f"id{i}": "NONE" for i in range(1, 6)}
    if dataset == 55:
        return pyuff.prepare_55(
            **lines,
            model_type=1,
            analysis_type=3,
            data_ch=2,
            spec_data_type=8,
            data_type=5,
            n_data_per_node=3,
            r1=phi,
            r2=zero,
            r3=zero,
            node_nums=NODES[keep],
            load_case=1,
            mode_n=k + 1,
            eig=complex(pole),
            modal_a=0j,
            modal_b=0j,
        )
    records = {
        10: [1, 0, 1, 0, 1, k + 1, 0, 0],
        11: [0] * 8,
        12: [0.0] * 6,
        13: [pole.real, pole.imag, *[0.0] * 4],
    }
    fields = {f"record{r}_field{i}": v for r, row in records.items() for i, v in enumerate(row, 1)}
    return {
        **lines,
        **fields,
        "type": 2414,
        "analysis_dataset_label": k + 1,
        "analysis_dataset_name": "mode",
        "dataset_location": 1,
        "model_type": 1,
        "analysis_type": 3,
        "data_characteristic": 2,
        "result_type": 8,
        "data_type": 5,
        "number_of_data_values_for_the_data_component": 3,
        "node_nums": NODES[keep],
        "data_at_node": [np.array([v.real, v.imag, 0, 0, 0, 0]) for v in phi],
    }


def write(folder, *sets):
    path = study_file(folder, STUDY)
    pyuff.UFF(str(folder / "modes.uff")).write_sets(list(sets), "overwrite")
    return path


@pytest.mark.parametrize("of_nodes", [15, 2411])
@pytest.mark.parametrize("of_shapes", [55, 2414])
@pytest.mark.parametrize("length", [1.0, 1000.0])
def test_complex_shapes_with_gaps_and_their_nodes_are_read(tmp_path, of_nodes, of_shapes, length):
    path = write(tmp_path, units(length), nodes(of_nodes, length), *(mode(k, of_shapes) for k in range(3)))
    assert main(["compare", str(path), "--json", str(tmp_path / "c.json"), "--quiet"]) == 0
    rows = json.loads((tmp_path / "c.json").read_text())["modes"]
    assert [r["measured_Hz"] for r in rows] == pytest.approx(FREQUENCY, rel=2e-6)  # five digits of a pole
    assert min(r["mac"] for r in rows) > 1 - 1e-6
    study = load_study(path)
    assert study.modes is not None
    mesh = study.model.mesh
    h = np.linalg.norm(np.diff(mesh.points[mesh.lines], axis=1), axis=-1).max()
    error = np.array([r["computed_Hz"] for r in rows]) / FREQUENCY - 1
    assert (error > -1e-9).all()
    assert (error < (ROOTS * h / L) ** 4 / 1440).all()  # cubic elements
    assert study.modes.modes.zeta == pytest.approx(ZETA, rel=1e-4)
    assert any("no values at node 103" in note for note in study.measured_notes)


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (
            [nodes(2411, 1.0)],
            r"no mode shapes .* it holds 6 points \(mode shapes are in datasets 55 and 2414\)",
        ),
        ([mode(0, 55)], r"no coordinates of node 101 \(dataset 15 or 2411\); give \[\[sensors\]\]"),
    ],
)
def test_a_missing_dataset_is_named_in_a_line(tmp_path, sets, words):
    with pytest.raises(StudyError, match=words) as refused:
        load_study(write(tmp_path, *sets))
    assert "\n" not in str(refused.value)


def test_a_file_of_another_kind_is_named_with_those_allowed(tmp_path):
    path = write(tmp_path, mode(0, 55))
    path.write_text(STUDY.replace("modes.uff", "study.toml"))
    with pytest.raises(StudyError, match=r"'study.toml' is not allowed; a file of the kind .uff, .* .csv"):
        load_study(path)
