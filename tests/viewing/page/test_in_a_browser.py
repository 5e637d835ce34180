"""A run's page in Chromium: it draws, picks, cuts, explodes, prints, and asks the network for nothing."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import Tab, browser, find_chromium
from command_line import finished
from PIL import Image

from jointsdf.viewing.page.stored_runs import view_runs

PROGRAM = find_chromium()
pytestmark = [pytest.mark.browser, pytest.mark.skipif(PROGRAM is None, reason="no Chromium: apt install chromium")]
SIZE = {"width": 1000, "height": 800}
FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def tab() -> Iterator[Tab]:
    assert PROGRAM is not None
    with browser(PROGRAM) as found:
        yield found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return view_runs([finished()], tmp_path_factory.mktemp("page") / "report.html")


def panels(tab: Tab) -> list[np.ndarray]:
    """What each panel shows, below its title, with the mouse elsewhere."""
    tab.mouse("mouseMoved", 1, 1)
    tab.run(FRAMES)
    picture = np.asarray(Image.open(io.BytesIO(tab.picture())).convert("RGB")).astype(int)
    boxes = tab.run(
        "[...document.querySelectorAll('.panel')].map((panel) => { const box = panel.getBoundingClientRect();"
        "return [box.top + 30, box.bottom, box.left, box.right].map(Math.round); })"
    )
    return [picture[top:bottom, left:right] for top, bottom, left, right in boxes]


def ink(panel: np.ndarray) -> float:
    """Share of the pixels that are not as the corner."""
    return float((np.abs(panel - panel[2, 2]).sum(axis=2) > 12).mean())


def change(one: np.ndarray, other: np.ndarray) -> float:
    return float((np.abs(one - other).sum(axis=2) > 12).mean())


def put(tab: Tab, selector: str, value: str, kind: str = "input") -> None:
    tab.run(
        f"(() => {{ const it = document.querySelector('{selector}'); it.value = '{value}';"
        f"it.dispatchEvent(new Event('{kind}')); }})()"
    )


def click_until(tab: Tab, panel: int, word: str) -> str:
    """Click places of a panel until the answer holds a word."""
    top, bottom, left, right = tab.run(
        f"(() => {{ const box = document.querySelectorAll('.panel')[{panel}].getBoundingClientRect();"
        "return [box.top, box.bottom, box.left, box.right]; })()"
    )
    for place in range(80):
        across, down = 0.25 + 0.5 * ((place * 0.618) % 1), 0.25 + 0.5 * place / 80
        tab.click(left + across * (right - left), top + down * (bottom - top))
        answer = str(tab.run("document.getElementById('readout').textContent"))
        if word in answer:
            return answer
    raise AssertionError(f"no {word} in panel {panel}")


def test_a_page_is_used(tab: Tab, page: Path) -> None:
    tab.open(page, **SIZE)
    assert tab.run("document.body.dataset.state") == "ready", tab.errors
    truth, fit = panels(tab)
    assert 0.03 < ink(truth) < 0.9
    assert 0.005 < ink(fit) < 0.9, "both are drawn, on an empty ground"

    answer = click_until(tab, 0, "part")
    assert answer.startswith("ground truth: part")
    assert "error" in answer
    assert "mm" in answer
    assert tab.run("document.querySelectorAll('#parts tr.picked').length") == 1
    picked = panels(tab)[0]
    assert change(truth, picked) > 0.01, "the other parts are paler"
    tab.run("document.querySelector('#parts tr.picked button').click()")
    assert change(truth, panels(tab)[0]) == 0

    for mode in ("error", "normal", "wrong"):
        tab.run(f"document.querySelector('input[value={mode}]').click()")
        assert change(truth, panels(tab)[0]) > 0.03, mode
    tab.run("document.querySelector('input[value=part]').click()")

    put(tab, "#plane-axis", "z")
    cut = panels(tab)
    assert change(truth, cut[0]) > 0.02
    assert "field" in click_until(tab, 1, "field")
    put(tab, "#plane-place", "0.5")
    assert change(cut[0], panels(tab)[0]) > 0.02
    assert tab.run("document.getElementById('plane-text').textContent").startswith("z = ")
    put(tab, "#plane-axis", "none")

    put(tab, "#explode", "0.6")
    assert change(truth, panels(tab)[0]) > 0.02
    put(tab, "#explode", "0")
    tab.run("document.getElementById('all-parts').click()")
    assert ink(panels(tab)[0]) == 0, "no part is shown"
    tab.run("document.getElementById('all-parts').click()")
    tab.run("document.getElementById('wireframe').click()")
    assert change(truth, panels(tab)[0]) > 0.01
    tab.run("document.getElementById('wireframe').click()")

    before = panels(tab)
    assert change(truth, before[0]) == 0
    middle = tab.run(
        "(() => { const box = document.getElementById('views').getBoundingClientRect();"
        "return [(box.left + box.right) / 2 + 80, (box.top + box.bottom) / 2]; })()"
    )
    tab.mouse("mousePressed", *middle, button="left", buttons=1, clickCount=1)
    tab.mouse("mouseMoved", middle[0] + 60, middle[1] + 20, button="left", buttons=1)
    tab.mouse("mouseReleased", middle[0] + 60, middle[1] + 20, button="left")
    turned = panels(tab)
    assert all(change(one, other) > 0.01 for one, other in zip(before, turned, strict=True)), "one camera"
    tab.run("document.getElementById('views').focus()")
    tab.call("Input.dispatchKeyEvent", type="keyDown", key="0", text="0")
    assert change(before[0], panels(tab)[0]) < 0.002, "the key starts over"
    assert len(tab.pdf()) > 20_000, "the view is printed as well"
    assert tab.errors == []
    assert {request.partition(":")[0] for request in tab.requests} == {"file"}
    assert len(tab.requests) == 1, "nothing but the page itself"


def test_dark_and_narrow(tab: Tab, page: Path) -> None:
    tab.open(page, width=420, height=900, dark=True)
    assert tab.run("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 29)"
    assert tab.run("document.documentElement.scrollWidth <= innerWidth"), "no sideways scrolling on a telephone"
    assert tab.errors == []
