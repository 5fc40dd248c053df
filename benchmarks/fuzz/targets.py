"""The readers under test, with valid files to damage."""

import random
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.io import savemat, wavfile

from benchmarks.fuzz import ansys_script, decks, drawing
from benchmarks.fuzz.worker import OURS, Target
from dovetail import load_study
from dovetail.commands.excitations import driven_by
from dovetail.commands.spectrum import FREQUENCY, PERIOD, TIME, _spectra
from dovetail.desk import Desk, History, write_journal
from dovetail.file import read_columns, read_named_points, read_study, write_template
from dovetail.units import folder as units_folder
from fem import FRF, Mesh, Modes, check_model
from fem.io import (
    Asked,
    model_of,
    read_calculix,
    read_csv,
    read_deck,
    read_frfs,
    read_matrices,
    read_mesh,
    read_npz,
    read_npz_mode_std,
    read_npz_modes,
    read_time_data,
    read_uff,
    write_mesh,
    write_npz,
    write_uff,
)
from fem.io.mat_hdf5 import read_hdf5
from fem.io.named_frf import frf_of_arrays
from fem.io.time_data import _arrays as time_of_arrays


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
    _each(
        path,
        lambda p: _finite(file.frf()),
        lambda p: _finite(file.mesh()),
        lambda p: _finite(file.one_set_of_modes()),
        lambda p: _finite(read_time_data(p)),
    )


def _npz_seeds(folder: Path) -> list[bytes]:
    return _written(
        folder,
        ".npz",
        lambda p: write_npz(p, _frf()),
        lambda p: write_npz(p, _modes()),
        lambda p: np.savez(p, frequency=np.arange(3.0), H=np.ones((3, 1, 1)), kind="mobility"),
        lambda p: np.savez(p, frequency=np.arange(1.0, 3.0), shapes=np.ones((6, 2)), n_rigid=1),
    )


def _saved(arrays: drawing.Arrays) -> Callable[[Path], list[bytes]]:
    return lambda folder: _written(folder, ".npz", lambda p: np.savez(p, allow_pickle=False, **arrays))


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
    write_template(folder)
    return [*(text.encode() for text in decks.STUDY), (folder / "study.toml").read_bytes()]


def _study(path: Path) -> None:
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


def _tdms_seeds(folder: Path) -> list[bytes]:
    return [data for k in range(40) if len(data := drawing.tdms(random.Random(k))) > 500]


def _wav_seeds(folder: Path) -> list[bytes]:
    values = np.random.default_rng(2).integers(-3000, 3000, (40, 2)).astype("int16")
    return _written(folder, ".wav", lambda p: wavfile.write(p, 512, values))


def _read_named(path: Path) -> None:
    """Read what may be FRFs, and what may be responses in time."""
    _each(
        path,
        lambda p: _finite(read_frfs(p, Asked("accelerance", ("1Z+", "2X-"))).frfs),
        lambda p: _finite(read_time_data(p)),
        lambda p: _finite(read_time_data(p, 100.0)),
    )


def _read_hdf5(path: Path) -> None:
    """Do as :func:`_read_named` with one reading of the file, which takes a process of its own."""
    arrays = read_hdf5(path)
    _each(
        path,
        lambda p: _finite(frf_of_arrays(arrays, p.name, Asked("accelerance", ("1Z+", "2X-"))).frfs),
        lambda p: time_of_arrays(p, arrays, None),
    )


def _read_npz(path: Path) -> None:
    _read_named(path)
    _each(path, read_npz, read_npz_modes, read_npz_mode_std, lambda p: read_matrices(p))


def _each(path: Path, *readers: Callable[[Path], Any]) -> None:
    """Read a file in several ways, each of which may refuse it."""
    for read in readers:
        try:
            read(path)
        except ValueError as reason:
            if type(reason).__module__.split(".")[0] not in OURS:
                raise


