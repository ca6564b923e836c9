// SPDX-License-Identifier: Apache-2.0
// The oscilloscope: stacked channels over device time, with trigger, cursors and readings.

import { Alarms } from "./alarms.js";
import { eachTick, fitCanvas, scaleStep } from "./axes.js";
import { byId, fillSelect, setPressed, setText, tableRow } from "./elements.js";
import { ExpressionField } from "./expression_field.js";
import { Hover } from "./hover.js";
import { drawTitle } from "./lane_title.js";
import { arrange, makeLanes, maxPoints, membersOf, moveInto, place, sharedExtremes } from "./lanes.js";
import { TraceCanvas, gap } from "./trace_gl.js";
import { Trigger, modes } from "./trigger.js";
import { channels, clockTick, clockTime, decimalsFor, duration, fixed, measuredCount, number, tick, withUnit } from "./units.js";
import { ViewAddress } from "./view_address.js";

export const timeBases_s = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60];
const shortest_s = 0.002;
const longest_s = 120;

export class Oscilloscope {
  // app: store (the data shown), live, paused, pause(), units, theme, settings.
  constructor(app) {
    this.app = app;
    this.screen = byId("screen");
    this.axesCanvas = byId("scope-axes");
    this.axes = this.axesCanvas.getContext("2d");
    this.traces = new TraceCanvas(byId("scope-traces"));
    this.trigger = new Trigger();
    this.span_s = 10;
    this.left_ns = 0; // time at the left edge
    this.span_ns = 1e10;
    this.held = false; // the display is frozen at a trigger
    this.lanes = makeLanes();
    this.low = new Float64Array(maxPoints);
    this.high = new Float64Array(maxPoints);
    this.bounds = new Float64Array(maxPoints + 1);
    this.pair = new Float64Array(2);
    this.cursors = [{ part: 0.35, element: byId("cursor-a") }, { part: 0.65, element: byId("cursor-b") }];
    this.cursorsOn = false;
    this.labels = new Map();
    this.labelStep = 0;
    this.markers = []; // as drawn: place and code of each event
    this.#restore();
    this.#buildControls();
    this.#buildReadings();
    this.#listen();
    this.hover = new Hover(this);
    this.alarms = new Alarms(this.app, this.lanes, this.kept.limits);
    this.expression = new ExpressionField(this.app, this.lanes.at(-1), this.kept.expression);
    this.ready = true;
    this.layout();
    if (this.kept.cursors) this.#placeCursors(this.kept.cursors);
  }

  // From the address, or as it was last in this browser.
  #restore() {
    this.address = new ViewAddress(this.app.settings);
    const view = this.address.read();
    if (view.units) this.app.units.system = view.units;
    if (view.span_s >= shortest_s && view.span_s <= longest_s) this.span_s = view.span_s;
    // At first, all that are measured.
    const usual = ({ index, channel }) => index < measuredCount || (channel.key === "expression" && view.expression !== "");
    for (const lane of this.lanes) lane.wanted = view.lanes?.some((members) => members.includes(lane.index)) ?? usual(lane);
    for (const [host, ...members] of view.lanes ?? []) for (const member of members) moveInto(this.lanes, this.lanes[member], host);
    for (const [index, scale] of view.scales) {
      const { own } = this.lanes[index];
      own.set(...scale.map((value) => value * this.#factor(this.lanes[index])));
      own.manual = true;
    }
    if (view.trigger) this.trigger.set(view.trigger, 0);
    this.kept = view; // for what is built later
  }

  #placeCursors(parts) {
    this.cursors.forEach((cursor, i) => { cursor.part = parts[i]; });
    this.toggleCursors(true);
  }

