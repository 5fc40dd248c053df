"""Figures: the right artists, labels and units."""

import subprocess
import sys
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex

from fem import FRF
from viz import curves, draw, frequencies, heat_maps, search, style

F = np.linspace(1.0, 100.0, 200)


def resonance(frequency, kind="accelerance", n_out=3, n_in=1):
    w, wn = 2 * np.pi * F, 2 * np.pi * frequency
    h = (1j * w) ** {"receptance": 0, "accelerance": 2}[kind] / (wn**2 - w**2 + 0.02j * wn * w)
    amplitude = np.arange(1, n_out + 1)[:, None] * np.ones(n_in)
    names = [f"U{k + 1}z" for k in range(n_out)], [f"F{k + 1}" for k in range(n_in)]
    return FRF.from_arrays(F, h[:, None, None] * amplitude, kind, *names)


def error_curves(measured, models, **more):
    errors, floor = curves.frf_errors(measured, models, **more)
    return curves.error_curves(measured.frequency, errors, floor=floor)


def legend_texts(figure):
    boxes = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
    return [text.get_text() for box in boxes for text in box.get_texts()]


def texts(ax):
    return [text.get_text() for text in ax.texts if text.get_text()]


@pytest.fixture
def measured():
    return resonance(40.0)


def test_frf_figure_shows_amplitude_with_unit_and_phase(measured):
    figure = curves.plot_frf(measured, {"nominal": resonance(44.0)}, [("U2z", "F1")])
    top, low = figure.axes
    assert top.get_ylabel() == "accelerance [(m/s²)/N]"
    assert top.get_yscale() == "log"
    assert low.get_ylabel() == "phase [°]"
    assert low.get_xlabel() == "frequency [Hz]"
    assert top.get_title(loc="left") == "U2z / F1"
    assert np.allclose(top.lines[0].get_ydata(), np.abs(measured.H[:, 1, 0]))
    phase = low.lines[0].get_ydata()
    assert np.allclose(phase[np.isfinite(phase)], np.rad2deg(np.angle(measured.H[:, 1, 0])))
    assert legend_texts(figure) == ["measured", "nominal"]


def test_amplitudes_are_shown_without_any_phase(measured):
    bare = replace(measured, H=np.abs(measured.H).astype(complex))
    figure = curves.plot_frf(bare, {"nominal": resonance(44.0)}, [("U1z", "F1"), ("U2z", "F1")])
    assert [ax.get_ylabel() for ax in figure.axes] == ["accelerance [(m/s²)/N]", ""]
    assert [ax.get_xlabel() for ax in figure.axes] == ["frequency [Hz]"] * 2
    assert np.allclose(figure.axes[1].lines[0].get_ydata(), bare.H[:, 1, 0].real)


def test_frf_models_of_another_kind_are_converted(measured):
    figure = curves.plot_frf(measured, {"fitted": resonance(40.0, "receptance")}, [("U1z", "F1")])
    data, model = (line.get_ydata() for line in figure.axes[0].lines)
    assert np.allclose(data, model)


def test_frf_marks_held_out_bands_and_the_noise(measured):
    figure = curves.plot_frf(measured, {}, floor=1e-3, held_out=[(20, 30)])
    assert len(figure.axes) == 6  # three pairs
    band = figure.axes[0].patches[0]
    assert (band.get_x(), band.get_width()) == (20, 10)
    assert legend_texts(figure) == ["measured", "held out from the fit", "below the noise, 1 σ"]
    shaded = figure.axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert shaded.max() == pytest.approx(1e-3)


def test_values_that_no_error_is_of_are_pale(measured):
    compared = np.ones(measured.H.shape, dtype=bool)
    compared[:50, 1, 0] = False
    figure = curves.plot_frf(measured, {}, [("U1z", "F1"), ("U2z", "F1")], compared=compared)
    whole, parted = (figure.axes[k].get_lines() for k in (0, 2))
    assert [line.get_label() for line in whole] == ["measured"]
    pale, dark = parted  # the dark one covers it
    np.testing.assert_array_equal(np.isfinite(dark.get_ydata()), compared[:, 1, 0])
    np.testing.assert_allclose(pale.get_ydata(), np.abs(measured.H[:, 1, 0]))
    assert legend_texts(figure) == ["measured", "measured, not compared"]


def test_the_phase_is_broken_where_it_wraps():
    f = np.linspace(1, 10, 50)
    h = np.exp(-1j * f)
    figure = curves.plot_frf(FRF.from_arrays(f, h))
    phase = figure.axes[1].lines[0].get_ydata()
    steps = np.abs(np.diff(phase))
    assert np.nanmax(steps) < 180
    assert np.isnan(phase).sum() == 2


