// SPDX-License-Identifier: BSD-3-Clause
// A run as MCAP, as the format's own library sees it: node run_mcap_test.mjs RUN_MCAP TRAJECTORY_TUM LAYOUT_JSON
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

import { McapIndexedReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

const TYPES = {
  "/tf": "tf2_msgs/msg/TFMessage",
  "/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
  "/health": "evpose_msgs/msg/Health",
  "/trajectory": "nav_msgs/msg/Path",
  "/map": "sensor_msgs/msg/PointCloud2",
  "/overlay": "sensor_msgs/msg/CompressedImage",
};
const [mcap, tum, layoutFile] = process.argv.slice(2);
const bytes = readFileSync(mcap);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
};
const reader = await McapIndexedReader.Initialize({ readable });
const messages = new Map(Object.keys(TYPES).map((topic) => [topic, []]));
const decoders = new Map();
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  assert.equal(schema.name, TYPES[channel.topic], channel.topic);
  if (!decoders.has(schema.id))
    decoders.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  messages.get(channel.topic).push(decoders.get(schema.id).readMessage(message.data));
}
for (const [topic, list] of messages) assert.ok(list.length > 0, `${topic} is empty`);

// Each pose of the trajectory, in order, to the nanosecond.
const rows = readFileSync(tum, "utf8").split("\n").filter((line) => line && !line.startsWith("#"));
const poses = messages.get("/pose");
assert.equal(poses.length, rows.length);
rows.forEach((row, i) => {
  const [stamp, ...numbers] = row.split(" ");
  const { header, pose } = poses[i];
  const { position: p, orientation: q } = pose.pose;
  const [seconds, decimals] = stamp.split(".");
  assert.equal(header.stamp.sec, Number(seconds));
  assert.equal(header.stamp.nanosec ?? header.stamp.nsec, Number(decimals.padEnd(9, "0").slice(0, 9)));
  [p.x, p.y, p.z, q.x, q.y, q.z, q.w].forEach((value, k) =>
    assert.ok(Math.abs(value - Number(numbers[k])) < 1e-6, `row ${i}, column ${k}`));
  const covariance = Array.from(pose.covariance);
  for (let a = 0; a < 6; ++a) {
    assert.ok(covariance[7 * a] > 0);
    for (let b = 0; b < 6; ++b) assert.ok(Math.abs(covariance[6 * a + b] - covariance[6 * b + a]) < 1e-12);
  }
});
const transforms = messages.get("/tf").map((message) => message.transforms[0]);
assert.equal(transforms.length, poses.length);
assert.deepEqual([transforms[0].header.frame_id, transforms[0].child_frame_id], ["map", "body"]);

const [cloud] = messages.get("/map");
assert.equal(messages.get("/map").length, 1);
assert.equal(cloud.data.length, cloud.width * cloud.point_step);
assert.deepEqual(cloud.fields.map((field) => field.name), ["x", "y", "z"]);
const floats = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
for (let at = 0; at < cloud.data.length; at += 4) assert.ok(Math.abs(floats.getFloat32(at, true)) < 1000);
assert.ok(messages.get("/trajectory")[0].poses.length > 1);

for (const { state, position_sigma_m: sigma } of messages.get("/health")) {
  assert.ok(["waiting", "initialising", "tracking", "degraded", "lost"].includes(state), state);
  assert.ok(sigma >= 0);
}
for (const { format, data } of messages.get("/overlay")) {
  assert.equal(format, "png");
  assert.deepEqual(Array.from(data.slice(0, 4)), [0x89, 0x50, 0x4e, 0x47]);
}

// The layout that we ship shows topics and fields that are there.
const layout = JSON.parse(readFileSync(layoutFile, "utf8"));
const shown = [];
for (const panel of Object.values(layout.configById)) {
  shown.push(...Object.keys(panel.topics ?? {}), ...(panel.paths ?? []).map((path) => path.value));
  if (panel.imageMode) shown.push(panel.imageMode.imageTopic);
}
for (const path of shown) {
  const [topic, field] = path.split(".");
  assert.ok(topic in TYPES, path);
  assert.ok(field === undefined || field in messages.get(topic)[0], path);
}
const panels = (node) => (typeof node === "string" ? [node] : [...panels(node.first), ...panels(node.second)]);
assert.deepEqual(panels(layout.layout).sort(), Object.keys(layout.configById).sort());
for (const topic of ["/map", "/pose", "/trajectory", "/overlay"]) assert.ok(shown.includes(topic), topic);
console.log(`${poses.length} poses, ${messages.get("/overlay").length} pictures: as written`);
