// SPDX-License-Identifier: BSD-3-Clause
// Our messages over UDP as node-mavlink sees them, field by field: node mavlink_test.mjs MAKE_MAVLINK
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { createSocket } from "node:dgram";
import { PassThrough } from "node:stream";
import { promisify } from "node:util";

import { ardupilotmega, common, MavLinkPacketParser, MavLinkPacketSplitter, minimal } from "node-mavlink";

const registry = { ...minimal.REGISTRY, ...common.REGISTRY, ...ardupilotmega.REGISTRY };

function same(value, text, where) {
  if (Array.isArray(text)) {
    assert.equal(value.length, text.length, where);
    text.forEach((t, i) => same(value[i], t, `${where}[${i}]`));
  } else if (typeof value === "bigint") assert.equal(value, BigInt(text), where);
  else if (typeof value === "string") assert.equal(value, text, where);
  else assert.ok(Object.is(value, Math.fround(Number(text))) || value === Number(text), `${where}: ${value}, not ${text}`);
}

function check(packet, sent) {
  const { header, protocol, payload } = packet;
  assert.deepEqual([header.msgid, header.seq, header.sysid, header.compid], [sent.id, sent.sequence, 42, 197]);
  const type = registry[sent.id];
  const message = protocol.data(payload, type);
  const fields = [...type.FIELDS].sort((a, b) => a.offset - b.offset);
  // An array of ours may be several numbers of theirs (param1 ... param7, xacc, yacc, zacc).
  const values = sent.values.flatMap((v, i) => (Array.isArray(v) && fields[i] && fields.length > sent.values.length && !fields.some((f) => f.length === v.length) ? v : [v]));
  assert.equal(fields.length, values.length, sent.name);
  fields.forEach((field, i) => same(message[field.name], values[i], `${sent.name}.${field.name}`));
}

const socket = createSocket("udp4");
await new Promise((done) => socket.bind(0, "127.0.0.1", done));
const bytes = new PassThrough();
const packets = [];
bytes.pipe(new MavLinkPacketSplitter()).pipe(new MavLinkPacketParser()).on("data", (packet) => packets.push(packet));
socket.on("message", (datagram) => bytes.write(datagram));

const { stdout } = await promisify(execFile)(process.argv[2], [`udp://127.0.0.1:${socket.address().port}`]);
const sent = stdout.trim().split("\n").map((line) => JSON.parse(line));
for (let i = 0; i < 200 && packets.length < sent.length; ++i) await new Promise((done) => setTimeout(done, 50));
socket.close();
assert.equal(packets.length, sent.length);
packets.forEach((packet, i) => check(packet, sent[i]));
const odometry = sent.filter((s) => s.name === "ODOMETRY");
assert.equal(odometry[1].values[11][0], "nan");
assert.equal(packets[sent.indexOf(odometry[2])].header.payloadLength, 1, "zeros at the end are not sent");
console.log(`${packets.length} messages of ${new Set(sent.map((s) => s.id)).size} kinds: all fields as sent`);
