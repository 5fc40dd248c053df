"""A comparison for notebooks: numbers, tables and figures of computed and measured FRFs."""

from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.report.html_table import inner, number, table
from dovetail.report.printed import Printed
from dovetail.report.table import Column, Table, columns_of_bands
from dovetail.result import bands_of_lines, least_frac
from fem.analysis.frf import FRF, imported
from fem.summary import summary
from updating import correlation
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Misfit:
    """The error of the amplitude of computed FRFs, root mean square in dB.

    Attributes
    ----------
    fit_db : float
        On the lines that a fit uses [dB].
    held_out_db : float
        On the lines that are held out from fits [dB].
    all_db : float
        On all lines [dB].
    noise_db : float
        Noise of the measurement [dB]; no model can be nearer.
    """

    fit_db: float
    held_out_db: float
    all_db: float
    noise_db: float

    def __repr__(self) -> str:
        """Return the errors on one line."""
        errors = f"{self.fit_db:.2f} dB on the lines of the fit, {self.held_out_db:.2f} dB held out"
        return summary(self, f"{errors}, {self.all_db:.2f} dB on all; noise {self.noise_db:.2f} dB")

    def __float__(self) -> float:
        """Return the error on the lines of the fit [dB]."""
        return self.fit_db

    def _repr_html_(self) -> str:
        """Return a table of the errors."""
        rows = [
            ("lines of the fit", number(self.fit_db)),
            ("lines held out", number(self.held_out_db)),
            ("all lines", number(self.all_db)),
            ("noise of the measurement", number(self.noise_db)),
        ]
        return table(("error of the amplitude", "dB"), rows)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyComparison(Printed, correlation.Comparison):
    """How far a study's FRFs are from the measured ones, with both.

    Attributes
    ----------
    name, label : str
        The study's, and its model's: ``"nominal"``, ``"fitted"`` or ``"with …"``.
    measured, computed : FRF
        At the same lines, outputs and inputs.
    held_out : tuple of (float, float)
        Bands that are held out from fits [Hz].
    misfit : Misfit
        Errors of the amplitude [dB].
    """

    name: str
    label: str
    measured: FRF
    computed: FRF
    held_out: tuple[tuple[float, float], ...]
    misfit: Misfit

    @classmethod
    def of(
        cls, problem: FitProblem, result: FitResult, n_bands: int, name: str = "", label: str = "model"
    ) -> "StudyComparison":
        """Compare a fit of a problem, or its nominal model, with the measurement."""
        data, measured, computed = problem.data, problem.measured, problem.frf(result)
        compared = correlation.compare(measured, computed, n_bands, data.mask)
        errors = Misfit(result.fit_db, result.held_out_db, compared.total_db, data.noise_db)
        inherited = {f.name: getattr(compared, f.name) for f in fields(compared)}
        return cls(
            **inherited,
            name=name,
            label=label,
            measured=measured,
            computed=computed,
            held_out=bands_of_lines(data.frequency, data.held_out),
            misfit=errors,
        )

    def printed(self) -> list[str | Table]:
        """Return the errors, and a table of sensors and bands, as ``dovetail compare`` prints them."""
        e = self.misfit
        held_out = f"{e.held_out_db:.2f}" if np.isfinite(e.held_out_db) else "-"
        return [
            f"{self.name}, {self.label}: error of the amplitude {e.fit_db:.2f} dB on the lines of the fit, "
            f"{held_out} on those held out and {e.all_db:.2f} on all; noise of the measurement "
            f"{e.noise_db:.2f} dB",
            table_of_errors(self),
        ]

    def worst_pairs(self, n: int = 4) -> tuple[tuple[str, str], ...]:
        """Return the pairs of output and input with the largest errors, the largest first."""
        return worst_pairs(self, n)

    def plot(
        self,
        output: str | None = None,
        input_: str | None = None,
        *,
        before: "StudyComparison | None" = None,
    ) -> Any:
        """Return an interactive plotly figure of one measured and computed FRF, magnitude [dB] and phase.

        Bands that are held out from fits are shaded, and values that are not compared are pale.

        Parameters
        ----------
        output, input_ : str, optional
            Labels of the pair to show; those with the largest error (of ``before``, if it is given) unless
            given.
        before : Comparison, optional
            Another comparison with the same measurement, whose model is shown, too.

        Raises
        ------
        FRFError
            If the measurement has no such label.
        """
        from viz.curves import frf
        from viz.interactive.live import draw

        worst = (before or self).worst_pairs(1)[0]
        pair = (output or worst[0], input_ or worst[1])
        models = {before.label: before.computed} if before is not None else {}
        label = self.label if self.label not in models else f"{self.label}, after"
        marked = {"held_out": self.held_out, "compared": np.isfinite(self.log_ratio)}
        return draw(frf(self.measured, {**models, label: self.computed}, pair, **marked))

    def still(self, n: int = 4) -> "Figure":
        """Return a matplotlib figure of the ``n`` FRFs with the largest errors, magnitude [dB] and phase."""
        marked = {"held_out": self.held_out, "compared": np.isfinite(self.log_ratio)}
        title = f"{self.name}, {self.label}: the FRFs with the largest errors"
        return frfs(self.measured, {self.label: self.computed}, self.worst_pairs(n), title, **marked)

    def plot_map(self) -> Any:
        """Return an interactive plotly figure of the error of each sensor in each band [dB]."""
        from viz.heat_maps import error_map
        from viz.interactive.live import draw

        bands = list(pairwise(self.bands.tolist()))
        return draw(error_map(self.by_band(), self.outputs, bands, title=f"{self.name}, {self.label}"))

    def to_frame(self) -> Any:
        """Return a ``pandas.DataFrame`` of errors [dB]: sensors down, bands [Hz] across.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        names = [f"{a:.4g}-{b:.4g} Hz" for a, b in pairwise(self.bands)]
        frame = imported("pandas").DataFrame(self.by_band(), index=list(self.outputs), columns=names)
        frame.index.name = "sensor"
        frame.insert(0, "all", self.by_sensor())
        frame.attrs = {"units": "dB"}
        return frame

    def to_xarray(self) -> Any:
        """Return an ``xarray.DataArray`` of errors [dB] with dimensions band, output and input.

        The coordinate ``band`` has the bands' middles [Hz].

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        middle = (self.bands[1:] + self.bands[:-1]) / 2
        coordinates = {"band": middle, "output": list(self.outputs), "input": list(self.inputs)}
        array = imported("xarray").DataArray(
            self.error_db,
            dims=("band", "output", "input"),
            coords=coordinates,
            name="error",
            attrs={"units": "dB"},
        )
        array["band"].attrs["units"] = "Hz"
        return array

    def _repr_html_(self) -> str:
        """Return the errors as a table with a picture of sensors and bands."""
        from viz.heat_maps import error_map
        from viz.still import draw
        from viz.style import figure_png

        columns = zip(self.outputs, self.by_sensor(), least_frac(self), strict=True)
        rows = [(name, number(error), number(frac, 3)) for name, error, frac in columns]
        head = table(("sensor", "error [dB]", "least FRAC"), rows, f"{self.name}, {self.label}")
        words = "Error of each sensor in each frequency band, in dB"
        bands = list(pairwise(self.bands.tolist()))
        figure = draw(error_map(self.by_band(), self.outputs, bands))
        picture = b64encode(figure_png(figure, 80)).decode()
        look = 'style="max-width:100%;height:auto"'
        shown = f'<img alt="{escape(words)}" {look} src="data:image/png;base64,{picture}">'
        style = 'style="display:flex;flex-wrap:wrap;align-items:flex-start;gap:2em"'
        return f"<p>{escape(inner(self.misfit))}</p><div {style}>{head}{shown}</div>"


