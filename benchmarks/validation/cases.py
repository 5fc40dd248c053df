"""Cases: an analyst's model, a measurement of a truth that differs from it, and the hidden effects."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.frames import (
    FAMILIES,
    SMALL,
    Draft,
    Generator,
    build_model,
    draw_draft,
    n_elements,
    perturbed,
    sensors_of,
)
from benchmarks.validation.hidden import FRF_STATES, KINDS, SETS, WEAK_SETS, draw_hidden
from benchmarks.validation.hiding import Hidden
from benchmarks.validation.truth import TrueFrame
from fem import DIRECTIONS, FRF, Model
from updating import Measurement, Nuisance
from updating.correlation import DB_PER_NEPER, log_ratio

SETTINGS_VERSION = 4
"""Raised whenever the same seed gives other cases than before."""


DRAWS = 40
"""So many frames are drawn until one shows what is to be hidden."""
_STEP = 1e-6
"""Relative step of the derivatives with respect to uncertain parameters."""
_WEAK = 0.02
"""Change of the FRFs up to which an effect counts as weak [nepers]."""
EACH_DB = 0.3
"""Change of the FRFs that each direction of a soft connection makes beside the others, at least [dB]."""
FAULT_SEEN = 0.1
"""Change of a sensor's FRFs from which its fault can be found, root mean square [nepers]."""


class CaseError(ValueError):
    """A case that cannot be drawn."""


