"""Named arrays of all types, shapes and extremes, in each format that holds such arrays."""

import base64
import io
import random
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat, wavfile

from benchmarks.fuzz.mutation import packed

Arrays = dict[str, NDArray[Any]]

_VALUES = np.random.default_rng(0).normal(size=(8, 2, 1))
_H = _VALUES + 0.5j
_T = np.arange(16.0) / 512
_LABELS, _INPUT = np.array(["1Z+", "2X-"]), np.array(["1Z+"])
_DIAGONAL = np.arange(12)
VALID: tuple[Arrays, ...] = (
    {
        "frequency": np.arange(1.0, 9.0),
        "H": _H,
        "kind": np.array("accelerance"),
        "outputs": _LABELS,
        "inputs": _INPUT,
        "coherence": np.full(_H.shape, 0.9),
        "averages": np.array(5),
    },
    {"f": np.arange(8.0), "test/real": _VALUES, "test/imag": _VALUES, "outputs": _LABELS},
    {"omega": np.arange(1, 9), "mobility_db": _VALUES[:, 0], "phase_deg": _VALUES[:, 0], "base": _INPUT},
    {
        "frequency": np.array([3.0, 7.5]),
        "shapes": np.ones((2, 2)),
        "zeta": np.array([0.01, 0.02]),
        "labels": _LABELS,
        "n_rigid": np.array(0),
        "frequency_std": np.full(2, 1e-3),
    },
    {"time": _T, "force [N]": np.sin(900 * _T), "acc_g": np.cos(900 * _T)},
    {
        "fs": np.array(512.0),
        "x": np.ones((16, 2)),
        "channels": np.array(["a", "b"]),
        "units": np.array(["N", "g"]),
    },
    {"dt": np.array(1 / 512), "a/time": _T, "a/values": _T**2, "time_b": _T[3:], "b": _T[3:] ** 3},
    {
        **{f"{key}_{part}": _DIAGONAL for key in "KM" for part in ("row", "column")},
        **{f"{key}_value": np.ones(12) for key in "KM"},
        **{f"{key}_shape": np.array([12, 12]) for key in "KM"},
        "nodes": np.array([1, 2]),
        "points": np.array([[0.0, 0, 0], [0, 0, 1]]),
        "labels": np.array([f"{n}{d}" for n in (1, 2) for d in ("X", "Y", "Z", "RX", "RY", "RZ")]),
    },
    {"K": np.eye(6), "M": np.eye(6), "C": np.zeros((6, 6)), "labels": np.array(["1Z+"] * 6)},
)
"""Arrays as readers look for them."""

_KEYS = tuple(dict.fromkeys(key for arrays in VALID for key in arrays))
_KNOWN_UNITS = "Hz rad/s kHz m/s^2/N (m/s^2)/N g/N dB deg N g m/s^2 ms s"
_UNITS = (
    *_KNOWN_UNITS.split(),
    "",
    "%",
    "1e400 m",
    "x" * 500,
    "½",
    "1/0",
    b"N",
    3.0,
    float("nan"),
    [1, 2],
)
_ATTRIBUTES: dict[str, tuple[Any, ...]] = {
    "units": _UNITS,
    "unit_string": _UNITS,
    "NI_UnitDescription": _UNITS,
    "wf_xunit_string": _UNITS,
    "scale_factor": (1.0, 2.0, "1", float("nan"), [1.0, 1.0], 10**400),
    "offset": (0, 1e308, "", b"\xff"),
    "wf_increment": (1 / 512, 1 / 512, 0.0, -1.0, 1e-320, 1e308, float("nan"), float("inf"), 2, "1", 2**40),
    "wf_start_offset": (0.0, 1 / 512, 0.3, -1e308, float("nan"), float("inf"), "0", 2**40),
    "wf_start_time": tuple(np.datetime64(t, "us") for t in ("2026-01-01", "1904-01-01", "9999-12-31")),
    "wf_samples": (1, -1),
    "NI_Scaling_Status": ("scaled", "unscaled", 1),
    "NI_Number_Of_Scales": (1, 2, 0, -1, 2**31 - 1, "1"),
    "NI_Scale[0]_Scale_Type": ("Linear", "Polynomial", "Table", "RTD", "Cubic", 7),
    "NI_Scale[0]_Linear_Slope": (2.0, float("nan"), "a", 1e308),
    "NI_Scale[0]_Linear_Y_Intercept": (0.0, 1e308, float("inf")),
    "NI_Scale[0]_Linear_Input_Source": (0, -1, 2**32 - 1, 1),
}
"""Attributes of arrays, properties of channels."""


