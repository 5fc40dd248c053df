"""A fleet of a small frame drawn from a seed: how well triage tells outliers, and their causes.

python -m benchmarks.fleet --units 300 --outliers 24

--diagnose N also diagnoses up to N units that are more likely outliers than not, and counts how often the
cause is right.
"""

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from benchmarks.validation.calibration import Share
from dovetail import load_study
from dovetail.fleet import Fleet, Triaged, cause_text, diagnose_outliers, run_fleet
from dovetail.units import Record, pool_of
from fem import FRF, Effect, Model, assemble, compute_frf
from fem.io import write_npz
from updating import propose, sensor_rows
from updating.correlation import DB_PER_NEPER

STUDY = """
[study]
name = "fleet"
[points]
a = [0.0, 0.0, 0.0]
b = [0.0, 0.0, 0.5]
c = [0.4, 0.0, 0.5]
d = [0.4, 0.3, 0.5]
[members.post]
from = "a"
to = "b"
[members.beam]
from = "b"
to = "c"
[members.arm]
from = "c"
to = "d"
[materials.steel]
E = 210e9
rho = 7850.0
[sections.bar]
shape = "rectangle"
b = 0.03
h = 0.02
[[supports]]
point = "a"
[[sensors]]
name = "bx"
point = "b"
direction = "x"
[[sensors]]
name = "by"
point = "b"
direction = "y"
[[sensors]]
name = "cz"
point = "c"
direction = "z"
[[sensors]]
name = "dz"
point = "d"
direction = "z"
[[sensors]]
name = "dx"
point = "d"
direction = "x"
[[excitations]]
sensor = "by"
[[excitations]]
sensor = "dz"
[damping]
modal = 0.01
[frequency]
start = 2.0
stop = 500.0
step = 2.0
[fit]
model_error = 0.05
[uncertain]
E = 0.02
rho = 0.01
damping = 0.3
"""
"""The frame: a post, a beam and an arm, welded."""

NOISE = 0.01
"""Relative noise of each FRF [-]."""
SCATTER = {"E": 0.01, "rho": 0.005, "damping": 0.1}
"""Standard deviations of the logarithms over the units [-]."""
KINDS = ("point_mass", "stiffness_loss", "support_flexibility", "distributed_mass")
"""Kinds of what is wrong with an outlier."""
VISIBLE = (0.5, 3.0)
"""Root mean square change of the FRFs by an outlier's effect, from and to [dB]."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A fleet on disk.

    ``effects`` has the effect of each unit, None for a regular one.
    """

    study: Path
    files: tuple[Path, ...]
    effects: tuple[Effect | None, ...]
    seconds: float


def draw_fleet(
    folder: Path,
    seed: int,
    n: int,
    n_outliers: int,
    study: str = STUDY,
    wrong: float = 0.0,
    spread: float = 0.0,
) -> Drawn:
    """Write a study and the FRFs of units into a folder.

    With ``wrong`` the foot of each unit turns about y with this stiffness [N·m/rad], which the study's model
    does not have, and whose logarithm scatters by ``spread``.
    """
    rng, start = np.random.default_rng(seed), time.process_time()
    path = folder / "study.toml"
    path.write_text(study)
    base = load_study(path)
    model, f = base.model.with_mesh(base.model.mesh.split(2)), base.frequency
    ends = [sensor_rows(model, part) for part in (base.sensors, base.excitations)]
    names = [[s.name for s in part] for part in (base.sensors, base.excitations)]

    def frfs(m: Model) -> np.ndarray:
        return compute_frf(assemble(m), f, *ends).H

    (foot,) = (c for c in propose(model, ("support_flexibility",)) if c.name.endswith("a.ry"))

    def standing(m: Model, stiffness: float) -> Model:
        return foot.with_values(stiffness=stiffness).added_to(m) if wrong else m

    nominal = frfs(standing(model, wrong))
    candidates = [c for c in propose(model, KINDS) if c.name != foot.name]
    files, effects = [], []
    outliers = set(rng.choice(n, n_outliers, replace=False).tolist())
    for k in range(n):
        z = rng.normal(size=3)
        unit = model.with_values(
            {
                ("frame", "E:steel"): 210e9 * np.exp(SCATTER["E"] * z[0]),
                ("frame", "rho:steel"): 7850 * np.exp(SCATTER["rho"] * z[1]),
            }
        )
        damping = replace(model.damping, ratio=model.damping.ratio * np.exp(SCATTER["damping"] * z[2]))
        effect = None
        while k in outliers and effect is None:
            effect = _visible(rng, candidates, standing(model, wrong), frfs, nominal)
        unit = standing(unit, wrong * np.exp(spread * rng.normal()))
        unit = unit if effect is None else effect.added_to(unit)
        H = frfs(unit.with_damping(damping))
        noise = rng.normal(size=(2, *H.shape))
        H = H * (1 + NOISE * (noise[0] + 1j * noise[1]) / np.sqrt(2))
        files.append(folder / f"unit-{k:04d}.npz")
        write_npz(files[-1], FRF.from_arrays(f, H, "accelerance", *names))
        effects.append(effect)
    return Drawn(path, tuple(files), tuple(effects), time.process_time() - start)


