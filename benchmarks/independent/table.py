"""Run the independent cases and set verdicts against the truth: python -m benchmarks.independent.table

Each nominal.json becomes a study, which is diagnosed in a process of its own. Each process reads truth.json
when its diagnosis has ended, and starts the case at the truth as well. What comes out is printed as it is. A
truth that is not understood is shown in its own words, and not judged.
"""

import argparse
import json
import math
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from benchmarks.independent.convert import convert
from benchmarks.independent.summary import summarise

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT.parent / "shared" / "data" / "independent-cases"
NOT_UNDERSTOOD = KeyError, TypeError, ValueError, AttributeError, IndexError
"""What reading a truth in unknown words raises."""
NOT_ENDED = "not ended"
"""What a case is called whose diagnosis has used its time of the processor."""
HEAD = ("case", "hidden", "verdict", "found", "right", "error [dB]", "floor [dB]", "time [s]")
POSTERIOR = ("probability", "of the place", "in three", "truth [nats]", "loss")
"""Columns of what the posterior says."""
YES, TWIN, PARTLY, NO, NOT_JUDGED = "yes", "as a twin", "partly", "no", "not judged"
CORNERS = "solid_corner", "rigid_end_zone"
"""What may be found where corners are solid."""
NEAR = 0.05
"""A position is right within this fraction of the member's length."""
GAIN = 0.05
"""A gain is right within this fraction."""
WORDS = {"joint", "joints", "member", "support", "supports"}
"""What stands before names of places."""
DIRECTIONS = {"x", "y", "z", "rx", "ry", "rz"}
OF_THE_TEST = {"sensor_gain": "gains", "sensor_tilt": "turns_rad", "sensor_position": "offsets_m"}
"""Faults that a test has which is not as described, and what truth.json calls their sizes."""
SOFT = {"connection", "joint_complex_stiffness", "joint_stiffness", "support_flexibility"}
"""Kinds that say that a connection gives way, in one direction or in several."""
LOSSY = {"joint_structural_damping"}
"""Kinds that say that it has a loss factor, beside parameters of that name."""
MOVED = {
    "hole_beside": ("joint_hole",),
    "mounted_along": ("part_shift",),
    "settled_elsewhere": ("support_shift", "foot_shift"),
}
"""Types of effects that move a point of action, and the kinds that say the same."""
ON_A_JOINT = {
    "joint_rotational_flexibility": ("joint_stiffness", "k"),
    "joint_translational_flexibility": ("joint_stiffness", "k"),
    "joint_viscous_damping": ("joint_viscous_damping", "c"),
    "joint_viscous_damper": ("joint_viscous_damping", "c"),
    "joint_cubic_stiffness": ("joint_cubic", "k3"),
    "joint_cubic_spring": ("joint_cubic", "k3"),
    "joint_friction": ("joint_friction", "F"),
    "joint_dry_friction": ("joint_friction", "F"),
    "joint_coulomb_friction": ("joint_friction", "F"),
}
"""Types of effects in one direction of a joint: the kind that is meant, and how its value is called."""
OF_A_SENSOR = {
    "factor": "gain",
    "excitation_factor": "gain",
    "delay_s": "delay",
    "tilt_rad": "tilt",
    "moved_m": "position",
    "swapped_with": "swap",
}
"""Keys of a fault's magnitude, and what they mean; one that begins with excitation is of a force."""


@dataclass(frozen=True)
class Hidden:
    """A hidden effect in the words of result.json.

    `kinds` are those that say the same of it; `place` are the names that `where` must hold, no more and no
    fewer; `value` that of the first parameter, None if the truth does not say.
    """

    kinds: tuple[str, ...]
    place: tuple[str, ...]
    value: float | None
    unit: str
    position: float | None = None
    reach: float = 0.0

    def __str__(self):
        at = "" if self.position is None else f" at {self.position:.2f} m"
        value = "" if self.value is None else f": {plus_minus(self.value, 0.0, self.unit)}"
        return f"{' or '.join(self.kinds)} {', '.join(self.place)}{at}{value}"

    def is_at(self, found):
        """Say whether a found effect or a twin is of this kind and at this place."""
        where = re.sub(r" at [\d.]+ m\b", "", found["where"])
        if len(self.kinds) > 1:  # what weakens a stretch has no plane of its own
            where = where.removesuffix(", bending about local y").removesuffix(", bending about local z")
        names = where.replace(",", " ").split()
        if found["kind"] not in self.kinds or set(names) - WORDS != set(self.place):
            return False
        if self.position is None:
            return True
        at = next(p["value"] for p in found["parameters"] if p["name"] == "position")
        return abs(at - self.position) <= self.reach


