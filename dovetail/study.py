"""The facade: a study as an object with which a model is compared, extended by effects, and fitted.

study = load_study("study.toml")
found = study.diagnose()
better = found.study
print(study.compare().total_db, better.compare().total_db)
better.save("better.toml")
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.disk.output import Output, check_outputs
from dovetail.file import config
from dovetail.file.contents import has_modes_alone
from dovetail.file.effects import candidate_named, candidates_of, with_given_values
from dovetail.file.estimates import FittedEstimate, merged
from dovetail.file.faults import as_mounted
from dovetail.file.paths import input_files
from dovetail.file.settings import N_BANDS
from dovetail.file.table import StudyError, StudyFileError, suggest
from dovetail.file.writing import rebased_values
from dovetail.notebook.responses import StudyFRF
from dovetail.report.html_table import inner, table
from fem.analysis.frf import FRFKind
from fem.analysis.loads import LoadCase
from fem.analysis.modes import Modes, first_modes
from fem.analysis.one_sided import OneSided, one_sided, solve_one_sided
from fem.analysis.second_order import SecondOrder, solve_second_order
from fem.analysis.statics import StaticSolution, solve_static
from fem.connection_damping import ConnectionDamping
from fem.effects import candidate_kinds
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.io.atomic import replacing
from fem.mesh import merge_names
from fem.model import Effect, Model, ModelError, parameter_values
from fem.summary import counted, listed
from fem.system import assemble
from updating.measurement.computed import computed_frf

# Methods that compare, fit and diagnose import what they need: modes and static responses need none of it.
if TYPE_CHECKING:
    from dovetail.modes_history import StatesHistory
    from dovetail.notebook.candidates import Candidates
    from dovetail.notebook.comparison import Misfit, StudyComparison
    from dovetail.notebook.diagnosis import StudyDiagnosis, StudyModeDiagnosis
    from dovetail.notebook.faults import Faults
    from dovetail.notebook.located import Located
    from dovetail.notebook.modes import StudyModeComparison
    from dovetail.notebook.planned import Planned
    from dovetail.pipeline import Progress
    from dovetail.result import RunResult
    from dovetail.update import Identified, StudyUpdate
    from updating.diagnosis.diagnosis import Diagnosis
    from updating.diagnosis.findings import Finding
    from updating.diagnosis.mode_diagnosis import ModeDiagnosis
    from updating.inference.fit_result import FitResult
    from updating.inference.problem import Problem
    from updating.measurement.measurement import Measurement, Sensor
    from updating.quality.corrections import Fault


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Study(config.StudyContents):
    """A study that can be computed, compared, diagnosed, extended and fitted; each step gives a new one.

    Attributes
    ----------
    added : tuple of Effect
        Effects that were added to the study file's model.
    start : Model or None
        The model before :meth:`fit`, without ``added``: a later fit starts there again, so that its priors
        stay those of the study file. None before the first fit.
    fitted : FitResult or None
        The last fit, with standard deviations of the fitted parameters.
    faults : tuple of Fault
        Faults of the measurement that a fit has found and corrected.
    """

    added: tuple[Effect, ...] = ()
    start: Model | None = None
    fitted: FitResult | None = None
    faults: tuple[Fault, ...] = ()
    _compared: dict[int, Any] = field(default_factory=dict, init=False)  # by n_bands; replace drops it

    @classmethod
    def from_model(
        cls,
        model: Model,
        measurements: Sequence[Measurement] = (),
        *,
        sensors: Sequence[Sensor] = (),
        excitations: Sequence[Sensor] = (),
        name: str = "model",
        **tables: Any,
    ) -> Study:
        """Return a study of a model that was built in Python, without a study file.

        ``Study.from_model(model, [measured], uncertain={"E": 0.02}, fit={"band": [20, 700]})`` judges by what
        the study file with these tables says; what is not given has the defaults of the study file. The mesh
        stays as it is.

        Parameters
        ----------
        model : Model
            With a point of the mesh at each sensor and force (:func:`updating.place_sensors`).
        measurements : sequence of Measurement
        sensors, excitations : sequence of Sensor
            Of a planned test, or of measured modes; those of the measurements need not be given.
        name : str
        **tables
            ``modes``, ``uncertain``, ``candidates``, ``fit``, ``form``, ``frequency``, ``relevant`` and
            ``channel_errors`` with the keys of docs/study-file.md.

        Raises
        ------
        StudyError
            For an unknown table or key, and a value that cannot be meant.
        MeasurementError
            If a sensor or a force is at no point of the mesh.
        """
        from dovetail.file.of_model import contents_of_model

        made = contents_of_model(model, measurements, sensors, excitations, name, tables)
        return cls(**{f.name: getattr(made, f.name) for f in fields(made)})

    def __repr__(self) -> str:
        """Return one line: arrays and texts of a study fill many screens."""
        mesh = self.model.mesh
        shape = f"{counted(len(self.sensors), 'sensor')}, {counted(len(self.excitations), 'excitation')}"
        size = f"{counted(len(mesh.members), 'member')}, {counted(mesh.n_lines, 'element')}"
        more = f" + {listed(e.name for e in self.added)}" if self.added else ""
        return f"<Study '{self.name}': {size}, {shape}{more}>"

    @property
    def label(self) -> str:
        """The model's: nominal or fitted, or with which effects."""
        if not self.added:
            return "fitted" if self.fitted else "nominal"
        return f"with {', '.join(e.name for e in self.added)}" + (", fitted" if self.fitted else "")

    def _repr_html_(self) -> str:
        """Return a table of the model, the test, the uncertain parameters, and the added effects."""
        from dovetail.report import words

        rows = [
            ("model", inner(self.model.mesh)),
            ("sensors", listed(s.name for s in self.sensors)),
            ("excitations", listed(s.name for s in self.excitations)),
            *(("measurement", inner(m)) for m in self.measurements),
            ("uncertain", listed(f"{n.effect}.{n.parameter} (± {n.std:.3g})" for n in self.nuisances)),
            *(("added", words.added_text(e, self.fitted)) for e in self.added),
            *(("corrected", words.fault_text(f)) for f in self.faults),
        ]
        return table(("", ""), rows, f"{self.name}, {self.label}")

    def solve_modes(self, n: int = 10) -> Modes:
        """Return the rigid-body modes and the first ``n`` elastic modes of the model."""
        return first_modes(assemble(self.model, reciprocal=False), n)

    def frf(self, frequency: ArrayLike | None = None, kind: FRFKind | str | None = None) -> StudyFRF:
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
        return StudyFRF.of(computed_frf(self.model, self.sensors, self.excitations, frequency, kind))

    def static(self, *cases: str) -> StaticSolution:
        """Return the static responses to load cases and combinations of the study.

        Parameters
        ----------
        *cases : str
            Names of load cases and combinations; all unless given.

        Raises
        ------
        StudyError
            If the study has no loads, or none of such a name.
        ModelError
            As :func:`fem.analysis.statics.solve_static`.
        """
        self._refuse_one_sided()
        return solve_static(assemble(self.model, reciprocal=False), self._load_cases(cases))

    def one_sided(self, *cases: str) -> tuple[OneSided, ...]:
        """Return the static responses with bars that carry tension or compression alone.

        Parameters
        ----------
        *cases : str
            Names of load cases and combinations; all unless given.

        Raises
        ------
        StudyError
            As :meth:`static`.
        ModelError
            As :func:`fem.analysis.one_sided.solve_one_sided`.
        """
        return tuple(solve_one_sided(self.model, case) for case in self._load_cases(cases))

    def _refuse_one_sided(self) -> None:
        """Raise a StudyError for bars that may go slack, where a linear structure is needed."""
        names = list(one_sided(self.model))
        if names:
            msg = (
                f"{self.path.name}: {merge_names(tuple(names))} may go slack, so the structure is not "
                "linear; dovetail static and Study.one_sided iterate. For this analysis leave out only = …"
            )
            raise StudyError(msg)

    def second_order(self, *cases: str) -> tuple[SecondOrder, ...]:
        """Return the second-order responses (P-Δ) to load cases and combinations of the study.

        Parameters
        ----------
        *cases : str
            Names of load cases and combinations; all unless given.

        Raises
        ------
        StudyError
            As :meth:`static`.
        ModelError
            As :func:`fem.analysis.second_order.solve_second_order`.
        """
        self._refuse_one_sided()
        system = assemble(self.model, reciprocal=False)
        return tuple(solve_second_order(system, case) for case in self._load_cases(cases))

    def _load_cases(self, names: Collection[str]) -> list[LoadCase]:
        """Return load cases and combinations by name, all unless names are given."""
        known = {c.name: c for c in self.loads.all_cases(self.model)}
        if not known:
            msg = f"{self.path.name}: the study has no loads; give [[loads]]"
            raise StudyError(msg)
        for name in names:
            if name not in known:
                msg = f"there is no load case or combination '{name}'; {suggest(name, known)}"
                raise StudyError(msg)
        return [known[name] for name in names or known]

    def compare(self, n_bands: int = N_BANDS) -> StudyComparison | StudyModeComparison:
        """Return how far the model's FRFs are from the first measurement's, on all lines.

        By measured modes where the study has nothing else. It is computed once for a study.

        Parameters
        ----------
        n_bands : int
            Number of equal frequency bands.

        Raises
        ------
        StudyError
            If the study has no measurement.
        """
        return self._modes_compared() if has_modes_alone(self) else self._frfs_compared(n_bands)

    def _modes_compared(self) -> StudyModeComparison:
        from dovetail.modes_pipeline import mode_problem
        from dovetail.notebook.modes import StudyModeComparison

        if 0 not in self._compared:
            problem = mode_problem(self)
            self._compared[0] = StudyModeComparison.of(problem, problem.nominal(), self.name, self.label)
        return self._compared[0]

    def _frfs_compared(self, n_bands: int = N_BANDS) -> StudyComparison:
        from dovetail.notebook.comparison import StudyComparison
        from dovetail.pipeline import fit_problem

        if n_bands not in self._compared:
            problem = fit_problem(self)
            comparison = StudyComparison.of(problem, problem.nominal(), n_bands, self.name, self.label)
            self._compared[n_bands] = comparison
        return self._compared[n_bands]

    def error(self) -> Misfit:
        """Return the error of the amplitude on the lines of the fit, those held out, and all [dB].

        The numbers are those of ``dovetail compare``. Of measured modes alone :meth:`compare` has them.

        Raises
        ------
        StudyError
            If the study has no FRFs.
        """
        return self._frfs_compared().misfit

    def plot(self) -> Any:
        """Return an interactive plotly figure of the model with its sensors, coloured by their errors [dB].

        Raises
        ------
        ValueError
            If the model has no members with sections.
        """
        from viz.interactive.model import model_figure

        errors: dict[str, float] = {}
        if self.measurements:
            found = self._frfs_compared()
            errors = dict(zip(found.outputs, found.by_sensor().tolist(), strict=True))
        title = f"{self.name}, {self.label}"
        return model_figure(self.model, self.sensors, self.excitations, errors=errors or None, title=title)

    def plot_modes(self, n: int = 10) -> Any:
        """Return an interactive plotly figure in which the first ``n`` elastic modes are chosen and move."""
        from viz.interactive.modes import modes_figure

        modes = self.solve_modes(n)
        elastic = range(modes.n_rigid, min(modes.n_rigid + n, len(modes.frequency)))
        return modes_figure(self.model, modes, list(elastic), title=f"{self.name}, {self.label}")

    def diagnose(
        self, progress: Progress | None = None, processes: int = 1, budget: str = "normal"
    ) -> StudyDiagnosis | StudyModeDiagnosis:
        """Return which effects the model lacks; see :func:`updating.diagnose`.

        By FRFs; by measured modes where the study has nothing else.

        Parameters
        ----------
        progress : callable, optional
            Called with a text and the fraction done; an exception from it ends the search.
        processes : int
            Number of parallel processes; the result is the same. With more than one, a script must guard
            its own work by ``if __name__ == "__main__":``.
        budget : str
            How much is tried with FRFs: ``"quick"`` for a first answer, ``"normal"`` or ``"thorough"``.

        Raises
        ------
        StudyError
            If the study has no measurement, or there is no such budget.
        """
        from dovetail.notebook.diagnosis import StudyDiagnosis, StudyModeDiagnosis
        from dovetail.pipeline import diagnose_any
        from dovetail.result import by_frfs
        from updating.diagnosis.evidence.budget import BUDGETS

        if budget not in BUDGETS:
            message = f"budget is one of {', '.join(BUDGETS)}, not {budget!r}"
            raise StudyError(message)
        found = diagnose_any(self, progress, processes, budget)
        return StudyDiagnosis.of(found, self) if by_frfs(found) else StudyModeDiagnosis.of(found, self)

    def locate(self, n_bands: int = N_BANDS, progress: Progress | None = None) -> Located:
        """Return which sensors, bands, members and places carry the misfit of the FRFs.

        Once the uncertain parameters are fitted: it says where a change would help, not what is wrong. It
        prints as ``dovetail locate`` does.

        Parameters
        ----------
        n_bands : int
            Number of equal frequency bands.
        progress : callable, optional
            Called with a text and the fraction done; an exception from it ends the work.

        Raises
        ------
        StudyError
            If the study has no FRFs.
        """
        from dovetail.notebook.located import located

        return located(self, n_bands, progress)

    def check(self) -> Faults:
        """Return probable faults of the model, such as loose parts, as ``dovetail check`` finds them."""
        from dovetail.notebook.faults import faults_of

        return faults_of(self)

    def identify_modes(
        self, measurement: str | None = None, band: tuple[float, float] | None = None
    ) -> Identified:
        """Return the natural modes in the measured FRFs with their uncertainty.

        Parameters
        ----------
        measurement : str, optional
            Its name; the first unless given.
        band : (float, float), optional
            Lowest and highest frequency; the study's unless given [Hz].

        Raises
        ------
        StudyError
            If the study has no such measurement.
        IdentificationError
            If the FRFs do not allow it.
        """
        from dovetail.update import identify_study

        return identify_study(self, measurement, band)

    def update(self) -> StudyUpdate:
        """Return the uncertain parameters updated to measured modes or FRFs, as ``[update]`` says.

        ``study.update().save("updated.toml")`` writes the study with the new values.

        Raises
        ------
        StudyError
            If nothing was measured, or nothing is uncertain.
        """
        from dovetail.update import update_study

        return update_study(self)

    def history(self, progress: Progress | None = None) -> StatesHistory:
        """Return what has changed since the baseline in each of the study's states.

        Parameters
        ----------
        progress : callable, optional
            Called with a text and the fraction done; an exception from it ends the work.

        Raises
        ------
        StudyError
            If the study has no modes of a baseline, or no states.
        """
        from dovetail.modes_history import diagnose_history

        return diagnose_history(self, progress or (lambda text, done: None))

    def plan(
        self,
        noise: float | None = None,
        left_db: float | None = None,
        progress: Progress | None = None,
        kinds: Sequence[str] | str | None = None,
        *,
        add: int | None = None,
        choose: int | None = None,
        excitations: int | None = None,
    ) -> Planned:
        """Return which missing effects the study's test could see and name, planned or measured.

        Parameters
        ----------
        noise : float, optional
            Noise of a planned test, in parts of the root mean square of the FRFs of a force; that of the
            measured FRFs, or 0.01, unless given [-].
        left_db : float, optional
            What a right model will leave beside noise; what the fit leaves of the measured FRFs, or what
            beams usually do, unless given [dB].
        progress : callable, optional
            Called with a text and the fraction done; an exception from it ends the work.
        kinds : str or sequence of str, optional
            Kinds of effect, such as ``"point_mass"``; those of the study unless given.
        add : int, optional
            Number of sensors that are added to the study's where they name most.
        choose : int, optional
            Number of sensors that are chosen in place of them.
        excitations : int, optional
            Number of forces that are chosen with ``choose``; those of the study unless given.

        Raises
        ------
        StudyError
            If the study has no sensors or no excitations, both ``add`` and ``choose`` are given, or there
            are fewer places.
        ModelError
            For a kind that does not exist.
        """
        from dovetail.notebook.planned import Planned
        from dovetail.plan import plan_study, with_chosen

        study = self if kinds is None else self._of_kinds(kinds)
        test, chosen = with_chosen(study, add, choose, excitations, noise, left_db, progress)
        return Planned(plan_study(test, noise, left_db, progress), chosen, self.name, self.path)

    def _of_kinds(self, kinds: Sequence[str] | str) -> Study:
        """Return the study with candidates of some kinds alone."""
        kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
        for kind in kinds:
            if kind not in candidate_kinds():
                msg = f"there is no kind of effect '{kind}'; {suggest(kind, candidate_kinds())}"
                raise ModelError(msg)
        return replace(self, kinds=kinds, exclude=())

    def candidates(
        self, kinds: Sequence[str] | str | None = None, at: Sequence[str] | str | None = None
    ) -> Candidates:
        """Return the effects that may be added to this model and test, with names, parameters and bounds.

        Parameters
        ----------
        kinds : str or sequence of str, optional
            Kinds of effect, such as ``"point_mass"``; all that the study does not exclude unless given.
        at : str or sequence of str, optional
            Places where they act, such as ``"joint:J"`` or ``"member:beam"``; everywhere unless given.

        Raises
        ------
        ModelError
            For a kind that does not exist, and a place where no candidate is.
        """
        from dovetail.notebook.candidates import Candidates
        from updating.diagnosis.candidates import propose

        test = next(iter(self.measurements or self.amplitudes), None)
        study = replace(self, kinds=None) if kinds is None else self._of_kinds(kinds)
        every = Candidates(propose(study.model, study.kinds, study.exclude, test))
        return every if at is None else every.at(*((at,) if isinstance(at, str) else at))

    def add(self, *effects: Effect | Finding | str, **values: float) -> Study:
        """Return the study with more effects in its model.

        ``study.add("point_mass:beam", mass=0.45, position=0.12)`` adds a mass of 0.45 kg at 0.12 m.

        Parameters
        ----------
        effects : str, Effect or Finding
            Names of candidates, as :meth:`candidates` lists them; candidates with values of their own; or
            findings of a diagnosis.
        **values : float
            Values of parameters of the one effect that is added [SI units of :meth:`candidates`]. Others
            stay as the candidate begins with them.

        Raises
        ------
        ModelError
            If there is no such candidate or parameter, a value is beyond its bounds, values are given for
            several effects, or the model has an effect of the same name.
        """
        from dovetail.found import effect_estimates
        from updating.diagnosis.findings import Finding

        if values and len(effects) != 1:
            msg = f"values are given with {len(effects)} effects; add one effect at a time to give it values"
            raise ModelError(msg)
        base = self.model.without_effect(*(e.name for e in self.added))
        new = []
        estimates: dict[str, FittedEstimate] = {}
        for one in effects:
            if isinstance(one, str):
                one = candidate_named(one, base, self.sensors, self.excitations)
            if isinstance(one, Finding) and not values:
                estimates |= effect_estimates(one.effect.name, one.parameters)
            new.append(with_given_values(one.effect if isinstance(one, Finding) else one, values))
        model = self.model
        for effect in new:
            model = effect.added_to(model)
        came = tuple(e.name for e in new) if self.has_baseline else ()
        return replace(
            self,
            model=model,
            added=(*self.added, *new),
            changes=(*self.changes, *came),
            estimates={**self.estimates, **estimates},
        )

    def fit(self, *, faults: bool = False) -> Study:
        """Return the study with its uncertain parameters, its damping and the added effects fitted.

        To FRFs; to measured modes where the study has nothing else. As in a diagnosis the form of the frame
        varies too, unless the study says ``[fit] form = false``. What was added to a study with a baseline
        has come since then.

        Parameters
        ----------
        faults : bool
            Whether sensors and forces that are at fault (signs, gains, delays, labels) are found and set
            right first, as ``dovetail compare --fitted`` does. That takes some seconds.

        Raises
        ------
        StudyError
            If the study has no measurement.
        """
        from dovetail.found import fit_estimates
        from dovetail.modes_pipeline import mode_problem_and_model
        from dovetail.pipeline import formed_problem_and_model
        from updating.diagnosis.begin import calibrated
        from updating.inference.fitting import fit_given
        from updating.inference.preparation import fitted_model

        start = self._unfitted
        effects = tuple(self._on(start, self.model.effect(e.name)) for e in self.added)
        names = {e.name for e in self.added}
        base = replace(self, model=start, changes=tuple(n for n in self.changes if n not in names))
        found: tuple[Fault, ...] = ()
        if has_modes_alone(self):
            problem, before = mode_problem_and_model(base)
            problem, result = fit_given(problem, effects)
        else:
            problem, before = formed_problem_and_model(base)
            problem, _, found = calibrated(problem, checked=faults)
            problem, result = fit_given(problem, effects)
            result = problem.assessed(result)
        model = fitted_model(before, result)
        estimates = fit_estimates(problem, result, model)
        return self._fitted_to(problem, result, model, [e.name for e in effects], found, estimates)

    @property
    def _unfitted(self) -> Model:
        """The model before any fit, without what was added."""
        return self.start or self.model.without_effect(*(e.name for e in self.added))

    def _fitted_to(
        self,
        problem: Problem[Any],
        result: FitResult,
        model: Model,
        added: Sequence[str],
        faults: Sequence[Fault],
        estimates: Mapping[str, FittedEstimate],
    ) -> Study:
        """Return the study with a fitted model, some of whose effects were added to the study's."""
        from updating.inference.fitted_damping import with_fitted_damping
        from updating.quality.corrections import set_right

        if problem.data.has_damping:
            model = with_fitted_damping(problem, result, model)
        more: dict[str, Any] = {"fitted": result, "faults": (*self.faults, *faults)}
        more["estimates"] = merged(self.estimates, estimates)
        test = problem.test_of(result)
        if test is not None:
            for key in ("measurements", "amplitudes"):
                more[key] = tuple(
                    replace(m, viscous=test.viscous, errors=test.errors) for m in getattr(self, key)
                )
        if faults:
            more["measurements"] = tuple(set_right(m, faults) for m in more["measurements"])
            more["sensors"] = as_mounted(self.sensors, "sensor", faults)
            more["excitations"] = as_mounted(self.excitations, "excitation", faults)
        effects = tuple(model.effect(name) for name in added)
        return replace(self, model=model, added=effects, start=self._unfitted, **more)

    def with_found(self, found: Diagnosis | ModeDiagnosis) -> Study:
        """Return the study with the fitted values, effects and faults of a diagnosis of it.

        It is what ``found.toml`` of a report has.

        Parameters
        ----------
        found : Diagnosis or ModeDiagnosis
            As :meth:`diagnose` and :func:`updating.diagnose` return it.
        """
        from dovetail.found import estimates_in
        from dovetail.result import by_modes_alone, uncertain_parameters

        result = found.final.fitted if by_modes_alone(found) else found.steps[-1].result
        names = [e.name for e in found.found]
        changes = (*self.changes, *names) if self.has_baseline else self.changes
        estimates = estimates_in(found, uncertain_parameters(found))
        added = [*(e.name for e in self.added), *names]
        study = replace(self, changes=changes)
        return study._fitted_to(found.problem, result, found.model, added, found.faults, estimates)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the study file with the values and effects of this model.

        Comments, order and spelling of the file stay.

        Raises
        ------
        StudyError
            If an added effect is none that a study file can name, or the study has no file: it is of a model
            that was built in Python.
        OutputError
            If ``path`` is one of the files that the study reads.
        """
        from dovetail.found import text_with_model, with_test

        path = Path(path)
        if not self.text:
            msg = (
                f"{path}: a model that was built in Python has no study file to write; pickle the study, or "
                "write the model as a deck, fem.io.nastran_text(fem.io.deck_of(study.model)), of which "
                "dovetail new --from makes one"
            )
            raise StudyError(msg)
        check_outputs(input_files(self.path), Output("path", path))
        values, damping = {}, None
        if self.start is not None:
            before, now = self.start.values(), self.model.values()
            values = {ref: now[ref] for ref, value in before.items() if ref in now and now[ref] != value}
            values |= rebased_values(self.model, self.start.effects)
            if self.model.damping is not self.start.damping:
                damping = self.model.damping, _connections_of(self.model)
        known = {e.name for e in (*(self.start or self.model).effects, *self.added)}
        forms = [e for e in self.model.effects if e.is_form and e.name not in known]
        changes = [e.rebased(self.model) for e in self.added if e.name in self.changes]
        effects = [*forms, *(e for e in self.added if e.name not in self.changes)]
        text = text_with_model(
            self, path.parent, values, damping, [e.rebased(self.model) for e in effects], self.faults, changes
        )
        if measured := self.measurements or self.amplitudes:
            text = with_test(text, measured[0])
        unnamed = [e.name for e in self.added if e.name not in self._candidate_names(e.kind)]
        if unnamed:
            names = ", ".join(unnamed)
            msg = f"{path}: a study file has no name for {names}; save only effects of Study.candidates()"
            raise StudyError(msg)
        with replacing(path) as scratch:
            scratch.write_text(text, encoding="utf-8")

    def _on(self, start: Model, effect: Effect) -> Effect:
        """Return an effect that was added after a fit as the start's candidate, with the same values.

        The parameter that the effect takes the place of has another value there.
        """
        if self.start is None or effect.kind not in candidate_kinds():
            return effect
        every = candidates_of(effect.kind, start, self.sensors, self.excitations)
        same = next((e for e in every if e.name == effect.name), None)
        if same is None:
            return effect
        amplitude = {"amplitude": effect.amplitude} if isinstance(effect, AmplitudeDependent) else {}
        return replace(same.with_values(**parameter_values(effect)), **amplitude)

    def _candidate_names(self, kind: str) -> set[str]:
        model = self.start or self.model.without_effect(*(e.name for e in self.added))
        return {e.name for e in candidates_of(kind, model, self.sensors, self.excitations)}

    def run(
        self, out: str | os.PathLike[str], progress: Progress | None = None, processes: int = 1
    ) -> RunResult[Any]:
        """Compare, diagnose and locate, and write the report into a folder; see :func:`pipeline.run`.

        By FRFs; by measured modes where the study has nothing else. A diagnosis at hand writes the same by
        ``found.report("out")``.
        """
        from dovetail.pipeline import run

        return run(self, Path(out), progress, processes=processes)


def load_study(path: str | os.PathLike[str], needs: Collection[str] = config.BEFORE_TEST) -> Study:
    """Read a study file and the files that it names.

    Before its test a study may name files with measured data that do not exist yet: it has a model, modes, a
    plan; what compares it with data raises a StudyError that names the file.

    Parameters
    ----------
    path : path
        A TOML file; see docs/study-file.md. Other files are looked for beside it.
    needs : collection of str
        Which of ``"sensors"`` and ``"measurements"`` must be right besides the model, and whether the
        ``"files"`` with measured data must exist. Anything else that cannot be read is left out, with a
        sentence in ``Study.warnings``.

    Raises
    ------
    StudyError
        If something in it cannot be meant; the message names file, line and key.
    StudyFileError
        If the file cannot be opened, as the command line says it; also an OSError.
    """
    try:
        read = config.load_study(path, needs)
    except OSError as reason:
        inside = Path(path) / "study.toml"
        if isinstance(reason, IsADirectoryError) and inside.is_file():
            msg = f"a folder; did you mean '{inside}'?"
            raise StudyFileError(reason.errno, msg, str(path)) from reason
        raise StudyFileError(
            reason.errno, reason.strerror or str(reason), str(reason.filename or path)
        ) from reason
    return Study(**{f.name: getattr(read, f.name) for f in fields(read)})


def _connections_of(model: Model) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return frequencies [Hz] and damping ratios [-] of connections, where they have their own."""
    known = model.of_kind(ConnectionDamping)
    return (known[0].frequency, known[0].ratio) if known else None
