"""The report: whole in one file, right for every verdict, and as a browser shows it."""

import math
import re
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from string import Formatter
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail.found import found_text
from dovetail.modes_pipeline import modes_in_frfs
from dovetail.notebook.diagnosis import StudyDiagnosis
from dovetail.pipeline import modes_of
from dovetail.report import (
    Album,
    Markup,
    TableBlock,
    cells,
    draw_all,
    fits_of,
    html,
    marked_places,
    probability_details,
    probable,
    report_html,
    rivals,
    tag,
    thresholds,
    words,
)
from dovetail.report.found_lines import found_lines
from dovetail.report.sections import explanations, rounds, uncertain
from dovetail.result import FORM_QUANTITIES, UncertainValue, diagnosis_dict, result_dict
from dovetail.spots import spot_of, spot_text
from fem import Frame, Material, MemberProperties, Model, Parameter, PointMass, Section
from fem.effects import effect_classes
from fem.io import read_mesh
from fem.io.abaqus import abaqus_text
from tests.frames import STUDY, cross_beam, portal
from tests.studies import study_from
from updating import EffectParameter, Fault, Finding, propose
from updating.diagnosis import NOWHERE, Departure
from updating.diagnosis.frf_modes import identified_in
from updating.inference import FORM_CLAMP, FORM_CORNER, FORM_JOINT, FORM_SECTION

VOID = {"meta", "link", "img", "br", "hr", "input"}


