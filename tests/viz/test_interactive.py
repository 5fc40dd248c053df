"""Interactive figures: the values that they show, the names that they answer clicks with, and their text."""

import json
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest

from fem import FRF, FRFError, Modes, assemble, solve_modes
from fem.lengths import metres_afterwards, show_lengths
from tests.frames import beam, cross_beam, fix
from updating import Sensor
from viz import curves, displacement_at, heat_maps, model_surface, search, style
from viz.interactive import live, model, modes, solids, theme
from viz.shapes import amplification, real_shape

NASTY = "a<b>&\"'{x}%{y}$z$"


def trace(figure, quantity, series):
    """Return the trace of a figure of FRFs."""
    known = [t for t in figure.data if t.meta == {"series": series, "quantity": quantity}]
    assert len(known) == 1
    return known[0]


@pytest.fixture(scope="module")
def measured():
    rng = np.random.default_rng(3)
    H = rng.normal(size=(40, 2, 2)) + 1j * rng.normal(size=(40, 2, 2))
    H[5, 1, 0] = 0.0
    return FRF.from_arrays(np.linspace(10.0, 400.0, 40), H, "accelerance", ["r1", "r2"], ["f1", "f2"])


@pytest.mark.parametrize("pair", [("r1", "f1"), ("r2", "f1"), ("r1", "f2")])
def test_an_frf_is_shown_in_decibels_and_degrees(measured, pair):
    figure = live.draw(curves.frf(measured, {"nominal": measured.as_kind("receptance")}, pair))
    H = measured.select([pair[0]], [pair[1]]).H[:, 0, 0]
    known = H != 0
    for series in ("measured", "nominal"):  # the model was converted to the measured kind
        magnitude = np.asarray(trace(figure, "magnitude", series).y)
        assert magnitude[known] == pytest.approx(20 * np.log10(np.abs(H[known])), abs=1e-4)
        assert np.isnan(magnitude[~known]).all()
        shown = trace(figure, "phase", series)
        there = np.isfinite(np.asarray(shown.y))
        assert np.asarray(shown.x)[there] == pytest.approx(measured.frequency[known], rel=1e-6)
        assert np.asarray(shown.y)[there] == pytest.approx(np.rad2deg(np.angle(H[known])), abs=1e-3)
    assert figure.layout.xaxis.range == (10.0, 400.0)
    assert f"{pair[0]} / {pair[1]}" in figure.layout.title.text


@pytest.mark.parametrize("coherence", [None, 1.0])
def test_amplitudes_are_shown_without_any_phase(measured, coherence):
    bare = replace(measured, H=np.abs(measured.H).astype(complex))
    gamma = None if coherence is None else np.full(bare.H.shape, coherence)
    figure = live.draw(curves.frf(bare, {"nominal": measured}, coherence=gamma))
    known = {t.meta["quantity"] for t in figure.data if t.meta}
    assert known == ({"magnitude"} if coherence is None else {"magnitude", "coherence"})
    assert figure.layout.xaxis.anchor == ("y" if coherence is None else "y2")


def test_a_phase_has_a_gap_where_it_jumps():
    f, phase = curves.without_wraps(np.arange(4.0), np.array([170.0, 179.0, -179.0, -170.0]))
    assert np.array_equal(f, [0, 1, 2, 2, 3])
    assert np.array_equal(phase, [170, 179, np.nan, -179, -170], equal_nan=True)


def test_a_prediction_band_is_that_of_two_sided_95_percent(measured):
    deviation = np.full(measured.H.shape, 0.1)
    figure = live.draw(
        curves.frf(
            measured, {"with the effect": measured}, ("r1", "f1"), deviations={"with the effect": deviation}
        )
    )
    low, high, middle = (
        np.asarray(trace(figure, q, "with the effect").y) for q in ("low", "high", "magnitude")
    )
    assert high - middle == pytest.approx(1.96 * 0.1 * 20 / np.log(10), rel=1e-4)
    assert middle - low == pytest.approx(high - middle, rel=1e-4)


