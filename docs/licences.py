"""Writes docs/licences.md: licences of the packages that `make setup` and `make peers` install, from their metadata."""

import re
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "licences.md"
LOCK, PEERS = ROOT / "requirements.lock", ROOT / "requirements-peers.lock"
HEAD = """# Licences

`jointsdf` itself is under the MIT licence; copied into it is three.js alone (`jointsdf/viewing/page/assets/three/`,
MIT). `make setup` installs these packages from the registry, each under its own licence. **use**: the package needs it,
and it comes with `pip install .` as well; development: tests, types and documentation alone; peers: of `make peers`
alone, for `python -m benchmarks peers` ([peers](peers.md)). Written by `python docs/licences.py` from the metadata of
what is installed; packages that are not, such as those of other systems, keep the licence that this page had, if any.

| package | version | licence | needed for |
|---|---|---|---|
"""
LONGEST = 100  # characters of a licence's name; longer ones are whole texts


def locked(*files: Path) -> dict[str, str]:
    """Version of each package of the lock files, both by default, by its normalised name."""
    text = "\n".join(file.read_text(encoding="utf-8") for file in files or (LOCK, PEERS))
    return {normalised(name): version for name, version in re.findall(r"^([\w.-]+)==([^\s;]+)", text, re.MULTILINE)}


def normalised(name: str) -> str:
    """A package's name as registries compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def used() -> set[str]:
    """Packages that the project needs, and theirs."""
    found: set[str] = set()
    waiting = ["jointsdf"]
    while waiting:
        name = waiting.pop()
        try:
            requirements = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # of another system
        needed = {normalised(re.split(r"[\s;<>=!~\[(]", text)[0]) for text in requirements if "extra ==" not in text}
        waiting += needed - found
        found |= needed
    return found


def licence(name: str) -> str:
    """Licence of an installed package: its SPDX expression, else its classifiers, else the line that it gives."""
    try:
        stated = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return before(name)
    classifiers = [text for text in stated.get_all("Classifier", []) if text.startswith("License")]
    line = (stated.get("License") or "").strip().splitlines()[:1]
    for text in (
        stated.get("License-Expression"),
        " or ".join(text.rpartition(" :: ")[2] for text in classifiers),
        *line,
    ):
        if text and len(text) <= LONGEST and text != "OSI Approved" and not text.startswith("Copyright"):
            return str(text)
    return "see the package"


def before(name: str) -> str:
    """Licence of a package on the page as it is; empty where it is not there."""
    found = re.search(
        rf"^\| {re.escape(name)} \| \S+ \| (.*) \| \S+ \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    return found[1] if found else ""


def page() -> str:
    """The page, one line per package."""
    torch = metadata.version("torch").partition("+")[0]
    purposes = dict.fromkeys(locked(PEERS), "peers") | dict.fromkeys(locked(LOCK), "development")
    purposes |= dict.fromkeys(used() & {*locked(LOCK), "torch"}, "**use**")
    packages = sorted({**locked(), "torch": torch}.items())
    lines = [f"| {name} | {version} | {licence(name)} | {purposes[name]} |" for name, version in packages]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
