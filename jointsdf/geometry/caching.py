"""Cache of functions of meshes, which lasts as long as the meshes live."""

import weakref
from collections.abc import Callable
from concurrent.futures import Future
from threading import Lock
from typing import TypeVar

Result = TypeVar("Result")


def cached_by_identity(function: Callable[..., Result]) -> Callable[..., Result]:
    """Cache a function by the identity of its arguments, which arrays make unhashable, until one of them is collected.

    Threads that ask for the same result at once compute it once. An exception is cached too.

    Args:
        function: Of positional arguments that can be weakly referenced, e.g. meshes or sample sets.
    """
    results: dict[tuple[int, ...], Future[Result]] = {}
    lock = Lock()

    def cached(*arguments: object) -> Result:
        key = tuple(map(id, arguments))
        with lock:
            first = key not in results
            future = results.setdefault(key, Future())
        if first:
            for argument in arguments:
                weakref.finalize(argument, results.pop, key, None)
            try:
                future.set_result(function(*arguments))
            except BaseException as error:
                future.set_exception(error)
        return future.result()

    return cached