def test_held_out_bands_and_coherence_are_drawn(measured):
    coherence = np.linspace(0.2, 1, measured.H.size).reshape(measured.H.shape)
    figure = live.draw(
        curves.frf(
            measured, None, ("r2", "f2"), held_out=[(100.0, 120.0), (300.0, 310.0)], coherence=coherence
        )
    )
    assert [(s.x0, s.x1) for s in figure.layout.shapes] == [(100.0, 120.0), (300.0, 310.0)]
    assert np.asarray(trace(figure, "coherence", "measured").y) == pytest.approx(coherence[:, 1, 1], rel=1e-6)
    assert figure.layout.yaxis3.domain[1] < figure.layout.yaxis2.domain[0] < figure.layout.yaxis.domain[0]


def test_values_that_no_error_is_of_are_in_a_pale_curve_alone(measured):
    compared = np.arange(40)[:, None, None] * np.ones((1, 2, 2)) >= 10
    figure = live.draw(curves.frf(measured, None, ("r1", "f1"), compared=compared))
    dark, pale = (np.asarray(trace(figure, "magnitude", s).y) for s in ("measured", "measured, not compared"))
    H = measured.H[:, 0, 0]
    assert pale == pytest.approx(20 * np.log10(np.abs(H)), abs=1e-4)
    np.testing.assert_array_equal(np.isfinite(dark), compared[:, 0, 0])
    assert figure.layout.yaxis.range == live.draw(curves.frf(measured, None, ("r1", "f1"))).layout.yaxis.range


def test_curves_differ_in_colour_and_in_line(measured):
    labels = ("nominal", "fitted", "with the effect", "rival: mass")
    figure = live.draw(curves.frf(measured, dict.fromkeys(labels, measured)))
    lines = [trace(figure, "magnitude", s).line for s in ("measured", *labels)]
    assert len({line.color for line in lines}) == 5
    assert len({(line.dash, line.width) for line in lines}) >= 4


def test_an_frf_that_is_not_there_is_refused(measured):
    with pytest.raises(FRFError, match=r"there is no \w+ 'r9'"):
        live.draw(curves.frf(measured, None, ("r9", "f1")))
    with pytest.raises(ValueError, match="at least one is needed"):
        live.draw(curves.frf(None))


def test_names_with_tags_stay_text(measured):
    named = FRF.from_arrays(measured.frequency, measured.H, "accelerance", [NASTY, "r2"], ["f1", "f2"])
    figure = live.draw(curves.frf(named, {NASTY: named}, (NASTY, "f1")))
    text = figure.to_json()
    assert "a<b>" not in json.dumps([t.name for t in figure.data])
    assert "a<b>" not in figure.layout.title.text.removeprefix("<b>")
    assert "a&lt;b&gt;&amp;\\\"'&#123;x&#125;%&#123;y&#125;&#36;z&#36;" in text
    assert figure.layout.meta["output"] == NASTY  # for programs it is what it is


# ----------------------------------------------------------------------------------------------------- errors


def test_a_map_has_the_errors_and_answers_with_the_sensor():
    values = np.array([[1.0, 2.0], [np.nan, 4.0], [5.0, 6.5]])
    figure = live.draw(heat_maps.error_map(values, ["a", NASTY, "c"], [(10, 20), (20, 40)]))
    (heat,) = figure.data
    assert np.array_equal(heat.z, values, equal_nan=True)
    assert heat.customdata[1][1] == [NASTY, 20.0, 40.0]
    assert heat.hovertext[2][1] == "c, 20–40 Hz: 6.50 dB"
    assert heat.hovertext[1][0].endswith("nothing compared")
    assert figure.layout.yaxis.range == (2.5, -0.5)  # the first sensor on top
    assert figure.layout.yaxis.ticktext[1] == theme.plain(NASTY)
    assert (heat.zmin, heat.zmax) == (1.0, 6.5)


