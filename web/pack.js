// SPDX-License-Identifier: BSD-3-Clause
// node pack.js IN OUT: gzip, the same bytes for the same input.
const { readFileSync, writeFileSync } = require("fs");
const { gzipSync } = require("zlib");

const [from, to] = process.argv.slice(2);
writeFileSync(to, gzipSync(readFileSync(from), { level: 9 }));
