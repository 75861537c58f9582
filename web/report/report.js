// SPDX-License-Identifier: BSD-3-Clause
// Draws the report from the data in #run. Text goes in as text, never as markup. Nothing is loaded from outside.
"use strict";

const root = document.documentElement;
const faults = [];

function fault(what) {
  faults.push(String(what));
  root.dataset.errors = faults.join(" | ");
  root.dataset.ready = "failed";
  const box = document.createElement("p");
  box.className = "fault";
  box.textContent = "This page could not be drawn in full: " + what;
  document.body.prepend(box);
}
window.addEventListener("error", (e) => fault(e.message || "script error"));
window.addEventListener("unhandledrejection", (e) => fault(e.reason && e.reason.message ? e.reason.message : e.reason));
document.addEventListener("securitypolicyviolation", (e) => fault("refused to load " + e.blockedURI));

const run = JSON.parse(document.getElementById("run").textContent);

// ---- elements ----

function element(tag, { cls, text, parent, ...attributes } = {}, children = []) {
  const e = document.createElement(tag);
  if (cls) e.className = cls;
  if (text !== undefined) e.textContent = text;
  for (const [name, value] of Object.entries(attributes)) e.setAttribute(name, value);
  for (const child of children) e.append(child);
  if (parent) parent.append(e);
  return e;
}

function section(page, title, about) {
  element("h2", { text: title, parent: page });
  if (about) element("p", { cls: "about", text: about, parent: page });
  return element("div", { cls: "row", parent: page });
}

/** A card with a plot; `figure` makes {data, layout} from the colours in force. */
const plots = [];
function card(row, id, title, about, figure, shape = "") {
  const box = element("section", { cls: "card" + (shape.includes("wide") ? " wide" : ""), parent: row });
  element("h3", { text: title, parent: box });
  if (about) element("p", { cls: "about", text: about, parent: box });
  const div = element("div", { cls: "plot " + shape.replace("wide", ""), id, parent: box });
  plots.push({ div, figure });
}

function table(parent, header, rows, numbers = []) {
  const cells = (tag, row) => row.map((text, i) => element(tag, { text, cls: numbers.includes(i) ? "number" : "" }));
  const scroll = element("div", { cls: "scroll", parent });
  const body = element("table", { cls: numbers.length ? "figures" : "", parent: scroll });
  if (header.length) element("tr", { parent: body }, cells("th", header));
  for (const row of rows) element("tr", { parent: body }, cells("td", row));
  hintAtScroll(scroll);
}

/** What is wider than its place says so: a shadow at the side where more is, and words above. */
function hintAtScroll(box) {
  const hint = element("p", { cls: "hint", text: "wider than the page: scroll sideways \u2192" });
  box.before(hint);
  const look = () => {
    const rest = box.scrollWidth - box.clientWidth;
    box.classList.toggle("more-right", box.scrollLeft < rest - 2);
    box.classList.toggle("more-left", box.scrollLeft > 2);
    hint.hidden = rest <= 2;
  };
  box.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(box);
  look();
}

// ---- look ----

const style = getComputedStyle(root);
const colour = (name) => style.getPropertyValue("--" + name).trim();

/** The colour with an opacity: "#rrggbb" -> rgba(). */
function faint(name, opacity) {
  const c = parseInt(colour(name).slice(1), 16);
  return `rgba(${c >> 16}, ${(c >> 8) & 255}, ${c & 255}, ${opacity})`;
}

/** Without a mouse, dragging scrolls the page and the buttons that come on hovering would stay. */
const touch = !window.matchMedia("(hover: hover)").matches;

const axis = (title, more = {}) => ({
  title: { text: title, standoff: 8, font: { size: 12 } },
  gridcolor: colour("grid"),
  zerolinecolor: colour("line"),
  linecolor: colour("line"),
  automargin: true,
  ...more,
});

function layout(more) {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("ink") },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("soft"), activecolor: colour("estimate") },
    dragmode: touch ? false : "zoom",
    margin: { l: 52, r: 12, t: 28, b: 42 },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 11 }, itemsizing: "constant" },
    showlegend: true,
    hovermode: "x unified",
    hoverlabel: { bgcolor: colour("card"), bordercolor: colour("line"), font: { color: colour("ink") } },
    ...more,
  };
}

const time = () => axis("time [s]");

