"""What README and docs show is what the commands print."""

import json
import re
import shlex

import pytest

from dovetail import main
from dovetail.cli import build_parser

PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "docs/*.md",
    "examples/*/*.toml",
    "dovetail/file/templates/**/*.toml",
)


def command_lines(root):
    """Yield the page and each dovetail command that documentation shows, without its placeholders."""
    for pattern in PAGES:
        for page in sorted(root.glob(pattern)):
            text = page.read_text(encoding="utf-8")
            shown = re.findall(r"`dovetail ([^`\n]+)`", text)
            command = r"^(?:#? {2,}|\$ )(?:\S*[/\\])?dovetail ((?!run --help)[a-z].*)$"
            shown += re.findall(command, text, re.M)
            for line in shown:
                yield page.name, re.split(r"  ", line)[0].strip()


def test_every_command_line_in_the_docs_can_be_given(root, capsys):
    parser, seen = build_parser(), 0
    for page, line in command_lines(root):
        words = shlex.split(line.replace("\\", "/"))
        if len(words) < 2 or "…" in line or words[1:] == ["--json"]:
            continue  # a command's name alone, or a family of files
        seen += 1
        options = parser.parse_args(words)
        assert callable(options.run), (page, line)
    assert seen > 20, capsys.readouterr()


@pytest.mark.slow
def test_the_demo_finds_what_the_readme_says(root, tmp_path, capsys, monkeypatch):
    """And `compare` gives the errors of the run before, and those after for the study that was found."""
    monkeypatch.setattr("dovetail.report.pictures.can_draw", lambda: False)
    study, out = root / "examples" / "cross-beam" / "study.toml", tmp_path / "out"
    assert main(["run", str(study), "--out", str(out)]) == 0
    printed = capsys.readouterr().out

    def errors(*words):
        assert main(["compare", *words]) == 0
        line = r"amplitude (\S+) dB on the lines of the fit, (\S+) on those held out"
        found = re.search(line, capsys.readouterr().out)
        assert found
        return found.groups()

    rows = dict(re.findall(r"^(\S.*?)  +(\d+\.\d+  +\d+\.\d+)$", printed, re.M))
    table = {name: tuple(cells.split()) for name, cells in rows.items()}
    assert errors(str(study)) == table["nominal model"]
    # A diagnosis lets the form of the frame vary beside the uncertain parameters.
    fitted = [float(x) for x in errors(str(study), "--fitted")]
    assert fitted == pytest.approx([float(x) for x in table["uncertain parameters fitted"]], rel=0.05)
    # The study that was found has no reduced basis, which errs by some hundredths of a decibel.
    found = [float(x) for x in errors(str(out / "found.toml"))]
    assert found == pytest.approx(
        [float(x) for x in table["+ joint stiffness at joint J, about x"]], abs=0.02
    )
    # what the headline says of the value is what the result holds
    (parameter,) = json.loads((out / "result.json").read_text(encoding="utf-8"))["effects"][0]["parameters"]
    said = re.search(r"stiffness (\d+\.\d)\s±\s(\d+\.\d)\sN·m/rad", printed)
    assert said
    value, std = said.groups()
    assert (float(value), float(std)) == (round(parameter["value"], 1), round(parameter["std"], 1))
    assert f"{value} ± {std} N·m/rad" in (root / "README.md").read_text(encoding="utf-8")
    report = (out / "report.html").read_text(encoding="utf-8")
    assert re.search(rf"{value}\s±\s{std}", report)
