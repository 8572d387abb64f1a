// SPDX-License-Identifier: BSD-3-Clause
// What npm's @mcap/core and @foxglove/rosmsg2-serialization make of MCAP files:
//
//   node oracle.mjs list FILE                            topic, type, size and check sum of every message
//   node oracle.mjs write FILE none|lz4|zstd BYTES       five frames, in chunks of so many bytes (0: in none)
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { McapStreamReader, McapWriter } from "@mcap/core";
import { ros2humble } from "@foxglove/rosmsg-msgs-common";
import { MessageWriter } from "@foxglove/rosmsg2-serialization";

const filter = (program, ...options) => (input) =>
  execFileSync(program, options, { input, maxBuffer: 1 << 30 });

function list(file) {
  const decompressHandlers = { lz4: filter("lz4", "-dc"), zstd: filter("zstd", "-dc") };
  const reader = new McapStreamReader({ decompressHandlers });
  reader.append(readFileSync(file));
  const schemas = new Map();
  const channels = new Map();
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type !== "Message") continue;
    const channel = channels.get(record.channelId);
    const sum = record.data.reduce((s, byte) => (Math.imul(31, s) + byte) >>> 0, 0);
    console.log(channel.topic, schemas.get(channel.schemaId).name, record.data.length, sum);
  }
  if (!reader.done()) throw new Error("the file does not end");
}

/// A writer of CDR for a type, with all that it is made of.
function serialiser(type) {
  const definitions = [];
  const collect = (name) => {
    const found = ros2humble[name];
    if (definitions.includes(found)) return;
    definitions.push(found);
    for (const field of found.definitions) if (field.isComplex) collect(field.type);
  };
  collect(type);
  return new MessageWriter(definitions);
}

function frame(k) {
  const header = { stamp: { sec: 100 + k, nanosec: 250000000 }, frame_id: "cam" };
  const colour = Uint8Array.from({ length: 8 * 6 * 3 }, (_, i) => (7 * i + k) & 255);
  const depth = Uint16Array.from({ length: 8 * 6 }, (_, i) => 1000 + i + k);
  const pose = {
    position: { x: 0.1 * k, y: 0.2, z: 0.3 },
    orientation: { x: 0, y: 0, z: 0.6, w: 0.8 },
  };
  const image = { header, height: 6, width: 8, is_bigendian: 0 };
  const camera = {
    header,
    height: 6,
    width: 8,
    distortion_model: "plumb_bob",
    d: [0.1, -0.2, 0.001, -0.002, 0.05],
    k: [9, 0, 4, 0, 10, 3, 0, 0, 1],
    r: [1, 0, 0, 0, 1, 0, 0, 0, 1],
    p: [9, 0, 4, 0, 0, 10, 3, 0, 0, 0, 1, 0],
  };
  const transform = { translation: pose.position, rotation: pose.orientation };
  return {
    "/image": ["sensor_msgs/Image", { ...image, encoding: "rgb8", step: 24, data: colour }],
    "/depth": [
      "sensor_msgs/Image",
      { ...image, encoding: "16UC1", step: 16, data: new Uint8Array(depth.buffer) },
    ],
    "/jpeg": ["sensor_msgs/CompressedImage", { header, format: "jpeg", data: colour.subarray(0, 7) }],
    "/camera_info": ["sensor_msgs/CameraInfo", camera],
    "/tf": [
      "tf2_msgs/TFMessage",
      { transforms: [{ header: { ...header, frame_id: "world" }, child_frame_id: "cam", transform }] },
    ],
    "/pose": ["geometry_msgs/PoseStamped", { header: { ...header, frame_id: "world" }, pose }],
    "/odom": [
      "nav_msgs/Odometry",
      { header: { ...header, frame_id: "odom" }, child_frame_id: "cam", pose: { pose } },
    ],
  };
}

async function write(file, compression, chunkSize) {
  const parts = [];
  let size = 0n;
  const writable = {
    write: async (bytes) => {
      parts.push(Buffer.from(bytes));
      size += BigInt(bytes.length);
    },
    position: () => size,
  };
  const programs = { lz4: filter("lz4", "-c"), zstd: filter("zstd", "-c") };
  const compressChunk =
    compression === "none"
      ? undefined
      : (data) => ({ compression, compressedData: programs[compression](data) });
  const options = chunkSize > 0 ? { chunkSize, compressChunk } : { useChunks: false };
  const writer = new McapWriter({ writable, ...options });
  await writer.start({ profile: "ros2", library: "oracle" });
  const channels = new Map();
  for (let k = 0; k < 5; ++k) {
    for (const [topic, [type, message]] of Object.entries(frame(k))) {
      if (!channels.has(topic)) {
        const name = type.replace("/", "/msg/");
        const data = new TextEncoder().encode("# none");
        const schemaId = await writer.registerSchema({ name, encoding: "ros2msg", data });
        const messageEncoding = "cdr";
        channels.set(topic, await writer.registerChannel({ schemaId, topic, messageEncoding, metadata: new Map() }));
      }
      const time = BigInt(100 + k) * 1000000000n;
      await writer.addMessage({
        channelId: channels.get(topic),
        sequence: k,
        logTime: time,
        publishTime: time,
        data: serialiser(type).writeMessage(message),
      });
    }
  }
  await writer.end();
  writeFileSync(file, Buffer.concat(parts));
}

const [command, ...words] = process.argv.slice(2);
if (command === "list") list(words[0]);
else if (command === "write") await write(words[0], words[1], Number(words[2]));
else throw new Error("usage: list FILE | write FILE none|lz4|zstd BYTES");
