"""``dovetail history``: what has changed since the first of several states, or from state to state."""

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, loaded, noted
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from fem.io.atomic import replacing
from fem.model import Effect

EXAMPLE = "dovetail history study.toml --picture history.png"
RESULTS = Results(picture="what changed when")


def run(options: Options, progress: Progress) -> Answer:
    """Diagnose each of a study's states against its baseline, or against the state that it names."""
    from dovetail.modes_history import diagnose_history, history_dict, history_lines
    from dovetail.modes_pipeline import by_modes

    study = loaded(options)
    study = by_modes(study)
    history = diagnose_history(study, progress)
    if options.picture is not None:
        from viz.history import plot_history
        from viz.style import save

        assert study.baseline is not None
        changes = [[(_place(e), s.probability) for e in s.diagnosis.found] for s in history]
        figure = plot_history(
            [s.name for s in history],
            study.baseline.modes.frequency,
            [s.shift for s in history],
            [s.std for s in history],
            changes,
        )
        with replacing(options.picture) as scratch:
            save(figure, scratch)
    printed = [*history_lines(study, history), *noted(study.measured_notes)]
    return Answer(study, printed, history_dict(study, history))


def _place(effect: Effect) -> str:
    """Return what an effect is and where, without its position, which differs a little between states."""
    return f"{effect.kind.replace('_', ' ')}, {effect.where.thing}"