def _finite(found: Any) -> None:
    """Raise for numbers that are not finite, which no reader returns."""
    for one in found if isinstance(found, tuple) else (found,):
        for name in ("frequency", "H", "values", "points", "sample_rate", "x"):
            assert np.isfinite(getattr(one, name, 0.0)).all(), f"{name} is not finite"


def _read_mesh(path: Path) -> None:
    _finite(read_mesh(path))


def _read_model(path: Path) -> None:
    _finite(model_of(read_deck(path)).mesh)


def _read_ansys(path: Path) -> None:
    _each(path, _read_mesh, _read_model)


def _read_columns(path: Path) -> None:
    _finite(read_frfs(path, Asked("accelerance")).frfs)


# Tables beside a study --------------------------------------------------------------------------------------

_BESIDE = {"sensors.csv": decks.SENSORS[0], "sections.csv": decks.SECTIONS[0], "modes.csv": decks.MODES[0]}


def _beside(folder: Path, but: str = "") -> Path:
    """Write the tables that the study names, but for one; return the folder."""
    for name, text in _BESIDE.items():
        if name != but:
            (folder / name).write_text(text, encoding="utf-8")
    return folder


def _in_study(end: str = "") -> Callable[[Path], None]:
    """Return the reader of a table, or of measured FRFs and modes, that a study names."""

    def read(path: Path) -> None:
        _beside(path.parent, path.name)
        study = read_study(decks.MAST + end, path.with_name("study.toml"))
        if path.name == "sections.csv":
            check_model(study.model)

    return read


@cache
def _mast() -> Any:
    with TemporaryDirectory() as scratch:
        return read_study(decks.MAST, _beside(Path(scratch)) / "study.toml")


def _read_excitation(path: Path) -> None:
    study = _mast()
    _each(
        path,
        lambda p: _finite(driven_by(study, read_columns(p, ("time",)))),
        lambda p: _finite(driven_by(study, read_columns(p, ("frequency",)), density=True)),
        lambda p: _finite(tuple(_spectra(read_columns(p, (FREQUENCY, PERIOD, TIME)), 0.05)[0].values())),
    )


def _read_dofs(path: Path) -> None:
    for key in "KM":
        path.with_name(f"f.{key}.mtx").write_text(decks.MATRIX_MARKET[0])
    _finite(read_matrices(path.with_name("f.mtx")))


def _read_records(path: Path) -> None:
    units_folder.read_records(path, {"a": 1, "b": (2, 3.5)})


# The desk's journal -----------------------------------------------------------------------------------------


@cache
def _desk() -> Desk:
    """Return a desk with a history of all that a journal may hold."""
    f = np.linspace(1, 100, 60)
    H = f**2 / (12.0**2 - f**2 + 0.3j * f)
    frf = FRF.from_arrays(f, np.stack([H, 0.5 * H], 1)[:, :, None], "accelerance", ["1Z+", "2X-"], ["1Z+"])
    with TemporaryDirectory() as scratch:
        study = _beside(Path(scratch)) / "study.toml"
        write_npz(study.with_name("f.npz"), frf)
        end = '[[measurements]]\nfile = "f.npz"\n[uncertain]\nE = 0.02\n'
        study.write_text(decks.MAST + end, encoding="utf-8")
        desk = Desk.open(study)
    desk._journal = None
    desk.add("point_mass:mast", mass=0.05)
    desk.turn("u")
    desk.set_gain("t", 1.1)
    desk.keep()
    desk.hold_out("band 20-40 Hz")
    desk.vary_form(True)
    desk.switch("u")
    return desk


def _journal_seeds(folder: Path) -> list[bytes]:
    desk = _desk()
    some = History(desk.history.states[1:3], 0)
    return _written(
        folder, ".json", *(lambda p, h=h: write_journal(p, h, desk.study.text) for h in (desk.history, some))
    )