@dataclass(frozen=True, slots=True)
class CaseSettings:
    """Distributions of the random cases."""

    seed: int
    small: bool = False  # two members, few modes and lines, to try things out
    material: float = 0.03  # half width of uniform relative deviations of E and ρ from the model [-]
    joint: float = 0.15  # and of joints' stiffnesses [-]
    damping: float = 2.0  # largest factor between the truth's damping and the model's
    noise: tuple[float, float] = (0.01, 0.03)  # least and largest relative noise of an FRF [-]
    noise_floor: float = 3e-5  # noise in parts of an excitation's largest FRF value [-]
    # least and largest change of the FRFs by a hidden effect that uncertain parameters cannot make [dB]
    visible_db: tuple[float, float] = (1.5, 4.0)
    weaker: float = 10.0  # factor by which the amplitudes of the sets "weak" and "frf-states" are smaller
    version: int = SETTINGS_VERSION

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for a file."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class Implant:
    """A hidden effect with its strength."""

    hidden: Hidden
    amplitude: float
    visible_db: float  # change of the FRFs beyond the reach of uncertain parameters [dB]


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A case."""

    set: str
    index: int
    draft: Draft
    implants: tuple[Implant, ...]
    exact: NDArray[np.complex128]  # (n_freq, n_out, n_in) accelerances without noise [(m/s²)/N]
    noise: float  # relative noise [-]
    model: Model
    measurement: Measurement
    nuisances: tuple[Nuisance, ...]
    exclude: tuple[str, ...]  # kinds that the search may not use
    baseline: Measurement | None = None  # FRFs of the frame before the effects came


def generator(settings: CaseSettings, set_name: str, *key: int) -> Generator:
    """Return the random numbers of a case: a child of the seed, whatever else is drawn."""
    return np.random.default_rng(
        np.random.SeedSequence(settings.seed, spawn_key=(list(SETS).index(set_name), *key))
    )


def kinds_of(settings: CaseSettings, set_name: str, index: int) -> tuple[str, ...]:
    """Return the hidden kinds of a case: each kind comes once a round, in an order that the seed shuffles."""
    out: list[str] = []
    for k, pool in enumerate(SETS[set_name]):
        turn, place = divmod(index, len(pool))
        order = generator(settings, set_name, 2**31 + turn, k).permutation(len(pool))
        out.append(pool[int(order[place])])
    return tuple(out)


def draw_case(settings: CaseSettings, set_name: str, index: int) -> Case:
    """Draw a case by itself.

    Raises
    ------
    CaseError
        If no frame has a place for the hidden effects.
    """
    rng = generator(settings, set_name, index)
    draft, truth, implants = next(frames_that_show(rng, settings, set_name, index))
    if set_name in WEAK_SETS:
        implants = tuple(
            replace(i, amplitude=i.amplitude / settings.weaker, visible_db=np.nan) for i in implants
        )
    return _measured(rng, settings, set_name, index, draft, truth, implants)


def frames_that_show(
    rng: Generator,
    settings: CaseSettings,
    set_name: str,
    index: int,
    shortened: Callable[[Draft], Draft] = lambda draft: draft,
) -> Iterator[tuple[Draft, TrueFrame, tuple[Implant, ...]]]:
    """Yield frames that show what a case hides, each with its truth and the effects.

    Raises
    ------
    CaseError
        After ``DRAWS`` frames.
    """
    kinds = kinds_of(settings, set_name, index)
    families = SMALL if settings.small else tuple(FAMILIES)
    feet = any(KINDS[kind].elastic_feet for kind in kinds)
    for _ in range(DRAWS):
        draft = shortened(draw_draft(rng, str(rng.choice(families)), settings.small, feet))
        truth = perturbed(rng, draft, settings.material, settings.joint, settings.damping)
        implants = drawn_implants(rng, settings, draft, truth, kinds)
        if implants is not None:
            yield draft, truth, implants
    msg = f"no frame of {DRAWS} shows {' and '.join(kinds)} well enough (set {set_name}, case {index})"
    raise CaseError(msg)


def drawn_implants(
    rng: Generator, settings: CaseSettings, draft: Draft, truth: TrueFrame, kinds: Sequence[str]
) -> tuple[Implant, ...] | None:
    """Find a place and a strength for each kind, or None if the frame has none."""
    if not kinds:
        return ()
    scale = _Scale(draft, truth, settings.noise_floor, 40 if settings.small else 100)
    out: list[Implant] = []
    for kind in kinds:
        low, high = np.log(settings.visible_db)
        wanted = float(np.exp(rng.uniform(low, high)))
        for _ in range(6):
            hidden = draw_hidden(rng, kind, draft, truth)
            if hidden is None:
                return None
            if _clash(hidden, out):
                implants = ()
            elif hidden.parts:
                implants = _together(rng, settings, scale, hidden.parts)
            elif KINDS[kind].fault:
                implants = _drawn_fault(rng, scale, hidden)
            else:
                implants = _strength(scale, hidden, wanted)
            out += implants
            if implants:
                break
        else:
            return None
    return tuple(out)


def _drawn_fault(rng: Generator, scale: "_Scale", hidden: Hidden) -> tuple[Implant, ...]:
    """Return a fault with a drawn size; nothing where nobody could find it.

    That is for a sensor that hears nothing, and for a fault that hardly changes its FRFs, such as a
    wrong place along a member that moves lengthways there.
    """
    if not all(scale.hears(name) for name in hidden.place.sensors):
        return ()
    size = float(rng.uniform(*hidden.bounds))
    return (Implant(hidden, size, np.nan),) if scale.misreads(hidden, size) else ()


def _clash(hidden: Hidden, others: Sequence[Implant]) -> bool:
    """Two effects on one member's field, one joint or one support would overwrite each other."""
    mine = hidden.place
    return any(
        (mine.member is not None and mine.member == o.hidden.place.member)
        or (mine.joint is not None and mine.joint == o.hidden.place.joint)
        or (mine.support is not None and mine.support == o.hidden.place.support)
        for o in others
    )


