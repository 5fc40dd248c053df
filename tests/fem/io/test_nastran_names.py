"""Names that comments of a Nastran deck give to members and materials."""

import pytest

from dovetail import load_study, main
from fem import Frame
from fem.io import read_model

GRIDS = "".join(f"GRID,{k},,{k}.,0.,0.\n" for k in range(1, 6))
TUBE, FLAT = "PBARL,1,1,,TUBE\n+,.05,.04\n", "PBAR,2,1,1.-4,1.-8,1.-8,1.-8\n"
STEEL = "MAT1,1,2.+11,,.3,7850.\n"
LEGS, RAILS = "CBAR,1,1,1,2,0.,1.,0.\nCBAR,2,1,2,3,0.,1.,0.\n", "CBAR,3,2,3,4,0.,1.,0.\n"
PLAIN = {"property 1", "property 2"}


def model(folder, text):
    path = folder / "a.bdf"
    path.write_text(f"{text}SPC1,1,123456,1\n")
    return read_model(path)


def members(folder, text):
    return set(model(folder, text).mesh.members)


@pytest.mark.filterwarnings("ignore::fem.mesh.MeshWarning")
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"$ legR2\n{TUBE}$ upper rail\n{FLAT}{STEEL}", {"legR2", "upper rail"}),
        (f"$ legR2\n{TUBE}{STEEL}{FLAT}", {"legR2", "property 2"}),
        (f"$ tube 42.4x3.2\n{TUBE}$ flat bar 20x50: DIM1 along z, DIM2 along y\n{FLAT}{STEEL}",
         {"tube 42.4x3.2", "property 2"}),
        (f"$----------\n$ legs\n$----------\n{TUBE}$\n$ rails\n$\n{FLAT}{STEEL}", {"legs", "rails"}),
        (f"$ made by hand\n\n$ legs\n{TUBE}$ rails\n{FLAT}{STEEL}", {"legs", "rails"}),
        (f"$ legs\n\n{TUBE}{STEEL}$ rails\n{FLAT}", {"property 1", "rails"}),
        # the last line, whatever is above it
        (f"$ mm, N, tonne\n$ legs\n{TUBE}$ made by hand\n$ ---\n$ rails\n{FLAT}{STEEL}", {"legs", "rails"}),
        (f'$HMNAME COMP 7"c"\n$HWCOLOR COMP 1 3\n{TUBE}{STEEL}{FLAT}', PLAIN),
        # above several cards, several lines, headings, sentences, cards, rulers
        (f"$ sections of 2024\n{TUBE}{FLAT}{STEEL}", PLAIN),
        (f"$ legs, of the gantry\n$ and its rails.\n{TUBE}{STEEL}{FLAT}", PLAIN),
        (f"$ Properties\n{TUBE}{STEEL}$ERROR = 0\n{FLAT}", PLAIN),
        (f"$ELEMENTS_WITH_PROPERTIES\n{TUBE}{STEEL}$ Beam elements\n{FLAT}", PLAIN),
        (f"$ the legs are tubes of steel\n{TUBE}{STEEL}$ rails.\n{FLAT}", PLAIN),
        (f"$PBAR 1 1 1.-4\n{TUBE}{STEEL}$PBARL,2,1,,TUBE\n{FLAT}", PLAIN),
        (f"$ 1 -- 2 -- 3\n{TUBE}{STEEL}$*******\n{FLAT}", PLAIN),
        # one name twice
        (f"$ bar\n{TUBE}$ bar\n{FLAT}{STEEL}", {"bar", "bar.2"}),
        # HyperMesh, Femap, Patran, ANSA, Simcenter
        (f'{TUBE}{FLAT}{STEEL}$HMNAME PROP                   1"legs" 4\n$HMNAME PROP 2"up, per" 4\n',
         {"legs", "up per"}),
        (f'{TUBE}{FLAT}{STEEL}$HMNAME COMP                   1"legs"\n$HMNAME COMP       2"rails"\n',
         {"legs", "rails"}),
        (f'{TUBE}{FLAT}{STEEL}$HMNAME COMP 7"legs" 1 "t" 4\n$HMNAME COMP 8"r" 2 "t" 4\n'
         '$HMNAME COMP 9"s" 2 "t" 4\n',
         {"legs", "property 2"}),
        (f'{TUBE}{FLAT}{STEEL}$HMNAME COMP 7"c" 1 "t" 4\n$HMNAME PROP 1"legs" 4\n'
         'ENDDATA\n$HMNAME PROP 2"rails"\n',
         {"legs", "rails"}),
        (f"$ Femap with NX Nastran Property 1 : Tube 50x10\n{TUBE}$ Femap Property 2 : rails\n{FLAT}{STEEL}",
         {"Tube 50x10", "rails"}),
        (f"$ Femap with Simcenter Nastran Property 1 : Untitled\n{TUBE}{FLAT}{STEEL}", PLAIN),
        (f"$ Elements and Element Properties for region : legs\n{TUBE}"
         '$ Pset: "legs" will be imported as: "p.1"\n'
         f"$ Elements and Element Properties for region : rails\n{FLAT}{STEEL}", {"legs", "rails"}),
        (f"$ANSA_NAME_COMMENT;1;PBARL;legs;NO;\n{TUBE}$ANSA_NAME_COMMENT;2;PBAR;rails;\n{FLAT}{STEEL}",
         {"legs", "rails"}),
        (f'{TUBE}{FLAT}{STEEL}$HMNAME PROP {"1" * 5000}"legs" 4\n', PLAIN),
        (f"$*\n$*  Property: legs\n$*\n{TUBE}$*\n$*  Property: rails\n$*\n{FLAT}{STEEL}", {"legs", "rails"}),
    ],
)  # fmt: skip
def test_comments_name_properties(tmp_path, text, expected):
    end = text.index("ENDDATA") if "ENDDATA" in text else len(text)
    assert members(tmp_path, GRIDS + LEGS + RAILS + text[:end] + "SPC1,1,123456,1\n" + text[end:]) == expected


