"""What is told about models that cannot be meant: what was found, where, and what is allowed."""

import numpy as np
import pytest

from fem import (
    FRF,
    Damping,
    Frame,
    FRFError,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    MeshError,
    Model,
    ModelError,
    PropertyError,
    assemble,
    compute_frf,
    solve_complex_modes,
    solve_modes,
)
from fem.directions import direction_vector, directions_from
from fem.summary import percent
from tests.frames import FLAT, STEEL, beam, chain, cross_beam, fix

PLAIN = MemberProperties(STEEL, FLAT)


def two_members(joint=()):
    mesh = Mesh.from_lines(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1], [2, 3]], {"a": [0], "b": [1]}
    )
    return Model(mesh.split(4), (Frame(members={"a": PLAIN, "b": PLAIN}), *joint))


def no_stiffness():
    return Joint(name="j", point1=1, point2=3, location=np.array([1, 0.5, 0]))


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (chain(3, 2), r"mechanism: 6 motion\(s\).*6 rigid-body.*most free: point \d"),
        (chain(2, 2, (fix(0),)), r"mechanism: 3 motion\(s\).*0 rigid-body"),
        (two_members(), r"2 parts that nothing connects \(a; b\); add joints"),
        (two_members((fix(0),)), r"2 parts that nothing connects"),
        (two_members((no_stiffness(),)), r"2 parts that nothing connects"),
    ],
    ids=["hinges", "hinge on a wall", "apart", "apart, one held", "joint without stiffness"],
)
def test_what_has_no_stiffness_is_described(model, words):
    with pytest.raises(ModelError, match=words):
        solve_modes(assemble(model))


def test_two_parts_that_are_both_held_are_fine():
    assert solve_modes(assemble(two_members((fix(0), fix(2)))), 4).n_rigid == 0


def lines(points=((0, 0, 0), (1, 0, 0)), rows=((0, 1),), **more):
    return lambda: Mesh.from_lines(points, rows, **more)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lines(rows=[[0, 7]]), "line 0 refers to point 7, but the mesh has 2 points; points count from 0"),
        (lines(rows=[[0, -1]]), "line 0 refers to point -1"),
        (lines(rows=[[0, 1], [1, 1]]), "line 1 between points 1 and 1 has zero length"),
        (
            lines([[0, 0, 0], [0, 0, 0], [1, 0, 0]], [[0, 2], [0, 1]]),
            "line 1 between points 0 and 1 has zero",
        ),
        (lines([[0, 0, 0], [0, np.nan, 0]]), "point 1 has a coordinate that is not a finite number"),
        (lines(rows=[]), "the mesh has no lines"),
        (lines([[0, 0], [1, 0]]), r"points have shape \(2, 2\); \(n_points, 3\) is expected"),
        (lines(sets={"a": [0], "b": [0]}), "line 0 is in the sets 'a' and 'b'"),
        (lines(sets={"a": [3]}), "set 'a' refers to line 3, but the mesh has 1 lines"),
        (
            lambda: beam(2).mesh.locate("beam", 1.5),
            "position 1.5 m lies outside member 'beam', which is 0 to 1 m",
        ),
        (lambda: beam(2).mesh.locate("rod", 0.5), "there is no member or group 'rod'; the mesh has beam"),
        (lambda: beam(2).mesh.refined(size=0), "the element size is 0; it must be positive"),
        (lambda: beam(2).mesh.refined(counts={"beam": 0}), "the element count of 'beam' is 0"),
    ],
)
def test_meshes(make, words):
    with pytest.raises(MeshError, match=words):
        make()


def test_a_group_is_no_single_member():
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1], [1, 2]], {"ell": [0, 1]})
    assert mesh.groups["ell"] == ("ell.1", "ell.2")
    with pytest.raises(MeshError, match=r"'ell' stands for 2 members \(ell.1, ell.2\); name one of them"):
        mesh.locate("ell", 0.5)


