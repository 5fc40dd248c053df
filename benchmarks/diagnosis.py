"""Time the search for a missing effect: the cross-beam, the same with a ten times finer mesh, and a tower.

Run it with one thread:  OPENBLAS_NUM_THREADS=1 python -m benchmarks.diagnosis [beams] [tower]
"""

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from dovetail import load_study
from fem import (
    FRF,
    Damping,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    Support,
    assemble,
    compute_frf,
    solve_modes,
)
from fem.effects import StiffnessLoss
from updating import Diagnosis, Measurement, Nuisance, Sensor, diagnose, propose

STUDY = Path(__file__).parents[1] / "examples" / "cross-beam" / "study.toml"


class Clock:
    """Adds up how long each kind of work takes, by the first word that the search says of it."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self._word, self._since = "", time.process_time()

    def __call__(self, text: str, done: float) -> None:
        """Take a message of the search."""
        now = time.process_time()
        self.seconds[self._word] += now - self._since
        self._word, self._since = text.split()[0], now

    def total(self) -> float:
        """Return all of it [s]."""
        return float(sum(self.seconds.values()))


def timed(model: Model, measurement: Measurement, nuisances: tuple[Nuisance, ...]) -> tuple[Diagnosis, Clock]:
    """Diagnose and return the times of the parts."""
    clock = Clock()
    found = diagnose(model, [measurement], nuisances, progress=clock)
    clock("end", 1.0)
    return found, clock


def line(name: str, model: Model, measurement: Measurement, nuisances: tuple[Nuisance, ...]) -> float:
    """Print one row of the table and return the seconds."""
    n = len(propose(model, test=measurement))
    found, clock = timed(model, measurement, nuisances)
    lines = measurement.frf.n_freq
    parts = ", ".join(f"{word} {s:.1f}" for word, s in clock.seconds.most_common(7) if word and s > 0.05)
    what = " and ".join(f"{f.effect.kind} {f.effect.where}" for f in found.findings) or found.verdict
    print(f"{name:22s}{model.n_dof:8d}{n:8d}{lines:7d}{clock.total():9.1f}  {parts}")
    print(f"{'':22s}{what}", flush=True)
    return clock.total()


def beams() -> None:
    """Time the example study as it is and with every element cut into ten."""
    study = load_study(STUDY)
    args = study.measurements[0], study.nuisances
    once = line("cross-beam", study.model, *args)
    fine = line("ten times finer", study.model.with_mesh(study.model.mesh.split(10)), *args)
    print(f"{'':22s}ratio {fine / once:.2f}")


def tower(storeys: int = 25, per_member: int = 12) -> tuple[Model, Measurement]:
    """Return a braced tower of 16 members a storey, and FRFs of it with one member softer in its middle."""
    corners = np.array([[0, 0], [1.2, 0], [1.2, 1.2], [0, 1.2]])
    points = np.array([[x, y, 1.0 * k] for k in range(storeys + 1) for x, y in corners])
    lines, sets = [], {}
    for k in range(storeys):
        low, high = 4 * k, 4 * (k + 1)
        for i in range(4):
            j = (i + 1) % 4
            for word, a, b in (
                ("leg", low + i, high + i),
                ("beam", high + i, high + j),
                ("brace", low + i, high + j),
                ("tie", low + j, high + i),
            ):
                sets[f"{word}{k + 1}{'abcd'[i]}"] = [len(lines)]
                lines.append([a, b])
    mesh = Mesh.from_lines(points, lines, sets).split(per_member)
    steel = Material("steel", 210e9, 7850.0)
    leg, other = Section.tube(0.030, 0.003), Section.rectangle(0.02, 0.005)
    members = {m: MemberProperties(steel, leg if m.startswith("leg") else other) for m in mesh.members}
    feet = tuple(Support(name=f"foot{i + 1}", point=i) for i in range(4))
    model = Model(mesh, (Frame(members=members), *feet), Damping.modal(0.01))
    at = [4 * k + i for k in range(3, storeys + 1, 3) for i in (0, 2)]
    sensors = [
        Sensor(name=f"{p}{d}", point=points[p], direction=np.eye(3)["xyz".index(d)]) for p in at for d in "xy"
    ]
    drives = [sensors[-1], sensors[len(sensors) // 2]]
    return model, _measured(model, sensors, drives)


def _measured(model: Model, sensors: list[Sensor], drives: list[Sensor]) -> Measurement:
    length = model.mesh.member_length("leg4b")
    hidden = StiffnessLoss(
        name="hidden", member="leg4b", position=0.5 * length, loss=0.85, width=0.1 * length, length=length
    )
    f = solve_modes(assemble(model), 24).frequency
    frequency = np.linspace(0.5 * f[0], f[-1], 1000)
    rows = [[_point(model, s) for s in part] for part in (sensors, drives)]
    H = compute_frf(assemble(model.with_effect(hidden)), frequency, *rows, kind="accelerance").H
    rng = np.random.default_rng(0)
    H = H * (1 + 0.01 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2))
    names = [[s.name for s in part] for part in (sensors, drives)]
    return Measurement(FRF.from_arrays(frequency, H, "accelerance", *names), tuple(sensors), tuple(drives))


def _point(model: Model, sensor: Sensor) -> tuple[int, str]:
    distance = np.linalg.norm(model.mesh.points - sensor.point, axis=1)
    return int(np.argmin(distance)), "xyz"[int(np.argmax(sensor.direction))]


if __name__ == "__main__":
    chosen = sys.argv[1:] or ["beams", "tower"]
    print("CPU seconds of one core\n")
    print(f"{'':22s}{'DOFs':>8s}{'cands.':>8s}{'lines':>7s}{'seconds':>9s}  of which")
    if "beams" in chosen:
        beams()
    if "tower" in chosen:
        uncertain = Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.01)
        line("tower", *tower(), uncertain)