@dataclass(frozen=True)
class HiddenConnection:
    """A connection that gives way in some directions, with a loss factor or without.

    Several found effects at it count as one if none is in another direction, and one effect in several
    directions may have more of them.
    """

    place: str
    stiffness: dict[str, float]
    loss_factor: float | None = None

    def __str__(self):
        values = [
            f"{d} {plus_minus(k, 0.0, 'N·m/rad' if d.startswith('r') else 'N/m')}"
            for d, k in self.stiffness.items()
        ]
        loss = [] if self.loss_factor is None else [f"loss factor {self.loss_factor:g}"]
        return f"connection {self.place} soft: {', '.join(values + loss)}"

    def is_part(self, found):
        """Say whether a found effect is at this connection and says nothing of others or other directions."""
        words = set(found["where"].replace(",", " ").split())
        directions = words & DIRECTIONS
        if words - WORDS - DIRECTIONS != {self.place}:
            return False
        if found["kind"] in LOSSY:
            return self.loss_factor is not None and directions <= set(self.stiffness)
        if found["kind"] not in SOFT or not directions:
            return False
        return directions <= set(self.stiffness) or len(directions & set(self.stiffness)) > 1

    def joined(self, found):
        """Return found effects with those at this connection as one."""
        mine = [f for f in found if self.is_part(f)]
        if not mine:
            return found
        both = {"kind": "connection", "parts": mine, "where": " ".join(f["where"] for f in mine)}
        both["twins"] = [t for f in mine for t in f["twins"]]
        return [both, *(f for f in found if f not in mine)]

    def is_at(self, found):
        """Say whether a found effect, or those joined to one, is this connection in all its directions."""
        parts = found.get("parts", [found])
        if not all(map(self.is_part, parts)):
            return False
        lossy = any(f["kind"] in LOSSY or any("loss" in p["name"] for p in f["parameters"]) for f in parts)
        named = set(found["where"].replace(",", " ").split())
        return set(self.stiffness) <= named and lossy >= (self.loss_factor is not None)


@dataclass(frozen=True)
class HiddenMove:
    """A point of action that is elsewhere than stated: a hole, a part that is mounted or a support."""

    kinds: tuple[str, ...]
    place: str
    member: str
    value: object

    def __str__(self):
        return f"{' or '.join(self.kinds)} {self.place}, {self.member}: {self.value} m"

    def is_at(self, found):
        """Say whether a found effect is of this kind, at this connection or of this member."""
        words = set(found["where"].replace(",", " ").split())
        return found["kind"] in self.kinds and bool(words & {self.place, self.member})


@dataclass(frozen=True)
class HiddenFault:
    """A hidden fault in the words of result.json; `other` is the sensor of a swap."""

    kind: str
    sensor: str
    value: float = 0.0
    unit: str = "-"
    other: str = ""

    def __str__(self):
        return fault_in_words(self.kind, self.sensor, plus_minus(self.value, 0.0, self.unit), self.other)

    def is_found(self, found):
        """Say whether a found fault is of this kind, at this sensor, and a gain of this size."""
        if found["kind"] != self.kind:
            return False
        if self.kind == "sensor_swap":
            return {found["sensor"], found.get("other")} == {self.sensor, self.other}
        if self.kind.endswith("gain") and abs(found["value"] / self.value - 1) > GAIN:
            return False
        return found["sensor"] == self.sensor


