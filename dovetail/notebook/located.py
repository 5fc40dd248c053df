"""Sensors, bands and places that carry the misfit of a study, as a user meets them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dovetail import pipeline
from dovetail.file.contents import StudyContents
from dovetail.file.settings import N_BANDS
from dovetail.report import words
from dovetail.report.drawn import draw_misfit
from dovetail.report.printed import Printed
from dovetail.report.table import Column, Table, columns_of_bands
from fem.model import Model
from fem.summary import summary
from updating.diagnosis.begin import begin_fitted
from updating.diagnosis.localisation import Localisation, locate
from updating.measurement.measurement import Sensor
from updating.quality.corrections import Fault

SHARE = "share of the misfit that a change there would explain"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Located(Printed):
    """Where the misfit of a study is, once its uncertain parameters are fitted.

    Attributes
    ----------
    name : str
        The study's.
    fit_db : float
        Error of the amplitude on the lines of the fit [dB].
    where : Localisation
        Errors of sensors and bands [dB], and shares of members and places [-].
    model : Model
    test : tuple of Sensor
        The compared sensors.
    faults : tuple of Fault
        Faults of the measurement that were corrected.
    notes : tuple of str
        Of the readers of the measured files.
    """

    name: str
    fit_db: float
    where: Localisation
    model: Model
    test: tuple[Sensor, ...]
    faults: tuple[Fault, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return the error, and the place with the largest share, on one line."""
        places = self.places
        best = f", {places.columns[0].values[0]}" if self.where.says_where else ""
        return summary(self, f"{self.name}: {self.fit_db:.2f} dB{best}")

    @property
    def sensors(self) -> Table:
        """Errors of all sensors, the worst first, in all and in each band [dB]."""
        where = self.where
        order = np.argsort(-np.nan_to_num(where.by_sensor_db), kind="stable")
        return Table.of(
            "sensors",
            Column("sensor", where.sensors),
            Column("all", where.by_sensor_db, "dB", ".2f"),
            *columns_of_bands(where.bands, where.by_band_db),
        ).rows(order)

    @property
    def places(self) -> Table:
        """Shares of the misfit of members, joints and supports, the largest first [-]."""
        shares = [(f"member {m}", s) for m, s in self.where.members.items()] + list(self.where.places)
        shares = sorted(shares, key=lambda place: -place[1])
        return Table.of(
            "places",
            Column("place", [words.place(name) for name, _ in shares]),
            Column(SHARE, [s for _, s in shares], "%", "{:.1f} %".format, 100, head=SHARE),
        )

    def draw(self, path: str | Path) -> Path:
        """Write a picture (PNG) of the structure: sensors by their errors, members and joints by shares."""
        shown = self.where if self.where.says_where else None
        return draw_misfit(self.model, self.test, self.where.by_sensor_db, path, shown)

    def printed(self, number: int = 20) -> list[str | Table]:
        """Return the lines and tables of ``dovetail locate`` with the first ``number`` sensors and places."""
        return [
            f"{self.name}: {self.fit_db:.2f} dB once the uncertain parameters are fitted; sensors, the "
            "worst first",
            self.sensors.first(number),
            "",
            *([self.places.first(number), ""] if self.where.says_where else []),
            *(f"corrected: {words.fault_text(f)}" for f in self.faults),
            self.where.note,
            *(f"note: {text}" for text in self.notes),
        ]


def located(
    study: StudyContents, n_bands: int = N_BANDS, progress: pipeline.Progress | None = None
) -> Located:
    """Return where the misfit of a study is; see :meth:`dovetail.Study.locate`."""
    say = progress or (lambda text, done: None)
    say("reducing the model", 0.0)
    problem = pipeline.formed_fit_problem(study)
    say("fitting the uncertain parameters", 0.2)
    problem, fitted, faults = begin_fitted(problem)
    say("locating the misfit", 0.5)
    where = locate(problem, fitted, n_bands)
    sensors = problem.data.measurement.sensors
    return Located(study.name, fitted.fit_db, where, study.model, sensors, faults, study.measured_notes)
