"""``dovetail plan``: which missing effects a test could see and name, before it is made."""

import argparse
from typing import TYPE_CHECKING, Any

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import count, positive, share
from dovetail.commands.common import Options, loaded
from dovetail.commands.results import Results
from dovetail.disk.output import Progress, write_json
from dovetail.file.config import BEFORE_TEST

if TYPE_CHECKING:
    from dovetail.file.contents import StudyContents
    from updating.plan.check import FailedTrial, Trial
    from updating.plan.plan import Plan

EXAMPLE = "dovetail plan study.toml --noise 1% --picture plan.png"

RESULTS = Results(picture="where effects are named")


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--noise",
        type=share,
        metavar="SHARE",
        help="noise of a test that is planned, such as 1%%, of the root mean square of the FRFs of a force "
        "(default: that of the measured FRFs, else 1%%)",
    )
    p.add_argument(
        "--left",
        type=positive,
        metavar="DB",
        help="what a right model will leave of the FRFs beside noise, in dB (default: what the fit leaves "
        "of the measured FRFs, else as much as beams usually do)",
    )
    p.add_argument(
        "--choose",
        type=count,
        metavar="N",
        help="choose N sensors, from points along all members, by which most is named, and map that test",
    )
    p.add_argument(
        "--add",
        type=count,
        metavar="N",
        help="add N sensors to those of the study where they name most, and map that test",
    )
    p.add_argument(
        "--excitations",
        type=count,
        metavar="N",
        help="with --choose: choose N places and directions of forces, too (default: those of the study)",
    )
    p.add_argument(
        "--separate",
        action="store_true",
        help="find what separates twins best in a second test: a known mass, or a released support",
    )
    p.add_argument(
        "--mass",
        type=positive,
        metavar="KG",
        help="that mass (default: 5 %% of the structure's)",
    )
    p.add_argument(
        "--averages",
        type=count,
        nargs=2,
        metavar=("NOW", "MORE"),
        help="numbers of averages: the noise is that of NOW; say how much more would be named with MORE",
    )
    p.add_argument(
        "--check",
        type=count,
        metavar="N",
        help="diagnose N sets of data drawn with effects of known sizes, and compare with the map",
    )
    p.add_argument("--seed", type=int, default=1, help="of the data of --check (default 1)")


def run(options: Options, progress: Progress) -> Answer:
    """Return which relevant effects a test sees and names."""
    from dovetail.notebook.planned import Planned
    from dovetail.plan import (
        plan_study,
        require_planned,
        separate_twins,
        with_chosen,
    )
    from dovetail.report import planning
    from updating.plan.plan import with_averages

    study = loaded(options, BEFORE_TEST)
    if options.check or options.separate:
        require_planned(study, options.noise, options.left)
    test = options.add, options.choose, options.excitations
    study, chosen = with_chosen(study, *test, options.noise, options.left, progress)
    plan = plan_study(study, options.noise, options.left, progress)
    apart = separate_twins(study, plan, options.mass, progress) if options.separate else []
    quieter, drawn = None, tuple(plan.kinds)
    if options.averages:
        quieter = with_averages(plan, options.averages[0], options.averages[1], progress)
    if options.picture is not None:
        from viz.plan import drawn_kinds, render_plan

        progress("drawing", 0.99)
        render_plan(plan, options.picture, study.name)
        drawn = drawn_kinds(plan)
    fields = planning.plan_dict(plan)
    printed = Planned(plan, chosen, study.name, study.path).printed()
    if chosen:
        fields["chosen"] = planning.chosen_dict(chosen)
    if len(drawn) < len(plan.kinds):
        which = f"{len(drawn)} of {len(plan.kinds)} rows, those whose effects differ most: {', '.join(drawn)}"
        printed += ["", f"{options.picture} shows {which}; --json writes all effects"]
    if quieter:
        fields["more_averages"] = planning.averages_dict(quieter, *options.averages)
        printed += ["", planning.averages_line(plan, quieter, *options.averages)]
    if apart:
        fields["second_test"] = planning.separation_dicts(apart)
        printed += ["", "second tests:", planning.table_of_twins(apart)]
    if options.check:
        checked = _checked(options, study, plan, fields, progress)
        fields |= planning.check_dicts(checked)
        printed += ["", planning.table_of_check(checked), *planning.failure_lines(checked)]
    return Answer(study, printed, fields)


def _checked(
    options: Options, study: "StudyContents", plan: "Plan", fields: dict[str, Any], progress: Progress
) -> list["Trial | FailedTrial"]:
    """Return the trials of ``--check``; the JSON file has those that ended, also if the check is stopped."""
    from dovetail.plan import check_plan
    from dovetail.report import planning

    checked: list[Trial | FailedTrial] = []
    file = None if str(options.json) == "-" else options.json

    def keep(trial: "Trial | FailedTrial") -> None:
        checked.append(trial)
        write_json(file, Answer(study, (), fields | planning.check_dicts(checked)).as_json())

    try:
        check_plan(study, plan, options.check, options.seed, progress, keep)
    except KeyboardInterrupt:
        kept = f"; {file} has them" if file is not None and checked else ""
        msg = f"{len(checked)} of {options.check} sets of data are diagnosed{kept}"
        raise KeyboardInterrupt(msg) from None
    return checked
