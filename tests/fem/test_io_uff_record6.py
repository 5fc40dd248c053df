"""Record 6 of dataset 58: nodes, directions and labels of FRFs in universal files."""

import pytest

from fem.io import UffError, read_frf
from tests.fem.test_io_uff_meaning import quietly, read, record


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.unv"


HEAD = f"{4:5d}{0:10d}{0:5d}{0:10d} "


@pytest.mark.parametrize(
    ("tail", "labels", "name"),
    [
        (f"{'PF-I-0301y':<10}{301:10d}{2:4d} {'NONE':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "PF-I-0301y"),
        (f"{'PF-I-0301y+':<10}{301:10d}{2:4d} {'NONE':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "PF-I-0301y+"),
        (f"{'SENSOR12345':<10}{301:10d}{2:4d} {'NONE':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "SENSOR12345"),
        (f"{'ABC':<11}{301:10d}{2:4d} {'NONE':<11}{1:10d}{3:4d}", ("301Y+", "1Z+"), "ABC"),
        (f"{'ABC':<14}{301:10d}{2:4d} {'NONE':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "ABC"),
        (f"{'ABC':<10}{301:10d}{2:4d} {'A_LONG_REFERENCE':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "ABC"),
        (f"{'ABC':<10}{301:10d}{2:4d} {'LONG1234567890':<10}{1:10d}{3:4d}", ("301Y+", "1Z+"), "ABC"),
        (f"{'a b':<10}{301:10d}{-2:4d} {'':<10}{1:10d}{3:4d}", ("301Y-", "1Z+"), "a b"),
    ],
)
def test_names_that_shift_the_columns(path, tail, labels, name):
    file, _ = quietly(path, record(record6=HEAD + tail))
    frf = file.frf()
    assert (frf.outputs + frf.inputs) == labels
    functions, _ = quietly(path, record(record6=("    1" + HEAD[5:]) + tail))
    assert functions.functions[0].response_name == name


@pytest.mark.parametrize("name", ["BEAM TOP FLANGE", "SENSOR 12345", "A B C D E F G"])
def test_a_long_name_with_blanks_is_refused_with_its_line(path, name):
    tail = f"{name:<10}{301:10d}{2:4d} {'NONE':<10}{1:10d}{3:4d}"
    with pytest.raises(
        UffError, match=r"a\.unv: dataset 58 at line 1 .*line 8 does not have response and reference"
    ):
        quietly(path, record(record6=HEAD + tail))


@pytest.mark.parametrize("direction", [9, -7, 13])
@pytest.mark.parametrize("end", [1, 3])
def test_directions_that_do_not_exist_are_refused_with_file_and_line(path, direction, end):
    ends = [1, 3, 1, 3]
    ends[end] = direction
    with pytest.raises(
        UffError, match=rf"a\.unv: dataset 58 at line 1 .*line 8: direction {direction} at node 1"
    ):
        read(path, record(ends=ends))


def test_amplitudes_without_phase_are_no_frfs(path):
    with pytest.raises(
        UffError,
        match=r"line 1 .*FRF 1Z[+]/1Z[+]: its values are real: amplitudes without phase, which are not used",
    ):
        quietly(path, record(form=2), reader=read_frf)
