"""What members are made of: materials and cross-sections."""

from fem.materials import Material, PropertyError
from fem.sections.shapes import Section

__all__ = ["Material", "PropertyError", "Section"]
