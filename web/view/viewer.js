// SPDX-License-Identifier: BSD-3-Clause
// The viewer: map and trajectory in 3D, the events' picture, and plots over time; live from /stream, or of a recorded
// run. Text goes in as text, never as markup. Nothing is loaded from outside of this server.
import * as THREE from "./three.js";
import { OrbitControls } from "./orbit.js";
import { RecordedPictures, showPicture } from "./picture.js";
import { drawPlots, moveMark, onPick } from "./plots.js";

const $ = (id) => document.getElementById(id);
const root = document.documentElement;
const HEALTH = ["waiting", "initialising", "tracking", "degraded", "ambiguous", "lost"];
const COLOURS = [0x8d9aa8, 0x8d9aa8, 0x4cc2ff, 0xffb020, 0xff4d4d];
const MOST_ROWS = 40000;
const SPAN_S = 30; // of the plots while live

const faults = [];
function fault(what) {
  faults.push(String(what));
  root.dataset.errors = faults.join(" | ");
}
window.addEventListener("error", (e) => fault(e.message || "script error"));
window.addEventListener("unhandledrejection", (e) => fault(e.reason?.message ?? e.reason));
document.addEventListener("securitypolicyviolation", (e) => fault(`refused to load ${e.blockedURI}`));

// ---- what is known ----

let rows = []; // of numbers, in the order of `column`
let column = {};
let mode = "live";
let shown = -1; // the row on display
let following = true; // the newest

function setColumns(names) {
  column = Object.fromEntries(names.map((name, i) => [name, i]));
}
const at = (row, name) => row[column[name]];

// ---- the scene ----

const renderer = new THREE.WebGLRenderer({ canvas: $("scene"), antialias: true });
renderer.setClearColor(0x10141a);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(55, 1, 0.02, 2000);
camera.up.set(0, 0, 1);
camera.position.set(-6, -6, 6);
const controls = new OrbitControls(camera, $("scene"));
controls.enableDamping = false;
controls.addEventListener("change", draw);

const body = new THREE.Group(); // forward red, left green, up blue
for (const [axis, colour] of [[[1, 0, 0], 0xff5555], [[0, 1, 0], 0x55dd55], [[0, 0, 1], 0x5588ff]]) {
  body.add(new THREE.ArrowHelper(new THREE.Vector3(...axis), new THREE.Vector3(), 0.4, colour, 0.1, 0.06));
}
const ellipsoid = new THREE.Mesh(new THREE.SphereGeometry(1, 24, 16), new THREE.MeshBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.25, depthWrite: false }));
ellipsoid.matrixAutoUpdate = false;
const path = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true }));
path.frustumCulled = false;
const pathPositions = new Float32Array(3 * MOST_ROWS);
const pathColours = new Float32Array(3 * MOST_ROWS);
path.geometry.setAttribute("position", new THREE.BufferAttribute(pathPositions, 3));
path.geometry.setAttribute("color", new THREE.BufferAttribute(pathColours, 3));
path.geometry.setDrawRange(0, 0);
const wholePath = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.35 }));
wholePath.frustumCulled = false;
for (const name of ["position", "color"]) wholePath.geometry.setAttribute(name, path.geometry.attributes[name]);
wholePath.geometry.setDrawRange(0, 0);
scene.add(body, ellipsoid, path, wholePath);
let mapParts = [];

function showMap(map) {
  for (const part of mapParts) scene.remove(part);
  const geometry = (numbers) => new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(numbers), 3));
  mapParts = [
    new THREE.Mesh(geometry(map.triangles), new THREE.MeshBasicMaterial({ color: 0x3a4a5c, transparent: true, opacity: 0.18, side: THREE.DoubleSide, depthWrite: false })),
    new THREE.LineSegments(geometry(map.lines), new THREE.LineBasicMaterial({ color: 0x7fa8c9 })),
    new THREE.Points(geometry(map.points), new THREE.PointsMaterial({ color: 0x7fa8c9, size: 1.5, sizeAttenuation: false })),
  ];
  scene.add(...mapParts);
}

/** Looks at the map and the way so far from the side and above. */
function frameAll(map) {
  const box = new THREE.Box3().setFromArray(map.points);
  for (const row of rows) box.expandByPoint(new THREE.Vector3(at(row, "x"), at(row, "y"), at(row, "z")));
  if (box.isEmpty()) return;
  const size = Math.max(1, box.getSize(new THREE.Vector3()).length());
  box.getCenter(controls.target);
  camera.position.copy(controls.target).add(new THREE.Vector3(-0.45, -0.6, 0.5).multiplyScalar(size * Math.max(1.05, 0.9 / camera.aspect)));
  controls.update();
}

