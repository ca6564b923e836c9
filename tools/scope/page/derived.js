// SPDX-License-Identifier: Apache-2.0
// Channels that the page derives from those of the stream, frame by frame: the coefficient of friction, the
// power of friction, and the expression of the user's.

import { symbols } from "./expression.js";
import { measuredCount } from "./units.js";

const [velocity, friction, load] = [1, 2, 3];
const [coefficient, power, expression] = [measuredCount, measuredCount + 1, measuredCount + 2];
const leastPart = 0.05; // of the largest load, below which a ratio to it means nothing

export class Derived {
  constructor() {
    this.expression = null; // see expression.js
    this.inputs = new Float64Array(symbols.length);
    this.clear();
  }

  clear() {
    this.end = 0; // one past the newest row that is derived
    this.largest_n = 0; // load, as it was used for what is derived
  }

  copy(other) {
    this.expression = other.expression;
    this.end = other.end;
    this.largest_n = other.largest_n;
  }

  // The first row to derive: of those that are new, or of all if a load has come that is larger than any before
  // (by more than 2 %, so that a load that rises slowly costs little).
  from(frames) {
    let largest = this.largest_n;
    const { mask, values } = frames;
    let from = Math.max(this.end, frames.begin);
    for (let row = from; row < frames.end; ++row) {
      const size = Math.abs(values[load][row & mask]);
      if (size > largest) largest = size;
    }
    if (largest > 1.02 * this.largest_n) {
      this.largest_n = largest;
      from = frames.begin;
    }
    return from;
  }

  fill(frames, from) {
    const { mask, values, time } = frames;
    const least_n = leastPart * this.largest_n;
    for (let row = from; row < frames.end; ++row) {
      const at = row & mask;
      const load_n = values[load][at];
      values[coefficient][at] = load_n >= least_n && load_n > 0 ? values[friction][at] / load_n : NaN;
      values[power][at] = values[friction][at] * values[velocity][at];
      values[expression][at] = this.expression === null ? NaN : this.#evaluate(values, at, time[at]);
    }
    this.end = frames.end;
  }

  #evaluate(values, at, time_ns) {
    const { inputs } = this;
    for (let i = 0; i < expression; ++i) inputs[i] = values[i][at];
    inputs[expression] = time_ns / 1e9;
    const value = this.expression(inputs);
    return Number.isFinite(value) ? value : NaN;
  }
}
