"""An effect is one file: others ask what it declares and name none; the docs' tables come from it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.make import pages
from docs.make.effects import TABLES, candidates
from fem import Entry
from fem.effects import candidate_kinds, effect_classes
from fem.model import Effect

ROOT = Path(__file__).parents[2]
PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")
CLASSES = {cls.__name__ for cls in effect_classes().values()}
KIND = re.compile(rf"(?<![\w.])({'|'.join(candidate_kinds())})(?=[:.]|$)")
"""A kind as a whole string, or before the place in the name of a candidate."""

MENTION = re.compile(rf"\b({'|'.join([*CLASSES, *candidate_kinds()])})\b")
"""What a file that names an effect has somewhere: others need not be parsed."""

BUILDS = "makes what a study file states"

ALLOWED = {
    "fem/__init__.py": (
        "names that users import",
        {
            "AddedMass",
            "Joint",
            "MultiPointConstraint",
            "PointMass",
            "RigidLink",
            "Superelement",
            "Support",
            "TabulatedStiffness",
            "Viscoelastic",
        },
    ),
    "fem/analysis/initial_stress.py": ("makes the prestress of a static state", {"Prestress"}),
    "fem/analysis/unbalance.py": ("varies the speed", {"Spin"}),
    "fem/analysis/campbell.py": ("varies the speed of rotors", {"Spin"}),
    "fem/analysis/buckling.py": (
        "takes that prestress apart, and asks what couples bending and torsion",
        {"Prestress", "ShearCentre"},
    ),
    "updating/measurement/measurement.py": (
        "makes the masses that sensors state, and the base that moves",
        {"AddedMass", "MovingBase"},
    ),
    "updating/measurement/base_motion.py": ("pushes the base that moves", {"MovingBase"}),
    "updating/inference/patches.py": ("makes elements short on patches of joints", {"JointPatch"}),
    "updating/inference/form.py": (
        "lets the form of every model vary",
        {"SectionForm", "ZoneForm", "ClampForm", "SensorForm", "DriverForm"},
    ),
    "updating/plan/perturbed.py": (
        "puts known masses on the structure of a second test, and releases supports",
        {"AddedMass", "Support"},
    ),
    "fem/io/frame_of_model.py": (
        "writes each as the cards of another program",
        {
            "AddedMass",
            "Crack",
            "DistributedMass",
            "EndRelease",
            "Joint",
            "MassDamping",
            "MemberDensity",
            "MemberSection",
            "MemberStiffness",
            "MemberTorsion",
            "MovingBase",
            "PointInertia",
            "PointMass",
            "RigidLink",
            "SectionForm",
            "SectionShear",
            "SprungMass",
            "StiffnessDamping",
        },
    ),
    "dovetail/export.py": (
        "leaves out what instruments add",
        {"DriverForm", "DriverMass", "SensorForm", "SensorMass", "Stinger"},
    ),
    "joint/assembly.py": ("identifies a joint", {"Joint"}),
    "joint/physics.py": ("makes the elements that a fit stands for", {"Joint", "Viscoelastic"}),
    "dovetail/file/channel_errors.py": (
        "tolerances of what instruments add",
        {"sensor_mass", "driver_mass", "stinger"},
    ),
    "dovetail/file/config.py": (BUILDS, {"Joint", "SectionShear"}),
    "dovetail/file/uncertain.py": (BUILDS, {"Joint", "SectionShear", "Superelement"}),
    "dovetail/file/connections.py": (
        BUILDS,
        {
            "Joint",
            "MultiPointConstraint",
            "RigidLink",
            "SprungMass",
            "Superelement",
            "TabulatedStiffness",
            "Viscoelastic",
        },
    ),
    "dovetail/file/loads.py": ("reads motions of supports and joints", {"Joint", "Support"}),
    "dovetail/file/from_deck.py": (
        "writes the tables of a deck's model",
        {"AddedMass", "DistributedMass", "Joint", "MultiPointConstraint", "RigidLink", "Support"},
    ),
    "dovetail/file/parts.py": (BUILDS, {"AddedMass", "DistributedMass", "Joint", "ShearCentre", "Support"}),
    "fem/io/frame_model.py": (
        "makes the effects of a deck's cards",
        {"AddedMass", "DistributedMass", "Joint", "MultiPointConstraint", "RigidLink", "Support"},
    ),
    "dovetail/file/plane.py": (BUILDS, {"Plane"}),
    "dovetail/file/rotation.py": (BUILDS, {"Spin"}),
    "dovetail/file/template.py": ("hides a mass in the example that it writes", {"AddedMass"}),
    "dovetail/file/measured_modes.py": ("an example in an error message", {"member_stiffness"}),
    "dovetail/commands/spectrum.py": ("refuses a rotor that turns", {"Spin"}),
    "dovetail/commands/compare.py": ("an example in its help", {"point_mass"}),
    "dovetail/identify.py": ("writes an identified joint into a study file", {"Joint", "Viscoelastic"}),
    "viz/models.py": ("draws the surfaces of imported parts", {"Superelement"}),
}
"""Files that name concrete effects, each with the reason and the classes or kinds that it names."""


def docstrings(tree: ast.AST) -> set[int]:
    """Return the identities of strings that stand by themselves."""
    return {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}


def named(code: str) -> Iterator[str]:
    """Yield the classes of effects that code imports, and the kinds of candidates in its strings."""
    if not MENTION.search(code):
        return
    tree = ast.parse(code)
    words = docstrings(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
            yield from (alias.name for alias in node.names if alias.name in CLASSES)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "fem":
            yield from {node.attr} & CLASSES
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in words:
            yield from KIND.findall(node.value)


def sources() -> Iterator[Path]:
    """Yield the files of the packages but for the effects themselves."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if not path.is_relative_to(ROOT / "fem" / "effects"):
                yield path


