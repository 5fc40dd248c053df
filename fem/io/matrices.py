"""K, M, C and D for and from other programs: Matrix Market, ``.npz``, and CalculiX's files.

A set of Matrix Market files is named after one path: ``frame.mtx`` stands for ``frame.K.mtx``,
``frame.M.mtx``, ``frame.C.mtx``, ``frame.D.mtx``, ``frame.Q.mtx`` and the table ``frame.dofs.csv``, which has
one line for each row of the matrices: row (from 1), label, node, direction (1 to 6, 0 for none), x, y, z [m].

Keys of an ``.npz`` file: ``K_row``, ``K_column``, ``K_value`` (both triangles, rows counted from 0) and the
same for M, C, D and Q, with their shapes ``K_shape``; ``labels`` (n,), ``nodes`` (n_nodes,), ``points``
(n_nodes, 3) [m]. Dense arrays ``K``, ``M``, ``C``, ``D`` are read as well.
"""

import csv
import os
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from fem.io.abaqus import read_abaqus_nodes
from fem.io.abaqus_matrices import moves_freely
from fem.io.arrays import typed
from fem.io.atomic import replacing
from fem.io.columns import cut_number, text_of
from fem.io.faults import error_at, refuse
from fem.io.matrix_market import MOST_ROWS
from fem.io.matrix_names import matrix_files
from fem.io.part_files import ENDINGS, read_part
from fem.matrices import Matrices, MatricesError
from fem.model import lever_matrix
from fem.system import System, sum_contributions

_LABEL = re.compile(r"\s*([0-9]{1,18})\s*(RX|RY|RZ|X|Y|Z)\s*([+-]?)\s*", re.IGNORECASE)
_UNIT = {"K": "stiffness [N/m, N, N m]", "M": "mass [kg, kg m, kg m2]", "C": "viscous damping [N s/m, ...]"}
_UNIT |= {"D": "structural damping [N/m, N, N m]", "Q": "from the independent coordinates to all DOFs [-]"}


def matrices_of(system: System, *, constrained: bool = True) -> Matrices:
    """Return a system's matrices with labelled degrees of freedom, for other programs.

    Damping of the structure is included as far as matrices can state it: C = local + αM + βK,
    D = local + ηK. Nodes are the points of the mesh, counted from 0. A coordinate that is no motion of one
    point (constraints have tied several, or an element has internal coordinates) has the label ``q…``; Q
    then defines it.

    Parameters
    ----------
    system : System
    constrained : bool
        True for the independent coordinates q with u = Q q, on which supports and rigid joints act; False for
        all DOFs of the mesh, without supports and rigid joints.

    Warns
    -----
    UserWarning
        If the model has modal damping ratios, or elements that depend on frequency, which no matrix can say.
    """
    model, damping = system.model, system.model.damping
    if damping.ratio.any():
        warnings.warn(
            "modal damping ratios have no matrix and are left out of C; Rayleigh damping would be kept",
            stacklevel=2,
        )
    if getattr(system, "laws", ()):
        warnings.warn(
            f"{len(system.laws)} element(s) depend on frequency; K holds their static stiffness only",
            stacklevel=2,
        )
    n_dof = model.n_dof
    if constrained:
        K, M, C, D = system.K, system.M, system.C, system.D
        Q = system.Q
    else:
        K, M, C, D = sum_contributions(model.contributions(), n_dof)
        Q = sp.eye_array(n_dof, format="csr")
    K, M, C, D = ((X + X.T) / 2 for X in (K, M, C, D))
    C = C + damping.alpha * M + damping.beta * K
    D = D + damping.loss_factor * K
    node, direction = _coordinates(Q, model.mesh.n_points)
    trivial = Q.shape[0] == Q.shape[1] == 6 * model.mesh.n_points
    return Matrices.from_arrays(
        K,
        M,
        node,
        direction,
        np.arange(model.mesh.n_points),
        model.mesh.points,
        C if abs(C).sum() else None,
        D if abs(D).sum() else None,
        None if trivial else Q,
    )