def _read_journal(path: Path) -> None:
    """Open the desk beside a journal, and go through all of its states."""
    desk = _desk()
    again = Desk(desk.study, desk.live, desk.history, path)
    again.candidates = desk.candidates
    again._go_on()
    again._journal = None
    again.second()
    while again.history.at:
        again.undo()
    for old in path.parent.glob("*.old*.json"):
        old.unlink()


TARGETS: dict[str, Target] = {
    t.name: t
    for t in (
        Target("uff", "f.uff", _uff_seeds(False), _read_uff),
        Target("uffb", "f.uff", _uff_seeds(True), _read_uff),
        Target("msh", "f.msh", _texts(decks.GMSH), _read_mesh),
        Target("mshb", "f.msh", _gmsh_binary, _read_mesh),
        Target("inp", "f.inp", _texts(decks.ABAQUS), _read_mesh),
        Target("bdf", "f.bdf", _texts(decks.NASTRAN), _read_mesh),
        Target("cdb", "f.cdb", _texts(ansys_script.SEEDS), _read_ansys, ansys_script.script),
        Target("inpmodel", "f.inp", _texts(decks.ABAQUS_MODELS), _read_model),
        Target("bdfmodel", "f.bdf", _texts(decks.NASTRAN_MODELS), _read_model),
        Target("vtu", "f.vtu", _mesh_seeds(".vtu"), _read_mesh, drawing.vtu),
        Target("vtk", "f.vtk", _vtk_seeds, _read_mesh),
        Target("xdmf", "f.xdmf", _mesh_seeds(".xdmf"), _read_mesh),
        Target("med", "f.med", _mesh_seeds(".med"), _read_mesh),
        Target("npz", "f.npz", _npz_seeds, _read_npz, drawing.npz),
        Target("mat", "f.mat", _mat_seeds, _read_named, drawing.mat5),
        Target("hdf5", "f.h5", _hdf5_seeds, _read_hdf5, drawing.hdf5),
        Target("tdms", "f.tdms", _tdms_seeds, _read_named, drawing.tdms),
        Target("wav", "f.wav", _wav_seeds, _read_named, drawing.wav),
        Target("columns", "f.txt", _texts(decks.COLUMNS), _read_columns),
        Target("times", "f.csv", _texts(decks.TIMES), _read_named),
        Target("csv", "f.csv", _texts(decks.CSV), lambda path: read_csv(path)),
        Target("excitation", "f.csv", _texts(decks.EXCITATIONS), _read_excitation),
        Target("points", "f.csv", _texts(decks.POINTS), read_named_points),
        Target("sensors", "sensors.csv", _texts(decks.SENSORS), _in_study()),
        Target("sections", "sections.csv", _texts(decks.SECTIONS), _in_study()),
        Target("modes", "modes.csv", _texts(decks.MODES), _in_study('[modes]\nfile = "modes.csv"\n')),
        Target(
            "modenpz", "f.npz", _saved(drawing.VALID[3]), _in_study('[modes]\nfile = "f.npz"\n'), drawing.npz
        ),
        Target(
            "frfnpz",
            "f.npz",
            _saved(drawing.VALID[0]),
            _in_study('[[measurements]]\nfile = "f.npz"\n'),
            drawing.npz,
        ),
        Target("toml", "f.toml", _study_seeds, _study),
        Target("mtx", "f.K.mtx", _texts(decks.MATRIX_MARKET), _read_matrix_market),
        Target("dofs", "f.dofs.csv", _texts(decks.DOFS), _read_dofs),
        Target("dof", "f.dof", _texts([decks.CALCULIX["dof"]]), _calculix("dof")),
        Target("sti", "f.sti", _texts([decks.CALCULIX["sti"]]), _calculix("sti")),
        Target("journal", "f.json", _journal_seeds, _read_journal),
        Target("records", "records.jsonl", _texts(decks.RECORDS), _read_records),
    )
    if t.name != "tdms" or find_spec("nptdms")
}
"""By name; the suffix of the file says the format."""