def hidden_effects(truth, nominal):
    """Return what is hidden, effects and faults. What is not understood is an error."""
    effects, faults = [], []
    joints = nominal["joints"] if isinstance(nominal["joints"], list) else []
    for e in truth["effects"]:
        size = e["magnitude"]
        match e["type"]:
            case "none":
                pass
            case kind if kind in ON_A_JOINT:
                effects.append(in_a_joint(e, joints))
            case "joint_hysteretic_damping":
                joint = joint_of(e["location"], joints)
                more = size["loss_factor"] - size["nominal"]
                effects.append(Hidden(("joint_structural_damping",), (joint["name"],), more, "-"))
            case "lumped_mass" if e["location"].startswith("joint "):
                joint = joint_of(e["location"], joints)
                effects.append(Hidden(("joint_mass",), (joint["name"],), size["kg"], "kg"))
            case "lumped_mass":
                member, s = place_of(e["location"], nominal)
                reach = NEAR * length_of(member, nominal)
                effects.append(Hidden(("point_mass",), (member,), size["kg"], "kg", s, reach))
            case "ground_spring" | "spring_to_ground" | "ground_damper" | "damper_to_ground":
                effects.append(to_the_ground(e, nominal))
            case "axial_preload":
                member = e["location"].split()[-1]
                effects.append(Hidden(("preload",), (member,), truth.get("final_brace_tension_N"), "N"))
            case "foundation_rotational_flexibility" if e["location"].startswith("all"):
                place = (*(str(s["point"]) for s in nominal["supports"]), e["direction"])
                value = size[f"k{e['direction']}_Nm_rad"]
                effects.append(Hidden(("support_flexibility",), place, value, "N·m/rad"))
            case "named":
                reach = NEAR * (e["length"] or 0.0)
                kinds, place = tuple(e["kind"]), tuple(e["place"])
                effects.append(Hidden(kinds, place, e["value"], e["unit"], e["position"], reach))
            case "connection":
                effects.append(
                    HiddenConnection(e["location"].split()[-1], size["k"], size.get("loss_factor"))
                )
            case moved if moved in MOVED:
                (value,) = size.values()
                effects.append(HiddenMove(MOVED[moved], e["location"].split()[-1], e["member"], value))
            case "sensor_fault":
                faults.append(fault_of(e))
            case _:
                refuse(e)
    return effects, faults


def refuse(effect):
    msg = f"truth.json: '{effect['type']}' at {effect['location']} is not understood"
    raise ValueError(msg)


def in_a_joint(effect, joints):
    """Return an effect in one direction of a joint."""
    kind, symbol = ON_A_JOINT[effect["type"]]
    joint, direction = joint_of(effect["location"], joints), effect["direction"]
    if direction not in ("x", "y", "z", "rx", "ry", "rz"):
        refuse(effect)
    force, length = ("N·m", "rad") if direction.startswith("r") else ("N", "m")
    unit = {"k": f"{force}/{length}", "c": f"{force}·s/{length}", "k3": f"{force}/{length}³", "F": force}
    named = [v for key, v in effect["magnitude"].items() if re.match(rf"{symbol}({direction})?(_|$)", key)]
    return Hidden((kind,), (joint["name"], direction), named[0] if len(named) == 1 else None, unit[symbol])


def to_the_ground(effect, nominal):
    """Return a spring or a damper between the ground and a member's end."""
    kind, symbol, unit = (
        ("ground_spring", "k", "N/m") if "spring" in effect["type"] else ("ground_damper", "c", "N·s/m")
    )
    member, s = place_of(effect["location"], nominal)
    ends = [end for end, at in (("1", 0.0), ("2", length_of(member, nominal))) if abs(s - at) < 1e-6]
    if not ends or effect["direction"] not in ("x", "y", "z"):
        refuse(effect)
    place = ("end", ends[0], "of", member, effect["direction"])
    named = [v for key, v in effect["magnitude"].items() if re.match(rf"{symbol}[xyz]?(_|$)", key)]
    return Hidden((kind,), place, named[0] if len(named) == 1 else None, unit)