def _coordinates(Q: Any, n_points: int) -> tuple[Ints, Ints]:
    """Return node and direction of each column of Q that is one DOF of the mesh; -1 and 0 of the others."""
    columns = sp.csc_array(Q)
    node, direction = np.full(Q.shape[1], -1), np.zeros(Q.shape[1], dtype=np.int64)
    for j in range(Q.shape[1]):
        part = slice(columns.indptr[j], columns.indptr[j + 1])
        dofs = columns.indices[part][columns.data[part] != 0]
        if dofs.size == 1 and dofs[0] < 6 * n_points and columns.data[part].max() == 1:
            node[j], direction[j] = dofs[0] // 6, dofs[0] % 6 + 1
    return node, direction


# Writing ----------------------------------------------------------------------------------------------------


def write_matrices(
    path: str | os.PathLike[str], data: Matrices | System, title: str = ""
) -> tuple[Path, ...]:
    """Write matrices; the suffix says how, ``.npz`` or ``.mtx``, and nothing is lost.

    Parameters
    ----------
    path : path
        ``frame.npz``, or ``frame.mtx``, which stands for ``frame.K.mtx`` … ``frame.dofs.csv``.
    data : Matrices or System
        A system is written as :func:`matrices_of` gives it.
    title : str
        Written in the comment of each Matrix Market file.

    Returns
    -------
    tuple of Path
        The files, each replaced completely or not at all.

    Raises
    ------
    MatricesError
        For another suffix.
    """
    matrices = matrices_of(data) if isinstance(data, System) else data
    path = Path(path)
    if path.suffix.lower() == ".npz":
        arrays: dict[str, Any] = _arrays_of(matrices)
        with replacing(path) as scratch, scratch.open("wb") as file:
            np.savez_compressed(file, **arrays)
        return (path,)
    if path.suffix.lower() != ".mtx":
        raise error_at(path.name, f"matrices are written as .npz or .mtx, not '{path.suffix}'", MatricesError)
    files = []
    for key in "KMCDQ":
        X = getattr(matrices, key)
        target = _part(path, f"{key}.mtx")
        if X is None:
            continue
        words = [
            f"{key}: {_UNIT[key]}" + (f" of {' '.join(title.split())}" if title else ""),
            f"rows and columns: see {_part(path, 'dofs.csv').name}; SI units (m, kg, s, N, rad)",
        ]
        with replacing(target) as scratch:
            text = "\n".join(" " + word for word in words)
            kind = "general" if key == "Q" else "symmetric"
            scipy.io.mmwrite(scratch, sp.coo_array(X), comment=text, precision=17, symmetry=kind)
        files.append(target)
    table = _part(path, "dofs.csv")
    place = {int(p): xyz for p, xyz in zip(matrices.nodes, matrices.points, strict=True)}
    with replacing(table) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["row", "label", "node", "direction", "x_m", "y_m", "z_m"])
        for k, name in enumerate(matrices.labels):
            node, direction = int(matrices.node[k]), int(matrices.direction[k])
            xyz = [repr(float(v)) for v in place[node]] if node in place else ["", "", ""]
            writer.writerow([k + 1, name, node if direction else "", direction, *xyz])
        written = set(matrices.node.tolist())
        for node, xyz in place.items():  # places of nodes that constraints have taken all rows of
            if node not in written:
                writer.writerow(["", "", node, "", *(repr(float(v)) for v in xyz)])
    return (*files, table)


def _part(path: Path, ending: str) -> Path:
    return path.with_name(f"{path.name.removesuffix(path.suffix)}.{ending}")


