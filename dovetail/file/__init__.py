"""The study file: reading it, and writing it with other values."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.file.config import NEEDS, read_study
    from dovetail.file.contents import has_modes_alone, without_held_out
    from dovetail.file.effects import effect_table
    from dovetail.file.faults import fault_table
    from dovetail.file.geometry import element_size, refine
    from dovetail.file.histories import read_columns
    from dovetail.file.lines import key_lines
    from dovetail.file.measured import pieces_of
    from dovetail.file.measured_modes import MeasuredModes
    from dovetail.file.mode_table import read_mode_table
    from dovetail.file.named_points import read_named_points
    from dovetail.file.paths import input_files, with_paths
    from dovetail.file.plausible import naming_implausible
    from dovetail.file.rotation import at_speed
    from dovetail.file.section_table import rolled, section_rows
    from dovetail.file.suspicions import LazyComparison
    from dovetail.file.template import write_template
    from dovetail.file.toml import toml_value
    from dovetail.file.writing import with_damping, with_effects, with_parameters
else:
    __getattr__, __dir__ = names_on_use(__name__)