def fault_of(effect):
    """Return a fault of a sensor or an excitation by the one key of its magnitude."""
    ((key, value),) = ((k, v) for k, v in effect["magnitude"].items() if k in OF_A_SENSOR)
    what, sensor = OF_A_SENSOR[key], effect["location"]
    whose = "excitation" if key.startswith("excitation") else "sensor"
    if what == "swap":
        return HiddenFault("sensor_swap", sensor, other=value)
    if what == "gain" and value == -1:
        what = "sign"
    unit = {"delay": "s", "tilt": "rad", "position": "m"}.get(what, "")
    return HiddenFault(f"{whose}_{what}", sensor, value, unit)


def joint_of(location, joints):
    """Return the joint between the members that end a location such as 'lap joint A-B', or of that name."""
    word = location.split()[-1]
    members = set(word.split("-"))
    (joint,) = (j for j in joints if {j["member1"], j["member2"]} == members or j["name"] == word)
    return joint


def place_of(location, nominal):
    """Return member and position of the sensors that begin a location such as 'U7 (x=0.6 on U)'."""
    point = location.split()[0]
    (place,) = {
        (s["member"], s["position"])
        for s in nominal["sensors"]
        if point in (s["name"], s["name"][:-1], str(s.get("node")))
    }
    return place


def length_of(member, nominal):
    a, b = next((m["end1"], m["end2"]) for m in nominal["members"] if m["name"] == member)
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True)) ** 0.5


def has_solid_corners(truth, nominal):
    """Say whether a structure is welded of solids, so that its corners have a size that centre lines lack."""
    welded = nominal.get("welded", nominal["joints"])
    return isinstance(welded, str) and "OpenSees" not in truth.get("code", "")


def is_of_test(effect, test, nominal):
    """Say whether a found effect is the test's own, which truth.json calls ``instruments``."""
    if effect["kind"] == "sensor_mass":
        return bool(test.get("masses_kg"))
    true = {"stinger": "stingers_N_per_m", "driver_mass": "drivers_kg"}.get(effect["kind"])
    if true is None:
        return False
    nodes = {s["name"]: str(s["node"]) for s in nominal["sensors"]}
    place = effect["where"].partition(" at ")[2].partition(", a")[0]  # excitation at 7, across it
    return place in {nodes[name] for name in test.get(true, {})}


def is_fault_of_test(fault, test):
    """Say whether a found fault is nearer to what the test had than to none at all."""
    size = test.get(OF_THE_TEST.get(fault["kind"], ""), {}).get(fault["sensor"])
    if size is None:
        return False
    size = math.hypot(*size) if isinstance(size, list) else size - 1
    found = fault["value"] - 1 if fault["kind"] == "sensor_gain" else abs(fault["value"])
    return abs(found - size) < 0.5 * abs(found)


def without_test(result, test, nominal):
    """Return a result without what the test itself is found to be, and whether there was any such effect.

    A test that is not as described has stingers, drivers, masses and sensors that are off: who finds them is
    right, and who does not is not wrong.
    """
    effects = [e for e in result["effects"] if not is_of_test(e, test, nominal)]
    faults = [f for f in result["faults"] if not is_fault_of_test(f, test)]
    verdict = result["verdict"]
    if verdict == "effect" and not effects and result["effects"]:
        verdict = "measurement fault" if faults else "nothing missing"
    if verdict == "measurement fault" and not faults and result["faults"]:
        verdict = "nothing missing"
    return result | {"verdict": verdict, "effects": effects, "faults": faults}


def judge(effects, faults, result, corners=False):
    """Say whether a result is right.

    yes: the verdict, and every effect and fault with its kind and place, and none besides. As a twin: the
    effect is named as one that the data cannot tell from the one found. Partly: the effects are among those
    found, with others. Everything else is wrong: "unexplained" as well, where nothing is hidden. Of a
    structure with solid ``corners`` these are right beside what is hidden.
    """
    found = [e for e in result["effects"] if not (corners and e["kind"] in CORNERS)]
    beside = len(found) < len(result["effects"])
    for h in effects:
        found = h.joined(found) if isinstance(h, HiddenConnection) else found
    want = "effect" if effects or beside else "measurement fault" if faults else "nothing missing"
    if result["verdict"] != want or (found and not effects):
        return NO
    if not faults_are(faults, result["faults"]):
        return NO
    if all(any(h.is_at(f) for f in found) for h in effects):
        return YES if len(found) == len(effects) else PARTLY
    if len(found) == len(effects) and all(
        any(h.is_at(t) for f in found for t in (f, *f["twins"])) for h in effects
    ):
        return TWIN
    return NO


