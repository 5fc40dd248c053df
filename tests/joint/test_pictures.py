"""Pictures of joints and the study that makes them: what they hold, and what they refuse."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from joint import explain_stiffness
from viz import figure_png, plot_stiffness_entries, plot_stiffness_laws

LINES = np.linspace(10.0, 500.0, 60)
Z = np.einsum("f,ij->fij", 1e6 * (1 + 0.05j) + 0 * LINES, np.array([[2.0, 1.0], [1.0, 3.0]]))


def test_entries_bands_and_labels():
    band = 1e4 * (1 + 1j) * np.ones_like(Z)
    figure = plot_stiffness_entries(
        LINES, {"direct": Z, "fit": 1.01 * Z}, [(0, 0), (0, 1)], ["A:z", "A:rx"], {"fit": band}, title="joint"
    )
    axes = figure.get_axes()
    assert len(axes) == 4
    assert "N/rad" in axes[2].get_ylabel()
    np.testing.assert_allclose(axes[0].get_lines()[1].get_ydata(), 2.02e6)
    edges = axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert edges.max() == pytest.approx(2.02e6 + 1.96e4)
    assert figure_png(figure)


def test_real_parts_alone():
    figure = plot_stiffness_entries(LINES, {"direct": Z}, [(0, 0)], ["A:z", "A:rx"], parts="real")
    assert len(figure.get_axes()) == 1


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="'fit' has shape"):
        plot_stiffness_entries(LINES, {"direct": Z, "fit": Z[:3]}, [(0, 0)], ["a:z", "b:z"])
    with pytest.raises(ValueError, match="nothing to plot"):
        plot_stiffness_entries(LINES, {}, [(0, 0)], ["a:z", "b:z"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bands": {"fitted": np.zeros((3, 1, 1))}}, "no curve 'fitted'; the curves are fit"),
        ({"focus": "fitted"}, "no curve 'fitted'"),
        ({"parts": "imaginary"}, "allowed are both, real, imag"),
        ({"entries": [(0, 1)]}, r"no entry \(0, 1\)"),
    ],
)
def test_names_that_are_not_there_are_refused(change, message):
    given = {"entries": [(0, 0)], "labels": ["x"], **change}
    with pytest.raises(ValueError, match=message):
        plot_stiffness_entries([1.0, 2.0, 3.0], {"fit": np.ones((3, 1, 1))}, **given)


def test_laws_are_drawn_with_their_sentence():
    rng = np.random.default_rng(0)
    noisy = Z * (1 + 0.01 * rng.standard_normal(Z.shape))
    laws = explain_stiffness(LINES, noisy, ["x", "y"])
    figure = plot_stiffness_laws(laws, "bolt")
    assert "structural damping" in figure.get_axes()[0].get_title(loc="left")
    assert figure_png(figure)


def study_of(name):
    path = Path(__file__).parents[2] / "examples" / "joint-study" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    study = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(study)
    return study


def test_the_papers_numerical_study(tmp_path):
    study = study_of("numerical")
    study.FREQUENCY = np.linspace(10.0, 3200.0, 40)
    errors = study.run(tmp_path)
    assert errors["direct"] < 1e-9
    assert errors["average K"] < 1e-8
    assert errors["rebuilt"] < 1e-9
    assert errors["9 nodes"] < 1e-9
    assert errors["average with translations only refused"]
    # what translations alone rebuild depends on what the rotations carry, and the residual says so
    assert errors["rebuilt, translations only, stiff in rotation"] > 1
    assert errors["residual, translations only, stiff in rotation"] > 0.9
    assert 1e-3 < errors["rebuilt, translations only, soft in rotation"] < 0.1
    assert errors["residual, translations only, soft in rotation"] < 0.3
    assert len(list(tmp_path.glob("*.png"))) == 7


@pytest.mark.slow
def test_the_papers_experimental_study(tmp_path, capsys):
    """The joint of the solid model: krx 200 N m/rad, kry 3000; the start takes 2980 and 3040.

    Beams are not solids: stiff directions come out off by per cents, and the stated deviations must know.
    """
    study = study_of("experimental")
    fit = study.run(tmp_path)
    known = fit.identifiability.determined[: len(fit.values)]
    true = np.append(study.TRUE, 0.006 * study.TRUE)
    assert known[:6].all()
    assert (np.abs(fit.values - true) / fit.std)[known].max() < 3
    # and are no wider than what they are to cover: the soft direction is known to a few per cent
    assert (fit.std / fit.values)[:6].max() < 0.1
    values = dict(zip(fit.form.names, fit.values, strict=True))
    assert values["K rx rx"] == pytest.approx(200.0, rel=0.02)
    assert values["K ry ry"] == pytest.approx(3000.0, rel=0.02)
    shown = capsys.readouterr().out
    assert "beam U" in shown
    for k, name in enumerate(fit.form.names):
        row = next(line for line in shown.splitlines() if line.strip().startswith(name))
        assert (" ± " in row) == bool(known[k])
    assert len(list(tmp_path.glob("*.png"))) == 4
