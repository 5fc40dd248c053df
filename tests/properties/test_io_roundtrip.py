"""Write, then read, is the identity to the precision that the format keeps; damaged files never surprise."""

import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fem import FRF, FRFKind, Mesh, MeshError, Modes
from fem.io import (
    TableError,
    UffError,
    label_of,
    parse_label,
    read_frf,
    read_mesh,
    read_modes,
    read_uff,
    write_csv,
    write_mesh,
    write_npz,
    write_uff,
)

few = settings(max_examples=25)
dofs = st.builds(label_of, st.integers(1, 999999), st.sampled_from([1, -1, 2, -2, 3, -3, 4, -5, 6]))
numbers = st.floats(-1e30, 1e30, allow_subnormal=False).filter(lambda v: v == 0 or abs(v) > 1e-30)
steps = st.floats(2.0**-7, 1e3, width=32)


@st.composite
def frfs(draw, labels=dofs):
    outputs = draw(st.lists(labels, min_size=1, max_size=3, unique=True))
    inputs = draw(st.lists(labels, min_size=1, max_size=2, unique=True))
    n = draw(st.integers(1, 6))
    if draw(st.booleans()):
        frequency = draw(st.sampled_from([0.0, 0.03125, 1.0])) + np.arange(n) * draw(
            st.sampled_from([0.03125, 0.1, 2.0])
        )
    else:
        frequency = np.cumsum(
            [draw(st.sampled_from([0.0, 1.0])), *draw(st.lists(steps, min_size=n - 1, max_size=n - 1))]
        )
    parts = draw(arrays(float, (n, len(outputs), len(inputs), 2), elements=numbers))
    return FRF.from_arrays(
        frequency, parts[..., 0] + 1j * parts[..., 1], draw(st.sampled_from(FRFKind)), outputs, inputs
    )


@st.composite
def meshes(draw):
    """Chains and branches on a grid, with coordinates that begin with anything."""
    n = draw(st.integers(2, 7))
    rows = st.tuples(*[st.integers(-3, 3)] * 3)
    grid = np.array(draw(st.lists(rows, min_size=n, max_size=n, unique=True)), dtype=float)
    grid += 0.01 * np.sin(np.arange(3.0 * n)).reshape(n, 3)  # no corner of just 120°, where members are cut
    points = grid * draw(st.sampled_from([1.0, 0.1, 333.3])) + draw(st.sampled_from([0.0, -1.0]))
    lines = [(draw(st.integers(0, k - 1)), k) for k in range(1, n)]
    cut = draw(st.integers(0, len(lines)))
    sets = {"a": range(cut), "B b": range(cut, len(lines))}
    names = {"base": 0} if draw(st.booleans()) else {}
    return Mesh.from_lines(points, lines, {k: list(v) for k, v in sets.items()}, names)


@st.composite
def shapes(draw):
    nodes = draw(st.lists(st.integers(1, 99999), min_size=1, max_size=3, unique=True))
    width = draw(st.sampled_from([3, 6]))
    labels = tuple(label_of(node, d) for node in nodes for d in range(1, width + 1))
    m = draw(st.integers(1, 3))
    frequency = np.cumsum(draw(st.lists(steps, min_size=m, max_size=m)))
    phi = draw(arrays(float, (len(labels), m, 2), elements=numbers))
    phi[0, :, 0] = 1.0  # a shape that is zero everywhere is refused
    is_complex = draw(st.booleans())
    zeta = draw(arrays(float, m, elements=st.floats(1e-4, 0.5)))
    return Modes(frequency, phi @ [1, 1j] if is_complex else phi[..., 0], zeta, labels)


def there_and_back(suffix, write, read):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file{suffix}"
        write(path)
        return read(path)


def assert_same(frf, back, rtol, frequency_rtol):
    assert (back.kind, back.outputs, back.inputs) == (frf.kind, frf.outputs, frf.inputs)
    np.testing.assert_allclose(back.frequency, frf.frequency, rtol=frequency_rtol, atol=1e-12)
    np.testing.assert_allclose(back.H.real, frf.H.real, rtol=rtol)
    np.testing.assert_allclose(back.H.imag, frf.H.imag, rtol=rtol)


@given(st.integers(-10, 10**9), st.integers(-6, 6))
def test_labels(node, direction):
    assert parse_label(label_of(node, direction)) == (node, direction)


@pytest.mark.parametrize(
    ("binary", "double", "rtol", "frequency_rtol"),
    [
        (True, True, 0, 1e-12),
        (True, False, 6e-8, 6e-8),
        (False, True, 6e-13, 5.1e-7),
        (False, False, 5.1e-6, 5.1e-7),
    ],
)
@few
@given(frf=frfs())
def test_frf_in_universal_files(frf, binary, double, rtol, frequency_rtol):
    back = there_and_back(".uff", lambda path: write_uff(path, frf, binary=binary, double=double), read_frf)
    assert_same(frf, back, rtol, frequency_rtol)


names = st.text(
    st.characters(codec="utf-8", exclude_categories=("C", "Z"), exclude_characters="/\x85"), min_size=1
)


