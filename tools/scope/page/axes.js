// SPDX-License-Identifier: Apache-2.0
// Axes: round steps, limits that do not jitter, and their drawing on a 2-D canvas.

// The step of 1, 2 or 5 times a power of ten that cuts `range` into at most `most` pieces.
export function roundStep(range, most) {
  const rough = range / Math.max(1, most);
  if (!(rough > 0) || !Number.isFinite(rough)) return 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const part = rough / power;
  return power * (part <= 1 ? 1 : part <= 2 ? 2 : part <= 5 ? 5 : 10);
}

// A round step that cuts the range into at most `most` pieces, or into more if fewer than two values, which
// make a scale, would be in it.
export function scaleStep(low, high, most) {
  let step = roundStep(high - low, most);
  for (let pieces = most + 1; Math.floor(high / step) - Math.ceil(low / step) < 1 && pieces <= 4 * most; ++pieces) step = roundStep(high - low, pieces);
  return step;
}

// Axis limits that follow the data: they grow immediately and shrink slowly.
export class Limits {
  constructor(least = 0) {
    this.least = least; // no narrower than this
    this.low = NaN;
    this.high = NaN;
    this.shrunk = 0;
    this.manual = false; // set by the user, until the view is reset
  }

  reset() {
    this.manual = false;
    this.low = NaN;
    this.high = NaN;
  }

  follow(low, high, now_ms) {
    if (!(low <= high)) return;
    const middle = (low + high) / 2;
    const range = Math.max(high - low, this.least, Math.abs(middle) * 1e-9, 1e-12);
    const outgrown = !(low >= this.low && high <= this.high);
    const roomy = range < 0.55 * (this.high - this.low);
    if (!roomy) this.shrunk = now_ms;
    if (!outgrown && !(roomy && now_ms - this.shrunk > 1500)) return;
    const step = roundStep(range, 10);
    this.low = Math.floor((middle - range * 0.54) / step) * step;
    this.high = Math.ceil((middle + range * 0.54) / step) * step;
    this.shrunk = now_ms;
  }

  set(low, high) {
    this.low = low;
    this.high = high;
  }

  get known() { return this.low < this.high; }
}

// Fits a canvas to its box in device pixels, with its context in CSS pixels. Setting the size clears the
// canvas, so it is done on change only. Returns true if it changed.
export function fitCanvas(canvas, context, width, height, ratio) {
  const across = Math.max(1, Math.round(width * ratio));
  const down = Math.max(1, Math.round(height * ratio));
  const changed = canvas.width !== across || canvas.height !== down;
  if (changed) {
    canvas.width = across;
    canvas.height = down;
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return changed;
}

// Calls use(value) for each round value within [low, high].
export function eachTick(low, high, step, use) {
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  for (let i = first; i <= last && i - first < 200; ++i) use(i * step);
}
