"""``dovetail history``: what has changed since the first of several states, state by state."""

import argparse
from pathlib import Path

from dovetail.commands.common import Options, check_places, loaded, say
from dovetail.disk.output import Output, OutputError, Progress, write_json
from fem.io.atomic import replacing
from fem.model import Effect

HELP = "find what has changed in each of several states since the first one"
EXAMPLE = "dovetail history study.toml --picture history.png"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw what changed when as .png")


def run(options: Options, progress: Progress) -> None:
    """Diagnose each of a study's states against its baseline."""
    from dovetail.modes_history import diagnose_history, history_dict, history_lines
    from dovetail.modes_pipeline import by_modes

    if options.picture is not None and options.picture.suffix.lower() != ".png":
        msg = f"{options.picture}: the picture is written as .png"
        raise OutputError(msg)
    check_places(options, Output("--picture", options.picture))
    study = loaded(options)
    study = by_modes(study)
    history = diagnose_history(study, progress)
    progress.close()
    write_json(options.json, history_dict(study, history))
    if options.picture is not None:
        from viz.history import plot_history
        from viz.style import save

        assert study.baseline is not None
        changes = [[(_place(e), s.probability) for e in s.diagnosis.found] for s in history]
        figure = plot_history(
            [s.name for s in history], study.baseline.modes.frequency, [s.shift for s in history],
            [s.std for s in history], changes,
        )  # fmt: skip
        with replacing(options.picture) as scratch:
            save(figure, scratch)
    say(options, *history_lines(study, history), *(f"note: {note}" for note in study.measured_notes))


def _place(effect: Effect) -> str:
    """Return what an effect is and where, without its position, which differs a little between states."""
    return f"{effect.kind.replace('_', ' ')}, {effect.where.split(' at ')[0]}"
