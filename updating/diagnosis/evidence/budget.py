"""How much a search tries: numbers that cost time, and decide nothing of what is believed."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Budget:
    """How much a search tries.

    Attributes
    ----------
    n_lines : int
        Lines of full fits.
    n_passes : int
        So often deviations of modes are fitted again at most, where another size than the next one is best.
    n_rounds : int
        Rounds of the search at most; each adds something to the best hypotheses.
    most_effects, most_back : int
        A hypothesis with so many effects is not searched on from. So often the search goes back to a less
        probable one if the best does not explain the data.
    n_beam : int
        Hypotheses that are searched on from at once.
    n_singles : int
        Single effects that are fitted to damped FRFs.
    n_places, n_pairs : int
        Places at which each kind, and of connections at which the block, gets a short fit; pairs of these.
    most_connections, most_paired : int
        Connections, the first of the scan, that are looked at in all directions; pairs are made of so many.
    n_short, together : int
        For each hypothesis that is fitted on, short fits; so many before it is asked whether others can win.
    n_full, n_final : int
        Hypotheses that are fitted fully at most and at least, where they may still win.
    most_fits : int
        A hypothesis is fitted fully from at most so many values.
    n_rivals : int
        Candidates that are fitted in the place of each found effect.
    n_departures, n_form_rivals : int
        Parts of the form outside their usual ranges where effects are fitted, and so many effects for each.
    checked : bool
        Whether faults of the measurement are looked for, rivals are fitted in the place of what was found,
        and that from other values, too.
    """

    n_lines: int = 100
    n_passes: int = 3
    n_rounds: int = 100
    most_effects: int = 6
    most_back: int = 1
    n_beam: int = 2
    n_singles: int = 16
    n_places: int = 4
    n_pairs: int = 2
    most_connections: int = 40
    most_paired: int = 8
    n_short: int = 3
    together: int = 8
    n_full: int = 6
    n_final: int = 3
    most_fits: int = 3
    n_rivals: int = 6
    n_departures: int = 3
    n_form_rivals: int = 2
    checked: bool = True


NORMAL = Budget()
QUICK = Budget(n_lines=40, n_passes=1, n_rounds=1, n_singles=6, n_short=1, n_full=2, n_final=2, checked=False)
THOROUGH = Budget(
    most_back=3, n_beam=3, n_singles=48, n_places=8, n_pairs=6, n_short=6, n_full=12, n_final=6, n_rivals=12
)
BUDGETS = {"quick": QUICK, "normal": NORMAL, "thorough": THOROUGH}
