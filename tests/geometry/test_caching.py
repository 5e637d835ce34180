"""One computation for each set of objects, whatever the threads, for as long as the objects live."""

import gc
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor

import pytest

from jointsdf.geometry.caching import cached_by_identity


class Thing:
    """Equal to every other one, and still another object."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Thing)

    __hash__ = None  # type: ignore[assignment]


class Result:
    """Can be weakly referenced."""


def test_the_same_objects_are_computed_once_and_others_again() -> None:
    calls: list[tuple[Thing, ...]] = []

    @cached_by_identity
    def compute(*things: Thing) -> Result:
        calls.append(things)
        return Result()

    first, second = Thing(), Thing()
    assert compute(first) is compute(first)
    assert compute(first) is not compute(second)
    assert compute(first, second) is compute(first, second)
    assert compute(first, second) is not compute(second, first)
    assert len(calls) == 4


def test_a_result_is_forgotten_with_any_of_its_arguments() -> None:
    compute = cached_by_identity(lambda *_: Result())
    first, second = Thing(), Thing()
    results = {
        "first": weakref.ref(compute(first)),
        "second": weakref.ref(compute(second)),
        "both": weakref.ref(compute(first, second)),
    }
    gc.collect()
    assert all(result() is not None for result in results.values())
    del second
    gc.collect()
    assert {key for key, result in results.items() if result() is not None} == {"first"}


def test_an_object_at_the_place_of_a_forgotten_one_is_computed_again() -> None:
    calls: list[int] = []
    compute = cached_by_identity(lambda thing: calls.append(id(thing)))
    for _ in range(20):
        compute(Thing())  # most are made where the one before was
    assert len(calls) == 20
    assert len(set(calls)) < 20


def test_threads_wait_for_the_one_that_computes() -> None:
    started, go_on, calls = threading.Event(), threading.Event(), []

    @cached_by_identity
    def compute(thing: Thing) -> Result:
        calls.append(thing)
        started.set()
        assert go_on.wait(10)
        return Result()

    thing, other = Thing(), Thing()
    with ThreadPoolExecutor(4) as pool:
        first = pool.submit(compute, thing)
        assert started.wait(10)
        more = [pool.submit(compute, thing) for _ in range(3)]
        assert not any(future.done() for future in more)
        go_on.set()
        assert {id(future.result(10)) for future in [first, *more]} == {id(first.result())}
    assert len(calls) == 1
    compute(other)
    assert len(calls) == 2


def test_another_object_does_not_wait() -> None:
    started, go_on = threading.Event(), threading.Event()
    slow = Thing()

    @cached_by_identity
    def compute(thing: Thing) -> str:
        if thing is slow:
            started.set()
            assert go_on.wait(10)
        return "done"

    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(compute, slow)
        assert started.wait(10)
        assert compute(Thing()) == "done"
        assert not waiting.done()
        go_on.set()


def test_an_exception_is_raised_again_for_the_same_objects() -> None:
    calls: list[Thing] = []

    @cached_by_identity
    def compute(thing: Thing) -> None:
        calls.append(thing)
        raise ValueError("no volume")

    thing = Thing()
    for _ in range(2):
        with pytest.raises(ValueError, match="no volume"):
            compute(thing)
    assert len(calls) == 1
    with pytest.raises(ValueError, match="no volume"):
        compute(Thing())
    assert len(calls) == 2
