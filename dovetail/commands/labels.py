"""How sensors and excitations are called in files that the program writes: such that the study reads them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.disk.output import OutputError
from dovetail.file.contents import StudyContents
from fem.io.uff_format import UffError, label_of, parse_label
from fem.io.uff_types import Points, TraceLine
from fem.mesh import Mesh
from updating.measurement.measurement import Sensor, sensor_point


def channel_labels(sensors: Sequence[Sensor], labels: Mapping[str, str]) -> tuple[str, ...]:
    """Return the labels that a study gives its sensors, or else their names.

    Raises
    ------
    OutputError
        If two share one.
    """
    return _distinct(sensors, [labels.get(s.name) or s.name for s in sensors])


class NodeNumbers:
    """Node numbers of a mesh's points in a universal file: those of the study's labels, the others free.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: StudyContents) -> None:
        mesh = study.model.mesh
        self.mesh: Mesh = mesh
        self._labels = study.labels
        number: dict[int, int] = {}
        owner: dict[int, str] = {}
        for group, sensors in (("outputs", study.sensors), ("inputs", study.excitations)):
            for s in sensors:
                label = self._given(group, s)
                if label:
                    point, node = sensor_point(mesh, s), parse_label(label)[0]
                    if number.setdefault(point, node) != node:
                        msg = (
                            f"'{s.name}' has the label {label}, and another sensor calls the same place node "
                            f"{number[point]}; a universal file has one number for it: write .npz or .csv"
                        )
                        raise OutputError(msg)
                    if owner.setdefault(node, s.name) != s.name and self._elsewhere(number, point, node):
                        msg = (
                            f"'{s.name}' and '{owner[node]}' are at two places, and their labels call both "
                            f"node {node}; write .npz or .csv"
                        )
                        raise OutputError(msg)
        free = iter(k for k in range(1, 2 * mesh.n_points + len(number) + 2) if k not in owner)
        self.from_labels = bool(number)
        self.number: NDArray[np.int64] = np.array(
            [number[p] if p in number else next(free) for p in range(mesh.n_points)], dtype=np.int64
        )

    @staticmethod
    def _elsewhere(number: Mapping[int, int], point: int, node: int) -> bool:
        return any(p != point and n == node for p, n in number.items())

    def _given(self, group: str, sensor: Sensor) -> str:
        """Return a sensor's label, if the study gives it one."""
        label = self._labels[group].get(sensor.name, "")
        if not label:
            return ""
        try:
            parse_label(label)
        except UffError:
            msg = (
                f"the label '{label}' of '{sensor.name}' is no node and direction such as 12Z+, as universal "
                "files have it; write .npz or .csv"
            )
            raise OutputError(msg) from None
        return label

    def labels(self, group: str, sensors: Sequence[Sensor]) -> tuple[str, ...]:
        """Return the labels of sensors (``"outputs"``) or excitations (``"inputs"``), such as ``"12Z+"``.

        Raises
        ------
        OutputError
            For one without a label that is along no axis, or two with the same.
        """
        return _distinct(sensors, [self._given(group, s) or self._by_axis(s) for s in sensors])

    def _by_axis(self, s: Sensor) -> str:
        axis = int(np.argmax(np.abs(s.direction)))
        if abs(s.direction[axis]) < 1 - 1e-9:
            msg = f"sensor '{s.name}' is along no axis, which a universal file cannot say; write .npz or .csv"
            raise OutputError(msg)
        node = int(self.number[sensor_point(self.mesh, s)])
        return label_of(node, (axis + 1) * (1 if s.direction[axis] > 0 else -1))

    def unnamed(self, group: str, sensors: Sequence[Sensor]) -> str:
        """Return how sensors without label and node are called, in words; nothing if there are none."""
        pairs = zip(sensors, self.labels(group, sensors), strict=True)
        new = [f"{s.name} as {label}" for s, label in pairs if not self._labels[group].get(s.name)]
        return ", ".join(new[:6]) + (" …" if len(new) > 6 else "")

    def geometry(self) -> Points:
        """Return the points of the mesh with their numbers."""
        return Points(self.number, self.mesh.points)

    def lines(self) -> tuple[TraceLine, ...]:
        """Return the members as lines through them."""
        return tuple(
            TraceLine(k, name, (tuple(self.number[self.mesh.member_points(name)].tolist()),))
            for k, name in enumerate(self.mesh.members, start=1)
        )


def _distinct(sensors: Sequence[Sensor], labels: list[str]) -> tuple[str, ...]:
    for k, label in enumerate(labels):
        first = labels.index(label)
        if first < k:
            msg = (
                f"'{sensors[first].name}' and '{sensors[k].name}' would both be {label} in the file; give "
                "them labels of their own"
            )
            raise OutputError(msg)
    return tuple(labels)