class _Scale:
    """Measures an effect's change of the FRFs beyond the reach of uncertain parameters.

    Only the exact frame is used. d = ln(H_with / H_without) at some lines, without FRFs near the noise
    floor; the derivatives of ln H with respect to E and ρ of each material, all damping, and each elastic
    stiffness of the joints are projected out of d; the root mean square of the remainder, amplitude and phase
    together, counts in dB. A linear projection does not move resonances back that have gone farther than
    their width, so that :meth:`slope` gives a weak effect's change, in proportion, as a second estimate.
    """

    def __init__(self, draft: Draft, truth: TrueFrame, noise_floor: float, n_lines: int = 100) -> None:
        self._draft, self._truth = draft, truth
        f = draft.frequency
        self._f = f[np.unique(np.linspace(0, f.size - 1, min(n_lines, f.size)).astype(int))]
        self._base = self._frf(truth)
        acceleration = np.abs(self._base) * (self._f**2)[:, None, None]
        self._measurable = acceleration > 30 * noise_floor * acceleration.max(axis=(0, 1))
        columns = [self._log_change(frame) / _STEP for frame in _varied(draft, truth, _STEP)]
        self._basis = np.linalg.qr(np.stack(columns, axis=1))[0]

    def _frf(self, frame: TrueFrame) -> NDArray[np.complex128]:
        return frame.frf(self._f, self._draft.sensors, self._draft.drives)

    def _log_change(
        self, frame: TrueFrame, base: NDArray[np.complex128] | None = None
    ) -> NDArray[np.float64]:
        d = log_ratio(self._frf(frame), self._base if base is None else base)[self._measurable]
        return np.concatenate([d.real, d.imag])

    def hears(self, sensor: str) -> bool:
        """Whether a sensor reads more than noise on most lines, from one excitation at least."""
        row = [s.name for s in self._draft.sensors].index(sensor)
        return bool((self._measurable[:, row].mean(axis=0) > 0.5).any())

    def misreads(self, hidden: Hidden, size: float) -> bool:
        """Whether a fault changes its sensors' FRFs by ``FAULT_SEEN``, root mean square."""
        sensors = self._draft.sensors
        wrong = hidden.readings(sensors, size) if hidden.readings is not None else sensors
        H = self._truth.frf(self._f, wrong, self._draft.drives)
        H = hidden.data(self._f, H, size) if hidden.data is not None else H
        rows = [i for i, s in enumerate(sensors) if s.name in hidden.place.sensors]
        d = np.abs(log_ratio(H, self._base))[:, rows][self._measurable[:, rows]]
        return bool(np.sqrt((d**2).mean()) >= FAULT_SEEN)

    def visible_db(self, frame: TrueFrame, base: TrueFrame | None = None) -> float:
        """Return the change from the truth, or from another frame near it, that is left [dB]."""
        d = self._log_change(frame, None if base is None else self._frf(base))
        d = d - self._basis @ (self._basis.T @ d)
        return float(DB_PER_NEPER * np.sqrt((d**2).sum() / (d.size / 2)))

    def of(self, hidden: Hidden, amplitude: float) -> float:
        """Return the change by an effect at an amplitude [dB]."""
        return self.visible_db(hidden.change(self._truth, amplitude))

    def added_change(self, implant: Implant, others: Sequence[Implant]) -> float:
        """Return the change that an effect makes in a frame that has others [dB]."""
        base = self._truth
        for o in others:
            base = o.hidden.change(base, o.amplitude)
        return self.visible_db(implant.hidden.change(base, implant.amplitude), base)

    def slope(self, hidden: Hidden) -> float:
        """Return the change by a weak effect, in proportion to its amplitude [dB]."""
        a = hidden.bounds[0]
        for _ in range(12):
            d = self._log_change(hidden.change(self._truth, a))
            if np.sqrt((d**2).sum() / (d.size / 2)) < _WEAK:
                break
            a /= 4
        return self.of(hidden, a) / a


def _varied(draft: Draft, truth: TrueFrame, step: float) -> list[TrueFrame]:
    out = []
    for material in dict.fromkeys(draft.materials.values()):
        for key in ("E", "rho"):
            members = {
                n: replace(m, **{key: getattr(m, key) * (1 + step)}) if draft.materials[n] == material else m
                for n, m in truth.members.items()
            }
            out.append(replace(truth, members=members))
    more = {n: replace(m, loss=m.loss * (1 + step)) for n, m in truth.members.items()}
    out.append(replace(truth, members=more))
    out.append(replace(truth, alpha=truth.alpha * (1 + step)))
    out.append(replace(truth, beta=truth.beta * (1 + step)))
    for j in truth.joints:
        for d in range(6):
            if not j.rigid[d]:
                K = j.K.copy()
                K[d, d] *= 1 + step
                out.append(truth.with_joint(j.name, K=K))
    return out


