"""Mode shapes, deflections and member fields for other programs, read back by readers that are not ours."""

import meshio
import numpy as np
import pytest
import pyuff
import pyvista
from meshio.xdmf import TimeSeriesReader
from scipy.linalg import eig

from fem import Frame, MeshError, Modes, assemble, solve_modes
from fem.io import (
    UffError,
    line_axial_force,
    line_strain_energy,
    read_modes,
    read_npz_modes,
    write_fields,
    write_modes,
    write_uff,
)
from fem.linalg.solvers import factorise
from tests.frames import FLAT, beam, fix, portal, with_part


@pytest.fixture(scope="module")
def frame():
    model = portal(0.2)
    return model, solve_modes(assemble(model), n=4)


def static(model, dof, force=1.0):
    """Return the deflection (n_dof,) under a force at one DOF."""
    system = assemble(model)
    b = np.zeros(model.n_dof)
    b[dof] = force
    return np.asarray(system.Q @ factorise(system.K).solve(np.asarray(system.Q.T @ b)))


def test_vtu_has_every_mode_with_its_frequency(tmp_path, frame):
    model, modes = frame
    energy = line_strain_energy(model, modes.shapes)
    length = model.mesh.lengths()
    write_modes(modes, model.mesh, tmp_path / "m.vtu", lines={"strain energy": energy, "length": length})
    found = meshio.read(tmp_path / "m.vtu")
    names = [f"mode {k + 1}: {f:.6g} Hz" for k, f in enumerate(modes.frequency)]
    assert set(found.point_data) == {*names, *(f"{name}, rotation" for name in names)}
    np.testing.assert_array_equal(found.points, model.mesh.points)
    for k, name in enumerate(names):
        shape = modes.shapes[:, k].reshape(-1, 6)
        np.testing.assert_array_equal(found.point_data[name], shape[:, :3])
        np.testing.assert_array_equal(found.point_data[f"{name}, rotation"], shape[:, 3:])
        np.testing.assert_array_equal(found.cell_data[f"{name}, strain energy"][0], energy[:, k])
    np.testing.assert_array_equal(found.cell_data["length"][0], length)
    assert found.cell_data["member"][0].max() == len(model.mesh.members)
    # VTK's own reader, which is ParaView's
    vtk = pyvista.read(tmp_path / "m.vtu")
    np.testing.assert_array_equal(vtk.point_data[names[1]], modes.shapes[:, 1].reshape(-1, 6)[:, :3])


def test_xdmf_is_a_series_of_modes(tmp_path, frame):
    model, modes = frame
    energy = line_strain_energy(model, modes.shapes)
    write_modes(modes, model.mesh, tmp_path / "m.xdmf", lines={"strain energy": energy})
    text = (tmp_path / "m.xdmf").read_text()
    assert f'Name="mode 2: {modes.frequency[1]:.6g} Hz"' in text
    assert [p.name for p in tmp_path.iterdir()] == ["m.xdmf"], "all in one file"
    with TimeSeriesReader(tmp_path / "m.xdmf") as reader:
        points, cells = reader.read_points_cells()
        np.testing.assert_array_equal(points, model.mesh.points)
        np.testing.assert_array_equal(cells[0].data, model.mesh.lines)
        assert reader.num_steps == modes.n_modes
        for k in range(modes.n_modes):
            t, point_data, cell_data = reader.read_data(k)
            shape = modes.shapes[:, k].reshape(-1, 6)
            assert t == k + 1
            np.testing.assert_allclose(point_data["displacement"], shape[:, :3], rtol=1e-15)
            np.testing.assert_allclose(point_data["rotation"], shape[:, 3:], rtol=1e-15)
            np.testing.assert_allclose(cell_data["strain energy"][0], energy[:, k], rtol=1e-15)
    vtk = pyvista.get_reader(tmp_path / "m.xdmf")
    assert vtk.time_values == [1.0, 2.0, 3.0, 4.0]
    vtk.set_active_time_value(3.0)
    grid = next(block for block in vtk.read() if "displacement" in block.point_data)
    assert grid.n_cells == model.mesh.n_lines
    np.testing.assert_allclose(grid.point_data["displacement"], modes.shapes[:, 2].reshape(-1, 6)[:, :3])


@pytest.mark.parametrize("suffix", ["vtu", "vtk", "xdmf"])
def test_complex_modes_are_real_and_imaginary_parts(tmp_path, frame, suffix):
    model, modes = frame
    turned = Modes(modes.frequency, modes.shapes * (0.6 + 0.8j), modes.zeta)
    path = tmp_path / f"m.{suffix}"
    write_modes(turned, model.mesh, path)
    shape = turned.shapes[:, 1].reshape(-1, 6)
    if suffix == "xdmf":
        with TimeSeriesReader(path) as reader:
            reader.read_points_cells()
            data = reader.read_data(1)[1]
        stem, turn = "displacement", "rotation"
    else:
        data = meshio.read(path).point_data
        stem = f"mode 2: {modes.frequency[1]:.6g} Hz"
        turn = f"{stem}, rotation"
    names = [f"{stem}, real", f"{stem}, imaginary", f"{turn}, real", f"{turn}, imaginary"]
    names = [name.replace(" ", "_") for name in names] if suffix == "vtk" else names
    expected = [shape[:, :3].real, shape[:, :3].imag, shape[:, 3:].real, shape[:, 3:].imag]
    for name, values in zip(names, expected, strict=True):
        np.testing.assert_allclose(data[name], values, rtol=1e-14)


