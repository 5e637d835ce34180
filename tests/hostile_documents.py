"""YAML that exhausts its reader, makes objects, or is no config of a run."""

from collections.abc import Callable

from hostile_configs import STORED

from jointsdf.runs.stored_yaml import MOST_BYTES

DEEP = 100_000
_TEXT = (STORED / "config.yaml").read_text()
_BOMB = "\n".join(["a0: &a0 [x, x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12))])
_CHAIN = "\n".join(["a0: &a0 {x: 1}", *(f"a{k}: &a{k} {{x: *a{k - 1}}}" for k in range(1, 150))])
_MERGE = "\n".join(["a0: &a0 {x: 1}", *(f"a{k}: &a{k} {{<<: [*a{k - 1}, *a{k - 1}]}}" for k in range(1, 40))])
DOCUMENTS: dict[str, str | Callable[[], str]] = {
    "an alias bomb": f"{_TEXT}{_BOMB}\n",
    "merged mappings": f"{_TEXT}{_MERGE}\n",
    "a chain of aliases": f"{_TEXT}{_CHAIN}\n",
    "an alias within its anchor": f"{_TEXT}loop: &loop [*loop]\n",
    "deep lists": lambda: f"{_TEXT}deep: {'[' * DEEP}{']' * DEEP}\n",
    "deep lists in dashes": lambda: f"{_TEXT}deep:\n  {'- ' * DEEP}x\n",
    "deep mappings": lambda: f"{_TEXT}deep: {'{a: ' * DEEP}1{'}' * DEEP}\n",
    "50 MB": lambda: f"{_TEXT}long: {'x' * 50_000_000}\n",
    "just above the limit": lambda: f"{_TEXT}# {'x' * MOST_BYTES}\n",
    "many values": lambda: f"{_TEXT}many: [{'1, ' * 100_000}]\n",
    "a long value": f"{_TEXT}long: {'x' * 100_000}\n",
    "a long integer": f"{_TEXT}long: {'9' * 9000}\n",
    "an integer of 60 to the power of 4,000": f"{_TEXT}long: 1{':1' * 4000}\n",
    "an object of Python's": f"{_TEXT}x: !!python/object/apply:os.system ['true']\n",
    "a name of Python's": f"{_TEXT}x: !!python/name:os.system\n",
    "a date": f"{_TEXT}x: 2020-01-01\n",
    "bytes": f"{_TEXT}x: !!binary aGVsbG8=\n",
    "a set": f"{_TEXT}x: !!set {{a, b}}\n",
    "a number as a key": f"{_TEXT}x: {{1: 2}}\n",
    "two documents": f"{_TEXT}---\n{_TEXT}",
    "a list": "[1, 2]\n",
    "text": "text\n",
}
