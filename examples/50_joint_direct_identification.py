"""Identify an eccentric bolted joint between two small structures, and rebuild their assembly.

Two rigid blocks hang in springs. A massless 6x6 joint, off both centres, ties them together. The receptances
of the free blocks and those of the assembly at one node of each block give the joint back.
"""

import tempfile
from pathlib import Path

import numpy as np

import joint
from viz import plot_stiffness_entries, save

frequency = np.linspace(20.0, 800.0, 40)  # Hz
omega = 2 * np.pi * frequency[:, None, None]


def hanging_block(name, mass, stiffness):
    """Return the receptances of a block of two nodes tied by a beam-like spring, each node on soft mounts."""
    inertia = np.diag([1, 1, 1, 2e-3, 1e-3, 2e-3])  # kg, kg m² per kg of mass
    spring = np.diag([1, 1, 1, 4e-4, 4e-4, 4e-4]) * stiffness  # N/m, N m/rad
    K = np.block([[1.01 * spring, -spring], [-spring, 1.01 * spring]])
    M = mass * np.kron(np.eye(2), inertia)
    every = joint.coordinates_of([f"{name}1", f"{name}2"])
    free, tied = joint.coordinates_of([f"{name}1"]), joint.coordinates_of([f"{name}2"])
    H = np.linalg.inv(K * (1 + 0.02j) - omega**2 * M)
    return joint.partition_frf(
        frequency, H, every, every, joint.Interface(joint=tied, outputs=free, inputs=free)
    )


blocks = joint.stack_substructures(hanging_block("U", 2.0, 4e6), hanging_block("D", 3.0, 9e6))

bolt = joint.relative_joint(
    K=np.diag([2e7, 2e7, 8e7, 4e3, 4e3, 2e3]),  # N/m, N m/rad
    D=np.diag([6e5, 6e5, 2e6, 100.0, 100.0, 50.0]),
    lever_1=[0.0, 0.010, -0.005],  # m, from U2 to the bolt
    lever_2=[0.0, -0.015, 0.005],  # m, from D2 to the bolt
)
Z_bolt = joint.joint_impedance(frequency, bolt.K, D=bolt.D)
assembly = joint.couple(blocks, Z_bolt)  # stands for what a test would measure

found = joint.identify_joint(blocks, assembly.frequency, assembly.H_nn, basis=bolt.B.T)
stiffness = np.real(found.z[found.regular]).mean(axis=0)  # 6x6, relative coordinates
rebuilt = joint.couple(blocks, found.Z)

hidden = np.tile((bolt.K + 1j * bolt.D)[:3, :3], (len(frequency), 1, 1))
curves = {"identified": found.z[:, :3, :3], "hidden": hidden}
figure = plot_stiffness_entries(frequency, curves, [(0, 0), (1, 1), (2, 2)], ["x", "y", "z"])
print(f"picture in {save(figure, Path(tempfile.mkdtemp()) / 'stiffness.png')}")
print(f"stiffness along z {stiffness[2, 2] / 1e6:.6f} kN/mm, hidden {bolt.K[2, 2] / 1e6:g} kN/mm")

assert found.regular.all()
assert np.allclose(np.diag(stiffness), [2e7, 2e7, 8e7, 4e3, 4e3, 2e3], rtol=1e-8)
assert np.allclose(rebuilt.H_nn, assembly.H_nn, rtol=0, atol=1e-9 * np.abs(assembly.H_nn).max())
