"""Pictures of an updating show what they should."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import fem
from fem.effects import MemberStiffness
from tests.frames import portal
from updating import UpdateSettings, update
from viz import plot_convergence, plot_correlation, plot_parameters, style


@pytest.fixture(scope="module")
def updated():
    model = portal(0.1)
    changes = [MemberStiffness(name=f"dE {m}", member=m, change=0.0) for m in model.mesh.members]
    model = model.with_effect(*changes)
    places = [(p, d) for p in range(4, model.mesh.n_points, 2) for d in "xyz"]
    truth = model.with_values({("dE left", "change"): 0.1, ("frame", "E:steel"): 200e9})
    modes = fem.solve_modes(fem.assemble(truth), n=6)
    rows = [6 * p + "xyz".index(d) for p, d in places]
    parameters = {("dE left", "change"): 0.2, ("frame", "E:steel"): 0.1, ("frame", "rho:steel"): 1e-5}
    return update(
        model,
        parameters,
        frequency=modes.frequency,
        shapes=modes.shapes[rows],
        outputs=places,
        settings=UpdateSettings(regularisation="tikhonov"),
    )


def test_convergence_draws_every_parameter_over_the_steps(updated):
    figure = plot_convergence(updated)
    above, below = figure.axes
    assert {line.get_label() for line in above.lines} >= {"frequencies [%]", "1 - MAC [%]"}
    drawn = {line.get_label(): line.get_xydata() for line in below.lines}
    for name in updated.names:
        assert len(drawn[name]) == len(updated.path)
    np.testing.assert_allclose(
        drawn["frame E:steel"][-1, 1], 100 * (updated["frame E:steel"].value / 210e9 - 1)
    )
    with pytest.raises(KeyError, match="nothing named"):
        plot_convergence(updated, ["frame G"])


def test_parameters_have_a_row_each_with_value_and_deviation(updated, tmp_path):
    figure = plot_parameters(updated, "portal")
    (ax,) = figure.axes
    assert [t.get_text() for t in ax.get_yticklabels()] == list(updated.names)
    words = [t.get_text() for t in ax.texts]
    assert any(w.startswith(f"{updated['frame E:steel'].value:.5g} ±") for w in words)
    assert style.save(figure, tmp_path / "p.png").stat().st_size > 5000


def test_correlation_shows_the_matrix(updated):
    ax = plot_correlation(updated).axes[0]
    np.testing.assert_allclose(ax.images[0].get_array(), updated.correlation)


def test_a_png_is_drawn_once_with_the_layout_that_savefig_gives_it(monkeypatch):
    with style.look():
        figure = style.new_figure(3.0, 2.0)
        figure.subplots().set(xlabel="frequency [Hz]", ylabel="error [dB]")
        buffer = BytesIO()
        figure.savefig(buffer, dpi=80)  # draws twice
    expected = np.asarray(Image.open(buffer).convert("RGB"), dtype=float)
    times, draw = [], Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda self, to: (times.append(to), draw(self, to)))
    drawn = np.asarray(Image.open(BytesIO(style.figure_png(figure, 80))), dtype=float)
    assert len(times) == 1
    np.testing.assert_allclose(drawn, expected, atol=1)
