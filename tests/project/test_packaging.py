"""The installed project is what pyproject.toml says, and its files name no place where it was made."""

import importlib
import re
import shutil
import subprocess
import tomllib

import pytest

from dovetail.distribution import DISTRIBUTION

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")

# Written in pieces, so that this file does not contain what it looks for.
ABSENT = re.compile(
    "|".join(
        (
            r"(?<![\w.~*])/" + "work/",
            r"\bpypi" + r"\.org",
            "python" + r"hosted\.org",
            "registry" + r"\.npmjs",
            "deb" + r"\.debian\.org",
            r"(?<!\w)(?:extra-)?index" + "-url",
        )
    )
)


@pytest.mark.parametrize("package", PACKAGES)
def test_package_imports_from_this_checkout(package, root):
    module = importlib.import_module(package)
    assert module.__file__ == str(root / package / "__init__.py")


def test_every_file_that_names_the_distribution_has_one_name(root):
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] == DISTRIBUTION
    extras = project["optional-dependencies"]
    own = [d for some in extras.values() for d in some if d.startswith("dovetail")]
    assert own
    assert all(d.startswith(f"{DISTRIBUTION}[") for d in own)
    wheel = DISTRIBUTION.replace("-", "_")
    assert f"{wheel}-VERSION-py3-none-any.whl" in (root / "docs/install.md").read_text(encoding="utf-8")


def test_no_file_names_the_place_where_it_was_made(root):
    if not shutil.which("git") or not (root / ".git").exists():
        pytest.skip("needs a git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=True)
    paths = [root / name for name in listed.stdout.split("\0") if name]
    assert paths
    found = []
    for path in paths:
        content = path.read_bytes() if path.is_file() else b""
        if b"\0" not in content:
            found += [
                f"{path.relative_to(root)}:{n}: {line.strip()[:100]}"
                for n, line in enumerate(content.decode(errors="replace").splitlines(), 1)
                if ABSENT.search(line)
            ]
    assert found == []


def test_pattern_finds_what_must_be_absent():
    for text in ("cd /" + "work/main", "from https://pypi" + ".org/simple", "--extra-index" + "-url x"):
        assert ABSENT.search(text)
    for text in ("out/work/x.csv", "the work/energy theorem", "--index 3"):
        assert not ABSENT.search(text)