def test_a_map_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"shape \(1, 2\) for 2 sensors and 2 bands"):
        live.draw(heat_maps.error_map([[1, 2]], ["a", "b"], [(1, 2), (2, 3)]))


def test_the_staircase_has_every_step_and_the_floor():
    steps = [("nominal", 6.0, 7.0), ("fitted", 3.4, 5.1), ("+ spring <k>", 0.7, None)]
    figure = live.draw(search.staircase(steps, 0.44))
    fit, held = figure.data
    assert list(fit.y) == [6.0, 3.4, 0.7]
    assert list(held.y[:2]) == [7.0, 5.1]
    assert np.isnan(held.y[2])
    assert list(fit.text) == ["6.00", "3.40", "0.70"]
    assert {(s.type, s.y1) for s in figure.layout.shapes} == {("rect", 0.44), ("line", 0.44)}
    assert "0.44 dB" in figure.layout.annotations[0].text
    assert figure.layout.xaxis.ticktext[2] == "+ spring &lt;k&gt;"
    assert fit.line.dash != held.line.dash


def test_bars_of_candidates_run_from_the_error_without_them():
    levels = [0.7, 2.5, 3.0, 0.9]
    figure = live.draw(
        search.ranking(
            ["best", "b", "worse", "twin"],
            levels,
            2.67,
            names=["n1", "n0", "n2", "n3"],
            accepted=0,
            twins=[3],
        )
    )
    by_name = {t.name: t for t in figure.data}
    assert list(by_name["accepted"].customdata) == ["n1"]
    assert list(by_name["accepted"].y) == [0]  # on top
    assert by_name["accepted"].x[0] + by_name["accepted"].base[0] == pytest.approx(0.7)
    assert list(by_name["indistinguishable from it"].customdata) == ["n3"]
    assert by_name["indistinguishable from it"].marker.pattern.shape == "/"
    ends = [x + b for x, b in zip(by_name["other"].x, by_name["other"].base, strict=True)]
    assert ends == pytest.approx([2.5, 3.0])
    assert [s.x0 for s in figure.layout.shapes] == [2.67]


def test_worse_candidates_are_counted():
    figure = live.draw(search.ranking([f"c{k}" for k in range(30)], np.arange(30.0), 40.0, at_most=12))
    assert sum(len(t.y) for t in figure.data) == 12
    assert "18 further ones are not shown" in figure.layout.xaxis.title.text
    with pytest.raises(ValueError, match="1 labels and 1 names are given for 2 errors"):
        live.draw(search.ranking(["a"], [1, 2], 3))


def test_probabilities_are_bars_in_whole_percent():
    figure = live.draw(search.probability([("mass & <x>", 0.875), ("unknown", 0.1249), ("other", 1e-5)]))
    reported, others = figure.data
    assert [*reported.x, *others.x] == [0.875, 0.1249, 1e-5]
    assert [*reported.text, *others.text] == ["88\u00a0%", "12\u00a0%", "below 1\u00a0%"]
    assert reported.customdata[0] == "mass & <x>"
    assert figure.layout.yaxis.ticktext[0] == "mass &amp; &lt;x&gt;"
    second, first = live.draw(search.probability([("more", 0.6), ("simple", 0.4)], accepted=1)).data
    assert (list(second.y), list(first.y)) == ([1], [0])
    assert second.marker.color == reported.marker.color != first.marker.color


def test_errors_by_sensor_are_groups_of_bars():
    figure = live.draw(
        search.error_bars(["s1", "s2"], {"nominal": [3.0, 4.0], "fitted": [1.0, 2.0]}, floor_db=0.5)
    )
    assert [list(t.x) for t in figure.data] == [[3.0, 4.0], [1.0, 2.0]]
    assert [t.marker.color for t in figure.data] == [style.NOMINAL, style.FITTED]
    assert list(figure.data[0].customdata) == ["s1", "s2"]
    assert any(s.type == "line" and s.x0 == 0.5 for s in figure.layout.shapes)


