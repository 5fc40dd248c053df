"""Contract of all kinds of channels: their rows, and FRFs that are computed, written and read again."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem import assemble, compute_frf, solve_modes
from fem.effects import SprungMass
from fem.io import read_frf, write_npz
from tests.frames import beam, fix
from updating import (
    BaseMotion,
    Measurement,
    MeasurementError,
    Sensor,
    StrainGauge,
    UnmeasuredForce,
    computed_frf,
    place_sensors,
    sensor_rows,
    with_moving_base,
)
from updating.measurement import MOTION, Combination, motions_of, shapes_like_motions
from updating.quality import driven_points, phase_evidence

X, Z = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
TIP, MIDDLE = np.array([1.0, 0, 0]), np.array([0.37, 0, 0])
CHANNELS = {
    "accelerometer": Sensor("a", MIDDLE, Z),
    "relative": Sensor("r", MIDDLE, Z, relative=True),
    "on a body": Sensor("b", TIP, Z, body="rider"),
    "combination": Combination("c", np.zeros(3), np.zeros(3), factors=np.arange(1.0, 13.0)),
    "strain gauge": StrainGauge("g", MIDDLE, X, "beam", offset=(0.0, 0.005)),
}
FORCES = {
    "force": Sensor("f", TIP, Z),
    "base": BaseMotion("base", np.zeros(3), Z),
    "unmeasured": UnmeasuredForce("u", TIP, Z, reference=Sensor("n", MIDDLE, Z)),
}
PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")
PER_FORCE = [f for f in FORCES.values() if f.reference_sensor() is None]


def every_kind(kind=Sensor):
    kinds = {kind}.union(*(every_kind(k) for k in kind.__subclasses__()))
    # a dataclass with slots is a copy of a class that may linger
    return {k for k in kinds if getattr(sys.modules[k.__module__], k.__name__, None) is k}


def model():
    rider = SprungMass(name="rider", point=1, mass=0.1, k={"z": 1e4})
    bare = beam(6, effects=(fix(0), rider))
    mesh = place_sensors(bare.mesh, tuple(CHANNELS.values()))
    return with_moving_base(type(bare)(mesh, bare.effects), tuple(FORCES.values()))


def test_every_kind_of_channel_is_walked():
    assert every_kind() == {type(c) for c in (*CHANNELS.values(), *FORCES.values())}


@pytest.mark.parametrize("kind", [BaseMotion, UnmeasuredForce, StrainGauge])
def test_a_kind_of_channel_is_named_where_studies_are_read_alone(kind):
    """All else asks what a channel says of itself."""
    root, own = Path(__file__).parents[2], Path(*kind.__module__.split(".")).with_suffix(".py")
    files = (p.relative_to(root) for part in PACKAGES for p in (root / part).rglob("*.py"))
    name = re.compile(rf"(?<!`){kind.__name__}\b")
    naming = {str(p) for p in files if name.search((root / p).read_text(encoding="utf-8"))}
    assert naming - {str(own)} <= {"updating/__init__.py", "dovetail/file/sensors.py"}


@pytest.mark.parametrize("channel", [*CHANNELS.values(), *FORCES.values()], ids=[*CHANNELS, *FORCES])
def test_a_row_has_the_size_of_the_model_and_scales_with_the_gain(channel):
    row = channel.row(model())
    assert row.shape == (model().n_dof,)
    assert np.isfinite(row).all()
    assert row.any()
    assert (sensor_rows(model(), [channel])[0] == row).all()
    assert replace(channel, gain=3.0).row(model()) == pytest.approx(3 * row)
    turned = replace(channel, direction=-channel.direction).row(model())
    assert turned == pytest.approx(-row) or isinstance(channel, Combination)


@pytest.mark.parametrize("channel", CHANNELS.values(), ids=CHANNELS)
@pytest.mark.parametrize("kind", ["receptance", "accelerance"])
def test_frfs_are_the_same_after_a_file_and_in_another_kind(tmp_path, channel, kind):
    f = np.linspace(5, 60, 12)
    frf = computed_frf(model(), [channel], tuple(FORCES.values()), f, kind)
    write_npz(tmp_path / "frf.npz", frf)
    again = read_frf(tmp_path / "frf.npz")
    assert (again.H == frf.H).all()  # 0 dB
    assert (again.strain, again.base, again.quantity) == (frf.strain, frf.base, frf.quantity)
    other = computed_frf(model(), [channel], tuple(FORCES.values()), f, "mobility")
    assert pytest.approx(other.H, rel=1e-12) == again.as_kind("mobility").H
    bare = compute_frf(
        assemble(model(), reciprocal=False),
        f,
        sensor_rows(model(), [channel]),
        sensor_rows(model(), PER_FORCE),
        kind,
    ).H
    as_bare = channel.quantity == MOTION or kind == "receptance"
    assert np.allclose(bare, frf.select(inputs=[f.name for f in PER_FORCE]).H) == as_bare


def test_a_rigid_motion_strains_nothing():
    free = beam(6)
    gauge = CHANNELS["strain gauge"]
    mesh = place_sensors(free.mesh, (gauge,))
    row = gauge.row(type(free)(mesh, free.effects))
    for motion, turn in ((np.eye(3), np.zeros((3, 3))), (np.zeros((3, 3)), np.eye(3))):
        for u, r in zip(motion, turn, strict=True):
            moved = np.hstack([u + np.cross(r, mesh.points), np.broadcast_to(r, mesh.points.shape)])
            assert abs(row @ moved.ravel()) < 1e-12 * np.abs(row).max()


def test_gauges_are_no_motions_where_these_are_needed():
    sensors = tuple(CHANNELS.values())
    assert CHANNELS["strain gauge"] not in motions_of(sensors)
    along = (Sensor("f", MIDDLE, X),)
    frf = computed_frf(model(), sensors[-1:], along, np.linspace(5, 60, 64), "accelerance")
    assert driven_points(Measurement(frf, sensors[-1:], along), 0.01) == []


def test_phases_of_strains_are_those_of_receptances():
    """Of accelerances a strain beside them would be a half turn, and of mobilities a quarter turn, off."""
    f = np.arange(2.0, 400.0, 0.5)
    damped = model().with_damping(type(model().damping)(loss_factor=0.02))
    for kind in ("receptance", "mobility", "accelerance"):
        gauge, motion = CHANNELS["strain gauge"], CHANNELS["accelerometer"]
        frf = computed_frf(damped, (gauge, motion), (FORCES["force"],), f, kind)
        assert (phase_evidence(frf).axis == 1).all()


def test_shapes_of_strains_and_motions_get_one_size():
    m, sensors = model(), tuple(CHANNELS.values())[0::4]
    shapes = sensor_rows(m, sensors) @ solve_modes(assemble(m), n=4).shapes
    assert np.abs(shapes[0]).max() > 5 * np.abs(shapes[1]).max()
    scaled, like = shapes_like_motions(shapes, sensors)
    size = np.sqrt((scaled**2).mean(axis=1))
    assert 2**-0.5 <= size[1] / size[0] <= 2**0.5
    assert sensor_rows(m, like) @ solve_modes(assemble(m), n=4).shapes == pytest.approx(scaled)
    assert shapes_like_motions(scaled, like)[1][1].gain == like[1].gain


def test_a_gauge_needs_a_member_of_the_frame():
    bare = model()
    frame = next(e for e in bare.effects if type(e).__name__ == "Frame")
    with pytest.raises(MeasurementError, match="is no member of the model's frame"):
        CHANNELS["strain gauge"].row(bare.without_effect(frame.name))