  // Keeps the view after a change by the user.
  keep() {
    if (!this.ready) return;
    const { lanes } = this;
    const hosts = lanes.filter((lane) => lanes.some((one) => one.wanted && one.host === lane.index));
    this.address.write({
      span_s: this.span_s,
      lanes: hosts.map((host) => [host, ...lanes.filter((one) => one !== host && one.host === host.index)].filter((one) => one.wanted).map((one) => one.index)),
      scales: lanes.filter(({ own }) => own.manual && own.known).map((lane) => [lane.index, lane.own.low / this.#factor(lane), lane.own.high / this.#factor(lane)]),
      limits: this.alarms.list(),
      expression: this.expression.text,
      trigger: this.trigger.mode === "roll" ? null : this.trigger,
      units: this.app.units.system,
      cursors: this.cursorsOn ? this.cursors.map(({ part }) => part) : null,
    });
  }

  // --- visible range -------------------------------------------------------------------------------

  layout() {
    const box = this.screen.getBoundingClientRect();
    const { rem, small } = this.app.theme;
    this.width = box.width;
    this.height = box.height;
    this.gutter = Math.round(small * 4.6);
    this.rightGutter = Math.round(rem * 1.25);
    this.bottom = Math.round(small * 1.9);
    this.plotWidth = Math.max(40, Math.floor(this.width - this.gutter - this.rightGutter));
    this.plotHeight = Math.max(40, this.height - this.bottom);
    this.ratio = Math.min(3, window.devicePixelRatio || 1);
    this.traces.resize(this.width, this.height, this.ratio);
    fitCanvas(this.axesCanvas, this.axes, this.width, this.height, this.ratio);
  }

  #findWindow() {
    const { store, live, paused } = this.app;
    if (paused) return;
    this.span_ns = this.span_s * 1e9;
    const lane = this.lanes[this.trigger.channel];
    this.trigger.hysteresis = lane.limits.known ? ((lane.limits.high - lane.limits.low) * 0.01) / this.#factor(lane) : 0;
    this.trigger.scan(live.frames, this.span_ns);
    this.held = this.trigger.holds(live.frames, this.span_ns);
    if (this.held) this.left_ns = this.trigger.fired_ns - this.span_ns * this.trigger.before;
    else if (this.trigger.mode === "roll" || this.trigger.mode === "auto" || store.frames.empty) this.left_ns = store.frames.last_ns - this.span_ns;
    if (this.trigger.done) this.app.pause(true);
  }

  #factor(lane) { return this.app.units.factor(lane.channel.quantity); }

  clear() {
    for (const lane of this.lanes) {
      lane.present = false;
      if (!lane.own.manual) lane.own.reset();
    }
    this.trigger.arm();
  }

  draw(now_ms) {
    this.#findWindow();
    const { frames } = this.app.store;
    this.titleHeight = Math.round(this.app.theme.small * 1.5);
    arrange(this.lanes, frames, this.pair);
    place(this.lanes, this.plotHeight, this.titleHeight);
    frames.touched = 0;
    this.#fillColumns(frames);
    for (const lane of this.lanes) lane.count = 0;
    // A scale that is shared is that of the first of its channels, which is filled before the others.
    const shown = frames.empty ? [] : this.lanes.filter((lane) => lane.visible);
    for (const lane of shown) if (lane.limits === lane.own) this.#fillLane(lane, frames, now_ms);
    for (const lane of shown) if (lane.limits !== lane.own) this.#fillLane(lane, frames, now_ms);
    this.#drawTraces();
    this.#drawAxes();
    this.#placeHandles();
    this.hover.draw(frames);
  }

  // Rows of the frames at each edge of a column of one pixel. Columns start at whole multiples of their
  // width in device time, so that traces do not change shape while they scroll.
  #fillColumns(frames) {
    const width = this.plotWidth;
    this.column_ns = this.span_ns / width;
    this.firstColumn = Math.floor(this.left_ns / this.column_ns);
    this.columnCount = width + 2;
    this.fromRow = frames.rowAt(this.left_ns);
    this.toRow = frames.rowAt(this.left_ns + this.span_ns, this.fromRow);
    this.dense = this.toRow - this.fromRow > 2 * width;
    if (!this.dense) return;
    let row = frames.begin;
    for (let i = 0; i <= this.columnCount; ++i) {
      row = frames.rowAt((this.firstColumn + i) * this.column_ns, row);
      this.bounds[i] = row;
    }
  }

