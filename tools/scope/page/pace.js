// SPDX-License-Identifier: Apache-2.0
// Pace of the page: screen frames, work per frame, and latency from LCM to pixel.

import { number } from "./units.js";

const kept = 512;

class Recent {
  constructor() {
    this.values = new Float64Array(kept);
    this.sorted = new Float64Array(kept);
    this.count = 0;
  }

  add(value) {
    this.values[this.count % kept] = value;
    this.count += 1;
  }

  // Quantile `part` of the recent values; NaN if there are none.
  quantile(part) {
    const held = Math.min(this.count, kept);
    if (held === 0) return NaN;
    this.sorted.fill(Infinity);
    for (let i = 0; i < held; ++i) this.sorted[i] = this.values[i];
    this.sorted.sort();
    return this.sorted[Math.min(held - 1, Math.floor(part * held))];
  }
}

// Rate limit of secondary plots: one is redrawn only after four times its own drawing time, so that a
// slow machine redraws them less often than the oscilloscope.
export class Turn {
  constructor() {
    this.next_ms = 0;
  }

  take(now_ms, work) {
    if (now_ms < this.next_ms) return;
    const began_ms = performance.now();
    work();
    this.next_ms = now_ms + 4 * (performance.now() - began_ms);
  }
}

export class Pace {
  constructor() {
    this.interval = new Recent(); // ms between frames of the screen
    this.work = new Recent(); // ms of our own in one of them
    this.lag = new Recent(); // ms from LCM to the end of drawing
    this.oldest_unix_ms = NaN; // of the frames received and not yet drawn
    this.last_ms = NaN;
  }

  arrived(received_unix_ms) {
    if (Number.isNaN(this.oldest_unix_ms)) this.oldest_unix_ms = received_unix_ms;
  }

  begin(now_ms) {
    if (now_ms - this.last_ms < 1000) this.interval.add(now_ms - this.last_ms);
    this.last_ms = now_ms;
    this.began_ms = performance.now();
  }

  // Everything received is on the canvas: the oldest has the largest latency.
  drew() {
    if (Number.isNaN(this.oldest_unix_ms)) return;
    this.lag.add(performance.timeOrigin + performance.now() - this.oldest_unix_ms);
    this.oldest_unix_ms = NaN;
  }

  end() { this.work.add(performance.now() - this.began_ms); }

  get framesPerSecond() { return 1000 / this.interval.quantile(0.5); }

  words(frames, dropped) {
    if (frames.empty) return "";
    const lag = this.lag.quantile(0.5);
    if (this.lag.count === 0) return `${number(frames.rate_hz, 4)} Hz · ${Math.round(this.framesPerSecond)} pictures/s`;
    // Larger values are probably a difference between the clocks of server and browser.
    const lagText = !(lag > -5) ? "lag –" : lag < 10000 ? `lag ${number(Math.max(0, lag), 2)} ms` : "lag > 10 s";
    const lost = frames.lost + dropped > 0 ? ` · lost ${frames.lost} frames, ${dropped} messages` : "";
    return `${number(frames.rate_hz, 4)} Hz · ${lagText} · ${Math.round(this.framesPerSecond)} pictures/s${lost}`;
  }
}
