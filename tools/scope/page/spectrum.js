// SPDX-License-Identifier: Apache-2.0
// The spectrum of one channel, with known frequencies marked.

import { byId, fillSelect, setText, watchVisible } from "./elements.js";
import { Fft, windowWeight } from "./fft.js";
import { channels, duration, number, tick } from "./units.js";
import uPlot from "./uPlot.esm.js";

const lengths = [1024, 2048, 4096, 8192, 16384, 32768, 65536];
const maxHarmonics = 7;
const labelRows = 5; // above the plot: harmonics, drive, marks of the model

export class Spectrum {
  constructor(app) {
    this.app = app;
    this.marks = []; // of the model, once it is known
    this.plot = null;
    this.zoom = null; // limits of the frequency that were chosen
    this.chosen = { channel: 0, length: 8192, window: "hann", quantity: "amplitude", axis: "log", ...app.settings.get("spectrum") };
    this.element = byId("spectrum-plot");
    this.visible = watchVisible([this.element]);
    fillSelect(byId("spectrum-channel"), channels.map((channel, i) => [i, channel.name]), this.chosen.channel);
    fillSelect(byId("spectrum-length"), lengths.map((length) => [length, String(length)]), this.chosen.length);
    for (const name of ["channel", "length", "window", "quantity", "axis"]) {
      const select = byId(`spectrum-${name}`);
      select.value = String(this.chosen[name]);
      select.addEventListener("change", () => this.choose({ [name]: name === "channel" || name === "length" ? Number(select.value) : select.value }));
    }
  }

  choose(change) {
    Object.assign(this.chosen, change);
    this.app.settings.set("spectrum", this.chosen);
    this.rebuild();
    this.update();
  }

  setMarks(marks) {
    this.marks = marks.filter(({ hz }) => hz > 0);
    if (this.plot) this.plot.redraw();
  }

  // Rebuilds the plot after a change of theme, size, unit or axis.
  rebuild() {
    this.plot?.destroy();
    this.plot = null;
  }

  update() {
    if (!this.visible(this.element) || !this.#transform()) return;
    if (!this.plot) this.#build();
    else this.plot.setData(this.data, this.zoom === null);
    if (this.zoom !== null) this.plot.setScale("x", this.zoom);
    this.#describe();
  }

  #prepare(length) {
    if (this.fft?.size === length && this.windowName === this.chosen.window) return;
    this.fft = new Fft(length);
    this.windowName = this.chosen.window;
    this.weights = new Float64Array(length);
    let sum = 0;
    let square = 0;
    for (let i = 0; i < length; ++i) {
      const weight = windowWeight(this.windowName, i, length);
      this.weights[i] = weight;
      sum += weight;
      square += weight * weight;
    }
    this.coherentGain = sum;
    this.noiseGain = square;
    this.data = [new Float64Array(length / 2 - 1), new Float64Array(length / 2 - 1)];
  }