def faults_are(faults, found):
    """Say whether the faults that were found are those that are hidden."""
    return len(found) == len(faults) and all(any(h.is_found(f) for f in found) for h in faults)


def in_words(result):
    """Return what was found, with values and standard deviations."""
    out = []
    for e in result["effects"]:
        values = ", ".join(plus_minus(p["value"], p["std"], p["unit"]) for p in e["parameters"])
        twins = f" ({len(e['twins'])} twin{'s' if len(e['twins']) > 1 else ''})" if e["twins"] else ""
        out.append(f"{e['kind']} {re.sub(' at [0-9.]+ m$', '', e['where'])}: {values}{twins}")
    for f in result["faults"]:
        value = plus_minus(f["value"], f["std"], f.get("unit", ""))
        out.append(fault_in_words(f["kind"], f["sensor"], value, f.get("other", "")))
    return "; ".join(out) or "-"


def fault_in_words(kind, sensor, value, other):
    whose, what = kind.split("_", 1)
    name = f"excitation {sensor}" if whose == "excitation" else sensor
    words = {"sign": "sign", "swap": f"swapped with {other}", "position": f"off by {value}"}
    return f"{name} {words.get(what, f'{what} {value}')}"


def plus_minus(value, std, unit):
    """Write a value with two digits of its standard deviation, or four of its own."""
    unit = "" if unit in ("", "-") else f" {unit}"
    if not std:
        return f"{value:.4g}{unit}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f}{unit}"


def hidden_in_words(effects, faults):
    return "; ".join(map(str, [*effects, *faults])) or "nothing"


def as_told(truth):
    """Return what a truth that is not understood says of its effects in its own words."""
    if truth is None:
        return "not in truth.json"
    effects = truth.get("effects", []) if isinstance(truth, dict) else truth
    if not isinstance(effects, list):
        return str(effects)
    out = []
    for e in effects:
        told = e if isinstance(e, dict) else {"prose": str(e)}
        out.append(told.get("prose") or " at ".join(str(told[k]) for k in ("type", "location") if k in told))
    return "; ".join(out) or "effects are not stated"


def judge_case(truth, nominal, result):
    """Say whether a result of a case is right by its truth.json."""
    plain = without_test(result, truth.get("instruments", {}), nominal)
    return judge(*hidden_effects(truth, nominal), plain, has_solid_corners(truth, nominal))


def kind_of(truth):
    """Return what kind of thing a truth hides."""
    kinds = [e["kind"][0] if e["type"] == "named" else e["type"] for e in truth.get("effects", ())]
    return "several" if len(kinds) > 1 else "nothing" if kinds in ([], ["none"]) else kinds[0]


def about(case, truth):
    """Return what a record of a case says of the case itself, whatever becomes of it."""
    return {
        "case": case, "set": truth.get("sort", "shared"), "structure": truth.get("structure", case),
        "test": truth.get("test", "as described"), "kind": kind_of(truth),
        "spoilt": bool(truth.get("readings")), "poor_baseline": bool(truth.get("both_states")),
    }  # fmt: skip


