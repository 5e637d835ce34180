"""Files of torch that know when they were damaged."""

import errno
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import torch

from jointsdf.model.sealed_file import checksum, load_sealed, save_sealed

CONTENT = {
    "format": 1,
    "state": {"weight": torch.linspace(-1, 1, 96).reshape(12, 8), "ids": torch.arange(3), "none": torch.zeros(0, 4)},
    "rates": [1e-3, 0.5],
    "names": ("a", None, True),
}


def same(one, other) -> bool:
    return checksum(one) == checksum(other)


def test_a_file_holds_what_was_saved(tmp_path: Path) -> None:
    save_sealed(CONTENT, tmp_path / "file")
    found = load_sealed(tmp_path / "file")
    assert found.keys() == CONTENT.keys()
    torch.testing.assert_close(found["state"], CONTENT["state"], rtol=0, atol=0)
    assert (found["rates"], found["names"]) == (CONTENT["rates"], CONTENT["names"])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no device that is always full")
def test_a_full_disk_is_named() -> None:
    with pytest.raises(OSError, match="No space left") as failed:
        save_sealed(CONTENT, "/dev/full")
    assert failed.value.errno == errno.ENOSPC


@pytest.mark.parametrize("sealed", [True, False], ids=["with a checksum", "of before"])
def test_a_flipped_bit_is_found_or_changes_nothing(tmp_path: Path, sealed: bool) -> None:
    path = tmp_path / "file"
    save_sealed(CONTENT, path) if sealed else torch.save(CONTENT, path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    refused = 0
    for place in rng.choice(8 * len(whole), 600, replace=False):
        damaged = bytearray(whole)
        damaged[place // 8] ^= 1 << (place % 8)
        path.write_bytes(damaged)
        try:
            found = load_sealed(path)
        except Exception:
            refused += 1
        else:
            assert same(found, CONTENT), place
    assert refused > 200


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content["state"]["weight"].view(-1)[5].add_(1e-7),
        lambda content: content.update(format=2),
        lambda content: content["rates"].reverse(),
        lambda content: content["state"].pop("none"),
    ],
)
def test_changed_content_is_found_where_the_archive_is_sound(tmp_path: Path, change) -> None:
    save_sealed(CONTENT, tmp_path / "file")
    stored = torch.load(tmp_path / "file", weights_only=True)
    change(stored)
    torch.save(stored, tmp_path / "file")
    with pytest.raises(ValueError, match="content does not match its checksum"):
        load_sealed(tmp_path / "file")


@pytest.mark.parametrize("data", [b"", b"a text", b"\x80\x02]q\x00a.", None])
def test_what_is_no_file_of_torch_is_refused(tmp_path: Path, data: bytes | None) -> None:
    save_sealed(CONTENT, tmp_path / "file")
    (tmp_path / "file").write_bytes((tmp_path / "file").read_bytes()[:-40] if data is None else data)
    with pytest.raises(ValueError, match="no archive of torch"):
        load_sealed(tmp_path / "file")


def test_the_checksum_is_sha_256_of_the_values_with_their_kinds() -> None:
    assert checksum("ab") == hashlib.sha256(b"str 2\nab").hexdigest()
    weights = torch.tensor([[1.0, -2.0]])
    expected = hashlib.sha256(b"tensor torch.float32 (1, 2)\n" + weights.numpy().tobytes()).hexdigest()
    assert checksum(weights) == checksum(torch.tensor([[1.0], [-2.0]]).T) == expected


def test_different_values_have_different_checksums() -> None:
    values = [0, 0.0, False, None, "", "0", [], {}, [0], {"0": 0}, {0: 0}, [[0]], ["a", "bc"], ["ab", "c"], {"a": None}]
    values += [torch.zeros(()), torch.zeros(1), torch.zeros(1, dtype=torch.int64), torch.zeros(1, 1), torch.zeros(0)]
    found = [checksum(value) for value in values]
    assert len(set(found)) == len(found), json.dumps(found)
    with pytest.raises(TypeError, match="set: neither"):
        checksum({1, 2})
