"""A measured cantilever, one of six masses left out of its model: python -m benchmarks.measured_masses FILE

FILE holds ``position`` (n, 6) [m] of the masses and ``peaks`` (n, 4) [Hz] of n samples (de Sousa and Machado,
Data in Brief, 2024). Each sample is diagnosed six times with a model that lacks one of its masses, and once
with the model that has all of them. The truth is a point mass where the missing one is. Samples are divided
in two: a half on which designs are compared, and a half that is reported once. Frequencies are multiplied by
the mean ratio of model and measurement over the first half. Queries that OUT has are not run again.
"""

import argparse
import json
import resource
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail import load_study
from dovetail.file.config import load_study as contents_of
from dovetail.pipeline import diagnose_any
from dovetail.result import diagnosis_dict

CALIBRATED = 0, 4, 8, 12, 16
"""Samples on which E, the spring and the masses of the model were calibrated: they belong to the design."""
MASS, SURE, NEAR = 0.0217, 0.9, 0.02
"""The masses [kg]; the probability from which a wrong answer is a sure one; distance between places [m]."""
FORMS = {
    "one-to-ten": "[candidates]\nmissing = 0.09\n",
    "thickness-one-to-ten": "[form]\nsize = 1e-5\n[candidates]\nmissing = 0.09\n",
    "default": "",
    "thickness": "[form]\nsize = 1e-5\n",
    "most": "[candidates]\nmissing = 0.8\n",
}
STUDY = """
[points]
clamp = [0.0, 0.0, 0.0]
tip = [0.38, 0.0, 0.0]
[members.beam]
from = "clamp"
to = "tip"
[materials.steel]
E = 199e9
rho = 7850.0
nu = 0.3
[sections.strip]
shape = "rectangle"
b = 0.032
h = 0.00475
nu = 0.3
[uncertain]
E = 0.005
rho = 0.005
joints = 0.1
[[joints]]
name = "clamp"
point1 = "clamp"
rigid = "x y z rx rz"
k = {{ kry = 1.195e4 }}
[[masses]]
name = "accelerometer"
point = "tip"
mass = 0.008
{masses}
[damping]
modal = 0.008
[modes]
frequency = {frequency}
frequency_std = 0.006
plane = "xz"
numbers = [2, 3, 4, 5]
{form}
"""
HANGING = """
[[masses]]
name = "m{number}"
point = {{ member = "beam", position = {position:.5f} }}
mass = 0.0217
inertia = 1.42e-5
"""


def text_of(positions: Sequence[float], frequency: Sequence[float], missing: int = 0, form: str = "") -> str:
    """Return a study whose model lacks one mass, counted from 1; 0 for none."""
    numbers = [k for k in range(1, 7) if k != missing]
    masses = "".join(HANGING.format(number=k, position=positions[k - 1]) for k in numbers)
    return STUDY.format(masses=masses, frequency=[round(float(f), 3) for f in frequency], form=form)


def halves(n: int) -> tuple[list[int], list[int]]:
    """Return the samples on which designs are compared and those that are reported once."""
    order = [i for i in np.random.default_rng(70).permutation(n).tolist() if i not in CALIBRATED]
    size = n // 2 - len(CALIBRATED)
    return sorted([*CALIBRATED, *order[:size]]), sorted(order[size:])


def ratios_of(folder: Path, samples: Any, design: Sequence[int]) -> Any:
    """Return the mean ratio of the model's frequencies to the measured ones, (4,) [-]."""
    out = []
    for i in design:
        path = folder / "full.toml"
        path.write_text(text_of(samples["position"][i], samples["peaks"][i]))
        modes = load_study(path).compare()
        out.append(np.asarray(modes.computed) / np.asarray(modes.measured))
    return np.mean(out, axis=0)


def queries(half: Sequence[int], full: bool) -> Iterator[tuple[int, int]]:
    """Yield sample and missing mass; 0 stands for none."""
    for i in half:
        yield from ((i, k) for k in ((0,) if full else range(1, 7)))


