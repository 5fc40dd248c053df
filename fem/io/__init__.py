"""Files: universal files, arrays, meshes, decks; nothing here imports meshio before it reads.

All readers refuse what they cannot read with a MeshError (meshes and decks), TableError, UffError or
MatricesError, each a ValueError, whose message has the file, its line, and what is allowed there.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from fem.io.abaqus import read_node_sets as read_node_sets
    from fem.io.abaqus_write import abaqus_text as abaqus_text
    from fem.io.ansys_write import ansys_text as ansys_text
    from fem.io.arrays import TableError as TableError
    from fem.io.arrays import read_npz as read_npz
    from fem.io.arrays import read_npz_mode_std as read_npz_mode_std
    from fem.io.arrays import read_npz_modes as read_npz_modes
    from fem.io.arrays import write_csv as write_csv
    from fem.io.arrays import write_npz as write_npz
    from fem.io.atomic import WriteError as WriteError
    from fem.io.column_frf import read_csv as read_csv
    from fem.io.deck_units import DeckUnits as DeckUnits
    from fem.io.fields import line_axial_force as line_axial_force
    from fem.io.fields import line_strain_energy as line_strain_energy
    from fem.io.fields import write_fields as write_fields
    from fem.io.fields import write_modes as write_modes
    from fem.io.frame_deck import BarProperty as BarProperty
    from fem.io.frame_deck import Bars as Bars
    from fem.io.frame_deck import Body as Body
    from fem.io.frame_deck import Connection as Connection
    from fem.io.frame_deck import Equation as Equation
    from fem.io.frame_deck import FrameDeck as FrameDeck
    from fem.io.frame_deck import Link as Link
    from fem.io.frame_model import model_of as model_of
    from fem.io.frame_model import read_deck as read_deck
    from fem.io.frame_model import read_model as read_model
    from fem.io.frame_of_model import ModelDeck as ModelDeck
    from fem.io.frame_of_model import deck_of as deck_of
    from fem.io.frf_files import UFF_SUFFIXES as UFF_SUFFIXES
    from fem.io.frf_files import read_frf as read_frf
    from fem.io.frf_files import read_frfs as read_frfs
    from fem.io.frf_files import read_modes as read_modes
    from fem.io.frf_reading import Asked as Asked
    from fem.io.matrices import matrices_of as matrices_of
    from fem.io.matrices import read_calculix as read_calculix
    from fem.io.matrices import read_matrices as read_matrices
    from fem.io.matrices import write_matrices as write_matrices
    from fem.io.meshfile import read_mesh as read_mesh
    from fem.io.meshfile import write_mesh as write_mesh
    from fem.io.meshio_mesh import read_part_faces as read_part_faces
    from fem.io.nastran_write import nastran_text as nastran_text
    from fem.io.time_data import read_time_data as read_time_data
    from fem.io.uff import UffFile as UffFile
    from fem.io.uff import read_uff as read_uff
    from fem.io.uff_format import UffError as UffError
    from fem.io.uff_format import label_of as label_of
    from fem.io.uff_format import parse_label as parse_label
    from fem.io.uff_types import Function as Function
    from fem.io.uff_types import Points as Points
    from fem.io.uff_write import write_uff as write_uff
    from fem.io.units import G0 as G0
    from fem.matrices import Matrices as Matrices
    from fem.matrices import MatricesError as MatricesError
else:
    __getattr__, __dir__ = names_on_use(__name__)
