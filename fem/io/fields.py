"""Motions and values along members for ParaView and others: mode shapes, deflections, forces, energies.

``.vtu`` and ``.vtk`` hold every motion as a separate array; ``.xdmf`` holds a series of steps, one for
each motion, which ParaView plays. Both keep displacements in m and rotations in rad.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.modes import Modes
from fem.array_types import Floats, Ints
from fem.elements.frame import Frame
from fem.io.arrays import write_npz
from fem.io.atomic import replacing
from fem.io.faults import error_at, refuse
from fem.io.meshfile import member_arrays, quiet, write_mesh
from fem.mesh import Location, Mesh, MeshError
from fem.model import Model, ModelError

_UNIVERSAL = (".uff", ".unv")


def write_modes(
    modes: Modes,
    mesh: Mesh,
    path: str | os.PathLike[str],
    *,
    frame: Frame | None = None,
    subdivisions: int = 1,
    lines: Mapping[str, ArrayLike] | None = None,
    modal_a: ArrayLike | str | None = None,
) -> None:
    """Write mode shapes with the mesh; the suffix says how.

    ``.vtu``, ``.vtk`` and ``.xdmf`` as :func:`write_fields`, with names such as ``mode 03: 41.27 Hz``;
    ``.uff`` and ``.unv`` as dataset 55; ``.npz`` with the arrays.

    Parameters
    ----------
    modes : Modes
        With a row for every DOF of the mesh; real or complex. Coordinates of effects are left out, but for
        ``.npz``.
    mesh : Mesh
    path : path
    frame, subdivisions, lines
        See :func:`write_fields`; line values may have a column for each mode.
    modal_a : array_like (n_modes,) or "unit", optional
        Modal A of complex modes in a universal file; see :func:`fem.io.uff.write_uff`.

    Raises
    ------
    MeshError, UffError
        If the shapes do not fit the mesh, or the format is another one.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        write_npz(path, modes)
        return
    shapes = _rows(modes.shapes, mesh, "the mode shapes")
    if suffix in _UNIVERSAL:
        from fem.io.uff_write import write_uff

        cut = Modes(modes.frequency, shapes, modes.zeta, (), modes.n_rigid)
        write_uff(path, modes=cut, mesh=mesh, modal_a=modal_a)
        return
    width = len(str(modes.n_modes))
    names = [f"mode {k + 1:0{width}d}: {f:.6g} Hz" for k, f in enumerate(modes.frequency)]
    motions = dict(zip(names, shapes.T, strict=True))
    write_fields(path, mesh, motions, lines=lines, frame=frame, subdivisions=subdivisions)


def write_fields(
    path: str | os.PathLike[str],
    mesh: Mesh,
    motions: Mapping[str, ArrayLike],
    *,
    lines: Mapping[str, ArrayLike] | None = None,
    frame: Frame | None = None,
    subdivisions: int = 1,
    times: ArrayLike | None = None,
) -> None:
    """Write motions of a mesh and values of its lines as ``.vtu``, ``.vtk`` or ``.xdmf``.

    A motion ``dead load`` becomes the vectors ``dead load`` and ``dead load, rotation`` of ``.vtu``; in
    ``.xdmf`` it is the step of that name with the vectors ``displacement`` and ``rotation``. A complex motion
    has each of these as ``…, real`` and ``…, imaginary``: it is the real part of (real + i imaginary)
    e^{iωt}. Members are the integer array ``member``.

    Parameters
    ----------
    path : path
    mesh : Mesh
    motions : mapping of str to array_like (n_dof,)
        Displacements and rotations of the points [m, rad].
    lines : mapping of str to array_like (n_lines,) or (n_lines, n_motions), optional
        Values of the lines, the same for all motions or one for each.
    frame : Frame, optional
        Gives the beams' shape functions for ``subdivisions``.
    subdivisions : int
        Number of straight pieces that each line is written as, bent as its beam is.
    times : array_like (n_motions,), optional
        Times of the steps of ``.xdmf``; their numbers from 1 unless given [s].

    Raises
    ------
    MeshError
        If values do not fit the mesh, or the format is another one.
    """
    file = Path(path)
    if file.suffix.lower() not in (".vtu", ".vtk", ".xdmf"):
        raise error_at(file.name, f"motions are written as .vtu, .vtk or .xdmf, not '{file.suffix}'")
    if subdivisions < 1 or (subdivisions > 1 and frame is None):
        msg = f"{subdivisions} subdivisions are asked for; 1 is allowed, and more with the frame given"
        raise MeshError(msg)
    columns = [_rows(np.asarray(u)[:, None], mesh, f"motion '{name}'")[:, 0] for name, u in motions.items()]
    fine, columns = _subdivided(mesh, columns, frame, subdivisions)
    values = _line_values(mesh, lines or {}, len(columns))
    values = {name: np.repeat(v, subdivisions, axis=0) for name, v in values.items()}
    if file.suffix.lower() == ".xdmf":
        at = np.arange(1.0, len(columns) + 1) if times is None else np.asarray(times, dtype=float)
        _write_xdmf(file, fine, dict(zip(motions, columns, strict=True)), values, at)
        return
    points = {
        f"{name}{', rotation' * turned}{part}": vectors
        for name, u in zip(motions, columns, strict=True)
        for turned in (0, 1)
        for part, vectors in _parts(u, turned).items()
    }
    cells = {}
    for name, v in values.items():
        if v.shape[1] == 1:
            cells[name] = v[:, 0]
        else:
            cells |= {f"{motion}, {name}": v[:, k] for k, motion in enumerate(motions)}
    write_mesh(fine, file, points, cells)


