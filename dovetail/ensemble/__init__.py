"""Monte Carlo of a study's uncertain parameters: bands of natural frequencies and FRFs."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.ensemble.bootstrap import run_bootstrap
    from dovetail.ensemble.quantiles import PROBABILITIES
    from dovetail.ensemble.run import run_ensemble
    from dovetail.ensemble.samples import SampledModel, check, compute
else:
    __getattr__, __dir__ = names_on_use(__name__)
