"""What goes to another program and what comes back: a frame and its results, as npz files.

Drivers run under interpreters that know neither Dovetail nor one another, so this module needs NumPy alone.
"""

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
PEERS_PYTHON = Path(os.environ.get("DOVETAIL_PEERS_PYTHON", ROOT / ".venv-peers" / "bin" / "python"))
"""The interpreter that `make peers` makes; another one by the variable DOVETAIL_PEERS_PYTHON."""

EULER_BERNOULLI, TIMOSHENKO = "euler-bernoulli", "timoshenko"

Floats = NDArray[np.float64]


class PeerError(RuntimeError):
    """Another program that did not do what it was asked."""


class _Stored:
    """Arrays and words that are written to one npz file and read from it."""

    def save(self, path: Path) -> None:
        """Write an npz file."""
        np.savez(path, **{f.name: getattr(self, f.name) for f in fields(self)})  # pyright: ignore[reportArgumentType]

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read an npz file; numbers and words become Python's own."""
        with np.load(path, allow_pickle=False) as data:
            values = {name: data[name] for name in data.files}
        return cls(**{name: x.item() if x.ndim == 0 else x for name, x in values.items()})


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PeerFrame(_Stored):
    """A frame of straight members, one element each, and what is wanted of it.

    Attributes
    ----------
    points : ndarray (n, 3)
        Coordinates [m].
    lines : ndarray of int (m, 2)
        The points of each member.
    local_z : ndarray (m, 3)
        Unit vectors of the members' local z axes, square to the members.
    E, G, rho : ndarray (m,)
        Moduli [Pa] and density [kg/m³].
    A, Iy, Iz, J : ndarray (m,)
        Area [m²], second moments about local y and z and torsion constant [m⁴].
    ky, kz : ndarray (m,)
        Shear coefficients along y and z [-]; Euler-Bernoulli leaves them out.
    fixed : ndarray of bool (n, 6)
        Supported directions.
    loads : ndarray (n, 6)
        Forces and moments on points, global [N, N·m].
    uniform : ndarray (m, 3)
        Forces per length along the members' local axes [N/m].
    released : ndarray of bool (m, 2, 2)
        Moments about local y and z that the first and the second end do not pass on: ``[member, end, axis]``.
    theory : str
        ``"euler-bernoulli"`` or ``"timoshenko"``.
    n_modes : int
        Number of modes wanted; 0 for none.
    static : bool
        Whether displacements and reactions are wanted.
    matrices : bool
        Whether K and M of all DOFs are wanted, without supports; for small frames.
    within : float
        Fraction of the members' lengths at which section forces and deflections are wanted; 0 for nowhere.
    options : str
        For the program: OpenSees' system, numberer and eigensolver, separated by blanks.
    history : ndarray (n_t,)
        Factors of the loads in time, the first 0, for responses in time from rest; none if empty [-].
    step : float
        Between them [s].
    alpha, beta : float
        Rayleigh damping of these responses [1/s, s].
    watched : ndarray of int (k,)
        Directions, 6 point + d, whose displacements are wanted in time.
    way : str
        How Dovetail steps in time: ``"newmark"``, as OpenSees does, or ``"modal"`` with ``n_modes`` modes.
    """

    points: Floats
    lines: NDArray[np.int64]
    local_z: Floats
    E: Floats
    G: Floats
    rho: Floats
    A: Floats
    Iy: Floats
    Iz: Floats
    J: Floats
    ky: Floats
    kz: Floats
    fixed: NDArray[np.bool_]
    loads: Floats
    uniform: Floats
    released: NDArray[np.bool_]
    theory: str = EULER_BERNOULLI
    n_modes: int = 0
    static: bool = True
    matrices: bool = False
    within: float = 0.0
    options: str = ""
    history: Floats = field(default_factory=lambda: np.zeros(0))
    step: float = 0.0
    alpha: float = 0.0
    beta: float = 0.0
    watched: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    way: str = "newmark"

    @property
    def n_free(self) -> int:
        """Number of directions that no support holds."""
        return int((~self.fixed).sum())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PeerResult(_Stored):
    """What a program found; arrays are empty where nothing was wanted.

    Attributes
    ----------
    program : str
        Its name and version.
    displacements, reactions : ndarray (n, 6)
        Global [m, rad; N, N·m].
    end_forces : ndarray (m, 2, 6)
        N, Vy, Vz, T, My, Mz on the positive faces of both ends of each member, in its axes [N, N·m].
    section_forces : ndarray (m, 6)
        N, Vy, Vz, T, My, Mz at the wanted fraction of each member; not from OpenSees [N, N·m].
    deflections : ndarray (m, 3)
        Displacements there, in the member's axes; not from OpenSees [m].
    frequency : ndarray (n_modes,)
        Rising [Hz].
    K, M : ndarray (6 n, 6 n)
        Stiffness and mass of all DOFs [N/m …, kg …].
    responses : ndarray (n_t, k)
        Displacements of the watched directions in time [m, rad].
    build, static_seconds, modes_seconds, transient_seconds : float
        CPU times of making the model, of statics, of modes and of responses in time, each with assembly [s].
    """

    program: str
    displacements: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    reactions: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    end_forces: Floats = field(default_factory=lambda: np.zeros((0, 2, 6)))
    section_forces: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    deflections: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    frequency: Floats = field(default_factory=lambda: np.zeros(0))
    K: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    M: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    responses: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    build: float = 0.0
    static_seconds: float = 0.0
    modes_seconds: float = 0.0
    transient_seconds: float = 0.0


Stored = TypeVar("Stored", PeerFrame, PeerResult)


def with_changes(stored: Stored, **changes: Any) -> Stored:
    """Return a frame or a result with other values."""
    return replace(stored, **changes)


def run(
    driver: str, frames: Sequence[PeerFrame], folder: Path, python: Path = PEERS_PYTHON
) -> list[PeerResult]:
    """Let one process of a driver compute frames, one after the other.

    Parameters
    ----------
    driver : str
        Module beside this one: ``"drive_opensees"``, ``"drive_pynite"`` or ``"drive_dovetail"``.
    frames : sequence of PeerFrame
    folder : Path
        For the files.
    python : Path
        The interpreter.

    Raises
    ------
    PeerError
        If the process fails; the message ends with what it wrote last.
    """
    paths = [folder / f"{driver}-{i}.npz" for i in range(len(frames))]
    answers = [path.with_suffix(".result.npz") for path in paths]
    for path, frame in zip(paths, frames, strict=True):
        frame.save(path)
    others = {name: value for name, value in os.environ.items() if name != "DOVETAIL_SOLVER"}
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(
        [python, "-m", f"benchmarks.peers.{driver}", *paths],
        cwd=ROOT,
        env={**others, **one_thread, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    missing = [path for path in answers if not path.exists()]
    if done.returncode or missing:
        msg = (
            f"{driver} ended with {done.returncode} and {len(missing)} of {len(frames)} results missing; "
            f"it wrote:\n{done.stderr[-2000:]}"
        )
        raise PeerError(msg)
    return [PeerResult.load(path) for path in answers]


def on_positive_faces(forces: Any) -> Floats:
    """Return the forces (m, 12) of the nodes on both ends of members as those on positive faces (m, 2, 6)."""
    return np.array(forces, dtype=float).reshape(-1, 2, 6) * np.array([-1.0, 1.0])[:, None]


def serve(compute: Any, paths: Sequence[str]) -> None:
    """Read frames, compute each and write the results beside them: the drivers' main loop."""
    for path in map(Path, paths):
        compute(PeerFrame.load(path)).save(path.with_suffix(".result.npz"))
