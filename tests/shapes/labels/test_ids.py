"""Which numbers are part ids, and their renumbering."""

import numpy as np
import pytest
from solids import strip

from jointsdf.errors import InputError
from jointsdf.shapes.labels.ids import check_ids, number_by_area


def per_rectangle(labels: np.ndarray) -> list[int]:
    assert (labels[::2] == labels[1::2]).all()
    return labels[::2].tolist()


def test_numbers_fall_with_area_and_keep_unlabelled() -> None:
    mesh = strip([1, 5, 2, 9, 3], [40, 3, -1, 11, 3])
    assert per_rectangle(number_by_area(mesh)) == [2, 1, -1, 0, 1]
    assert per_rectangle(number_by_area(strip([1, 2], [-1, -1]))) == [-1, -1]


@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.int64, np.uint16, np.uint64, ">i4", np.float16, np.float64])
def test_whole_numbers_of_any_type_are_ids(dtype: str) -> None:
    found = check_ids("it", np.array([0, 120, 7, 7], dtype=dtype))
    assert (found.dtype, found.tolist()) == (np.int64, [0, 120, 7, 7])


def test_the_limits_and_booleans_are_ids() -> None:
    assert check_ids("it", np.array([True, False])).tolist() == [1, 0]
    for values in (np.array([-1, 2**31 - 1]), np.array([-1.0, 2.0**31 - 1])):
        assert check_ids("it", values).tolist() == [-1, 2**31 - 1]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.array([0, -2]), "it holds -2: part ids are integers from -1 (unlabelled) to 2147483647"),
        (np.array([0, 2**31]), "it holds 2147483648: part ids"),
        (np.array([0, 2.0**31]), "it holds 2147483648: part ids"),
        (np.array([0, 2.0**31], dtype=np.float32), "it holds 2147483648: part ids"),
        (np.array([2**64 - 1], dtype=np.uint64), "it holds 18446744073709551615: part ids"),
        (np.array([0.0, 0.5]), "it holds 0.5: part ids"),
        (np.array([0.0, np.nan]), "it holds nan: part ids"),
        (np.array([np.inf]), "it holds inf: part ids"),
        (np.array(["3"]), "it holds <U1: give integers"),
        (np.array([1j]), "it holds complex128: give integers"),
    ],
)
def test_other_numbers_are_refused_by_value(values: np.ndarray, message: str) -> None:
    with pytest.raises(InputError) as caught:
        check_ids("it", values)
    assert str(caught.value).startswith(message)