def is_truth(explanation: dict[str, Any], place: float | None) -> bool:
    """Whether an explanation is the missing mass, within two standard deviations of its place or 20 mm."""
    effects = explanation["effects"]
    if place is None or len(effects) != 1 or effects[0]["kind"] not in ("point_mass", "distributed_mass"):
        return place is None and not effects
    (position,) = (p for p in effects[0]["parameters"] if p["name"] == "position")
    return abs(position["value"] - place) <= max(NEAR, 2 * (position["std"] or 0.0))


def ended(*_: object) -> None:
    """End a query that takes too long."""
    msg = "over the cap"
    raise TimeoutError(msg)


def judged(path: Path, place: float | None, cap: int) -> dict[str, Any]:
    """Return what a diagnosis of a study gave, and whether it is right."""
    began = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    signal.signal(signal.SIGPROF, ended)
    signal.setitimer(signal.ITIMER_PROF, cap)
    try:
        found = diagnosis_dict(diagnose_any(contents_of(path), lambda text, done: None, 1, "normal"))
    except TimeoutError:
        return {"verdict": "not ended", "sets": 0, "in_set": False, "right": False, "probability": 0.0}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    credible = found["credible"]
    return {
        "verdict": found["verdict"],
        "first": credible[0]["explanation"],
        "probability": credible[0]["probability"],
        "right": is_truth(credible[0], place),
        "in_set": any(is_truth(e, place) for e in credible),
        "sets": len(credible),
        "set": [(e["explanation"], round(e["probability"], 4)) for e in credible],
        "cpu": resource.getrusage(resource.RUSAGE_SELF).ru_utime - began,
    }


def row_of(name: str, records: Sequence[dict[str, Any]]) -> str:
    """Return a line of the table: how many are right, in the set, sure and wrong, and the size of the set."""
    n = len(records)
    right, held = (sum(r[key] for r in records) for key in ("right", "in_set"))
    wrong = sum(not r["right"] and r["probability"] >= SURE for r in records)
    nothing = sum(r["verdict"] == "nothing missing" for r in records)
    size = np.median([r["sets"] for r in records])
    cpu = np.median([r.get("cpu", np.nan) for r in records])
    return (
        f"| {name} | {n} | {right} | {held} ({100 * held / n:.0f} %) | {wrong} | {nothing} | "
        f"{size:.0f} | {np.mean([r['sets'] for r in records]):.1f} | {cpu:.1f} |"
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Run the queries of a half that are not there yet, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measured_masses", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("out", type=Path, help="file of the records, .jsonl")
    parser.add_argument("--half", choices=("design", "reported"), default="design")
    parser.add_argument("--form", choices=tuple(FORMS), default="default")
    parser.add_argument("--every", type=int, default=1, help="run a random n-th of the queries")
    parser.add_argument("--cap", type=int, default=60, help="CPU seconds after which a query is ended")
    options = parser.parse_args(argv)
    samples = np.load(options.file)
    design, reported = halves(len(samples["peaks"]))
    half = design if options.half == "design" else reported
    lines = options.out.read_text().splitlines() if options.out.exists() else ()
    known = {tuple(r["query"]): r for r in map(json.loads, lines)}
    with tempfile.TemporaryDirectory() as folder, options.out.open("a") as out:
        ratio = ratios_of(Path(folder), samples, design)
        every = list(queries(half, False))
        some = sorted(np.random.default_rng(1).permutation(len(every))[:: options.every].tolist())
        chosen = [*(every[k] for k in some), *queries(half, True)]
        for sample, missing in chosen:
            key = (options.form, sample, missing)
            if key in known:
                continue
            positions, peaks = samples["position"][sample], samples["peaks"][sample] * ratio
            path = Path(folder) / f"sample-{sample}-{missing}.toml"
            path.write_text(text_of(positions, peaks, missing, FORMS[options.form]))
            began = time.perf_counter()
            record = judged(path, float(positions[missing - 1]) if missing else None, options.cap)
            known[key] = record | {"query": key, "wall": time.perf_counter() - began}
            out.write(json.dumps(known[key]) + "\n")
            out.flush()
    rows = [known[options.form, sample, missing] for sample, missing in chosen]
    print("| queries | n | right | in the 90 % set | sure and wrong | nothing | set, median | mean | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    print(row_of("one mass left out", [r for r in rows if r["query"][2]]))
    print(row_of("nothing left out", [r for r in rows if not r["query"][2]]))


if __name__ == "__main__":
    main()
