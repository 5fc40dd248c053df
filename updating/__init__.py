"""From time data to an updated model: estimate, identify, compare, update, and find missing effects.

    time data ─ estimate_frf → EstimatedFRF ─ identify_modes → IdentifiedModes
    responses alone ─ identify_ambient → AmbientModes, … ─ merge_set_ups → MergedModes
    Measurement, Model ─ compare → Comparison
                       ─ update → Updated: the model, values with uncertainty, the path there
                       ─ build_problem → FitProblem ─ locate → Localisation
                       ─ diagnose → Diagnosis: verdict, findings with their twins, faults, the updated model
    ModeTargets, Model ─ build_mode_problem, diagnose_modes → ModeDiagnosis
    before a test      ─ plan_pretest → PretestPlan;  plan_test → Plan
    after it           ─ match_geometry → GeometryMatch

Correlation works on bare arrays: `mac`, `comac`, `ecomac`, `orthogonality`, `pair_modes`, `frac`, `fdac`,
`band_error` and others. `docs/how-dovetail-judges.md` explains a diagnosis and when not to believe it, and
`docs/mathematics.md` has its equations; the other steps have pages of their own beside them.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.ambient.ambient_modes import AmbientModes
    from updating.ambient.identification import identify_ambient
    from updating.ambient.record import AmbientError
    from updating.ambient.set_ups import MergedModes, merge_set_ups
    from updating.correlation import Comparison, ModeComparison, compare, compare_modes, frac, mac
    from updating.correlation.complexity import (
        mean_phase,
        mean_phase_deviation,
        modal_complexity_factor,
        modal_phase_collinearity,
        real_shapes,
    )
    from updating.correlation.frf_correlation import (
        BandError,
        band_error,
        cross_signature_assurance,
        cross_signature_scale,
        fdac,
        signature_assurance,
    )
    from updating.correlation.pairing import ModePair, pair_modes, track_modes
    from updating.correlation.shape_correlation import (
        auto_mac,
        comac,
        cross_orthogonality,
        ecomac,
        eliminate_coordinates,
        mac_without,
        modal_scale_factor,
        orthogonality,
        principal_angles,
        subspace_mac,
    )
    from updating.diagnosis.candidates import propose
    from updating.diagnosis.diagnose import diagnose
    from updating.diagnosis.diagnose_modes import diagnose_modes
    from updating.diagnosis.diagnosis import Diagnosis
    from updating.diagnosis.findings import EffectParameter, Finding, Ranked, Step
    from updating.diagnosis.localisation import Localisation, locate
    from updating.diagnosis.mode_diagnosis import ModeDiagnosis
    from updating.diagnosis.verdict import EFFECT, FAULT, NOTHING, UNEXPLAINED
    from updating.inference.arrays import frf_data, mode_data
    from updating.inference.bootstrap import BootstrapModel, refit
    from updating.inference.fit import FitProblem
    from updating.inference.fit_result import FitResult
    from updating.inference.fitting import assessed_fit
    from updating.inference.mode_preparation import build_mode_problem
    from updating.inference.mode_targets import ModeTargets
    from updating.inference.parameters import DampingCurve, Nuisance
    from updating.inference.preparation import build_problem
    from updating.inference.regularisation import (
        GeneralisedSVD,
        LCurve,
        gsvd,
        l_curve,
        select_by_pivoting,
        select_forward,
        tikhonov,
    )
    from updating.inference.sampling import MissingExtraError, Samples
    from updating.inference.unknowns import Unknown
    from updating.inference.update import update
    from updating.inference.update_settings import UpdateSettings
    from updating.inference.updated import Ending, Updated, UpdatedParameter, UpdateStep
    from updating.measurement.base_motion import BaseMotion
    from updating.measurement.channel_errors import ChannelErrors
    from updating.measurement.computed import computed_frf
    from updating.measurement.frf_estimation import (
        EstimatedFRF,
        EstimationError,
        estimate_frf,
        estimate_roving,
        level_at_end,
        split_hits,
    )
    from updating.measurement.matching import (
        GeometryMatch,
        GeometryMatchError,
        align_points,
        match_geometry,
        match_members,
    )
    from updating.measurement.measurement import (
        Measurement,
        MeasurementError,
        Sensor,
        place_sensors,
        sensor_rows,
        with_moving_base,
        with_sensor_masses,
    )
    from updating.measurement.noise import noise_from_coherence, noise_from_repeats, relative_noise
    from updating.measurement.pretest import Observability, PretestPlan, assess_sensors, plan_pretest
    from updating.measurement.recorded_channels import RecordedChannels, recorded_channels
    from updating.measurement.reference_sensor import UnmeasuredForce
    from updating.measurement.strain_gauge import StrainGauge
    from updating.measurement.tables import (
        frf_from_labelled,
        labelled_from_frf,
        labelled_from_modes,
        modes_from_labelled,
        sensors_from_table,
        table_from_sensors,
    )
    from updating.modal.damping import damping_matrix
    from updating.modal.identification import identify_modes
    from updating.modal.identified_modes import IdentifiedModes
    from updating.modal.peaks import Candidate, mode_indicator, unexplained_peaks
    from updating.modal.poles import IdentificationError, Stabilisation
    from updating.plan.plan import Outlook, Plan, plan_test
    from updating.quality.corrections import Fault
    from updating.quality.faults import confirm_faults, find_faults, settle_faults
    from updating.quality.gates import Check, Gates, Homogeneity, Reciprocity, check_gates
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "EFFECT",
    "FAULT",
    "NOTHING",
    "UNEXPLAINED",
    "AmbientError",
    "AmbientModes",
    "BandError",
    "BaseMotion",
    "BootstrapModel",
    "Candidate",
    "ChannelErrors",
    "Check",
    "Comparison",
    "DampingCurve",
    "Diagnosis",
    "EffectParameter",
    "Ending",
    "EstimatedFRF",
    "EstimationError",
    "Fault",
    "Finding",
    "FitProblem",
    "FitResult",
    "Gates",
    "GeneralisedSVD",
    "GeometryMatch",
    "GeometryMatchError",
    "Homogeneity",
    "IdentificationError",
    "IdentifiedModes",
    "LCurve",
    "Localisation",
    "Measurement",
    "MeasurementError",
    "MergedModes",
    "MissingExtraError",
    "ModeComparison",
    "ModeDiagnosis",
    "ModePair",
    "ModeTargets",
    "Nuisance",
    "Observability",
    "Outlook",
    "Plan",
    "PretestPlan",
    "Ranked",
    "Reciprocity",
    "RecordedChannels",
    "Samples",
    "Sensor",
    "Stabilisation",
    "Step",
    "StrainGauge",
    "Unknown",
    "UnmeasuredForce",
    "UpdateSettings",
    "UpdateStep",
    "Updated",
    "UpdatedParameter",
    "align_points",
    "assess_sensors",
    "assessed_fit",
    "auto_mac",
    "band_error",
    "build_mode_problem",
    "build_problem",
    "check_gates",
    "comac",
    "compare",
    "compare_modes",
    "computed_frf",
    "confirm_faults",
    "cross_orthogonality",
    "cross_signature_assurance",
    "cross_signature_scale",
    "damping_matrix",
    "diagnose",
    "diagnose_modes",
    "ecomac",
    "eliminate_coordinates",
    "estimate_frf",
    "estimate_roving",
    "fdac",
    "find_faults",
    "frac",
    "frf_data",
    "frf_from_labelled",
    "gsvd",
    "identify_ambient",
    "identify_modes",
    "l_curve",
    "labelled_from_frf",
    "labelled_from_modes",
    "level_at_end",
    "locate",
    "mac",
    "mac_without",
    "match_geometry",
    "match_members",
    "mean_phase",
    "mean_phase_deviation",
    "merge_set_ups",
    "modal_complexity_factor",
    "modal_phase_collinearity",
    "modal_scale_factor",
    "mode_data",
    "mode_indicator",
    "modes_from_labelled",
    "noise_from_coherence",
    "noise_from_repeats",
    "orthogonality",
    "pair_modes",
    "place_sensors",
    "plan_pretest",
    "plan_test",
    "principal_angles",
    "propose",
    "real_shapes",
    "recorded_channels",
    "refit",
    "relative_noise",
    "select_by_pivoting",
    "select_forward",
    "sensor_rows",
    "sensors_from_table",
    "settle_faults",
    "signature_assurance",
    "split_hits",
    "subspace_mac",
    "table_from_sensors",
    "tikhonov",
    "track_modes",
    "unexplained_peaks",
    "update",
    "with_moving_base",
    "with_sensor_masses",
]