# ------------------------------------------------------------------------------------------------------ space


def solid_of(figure, role):
    return [t for t in figure.data if t.type == "mesh3d" and (t.meta or {}).get("role") == role]


def volume(mesh):
    """Return the volume that a closed surface encloses, by the divergence theorem."""
    p = np.stack([mesh.x, mesh.y, mesh.z], axis=1).astype(float)
    a, b, c = (p[np.asarray(k, dtype=int)] for k in (mesh.i, mesh.j, mesh.k))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def test_a_member_is_its_section_swept_along_its_axis():
    figure = model.model_figure(beam(4, length=0.7))
    (mesh,) = solid_of(figure, "member")
    assert volume(mesh) == pytest.approx(0.7 * 0.03 * 0.01, rel=1e-5)
    assert set(mesh.customdata) == {"beam"}
    assert set(mesh.hovertext) == {"member beam"}


SENSORS = [Sensor(f"s{k}", np.array([0.1 * k, 0, 0]), np.array([0, 0, 1.0])) for k in range(4)]


def test_sensors_have_the_colours_of_their_errors_and_their_names():
    errors = {"s0": 1.0, "s1": 2.0, "s2": 3.5}
    figure = model.model_figure(beam(4, effects=(fix(0),)), SENSORS, SENSORS[:1], errors=errors)
    shown = next(t for t in figure.data if t.type == "scatter3d" and (t.meta or {}).get("role") == "sensor")
    assert list(shown.customdata) == ["s0", "s1", "s2", "s3"]
    assert list(shown.marker.color[:3]) == [1.0, 2.0, 3.5]
    assert (shown.marker.cmin, shown.marker.cmax) == (0.0, 3.5)
    assert shown.hovertext[2] == "sensor <b>s2</b>, along +z<br>error 3.50 dB"
    assert shown.hovertext[3] == "sensor <b>s3</b>, along +z"
    (arrows,) = solid_of(figure, "sensor")
    last = theme.rgb_text(style.misfit_map()(1.0))
    assert last in arrows.facecolor
    force = next(
        t for t in figure.data if t.type == "scatter3d" and (t.meta or {}).get("role") == "excitation"
    )
    assert list(force.customdata) == ["s0"]
    support = next(t for t in figure.data if (t.meta or {}).get("role") == "effect")
    assert support.customdata[0] == fix(0).where


def test_places_are_marked_where_they_are():
    places = [
        solids.MarkedPlace(np.array([0.2, 0, 0]), "joint J", NASTY),
        solids.MarkedPlace(np.array([0.4, 0, 0]), "beam at 0.4", "a candidate", "candidate"),
    ]
    figure = model.model_figure(beam(4), places=places)
    found, candidate = (
        next(t for t in figure.data if (t.meta or {}).get("role") == role)
        for role in ("finding", "candidate")
    )
    assert (found.x[0], found.y[0], found.z[0]) == pytest.approx((0.2, 0, 0))
    assert list(found.customdata) == ["joint J"]
    assert list(candidate.customdata) == ["beam at 0.4"]
    (note,) = figure.layout.scene.annotations
    assert note.text == f"<b>{theme.plain(NASTY)}</b>"
    assert note.x == pytest.approx(0.2)


def test_members_can_have_the_colours_of_values():
    frame = cross_beam()
    names = list(frame.mesh.members)
    figure = model.model_figure(frame, members={names[0]: 0.75})
    (mesh,) = solid_of(figure, "member")
    owner = np.array(mesh.customdata)
    assert set(np.asarray(mesh.intensity)[owner == names[0]]) == {0.75}
    assert set(np.asarray(mesh.intensity)[owner != names[0]]) == {0.0}
    assert mesh.cmax == 0.75


