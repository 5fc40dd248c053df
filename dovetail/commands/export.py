"""``dovetail export``: the model, or what was found of it, as decks of other programs."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.disk.output import Output, OutputError, Progress
from dovetail.export import WRITERS, exported_deck
from fem.analysis.modes import first_modes
from fem.io import write_modes
from fem.io.atomic import replacing
from fem.matrices import UNITS
from fem.system import assemble

EXAMPLE = "dovetail export out/found.toml --nastran found.bdf --units mm-t-s"
MODES = 20
"""Modes that a deck asks for, and that a universal file has."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    for program, suffix in (("nastran", ".bdf"), ("abaqus", ".inp"), ("ansys", ".mac")):
        words = f"write cards for {program.upper() if program == 'ansys' else program.capitalize()}: {suffix}"
        p.add_argument(f"--{program}", type=Path, metavar="FILE", help=words)
    p.add_argument("--uff", type=Path, metavar="FILE", help="write the mesh and the computed modes: .uff")
    p.add_argument(
        "--whole",
        action="store_true",
        help="the whole model, with a request of its modes (default: what was found)",
    )
    p.add_argument("--units", choices=tuple(UNITS), default="SI", help="units of the decks (default SI)")


def run(options: Options, progress: Progress) -> Answer:
    """Write the files that are asked for."""
    paths = {name: path for name in WRITERS if (path := getattr(options, name)) is not None}
    if not paths and options.uff is None:
        msg = f"no file is asked for; give {', '.join(f'--{name} FILE' for name in WRITERS)} or --uff FILE"
        raise OutputError(msg)
    if options.uff is not None and options.uff.suffix.lower() not in (".uff", ".unv"):
        msg = f"--uff {options.uff} is written as .uff or .unv, not '{options.uff.suffix}'"
        raise OutputError(msg)
    check_places(
        options, *(Output(f"--{name}", path) for name, path in (*paths.items(), ("uff", options.uff)))
    )
    study = loaded(options, ())
    lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    if paths:
        progress("making the deck")
        deck, lines = exported_deck(study, whole=options.whole)
        heading, notes = (*lines, f"units {options.units}"), deck.notes
        texts = {name: WRITERS[name](deck, options.units, heading, MODES) for name in paths}
        for name, text in texts.items():
            with replacing(paths[name]) as scratch:
                scratch.write_text(text, "utf-8")
    if options.uff is not None:
        progress("solving for modes")
        write_modes(
            first_modes(assemble(study.model, reciprocal=False), MODES), study.model.mesh, options.uff
        )
    files = {name: str(path) for name, path in (*paths.items(), ("uff", options.uff)) if path is not None}
    return Answer(
        study,
        [*lines, *(f"{name}: {path}" for name, path in files.items()), *noted(notes)],
        {
            "files": files,
            "units": options.units,
            "whole": options.whole,
            "exported": lines,
            "notes": notes,
        },
    )
