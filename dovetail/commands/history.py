"""``dovetail history``: what has changed since the first of several states, or from state to state."""

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, loaded, noted
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from fem.model import Effect

EXAMPLE = "dovetail history study.toml --picture history.png"
RESULTS = Results(picture="what changed when")


def run(options: Options, progress: Progress) -> Answer:
    """Diagnose each of a study's states against its baseline, or against the state that it names."""
    from dovetail.modes_history import diagnose_history

    study = loaded(options)
    history = diagnose_history(study, progress)
    if options.picture is not None:
        from viz.history import plot_history
        from viz.style import save

        changes = [[(_place(e), s.probability) for e in s.diagnosis.found] for s in history.states]
        figure = plot_history(
            [s.name for s in history.states],
            history.baseline,
            [s.shift for s in history.states],
            [s.std for s in history.states],
            changes,
        )
        save(figure, options.picture)
    printed = [*history.printed(), *noted(study.measured_notes)]
    return Answer(study, printed, history.as_dict())


def _place(effect: Effect) -> str:
    """Return what an effect is and where, without its position, which differs a little between states."""
    return f"{effect.kind.replace('_', ' ')}, {effect.where.thing}"