@pytest.fixture(scope="module")
def shaken():
    frame = beam(6, effects=(fix(0),))
    return frame, solve_modes(assemble(frame), n=4)


def test_a_mode_moves_as_the_model_does(shaken):
    frame, known = shaken
    figure = modes.modes_figure(frame, known, [0, 2], frames=False)
    rest = next(t for t in figure.data if t.meta == {"moves": "surface"})
    told = figure.layout.meta["modes"]
    assert [m["label"].split(":")[0] for m in told] == ["mode 1", "mode 3"]
    for index, mode in zip((0, 2), told, strict=True):
        pieces = len(rest.x) // (4 * frame.mesh.n_lines) - 1
        surface = model_surface(frame, real_shape(known.shapes[:, index]), pieces=pieces)
        scale = amplification(surface, frame.mesh.size)
        moved = np.asarray(mode["surface"]).reshape(-1, 3)
        assert np.stack([rest.x, rest.y, rest.z], axis=1) == pytest.approx(surface.rest, abs=1e-6)
        assert moved == pytest.approx(scale * surface.displacement, abs=1e-6)
    rows = np.asarray(figure.layout.meta["edges"])
    edges = next(t for t in figure.data if t.meta == {"moves": "edges"})
    assert len(edges.x) == len(rows)
    assert np.isnan(np.asarray(edges.x)[rows < 0]).all()
    assert np.asarray(edges.x)[rows >= 0] == pytest.approx(np.asarray(rest.x)[rows[rows >= 0]])


@pytest.mark.parametrize("factor", [1.0, -3.0, 0.2j])
def test_a_measured_shape_that_agrees_lies_on_the_computed_one(shaken, factor):
    frame, known = shaken
    points = np.array([s.point for s in SENSORS])
    vectors = factor * displacement_at(frame, known.shapes[:, 1], points)
    figure = modes.modes_figure(frame, known, [1], measured={1: (points, vectors)}, frames=False)
    (mode,) = figure.layout.meta["modes"]
    measured, computed = (np.asarray(mode[k]).reshape(-1, 3, 3) for k in ("measured", "computed"))
    assert measured[:, 1] == pytest.approx(computed[:, 1], abs=1e-6)
    assert np.abs(measured[:, 1]).max() > 1e-3
    assert (measured[:, 0] == 0).all()  # arrows begin at the sensors, rings have tips alone
    assert np.isnan(computed[:, 0]).all()


def test_frames_play_a_mode_there_and_back(shaken):
    frame, known = shaken
    figure = modes.modes_figure(frame, known, [0, 1])
    assert len(figure.frames) == 2 * modes.PHASES
    first, last = figure.frames[0].data[0].z, figure.frames[modes.PHASES - 1].data[0].z
    values = [np.frombuffer(b64decode(z["bdata"]), dtype=np.float32) for z in (first, last)]
    rest = model_surface(frame, pieces=6).rest[:, 2]
    assert values[0] + values[1] == pytest.approx(2 * rest, abs=1e-6)  # as far one way as the other
    (choose, stop) = figure.layout.updatemenus
    assert [b.label.split(":")[0] for b in choose.buttons] == ["mode 1", "mode 2"]
    assert stop.buttons[0].label == "stop"


def test_rigid_body_modes_and_growing_ones_are_named():
    known = Modes(np.array([0.0, -3.0, 41.2]), np.zeros((6, 3)), np.array([0, 0, 0.012]), n_rigid=1)
    labels = [modes.mode_label(known, k) for k in range(3)]
    assert labels == [
        "rigid-body mode 1",
        "mode 1: −3 Hz, a motion that grows",
        "mode 2: 41.2 Hz, damping 1.2 %",
    ]
    with pytest.raises(ValueError, match="none of 3 modes"):
        modes.modes_figure(beam(1), known, [])


# ------------------------------------------------------------------------------------------------------ theme


