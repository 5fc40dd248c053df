"""FRFs in columns of text, each identified by its header or by its place."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFError, FRFKind
from fem.array_types import Complexes, Floats
from fem.io.arrays import TableError
from fem.io.columns import Columns, read_columns
from fem.io.faults import error_at, refuse
from fem.io.frf_labels import NAMES, Unit, decibel_reference, frequency_factor, frf_unit
from fem.io.frf_reading import FORMS, Asked, Reading
from fem.io.header_keys import Described, keyed_header
from fem.io.units import LONGEST_HEADING, UnitHeading, split_heading

_PARTS: dict[str, str] = {
    "real": r"re|real|realteil|realpart",
    "imag": r"im|imag|img|imaginary|imaginaer|imaginär|imaginärteil|imagpart",
    "magnitude": r"mag|magnitude|amp|ampl|amplitude|abs|betrag|modulus",
    "phase": r"ph|phase|phas|angle|arg|winkel|phi",
    "coherence": r"coh|coherence|kohärenz|koh|gamma2|γ²",
    "frequency": r"(?:freq|frequency|frequencies|frequenz|fréquence)(?!\s+resp)",
}
"""Words of a header that identify a column."""
_EXACT = {
    "f": "frequency",
    "x-axis": "frequency",
    "index": "index",
    "no": "index",
    "nr": "index",
    "line": "index",
    "#": "index",
}
"""The same of cells that hold nothing else."""
_PART = {
    part: re.compile(rf"(?<![\w/])(?:{words})(?![\w/])", re.IGNORECASE) for part, words in _PARTS.items()
}
_BRACKETS = re.compile(r"\[([^\[\]]*)\]|\(([^()]*(?:\([^()]*\)[^()]*)*)\)")
_DEGREES = ("deg", "degree", "degrees", "°")
_RADIANS = ("rad", "radian", "radians")
_WRITTEN = re.compile(r"(re|im)\((.+)/([^/]+)\)")
_OF_TWO = re.compile(r"\b[A-Za-z]\w*\s*\(\s*([^(),;]*[^(),;\s])\s*[,;]\s*([^(),;]*[^(),;\s])\s*\)")
"""A function of two degrees of freedom, response and force: ``H(3Z,1Z)``."""
_KIND = re.compile(r"^kind:\s*([A-Za-z]+)")


def read_csv(
    path: "str | Path",
    kind: FRFKind | str | None = None,
    *,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    delimiter: str | None = None,
    header: bool | None = None,
    form: str = "auto",
) -> FRF:
    """Read FRFs from a text table, one line for each frequency.

    The header tells the columns where it names them: frequency, real and imaginary part, or magnitude and
    phase of ``response/force``, with their units. Else the first column is the frequency [Hz], and then come
    the FRFs: the responses to the first force, those to the second, and so on. Lines that are empty are
    passed over.

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs; a line ``# kind: mobility`` in the file goes before it.
    outputs, inputs : sequence of str, optional
        Labels of the responses and of the forces. Without them they come from the header, or else each FRF is
        a response (out1, …) to one force (in1).
    delimiter : str, optional
        ``";"``, ``","``, tab or blank; found unless given. Where it is not a comma, numbers may have decimal
        commas.
    header : bool, optional
        Whether the first line holds names; found unless given.
    form : str
        The columns of an FRF, where the header does not tell them: ``"complex"`` (one number such as
        ``1.2-3.4j``), ``"re-im"``, ``"magnitude-degrees"``, ``"magnitude-radians"``, ``"decibel-degrees"``.
        ``"auto"`` takes complex numbers where there is a ``j`` or ``i``, else real and imaginary parts.

    Raises
    ------
    TableError
        For a cell that is no number, a line with too few or too many cells, columns that do not fit the
        labels, or amplitudes without phase; the message names line and column.
    """
    asked = Asked(kind, outputs, inputs, form=form, delimiter=delimiter, header=header)
    reading = frf_of_columns(Path(path), asked)
    if not reading.phase:
        raise error_at(Path(path).name, WITHOUT_PHASE, TableError)
    return reading.frfs[0]


def frf_of_columns(path: Path, asked: Asked) -> Reading:
    """Return the FRFs of a text file in columns.

    Parameters
    ----------
    path : Path
    asked : Asked
        Uses ``kind``, ``outputs``, ``inputs``, ``delimiter``, ``header``, ``form``, ``pairs`` and
        ``unit_labels``.
    """
    if asked.form not in FORMS:
        refuse(f"the form is '{asked.form}'; allowed are {', '.join(FORMS)}", TableError)
    return _Table(read_columns(path, asked.delimiter, asked.header), asked).reading()


@dataclass(frozen=True, slots=True)
class _Column:
    """One column as its header describes it.

    Attributes
    ----------
    at : int
    part : str, one of ``_PARTS``, or nothing
    unit : str, its label; nothing where there is none
    pair : tuple of str or None, response and force
    names : tuple of str, the cells above it as they are, the lowest first
    level : bool, whether it is in dB
    """

    at: int
    part: str = ""
    unit: str = ""
    pair: tuple[str, str] | None = None
    names: tuple[str, ...] = ()
    level: bool = False


@dataclass(frozen=True, slots=True)
class _Curve:
    """Columns of an FRF: one complex one, or a first (real part or magnitude) and perhaps a second."""

    first: _Column
    second: _Column | None = None
    form: str = "complex"

    @property
    def pair(self) -> tuple[str, str] | None:
        """Response and force of its columns."""
        return self.first.pair

    @property
    def name(self) -> str:
        """Its name in the file."""
        return self.first.names[0] if self.first.names else f"column {self.first.at + 1}"


def _with_keys(column: _Column, keys: Described) -> _Column:
    """Return a column with what the keys of the header say and its heading does not."""
    part = "" if keys.part == "complex" else keys.part
    unit = column.unit or keys.unit
    return replace(
        column,
        part=part if part in ("frequency", "other", "coherence") else column.part or part,
        unit=unit,
        pair=keys.pair or column.pair,
        names=(*keys.names[:1], *column.names, *keys.names[1:]),
        level=column.level or decibel_reference(unit) is not None,
    )


class _Table:
    """Columns of one file, with the user's statements about them."""

    def __init__(self, table: Columns, asked: Asked) -> None:
        self.table, self.asked = table, asked
        self.keyed = keyed_header(table)
        self.notes: list[str] = [] if self.keyed is None else list(self.keyed.notes)
        self.stated = asked.form != "auto"

    def refuse(self, text: str) -> NoReturn:
        """Raise an error with the file's name."""
        raise error_at(self.table.name, text, TableError)

    def reading(self) -> Reading:
        """Return the FRFs."""
        columns = self._columns()
        x, rest = self._abscissa(columns)
        frequency, label = self._frequency(x)
        coherent = [c for c in rest if c.part == "coherence"]
        curves = self._curves([c for c in rest if c.part != "coherence"])
        pairs = self._pairs(curves)
        chosen = [k for k, pair in enumerate(pairs) if pair is not None]
        curves, pairs = [curves[k] for k in chosen], [pairs[k] for k in chosen]
        outputs, inputs, order = self._matrix(curves, pairs)
        unit = self._units(curves)
        shape = (len(inputs), len(outputs), frequency.size)
        values = [self._values(curve) * u.factor for curve, u in zip(curves, unit, strict=True)]
        H = np.array([values[k] for k in order]).reshape(shape).transpose(2, 1, 0)
        try:
            strain = [o for k, o in enumerate(outputs) if unit[order[k]].kind is None]
            kind = next((u.kind for u in unit if u.kind is not None), FRFKind.RECEPTANCE)
            frf = FRF.from_arrays(frequency, H, kind, outputs, inputs, strain=strain)
        except FRFError as reason:
            self.refuse(str(reason))
        phased = {c.form not in ("magnitude", "decibel") for c in curves}
        if len(phased) > 1:
            self.refuse("some of its FRFs have a phase and others have none; read them from two files")
        gamma = self._coherence(coherent, [curves[k] for k in order], shape)
        axes = ((label,),) if label else ()
        averages = self.keyed.averages if self.keyed is not None and gamma is not None else None
        notes = tuple(self.notes)
        return Reading((frf,), axes, phased.pop(), gamma, averages, notes=notes, stated=self.stated)

    # What the header says ----------------------------------------------------------------------------------

    def _columns(self) -> list[_Column]:
        """Return each column as the header describes it."""
        rows = self.table.heads
        if self.keyed is not None:  # rows of keys are no headings
            rows = tuple(row for row in rows if self._above_frequency(row[0]))
        of_units = [
            any(frequency_factor(cell) is not None for cell in row[:2])
            and not any(words.search(cell.replace("_", " ")) for cell in row for words in _PART.values())
            for row in rows
        ]
        out = []
        for at in range(self.table.width):
            column = _Column(at, names=tuple(row[at] for row in rows[::-1] if row[at]))
            for row, units in zip(rows[::-1], of_units[::-1], strict=True):
                column = self._with_cell(column, row[at], units)
            if self.keyed is not None:
                keys = self.keyed.columns[at]
                if keys.part == "imag" and column.unit.lower() in (*_DEGREES, *_RADIANS):
                    out[-1] = replace(out[-1], part="magnitude")
                    keys = replace(keys, part="phase")
                elif keys.assumption and not (column.part or column.unit):
                    self.notes.append(keys.assumption)
                column = _with_keys(column, keys)
            out.append(column)
        return [c for c in out if c.part != "other"]

    def _above_frequency(self, cell: str) -> bool:
        return not cell or frequency_factor(cell) is not None or bool(_PART["frequency"].search(cell))

    def _with_cell(self, column: _Column, cell: str, unit_row: bool) -> _Column:
        """Return a column with the statements of one cell above it; cells nearer to the data go before."""
        if not cell or len(cell) > LONGEST_HEADING:
            return column
        if unit_row or self._is_unit(cell):
            return replace(
                column, unit=column.unit or cell, level=column.level or decibel_reference(cell) is not None
            )
        heading = split_heading(cell)
        if frf_unit(heading.unit) is None:
            heading = UnitHeading(cell)
        written = _WRITTEN.fullmatch(heading.name)
        if written is not None:
            part = {"re": "real", "im": "imag"}[written[1]]
            return replace(column, part=part, pair=(written[2], written[3]), unit=column.unit or heading.unit)
        unit, text = column.unit, cell
        for found in _BRACKETS.finditer(cell):
            inside = (found[1] if found[1] is not None else found[2]).strip()
            square = found[1] is not None and not any(p.search(inside) for p in _PART.values())
            if self._is_unit(inside) or (square and inside):
                unit = unit or inside
                text = text.replace(found[0], " ")
        plain = text.replace("_", " ")
        part = column.part or _EXACT.get(plain.strip(" .").lower(), "")
        part = part or next((p for p, words in _PART.items() if words.search(plain)), "")
        level = column.level or bool(re.search(r"\bdB\b", plain)) or decibel_reference(unit) is not None
        return replace(column, part=part, unit=unit, level=level, pair=column.pair or self._pair_in(text))

    def _is_unit(self, text: str) -> bool:
        plain = text.strip().lower()
        known = frf_unit(text) is not None or frequency_factor(text) is not None
        return known or decibel_reference(text) is not None or plain in (*_DEGREES, *_RADIANS, "-", "%")

    def _pair_in(self, text: str) -> tuple[str, str] | None:
        """Return response and force of a cell such as ``FRF s1/s5 real`` or ``H(s1,s5) real``."""
        written = _OF_TWO.search(text)
        if written is not None and not (self._is_unit(written[1]) or self._is_unit(written[2])):
            return written[1].strip(), written[2].strip()
        text = re.sub(r"[()\[\]{}\"']", " ", re.sub(r"\s*/\s*", "/", text))
        for word in re.split(r"[\s,;]+", text):
            sides = word.split("/")
            if len(sides) == 2 and all(sides) and frf_unit(word) is None:
                force = re.sub(
                    rf"_(?:{'|'.join(_PARTS[p] for p in list(_PARTS)[:5])})$", "", sides[1], flags=re.I
                )
                return sides[0], force
        return None

    # Frequencies -------------------------------------------------------------------------------------------

    def _abscissa(self, columns: Sequence[_Column]) -> tuple[_Column, list[_Column]]:
        """Return the column of frequencies and those of FRFs."""
        if len(columns) < 2:
            line = self.table.lines[0]
            self.refuse(f"line {line} has one column; frequency and FRFs are expected, by ; , tab or blank")
        named = [c for c in columns if c.part == "frequency" or frequency_factor(c.unit) is not None]
        x = named[0] if named else columns[1 if self._counts(columns) else 0]
        for other in named[1:]:
            if not np.array_equal(self.table.values[:, other.at], self.table.values[:, x.at]):
                self.refuse(
                    f"the columns {x.at + 1} and {other.at + 1} are both frequencies and differ; FRFs of one "
                    "file need the same lines"
                )
        drop = {c.at for c in named} | {x.at} | {c.at for c in columns if c.part == "index"}
        if x.at == 1 and not named:
            drop.add(0)
            self.notes.append(
                "the first column counts the lines and is left out; the second is the frequency"
            )
        return x, [c for c in columns if c.at not in drop]

    def _counts(self, columns: Sequence[_Column]) -> bool:
        """Return whether the first column counts the lines and the second rises evenly, as a frequency."""
        values = self.table.values.real
        if len(columns) < 3 or len(values) < 3 or any(c.part for c in columns):
            return False
        step = np.diff(values[:, 1])
        count = values[:, 0] - values[0, 0]
        even = bool((step > 0).all() and np.ptp(step) <= 1e-3 * step.mean())
        return np.array_equal(count, np.arange(len(values))) and even and values[0, 0] in (0, 1)

    def _frequency(self, x: _Column) -> tuple[Floats, str]:
        label = x.unit
        factor = frequency_factor(label) if label else 1.0
        if factor is None:
            self.refuse(f"column {x.at + 1} is in '{label}', which is no unit of frequency that is known")
        f = self.table.values[:, x.at].real * factor
        k = np.flatnonzero(np.diff(f) <= 0)
        if k.size:
            one, other = (int(self.table.lines[j]) for j in (k[0], k[0] + 1))
            word = "again" if f[k[0]] == f[k[0] + 1] else "after"
            self.refuse(
                f"frequencies must increase strictly; line {other} has {f[k[0] + 1]:g} Hz {word} "
                f"{'as ' if word == 'again' else ''}{f'{f[k[0]]:g} Hz of ' if word == 'after' else ''}line "
                f"{one}"
            )
        return f, label

    # FRFs --------------------------------------------------------------------------------------------------

    def _curves(self, columns: Sequence[_Column]) -> list[_Curve]:
        """Return the FRFs by the parts that the header names, or by their place."""
        form = self.asked.form
        if not columns:
            self.refuse("it has frequencies and no FRFs")
        if form == "auto" and all(c.part in ("real", "imag", "magnitude", "phase") for c in columns):
            self.stated = True
            return self._by_parts(columns)
        if form == "auto" and np.iscomplexobj(self.table.values):
            form = "complex"
        if form == "auto" and (any(c.level for c in columns) or self._distinct(columns)):
            form = "decibel" if all(c.level for c in columns) else "magnitude"
            self._refuse_signs(columns, form)
        form = "re-im" if form == "auto" else form
        if form in ("complex", "magnitude", "decibel"):
            return [_Curve(c, None, form) for c in columns]
        if len(columns) % 2:
            words = {"re-im": "real and imaginary part"}.get(form, "magnitude and phase")
            self.refuse(
                f"line {self.table.lines[0]} has {self.table.width} columns; the frequency and two columns "
                "for "
                f'each FRF, {words}, are expected (form = "magnitude" or "decibel" reads one): '
                f"{WITHOUT_PHASE}"
            )
        return [_Curve(a, b, form) for a, b in zip(columns[0::2], columns[1::2], strict=True)]

    def _distinct(self, columns: Sequence[_Column]) -> bool:
        """Return whether the header names another FRF for each column, so that none has two."""
        pairs = [c.pair for c in columns]
        return None not in pairs and len(set(pairs)) == len(pairs)

    def _refuse_signs(self, columns: Sequence[_Column], form: str) -> None:
        values = self.table.values[:, [c.at for c in columns]].real
        if form == "magnitude" and (values < 0).any():
            self.refuse(
                "each of its columns is another FRF, and some have negative values, so that they are no "
                'amplitudes; give form, such as "decibel", or columns of both parts'
            )

    def _by_parts(self, columns: Sequence[_Column]) -> list[_Curve]:
        """Return FRFs of columns whose parts are known: of one pair, or else of neighbours."""
        out: list[_Curve] = []
        for group in self._groups(columns):
            have = {c.part: c for c in group}
            if len(have) < len(group):
                twice = next(c for c in group if have[c.part] is not c)
                self.refuse(
                    f"the header names {'/'.join(twice.pair) if twice.pair else twice.part} twice "
                    f"(columns {twice.at + 1} and {have[twice.part].at + 1})"
                )
            if "real" in have and "imag" in have:
                out.append(_Curve(have["real"], have["imag"], "re-im"))
            elif "magnitude" in have:
                first, second = have["magnitude"], have.get("phase")
                level = "decibel" if first.level else "magnitude"
                out.append(
                    _Curve(first, second, level if second is None else f"{level}-{self._angle(second)}")
                )
            else:
                only = group[0]
                self.refuse(
                    f"column {only.at + 1} ('{only.names[0]}') is a {only.part} part alone; the other part "
                    "is needed as well"
                )
        return out

    def _groups(self, columns: Sequence[_Column]) -> list[list[_Column]]:
        if all(c.pair is not None for c in columns):
            by_pair: dict[tuple[str, str] | None, list[_Column]] = {}
            for c in columns:
                by_pair.setdefault(c.pair, []).append(c)
            return list(by_pair.values())
        groups: list[list[_Column]] = []
        for c in columns:
            if not groups or c.part in [g.part for g in groups[-1]]:
                groups.append([])
            groups[-1].append(c)
        return groups

    def _angle(self, column: _Column) -> str:
        """Return whether angles are degrees or radians."""
        unit = column.unit.strip().lower()
        text = " ".join(column.names).lower()
        largest = float(np.abs(self.table.values[:, column.at].real).max())
        if unit in _DEGREES or re.search(r"(?<![a-z])deg|°", text):
            return "degrees"
        if unit in _RADIANS or re.search(r"(?<![a-z])rad", text):
            return "radians"
        if largest > 2 * np.pi + 0.01:
            return "degrees"
        self.refuse(
            f"column {column.at + 1} does not say whether its angles, up to {largest:.3g}, are degrees or "
            'radians; give form = "magnitude-degrees" or "magnitude-radians"'
        )

    def _values(self, curve: _Curve) -> Complexes | Floats:
        """Return an FRF in the file's unit."""
        a = self.table.values[:, curve.first.at]
        if curve.form == "complex":
            return a
        a = a.real
        level, _, angle = curve.form.partition("-")
        if level == "re":
            return a + 1j * self._second(curve)
        if level == "decibel":
            a = (decibel_reference(curve.first.unit) or (1.0, ""))[0] * 10 ** (a / 20)
        if (a < 0).any():
            k = int(np.flatnonzero(a < 0)[0])
            self.refuse(
                f"line {self.table.lines[k]}, column {curve.first.at + 1} has the magnitude {a[k]:g}; none "
                "is "
                'negative, unless in dB: form = "decibel" or "decibel-degrees"'
            )
        if not angle:
            return a
        return a * np.exp(1j * self._second(curve) * (1.0 if angle == "radians" else np.pi / 180))

    def _second(self, curve: _Curve) -> Floats:
        assert curve.second is not None  # forms with two parts have both
        return self.table.values[:, curve.second.at].real

    def _coherence(
        self, columns: Sequence[_Column], curves: Sequence[_Curve], shape: tuple[int, int, int]
    ) -> Floats | None:
        """Return the coherences (n_freq, n_out, n_in) of FRFs in order; NaN where there is none."""
        out = np.full((len(curves), shape[2]), np.nan)
        for column in columns:
            before = [k for k, c in enumerate(curves) if c.first.at < column.at]
            hit = [k for k, c in enumerate(curves) if column.pair is not None and c.pair == column.pair]
            at = hit or (sorted(before, key=lambda k: curves[k].first.at)[-1:] if column.pair is None else [])
            for k in at:
                out[k] = self.table.values[:, column.at].real * (0.01 if column.unit == "%" else 1.0)
        return out.reshape(shape).transpose(2, 1, 0) if np.isfinite(out).any() else None

    # Labels and units --------------------------------------------------------------------------------------

    def _pairs(self, curves: Sequence[_Curve]) -> list[tuple[str, str] | None]:
        """Return response and force of each FRF as the user or the header says; None for one left out."""
        given = self.asked.pairs
        if given is None:
            return [c.pair or ("", "") for c in curves]
        if not isinstance(given, Mapping):
            if len(given) != len(curves):
                shown = ", ".join(c.name for c in curves[:8])
                self.refuse(f"{len(given)} pairs are given for its {len(curves)} FRFs ({shown})")
            return [split_pair(pair, self.table.name) for pair in given]
        out: list[tuple[str, str] | None] = []
        used: set[str] = set()
        for curve in curves:
            names = {*curve.first.names, "/".join(curve.pair) if curve.pair else ""}
            keys = [key for key in given if key in names]
            used.update(keys)
            out.append(split_pair(given[keys[0]], self.table.name) if keys else None)
        lost = [key for key in given if key not in used]
        if lost:
            have = ", ".join(dict.fromkeys(name for c in curves for name in c.first.names))
            self.refuse(f"pairs names '{lost[0]}', which is above no column; its columns have {have}")
        if None in out:
            rest = [c.name for c, pair in zip(curves, out, strict=True) if pair is None]
            self.notes.append(f"the columns {', '.join(rest[:6])} are in no pair of the study and left out")
        return out

    def _matrix(
        self, curves: Sequence[_Curve], pairs: Sequence[tuple[str, str] | None]
    ) -> tuple[list[str], list[str], list[int]]:
        """Return the labels, and which FRF is where, force by force."""
        asked, n = self.asked, len(curves)
        known = [p for p in pairs if p is not None and any(p)]
        named = asked.outputs is None and asked.inputs is None
        if len(known) == n and n and (named or asked.pairs is not None):
            return self._of_pairs(known)
        if known and named:
            bare = next(c.name for c in curves if c.pair is None)
            self.refuse(f"'{bare}' does not say response and force as a/b does, other columns do; give pairs")
        if named and n > 1 and any(c.first.names for c in curves):
            self.notes.append(
                f"the names above its columns ({', '.join(c.name for c in curves[:4])} …) do not say "
                "response and force as a/b does: they are taken for responses to one force, in their order"
            )
        n_in = len(asked.inputs) if asked.inputs is not None else max(1, n // len(asked.outputs or [0] * n))
        inputs = list(asked.inputs) if asked.inputs is not None else [f"in{k + 1}" for k in range(n_in)]
        n_out = n // max(1, len(inputs))
        outputs = list(asked.outputs) if asked.outputs is not None else [f"out{k + 1}" for k in range(n_out)]
        if len(outputs) * len(inputs) != n:
            self.refuse(
                f"it has {n} FRFs for {len(outputs)} responses and {len(inputs)} forces; "
                f"{len(outputs) * len(inputs)} are expected"
            )
        return outputs, inputs, list(range(n))

    def _of_pairs(self, pairs: Sequence[tuple[str, str]]) -> tuple[list[str], list[str], list[int]]:
        outputs, inputs = (list(dict.fromkeys(pair[k] for pair in pairs)) for k in (0, 1))
        where = {pair: k for k, pair in enumerate(pairs)}
        missing = [f"{o}/{i}" for i in inputs for o in outputs if (o, i) not in where]
        if missing or len(where) < len(pairs):
            twice = next((f"{o}/{i}" for o, i in pairs if pairs.count((o, i)) > 1), "")
            what = f"lacks {', '.join(missing[:5])}" if missing else f"names {twice} twice"
            self.refuse(f"the header {what}; each response to each force is expected once")
        return outputs, inputs, [where[o, i] for i in inputs for o in outputs]

    def _units(self, curves: Sequence[_Curve]) -> list[Unit]:
        """Return kind and factor to SI of each FRF; all but strains are of one kind."""
        stated = self._stated_kind()
        labels = [self._label(c) for c in curves] if self.asked.unit_labels else [""] * len(curves)
        units = [frf_unit(label) if label else None for label in labels]
        for curve, label, unit in zip(curves, labels, units, strict=True):
            if label and unit is None:
                self.refuse(
                    f"column {curve.first.at + 1} has the unit '{label}', which is none of FRFs that is "
                    "known; give scale, the factor to SI, with which unit labels do not count, and kind"
                )
        found = {u.kind: k for k, u in reversed(list(enumerate(units))) if u is not None and u.kind}
        if len(found) > 1:
            (one, i), (other, j) = list(found.items())[:2]
            self.refuse(
                f"'{curves[i].name}' is in '{labels[i]}', a unit of {one}, and '{curves[j].name}' in "
                f"'{labels[j]}', of {other}; FRFs of one kind are needed: read them from two files"
            )
        kind = next(iter(found), None)
        if kind is not None and stated is not None and stated != kind:
            label = labels[found[kind]]
            self.refuse(
                f"its unit '{label}' is that of {kind}, and kind is {stated}; correct kind, or give scale, "
                "with which unit labels do not count"
            )
        kind = kind or stated
        if kind is None and None not in units:  # strains alone
            kind = FRFKind.RECEPTANCE
        if kind is None:
            self.refuse(f"it does not say the kind of its FRFs; give kind, one of {', '.join(FRFKind)}")
        if found and None in units:
            bare = curves[units.index(None)].name
            self.refuse(f"'{bare}' has no unit and other columns have; give scale, or a unit for each")
        self._note_units(labels, units, curves)
        return [u or Unit(kind, 1.0) for u in units]

    def _note_units(
        self, labels: Iterable[str], units: Iterable[Unit | None], curves: Sequence[_Curve]
    ) -> None:
        factors = {label: u.factor for label, u in zip(labels, units, strict=True) if u and u.factor != 1}
        self.notes += [f"FRFs in '{label}' are multiplied by {f:.6g}" for label, f in factors.items()]
        if any(c.form.startswith("decibel") and not self._label(c) for c in curves):
            self.notes.append("its levels in dB say no unit; they are taken for 20 lg of FRFs in SI units")

    def _label(self, curve: _Curve) -> str:
        """Return the unit label of an FRF, without dB and its number."""
        level = decibel_reference(curve.first.unit)
        label = (level[1] if level is not None else curve.first.unit).strip()
        return "" if label in ("-", "1") else label

    def _stated_kind(self) -> FRFKind | None:
        if self.keyed is not None and self.keyed.kind is not None:
            return self.keyed.kind
        for line in self.table.header:
            found = _KIND.match(line)
            if found is not None and found[1].lower() in NAMES:
                return NAMES[found[1].lower()]
        words = {w for line in self.table.header for w in re.findall(r"[a-z]+", line.lower()) if w in NAMES}
        kinds = {NAMES[w] for w in words}
        stated = kinds.pop() if len(kinds) == 1 else None
        return self.asked.known_kind(self.table.name) or stated


def split_pair(text: str, name: str) -> tuple[str, str]:
    """Return response and force of ``"response/force"``."""
    response, mark, force = text.rpartition("/")
    if not (mark and response.strip() and force.strip()):
        raise error_at(name, f"the pair '{text}' is not allowed; \"response/force\" is needed", TableError)
    return response.strip(), force.strip()