def test_unknown_pairs_are_refused(measured):
    with pytest.raises(ValueError, match="there is no output 'X9'"):
        curves.plot_frf(measured, {}, [("X9", "F1")])


def test_the_dark_curve_has_a_label_of_choice_in_every_panel():
    models = {"nominal": resonance(44.0)}
    figure = curves.plot_frf(resonance(40.0), models, [("U1z", "F1"), ("U2z", "F1")], label="computed")
    drawn = [line.get_label() for ax in figure.axes for line in ax.get_lines()]
    assert drawn.count("computed") == 2
    assert drawn.count("nominal") == 2
    assert "measured" not in drawn


def test_models_keep_their_colours_in_every_figure(measured):
    both = curves.plot_frf(measured, {"nominal": measured, "fitted": measured}, [("U1z", "F1")])
    one = draw(error_curves(measured, {"fitted": resonance(41.0)}))
    assert (
        to_hex(both.axes[0].lines[2].get_color())
        == to_hex(one.axes[0].lines[0].get_color())
        == style.FITTED.lower()
    )
    assert to_hex(both.axes[0].lines[0].get_color()) == style.MEASURED


def test_a_model_ten_per_cent_too_large_has_an_error_of_minus_20_db(measured):
    larger = FRF.from_arrays(F, 1.1 * measured.H, measured.kind, measured.outputs, measured.inputs)
    for smooth in (1, 9):
        figure = draw(error_curves(measured, {"nominal": larger}, floor=1e-3, smooth=smooth))
        (line,) = figure.axes[0].lines
        assert np.allclose(line.get_ydata(), -20.0)
    assert figure.axes[0].get_ylabel() == "relative error [dB]"
    assert figure.axes[0].get_xlabel() == "frequency [Hz]"


def test_errors_need_the_measured_lines(measured):
    with pytest.raises(ValueError, match="model 'nominal' has 100 lines, not the 200 measured ones"):
        error_curves(measured, {"nominal": measured.select(lines=np.arange(0, 200, 2))})


def test_misfit_matrix_shows_values_sensors_and_bands():
    values = np.array([[-30.0, -5.0], [np.nan, -12.5], [-20.0, -7.0]])
    figure = draw(
        heat_maps.error_map(
            values, ["a", "b", "c"], [(10, 20), (20, 40.5)], quantity="misfit", title="Fitted"
        )
    )
    ax, bar = figure.axes
    assert np.allclose(ax.images[0].get_array().filled(np.nan), values, equal_nan=True)
    assert texts(ax) == ["−30.0", "−5.0", "−12.5", "−20.0", "−7.0"]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["10–20", "20–40.5"]
    assert [t.get_text() for t in ax.get_yticklabels()] == ["a", "b", "c"]
    assert ax.get_xlabel() == "band [Hz]"
    assert bar.get_ylabel() == "misfit [dB]"


def test_large_misfit_matrices_have_no_numbers():
    figure = draw(heat_maps.error_map(np.zeros((66, 5)), [str(k) for k in range(66)], ["b"] * 5))
    assert texts(figure.axes[0]) == []


def test_matrix_sizes_must_agree():
    with pytest.raises(ValueError, match=r"shape \(2, 2\) for 3 sensors and 2 bands"):
        heat_maps.error_map(np.zeros((2, 2)), ["a", "b", "c"], ["x", "y"])


def test_ranking_keeps_its_order_and_tells_accepted_from_twins():
    """A crack that contains a joint leaves less, and is less probable."""
    described = search.ranking(
        ["joint", "crack", "mass"], [-29.5, -30.0, -12.0], -10.0, twins={1}, accepted=0, floor_db=-33.0
    )
    figure = draw(described)
    (ax,) = figure.axes
    assert [t.get_text() for t in ax.get_yticklabels()] == ["joint", "crack", "mass"]
    bars = [bar for bars in ax.containers for bar in bars]
    assert [bar.get_width() for bar in bars] == [-19.5, -20.0, -2.0]
    assert to_hex(bars[0].get_facecolor()) == style.EFFECT.lower()
    assert [bool(bar.get_hatch()) for bar in bars] == [False, True, False]
    assert texts(ax) == ["noise floor −33.00 dB", "−29.50", "−30.00", "−12.00", "without: −10.00 dB"]
    assert ax.yaxis_inverted()
    assert legend_texts(figure) == ["accepted", "indistinguishable from it", "other"]
    assert ax.get_xlabel().endswith("[dB]")


def test_long_rankings_say_what_they_leave_out():
    (ax,) = draw(search.ranking([f"c{k}" for k in range(30)], -np.arange(30.0), 0.0, at_most=8)).axes
    assert len(ax.get_yticks()) == 8
    assert "22 further ones are not shown" in ax.get_xlabel()


