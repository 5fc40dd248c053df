"""The cross-beam paper's experimental study, from FRFs to the joint.

Both beams alone are compared with their models and updated, with their damping; the joint between them is
identified from the FRFs of the assembly, with what stays uncertain about the beams; the assembly is rebuilt.
The pictures correspond to the paper's figures 4, 5 and 7.

    python examples/joint-study/experimental.py out/joint-study

The FRFs are those of a model of solid elements in another program, with 1 % noise: accelerations along z.
"""

import sys
from pathlib import Path

import numpy as np

from fem import DIRECTIONS, FRF, Damping, Frame, Material, MemberProperties, Mesh, Model, Section
from fem.io import read_frf
from joint import JointFit, ModelParts, Uncertain, fit_joint, relative_coordinates, relative_form
from updating import (
    FitProblem,
    FitResult,
    Measurement,
    Nuisance,
    Sensor,
    assessed_fit,
    build_problem,
    relative_noise,
)
from viz import plot_frf, plot_stiffness_entries, save

HERE = Path(__file__).parent
NOMINAL = Material("steel", 206.8e9, 7889.0)
BEAMS = {
    "U": (np.array([0.0, 0, 0.011]), np.array([1.0, 0, 0]), 0.45, 1, 101),
    "D": (np.array([0.45, -0.25, -0.011]), np.array([0, 1.0, 0]), 0.25, 11, 102),
}
"""First end, direction, position of the joint, node of the first sensor, node at the joint."""

BAND = (20.0, 1500.0)
"""Frequencies in which beams agree with solids to a fraction of a per cent [Hz]."""

ACCURACY = 0.05
"""What is asked of beam models, relative to each FRF; it is added to the data's own noise."""


UNSURE = (("frame", "E:steel", 0.002), ("frame", "rho:steel", 0.002), ("damping", "ratio", 0.1))
"""What the updates leave uncertain of each beam: standard deviations of the logarithm."""

ASSUMED = np.array([49.2e6, 50.0e6, 9.81e6, 2980.0, 3040.0, 5000.0])
"""Stiffness along and about x, y, z before the test [N/m, N·m/rad]; the loss factor is 0.006."""

TRUE = np.array([50e6, 50e6, 10e6, 200.0, 3000.0, 5000.0])
"""The same in the model that made the data, and the same loss factor."""


def beam(name: str, material: Material, damping: Damping) -> tuple[Model, dict[int, int]]:
    """Return a free beam, and its points at sensors and at the joint by node number."""
    start, along, joint, first, hole = BEAMS[name]
    mesh = Mesh.from_lines([start, start + 0.8 * along], [[0, 1]], {name: [0]})
    for s in (*np.arange(1, 8) / 10, joint):
        mesh = mesh.with_point_on(name, float(s))
    at = {first + k: mesh.nearest_point(start + 0.1 * k * along)[0] for k in range(9)}
    at[hole] = mesh.nearest_point(start + joint * along)[0]
    properties = MemberProperties(material, Section.rectangle(0.03, 0.01))
    return Model(mesh.refined(0.02), (Frame(members={name: properties}),), damping), at


def update(name: str) -> tuple[FitProblem, FitResult]:
    """Fit modulus, density and the damping curve of a beam to its own FRFs."""
    model, at = beam(name, NOMINAL, Damping.modal(0.0036))
    frf = read_frf(HERE / f"sub_{name}.uff").select(band=BAND)

    def sensors(labels: tuple[str, ...]) -> tuple[Sensor, ...]:
        return tuple(Sensor(x, model.mesh.points[at[int(x[:-2])]], np.array([0, 0, 1.0])) for x in labels)

    uncertain = [Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.005)]
    problem = build_problem(model, Measurement(frf, sensors(frf.outputs), sensors(frf.inputs)), uncertain)
    return problem, assessed_fit(problem)


