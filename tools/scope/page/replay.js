// SPDX-License-Identifier: Apache-2.0
// A recording instead of the rig: its position, which plays, and the frames before it in the page's store.

import { fitCanvas } from "./axes.js";
import { byId, fillSelect, setText } from "./elements.js";
import { Pieces } from "./pieces.js";
import { clockTime } from "./recording.js";
import { measuredCount } from "./units.js";

const speeds = [0.1, 0.25, 0.5, 1, 2, 5, 10, 30];
const least_ns = 20e9; // before the position, for the plots beside the traces
const mostPieces = 60; // read for what is before it
const longestStep_ms = 250; // a page that was suspended does not catch up
const ahead = 2; // pieces

export class Replay {
  constructor(app) {
    this.app = app;
    this.summary = null;
    this.position_ns = 0; // like all times here, since the first frame
    this.speed = 1;
    this.turn = 0; // of the latest seek
    this.filling = false;
    this.filled_ns = 0; // span that was read before the position
    this.slider = byId("replay-position");
    this.canvas = byId("replay-overview");
    this.context = this.canvas.getContext("2d");
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value) * 1e9));
    this.canvas.addEventListener("pointerdown", (event) => this.seek((event.offsetX / this.canvas.clientWidth) * this.length_ns));
    byId("replay-play").addEventListener("click", () => app.pause(!app.paused));
    const speed = byId("replay-speed");
    fillSelect(speed, speeds.map((value) => [value, `${value}×`]), 1);
    speed.addEventListener("change", () => { this.speed = Number(speed.value); });
  }

  get active() { return this.summary !== null; }
  get length_ns() { return this.summary.length_ns; }

  // The server shows a recording.
  async open() {
    if (this.active || this.opening) return;
    this.opening = true;
    try {
      const summary = await (await Pieces.read("recording")).json();
      this.first_ns = BigInt(summary.first_ns);
      this.pieces = new Pieces(this.first_ns);
      this.summary = summary;
      byId("replay").hidden = false;
      byId("freeze-on-fault").parentElement.hidden = true;
      setText(byId("replay-file"), summary.file);
      this.slider.max = String(summary.length_ns / 1e9);
      this.slider.step = String(Math.max(0.001, 10 ** Math.floor(Math.log10(summary.length_ns / 1e12))));
      for (const event of summary.events) this.app.rig.events.take(event);
      this.app.layout();
      this.app.pause(true);
      await this.seek(Math.min(summary.length_ns, this.app.scope.span_s * 1e9));
    } catch (error) {
      this.#failed(error);
    } finally {
      this.opening = false;
    }
  }

  #failed(error) {
    this.filling = false;
    this.app.say(`The recording cannot be read: ${error.message}`);
  }

  // Number of the piece with a time.
  #pieceAt(time_ns) {
    const { pieces } = this.summary;
    let number = 0;
    while (number + 1 < pieces.length && pieces[number + 1] <= time_ns) number += 1;
    return number;
  }

  // Goes to a time. `left_ns`: the left edge of a paused screen, if it is not to end there.
  async seek(time_ns, left_ns = null) {
    const turn = ++this.turn;
    const to_ns = Math.min(this.length_ns, Math.max(0, time_ns));
    const span_ns = Math.max(least_ns, 1.2e9 * this.app.scope.span_s);
    const last = this.#pieceAt(to_ns);
    const first = Math.max(0, last - mostPieces, this.#pieceAt(to_ns - span_ns));
    this.filling = true;
    try {
      for (let number = first; number <= last; ++number) {
        await this.pieces.load(number);
        if (turn !== this.turn) return; // another seek began
      }
    } catch (error) {
      if (turn === this.turn) this.#failed(error);
      return;
    }
    this.filling = false;
    this.filled_ns = span_ns;
    this.app.beginAt(this.first_ns);
    this.#rewind(this.summary.pieces[first]);
    this.number = first;
    this.next = 0;
    this.#feed(to_ns);
    if (this.app.paused) this.app.showPaused(left_ns ?? to_ns - this.app.scope.span_ns);
    this.show();
    this.app.touch();
  }

  // The verdict on the model at a time.
  #rewind(time_ns) {
    for (const event of this.summary.events) if (Number(BigInt(event.time_ns) - this.first_ns) <= time_ns) this.app.rig.judge(event);
    const model = this.summary.models.findLast((one) => one.time_ns <= time_ns) ?? this.summary.models[0];
    if (model) this.app.takeMessage(model.message);
  }

  // Takes the messages up to a time, as far as they are here.
  #feed(to_ns) {
    for (;;) {
      const messages = this.pieces.get(this.number);
      if (messages === null) {
        this.#want(this.number);
        return;
      }
      while (this.next < messages.length && messages[this.next].time_ns <= to_ns) this.#take(messages[this.next++]);
      if (this.next < messages.length || this.number + 1 === this.summary.pieces.length) {
        this.position_ns = to_ns;
        this.pieces.keep(this.number, this.number + ahead);
        for (let number = this.number + 1; number <= this.number + ahead && number < this.summary.pieces.length; ++number) this.#want(number);
        return;
      }
      this.number += 1;
      this.next = 0;
    }
  }

  #want(number) { this.pieces.load(number).catch(() => {}); } // it is asked for again

  #take({ block, message }) {
    if (block) {
      if (block.received_unix_ms < 9e11) block.received_unix_ms = NaN; // no wall clock
      this.app.takeFrames(block);
    } else if (message.type !== "source" && message.type !== "restart") {
      this.app.takeMessage(message);
    }
  }

  // To be called for each picture.
  tick(now_ms) {
    if (!this.active) return;
    const passed_ms = Math.min(longestStep_ms, now_ms - this.ticked_ms || 0);
    this.ticked_ms = now_ms;
    if (this.filling) return;
    if (this.app.paused) this.#followView();
    else if (1.2e9 * this.app.scope.span_s > this.filled_ns) this.seek(this.position_ns);
    else this.#play(passed_ms * 1e6 * this.speed);
  }

  #play(step_ns) {
    this.#feed(Math.min(this.length_ns, this.position_ns + step_ns));
    if (this.position_ns >= this.length_ns) this.app.pause(true);
  }

  // A paused screen that was moved beyond what is held.
  #followView() {
    const { left_ns: left, span_ns: span } = this.app.scope;
    const { frames } = this.app.store;
    const view = `${left} ${span}`;
    if (frames.empty || view === this.followed) return;
    const before = left < frames.first_ns && frames.first_ns > 0;
    const after = left + span > frames.last_ns && frames.last_ns < this.length_ns;
    if (!before && !after) return;
    this.followed = view;
    this.seek(left + span, left);
  }

  // A few times a second.
  show() {
    if (!this.active) return;
    const { app } = this;
    const at_s = this.position_ns / 1e9;
    setText(byId("replay-play"), app.paused ? "Play" : "Pause");
    const text = `${clockTime(at_s)} of ${clockTime(this.length_ns / 1e9)}`;
    setText(byId("replay-time"), text);
    this.slider.setAttribute("aria-valuetext", text);
    if (document.activeElement !== this.slider || !this.filling) this.slider.value = String(at_s);
    this.#draw();
  }

  #lane() {
    const { lanes, trigger } = this.app.scope;
    const measured = lanes.slice(0, measuredCount);
    return measured.find((lane) => lane.visible && lane.index === trigger.channel) ?? measured.find((lane) => lane.visible);
  }

  // One channel over the whole recording, its events, and what is on screen.
  #draw() {
    const { canvas, context, app, summary: { overview, events } } = this;
    const { width, height } = canvas.getBoundingClientRect();
    fitCanvas(canvas, context, width, height, Math.min(3, window.devicePixelRatio || 1));
    context.clearRect(0, 0, width, height);
    const x = (time_ns) => (time_ns / this.length_ns) * width;
    context.fillStyle = app.theme.colours.band;
    const left = Math.max(0, x(app.scope.left_ns));
    context.fillRect(left, 0, Math.max(2, x(app.scope.left_ns + app.scope.span_ns) - left), height);
    const lane = this.#lane();
    this.columns = 0;
    if (lane) this.#drawChannel(overview.low[lane.index], overview.high[lane.index], x, height, app.theme.channel[lane.index]);
    this.marks = 0;
    for (const event of events) {
      const at = x(Number(BigInt(event.time_ns) - this.first_ns));
      if (!(event.time_ns > 0 && at >= 0)) continue;
      context.fillStyle = event.code === "note" ? app.theme.colours.mark : [app.theme.colours.quiet, app.theme.colours.warn, app.theme.colours.bad][event.severity] ?? app.theme.colours.quiet;
      context.fillRect(at - 0.5, event.severity >= 2 || event.code === "note" ? 0 : height * 0.75, 1.5, height);
      this.marks += 1;
    }
  }

  #drawChannel(low, high, x, height, colour) {
    const known = (list) => list.filter((value) => value !== null);
    const least = Math.min(...known(low));
    const range = Math.max(...known(high)) - least || 1;
    const y = (value) => 2 + (height - 4) * (1 - (value - least) / range);
    this.context.fillStyle = colour;
    low.forEach((value, i) => {
      if (value === null) return;
      const from = x(i * this.summary.overview.step_ns);
      this.context.fillRect(from, y(high[i]), Math.max(1, x((i + 1) * this.summary.overview.step_ns) - from), Math.max(1, y(value) - y(high[i])));
      this.columns += 1;
    });
  }
}
