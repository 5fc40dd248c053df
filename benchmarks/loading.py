"""Time loading a study against computing its model's FRFs once.

A study that is loaded compares what was measured with the model: unit, kind, phase, frequency axis. Three
structures: a portal of 20 m with thin sections and FRFs like the model's; the same with FRFs that are not,
for which other units are tried; a cubic frame with few modes in the band.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.loading

Seconds depend on the machine; the ratio of loading to one computation is what to compare.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import TypeVar

import numpy as np

from dovetail.file.config import StudyContents, load_study
from fem import FRF, assemble, compute_frf
from fem.io import write_npz
from updating import sensor_rows

T = TypeVar("T")

HEAD = """
[materials.steel]
E = 210e9
rho = 7850.0
[defaults]
material = "steel"
section = {{ shape = "rectangle", b = {b}, h = {h} }}
[damping]
modal = 0.005
[frequency]
stop = {stop}
[[excitations]]
sensor = "one"
"""


def portal(size: float, b: float, h: float, stop: float) -> str:
    """Return a study of two clamped columns and a beam with three sensors, without a measurement."""
    points = {"a": (0, 0, 0), "b": (0, 0, size), "c": (size, 0, size), "d": (size, 0, 0)}
    members = [("a", "b"), ("b", "c"), ("d", "c")]
    places = [("ab", 0.43, "x"), ("bc", 0.29, "z"), ("dc", 0.57, "x")]
    return _text(points, members, ["a", "d"], [(m, p * size, d) for m, p, d in places], b, h, stop)


def cube(n: int, stop: float) -> str:
    """Return a study of a cubic frame of n points a side, 1 m apart and held at its base."""
    points = {f"p{i}-{j}-{k}": (i, j, k) for i, j, k in product(range(n), repeat=3)}
    members = [
        (f"p{i}-{j}-{k}", f"p{i + x}-{j + y}-{k + z}")
        for i, j, k in product(range(n), repeat=3)
        for x, y, z in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
        if max(i + x, j + y, k + z) < n
    ]
    feet = [f"p{i}-{j}-0" for i, j in product(range(n), repeat=2)]
    high = f"p0-0-{n - 2}p0-0-{n - 1}"
    return _text(points, members, feet, [(high, 0.5, "x"), (high, 0.25, "y")], 0.05, 0.05, stop)


def _text(
    points: Mapping[str, tuple[float, ...]],
    members: list[tuple[str, str]],
    feet: list[str],
    sensors: list[tuple[str, float, str]],
    b: float,
    h: float,
    stop: float,
) -> str:
    names = ("one", "two", "three")
    lines = ["[points]", *(f"{name} = {list(map(float, xyz))}" for name, xyz in points.items()), "[members]"]
    lines += [f'{p}{q} = {{ from = "{p}", to = "{q}" }}' for p, q in members]
    lines += [f'[[supports]]\npoint = "{p}"' for p in feet]
    lines += [
        f'[[sensors]]\nname = "{name}"\npoint = {{ member = "{m}", position = {p} }}\ndirection = "{d}"'
        for name, (m, p, d) in zip(names, sensors, strict=False)
    ]
    return "\n".join(lines) + HEAD.format(b=b, h=h, stop=stop)


def timed(call: Callable[[], T]) -> tuple[float, T]:
    """Return the processor time of a call [s], and its result."""
    start = time.process_time()
    out = call()
    return time.process_time() - start, out


def computed(study: StudyContents, frequency: np.ndarray) -> FRF:
    """Compute the FRFs of a study's model by the reduced engine."""
    rows, columns = (sensor_rows(study.model, part) for part in (study.sensors, study.excitations))
    frf = compute_frf(assemble(study.model), frequency, rows, columns, method="reduced")
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    return FRF.from_arrays(frequency, frf.H, frf.kind, *names)


def rows() -> Iterator[str]:
    """Yield one line of the table after the other."""
    for name, text, stop in (
        ("portal 20 m, 30 x 8 mm", portal(20.0, 0.03, 0.008, 500.0), 500.0),
        ("cube of 6 points a side", cube(6, 60.0), 60.0),
    ):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "study.toml"
            file.write_text(text, encoding="utf-8")
            bare, study = timed(lambda file=file: load_study(file))
            frequency = np.linspace(stop / 100, stop, 500)
            once, frf = timed(lambda study=study, f=frequency: computed(study, f))
            file.write_text(f'{text}\n[[measurements]]\nfile = "m.npz"\n', encoding="utf-8")
            for what, H in (("its own", frf.H), ("others", np.roll(frf.H, 150, axis=0)[:, ::-1] * 0.1)):
                noise = 0.01 * np.random.default_rng(0).standard_normal(H.shape)
                write_npz(
                    file.with_name("m.npz"),
                    FRF.from_arrays(frequency, H * (1 + noise), frf.kind, frf.outputs, frf.inputs),
                )
                load, _ = timed(lambda file=file: load_study(file))
                yield (
                    f"{name:26s}{study.model.mesh.n_lines:9d}{what:>9s}{bare:8.2f}{once:9.2f}{load:9.2f}"
                    f"{load / (once + bare):9.2f}"
                )


def main() -> None:
    """Print the table."""
    print("                                                 [s]   FRFs [s]  load [s]")
    print("study                      elements     FRFs  model  reduced  measured    ratio")
    for row in rows():
        print(row)
        sys.stdout.flush()


if __name__ == "__main__":
    main()