def identify(updated: dict[str, tuple[FitProblem, FitResult]]) -> tuple[FRF, JointFit]:
    """Return the assembly's measured FRFs, and the joint fitted to them between the updated beams."""
    models: dict[str, Model] = {}
    points: dict[str, dict[int, int]] = {}
    for name, (problem, result) in updated.items():
        material = Material("steel", result.values["frame", "E:steel"], result.values["frame", "rho:steel"])
        damping = Damping.modal(result.zeta, problem.damping.knots)
        models[name], points[name] = beam(name, material, damping)
    frf = read_frf(HERE.parent / "cross-beam" / "frf.uff").select(band=BAND).as_kind("receptance")

    def at(labels: tuple[str, ...]) -> dict[str, list[tuple[int, str]]]:
        nodes = [int(x[:-2]) for x in labels]
        return {name: [(own[n], "z") for n in nodes if n in own] for name, own in points.items()}

    joint = {name: [points[name][BEAMS[name][4]]] for name in models}
    doubts = [Uncertain(name, *what) for name in models for what in UNSURE]
    parts = ModelParts.of(models, frf.frequency, joint, at(frf.outputs), doubts, at(frf.inputs))
    B = relative_coordinates([0, 0, -0.011], [0, 0, 0.011])
    form = relative_form(parts.at_mean.interface.joint, B, ("K", "D"), pattern=np.eye(6))
    start = np.concatenate([ASSUMED, 0.006 * ASSUMED])
    noise = np.abs(frf.H) * np.sqrt(ACCURACY**2 + 2 * relative_noise(frf.H) ** 2)
    return frf, fit_joint(form, parts, frf.frequency, frf.H, start, noise=noise, positive=True)


def table(fit: JointFit) -> str:
    """Return true and fitted values, with the distance in stated deviations where there are any."""
    lines = [f"  {'parameter':9s} {'true':>9s}  {'off by':>8s}  fitted"]
    for k, (name, true) in enumerate(zip(fit.form.names, np.append(TRUE, 0.006 * TRUE), strict=True)):
        known = fit.identifiability.determined[k]
        off = f"{(fit.values[k] - true) / fit.std[k]:+.1f} std" if known else ""
        lines.append(f"  {name:9s} {true:9.4g}  {off:>8s}  {fit.words(k)}")
    return "\n".join(lines)


def run(folder: Path) -> JointFit:
    """Make the pictures, print the tables, and return the joint."""
    updated = {name: update(name) for name in BEAMS}
    for name, (problem, result) in updated.items():
        E, rho = (result.values["frame", f"{key}:steel"] for key in ("E", "rho"))
        before = problem.nominal()
        print(f"beam {name}: E {E / 1e9:.2f} GPa, density {rho:.0f} kg/m³,", end=" ")
        print(f"damping {result.zeta.min():.2%} to {result.zeta.max():.2%};")
        print(f"  error {before.fit_db:.2f} → {result.fit_db:.2f} dB, held out {result.held_out_db:.2f} dB")
        pair = (problem.measured.outputs[8], problem.measured.inputs[0])
        curves = {"nominal": problem.frf(before), "updated": problem.frf(result)}
        figure = plot_frf(problem.measured, curves, [pair], title=f"Beam {name} alone (figure 4)")
        save(figure, folder / f"fig-04-beam-{name}.png")
    frf, fit = identify(updated)
    print(f"joint: {fit.message}")
    print(table(fit))
    rebuilt = FRF.from_arrays(frf.frequency, fit.H, "receptance", frf.outputs, frf.inputs)
    pairs = [("9Z+", "1Z+"), ("17Z+", "13Z+")]
    save(
        plot_frf(frf, {"rebuilt": rebuilt}, pairs, title="Assembly (figure 5)"),
        folder / "fig-05-assembly.png",
    )
    # stiffness and damping of the six relative motions, beside the joint as it was assumed
    ones = np.ones((frf.n_freq, 1, 1))
    found, spread = (np.diag(v[:6] + 1j * v[6:]) * ones for v in (fit.values, np.nan_to_num(fit.std)))
    assumed = np.diag(ASSUMED * (1 + 0.006j)) * ones
    curves, bands = {"assumed": assumed, "fitted": found}, {"fitted": spread}
    figure = plot_stiffness_entries(
        frf.frequency, curves, [(3, 3), (4, 4)], DIRECTIONS, bands, title="Joint about x and y (figure 7)"
    )
    save(figure, folder / "fig-07-joint.png")
    return fit


if __name__ == "__main__":
    run(Path(sys.argv[1] if len(sys.argv) > 1 else "out/joint-study"))