def test_staircase_prints_every_value_and_the_floor():
    steps = [("nominal", -3.0, -2.5), ("fitted", -14.6, None), ("+ joint", -38.0, -36.0)]
    figure = draw(search.staircase(steps, -39.5, digits=1))
    (ax,) = figure.axes
    assert set(texts(ax)) == {"noise floor −39.5 dB", "−3.0", "−2.5", "−14.6", "−38.0", "−36.0"}
    assert [t.get_text() for t in ax.get_xticklabels()] == ["nominal", "fitted", "+ joint"]
    assert legend_texts(figure) == ["on the lines of the fit", "on held-out lines"]
    drawn = {line.get_label(): line for line in ax.lines}
    assert list(drawn["on the lines of the fit"].get_ydata()) == [-3.0, -14.6, -38.0]
    assert ax.get_ylim()[0] < -39.5


def test_staircase_without_held_out_lines_has_one_curve():
    figure = draw(search.staircase([("nominal", 3.0, None), ("fitted", 9.0, None)]))
    assert legend_texts(figure) == ["on the lines of the fit"]
    assert figure.axes[0].get_ylim()[0] == 0.0


def test_mac_shows_values_and_both_sets_of_modes():
    figure = draw(frequencies.mac_map([[1.0, 0.1, 0.0], [0.05, 0.93, 0.2]], ["10", "20"], ["11", "21", "31"]))
    ax, bar = figure.axes
    assert texts(ax) == ["1.00", "0.10", "0.00", "0.05", "0.93", "0.20"]
    assert (ax.get_ylabel(), ax.get_xlabel(), bar.get_ylabel()) == (
        "measured [Hz]",
        "computed [Hz]",
        "MAC [-]",
    )
    assert ax.images[0].get_clim() == (0, 1)


def test_position_marks_the_best_place():
    s = np.linspace(0, 0.8, 81)
    error = -10 - 20 * np.exp(-(((s - 0.3) / 0.05) ** 2))
    more = {
        "interval": (0.28, 0.33),
        "sensors": [0.1, 0.5],
        "baseline": -9.5,
        "floor": -33,
        "member": "lower",
    }
    figure = draw(search.position(s, error, **more))
    (ax,) = figure.axes
    assert ax.get_xlabel() == "place along lower [m]"
    assert ax.get_ylabel() == "error [dB]"
    assert legend_texts(figure) == ["with the effect", "best at 0.3 m", "sensors", "confidence interval"]
    assert texts(ax) == ["noise floor −33.0 dB", "without the effect −9.5 dB"]


def test_figures_are_saved_at_their_size_and_as_bytes(tmp_path):
    figure = draw(search.staircase([("nominal", -3.0, None), ("fitted", -9.0, None)]))
    data = style.figure_png(figure, dpi=100)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
    assert (width, height) == (round(figure.get_figwidth() * 100), round(figure.get_figheight() * 100))
    for suffix in ("png", "svg", "pdf"):
        path = style.save(figure, tmp_path / "new" / f"a.{suffix}")
        assert path.stat().st_size > 3000


def test_nothing_is_drawn_outside_the_figure(measured):
    for figure in (
        curves.plot_frf(measured, {"nominal": measured}, title="A title", held_out=[(2, 3)]),
        draw(frequencies.mac_map(np.eye(8), *([f"{k} Hz" for k in range(8)],) * 2, title="MAC")),
        draw(
            search.ranking(["a rather long name of a candidate effect on a member"], [-3.0], -1.0, title="R")
        ),
    ):
        style.figure_png(figure, dpi=60)
        box = figure.get_tightbbox(figure.canvas.get_renderer())
        assert box.x0 > -0.05
        assert box.y0 > -0.05
        assert box.x1 < figure.get_figwidth() + 0.05
        assert box.y1 < figure.get_figheight() + 0.05


def test_the_user_s_matplotlib_settings_are_left_alone(measured):
    before = dict(mpl.rcParams)
    style.figure_png(curves.plot_frf(measured))
    assert dict(mpl.rcParams) == before


def test_colours_of_models_and_maps_are_distinct_in_grey():
    def grey(cmap):
        rgb = cmap(np.linspace(0, 1, 64))[:, :3]
        return rgb @ [0.299, 0.587, 0.114]

    for cmap in (style.displacement_map(), style.misfit_map(), style.agreement_map()):
        steps = np.diff(grey(cmap))
        assert (steps > 0).all() or (steps < 0).all()
    assert len({colour for colour, _ in style.MODELS}) == len(style.MODELS)


def test_curves_never_import_pyplot():
    code = "import viz.curves, sys; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
