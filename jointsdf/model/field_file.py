"""A field's file: reading errors in one line; parameters as float16 (IEEE 754 binary16) for half the size."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import torch
from torch import Tensor, nn

from jointsdf.errors import InputError, first_line

THIN = 3  # rows or columns up to which a matrix is kept: those of the first layer, and of the distance's output

UNREADABLE = (  # errors of reading a damaged checkpoint, found by flipping bytes
    RuntimeError,
    LookupError,
    EOFError,
    TypeError,
    AttributeError,
    OSError,
    ValueError,
    pickle.UnpicklingError,
)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn errors within the block into input errors about the file.

    Raises:
        InputError: The file is missing, truncated, or not a field.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such field checkpoint; a finished run folder holds field.ckpt")
    try:
        yield
    except UNREADABLE as error:
        raise InputError(f"{path}: not a readable field checkpoint ({first_line(error)}); run the fit again") from error


def half_state(module: nn.Module) -> dict[str, Tensor]:
    """State of the module with its large matrices in float16; biases, thin matrices and buffers are kept as they are.

    The first layer is kept because its frequency multiplies its rounding by coordinates that nothing averages: rounded,
    it makes the field's error twelve times as large, for 1% of the bytes.

    Raises:
        InputError: A weight beyond the range of float16.

    >>> [value.dtype for value in half_state(nn.Linear(8, 4)).values()]
    [torch.float16, torch.float32]
    """
    state = dict(module.state_dict())
    for name, parameter in module.named_parameters():
        if parameter.ndim == 2 and min(parameter.shape) > THIN:
            state[name] = parameter.detach().half()
            if not torch.isfinite(state[name]).all():
                most = float(parameter.detach().abs().max())
                raise InputError(f"{name}={most:.3g}: float16 ends at 65504; save the field without half=True")
    return state
