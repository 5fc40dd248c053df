"""The open test of missing physics: python -m benchmarks.open_test take|solve|check|judge|tune|oracle|…."""

import argparse
import importlib
import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

from benchmarks.open_test import judge as judging
from benchmarks.open_test.answer import Answer, not_ended, read_answer
from benchmarks.open_test.case import CaseError, read_structure
from benchmarks.open_test.rivals import NAMES
from benchmarks.open_test.sets import TRUTH, cases_of, reveal, seal, take
from benchmarks.open_test.tuning import tuned

LIMIT = 300
"""CPU seconds that a program has for a case."""
GRACE = 20
"""CPU seconds after which a rival that does not watch its time is ended."""


def answered(name, case, limit):
    """Return the answer of a rival to the case in a folder."""
    from benchmarks.open_test.rivals.common import Case

    rival, structure = importlib.import_module(f"benchmarks.open_test.rivals.{name}"), read_structure(case)
    begun = time.process_time()
    said = rival.solve(Case(Path(case), limit))
    seconds = round(time.process_time() - begun, 1)
    version = metadata.version("dovetail-dynamics")
    return Answer(structure.name, name, version, seconds, said.explanations, said.unexplained)


def solve_all(name, cases, out, limit):
    """Answer all cases of a folder, each in a process of its own; go on after a run that was stopped.

    BLAS has one thread: threads that wait for each other would count as CPU seconds of a program.
    """
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    for case in cases_of(cases):
        file = out / name / f"{case}.json"
        if file.exists():
            continue
        file.parent.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "benchmarks.open_test", "one", name, str(cases / case), str(file)]
        begun = resource.getrusage(resource.RUSAGE_CHILDREN)
        ended = subprocess.run([*command, "--limit", str(limit)], check=False, env=environment).returncode
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = used.ru_utime + used.ru_stime - begun.ru_utime - begun.ru_stime
        if not file.exists():
            if ended != -signal.SIGXCPU and ended != -signal.SIGKILL:
                sys.stderr.write(f"{name} {case}: ended with {ended}\n")
            _write(file, not_ended(case, name, "", round(seconds, 1)))
        sys.stderr.write(f"{name} {case}: {seconds:.0f} CPU s\n")


def _write(file, answer):
    text = json.dumps(answer.as_dict(), indent=1, ensure_ascii=False)
    part = file.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    part.rename(file)


def judged(cases, folders, truths, oracle):
    """Return what answers are worth, and the cases that have none and count as "do not know", by program."""
    by_program, missing = {}, {}
    for folder in folders:
        for case in sorted(truths):
            structure = read_structure(cases / case)
            file = folder / f"{case}.json"
            if file.exists():
                answer = read_answer(file, structure)
            else:
                answer = Answer(case, folder.name, "", math.nan, ())
                missing.setdefault(folder.name, []).append(case)
            one = judging.judge(answer, truths[case], structure, oracle.get(case))
            by_program.setdefault(folder.name, []).append(one)
    return by_program, missing


def _ask_oracle(cases, file):
    from benchmarks.open_test.oracle import nats_of
    from benchmarks.open_test.rivals.common import Case

    truths = json.loads((cases / TRUTH).read_text(encoding="utf-8"))
    known = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for case in sorted(truths.keys() - known.keys()):
        known[case] = nats_of(Case(cases / case), truths[case])
        file.write_text(json.dumps(known, indent=1), encoding="utf-8")
        sys.stderr.write(f"{case}: {known[case]} nats\n")


