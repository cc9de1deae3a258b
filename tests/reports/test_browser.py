"""The page in a browser: it draws, selects, sorts, filters and enlarges, without a word in the console."""

from __future__ import annotations

import shutil
import subprocess
from html import unescape

import pytest

from reports import render

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

# What a user does, and what the page then shows, written where the dump of the page can be searched for it.
USE = """
const drawn = setInterval(() => {
  if (document.querySelectorAll(".plot .main-svg").length < 5) return;
  clearInterval(drawn);
  const said = [];
  const rows = () => [...document.querySelectorAll("#cells tbody tr")].filter((row) => !row.hidden);
  const heading = (text) => [...document.querySelectorAll("#cells th")].find((th) => th.textContent === text);
  const column = (text) => rows().map((row) => row.cells[heading(text).cellIndex].firstChild.textContent.trim());
  const galleries = () => [...document.querySelectorAll(".gallery:not([hidden])")].map((g) => g.dataset.scene);
  heading("NRMSE").click(); said.push("up " + column("NRMSE"));
  heading("NRMSE").click(); said.push("down " + column("NRMSE"));
  const filters = document.getElementById("filters");
  filters.elements.text.value = "HALL"; filters.dispatchEvent(new Event("input"));
  said.push("found " + rows().length + " " + filters.querySelector("output").textContent);
  said.push("first " + galleries());
  const light = document.querySelector("#selectors select[name=light]");
  light.value = "hall"; light.dispatchEvent(new Event("change", { bubbles: true }));
  said.push("second " + galleries() + location.hash);
  const viewer = document.getElementById("viewer");
  document.querySelector(".gallery:not([hidden]) img").click();
  const caption = () => viewer.open + " " + viewer.querySelector("p").textContent;
  const press = (key) => viewer.dispatchEvent(new KeyboardEvent("keydown", { key }));
  said.push("view " + caption()); press("ArrowRight"); said.push("right " + caption());
  press("ArrowDown"); said.push("below " + caption());
  const out = document.createElement("pre"); out.id = "said"; out.textContent = said.join("\\n");
  document.body.append(out);
}, 100);
"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on PATH: the page's script is not tried")
def test_the_page_can_be_used(make, tmp_path):
    scenes = [make.scene("studio"), make.scene("hall"), make.scene("dark", image=None, reference_rms=0.0)]
    cells = [make.cell(scene, error, 1e-4 / error) for scene in scenes[:2] for error in (0.02, 0.1, 0.003)]
    html = render(make.records(scenes, cells), "latest").replace("</body>", f"<script>{USE}</script></body>")
    page = tmp_path / "report.html"
    page.write_text(html, encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
             "--disable-component-update", "--disable-sync", "--enable-logging=stderr", "--virtual-time-budget=60000",
             f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom"]  # fmt: skip
    ended = subprocess.run([CHROMIUM, *flags, page.as_uri()], capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in ended.stderr
    words = unescape(ended.stdout).replace("\N{NO-BREAK SPACE}", " ").partition('<pre id="said">')[2]
    said = dict(line.split(" ", 1) for line in words.partition("</pre>")[0].split("\n"))
    assert said == {
        "up": "0.300 %,0.300 %,2.00 %,2.00 %,10.0 %,10.0 %",
        "down": "10.0 %,10.0 %,2.00 %,2.00 %,0.300 %,0.300 %",
        "found": "3 3 of 6 rows",
        "first": "0",
        "second": "1#scene=1",
        "view": "true reference",
        "right": "true shrm(eps=0.02)",
        "below": "true shrm(eps=0.02) − reference",
    }