def test_no_other_file_names_a_concrete_effect():
    found = {p.relative_to(ROOT).as_posix(): set(named(p.read_text(encoding="utf-8"))) for p in sources()}
    assert {file: names for file, names in found.items() if names} == {
        file: names for file, (_, names) in ALLOWED.items()
    }


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("from fem.effects.crack import Crack", ["Crack"]),
        ("from fem import Joint, Mesh", ["Joint"]),
        ("import fem\nfem.Support(name='a', point=0)", ["Support"]),
        ("if effect.kind == 'crack':\n    pass", ["crack"]),
        ("SPRINGS = ('ground_spring', 'side_spring')", ["ground_spring", "side_spring"]),
        ("name.startswith(f'joint_stiffness:{joint}.')", ["joint_stiffness"]),
        ("'''A crack takes it.'''\ntext = 'the preload is unknown'", []),
        ("from fem.effects.joint import PointPair, joint_unit", []),
    ],
)
def test_the_scan_notices(code, found):
    assert list(named(code)) == found


def test_the_folders_of_effects_are_read_once(monkeypatch):
    known = effect_classes()
    monkeypatch.setattr("pkgutil.iter_modules", None)
    assert effect_classes() == known


def tables():
    """Return the tables of effects in the pages, by name."""
    texts = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md"))]
    return [m for text in texts for m in pages.MARK.finditer(text) if m[1] == "effects"]


def test_docs_hold_the_tables_that_the_effects_declare():
    for match in tables():
        assert pages.generate(match[0], "page.md", ROOT).text == match[0], "run python -m docs.make"


def test_every_table_is_on_one_page():
    assert sorted(m[2] for m in tables()) == sorted(TABLES)


def test_a_candidate_without_a_row_is_refused(monkeypatch):
    monkeypatch.setattr(effect_classes()["crack"], "entry", None)
    with pytest.raises(LookupError, match="crack is proposed"):
        candidates()


def test_a_changed_row_shows_in_the_page(monkeypatch):
    monkeypatch.setattr(effect_classes()["crack"], "entry", Entry("`compliance` [-]", "a slit", "anywhere"))
    assert "| `crack` | `compliance` [-] | a slit |" in pages.effects_table("parameters")


def test_what_an_effect_answers_is_listed_for_its_writer():
    answers = {
        name for name, x in vars(Effect).items() if callable(x) or isinstance(x, property | classmethod)
    }
    answers = {name for name in answers if not name.startswith("_")}
    table = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("| to answer |")[2]
    rows = table.partition("\n\n")[0].splitlines()[2:]
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])]
    assert sorted(listed) == sorted(answers)
    assert len(answers) <= 18
