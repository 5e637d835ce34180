"""The table of ABC's archives."""

from pathlib import Path

import pytest
from abc_files import NEEDS_RAW, RAW

from jointsdf.abc_dataset import chunks
from jointsdf.errors import InputError
from jointsdf.shapes import abc


def test_a_models_chunk_follows_from_its_number() -> None:
    numbers = [chunks.chunk_of(each) for each in ("00000000", "00009999", "00010000", "00016513_3d69")]
    assert numbers == ["0000", "0000", "0001", "0001"]
    needed = {chunks.chunk_of(entry.abc_id) for entry in abc.catalogue().values()}
    assert {(each.kind, each.chunk) for each in chunks.read_table()} == {(k, n) for k in chunks.KINDS for n in needed}


@NEEDS_RAW
def test_the_table_says_what_abcs_lists_say() -> None:
    for each in chunks.read_table():
        assert f"{each.url} {each.name}" in (RAW / f"{each.kind}_v00.txt").read_text().splitlines()
        assert f"{each.name}: {each.md5}" in (RAW / "md5.yml").read_text().splitlines()
        assert f"{each.name}: {each.bytes}" in (RAW / "size.yml").read_text().splitlines()


def test_addresses_change_by_a_list_as_abcs_own(tmp_path: Path) -> None:
    own = tmp_path / "list.txt"
    own.write_text("https://mirror.org/1 abc_0000_step_v00.7z\nhttps://mirror.org/2 abc_0099_step_v00.7z\n\n")
    before, after = chunks.read_table(), chunks.read_table(own)
    assert after[0] == chunks.Chunk("step", "0000", "https://mirror.org/1", before[0].md5, before[0].bytes)
    assert after[1:] == before[1:]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("file:///etc/passwd abc_0000_step_v00.7z", "line 1"),
        ("https://a.org/1", "line 1"),
        ("kind,chunk,url,md5,bytes\nstep,0000,ftp://a.org,695388be7a278c7798c8c8ae239772ac,5", "line 2"),
        ("kind,chunk,url,md5,bytes\nstep,0000,http://a.org,695388be,5", "line 2"),
        ("kind,chunk,url,md5,bytes\nstep,0000,http://a.org,695388be7a278c7798c8c8ae239772ac,0", "line 2"),
        ("kind,chunk,url,md5,bytes\nmeta,0000,http://a.org,695388be7a278c7798c8c8ae239772ac,5", "line 2"),
    ],
)
def test_an_unusable_list_is_refused(tmp_path: Path, text: str, named: str) -> None:
    own = tmp_path / "list.txt"
    own.write_text(text)
    with pytest.raises(InputError, match=named) as refused:
        chunks.read_table(own)
    assert str(own) in str(refused.value)
