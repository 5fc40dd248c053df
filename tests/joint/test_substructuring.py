"""Coupling, decoupling and inverse substructuring by labelled FRFs, against assembled models."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fem import DIRECTIONS, FRF, Damping, Joint, Mesh, Model, assemble, compute_frf
from joint import (
    Regularisation,
    SubstructuringError,
    couple_frf,
    decouple_frf,
    interface_problem,
    invert_substructure,
    l_curve,
)
from tests.frames import FLAT, STEEL, Frame, MemberProperties
from tests.noise import complex_normal

FREQUENCY = np.linspace(20.0, 900.0, 45)
UNITS = ("X", "Y", "Z", "RX", "RY", "RZ")
STIFF = np.diag([2e6, 3e6, 1e6, 300.0, 200.0, 400.0])


def points(x0, y):
    return [[x0, 0, 0], [x0 + 0.3, 0, 0], [x0 + 0.5, y, 0]]


def frame(pieces, effects=()):
    """Return bent frames of two members each, from (first x, y of the end)."""
    xyz, lines, sets = [], [], {}
    for k, (x0, y) in enumerate(pieces):
        base = len(xyz)
        xyz += points(x0, y)
        sets[f"p{k}"] = [len(lines), len(lines) + 1]
        lines += [[base, base + 1], [base + 1, base + 2]]
    mesh = Mesh.from_lines(xyz, lines, sets).refined(0.06)
    properties = MemberProperties(STEEL, FLAT)
    return Model(
        mesh, (Frame(members=dict.fromkeys(mesh.members, properties)), *effects), Damping.structural(0.01)
    )


def frf_of(model, at, prefix):
    dofs = [(p, d) for p in at for d in DIRECTIONS]
    names = [f"{prefix}{p}{u}+" for p in at for u in UNITS]
    H = compute_frf(assemble(model), FREQUENCY, dofs, dofs, "receptance", "direct").H
    return FRF.from_arrays(FREQUENCY, H, "receptance", names, names)


@pytest.fixture(scope="module")
def parts(coincident):
    return coincident[0]


PAIRS = [(f"A2{u}+", f"B0{u}+") for u in UNITS]


@pytest.fixture(scope="module")
def coincident():
    """Return parts and their rigid and elastic assemblies, the interface points in one place."""
    pieces = [(0.0, 0.0), (0.5, -0.2)]
    ends = frf_of(frame(pieces[:1]), (0, 1, 2), "A"), frf_of(frame(pieces[1:]), (0, 1, 2), "B")
    out = []
    for more in ({"rigid": DIRECTIONS}, {"K": STIFF}):
        joint = Joint(name="j", point1=2, point2=3, location=np.array([0.5, 0, 0]), **more)
        out.append(frf_of(frame(pieces, (joint,)), (0, 1, 2, 3, 4, 5), ""))
    return ends, *out


def test_rigid_coupling_is_the_assembled_model(coincident):
    parts, rigid, _ = coincident
    found = couple_frf(parts, PAIRS)
    assert_allclose(found.frf.H, rigid.H, atol=1e-7 * abs(rigid.H).max())
    assert found.frf.outputs == parts[0].outputs + parts[1].outputs
    assert found.gap.max() < 1e-8
    assert (found.condition >= 1).all()


def test_flexible_coupling_is_the_assembled_model(coincident):
    """The model's structural loss acts on its frame and on the joint alike: Z_j = K (1 + 0.01 i)."""
    parts, _, elastic = coincident
    S = np.broadcast_to(np.linalg.inv(STIFF * (1 + 0.01j)), (FREQUENCY.size, 6, 6))
    found = couple_frf(parts, PAIRS, compliance=S)
    assert_allclose(found.frf.H, elastic.H, atol=1e-7 * abs(elastic.H).max())


