"""Learn the form of frames that lack nothing: python -m benchmarks.independent.learned_form CASES ...

Each CASES is a folder of cases, such as `benchmarks.independent.foreign` writes with `--sort nothing`. They
are fitted once, with the present priors. What the data say of the form's parameters, whatever the priors are,
follows from the fit's covariance; mean and standard deviation of each kind of parameter are those with the
highest evidence of all cases together. The evidence of a third of the cases is computed with what the others
taught.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from dovetail import load_study
from dovetail.pipeline import fit_settings, measured, without_held_out
from fem.array_types import Floats
from updating.diagnosis.evidence.diagnosis import prepare_search, search_of_problem

Priors = Mapping[str, tuple[float, float]]
"""Mean and standard deviation of kinds of parameters [unit of the parameter]."""
WIDTH = 2.0
"""Standard deviation of the logarithm of how far the learned deviations are from the present ones [-]."""
N_PARTS = 3


@dataclass(frozen=True)
class Known:
    """What the data of a case say of its form.

    Attributes
    ----------
    name : str
    kinds : tuple of str
        Of each of n parameters.
    now : ndarray (2, n)
        Means and standard deviations of the present priors.
    value, std : ndarray (n,)
        Of the fit.
    precision : ndarray (n, n)
        Of the data alone.
    pull : ndarray (n,)
        The precision times the values that the data alone would have.
    """

    name: str
    kinds: tuple[str, ...]
    now: Floats
    value: Floats
    std: Floats
    precision: Floats
    pull: Floats

    def log_evidence(self, priors: Priors) -> float:
        """Return the logarithm of the evidence with other priors, up to a constant of the case."""
        own = [priors.get(kind, tuple(now)) for kind, now in zip(self.kinds, self.now.T, strict=True)]
        mean, std = np.array(own).T
        A, b = self.precision + np.diag(std**-2.0), self.pull + mean / std**2
        log_det = np.linalg.slogdet(A)[1] + 2 * np.log(std).sum()
        return 0.5 * float(b @ np.linalg.solve(A, b) - log_det - ((mean / std) ** 2).sum())


def known(case: Path, folder: Path) -> Known | None:
    """Fit a case in which nothing is missing; None if the model does not explain its data."""
    path = folder / case.name / "study.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    convert = (sys.executable, "-m", "benchmarks.independent.convert", str(case / "nominal.json"), str(path))
    subprocess.run(convert, check=True)
    study = load_study(path)
    data = without_held_out(study, measured(study, phases=False)[0])
    prepared = prepare_search(study.model, data, study.nuisances, **fit_settings(study))
    search = search_of_problem(*prepared, progress=lambda text, done: None)
    if not search.explains:
        return None
    problem, fitted = prepared[0], search.best.fitted
    refs = list(fitted.values)
    form = [
        (refs.index(n.refs[0]), n)
        for n in problem.nuisances
        if len(n.refs) == 1 and n.refs[0] in refs and kind_of(problem.reduced.model.effect(n.effect), n)
    ]
    rows = [i for i, _ in form]
    C = fitted.covariance[np.ix_(rows, rows)]
    x = np.array([fitted.values[refs[i]] for i in rows])
    now = np.array([(n.mean or 0.0, n.std) for _, n in form]).T
    kinds = tuple(kind_of(problem.reduced.model.effect(n.effect), n) for _, n in form)
    precision = np.linalg.inv(C) - np.diag(now[1] ** -2.0)
    size, V = np.linalg.eigh(precision)
    pull = np.linalg.solve(C, x) - now[0] / now[1] ** 2
    return Known(case.name, kinds, now, x, np.sqrt(np.diag(C)), V * np.maximum(size, 0.0) @ V.T, pull)


def kind_of(effect, nuisance) -> str:
    """Return the kind of a parameter of the form, "" of others."""
    place = {"section_form": "section", "clamp_form": "clamp", "zone_form": "corner"}.get(effect.kind, "")
    place = "joint" if place == "corner" and effect.around else place
    return f"{place} {nuisance.parameter}" if place else ""


def learned(cases: Sequence[Known], kinds: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return means and standard deviations of some kinds with the highest evidence of all cases together."""
    now = {kind: pair for c in cases for kind, pair in zip(c.kinds, c.now.T, strict=True)}
    kinds = [kind for kind in kinds if kind in now]
    start = np.array([now[kind] for kind in kinds])

    def priors(x: Floats) -> dict[str, tuple[float, float]]:
        return {k: (float(m), float(np.exp(s))) for k, m, s in zip(kinds, *x.reshape(2, -1), strict=True)}

    def cost(x: Floats) -> float:
        off = (x[len(kinds) :] - np.log(start[:, 1])) / WIDTH
        return 0.5 * float(off @ off) - sum(c.log_evidence(priors(x)) for c in cases)

    return priors(minimize(cost, np.concatenate([start[:, 0], np.log(start[:, 1])]), method="L-BFGS-B").x)


def held_out(cases: Sequence[Known], kinds: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield cases and how much their evidence rises by what the other parts taught [nats]."""
    for part in range(N_PARTS):
        priors = learned([c for i, c in enumerate(cases) if i % N_PARTS != part], kinds)
        for c in cases[part::N_PARTS]:
            yield c.name, c.log_evidence(priors) - c.log_evidence({})


def main() -> None:
    """Print what was learned, and how much better it predicts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--kinds", nargs="+", help='such as "corner u"; all unless given')
    options = parser.parse_args()
    folders = [p.parent for each in options.cases for p in sorted(each.glob("*/nominal.json"))]
    with tempfile.TemporaryDirectory() as folder:
        fitted = [(case, known(case, Path(folder))) for case in folders]
    cases = [c for _, c in fitted if c is not None]
    print("not explained:", ", ".join(case.name for case, c in fitted if c is None) or "none")
    kinds = options.kinds or sorted({kind for c in cases for kind in c.kinds})
    priors = learned(cases, kinds)
    print("| parameter | number | present prior | learned |\n|---|---|---|---|")
    for kind in kinds:
        now = [pair for c in cases for k, pair in zip(c.kinds, c.now.T, strict=True) if k == kind]
        mean, std = priors[kind]
        print(f"| {kind} | {len(now)} | {now[0][0]:g} ± {now[0][1]:g} | {mean:.3f} ± {std:.3f} |")
    gains = dict(held_out(cases, kinds))
    worse = ", ".join(f"{name} {gain:.1f}" for name, gain in gains.items() if gain < 0) or "none"
    print(f"held out, {len(cases)} cases: {sum(gains.values()):.0f} nats; worse: {worse}")


if __name__ == "__main__":
    main()
