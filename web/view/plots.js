// SPDX-License-Identifier: BSD-3-Clause
// The plots over time, and a mark on them at the time that is shown.

const root = document.documentElement;
const sigma = (v) => 1000 * Math.sqrt(v);
const PLOTS = [
  { id: "plot-rate", title: "events, million a second", lines: [["rate_mev_s", "", 1]] },
  { id: "plot-latency", title: "delay, ms", lines: [["latency_ms", "", 1]], cut: true },
  { id: "plot-sigma", title: "sigma: mm, hundredths of a degree",
    lines: [["cxx", "x", sigma], ["cyy", "y", sigma], ["czz", "z", sigma], ["rotation_deg", "rotation", 100]] },
  { id: "plot-gyro", title: "gyroscope's bias, mrad/s",
    lines: [["bgx", "x", 1000], ["bgy", "y", 1000], ["bgz", "z", 1000]] },
  { id: "plot-accel", title: "accelerometer's bias, mm/s²",
    lines: [["bax", "x", 1000], ["bay", "y", 1000], ["baz", "z", 1000]] },
  { id: "plot-points", title: "map points: chosen, matched",
    lines: [["points", "chosen", 1], ["matched", "matched", 1]] },
];
const INK = ["#4cc2ff", "#ffb020", "#3ddc84", "#ff7ab6"];
const MOST = 1200; // values of a line

const markAt = (t) => (t === null ? [] : [{
  type: "line", x0: t, x1: t, yref: "paper", y0: 0, y1: 1, line: { color: "#dbe3ec", width: 1 },
}]);

/** A few updates that took long must not flatten all others: the range ends above 99 % of the values, and says so. */
function cutRange(plot, values) {
  const sorted = values.filter((v) => v !== null).sort((a, b) => a - b);
  if (!plot.cut || sorted.length < 50) return {};
  const high = 2 * sorted[Math.floor(0.99 * sorted.length)], largest = sorted[sorted.length - 1];
  return largest > high && high > 0 ? { range: [0, high], note: `, up to ${largest.toFixed(0)}` } : {};
}

function layout(plot, range, note, now) {
  return {
    title: { text: plot.title + (note ?? ""), font: { size: 12, color: "#dbe3ec" }, x: 0.02, y: 0.97 },
    margin: { l: 42, r: 8, t: 24, b: 22 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { size: 10, color: "#8d9aa8" }, showlegend: plot.lines.length > 1,
    legend: { orientation: "h", x: 1, xanchor: "right", y: 1.16, bgcolor: "rgba(0,0,0,0)" },
    xaxis: { gridcolor: "#2c3540", zeroline: false, fixedrange: true },
    yaxis: {
      gridcolor: "#2c3540", zeroline: false, fixedrange: true, ...(range ? { range } : { rangemode: "tozero" }),
    },
    shapes: markAt(now),
  };
}

/** `rows`: what is to be drawn; `at(row, name)`: a number of theirs or null; `now`: where the mark stands, or null. */
export function drawPlots(rows, at, now) {
  const step = Math.ceil(rows.length / MOST);
  const part = step > 1 ? rows.filter((_, i) => i % step === 0) : rows;
  const t = part.map((row) => at(row, "t"));
  for (const plot of PLOTS) {
    const value = (row, name, scale) => {
      const number = at(row, name);
      return number === null ? null : typeof scale === "function" ? scale(number) : scale * number;
    };
    const data = plot.lines.map(([name, label, scale], i) => ({
      x: t, y: part.map((row) => value(row, name, scale)), name: label, mode: "lines",
      line: { width: 1.2, color: INK[i] }, hoverinfo: "x+y",
    }));
    const { range, note } = cutRange(plot, data[0].y);
    Plotly.react(plot.id, data, layout(plot, range, note, now), { displayModeBar: false, responsive: true });
  }
  root.dataset.plots = PLOTS.length;
}

export function moveMark(now) {
  for (const plot of PLOTS) Plotly.relayout(plot.id, { shapes: markAt(now) });
}

/** `take` is told the time of a point that is clicked on. */
export function onPick(take) {
  for (const plot of PLOTS) document.getElementById(plot.id).on("plotly_click", (e) => take(e.points[0].x));
}
