"""Places of sensors and forces by which a test names as many relevant effects as possible."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import combinations
from operator import add
from typing import Any

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.declarations import Relevant
from fem.effects.places import members_mass
from fem.linalg.solvers import one_thread
from fem.model import Effect, Model, covers
from updating.diagnosis.evidence.diagnosis import prepare_search
from updating.diagnosis.evidence.hypothesis import Odds, near_to
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.information import ExpectedGains, Information
from updating.forecast.look import Look
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.heartbeat import Progress, beat
from updating.inference.parameters import Nuisance
from updating.least_squares.costs import Levels
from updating.measurement.channel_errors import USUAL, ChannelErrors
from updating.measurement.measurement import Sensor
from updating.plan.planned import USUAL_NOISE, as_planned, planned_measurement, usual_discrepancy
from updating.plan.visibility import needed, odds_against, size_of, sized

N_HALVED = 6
"""Halves of the range of a multiple, to 1 %."""
N_LINES = 24
"""Lines at which sensors are compared."""
N_POSITIONS, N_OF_RIVALS = 6, 3
"""At most so many positions of an effect of a relevant size, and of of its rivals."""
MOST_RESIDUALS = 30_000
"""Forces are chosen by what sensors at some places see, where those at all would have more residuals: each of
a thousand effects takes 16 bytes of each."""
MOST_PASSES = 3
"""Passes in which sensors are exchanged one by one, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenChannels:
    """Sensors and forces of a test.

    Attributes
    ----------
    sensors, excitations : tuple of Sensor
    curve : ndarray (n_sensors,)
        Share of the relevant effects that the first sensors name, by how many they are, as they were added
        one by one [-].
    share : float
        That of all after their exchange [-].
    kept : tuple of Sensor
        Sensors of the test beside these.
    without : float
        Share that those alone name [-].
    """

    sensors: tuple[Sensor, ...]
    excitations: tuple[Sensor, ...]
    curve: Floats
    share: float
    kept: tuple[Sensor, ...] = ()
    without: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Worth:
    """What sets of channels say of effects.

    Attributes
    ----------
    information : sequence of Information
        Of each channel on the uncertain parameters and on effects.
    data : ndarray (n_groups,)
        For how many independent data the discrepancy of each group stands.
    known : ndarray (n_uncertain,)
        Precision of the uncertain parameters beforehand.
    least : ndarray (n_relevant, n_effects)
        Gains that distinguish the first effects from all, each from nothing where that is itself; 0 where
        they need not be distinguished.
    """

    information: Sequence[Information]
    data: Floats
    known: Floats
    least: Floats

    def of(self, some: Iterable[int]) -> Information:
        """Return the information of some channels together."""
        return reduce(add, (self.information[k] for k in some))

    def margins(self, total: Information) -> Floats:
        """Return what relevant effects gain over what they need, over their worst rivals, (n_relevant,)."""
        n = len(self.least)
        found = total.beyond(np.diag(self.known))
        sine_squared = 1 - found.cosines_squared
        sine_squared[np.arange(n), np.arange(n)] = 1.0
        enough = np.diag(self.least[:, :n])
        # what remains counts in parts of what is left otherwise
        one, zero = np.ones_like(self.data), np.zeros_like(self.data)
        left = ExpectedGains(Levels(self.data, one, zero), zero)
        least = left.multiples(found.squares / self.data, found.known, enough, N_HALVED)
        worth = (enough / least**2)[:, None] * sine_squared
        ratio = np.where(self.least > 0, worth / np.where(self.least > 0, self.least, 1.0), np.inf)
        out: Floats = ratio.min(axis=1)
        return out

    def value(self, total: Information) -> float:
        """Return the share of effects that are distinguished, and how nearly the others are, on average."""
        margins = self.margins(total)
        return float((margins >= 1).mean() + np.minimum(margins, 1.0).mean())

    def share(self, total: Information) -> float:
        """Return the share of effects that are distinguished."""
        return float((self.margins(total) >= 1).mean())