def test_subdivisions_follow_the_beams_own_shape(tmp_path):
    """A cantilever in one element under a tip force F: w = F x²(3L - x)/6EI, which is its cubic exactly."""
    L, n = 0.8, 7
    model = beam(1, L, effects=(fix(0),))
    (frame,) = model.of_kind(Frame)
    u = static(model, 6 + 2)
    path = tmp_path / "tip.vtu"
    write_fields(path, model.mesh, {"tip force": u}, frame=frame, subdivisions=n, lines={"number": [3.0]})
    found = meshio.read(path)
    assert len(found.points) == n + 1
    assert len(found.cells[0].data) == n
    x = found.points[:, 0]
    EI = 210e9 * FLAT.Iy
    w, slope = x**2 * (3 * L - x) / (6 * EI), x * (2 * L - x) / (2 * EI)
    np.testing.assert_allclose(found.point_data["tip force"][:, 2], w, atol=1e-11 * w.max())
    np.testing.assert_allclose(
        found.point_data["tip force, rotation"][:, 1], -slope, atol=1e-11 * slope.max()
    )
    np.testing.assert_array_equal(found.cell_data["number"][0], np.full(n, 3.0))
    lines = found.points[found.cells[0].data]
    np.testing.assert_allclose(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1), L / n)


def test_subdivisions_of_a_frame_are_where_a_finer_mesh_has_its_points(tmp_path, frame):
    model, _ = frame
    (beams,) = model.of_kind(Frame)
    u = static(model, 6 * 1 + 0)
    write_fields(tmp_path / "a.vtu", model.mesh, {"push": u}, frame=beams, subdivisions=3)
    found = meshio.read(tmp_path / "a.vtu")
    fine = model.with_mesh(model.mesh.split(3))
    expected = static(fine, 6 * 1 + 0).reshape(-1, 6)[:, :3]
    np.testing.assert_allclose(found.points, fine.mesh.points, atol=1e-15)
    # elements are exact under nodal loads: both are the exact solution, but for rounding of the finer mesh
    np.testing.assert_allclose(found.point_data["push"], expected, atol=1e-8 * abs(expected).max())


def test_coordinates_of_effects_are_left_out(tmp_path):
    model = with_part()
    modes = solve_modes(assemble(model), n=2)
    write_modes(modes, model.mesh, tmp_path / "m.vtu")
    assert meshio.read(tmp_path / "m.vtu").points.shape == model.mesh.points.shape
    write_modes(modes, model.mesh, tmp_path / "m.uff")
    assert len(read_modes(tmp_path / "m.uff").labels) == 6 * model.mesh.n_points
    write_modes(modes, model.mesh, tmp_path / "m.npz")
    np.testing.assert_array_equal(read_npz_modes(tmp_path / "m.npz").shapes, modes.shapes)


# Values along members ---------------------------------------------------------------------------------------


def test_axial_force_of_a_bar_is_the_force_on_it():
    along = np.array([1, 2, -0.5]) / np.sqrt(5.25)
    arm = np.array([0, 0, 0.03])
    for offsets in ({}, {"offset1": arm, "offset2": arm}):
        model = beam(4, 0.7, effects=(fix(0),), along=along, **offsets)
        u = sum(1e3 * a * static(model, 6 + d) for d, a in enumerate(along))
        force = line_axial_force(model, u[:, None])[:, 0]
        # the force, but for rounding: bending of the offset bar does not change its axial force
        np.testing.assert_allclose(force, 1e3, rtol=1e-8)
        np.testing.assert_allclose(line_axial_force(model, -u[:, None])[:, 0], -force)


def test_strain_energies_add_up_to_the_work(frame):
    model, modes = frame
    cantilever = beam(5, 0.6, effects=(fix(0),))
    u = static(cantilever, 6 + 2, 40.0)
    energy = line_strain_energy(cantilever, u[:, None])
    np.testing.assert_allclose(energy.sum(), 40.0 * u[6 + 2] / 2, rtol=1e-10)
    # in a cantilever of length L the part between x1 and x2 has F² ((L-x1)³ - (L-x2)³)/6EI
    s = 0.6 - cantilever.mesh.member_positions("beam")
    expected = 40.0**2 * (s[:-1] ** 3 - s[1:] ** 3) / (6 * 210e9 * FLAT.Iy)
    np.testing.assert_allclose(energy[cantilever.mesh.members["beam"], 0], expected, rtol=1e-7)
    # rigid joints have no energy: the beams have all of a mode's, ω²/2
    np.testing.assert_allclose(
        line_strain_energy(model, modes.shapes).sum(axis=0), modes.omega**2 / 2, rtol=1e-9
    )


# Universal files --------------------------------------------------------------------------------------------