def draw_array(rng: random.Random) -> NDArray[Any]:
    """Return an array of any type and shape."""
    shape = tuple(rng.choice((0, 1, 2, 2, 3, 12)) for _ in range(rng.choice((0, 1, 1, 2, 2, 3, 4))))
    n = int(np.prod(shape))
    kind = rng.choice(
        ("float", "float", "int", "text", "complex", "bool", "uint8", "time", "extreme", "rising", "float16")
    )
    if kind == "text":
        values = np.array(
            [rng.choice(("1Z+", "2X", "q1", "", "7RZ-", "x" * 300)) for _ in range(n)], dtype=str
        )
    elif kind == "extreme":
        values = np.array([rng.choice(_EXTREME) for _ in range(n)], dtype=float)
    elif kind == "rising":
        values = np.arange(float(n))
    elif kind == "time":
        values = np.arange(n).astype("datetime64[s]")
    else:
        values = np.array([rng.choice((0, 1, 2, 3, 11, 2**40 if kind == "int" else 5)) for _ in range(n)])
        values = values.astype(kind)
    return values.reshape(shape)


_EXTREME = (np.nan, np.inf, -np.inf, -1.0, 1e308, 5e-324, 0.0, 2.0**63, 2.0**31)


@np.errstate(all="ignore")
def draw_arrays(rng: random.Random, valid: tuple[Arrays, ...] = VALID) -> Arrays:
    """Return valid arrays, some of them changed, left out or exchanged; at times arrays of any kind."""
    if rng.random() < 0.2:
        return {key: draw_array(rng) for key in rng.sample(_KEYS, rng.randrange(1, len(_KEYS)))}
    arrays = dict(rng.choice(valid))
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        key = rng.choice(list(arrays))
        action = rng.randrange(5)
        if action == 0 and len(arrays) > 1:
            del arrays[key]
        elif action == 1:
            arrays[rng.choice((key, rng.choice(_KEYS)))] = draw_array(rng)
        elif action == 2:
            other = rng.choice(list(arrays))
            arrays[key], arrays[other] = arrays[other], arrays[key]
        else:
            arrays[key] = _changed(rng, arrays[key])
    return arrays


def _changed(rng: random.Random, array: NDArray[Any]) -> NDArray[Any]:
    """Return an array of another type or shape, or with an extreme value."""
    action = rng.randrange(6)
    if action == 0:
        return array.T[..., None] if rng.random() < 0.3 else array.T
    if action == 1 and array.ndim:
        return (
            array[: rng.randrange(len(array) + 1)] if rng.random() < 0.5 else np.concatenate([array, array])
        )
    if action == 2 and array.dtype.kind in "fiu":
        return array.astype(rng.choice(("i1", "u2", "i8", "f2", "f4", ">f8", "c8", "U", "b1")))
    if action == 3:
        return array.reshape(-1) if rng.random() < 0.5 else array[None]
    if action == 4 and array.dtype.kind in "fi":
        return array * rng.choice((-1, 1e-300, 1e300, 0, 1e4))
    out = array.copy()
    if out.size and out.dtype.kind in "fc":
        out.flat[rng.randrange(out.size)] = rng.choice(_EXTREME)
    elif out.size and out.dtype.kind in "iu":
        info = np.iinfo(out.dtype)
        out.flat[rng.randrange(out.size)] = rng.choice((0, 1, info.min, info.max))
    return out


def draw_attributes(rng: random.Random, least: float) -> dict[str, Any]:
    """Return attributes of an array; ``least`` is the share of those that have none."""
    if rng.random() < least:
        return {}
    names = rng.sample(list(_ATTRIBUTES), rng.choice((1, 2, 3, 8)))
    return {name: rng.choice(_ATTRIBUTES[name]) for name in names}


