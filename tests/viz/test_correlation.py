"""Pictures of correlation: the right artists, labels and units."""

import numpy as np
import pytest
from matplotlib.patches import Rectangle

import fem
from updating import (
    band_error,
    cross_signature_assurance,
    cross_signature_scale,
    fdac,
    match_geometry,
    pair_modes,
    plan_pretest,
    signature_assurance,
)
from viz import correlation as pictures
from viz import draw, figure_png

F = np.linspace(2.0, 90.0, 90)


def receptance(frequency, stiffness=1.0):
    K = stiffness * 4e4 * (np.diag([2.0, 2, 2, 1]) - np.eye(4, k=1) - np.eye(4, k=-1)) * (1 + 0.04j)
    return np.array([np.linalg.inv(K - (2 * np.pi * f) ** 2 * np.eye(4))[:, :2] for f in frequency])


def frame():
    points = [[0, 0, 0], [0, 0, 1], [0.8, 0, 1], [0.8, 0.4, 1]]
    members = {"post": [0], "arm": [1], "stub": [2]}
    mesh = fem.Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], members).refined(size=0.1)
    bar = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.03, 0.02))
    foot, _ = mesh.nearest_point([0, 0, 0])
    return fem.Model(
        mesh, (fem.Frame(members=dict.fromkeys(members, bar)), fem.Support(name="foot", point=foot))
    )


def drawn(figure):
    return len(figure_png(figure)) > 5000


def bars(ax):
    return [patch for patch in ax.patches if isinstance(patch, Rectangle)]


def labels_of(figure):
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


def test_bars_name_the_worst_dofs():
    names = [f"{k}Z+" for k in range(9)]
    comac = np.linspace(0.2, 1, 9)
    figure = pictures.plot_coordinates({"CoMAC": comac, "ECoMAC": comac / 4}, names, mark=2)
    low, high = figure.axes
    assert [t.get_text() for t in low.texts] == ["0Z+", "1Z+"]
    assert [t.get_text() for t in high.texts] == ["8Z+", "7Z+"]
    assert high.get_ylabel() == "ECoMAC [-]"
    assert [bar.get_height() for bar in bars(low)] == pytest.approx(list(comac))
    assert drawn(figure)
    with pytest.raises(ValueError, match=r"'CoMAC' has shape \(9,\) for 8 names"):
        pictures.plot_coordinates({"CoMAC": comac}, names[:8])


def test_maps_and_curves_over_frequency():
    f_a = np.linspace(2.0, 100.0, 70)
    x, a = receptance(F), receptance(f_a, 1.2**2)
    figure = pictures.plot_fdac(F, f_a, fdac(x, a)[..., 0], title="Force 1", ratio=1.2)
    assert figure.axes[0].get_ylabel() == "frequency, computed [Hz]"
    assert labels_of(figure) == ["equal frequencies", "ratio 1.2"]
    assert drawn(figure)
    with pytest.raises(ValueError, match="90 measured and 90 computed"):
        pictures.plot_fdac(F, F, fdac(x, a)[..., 0])
    same = receptance(F, 1.2)
    curves = {"CSAC": cross_signature_assurance(x, same), "CSF": cross_signature_scale(x, same)}
    figure = pictures.plot_signature(F, curves, modes=[20, 60])
    assert labels_of(figure) == ["CSAC", "CSF", "measured modes"]
    assert len(figure.axes[0].lines) == 2 * 2 + 1
    assert drawn(figure)
    sac = signature_assurance(x, same)
    figure = pictures.plot_agreement(sac, ["U1", "U2", "U3", "U4"], ["F1", "F2"], "SAC [-]")
    assert [t.get_text() for t in figure.axes[0].texts] == [f"{v:.2f}" for v in sac.ravel()]
    assert drawn(figure)


def test_pairs_close_modes_and_modes_without_a_partner():
    rng = np.random.default_rng(1)
    a = rng.standard_normal((10, 5))
    turned = a[:, 1:3] @ [[0.6, -0.8], [0.8, 0.6]]
    x = np.column_stack([a[:, 0], turned, rng.standard_normal(10)])
    found = pair_modes([10, 21, 21.3, 34], x, [10.2, 20, 20.1, 40, 50], a)
    figure = pictures.plot_mode_pairs(found)
    texts = [t.get_text() for t in figure.axes[0].texts]
    assert texts == ["+2.0 %", "−4.8, −5.6 %"]
    words = labels_of(figure)
    assert "close modes, as a subspace" in words
    assert {"measured, no partner", "computed, no partner"} <= set(words)
    assert drawn(figure)


def test_a_plan_and_a_match_are_drawn(offscreen, tmp_path):
    model = frame()
    plan = plan_pretest(model, fem.solve_modes(fem.assemble(model), n=6), 10, 2)
    figure = pictures.plot_pretest(plan, title="Ten sensors")
    seen = [bar.get_width() for bar in bars(figure.axes[1])[:6]]
    assert seen == pytest.approx(list(plan.observability.seen))
    assert drawn(figure)
    file = pictures.render_pretest(model, plan, tmp_path / "pretest.png")
    assert file.stat().st_size > 10_000
    mesh = model.mesh
    corners = [mesh.nearest_point(p)[0] for p in ([0, 0, 0], [0, 0, 1], [0.8, 0, 1], [0.8, 0.4, 1])]
    test = np.vstack([mesh.points[corners], [[0.4, 0.3, 0.5]]])
    match = match_geometry(test, mesh.points, 0.02)
    figure = pictures.plot_geometry_match(mesh, match, names=list("ABCDE"))
    assert [t.get_text() for t in figure.axes[0].texts] == list("ABCDE")
    assert "without a mesh point" in labels_of(figure)
    assert figure.legends[0].get_title().get_text().startswith("Not turned")
    assert drawn(figure)


def test_orthogonality_frames_what_is_above_its_limit():
    values = np.array([[0.97, -0.05, 0.22], [0.03, -0.85, 0.1]])
    figure = pictures.plot_orthogonality(values, (["10 Hz", "20 Hz"], ["11 Hz", "21 Hz", "30 Hz"]))
    boxes = [p for p in figure.axes[0].patches if isinstance(p, Rectangle)]
    framed = {(round(p.get_x() + 0.48), round(p.get_y() + 0.48)) for p in boxes}
    assert framed == {(2, 0), (1, 1)}  # column, row: 0.22 beside a pair, and a pair of 0.85
    with pytest.raises(ValueError, match="2 rows and 2 columns"):
        pictures.plot_orthogonality(values, (["a", "b"], ["c", "d"]))


def test_band_errors_have_a_cell_for_each_sensor_and_band():
    H = np.ones((40, 2, 3), dtype=complex)
    error = band_error(np.arange(40.0), H, H * np.array([1.0, 1.1])[:, None], 4)
    figure = draw(pictures.band_error_map(error, ["a", "b"], "relative"))
    words = [text.get_text() for text in figure.axes[0].texts]
    assert [float(w) for w in words] == [0.0] * 4 + [0.1] * 4
    with pytest.raises(ValueError, match="allowed are relative, level_db, log_error"):
        pictures.band_error_map(error, ["a", "b"], "energy")
    with pytest.raises(ValueError, match="2 outputs; 1 names"):
        pictures.band_error_map(error, ["a"])