def _visible(rng, candidates: Sequence[Effect], model: Model, frfs, nominal) -> Effect | None:
    """Return a candidate at one of its starts that changes the FRFs as much as is wanted, or None."""
    kind = KINDS[rng.integers(len(KINDS))]
    those = [c for c in candidates if c.kind == kind]
    effect = those[rng.integers(len(those))]
    starts = effect.starts(lambda key: 1e5)
    effect = effect.with_values(**starts[rng.integers(len(starts))])
    try:
        changed = frfs(effect.added_to(model))
    except ValueError:
        return None
    size = DB_PER_NEPER * float(np.sqrt((np.log(np.abs(changed / nominal)) ** 2).mean()))
    return effect if VISIBLE[0] < size < VISIBLE[1] else None


def auc(odds: np.ndarray, wrong: np.ndarray) -> float:
    """Return the probability that an outlier has higher odds than a regular unit (Mann and Whitney)."""
    ranks, n = rankdata(odds), int(wrong.sum())
    return float((ranks[wrong].sum() - n * (n + 1) / 2) / (n * (len(odds) - n)))


def judged(effect: Effect | None, record: Record | None) -> str:
    """Return how a diagnosis names the cause of an outlier.

    - right: the kind and the member, or the support and its direction, and nothing else
    - beside: the same, and something else
    - twin: another effect, with the right one among those that the data cannot tell from it
    - wrong: anything else, faults of the measurement and "unexplained" too
    - missed: not diagnosed
    - regular: a unit with nothing wrong
    """
    if effect is None:
        return "regular"
    if record is None:
        return "missed"
    names = [f["name"] for f in record["findings"]]
    if effect.name in names:
        return "right" if len(names) == 1 and not record["faults"] else "beside"
    twins = {t["name"] for f in record["findings"] for t in f["twins"]}
    return "twin" if effect.name in twins else "wrong"


def causes(found: Triaged, effects: Sequence[Effect | None], n: int, folder: Path) -> list[str]:
    """Diagnose up to n units; print each diagnosis, and return the table of the causes."""
    with pool_of() as pool:
        records, failures = diagnose_outliers(found, n, folder, pool)
    seconds = [r["cpu_seconds"] for r in records.values()]
    at = {file: k for k, file in enumerate(found.files)}
    outcomes = [judged(effects[k], None) for k in range(len(effects)) if found.files[k] not in records]
    for file, record in records.items():
        effect = effects[at[file]]
        outcomes.append(judged(effect, record))
        true = "nothing" if effect is None else effect.name
        print(f"  {file.name} {true}: {outcomes[-1]}: {cause_text(record)}", flush=True)
    counts = Counter(outcomes)
    wrong = sum(e is not None for e in effects)
    lines = [f"  {word}: {counts[word]}" for word in ("right", "beside", "twin", "wrong", "missed")]
    share = Share(counts["right"] + counts["beside"] + counts["twin"], wrong)
    return [
        f"causes of {wrong} outliers; {np.median(seconds):.0f} s of CPU each; {len(failures)} failed",
        *lines,
        f"right cause named, alone, beside others or among twins: {share}",
        f"right cause alone: {Share(counts['right'], wrong)}",
    ]


def main() -> None:
    """Draw a fleet, triage it, and print how well outliers are told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=300)
    parser.add_argument("--outliers", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--wrong", type=float, default=0.0, help="stiffness of the foot that the model lacks")
    parser.add_argument("--spread", type=float, default=0.0, help="scatter of its logarithm")
    parser.add_argument("--diagnose", type=int, default=0, help="outliers that are diagnosed")
    parser.add_argument("--keep", type=Path, help="folder that keeps the fleet")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        name = options.keep or Path(scratch)
        name.mkdir(exist_ok=True)
        drawn = draw_fleet(
            name, options.seed, options.units, options.outliers, wrong=options.wrong, spread=options.spread
        )
        print(f"drawn in {drawn.seconds:.1f} s of CPU")
        start = time.process_time()
        fleet = Fleet.of(drawn.study.read_text(), drawn.study, drawn.files)
        built = time.process_time()
        with pool_of() as pool:
            found = run_fleet(fleet, drawn.files, Path(name, "out"), pool)
        each = (time.process_time() - built) / len(drawn.files)
        p, wrong = found.population, np.array([e is not None for e in drawn.effects])
        print(f"basis in {built - start:.2f} s; {1e3 * each:.0f} ms of CPU a unit: {3600 / each:.0f} an hour")
        print(f"AUC {auc(p.odds, wrong):.4f}; share of outliers {p.share:.3f}, true {wrong.mean():.3f}")
        flagged = p.probability > 0.5
        print(f"more likely than not: {flagged.sum()}, of them regular {(flagged & ~wrong).sum()}")
        for k in p.order[: options.outliers + 6]:
            effect = drawn.effects[k]
            print(f"  {found.files[k].name} {p.probability[k]:.4f} rest {p.rest[k]:9.3g}", end=" ")
            print(f"distance {p.distance[k]:9.3g} {'' if effect is None else effect.name}")
        if options.diagnose:
            print("\n".join(causes(found, drawn.effects, options.diagnose, Path(name, "out"))))


if __name__ == "__main__":
    main()