def test_parts_that_one_frf_holds_are_coupled_as_two(coincident):
    """A connection may begin and end in one part: a ring is closed so."""
    (a, b), _, _ = coincident
    n = len(a.outputs)
    H = np.zeros((FREQUENCY.size, 2 * n, 2 * n), dtype=complex)
    H[:, :n, :n], H[:, n:, n:] = a.H, b.H
    labels = a.outputs + b.outputs
    both = FRF.from_arrays(FREQUENCY, H, "receptance", labels, labels)
    apart, together = couple_frf((a, b), PAIRS), couple_frf([both], PAIRS)
    assert_allclose(together.frf.H, apart.frf.H, atol=1e-12 * abs(H).max())
    assert_allclose(together.condition, apart.condition, rtol=1e-9)


def test_decoupling_gives_the_other_part_back(coincident):
    parts, _, _ = coincident
    whole = couple_frf(parts, PAIRS).frf
    renamed = FRF.from_arrays(
        FREQUENCY, whole.H, "receptance", [f"W{n}" for n in whole.outputs], [f"W{n}" for n in whole.inputs]
    )
    pairs = [(f"WB0{u}+", f"A2{u}+") for u in UNITS]
    found = decouple_frf(renamed, parts[0], pairs)
    keep = [f"WB{p}{u}+" for p in (0, 1, 2) for u in UNITS]
    left = found.frf.select(outputs=keep, inputs=keep)
    assert_allclose(left.H, parts[1].H, atol=1e-5 * abs(parts[1].H).max())


def test_an_extended_interface_needs_regularisation_and_gives_the_same(coincident):
    """Internal DOFs of the known part add equations, not forces: dependent motions are refused by name."""
    parts, _, _ = coincident
    whole = couple_frf(parts, PAIRS).frf
    renamed = FRF.from_arrays(
        FREQUENCY, whole.H, "receptance", [f"W{n}" for n in whole.outputs], [f"W{n}" for n in whole.inputs]
    )
    pairs = [(f"WB0{u}+", f"A2{u}+") for u in UNITS] + [(f"WA0{u}+", f"A0{u}+") for u in UNITS]
    with pytest.raises(SubstructuringError, match=r"is singular at .* depend on one another"):
        decouple_frf(renamed, parts[0], pairs)
    found = decouple_frf(renamed, parts[0], pairs, regularisation=Regularisation("tsvd", 1e-9))
    keep = [f"WB{p}{u}+" for p in (1, 2) for u in UNITS[:3]]
    left = found.frf.select(outputs=keep, inputs=keep).H
    exact = parts[1].select(outputs=[k[1:] for k in keep], inputs=[k[1:] for k in keep]).H
    assert np.median(np.linalg.norm(left - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))) < 1e-4
    # the same interface as `l_curve` takes it: what an amount leaves is the gap
    A, B = interface_problem(renamed, pairs, removed=parts[0])
    assert A.shape == (FREQUENCY.size, 12, 12)
    curve = l_curve(A, B, "tsvd", [1e-9, 1e-3, 1e-2, 0.1, 0.3])
    assert curve.residual[0] == pytest.approx(np.sqrt((found.gap**2).mean()), rel=1e-6)


def test_inverse_substructuring_finds_the_joint_whatever_is_attached(coincident):
    _, _, elastic = coincident
    pairs = [(f"2{u}+", f"3{u}+") for u in UNITS]
    Z = invert_substructure(elastic, pairs)
    scale = np.sqrt(np.outer(np.diag(STIFF), np.diag(STIFF)))
    # the sides' own receptances are up to 1e5 times the joint's compliance: as many digits of the FRFs' 13 go
    assert abs((Z - STIFF * (1 + 0.01j)) / scale).max() < 1e-6


def test_tikhonov_and_tsvd_go_to_the_exact_solution():
    rng = np.random.default_rng(0)
    A = complex_normal(rng, (4, 5, 5))
    B = rng.standard_normal((4, 5, 3)).astype(complex)
    exact = np.linalg.solve(A, B)
    for method in ("tsvd", "tikhonov"):
        assert_allclose(Regularisation(method, 1e-9).solve(A, B), exact, rtol=1e-9)
    # Tikhonov with amount a: components are σ²/(σ² + a² σ₁²) of the exact ones
    _, s, Vh = np.linalg.svd(A)
    parts = (Vh @ Regularisation("tikhonov", 0.3).solve(A, B)) / (Vh @ exact)
    kept = (s**2 / (s**2 + 0.09 * s[:, :1] ** 2))[:, :, None]
    assert_allclose(parts, np.broadcast_to(kept, parts.shape), rtol=1e-9)