/** A line that is broken where there was no pose. */
function line(name, series, ink, more = {}) {
  const x = [], y = [];
  series.t.forEach((t, i) => {
    if (i > 0 && (run.lost || []).some((l) => l.from >= series.t[i - 1] && l.to <= t)) {
      x.push(t);
      y.push(null);
    }
    x.push(t);
    y.push(series.y[i]);
  });
  return { type: "scatter", mode: "lines", name, x, y, line: { color: colour(ink), width: 1.5 }, ...more };
}

/** Marks the stretches without pose. */
const lostShapes = () => (run.lost || []).map((l) => ({
  type: "rect", xref: "x", yref: "paper", x0: l.from, x1: l.to, y0: 0, y1: 1, layer: "below",
  fillcolor: faint("bad", 0.14), line: { width: 0 },
}));

/** The area from -bound to +bound, or from 0 to it. */
function band(name, bound, both, ink) {
  const x = both ? bound.t.concat(bound.t.slice().reverse()) : bound.t;
  const y = both ? bound.y.concat(bound.y.map((v) => -v).reverse()) : bound.y;
  return {
    type: "scatter", mode: "lines", name, x, y, fill: both ? "toself" : "tozeroy", fillcolor: faint(ink, both ? 0.09 : 0.16),
    line: { width: 1, color: faint(ink, 0.35) }, hoverinfo: "skip",
  };
}

const largest = (series) => series.y.reduce((m, v) => Math.max(m, Math.abs(v)), 0);

/** Ranges around the paths: the map is drawn as far as it lies there. */
function aroundPaths(axis) {
  const values = run.paths.flatMap((p) => p[axis]);
  const low = values.reduce((a, b) => Math.min(a, b)), high = values.reduce((a, b) => Math.max(a, b));
  const margin = Math.max(0.5, 0.3 * (high - low));
  return [low - margin, high + margin];
}

const median = (series) => series.y.map(Math.abs).sort((a, b) => a - b)[series.y.length >> 1] || 0;

/** A range that shows the errors in full, and the edge of their bounds unless that would make the errors small. */
function rangeOf(errors, bounds, both) {
  const error = Math.max(...errors.map(largest));
  const bound = Math.max(0, ...bounds.filter(Boolean).map(median));
  const top = 1.1 * Math.max(error, Math.min(bound, 6 * error)) || 1;
  return both ? [-top, top] : [0, top];
}

// ---- plots ----

const pathInk = { estimate: "estimate", truth: "truth" };

function trajectory3d() {
  const data = [];
  if (run.map) {
    data.push({ type: "scatter3d", mode: "markers", name: "map", ...run.map, marker: { size: 1.6, color: colour("map") }, hoverinfo: "skip" });
  }
  for (const path of run.paths) {
    data.push({
      type: "scatter3d", mode: "lines", name: path.name, x: path.x, y: path.y, z: path.z,
      line: { color: colour(pathInk[path.role]), width: path.role === "truth" ? 5 : 3 },
      customdata: path.t, hovertemplate: "%{x:.3f}, %{y:.3f}, %{z:.3f} m<br>%{customdata:.3f} s",
    });
  }
  const a = (title) => ({ title: { text: title }, gridcolor: colour("line"), zerolinecolor: colour("line"), color: colour("soft"), showbackground: false });
  const far = window.innerWidth < 600 ? 1.3 : 1; // else the sides are cut off on a phone
  const scene = { aspectmode: "data", xaxis: a("x [m]"), yaxis: a("y [m]"), zaxis: a("z [m]"), camera: { eye: { x: 1.35 * far, y: -1.55 * far, z: 0.95 * far }, center: { x: 0, y: 0, z: -0.15 } } };
  return { data, layout: layout({ scene, margin: { l: 0, r: 0, t: 24, b: 0 }, hovermode: "closest" }) };
}

function topView() {
  const data = [];
  if (run.map) {
    data.push({ type: "scatter", mode: "markers", name: "map", x: run.map.x, y: run.map.y, marker: { size: 2, color: colour("map") }, hoverinfo: "skip" });
  }
  for (const path of run.paths) {
    data.push({
      type: "scatter", mode: "lines", name: path.name, x: path.x, y: path.y,
      line: { color: colour(pathInk[path.role]), width: path.role === "truth" ? 4 : 2 },
      customdata: path.t, hovertemplate: "%{x:.3f}, %{y:.3f} m<br>%{customdata:.3f} s",
    });
  }
  const first = run.paths[run.paths.length - 1];
  data.push({ type: "scatter", mode: "markers", name: "start", x: [first.x[0]], y: [first.y[0]], marker: { size: 9, symbol: "circle-open", line: { width: 2 }, color: colour("ink") }, hoverinfo: "skip" });
  return { data, layout: layout({ xaxis: axis("x [m]", { range: aroundPaths("x") }), yaxis: axis("y [m]", { range: aroundPaths("y"), scaleanchor: "x" }), hovermode: "closest" }) };
}

