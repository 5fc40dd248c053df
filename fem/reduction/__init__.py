"""Models with fewer coordinates: condensation, expansion, and the fast reduced model."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from fem.reduction.condensation import Reduction as Reduction
    from fem.reduction.condensation import reduce_craig_bampton as reduce_craig_bampton
    from fem.reduction.condensation import reduce_dynamic as reduce_dynamic
    from fem.reduction.condensation import reduce_guyan as reduce_guyan
    from fem.reduction.condensation import reduce_irs as reduce_irs
    from fem.reduction.condensation import reduce_serep as reduce_serep
    from fem.reduction.expansion import Expansion as Expansion
    from fem.reduction.expansion import expand_dynamic as expand_dynamic
    from fem.reduction.expansion import expand_hybrid as expand_hybrid
    from fem.reduction.expansion import expand_serep as expand_serep
    from fem.reduction.expansion import expand_smooth as expand_smooth
    from fem.reduction.expansion import expand_static as expand_static
    from fem.reduction.local_changes import LocalChanges as LocalChanges
    from fem.reduction.parametric_frf import ParametricFRF as ParametricFRF
    from fem.reduction.reduced_model import ReducedModel as ReducedModel
    from fem.reduction.reduced_model import reduce_model as reduce_model
    from fem.reduction.reduced_model import values_of as values_of
else:
    __getattr__, __dir__ = names_on_use(__name__)
