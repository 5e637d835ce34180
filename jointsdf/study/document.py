"""LaTeX document of all tables and figures, compiled to a PDF by the TeX installed."""

import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from jointsdf.study.groups import Group
from jointsdf.study.tables.latex import escape

DOCUMENT = "report.tex"
ENGINES = ("pdflatex", "lualatex", "xelatex", "tectonic")
PREAMBLE = r"""\documentclass[10pt]{article}
\usepackage[T1]{fontenc}
\usepackage[a4paper,margin=20mm]{geometry}
\usepackage{booktabs,graphicx}
\usepackage[hidelinks]{hyperref}
\setlength{\belowcaptionskip}{4pt}
\renewcommand{\topfraction}{0.95}
\renewcommand{\textfraction}{0.05}
\title{Joint neural SDF reconstruction and segmentation: tables and figures}
\date{}
\begin{document}
\maketitle
"""


def build_document(groups: Iterable[Group], parts: Iterable[Path], names: Sequence[str]) -> str:
    """LaTeX source with a section per group of comparable runs, of its tables and figures.

    Args:
        groups: In the order of the sections.
        parts: The `.tex` files of tables and figures, relative to the document.
        names: Of tables and figures, in the order within a section.
    """
    files = {(path.parent.name, path.stem): path for path in parts}
    sections = []
    for group in groups:
        key = group.key
        title = f"Study {key['study']}, recipe {key['recipe']}, variant {key['variant']}"
        what = f"Source of shapes: {key['source']}; labels: {key['label_kind']}; protocol: {key['protocol']}."
        wanted = [(group.folder, name + group.suffix) for name in names]
        inputs = [files[name].as_posix() for name in wanted if name in files]
        pictures = rf"\graphicspath{{{{../figures/{group.folder}/}}}}"
        lines = [rf"\section{{{escape(title)}}}", escape(what), pictures, *(rf"\input{{{name}}}" for name in inputs)]
        sections.append("\n".join([*lines, r"\clearpage"]))
    return PREAMBLE + "\n\n".join(sections) + "\n\\end{document}\n"


def compile_pdf(path: Path) -> Path:
    """Compile a document to a PDF in its folder.

    Returns:
        The PDF.

    Raises:
        ValueError: No TeX is installed, or it fails. One line, with the fix.
    """
    engine = next((name for name in ENGINES if shutil.which(name)), None)
    if engine is None:
        fix = "install one, e.g. texlive-latex-recommended"
        raise ValueError(f"{path} is written, its PDF is not: no TeX found; {fix}")
    path.with_suffix(".pdf").unlink(missing_ok=True)
    options = (
        []
        if engine == "tectonic"
        else ["-no-shell-escape", "-interaction=nonstopmode", "-halt-on-error", "-file-line-error"]
    )
    done = subprocess.run([engine, *options, path.name], cwd=path.parent, capture_output=True, check=False)
    if done.returncode:
        said = done.stdout.decode(errors="replace").splitlines()
        first = next((line for line in said if ".tex:" in line or line.startswith("!")), "no message")
        raise ValueError(f"{engine} failed: {first}; all of it is in {path.with_suffix('.log')}")
    for ending in (".aux", ".out", ".log"):
        path.with_suffix(ending).unlink(missing_ok=True)
    return path.with_suffix(".pdf")
