// SPDX-License-Identifier: BSD-3-Clause
// Sections of the report on the run's motion, biases, start and calibration. What is used here stands in report.js.
"use strict";

/** The area between two lines that have times of their own. */
function between(low, high, ink, name) {
  return {
    type: "scatter", mode: "lines",
    x: low.t.concat(high.t.slice().reverse()), y: low.y.concat(high.y.slice().reverse()),
    fill: "toself", fillcolor: faint(ink, 0.13), line: { width: 0, color: faint(ink, 0.4) }, hoverinfo: "skip",
    legendgroup: name, showlegend: false,
  };
}

/** A range that shows the lines in full, and their bands unless these would make the lines small. */
function rangeWithin(lines) {
  const least = (list) => list.reduce((a, b) => Math.min(a, b)), most = (list) => list.reduce((a, b) => Math.max(a, b));
  const low = Math.min(...lines.map((l) => least(l.series.y))), high = Math.max(...lines.map((l) => most(l.series.y)));
  const bandLow = Math.min(low, ...lines.map((l) => (l.low ? least(l.low.y) : low)));
  const bandHigh = Math.max(high, ...lines.map((l) => (l.high ? most(l.high.y) : high)));
  const reach = Math.max(high - low, 1e-9 + 0.02 * Math.max(Math.abs(low), Math.abs(high)));
  const from = Math.max(bandLow, low - reach), to = Math.min(bandHigh, high + reach), margin = 0.06 * (to - from) || 1;
  return [from - margin, to + margin];
}

const course = (lines, unit) => () => {
  const data = [];
  for (const l of lines) {
    if (l.low) data.push(between(l.low, l.high, l.ink, l.name));
    if (l.truth) {
      const grey = { legendgroup: l.name, showlegend: false, line: { width: 3, color: faint("truth", 0.45) } };
      data.push(line(`${l.name}, ground truth`, l.truth, "truth", grey));
    }
    data.push(line(l.name, l.series, l.ink, { legendgroup: l.name }));
  }
  const axes = { xaxis: time(), yaxis: axis(unit, { range: rangeWithin(lines) }) };
  return { data, layout: layout({ shapes: lostShapes(), ...axes }) };
};

function start(page) {
  if (!run.start) return;
  const row = section(page, "Start");
  const box = element("section", { cls: "card wide", parent: row });
  table(box, [], run.start);
}

function motion(page) {
  if (!run.motion) return;
  const row = section(page, "Motion");
  const { velocity, attitude } = run.motion;
  card(row, "velocity", "Velocity in the map", "shaded: 3 sigma of the covariance", course(velocity, "velocity [m/s]"));
  const beside = attitude.some((a) => a.truth) ? "; grey: ground truth" : "";
  const about = `turned about x (roll), then y (pitch), then z (yaw) of the map${beside}`;
  card(row, "attitude", "Attitude of the body", about, course(attitude, "angle [deg]"));
}

function biases(page) {
  if (!run.biases) return;
  const row = section(page, "Biases of the IMU");
  card(row, "gyro-bias", "Gyroscope", "", course(run.biases.gyro, "bias [mrad/s]"));
  card(row, "accel-bias", "Accelerometer", "", course(run.biases.accel, "bias [mm/s²]"));
}

function calibration(page) {
  const c = run.calibration;
  if (!c) return;
  const row = section(page, "Calibration", "Estimated on the way, from what was given and its sigma. "
    + "Give the run's calibration.yaml to the next flight with this camera.");
  const box = element("section", { cls: "card wide", parent: row });
  element("h3", { text: "Given and found", parent: box });
  table(box, ["", "given", "sigma", "found", "sigma", "change in given sigmas"], c.table, [1, 2, 3, 4, 5]);
  for (const p of c.plots) {
    const unit = p.unit ? ` [${p.unit}]` : "";
    card(row, p.id, p.title, "change from what was given; shaded: 1 sigma", course(p.lines, `change${unit}`));
  }
}