def npz(rng: random.Random) -> bytes:
    """Return a NumPy archive."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **draw_arrays(rng))
    return file.getvalue()


def mat5(rng: random.Random) -> bytes:
    """Return a MATLAB file of version 5: plain, with damaged sizes, or with these in compressed elements."""
    tree: dict[str, Any] = {}
    for key, array in draw_arrays(rng).items():
        part, *rest = key.split("/")
        cells = array.dtype.kind == "U" and rng.random() < 0.7
        value = array.astype(object) if cells or array.dtype.kind == "M" else array
        if rest:
            tree.setdefault(part, {})[rest[0]] = value
        else:
            tree[part] = value
    file = io.BytesIO()
    for key, value in tree.items():
        with suppress(Exception):  # what no MATLAB file can hold
            one = io.BytesIO()
            savemat(one, {key: value}, oned_as=rng.choice(("row", "column")))
            file.write(one.getvalue()[128 if file.tell() else 0 :])
    data = file.getvalue()
    if rng.random() < 0.5:
        data = data[:128] + packed(rng, data[128:])
    if rng.random() < 0.3:
        inner = zlib.compress(data[128:])
        data = data[:128] + struct.pack("<II", 15, len(inner)) + inner
    return data


def hdf5(rng: random.Random) -> bytes:
    """Return an HDF5 file, at times as MATLAB 7.3 writes it, with units and scales of axes."""
    import h5py

    memory = io.BytesIO()
    matlab = rng.random() < 0.4
    with h5py.File(memory, "w", userblock_size=512 if matlab else 0) as file:
        for k, (key, array) in enumerate(draw_arrays(rng).items()):
            with suppress(Exception):  # what HDF5 cannot hold, such as dates
                (_matlab_dataset if matlab else _dataset)(rng, file, key, array, k)
        sets = [item for item in file.values() if isinstance(item, h5py.Dataset)]
        for item in sets:
            for name, value in draw_attributes(rng, 0.6).items():
                with suppress(Exception):
                    item.attrs[name] = value
        if len(sets) > 1 and rng.random() < 0.4:
            with suppress(Exception):
                one, other = rng.sample(sets, 2)
                one.make_scale(rng.choice(("frequency", "output", "x")))
                other.dims[rng.randrange(other.ndim)].attach_scale(one)
                other.dims[rng.randrange(other.ndim)].label = rng.choice(("frequency", "input", "é", ""))
    return memory.getvalue()


def _dataset(rng: random.Random, file: Any, key: str, array: NDArray[Any], _: int) -> None:
    import h5py

    if array.dtype.kind == "U":
        length = rng.choice((None, 3))
        file.create_dataset(key, data=array.astype(object), dtype=h5py.string_dtype(length=length))
        return
    packing: dict[str, Any] = (
        {"compression": "gzip"} if array.ndim and array.size and rng.random() < 0.3 else {}
    )
    file.create_dataset(key, data=array, **packing)


def _matlab_dataset(rng: random.Random, file: Any, key: str, array: NDArray[Any], k: int) -> None:
    import h5py

    kind, value = "double", array.T if array.ndim else array.reshape(1, 1)
    if array.dtype.kind == "U":
        texts = [np.array([[ord(c)] for c in text] or [[0]], dtype="u2") for text in array.reshape(-1)]
        own = [file.create_dataset(f"#refs#/{k}-{i}", data=text) for i, text in enumerate(texts)]
        references = [rng.choice((d.ref, d.ref, d.ref, h5py.Reference())) for d in own]
        kind, value = "cell", np.array([references], dtype=h5py.ref_dtype)
    elif array.dtype.kind == "c":
        parts = np.empty(value.shape, dtype=[("real", "f8"), ("imag", "f8")])
        parts["real"], parts["imag"] = value.real, value.imag
        value = parts
    item = file.create_dataset(key, data=value)
    kind = rng.choice((kind, kind, kind, kind, "char", "cell", "struct"))
    item.attrs["MATLAB_class"] = np.bytes_(kind)
    if rng.random() < 0.05:
        item.attrs["MATLAB_empty"] = 1


def tdms(rng: random.Random) -> bytes:
    """Return a LabVIEW file of one or more segments."""
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    memory = io.BytesIO()
    with suppress(Exception), TdmsWriter(memory) as writer:
        for _ in range(rng.choice((1, 1, 2))):
            shared = {"wf_increment": 1 / 512} if rng.random() < 0.7 else {}
            objects: list[Any] = [RootObject(shared | draw_attributes(rng, 0.8))]
            objects.append(GroupObject("g", draw_attributes(rng, 0.8)))
            for key, array in draw_arrays(rng).items():
                own = _writable(draw_attributes(rng, 0.5))
                objects.append(ChannelObject(rng.choice(("g", "g", "h")), key, np.ravel(array), own))
            with suppress(Exception):
                writer.write_segment(objects)
    return memory.getvalue()


def _writable(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return properties of types that TDMS has."""
    return {
        k: v for k, v in values.items() if isinstance(v, str | float | int | np.datetime64) and v != 10**400
    }


