// SPDX-License-Identifier: Apache-2.0
// The trigger of the oscilloscope: finds where a channel crosses a level, in device time.

export const modes = ["roll", "auto", "normal", "single"];
const pendingMost = 256;

export class Trigger {
  constructor() {
    this.mode = "roll";
    this.channel = 0;
    this.level = 0; // in SI units
    this.rising = true;
    this.before = 0.2; // fraction of the screen before the crossing
    this.hysteresis = 0; // in SI units: how far the channel must have been on the other side
    this.pending = new Float64Array(pendingMost);
    this.arm();
  }

  // Restarts with future frames.
  arm(row = 0) {
    this.row = row;
    this.ready = false;
    this.pendingBegin = 0;
    this.pendingEnd = 0;
    this.fired_ns = NaN;
    this.done = false; // a single shot that was fired
  }

  set(change, row) {
    Object.assign(this, change);
    this.arm(row);
  }

  // Searches new frames. The window of `span_ns` around a crossing is shown once it is complete.
  scan(frames, span_ns) {
    if (this.mode === "roll" || this.done) { this.row = frames.end; return; }
    this.#findCrossings(frames);
    const full_ns = frames.last_ns - span_ns * (1 - this.before);
    while (this.pendingBegin < this.pendingEnd) {
      const time_ns = this.pending[this.pendingBegin % pendingMost];
      if (time_ns > full_ns) break;
      this.pendingBegin += 1;
      this.fired_ns = time_ns;
      if (this.mode === "single") { this.done = true; break; }
    }
  }

  #findCrossings(frames) {
    const { time, mask } = frames;
    const data = frames.values[this.channel];
    const sign = this.rising ? 1 : -1;
    let row = Math.max(this.row, frames.begin + 1);
    for (; row < frames.end; ++row) {
      const last = sign * (data[(row - 1) & mask] - this.level);
      const now = sign * (data[row & mask] - this.level);
      if (last < -this.hysteresis || (this.hysteresis === 0 && last < 0)) this.ready = true;
      if (!(this.ready && last < 0 && now >= 0)) continue;
      this.ready = false;
      const from = time[(row - 1) & mask];
      const crossing = from + ((time[row & mask] - from) * last) / (last - now);
      if (this.pendingEnd - this.pendingBegin === pendingMost) this.pendingBegin += 1;
      this.pending[this.pendingEnd % pendingMost] = crossing;
      this.pendingEnd += 1;
    }
    this.row = frames.end;
  }

  // True if the display is held at a crossing; else it rolls or waits.
  holds(frames, span_ns) {
    if (this.mode === "roll" || Number.isNaN(this.fired_ns)) return false;
    return this.mode !== "auto" || frames.last_ns - this.fired_ns < Math.max(2.5 * span_ns, 1e9);
  }

  get word() {
    if (this.mode === "roll") return "";
    if (this.done) return "fired, stopped";
    return Number.isNaN(this.fired_ns) ? "waiting" : "triggered";
  }
}