def test_the_corner_of_an_l_curve_lies_between_noise_and_signal():
    """Singular values 1 … 1e-12, noise 1e-5: amounts far above it lose signal, far below let noise in."""
    rng = np.random.default_rng(1)
    n = 12
    U = np.linalg.qr(rng.standard_normal((n, n)))[0]
    V = np.linalg.qr(rng.standard_normal((n, n)))[0]
    s = np.logspace(0, -12, n)
    A = (U * s) @ V.T
    x = V @ (s**0.3)
    b = A @ x + 1e-5 * rng.standard_normal(n) / np.sqrt(n)
    curve = l_curve(A[None], b[None, :, None])
    assert 1e-7 < curve.corner < 1e-3
    assert (np.diff(curve.residual) >= -1e-15).all()
    assert (np.diff(curve.solution) <= 1e-12).all()


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ([], "no connections"),
        ([("A2X+", "Q1X+")], "'Q1X\\+' is no response"),
        ([("A2X+", "A2X+")], "joins a DOF to itself"),
        ([PAIRS[0], PAIRS[0]], "occurs twice"),
        ([PAIRS[0], PAIRS[0][::-1]], "occurs twice"),
        (["A2X+"], "'A2X\\+' is no pair of labels"),
        ([("A2X+", "B0X+", "B1X+")], "is no pair of labels"),
    ],
)
def test_connections_that_cannot_be_are_refused(parts, pairs, message):
    with pytest.raises(SubstructuringError, match=message):
        couple_frf(parts, pairs)


def test_parts_and_compliances_that_cannot_be_are_refused(parts):
    with pytest.raises(SubstructuringError, match="no parts"):
        couple_frf([], PAIRS)
    moved = FRF.from_arrays(FREQUENCY + 1, parts[1].H, "receptance", parts[1].outputs, parts[1].inputs)
    with pytest.raises(SubstructuringError, match="share one set of lines"):
        couple_frf((parts[0], moved), PAIRS)
    with pytest.raises(SubstructuringError, match=r"\(45, 6, 6\) is needed"):
        couple_frf(parts, PAIRS, compliance=1e-6)
    with pytest.raises(SubstructuringError, match="not finite"):
        couple_frf(parts, PAIRS, compliance=np.full((45, 6, 6), np.nan))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": np.ones((2, 3))}, r"\(n_freq, n, n\) and \(n_freq, n, k\) are needed"),
        ({"B": np.ones((4, 3, 1))}, "are needed"),
        ({"A": np.zeros((2, 3, 3))}, "A holds a value that is not finite, or a line of zeros"),
        ({"B": np.full((2, 3, 1), np.nan)}, "B holds a value"),
        ({"method": "none"}, "one of tsvd or tikhonov"),
        ({"amounts": [0.1]}, "1 amounts are given, the least 0.1; at least five above zero"),
        ({"amounts": [-1, 0.1, 0.2, 0.3, 0.4]}, "above zero"),
    ],
)
def test_an_l_curve_of_nothing_is_refused(change, message):
    given = {"A": np.broadcast_to(np.eye(3), (2, 3, 3)), "B": np.ones((2, 3, 1)), **change}
    with pytest.raises(SubstructuringError, match=message):
        l_curve(**given)


def test_labels_of_two_parts_must_differ(parts):
    with pytest.raises(SubstructuringError, match="occurs in two parts"):
        couple_frf((parts[0], parts[0]), PAIRS)


def test_regularisation_is_checked():
    with pytest.raises(SubstructuringError, match="allowed are none, tsvd, tikhonov"):
        Regularisation("ridge")
    with pytest.raises(SubstructuringError, match="0 to 1"):
        Regularisation("tsvd", 2.0)
