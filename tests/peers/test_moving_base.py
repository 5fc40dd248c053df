"""OpenSees shakes a cantilever by a uniform excitation; its steady motion has Dovetail's transmissibility.

Masses are at nodes: OpenSees 3.7 counts those of elements twice in such loads.
"""

import json
import subprocess

import numpy as np
import pytest

from benchmarks.peers.exchange import PEERS_PYTHON
from fem import Damping, assemble, compute_frf
from tests.frames import STEEL, beam, fix
from updating import BaseMotion, Sensor, sensor_rows, with_moving_base

pytestmark = pytest.mark.peer

N, LENGTH, B, H = 10, 1.0, 0.03, 0.01
ALPHA, BETA = 20.0, 2e-5  # decays by exp(-15) in the shorter record
STEPS, CYCLES = 200, 60
SCRIPT = """
import json, sys
import numpy as np
import openseespy.opensees as ops
n, length, b, h, E, rho, alpha, beta, steps, cycles, f = json.load(sys.stdin)
ops.wipe()
ops.model("basic", "-ndm", 2, "-ndf", 3)
for k in range(n + 1):
    ops.node(k, k * length / n, 0.0)
    part = length / n * rho * (1 if 0 < k < n else 0.5)
    ops.mass(k, part * b * h, part * b * h, 0.0)
ops.fix(0, 1, 1, 1)
ops.geomTransf("Linear", 1)
for k in range(n):
    bending = E, b * h**3 / 12
    ops.element("elasticBeamColumn", k + 1, k, k + 1, b * h, *bending, 1)
ops.rayleigh(alpha, beta, 0.0, 0.0)
dt = 1 / (f * steps)
t = np.arange(steps * cycles + 1) * dt
ops.timeSeries("Path", 1, "-dt", dt, "-values", *np.sin(2 * np.pi * f * t).tolist())
ops.pattern("UniformExcitation", 1, 2, "-accel", 1)
ops.constraints("Plain")
ops.numberer("RCM")
ops.system("BandGeneral")
ops.test("NormDispIncr", 1e-12, 10)
ops.algorithm("Linear")
ops.integrator("Newmark", 0.5, 0.25)
ops.analysis("Transient")
u = []
for _ in range(steps * cycles):
    ops.analyze(1, dt)
    u.append((ops.nodeDisp(n, 2), ops.nodeDisp(n // 2, 2)))
u = np.array(u)[-steps:]
late = t[-steps:]
turn = np.exp(-2j * np.pi * f * late)
amplitude = 2 / steps * (u * turn[:, None]).sum(axis=0) / (-1j)
json.dump([[a.real, a.imag] for a in amplitude], sys.stdout)
"""


@pytest.mark.parametrize("f", [14.0, 40.0])
def test_relative_motion_on_a_shaking_base_is_that_of_opensees(f):
    model = beam(N, LENGTH, effects=(fix(0),), theory="euler-bernoulli", mass="lumped")
    model = model.with_damping(Damping.rayleigh(ALPHA, BETA))
    given = [N, LENGTH, B, H, STEEL.E, STEEL.rho, ALPHA, BETA, STEPS, CYCLES, f]
    out = subprocess.run(
        [PEERS_PYTHON, "-c", SCRIPT], input=json.dumps(given), capture_output=True, text=True, check=True
    )
    found = np.array(json.loads(out.stdout)) @ [1, 1j]
    up = np.array([0.0, 0.0, 1.0])
    sensors = [Sensor(str(x), np.array([x, 0.0, 0.0]), up, relative=True) for x in (LENGTH, LENGTH / 2)]
    bases = [BaseMotion("base", model.mesh.points[0], up)]
    moved = with_moving_base(model, bases)
    rows = (sensor_rows(moved, part) for part in (sensors, bases))
    # The average acceleration is the bilinear transform: steps see (STEPS f / π) tan(π / STEPS).
    seen = STEPS * f / np.pi * np.tan(np.pi / STEPS)
    expected = compute_frf(assemble(moved), [seen], *rows, "receptance", method="direct").H[0, :, 0]
    # the record begins at rest: exp(-15) of the first transient is left, and rounding of one part in 1e6
    assert found == pytest.approx(expected, rel=1e-5)
