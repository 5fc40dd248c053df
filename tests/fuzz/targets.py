"""The readers under test, with valid files to damage."""

import io
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.io import savemat, wavfile

from fem.analysis.frf import FRF
from fem.analysis.modes import Modes
from fem.io import (
    Asked,
    read_calculix,
    read_csv,
    read_frfs,
    read_matrices,
    read_mesh,
    read_npz,
    read_npz_modes,
    read_uff,
    write_mesh,
    write_npz,
    write_uff,
)
from fem.io.time_data import read_time_data
from fem.mesh import Mesh
from tests.fuzz import decks
from tests.fuzz.worker import Target


def _portal() -> Mesh:
    points = [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]
    return Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"columns": [0, 2], "beam": [1]})


def _frf() -> FRF:
    rng = np.random.default_rng(0)
    H = rng.normal(size=(8, 2, 1)) + 1j * rng.normal(size=(8, 2, 1))
    return FRF.from_arrays(np.arange(1.0, 9.0), H, "accelerance", ["1Z+", "2X-"], ["1Z+"])


def _modes() -> Modes:
    shapes = np.random.default_rng(1).normal(size=(24, 2))
    return Modes(np.array([3.0, 7.5]), shapes, np.array([0.01, 0.02]))


def _texts(texts: list[str]) -> Callable[[Path], list[bytes]]:
    return lambda folder: [text.encode() for text in texts]


def _written(folder: Path, suffix: str, *writers: Callable[[Path], object]) -> list[bytes]:
    out = []
    for write in writers:
        path = folder / f"seed{suffix}"
        write(path)
        out.append(path.read_bytes())
        path.unlink()
    return out


def _uff_seeds(binary: bool) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        return _written(
            folder,
            ".uff",
            lambda p: write_uff(p, _frf(), mesh=_portal(), binary=binary),
            lambda p: write_uff(p, _frf(), binary=binary, double=False),
            lambda p: write_uff(p, modes=_modes(), mesh=_portal(), points=15, binary=binary),
        )

    return seeds


def _read_uff(path: Path) -> None:
    file = read_uff(path, "accelerance")
    for use in (file.frf, file.mesh):
        try:
            use()
        except ValueError as reason:  # what the file does not hold
            if type(reason).__module__.split(".")[0] != "fem":
                raise


def _npz_seeds(folder: Path) -> list[bytes]:
    return _written(
        folder,
        ".npz",
        lambda p: write_npz(p, _frf()),
        lambda p: write_npz(p, _modes()),
        lambda p: np.savez(p, frequency=np.arange(3.0), H=np.ones((3, 1, 1)), kind="mobility"),
        lambda p: np.savez(p, frequency=np.arange(1.0, 3.0), shapes=np.ones((6, 2)), n_rigid=1),
    )


_ENTRIES = (f"{key}_{part}" for key in "KM" for part in ("row", "column", "value", "shape"))
_KEYS = tuple(
    [
        "frequency",
        "H",
        "kind",
        "outputs",
        "inputs",
        "shapes",
        "zeta",
        "labels",
        "n_rigid",
        "K",
        "M",
        "C",
        "nodes",
        "points",
    ]
)
_KEYS = (*_KEYS, *_ENTRIES)