@one_thread()
def choose(
    model: Model,
    sensors: Sequence[Sensor],
    excitations: Sequence[Sensor],
    frequency: Floats,
    n_sensors: int,
    n_excitations: int | None = None,
    nuisances: Sequence[Nuisance] = (),
    *,
    kept: Sequence[Sensor] = (),
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    sizes: Relevant,
    noise: float = USUAL_NOISE,
    errors: ChannelErrors = USUAL,
    model_error: float = EXPLAINED_LEVEL,
    discrepancy: float | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> ChosenChannels:
    """Choose sensors and forces so that as many effects of a relevant size as possible are named.

    Sensors are added one by one and then exchanged as long as that gains. Their masses do not count, nor
    those of exciters whose places are chosen. Of many places, forces are chosen by what sensors at some of
    them see.

    Parameters
    ----------
    model : Model
        With points where sensors and forces may be.
    sensors, excitations : sequence of Sensor
        Those that are possible.
    frequency : ndarray (n_freq,)
        Lines of the test [Hz].
    n_sensors : int
    n_excitations : int, optional
        All unless given.
    kept : sequence of Sensor
        Sensors that the test has beside those that are chosen.
    nuisances, kinds, exclude, model_error, settings
        As of :func:`updating.plan.plan.plan_test`.
    sizes : Relevant
    noise : float
        As of :func:`updating.plan.planned.planned_measurement` [-].
    errors : ChannelErrors
    discrepancy : float, optional
        As of :func:`updating.plan.plan.plan_test` [nepers].
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    ValueError
        If more are to be chosen than are possible.
    """
    for word, n, some in (("sensors", n_sensors, sensors), ("excitations", n_excitations, excitations)):
        if n is not None and not 1 <= n <= len(some):
            msg = f"{n} {word} are to be chosen from {len(some)}; at least 1 and at most as many are possible"
            raise ValueError(msg)
    say = progress or (lambda text, done: None)
    light = replace(errors, sensor_mass=0.0)  # no test has sensors everywhere
    if n_excitations is not None:
        light = replace(light, driver_mass=0.0, stinger=0.0)
    settings |= {"kinds": kinds, "exclude": exclude, "model_error": model_error}
    discrepancy = usual_discrepancy(model_error) if discrepancy is None else discrepancy
    fixed = range(len(kept))
    sensors = (*kept, *sensors)

    def seen(some: Sequence[Sensor], forces: Sequence[Sensor], at: float) -> tuple["_Channels", Floats]:
        """Return what some sensors see of effects with some forces, and the gains that they need."""
        say("reducing the model", at)
        test = planned_measurement(model, some, forces, frequency, noise, errors=light)
        fit_problem, _, candidates = prepare_search(model, test, nuisances, **settings)
        base = fit_problem.nominal()
        problem = as_planned(fit_problem, base)
        n_data = len(frequency) * len(some) * len(forces)
        look = Look.of(problem, base, N_LINES, 0, n_data, discrepancy, bounded=False)
        odds = Odds.of(candidates, problem.reduced.model)
        n, effects, changes, against = _effects(
            look, candidates, sizes, odds, lambda part: say("effects", at + (0.5 - at) * part)
        )
        same = np.array([[a.name == b.name or covers(b, a) for b in effects] for a in effects[:n]])
        least = np.where(same, 0.0, needed(against[:n, None] - against))
        least[np.arange(n), np.arange(n)] = needed(against[:n])
        say("what each channel says", 0.5)
        return _Channels.of(look, changes, len(some) / (len(kept) + n_sensors)), least

    def chosen(part: float) -> None:
        say("choosing forces", 0.5 + 0.1 * part)

    n_few = max(MOST_RESIDUALS // (N_LINES * len(excitations)), 2)
    if n_excitations is not None and n_few < len(sensors):
        few = np.linspace(0, len(sensors) - 1, n_few).astype(int)
        pushed = _best_forces(*seen([sensors[k] for k in few], excitations, 0.0), n_excitations, chosen)
        excitations = [excitations[k] for k in pushed]
    channels, least = seen(sensors, excitations, 0.3)
    pushed = _best_forces(channels, least, n_excitations or len(excitations), chosen)
    worth = _Worth(channels.of_sensors(pushed, len(least)), channels.data, channels.known, least)
    taken, curve = _added(worth, fixed, n_sensors, lambda part: say("adding sensors", 0.6 + 0.2 * part))
    taken = _exchanged(worth, taken, len(kept), lambda part: say("exchanging sensors", 0.8 + 0.2 * part))
    return ChosenChannels(
        tuple(sensors[k] for k in sorted(taken[len(kept) :])),
        tuple(excitations[k] for k in pushed),
        curve,
        worth.share(worth.of(taken)),
        tuple(kept),
        worth.share(worth.of(fixed)) if kept else 0.0,
    )


def _effects(
    look: Look[Any, Any],
    candidates: Sequence[Effect],
    sizes: Relevant,
    odds: Odds,
    say: Callable[[float], None],
) -> tuple[int, list[Effect], Complexes, Floats]:
    """Return effects at some positions, what they do to the residuals (n, m), and the log odds against each.

    The first, so many, are of a relevant size; a little of all others are the rivals.
    """
    problem, mass = look.problem, members_mass(look.problem.reduced.model)
    single = [len(near_to(e)) == 1 for e in candidates]
    values = [
        e.relevant(sizes, mass, problem.surroundings) if s else None
        for e, s in zip(candidates, single, strict=True)
    ]
    counted = [k for k, v in enumerate(values) if v is not None]
    rest = [k for k, v in enumerate(values) if v is None]
    n, effects = 0, list[Effect]()
    parts: list[Complexes] = []
    against: list[float] = []
    for some, most in ((counted, N_POSITIONS), (rest, N_OF_RIVALS)):
        grids = [Grid.of(problem, candidates[k]) for k in some]
        there = Forecast.of(look, grids, n_places=most, changes=True)
        each = [odds_against(problem, g.effect, odds, len(g.slight_points())) for g in grids]
        for i, o in enumerate(there.owner.tolist()):
            slight, change, value = there.effect_at(i, 1.0), there.changes[i], values[some[o]]
            if value is not None:
                relevant = sized(slight, value)
                change, slight = change * (size_of(relevant) / size_of(slight)), relevant
            effects.append(slight)
            parts.append(change)
            against.append(each[o])
        if some is counted:
            n = len(effects)
            say(0.7)
    return n, effects, np.array(parts), np.array(against)


@dataclass(frozen=True, slots=True, eq=False)
class _Channels:
    """Slopes of the residuals, by channel.

    Attributes
    ----------
    slopes : ndarray (n, m)
        By what is uncertain of all channels together and, behind that, by effects; weighted.
    errors : list of ndarray (n_errors, m)
        By errors of each sensor, in standard deviations of them.
    known : ndarray (n_uncertain,)
        Precision of the former beforehand.
    output, input, group : ndarray of int (m,)
        Sensor, force and group of each residual.
    data : ndarray (n_groups,)
        For how many independent data the discrepancy of each group stands.
    """

    slopes: Complexes
    errors: list[Complexes]
    known: Floats
    output: Ints
    input: Ints
    group: Ints
    data: Floats

    @classmethod
    def of(cls, look: Look[Any, Any], changes: Complexes, more: float) -> "_Channels":
        """Sort the slopes; with fewer sensors than are possible each counts ``more``."""
        scatter, m = look.problem.scatter, len(look.share)
        n_out = len(look.problem.data.measurement.sensors)
        J = (look.slopes[:, :m] + 1j * look.slopes[:, m : 2 * m]) * np.sqrt(more * look.weights[:m])
        of = np.full(len(J), -1)
        if scatter is not None and scatter.channels is not None and len(scatter.channels.of):
            numbers = scatter.channels.of
            of[-len(numbers) :] = np.where(numbers < n_out, numbers, -1)
        _, output, input_ = np.unravel_index(
            look.residuals.at, look.problem.data.mask[look.residuals.lines].shape
        )
        shared = of < 0
        known = (look.slopes[shared, 2 * m :] ** 2).sum(axis=1)
        slopes = np.vstack([J[shared], changes * np.sqrt(more * look.weights[:m])])
        errors = [J[of == o] for o in range(n_out)]
        return cls(slopes, errors, known, output, input_, look.share.argmax(axis=1), look.likelihood.n)

    def of_forces(self, n: int) -> list[Information]:
        """Return the information of all sensors with each force on the first n effects."""
        some = (self.input == i for i in range(self.input.max() + 1))
        return [self._information(self.slopes[:, here], here, n) for here in some]

    def of_sensors(self, forces: Sequence[int], n: int) -> list[Information]:
        """Return the information of each sensor with some forces on the first n effects.

        Without what errors of that sensor could do.
        """
        out = []
        for o, of_sensor in enumerate(self.errors):
            beat()
            here = (self.output == o) & np.isin(self.input, list(forces))
            part, errors = self.slopes[:, here], of_sensor[:, here]
            both = (errors @ errors.conj().T).real + np.eye(len(errors))
            C = np.linalg.solve(both, (errors @ part.conj().T).real)
            # what is known of these errors beforehand counts in no group more than in another
            out.append(self._information(part - C.T @ errors, here, n, C.T / np.sqrt(len(self.data))))
        return out

    def _information(self, slopes: Complexes, here: Bools, n: int, more: Floats | None = None) -> Information:
        groups = (slopes[:, self.group[here] == g] for g in range(len(self.data)))
        rest = [] if more is None else [more]
        rows = [np.hstack([p.real, p.imag, *rest]).astype(np.float32) for p in groups]
        return Information.of(rows, len(self.known), n)


def _best_forces(channels: _Channels, least: Floats, n: int, say: Callable[[float], None]) -> tuple[int, ...]:
    """Return the forces that tell most with all sensors."""
    worth = _Worth(channels.of_forces(len(least)), channels.data, channels.known, least)
    n_all = len(worth.information)
    if n == n_all:
        return tuple(range(n))
    single = []
    for k, each in enumerate(worth.information):
        say(0.7 * k / n_all)
        single.append(worth.value(each))
    # Of more places for forces those that are driven best count
    best = np.sort(np.argsort(single)[::-1][: max(n, 8)])
    sets, values = list(combinations(best.tolist(), n)), list[float]()
    for k, some in enumerate(sets):
        say(0.7 + 0.3 * k / len(sets))
        values.append(worth.value(worth.of(some)))
    return sets[int(np.argmax(values))]


def _added(
    worth: _Worth, fixed: Iterable[int], n: int, say: Callable[[float], None]
) -> tuple[list[int], Floats]:
    """Return channels added to some one by one by what they gain, and the shares of effects distinguished."""
    taken = list(fixed)
    curve = np.zeros(n)
    for step in range(n):
        say(step / n)
        taken.append(_best(worth, taken)[1])
        curve[step] = worth.share(worth.of(taken))
    return taken, curve


def _exchanged(worth: _Worth, taken: list[int], n_fixed: int, say: Callable[[float], None]) -> list[int]:
    """Return channels of which all but the first are exchanged one by one as long as that gains."""
    taken = list(taken)
    now = worth.value(worth.of(taken))
    for turn in range(MOST_PASSES):
        before = now
        for k in range(n_fixed, len(taken)):
            say((turn + k / len(taken)) / MOST_PASSES)
            value, other = _best(worth, taken[:k] + taken[k + 1 :], but=taken[k])
            if value > now:
                now, taken[k] = value, other
        if now <= before:
            break
    return taken


def _best(worth: _Worth, taken: Sequence[int], but: int = -1) -> tuple[float, int]:
    """Return the value of the channel that tells most beside some others, and its number."""
    others, found = [worth.of(taken)] if taken else [], []
    for k in range(len(worth.information)):
        if k not in taken and k != but:
            beat()
            found.append((worth.value(reduce(add, [*others, worth.information[k]])), -k))
    value, k = max(found, default=(-np.inf, 1))
    return value, -k
