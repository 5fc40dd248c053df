"""How alike shapes and FRFs are: everything that compares measured with computed data, in one place.

Shapes: `updating.correlation.shape_correlation`; FRFs: `updating.correlation.frf_correlation`; which mode is
which: `updating.correlation.pairing`. All take bare arrays.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.correlation.frf_correlation import (
        DB_PER_NEPER,
        BandError,
        Comparison,
        band_error,
        cmif,
        compare,
        complex_log,
        cross_signature_assurance,
        cross_signature_scale,
        fdac,
        frac,
        log_ratio,
        rms_db,
        signature_assurance,
    )
    from updating.correlation.pairing import ModeComparison, ModePair, compare_modes, pair_modes
    from updating.correlation.shape_correlation import (
        CoordinateElimination,
        auto_mac,
        comac,
        cross_orthogonality,
        ecomac,
        eliminate_coordinates,
        mac,
        mac_without,
        modal_scale_factor,
        orthogonality,
        principal_angles,
        subspace_mac,
    )
else:
    __getattr__, __dir__ = names_on_use(__name__)
