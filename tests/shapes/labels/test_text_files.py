"""Labels in text, tables and JSON."""

import json
from pathlib import Path

import numpy as np
import pytest
from mesh_files import put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.face_order import order_record
from jointsdf.shapes.labels.text_files import read_json, read_table, read_text

TEXTS = {
    "one in a line": ("a.txt", "0\n120\n-1\n7\n"),
    "Windows": ("a.txt", "\ufeff0\r\n120\r\n-1\r\n7"),
    "space": ("a.txt", "  0\n+120 \n-1\n7\n\n\n"),
    "floats": ("a.txt", "0.0\n1.2e2\n-1.000000000000000000e+00\n7.\n"),
    "comments": ("a.txt", "# labels\n# of faces\n0\n120\n-1\n7\n"),
    "one line": ("a.txt", "0 120 -1 7\n"),
    "commas": ("a.csv", "0, 120, -1, 7\n"),
    "face and label": ("a.csv", "0,0\n1,120\n2,-1\n3,7\n"),
    "in another order": ("a.csv", "3;7\n0;0\n2;-1\n1;120\n"),
    "with names": ("a.csv", '"face","label"\n3,7\n0,0\n2,-1\n1,120\n'),
    "one name": ("a.CSV", "label\n0\n120\n-1\n7\n"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_texts_give_a_number_for_each_face(tmp_path: Path, case: str) -> None:
    name, content = TEXTS[case]
    for encoding in ("utf-8", "utf-16"):
        path = tmp_path / name
        path.write_bytes(content.removeprefix("\ufeff" if encoding == "utf-16" else "").encode(encoding))
        assert read_text(path).tolist() == [0, 120, -1, 7]


BAD_TEXTS: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "is empty"),
    "blank": ("\n \n", "is empty"),
    "comments only": ("# nothing\n", "is empty"),
    "three in a line": ("1 2 3\n4 5 6\n", "has 3 numbers in each line"),
    "rows of other lengths": ("0 2\n1\n", "has '1' in line 2"),
    "a gap": ("1\n\n2\n3\n", "has '' in line 2"),
    "words": ("shaft\nflange\n", "has 'shaft' in line 1"),
    "a name after a comment": ("# x\n1\nshaft\n", "has 'shaft' in line 3"),
    "other digits": ("1\n\u0664\n", "in line 2"),
    "underscores": ("1\n1_0\n", "has '1_0' in line 2"),
    "no number": ("1\nnan\n", "has 'nan' in line 2"),
    "a face twice": ("0 5\n1 6\n1 7\n", "must name each of the faces 0 to 2 once"),
    "faces from 1": ("1 5\n2 6\n", "must name each of the faces 0 to 1 once"),
    "half a face": ("0 5\n1.5 6\n", "must name each of the faces"),
    "an array": (b"\x93NUMPY\x01\x00" + bytes(90), "is no text but a .npy array: name it .npy"),
    "half of UTF-16": (b"\xff\xfe\x00", "is no text"),
}


@pytest.mark.parametrize("case", BAD_TEXTS)
def test_bad_texts_are_one_line_that_names_the_line(tmp_path: Path, case: str) -> None:
    content, message = BAD_TEXTS[case]
    path = put(tmp_path, "labels.txt", content)
    with pytest.raises(InputError) as caught:
        read_text(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_of_numbers_as_programs_write_them(tmp_path: Path) -> None:
    content = "//X Y Z Class\n.5 -.25 1e-3 2\n-1.5E+2 0 3. 4\n"
    np.testing.assert_array_equal(
        read_table(put(tmp_path, "a.xyzc", content)), [[0.5, -0.25, 1e-3, 2], [-150, 0, 3, 4]]
    )


@pytest.mark.parametrize(
    "given", [[0, 120, -1, 7], {"3": 7, "0": 0, "2": -1, "1": 120}, {"labels": [0, 120, -1, 7], "of": "x"}]
)
def test_json_gives_a_number_for_each_face(tmp_path: Path, given: object) -> None:
    assert read_json(put(tmp_path, "a.json", json.dumps(given))).tolist() == [0, 120, -1, 7]


BAD_JSON = {
    "cut": ("[1, 2", "is no JSON (truncated or damaged?)"),
    "empty": ("", "is empty"),
    "an empty list": ("[]", "holds no list of labels"),
    "a number": ("3", "holds no list of labels"),
    "names": ('["shaft"]', "holds 'shaft'"),
    "nothing": ("[1, null]", "holds 'None'"),
    "lists": ("[[1], [2]]", "holds '[1]'"),
    "faces by name": ('{"top": 1}', "has the key 'top'"),
    "a face left out": ('{"0": 1, "2": 3}', "must name each of the faces 0 to 1 once"),
    "a face twice": ('{"0": 1, "0": 2}', "it has a key twice"),
    "deep": ("[" * 100_000, "is no JSON"),
    "endless": (f"[{'9' * 400}]", "hundreds of digits"),
    "our record": (order_record("mesh.ply", "labels.npy", b"", np.zeros((0, 3, 3))), "give labels=labels.npy"),
}


@pytest.mark.parametrize("case", BAD_JSON)
def test_bad_json_is_one_line(tmp_path: Path, case: str) -> None:
    content, message = BAD_JSON[case]
    path = put(tmp_path, "a.json", content)
    with pytest.raises(InputError) as caught:
        read_json(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(path))