def two_masses():
    """Return M, C, K of two masses with a damper that couples the modes, and their poles and shapes."""
    M, K = np.diag([2.0, 1.0]), np.array([[3e4, -1e4], [-1e4, 1.5e4]])
    C = np.array([[12.0, -2.0], [-2.0, 2.0]])
    zero = np.zeros((2, 2))
    lam, X = eig(np.block([[zero, np.eye(2)], [-K, -C]]), np.block([[np.eye(2), zero], [zero, M]]))
    keep = np.argsort(np.where(lam.imag > 0, lam.imag, np.inf))[:2]
    return M, C, K, lam[keep], X[:2, keep]


def test_complex_modes_keep_modal_a_and_give_the_frf_back(tmp_path):
    M, C, K, lam, phi = two_masses()
    a = np.einsum("ik,ik->k", phi, (2 * M @ phi) * lam + C @ phi)
    modes = Modes(abs(lam) / (2 * np.pi), phi, -lam.real / abs(lam), ("1Z+", "2Z+"))
    write_uff(tmp_path / "c.uff", modes=modes, modal_a=a)
    raw = [s for s in pyuff.UFF(str(tmp_path / "c.uff")).read_sets() if s["type"] == 55]
    np.testing.assert_allclose([s["modal_a"] for s in raw], a, rtol=1e-5)  # six digits in the file
    np.testing.assert_allclose([s["modal_b"] for s in raw], -lam * a, rtol=1e-5)
    np.testing.assert_allclose([s["eig"] for s in raw], lam, rtol=1e-5)
    back = read_modes(tmp_path / "c.uff")
    rows = [back.labels.index(label) for label in modes.labels]
    psi = back.shapes[rows]
    # read back, modal A is 2iω_d: the residues of H are ψψᵀ/2iω_d, which needs nothing else from the file
    pole = -back.zeta * back.omega + 1j * back.omega * np.sqrt(1 - back.zeta**2)
    for omega in (30.0, 95.0, 140.0):
        residue = [np.outer(p, p) / (2j * l.imag) for p, l in zip(psi.T, pole, strict=True)]
        H = sum(
            r / (1j * omega - l) + r.conj() / (1j * omega - l.conj())
            for r, l in zip(residue, pole, strict=True)
        )
        exact = np.linalg.inv(K + 1j * omega * C - omega**2 * M)
        assert abs(H - exact).max() <= 1e-4 * abs(exact).max()


def test_unit_modal_a_is_unit_modal_mass(tmp_path, frame):
    model, modes = frame
    turned = Modes(modes.frequency, modes.shapes * np.exp(0.3j), np.full(modes.n_modes, 0.02))
    write_modes(turned, model.mesh, tmp_path / "m.unv", modal_a="unit")
    back = read_modes(tmp_path / "m.unv")
    # a shape is written as it is, and scaled on reading by √(2iω_d/A), here 1
    np.testing.assert_allclose(back.shapes, turned.shapes, atol=2e-5 * abs(turned.shapes).max())
    plain = turned.shapes / np.exp(0.3j)
    write_modes(
        Modes(modes.frequency, 3 * turned.shapes, turned.zeta),
        model.mesh,
        tmp_path / "m.unv",
        modal_a=9 * 2j * modes.omega * np.sqrt(1 - 0.02**2),
    )
    np.testing.assert_allclose(
        read_modes(tmp_path / "m.unv").shapes, turned.shapes, atol=2e-5 * abs(plain).max()
    )


@pytest.mark.parametrize(
    ("shapes", "modal_a", "message"),
    [
        (1.0, "unit", "real mode shapes, which have a modal mass instead"),
        (1j, "one", "modal_a is 'one'; allowed are 'unit'"),
        (1j, [1.0], r"shape \(1,\); \(4,\) finite numbers are expected"),
        (1j, [1.0, np.nan, 1.0, 1.0], "finite numbers are expected"),
    ],
)
def test_modal_a_that_does_not_fit_is_refused(tmp_path, frame, shapes, modal_a, message):
    model, modes = frame
    other = Modes(modes.frequency, shapes * modes.shapes, modes.zeta)
    with pytest.raises(UffError, match=message):
        write_modes(other, model.mesh, tmp_path / "m.uff", modal_a=modal_a)
    assert not list(tmp_path.iterdir())


# Errors -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"path": "m.stl"}, "motions are written as .vtu, .vtk or .xdmf, not '.stl'"),
        ({"subdivisions": 3}, "3 subdivisions are asked for; 1 is allowed, and more with the frame given"),
        ({"subdivisions": 0}, "0 subdivisions are asked for"),
        ({"motions": {"u": np.zeros(5)}}, "motion 'u': 5 rows were found; the mesh has 18 DOFs"),
        ({"lines": {"N": np.zeros(7)}}, r"the line values 'N' have shape \(7,\) .* real \(2,\) or \(2, 1\)"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, options, message):
    model = beam(2)
    given = {"motions": {"u": np.zeros(18)}, "path": "m.vtu"} | options
    with pytest.raises(MeshError, match=message):
        write_fields(tmp_path / given.pop("path"), model.mesh, given.pop("motions"), **given)
    assert not list(tmp_path.iterdir())