const errorOverTime = (series, bound, unit) => () => {
  const data = [];
  if (bound) data.push(band("3 sigma of the covariance", bound, false, "estimate"));
  data.push(line("error", series, "estimate"));
  return { data, layout: layout({ shapes: lostShapes(), xaxis: time(), yaxis: axis(`error [${unit}]`, { range: rangeOf([series], [bound], false) }) }) };
};

const errorByAxis = (axes, unit) => () => {
  const data = [];
  for (const a of axes) {
    if (a.bound) data.push({ ...band(a.name + ", 3 sigma", a.bound, true, a.ink), legendgroup: a.name, showlegend: false });
    data.push({ ...line(a.name, a.error, a.ink), legendgroup: a.name });
  }
  return { data, layout: layout({ shapes: lostShapes(), xaxis: time(), yaxis: axis(`error [${unit}]`, { range: rangeOf(axes.map((a) => a.error), axes.map((a) => a.bound), true) }) }) };
};

const distribution = (cdf, unit) => () => ({
  data: [{
    type: "scatter", mode: "lines", name: "estimate", x: cdf.x, y: cdf.y, line: { color: colour("estimate"), width: 2 },
    hovertemplate: `%{y:.0%} of the poses within %{x:.4g} ${unit}<extra></extra>`,
  }],
  layout: layout({
    xaxis: axis(`error [${unit}]`, { rangemode: "tozero" }),
    yaxis: axis("share of poses within", { range: [0, 1.02], tickformat: ".0%" }),
    hovermode: "closest",
  }),
});

function latency() {
  const inks = ["stage1", "stage2", "stage3", "stage4", "stage5"];
  const data = run.latency.stages.map((s, i) => ({
    type: "scatter", mode: "lines", name: s.name, x: s.x, y: s.y,
    line: { shape: "hv", width: 1.6, color: colour(inks[i] || "ink") }, fill: "tozeroy", fillcolor: faint(inks[i] || "ink", 0.1),
  }));
  return { data, layout: layout({ xaxis: axis("wall time [ms]", { type: "log", dtick: 1 }), yaxis: axis("share of updates", { tickformat: ".0%", rangemode: "tozero" }), hovermode: "closest" }) };
}

const healthInk = { waiting: "idle", initialising: "idle", tracking: "good", degraded: "warm", ambiguous: "warm", lost: "bad" };

/** Colours the background by health, with a legend entry for each state that occurs. */
function healthBackground() {
  const shapes = (run.health || []).map((h) => ({
    type: "rect", xref: "x", yref: "paper", x0: h.from, x1: h.to, y0: 0, y1: 1, layer: "below",
    fillcolor: faint(healthInk[h.state], h.state === "tracking" ? 0.08 : 0.22), line: { width: 0 },
  }));
  const states = [...new Set((run.health || []).map((h) => h.state))];
  const legend = states.map((s) => ({
    type: "scatter", mode: "markers", name: s, x: [null], y: [null],
    marker: { symbol: "square", size: 10, color: faint(healthInk[s], 0.5) }, hoverinfo: "skip",
  }));
  return { shapes, legend };
}

const activity = (entries, unit) => () => {
  const { shapes, legend } = healthBackground();
  const data = entries.map(([name, series, ink]) => line(name, series, ink)).concat(legend);
  return { data, layout: layout({ shapes, xaxis: time(), yaxis: axis(unit, { rangemode: "tozero" }) }) };
};

// ---- page ----

function head() {
  const box = document.getElementById("head");
  const title = element("h1", { text: run.title + " ", parent: box });
  if (run.status) element("span", { cls: "badge " + run.status, text: run.status, parent: title });
  if (run.subtitle) element("p", { cls: "subtitle", text: run.subtitle, parent: box });
  const tiles = element("div", { cls: "tiles", parent: box });
  for (const t of run.tiles) {
    const tile = element("div", { cls: "tile " + (t.level || ""), parent: tiles });
    element("div", { cls: "label", text: t.label, parent: tile });
    const value = element("div", { cls: "value", text: t.value, parent: tile });
    if (t.unit) element("span", { cls: "unit", text: t.unit, parent: value });
    if (t.note) element("div", { cls: "note", text: t.note, parent: tile });
  }
}

