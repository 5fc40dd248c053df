"""Estimation, identification, correlation and updating take bare arrays, in the documentation's own lines."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import fem
from updating import (
    IdentificationError,
    band_error,
    cross_orthogonality,
    estimate_frf,
    fdac,
    frac,
    identify_modes,
    mac,
    orthogonality,
)

DOCS = Path(__file__).parents[2] / "docs"
RATE = 1024.0


def lines_of(page):
    """Return the blocks of Python of a page that begins with bare arrays."""
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def run(code, **names):
    statements = [s for s in ast.parse(code).body if not isinstance(s, ast.ImportFrom)]
    assert len(statements) == 3
    exec(code, names)
    return names


@pytest.fixture(scope="module")
def record():
    """Two resonators of 40 and 90 Hz, 1 and 1.2 %, driven by noise; the recursion has exactly their poles."""
    force = np.random.default_rng(0).standard_normal(2**17)
    out = []
    for f, zeta in ((40.0, 0.010), (90.0, 0.012)):
        pole = np.exp(2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)) / RATE)
        out.append(lfilter([0.0, pole.imag], [1.0, -2 * pole.real, abs(pole) ** 2], force))
    return force, np.stack([out[0] + out[1], out[0] - out[1], 0.5 * out[0] + 0.2 * out[1]], axis=1)


def test_time_data_become_modes_in_three_lines(record, capsys):
    code = lines_of("modal-identification.md")[0]
    with pytest.warns(UserWarning, match="Modal masses are unknown"):
        found = run(code, force=record[0], response=record[1], sample_rate=RATE)["found"]
    # leakage of blocks of 4 s moves resonances by less than a tenth of a line; deviations leave it out
    assert np.abs(found.modes.frequency - [40, 90]).max() < 0.1 * RATE / 4096
    assert found.modes.zeta == pytest.approx([0.010, 0.012], rel=0.05)
    assert "leakage" in found.choices[-1]
    assert "39.98" in capsys.readouterr().out


def superposition(n_in=1):
    f = np.arange(1.0, 60.0, 0.1)
    shapes = np.array([[1.0, 0.5], [0.4, -1.0], [-0.3, 0.8]])
    w, wr, z = 2 * np.pi * f[:, None], 2 * np.pi * np.array([10.0, 25.0]), np.array([0.01, 0.02])
    modal = -(w**2) / (wr**2 - w**2 + 2j * z * wr * w)
    return f, np.einsum("fr,or,ir->foi", modal, shapes, shapes[:n_in]), shapes


@pytest.mark.parametrize("form", ["one force", "one response", "two forces"])
def test_frfs_of_all_natural_forms_become_modes_in_three_lines(form):
    f, H, shapes = superposition(2 if form == "two forces" else 1)
    H = {"one force": H[:, :, 0], "one response": H[:, 0, 0], "two forces": H}[form]
    names = run(lines_of("modal-identification.md")[1], frequency=f, H=H)
    assert names["f"] == pytest.approx([10, 25], rel=1e-6)
    assert names["zeta"] == pytest.approx([0.01, 0.02], rel=1e-4)
    assert np.abs(names["shapes"]) == pytest.approx(np.abs(shapes[: len(names["shapes"])]), rel=1e-3)


def test_deviations_of_one_force_have_the_shape_of_its_frfs():
    f, H, _ = superposition()
    H = (
        H[:, :, 0]
        + 1e-3 * np.random.default_rng(1).standard_normal((2, *H.shape[:2])).T.swapaxes(0, 1)[..., 0]
    )
    std = np.full(H.shape, 1e-3)
    flat = identify_modes(f, H, std=std, driving=[(0, 0)])
    whole = identify_modes(f, H[:, :, None], std=std[:, :, None], driving=[("out1", "in1")])
    np.testing.assert_array_equal(flat.modes.frequency, whole.modes.frequency)


def test_an_estimate_brings_its_deviations_and_the_decay_of_its_window():
    """One block that begins with a unit hit, and a window of which 1 % is left at its end."""
    n, pole = 4096, np.exp(2 * np.pi * 40 * (-0.01 + 1j * np.sqrt(1 - 0.01**2)) / RATE)
    hit = np.zeros((3, n, 1))
    hit[:, 0] = 1.0
    response = lfilter([0.0, pole.imag], [1.0, -2 * pole.real, abs(pole) ** 2], hit, axis=1)
    estimate = estimate_frf(hit, response, RATE, window="exponential", band=(20, 80), kind="receptance")
    assert estimate.added_decay == pytest.approx(np.log(100) * RATE / n)
    with pytest.warns(UserWarning, match="Modal masses are unknown"):
        found = identify_modes(estimate)
    with pytest.warns(UserWarning, match="Modal masses are unknown"):
        kept = identify_modes(estimate, added_decay=0.0)
    assert found.modes.zeta == pytest.approx([0.01], rel=1e-3)
    assert kept.modes.zeta == pytest.approx([0.01 + estimate.added_decay / (2 * np.pi * 40)], rel=1e-3)


def test_shapes_and_frfs_are_compared_in_three_lines(capsys):
    f, H, shapes = superposition()
    names = {"phi_measured": shapes, "phi_computed": shapes @ np.diag([2.0, -1.0]), "H_measured": H[::20]}
    names |= {"f_measured": [10.0, 25.0], "f_computed": [10.1, 24.9], "H_computed": 1.1 * H[::20]}
    run(lines_of("correlation.md")[0], **names)
    assert "10.1" in capsys.readouterr().out
    one = H[:, 0, 0]
    assert frac(one, 2 * one) == pytest.approx(1.0)
    assert band_error(f, one, 1.1 * one, 1).relative() == pytest.approx(0.1)
    with pytest.raises(ValueError, match="one response alone has no shape"):
        fdac(one, one)


def test_lumped_masses_may_be_given_as_their_diagonal():
    shapes, m = np.random.default_rng(2).standard_normal((5, 2)), np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(orthogonality(shapes, m), orthogonality(shapes, np.diag(m)))
    with pytest.raises(ValueError, match="or the 5 numbers on its diagonal"):
        cross_orthogonality(shapes, shapes, m[:4])


def test_a_model_is_updated_in_three_lines(capsys):
    """A cantilever of which the modulus is 4 % low: FRFs at two places from bare arrays."""
    mesh = fem.Mesh.from_lines([[0, 0, 0], [1.0, 0, 0]], [[0, 1]], {"beam": [0]}).split(8)
    part = fem.MemberProperties(fem.Material("steel", 200e9, 7850.0), fem.Section.rectangle(0.03, 0.02))
    effects = (fem.Frame(members={"beam": part}), fem.Support(name="foot", point=0))
    model = fem.Model(mesh, effects, fem.Damping.modal(0.01))
    real = model.with_values({("frame", "E:steel"): 208e9})
    places, f = [(1, "z"), (5, "z")], np.arange(5.0, 200.0, 1.0)
    H = fem.compute_frf(fem.assemble(real), f, places, places[:1]).H
    code = lines_of("updating.md")[0].replace("[83.1, 228.9, 448.0]", repr([16.9, 25.2]))
    parameters = [("frame", "E:steel")]
    names = run(code, model=model, parameters=parameters, H=H[:, :, 0], f=f, places=places)
    E = names["updated"]["frame E:steel"]
    assert abs(E.value - 208e9) < E.std
    assert "frame E:steel" in capsys.readouterr().out


def test_what_is_mixed_up_is_refused():
    f, H, shapes = superposition()
    for arguments, error, words in (
        ((H, f), ValueError, "are complex; are they the FRFs"),
        ((f, np.moveaxis(H, 0, -1)), ValueError, r"\(n_freq, n_out\) for one force"),
        ((f,), IdentificationError, "without FRFs"),
    ):
        with pytest.raises(error, match=words):
            identify_modes(*arguments)
    with pytest.raises(IdentificationError, match=r"response 5; the data have out1.*number 0 to 2"):
        identify_modes(f, H, driving=[(5, 0)])
    with pytest.raises(IdentificationError, match="a pair"):
        identify_modes(f, H, driving=["out1"])
    shapes[1, 0] = np.inf
    with pytest.raises(ValueError, match=r"phi_x are infinite, the first at DOF 1, mode 0, from 0"):
        mac(shapes, shapes)
    H[3, 1, 0] = np.inf
    with pytest.raises(ValueError, match=r"1 value\(s\) of H_x .* at line 3, output 1, input 0, from 0"):
        frac(H, H)
