"""The page: complete, self-contained, escaped, and there for every kind of run."""

from __future__ import annotations

import base64
import gzip
import json
import re
import time
from html.parser import HTMLParser

import numpy as np
import pytest

from envbench.errors import BadInput
from envbench.metrics import METRICS
from envbench.records import Score, Status
from envbench.store import Store
from reports import render, write

_VOID = {"meta", "link", "img", "input", "br"}
_LOADING = {"src", "href", "srcset", "action", "poster", "data", "background"}


class Page(HTMLParser):
    """A parsed page: fails on tags that do not nest; keeps references, scripts, texts and table rows."""

    def __init__(self, html):
        super().__init__()
        self.open, self.references, self.scripts, self.ids, self.texts, self.rows = [], [], {}, set(), [], []
        self.images = 0
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.references += [value for name, value in attrs.items() if name in _LOADING]
        assert not [name for name in attrs if name.startswith("on")]
        self.ids.add(attrs.get("id"))
        self.images += tag == "img"
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th") and "tr" in self.open:
            self.rows[-1].append("")
        if tag not in _VOID:
            self.open.append(tag if tag != "script" else f"script {attrs.get('id')}")

    def handle_endtag(self, tag):
        assert self.open.pop().split()[0] == tag

    def handle_data(self, text):
        if self.open and self.open[-1].startswith("script"):
            name = self.open[-1].split()[1]
            self.scripts[name] = self.scripts.get(name, "") + text
        elif "style" not in self.open:
            self.texts.append(text)
            if {"td", "th"} & set(self.open) and self.rows:
                self.rows[-1][-1] += text

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.texts))

    @property
    def data(self):
        return json.loads(self.scripts["data"], parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


@pytest.fixture(scope="module")
def full(make):
    """A run with all that a run can hold: three lights, two materials, every status."""
    scenes = [make.scene(light, material) for light in ("studio", "hall", "black") for material in ("phong", "skin")]
    scenes[4] = make.scene("black", "phong", reference_rms=0.0, reference_floor=0.0, notes=("the light is all black",))
    scenes[5] = make.scene("black", "skin", image=None, reference_floor=0.02)
    cells = [make.cell(s, e, e / 10, settings={"eps": e}) for s in scenes[:4] for e in (0.1, 0.01)]
    undefined = (Score("nrmse", np.nan), Score("rmse", 2.5e-5))
    cells.append(make.cell(scenes[4], method="angular", settings={}, scores=undefined))
    cells.append(
        make.cell(scenes[5], scores=(Score("nrmse", 1e-4, 0.0, 4.2e-4, below_floor=True),), lacks=("subsurface",))
    )
    bad = [status for status in Status if status is not Status.OK]
    cells += [make.ended(scenes[0], status, f"reason of {status.name}", settings={"n": 1}) for status in bad]
    cells.append(make.ended(make.scene("lost"), Status.FAILED, "reference failed: no rays", settings={"n": 2}))
    return make.records(scenes, cells)


@pytest.fixture(scope="module")
def page(full):
    return Page(render(full, "latest"))


def test_it_opens_offline(full, page):
    assert all(ref.startswith(("#", "data:")) for ref in page.references)
    html = render(full, "latest")
    assert not re.search(r"https?://|@import|url\(", html)
    plotly = gzip.decompress(base64.b64decode(page.scripts["plotly"])).decode()
    assert plotly.lstrip().startswith("/**\n* plotly.js")


def test_every_cell_has_its_row_and_every_reason_is_told(full, page):
    rows = [row for row in page.rows if (len(row) > 10 and row[0] in ("studio", "hall", "black")) or "lost" in row[0]]
    table = [row for row in rows if any(status in row[4] for status in Status)]
    assert len(table) == len(full.cell_results)
    for cell, row in zip(full.cell_results, table, strict=True):
        assert cell.method in row[2]
        assert cell.status in row[4]
        assert all(f"{key}={value}" in row[3] for key, value in cell.settings.items())
    for cell in full.cell_results:
        assert page.text.count(cell.reason) >= 2 or not cell.reason  # in its row, and among those not ok


def test_numbers_are_worded_as_they_are_meant(page):
    assert "< 0.0420 %" in page.text  # an upper bound, not the value
    assert "below noise floor" in page.text
    assert "undefined RMSE 2.50×10⁻⁵" in page.text
    assert "lacks subsurface" in page.text
    assert "1.23 MB" in page.text
    assert "target missed" in page.text
    assert "the light is all black" in page.text
    assert "no reference" in page.text


def test_metrics_machine_and_suite_are_told(full, page):
    assert all(metric.formula in "".join(page.texts) for metric in METRICS.values())
    assert '{"drjit": 2}' in page.text
    assert "a processor, 2 cores, threads (drjit 2), 8.00 GB" in page.text
    assert "3.9.1" in page.text
    assert full.info.suite_text.strip() in page.text
    assert "15.0 % of it harness overhead" in page.text
    assert {"answer", "summary", "scene", "reference", "troubles", "metrics", "machine", "reproduce"} <= page.ids


def test_plots_hold_what_was_scored_and_timed(full, page):
    data = page.data
    assert len(data["scenes"]) == 6
    assert len(data["points"]) == 9  # 8 with an error, one with an upper bound
    point = data["points"][0]
    assert (point["y"], point["low"], point["high"]) == pytest.approx((0.1, 0.095, 0.105))
    assert point["times"]["change"]["x"] == pytest.approx(0.01)
    assert [point["times"][phase]["x"] for phase in ("prepare", "relight", "frame", "shade")] == pytest.approx(
        [0.02, 0.007, 0.001, 0.002]
    )
    assert [p["below"] for p in data["points"]] == [False] * 8 + [True]
    assert data["points"][-1]["y"] == pytest.approx(4.2e-4)
    assert data["scenes"][4]["floor"] is None


def test_images_of_reference_method_and_difference(page):
    # Five scenes have images, with 9 cells of images in all; the viewer has one more.
    assert page.images == 5 + 2 * 9 + 1


@pytest.mark.parametrize(
    "evil", ["<script>alert(1)</script>", "</script><img src=x>", '" onload="x', "{{ 7 * 7 }}", "</style>"]
)
def test_names_are_text_wherever_they_stand(make, evil):
    scene = make.scene(
        evil, evil, geometry=evil, view=evil, name=evil, notes=(evil,), effects=(evil,), reference_key=evil
    )
    cells = [
        make.cell(scene, method=evil, settings={evil: evil}, description={evil: evil}, lacks=(evil,)),
        make.ended(scene, Status.FAILED, evil),
    ]
    extra = {"suite": evil, "suite_text": evil, "machine": {evil: evil}, "versions": {evil: evil}, "started": evil}
    page = Page(render(make.records([scene], cells, **extra), "latest"))
    assert all(ref.startswith(("#", "data:")) for ref in page.references)
    assert set(page.scripts) == {"data", "plotly", "None"}
    assert page.data["scenes"][0]["light"] == evil
    # Plotly reads a little HTML in hover texts: what it gets is escaped once more.
    assert "<" not in page.data["points"][0]["settings"]
    assert evil in "".join(page.texts)


def test_settings_of_any_json_type(make):
    settings = {"a": None, "b": [1, {"c": 2.5}], "d": True, "e": "text", "f": {}, "g": 1e-9, "h": "é"}
    scene = make.scene()
    page = Page(render(make.records([scene], [make.cell(scene, settings=settings)]), "latest"))
    assert 'a=null, b=[1, {"c": 2.5}], d=true, e=text, f={}, g=1e-09, h=é' in page.text


def runs(make):
    scene = make.scene()
    black = make.scene(reference_rms=0.0, reference_floor=0.0, image=np.zeros((4, 4, 3), np.float32))
    undefined = make.cell(black, scores=(Score("nrmse", np.nan), Score("rmse", 0.0)), image=black.image)
    odd = (Score("nrmse", 0.0, 0.0, 0.0), Score("psnr", np.inf), Score("of a user", -1e-12), Score("ssim", np.nan))
    still = make.cell(scene, timings=make.timings(0.0))
    return {
        "nothing": make.records([], []),
        "no cell": make.records([scene], []),
        "no scene": make.records([], [make.ended(scene, Status.CRASHED, "signal 11")]),
        "no images": make.records([make.scene(image=None)], [make.cell(make.scene(image=None))]),
        "all failed": make.records([scene], [make.ended(scene, Status.FAILED, "no")]),
        "all black": make.records([black], [undefined]),
        "odd scores": make.records([scene], [make.cell(scene, scores=odd)]),
        "no time": make.records([scene], [still]),
        "no timings": make.records([scene], [make.cell(scene, timings=())]),
        "other size": make.records([scene], [make.cell(scene, image=np.ones((3, 5, 3), np.float32))]),
        "NaN reference": make.records([make.scene(reference_rms=np.nan, reference_floor=np.nan)], [make.cell(scene)]),
    }


@pytest.mark.parametrize("name", [
    "nothing", "no cell", "no scene", "no images", "all failed", "all black", "odd scores", "no time", "no timings",
    "other size", "NaN reference",
])  # fmt: skip
def test_every_kind_of_run_gives_a_page(make, name):
    page = Page(render(runs(make)[name], "latest"))
    assert page.data["points"] == [] or name not in ("all failed", "all black", "no scene", "odd scores")
    assert "has not finished" not in page.text


def test_an_unfinished_run_says_so(make):
    scene = make.scene()
    running = make.records([scene], [make.cell(scene)], finished=None, wall_seconds=None, overhead_seconds=None)
    text = Page(render(running, "latest")).text
    assert "This run has not finished" in text
    assert "./bench run quick --resume" in text


def test_500_cells_take_seconds_and_stay_small(make):
    scenes = [make.scene(f"light {i}", image=make.ball(64)) for i in range(50)]
    cells = [make.cell(scene, e / 1000) for scene in scenes for e in range(1, 11)]
    start = time.perf_counter()
    html = render(make.records(scenes, cells), "latest")
    # 1,050 images of 64 x 64 take at most their raw size in base64, the page besides 4 kB a cell, plotly 2 MB.
    assert len(html) < 1050 * 64 * 64 * 4 * 4 / 3 + 500 * 4000 + 2.5e6
    assert time.perf_counter() - start < 10
    assert len(Page(html).data["points"]) == 500


def test_it_is_written_from_the_store_in_one_piece(make, full, tmp_path):
    with Store.open(tmp_path / "runs.sqlite", create=True) as store:
        store.begin(full.info)
        for scene in full.scene_results:
            store.save_scene(full.info.id, scene)
        for cell in {cell.key: cell for cell in full.cell_results}.values():
            store.save_cell(full.info.id, cell)
        target = tmp_path / "new" / "report.html"
        assert write(store, "latest", target) == target
        first = target.read_bytes()
        assert write(store, full.info.id, target).read_bytes() == first  # same records, same bytes
        assert [entry.name for entry in target.parent.iterdir()] == ["report.html"]
        with pytest.raises(BadInput, match="is no run"):
            write(store, "another", target)
    Page(first.decode())


@pytest.mark.parametrize("place", ["a folder", "under a file", "no room"])
def test_a_place_that_cannot_be_written_is_one_line(make, tmp_path, monkeypatch, place):
    target = tmp_path / "report.html"
    if place == "a folder":
        target.mkdir()
    elif place == "under a file":
        target.write_text("old")
        target = target / "report.html"
    else:
        target.write_text("old")
        monkeypatch.setattr(
            "pathlib.Path.write_text", lambda *_, **__: (_ for _ in ()).throw(OSError(28, "No space left on device"))
        )
    with pytest.raises(BadInput, match=r"^cannot write '.*report\.html': [^\n]+$"):
        write(make.records([], []), "latest", target)
    assert place != "no room" or target.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]