function overlays(page) {
  if (!run.overlays || !run.overlays.length) return;
  element("h2", { text: "What the tracker saw", parent: page });
  element("p", { cls: "about", parent: page,
    text: "Events of the last moments (red: brighter, blue: darker; fading with age) and the map projected with the estimated pose (green: matched with events, grey: not)." });
  const strip = element("div", { cls: "strip", parent: page });
  for (const o of run.overlays) {
    element("figure", { parent: strip }, [
      element("img", { src: "data:image/png;base64," + o.png, alt: "map over events at " + o.caption, width: o.width, height: o.height }),
      element("figcaption", { text: o.caption }),
    ]);
  }
  hintAtScroll(strip);
}

function errors(page) {
  const e = run.errors;
  if (!e) return;
  const row = section(page, "Error against ground truth", e.about);
  const bounds = e.position.some((a) => a.bound) ? "; shaded: 3 sigma of the covariance" : "";
  card(row, "ate", "Position error", "", errorOverTime(e.ate, e.ate_bound, "mm"));
  card(row, "are", "Rotation error", "", errorOverTime(e.are, e.are_bound, "deg"));
  card(row, "position-axes", "Position error by axis of the map", "estimate minus truth" + bounds, errorByAxis(e.position, "mm"));
  card(row, "rotation-axes", "Rotation error by axis of the body", "estimate relative to truth" + bounds, errorByAxis(e.rotation, "deg"));
  card(row, "cdf-ate", "Distribution of the position error (ATE)", "", distribution(e.cdf_ate, "mm"));
  card(row, "cdf-are", "Distribution of the rotation error (ARE)", "", distribution(e.cdf_are, "deg"));
}

function work(page) {
  if (!run.activity) return;
  const row = section(page, "Work and health");
  if (run.latency) {
    card(row, "latency", "Wall time of an update by stage", "", latency);
    const box = element("section", { cls: "card", parent: row });
    element("h3", { text: "Median, p99 and largest [ms]", parent: box });
    table(box, ["stage", "median", "p99", "largest"], run.latency.table, [1, 2, 3]);
  }
  card(row, "events", "Events read, and kept by the noise filter", "background: health", activity([["read", run.activity.read, "estimate"], ["kept", run.activity.kept, "warm"]], "events [million / s]"));
  card(row, "points", "Map points chosen, and matched with events", "background: health", activity([["chosen", run.activity.points, "truth"], ["matched", run.activity.matched, "estimate"]], "points per update"));
  if (run.health.length) {
    const states = element("section", { cls: "card wide", parent: row });
    element("h3", { text: "Changes of health", parent: states });
    table(states, ["from [s]", "state", "reason"], run.health.map((h) => [h.from.toFixed(3), h.state, h.reason]), [0]);
  }
}

function details(page) {
  for (const d of run.details || []) {
    const box = element("details", { parent: page }, [element("summary", { text: d.title })]);
    table(box, [], d.rows);
  }
}

function build() {
  document.title = run.title;
  head();
  const page = document.getElementById("page");
  page.replaceChildren();
  const row = section(page, "Trajectory");
  if (run.paths.length) {
    card(row, "trajectory", "In space", "", trajectory3d, "tall");
    card(row, "top", "From above", "", topView, "tall");
  }
  overlays(page);
  start(page);
  errors(page);
  motion(page);
  biases(page);
  calibration(page);
  work(page);
  details(page);
  document.getElementById("foot").textContent = run.foot;
}

/** Unpacks and runs the plot library, which stands in the page as a third of its size. */
async function loadPlotly() {
  if (!window.DecompressionStream) throw new Error("the browser is older than 2023 and cannot unpack the plot library");
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  element("script", { text: await new Response(stream).text(), parent: document.head });
}

async function draw() {
  for (const { div, figure } of plots) {
    const { data, layout: l } = figure();
    await Plotly.react(div, data, l, {
      responsive: true, displaylogo: false, displayModeBar: touch ? false : "hover", modeBarButtonsToRemove: ["lasso2d", "select2d"],
    });
    div.dataset.drawn = "yes";
  }
}

build();
loadPlotly().then(draw).then(() => {
  root.dataset.plots = plots.length;
  if (!faults.length) root.dataset.ready = "ok";
});
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