def main(argv=None):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.open_test", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    p = commands.add_parser("take", help="make cases of the test of generated ones")
    p.add_argument("generated", type=Path, help="folder of benchmarks.independent.foreign")
    p.add_argument("out", type=Path)
    p.add_argument("--first", type=int, default=1, help="number of the first case")
    p = commands.add_parser("solve", help="answer all cases of a folder with programs that are here")
    p.add_argument("names", nargs="+", choices=NAMES, metavar="NAME", help=", ".join(NAMES))
    p.add_argument("cases", type=Path)
    p.add_argument("answers", type=Path)
    p.add_argument("--limit", type=int, default=LIMIT, help="CPU seconds a case (default: %(default)s)")
    p = commands.add_parser("one", help="answer one case in this process")
    p.add_argument("name", choices=NAMES)
    p.add_argument("case", type=Path)
    p.add_argument("file", type=Path)
    p.add_argument("--limit", type=int, default=LIMIT)
    p = commands.add_parser("check", help="say whether an answer can be read")
    p.add_argument("case", type=Path)
    p.add_argument("file", type=Path)
    p = commands.add_parser("judge", help="set answers against the truth")
    p.add_argument("cases", type=Path)
    p.add_argument("answers", type=Path, nargs="+", help="a folder for each program, which it is named by")
    p.add_argument("--oracle", type=Path, help="JSON file: nats of the truth by case")
    p.add_argument("--page", type=Path, help="Markdown file for the tables; its picture stands beside it")
    p = commands.add_parser("tune", help="say which temperature, penalty and doubt of methods score best")
    p.add_argument("cases", type=Path, help="cases whose truth is open")
    p.add_argument("answers", type=Path, nargs="+", help="a folder for each method")
    p = commands.add_parser("oracle", help="say how far data show their effects, by fits from the truth")
    p.add_argument("cases", type=Path, help="cases whose truth is open")
    p.add_argument("file", type=Path, help="JSON file: nats by case; a run that was stopped goes on")
    for name, says in (
        ("seal", "move the truth away and leave seals"),
        ("reveal", "bring sealed truth back"),
    ):
        p = commands.add_parser(name, help=says)
        p.add_argument("cases", type=Path)
        p.add_argument("kept", type=Path, help="the keeper's folder, with truth and salt")
    options = parser.parse_args(argv)
    try:
        return _run(options)
    except CaseError as reason:
        sys.stderr.write(f"{reason}\n")
        return 2


def _run(options):
    match options.command:
        case "take":
            told = take(options.generated, options.out, options.first)
            sys.stdout.write(f"{len(told)} cases in {options.out}\n")
        case "solve":
            for name in options.names:
                solve_all(name, options.cases, options.answers, options.limit)
        case "one":
            before = resource.getrlimit(resource.RLIMIT_CPU)
            most = int(time.process_time()) + options.limit + GRACE
            resource.setrlimit(resource.RLIMIT_CPU, (most, before[1]))
            try:
                _write(options.file, answered(options.name, options.case, options.limit))
            finally:
                resource.setrlimit(resource.RLIMIT_CPU, before)
        case "check":
            answer = read_answer(options.file, read_structure(options.case))
            sys.stdout.write(
                f"{len(answer.explanations)} explanations, {100 * answer.unknown:.3g} % not stated\n"
            )
        case "judge":
            truths = json.loads((options.cases / TRUTH).read_text(encoding="utf-8"))
            oracle = json.loads(options.oracle.read_text(encoding="utf-8")) if options.oracle else {}
            by_program, missing = judged(options.cases, options.answers, truths, oracle)
            text = judging.report(by_program, missing)
            sys.stdout.write(text)
            if options.page:
                picture = options.page.with_suffix(".png")
                judging.draw(by_program, picture)
                options.page.write_text(
                    f"{text}\n![Log scores and outcomes]({picture.name})\n", encoding="utf-8"
                )
        case "tune":
            truths = json.loads((options.cases / TRUTH).read_text(encoding="utf-8"))
            structures = {case: read_structure(options.cases / case) for case in truths}
            for folder in options.answers:
                files = sorted(folder.glob("*.json"))
                answers = [read_answer(file, structures[file.stem]) for file in files]
                score, ratio, penalty, unknown = tuned(answers, truths, structures)
                sys.stdout.write(
                    f"{folder.name}, {len(answers)} cases: {score:.2f} nats with {ratio:g} times the "
                    f'temperature, {penalty:g} nats an effect and {unknown:g} for "do not know"\n'
                )
        case "oracle":
            _ask_oracle(options.cases, options.file)
        case "seal":
            sys.stdout.write(f"{len(seal(options.cases, options.kept))} truths are sealed\n")
        case "reveal":
            reveal(options.cases, options.kept)
            sys.stdout.write("every truth is what was sealed\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
