"""``dovetail plan``: which missing effects a test could see and name, before it is made."""

import argparse
from pathlib import Path

from dovetail.commands.argument_types import positive
from dovetail.commands.common import Options, check_places, loaded, say
from dovetail.disk.output import Output, Progress, write_json

HELP = "say which missing effects a test could see and name, before it is made"
EXAMPLE = "dovetail plan study.toml --noise 0.01 --picture plan.png"
MOST_TWINS = 10


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--noise",
        type=positive,
        metavar="SHARE",
        help="noise of a test that is planned, in parts of each FRF's root mean square "
        "(default: that of the measured FRFs, else 0.01)",
    )
    p.add_argument(
        "--left",
        type=positive,
        metavar="DB",
        help="what a right model will leave of the FRFs beside noise, in dB (default: what the fit leaves "
        "of the measured FRFs, else as much as beams usually do)",
    )
    p.add_argument("--picture", type=Path, metavar="FILE", help="draw where effects are named (PNG)")


def run(options: Options, progress: Progress) -> None:
    """Print which relevant effects a test sees and names."""
    from dovetail.plan import plan_study
    from dovetail.report import planning

    check_places(options, Output("--picture", options.picture))
    study = loaded(options)
    plan = plan_study(study, options.noise, options.left, progress)
    if options.picture is not None:
        from viz.plan import render_plan

        progress("drawing", 0.99)
        render_plan(plan, options.picture, study.name)
    progress.close()
    write_json(options.json, {"study": study.name, **planning.plan_dict(plan), "warnings": study.warnings})
    rows = planning.kind_rows(plan)
    kind, relevant = (max([len(getattr(r, key)) for r in rows] + [8]) for key in ("kind", "relevant"))
    seen, located, named = (100 * plan.coverage(what) for what in ("seen", "located", "named"))
    lines = [
        f"{study.name}: {planning.title(plan)}",
        f"of {len(plan.relevant)} relevant effects {seen:.0f} % are seen, {located:.0f} % located and "
        f"{named:.0f} % named",
        "",
        f"{'kind':{kind}}  {'relevant size':{relevant}}     n  seen  place  named  named from",
        *(
            f"{r.kind:{kind}}  {r.relevant:{relevant}}  {r.n:4d}  {_percent(r.seen)}  {_percent(r.located)} "
            f" {_percent(r.named)}  {r.smallest or 'none'}{f' … {r.largest}' if r.largest else ''}"
            for r in rows
        ),
    ]
    if twins := plan.twins:
        lines += ["", "seen, but not told apart:"]
        lines += [f"  {planning.twin_text(*pair)}" for pair in twins[:MOST_TWINS]]
        lines += [f"  and {len(twins) - MOST_TWINS} more pairs (--json has all)"] * (len(twins) > MOST_TWINS)
    if blind := planning.blind_lines(plan):
        lines += ["", "not seen in relevant size:", *(f"  {line}" for line in blind)]
    say(options, *lines)


def _percent(share: float) -> str:
    return f"{100 * share:3.0f} %"
