"""The cross-beam paper's numerical study: one 12 x 12 joint between two beams of 126 coordinates each.

Direct and average solution, the rebuilt assembly, and what the reduction of joint and of internal coordinates
does; the pictures correspond to the paper's figures 7 to 12.

    python examples/joint-study/numerical.py out/joint-study

Table 1 of the paper, with the joint's numbers, is lost: the joint here is stiff, fully coupled, with a mass
of about 0.1 kg. As what is lost with the joint's rotations depends on what they carry, figures 10 and 11 are
made a second time for a joint that gives way in rotation, as one with washers of rubber does.
"""

import sys
from pathlib import Path

import numpy as np

from fem import (
    DIRECTIONS,
    FRF,
    Damping,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
)
from joint import (
    CoordinateSet,
    Interface,
    JointIdentificationError,
    SubstructureFRF,
    coordinates_of,
    couple,
    full_form,
    identify_average,
    identify_joint,
    joint_impedance,
    partition_frf,
    stack_substructures,
)
from viz import plot_frf, plot_stiffness_entries, save

FREQUENCY = np.linspace(10.0, 3200.0, 320)
PAPER_NODES = (1, 5, 13, 21, 24, 28, 35, 37, 41)
JOINT = ("U11", "D22")
SOFT = 0.0006
"""Arm of the joint's rotations where it gives way in them, a thirtieth of the stiff one's [m]."""

STEEL = MemberProperties(
    Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01), theory="euler-bernoulli"
)


def beam(name: str, along: tuple[float, float, float], nodes: range, internal: list[str]) -> SubstructureFRF:
    """Return the receptances of a free beam of 20 elements at its joint node and at internal nodes."""
    xyz = np.linspace(0, 0.8, 21)[:, None] * np.array(along)
    mesh = Mesh.from_lines(xyz, [[i, i + 1] for i in range(20)], {name: range(20)})
    model = Model(mesh, (Frame(members={name: STEEL}),), Damping.structural(0.01))
    mine = [n for n in (f"{name}{k}" for k in nodes) if n in internal or n in JOINT]
    every = coordinates_of(mine)
    at = [(int(n[1:]) - nodes[0], d) for n in mine for d in DIRECTIONS]
    H = compute_frf(assemble(model), FREQUENCY, at, at, "receptance").H
    joint, a = (
        coordinates_of([n for n in mine if n in JOINT]),
        coordinates_of([n for n in mine if n in internal]),
    )
    return partition_frf(FREQUENCY, H, every, every, Interface(joint, a, a))


def beams(internal: list[str]) -> SubstructureFRF:
    """Return both beams side by side: nodes 1-21 along x, 22-42 along y."""
    return stack_substructures(
        beam("U", (1.0, 0, 0), range(1, 22), internal), beam("D", (0, 1.0, 0), range(22, 43), internal)
    )


def bolted(lever: float = 0.02) -> tuple[np.ndarray, ...]:
    """Return K, M, C and D (12, 12): coupled, rotations at an arm [m]."""
    rng = np.random.default_rng(11)
    arm = np.diag([1, 1, 1, lever, lever, lever] * 2)

    def coupled(low: float, high: float) -> np.ndarray:
        Q = np.linalg.qr(rng.standard_normal((12, 12)))[0] * np.sqrt(np.geomspace(low, high, 12))
        return arm @ Q @ Q.T @ arm

    return coupled(1e6, 1e8), coupled(0.05, 0.3), coupled(10, 200), coupled(1e4, 1e6)


def translations_only(parts: SubstructureFRF) -> SubstructureFRF:
    """Return substructures whose joint has lost its rotations."""
    keep = tuple(label for label in parts.interface.joint.labels if ":r" not in label)
    at = parts.interface.joint.positions(keep)
    interface = Interface(CoordinateSet(keep), parts.interface.outputs, parts.interface.inputs)
    H_bb = parts.H_bb[:, at][:, :, at]
    return SubstructureFRF(
        parts.frequency, interface, parts.H_aa, parts.H_ab[:, :, at], parts.H_ba[:, at], H_bb
    )


def frf(H: np.ndarray, parts: SubstructureFRF, output: str, force: str) -> FRF:
    """Return one receptance of an assembly."""
    i = parts.interface.outputs.positions([output])[0]
    j = parts.interface.inputs.positions([force])[0]
    return FRF.from_arrays(FREQUENCY, H[:, i, j], "receptance", [output], [force])