def investigate(case, out, cap=None):
    """Convert a case and run it in a process of its own; return result.json, or what the program said.

    The record of the case is under ``record``. A diagnosis may use ``cap`` seconds of the processor.
    """
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    folder = out / case.name
    folder.mkdir(parents=True, exist_ok=True)
    study = folder / "study.toml"
    study.write_text(convert(nominal, case, study), encoding="utf-8")
    out = folder / "result"
    command = [sys.executable, "-m", "benchmarks.independent.by_evidence", str(study), str(case), str(out)]
    command += [] if cap is None else ["--cap", str(cap)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode == -signal.SIGXCPU:
        return f"{NOT_ENDED} in {cap} s"
    if done.returncode:
        return done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit code {done.returncode}"
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    record = out / "record.json"
    if record.exists():
        result["record"] = json.loads(record.read_text(encoding="utf-8"))
    return result


def row(case, result, truth):
    """Return a line of the table; ``truth`` is None for a case that truth.json does not have."""
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    try:
        known = hidden_effects(truth, nominal)
    except NOT_UNDERSTOOD:
        known, hidden = None, as_told(truth)
    else:
        hidden = hidden_in_words(*known)
    if isinstance(result, str):
        return (case.name, hidden, "failed", result, NO, "-", "-", "-")
    errors = " → ".join(f"{s['fit']:.2f}" for s in result["error_db"]) or "-"
    return (
        case.name,
        hidden,
        result["verdict"],
        in_words(result),
        judge_case(truth, nominal, result) if known else NOT_JUDGED,
        errors,
        f"{result['noise_floor_db']:.2f}" if result["error_db"] else "-",
        f"{result['seconds']:.0f}",
    )


def evidence_row(result):
    """Return the cells of what the posterior says of a case."""
    told = {} if isinstance(result, str) else result.get("record", {}).get("evidence")
    if not told:
        return ("-",) * len(POSTERIOR)
    truth = "-" if told["truth"] is None else f"{told['truth']:+.1f}"
    shares = (f"{100 * told[key]:.1f} %" for key in ("probability", "place_probability"))
    return (*shares, "yes" if told["in_three"] else "no", truth, told["loss"])


def record_of(case, result, truth):
    """Return the record of a case, also of one that failed or did not end."""
    if isinstance(result, str):
        return about(case, truth or {}) | {"outcome": NOT_ENDED if result.startswith(NOT_ENDED) else "failed"}
    return result.get("record", about(case, truth or {}))


def write_records(records, path):
    """Write the records of cases as lines of JSON, for `benchmarks.calibration` and `summary`."""
    lines = [json.dumps(r, ensure_ascii=False) + "\n" for r in records]
    path.write_text("".join(lines), encoding="utf-8")


def count(rows):
    """Return how many rows are right of those that were judged."""
    verdicts = [r[HEAD.index("right")] for r in rows]
    judged = len(rows) - verdicts.count(NOT_JUDGED)
    rest = "" if judged == len(rows) else f"; {len(rows) - judged} not judged"
    return f"{verdicts.count(YES)} of {judged} right{rest}"


def markdown(rows, head=HEAD):
    """Return a table in Markdown with aligned columns."""
    every = [head, *rows]
    widths = [max(len(r[k]) for r in every) for k in range(len(head))]
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
    parser.add_argument(
        "--cap", type=int, metavar="SECONDS", help="a case has not ended after so many of the processor"
    )
    options = parser.parse_args(argv)
    cases = [p.parent for p in sorted(options.cases.glob("*/nominal.json")) if options.only in p.parent.name]
    if not cases:
        sys.stderr.write(f"{options.cases}: there are no cases\n")
        return 2

    def run(case):
        result = investigate(case, options.out, options.cap)
        sys.stderr.write(f"{case.name}: {result if isinstance(result, str) else result['verdict']}\n")
        return result

    with ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(run, cases))
    told = options.cases / "truth.json"
    truth = json.loads(told.read_text(encoding="utf-8")) if told.exists() else {}
    rows = [row(case, result, truth.get(case.name)) for case, result in zip(cases, results, strict=True)]
    rows = [(*cells, *evidence_row(result)) for cells, result in zip(rows, results, strict=True)]
    records = [record_of(c.name, r, truth.get(c.name)) for c, r in zip(cases, results, strict=True)]
    write_records(records, options.out / "records.jsonl")
    text = f"{markdown(rows, (*HEAD, *POSTERIOR))}\n\n{count(rows)}\n\n{summarise(records, options.out)}"
    (options.out / "table.md").write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    return int(any(isinstance(r, str) and not r.startswith(NOT_ENDED) for r in results))


if __name__ == "__main__":
    sys.exit(main())