class Reader(HTMLParser):
    """What a page is made of; complains about tags that are not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.addresses, self.tags = [], [], [], set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        known = dict(attrs)
        self.tags.add(tag)
        self.addresses += [v for k, v in attrs if k in ("src", "href", "data", "action", "srcset")]
        if tag == "img":
            self.images.append(known)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def found(bent):
    return bent


@pytest.fixture(scope="module")
def album(bent_album):
    return bent_album


@pytest.fixture(scope="module")
def text(found, album):
    return report_html(found, album)


def without_findings(result, verdict, faults=()):
    """Return a result as if nothing had been found."""
    d = result.diagnosis
    steps = d.steps[:2]
    less = replace(d, verdict=verdict, reason="none does", findings=(), faults=faults, steps=steps)
    return replace(result, diagnosis=less, comparisons=result.comparisons[:2])


def test_the_page_loads_nothing(text):
    page = Reader(text)
    assert page.images
    assert all(image["src"].startswith("data:image/") and image["alt"] for image in page.images)
    assert all(address.startswith(("data:", "#")) for address in page.addresses)
    bare = re.sub(r"data:[\w/+;]*,[\w+/=]*", "", text)
    assert not re.search(r"https?://|file:|url\(|@import|<script|<iframe|\bon\w+=", bare)
    assert len(text) < 8e6


def test_the_curves_that_are_drawn_have_the_errors_that_are_stated(found):
    d, measured = found.diagnosis, found.diagnosis.measured
    drawn = {}
    for k, rival in rivals(found).items():
        drawn = fits_of(found, k, rival)
        for piece in d.findings[k].decisive:
            pair, band = ([piece.output], [piece.input]), slice(*piece.band)
            seen = measured.select(*pair)
            lines = (seen.frequency >= band.start) & (seen.frequency <= band.stop)
            errors = [
                np.sqrt(np.mean((20 * np.log10(abs(f.select(*pair).H / seen.H))[lines]) ** 2))
                for f in drawn.values()
            ]
            assert errors == pytest.approx([piece.first_db, piece.second_db], rel=1e-9)
    assert drawn


def test_the_order_is_that_of_a_reader(text):
    headings = re.findall(r"<h2>(.*?)</h2>", text)
    assert headings == [
        "How sure",
        "Compared data",
        "Checks of the measurement",
        "Where it fails",
        "Missing effects",
        "How the candidates did",
        "FRFs before and after",
        "Natural frequencies and mode shapes",
        "Uncertain parameters",
        "Faults of the measurement",
        "Notes",
        "Assumptions and thresholds",
        "About this run",
    ]
    assert text.index("Verdict: effect") < text.index("<h2>")


def test_what_the_user_wrote_is_escaped(text):
    assert "bent &lt;bar&gt;" in text
    assert "<bar>" not in text
    assert "Two members &amp; a hidden mass" in text


def test_the_effect_is_told_with_its_numbers(text):
    assert re.search(r"Member arm carries a mass at 0\.(29|30)\d m that the model lacks", text)
    assert re.search(r"mass 0\.2[45]\d* ± 0\.\d+\u00a0kg", text)
    assert "FRFs of the excitation K, which were not fitted" in text
    assert "instead of rigid" not in text


@pytest.mark.parametrize(
    ("verdict", "faults", "words_of_it"),
    [
        ("nothing missing", (), ["The model lacks nothing that stands out from the error of beam theory"]),
        (
            "measurement fault",
            (Fault("sensor_sign", "P", -1.0, 0.0), Fault("sensor_gain", "A", 1.2, 0.03)),
            ["P reads with the opposite sign and A reads 1.200 ± 0.030 times the motion", "wrong gain"],
        ),
        (
            "unexplained",
            (),
            ["no effect known to the program explains why", "Advice", "two force levels"],
        ),
    ],
)
def test_every_verdict_has_its_words(found, album, verdict, faults, words_of_it):
    page = report_html(without_findings(found, verdict, faults), album)
    Reader(page)
    for words_ in words_of_it:
        assert words_ in page
    assert "inf" not in re.findall(r"\b(?:nan|inf)\b", re.sub(r"data:[^\"]*", "", page))
    assert f"Verdict: {verdict}" in page


def test_twins_are_named_in_the_headline(found, album):
    d = found.diagnosis
    (finding,) = d.findings
    rival = d.rounds[0][1]
    twins = (rival, replace(rival, name="another"))
    twofold = replace(found, diagnosis=replace(d, findings=(replace(finding, twins=twins),)))
    page = report_html(twofold, album)
    assert "or it is one of 2 other effects that these data cannot distinguish from it" in page
    assert page.count(">twin<") >= 2


def test_an_effect_that_fits_as_well_is_told_with_the_digits_of_the_difference(found, album):
    """The prior decides between a crack and a release at an end: 0.7624 dB against 0.7585 dB."""
    d = found.diagnosis
    (finding,), (first, other, *_) = d.findings, d.rounds[0]
    crack = replace(other, fit_db=first.fit_db + 0.0041, similarity=0.99984)
    d = replace(
        d,
        findings=(replace(finding, equal_fits=(crack,), rival=crack),),
        rounds=((first, crack), *d.rounds[1:]),
    )
    n = next(n for n in (2, 3, 4) if f"{crack.fit_db:.{n}f}" != f"{first.fit_db:.{n}f}")
    errors = f"{crack.fit_db:.{n}f} dB against {first.fit_db:.{n}f} dB"
    page, lines = report_html(replace(found, diagnosis=d), album), "\n".join(found_lines(d))
    for text in (page, lines):
        assert f"{words.ranked_label(crack)} ({errors}, similarity 0.9998; probability" in text
        assert "the prior decides, not the data" in text
    assert "has no twin" not in page
    assert "No candidate without it explains the data nearly as well" not in page
    table = rounds.table([first, crack], 0, found.diagnosis.model)
    assert "0.9998" in str(table)
    assert any(crack.fit_db in column.values for column in table.columns)


def test_an_error_of_a_channel_beyond_tolerance_is_told_everywhere(found, album, tmp_path):
    fault = Fault("sensor_gain", "T", 0.8, 0.02, tolerance=0.03)
    told = without_findings(found, "measurement fault")
    told = replace(told, diagnosis=replace(told.diagnosis, channel_faults=(fault,)), folder=tmp_path)
    sentence = "T reads 0.800 ± 0.020 times the motion (6.7 times its tolerance)"
    page = report_html(told, album)
    assert f"The measurement is at fault, not the model: {sentence}." in page
    assert "as they were read" in page
    assert "None was found" not in page
    assert any(sentence in line for line in found_lines(told.diagnosis))
    assert sentence in StudyDiagnosis.of(told.diagnosis, told.study)._repr_html_()
    (plain,) = diagnosis_dict(told.diagnosis)["faults"]
    assert (plain["kind"], plain["value"], plain["tolerance"]) == ("sensor_gain", 0.8, 0.03)
    text = found_text(told, tmp_path)
    assert f"# {sentence}: it is part of [channel_errors]" in text
    assert "[[faults]]" not in text
    assert any("gain 0.80" in place.label for place in marked_places(told))


def test_where_shares_say_nothing_the_report_has_no_table_of_them(found, album):
    where = replace(found.localisation, members={}, places=(), note=NOWHERE)
    page = report_html(replace(found, localisation=where), album)
    assert "share of the misfit [%]" not in page
    assert NOWHERE in page
    clear = replace(where, members={**where.members, "arm": 0.4})
    assert "share of the misfit [%]" in report_html(replace(found, localisation=clear), album)


def soft_bolt(result, direction):
    """Return a finding of a soft joint, whose law with a loss factor fits as well, and all that covers it."""
    known = {e.name: e for e in propose(cross_beam())}
    soft, law = (known[f"{kind}:bolt.{direction}"] for kind in ("joint_stiffness", "joint_complex_stiffness"))
    values = (EffectParameter("stiffness", 2e6, "N/m", 1e5),)
    more = (*values, EffectParameter("loss_factor", 0.02, "-", 0.03))
    fit = SimpleNamespace(effects=(law,))
    first = result.diagnosis.rounds[0][0]
    twin = replace(first, name=law.name, kind=law.kind, where=law.where, parameters=more, result=fit)
    return Finding(soft, values, (twin,)), law


def test_a_diagnosis_by_frfs_has_explanations_with_values(found):
    d = found.diagnosis
    assert {e.name for e in d.reported.effects} == {f.effect.name for f in d.findings}
    assert d.sure
    assert d.credible == (d.reported,)
    (only,) = result_dict(found)["credible"]
    assert only["probability"] == d.reported.probability
    values = {p.name: p.value for p in d.findings[0].parameters}
    assert {p["name"] for p in only["effects"][0]["parameters"]} == values.keys()


def test_two_directions_of_a_joint_are_one_sentence_and_an_extension_is_no_other_effect(found):
    pairs = [soft_bolt(found, direction) for direction in "xy"]
    findings, laws = zip(*pairs, strict=True)
    assert words.sentences(findings) == "Joint bolt is softer along x and along y than in the model."
    one, other = (f.effect.name for f in findings)
    posterior = (
        ((one, other), 0.87),
        ((laws[0].name, other), 0.07),
        ((one, laws[1].name), 0.05),
        ((one,), 0.01),
    )
    d = replace(found.diagnosis, findings=findings, model=cross_beam(), candidates=laws, posterior=posterior)
    text = "\n".join(found_lines(d))
    assert "cannot be distinguished" not in text
    assert (
        "also consistent with joint complex stiffness: joint bolt, along x, whose loss factor 0.020 ± 0.030"
        in text
    )
    assert re.search(r"along x above 99\s%, .*along y 99\s%; exactly these effects: 87\s%", text)
    law = findings[0].twins[0]
    assert (findings[0].alternatives, findings[0].extensions) == ((), (law,))


def test_a_value_below_its_deviation_is_said_in_words(found):
    d = found.diagnosis
    (finding,) = d.findings
    first, *others = finding.parameters
    vague = replace(finding, parameters=(replace(first, std=2 * abs(first.value)), *others))
    assert "is not known in size" not in probability_details(d)
    assert "is not known in size" in probability_details(replace(d, findings=(vague,)))


def with_posterior(result, *hypotheses):
    """Return a result whose answer is the first hypothesis, and which has others besides."""
    return replace(result, diagnosis=replace(result.diagnosis, posterior=hypotheses))


def test_the_simpler_answer_says_what_is_more_probable_with_more_effects(found):
    name = found.diagnosis.findings[0].effect.name
    other = next(e for e in found.diagnosis.candidates if e.name != name)
    d = with_posterior(found, ((other.name, name), 0.64), ((name,), 0.36)).diagnosis
    text = probability_details(d)
    assert "This effect alone: 36\u00a0%" in text
    label = probable.label_of(d, [other.name])  # at its most probable position
    assert label.startswith(other.kind.replace("_", " "))
    assert f"with {label} in addition: 64\u00a0%, too close to decide" in text
    assert probable.reported(d) == 1
    assert "too close to decide" not in probability_details(found.diagnosis)
    clear = with_posterior(found, ((other.name, name), 0.99), ((name,), 0.01)).diagnosis
    assert probability_details(clear).endswith(f"with {label} in addition: 99\u00a0%")


def test_an_effect_counts_in_every_answer_that_has_it(found, album):
    name = found.diagnosis.findings[0].effect.name
    other = next(e.name for e in found.diagnosis.candidates if e.name != name)
    both = with_posterior(found, ((name,), 0.55), ((other, name), 0.44), ((other,), 0.01))
    page = report_html(both, album)
    lines = found_lines(both.diagnosis)
    for text in (page, "\n".join(lines)):
        assert "Probability of this effect, alone or with others: 99\u00a0%" in text
        assert text.index("This effect alone: 55\u00a0%") > text.index("alone or with others: 99\u00a0%")
    assert "It has no twin: no answer without it is nearly as probable." in page


def test_an_answer_of_several_effects_is_named_where_it_could_replace_one(found, album):
    name = found.diagnosis.findings[0].effect.name
    first, second = [e for e in found.diagnosis.candidates if e.name != name][:2]
    pair = with_posterior(found, ((name,), 0.6), ((first.name, second.name), 0.35), (("unknown",), 0.05))
    page = report_html(pair, album)
    label = probable.label_of(pair.diagnosis, [first.name, second.name])
    assert len(label.split(" and ")) == 2
    assert f"It may be replaced by another answer: {label}, and nothing else (35\u00a0%)." in page
    assert "has no twin" not in page
    assert "alone or with others: 60\u00a0%" in page
    assert "This effect alone: 60\u00a0%" in page


def test_each_of_several_effects_has_its_own_probability(found):
    (finding,) = found.diagnosis.findings
    other = next(e for e in found.diagnosis.candidates if e.name != finding.effect.name)
    a, b = finding.effect.name, other.name
    d = replace(
        found.diagnosis,
        findings=(finding, replace(finding, effect=other)),
        posterior=(((a, b), 0.5), ((a,), 0.3), ((b,), 0.1), ((), 0.1)),
    )
    assert probable.probability_text(d) == ("Probability of these effects, alone or with others: 50\u00a0%")
    text = probable.probability_details(d)
    assert text.endswith("; exactly these effects: 50\u00a0%")
    assert re.findall(r"(\d+)\u00a0%", text) == ["80", "60", "50"]
    far = replace(d, findings=(), verdict="unexplained", posterior=(((), 0.03), (("unknown",), 0.97)))
    assert probable.probability_text(far) == (
        "Probability of a cause that the library does not have: 97\u00a0%"
    )


def test_doubts_are_told(found, album):
    d = found.diagnosis
    steps = (*d.steps[:-1], replace(d.steps[-1], level=1.0))
    uncertain = (replace(found.uncertain[0], fitted=0.9 * found.uncertain[0].nominal), *found.uncertain[1:])
    page = report_html(replace(found, diagnosis=replace(d, steps=steps), uncertain=uncertain), album)
    assert "That explains the misfit only in part." in page
    first, _, rest = page.partition("</header>")
    assert "E of steel (−5.0)" in first
    assert "far from nominal" not in rest
    assert "only in part" not in report_html(found, album)


def test_a_connection_out_of_its_usual_range_is_told_and_marked(found, album):
    assert len(marked_places(found)) == 1  # the mass
    d = found.diagnosis
    zone = next(e for e in d.problem.reduced.model.effects if e.kind == "clamp_form")
    soft = Departure(zone, "u", "-", -1.2, 0.2, 0.5, 0.98, ())
    odd = replace(found, diagnosis=replace(d, departures=(soft,)))
    first, _, _ = report_html(odd, album).partition("</header>")
    assert first.count("69.9 ± 6.0\u00a0% softer") == 1
    place = next(p for p in marked_places(odd) if p.label == "softer than drawn")
    np.testing.assert_allclose(place.point, zone.locations(found.study.model)[0], atol=1e-9)
    assert place.role == "finding"


def test_parameters_far_from_nominal_are_printed_and_in_json(found, monkeypatch):
    assert not any(u["far"] for u in diagnosis_dict(found.diagnosis)["uncertain"])
    assert not any("far from nominal" in line for line in found_lines(found.diagnosis))
    one = found.uncertain[0]
    moved = (replace(one, fitted=one.nominal - 2.6 * one.prior_std),)
    for module in ("dovetail.result", "dovetail.report.found_lines"):
        monkeypatch.setattr(f"{module}.uncertain_parameters", lambda d: moved)
    (said,) = diagnosis_dict(found.diagnosis)["uncertain"]
    assert (said["moved"], said["far"]) == (pytest.approx(-2.6), True)
    assert any("E of steel (−2.6)" in line for line in found_lines(found.diagnosis))


def test_the_ten_most_probable_explanations_are_ranked_fitted_or_not(found):
    """However few were fitted: those of a forecast count, too."""
    d = found.diagnosis
    table = explanations.ranking(d)
    assert table.rows[0][2] == "fitted"
    assert [row[2] for row in table.rows if row[0].startswith("something that")] == [""]
    searched = d.searched.search
    forecast = {key for key in searched.promised if key not in searched.known}
    assert forecast
    assert {frozenset(e.name for e in x.effects) for x in d.explanations if x.is_forecast} == forecast
    first, rest = probable.most_probable(d, 3)
    assert (len(first), sum(e.probability for e in (*first, *rest))) == (3, pytest.approx(1.0))
    fitted = {frozenset(e.name for e in x.effects) for x in d.explanations if x.known and not x.is_forecast}
    assert fitted <= set(d.searched.search.known)


def test_hypotheses_below_one_per_cent_share_a_row():
    known = [("a", 0.98), ("b", 0.013), ("c", 0.004), ("d", 0.002), ("e", 0.001)]
    assert probable.without_rare(known) == [*known[:2], ("3 others, together", pytest.approx(0.007))]
    assert probable.without_rare(known, 3) == known  # one that is reported stays, with all before it
    assert probable.without_rare(known[:3]) == known[:3]


def test_a_compliance_is_told_as_a_stiffness():
    p = EffectParameter("compliance", 2e-5, "rad/(N·m)", 1e-6)
    of = Parameter("compliance", "rad/(N·m)", 2e-5, 0.0, 0.0, 1e-3)
    assert words.parameter_text(p, of) == "stiffness 50.0 ± 2.5\u00a0kN·m/rad instead of rigid"
    assert words.parameter_text(replace(p, value=0.0)) == "stiffness rigid"
    other = EffectParameter("mass", 2.0, "kg", 0.1)
    assert words.as_stiffness(other) is other


@pytest.mark.parametrize(
    "p",
    [
        EffectParameter("compliance", 2e-5, "rad/(N·m)", 1e-6),
        EffectParameter("stiffness", 5e4, "N·m/rad", 2500.0, scale="reciprocal"),
    ],
)
def test_a_finding_has_its_stiffness_and_its_compliance(found, p):
    finding = replace(found.diagnosis.findings[0], parameters=(p,))
    stiffness, compliance = finding.stiffness, finding.compliance
    assert (stiffness.value, stiffness.std) == (pytest.approx(5e4), pytest.approx(2500.0))
    assert (compliance.value, compliance.std) == (pytest.approx(2e-5), pytest.approx(1e-6))
    assert "stiffness 50.0 ± 2.5\u00a0kN·m/rad" in words.finding_text(finding)
    assert words.compliance_text(finding).startswith("as a compliance: ")
    assert found.diagnosis.findings[0].stiffness is None  # a mass


@pytest.mark.parametrize(
    ("p", "said"),
    [
        (EffectParameter("compliance", 4e-4, "rad/(N·m)", 1e-4), "stiffness 2.50 ± 0.62 kN·m/rad"),
        (
            EffectParameter("compliance", 4e-4, "rad/(N·m)", 2.8e-4),
            "stiffness 2.5 kN·m/rad (1.5 to 8.3 kN·m/rad)",
        ),
        (
            EffectParameter("compliance", 4e-4, "rad/(N·m)", 5e-4),
            "stiffness 2.5 kN·m/rad (above 1.1 kN·m/rad)",
        ),
        (EffectParameter("stiffness", 100.0, "N/m", 75.0, scale="log"), "stiffness 100 N/m (50 to 200 N/m)"),
        (EffectParameter("mass", 2.0, "kg", 1.0), "mass 2.0 ± 1.0 kg"),
    ],
)
def test_a_large_deviation_is_told_as_the_interval_of_the_scale_of_the_fit(p, said):
    assert words.parameter_text(p).replace("\u00a0", " ") == said


def test_long_lists_are_folded():
    rows = [[f"candidate {k}", k] for k in range(100)]
    shown, folded = html(TableBlock(["name", "x [-]"], rows, numbers=[1], marked=[30])).split("<details>")
    assert shown.count("<tr") == 21
    assert folded.count("<tr") == 81
    assert "80 more" in folded
    assert folded.count('class="mark"') == 1


def test_markup_is_escaped_once():
    assert tag("p", "a < b", Markup("<b>"), class_=None, title='"') == '<p title="&quot;">a &lt; b<b></p>'
    assert Markup("<i>") + "&" == "<i>&amp;"
    assert html(html("&")) == "&amp;"


def test_every_threshold_says_what_it_means():
    known = {name: (value, text) for name, value, text in thresholds()}
    assert {"UNKNOWN_ODDS", "LEAST_MISFIT_RATIO"} <= set(known)
    assert all(np.isfinite(value) for value, _ in known.values())


def test_the_report_describes_the_search_where_one_was_made(found, album):
    by_hand = replace(found, diagnosis=replace(found.diagnosis, posterior=(), rounds=()))
    searched, chosen = (report_html(result, album) for result in (found, by_hand))
    for text in ("if its evidence", "Hypotheses are ranked by"):
        assert text in searched
        assert text not in chosen


@pytest.mark.parametrize(
    ("value", "unit", "std", "shown"),
    [
        (146.63, "N·m/rad", 9.8, "146.6 ± 9.8\u00a0N·m/rad"),
        (49.2e6, "N/m", 0.31e6, "49.20 ± 0.31\u00a0MN/m"),
        (2980.0, "N·m/rad", 0.0, "2.98\u00a0kN·m/rad"),
        (0.25, "kg", 0.0012, "0.2500 ± 0.0012\u00a0kg"),
        (-0.1234, "-", np.nan, "−0.123"),
        (3e-7, "-", 0.0, "3.00·10⁻⁷"),
        (np.inf, "N/m", 0.0, "rigid"),
        (np.nan, "kg", 0.0, "–"),
        (0.0, "kg", 0.0, "0.00\u00a0kg"),
        (4830.0, "N", 1234.0, "4.8 ± 1.2\u00a0kN"),
        (0.494, "N·m/rad", 51.0, "0.49 ± 51\u00a0N·m/rad"),
        (-0.0004, "-", 0.012, "0.000 ± 0.012"),
        (-0.3, "%", 48.0, "0 ± 48\u00a0%"),
    ],
)
def test_numbers_are_as_long_as_they_are_known(value, unit, std, shown):
    assert words.with_unit(value, unit, std) == shown


@pytest.mark.parametrize(
    ("where", "shown"),
    [
        ("joint J, rx", "joint J, about x"),
        ("support base, z", "support base, along z"),
        ("supports 101, 102, 103, 104, ry", "4 supports (101 … 104), about y"),
        ("supports a, b, x", "supports a, b, along x"),
        ("member arm at 0.300 m", "member arm at 0.300 m"),
    ],
)
def test_places_are_spelt_out(where, shown):
    assert words.place(where) == shown


def test_a_browser_shows_it(text, tmp_path, browser):
    file = tmp_path / "report.html"
    file.write_text(text, encoding="utf-8")
    call = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    call += ["--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1000,2000", "--virtual-time-budget=3000"]
    dom = subprocess.run(
        [*call, "--dump-dom", file.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    assert "Verdict: effect" in dom.stdout
    assert dom.stdout.rstrip().endswith("</html>")
    assert "ERR_" not in dom.stderr
    picture = tmp_path / "page.png"
    subprocess.run(
        [*call, f"--screenshot={picture}", file.as_uri()], capture_output=True, timeout=90, check=True
    )
    from PIL import Image

    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    band = np.abs(pixels - np.array([0xD5, 0x5E, 0x00])).max(axis=2) < 12  # the bar beside the verdict
    assert band.any(axis=1).sum() > 60
    assert (pixels[-200:] < 250).any()  # the page goes on below


def test_an_empty_album_is_no_obstacle(found, tmp_path):
    Reader(report_html(found, Album(tmp_path)))


@pytest.mark.slow
@pytest.mark.usefixtures("offscreen")
def test_the_structure_is_drawn(found, tmp_path):
    whole = draw_all(found, tmp_path, lambda text, done: None)
    assert whole.failures == []
    assert {"structure", "misfit-fitted", "misfit-final", "mode-1", "mode-changed"} <= set(whole.pictures)
    Reader(report_html(found, whole))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("frame.E:steel", "E of steel"),
        ("frame.rho:steel", "density of steel"),
        ("J.krx", "krx of J"),
        ("damping ratio at 43.92 Hz", "damping ratio at 43.92 Hz"),
    ],
)
def test_uncertain_parameters_are_called_as_a_reader_would(name, said):
    assert UncertainValue(name, "-", 0.0, 0.0, 0.1, 0.1, at_bound=False).words == said


def test_values_of_instruments_are_called_by_their_place():
    mass = UncertainValue("driver_mass:3.mass", "kg", 0, 0, 1, 1, at_bound=False, where="excitation at K")
    assert mass.words == "mass of excitation at K"
    form = ("-", 0, 0, 1, 1, False, "section of member leg.1")
    assert UncertainValue("section_form:leg.1.A", *form).words == "section of member leg.1: mass per length"


def test_the_form_of_a_connection_is_named_by_its_place(found):
    form = [u.words for u in found.uncertain if u.form_of]
    assert any(w.startswith("corner of ") and w.endswith(": stiffness") for w in form)
    assert any(w.startswith("section of member") and w.endswith(": mass per length") for w in form)
    assert not [u.words for u in found.uncertain if "_form" in u.words]


def test_warnings_stand_below_the_verdict(found, album):
    words = "study.toml, line 3, materials.steel.E: E = 210e3 Pa is implausible"
    doubted = replace(found, study=replace(found.study, warnings=(words,)))
    page = report_html(doubted, album)
    assert page.index("Verdict: ") < page.index("Check first") < page.index(html(words))
    assert result_dict(doubted)["warnings"] == [words]
    assert "Implausible values" not in report_html(found, album)


SENTENCES = {
    "joint_stiffness:bolt.rx": (
        "Joint bolt is stiffer about x than in the model.",
        "Joint bolt is softer about x than in the model.",
    ),
    "joint_stiffness:corner0+corner1.rx": (
        "Joints corner0, corner1 are softer about x than in the model.",  # where they are rigid
    )
    * 2,
    "member_density:left": (
        "Member left is heavier than in the model.",
        "Member left is lighter than in the model.",
    ),
    "preload:left": (
        "Member left is under tension that the model lacks.",
        "Member left is under compression that the model lacks.",
    ),
    "point_mass:left": ("Member left carries a mass at 0.250 m that the model lacks.",) * 2,
    "support_flexibility:foot0.rx": ("Support foot0 is flexible about x, but rigid in the model.",) * 2,
    "joint_mass:bolt": ("The model lacks joint mass: joint bolt.",) * 2,
}
"""Candidates of crossed beams and of a portal, and what is reported of more and of less."""


@pytest.mark.parametrize("name", SENTENCES)
def test_a_finding_is_reported_as_the_effect_states_it(name):
    model = cross_beam() if "bolt" in name else portal()
    effect = next(e for e in effect_classes()[name.partition(":")[0]].propose(model) if e.name == name)
    first = effect.parameters()[0]
    absent = first.absent if np.isfinite(first.absent) else 1e6
    for change, sentence in zip((0.1, -0.1), SENTENCES[name], strict=True):
        parameters = [SimpleNamespace(name=first.name, value=absent + change)]
        assert words.sentence([Finding(effect, parameters, ())]) == sentence


def test_every_statement_has_fields_that_a_report_knows():
    fields = set(re.findall(r"``(\w+)``", words.sentence.__doc__))
    for cls in effect_classes().values():
        assert {name for _, name, _, _ in Formatter().parse(cls.statement) if name} <= fields, cls.kind


def test_every_parameter_of_the_form_has_a_name():
    assert (FORM_CLAMP | FORM_CORNER | FORM_JOINT | FORM_SECTION).keys() <= FORM_QUANTITIES.keys()


def test_names_with_commas_are_whole_in_sentences():
    kind = effect_classes()["joint_structural_damping"]
    lossy = [kind(name=name, joint=name, loss_factor=0.1) for name in ("a, left", "a, right")]
    findings = [Finding(e, [SimpleNamespace(name="loss_factor", value=0.1)], ()) for e in lossy]
    assert words.sentences(findings) == (
        "Joint a, left dissipates more than in the model. Joint a, right dissipates more than in the model."
    )
    kind = effect_classes()["member_density"]
    (at_rest,) = (e for e in kind.propose(portal()) if e.name == "member_density:left")
    named = replace(at_rest, member="at 2, left")
    value = [SimpleNamespace(name=named.parameters()[0].name, value=0.1)]
    assert words.sentence([Finding(named, value, ())]) == "Member at 2, left is heavier than in the model."


def test_a_place_is_said_by_node_coordinates_and_global_axis(tmp_path):
    study = study_from(tmp_path, STUDY)
    release = next(e for e in study.candidates("end_release") if e.direction == "ry")
    (xyz,) = release.locations(study.model)
    mesh = study.model.mesh
    name = next(n for n, k in mesh.point_names.items() if np.allclose(mesh.points[k], xyz))
    said = spot_text(release, study.model)
    assert said.startswith(f"at {name}, (")
    assert re.search(r"\(0, 0, 0\.5\) m, about global [xyz]$", said), said
    foot = next(iter(study.candidates("support_flexibility")))
    assert re.match(r"at foot, end 1 of member post, \(0, 0, 0\) m", spot_text(foot, study.model))
    inside = next(e for e in study.candidates("point_mass") if e.member == "arm").with_values(position=0.1)
    assert re.fullmatch(r"at \([\d., −]+\) m", spot_text(inside, study.model))


def test_a_place_is_said_by_the_numbers_of_the_mesh_file(tmp_path):
    """Numbers with gaps, of a mesh that is refined afterwards."""
    rows = ["*NODE", "10, 0, 0, 0", "30, 0.4, 0, 0", "20, 1, 0, 0", "*ELEMENT, TYPE=B31", "7, 10, 30"]
    (tmp_path / "bar.inp").write_text("\n".join([*rows, "5, 30, 20", ""]), encoding="utf-8")
    mesh = read_mesh(tmp_path / "bar.inp")
    steel = MemberProperties(Material("steel", 2e11, 7850.0), Section.circle(0.02))
    (member,) = mesh.members
    model = Model(mesh.refined(0.07), (Frame(members={member: steel}),))
    (mass,) = PointMass.propose(model)
    off, at_node = (spot_of(mass.with_values(position=s), model) for s in (0.45, 0.4))
    assert off.text == "in element 5, nodes 30 to 20 (node 30 is 0.05 m away), (0.45, 0, 0) m"
    assert off.fields()["between_nodes"] == [30, 20]
    assert at_node.text == "at node 30, (0.4, 0, 0) m"
    assert at_node.short == "node 30"
    (tmp_path / "again.inp").write_text(abaqus_text(mesh), encoding="utf-8")
    again = read_mesh(tmp_path / "again.inp").numbers
    assert again.nodes.tolist() == [10, 30, 20]
    assert again.elements.tolist() == [7, 5]


def test_uncertain_parameters_that_did_not_move_are_folded(found):
    far = [replace(u, fitted=u.nominal + 2 * u.std, at_bound=False) for u in found.uncertain]
    near = [replace(u, name=f"{u.name} {k}", fitted=u.nominal, at_bound=False) for k, u in enumerate(far)]
    both = replace(found, uncertain=(*near[:12], *far[:6]))
    _, table = uncertain.page(both, None).blocks
    assert table.n_shown == 6
    assert [row[0] for row in table.rows[:6]] == [u.words for u in far[:6]]


def test_what_an_effect_replaced_has_not_moved(found):
    first, second, *others = (replace(u, fitted=u.nominal, at_bound=False) for u in found.uncertain)
    gone, far = replace(first, fitted=np.nan), replace(second, fitted=second.nominal + 2 * second.std)
    text, table = uncertain.page(replace(found, uncertain=(gone, *others, far)), None).blocks
    assert f"The first 1 of {len(found.uncertain)} moved by more than the ± of their fitted" in str(text)
    assert [row[0] for row in table.rows[:2]] == [far.words, gone.words]


@pytest.mark.parametrize(
    ("name", "nominal", "shown"),
    [
        ("joint_fractional:J.exponent", 0.4, "0.4"),
        ("corner:a.rigid_zone_factor", 0.4, "0.4"),
        ("J.eta", 0.02, "2"),
        ("frame.change", 0.0, "0"),
        ("damping ratio at 12.5 Hz", 0.01, "1"),
    ],
)
def test_only_damping_and_changes_are_in_percent(found, name, nominal, shown):
    one = replace(found.uncertain[0], name=name, unit="-", nominal=nominal, fitted=nominal, form_of="")
    _, table = uncertain.page(replace(found, uncertain=(one,)), None).blocks
    number, _, unit = table.rows[0][1].partition("\u00a0")
    assert float(number) == float(shown)
    assert (unit == "%") == (float(shown) != nominal or not nominal)


def test_a_mode_without_a_partner_has_a_dash():
    """The report of the demo had "+nan" for two modes that the nominal model lacks."""
    assert cells.shift(223.9, math.nan) == cells.shift(math.nan, 223.9) == "–"
    assert cells.shift(200.0, 199.0) == "−0.50"


def test_modes_in_the_frfs_stand_beside_the_models_where_none_were_given(found, album):
    modes = found.identified
    rows = modes.rows()
    assert len(rows) >= 3
    paired = [r for r in rows if r["reported_Hz"] is not None]
    assert len(paired) >= 3
    for r in paired:
        assert r["reported_Hz"] == pytest.approx(r["measured_Hz"], rel=5e-3)
        assert r["mac_reported"] > 0.95
    assert modes.comac.shape == (len(modes.measured.sensors),)
    assert (modes.comac > 0.9).all()
    assert result_dict(found)["identified_modes"] == rows
    page = report_html(found, album)
    assert "these modes were identified in the FRFs" in page
    assert "CoMAC of each sensor" in page


def test_modes_that_the_diagnosis_identified_are_not_identified_again(found, monkeypatch):
    known = replace(found.diagnosis, identified=identified_in(found.diagnosis.problem))
    monkeypatch.setattr("updating.diagnosis.frf_modes.identify_modes", None)
    nominal, _, reported = modes_of(known)
    rows = modes_in_frfs(found.study, known, nominal, reported).rows()
    assert rows == found.identified.rows()


def test_one_candidate_alone_is_not_drawn_as_a_ranking(found, album):
    """It has a sentence with what it is compared with, and its row."""
    d = found.diagnosis
    alone = replace(d, rounds=((d.rounds[0][0],),), findings=d.findings[:1])
    assert rounds.figure(d, 0) is not None
    assert rounds.figure(alone, 0) is None
    page = report_html(replace(found, diagnosis=alone), album)
    assert f"One candidate was fitted fully; without it {d.steps[1].fit_db:.2f} dB are left." in page
    assert "ranking-1" not in page.split("How the candidates did")[-1]


def test_a_finding_without_a_rival_names_what_was_fitted_without_it():
    finding = SimpleNamespace(effect=SimpleNamespace(name="crack"))
    with_it = SimpleNamespace(effects=(finding.effect,), probability=0.7, known=True, label="crack")
    others = [
        SimpleNamespace(effects=(SimpleNamespace(name=n),), probability=p, known=True, label=n)
        for n, p in (("mass", 0.02), ("joint", 0.2))
    ]
    nothing = SimpleNamespace(effects=(), probability=0.05, known=True, label="nothing missing")
    unknown = SimpleNamespace(effects=(), probability=0.03, known=False, label="unknown")

    def text(explanations, n_ranked):
        return words.no_rival_text(SimpleNamespace(explanations=explanations), finding, [None] * n_ranked)

    assert text([with_it, *others, nothing, unknown], 3).endswith(
        "fitted is joint, and nothing else: 20\u00a0%."
    )
    assert (
        text([with_it, nothing, unknown], 3)
        == "Each other candidate that was fitted in its place contains it."
    )
    assert "promising enough" in text([with_it, nothing, unknown], 1)
