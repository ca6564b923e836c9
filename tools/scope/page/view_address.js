// SPDX-License-Identifier: Apache-2.0
// The view of the oscilloscope as text: in the address, so that a copied one opens the same view, and in the
// settings. Items are separated by *, their parts by _, which addresses leave as they are; numbers are in SI
// units.

import { modes } from "./trigger.js";
import { channels, systems } from "./units.js";

const names = ["span", "lanes", "scales", "limits", "expression", "trigger", "units", "cursors"];
const ofThePage = { scales: "", trigger: "", units: "", cursors: "" }; // last as long as the page, or its address
const write_ms = 300; // browsers limit how often the address is changed

const indexOf = (id) => channels.findIndex((channel) => channel.id === id);
const itemsOf = (text) => (text ? text.split("*") : []);

// Pairs of numbers by channel; a blank is NaN.
function readPairs(text) {
  const pairs = new Map();
  for (const item of itemsOf(text)) {
    const [id, ...parts] = item.split("_");
    const pair = parts.map((part) => (part === "" ? NaN : Number(part)));
    if (indexOf(id) >= 0 && pair.length === 2) pairs.set(indexOf(id), pair);
  }
  return pairs;
}

function writePairs(pairs) {
  const number = (value) => (Number.isNaN(value) ? "" : String(Number(value.toPrecision(9))));
  return pairs.map(([index, low, high]) => `${channels[index].id}_${number(low)}_${number(high)}`).join("*");
}

// "normal_F_0.2_falling"; null if it is not understood.
function readTrigger(text = "") {
  const [mode, id, level, edge] = text.split("_");
  const trigger = { mode, channel: indexOf(id), level: Number(level), rising: edge !== "falling" };
  return modes.includes(mode) && trigger.channel >= 0 && level !== "" && Number.isFinite(trigger.level) ? trigger : null;
}

// Places on the screen, as parts of its width.
function readCursors(text = "") {
  const parts = text.split("_").map((part) => (part === "" ? NaN : Number(part)));
  return parts.length === 2 && parts.every((part) => part >= 0 && part <= 1) ? parts : null;
}

// Items that are not understood are left out.
export function decode(texts) {
  const listed = texts.lanes === undefined ? null : itemsOf(texts.lanes).map((item) => item.split("_").map(indexOf).filter((index) => index >= 0));
  const ordered = ([low, high]) => low < high;
  const some = ([low, high]) => !(Number.isNaN(low) && Number.isNaN(high)) && !(low >= high);
  const pairs = (text, use) => new Map([...readPairs(text)].filter(([, pair]) => use(pair)));
  return {
    span_s: Number(texts.span ?? NaN),
    lanes: listed?.filter((lane) => lane.length > 0) ?? null,
    scales: pairs(texts.scales, ordered),
    limits: pairs(texts.limits, some),
    expression: texts.expression ?? "",
    trigger: readTrigger(texts.trigger),
    units: Object.hasOwn(systems, texts.units ?? "") ? texts.units : null,
    cursors: readCursors(texts.cursors),
  };
}

export function encode({ span_s, lanes, scales, limits, expression, trigger, units, cursors }) {
  return {
    span: String(Number(span_s.toPrecision(6))),
    lanes: lanes.map((lane) => lane.map((index) => channels[index].id).join("_")).join("*"),
    scales: writePairs(scales),
    limits: writePairs(limits),
    expression,
    trigger: trigger ? `${trigger.mode}_${channels[trigger.channel].id}_${Number(trigger.level.toPrecision(9))}_${trigger.rising ? "rising" : "falling"}` : "",
    units,
    cursors: cursors ? cursors.map((part) => Number(part.toFixed(5))).join("_") : "",
  };
}

export class ViewAddress {
  #timer = null;
  #written_ms = -Infinity;

  constructor(settings) {
    this.settings = settings;
    const query = new URLSearchParams(window.location.search);
    const given = names.some((name) => query.has(name));
    const kept = settings.get("view") ?? {};
    this.texts = given ? Object.fromEntries(names.filter((name) => query.has(name)).map((name) => [name, query.get(name)])) : { ...kept, ...ofThePage };
    if (!given && settings.get("view") !== undefined) this.#schedule();
  }

  read() { return decode(this.texts); }

  write(view) {
    this.texts = encode(view);
    this.settings.set("view", this.texts);
    this.#schedule();
  }

  // At once, or a little after the latest time.
  #schedule() {
    if (this.#timer !== null) return;
    const wait_ms = this.#written_ms + write_ms - performance.now();
    if (wait_ms > 0) this.#timer = setTimeout(() => this.#show(), wait_ms);
    else this.#show();
  }

  #show() {
    this.#timer = null;
    this.#written_ms = performance.now();
    const url = new URL(window.location.href);
    for (const name of names) {
      if (this.texts[name] || (name === "lanes" && this.texts[name] !== undefined)) url.searchParams.set(name, this.texts[name]);
      else url.searchParams.delete(name);
    }
    window.history.replaceState(null, "", url);
  }
}
