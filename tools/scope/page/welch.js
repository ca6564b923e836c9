// SPDX-License-Identifier: Apache-2.0
// Spectra of one signal, or of two and between them, averaged by Welch's method: segments that overlap by
// half, each without its mean and weighted by the window.

import { Fft, windowWeight } from "./fft.js";

// Kinds of averages: segments at most, and the least share of the newest one.
export const averages = {
  off: { segments: 1, share: 0 },
  4: { segments: 4, share: 0 },
  16: { segments: 16, share: 0 },
  exponential: { segments: 24, share: 1 / 8 }, // what is older counts less than 1/20 in all
};

export class Welch {
  constructor(length, window) {
    this.length = length;
    this.window = window;
    this.fft = new Fft(length);
    this.weights = Float64Array.from({ length }, (_, i) => windowWeight(window, i, length));
    this.coherentGain = this.weights.reduce((sum, weight) => sum + weight, 0);
    this.noiseGain = this.weights.reduce((sum, weight) => sum + weight * weight, 0);
    // Mean power of either signal, and conj(X) Y, by the line.
    for (const name of ["xx", "yy", "re", "im"]) this[name] = new Float64Array(length / 2);
    this.segments = 0;
  }

  // Samples that a number of segments needs.
  span(segments) { return this.length + ((segments - 1) * this.length) / 2; }

  // Segments within so many samples.
  fitting(samples, most) { return Math.min(most, Math.floor((samples - this.length) / (this.length / 2)) + 1); }

  // Averages all segments of x, and of y if it is not null. `share`: see `averages`.
  run(x, y, segments, share) {
    for (this.segments = 0; this.segments < segments; ++this.segments) {
      const from = (this.segments * this.length) / 2;
      this.#load(x, from, this.fft.real);
      if (y === null) this.fft.imaginary.fill(0);
      else this.#load(y, from, this.fft.imaginary);
      this.fft.run();
      this.#add(Math.max(share, 1 / (this.segments + 1)), y !== null);
    }
  }

  #load(samples, from, into) {
    const { length, weights } = this;
    let mean = 0;
    for (let i = 0; i < length; ++i) mean += samples[from + i];
    mean /= length;
    for (let i = 0; i < length; ++i) into[i] = (samples[from + i] - mean) * weights[i];
  }

  // The transform of x + iy holds both: X and Y are its parts that are even and odd under conjugation.
  #add(share, two) {
    const { length, xx, yy, re, im, fft: { real, imaginary } } = this;
    for (let k = 1; k < length / 2; ++k) {
      const xRe = (real[k] + real[length - k]) / 2;
      const xIm = (imaginary[k] - imaginary[length - k]) / 2;
      xx[k] += (xRe * xRe + xIm * xIm - xx[k]) * share;
      if (!two) continue;
      const yRe = (imaginary[k] + imaginary[length - k]) / 2;
      const yIm = (real[length - k] - real[k]) / 2;
      yy[k] += (yRe * yRe + yIm * yIm - yy[k]) * share;
      re[k] += (xRe * yRe + xIm * yIm - re[k]) * share;
      im[k] += (xRe * yIm - xIm * yRe - im[k]) * share;
    }
  }
}

// The newest samples of a channel before a row, at the rate of the sequence number: frames that were lost are
// replaced by the one before, and counted. Returns their number.
export function gather(frames, channel, end, into) {
  const data = frames.values[channel];
  const { mask, columns: { sequence } } = frames;
  let row = end - 1;
  const newest = sequence[row & mask];
  let lost = 0;
  let last = data[row & mask];
  for (let i = into.length - 1; i >= 0; --i) {
    const wanted = newest - (into.length - 1 - i);
    while (row > frames.begin && sequence[row & mask] > wanted) row -= 1;
    const value = data[row & mask];
    if (sequence[row & mask] !== wanted || value !== value) lost += 1;
    if (value === value) last = value;
    into[i] = last;
  }
  return lost;
}