def contribute(model):
    return lambda: assemble(model)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            contribute(beam(3, along=(1, 0, 0), orientation=np.array([2.0, 0, 0]))),
            "'beam': its orientation .* is parallel",
        ),
        (
            contribute(beam(4, rigid1=0.3)),
            r"'beam': the rigid end zone of 0.3 m does not fit .*\(0.25 m\); use larger",
        ),
        (contribute(beam(1, rigid1=0.6, rigid2=0.6)), "the rigid end zone of 0.6 m does not fit"),
        (lambda: beam(1, rigid1=-0.1), "rigid end zones are -0.1 and 0 m; they cannot be negative"),
        (
            lambda: beam(1, theory="shell"),
            "the beam theory is 'shell'; allowed are timoshenko, euler-bernoulli",
        ),
        (
            lambda: assemble(Model(beam(2).mesh, (Frame(members={"rod": PLAIN}),))),
            "member 'beam' of the mesh has no material and section; given are rod",
        ),
        (
            lambda: Frame(members={"a": PLAIN, "b": MemberProperties(Material("steel", 2e11, 7850.0), FLAT)}),
            "two different materials have the name 'steel'",
        ),
        (lambda: beam(1, effects=(fix(0), fix(0))), "two effects have the name 'support0'"),
        (lambda: beam(1).effect("rope"), "no effect 'rope'; it has frame"),
        (
            lambda: beam(1).with_values({("frame", "G:steel"): 1.0}),
            "'frame' has no parameter 'G:steel'; it has E:steel",
        ),
        *(
            (
                lambda solve=solve: solve(assemble(beam(1, effects=(fix(0), fix(1))))),
                "leave no motion at all.*divide",
            )
            for solve in (
                solve_modes,
                lambda s: solve_complex_modes(s, 3),
                lambda s: compute_frf(s, [10.0], [(0, "z")], [(0, "z")]),
                lambda s: compute_frf(s, [10.0], [(0, "z")], [(0, "z")], method="direct"),
            )
        ),
        (
            lambda: assemble(
                Model(
                    Mesh.from_lines([[0, 0, 0], [1, 0, 0], [5, 5, 5]], [[0, 1]], {"a": [0]}),
                    (Frame(members={"a": PLAIN}),),
                )
            ),
            "point 2 of the mesh has neither stiffness nor mass in x",
        ),
        (
            lambda: Damping.modal(1.0),
            "ratios are 1, and lie between 0 and 1; if they are in per cent, divide",
        ),
        (lambda: Damping.modal([0.1, 0.2], [5.0, 4.0]), "2 damping ratios need 2 increasing frequencies"),
        (lambda: direction_vector("q"), "'q' is not a direction"),
        (lambda: direction_vector([0, 0, 0]), "is not a direction"),
        (lambda: directions_from("x w", "foot"), "foot: 'w' is not a direction"),
        (lambda: solve_modes(assemble(beam(2)), 0), "0 modes are asked for"),
        (
            lambda: Joint(name="j", point1=0, location=np.zeros(3), K=np.arange(36.0).reshape(6, 6)),
            "joint 'j': K is not symmetric",
        ),
        (
            lambda: Joint(name="j", point1=0, location=np.zeros(3), M=np.eye(3)),
            r"joint 'j': M has shape \(3, 3\)",
        ),
    ],
)
def test_models(make, words):
    with pytest.raises(ModelError, match=words):
        make()


@pytest.mark.parametrize(
    ("values", "words"),
    [((0, 1), "E is 0"), ((1, -1), "rho is -1"), ((np.nan, 1), "E is nan"), ((1, 1, 0.6), "nu is 0.6")],
)
def test_materials(values, words):
    with pytest.raises(PropertyError, match=f"material 'x': {words}; it must be"):
        Material("x", *values)


def frf(f=(1.0, 2.0), H=((1.0, 2.0),), **more):
    return lambda: FRF.from_arrays(f, np.transpose(H)[:, :, None] if np.ndim(H) == 2 else H, **more)


def respond(**more):
    keys = {"frequency": [1.0], "outputs": [(0, "z")], "inputs": [(0, "z")], **more}
    return lambda: compute_frf(assemble(cross_beam(0.2)), **keys)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (frf(f=(2.0, 1.0)), "frequencies must increase strictly; line 1 has 1 Hz after 2 Hz"),
        (frf(f=(-1.0, 1.0)), "finite and not negative"),
        (frf(f=(1.0, 2.0, 3.0)), r"H has shape \(2, 1, 1\) for 3 frequencies"),
        (
            frf(H=((1.0, np.nan),)),
            "1 FRF value.* not finite numbers, the first at 2 Hz, response 'out1', force 'in1'",
        ),
        (
            frf(kind="compliance"),
            "the FRF kind is 'compliance'; allowed are receptance, mobility, accelerance",
        ),
        (frf(H=((1.0, 2.0), (1.0, 2.0)), outputs=["a", "a"]), "output label 'a' occurs twice"),
        (frf(outputs=["a", "b"]), "2 output labels are given for 1 output"),
        (lambda: frf(f=(0.0, 1.0))().as_kind("receptance"), "a line at 0 Hz cannot be converted"),
        (
            lambda: frf()().select(outputs=["b"]),
            "there is no response 'b'; the data have out1|there is no output 'b'",
        ),
        (
            lambda: frf()().select(band=(5.0, 6.0)),
            "no line lies in the band 5 to 6 Hz; the data cover 1 to 2 Hz",
        ),
        (respond(method="magic"), "the FRF method is 'magic'; allowed are auto, modal, reduced, direct"),
        (respond(frequency=[-1.0]), "finite and not negative"),
        (respond(frequency=[0.0]), "infinite at a line: 0 Hz on a free structure"),
    ],
)
def test_frfs(make, words):
    with pytest.raises(FRFError, match=words):
        make()


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ([(99, "z")], "is not in the mesh, which has"),
        ([(0, "w")], "'w' is not a direction"),
        (np.ones((1, 5)), "5 columns"),
    ],
)
def test_selections(outputs, words):
    with pytest.raises(ModelError, match=words):
        respond(outputs=outputs)()


@pytest.mark.parametrize(
    ("probability", "text"), [(1.0, "above 99"), (0.99, "99"), (0.5, "50"), (0.01, "1"), (1e-9, "below 1")]
)
def test_no_probability_is_called_certain(probability, text):
    assert percent(probability) == f"{text}\u00a0%"


@pytest.mark.parametrize("text", ["xyz", "x y z", "z,x,y", "xy z", ["x", "y", "z"]])
def test_directions_may_be_one_word_or_several(text):
    assert directions_from(text, "foot") == ("x", "y", "z")


def test_rotations_in_one_word_keep_their_letter():
    assert directions_from("rxz", "foot") == ("z", "rx")
