"""Statics of a portal of steel profiles: reactions, second order, and the load at which it buckles.

The study is that of the page *Loads and time*. The commands run here from Python.
"""

import json
import tempfile
from pathlib import Path

from dovetail import main

study = Path(__file__).parent / "loaded-portal" / "study.toml"
folder = Path(tempfile.mkdtemp())


def run(command, *options):
    """Run a command of dovetail, and return its numbers."""
    file = folder / f"{command}.json"
    print(f"$ dovetail {command} study.toml {' '.join(options)}")
    assert main([command, str(study), *options, "--json", str(file)]) == 0
    return json.loads(file.read_text(encoding="utf-8"))


case = ("--case", "strength")
static = run("static", *case)
second = run("static", *case, "--second-order")
buckling = run("buckling", *case, "--number", "1", "--picture", str(folder / "shapes"))

# Both tell the same story: the second-order analysis states the factor of the first buckling shape.
factor = second["buckling_factors"]["strength"]
print(f"buckles at {factor:.3f} times the load")

# Vertical equilibrium: reactions carry what is applied, at first and at second order.
lift = [
    sum(reaction.get("z", 0.0) for reaction in found["cases"]["strength"]["reactions"].values())
    for found in (static, second)
]
print(f"reactions {lift[0]:.1f} N and {lift[1]:.1f} N")

assert abs(lift[1] / lift[0] - 1) < 1e-9
assert abs(buckling["factors"][0] / factor - 1) < 1e-6
