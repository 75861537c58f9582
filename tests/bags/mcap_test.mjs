// SPDX-License-Identifier: BSD-3-Clause
// Our MCAP files as the format's own library sees them: node mcap_test.mjs MAKE_BAGS FOLDER
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync } from "node:fs";

import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

const START = 1_700_000_000_000_000_000n;
const PACKETS = 300;
const EVENTS = 300_000;

const nanoseconds = (t) => BigInt(t.sec) * 1_000_000_000n + BigInt(t.nsec ?? t.nanosec);
const xyz = (v) => [v.x, v.y, v.z];

function eventsOf(message) {
  assert.deepEqual([message.width, message.height], [640, 480]);
  if (message.encoding === undefined)
    return message.events.map((e) => [nanoseconds(e.ts), e.x, e.y, e.polarity]);
  assert.equal(message.encoding, "mono");
  const bytes = message.events;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const rows = [];
  for (let at = 0; at < view.byteLength; at += 8) {
    const upper = view.getUint16(at + 6, true);
    const t = message.time_base + BigInt(view.getUint32(at, true));
    rows.push([t, view.getUint16(at + 4, true), upper & 0x7fff, upper >> 15 === 1]);
  }
  return rows;
}

/** Checks messages as they come, whichever way they are read. */
class Checker {
  counts = { "/events": 0, "/imu": 0, "/pose": 0 };

  "/events"(message) {
    for (const row of eventsOf(message)) {
      const n = this.counts["/events"]++;
      assert.deepEqual(row, [START + BigInt(n) * 13_000n, (n * 7) % 640, (n * 11) % 480, n % 3 === 0]);
    }
  }
  "/imu"(message, logTime) {
    const i = this.counts["/imu"]++;
    assert.equal(nanoseconds(message.header.stamp), START + BigInt(i) * 5_000_001n);
    assert.equal(nanoseconds(message.header.stamp), logTime);
    assert.equal(message.header.frame_id, "imu");
    assert.deepEqual(xyz(message.angular_velocity), [0.5 * i, -0.25, 0.125]);
    assert.deepEqual(xyz(message.linear_acceleration), [i / 8, 2, -9.75]);
    assert.equal(message.orientation_covariance[0], -1);
  }
  "/pose"(message) {
    const i = this.counts["/pose"]++;
    assert.equal(nanoseconds(message.header.stamp), START + BigInt(i) * 7_000_003n);
    assert.deepEqual(xyz(message.pose.position), [i / 4, -2, 3]);
    const q = message.pose.orientation;
    assert.deepEqual([q.x, q.y, q.z, q.w], i % 2 === 0 ? [0, 0, 0, 1] : [-0.5, 0.5, -0.5, 0.5]);
  }
  finish() {
    assert.deepEqual(this.counts, { "/events": EVENTS, "/imu": PACKETS, "/pose": PACKETS });
  }
}

/** A decoder made from the schema that the file carries. */
function decoder(schema) {
  assert.equal(schema.encoding, "ros2msg");
  return new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
}

async function checkIndexed(bytes) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  assert.equal(reader.header.profile, "ros2");
  assert.equal(reader.channelsById.size, 3);
  assert.equal(reader.statistics.chunkCount, reader.chunkIndexes.length);
  assert.ok(reader.chunkIndexes.length > 1);
  const checker = new Checker();
  const decoders = new Map();
  let last = 0n;
  let messages = 0n;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(schema.id)) decoders.set(schema.id, decoder(schema));
    assert.ok(message.logTime >= last, "messages come in order of time");
    last = message.logTime;
    ++messages;
    checker[channel.topic](decoders.get(schema.id).readMessage(message.data), message.logTime);
  }
  checker.finish();
  assert.equal(reader.statistics.messageCount, messages);
}

/** From the first byte to the last, with every checksum. */
function checkStream(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(new Uint8Array(bytes));
  const kinds = new Set();
  for (let record; (record = reader.nextRecord()); ) kinds.add(record.type);
  assert.ok(reader.done());
  for (const kind of ["Message", "DataEnd", "Statistics", "ChunkIndex", "SummaryOffset", "Footer"])
    assert.ok(kinds.has(kind), kind);
}

const [makeBags, folder] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
execFileSync(makeBags, [folder]);
for (const name of ["plain.mcap", "packets.mcap"]) {
  const bytes = readFileSync(`${folder}/${name}`);
  await checkIndexed(bytes);
  checkStream(bytes);
  console.log(`${name}: as written`);
}
