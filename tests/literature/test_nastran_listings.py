"""Decks of which Nastran's listings are public: natural frequencies to the digits that are printed."""

import numpy as np

from fem import assemble, solve_modes
from fem.io import DeckUnits, model_of
from fem.io.nastran_frame import read_nastran_frame

LISTED = (456.6603, 456.6603, 2674.588, 2674.588, 3554.923, 4507.487, 6626.104, 6626.104, 11111.59, 11111.59)
"""Simcenter Nastran, 5 September 2019 version, in models/beam_modes of SteveDoyle2/pyNastran [Hz]."""


def test_a_stocky_cantilever_of_cbar_and_cbeam_with_a_body(tmp_path):
    """Ten bars of a rod of radius 1 and length 10, the last one a CBEAM, and a body at the tip.

    Nastran's lumped mass has inertia of torsion in CBEAM alone, and no rotary inertia of bending; the shear
    coefficient of a ROD is 0.9. With 6 (1 + ν) / (7 + 6 ν) the highest frequencies are 0.3 % lower, and with
    the rotary inertia 3.9 %.
    """
    lines = ["MAT1,2,3.+7,1.1628+7,.29,7.4851-4", "SPC1,1,123456,1"]
    lines += ["PBARL,1,2,,ROD", ",1.", "PBEAML,3,2,,ROD", ",1."]
    lines += ["CONM2,21,11,,2.59-3", ",2.59-3,,2.59-3,,,2.59-3"]
    lines += [f"GRID,{k},,{k - 1}.,0.,0." for k in range(1, 12)]
    lines += [f"CBAR,{k},1,{k},{k + 1},0.,1.,0." for k in range(1, 10)]
    lines += ["CBEAM,10,3,10,11,0.,1.,0."]
    path = tmp_path / "cantilever.bdf"
    path.write_text("\n".join(lines) + "\n")
    modes = solve_modes(assemble(model_of(read_nastran_frame(path, DeckUnits()))), 10)
    np.testing.assert_allclose(modes.frequency, LISTED, rtol=1e-6)