  #fillLane(lane, frames, now_ms) {
    if (this.dense) this.#summariseDense(lane, frames);
    else this.#summariseSparse(lane, frames);
    lane.alarm = Alarms.side(lane.bounds, this.pair[0], this.pair[1]);
    if (!lane.limits.manual && lane.limits === lane.own) {
      const factor = this.#factor(lane);
      if (this.lanes.some((one) => one !== lane && one.visible && one.limits === lane.limits)) sharedExtremes(this.lanes, lane, frames, this.fromRow, this.toRow, this.pair);
      lane.limits.follow(this.pair[0] * factor, this.pair[1] * factor, now_ms);
    }
    if (!lane.limits.known) return;
    if (this.dense) this.#traceDense(lane);
    else this.#traceSparse(lane, frames);
  }

  #summariseDense(lane, frames) {
    let low = Infinity;
    let high = -Infinity;
    for (let i = 0; i < this.columnCount; ++i) {
      frames.extremes(lane.index, this.bounds[i], this.bounds[i + 1], this.pair);
      this.low[i] = this.pair[0];
      this.high[i] = this.pair[1];
      if (this.pair[0] < low) low = this.pair[0];
      if (this.pair[1] > high) high = this.pair[1];
    }
    this.pair[0] = low;
    this.pair[1] = high;
  }

  #summariseSparse(lane, frames) {
    frames.extremes(lane.index, Math.max(frames.begin, this.fromRow - 1), Math.min(frames.end, this.toRow + 1), this.pair);
  }

  // Two points per column; first the one nearer to the last point of the previous column.
  #traceDense(lane) {
    const { points } = lane;
    const scale = (this.#factor(lane) * lane.height) / (lane.limits.high - lane.limits.low);
    const base = lane.top + lane.height + (lane.limits.low * lane.height) / (lane.limits.high - lane.limits.low);
    const shift = this.gutter + (this.firstColumn * this.column_ns - this.left_ns) / this.column_ns + 0.5;
    let last = 0;
    let count = 0;
    for (let i = 0; i < this.columnCount; ++i) {
      const low = this.low[i];
      const high = this.high[i];
      const at = 2 * count;
      if (!(low <= high)) {
        points[at] = gap;
        points[at + 1] = 0;
        count += 1;
        continue;
      }
      const lowFirst = Math.abs(low - last) <= Math.abs(high - last);
      points[at] = shift + i;
      points[at + 1] = base - (lowFirst ? low : high) * scale;
      points[at + 2] = shift + i;
      points[at + 3] = base - (lowFirst ? high : low) * scale;
      last = lowFirst ? high : low;
      count += 2;
    }
    lane.count = count;
  }

  #traceSparse(lane, frames) {
    const { points } = lane;
    const { time, mask } = frames;
    const data = frames.values[lane.index];
    const scale = (this.#factor(lane) * lane.height) / (lane.limits.high - lane.limits.low);
    const base = lane.top + lane.height + (lane.limits.low * lane.height) / (lane.limits.high - lane.limits.low);
    const perNs = this.plotWidth / this.span_ns;
    const from = Math.max(frames.begin, this.fromRow - 1);
    const to = Math.min(frames.end, this.toRow + 1);
    let count = 0;
    for (let row = from; row < to && count < maxPoints - 2; ++row) {
      const value = data[row & mask];
      if ((row > from && frames.broken(row - 1, row)) || value !== value) {
        points[2 * count] = gap;
        points[2 * count + 1] = 0;
        count += 1;
      }
      if (value === value) {
        points[2 * count] = this.gutter + (time[row & mask] - this.left_ns) * perNs;
        points[2 * count + 1] = base - value * scale;
        count += 1;
      }
    }
    lane.count = count;
  }

  #drawTraces() {
    const { traces } = this;
    const { channel: colours, large } = this.app.theme;
    const thick = large ? 2.2 : 1.4;
    traces.begin();
    for (const lane of this.lanes) {
      if (!lane.visible || lane.count === 0) continue;
      traces.clip(this.gutter, lane.top, this.plotWidth, lane.height);
      traces.line(lane.points, lane.count, colours[lane.index], thick);
      // Frames far apart are drawn as points.
      if (!this.dense && (this.toRow - this.fromRow) * 7 < this.plotWidth) traces.dots(lane.points, lane.count, colours[lane.index], thick * 2.6);
      traces.unclip();
    }
  }

  // --- axes ----------------------------------------------------------------------------------------

  #drawAxes() {
    const { axes, gutter, plotWidth, plotHeight } = this;
    const { colours, font, small } = this.app.theme;
    axes.clearRect(0, 0, this.width, this.height);
    axes.font = font;
    axes.lineWidth = 1;
    this.#drawTimeAxis(axes, colours, small);
    for (const lane of this.lanes) if (lane.leader === lane) this.#drawLane(axes, lane);
    axes.strokeStyle = colours["strong-line"];
    axes.strokeRect(gutter + 0.5, 0.5, plotWidth - 1, plotHeight - 1);
    this.#drawMarkers(axes, colours, small);
    if (this.held) this.#drawTriggerLine(axes, colours.accent);
  }

  // The events of the list, at their device times.
  #drawMarkers(axes, colours, small) {
    const { origin_ns: origin } = this.app.store.frames;
    this.markers = [];
    if (origin === null) return;
    for (const { event, at, item } of this.app.rig.events.lines) {
      if (item.hidden) continue;
      for (const time_ns of at) {
        const x = this.gutter + ((time_ns - Number(origin) - this.left_ns) / this.span_ns) * this.plotWidth;
        if (!(x >= this.gutter && x <= this.gutter + this.plotWidth)) continue;
        const note = event.code === "note" ? event.message : "";
        this.markers.push({ x, code: event.code, note });
        axes.strokeStyle = axes.fillStyle = note ? colours.mark : [colours.quiet, colours.warn, colours.bad][event.severity] ?? colours.quiet;
        axes.setLineDash(event.severity >= 2 ? [] : [1, 3]);
        axes.beginPath();
        axes.moveTo(x, 0);
        axes.lineTo(x, this.plotHeight);
        axes.stroke();
        axes.setLineDash([]);
        axes.beginPath();
        axes.moveTo(x - small / 3, this.plotHeight);
        axes.lineTo(x + small / 3, this.plotHeight);
        axes.lineTo(x, this.plotHeight - small / 2);
        axes.fill();
        if (note) this.#drawNote(axes, x, note, colours);
      }
    }
  }

  // The beginning of a note beside its marker, in the strip of a lane's title, where no trace is: the first with
  // room for it.
  #drawNote(axes, x, note, colours) {
    const words = note.length > 40 ? `${note.slice(0, 39)}…` : note;
    const { width } = axes.measureText(words);
    const right = this.gutter + this.plotWidth;
    for (const lane of this.lanes) {
      if (lane.leader !== lane) continue;
      const side = x + width + 8 < right ? 1 : -1;
      const left = side > 0 ? x + 4 : x - width - 4;
      const taken = lane.taken.some(([from, to]) => left < to + 4 && left + width > from - 4);
      if (taken) continue;
      lane.taken.push([left, left + width]);
      axes.textBaseline = "top";
      axes.textAlign = "left";
      axes.fillStyle = colours.mark;
      axes.fillText(words, left, lane.edge + 3);
      this.markers.at(-1).shown = words;
      return;
    }
  }

  // Seconds that are added to the frames' own time for the chosen clock.
  #origin_s(frames) {
    if (this.held) return -this.trigger.fired_ns / 1e9;
    if (this.#inUtc(frames)) return frames.utc_ms / 1e3;
    return frames.origin_ns === null ? 0 : Number(frames.origin_ns) / 1e9;
  }

  // A time on screen by the chosen clock, to a ten-thousandth of the screen.
  timeText(frames, at_ns) {
    const step = this.span_ns / 1e9 / 1e4;
    const at_s = at_ns / 1e9 + this.#origin_s(frames);
    return this.#inUtc(frames) ? clockTick(at_s, step) : tick(at_s, step);
  }

  // Its unit.
  timeUnit(frames) { return this.held ? "s after trigger" : this.#inUtc(frames) ? "UTC" : "s"; }

  // A value [SI] of a lane in its unit, with a decimal more than the readings have.
  valueText(lane, value) { return fixed(value * this.#factor(lane), Math.min(9, lane.decimals + 1)); }

  #inUtc(frames) { return !this.held && this.app.clock === "utc" && frames.utc_ms === frames.utc_ms; }

  // Device time or UTC, or time relative to the trigger if the display is held by it.
  #drawTimeAxis(axes, colours, small) {
    const { frames } = this.app.store;
    const origin_s = this.#origin_s(frames);
    const utc = this.#inUtc(frames);
    if (!Number.isFinite(this.left_ns)) return;
    const low = this.left_ns / 1e9 + origin_s;
    const span = this.span_ns / 1e9;
    // A label is not drawn beside the name of the axis.
    const free = Math.max(0.3, 1 - (small * 8) / this.plotWidth);
    const step = scaleStep(low, low + span * free, Math.max(2, Math.floor((free * this.plotWidth) / (small * 6))));
    if (step !== this.labelStep || utc !== this.labelsUtc || this.labels.size > 400) {
      this.labels.clear();
      this.labelsUtc = utc;
      this.labelStep = step;
    }
    axes.strokeStyle = colours.line;
    axes.fillStyle = colours.quiet;
    axes.textAlign = "center";
    axes.textBaseline = "bottom";
    axes.beginPath();
    eachTick(low, low + span, step, (value) => {
      const x = this.gutter + Math.round(((value - low) / span) * this.plotWidth) + 0.5;
      axes.moveTo(x, 0);
      axes.lineTo(x, this.plotHeight);
      if (x > this.width - small * 9) return;
      const key = Math.round(value / step);
      let label = this.labels.get(key);
      if (label === undefined) {
        label = utc ? clockTick(value, step) : tick(value, step);
        this.labels.set(key, label);
      }
      axes.fillText(label, x, this.height - 1);
    });
    axes.stroke();
    axes.textAlign = "right";
    axes.fillText(this.held ? "s after trigger" : utc ? "UTC" : "device time (s)", this.width - this.rightGutter, this.height - 1);
  }

  #drawLane(axes, lane) {
    const { colours, small } = this.app.theme;
    const { limits, top, height, edge } = lane;
    if (edge > 0) {
      axes.strokeStyle = colours["strong-line"];
      axes.beginPath();
      axes.moveTo(this.gutter, Math.round(edge) + 0.5);
      axes.lineTo(this.gutter + this.plotWidth, Math.round(edge) + 0.5);
      axes.stroke();
    }
    if (limits.known) {
      const step = scaleStep(limits.low, limits.high, Math.max(2, Math.floor(height / (small * 1.7))));
      lane.labels = [];
      axes.textAlign = "right";
      axes.textBaseline = "middle";
      axes.fillStyle = colours.quiet;
      axes.strokeStyle = colours.line;
      axes.beginPath();
      eachTick(limits.low, limits.high, step, (value) => {
        const y = Math.round(top + height * (1 - (value - limits.low) / (limits.high - limits.low))) + 0.5;
        axes.moveTo(this.gutter, y);
        axes.lineTo(this.gutter + this.plotWidth, y);
        lane.labels.push(tick(value, step));
        axes.fillText(tick(value, step), this.gutter - 5, y);
      });
      axes.stroke();
    }
    const members = membersOf(this.lanes, lane);
    drawTitle(axes, members, this);
    for (const member of members) if (member.limits.known) this.alarms.draw(axes, member, this);
  }

  #drawTriggerLine(axes, colour) {
    const x = this.gutter + ((this.trigger.fired_ns - this.left_ns) / this.span_ns) * this.plotWidth;
    axes.strokeStyle = colour;
    axes.setLineDash([2, 3]);
    axes.beginPath();
    axes.moveTo(x, 0);
    axes.lineTo(x, this.plotHeight);
    const lane = this.lanes[this.trigger.channel];
    const y = this.#levelY(lane);
    if (lane.visible && y !== null) {
      axes.moveTo(this.gutter, y);
      axes.lineTo(this.gutter + this.plotWidth, y);
    }
    axes.stroke();
    axes.setLineDash([]);
  }

  #levelY(lane) {
    if (!lane.limits.known) return null;
    const part = (this.trigger.level * this.#factor(lane) - lane.limits.low) / (lane.limits.high - lane.limits.low);
    return lane.top + lane.height * (1 - Math.min(1, Math.max(0, part)));
  }

  #placeHandles() {
    const lane = this.lanes[this.trigger.channel];
    const handle = this.levelHandle;
    const y = lane.visible && this.trigger.mode !== "roll" ? this.#levelY(lane) : null;
    if (handle.hidden !== (y === null)) handle.hidden = y === null;
    if (y !== null && handle.shownAt !== y) {
      handle.shownAt = y;
      handle.style.top = `${y}px`;
    }
    for (const cursor of this.cursors) {
      const x = this.gutter + cursor.part * this.plotWidth;
      if (cursor.shownAt === x) continue;
      cursor.shownAt = x;
      cursor.element.style.left = `${x}px`;
    }
  }

  // --- readings, a few times a second --------------------------------------------------------------

  #buildReadings() {
    const body = byId("readings").tBodies[0];
    for (const lane of this.lanes) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = lane.channel.name;
      button.style.setProperty("--colour", `var(--c${lane.index})`);
      button.title = `Show or hide (${lane.index + 1})`;
      button.addEventListener("click", () => this.toggleLane(lane.index));
      lane.button = button;
      lane.row = tableRow(button, 5);
      lane.row.cells[1].classList.add("last");
      body.append(lane.row);
      setPressed(button, lane.wanted);
    }
    const table = byId("cursor-readings").tBodies[0];
    this.cursorTime = tableRow("t (s)", 3);
    this.cursorRate = tableRow("1/Δt (Hz)", 3);
    table.append(this.cursorTime, this.cursorRate);
    for (const lane of this.lanes) {
      lane.cursorRow = tableRow("", 3);
      table.append(lane.cursorRow);
    }
  }

  updateReadings() {
    const { frames } = this.app.store;
    const from = frames.rowAt(this.left_ns);
    const to = frames.rowAt(this.left_ns + this.span_ns, from);
    const readings = [];
    for (const lane of this.lanes) {
      lane.row.hidden = lane.boundsRow.hidden = !lane.present;
      if (!lane.present) continue;
      lane.measured.take(frames, lane.index, from, to);
      const factor = this.#factor(lane);
      const unit = this.app.units.label(lane.channel.quantity);
      const { last, low, high, mean, rms } = lane.measured;
      // Of the scale, which does not jitter.
      lane.decimals = decimalsFor(lane.limits.known ? Math.max(Math.abs(lane.limits.low), Math.abs(lane.limits.high)) : NaN);
      setText(lane.button, withUnit(lane.channel.name, unit));
      const cells = lane.row.cells;
      [last, low, high, mean, rms].forEach((value, i) => setText(cells[i + 1], fixed(value * factor, lane.decimals)));
      if (lane.wanted) readings.push(`${lane.channel.name.toLowerCase()} ${fixed(last * factor, lane.decimals)} ${unit}`);
    }
    this.summary = readings.length === 0 ? "No frames received yet." : readings.join(", ");
    const lost = frames.empty ? 0 : this.#lostInView(frames, from, to);
    const step_s = to - from < 2 ? 0 : this.#steppedInView(frames, from, to);
    const place = (lost > 0 ? ` ${lost} frames were lost in it.` : "") + (step_s !== 0 ? ` Its time steps by ${duration(step_s)}.` : "");
    setText(byId("scope-summary"), frames.empty ? "No frames received yet."
      : `${to - from} frames on screen at ${number(frames.rate_hz)} Hz, ${duration(this.span_ns / 1e9)} of device time.${place}`);
    setText(byId("trigger-state"), this.trigger.word);
    this.#showNote();
    if (this.cursorsOn) this.#updateCursors(frames);
  }

  #showNote() {
    const note = byId("screen-note");
    const { paused, frozenAt, restarted } = this.app;
    const frozen = frozenAt ? `frozen at the fault of ${clockTime(frozenAt.unix_ms)}` : this.trigger.done ? "single shot, paused" : "paused";
    const text = this.app.replay.active ? "" : paused ? frozen + (restarted ? "; the daemon was restarted since" : "")
      : this.trigger.word === "waiting" ? "waiting for the trigger" : this.held ? "triggered" : "";
    note.hidden = text === "";
    setText(note, text);
  }

  #lostInView(frames, from, to) {
    if (to - from < 2) return 0;
    const { sequence } = frames.columns;
    return sequence[(to - 1) & frames.mask] - sequence[from & frames.mask] - (to - 1 - from);
  }

  // Steps of the time [s], summed.
  #steppedInView(frames, from, to) {
    const { stepped } = frames.columns;
    return (stepped[(to - 1) & frames.mask] - stepped[from & frames.mask]) / 1e9;
  }

  // --- cursors -------------------------------------------------------------------------------------

  cursorTime_ns(index) { return this.left_ns + this.cursors[index].part * this.span_ns; }

  #updateCursors(frames) {
    const [a, b] = [this.cursorTime_ns(0), this.cursorTime_ns(1)];
    const unit = this.timeUnit(frames);
    const write = (row, ...texts) => texts.forEach((text, i) => setText(row.cells[i + 1], text));
    setText(this.cursorTime.cells[0], unit === "UTC" ? unit : "t (s)");
    write(this.cursorTime, this.timeText(frames, a), this.timeText(frames, b), number((b - a) / 1e9, 5));
    write(this.cursorRate, "", "", a === b ? "–" : number(1e9 / Math.abs(b - a), 5));
    this.cursors.forEach((cursor, i) => {
      const time = `${this.timeText(frames, i === 0 ? a : b)} ${unit === "UTC" ? unit : "s"}`;
      cursor.element.setAttribute("aria-valuenow", cursor.part.toFixed(4));
      cursor.element.setAttribute("aria-valuetext", time);
    });
    for (const lane of this.lanes) {
      lane.cursorRow.hidden = !lane.visible;
      if (!lane.visible) continue;
      const atA = frames.valueAt(lane.index, a);
      const atB = frames.valueAt(lane.index, b);
      setText(lane.cursorRow.cells[0], withUnit(lane.channel.symbol, this.app.units.label(lane.channel.quantity)));
      write(lane.cursorRow, ...[atA, atB, atB - atA].map((value) => this.valueText(lane, value)));
    }
  }

  toggleCursors(on = !this.cursorsOn) {
    this.cursorsOn = on;
    for (const cursor of this.cursors) {
      cursor.element.hidden = !on;
      cursor.element.setAttribute("aria-valuemin", "0");
      cursor.element.setAttribute("aria-valuemax", "1");
    }
    byId("cursor-readings").hidden = !on;
    setPressed(byId("cursors"), on);
    if (on) this.#updateCursors(this.app.store.frames);
    this.keep();
    this.app.touch();
  }

  moveCursor(index, part) {
    if (!this.cursorsOn) this.toggleCursors(true);
    this.cursors[index].part = Math.min(1, Math.max(0, part));
    this.#updateCursors(this.app.store.frames);
    this.keep();
    this.app.touch();
  }

  nudgeCursor(index, pixels) { this.moveCursor(index, this.cursors[index].part + pixels / this.plotWidth); }

  // The channels on screen.
  shownLanes() { return this.lanes.filter((lane) => lane.visible); }

  // --- actions -------------------------------------------------------------------------------------

  toggleLane(index) {
    const lane = this.lanes[index];
    lane.wanted = !lane.wanted;
    setPressed(lane.button, lane.wanted);
    this.keep();
    this.app.touch();
  }

  // Draws a channel in the lane of another, or in its own.
  overlay(lane, host) {
    moveInto(this.lanes, lane, host);
    for (const one of this.lanes) if (!one.own.manual) one.own.reset();
    this.alarms.show();
    this.keep();
    this.app.touch();
  }

  // Shows a lane whose data is other than before.
  renewLane(lane, wanted) {
    lane.present = false;
    lane.own.reset();
    if (wanted !== lane.wanted) this.toggleLane(lane.index);
    this.app.touch();
  }

  // Sets the time base. While paused, the time at the fraction `part` of the screen stays in place.
  setSpan(span_s, part = 0.5) {
    this.span_s = Math.min(longest_s, Math.max(shortest_s, span_s));
    if (this.app.paused) {
      const kept = this.cursors.map((_, i) => this.cursorTime_ns(i));
      const fixed = this.left_ns + this.span_ns * part;
      this.span_ns = this.span_s * 1e9;
      this.left_ns = fixed - this.span_ns * part;
      this.#keepCursors(kept);
    }
    this.#showTimeBase();
    this.keep();
    this.app.touch();
  }

  #keepCursors(times_ns) {
    this.cursors.forEach((cursor, i) => { cursor.part = Math.min(1, Math.max(0, (times_ns[i] - this.left_ns) / this.span_ns)); });
  }

  // The next longer (1) or shorter (-1) time base of the list.
  stepSpan(direction, part) {
    const longer = timeBases_s.find((span) => span > this.span_s * 1.001);
    const shorter = timeBases_s.findLast((span) => span < this.span_s * 0.999);
    const next = direction > 0 ? longer : shorter;
    if (next !== undefined) this.setSpan(next, part);
  }

  // Moves along time by a fraction of the screen; a running display is paused first.
  pan(part) {
    if (!this.app.paused) this.app.pause(true);
    const kept = this.cursors.map((_, i) => this.cursorTime_ns(i));
    const { frames } = this.app.store;
    const least = frames.first_ns - this.span_ns * 0.9;
    const most = frames.last_ns - this.span_ns * 0.1;
    const wanted = this.left_ns + part * this.span_ns;
    this.left_ns = frames.empty ? wanted : Math.min(most, Math.max(least, wanted));
    this.#keepCursors(kept);
    this.app.touch();
  }

  // Shows a time in the middle of the paused screen.
  moveTo(time_ns) {
    const kept = this.cursors.map((_, i) => this.cursorTime_ns(i));
    this.left_ns = time_ns - this.span_ns / 2;
    this.#keepCursors(kept);
    this.app.touch();
  }

  // Scales a lane about its middle, until the view is reset.
  scaleLane(index, factor) {
    const { limits } = this.lanes[index];
    if (!limits.known) return;
    const middle = (limits.low + limits.high) / 2;
    const half = ((limits.high - limits.low) / 2) * factor;
    limits.manual = true;
    limits.set(middle - half, middle + half);
    this.keep();
    this.app.touch();
  }

  reset() {
    for (const lane of this.lanes) {
      lane.own.reset();
    }
    this.setSpan(10);
    if (this.app.paused) this.left_ns = this.app.store.frames.last_ns - this.span_ns;
    this.app.touch();
  }

  unitsChanged() {
    for (const lane of this.lanes) {
      lane.own.reset();
    }
    this.alarms.show();
    this.keep();
    this.#showTrigger();
  }

  setTrigger(change) {
    this.trigger.set(change, this.app.live.frames.end);
    if (this.app.paused && this.trigger.mode !== "roll") this.app.pause(false);
    this.#showTrigger();
    this.keep();
    this.app.touch();
  }

  nextTriggerMode() { this.setTrigger({ mode: modes[(modes.indexOf(this.trigger.mode) + 1) % modes.length] }); }

  // Moves the level by a fraction of the lane's height.
  nudgeLevel(part) {
    const lane = this.lanes[this.trigger.channel];
    if (!lane.limits.known) return;
    this.setTrigger({ level: this.trigger.level + (part * (lane.limits.high - lane.limits.low)) / this.#factor(lane) });
  }

  #buildControls() {
    this.levelHandle = byId("level-handle");
    this.timeBase = byId("time-base");
    this.timeBase.addEventListener("change", () => this.setSpan(Number(this.timeBase.value)));
    byId("zoom-in").addEventListener("click", () => this.stepSpan(-1));
    byId("zoom-out").addEventListener("click", () => this.stepSpan(1));
    byId("reset").addEventListener("click", () => this.reset());
    byId("cursors").addEventListener("click", () => this.toggleCursors());
    fillSelect(byId("trigger-channel"), channels.map((channel, i) => [i, channel.name]), 0);
    byId("trigger-mode").addEventListener("change", (event) => this.setTrigger({ mode: event.target.value }));
    byId("trigger-channel").addEventListener("change", (event) => this.setTrigger({ channel: Number(event.target.value) }));
    byId("trigger-edge").addEventListener("click", () => this.setTrigger({ rising: !this.trigger.rising }));
    byId("trigger-arm").addEventListener("click", () => this.setTrigger({}));
    byId("trigger-level").addEventListener("change", (event) => {
      const value = Number(event.target.value);
      if (Number.isFinite(value)) this.setTrigger({ level: value / this.#factor(this.lanes[this.trigger.channel]) });
    });
    this.#showTimeBase();
    this.#showTrigger();
  }

  #showTimeBase() {
    const listed = timeBases_s.includes(this.span_s);
    const options = timeBases_s.map((span) => [span, duration(span)]);
    if (!listed) options.push([this.span_s, duration(this.span_s)]);
    fillSelect(this.timeBase, options, this.span_s);
  }

  #showTrigger() {
    const { trigger } = this;
    const lane = this.lanes[trigger.channel];
    byId("trigger-mode").value = trigger.mode;
    byId("trigger-channel").value = String(trigger.channel);
    const edge = byId("trigger-edge");
    setText(edge, trigger.rising ? "↗" : "↘");
    edge.setAttribute("aria-label", trigger.rising ? "Edge: rising" : "Edge: falling");
    const unit = this.app.units.label(lane.channel.quantity);
    byId("trigger-level").value = String(Number((trigger.level * this.#factor(lane)).toPrecision(4)));
    setText(byId("trigger-unit"), unit);
    byId("trigger-arm").disabled = trigger.mode === "roll";
    this.levelHandle.setAttribute("aria-valuenow", String(Number((trigger.level * this.#factor(lane)).toPrecision(4))));
    this.levelHandle.setAttribute("aria-valuetext", `${number(trigger.level * this.#factor(lane))} ${unit}`);
  }

  partOf(event) {
    const box = this.screen.getBoundingClientRect();
    return (event.clientX - box.left - this.gutter) / this.plotWidth;
  }

  #laneAt(event) {
    const y = event.clientY - this.screen.getBoundingClientRect().top;
    return this.lanes.find((lane) => lane.leader === lane && y >= lane.edge && y < lane.top + lane.height);
  }

  #listen() {
    const { screen } = this;
    // Without a key the wheel scrolls the page.
    screen.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      const turn = event.deltaY || event.deltaX;
      const factor = Math.exp(Math.max(-0.5, Math.min(0.5, turn * 0.0015)));
      const lane = this.#laneAt(event);
      if (event.shiftKey && lane) this.scaleLane(lane.index, factor);
      else this.setSpan(this.span_s * factor, this.partOf(event));
    }, { passive: false });
    screen.addEventListener("dblclick", () => this.reset());
    this.#drag(screen, (event, start) => {
      const part = this.partOf(event);
      if (event.type === "pointerdown") { this.dragPart = part; return; }
      if (Math.abs(part - this.dragPart) * this.plotWidth < 3 && !start.moved) return;
      start.moved = true;
      this.pan(this.dragPart - part);
      this.dragPart = part;
    });
    this.cursors.forEach((cursor, i) => {
      this.#drag(cursor.element, (event) => { if (event.type === "pointermove") this.moveCursor(i, this.partOf(event)); });
      cursor.element.addEventListener("keydown", (event) => {
        const step = event.shiftKey ? 20 : 1;
        const moves = { ArrowLeft: -step, ArrowRight: step };
        if (event.key in moves) this.nudgeCursor(i, moves[event.key]);
        else if (event.key === "Home") this.moveCursor(i, 0);
        else if (event.key === "End") this.moveCursor(i, 1);
        else return;
        event.preventDefault();
        event.stopPropagation();
      });
    });
    this.#drag(this.levelHandle, (event) => {
      if (event.type !== "pointermove") return;
      const lane = this.lanes[this.trigger.channel];
      const y = event.clientY - this.screen.getBoundingClientRect().top;
      const part = Math.min(1, Math.max(0, 1 - (y - lane.top) / lane.height));
      this.setTrigger({ level: (lane.limits.low + part * (lane.limits.high - lane.limits.low)) / this.#factor(lane) });
    });
    this.levelHandle.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 0.1 : 0.01;
      if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
      this.nudgeLevel(event.key === "ArrowUp" ? step : -step);
      event.preventDefault();
      event.stopPropagation();
    });
  }

  #drag(element, use) {
    let start = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.target.closest(".cursor, .level") !== element.closest(".cursor, .level")) return;
      start = { moved: false };
      element.setPointerCapture(event.pointerId);
      use(event, start);
    });
    element.addEventListener("pointermove", (event) => { if (start) use(event, start); });
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => { start = null; });
  }
}