@few
@given(frf=frfs(names))
def test_frf_in_npz_and_csv_is_exact(frf):
    assert_same(frf, there_and_back(".npz", lambda path: write_npz(path, frf), read_frf), 0, 0)
    assert_same(frf, there_and_back(".csv", lambda path: write_csv(path, frf), read_frf), 0, 0)


@few
@given(modes=shapes())
def test_modes_in_universal_files_and_npz(modes):
    for suffix, write, rtol in ((".uff", lambda p: write_uff(p, modes=modes), 6e-6), (".npz", None, 0)):
        back = there_and_back(suffix, write or (lambda p: write_npz(p, modes)), read_modes)
        assert back.labels == modes.labels
        for have, want in (
            (back.frequency, modes.frequency),
            (back.shapes.real, modes.shapes.real),
            (back.shapes.imag, modes.shapes.imag),
        ):
            np.testing.assert_allclose(have, want, rtol=1.1 * rtol)
        np.testing.assert_allclose(back.zeta, modes.zeta, rtol=3 * rtol)


@few
@given(mesh=meshes())
def test_mesh_in_every_format(mesh):
    writers = {
        ".uff": lambda path: write_uff(path, mesh=mesh),
        ".unv": lambda path: write_uff(path, mesh=mesh, points=15),
        ".msh": lambda path: write_mesh(mesh, path),
        ".inp": lambda path: write_mesh(mesh, path),
        ".vtu": lambda path: write_mesh(mesh, path),
    }
    for suffix, write in writers.items():
        back = there_and_back(suffix, write, read_mesh)
        np.testing.assert_allclose(back.points, mesh.points, rtol=6e-6 if suffix == ".unv" else 1e-15)
        np.testing.assert_array_equal(back.lines, mesh.lines)
        assert {k: v.tolist() for k, v in back.members.items()} == {
            k: v.tolist() for k, v in mesh.members.items()
        }
        if suffix in (".msh", ".inp"):
            assert dict(back.point_names) == dict(mesh.point_names)
        if suffix == ".inp":
            assert {k: set(v) for k, v in back.groups.items()} == {k: set(v) for k, v in mesh.groups.items()}


def whole_file(folder):
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    H = np.arange(12).reshape(3, 2, 2) * (1 + 1j)
    frf = FRF.from_arrays([1.0, 2.0, 4.0], H, "mobility", ["1X+", "2Z-"], ["1X+", "3RY+"])
    modes = Modes(np.array([1.0, 2.0]), np.arange(6).reshape(3, 2) * 1j, None, ("1X+", "1Y+", "1Z+"))
    parts = []
    for binary, double in ((True, True), (True, False), (False, True), (False, False)):
        write_uff(
            folder / "x.uff", frf, modes, mesh, binary=binary, double=double, points=15 if double else 2411
        )
        parts.append((folder / "x.uff").read_bytes())
    return b"".join(parts)


with tempfile.TemporaryDirectory() as _folder:
    WHOLE = whole_file(Path(_folder))


def read_damaged(data, suffix=".uff", read=read_uff, errors=UffError):
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder) / f"file{suffix}"
        path.write_bytes(data)
        try:
            return read(path)
        except errors as reason:
            assert "file" in str(reason)  # noqa: PT017 - a file may as well be read
            return None


@settings(max_examples=100)
@given(st.integers(0, len(WHOLE)))
def test_a_universal_file_cut_anywhere(end):
    read_damaged(WHOLE[:end])


@settings(max_examples=100)
@given(st.integers(0, len(WHOLE) - 1), st.binary(min_size=1, max_size=12), st.booleans())
def test_a_universal_file_with_foreign_bytes(at, junk, overwrite):
    file = read_damaged(WHOLE[:at] + junk + WHOLE[at + len(junk) * overwrite :])
    if file is not None and (file.points or file.trace_lines):
        try:
            file.mesh()
        except (UffError, MeshError) as reason:
            assert "file" in str(reason)  # noqa: PT017


@few
@given(st.data(), meshes(), st.sampled_from([".msh", ".inp", ".vtu", ".bdf"]))
def test_a_mesh_file_cut_or_changed(data, mesh, suffix):
    written = ".inp" if suffix == ".bdf" else suffix
    whole = there_and_back(written, lambda path: write_mesh(mesh, path), Path.read_bytes)
    at = data.draw(st.integers(0, len(whole)))
    junk = data.draw(st.binary(max_size=5))
    rest = whole[at + len(junk) :] if data.draw(st.booleans()) else b""
    read_damaged(whole[:at] + junk + rest, suffix, read_mesh, MeshError)


@few
@given(st.data(), frfs(), st.sampled_from([".npz", ".csv"]))
def test_a_file_of_arrays_cut_or_changed(data, frf, suffix):
    write = write_npz if suffix == ".npz" else write_csv
    whole = there_and_back(suffix, lambda path: write(path, frf), Path.read_bytes)
    at = data.draw(st.integers(0, len(whole)))
    junk = data.draw(st.binary(max_size=5))
    rest = whole[at + len(junk) :] if data.draw(st.booleans()) else b""
    read_damaged(whole[:at] + junk + rest, suffix, read_frf, TableError)