def test_night_changes_colours_and_nothing_else(measured):
    figure = live.draw(curves.frf(measured, {"fitted": measured}, held_out=[(20, 30)]))
    night = theme.at_night(figure)
    assert trace(night, "magnitude", "measured").line.color == theme.NIGHT[style.INK]
    assert night.layout.shapes[0].fillcolor == theme.NIGHT[style.HELD_OUT]
    assert np.array_equal(
        trace(night, "phase", "fitted").y, trace(figure, "phase", "fitted").y, equal_nan=True
    )
    assert trace(figure, "magnitude", "measured").line.color == style.INK


def contrast(one, two):
    """Return the contrast of two colours as WCAG 2 defines it."""

    def light(text):
        c = np.array([int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)])
        return np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]

    low, high = sorted([light(one), light(two)])
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("colour", [style.INK, style.MUTED, style.BLUE, style.VERMILION, style.HIGHLIGHT])
def test_texts_can_be_read_by_day_and_by_night(colour):
    """Texts need 4.5, large ones and lines 3 (WCAG 2.1, 1.4.3 and 1.4.11)."""
    need = 3.0 if colour == style.VERMILION else 4.5  # only bars, lines and bold numbers
    assert contrast(colour, theme.PAPER) >= need
    assert contrast(theme.NIGHT.get(colour, colour), theme.NIGHT[theme.PAPER]) >= need


def test_no_figure_offers_to_send_its_data_away():
    assert theme.CONFIG["showSendToCloud"] is False
    assert theme.CONFIG["displaylogo"] is False


def test_legends_begin_below_the_tool_bar(measured):
    made = (
        model.model_figure(beam(2), places=[solids.MarkedPlace(np.zeros(3), "p", "a place")]),
        live.draw(curves.frf(measured, {"nominal": measured}, (measured.outputs[0], measured.inputs[0]))),
        live.draw(search.staircase([("nominal", 6.0, 7.0), ("fitted", 1.0, 2.0)], 0.5)),
        live.draw(search.ranking(["a", "b"], [1.0, 2.0], 3.0)),
    )
    for figure in made:
        legend, height = figure.layout.legend, figure.layout.height
        assert (legend.yref, legend.yanchor) == ("container", "top")
        assert (1 - legend.y) * height >= theme.TOOL_BAR - 1e-9
        assert figure.layout.margin.t >= (1 - legend.y) * height + theme.LEGEND_ROW - 1e-9


@pytest.mark.parametrize("title", ["", "a title"])
def test_figures_without_a_legend_begin_below_the_tool_bar_too(title):
    made = (
        live.draw(heat_maps.error_map(np.ones((3, 2)), ["a", "b", "c"], [(0, 1), (1, 2)], title=title)),
        live.draw(search.probability([("a", 0.9), ("b", 0.1)], title=title)),
    )
    for figure in made:
        assert figure.layout.margin.t >= theme.TOOL_BAR


def test_a_long_hypothesis_is_broken_and_not_cut():
    name = "joint stiffness: joint J, about x and joint viscous damping: joint J"
    (shown,) = live.draw(search.probability([(name, 1.0)])).layout.yaxis.ticktext
    assert shown.replace("<br>", " ") == name


@pytest.mark.parametrize(("unit", "name", "most"), [(1.0, "m", "0.8"), (0.001, "mm", "800")])
def test_axes_have_the_unit_of_length_that_texts_have(unit, name, most):
    with metres_afterwards():
        show_lengths(unit)
        scene = solids.scene(np.array([[0.0, 0.0, 0.0], [0.8, 0.02, 0.4]]))
    axis = scene["xaxis"]
    assert axis["title"]["text"] == f"x [{name}]"
    assert axis["ticktext"][-1] == most
    assert axis["tickvals"][-1] == pytest.approx(0.8)
    assert 3 <= len(axis["tickvals"]) <= 6
    assert len(scene["yaxis"]["tickvals"]) == 1  # texts of more would overlap