/** Principal axes of a symmetric 3x3 matrix, by Jacobi's rotations. */
function principalAxes(m) {
  const a = m.map((r) => [...r]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 20; ++sweep) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-18) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = Math.sign(theta || 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
      const c = 1 / Math.sqrt(t * t + 1), s = t * c;
      for (let k = 0; k < 3; ++k) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; ++k) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; ++k) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return { values: [a[0][0], a[1][1], a[2][2]], vectors: v };
}

const ENLARGED = 20; // sigmas of millimetres would not be seen
function showPose(row) {
  const position = new THREE.Vector3(at(row, "x"), at(row, "y"), at(row, "z"));
  if ($("follow").ariaPressed === "true") {
    camera.position.add(position).sub(controls.target);
    controls.target.copy(position);
  }
  body.position.copy(position);
  body.quaternion.set(at(row, "qx"), at(row, "qy"), at(row, "qz"), at(row, "qw"));
  const c = ["cxx", "cxy", "cxz", "cyy", "cyz", "czz"].map((name) => at(row, name));
  const { values, vectors } = principalAxes([[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]]);
  const radii = values.map((value) => ENLARGED * Math.sqrt(Math.max(value, 1e-10)));
  ellipsoid.matrix.set(
    vectors[0][0] * radii[0], vectors[0][1] * radii[1], vectors[0][2] * radii[2], position.x,
    vectors[1][0] * radii[0], vectors[1][1] * radii[1], vectors[1][2] * radii[2], position.y,
    vectors[2][0] * radii[0], vectors[2][1] * radii[1], vectors[2][2] * radii[2], position.z, 0, 0, 0, 1);
  const health = HEALTH[at(row, "health")] ?? "waiting";
  $("health").textContent = health;
  $("health").className = `health ${health}`;
  const sigma = 1000 * Math.sqrt(Math.max(c[0], c[3], c[5]));
  const speed = Math.hypot(at(row, "vx"), at(row, "vy"), at(row, "vz"));
  $("pose").textContent = `${position.x.toFixed(3)}  ${position.y.toFixed(3)}  ${position.z.toFixed(3)} m, ${speed.toFixed(2)} m/s, sigma ${sigma.toFixed(1)} mm (ellipsoid ${ENLARGED} times larger)`;
  $("clock").textContent = `${at(row, "t").toFixed(2)} s`;
  root.dataset.t = at(row, "t");
  root.dataset.pose = position.toArray().map((v) => v.toFixed(4)).join(" ");
}

function extendPath(from) {
  const colour = new THREE.Color();
  for (let i = from; i < rows.length; ++i) {
    pathPositions.set([at(rows[i], "x"), at(rows[i], "y"), at(rows[i], "z")], 3 * i);
    colour.setHex(COLOURS[at(rows[i], "health")] ?? COLOURS[0]).toArray(pathColours, 3 * i);
  }
  path.geometry.attributes.position.needsUpdate = true;
  path.geometry.attributes.color.needsUpdate = true;
  wholePath.geometry.setDrawRange(0, rows.length);
}

let drawing = false;
function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    renderer.render(scene, camera);
  });
}

function resize() {
  const box = $("scene").parentElement;
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.setSize(box.clientWidth, box.clientHeight, false);
  camera.aspect = box.clientWidth / Math.max(1, box.clientHeight);
  camera.updateProjectionMatrix();
  draw();
}
new ResizeObserver(resize).observe($("scene").parentElement);

// ---- plots ----

function rowsToPlot() {
  if (rows.length === 0) return [];
  if (mode === "run" || !following) return rows;
  const from = at(rows[rows.length - 1], "t") - SPAN_S;
  let i = rows.length;
  while (i > 0 && at(rows[i - 1], "t") >= from) --i;
  return rows.slice(i);
}

const markTime = () => (shown < 0 || (following && mode === "live") ? null : at(rows[shown], "t"));
let plotsWait = 0;
let plotted = -1; // rows of a recorded run, which do not change
function plotsSoon() {
  if (plotsWait) return;
  plotsWait = setTimeout(() => {
    plotsWait = 0;
    if (mode === "run" && plotted === rows.length) return moveMark(markTime());
    drawPlots(rowsToPlot(), at, markTime());
    if (plotted < 0) onPick(pick);
    plotted = rows.length;
  }, mode === "run" && plotted >= 0 ? 100 : 500);
}

// ---- time ----

const pictures = new RecordedPictures();

function show(index) {
  if (rows.length === 0) return;
  shown = Math.max(0, Math.min(rows.length - 1, index));
  showPose(rows[shown]);
  path.geometry.setDrawRange(0, shown + 1);
  $("time").min = at(rows[0], "t");
  $("time").max = at(rows[rows.length - 1], "t");
  $("time").value = at(rows[shown], "t");
  if (mode === "run") pictures.show(at(rows[shown], "t"));
  draw();
  plotsSoon();
}