def run(folder: Path) -> dict[str, float]:
    """Make all pictures and return the errors that the study is about."""
    nodes = [f"{'U' if k < 22 else 'D'}{k}" for k in PAPER_NODES]
    everything = beams([f"{'U' if k < 22 else 'D'}{k}" for k in range(1, 43) if k not in (11, 22)])
    labels = everything.interface.joint.labels
    Z = joint_impedance(FREQUENCY, *bolted())
    measured = couple(everything, Z).H_nn

    direct = identify_joint(everything, FREQUENCY, measured)
    average = identify_average(everything, FREQUENCY, measured, full_form(everything.interface.joint))
    entries = [(2, 2), (4, 4)]
    pictures = {
        "fig-07-08-direct-and-average": plot_stiffness_entries(
            FREQUENCY,
            {"direct": direct.Z, "average": average.Z(FREQUENCY)},
            entries,
            labels,
            title="Dynamic stiffness of the joint: direct and average solution (figures 7 and 8)",
        )
    }
    rebuilt = couple(everything, direct.Z).H_nn
    pair = ("U21:z", "U1:z")
    pictures["fig-09-rebuilt"] = plot_frf(
        frf(measured, everything, *pair),
        {"rebuilt": frf(rebuilt, everything, *pair)},
        title="Assembly, original and rebuilt (figure 9)",
    )

    few = beams(nodes)
    fewer = identify_joint(few, FREQUENCY, couple(few, Z).H_nn)
    reduced = translations_only(everything)
    at = everything.interface.joint.positions(reduced.interface.joint.labels)
    errors = {}
    for suffix, word, lever in (("", "stiff in rotation", 0.02), ("-soft", "soft in rotation", SOFT)):
        Z_there = joint_impedance(FREQUENCY, *bolted(lever))
        seen = couple(everything, Z_there).H_nn
        found = identify_joint(reduced, FREQUENCY, seen, amplification_limit=np.inf)
        again = couple(reduced, found.Z).H_nn
        off = np.linalg.norm(again - seen, axis=(1, 2)) / np.linalg.norm(seen, axis=(1, 2))
        errors[word] = float(np.median(off)), float(np.median(found.residual))
        pictures[f"fig-11-rebuilt-from-reduced{suffix}"] = plot_frf(
            frf(seen, everything, *pair),
            {"rebuilt": frf(again, everything, *pair)},
            title=f"Rebuilt from translations only, joint {word} (figure 11)",
        )
        pictures[f"fig-10-reduced-joint{suffix}"] = plot_stiffness_entries(
            FREQUENCY,
            {"translations only": found.Z, "all six": Z_there[:, at][:, :, at]},
            [(2, 2)],
            reduced.interface.joint.labels,
            title=f"Translations only, joint {word}: no function K - ω²M + iωC + iD (figure 10)",
        )
    pictures["fig-12-reduced-internal"] = plot_stiffness_entries(
        FREQUENCY,
        {"9 nodes": fewer.Z, "40 nodes": direct.Z},
        entries,
        labels,
        title="Internal coordinates reduced from 240 to 54: nothing changes (figure 12)",
    )
    for name, figure in pictures.items():
        save(figure, folder / f"{name}.png")
    try:
        identify_average(reduced, FREQUENCY, measured, full_form(reduced.interface.joint))
        refused = 0.0
    except JointIdentificationError as reason:
        print(f"average solution with translations only: {reason}")
        refused = 1.0

    def error(X: np.ndarray, Y: np.ndarray) -> float:
        return float(np.linalg.norm(X - Y) / np.linalg.norm(Y))

    return {
        "direct": error(direct.Z, Z),
        "average K": error(average.K, bolted()[0]),
        "rebuilt": error(rebuilt, measured),
        "9 nodes": error(fewer.Z[fewer.regular], Z[fewer.regular]),
        **{f"rebuilt, translations only, {word}": off for word, (off, _) in errors.items()},
        **{f"residual, translations only, {word}": left for word, (_, left) in errors.items()},
        "average with translations only refused": refused,
    }


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "out/joint-study")
    for what, value in run(target).items():
        print(f"{what:50s} {value:.1e}")
    print(f"pictures are in {target}")
