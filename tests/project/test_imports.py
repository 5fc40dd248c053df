"""What a command may import: a start costs what is imported, and most of a short command is its start."""

import importlib
import json
import shutil
import subprocess
import sys
from importlib.metadata import packages_distributions

import pytest

import fem

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")
SPLIT = ("dovetail.report", "dovetail.notebook", "viz.interactive")
"""Rooms whose modules are named one by one."""

# each step may import what is named here and above it
MAY_IMPORT = {
    "import dovetail": "dovetail fem fem.lazy",
    "--version": "dovetail.cli dovetail.distribution viz viz.offscreen",
    "--help": "",
    "modes": """
        dovetail.commands dovetail.disk dovetail.file dovetail.study
        dovetail.notebook dovetail.notebook.responses
        dovetail.report dovetail.report.html_table dovetail.report.office dovetail.report.table
        updating updating.correlation updating.inference updating.measurement updating.quality
        fem.analysis fem.array_types fem.chains fem.checks fem.connection_damping fem.declarations
        fem.directions fem.effects fem.elements fem.ground fem.io fem.laws fem.lengths fem.linalg
        fem.materials fem.matrices
        fem.mesh fem.model fem.plausibility fem.recent fem.sections fem.summary fem.system fem.tabulated
        numpy scipy scipy.linalg scipy.sparse threadpoolctl
        """,
    "static": "",
    "check": "dovetail.notebook.faults dovetail.report.printed",
    "compare": """
        dovetail.notebook.comparison
        dovetail.found dovetail.frf_modes dovetail.modes_pipeline dovetail.pipeline dovetail.result
        dovetail.report.probable dovetail.report.words dovetail.spots
        updating.diagnosis updating.forecast updating.least_squares updating.modal updating.plan
        fem.reduction
        scipy.spatial scipy.special scipy.constants
        """,
}

BROUGHT_ALONG = {"charset_normalizer", "scipy.version"}
"""NumPy's f2py, which SciPy imports, takes the former where it is installed."""

STEPS = """
import contextlib, io, json, sys
import dovetail
steps = {"import dovetail": [*sys.modules]}
from dovetail.cli import main
study = sys.argv[1]
for words in (["--version"], ["--help"], *([c, study] for c in ("modes", "static", "check", "compare"))):
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(words) == 0, words
    steps[words[0]] = [*sys.modules]
print(json.dumps(steps))
"""


@pytest.fixture(scope="module")
def imported(root, tmp_path_factory):
    """Return the modules that a process has imported after each step."""
    folder = tmp_path_factory.mktemp("study")
    for name in ("frame.msh", "test.uff"):
        shutil.copy(root / "examples" / "first-frame" / name, folder)
    text = (root / "examples" / "first-frame" / "study.toml").read_text(encoding="utf-8")
    load = '\n[[loads]]\ncase = "push"\npoint = [0.0, 0.0, 1.0]\nforce = [100.0, 0.0, 0.0]\n'
    (folder / "study.toml").write_text(text + load, encoding="utf-8")
    command = [sys.executable, "-c", STEPS, str(folder / "study.toml")]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def libraries():
    """Return the names under which installed packages are imported, without the private ones."""
    return {name for name in packages_distributions() if not name.startswith("_")}


@pytest.mark.parametrize("step", MAY_IMPORT)
def test_each_step_imports_no_more_than_it_may(imported, libraries, step):
    steps = list(MAY_IMPORT)
    allowed = {name for one in steps[: steps.index(step) + 1] for name in MAY_IMPORT[one].split()}
    names = [name for name in imported[step] if name.split(".")[0] in libraries | {*PACKAGES}]
    rooms = {room_of(name) for name in names if "._" not in name}
    assert rooms - BROUGHT_ALONG <= allowed


def room_of(module):
    """Return the room of a module of ours, or the library; SciPy by its subpackages."""
    depth = 3 if module.startswith(SPLIT) else 2 if module.startswith((*PACKAGES, "scipy")) else 1
    return ".".join(module.split(".")[:depth])


def test_numerics_import_without_what_takes_long_and_few_need(root):
    heavy = {
        "pyvista",
        "vtkmodules",
        "matplotlib",
        "plotly",
        "meshio",
        "pyuff",
        "scipy.signal",
        "scipy.stats",
    }
    code = f"""
import sys
from fem import *
from fem.effects import *
from fem.io import *
from updating import *
from joint import *
print(*sorted({heavy} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_public_name_is_there_without_being_imported_before(root):
    files = [file for package in PACKAGES for file in (root / package).rglob("__init__.py")]
    names = [".".join(file.parent.relative_to(root).parts) for file in files]
    doors = [module for module in map(importlib.import_module, names) if hasattr(module, "__all__")]
    assert len(doors) > 20
    for door in doors:
        assert set(door.__all__) <= set(dir(door)), door
        for name in door.__all__:
            assert getattr(door, name) is getattr(door, name)


def test_submodules_are_attributes_and_other_names_are_refused():
    assert fem.analysis.modes.solve_modes is fem.solve_modes
    with pytest.raises(AttributeError, match="module 'fem' has no attribute 'solve_model'"):
        fem.solve_model  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'solve_model'"):
        from fem import solve_model  # noqa: F401
