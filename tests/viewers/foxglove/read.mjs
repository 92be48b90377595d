// Decodes a recording with the libraries that Foxglove is made of; prints what was found as JSON.
import { open } from "node:fs/promises";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";

const file = await open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, size) => {
    const bytes = new Uint8Array(Number(size));
    const { bytesRead } = await file.read(bytes, 0, bytes.length, Number(offset));
    return bytes.subarray(0, bytesRead);
  },
};
const recording = await McapIndexedReader.Initialize({ readable });
const decoders = new Map();
for (const channel of recording.channelsById.values()) {
  const schema = recording.schemasById.get(channel.schemaId);
  if (channel.messageEncoding === "cdr") {
    const definition = new TextDecoder().decode(schema.data);
    decoders.set(channel.id, new MessageReader(parse(definition, { ros2: true })));
  }
}
const counts = {};
const last = {};
for await (const message of recording.readMessages()) {
  const { topic } = recording.channelsById.get(message.channelId);
  const decoder = decoders.get(message.channelId);
  if (decoder !== undefined) {
    last[topic] = decoder.readMessage(message.data);
    counts[topic] = (counts[topic] ?? 0) + 1;
  }
}
await file.close();
const { name, position } = last["/vigil/belief"];
const belief = Object.fromEntries(name.map((key, at) => [key, position[at]]));
console.log(JSON.stringify({ profile: recording.header.profile, counts, belief }));
