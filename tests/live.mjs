// What tests/live.sh asks of a viewer: `view URL FILE` takes everything that is advertised until SIGINT, `compare FILE
// RECORDING` compares that with a recording made at the same time, `dashboard FILE URL` looks whether each metric that a
// dashboard shows is given.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { McapStreamReader } = require("@mcap/core");
const protobuf = require("protobufjs");
const descriptor = require("protobufjs/ext/descriptor");
const { WebSocket } = require("ws");

/** The message type of an advertised or recorded schema. */
function typeOf(schema, name) {
  const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema));
  root.resolveAll();
  return root.lookupType(name);
}

function view(url, file) {
  // The package's own name of the protocol is the older one; the messages are the same.
  const client = new FoxgloveClient({ ws: new WebSocket(url, ["foxglove.sdk.v1"]) });
  const [topics, subscriptions, schemas, messages] = [new Map(), new Map(), {}, []];
  client.on("error", (error) => {
    throw error;
  });
  client.on("advertise", (channels) => {
    for (const { id, topic, encoding, schemaName, schema, schemaEncoding } of channels) {
      assert.equal(encoding, "protobuf");
      assert.equal(schemaEncoding, "protobuf");
      console.log(`advertised ${topic}`);
      schemas[topic] = { schemaName, schema };
      topics.set(id, topic);
      subscriptions.set(client.subscribe(id), topic);
    }
  });
  client.on("unadvertise", (ids) => {
    for (const id of ids) {
      console.log(`unadvertised ${topics.get(id)}`);
      topics.delete(id);
    }
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const topic = subscriptions.get(subscriptionId);
    if (messages.every((it) => it.topic !== topic)) console.log(`first message of ${topic}`);
    const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
    messages.push({ topic, time: timestamp.toString(), data: bytes.toString("base64") });
  });
  process.on("SIGINT", () => {
    writeFileSync(file, JSON.stringify({ schemas, messages }));
    process.exit(0);
  });
}

/** The messages of a recording: topic and bytes as base64. */
function recorded(file) {
  const reader = new McapStreamReader();
  reader.append(readFileSync(file));
  const [topics, messages] = [new Map(), []];
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type === "Message") {
      const data = Buffer.from(record.data).toString("base64");
      messages.push({ topic: topics.get(record.channelId), data });
    }
  }
  return messages;
}

function compare(file, recording) {
  const { schemas, messages } = JSON.parse(readFileSync(file));
  const of = (all, topic) => all.filter((it) => it.topic === topic).map((it) => it.data);
  const other = recorded(recording);
  const decode = (topic) => {
    const { schemaName, schema } = schemas[topic];
    const type = typeOf(Buffer.from(schema, "base64"), schemaName);
    const options = { enums: String, longs: Number };
    return of(messages, topic).map((it) => type.toObject(type.decode(Buffer.from(it, "base64")), options));
  };

  const samples = "/train/1/samples";
  const [seen, kept] = [of(messages, samples), of(other, samples)];
  // The first ones came before the viewer had subscribed to the new channel.
  assert.ok(seen.length > 3000 && seen.length > 0.9 * kept.length, `${seen.length} of ${kept.length} samples`);
  assert.deepEqual(seen, kept.slice(-seen.length), "each sample as it was recorded");
  const [first] = decode(samples);
  assert.ok(first.speed_mps >= 0 && Number.isFinite(first.traction_force_n), JSON.stringify(first));
  assert.ok(!("acceleration_mps2" in first), "missing is missing");

  // Recorder and live view look at different moments, the recorder at nearly every one; of what both saw
  // each bit is the same.
  const mass = "/train/1/0_train_kalman";
  const known = new Set(of(other, mass));
  const both = of(messages, mass).filter((it) => known.has(it)).length;
  assert.ok(both > 20, `${both} of ${of(messages, mass).length} snapshots are recorded too`);
  const last = decode(mass).at(-1);
  const { mass_t, mass_low_t, mass_high_t, mass_std_t } = last.estimate;
  assert.ok(1600 < mass_t && mass_t < 1800, JSON.stringify(last));
  assert.ok(Math.abs(mass_high_t - mass_t - 1.96 * mass_std_t) < 1e-9 * mass_t);
  assert.ok(Math.abs(mass_t - mass_low_t - 1.96 * mass_std_t) < 1e-9 * mass_t);
  assert.equal(last.status, "STATUS_ESTIMATED");

  const topics = new Set(messages.map((it) => it.topic));
  for (const topic of Object.keys(schemas)) assert.ok(topics.has(topic), `${topic}: advertised, but nothing came`);

  const kinds = decode("/events").map((it) => it.kind);
  for (const kind of ["DAEMON_CAME", "CONTROLLER_CAME", "STATUS_CHANGED", "CONTROLLER_GONE", "DAEMON_GONE"]) {
    assert.ok(kinds.includes(`EVENT_KIND_${kind}`), `${kind}: ${kinds}`);
  }
  for (const { time } of messages) assert.ok(Math.abs(Number(time) / 1e6 - Date.now()) < 3_600_000, "wall time");
  console.log(`${messages.length} messages of ${Object.keys(schemas).length} topics, as they were recorded`);
}

async function dashboard(file, url) {
  const page = await (await fetch(url)).text();
  const families = new Set([...page.matchAll(/^# TYPE (\S+)/gm)].map((it) => it[1]));
  const given = [...page.matchAll(/^(dynocar_\w+)\{(.*)\} \S+$/gm)].map((it) => ({
    name: it[1],
    labels: Object.fromEntries([...it[2].matchAll(/(\w+)="([^"]*)"/g)].map((label) => [label[1], label[2]])),
  }));
  const text = readFileSync(file, "utf8");
  const { panels, templating } = JSON.parse(text);
  const targets = panels.flatMap((it) => it.targets);
  const shown = new Set();
  for (const { expr, legendFormat } of targets) {
    for (const [, name, selector] of expr.matchAll(/(dynocar_\w+)\{([^}]*)\}/g)) {
      shown.add(name.replace(/_total$/, ""));
      const wanted = [...selector.matchAll(/(\w+)="([^"]*)"/g)].map((it) => [it[1], it[2].replace("$train", "1")]);
      const ofName = given.filter((it) => it.name === name);
      const found = ofName.filter(({ labels }) => wanted.every(([key, value]) => labels[key] === value));
      // Nothing was refused of a good run.
      if (name === "dynocar_samples_rejected_total" && ofName.length === 0) continue;
      assert.ok(families.has(name.replace(/_total$/, "")), `${name}: not among ${[...families]}`);
      assert.ok(found.length > 0, `${name}{${selector}}: not given: ${JSON.stringify(ofName)}`);
      const legend = [...legendFormat.matchAll(/\{\{(\w+)\}\}/g)].map((it) => it[1]);
      for (const label of legend) assert.ok(label in found[0].labels, `${name}: no label ${label}`);
    }
  }
  assert.ok([...families].every((it) => shown.has(it)), `not shown: ${[...families].filter((it) => !shown.has(it))}`);
  assert.deepEqual(templating.list.map((it) => it.name), ["datasource", "train"]);
  console.log(`${targets.length} expressions of the dashboard, every one of ${shown.size} metrics given`);
}

const [command, ...rest] = process.argv.slice(2);
await { view, compare, dashboard }[command](...rest);
