"""The facade: a study as an object with which a model is compared, extended by effects, and fitted.

study = load_study("study.toml")
found = study.diagnose()
better = study.add(*found.findings).fit()
print(study.compare().total_db, better.compare().total_db)
better.save("better.toml")
"""

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.disk.output import Output, check_outputs
from dovetail.file import config
from dovetail.file.effects import candidates_of
from dovetail.file.paths import input_files, with_paths
from dovetail.file.table import StudyError
from dovetail.file.writing import (
    rebased_values,
    with_damping,
    with_effects,
    with_element_sizes,
    with_parameters,
)
from dovetail.found import fitted_damping
from dovetail.pipeline import N_BANDS, Progress, diagnose_study, fit_problem, run
from dovetail.result import RunResult
from fem.analysis.frf import FRF, FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.analysis.modes import Modes, first_modes
from fem.connection_damping import ConnectionDamping
from fem.io.atomic import replacing
from fem.model import Effect, Model
from fem.system import assemble
from updating.correlation import Comparison, compare
from updating.diagnosis.diagnose import Diagnosis, propose
from updating.diagnosis.findings import Finding
from updating.inference.fit import FitProblem
from updating.inference.preparation import fitted_model
from updating.measurement.measurement import sensor_rows


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Study(config.Study):
    """A study that can be computed, compared, diagnosed, extended and fitted; each step gives a new one.

    Attributes
    ----------
    added : tuple of Effect
        Effects that were added to the study file's model.
    start : Model or None
        The model before :meth:`fit`, without ``added``: a later fit starts there again, so that its priors
        stay those of the study file. None before the first fit.
    """

    added: tuple[Effect, ...] = ()
    start: Model | None = None

    def __repr__(self) -> str:
        """Return one line: arrays and texts of a study fill many screens."""
        mesh = self.model.mesh
        shape = f"{len(self.sensors)} sensors, {len(self.excitations)} excitations"
        more = "".join(f" + {e.name}" for e in self.added)
        return f"<Study '{self.name}': {len(mesh.members)} members, {mesh.n_lines} elements, {shape}{more}>"

    def solve_modes(self, n: int = 10) -> Modes:
        """Return the rigid-body modes and the first ``n`` elastic modes of the model."""
        return first_modes(assemble(self.model, reciprocal=False), n)

    def frf(self, frequency: ArrayLike | None = None, kind: FRFKind | str | None = None) -> FRF:
        """Return the model's FRFs from the excitations to the sensors.

        Parameters
        ----------
        frequency : array_like (n_freq,), optional
            Lines [Hz]; those of the first measurement, or of the study file, unless given.
        kind : FRFKind or str, optional
            Receptance, mobility or accelerance; that of the first measurement, or accelerance, unless given.

        Raises
        ------
        StudyError
            If the study has no sensors or no excitations.
        """
        self.require_ends()
        measured = self.measurements[0].frf if self.measurements else None
        if frequency is None:
            frequency = self.frequency if measured is None else measured.frequency
        kind = kind or (FRFKind.ACCELERANCE if measured is None else measured.kind)
        outputs, inputs = (sensor_rows(self.model, part) for part in (self.sensors, self.excitations))
        system = assemble(self.model, reciprocal=False)
        H = compute_frf(system, np.asarray(frequency, dtype=float), outputs, inputs, kind).H
        names, forces = (tuple(s.name for s in part) for part in (self.sensors, self.excitations))
        return FRF.from_arrays(frequency, H, kind, names, forces)

    def require_ends(self) -> None:
        """Raise a :class:`StudyError` if the study has no sensors or no excitations."""
        for part in ("sensors", "excitations"):
            if not getattr(self, part):
                msg = f"{self.path}: it has no [[{part}]]; FRFs need both sensors and excitations"
                raise StudyError(msg)

    def compare(self, n_bands: int = N_BANDS) -> Comparison:
        """Return how far the model's FRFs are from the first measurement's, on all lines.

        Raises
        ------
        StudyError
            If the study has no measurement.
        """
        problem = fit_problem(self)
        return compare(problem.measured, problem.frf(problem.nominal()), n_bands, problem.data.mask)

    def diagnose(self, progress: Progress | None = None) -> Diagnosis:
        """Return which effects the model lacks; see :func:`updating.diagnose`.

        Parameters
        ----------
        progress : callable, optional
            Called with a text and the fraction done; what it raises ends the search.

        Raises
        ------
        StudyError
            If the study has no measurement.
        """
        return diagnose_study(self, progress)

    def candidates(self, kinds: Sequence[str] | None = None) -> tuple[Effect, ...]:
        """Return the effects that may be added to this model and test, all or those of some kinds."""
        test = self.measurements[0] if self.measurements else None
        return propose(self.model, kinds, () if kinds else self.exclude, test)

    def add(self, *effects: Effect | Finding) -> "Study":
        """Return the study with more effects in its model.

        Parameters
        ----------
        effects : Effect or Finding
            Candidates with the values that they shall have (:meth:`candidates`, ``with_values``), or findings
            of a diagnosis.

        Raises
        ------
        ModelError
            If the model has an effect of the same name.
        """
        new = tuple(e.effect if isinstance(e, Finding) else e for e in effects)
        model = self.model
        for effect in new:
            model = effect.added_to(model)
        return replace(self, model=model, added=(*self.added, *new))

    def fit(self) -> "Study":
        """Return the study with its uncertain parameters, its damping and the added effects fitted.

        Raises
        ------
        StudyError
            If the study has no measurement.
        """
        start = self.start or self.model.without_effect(*(e.name for e in self.added))
        effects = tuple(self.model.effect(e.name) for e in self.added)
        problem: FitProblem = fit_problem(replace(self, model=start))
        result = problem.fit_from_starts(effects)
        model = fitted_model(start, result)
        damping, connections = fitted_damping(problem, result, model)
        model = model.with_damping(damping)
        if connections is not None:
            known = [e.name for e in model.of_kind(ConnectionDamping)]
            own = ConnectionDamping(frequency=connections[0], ratio=connections[1])
            model = model.without_effect(*known).with_effect(own)
        added = tuple(model.effect(e.name) for e in effects)
        return replace(self, model=model, added=added, start=start)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the study file with the values and effects of this model.

        Comments, order and spelling of the file stay.

        Raises
        ------
        StudyError
            If an added effect is none that a study file can name.
        OutputError
            If ``path`` is one of the files that the study reads.
        """
        path = Path(path)
        check_outputs(input_files(self.path), Output("path", path))
        text = with_element_sizes(self.text, self.chosen_sizes)
        if self.start is not None:
            before, now = self.start.values(), self.model.values()
            values = {ref: now[ref] for ref, value in before.items() if ref in now and now[ref] != value}
            text = with_parameters(text, values | rebased_values(self.model, self.start.effects))
            text = with_damping(text, self.model.damping, _connections_of(self.model))
        text = with_effects(text, [e.rebased(self.model) for e in self.added])
        text = with_paths(text, self.path.parent, path.parent)
        unnamed = [e.name for e in self.added if e.name not in self._candidate_names(e.kind)]
        if unnamed:
            names = ", ".join(unnamed)
            msg = f"{path}: a study file has no name for {names}; save only effects of Study.candidates()"
            raise StudyError(msg)
        with replacing(path) as scratch:
            scratch.write_text(text, encoding="utf-8")

    def _candidate_names(self, kind: str) -> set[str]:
        model = self.start or self.model.without_effect(*(e.name for e in self.added))
        return {e.name for e in candidates_of(kind, model, self.sensors, self.excitations)}

    def run(self, out: str | os.PathLike[str], progress: Progress | None = None) -> RunResult:
        """Compare, diagnose and locate, and write the report into a folder; see :func:`pipeline.run`."""
        return run(self, Path(out), progress)


def load_study(path: str | os.PathLike[str], needs: Collection[str] = config.NEEDS) -> Study:
    """Read a study file and the files that it names.

    Parameters
    ----------
    path : path
        A TOML file; see docs/study-file.md. Other files are looked for beside it.
    needs : collection of str
        Which of ``"sensors"`` and ``"measurements"`` must be right besides the model. Anything else that
        cannot be read is left out, with a sentence in ``Study.warnings``.

    Raises
    ------
    StudyError
        If something in it cannot be meant; the message names file, line and key.
    OSError
        If the file cannot be opened.
    """
    read = config.load_study(path, needs)
    return Study(**{f.name: getattr(read, f.name) for f in fields(read)})


def _connections_of(model: Model) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return frequencies [Hz] and damping ratios [-] of connections, where they have their own."""
    own = model.of_kind(ConnectionDamping)
    return (own[0].frequency, own[0].ratio) if own else None
