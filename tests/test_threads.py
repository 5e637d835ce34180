"""Pieces of work on several threads: the same answers in the same order, each piece with operations of one thread."""

import threading
from collections.abc import Iterator

import pytest
import torch

from jointsdf import threads
from jointsdf.threads import large_pieces, over_threads, pieces, workers


@pytest.fixture(params=[1, 2, 5])
def number(request: pytest.FixtureRequest) -> Iterator[int]:
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield request.param
    torch.set_num_threads(before)


def test_answers_come_in_the_order_of_the_items(number: int) -> None:
    items = [torch.full((3,), float(k)) for k in range(23)]
    found = over_threads(lambda item: 2 * item, items)
    assert torch.equal(torch.stack(found), 2 * torch.stack(items))
    assert over_threads(lambda item: item, []) == []
    assert workers() == number


def test_a_piece_has_operations_of_one_thread_and_records_no_gradient(number: int) -> None:
    weight = torch.ones(4, requires_grad=True)

    def look(_: int) -> tuple[int, bool, bool]:
        torch.rand(200, 200) @ torch.rand(200, 200)  # the first operation of a thread may change its number
        return torch.get_num_threads(), torch.is_grad_enabled(), (2 * weight).requires_grad

    assert set(over_threads(look, range(20))) == {(1, False, False)}
    assert torch.get_num_threads() == number
    assert torch.is_grad_enabled()
    later: list[int] = []
    thread = threading.Thread(target=lambda: later.append(torch.get_num_threads()))
    thread.start()
    thread.join()
    assert later == [number], "threads of others are as they were"


def test_as_many_work_at_once_as_there_are_threads(number: int) -> None:
    """Each waits for the others: fewer would never meet."""
    meeting = threading.Barrier(number, timeout=20)
    with large_pieces():
        over_threads(lambda _: meeting.wait() if number > 1 else None, range(2 * number))


def test_an_error_of_a_piece_is_raised(number: int) -> None:
    def fail(item: int) -> int:
        if item == 3:
            raise ValueError(f"piece {item} of {number}")
        return item

    with pytest.raises(ValueError, match="piece 3"):
        over_threads(fail, range(6))
    assert over_threads(lambda item: item, range(3)) == [0, 1, 2]


def test_within_large_pieces_operations_take_one_thread(number: int) -> None:
    with large_pieces():
        assert (torch.get_num_threads(), workers()) == (1, number)
        with large_pieces():
            assert (torch.get_num_threads(), workers()) == (1, number)
        with pytest.raises(KeyError), large_pieces():
            raise KeyError
        assert (torch.get_num_threads(), workers()) == (1, number)
    assert (torch.get_num_threads(), workers()) == (number, number)


@pytest.mark.parametrize("points", [0, 1, 249, 250, 1000, 1300, 1301, 2500, 20000])
def test_pieces_are_as_many_for_each_thread_and_never_large(number: int, points: int) -> None:
    count = pieces(torch.zeros(points, 3))
    sizes = [len(piece) for piece in torch.zeros(points, 3).tensor_split(count)]
    assert sum(sizes) == points
    assert max(sizes) <= threads.MAX_PIECE_POINTS
    assert count == 1 or min(sizes) >= threads.MIN_PIECE_POINTS
    if points >= threads.MIN_PIECE_POINTS * number:
        assert count % number == 0 or count == points // threads.MIN_PIECE_POINTS
