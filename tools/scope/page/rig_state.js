// SPDX-License-Identifier: Apache-2.0
// State of the rig and the daemon: faults, excitation, ledger, timing, events, model check.

import { roundStep, eachTick, fitCanvas } from "./axes.js";
import { Facts, byId, setState, setText, tableRow, watchVisible } from "./elements.js";
import { Events } from "./events.js";
import { RecordingState } from "./recording.js";
import { clockTime, count, duration, number } from "./units.js";

const stateMarks = { faulted: "bad", idle: "unknown", armed: "warn", running: "good", stopping: "warn" };
const limitNames = ["no", "displacement or force", "velocity", "acceleration", "not a number"];

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

export class RigState {
  constructor(app) {
    this.app = app;
    this.status = null;
    this.timing = null;
    this.excitationFacts = new Facts(byId("excitation"));
    this.clockFacts = new Facts(byId("clockwork"));
    this.recording = new RecordingState();
    this.histograms = [...document.querySelectorAll("[data-timing]")].map((figure) => {
      const canvas = figure.querySelector("canvas");
      return { name: figure.dataset.timing, figure, canvas, context: canvas.getContext("2d"), note: figure.querySelector("p") };
    });
    this.visible = watchVisible(this.histograms.map(({ figure }) => figure), () => this.drawTiming());
    this.events = new Events(app);
    this.verdict = null;
    this.fresh = false;
    this.chips = new Map(["state", "amplifier", "recording", "verdict"].map((name) => [name, { element: byId(`${name}-chip`), text: "", state: "unknown" }]));
  }