def _together(
    rng: Generator, settings: CaseSettings, scale: _Scale, parts: Sequence[Hidden]
) -> tuple[Implant, ...]:
    """Return effects at one place, each as visible as one alone; nothing if one is lost beside others."""
    out: tuple[Implant, ...] = ()
    for part in parts:
        wanted = float(np.exp(rng.uniform(*np.log(settings.visible_db))))
        out += _strength(scale, part, wanted)
    if len(out) < len(parts):
        return ()
    seen = (scale.added_change(i, [o for o in out if o is not i]) for i in out)
    return out if all(db >= EACH_DB for db in seen) else ()


def _strength(scale: _Scale, hidden: Hidden, wanted: float) -> tuple[Implant, ...]:
    """Return an effect that changes the FRFs as wanted; nothing if even the largest amplitude does not."""
    low, high = hidden.bounds
    slope = scale.slope(hidden)
    grid = np.geomspace(low, high, 9)
    before = None
    for a in grid:
        change = min(slope * float(a), scale.of(hidden, float(a)))
        if change >= wanted:
            break
        before = float(a)
    else:
        return ()
    if before is None:
        return ()
    upper = float(a)
    for _ in range(4):
        middle = float(np.sqrt(before * upper))
        between = min(slope * middle, scale.of(hidden, middle))
        if between >= wanted:
            upper, change = middle, between
        else:
            before = middle
    return (Implant(hidden, upper, change),)


def _measured(
    rng: Generator,
    settings: CaseSettings,
    set_name: str,
    index: int,
    draft: Draft,
    truth: TrueFrame,
    implants: tuple[Implant, ...],
) -> Case:
    sensors, before = draft.sensors, truth
    for i in implants:
        truth = i.hidden.change(truth, i.amplitude)
        if i.hidden.readings is not None:
            sensors = i.hidden.readings(sensors, i.amplitude)
    f = draft.frequency
    exact = truth.frf(f, sensors, draft.drives) * (-((2 * np.pi * f) ** 2))[:, None, None]
    for i in implants:
        if i.hidden.data is not None:
            exact = i.hidden.data(f, exact, i.amplitude)
    relative = float(rng.uniform(*settings.noise))
    measurement = _with_noise(rng, settings, draft, exact, relative)
    baseline = None
    if set_name in FRF_STATES:
        first = before.frf(f, draft.sensors, draft.drives) * (-((2 * np.pi * f) ** 2))[:, None, None]
        baseline = _with_noise(rng, settings, draft, first, relative)
    model = build_model(draft.frame, draft.materials, draft.sensors, n_elements(draft.frame))
    exclude = (
        tuple(k for i in implants for k in KINDS[i.hidden.kind].found_as) if set_name == "withheld" else ()
    )
    nuisances = nuisances_of(settings, draft)
    return Case(
        set_name, index, draft, implants, exact, relative, model, measurement, nuisances, exclude, baseline
    )


def _with_noise(
    rng: Generator, settings: CaseSettings, draft: Draft, exact: NDArray[np.complex128], relative: float
) -> Measurement:
    """Return FRFs as they are measured, with relative noise and a floor."""
    g = rng.standard_normal((4, *exact.shape)) / np.sqrt(2)
    peak = np.abs(exact).max(axis=(0, 1))
    H = exact * (1 + relative * (g[0] + 1j * g[1])) + settings.noise_floor * peak * (g[2] + 1j * g[3])
    names = [[s.name for s in part] for part in (draft.sensors, draft.drives)]
    frf = FRF.from_arrays(draft.frequency, H, "accelerance", *names)
    sensors, drives = (sensors_of(draft.frame, part) for part in (draft.sensors, draft.drives))
    return Measurement(frf, sensors, drives)


def nuisances_of(settings: CaseSettings, draft: Draft) -> tuple[Nuisance, ...]:
    """Return the analyst's uncertain parameters; a uniform half width w has the standard deviation w/√3."""
    out = [
        Nuisance("frame", f"{key}:{name}", round(float(settings.material / np.sqrt(3)), 4))
        for name in dict.fromkeys(draft.materials.values())
        for key in ("E", "rho")
    ]
    for j in draft.frame.joints:
        out += [
            Nuisance(j.name, f"k{d}", round(settings.joint / np.sqrt(3), 4))
            for d, rigid in zip(DIRECTIONS, j.rigid, strict=True)
            if not rigid
        ]
    return tuple(out)