@pytest.mark.parametrize(
    "text",
    [
        f"$ steel S355\n{STEEL}",
        f'{STEEL}$HMNAME MAT                    1"steel S355" "MAT1"\n',
        f"$ Femap with NX Nastran Material 1 : steel S355\n{STEEL}",
        f"$ Material Record : steel S355\n$ Description of Material : Date: 1-May-20\n{STEEL}",
        f"$ANSA_NAME_COMMENT;1;MAT1;steel S355;\n{STEEL}",
    ],
)
@pytest.mark.filterwarnings("ignore::fem.mesh.MeshWarning")
def test_comments_name_materials(tmp_path, text):
    (frame,) = model(tmp_path, GRIDS + LEGS + TUBE + text).of_kind(Frame)
    assert {p.material.name for p in frame.members.values()} == {"steel S355"}


BLOCKS = (
    "$ legL\nGRID,1,,1.,0.,0.\nGRID,2,,2.,0.,0.\nCBAR,1,1,1,2,0.,1.,0.\n"
    "$ legR\nGRID,3,,3.,0.,0.\nGRID,4,,4.,0.,0.\nCBAR,2,1,2,3,0.,1.,0.\nCBAR,3,1,3,4,0.,1.,0.\n"
)


@pytest.mark.filterwarnings("ignore::fem.mesh.MeshWarning")
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BLOCKS, {"legL", "legR"}),
        (BLOCKS.replace("$ legR", "$ --- 2 ---"), {"legL", "property 1"}),
        (BLOCKS.replace("$ legR", "$ legL"), {"property 1"}),
        (BLOCKS.replace("$ legR\n", ""), {"property 1"}),
        (BLOCKS.replace("CBAR,3,1", "CBAR,3,2"), {"legL", "property 1", "property 2"}),
        (BLOCKS.replace("$ legL", "$ Grid points").replace("$ legR", "$ Bars"), {"property 1"}),
    ],
)
def test_comments_above_blocks_of_bars_name_them(tmp_path, text, expected):
    assert members(tmp_path, text + TUBE + FLAT + STEEL) == expected


def test_a_study_has_the_names_of_comments(tmp_path):
    (tmp_path / "a.bdf").write_text(f"{BLOCKS}{TUBE}$ S355\n{STEEL}SPC1,1,123456,1\n")
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / "a.bdf")]) == 0
    case = load_study(tmp_path / "s" / "study.toml")
    assert set(case.model.mesh.members) == {"legL", "legR"}
