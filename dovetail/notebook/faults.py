"""Probable faults of a study's model, as a user meets them."""

from collections.abc import Iterator
from dataclasses import dataclass

from dovetail.file.contents import StudyContents
from dovetail.report.printed import Printed
from fem.checks import Defect, check_model
from fem.mesh import Mesh
from fem.summary import counted, summary
from updating.quality.channels import check_channels

UNMOVED = {"model", "no properties", "mechanism", "loose part", "unused point"}
"""Faults of a model that has no motion, or one that nothing opposes: nothing is asked of its sensors."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Faults(Printed):
    """Probable faults of a study's model and channels.

    Attributes
    ----------
    name : str
        The study's.
    mesh : Mesh
    found : tuple of Defect
        Each with its kind, its message, and the points and elements where it is.
    warnings : tuple of str
        Probable faults of the files.
    """

    name: str
    mesh: Mesh
    found: tuple[Defect, ...]
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of faults."""
        return len(self.found)

    def __iter__(self) -> Iterator[Defect]:
        """Return the faults."""
        return iter(self.found)

    def __repr__(self) -> str:
        """Return how many of which kinds there are, on one line."""
        kinds = ", ".join(dict.fromkeys(f.kind for f in self.found))
        return summary(self, f"{self.name}: {counted(len(self), 'fault')}" + f" ({kinds})" * bool(kinds))

    def printed(self) -> list[str]:
        """Return the size of the model, the faults, and the warnings."""
        return [self.size, *self.lines, self.count, *(f"warning: {text}" for text in self.warnings)]

    @property
    def size(self) -> str:
        """The model's name and size in words."""
        m = self.mesh
        return f"{self.name}: {m.n_points} points, {m.n_lines} elements, {len(m.members)} members"

    @property
    def lines(self) -> list[str]:
        """A line for each fault."""
        return [f"  {f.kind}: {f.message}" for f in self.found]

    @property
    def count(self) -> str:
        """The number of faults and warnings in words."""
        more = f", {counted(len(self.warnings), 'warning')}" * bool(self.warnings)
        return (f"{len(self)} fault(s) found" if self.found else "no faults found") + more


def faults_of(study: StudyContents, refusals: tuple[str, ...] = ()) -> Faults:
    """Return the probable faults of a study; ``refusals`` say why a diagnosis would refuse it."""
    unread = {text for text in study.warnings if any(words in text for words in study.left_out)}
    warnings = tuple(text for text in study.warnings if text not in study.implausible and text not in unread)
    found = tuple(f for f in check_model(study.model) if f.kind != "implausible")
    found += tuple(Defect("implausible", words) for words in study.implausible)
    if not any(f.kind in UNMOVED for f in found):
        lines = study.measurements[0].frf.frequency if study.measurements else study.frequency
        found += check_channels(study.model, study.sensors, study.excitations, lines, study.measurements)
    found += tuple(Defect("refused", words) for words in refusals)
    return Faults(study.name, study.model.mesh, found, warnings)