function indexAt(t) {
  let low = 0, high = rows.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (at(rows[middle], "t") < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

function setFollowing(on) {
  following = on;
  $("live").ariaPressed = String(on);
  if (on) show(rows.length - 1);
}

function pick(t) {
  if (rows.length === 0) return; // between a restart and its first rows
  play(false);
  setFollowing(false);
  show(indexAt(t));
}
$("time").addEventListener("input", () => pick(Number($("time").value)));
$("live").addEventListener("click", () => setFollowing(true));
$("follow").addEventListener("click", () => {
  $("follow").ariaPressed = String($("follow").ariaPressed !== "true");
  show(shown);
});

/** Of a recorded run, in the time of the wall times the speed; from the start again if it is at the end. */
let playing = false;
function play(on) {
  playing = on;
  $("play").textContent = on ? "pause" : "play";
  $("play").ariaPressed = String(on);
  if (!on) return;
  const end = at(rows[rows.length - 1], "t");
  let t = shown >= rows.length - 1 ? at(rows[0], "t") : at(rows[shown], "t");
  let before = performance.now();
  const step = (now) => {
    if (!playing) return;
    t += (Number($("speed").value) * Math.max(0, now - before)) / 1000;
    before = now;
    show(indexAt(Math.min(t, end)));
    if (t >= end) return play(false);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}
$("play").addEventListener("click", () => play(!playing));
document.addEventListener("keydown", (e) => {
  if (e.key !== " " || mode !== "run" || ["BUTTON", "SELECT"].includes(e.target.tagName)) return;
  e.preventDefault();
  play(!playing);
});

function addRows(more) {
  if (rows.length + more.length > MOST_ROWS) {
    rows = rows.slice(MOST_ROWS / 2);
    shown = Math.max(0, shown - MOST_ROWS / 2);
    extendPath(0);
  }
  const from = rows.length;
  rows.push(...more);
  extendPath(from);
  root.dataset.rows = rows.length;
  if (following) show(rows.length - 1);
  else $("time").max = at(rows[rows.length - 1], "t");
}

let noticeWait = 0;
function notice(words) {
  $("notice").textContent = words;
  $("notice").hidden = false;
  clearTimeout(noticeWait);
  noticeWait = setTimeout(() => ($("notice").hidden = true), 5000);
}

// ---- the server ----

async function load() {
  const [map, history] = await Promise.all(["scene.json", "history.json"].map(async (name) => {
    const answer = await fetch(name);
    if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
    return answer.json();
  }));
  mode = history.mode;
  document.body.classList.toggle("recorded", mode === "run");
  $("title").textContent = history.title;
  document.title = `evpose: ${history.title}`;
  setColumns(history.columns);
  showMap(map);
  rows = [];
  shown = -1;
  following = mode === "live";
  addRows(history.rows);
  $("follow").ariaPressed = String(mode === "live");
  frameAll(map);
  show(mode === "live" ? rows.length - 1 : 0);
  root.dataset.loaded = 1 + Number(root.dataset.loaded ?? 0);
}

function say(state) {
  $("connection").textContent = state;
  root.dataset.connection = state;
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/stream`);
  socket.binaryType = "arraybuffer";
  let waiting = []; // what came before the history was here
  let ready = false;
  const take = (data) => {
    if (typeof data !== "string") return showPicture(data);
    const message = JSON.parse(data);
    if (message.kind === "rows") {
      const last = rows.length > 0 ? at(rows[rows.length - 1], "t") : -1;
      addRows(message.rows.filter((row) => row[0] > last));
    } else if (message.kind === "restart") {
      rows = [];
      shown = -1;
      setFollowing(true); // what was looked at has gone
      for (const line of [path, wholePath]) line.geometry.setDrawRange(0, 0);
    } else if (message.kind === "notice") notice(message.words);
  };
  socket.onopen = async () => {
    try {
      await load();
      ready = true;
      say("connected");
      waiting.forEach(take);
      waiting = [];
    } catch (error) {
      say(`cannot load: ${error.message}`);
      socket.close();
    }
  };
  socket.onmessage = (event) => (ready ? take(event.data) : waiting.push(event.data));
  socket.onclose = () => {
    say("not connected, trying again");
    setTimeout(start, 1000);
  };
}

/** A recorded run has no stream; the history says which it is. */
async function start() {
  try {
    const { mode: kind } = await (await fetch("mode.json")).json();
    if (kind === "run") {
      await load();
      say("recorded");
      pictures.follow((fault) => {
        document.body.classList.add("unpictured");
        say(`recorded; no pictures: ${fault}`);
      });
    } else connect();
  } catch {
    say("not connected, trying again");
    setTimeout(start, 1000);
  }
}
resize();
start();
