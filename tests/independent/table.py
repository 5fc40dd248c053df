"""Run the independent cases and set verdicts against the truth: python -m tests.independent.table

Each nominal.json becomes a study, `dovetail run` investigates it in a process of its own, and only when all
have ended is truth.json read. What comes out is printed as it is.
"""

import argparse
import json
import math
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tests.independent.convert import convert

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT.parent / "shared" / "data" / "independent-cases"
HEAD = ("case", "hidden", "verdict", "found", "right", "error [dB]", "floor [dB]", "time [s]")
YES, TWIN, PARTLY, NO = "yes", "as a twin", "partly", "no"
CORNERS = "solid_corner", "rigid_end_zone"
"""What may be found where corners are solid."""
NEAR = 0.05
"""A position is right within this fraction of the member's length."""


@dataclass(frozen=True)
class Hidden:
    """A hidden effect in the words of result.json.

    `kinds` are those that say the same of it; `place` are the names that `where` must hold, no more and no
    fewer; `value` that of the first parameter.
    """

    kinds: tuple[str, ...]
    place: tuple[str, ...]
    value: float
    unit: str
    position: float | None = None
    reach: float = 0.0

    def __str__(self):
        at = "" if self.position is None else f" at {self.position:.2f} m"
        return (
            f"{' or '.join(self.kinds)} {', '.join(self.place)}{at}: {plus_minus(self.value, 0.0, self.unit)}"
        )

    def is_at(self, found):
        """Say whether a found effect or a twin is of this kind and at this place."""
        where = re.sub(r" at [\d.]+ m\b", "", found["where"])
        if len(self.kinds) > 1:  # what weakens a stretch has no plane of its own
            where = where.removesuffix(", bending about local y").removesuffix(", bending about local z")
        names = where.replace(",", " ").split()
        if found["kind"] not in self.kinds or set(names) - {
            "joint",
            "joints",
            "member",
            "support",
            "supports",
        } != set(self.place):
            return False
        if self.position is None:
            return True
        at = next(p["value"] for p in found["parameters"] if p["name"] == "position")
        return abs(at - self.position) <= self.reach


def hidden_effects(truth, nominal):
    """Return what is hidden: effects, and faults as {sensor: factor}. What is not understood is an error."""
    effects, faults = [], {}
    joints = nominal["joints"] if isinstance(nominal["joints"], list) else []
    for e in truth["effects"]:
        size = e["magnitude"]
        match e["type"]:
            case "none":
                pass
            case "joint_rotational_flexibility":
                place = (joint_of(e["location"], joints)["name"], e["direction"])
                effects.append(
                    Hidden(("joint_stiffness",), place, size[f"k{e['direction']}_Nm_rad"], "N·m/rad")
                )
            case "joint_hysteretic_damping":
                joint = joint_of(e["location"], joints)
                more = size["loss_factor"] - size["nominal"]
                effects.append(Hidden(("joint_structural_damping",), (joint["name"],), more, "-"))
            case "lumped_mass":
                point = e["location"].split()[0]
                (s,) = (s for s in nominal["sensors"] if s["name"] == f"{point}z")
                reach = NEAR * length_of(s["member"], nominal)
                effects.append(
                    Hidden(("point_mass",), (s["member"],), size["kg"], "kg", s["position"], reach)
                )
            case "axial_preload":
                member = e["location"].split()[-1]
                effects.append(Hidden(("preload",), (member,), truth["final_brace_tension_N"], "N"))
            case "foundation_rotational_flexibility" if e["location"].startswith("all"):
                place = (*(str(s["point"]) for s in nominal["supports"]), e["direction"])
                value = size[f"k{e['direction']}_Nm_rad"]
                effects.append(Hidden(("support_flexibility",), place, value, "N·m/rad"))
            case "named":
                reach = NEAR * (e["length"] or 0.0)
                kinds, place = tuple(e["kind"]), tuple(e["place"])
                effects.append(Hidden(kinds, place, e["value"], e["unit"], e["position"], reach))
            case "sensor_fault":
                faults[e["location"]] = size["factor"]
            case other:
                msg = f"truth.json: '{other}' at {e['location']} is not understood"
                raise ValueError(msg)
    return effects, faults


def joint_of(location, joints):
    """Return the joint between the members that end a location such as 'lap joint A-B'."""
    members = set(location.split()[-1].split("-"))
    (joint,) = (j for j in joints if {j["member1"], j["member2"]} == members)
    return joint


def length_of(member, nominal):
    a, b = next((m["end1"], m["end2"]) for m in nominal["members"] if m["name"] == member)
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True)) ** 0.5


def has_solid_corners(truth, nominal):
    """Say whether a structure is welded of solids, so that its corners have a size that centre lines lack."""
    return isinstance(nominal["joints"], str) and "OpenSees" not in truth["code"]


