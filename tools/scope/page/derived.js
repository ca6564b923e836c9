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
    this.pair = new Float64Array(2);
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

  // The first row to derive: of those that are new, or of all if the largest load that is held has grown (by more
  // than 2 %, so that a load that rises slowly costs little) or has gone with the frames that were dropped.
  from(frames) {
    frames.extremes(load, frames.begin, frames.end, this.pair);
    const largest = Math.max(Math.abs(this.pair[0]), Math.abs(this.pair[1]));
    if (!(largest < Infinity) || (largest <= 1.02 * this.largest_n && largest >= 0.5 * this.largest_n)) return Math.max(this.end, frames.begin);
    this.largest_n = largest;
    return frames.begin;
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
