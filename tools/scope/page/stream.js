// SPDX-License-Identifier: Apache-2.0
// The WebSocket and its decoder; the page sends nothing but notes.

const subprotocol = "stickslip-scope";
const firstWait_ms = 300;
const longestWait_ms = 800;
const answerWithin_ms = 1500; // a server that answers at all
const openWithin_ms = 4000;
const headerBytes = 16;
const channelCount = 6;

// A binary message of kind 1. `words` views the times and sequence numbers (8 bytes each, times first),
// `numbers` the values, channel after channel. Throws a RangeError for an incomplete message.
export function decodeFrames(buffer) {
  const header = new DataView(buffer);
  if (header.getUint8(0) !== 1) throw new RangeError(`message of kind ${header.getUint8(0)}, expected 1`);
  const channels = header.getUint16(2, true);
  const count = header.getUint32(4, true);
  const length = headerBytes + count * 8 * (2 + channelCount);
  if (channels !== channelCount || buffer.byteLength !== length) {
    throw new RangeError(`frames of ${channels} channels in ${buffer.byteLength} bytes, expected ${channelCount} in ${length}`);
  }
  return {
    flags: header.getUint8(1),
    count,
    received_unix_ms: header.getFloat64(8, true),
    words: new DataView(buffer, headerBytes, count * 16),
    numbers: new Float64Array(buffer, headerBytes + count * 16, count * channelCount),
  };
}

// Keeps a connection. `take` has onFrames(block), onMessage(object) and onLink({state, wait_s, reason}), state
// being "connecting", "open" or "waiting".
export class Stream {
  #take;
  #wait_ms = firstWait_ms;
  #socket = null;
  #timer = 0;
  #asking = null; // whether the server is there

  constructor(take) {
    this.#take = take;
    this.refused = 0; // messages that were not understood
    this.opened = 0; // connections made
    this.wanted = new URLSearchParams(window.location.search).get("source") ?? ""; // of several rigs
  }

  // Address of the stream: host and token of the page, and the rig that is wanted.
  static address(wanted, page = window.location) {
    const token = new URLSearchParams(page.search).get("token");
    const url = new URL("stream", page.href);
    url.protocol = page.protocol === "https:" ? "wss:" : "ws:";
    url.search = new URLSearchParams({ ...(token !== null && { token }), ...(wanted !== "" && { source: wanted }) }).toString();
    url.hash = "";
    return url.href;
  }

  connect() {
    this.#forget();
    this.#take.onLink({ state: "connecting" });
    const socket = new WebSocket(Stream.address(this.wanted), subprotocol);
    this.#timer = setTimeout(() => this.abandon("no answer"), openWithin_ms);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => {
      clearTimeout(this.#timer);
      this.opened += 1;
      this.#wait_ms = firstWait_ms;
      this.#take.onLink({ state: "open" });
    };
    socket.onmessage = (event) => this.#receive(event.data);
    socket.onclose = (event) => this.#closed(event);
  }

  // False if it is not connected.
  send(message) {
    if (this.#socket?.readyState !== 1) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  // Connects immediately if not connected, on request of the user.
  reconnect() {
    if (this.#socket === null || this.#socket.readyState > 1) this.connect();
  }

  // Gives up a connection that says nothing, and begins to look for the server.
  abandon(reason) {
    this.#forget();
    this.#closed({ reason });
  }

  // Nothing of the present connection or attempt is heard any more.
  #forget() {
    clearTimeout(this.#timer);
    this.#asking?.abort();
    this.#asking = null;
    const socket = this.#socket;
    this.#socket = null;
    if (socket === null) return;
    socket.onopen = null;
    socket.onmessage = null;
    socket.onclose = null;
    if (socket.readyState < 2) socket.close();
  }

  #receive(data) {
    try {
      if (typeof data === "string") this.#take.onMessage(JSON.parse(data));
      else this.#take.onFrames(decodeFrames(data));
    } catch (error) {
      if (!(error instanceof RangeError || error instanceof SyntaxError)) throw error;
      this.refused += 1;
    }
  }

  #closed(event) {
    // Random delay, so that many pages do not reconnect at the same moment.
    const wait_ms = this.#wait_ms * (0.75 + 0.5 * Math.random());
    this.#wait_ms = Math.min(longestWait_ms, this.#wait_ms * 2);
    this.#take.onLink({ state: "waiting", wait_s: wait_ms / 1e3, reason: event.reason || "" });
    this.#timer = setTimeout(() => this.#seek(), wait_ms);
  }

  // Opens the stream once the server answers: browsers delay WebSockets after failures, requests they do not.
  async #seek() {
    const asking = new AbortController();
    this.#asking = asking;
    const timer = setTimeout(() => asking.abort(), answerWithin_ms);
    try {
      const answer = await fetch(new URL("icon.svg", window.location.href), { method: "HEAD", cache: "no-store", signal: asking.signal });
      if (this.#asking === asking && answer.ok) this.connect();
      else if (this.#asking === asking) this.#closed({ reason: `the server answers ${answer.status}` });
    } catch {
      if (this.#asking === asking) this.#closed({ reason: "" });
    } finally {
      clearTimeout(timer);
    }
  }
}