  #setChip(name, text, state) {
    Object.assign(this.chips.get(name), { text, state });
    this.#showChip(this.chips.get(name));
  }

  // A state that is not known to be of now is grey.
  #showChip({ element, text, state }) {
    if (text === "") return; // not known yet
    setText(element, this.fresh ? text : `was: ${text}`);
    setState(element, this.fresh ? state : "unknown");
  }

  // `fresh`: the latest status describes the rig of now.
  setFresh(fresh) {
    if (fresh === this.fresh) return;
    this.fresh = fresh;
    for (const chip of this.chips.values()) this.#showChip(chip);
    setState(byId("rig"), fresh ? "" : "old");
  }

  take(message) {
    if (message.type === "status") this.#takeStatus(message);
    else if (message.type === "timing") { this.timing = message; this.drawTiming(); }
    else if (message.type === "event") this.#takeEvent(message);
    else if (message.type === "excitation") this.excitation = message;
    else if (message.type === "recorder") this.#takeRecorder(message);
    else if (message.type === "model") setText(byId("rig-name"), message.rig || "scope");
  }

  // Another rig is shown.
  clear() {
    this.events.clear();
    this.rewind();
  }

  // Another time of a recording is shown: nothing is known of it yet.
  rewind() {
    this.status = null;
    this.verdict = null;
    this.logEvent = undefined;
    this.recording.clear();
    this.#setChip("verdict", "model not judged", "unknown");
    setText(byId("verdict"), "The live model check has not reported yet.");
    setState(byId("verdict"), "unknown");
  }

  #takeStatus(status) {
    const before = this.status?.state;
    if (before !== undefined && before !== "faulted" && status.state === "faulted") this.app.faulted(status);
    this.#showRecording(status, this.status);
    this.status = status;
    this.#setChip("state", status.state, stateMarks[status.state] ?? "unknown");
    this.#setChip("amplifier", `amplifier ${status.amplifier_on ? "on" : "off"}`, status.amplifier_on ? "good" : "unknown");
    const fault = byId("fault");
    fault.hidden = status.state !== "faulted";
    setText(byId("fault-name"), status.interlock ? `${status.interlock.replace(/_/g, " ")}:` : "faulted");
    setText(byId("fault-cause"), status.cause ?? "");
    if (before !== undefined && before !== status.state) this.app.say(`The rig is ${status.state}. ${status.cause ?? ""}`);
    this.events.follow(status);
    this.#showLedger(status);
    this.#showClock(status);
  }

  #takeRecorder(message) {
    const before = this.recording.endsSoon;
    this.recording.take(message);
    if (this.recording.endsSoon && !before) this.app.say("The disk of the recording is nearly full.");
    if (this.status) this.#showRecording(this.status, this.status);
  }

  // Bad while frames are lost or the log is missing; a loss stays visible to the end of the recording.
  #showRecording(status, previous) {
    const lost = sum(status.record_loss);
    const lostBefore = sum(previous?.record_loss);
    const losing = lost > (lostBefore <= lost ? lostBefore : 0);
    const missing = this.logEvent?.code === "log_missing";
    const { summary, endsSoon } = this.recording;
    const text = !status.recording ? "not recorded" : losing ? `recording loses frames: ${count(lost)}` : missing ? "log missing"
      : lost > 0 ? `recording${summary}, ${count(lost)} lost` : `recording${summary}`;
    const warned = lost > 0 || endsSoon;
    this.#setChip("recording", text, !status.recording ? "unknown" : losing || missing ? "bad" : warned ? "warn" : "good");
    if (status.recording && losing && !this.losing) this.app.say("The recording loses frames.");
    this.losing = losing;
  }

  #showLedger(status) {
    const body = byId("ledger").tBodies[0];
    const rows = [["produced", status.produced, status.produced], ["delivered", status.publishing ? status.published : NaN, status.recording ? status.recorded : NaN]];
    const losses = new Set([...Object.keys(status.publish_loss ?? {}), ...Object.keys(status.record_loss ?? {})]);
    for (const name of losses) rows.push([`lost: ${name.replace(/_/g, " ")}`, status.publish_loss?.[name], status.record_loss?.[name], true]);
    rows.push(["on its way", status.publishing ? status.produced - status.published - sum(status.publish_loss) : NaN,
      status.recording ? status.produced - status.recorded - sum(status.record_loss) : NaN]);
    while (body.rows.length > rows.length) body.deleteRow(-1);
    rows.forEach(([name, published, recorded, loss], i) => {
      const row = body.rows[i] ?? body.appendChild(tableRow("", 2));
      setText(row.cells[0], name);
      [published, recorded].forEach((value, column) => {
        const off = (column === 0 ? !status.publishing : !status.recording) && name !== "produced";
        setText(row.cells[column + 1], off ? "off" : count(value ?? 0));
        setState(row.cells[column + 1], loss && value > 0 ? "bad" : "");
      });
    });
    this.ledgerBalances = rows.every(([name, published, recorded]) => name !== "on its way" || !(published < 0 || recorded < 0));
  }

  #showClock(status) {
    const facts = this.clockFacts;
    const bad = (value, state = "warn") => (value > 0 ? state : "");
    facts.set("running for", duration(status.uptime_ns / 1e9, 4));
    facts.set("cycles", count(status.cycles));
    facts.set("overruns", count(status.overruns), bad(status.overruns));
    facts.set("late cycles", count(status.late_cycles), bad(status.late_cycles));
    facts.set("lateness, 99 % / max", `${duration(status.lateness_p99_ns / 1e9)} / ${duration(status.lateness_max_ns / 1e9)}`, status.degraded ? "warn" : "");
    facts.set("cycle, 99 % / max", `${duration(status.cycle_p99_ns / 1e9)} / ${duration(status.cycle_max_ns / 1e9)}`);
    facts.set("missing at source", count(status.missing_at_source), bad(status.missing_at_source, "bad"));
    facts.set("failed reads, writes", `${count(status.failed_reads)}, ${count(status.failed_writes)}`, bad(status.failed_reads + status.failed_writes, "bad"));
    facts.set("not finite, repeated", `${count(status.not_finite)}, ${count(status.repeated)}`, bad(status.not_finite + status.repeated));
    facts.set("lost messages", count(status.lost_messages), bad(status.lost_messages));
  }

  // A few times a second: values that arrive too often to be shown each time.
  update() {
    const now = this.excitation;
    if (!now) return;
    const { units } = this.app;
    const last = (list) => (list?.length ? list[list.length - 1] : NaN);
    const facts = this.excitationFacts;
    const forced = this.app.driveIsForce;
    const shown = (value) => (forced ? `${number(value)} N` : `${number(value * units.factor("length"))} ${units.label("length")}`);
    facts.set("carrier", `${number(now.carrier_hz)} Hz`);
    facts.set("amplitude", shown(last(now.amplitude)));
    facts.set("drive", shown(last(now.drive)));
    facts.set("phase", `${number((last(now.phase_rad) * 180) / Math.PI, 3)}°`);
    facts.set("gain", number(now.gain));
    const limit = Number(now.limited) || 0;
    facts.set("limited", limitNames[limit] ?? String(limit), limit > 0 ? "warn" : "");
  }

  // --- events --------------------------------------------------------------------------------------

  // Verdicts of the model check, and the state of the log.
  judge(event) {
    if (event.code === "model_broken" || event.code === "model_follows") this.#takeVerdict(event);
    if (event.code.startsWith("log_") && !(event.utc_us < this.logEvent?.utc_us)) this.logEvent = event;
    if (event.code === "model_explained" || event.code === "model_unexplained") this.#takeExplanation(event);
  }

  #takeEvent(event) {
    this.judge(event);
    if (this.events.take(event) && event.severity >= 2) this.app.say(`Error: ${event.message}`);
    this.app.touch();
  }

  #takeVerdict(event) {
    if (this.verdict && event.utc_us < this.verdict.utc_us) return;
    this.verdict = event;
    const broken = event.code === "model_broken";
    const line = byId("verdict");
    setText(line, `${broken ? "✕" : "●"} ${sentence(event.message)}`);
    setState(line, broken ? "bad" : "good");
    this.#setChip("verdict", broken ? "rig deviates" : "rig follows model", broken ? "bad" : "good");
  }

  // Belongs to the preceding alarm.
  #takeExplanation(event) {
    if (this.verdict?.code !== "model_broken" || event.utc_us < this.verdict.utc_us) return;
    const line = byId("verdict");
    setText(line, `✕ ${sentence(event.message)}. First alarm ${clockTime(this.verdict.utc_us / 1e3)}: ${this.verdict.message}`);
  }

  // --- histograms of timing ------------------------------------------------------------------------

  drawTiming() {
    if (!this.timing) return;
    for (const one of this.histograms) if (this.visible(one.figure)) this.#drawHistogram(one);
  }

  // Durations on a logarithmic axis, counts on another: one late cycle in a million is visible.
  #drawHistogram(one) {
    const { context, canvas } = one;
    const { theme } = this.app;
    const { colours, small, font } = theme;
    const edges = this.timing.upper_edge_ns;
    const counts = this.timing[one.name] ?? [];
    const box = canvas.getBoundingClientRect();
    fitCanvas(canvas, context, box.width, box.height, Math.min(3, window.devicePixelRatio || 1));
    context.clearRect(0, 0, box.width, box.height);
    let first = counts.findIndex((n) => n > 0);
    const last = counts.findLastIndex((n) => n > 0);
    if (first < 0) { setText(one.note, "nothing counted"); return; }
    first = Math.max(0, first - 1);
    const left = small * 3;
    const bottom = small * 1.7;
    const width = box.width - left - 4;
    const height = box.height - bottom - 4;
    const low = Math.log10(lowerEdge(edges, first));
    const high = Math.max(low + 1, Math.log10(edges[last]) + 0.1);
    const most = Math.log10(Math.max(...counts) * 1.6);
    const x = (ns) => left + ((Math.log10(ns) - low) / (high - low)) * width;
    const y = (n) => 4 + height * (1 - Math.log10(n * 2) / (most + Math.log10(2)));
    context.font = font;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillStyle = colours.quiet;
    context.strokeStyle = colours.line;
    context.beginPath();
    const step = Math.max(1, roundStep(most, 3));
    eachTick(0, most, step, (power) => {
      context.moveTo(left, Math.round(y(10 ** power)) + 0.5);
      context.lineTo(left + width, Math.round(y(10 ** power)) + 0.5);
      context.fillText(power < 4 ? String(10 ** Math.round(power)) : `10${"⁰¹²³⁴⁵⁶⁷⁸⁹"[Math.round(power)] ?? ""}`, left - 4, y(10 ** power));
    });
    context.textAlign = "center";
    context.textBaseline = "top";
    for (let power = Math.ceil(low); power <= high; ++power) {
      const at = Math.round(x(10 ** power)) + 0.5;
      context.moveTo(at, 4);
      context.lineTo(at, 4 + height);
      context.fillText(duration(10 ** (power - 9), 1), Math.min(Math.max(at, left + small), left + width - small * 1.4), 6 + height);
    }
    context.stroke();
    context.fillStyle = colours.c0;
    for (let bin = first; bin <= last; ++bin) {
      if (!(counts[bin] > 0)) continue;
      const from = x(lowerEdge(edges, bin));
      context.fillRect(from, y(counts[bin]), Math.max(1, x(edges[bin]) - from - 1), 4 + height - y(counts[bin]));
    }
    context.strokeStyle = colours["strong-line"];
    context.strokeRect(left + 0.5, 4.5, width - 1, height - 1);
    const total = counts.reduce((sum, n) => sum + n, 0);
    const text = `median ≤ ${duration(quantile(edges, counts, total, 0.5) / 1e9)}, 99 % ≤ ${duration(quantile(edges, counts, total, 0.99) / 1e9)}, ` +
      `all ≤ ${duration(edges[last] / 1e9)}; ${count(total)} counted`;
    setText(one.note, text);
    canvas.setAttribute("aria-label", `${one.figure.querySelector("h3").textContent}: ${text}`);
  }
}

function sum(losses) {
  return Object.values(losses ?? {}).reduce((total, value) => total + value, 0);
}

// Bins of increasing width; the first begins at 0, which a logarithmic axis cannot show.
function lowerEdge(edges, bin) {
  return bin > 0 ? edges[bin - 1] : (edges[0] * edges[0]) / edges[1];
}

function quantile(edges, counts, total, part) {
  let sum = 0;
  for (let bin = 0; bin < counts.length; ++bin) {
    sum += counts[bin];
    if (sum >= part * total) return edges[bin];
  }
  return NaN;
}
