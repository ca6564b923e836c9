// SPDX-License-Identifier: Apache-2.0
// The events: identical ones in one line, with a filter, and the cause of the amplifier's end on top.

import { byId, setPressed, setText } from "./elements.js";
import { count } from "./units.js";

const most = 200; // lines
const severities = ["information", "warning", "error"];

export class Events {
  constructor(app) {
    this.app = app;
    this.lines = []; // latest first: {key, event, seen (identities), times, at (device times), item}
    this.pinned = null;
    this.list = byId("event-list");
    this.least = byId("event-severity");
    this.wanted = byId("event-words");
    this.least.addEventListener("change", () => this.#filter());
    this.wanted.addEventListener("input", () => this.#filter());
    byId("clock").addEventListener("click", () => app.toggleClock());
  }

  clear() {
    this.lines = [];
    this.list.replaceChildren();
    this.pin(null);
    this.#filter();
  }

  // Events repeated for a new connection are taken once. An event of the page's own is identified by the time
  // of its frame: its UTC is an estimate, which moves with each quicker receipt.
  take(event) {
    const key = `${event.code} ${event.message}`;
    const identity = event.own ? event.time_ns : event.utc_us;
    let line = this.lines.find((one) => one.key === key);
    if (line?.seen.has(identity)) return false;
    if (line === undefined) {
      line = { key, event, seen: new Set(), times: 0, at: [], item: this.#item(event) };
      this.lines.push(line);
    }
    line.seen.add(identity);
    if (line.seen.size > most) line.seen.delete(line.seen.values().next().value);
    line.times += 1;
    if (event.time_ns > 0) line.at.push(event.time_ns);
    if (line.at.length > most) line.at.shift();
    if (event.utc_us >= line.event.utc_us) line.event = event;
    this.lines.sort((a, b) => b.event.utc_us - a.event.utc_us);
    for (const { item } of this.lines.splice(most)) item.remove();
    const place = this.lines.indexOf(line);
    if (place >= 0) this.list.insertBefore(line.item, this.lines[place + 1]?.item ?? null);
    this.#show(line);
    this.#filter();
    return true;
  }

  // Device time has begun anew: earlier events have no place on the traces.
  beginRun() {
    for (const line of this.lines) {
      line.at = [];
      if (line.event.own) line.seen.clear();
      line.event = { ...line.event, time_ns: 0 };
      this.#show(line);
    }
  }

  #item(event) {
    const item = document.createElement("li");
    item.dataset.severity = String(event.severity);
    if (event.own) item.dataset.own = "yes"; // of this page, not of the rig
    const time = document.createElement("button");
    time.type = "button";
    time.className = "when";
    const code = document.createElement("b");
    code.textContent = event.code.replace(/_/g, " ");
    code.title = severities[event.severity] ?? "";
    const times = document.createElement("i");
    const text = document.createElement("span");
    text.textContent = event.message;
    item.append(time, code, times, text);
    return item;
  }

  #show({ event, item, times }) {
    const [time, , counted] = item.children;
    setText(time, this.app.timeOf(event));
    time.title = "Show it on the traces";
    time.disabled = !(event.time_ns > 0);
    time.onclick = () => this.app.goTo(event);
    setText(counted, times > 1 ? `${count(times)} times` : "");
  }

  // The other clock was chosen.
  retime() {
    for (const line of this.lines) this.#show(line);
    if (this.pinned) this.pin(this.pinned);
    setPressed(byId("clock"), this.app.clock === "utc");
  }

  #filter() {
    const least = Number(this.least.value);
    const words = this.wanted.value.trim().toLowerCase();
    let shown = 0;
    for (const { event, item } of this.lines) {
      const fits = event.severity >= least && (words === "" || `${event.code.replace(/_/g, " ")} ${event.message}`.toLowerCase().includes(words));
      item.hidden = !fits;
      if (fits) shown += 1;
    }
    const none = byId("no-event");
    none.hidden = shown > 0;
    setText(none, this.lines.length === 0 ? "None since this page was opened." : "None that the filter leaves.");
  }

  // The event that switched the amplifier off, until it is on again; null: none.
  pin(event) {
    this.pinned = event;
    const place = byId("event-pinned");
    place.hidden = event === null;
    if (event === null) return;
    setText(place.children[0], `Amplifier switched off${event.utc_us > 0 ? `, ${this.app.timeOf(event)}` : ""}:`);
    setText(place.children[1], event.message.replace(/^amplifier off: /, ""));
  }

  // The event of a fault, by its cause; undefined if it has not come.
  faultOf(status) {
    return this.lines.find(({ event }) => event.code === "fault" && event.message.includes(status.cause ?? ""))?.event;
  }

  // By the status: a fault keeps the amplifier off. A rig that has just started was never on.
  follow(status) {
    if (status.state !== "faulted" || status.interlock === "just_started") {
      if (this.pinned && (status.amplifier_on || status.state === "running")) this.pin(null);
      return;
    }
    const event = this.faultOf(status);
    if (event !== undefined && event === this.pinned) return;
    this.pin(event ?? { utc_us: 0, time_ns: 0, severity: 2, code: status.interlock || "fault", message: status.cause || "no cause was given" });
  }
}
