"""OpenSees brings a lattice into equilibrium on the displaced structure, and converges to Dovetail's sway."""

import pytest

from benchmarks.second_order import Loaded
from fem import Frame

pytestmark = pytest.mark.peer


def test_opensees_converges_to_the_second_order_sway():
    """Its elements have no geometric stiffness within them: their error falls with their length squared."""
    finest = Loaded.of(2, 2, 3, 16)
    exact = finest.here()[0]
    others = [Loaded.of(2, 2, 3, pieces, finest.force) for pieces in (4, 8)]
    coarse, fine, least = (each.by_opensees()[0] / exact - 1 for each in (*others, finest))
    assert coarse / fine == pytest.approx(4, rel=0.05)
    assert fine / least == pytest.approx(4, rel=0.05)
    # extrapolated to elements of no length, they differ by the strain of the columns, which one counts
    bar = next(iter(finest.model.of_kind(Frame)[0].members.values()))
    strain = finest.force / (bar.material.E * bar.section.A)
    assert abs(4 * least - fine) / 3 < strain
