"""Files with nothing of what a reader expects end in one line that names the file."""

import io
import warnings
import wave
from functools import cache

import numpy as np
import pytest
from scipy.io import savemat

from dovetail import main
from fem.io import (
    read_deck,
    read_frf,
    read_matrices,
    read_mesh,
    read_model,
    read_modes,
    read_time_data,
    read_uff,
)

FRAME = (
    "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n*ELEMENT, TYPE=B31, ELSET=E\n1, 1, 2\n"
    "*BEAM SECTION, ELSET=E, MATERIAL=S, SECTION=RECT\n.1, .1\n"
    "*MATERIAL, NAME=S\n*ELASTIC\n2e11, .3\n*DENSITY\n7800.\n"
)
TEXTS = {
    "empty": "",
    "blank lines": "\n  \n\n",
    "comments": "$ a\n# b\n** c\n",
    "a word": "hello\n",
    "zeros": "\0" * 200,
    "nodes of Abaqus": "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n",
    "solids of Abaqus": FRAME.replace("B31", "C3D4").replace("BEAM", "SOLID"),
    "grid points": "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n",
    "solids of Nastran": "GRID,1,,0.,0.,0.\nCTETRA,1,1,1,1,1,1\nPSOLID,1,1\nENDDATA\n",
    "executive control": "SOL 103\nCEND\nBEGIN BULK\nENDDATA\n",
    "commands of ANSYS": "/PREP7\n/COM,ANSYS\nFINISH\n",
    "a head of Gmsh": "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n0 0 0 0\n$EndNodes\n",
    "a head of a universal file": "    -1\n   151\nname\n\n\n\n\n\n\n    -1\n",
    "no dataset": "    -1\n    -1\n",
    "an open dataset": "    -1\n    58\n",
    "a head of a table": "frequency,1Z+/1Z+ real,1Z+/1Z+ imag\n",
    "a head of a time table": "time [s],a [m/s^2]\n",
    "a head of Matrix Market": "%%MatrixMarket matrix coordinate real symmetric\n",
    "VTK": "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n",
    "XML": "<?xml version='1.0'?>\n<VTKFile></VTKFile>\n",
    "a head of MATLAB": "MATLAB 5.0 MAT-file" + " " * 105,
    "a head of RIFF": "RIFF\0\0\0\0WAVE",
    "a head of LabVIEW": "TDSm" + "\0" * 24,
    "a head of HDF5": "\x89HDF\r\n\x1a\n",
    "a head of ZIP": "PK\x03\x04",
}
SUFFIXES = (".inp", ".bdf", ".cdb", ".msh", ".uff", ".vtu", ".npz", ".mat", ".csv", ".h5", ".wav", ".mtx")
READERS = (read_mesh, read_model, read_deck, read_frf, read_modes, read_uff, read_matrices, read_time_data)


@cache
def contents():
    """Return the texts, and containers of other libraries with nothing in them, as bytes."""
    found = {name: text.encode("latin1") for name, text in TEXTS.items()}
    for name, arrays in (
        ("no array", {}),
        ("an FRF of no line", {"frequency": np.zeros(0), "H": np.zeros((0, 1, 1))}),
        ("matrices of no row", {"K": np.zeros((0, 0)), "M": np.zeros((0, 0))}),
    ):
        npz, mat = io.BytesIO(), io.BytesIO()
        np.savez(npz, **arrays)  # pyright: ignore[reportArgumentType]
        savemat(mat, arrays)
        found |= {f"{name} (npz)": npz.getvalue(), f"{name} (mat)": mat.getvalue()}
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(1000)
    found["no sample (wav)"] = file.getvalue()
    return found


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return the files of every content with every suffix: all readers read the same ones."""
    paths = {}
    for name, data in contents().items():
        folder = tmp_path_factory.mktemp("nothing")
        for suffix in SUFFIXES:
            paths[name, suffix] = folder / suffix[1:] / f"file{suffix}"
            paths[name, suffix].parent.mkdir()
            paths[name, suffix].write_bytes(data)
    return paths


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
def test_every_reader_answers_with_one_line(files, reader):
    """Whatever else is raised would end the program with a traceback."""
    wrong = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for (name, suffix), path in files.items():
            try:
                reader(path)
            except Exception as reason:
                ours = type(reason).__module__.split(".")[0] in ("fem", "updating", "dovetail")
                if not ours or path.stem not in str(reason) or "\n" in str(reason):
                    wrong.append((suffix, name, reason))
    assert not wrong


@pytest.mark.parametrize("suffix", [".inp", ".bdf", ".cdb", ".msh", ".uff", ".vtu"])
@pytest.mark.parametrize("test", [(), ("test.uff",)])
def test_a_study_of_nothing_is_refused(tmp_path, capsys, suffix, test):
    (tmp_path / "test.uff").write_bytes(contents()["a head of a universal file"])
    for name in (
        "empty",
        "nodes of Abaqus",
        "solids of Abaqus",
        "solids of Nastran",
        "grid points",
        "a word",
    ):
        path = tmp_path / f"file{suffix}"
        path.write_bytes(contents()[name])
        code = main(["new", str(tmp_path / "s"), "--from", str(path), *(str(tmp_path / t) for t in test)])
        lines = capsys.readouterr().err.splitlines()
        assert code == 2, (name, lines)
        assert "fault of the program" not in lines[-1], (name, lines)
        assert not (tmp_path / "s").exists()
