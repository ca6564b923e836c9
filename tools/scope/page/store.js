// SPDX-License-Identifier: Apache-2.0
// The received data in rings of typed arrays: no object per sample, and no growth once a ring spans the
// required time.

import { Derived } from "./derived.js";
import { channels, measuredCount } from "./units.js";

const lowWord = 2 ** 32;

// Rows of numbers by time. Row numbers start at 0 and never wrap: `begin` is the oldest row that is
// held, `end` is one past the newest. Time is in ns since `origin_ns` (a BigInt, device time), so that a
// double holds it exactly for 104 days.
export class Ring {
  // columns: names besides `time`. span_s: a full ring that spans less grows, up to `limit` rows.
  constructor(columns, { rows = 8192, span_s = 66, limit = 2 ** 20 } = {}) {
    this.names = columns;
    this.span_ns = span_s * 1e9;
    this.limit = limit;
    this.origin_ns = null;
    this.#allocate(rows);
    this.clear();
  }

  #allocate(rows) {
    this.rows = rows;
    this.mask = rows - 1;
    this.time = new Float64Array(rows);
    this.columns = {};
    for (const name of this.names) this.columns[name] = new Float64Array(rows);
    this.allocated?.();
  }

  clear() {
    this.begin = 0;
    this.end = 0;
  }

  get empty() { return this.end === this.begin; }
  get bytes() { return this.rows * 8 * (1 + this.names.length); }
  // Time of the oldest and of the newest row; NaN if there is none.
  get first_ns() { return this.empty ? NaN : this.time[this.begin & this.mask]; }
  get last_ns() { return this.empty ? NaN : this.time[(this.end - 1) & this.mask]; }

  // Array index of a new row.
  push(time_ns) {
    if (this.end - this.begin === this.rows) {
      if (this.rows < this.limit && time_ns - this.first_ns < this.span_ns) this.#grow();
      else this.begin += 1;
    }
    const at = this.end & this.mask;
    this.time[at] = time_ns;
    this.end += 1;
    return at;
  }

  #grow() {
    const old = { time: this.time, columns: this.columns, mask: this.mask };
    this.#allocate(this.rows * 2);
    for (let row = this.begin; row < this.end; ++row) {
      this.time[row & this.mask] = old.time[row & old.mask];
      for (const name of this.names) this.columns[name][row & this.mask] = old.columns[name][row & old.mask];
    }
    this.regrown?.();
  }

  // Number of the first row at or after a time; `end` if there is none. `from`: start of the search.
  rowAt(time_ns, from = this.begin) {
    let low = Math.max(from, this.begin);
    let high = this.end;
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.time[middle & this.mask] < time_ns) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  // Copies another ring with the same columns, for a pause.
  copy(other) {
    if (this.rows !== other.rows) this.#allocate(other.rows);
    this.time.set(other.time);
    for (const name of this.names) this.columns[name].set(other.columns[name]);
    this.begin = other.begin;
    this.end = other.end;
    this.origin_ns = other.origin_ns;
    this.copied?.(other);
  }

  // Device time [ns] of a row as a BigInt.
  deviceTime(row) { return this.origin_ns + BigInt(this.time[row & this.mask]); }
}

const fineShift = 4;
const coarseShift = 9;
const channelCount = channels.length;
const each = [...channels.keys()];

// Frames with the extremes of every 16 and every 512 rows, so that drawing a minute costs as much as
// drawing a second.
export class FrameStore extends Ring {
  constructor(options) {
    super(["sequence", "stepped", ...each.map((channel) => `c${channel}`)], { rows: 2 ** 17, ...options });
    this.lost = 0;
    this.steps = 0; // of the time
    this.pair = new Float64Array(2);
    this.touched = 0; // values looked at by extremes(): what drawing costs
  }

  get bytes() { return super.bytes + (this.fineLow[0].length + this.coarseLow[0].length) * channelCount * 16; }

  allocated() {
    this.values = each.map((channel) => this.columns[`c${channel}`]);
    const make = (shift) => each.map(() => new Float64Array(this.rows >> shift));
    this.fineLow = make(fineShift);
    this.fineHigh = make(fineShift);
    this.coarseLow = make(coarseShift);
    this.coarseHigh = make(coarseShift);
  }

  regrown() {
    this.#summariseAll(this.begin, 0, channelCount);
  }

  copied(other) {
    for (const channel of each) {
      for (const name of ["fineLow", "fineHigh", "coarseLow", "coarseHigh"]) this[name][channel].set(other[name][channel]);
    }
    this.lost = other.lost;
    this.steps = other.steps;
    this.utc_ms = other.utc_ms;
    this.derived.copy(other.derived);
  }

  clear() {
    super.clear();
    this.derived ??= new Derived(); // before the constructor has ended
    this.derived.clear();
    this.lost = 0;
    this.steps = 0;
    this.period_ns = NaN;
    this.utc_ms = NaN; // of the origin of time, by the quickest receipt
  }

