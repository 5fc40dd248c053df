"""How well sections are known: stated in a study in the terms of a workshop."""

import numpy as np
import pytest

from dovetail import StudyError, load_study
from fem import Section
from fem.declarations import SectionTolerance
from fem.sections.tolerance import constants_std
from updating.inference.form import form_of

STUDY = """
[study]
name = "two bars"

[points]
a = [0, 0, 0]
b = [1, 0, 0]
c = [1, 0, 2]

[members.flat]
from = "a"
to = "b"
section = "flat"

[members.tube]
from = "b"
to = "c"
section = "tube"

[materials.steel]
E = 2.1e11
nu = 0.3
rho = 7850

[sections.flat]
shape = "rectangle"
b = 0.03
h = 0.005

[sections.tube]
shape = "tube"
d = 0.02
t = 0.001
"""


def read(folder, text):
    path = folder / "study.toml"
    path.write_text(STUDY + text, encoding="utf-8")
    return load_study(path)


def std_of(study, member):
    forms = {e.name: e for e in form_of(study.model)[0]}
    varied = form_of(study.model)[1]
    return {
        n.refs[0][1]: n.std
        for n in varied
        if n.refs[0][0].startswith("section_form")
        and forms[n.refs[0][0]].members == ((member,) if isinstance(member, str) else member)
    }


def test_the_constants_of_a_rectangle_follow_from_its_sizes():
    b, h, size = 0.03, 0.005, 1e-5
    found = constants_std(SectionTolerance(size=size), Section.rectangle(b, h))
    along_b, along_h = size / b, size / h
    assert found["A"] == pytest.approx(np.hypot(along_b, along_h), rel=1e-4)
    ends = sorted([np.hypot(along_b, 3 * along_h), np.hypot(3 * along_b, along_h)])
    assert sorted([found["Iy"], found["Iz"]]) == pytest.approx(ends, rel=1e-4)


def test_a_wall_is_as_well_known_as_its_thickness():
    d, t, size = 0.02, 0.0001, 1e-6
    found = constants_std(SectionTolerance(size=size), Section.tube(d, t))
    assert found["A"] == pytest.approx(size / t, rel=0.02)
    assert found["J"] == pytest.approx(size / t, rel=0.02)


def test_what_is_stated_counts_and_all_else_is_as_usual(tmp_path):
    usual = read(tmp_path, "")
    assert std_of(usual, "tube") == {"A": 0.01, "Iy": 0.02, "Iz": 0.02, "J": 0.05}
    text = '\n[form]\nmass = 0.002\n\n[[form.parts]]\nmembers = ["tube"]\nsize = 1e-5\ntorsion = 0.1\n'
    stated = read(tmp_path, text)
    assert std_of(stated, "flat") == {"A": 0.002, "Iy": 0.02, "Iz": 0.02, "J": 0.05, "shear": 0.5}
    tube = std_of(stated, "tube")
    assert tube["J"] == 0.1
    assert tube["Iy"] == pytest.approx(tube["Iz"])
    assert tube["Iy"] == pytest.approx(0.01, rel=0.2)  # the wall of 1 mm decides


def test_what_is_measured_counts_before_what_follows_from_sizes(tmp_path):
    text = '\n[form]\nmass = 0.002\n\n[[form.parts]]\nmembers = ["tube"]\nsize = 1e-4\n'
    assert std_of(read(tmp_path, text), "tube")["A"] == 0.002


def test_a_part_is_not_known_as_well_as_another_of_its_section(tmp_path):
    text = '\n[members.other]\nfrom = "a"\nto = [0, 1, 0]\nsection = "flat"\n'
    usual = read(tmp_path, text)
    assert {"A": 0.01}.items() <= std_of(usual, ("flat", "other")).items()
    text += '\n[[form.parts]]\nmembers = ["other"]\nmass = 0.001\n'
    stated = read(tmp_path, text)
    assert std_of(stated, "flat")["A"] == 0.01
    assert std_of(stated, "other")["A"] == 0.001


def test_what_is_known_exactly_does_not_vary(tmp_path):
    assert set(std_of(read(tmp_path, "\n[form]\nbending = 0\n"), "flat")) == {"A", "J", "shear"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[form]\nthickness = 1e-5\n", "form.thickness: unknown key"),
        ("[form]\nmass = 2\n", "mass: 2 is not allowed; a standard deviation up to 0.5"),
        ("[form]\nsize = -1e-5\n", "size: -1e-05 is not allowed"),
        ("[form]\nsize = 0.02\n", "size: 0.02 m makes .* of member 'flat' uncertain by .* %"),
        ("[form]\nmass = 0.01\n[fit]\nform = false\n", "form: .fit. says that sections are as drawn"),
        ('[[form.parts]]\nmembers = ["tub"]\nsize = 1e-5\n', "no member 'tub'"),
        ("[[form.parts]]\nsize = 1e-5\n", "members"),
    ],
)
def test_wrong_tolerances_are_refused(tmp_path, text, words):
    with pytest.raises(StudyError, match=words):
        read(tmp_path, "\n" + text)


def test_a_tolerance_of_sizes_needs_a_section_with_sizes(tmp_path):
    text = STUDY.replace(
        'shape = "rectangle"\nb = 0.03\nh = 0.005', "A = 1e-4\nIy = 1e-9\nIz = 1e-9\nJ = 2e-9"
    )
    path = tmp_path / "study.toml"
    path.write_text(text + "\n[form]\nsize = 1e-5\n", encoding="utf-8")
    with pytest.raises(StudyError, match="needs a shape with dimensions"):
        load_study(path)
