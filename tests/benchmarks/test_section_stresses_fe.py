"""Stresses of shear and torsion against finite elements, where sectionproperties is installed."""

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from fem import Section
from fem.sections.outlines import ring
from fem.sections.stress_points import stress_points
from fem.sections.walls import wall_flows

pytest.importorskip("sectionproperties", reason="needs dovetail[sections]")

NU = 0.3


UNITS = {"Vy": ({"vx": 1.0}, 1), "Vz": ({"vy": 1.0}, 2), "T": ({"mzz": 1.0}, 3)}
"""Forces of the library, whose x and y are y and z, and columns of those of Dovetail."""


def by_elements(outlines, triangles):
    """Return a section of finite elements: a polygon with holes."""
    from sectionproperties.analysis.section import Section as Analysis  # pyright: ignore[reportMissingImports]
    from sectionproperties.pre.geometry import Geometry  # pyright: ignore[reportMissingImports]
    from sectionproperties.pre.pre import Material  # pyright: ignore[reportMissingImports]
    from shapely import Polygon

    shape = Polygon(outlines[0], outlines[1:])
    geometry: Any = Geometry(shape, material=Material("", 1.0, NU, 1.0, 1.0, "grey"))
    geometry.create_mesh(mesh_sizes=[shape.area / triangles])
    analysis: Any = Analysis(geometry)
    analysis.calculate_geometric_properties()
    analysis.calculate_warping_properties()
    return analysis


def differences(section, outlines, use, triangles):
    """Return the largest difference for each unit force at some points, relative to the largest stress."""
    found, elements = stress_points(section, NU), by_elements(outlines, triangles)
    assert found is not None
    points, own = found.points[use], found.per_force[use, 1:]
    out = []
    for unit, (forces, column) in UNITS.items():
        ours = own[:, :, column]
        if unit != "T":  # the elements' forces act at the shear centre
            y, z = section.shear_centre
            ours = ours + own[:, :, 3] * (y if unit == "Vz" else -z)
        (stress,) = elements.calculate_stress(**forces).get_stress()
        at_nodes = np.column_stack([stress["sig_zx"], stress["sig_zy"]])
        # inwards by so little that points on the outline are inside it
        theirs = LinearNDInterpolator(elements.mesh["vertices"], at_nodes)(points * (1 - 1e-6))
        known = np.isfinite(theirs).all(axis=1)
        assert known.mean() > 0.8
        out.append(float(abs(ours - theirs)[known].max() / np.linalg.norm(theirs[known], axis=1).max()))
    return np.array(out)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["circle", "tube", "ellipse", "rectangle"])
def test_solid_and_round_sections(shape):
    section, outlines = {
        "circle": (Section.circle(1.0), [ring(1, 1, 144)]),
        "tube": (Section.tube(1.0, 0.2), [ring(1, 1, 144), ring(0.6, 0.6, 144)]),
        "ellipse": (Section.ellipse(1.0, 1.6), [ring(1, 1.6, 144)]),
        "rectangle": (Section.rectangle(1.0, 0.6), Section.rectangle(1.0, 0.6).outlines),
    }[shape]
    found = stress_points(section, NU)
    assert found is not None
    corner = (abs(found.points) > 0.999 * np.ptp(section.outlines[0], axis=0) / 2).all(axis=1)
    # the elements' stresses are means at nodes, and of one element alone at corners: 2 % of the largest
    assert differences(section, outlines, np.flatnonzero(~corner), 2000).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["i_section", "channel", "hollow_rectangle", "angle_section"])
def test_walls_away_from_their_ends(shape):
    """Thin walls in their middle; the theory errs by the thickness relative to the width."""
    sizes = {
        "i_section": {"b": 1.0, "h": 1.6, "tf": 0.05, "tw": 0.04},
        "channel": {"b": 0.8, "h": 1.6, "tf": 0.05, "tw": 0.04},
        "hollow_rectangle": {"b": 1.0, "h": 1.6, "t": 0.05},
        "angle_section": {"b": 1.0, "h": 1.4, "t": 0.05},
    }[shape]
    section = Section.of_shape(shape, **sizes)
    found, walls = stress_points(section, NU), section.walls
    assert found is not None
    assert walls is not None
    flow = wall_flows(*walls)
    r = (found.points - flow.centroid)[:, None] - flow.first
    s = (r * flow.along).sum(axis=2)
    off = np.linalg.norm(r - s[:, :, None] * flow.along, axis=2)
    within = (s > 0.15 * flow.length) & (s < 0.85 * flow.length) & (off < 0.51 * flow.thickness)
    assert differences(section, section.outlines, np.flatnonzero(within.any(axis=1)), 3000).max() < 0.05
