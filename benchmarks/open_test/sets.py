"""Make cases of the open test of generated ones, seal their truth, and reveal it."""

import hashlib
import json
import secrets
import shutil
import tempfile
from pathlib import Path

from benchmarks.open_test.case import FRFS, MODES, STRUCTURE, CaseError, neutral, nominal_of, write_modes
from benchmarks.open_test.truth import broken_seals, neutral_truth, seal_of

TRUTH, SEALS, SALT, SUMS = "truth.json", "seals.json", "salt.txt", "SHA256SUMS"
SET = "case-{:03d}"
"""What a case is called: nothing of its structure or seed shows."""


def cases_of(folder):
    """Return the names of the cases in a folder.

    Raises
    ------
    CaseError
        If there is none.
    """
    names = sorted(p.parent.name for p in Path(folder).glob(f"*/{STRUCTURE}"))
    if not names:
        msg = f"{folder}: there is no folder with {STRUCTURE}"
        raise CaseError(msg)
    return names


def take(generated, out, first=1):
    """Write generated cases (`benchmarks.independent.foreign`) as cases of the test; return their truths."""
    from benchmarks.independent.convert import convert  # to judge needs no package of Dovetail
    from dovetail import load_study
    from updating import identify_modes

    generated, out = Path(generated), Path(out)
    truths = json.loads((generated / TRUTH).read_text(encoding="utf-8"))
    told = {}
    for k, (name, truth) in enumerate(sorted(truths.items()), first):
        case, source = SET.format(k), generated / name
        target = out / case
        target.mkdir(parents=True, exist_ok=True)
        nominal = json.loads((source / "nominal.json").read_text(encoding="utf-8")) | {"case": case}
        structure = neutral(nominal)
        (target / STRUCTURE).write_text(json.dumps(structure, indent=1, ensure_ascii=False), encoding="utf-8")
        shutil.copyfile(source / "frf.uff", target / FRFS)
        with tempfile.TemporaryDirectory() as folder:
            study = Path(folder) / "study.toml"
            study.write_text(convert(nominal_of(structure), target, study), encoding="utf-8")
            (measured,) = load_study(study).measurements
        write_modes(target / MODES, identify_modes(measured.frf).modes, measured.frf.outputs)
        told[case] = neutral_truth(truth)
    known = out / TRUTH
    before = json.loads(known.read_text(encoding="utf-8")) if known.exists() else {}
    known.write_text(json.dumps(before | told, indent=1, ensure_ascii=False), encoding="utf-8")
    return told


def seal(folder, kept):
    """Move the truth of a set to a folder of its keeper, with a salt; leave seals and sums of all files.

    Returns
    -------
    dict
        Seals by case.
    """
    folder, kept = Path(folder), Path(kept)
    kept.mkdir(parents=True, exist_ok=True)
    truths = json.loads((folder / TRUTH).read_text(encoding="utf-8"))
    salt = secrets.token_hex(16)
    seals = {case: seal_of(case, truth, salt) for case, truth in truths.items()}
    shutil.move(folder / TRUTH, kept / TRUTH)
    (kept / SALT).write_text(salt, encoding="utf-8")
    (folder / SEALS).write_text(json.dumps(seals, indent=1), encoding="utf-8")
    files = [Path(case) / file for case in seals for file in (STRUCTURE, FRFS, MODES)]
    sums = (
        f"{hashlib.sha256((folder / file).read_bytes()).hexdigest()}  {file.as_posix()}" for file in files
    )
    (folder / SUMS).write_text("\n".join(sums) + "\n", encoding="utf-8")
    return seals


def reveal(folder, kept):
    """Copy the truth of a sealed set back beside its cases, if it is what was sealed.

    Raises
    ------
    CaseError
        If the truth of a case is not what was sealed.
    """
    folder, kept = Path(folder), Path(kept)
    truths = json.loads((kept / TRUTH).read_text(encoding="utf-8"))
    seals = json.loads((folder / SEALS).read_text(encoding="utf-8"))
    if broken := broken_seals(truths, seals, (kept / SALT).read_text(encoding="utf-8").strip()):
        msg = f"{kept / TRUTH}: this is not what was sealed of {', '.join(broken)}"
        raise CaseError(msg)
    shutil.copyfile(kept / TRUTH, folder / TRUTH)