def _draw_npz(rng: random.Random) -> bytes:
    """Return an archive of arrays of all types and shapes, under the keys that readers look for."""
    arrays = {key: _draw_array(rng) for key in rng.sample(_KEYS, rng.randrange(1, len(_KEYS)))}
    if rng.random() < 0.5:
        arrays["kind"] = np.array(rng.choice(("mobility", "receptance", "accelerance", "x", "")))
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def _draw_array(rng: random.Random) -> np.ndarray:
    shape = tuple(rng.choice((0, 1, 2, 2, 3, 12)) for _ in range(rng.choice((0, 1, 1, 2, 2, 3, 4))))
    n = int(np.prod(shape))
    kind = rng.choice(
        ("float", "float", "int", "text", "complex", "bool", "uint8", "time", "extreme", "rising")
    )
    if kind == "text":
        values = np.array(
            [rng.choice(("1Z+", "2X", "q1", "", "7RZ-", "x" * 300)) for _ in range(n)], dtype=str
        )
    elif kind == "extreme":
        values = np.array([rng.choice((np.nan, np.inf, -1.0, 1e308, 5e-324, 0.0, 2.0**63)) for _ in range(n)])
    elif kind == "rising":
        values = np.arange(float(n))
    elif kind == "time":
        values = np.arange(n).astype("datetime64[s]")
    else:
        values = np.array(
            [rng.choice((0, 1, 2, 3, 11, 2**40 if kind == "int" else 5)) for _ in range(n)]
        ).astype(kind)
    return values.reshape(shape)


def _read_npz(path: Path) -> None:
    for read in (read_npz, read_npz_modes, read_matrices):
        try:
            read(path)
        except ValueError as reason:  # the file is of another reader's kind
            if type(reason).__module__.split(".")[0] != "fem":
                raise


def _read_matrix_market(path: Path) -> None:
    other = path.with_name("f.M.mtx")
    other.write_text(decks.MATRIX_MARKET[0])
    read_matrices(
        path.with_name("f.mtx"), labels=[f"{n}{d}" for n in (1, 2) for d in ("X", "Y", "Z", "RX", "RY", "RZ")]
    )


def _calculix(suffix: str) -> Callable[[Path], object]:
    def read(path: Path) -> None:
        for other, text in decks.CALCULIX.items():
            if other != suffix:
                path.with_suffix(f".{other}").write_text(text)
        read_calculix(path)

    return read


def _study_seeds(folder: Path) -> list[bytes]:
    """Return small studies, and the template with its measurement beside."""
    from dovetail.file.template import write_template

    write_template(folder)
    return [*(text.encode() for text in decks.STUDY), (folder / "study.toml").read_bytes()]


def _study(path: Path) -> None:
    from dovetail.file.config import load_study
    from fem.checks import check_model

    study = load_study(path)
    check_model(study.model)


def _mesh_seeds(suffix: str) -> Callable[[Path], list[bytes]]:
    return lambda folder: _written(folder, suffix, lambda p: write_mesh(_portal(), p))


def _vtk_seeds(folder: Path) -> list[bytes]:
    return [*(text.encode() for text in decks.VTK), *_mesh_seeds(".vtk")(folder)]


def _gmsh_binary(folder: Path) -> list[bytes]:
    import meshio

    mesh = meshio.Mesh(
        np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 1]]),
        [("line", np.array([[0, 1], [1, 2]]))],
        cell_data={"gmsh:physical": [np.array([1, 2])], "gmsh:geometrical": [np.array([1, 2])]},
    )
    return _written(
        folder,
        ".msh",
        lambda p: meshio.write(p, mesh, file_format="gmsh22", binary=True),
        lambda p: meshio.write(p, mesh, file_format="gmsh", binary=True),
    )


def _mat_seeds(folder: Path) -> list[bytes]:
    frf = _frf()
    arrays = {"f": frf.frequency, "H": frf.H, "outputs": np.array(frf.outputs, dtype=object), "s": {"a": 1.0}}
    return [
        *_written(folder, ".mat", lambda p: savemat(p, arrays)),
        *_written(folder, ".mat", lambda p: savemat(p, arrays, do_compression=True)),
    ]