def worst_pairs(c: correlation.Comparison, n: int = 4) -> tuple[tuple[str, str], ...]:
    """Return the pairs of output and input with the largest errors, the largest first."""
    square = c.log_ratio.real**2
    seen = np.isfinite(square)
    mean = np.where(seen, square, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    order = np.argsort(-mean, axis=None)[:n]
    where = zip(*np.unravel_index(order, mean.shape), strict=True)
    return tuple((c.outputs[int(i)], c.inputs[int(j)]) for i, j in where)


def frfs(
    measured: FRF,
    models: Mapping[str, FRF],
    pairs: Iterable[tuple[str, str]],
    title: str = "",
    **marked: Any,
) -> "Figure":
    """Return a matplotlib figure of some FRFs, measured and computed; see :func:`viz.curves.frf`."""
    from viz.curves import frf
    from viz.still import draw

    return draw([frf(measured, models, pair, **marked) for pair in pairs], title)


def table_of_errors(c: correlation.Comparison) -> Table:
    """Return the error of each sensor over all lines and in each band, or of each place of a roving force."""
    words = "sensor", "sensors"
    if c.moving_forces:
        c, words = c.transposed(), ("excitation", "excitations")
    return Table.of(
        words[1],
        Column(words[0], c.outputs),
        Column("all lines", c.by_sensor(), "dB", ".2f", head="all dB"),
        *columns_of_bands(c.bands, c.by_band()),
        Column("least FRAC", least_frac(c), show=".3f"),
    )