def _rows(shapes: NDArray[Any], mesh: Mesh, what: str) -> NDArray[Any]:
    """Return the rows of the mesh's DOFs; coordinates of effects come after them."""
    if shapes.ndim != 2 or len(shapes) < 6 * mesh.n_points:
        msg = (
            f"{what}: {len(shapes)} rows were found; the mesh has {6 * mesh.n_points} DOFs, six for each of "
            f"its {mesh.n_points} points"
        )
        raise MeshError(msg)
    return shapes[: 6 * mesh.n_points]


def _line_values(mesh: Mesh, lines: Mapping[str, ArrayLike], n: int) -> dict[str, Floats]:
    out = {}
    for name, given in lines.items():
        v = np.asarray(given)
        if v.shape not in ((mesh.n_lines,), (mesh.n_lines, n)) or np.iscomplexobj(v):
            msg = (
                f"the line values '{name}' have shape {v.shape} and type {v.dtype}; real ({mesh.n_lines},) "
                f"or ({mesh.n_lines}, {n}) are expected"
            )
            raise MeshError(msg)
        out[name] = v.reshape(mesh.n_lines, -1).astype(float)
    return out


def _parts(u: NDArray[Any], turned: int) -> dict[str, Floats]:
    vectors = np.ascontiguousarray(u.reshape(-1, 6)[:, 3 * turned : 3 * turned + 3])
    if np.iscomplexobj(u):
        return {", real": np.real(vectors).copy(), ", imaginary": np.imag(vectors).copy()}
    return {"": vectors}


def _subdivided(
    mesh: Mesh, columns: list[NDArray[Any]], frame: Frame | None, pieces: int
) -> tuple[Mesh, list[NDArray[Any]]]:
    """Return the mesh with each line in pieces, and the motions there by the beams' shape functions."""
    if pieces == 1 or frame is None:
        return mesh, columns
    at = [Location(row, k / pieces) for row in range(mesh.n_lines) for k in range(1, pieces)]
    dofs, N = frame.interpolate(mesh, at)
    inner = [np.einsum("bij,bj->bi", N, u[dofs]).ravel() for u in columns]
    return mesh.split(pieces), [np.concatenate([u, v]) for u, v in zip(columns, inner, strict=True)]


def _write_xdmf(
    file: Path, mesh: Mesh, motions: dict[str, NDArray[Any]], lines: dict[str, Floats], times: Floats
) -> None:
    """Write a series of steps with all numbers in the XML, which needs no h5py."""
    cells = member_arrays(mesh)
    with quiet(), replacing(file) as scratch:
        from meshio.xdmf import TimeSeriesWriter

        with TimeSeriesWriter(scratch, data_format="XML") as writer:
            out: Any = writer
            out.collection.set("Name", file.stem)
            out.write_points_cells(np.array(mesh.points), [("line", np.array(mesh.lines))])
            for topology in out.domain.iter("Topology"):
                topology.set("NodesPerElement", "2")
            for k, (name, u) in enumerate(motions.items()):
                points = {
                    f"{word}{part}": vectors
                    for turned, word in enumerate(("displacement", "rotation"))
                    for part, vectors in _parts(u, turned).items()
                }
                of_step = {key: [v[:, min(k, v.shape[1] - 1)]] for key, v in lines.items()}
                members = {"member": [cells["member"]]}
                out.write_data(float(times[k]), point_data=points, cell_data=members | of_step)
                out.collection[-1].set("Name", name)


# Values along members ---------------------------------------------------------------------------------------


def line_strain_energy(model: Model, motions: NDArray[Any]) -> Floats:
    """Return the strain energy ½ uᴴ K u of each line's beam, shape (n_lines, k) [J].

    Of a mass-normalised mode the sum is ω²/2 [rad²/s²]. Complex motions give the mean over a period times
    two.

    Parameters
    ----------
    model : Model
        With one frame.
    motions : ndarray (n_dof, k)
    """
    dofs, K = _beams(model)
    u = motions[dofs]
    return np.real(np.einsum("bik,bij,bjk->bk", u.conj(), K, u)) / 2


def line_axial_force(model: Model, motions: NDArray[Any]) -> NDArray[Any]:
    """Return the axial force in the middle of each line's beam, shape (n_lines, k) [N]; tension is positive.

    Parameters
    ----------
    model : Model
        With one frame.
    motions : ndarray (n_dof, k)
    """
    dofs, K = _beams(model)
    (frame,) = model.of_kind(Frame)
    force = np.einsum("bij,bjk->bik", K, motions[dofs])
    axis = frame.rotations(model.mesh)[:, 0]
    return np.einsum("bi,bik->bk", axis, force[:, 6:9] - force[:, :3]) / 2


def _beams(model: Model) -> tuple[Ints, Floats]:
    frames = model.of_kind(Frame)
    if len(frames) != 1:
        refuse(f"the model has {len(frames)} frames; values along lines need exactly one", ModelError)
    beams = frames[0].contribution_of(model, np.arange(model.mesh.n_lines))[0]
    return beams.dofs, np.asarray(beams.K)