def _hdf5_seeds(folder: Path) -> list[bytes]:
    """Return FRFs with dimension scales and units, compressed ones, and a file as MATLAB 7.3 writes it."""
    import h5py

    frf = _frf()

    def labelled(path: Path) -> None:
        with h5py.File(path, "w") as file:
            f = file.create_dataset("frequency", data=frf.frequency)
            f.attrs["units"] = "Hz"
            f.make_scale("frequency")
            H = file.create_dataset("test/H", data=frf.H)
            H.attrs["units"] = "(m/s^2)/N"
            H.dims[0].attach_scale(f)
            H.dims[1].label, H.dims[2].label = "output", "input"
            file.create_dataset("outputs", data=list(frf.outputs), dtype=h5py.string_dtype())

    def compressed(path: Path) -> None:
        with h5py.File(path, "w", libver="latest") as file:
            file.create_dataset("f", data=frf.frequency, chunks=(4,), compression="gzip")
            for name, part in (("real", frf.H.real), ("imag", frf.H.imag)):
                file.create_dataset(name, data=part, chunks=(4, 2, 1), compression="gzip", shuffle=True)

    def matlab(path: Path) -> None:
        with h5py.File(path, "w", userblock_size=512) as file:
            parts = np.dtype([("real", "f8"), ("imag", "f8")])
            H = np.empty(frf.H.T.shape, dtype=parts)
            H["real"], H["imag"] = frf.H.T.real, frf.H.T.imag
            texts = [np.array([[ord(c)] for c in name], dtype="u2") for name in frf.outputs]
            own = [file.create_dataset(f"#refs#/{k}", data=text) for k, text in enumerate(texts)]
            cells = np.array([[d.ref] for d in own], dtype=h5py.ref_dtype)
            arrays = {"f": frf.frequency[None], "H": H, "outputs": cells}
            for (name, values), kind in zip(arrays.items(), ("double", "double", "cell"), strict=True):
                file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_(kind)

    return _written(folder, ".h5", labelled, compressed, matlab)


def _wav_seeds(folder: Path) -> list[bytes]:
    values = np.random.default_rng(2).integers(-3000, 3000, (40, 2)).astype("int16")
    return _written(folder, ".wav", lambda p: wavfile.write(p, 512, values))


def _read_named(path: Path) -> None:
    read_frfs(path, Asked("accelerance", ("1Z+", "2X-")))


def _read_columns(path: Path) -> None:
    read_frfs(path, Asked("accelerance"))


TARGETS: dict[str, Target] = {
    t.name: t
    for t in (
        Target("uff", "f.uff", _uff_seeds(False), _read_uff),
        Target("uffb", "f.uff", _uff_seeds(True), _read_uff),
        Target("msh", "f.msh", _texts(decks.GMSH), read_mesh),
        Target("mshb", "f.msh", _gmsh_binary, read_mesh),
        Target("inp", "f.inp", _texts(decks.ABAQUS), read_mesh),
        Target("bdf", "f.bdf", _texts(decks.NASTRAN), read_mesh),
        Target("vtu", "f.vtu", _mesh_seeds(".vtu"), read_mesh),
        Target("vtk", "f.vtk", _vtk_seeds, read_mesh),
        Target("xdmf", "f.xdmf", _mesh_seeds(".xdmf"), read_mesh),
        Target("npz", "f.npz", _npz_seeds, _read_npz, _draw_npz),
        Target("mat", "f.mat", _mat_seeds, _read_named),
        Target("hdf5", "f.h5", _hdf5_seeds, _read_named),
        Target("wav", "f.wav", _wav_seeds, read_time_data),
        Target("columns", "f.txt", _texts(decks.COLUMNS), _read_columns),
        Target("csv", "f.csv", _texts(decks.CSV), lambda path: read_csv(path)),
        Target("toml", "f.toml", _study_seeds, _study),
        Target("mtx", "f.K.mtx", _texts(decks.MATRIX_MARKET), _read_matrix_market),
        Target("dof", "f.dof", _texts([decks.CALCULIX["dof"]]), _calculix("dof")),
        Target("sti", "f.sti", _texts([decks.CALCULIX["sti"]]), _calculix("sti")),
    )
}
"""By name; the suffix of the file says the format."""
