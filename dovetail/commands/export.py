"""``dovetail export``: the model, or what was found of it, as decks of other programs."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.disk.output import Output, OutputError, Progress
from dovetail.export import (
    WRITERS,
    Exported,
    differences,
    exported_deck,
    exported_edit,
    program_of,
)
from dovetail.file.contents import SourceDeck, StudyContents
from fem.analysis.modes import first_modes
from fem.io import write_modes
from fem.io.atomic import replacing
from fem.io.deck_units import DeckUnits
from fem.io.programs import ALLOWED
from fem.io.source_changes import DeckEdit, SourceError
from fem.matrices import UNITS
from fem.mesh import MeshError
from fem.model import Model
from fem.summary import listed
from fem.system import assemble

EXAMPLE = "dovetail export out/found.toml --nastran found.bdf --merge merged.bdf"
MODES = 20
"""Modes that a deck asks for, and that a universal file has."""


INSERT: Mapping[str, tuple[str, ...]] = {
    "nastran": (r"\s*ENDDATA", r"\s*BEGIN\b"),
    "abaqus": (r"\s*\*\s*STEP\b",),
    "ansys": (r"\s*(/SOLU|FINISH|/EOF)\b",),
}
"""Patterns of the lines of a deck before which cards, and lines of case control, go."""
PLACE: Mapping[str, tuple[str, str]] = {
    "nastran": (
        "put these cards, or INCLUDE '{file}', into {deck} before ENDDATA",
        ", and delete the cards that they replace",
    ),
    "abaqus": (
        "put these keywords, or *INCLUDE, INPUT={file}, into {deck} before *STEP",
        ", and delete the lines that they replace",
    ),
    "ansys": (
        "read these commands by /INPUT,{file} after {deck}",
        ": they redefine what they replace, so nothing is to be deleted",
    ),
}
"""Where cards go, and, where they replace some, what to do with these."""
AGREEMENT = 1e-4
"""Difference of natural frequencies up to which a deck is its model [-]."""
NUMBERED = "new cards are numbered from 900001 (ANSYS: tables from 9001), bars as the lines of the study"


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
    p.add_argument(
        "--fitted",
        action="store_true",
        help="also fitted values of what the deck has, beyond their standard deviation, and the form that "
        "the report names (default: the found effects alone)",
    )
    p.add_argument(
        "--into",
        type=Path,
        metavar="DECK",
        help="the deck that the cards are for, whose numbers they keep (default: [source] of the study)",
    )
    p.add_argument(
        "--merge",
        type=Path,
        metavar="FILE",
        help="write that deck with the cards in it, too: a complete deck",
    )
    p.add_argument(
        "--units", choices=tuple(UNITS), help="units of the decks (default: those of the source deck, or SI)"
    )


def _source(options: Options, study: StudyContents, notes: list[str]) -> SourceDeck | None:
    """Return the deck that the cards are for, None with a note where it cannot be read."""
    known = study.source
    if options.into is not None:
        units = options.units or (known.units if known is not None else "SI")
        known = SourceDeck(options.into, units)
        places = (options.nastran, options.abaqus, options.ansys, options.merge)
        if any(path is not None and path.resolve() == options.into.resolve() for path in places):
            msg = f"--into {options.into} would be overwritten; give the cards another name"
            raise OutputError(msg)
        if not options.into.is_file() or not program_of(options.into):
            msg = f"--into {options.into}: a deck that is there is needed: {ALLOWED}"
            raise OutputError(msg)
    if known is None:
        return None
    if not known.file.is_file():
        lost = f"{known.file}, the deck of [source], is not there"
        if options.merge is not None:
            msg = f"--merge {options.merge}: {lost}; --into gives its new place"
            raise OutputError(msg)
        notes.append(f"{lost}: {NUMBERED}; --into gives its new place")
        return None
    return known


def _named(units: str | Sequence[float]) -> str:
    return units if isinstance(units, str) else ",".join(map(str, units))


def _edit(
    options: Options, study: StudyContents, source: SourceDeck, notes: list[str]
) -> tuple[DeckEdit, Exported] | None:
    """Return the cards for the source deck; None with a note where its numbers cannot be kept."""
    try:
        return exported_edit(study, source, fitted=options.fitted)
    except SourceError as reason:
        if options.merge is not None:
            msg = f"--merge {options.merge}: {reason}"
            raise OutputError(msg) from reason
        notes.append(f"{reason}: {NUMBERED}")
        return None


def _agreement(path: Path, source: SourceDeck, model: Model, unread: Sequence[str]) -> str:
    """Return a sentence on how well a merged deck has the natural frequencies of its model."""
    try:
        error, of_ends = differences(path, source, model)
    except MeshError as reason:
        return f"{path.name} cannot be read again: {reason}"
    head = f"{path.name}, read again: its natural frequencies"
    by = f"{100 * error:.2g} %"
    if error < AGREEMENT:
        return f"{head} agree with those of the study to {by}"
    if unread:
        return (
            f"{head} differ from those of the study by up to {by}: Dovetail does not read its "
            f"matrices ({', '.join(unread)}), so check that deck in its program"
        )
    if of_ends < AGREEMENT:
        return f"{head} are those of the study, but for nodes behind released ends, which add up to {by}"
    return (
        f"{head} differ from those of the study by up to {by}: the deck's elements may be too long, "
        "its sections may have a found form only nearly, or a note says what the cards lack"
    )


def run(options: Options, progress: Progress) -> Answer:
    """Write the files that are asked for."""
    paths = {name: path for name in WRITERS if (path := getattr(options, name)) is not None}
    if not paths and options.uff is None and options.merge is None:
        msg = f"no file is asked for; give {', '.join(f'--{name} FILE' for name in WRITERS)} or --uff FILE"
        raise OutputError(msg)
    if options.uff is not None and options.uff.suffix.lower() not in (".uff", ".unv"):
        msg = f"--uff {options.uff} is written as .uff or .unv, not '{options.uff.suffix}'"
        raise OutputError(msg)
    check_places(
        options,
        *(
            Output(f"--{name}", path)
            for name, path in (*paths.items(), ("merge", options.merge), ("uff", options.uff))
        ),
    )
    if options.whole and options.fitted:
        msg = "--whole exports the model, and --fitted changes of a deck; give one of them"
        raise OutputError(msg)
    study = loaded(options, ())
    lines: tuple[str, ...] = ()
    notes: list[str] = []
    units = options.units or (study.source.units if study.source is not None else "SI")
    source = None if options.whole else _source(options, study, notes)
    if options.merge is not None and source is None:
        why = (
            "it takes no --whole"
            if options.whole
            else f"{study.path.name} has no [source]; give it by --into"
        )
        msg = f"--merge {options.merge} needs the source deck: {why}"
        raise OutputError(msg)
    texts: dict[Path, str] = {}
    program = "" if source is None else program_of(source.file)
    edit = None
    replaces: list[str] = []
    if source is not None and (program in paths or options.merge is not None):
        progress("comparing with the deck")
        if options.units is not None and DeckUnits.of(options.units) != DeckUnits.of(source.units):
            msg = f"--units {options.units}: the units of {source.file.name} are {_named(source.units)}"
            raise OutputError(msg)
        units = source.units
        edit = _edit(options, study, source, notes)
    if source is not None and edit is not None:
        cards, found = edit
        lines, into = found.lines, source.file
        replaces = [*map(str, cards.replaced), *cards.redefined]
        place = "".join(PLACE[program][: 1 + bool(replaces)])
        file = paths[program].name if program in paths else into.name
        heading = (*lines, f"units {_named(units)}", place.format(file=file, deck=into.name))
        notes += [f"case control needs {line}" for line in cards.control]
        if replaces:
            notes.append(f"replaces {listed(replaces)}")
        notes += cards.notes
        if program in paths:
            texts[paths[program]] = cards.text(heading)
        if options.merge is not None:
            old = into.read_text("utf-8", errors="surrogateescape")
            texts[options.merge] = cards.merged(old, into.name, heading, *INSERT[program])
    others = [name for name in paths if edit is None or name != program]
    if others and source is not None and edit is not None:
        notes.append(f"{source.file.name} is no deck of {' or '.join(others)}: {NUMBERED}")
    if others:
        progress("making the deck")
        deck, lines = exported_deck(study, whole=options.whole, fitted=options.fitted)
        heading = (*lines, f"units {_named(units)}")
        texts |= {paths[name]: WRITERS[name](deck, DeckUnits.of(units), heading, MODES) for name in others}
        notes += deck.notes
    for path, text in texts.items():
        with replacing(path) as scratch:
            scratch.write_text(text, "utf-8", errors="surrogateescape")
    if options.merge is not None and source is not None and edit is not None:
        progress("reading the merged deck")
        notes.append(_agreement(options.merge, source, edit[1].model, edit[0].unread))
    if options.uff is not None:
        progress("solving for modes")
        write_modes(
            first_modes(assemble(study.model, reciprocal=False), MODES), study.model.mesh, options.uff
        )
    named = (*paths.items(), ("merge", options.merge), ("uff", options.uff))
    files = {name: str(path) for name, path in named if path is not None}
    return Answer(
        study,
        [*lines, *(f"{name}: {path}" for name, path in files.items()), *noted(notes)],
        {
            "files": files,
            "units": _named(units),
            "whole": options.whole,
            "fitted": options.fitted,
            "exported": lines,
            "replaces": replaces,
            "notes": notes,
        },
    )