def wav(rng: random.Random) -> bytes:
    """Return a WAV file, at times with extremes in its header."""
    dtype = rng.choice(("u1", "i2", "i4", "f4", "f8"))
    shape = rng.choice(((0,), (1,), (40,), (40, 2), (3, 12), (0, 2)))
    values = np.array([rng.choice((0, 1, 100)) for _ in range(int(np.prod(shape)))]).astype(dtype)
    if values.dtype.kind == "f" and values.size and rng.random() < 0.3:
        values.flat[0] = rng.choice((np.nan, np.inf, -1e30))
    memory = io.BytesIO()
    wavfile.write(memory, rng.choice((512, 1, 0, 2**24)), values.reshape(shape))
    data = memory.getvalue()
    return packed(rng, data[:60]) + data[60:] if rng.random() < 0.5 else data


_MESH: Arrays = {
    "Points": np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]),
    "connectivity": np.array([0, 1, 1, 2, 2, 3]),
    "offsets": np.array([2, 4, 6]),
    "types": np.array([3, 3, 3], dtype="u1"),
    "member": np.array([1, 2, 1]),
}
_VTK_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}


def vtu(rng: random.Random) -> bytes:
    """Return an unstructured grid of VTK's XML with arrays as text or in base 64, also compressed."""
    arrays = draw_arrays(rng, (_MESH,))
    coded = rng.choice(("ascii", "binary", "zlib"))
    header = rng.choice(("UInt32", "UInt32", "UInt64"))
    n_points, n_cells = (rng.choice((n, n, n, n, n + 1, -1, 0, 2**40)) for n in (4, 3))
    compressor = ' compressor="vtkZLibDataCompressor"' if coded == "zlib" else ""

    def part(tag: str, names: tuple[str, ...]) -> Iterator[str]:
        yield f"<{tag}>"
        for name in names:
            if name in arrays:
                yield _data_array(rng, name, arrays[name], coded, header)
        yield f"</{tag}>"

    rest = tuple(name for name in arrays if name not in list(_MESH)[:4])
    return "\n".join(
        (
            '<?xml version="1.0"?>',
            f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="{header}"'
            f"{compressor}>",
            f'<UnstructuredGrid><Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}">',
            *part("Points", ("Points",)),
            *part("Cells", ("connectivity", "offsets", "types")),
            *part(rng.choice(("CellData", "CellData", "PointData")), rest),
            "</Piece></UnstructuredGrid></VTKFile>",
        )
    ).encode()


def _data_array(rng: random.Random, name: str, array: NDArray[Any], coded: str, header: str) -> str:
    array = array if array.dtype.kind in _VTK_TYPES and array.dtype.itemsize > 0 else np.zeros(array.shape)
    kind = f"{_VTK_TYPES[array.dtype.kind]}{8 * array.dtype.itemsize}"
    columns = f' NumberOfComponents="{array.shape[1]}"' if array.ndim > 1 else ""
    raw = array.astype(array.dtype.newbyteorder("<")).tobytes()
    size = "<I" if header == "UInt32" else "<Q"
    if coded == "ascii":
        text = " ".join(str(v) for v in array.reshape(-1).tolist())
    elif coded == "binary":
        content = struct.pack(size, len(raw)) + raw
        text = base64.b64encode(packed(rng, content) if rng.random() < 0.1 else content).decode()
    else:
        inner = zlib.compress(raw)
        head = b"".join(struct.pack(size, n) for n in (1, len(raw), 0, len(inner)))
        head = packed(rng, head) if rng.random() < 0.1 else head
        text = (base64.b64encode(head) + base64.b64encode(inner)).decode()
    form = "ascii" if coded == "ascii" else "binary"
    return f'<DataArray type="{kind}" Name="{name}"{columns} format="{form}">{text}</DataArray>'


DRAWN: dict[str, Callable[[random.Random], bytes]] = {
    "npz": npz,
    "mat": mat5,
    "hdf5": hdf5,
    "tdms": tdms,
    "wav": wav,
    "vtu": vtu,
}
"""By format."""
