"""Whether stated deviations of fits are right: z of every parameter over noisy sets whose truth is drawn.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.deviations [--sets 40] [--drawn] [--strain]

All that is uncertain is drawn from its prior: parameters of the study, damping, and, unless ``--drawn`` takes
the form as drawn, the form and its small deviations. FRFs of that model, or with ``--strain`` those of three
gauges on each member, get noise of 1 %; then the effect is fitted with everything else. The root mean square
of z = (fitted - true) / deviation is 1 where deviations are right.
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dovetail import Study, load_study
from dovetail.pipeline import formed_fit_problem
from fem import Effect, parameter_values
from fem.model import ParameterRef
from updating import FitProblem, Measurement, StrainGauge, computed_frf, place_sensors
from updating.inference import Solution, fit_given
from updating.inference.scatter import form_scatter

EXAMPLES = Path(__file__).parents[1] / "examples"
CASES = (
    ("first-frame", "support_flexibility:left foot.ry", 2e4),
    ("cross-beam", "joint_stiffness:J.rx", 200.0),
    ("southampton-frame", "joint_stiffness:A1+B1+C1+D1+A2+B2+C2+D2+A3+B3+C3+D3.ry", 920.0),
)
"""Studies, and the effect that each of their data sets has, with its value."""
BASIS_LINES = 60
"""Lines at which responses of a truth join the basis that it is computed on."""
FAR = 3.0
"""A fit that ends at more than so many times the level of the noise has not found its minimum: it is lost."""
SHARES, OFFSET = (0.15, 0.5, 0.85), (0.015, 0.02)
"""Where gauges are along their members [-], and their distances from the axes [m]."""
NOISE = 0.01
"""Relative standard deviation of real and imaginary part of each FRF."""


def with_gauges(study: Study) -> Study:
    """Return a study whose sensors are gauges at the surface of its members, with the model's own FRFs."""
    gauges, mesh = [], study.model.mesh
    for name in mesh.members:
        s = mesh.member_positions(name)
        axis = np.diff(mesh.points[mesh.member_points(name)[[0, -1]]], axis=0)[0]
        for k, share in enumerate(SHARES):
            place = mesh.points[mesh.member_points(name)[0]] + share * axis
            label, along = f"{name} {k + 1}", axis / s[-1]
            gauges.append(StrainGauge(label, place, along, member=name, offset=OFFSET))
    sensors = tuple(gauges)
    model = study.model.with_mesh(place_sensors(mesh, sensors))
    first = study.measurements[0]
    frf = computed_frf(model, sensors, first.excitations, first.frf.frequency, first.frf.kind)
    return replace(
        study, model=model, sensors=sensors, measurements=(Measurement(frf, sensors, first.excitations),)
    )


def measured(
    problem: FitProblem, effects: tuple[Effect, ...], rng: np.random.Generator
) -> tuple[FitProblem, Mapping[ParameterRef, float]]:
    """Return a problem with the noisy FRFs of a drawn truth, and the true values of its parameters."""
    starts = [parameter_values(e) for e in effects]
    scatter = form_scatter(problem, problem.nominal())
    lines = np.arange(len(problem.data.frequency))
    function = replace(problem, scatter=scatter).function(effects, starts, lines)
    x, prior, limits = function.start.copy(), function.prior(), function.limits()
    names = {e.name for e in effects}
    vary = np.ones(len(x), dtype=bool)
    vary[: len(function.variables)] = [v.ref[0] not in names for v in function.variables]
    x[vary] = (prior.mean + prior.std * rng.standard_normal(len(x)))[vary]
    x = np.clip(x, *limits.T)
    truth = function.result(Solution(x, np.nan, 0.0, 0, True))
    better = problem.better_basis(truth, BASIS_LINES)
    assert better is not None
    fine = replace(problem, reduced=better[1], scatter=scatter)
    H = np.array(problem.data.H)
    ratio, _ = fine.function(effects, starts, lines)(x, False)  # weight · ln(computed / measured)
    keep = problem.data.mask
    noise = NOISE * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    H[keep] = H[keep] * np.exp(ratio / problem.data.weight[keep])
    data = replace(problem.data, H=H * (1 + noise), noise=np.where(keep, NOISE, problem.data.noise))
    return replace(problem, data=data), truth.values


def main() -> None:
    """Print the root mean squares of z of each parameter."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=40, help="data sets of each study (default 40)")
    parser.add_argument("--seed", type=int, default=1, help="of truths and noise (default 1)")
    parser.add_argument("--drawn", action="store_true", help="the form is as drawn")
    parser.add_argument("--strain", action="store_true", help="gauges in place of the sensors")
    parser.add_argument("--only", help="one of the studies")
    options = parser.parse_args()
    for name, effect, value in CASES:
        if options.only not in (None, name):
            continue
        study = load_study(EXAMPLES / name / "study.toml")
        study = with_gauges(study) if options.strain else study
        problem = formed_fit_problem(replace(study, model_error=0.0) if options.drawn else study)
        effects = tuple(
            e.with_values(**{e.parameters()[0].name: value}) for e in study.candidates() if e.name == effect
        )
        rng, z, lost = np.random.default_rng(options.seed), defaultdict(list), 0
        for _ in range(options.sets):
            drawn, truth = measured(problem, effects, rng)
            drawn = drawn.with_seen_noise(fit_given(drawn, effects)[1])
            _, result = fit_given(drawn, effects)
            if result.level > FAR * drawn.data.noise_level:
                lost += 1
                continue
            for ref, true in truth.items():
                z[ref].append((result.values[ref] - true) / result.std[ref])
        every = np.sqrt(np.mean([np.square(each) for each in z.values()]))
        print(f"{name}: {options.sets} sets, {lost} of them lost; all parameters {every:.2f}")
        for ref, each in z.items():
            rms = np.sqrt(np.mean(np.square(each)))
            print(f"   {' '.join(ref):48s} rms z {rms:5.2f}  mean {np.mean(each):+5.2f}")


if __name__ == "__main__":
    main()
