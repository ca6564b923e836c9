// SPDX-License-Identifier: Apache-2.0
// Numbers of a channel over the frames on screen.

export class Measurement {
  constructor() {
    this.last = this.low = this.high = this.mean = this.rms = this.frequency_hz = NaN;
  }

  get peakToPeak() { return this.high - this.low; }

  // Of the rows [from, to); `last` is of the newest row.
  take(frames, channel, from, to) {
    const data = frames.values[channel];
    const { mask } = frames;
    let count = 0;
    let sum = 0;
    let low = Infinity;
    let high = -Infinity;
    for (let row = from; row < to; ++row) {
      const value = data[row & mask];
      if (value !== value) continue;
      count += 1;
      sum += value;
      if (value < low) low = value;
      if (value > high) high = value;
    }
    this.last = frames.empty ? NaN : data[(frames.end - 1) & mask];
    this.low = low;
    this.high = high;
    this.mean = sum / count;
    this.rms = this.#spread(data, mask, from, to, count);
    this.frequency_hz = this.#frequency(frames, data, from, to);
  }

  #spread(data, mask, from, to, count) {
    let square = 0;
    for (let row = from; row < to; ++row) {
      const value = data[row & mask];
      if (value === value) square += (value - this.mean) * (value - this.mean);
    }
    return Math.sqrt(square / count);
  }

  // From the rising crossings of the mean, with a hysteresis of a tenth of the range at either side; NaN if
  // the periods between them differ by more than a quarter (rms) or are fewer than two.
  #frequency(frames, data, from, to) {
    const { mask, time } = frames;
    const { mean } = this;
    const reach = 0.1 * this.peakToPeak;
    let armed = false; // the signal was well below
    let crossed = NaN; // upwards, at this time
    let passed = NaN; // as before, and the signal was well above since
    let [count, sum, squares] = [0, 0, 0];
    for (let row = from + 1; row < to; ++row) {
      const before = data[(row - 1) & mask] - mean;
      const now = data[row & mask] - mean;
      if (now !== now || before !== before || frames.broken(row - 1, row)) {
        armed = false;
        crossed = passed = NaN;
        continue;
      }
      if (now < -reach) armed = true;
      if (!armed) continue;
      if (before < 0 && now >= 0) crossed = time[(row - 1) & mask] - ((time[row & mask] - time[(row - 1) & mask]) * before) / (now - before);
      if (!(now > reach)) continue;
      armed = false;
      const period = (crossed - passed) / 1e9;
      passed = crossed;
      if (period !== period) continue;
      count += 1;
      sum += period;
      squares += period * period;
    }
    const each = sum / count;
    return count >= 2 && squares / count - each * each < (each / 4) ** 2 ? 1 / each : NaN;
  }
}