def _arrays_of(matrices: Matrices) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "labels": np.array(matrices.labels, dtype=str),
        "nodes": matrices.nodes,
        "points": matrices.points,
    }
    for key in "KMCDQ":
        X = getattr(matrices, key)
        if X is not None:
            coo = sp.coo_array(X)
            arrays |= {f"{key}_row": coo.row, f"{key}_column": coo.col, f"{key}_value": coo.data}
            arrays[f"{key}_shape"] = np.array(X.shape)
    return arrays


# Reading ----------------------------------------------------------------------------------------------------


def read_matrices(
    path: str | os.PathLike[str],
    units: str | tuple[float, float, float] = "SI",
    *,
    labels: ArrayLike | None = None,
    nodes: ArrayLike | None = None,
    points: ArrayLike | None = None,
    deck: str | os.PathLike[str] | None = None,
) -> Matrices:
    """Read matrices of a structure; the ending and the content of a file say which format it has.

    Parameters
    ----------
    path : path
        ``part.npz``; ``part.mtx`` for ``part.K.mtx``, ``part.M.mtx`` and so on (Matrix Market, Abaqus);
        ``part.sti`` (:func:`read_calculix`); ``part.pch``, ``part.bdf`` (DMIG) and ``part.op4`` of Nastran;
        ``part.matrix`` and ``part.hb`` for ``part.K.matrix`` and so on (Harwell-Boeing); ``part.mat``.
    units : str or (length, mass, time)
        Units of the file, such as ``"mm-t-s"``; see :data:`fem.matrices.UNITS`.
    labels : sequence of str, optional
        Degrees of freedom of the rows, such as ``"12Z+"``, where the file does not say them.
    nodes, points : array_like (n_nodes,), (n_nodes, 3), optional
        Places of nodes in the file's unit of length, where it does not say them.
    deck : path, optional
        Deck of Abaqus, CalculiX or Nastran, or table (``.csv``: node, x, y, z) with the places of nodes; one
        next to the file with the same name unless given.

    Raises
    ------
    MatricesError
        If a file is missing or damaged, or the matrices are not those of a structure.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".sti":
        return read_calculix(path, deck, units=units, nodes=nodes, points=points)
    if suffix not in (".npz", *ENDINGS):
        allowed = ", ".join((".npz", *ENDINGS[:-1]))
        msg = f"{path.name}: matrices are read from {allowed}, .mat and .sti files, not '{path.suffix}'"
        raise MatricesError(msg)
    if suffix == ".npz" and not path.is_file():
        raise error_at(path, "there is no such file", MatricesError)
    places = None if deck is None else Path(deck)
    found = _npz(path) if suffix == ".npz" else read_part(path, places, ordered=labels is None)
    for base in {path.stem, matrix_files(path)[0]} if suffix != ".npz" and "K" in found else ():
        table = path.with_name(f"{base}.dofs.csv")
        if table.is_file():
            found |= _table(table, found["K"].shape[0])
    given = {"labels": labels, "nodes": nodes, "points": points}
    found |= {key: np.asarray(value) for key, value in given.items() if value is not None}
    for key, word in (("K", "stiffness"), ("M", "mass")):
        if key not in found:
            others = ", ".join(k for k in found if k in "KMCDQ")
            msg = f"{path.name}: there is no {word} matrix {key}; it has {others or 'none'}"
            raise MatricesError(msg)
    if "labels" in found:
        node, direction, sign = _parsed(np.atleast_1d(found["labels"]), path.name)
    elif "node" in found:
        node, direction, sign = found["node"], found["direction"], np.ones(found["node"].size)
    else:
        msg = (
            f"{path.name}: it does not say the degrees of freedom of its rows; write {path.stem}.dofs.csv "
            "next to it (row,label,node,direction,x_m,y_m,z_m), or give labels= such as '12Z+'"
        )
        raise MatricesError(msg)
    return _built(path.name, found, node, direction, sign, units)


def _built(
    name: str,
    found: dict[str, Any],
    node: Ints,
    direction: Ints,
    sign: Floats,
    units: str | tuple[float, float, float],
) -> Matrices:
    """Put matrices together; rows with a negative direction are turned."""
    parts = {key: found.get(key) for key in "KMCDQ"}
    if (sign < 0).any():
        for key, X in parts.items():
            if X is not None and X.shape[1] == sign.size:
                turned = sp.csr_array(X) @ sp.diags_array(sign)
                parts[key] = turned if key == "Q" else sp.diags_array(sign) @ turned
    try:
        matrices = Matrices.from_arrays(
            parts["K"],
            parts["M"],
            node,
            direction,
            found.get("nodes", ()),
            found.get("points", ()),
            parts["C"],
            parts["D"],
            parts["Q"],
        )
        axes = {p: R.T for p, R in found.get("axes", {}).items()}
        return (matrices.turned(axes) if axes else matrices).scaled(units)
    except MatricesError as reason:
        raise error_at(name, str(reason), MatricesError) from reason


def _parsed(labels: NDArray[Any], name: str) -> tuple[Ints, Ints, Floats]:
    node, direction, sign = np.full(labels.size, -1), np.zeros(labels.size, np.int64), np.ones(labels.size)
    for k, text in enumerate(labels.astype(str).ravel().tolist()):
        if re.fullmatch(r"q\d+", text):
            continue
        match = _LABEL.fullmatch(text)
        if match is None:
            msg = f"{name}: the label of row {k} is {text!r}; a degree of freedom such as '12Z+' is expected"
            raise MatricesError(msg)
        node[k] = int(match.group(1))
        direction[k] = ("X", "Y", "Z", "RX", "RY", "RZ").index(match.group(2).upper()) + 1
        sign[k] = -1.0 if match.group(3) == "-" else 1.0
    return node, direction, sign


def _npz(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        try:
            loaded: Any = np.load(file, allow_pickle=False)
            arrays = {"array": loaded} if isinstance(loaded, np.ndarray) else dict(loaded)
        except Exception as reason:  # damaged archives raise whatever zipfile, zlib and numpy come upon
            raise error_at(path.name, f"it cannot be read as .npz ({reason})", MatricesError) from reason
    name = path.name
    found: dict[str, Any] = {
        key: typed(arrays, key, name, what, n_axes, MatricesError)
        for key, what, n_axes in (("labels", "text", 1), ("nodes", "integer", 1), ("points", "real", 2))
        if key in arrays
    }
    for key in "KMCDQ":
        if key in arrays:
            found[key] = typed(arrays, key, name, "any", 2, MatricesError)
        elif f"{key}_value" in arrays:
            found[key] = _sparse(arrays, key, name)
    return found


def _sparse(arrays: dict[str, NDArray[Any]], key: str, name: str) -> sp.csr_array:
    """Return the matrix whose entries are ``K_row``, ``K_column`` and ``K_value``."""
    missing = [f"{key}_{part}" for part in ("row", "column", "shape") if f"{key}_{part}" not in arrays]
    if missing:
        raise error_at(name, f"{key}_value is there, but {', '.join(missing)} is missing", MatricesError)
    row, column, shape = (
        typed(arrays, f"{key}_{k}", name, "integer", 1, MatricesError) for k in ("row", "column", "shape")
    )
    value = typed(arrays, f"{key}_value", name, "real", 1, MatricesError)
    if shape.size != 2 or not ((shape >= 1) & (shape <= MOST_ROWS)).all():
        msg = f"{name}: {key}_shape is {shape.tolist()}; rows and columns, 1 to {MOST_ROWS}, are expected"
        raise MatricesError(msg)
    if not row.size == column.size == value.size:
        msg = f"{name}: {key} has {row.size} rows, {column.size} columns and {value.size} values of entries"
        raise MatricesError(msg)
    if row.size and not (
        min(row.min(), column.min()) >= 0 and row.max() < shape[0] and column.max() < shape[1]
    ):
        msg = (
            f"{name}: entries of {key} lie outside its {shape[0]} rows and {shape[1]} columns, counted from 0"
        )
        raise MatricesError(msg)
    return sp.coo_array((value, (row, column)), shape=tuple(shape.tolist())).tocsr()


def _table(file: Path, n: int) -> dict[str, Any]:
    try:
        lines = list(csv.reader(text_of(file).splitlines()))
    except csv.Error as reason:
        raise error_at(file.name, f"it is no table ({reason})", MatricesError) from None
    if not lines or lines[0] != ["row", "label", "node", "direction", "x_m", "y_m", "z_m"]:
        raise error_at(file.name, "its first line is not row,label,node,direction,x_m,y_m,z_m", MatricesError)
    labels, place = [""] * n, {}
    for k, cells in enumerate(lines[1:], start=2):
        try:
            row, name, node, _, x, y, z = cells
            if row:
                if not 1 <= int(row) <= n:
                    msg = f"{file.name}: line {k} is about row {row}; the matrices have rows 1 to {n}"
                    raise MatricesError(msg)
                labels[int(row) - 1] = name
            if node and x:
                place[int(np.int64(int(node)))] = xyz = [float(v) for v in (x, y, z)]
                if not np.isfinite(xyz).all():
                    raise ValueError
        except MatricesError:
            raise
        except (ValueError, OverflowError):
            msg = f"{file.name}: line {k} is {','.join(cells)[:80]!r}; seven cells are expected"
            raise MatricesError(msg) from None
    if "" in labels:
        raise error_at(file.name, f"there is no line about row {labels.index('') + 1} of {n}", MatricesError)
    return {
        "labels": np.array(labels),
        "nodes": np.array(list(place)),
        "points": np.array(list(place.values())),
    }


def read_calculix(
    path: str | os.PathLike[str],
    deck: str | os.PathLike[str] | None = None,
    units: str | tuple[float, float, float] = "SI",
    *,
    nodes: ArrayLike | None = None,
    points: ArrayLike | None = None,
) -> Matrices:
    """Read the files of CalculiX's ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: ``.sti``, ``.mas`` and ``.dof``.

    Each line of ``.sti`` and ``.mas`` has row, column (from 1) and value, of one triangle; each line of
    ``.dof`` says the degree of freedom of a row as ``node.direction``. Directions that supports hold have no
    row.

    Parameters
    ----------
    path : path
        The job with any suffix or none: ``bracket.sti``.
    deck : path, optional
        Input deck with the nodes' places; ``bracket.inp`` next to the matrices unless given.
    units : str or (length, mass, time)
        Units of the deck, such as ``"mm-t-s"``.
    nodes, points : array_like (n_nodes,), (n_nodes, 3), optional
        Places of nodes in the deck's unit of length, instead of a deck.

    Raises
    ------
    MatricesError
        If a file is missing or damaged.
    """
    job = Path(path)
    job = job.with_suffix("") if job.suffix.lower() in (".sti", ".mas", ".dof", ".inp") else job
    files = [job.with_name(f"{job.name}.{ending}") for ending in ("dof", "sti", "mas")]
    for file in files:
        if not file.is_file():
            msg = (
                f"{file}: there is no such file; CalculiX writes .sti, .mas and .dof with "
                "*FREQUENCY, SOLVER=MATRIXSTORAGE"
            )
            raise MatricesError(msg)
    node, direction = _calculix_dofs(files[0])
    found: dict[str, Any] = {
        "K": _triplets(files[1], node.size, diagonal=True),
        "M": _triplets(files[2], node.size, diagonal=False),
    }
    deck = job.with_name(f"{job.name}.inp") if deck is None else Path(deck)
    if nodes is not None and points is not None:
        found |= {"nodes": np.asarray(nodes), "points": np.asarray(points)}
    elif deck.is_file():
        numbers, places = read_abaqus_nodes(deck)
        keep = np.isin(numbers, node)
        found |= {"nodes": numbers[keep], "points": places[keep]}
        node, direction = _without_modes(found["K"], node, direction, found["nodes"], found["points"])
    return _built(job.name, found, node, direction, np.ones(node.size), units)


def _calculix_dofs(file: Path) -> tuple[Ints, Ints]:
    words = file.read_text(encoding="ascii", errors="replace").split()
    pairs = [re.fullmatch(r"([0-9]{1,18})\.([1-6])", word) for word in words]
    bad = next((k for k, pair in enumerate(pairs) if pair is None), None)
    if bad is not None:
        found = f"line {bad + 1} is {words[bad][:30]!r}"
        raise error_at(file.name, f"{found}; node and direction are expected, such as 12.3", MatricesError)
    numbers = np.array([[int(p.group(1)), int(p.group(2))] for p in pairs if p], dtype=np.int64).reshape(
        -1, 2
    )
    return numbers[:, 0], numbers[:, 1]


def _without_modes(
    K: sp.csr_array, node: Ints, direction: Ints, nodes: Ints, points: Floats
) -> tuple[Ints, Ints]:
    """Return node and direction of rows; -1 and 0 for incompatible modes of elements such as C3D8I.

    CalculiX gives these modes nodes that the deck does not have, and so it does to the nodes of beams and
    shells, which it makes solid. Modes rest in rigid-body motions, and such nodes do not.
    """
    inner = ~np.isin(node, nodes)
    if not inner.any() or inner.all():
        return node, direction
    order = np.argsort(nodes)
    at = order[np.searchsorted(nodes, node[~inner], sorter=order)]
    R = np.zeros((len(node), 6))
    R[~inner] = lever_matrix(points - points.mean(axis=0))[at, direction[~inner] - 1]
    if not moves_freely(K[inner], R):
        return node, direction
    return np.where(inner, -1, node), np.where(inner, 0, direction)


def _triplets(file: Path, n: int, diagonal: bool) -> sp.csr_array:
    """Return the symmetric matrix of a file; with ``diagonal`` each row has to have its diagonal entry.

    CalculiX leaves out entries below 1e-20: a row of the stiffness has a diagonal, and one of the mass may
    have none.
    """
    text = file.read_text(encoding="ascii", errors="replace").replace("D", "E")
    if not text.endswith("\n") and text.strip():
        values = [line.split()[-1] for line in text.splitlines() if line.strip()]
        if reason := cut_number(values, ()):
            refuse(f"{file.name}, line {len(values)}: {reason}", MatricesError)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # so NumPy says that it met something else than a number
            table = np.fromstring(text, sep=" ").reshape(-1, 3)
    except (ValueError, DeprecationWarning):
        raise error_at(file.name, "row, column and value are expected on every line", MatricesError) from None
    rows, cols = (table[:, k].astype(np.int64) - 1 for k in (0, 1))
    outside = (np.minimum(rows, cols) < 0) | (np.maximum(rows, cols) >= n)
    if outside.any():
        k = int(np.argmax(outside))
        msg = (
            f"{file.name}: line {k + 1} is about row {rows[k] + 1} and column {cols[k] + 1}; the .dof file "
            f"has {n} rows"
        )
        raise MatricesError(msg)
    bare = np.setdiff1d(np.arange(n), rows[rows == cols])
    if diagonal and bare.size:
        msg = (
            f"{file.name}: there is no diagonal entry of row {bare[0] + 1}, {bare.size} missing in all; the "
            f".dof file has {n} rows and each of them needs one: is the file cut?"
        )
        raise MatricesError(msg)
    low, high = np.minimum(rows, cols), np.maximum(rows, cols)
    upper = sp.coo_array((table[:, 2], (low, high)), shape=(n, n)).tocsr()
    return sp.csr_array(upper + sp.triu(upper, k=1).T)