  // The newest 2^k frames, or of a pause those of the window that is seen; frames that were lost are replaced by the one before, and counted.
  #transform() {
    const { frames } = this.app.store;
    const rate = frames.rate_hz;
    const { from, to } = this.app.seen();
    this.end = to;
    const held = to - from;
    let { length } = this.chosen;
    while (length > held && length > 256) length /= 2;
    if (!(rate > 0) || length > held) return false;
    this.#prepare(length);
    const { real } = this.fft;
    this.lost = this.#gather(frames, length, real);
    let mean = 0;
    for (let i = 0; i < length; ++i) mean += real[i];
    mean /= length;
    if (!Number.isFinite(mean)) return false;
    for (let i = 0; i < length; ++i) real[i] = (real[i] - mean) * this.weights[i];
    this.fft.run();
    this.#scale(length, rate);
    return true;
  }

  #gather(frames, length, into) {
    const data = frames.values[this.chosen.channel];
    const { mask } = frames;
    const { sequence } = frames.columns;
    let row = this.end - 1;
    const newest = sequence[row & mask];
    let lost = 0;
    let last = data[row & mask];
    for (let i = length - 1; i >= 0; --i) {
      const wanted = newest - (length - 1 - i);
      while (row > frames.begin && sequence[row & mask] > wanted) row -= 1;
      const value = data[row & mask];
      if (sequence[row & mask] !== wanted || value !== value) lost += 1;
      if (value === value) last = value;
      into[i] = last;
    }
    return lost;
  }

  #scale(length, rate) {
    const { real, imaginary } = this.fft;
    const factor = this.app.units.factor(channels[this.chosen.channel].quantity);
    // Amplitude: the peak value of a sine. Density: its root, one-sided.
    const scale = this.chosen.quantity === "amplitude" ? (2 * factor) / this.coherentGain : factor * Math.sqrt(2 / (rate * this.noiseGain));
    const [frequency, value] = this.data;
    for (let i = 1; i < length / 2; ++i) {
      frequency[i - 1] = (i * rate) / length;
      value[i - 1] = Math.max(1e-30, Math.hypot(real[i], imaginary[i]) * scale);
    }
    this.length = length;
    this.rate_hz = rate;
  }

  #build() {
    const { theme, units } = this.app;
    const { colours, font } = theme;
    const channel = channels[this.chosen.channel];
    const unit = units.label(channel.quantity);
    const box = this.element.getBoundingClientRect();
    const axis = { stroke: colours.quiet, font, labelFont: font, grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.line, width: 1 } };
    const log = this.chosen.axis === "log";
    const round = (value) => (value === null || (log && !isRound(value)) ? "" : tick(value, value || 1));
    this.plot = new uPlot({
      width: Math.floor(box.width), height: Math.floor(box.height),
      legend: { show: false },
      padding: [theme.small * 1.2 * labelRows + 2, null, null, null], // for the labels of the marks
      cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false }, bind: { dblclick: () => () => this.setZoom(null) } },
      scales: {
        x: { time: false, distr: log ? 3 : 1, range: (plot, low, high) => (this.zoom !== null ? [this.zoom.min, this.zoom.max] : log ? [Math.max(low, 0.1), high] : [low, high]) },
        y: { distr: 3, range: (plot, low, high) => this.#range(low, high) },
      },
      axes: [
        { ...axis, label: "frequency (Hz)", labelSize: theme.small * 1.7, size: theme.small * 2.4, values: (plot, list) => list.map(round) },
        { ...axis, label: `${channel.symbol} (${this.chosen.quantity === "amplitude" ? unit : `${unit}/√Hz`})`, labelSize: theme.small * 1.7, size: theme.small * 4.6, values: (plot, list) => list.map((v) => (v === null ? "" : powerOfTen(v))) },
      ],
      series: [{}, { stroke: colours[`c${this.chosen.channel}`], width: theme.large ? 2 : 1.2, points: { show: false } }],
      hooks: { draw: [(plot) => this.#drawMarks(plot)], setCursor: [(plot) => this.#readOff(plot)], setSelect: [(plot) => this.#zoomTo(plot)] },
    }, this.data, this.element);
  }

  #zoomTo(plot) {
    const { left, width } = plot.select;
    if (!(width > 2)) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.setZoom({ min: plot.posToVal(left, "x"), max: plot.posToVal(left + width, "x") });
  }

  // Holds until a double click.
  setZoom(zoom) {
    this.zoom = zoom;
    this.update();
  }

  // Ten decades at most, so that an empty bin does not compress the rest.
  #range(low, high) {
    if (!(high > 0)) return [1e-6, 1];
    const top = 10 ** Math.ceil(Math.log10(high) + 0.15);
    return [Math.max(10 ** Math.floor(Math.log10(low)), top / 1e8), top];
  }

  // Known frequencies by name; the drive and its harmonics by their order.
  #drawMarks(plot) {
    const { colours, font, small } = this.app.theme;
    const { ctx: context, bbox } = plot;
    const ratio = uPlot.pxRatio;
    context.save();
    context.font = font.replace(/^\d+/, String(Math.round(small * ratio * 0.92)));
    context.textBaseline = "top";
    context.textAlign = "left";
    const { min, max } = plot.scales.x;
    const mark = (hz, label, colour, dash, row) => {
      if (!(hz > min && hz < max)) return;
      const x = Math.round(plot.valToPos(hz, "x", true));
      context.strokeStyle = colour;
      context.lineWidth = ratio;
      context.setLineDash(dash.map((length) => length * ratio));
      context.beginPath();
      const y = bbox.top - (labelRows - row) * small * ratio * 1.2;
      context.moveTo(x, y);
      context.lineTo(x, bbox.top + bbox.height);
      context.stroke();
      const wide = context.measureText(label).width;
      const left = x + wide + 6 * ratio > bbox.left + bbox.width ? x - wide - 4 * ratio : x + 3 * ratio;
      context.fillStyle = colours.panel;
      context.fillRect(left - ratio, y, wide + 2 * ratio, small * ratio * 1.15);
      context.fillStyle = colour;
      context.fillText(label, left, y);
    };
    const drive = this.app.store.carrier_hz;
    for (let order = 2; drive > 0 && order <= maxHarmonics; ++order) mark(order * drive, `${order}`, colours.quiet, [1, 3], 0);
    if (drive > 0) mark(drive, `drive ${number(drive, 3)}`, colours.c1, [6, 3], 1);
    this.marks.forEach(({ name, hz }, i) => mark(hz, `${name} ${number(hz, 3)}`, colours.mark, [2, 2], 2 + (i % 3)));
    context.restore();
  }

  #readOff(plot) {
    const { idx } = plot.cursor;
    const unit = this.app.units.label(channels[this.chosen.channel].quantity);
    this.read = idx === null || idx === undefined ? ""
      : `At ${number(this.data[0][idx])} Hz: ${number(this.data[1][idx], 3)} ${this.chosen.quantity === "amplitude" ? unit : `${unit}/√Hz`}. `;
    this.#describe();
  }

  #describe() {
    const [frequency, value] = this.data;
    let peak = 0;
    for (let i = 1; i < value.length; ++i) if (value[i] > value[peak]) peak = i;
    const lost = this.lost > 0 ? ` ${this.lost} missing values were filled.` : "";
    this.peak_hz = frequency[peak];
    setText(byId("spectrum-summary"), `${this.read ?? ""}Largest at ${number(frequency[peak])} Hz. ${this.length} frames, ` +
      `${duration(this.length / this.rate_hz)}, lines ${number(this.rate_hz / this.length, 3)} Hz apart.${lost}`);
  }
}

// 1, 2 or 5 times a power of ten.
function isRound(value) {
  const part = value / 10 ** Math.floor(Math.log10(value) + 1e-9);
  return [1, 2, 5].some((digit) => Math.abs(part - digit) < 1e-6);
}

function powerOfTen(value) {
  const power = Math.round(Math.log10(value));
  if (Math.abs(value / 10 ** power - 1) > 1e-6) return "";
  return power >= -3 && power <= 3 ? String(10 ** power) : `10${[...String(power)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`;
}
