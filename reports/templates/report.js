"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const fields = ["light", "material", "geometry", "view", "knob", "setting"];

  // Tables: a heading sorts. In the summary the controls filter, and a row shows its scene.
  const rows = all("#cells tbody tr");
  function sort(table, heading) {
    const column = heading.cellIndex;
    const descending = heading.getAttribute("aria-sort") === "ascending";
    all("thead th", table).forEach((other) => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", descending ? "descending" : "ascending");
    const key = (row) => row.cells[column].dataset.order;
    const number = heading.classList.contains("n");
    const compare = (a, b) => (number ? a - b : a.localeCompare(b, undefined, { numeric: true }));
    const sorted = all("tbody tr", table).sort((a, b) => {
      const [x, y] = [key(a), key(b)];
      if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
      return descending ? compare(y, x) : compare(x, y);
    });
    table.tBodies[0].append(...sorted);
  }
  for (const table of all("table.sortable"))
    for (const button of all("thead button", table))
      button.parentElement.addEventListener("click", () => sort(table, button.parentElement));

  const filters = document.getElementById("filters");
  if (filters) {
    const filter = () => {
      const text = filters.elements.text.value.toLowerCase();
      const chosen = all("select", filters).filter((select) => select.value);
      for (const row of rows) {
        const same = (select) => row.cells[select.dataset.column].dataset.order === select.value;
        row.hidden = !(row.textContent.toLowerCase().includes(text) && chosen.every(same));
      }
      filters.querySelector("output").textContent =
        `${rows.filter((row) => !row.hidden).length} of ${rows.length} rows`;
    };
    filters.addEventListener("input", filter);
    filters.addEventListener("submit", (event) => event.preventDefault());
    filters.hidden = false;
    filter();
  }

  // The chosen scene: its plots, its images, its rows.
  const selectors = document.getElementById("selectors");
  if (!selectors) return;
  const selects = all("select", selectors);
  let current = 0;

  function choose(scene) {
    current = scene;
    if (scene) history.replaceState(null, "", `#scene=${scene}`); // a link to what is shown
    selects.forEach((select) => (select.value = data.scenes[scene][select.name]));
    all(".gallery").forEach((gallery) => (gallery.hidden = +gallery.dataset.scene !== scene));
    const missing = document.getElementById("no-image");
    if (missing) missing.hidden = all(".gallery").some((gallery) => !gallery.hidden);
    rows.forEach((row) => row.classList.toggle("shown", +row.dataset.scene === scene));
    draw();
  }
  selectors.addEventListener("change", (event) => {
    const wanted = Object.fromEntries(selects.map((select) => [select.name, select.value]));
    const last = event.target.name;
    const likeness = (scene) =>
      fields.reduce((sum, f) => sum + (f in wanted && scene[f] === wanted[f] ? (f === last ? 10 : 1) : 0), 0);
    // Where the combination does not exist: the scene most like it that has what was chosen last.
    const likenesses = data.scenes.map(likeness);
    choose(likenesses.indexOf(Math.max(...likenesses)));
  });
  rows.forEach((row) =>
    row.addEventListener("click", () => {
      if (row.dataset.scene === undefined || String(getSelection())) return; // who selects text wants to copy it
      choose(+row.dataset.scene);
      document.getElementById("scene").scrollIntoView({ behavior: "smooth" });
    }),
  );
  selectors.hidden = false;

  // Plots.
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const bars = (points, of, axis) => ({
    type: "data",
    symmetric: false,
    array: points.map((p) => of(p).high - of(p)[axis]),
    arrayminus: points.map((p) => of(p)[axis] - of(p).low),
    thickness: 1,
    width: 3,
  });

  function trace(method, points, panel) {
    const time = (p) => p.times[panel];
    return {
      name: method.name,
      mode: "lines+markers",
      x: points.map((p) => time(p).x),
      y: points.map((p) => p.y),
      error_x: bars(points, time, "x"),
      error_y: bars(points, (p) => p, "y"),
      line: { color: colour(`--m${method.colour}`), width: 1.5 },
      marker: {
        color: colour(`--m${method.colour}`),
        symbol: points.map((p) => (p.below ? "triangle-down-open" : method.symbol)),
        size: 10,
        line: { color: colour(`--m${method.colour}`), width: 2 },
      },
      text: points.map((p) => `<b>${p.method}</b><br>${p.settings}<br>${p.score}<br>${panel} ${time(p).text}`),
      hovertemplate: "%{text}<extra></extra>",
    };
  }

  // Plotly's axes count in powers of ten; at least one decade, so that near points do not look far apart.
  function range(lows, highs) {
    let [low, high] = [Math.log10(Math.min(...lows)), Math.log10(Math.max(...highs))];
    const short = Math.max(0, 1 - (high - low)) / 2;
    [low, high] = [low - short, high + short];
    const margin = 0.06 * (high - low);
    return [low - margin, high + margin];
  }

  // Marks at 1, 2 and 5 of each decade; at fewer where a panel has no room for so many words.
  function ticks([low, high], word, room) {
    const values = [];
    const leading = [[1, 2, 5], [1, 3], [1]].find((digits) => digits.length * (high - low) <= room) ?? [1];
    for (let decade = Math.floor(low); decade <= high; decade++)
      for (const digit of leading) values.push(digit * 10 ** decade);
    const kept = values.filter((v) => Math.log10(v) >= low && Math.log10(v) <= high);
    return { tickmode: "array", tickvals: kept, ticktext: kept.map(word) };
  }
  const plain = (value) => String(+value.toPrecision(3));
  const percentage = (value) => `${plain(100 * value)}%`;
  const duration = (value) => {
    const [scale, unit] = [[1, "s"], [1e-3, "ms"], [1e-6, "µs"], [1e-9, "ns"]].find(([s]) => value >= 0.9999 * s) ?? [1e-9, "ns"];
    return `${plain(value / scale)} ${unit}`;
  };

  function draw() {
    if (!window.Plotly) return;
    const points = data.points.filter((point) => point.scene === current);
    const floor = data.scenes[current].floor;
    const note = document.getElementById("unplotted");
    note.hidden = points.length > 0;
    note.textContent = "No method has a relative error on this scene, so there is nothing to plot; the summary says why.";
    document.getElementById("plots").hidden = points.length === 0;
    if (points.length === 0) return;
    const floors = floor > 0 ? [floor] : [];
    const y = range([...points.map((p) => p.low), ...floors], [...points.map((p) => p.high), ...floors]);
    const axis = {
      type: "log", gridcolor: colour("--line"), linecolor: colour("--line"), zeroline: false, showline: true, mirror: true,
    };
    for (const [i, panel] of data.panels.entries()) {
      const timed = points.filter((p) => p.times[panel.id]);
      const x = timed.length ? range(timed.map((p) => p.times[panel.id].low), timed.map((p) => p.times[panel.id].high)) : [-3, 0];
      const traces = data.methods
        .map((method) => [method, timed.filter((p) => p.method === method.name)])
        .filter(([, own]) => own.length)
        .map(([method, own]) => trace(method, own, panel.id));
      const layout = {
        margin: { l: 56, r: 12, t: 8, b: i ? 26 : 44 },
        paper_bgcolor: "transparent",
        plot_bgcolor: "transparent",
        font: { family: "system-ui, sans-serif", size: i ? 11 : 12.5, color: colour("--ink") },
        showlegend: false,
        hovermode: "closest",
        hoverlabel: { bgcolor: colour("--panel"), bordercolor: colour("--line"), font: { color: colour("--ink") }, align: "left" },
        xaxis: { ...axis, range: x, tickangle: 0, ...ticks(x, duration, i ? 4 : 9), title: i ? undefined : { text: "time of one change of light" } },
        yaxis: { ...axis, range: y, ...ticks(y, percentage, i ? 7 : 12), title: i ? undefined : { text: "NRMSE" } },
        shapes: floors.map((value) => ({
          type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value, line: { dash: "dash", width: 1, color: colour("--faint") },
        })),
        annotations: i ? [] : floors.map((value) => ({
          text: data.scenes[current].floorText, xref: "paper", x: 0.005, xanchor: "left", y: Math.log10(value), yanchor: "top", showarrow: false, font: { size: 11, color: colour("--faint") },
        })),
      };
      Plotly.react(document.querySelector(`#plot-${panel.id} > div`), traces, layout, { displaylogo: false, responsive: true, displayModeBar: false });
    }
  }

  async function unpack() {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }
  const start = Number(new URLSearchParams(location.hash.slice(1)).get("scene")) || 0;
  choose(Math.min(start, data.scenes.length - 1));
  unpack().then(draw, (error) => {
    const note = document.getElementById("unplotted");
    note.hidden = false;
    note.textContent = `This browser cannot draw the plots (${error.message}): it needs DecompressionStream, as all have had since 2023.`;
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  // Paper is light, whatever the screen is.
  const paper = (on) => (document.documentElement.classList.toggle("paper", on), draw());
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));

  // Viewer: images of a scene flip in place.
  const viewer = document.getElementById("viewer");
  let shown = null;
  function view(image) {
    shown = image;
    viewer.querySelector("img").src = image.src;
    viewer.querySelector("img").alt = image.alt;
    viewer.querySelector("p").textContent = image.dataset.label;
    if (!viewer.open) viewer.showModal();
  }
  function neighbour(step) {
    const images = all(`img[data-kind=${shown.dataset.kind}]`, shown.closest(".gallery"));
    return images[(images.indexOf(shown) + step + images.length) % images.length];
  }
  all(".shots img").forEach((image) => image.addEventListener("click", () => view(image)));
  viewer.addEventListener("click", () => viewer.close());
  viewer.addEventListener("keydown", (event) => {
    const other = shown.dataset.kind === "render" ? "difference" : "render";
    const next = {
      ArrowLeft: () => neighbour(-1),
      ArrowRight: () => neighbour(1),
      ArrowUp: () => shown.parentElement.querySelector(`img[data-kind=${other}]`),
      ArrowDown: () => shown.parentElement.querySelector(`img[data-kind=${other}]`),
    }[event.key]?.();
    if (!next) return;
    event.preventDefault();
    view(next);
  });
})();