  // Steps of the time [ns] up to a new row, summed: more than ten periods that the sequence number does not
  // explain, as in recordings (protocol/time_steps.h). The period is a running mean, in which a step counts
  // ten periods at most.
  #stepped(interval_ns, numbers) {
    const before = this.columns.stepped[(this.end - 1) & this.mask];
    const each = interval_ns / numbers;
    if (!(this.period_ns > 0)) this.period_ns = each;
    const regular = this.period_ns * numbers;
    const excess = interval_ns - regular;
    const steps = Math.abs(excess) > Math.max(10 * this.period_ns, 0.01 * regular);
    this.period_ns += (Math.min(each, 10 * this.period_ns) - this.period_ns) / 32;
    if (!steps) return before;
    this.steps += 1;
    return before + excess;
  }

  // True if frames were lost, or the time steps, between two rows: no line joins them.
  broken(earlier, later) {
    const { mask, columns: { sequence, stepped } } = this;
    return sequence[later & mask] - sequence[earlier & mask] > later - earlier || stepped[later & mask] !== stepped[earlier & mask];
  }

  #summariseAll(from, firstChannel, pastChannel) {
    for (let row = from; row < this.end; ++row) this.#summarise(row, row === this.begin, firstChannel, pastChannel);
  }

  // Derives channels anew from a row on.
  #derive(from) {
    this.derived.fill(this, from);
    this.#summariseAll(from, measuredCount, channelCount);
  }

  // Of the user's; see expression.js.
  setExpression(expression) {
    this.derived.expression = expression;
    this.#derive(this.begin);
  }

  #summarise(row, first, firstChannel, pastChannel) {
    const at = row & this.mask;
    const fine = at >> fineShift;
    const coarse = at >> coarseShift;
    const fineFirst = first || (at & ((1 << fineShift) - 1)) === 0;
    const coarseFirst = first || (at & ((1 << coarseShift) - 1)) === 0;
    for (let channel = firstChannel; channel < pastChannel; ++channel) {
      const value = this.values[channel][at];
      if (fineFirst) { this.fineLow[channel][fine] = Infinity; this.fineHigh[channel][fine] = -Infinity; }
      if (coarseFirst) { this.coarseLow[channel][coarse] = Infinity; this.coarseHigh[channel][coarse] = -Infinity; }
      if (value < this.fineLow[channel][fine]) this.fineLow[channel][fine] = value;
      if (value > this.fineHigh[channel][fine]) this.fineHigh[channel][fine] = value;
      if (value < this.coarseLow[channel][coarse]) this.coarseLow[channel][coarse] = value;
      if (value > this.coarseHigh[channel][coarse]) this.coarseHigh[channel][coarse] = value;
    }
  }

  // Appends a decoded block (see `decodeFrames`) without frames that are held already. Returns true if the
  // source restarted, in which case earlier rows are discarded.
  append(block) {
    const { count, words, numbers } = block;
    let restarted = false;
    if (this.origin_ns === null) this.origin_ns = timeOf(words, 0);
    const originLow = Number(this.origin_ns & 0xffffffffn);
    const originHigh = Number(this.origin_ns >> 32n);
    for (let i = 0; i < count; ++i) {
      const time_ns = (words.getInt32(i * 8 + 4, true) - originHigh) * lowWord + (words.getUint32(i * 8, true) - originLow);
      const at8 = (count + i) * 8;
      const sequence = words.getInt32(at8 + 4, true) * lowWord + words.getUint32(at8, true);
      let stepped = 0;
      if (!this.empty) {
        const before = this.columns.sequence[(this.end - 1) & this.mask];
        const last_ns = this.last_ns;
        const live = (block.flags & 2) === 0;
        if (time_ns > last_ns ? sequence <= before : live && time_ns < last_ns - 1e9) {
          this.clear();
          restarted = true;
        } else if (time_ns <= last_ns) {
          continue;
        } else {
          this.lost += sequence - before - 1;
          stepped = this.#stepped(time_ns - last_ns, sequence - before);
        }
      }
      const at = this.push(time_ns);
      this.columns.sequence[at] = sequence;
      this.columns.stepped[at] = stepped;
      for (let channel = 0; channel < measuredCount; ++channel) this.values[channel][at] = numbers[channel * count + i];
      this.#summarise(this.end - 1, this.end - 1 === this.begin, 0, measuredCount);
    }
    this.#derive(this.derived.from(this));
    if ((block.flags & 2) === 0 && !this.empty) {
      const utc_ms = block.received_unix_ms - this.last_ns / 1e6;
      if (!(this.utc_ms < utc_ms)) this.utc_ms = utc_ms;
    }
    return restarted;
  }

  // Extremes of a channel in the rows [from, to) in into[0] and into[1]; Infinity and -Infinity without
  // values.
  extremes(channel, from, to, into) {
    const { mask, values } = this;
    const data = values[channel];
    let low = Infinity;
    let high = -Infinity;
    let row = from;
    while (row < to) {
      const left = to - row;
      let newLow;
      let newHigh;
      // Blocks with overwritten rows lie before begin and are never read.
      if (left >= 512 && (row & 511) === 0) {
        newLow = this.coarseLow[channel][(row & mask) >> coarseShift];
        newHigh = this.coarseHigh[channel][(row & mask) >> coarseShift];
        row += 512;
      } else if (left >= 16 && (row & 15) === 0) {
        newLow = this.fineLow[channel][(row & mask) >> fineShift];
        newHigh = this.fineHigh[channel][(row & mask) >> fineShift];
        row += 16;
      } else {
        newLow = data[row & mask];
        newHigh = newLow;
        row += 1;
      }
      if (newLow < low) low = newLow;
      if (newHigh > high) high = newHigh;
      this.touched += 1;
    }
    into[0] = low;
    into[1] = high;
  }

  // The load [N] below which a ratio to it means nothing: a twentieth of the largest in the rows; NaN without
  // loads.
  leastLoad(from, to) {
    this.extremes(3, from, to, this.pair);
    return Math.max(Math.abs(this.pair[0]), Math.abs(this.pair[1])) < Infinity ? 0.05 * Math.max(Math.abs(this.pair[0]), Math.abs(this.pair[1])) : NaN;
  }

  // Frames per second over the last second or so, without steps of the time; NaN if unknown.
  get rate_hz() {
    const from = Math.max(this.begin, this.end - 1001) & this.mask;
    const to = (this.end - 1) & this.mask;
    const { sequence, stepped } = this.columns;
    const span = this.last_ns - this.time[from] - (stepped[to] - stepped[from]);
    const steps = sequence[to] - sequence[from];
    return steps > 0 && span > 0 ? (steps * 1e9) / span : NaN;
  }

  // Value of a channel at a time, on the straight line between its neighbours; NaN outside, and where the
  // time steps.
  valueAt(channel, time_ns) {
    const row = this.rowAt(time_ns);
    if (row >= this.end) return NaN;
    const data = this.values[channel];
    const right = this.time[row & this.mask];
    if (right === time_ns) return data[row & this.mask];
    if (row === this.begin || this.columns.stepped[row & this.mask] !== this.columns.stepped[(row - 1) & this.mask]) return NaN;
    const left = this.time[(row - 1) & this.mask];
    const part = (time_ns - left) / (right - left);
    return data[(row - 1) & this.mask] * (1 - part) + data[row & this.mask] * part;
  }
}

