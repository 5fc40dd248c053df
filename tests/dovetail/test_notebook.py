"""What a notebook shows: short texts with units, tables in HTML, labelled arrays, and figures."""

import dataclasses
import html
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import dovetail
import fem
import joint
import updating
from dovetail.report.found_lines import found_lines
from fem import FRF, Effect, FRFError, Parameter, assemble
from fem.declarations import Site
from fem.summary import fields_summary, percent, quantity, span
from tests.studies import fit_problem

LONGEST = 300
"""Characters of a line that a prompt may print."""


@pytest.fixture(scope="module")
def study(bent_file):
    return dovetail.load_study(bent_file)


@pytest.fixture(scope="module")
def comparison(study):
    return study.compare()


@pytest.fixture(scope="module")
def found(study, bent):
    """Return what a notebook gets of a diagnosis that is made already."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dovetail.pipeline.diagnose_study", lambda *_: bent.diagnosis)
        return study.diagnose()


def test_objects_that_people_meet_print_one_short_line(study, comparison, found, bent):
    problem = fit_problem(study)
    met = [
        study,
        study.model,
        study.model.mesh,
        study.model.damping,
        *study.model.effects,
        *study.candidates(),
        study.candidates(),
        study.frf(),
        study.measurements[0],
        study.measurements[0].frf,
        *study.sensors,
        study.solve_modes(4),
        assemble(study.model),
        comparison,
        study.error(),
        problem,
        problem.data,
        problem.reduced,
        problem.nominal(),
        found,
        *found.explanations,
        dataclasses.replace(bent, folder=Path("out")),
        *found.findings,
        *found.steps,
        *found.rounds[0],
        found.steps[-1].result,
        found.steps[-1].result.solution,
        *study.model.contributions(),
    ]
    too_long = {type(x).__name__: len(repr(x)) for x in met if len(repr(x)) > LONGEST or "\n" in repr(x)}
    assert too_long == {}


def test_a_printed_diagnosis_says_what_was_found(found):
    first, *lines = str(found).splitlines()
    assert first == f"{found.verdict}: {found.reason}"
    assert lines == found_lines(found)
    assert any("point mass" in line and "±" in line for line in lines)


def test_a_comparison_is_computed_once_for_a_study(study, comparison, monkeypatch):
    calls = []
    monkeypatch.setattr("dovetail.pipeline.fit_problem", lambda one: calls.append(one) or fit_problem(one))
    assert study.compare() is comparison
    assert study.error() == comparison.misfit
    assert not calls
    other = study.add("point_mass:arm", mass=0.1)
    assert other.error() != comparison.misfit
    assert other.error() == other.compare().misfit
    assert calls == [other]
    assert len(other.compare(4).bands) != len(other.compare().bands)


def test_the_study_of_a_diagnosis_is_that_of_its_report(study, found, bent, tmp_path):
    better = found.study
    last = found.steps[-1]
    assert better.error().fit_db == pytest.approx(last.fit_db, abs=1e-3)  # dB
    assert better.error().fit_db < 0.1 * study.error().fit_db
    assert [e.name for e in better.added] == [f.effect.name for f in found.findings]
    better.save(tmp_path / "better.toml")
    saved = dovetail.load_study(tmp_path / "better.toml")
    reported = dovetail.load_study(bent.folder / "found.toml")
    assert saved.model.values() == reported.model.values()
    assert saved.estimates == reported.estimates


def test_a_diagnosis_at_hand_writes_the_report_of_a_run(found, bent, bent_album, tmp_path, monkeypatch):
    monkeypatch.setattr("dovetail.report.pictures.draw_all", lambda *_: bent_album)
    written = found.report(tmp_path / "out")
    assert {f.name for f in written.folder.iterdir()} | {"pictures"} == {
        f.name for f in bent.folder.iterdir()
    }
    names = "effects", "error_db", "ranking", "posterior", "uncertain", "model"
    ours, theirs = (json.loads(r.json.read_text(encoding="utf-8")) for r in (written, bent))
    assert {n: ours[n] for n in names} == {n: theirs[n] for n in names}


@pytest.mark.parametrize("package", [fem, updating, joint], ids=lambda package: package.__name__)
def test_no_exported_class_prints_its_arrays(package):
    """The text that dataclasses make prints every field, arrays included."""

    @dataclasses.dataclass
    class Plain:
        x: int

    assert hasattr(Plain.__repr__, "__wrapped__")
    printing = [
        name
        for name in package.__all__
        if dataclasses.is_dataclass(cls := getattr(package, name))
        and any("NDArray" in str(f.type) for f in dataclasses.fields(cls))
        and hasattr(cls.__repr__, "__wrapped__")  # by which dataclasses stop at objects within themselves
    ]
    assert printing == []


def test_texts_have_values_with_units(study, comparison, found):
    frf = study.frf()
    assert repr(frf) == (
        "<StudyFRF accelerance [(m/s²)/N]: 198 lines, 4 to 398 Hz; 4 outputs (P, K, T, A) × 2 inputs (T, K)>"
    )
    assert repr(study.error()).startswith(f"<Misfit {study.error().fit_db:.2f} dB on the lines of the fit")
    assert f"{comparison.total_db:.2f} dB on all lines" in repr(comparison)
    first = "<PointMass point_mass:arm at member arm at 0.2"
    assert repr(study.candidates()["point_mass:arm"]).startswith(first)
    assert "mass 0." in repr(found.findings[0])
    assert "kg" in repr(found.findings[0])
    (effect,) = found.found
    sure, errors = percent(found.reported.probability), " → ".join(f"{s.fit_db:.3g}" for s in found.steps)
    said = f"effect: {effect.name}, probability of exactly this {sure}; error {errors} dB"
    assert repr(found) == f"<StudyDiagnosis {said}>".replace("\u00a0", " ")


def test_an_effect_of_ones_own_prints_its_parameters():
    @dataclasses.dataclass(frozen=True, slots=True, eq=False, kw_only=True)
    class Blob(Effect):
        field: np.ndarray
        mass: float

        @property
        def where(self):
            return Site("nowhere")

        def parameters(self):
            return (Parameter("mass", "kg", self.mass, 0.0, 0.0, 1.0),)

    assert repr(Blob(name="b", field=np.zeros(1000), mass=0.5)) == "<Blob b at nowhere: mass 0.5 kg>"


def test_objects_with_many_fields_count_the_last():
    names = [f"field{k}" for k in range(30)]
    body = {"__repr__": fields_summary}
    wide = dataclasses.make_dataclass("Wide", [(name, np.ndarray) for name in names], namespace=body)
    text = repr(wide(*[np.zeros((20, k)) for k in range(1, 31)]))
    assert text.startswith("Wide(field0=array (20, 1) float64, field1=array (20, 2) float64, ")
    shown = text.count("=array")
    assert text.endswith(f"{30 - shown} more fields)")
    assert len(text) <= LONGEST


def test_numbers_in_texts():
    assert quantity(0.45, "kg") == "0.45 kg"
    assert span([3.0, np.nan, 1.0], "Hz") == "1 to 3 Hz"
    assert span([2.0], "Hz") == "2 Hz"
    assert span([np.nan]) == "no values"


def test_a_curve_is_taken_by_its_labels(study):
    frf = study.frf()
    np.testing.assert_array_equal(frf["A", "T"], frf.H[:, frf.outputs.index("A"), frf.inputs.index("T")])
    with pytest.raises(FRFError, match="there is no output 'B'"):
        frf["B", "T"]
    with pytest.raises(FRFError, match="by two labels"):
        frf["A"]


def test_frfs_keep_their_figure_through_select_and_as_kind(study):
    part = study.frf().select(["A"], band=(10.0, 20.0)).as_kind("receptance")
    figure = part.plot()
    magnitude = next(t for t in figure.data if t.meta["quantity"] == "magnitude")
    np.testing.assert_allclose(magnitude.y, 20 * np.log10(np.abs(part["A", "T"])), rtol=1e-5)


def test_labelled_arrays_have_the_values_and_units(study, comparison):
    frf = study.frf()
    array = frf.to_xarray()
    assert array.attrs["units"] == "(m/s²)/N"
    assert array["frequency"].attrs["units"] == "Hz"
    np.testing.assert_array_equal(array.sel(output="A", input="K").values, frf["A", "K"])
    np.testing.assert_array_equal(frf.to_frame()["A", "K"].to_numpy(), frf["A", "K"])
    errors = comparison.to_frame()
    np.testing.assert_allclose(errors["all"], comparison.by_sensor())
    np.testing.assert_allclose(errors.iloc[:, 1:], comparison.by_band())
    np.testing.assert_array_equal(comparison.to_xarray().values, comparison.error_db)
    candidates = study.candidates().to_frame().set_index(["candidate", "parameter"])
    assert candidates.loc[("point_mass:arm", "mass"), "unit"] == "kg"


@pytest.mark.parametrize(("package", "method"), [("xarray", "to_xarray"), ("pandas", "to_frame")])
def test_without_the_extra_one_line_says_how_to_install_it(study, monkeypatch, package, method):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError) as caught:
        getattr(study.frf(), method)()
    assert str(caught.value) == (
        f"{package} is not installed; install it with: python -m pip install {package}"
    )


def test_tables_hold_the_numbers_and_escape_names(study, comparison, found):
    shown = study._repr_html_()
    assert "bent &lt;bar&gt;" in shown
    assert "<bar>" not in shown
    for obj in (study, comparison, found, study.candidates(), study.error(), study.frf()):
        tags = re.findall(r"<(/?)(table|tr|td|th|div|p|b|thead|tbody|caption)\b", obj._repr_html_())
        opened = [tag for slash, tag in tags if not slash]
        assert sorted(opened) == sorted(tag for slash, tag in tags if slash)
    cells = re.findall(r"<td[^>]*>(.*?)</td>", comparison._repr_html_())
    assert cells[1::3] == [f"{v:.2f}" for v in comparison.by_sensor()]
    assert html.escape(found.reason) in found._repr_html_()


def test_a_comparison_draws_the_worst_pair_beside_another_model(study, comparison):
    better = study.add("point_mass:arm", mass=0.25, position=0.3).compare()
    figure = better.plot(before=comparison)
    curves = {t.meta["series"]: t for t in figure.data if (t.meta or {}).get("quantity") == "magnitude"}
    assert list(curves) == ["measured, not compared", "measured", "nominal", "with point_mass:arm"]
    output, input_ = comparison.worst_pairs(1)[0]
    square = np.nanmean(comparison.log_ratio.real**2, axis=0)
    assert square[comparison.outputs.index(output), comparison.inputs.index(input_)] == np.nanmax(square)
    drawn = {"measured, not compared": better.measured, "with point_mass:arm": better.computed}
    for label, frf in drawn.items():
        np.testing.assert_allclose(curves[label].y, 20 * np.log10(np.abs(frf[output, input_])), rtol=1e-5)
    with pytest.raises(FRFError, match="no output 'B'"):
        comparison.plot("B")


def test_the_map_and_the_staircase_have_the_numbers(comparison, found):
    np.testing.assert_allclose(comparison.plot_map().data[0].z, comparison.by_band(), rtol=1e-6)
    np.testing.assert_allclose(found.plot().data[0].y, [s.fit_db for s in found.steps])
    assert found.plot_ranking().data
    with pytest.raises(ValueError, match="there is no round 9"):
        found.plot_ranking(9)


def test_the_model_shows_each_sensor_with_its_error(study, comparison):
    figure = study.plot()
    marks = next(t for t in figure.data if (t.meta or {}).get("role") == "sensor" and t.type == "scatter3d")
    shown = dict(zip(marks.customdata, marks.marker.color, strict=True))
    errors = dict(zip(comparison.outputs, comparison.by_sensor(), strict=True))
    assert {name: shown[name] for name in errors} == pytest.approx(errors, rel=1e-6)
    labels = [button.label for button in study.plot_modes(2).layout.updatemenus[0].buttons]
    frequencies = study.solve_modes(2).frequency
    assert [f"{f:.4g} Hz" in label for f, label in zip(frequencies, labels, strict=False)] == [True, True]


def test_everything_public_of_the_facade_has_a_docstring(study, comparison, found):
    for obj in (study, comparison, found, study.candidates(), study.frf(), study.error()):
        own = [
            name
            for cls in type(obj).__mro__
            if cls.__module__.startswith(("dovetail", "fem", "updating"))
            for name in vars(cls)
            if not name.startswith("_")
        ]
        without = [
            name
            for name in own
            if callable(getattr(type(obj), name, None)) and not getattr(type(obj), name).__doc__
        ]
        assert without == []
        assert set(own) <= set(dir(obj))


def test_a_single_line_frf_is_short():
    one = FRF.from_arrays([5.0], [1.0 + 0j])
    assert repr(one) == "<FRF accelerance [(m/s²)/N]: 1 line, 5 Hz; 1 outputs (out1) × 1 inputs (in1)>"
