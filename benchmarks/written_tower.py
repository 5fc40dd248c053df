"""The tower of 400 members of :mod:`benchmarks.diagnosis` as a study file with its FRFs."""

from pathlib import Path

from benchmarks.diagnosis import tower
from fem.io import write_npz

HEAD = """\
[study]
name = "Tower of 400 members"

[materials.steel]
E = 210e9
rho = 7850

[sections.leg]
shape = "tube"
d = 0.06
t = 0.003

[sections.other]
shape = "rectangle"
b = 0.02
h = 0.005

[damping]
modal = 0.01

[uncertain]
E = 0.02
rho = 0.01

[candidates]
kinds = ["stiffness_loss", "point_mass", "member_stiffness"]

[[measurements]]
file = "frf.npz"
"""


def write_tower(folder: Path, per_member: int = 12) -> Path:
    """Write the study and what was measured into a folder; return the study file.

    Parameters
    ----------
    folder : Path
    per_member : int
        Elements of each member.
    """
    drawn, _ = tower(per_member=1)
    _, measurement = tower(per_member=per_member)
    mesh = drawn.mesh
    parts = [HEAD, "\n[points]"]
    parts += [f"P{k} = [{x:g}, {y:g}, {z:g}]" for k, (x, y, z) in enumerate(mesh.points)]
    for name, lines in mesh.members.items():
        a, b = mesh.lines[lines[0]]
        section = "leg" if name.startswith("leg") else "other"
        parts.append(
            f'\n[members.{name}]\nfrom = "P{a}"\nto = "P{b}"\nmaterial = "steel"\nsection = "{section}"\n'
            f"elements = {per_member}"
        )
    parts += [f'\n[[supports]]\npoint = "P{k}"' for k in range(4)]
    parts += [
        f'\n[[sensors]]\nname = "{s.name}"\npoint = "P{mesh.nearest_point(s.point)[0]}"\n'
        f'direction = "{s.name[-1]}"'
        for s in measurement.sensors
    ]
    parts += [f'\n[[excitations]]\nsensor = "{s.name}"' for s in measurement.excitations]
    write_npz(folder / "frf.npz", measurement.frf)
    path = folder / "study.toml"
    path.write_text("\n".join(parts) + "\n", encoding="utf-8")
    return path
