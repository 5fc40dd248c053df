"""Files: universal files, arrays, meshes, decks; nothing here imports meshio before it reads.

All readers refuse what they cannot read with a MeshError (meshes and decks), TableError, UffError or
MatricesError, each a ValueError, whose message has the file, its line, and what is allowed there.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from fem.io.abaqus import read_node_sets
    from fem.io.abaqus_write import abaqus_text
    from fem.io.ansys_write import ansys_text
    from fem.io.arrays import TableError, read_npz, read_npz_mode_std, read_npz_modes, write_csv, write_npz
    from fem.io.atomic import WriteError
    from fem.io.column_frf import read_csv
    from fem.io.deck_units import DeckUnits
    from fem.io.fields import line_axial_force, line_strain_energy, write_fields, write_modes
    from fem.io.frame_deck import BarProperty, Bars, Body, Connection, Equation, FrameDeck, Link
    from fem.io.frame_model import model_of, read_deck, read_model
    from fem.io.frame_of_model import ModelDeck, deck_of
    from fem.io.frf_files import read_frfs
    from fem.io.frf_reading import Asked
    from fem.io.matrices import matrices_of, read_calculix, read_matrices, write_matrices
    from fem.io.meshfile import read_mesh, write_mesh
    from fem.io.nastran_write import nastran_text
    from fem.io.part_mesh import read_part_faces
    from fem.io.reading import UFF_SUFFIXES, read_frf, read_modes
    from fem.io.time_data import read_time_data
    from fem.io.uff import UffFile, read_uff
    from fem.io.uff_format import UffError, label_of, parse_label
    from fem.io.uff_types import Function, Points
    from fem.io.uff_write import write_uff
    from fem.io.units import G0
    from fem.matrices import Matrices, MatricesError
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "G0",
    "UFF_SUFFIXES",
    "Asked",
    "BarProperty",
    "Bars",
    "Body",
    "Connection",
    "DeckUnits",
    "Equation",
    "FrameDeck",
    "Function",
    "Link",
    "Matrices",
    "MatricesError",
    "ModelDeck",
    "Points",
    "TableError",
    "UffError",
    "UffFile",
    "WriteError",
    "abaqus_text",
    "ansys_text",
    "deck_of",
    "label_of",
    "line_axial_force",
    "line_strain_energy",
    "matrices_of",
    "model_of",
    "nastran_text",
    "parse_label",
    "read_calculix",
    "read_csv",
    "read_deck",
    "read_frf",
    "read_frfs",
    "read_matrices",
    "read_mesh",
    "read_model",
    "read_modes",
    "read_node_sets",
    "read_npz",
    "read_npz_mode_std",
    "read_npz_modes",
    "read_part_faces",
    "read_time_data",
    "read_uff",
    "write_csv",
    "write_fields",
    "write_matrices",
    "write_mesh",
    "write_modes",
    "write_npz",
    "write_uff",
]
