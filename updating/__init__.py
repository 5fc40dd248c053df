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
    from updating.ambient.ambient_modes import AmbientModes as AmbientModes
    from updating.ambient.identification import identify_ambient as identify_ambient
    from updating.ambient.record import AmbientError as AmbientError
    from updating.ambient.set_ups import MergedModes as MergedModes
    from updating.ambient.set_ups import merge_set_ups as merge_set_ups
    from updating.correlation import Comparison as Comparison
    from updating.correlation import ModeComparison as ModeComparison
    from updating.correlation import compare as compare
    from updating.correlation import compare_modes as compare_modes
    from updating.correlation import frac as frac
    from updating.correlation import mac as mac
    from updating.correlation.complexity import mean_phase as mean_phase
    from updating.correlation.complexity import mean_phase_deviation as mean_phase_deviation
    from updating.correlation.complexity import modal_complexity_factor as modal_complexity_factor
    from updating.correlation.complexity import modal_phase_collinearity as modal_phase_collinearity
    from updating.correlation.complexity import real_shapes as real_shapes
    from updating.correlation.frf_correlation import BandError as BandError
    from updating.correlation.frf_correlation import band_error as band_error
    from updating.correlation.frf_correlation import cross_signature_assurance as cross_signature_assurance
    from updating.correlation.frf_correlation import cross_signature_scale as cross_signature_scale
    from updating.correlation.frf_correlation import fdac as fdac
    from updating.correlation.frf_correlation import signature_assurance as signature_assurance
    from updating.correlation.pairing import ModePair as ModePair
    from updating.correlation.pairing import pair_modes as pair_modes
    from updating.correlation.pairing import track_modes as track_modes
    from updating.correlation.shape_correlation import auto_mac as auto_mac
    from updating.correlation.shape_correlation import comac as comac
    from updating.correlation.shape_correlation import cross_orthogonality as cross_orthogonality
    from updating.correlation.shape_correlation import ecomac as ecomac
    from updating.correlation.shape_correlation import eliminate_coordinates as eliminate_coordinates
    from updating.correlation.shape_correlation import mac_without as mac_without
    from updating.correlation.shape_correlation import modal_scale_factor as modal_scale_factor
    from updating.correlation.shape_correlation import orthogonality as orthogonality
    from updating.correlation.shape_correlation import principal_angles as principal_angles
    from updating.correlation.shape_correlation import subspace_mac as subspace_mac
    from updating.diagnosis.candidates import propose as propose
    from updating.diagnosis.diagnose import diagnose as diagnose
    from updating.diagnosis.diagnose_modes import diagnose_modes as diagnose_modes
    from updating.diagnosis.diagnosis import Diagnosis as Diagnosis
    from updating.diagnosis.findings import EffectParameter as EffectParameter
    from updating.diagnosis.findings import Finding as Finding
    from updating.diagnosis.findings import Ranked as Ranked
    from updating.diagnosis.findings import Step as Step
    from updating.diagnosis.localisation import Localisation as Localisation
    from updating.diagnosis.localisation import locate as locate
    from updating.diagnosis.mode_diagnosis import ModeDiagnosis as ModeDiagnosis
    from updating.diagnosis.verdict import EFFECT as EFFECT
    from updating.diagnosis.verdict import FAULT as FAULT
    from updating.diagnosis.verdict import NOTHING as NOTHING
    from updating.diagnosis.verdict import UNEXPLAINED as UNEXPLAINED
    from updating.inference.arrays import frf_data as frf_data
    from updating.inference.arrays import mode_data as mode_data
    from updating.inference.bootstrap import BootstrapModel as BootstrapModel
    from updating.inference.bootstrap import refit as refit
    from updating.inference.fit import FitProblem as FitProblem
    from updating.inference.fit_result import FitResult as FitResult
    from updating.inference.fitting import assessed_fit as assessed_fit
    from updating.inference.mode_preparation import build_mode_problem as build_mode_problem
    from updating.inference.mode_targets import ModeTargets as ModeTargets
    from updating.inference.parameters import DampingCurve as DampingCurve
    from updating.inference.parameters import Nuisance as Nuisance
    from updating.inference.preparation import build_problem as build_problem
    from updating.inference.regularisation import GeneralisedSVD as GeneralisedSVD
    from updating.inference.regularisation import LCurve as LCurve
    from updating.inference.regularisation import gsvd as gsvd
    from updating.inference.regularisation import l_curve as l_curve
    from updating.inference.regularisation import select_by_pivoting as select_by_pivoting
    from updating.inference.regularisation import select_forward as select_forward
    from updating.inference.regularisation import tikhonov as tikhonov
    from updating.inference.sampling import MissingExtraError as MissingExtraError
    from updating.inference.sampling import Samples as Samples
    from updating.inference.unknowns import Unknown as Unknown
    from updating.inference.update import update as update
    from updating.inference.update_settings import UpdateSettings as UpdateSettings
    from updating.inference.updated import Ending as Ending
    from updating.inference.updated import Updated as Updated
    from updating.inference.updated import UpdatedParameter as UpdatedParameter
    from updating.inference.updated import UpdateStep as UpdateStep
    from updating.measurement.base_motion import BaseMotion as BaseMotion
    from updating.measurement.channel_errors import ChannelErrors as ChannelErrors
    from updating.measurement.computed import computed_frf as computed_frf
    from updating.measurement.frf_estimation import EstimatedFRF as EstimatedFRF
    from updating.measurement.frf_estimation import EstimationError as EstimationError
    from updating.measurement.frf_estimation import estimate_frf as estimate_frf
    from updating.measurement.frf_estimation import estimate_roving as estimate_roving
    from updating.measurement.frf_estimation import level_at_end as level_at_end
    from updating.measurement.frf_estimation import split_hits as split_hits
    from updating.measurement.matching import GeometryMatch as GeometryMatch
    from updating.measurement.matching import GeometryMatchError as GeometryMatchError
    from updating.measurement.matching import align_points as align_points
    from updating.measurement.matching import match_geometry as match_geometry
    from updating.measurement.matching import match_members as match_members
    from updating.measurement.measurement import Measurement as Measurement
    from updating.measurement.measurement import MeasurementError as MeasurementError
    from updating.measurement.measurement import Sensor as Sensor
    from updating.measurement.measurement import place_sensors as place_sensors
    from updating.measurement.measurement import sensor_rows as sensor_rows
    from updating.measurement.measurement import with_moving_base as with_moving_base
    from updating.measurement.measurement import with_sensor_masses as with_sensor_masses
    from updating.measurement.noise import noise_from_coherence as noise_from_coherence
    from updating.measurement.noise import noise_from_repeats as noise_from_repeats
    from updating.measurement.noise import relative_noise as relative_noise
    from updating.measurement.pretest import Observability as Observability
    from updating.measurement.pretest import PretestPlan as PretestPlan
    from updating.measurement.pretest import assess_sensors as assess_sensors
    from updating.measurement.pretest import plan_pretest as plan_pretest
    from updating.measurement.recorded_channels import RecordedChannels as RecordedChannels
    from updating.measurement.recorded_channels import recorded_channels as recorded_channels
    from updating.measurement.reference_sensor import UnmeasuredForce as UnmeasuredForce
    from updating.measurement.strain_gauge import StrainGauge as StrainGauge
    from updating.measurement.tables import frf_from_labelled as frf_from_labelled
    from updating.measurement.tables import labelled_from_frf as labelled_from_frf
    from updating.measurement.tables import labelled_from_modes as labelled_from_modes
    from updating.measurement.tables import modes_from_labelled as modes_from_labelled
    from updating.measurement.tables import sensors_from_table as sensors_from_table
    from updating.measurement.tables import table_from_sensors as table_from_sensors
    from updating.modal.damping import damping_matrix as damping_matrix
    from updating.modal.identification import identify_modes as identify_modes
    from updating.modal.identified_modes import IdentifiedModes as IdentifiedModes
    from updating.modal.peaks import Candidate as Candidate
    from updating.modal.peaks import mode_indicator as mode_indicator
    from updating.modal.peaks import unexplained_peaks as unexplained_peaks
    from updating.modal.poles import IdentificationError as IdentificationError
    from updating.modal.poles import Stabilisation as Stabilisation
    from updating.plan.plan import Outlook as Outlook
    from updating.plan.plan import Plan as Plan
    from updating.plan.plan import plan_test as plan_test
    from updating.quality.corrections import Fault as Fault
    from updating.quality.faults import confirm_faults as confirm_faults
    from updating.quality.faults import find_faults as find_faults
    from updating.quality.faults import settle_faults as settle_faults
    from updating.quality.gates import Check as Check
    from updating.quality.gates import Gates as Gates
    from updating.quality.gates import Homogeneity as Homogeneity
    from updating.quality.gates import Reciprocity as Reciprocity
    from updating.quality.gates import check_gates as check_gates
else:
    __getattr__, __dir__ = names_on_use(__name__)
