"""Models with fewer coordinates: condensation, expansion, and the fast reduced model."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from fem.reduction.condensation import (
        Reduction,
        reduce_craig_bampton,
        reduce_dynamic,
        reduce_guyan,
        reduce_irs,
        reduce_serep,
    )
    from fem.reduction.expansion import (
        Expansion,
        expand_dynamic,
        expand_hybrid,
        expand_serep,
        expand_smooth,
        expand_static,
    )
    from fem.reduction.local_changes import LocalChanges
    from fem.reduction.parametric_frf import ParametricFRF
    from fem.reduction.reduced_model import ReducedModel, reduce_model, values_of
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "Expansion",
    "LocalChanges",
    "ParametricFRF",
    "ReducedModel",
    "Reduction",
    "expand_dynamic",
    "expand_hybrid",
    "expand_serep",
    "expand_smooth",
    "expand_static",
    "reduce_craig_bampton",
    "reduce_dynamic",
    "reduce_guyan",
    "reduce_irs",
    "reduce_model",
    "reduce_serep",
    "values_of",
]