def judge(effects, faults, result, corners=False):
    """Say whether a result is right.

    yes: the verdict, and every effect and fault with its kind and place, and none besides. As a twin: the
    effect is named as one that the data cannot tell from the one found. Partly: the effects are among those
    found, with others. Everything else is wrong: "unexplained" as well, where nothing is hidden. Of a
    structure with solid ``corners`` these are right beside what is hidden.
    """
    found = [e for e in result["effects"] if not (corners and e["kind"] in CORNERS)]
    beside = len(found) < len(result["effects"])
    want = "effect" if effects or beside else "measurement fault" if faults else "nothing missing"
    if result["verdict"] != want or (found and not effects):
        return NO
    if {f["sensor"] for f in result["faults"]} != set(faults):
        return NO
    if any(abs(f["value"] / faults[f["sensor"]] - 1) > 0.05 for f in result["faults"]):
        return NO
    if all(any(h.is_at(f) for f in found) for h in effects):
        return YES if len(found) == len(effects) else PARTLY
    if len(found) == len(effects) and all(
        any(h.is_at(t) for f in found for t in (f, *f["twins"])) for h in effects
    ):
        return TWIN
    return NO


def in_words(result):
    """Return what was found, with values and standard deviations."""
    out = []
    for e in result["effects"]:
        values = ", ".join(plus_minus(p["value"], p["std"], p["unit"]) for p in e["parameters"])
        twins = f" ({len(e['twins'])} twin{'s' if len(e['twins']) > 1 else ''})" if e["twins"] else ""
        out.append(f"{e['kind']} {re.sub(' at [0-9.]+ m$', '', e['where'])}: {values}{twins}")
    for f in result["faults"]:
        value = "sign" if f["kind"] == "sensor_sign" else f"gain {plus_minus(f['value'], f['std'], '')}"
        out.append(f"{f['sensor']} {value}")
    return "; ".join(out) or "-"


def plus_minus(value, std, unit):
    """Write a value with two digits of its standard deviation, or four of its own."""
    unit = "" if unit in ("", "-") else f" {unit}"
    if not std:
        return f"{value:.4g}{unit}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f}{unit}"


def hidden_in_words(effects, faults):
    signs = [f"{s} sign" if factor == -1 else f"{s} gain {factor:g}" for s, factor in faults.items()]
    return "; ".join([*map(str, effects), *signs]) or "nothing"


def investigate(case, out):
    """Convert a case and run it in a process of its own; return result.json, or what the program said."""
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    folder = out / case.name
    folder.mkdir(parents=True, exist_ok=True)
    study = folder / "study.toml"
    study.write_text(convert(nominal, case, study), encoding="utf-8")
    command = [sys.executable, "-m", "study", "run", str(study), "--out", str(folder / "result"), "--quiet"]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit code {done.returncode}"
    return json.loads((folder / "result" / "result.json").read_text(encoding="utf-8"))


def row(case, result, truth):
    """Return a line of the table."""
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    effects, faults = hidden_effects(truth, nominal)
    hidden = hidden_in_words(effects, faults)
    if isinstance(result, str):
        return (case.name, hidden, "failed", result, NO, "-", "-", "-")
    errors = " → ".join(f"{s['fit']:.2f}" for s in result["error_db"])
    return (
        case.name,
        hidden,
        result["verdict"],
        in_words(result),
        judge(effects, faults, result, has_solid_corners(truth, nominal)),
        errors,
        f"{result['noise_floor_db']:.2f}",
        f"{result['seconds']:.0f}",
    )


def markdown(rows):
    """Return a table in Markdown with aligned columns."""
    every = [HEAD, *rows]
    widths = [max(len(r[k]) for r in every) for k in range(len(HEAD))]
    lines = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(r, widths, strict=True)) + " |" for r in every
    ]
    lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
    return "\n".join(lines)


def main(argv=None):
    parser = argparse.ArgumentParser(description="Run independent cases and set verdicts against the truth.")
    parser.add_argument(
        "--cases", type=Path, default=CASES, help="folder of the cases (default: %(default)s)"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "independent", help="(default: %(default)s)"
    )
    parser.add_argument("--only", default="", help="only cases whose name holds this")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (default: %(default)s)")
    options = parser.parse_args(argv)
    cases = [p.parent for p in sorted(options.cases.glob("*/nominal.json")) if options.only in p.parent.name]
    if not cases:
        sys.stderr.write(f"{options.cases}: there are no cases\n")
        return 2

    def run(case):
        result = investigate(case, options.out)
        sys.stderr.write(f"{case.name}: {result if isinstance(result, str) else result['verdict']}\n")
        return result

    with ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(run, cases))
    truth = json.loads((options.cases / "truth.json").read_text(encoding="utf-8"))
    rows = [row(case, result, truth[case.name]) for case, result in zip(cases, results, strict=True)]
    right = sum(r[HEAD.index("right")] == YES for r in rows)
    text = f"{markdown(rows)}\n\n{right} of {len(rows)} right\n"
    (options.out / "table.md").write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    return int(any(isinstance(result, str) for result in results))


if __name__ == "__main__":
    sys.exit(main())
