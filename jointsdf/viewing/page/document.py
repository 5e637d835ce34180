"""HTML of a page from templates, with everything that it needs in it: styles, scripts, data."""

import base64
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from jinja2 import DictLoader, Environment, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

ASSETS = resources.files("jointsdf.viewing.page").joinpath("assets")
THREE = {"three.module.min.js": "three", "OrbitControls.js": "three/addons/controls/OrbitControls.js"}
# What a page may load: what is in it, and files beside it. Nothing from the network.
POLICY = "default-src 'none'; script-src 'unsafe-inline' data: file:; style-src 'unsafe-inline'; img-src data: file:"


def render_page(
    template: Traversable,
    *,
    modules: Sequence[Traversable],
    css: Sequence[Traversable] = (),
    shared: str = "",
    **content: Any,
) -> str:
    """The document.

    Args:
        template: A jinja2 template, in which texts are escaped.
        modules: From `page_modules`; none where `shared` has them.
        css: Further styles than those of all pages.
        shared: Path of `library_script()`'s file from the page; empty for a page that needs no other file.
        **content: Of the template; `data` becomes JSON that no text within can leave.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, loader=DictLoader({"page": _text(template)}))
    data = htmlsafe_json_dumps(content.pop("data"), allow_nan=False, separators=(",", ":"))
    if shared:
        library = Markup('<script src="{}"></script>').format(shared)
    else:
        library = Markup('<script type="importmap">{}</script>').format(Markup(import_map(modules)))  # base64 and names
    style = Markup("".join(map(_text, (ASSETS.joinpath("page.css"), *css))))
    return environment.get_template("page").render(data=data, library=library, css=style, policy=POLICY, **content)


def import_map(modules: Sequence[Traversable]) -> str:
    """JSON of modules by name, as `data:` addresses, which need no server: `page/<file>`, and three.js by its own."""
    addresses = {
        THREE.get(path.name, f"page/{path.name}"): f"data:text/javascript;base64,{_base64(path)}" for path in modules
    }
    return json.dumps({"imports": addresses})


def page_modules() -> list[Traversable]:
    """The scripts of the page of runs, and three.js."""
    own = [path for path in ASSETS.iterdir() if path.name.endswith(".js")]
    return [*own, *(ASSETS.joinpath("three", name) for name in THREE)]


def library_script() -> str:
    """A script that brings `page_modules` to each page that loads it."""
    return f"""// three.js (MIT licence, https://threejs.org) and the modules of the pages in this folder.
const map = document.createElement("script");
map.type = "importmap";
map.textContent = JSON.stringify({import_map(page_modules())});
document.head.append(map);
"""


def without_nan(value: Any) -> Any:
    """JSON's types alone, with null for NaN and infinities."""
    if isinstance(value, Mapping):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value


def _base64(path: Traversable) -> str:
    return base64.b64encode(path.read_bytes()).decode()


def _text(path: Traversable) -> str:
    return path.read_text(encoding="utf-8")
