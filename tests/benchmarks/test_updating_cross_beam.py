"""The two beams of a cross-beam, each measured alone, whose truth is made of solid elements by another code.

Steel of 210 GPa and 7850 kg/m³; the model starts 1.5 % and 0.5 % beside it, as an analyst would.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

import fem
from fem.io import read_uff
from updating.modal_identification import identify_modes
from updating.update import Ending, update

FOLDER = Path(__file__).parents[2] / "examples" / "joint-study"
TRUE = {"frame E:steel": 210e9, "frame rho:steel": 7850.0}
PRIOR = {("frame", "E:steel"): 0.02, ("frame", "rho:steel"): 0.005}
HOLE = {"U": 0.45, "D": 0.25}


def beam_and_data(name):
    """Return the beam's model, its FRFs, and (point, direction) by label."""
    first = {"U": 1, "D": 11}[name]
    at = {f"{first + i}Z+": 0.1 * i for i in range(9)}
    at[{"U": "101Z+", "D": "102Z+"}[name]] = HOLE[name]
    x = sorted(at.values())
    lines = [[i, i + 1] for i in range(9)]
    mesh = fem.Mesh.from_lines([[v, 0, 0] for v in x], lines, {"beam": range(9)}).split(4)
    part = fem.MemberProperties(fem.Material("steel", 206.8e9, 7889.0), fem.Section.rectangle(0.03, 0.01))
    model = fem.Model(mesh, (fem.Frame(members={"beam": part}),), fem.Damping.modal(0.0036))
    frf = read_uff(FOLDER / f"sub_{name}.uff").frf()
    return model, frf, {label: (x.index(v), "z") for label, v in at.items()}


def nearest(model, frequency):
    """Return the model's natural frequencies of bending across z next to measured ones [Hz]."""
    modes = fem.solve_modes(fem.assemble(model), max_frequency=1.1 * frequency[-1])
    z = np.abs(modes.shapes[2::6]).max(axis=0) > np.abs(modes.shapes[1::6]).max(axis=0)
    f = modes.frequency[z & (modes.frequency > 0)]
    return f[np.abs(f[:, None] - frequency).argmin(axis=0)]


@pytest.mark.parametrize("name", ["U", "D"])
def test_frfs_give_moduli_densities_and_frequencies(name):
    model, frf, places = beam_and_data(name)
    result = update(model, PRIOR, frf=frf, outputs=places, inputs=places)
    assert result.ending is Ending.CONVERGED, result.messages
    for parameter, true in TRUE.items():
        low, high = result[parameter].interval(0.95)
        assert low < true < high, result.table()
    measured = identify_modes(frf).modes.frequency
    measured = measured[measured > 50]
    assert len(measured) >= 8
    assert np.abs(nearest(result.model, measured) / measured - 1).max() < 2e-3
    # the truth's damping: ζ = 0.003 (1 + 0.35 sin(2πf/1700 Hz + 0.7))
    for p in result.parameters[2:]:
        f = float(p.name.split()[2])
        assert p.value == pytest.approx(0.003 * (1 + 0.35 * np.sin(2 * np.pi * f / 1700 + 0.7)), rel=0.1)


@pytest.mark.parametrize("name", ["U", "D"])
def test_mode_sensitivities_do_the_same(name):
    model, frf, places = beam_and_data(name)
    found = identify_modes(frf)
    keep = found.modes.frequency > 50
    modes = fem.Modes(
        found.modes.frequency[keep], found.modes.shapes[:, keep], found.modes.zeta[keep], found.modes.labels
    )
    result = update(model, PRIOR, modes=modes, outputs=places, frequency_std=2e-4, damping=True)
    assert result.ending is Ending.CONVERGED, result.messages
    assert (result.pairs.mac > 0.99).all()
    assert np.abs(nearest(result.model, modes.frequency) / modes.frequency - 1).max() < 2e-3
    # frequencies fix E/ρ alone, as well as the model's error of 0.1 % in each lets them
    ratio = np.log(result.values[0] / result.values[1] / (210e9 / 7850))
    C = result.covariance / np.outer(result.values, result.values)
    assert abs(ratio) < norm.ppf(0.975) * np.sqrt(C[0, 0] + C[1, 1] - 2 * C[0, 1])
    assert result.correlation[0, 1] > 0.95
