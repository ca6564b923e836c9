// SPDX-License-Identifier: Apache-2.0
// The pieces of a recording, read from the server when they are wanted.

import { decodeFrames } from "./stream.js";

const text = new TextDecoder();

// Messages in their order: {time_ns, block} or {time_ns, message}, the time [ns since `first_ns`] being that of
// the latest frame. Before the first block of frames there is none: -Infinity.
export function decodePiece(buffer, first_ns) {
  const view = new DataView(buffer);
  const messages = [];
  let time_ns = -Infinity;
  for (let at = 0; at < buffer.byteLength;) {
    const size = view.getUint32(at, true);
    const binary = view.getUint32(at + 4, true) === 1;
    const content = buffer.slice(at + 8, at + 8 + size);
    at += 8 + size;
    if (!binary) {
      messages.push({ time_ns, message: JSON.parse(text.decode(content)) });
      continue;
    }
    const block = decodeFrames(content);
    time_ns = Number(block.words.getBigInt64((block.count - 1) * 8, true) - first_ns);
    messages.push({ time_ns, block });
  }
  return messages;
}

export class Pieces {
  #held = new Map(); // by number: a promise, or the messages
  #first_ns;

  constructor(first_ns) {
    this.#first_ns = first_ns;
  }

  // Address of a part of the recording, with the page's token.
  static address(path, page = window.location) {
    const url = new URL(path, page.href);
    const token = new URLSearchParams(page.search).get("token");
    url.search = token === null ? "" : new URLSearchParams({ token }).toString();
    url.hash = "";
    return url.href;
  }

  static async read(path) {
    const answer = await fetch(Pieces.address(path), { cache: "no-store" });
    if (!answer.ok) throw new Error(`the server answers ${answer.status}`);
    return answer;
  }

  async #fetch(number) {
    const answer = await Pieces.read(`recording/${number}`);
    return decodePiece(await answer.arrayBuffer(), this.#first_ns);
  }

  // The messages of a piece; rejects if the server does not answer.
  load(number) {
    const held = this.#held.get(number);
    if (held !== undefined) return Promise.resolve(held);
    const coming = this.#fetch(number).then((messages) => {
      if (this.#held.get(number) === coming) this.#held.set(number, messages);
      return messages;
    }, (error) => {
      this.#held.delete(number);
      throw error;
    });
    this.#held.set(number, coming);
    return coming;
  }

  // The messages if they are here, else null.
  get(number) {
    const held = this.#held.get(number);
    return Array.isArray(held) ? held : null;
  }

  // Forgets all but the pieces [from, to].
  keep(from, to) {
    for (const number of this.#held.keys()) if (number < from || number > to) this.#held.delete(number);
  }

  get count() { return this.#held.size; }
}
