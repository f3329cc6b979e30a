// A viewer made of the parts of Foxglove and Lichtblick: subscribes to every channel and prints what it receives, a JSON object a line.
//
// usage: node viewer.cjs ADDRESS; a line on stdin calls the service of that name, its end ends.
"use strict";
const readline = require("node:readline");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const print = (object) =>
  console.log(JSON.stringify(object, (_, value) => (ArrayBuffer.isView(value) ? Array.from(value) : value)));

/** A function from the bytes of a message on this channel to what they mean. */
function decoder(channel) {
  if (channel.encoding === "json") return (data) => JSON.parse(new TextDecoder().decode(data));
  if (channel.encoding !== "cdr" || channel.schemaEncoding !== "ros2msg") throw new Error(`no decoder for ${channel.topic}`);
  const reader = new MessageReader(parse(channel.schema, { ros2: true }));
  return (data) => reader.readMessage(data);
}

const client = new FoxgloveClient({
  ws: new WebSocket(process.argv[2], ["foxglove.sdk.v1", FoxgloveClient.SUPPORTED_SUBPROTOCOL]),
});
const subscriptions = new Map();
const services = new Map();
let calls = 0;

client.on("error", (error) => print({ error: String(error.message ?? error) }));
client.on("close", () => process.exit(0));
client.on("status", (status) => print({ status }));
client.on("serverInfo", (info) => print({ info }));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    subscriptions.set(client.subscribe(channel.id), { topic: channel.topic, decode: decoder(channel) });
  }
  print({ topics: channels.map((channel) => channel.topic) });
});
client.on("advertiseServices", (all) => all.forEach((service) => services.set(service.name, service)));
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, decode } = subscriptions.get(subscriptionId);
  print({ topic, time_ns: String(timestamp), message: decode(data) });
});
client.on("serviceCallResponse", ({ data }) => print({ answer: JSON.parse(new TextDecoder().decode(data)) }));
client.on("serviceCallFailure", ({ message }) => print({ failure: message }));

const commands = readline.createInterface({ input: process.stdin });
commands.on("close", () => client.close());
commands.on("line", (name) => {
  client.sendServiceCallRequest({
    serviceId: services.get(name).id,
    callId: ++calls,
    encoding: "json",
    data: new DataView(new TextEncoder().encode("{}").buffer),
  });
});
