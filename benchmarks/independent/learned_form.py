"""Learn the form of frames that lack nothing: python -m benchmarks.independent.learned_form CASES ...

Each CASES is a folder of cases, such as `benchmarks.independent.foreign` writes with `--sort nothing`. They
are fitted once, with the present priors, and learned from as `dovetail learn` does. The evidence of a third
of the cases is computed with what the others taught.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from dovetail import load_study
from dovetail.learning import form_data
from updating.inference.learned_form import FormData, Kind, learned, usual

N_PARTS = 3


def known(case: Path, folder: Path) -> FormData | None:
    """Fit a case in which nothing is missing; None if the model does not explain its data."""
    path = folder / case.name / "study.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    convert = (sys.executable, "-m", "benchmarks.independent.convert", str(case / "nominal.json"), str(path))
    subprocess.run(convert, check=True)
    return form_data(load_study(path))


def held_out(cases: Mapping[str, FormData], kinds: Collection[Kind]) -> Iterator[tuple[str, float]]:
    """Yield cases and how much their evidence rises by what the other parts taught [nats]."""
    for part in range(N_PARTS):
        priors = learned([c for i, c in enumerate(cases.values()) if i % N_PARTS != part], kinds)
        for name, c in list(cases.items())[part::N_PARTS]:
            yield name, c.log_evidence(priors) - c.log_evidence({})


def main() -> None:
    """Print what was learned, and how much better it predicts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--kinds", nargs="+", help='such as "corner u"; all unless given')
    options = parser.parse_args()
    folders = [p.parent for each in options.cases for p in sorted(each.glob("*/nominal.json"))]
    with tempfile.TemporaryDirectory() as folder:
        fitted = {case.name: known(case, Path(folder)) for case in folders}
    cases = {name: c for name, c in fitted.items() if c is not None}
    print("not explained:", ", ".join(name for name, c in fitted.items() if c is None) or "none")
    now = usual(cases.values())
    kinds = [kind for kind in sorted(now) if not options.kinds or " ".join(kind) in options.kinds]
    priors = learned(list(cases.values()), kinds)
    print("| parameter | number | present prior | learned |\n|---|---|---|---|")
    for kind in kinds:
        number = sum(k == kind for c in cases.values() for k in c.kinds)
        (before, width), (mean, std) = now[kind], priors[kind]
        print(f"| {' '.join(kind)} | {number} | {before:g} ± {width:g} | {mean:.3f} ± {std:.3f} |")
    gains = dict(held_out(cases, kinds))
    worse = ", ".join(f"{name} {gain:.1f}" for name, gain in gains.items() if gain < 0) or "none"
    print(f"held out, {len(cases)} cases: {sum(gains.values()):.0f} nats; worse: {worse}")


if __name__ == "__main__":
    main()