function timeOf(words, at) {
  return words.getBigInt64(at, true);
}

export const estimateColumns = [
  "valid", "theta", "mu", "gamma_per_s", "friction_force_n", "slip_velocity_m_s", "sticking", "raw_friction_force_n",
  "raw_coefficient", "theta_deviation", "mu_deviation", "gamma_per_s_deviation", "friction_force_n_deviation",
  "slip_velocity_m_s_deviation", "nis", "nis_freedom",
];

// All time series: frames, estimates, excitation.
export class Store {
  constructor() {
    this.frames = new FrameStore();
    this.estimates = new Ring(estimateColumns);
    this.excitation = new Ring(["drive", "phase_rad", "amplitude"], { rows: 2 ** 17 });
    this.carrier_hz = NaN;
  }

  clear() {
    this.frames.clear();
    this.estimates.clear();
    this.excitation.clear();
  }

  copy(other) {
    this.frames.copy(other.frames);
    this.estimates.copy(other.estimates);
    this.excitation.copy(other.excitation);
    this.carrier_hz = other.carrier_hz;
  }

  get bytes() { return this.frames.bytes + this.estimates.bytes + this.excitation.bytes; }

  // Adds a block of frames; returns true if the source restarted.
  addFrames(block) {
    const restarted = this.frames.append(block);
    if (restarted) {
      this.estimates.clear();
      this.excitation.clear();
    }
    return restarted;
  }

  // Device time [ns], as JSON has it, on the axis of the frames; NaN before the first frame.
  #relative(time_ns) {
    return this.frames.origin_ns === null ? NaN : time_ns - Number(this.frames.origin_ns);
  }

  addEstimate(message) {
    const time_ns = this.#relative(message.time_ns);
    const ring = this.estimates;
    if (!(time_ns > ring.last_ns || (ring.empty && time_ns === time_ns))) return;
    const at = ring.push(time_ns);
    const columns = ring.columns;
    columns.valid[at] = message.valid ? 1 : 0;
    for (const name of estimateColumns) {
      if (name === "valid") continue;
      const deviation = name.endsWith("_deviation");
      const value = deviation ? message.deviation?.[name.slice(0, -"_deviation".length)] : message[name];
      columns[name][at] = message.valid && typeof value === "number" ? value : NaN;
    }
  }

  addExcitation(message) {
    const ring = this.excitation;
    for (let i = 0; i < message.time_ns.length; ++i) {
      const time_ns = this.#relative(message.time_ns[i]);
      if (!(time_ns > ring.last_ns || (ring.empty && time_ns === time_ns))) continue;
      const at = ring.push(time_ns);
      ring.columns.drive[at] = message.drive[i] ?? NaN;
      ring.columns.phase_rad[at] = message.phase_rad[i] ?? NaN;
      ring.columns.amplitude[at] = message.amplitude[i] ?? NaN;
    }
    this.carrier_hz = message.carrier_hz ?? NaN;
  }
}
