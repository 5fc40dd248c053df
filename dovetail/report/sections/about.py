"""The facts of the run."""

from dovetail.file.contents import StudyContents
from dovetail.file.geometry import describe_sizes
from dovetail.report.blocks import Facts, ReportSection
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_any, by_frfs, by_modes_alone, program_version
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the facts of the run."""
    d = result.diagnosis
    facts = [
        ("study file", result.study.path.name)
        if result.study.text
        else ("study", f"{result.study.name}, a model built in Python"),
        ("program", _program()),
        ("date", result.finished.strftime("%Y-%m-%d %H:%M %Z")),
        ("duration", f"{result.seconds:.0f} s, of which the diagnosis took {d.seconds:.0f} s"),
        _mesh(result.study),
    ]
    files = f"result.json (for programs), {'found.toml, ' * bool(result.study.text)}pictures/"
    if by_frfs(d):
        facts += [
            ("error of the mesh", f"{d.discretisation_db:.2g} dB, estimated by halving every element"),
            (
                "error of the reduced basis",
                f"{d.basis_db:.2g} dB, against direct solutions of the full model",
            ),
        ]
        files += ", frf.npz (measured and computed FRFs of each step)"
    if by_modes_alone(d):
        level = d.calibration[0].mesh_level
        facts.append(("error of the mesh", f"{100 * level:.2g} % of natural frequencies"))
    return ReportSection("About this run", [Facts([*facts, ("files next to this one", files)])])


def _program() -> str:
    version = program_version()
    return "Dovetail, not installed" if version == "unknown" else f"Dovetail {version}"


def _mesh(study: StudyContents) -> tuple[str, str]:
    mesh = study.model.mesh
    if not mesh.n_lines:
        return "mesh", f"no members; {study.model.n_dof} degrees of freedom before constraints"
    size = f"{mesh.n_lines} elements of {describe_sizes(mesh.lengths())}"
    return "mesh", f"{size}, {study.model.n_dof} degrees of freedom before constraints"
