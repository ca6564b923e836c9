// SPDX-License-Identifier: Apache-2.0
// The spectrum of one channel, or the frequency response between two, with known frequencies marked.

import { decadeRange, decades, frequencyAxis } from "./decades.js";
import { byId, fillSelect, setText, watchVisible } from "./elements.js";
import { ResponsePlots, respond } from "./response.js";
import { channels, duration, fixed, number, withUnit } from "./units.js";
import uPlot from "./uPlot.esm.js";
import { Welch, averages, gather } from "./welch.js";

const lengths = [1024, 2048, 4096, 8192, 16384, 32768, 65536];
const maxHarmonics = 7;
const labelRows = 5; // above the plot: harmonics, drive, marks of the model
const usual = { show: "spectrum", channel: 0, input: 4, length: 8192, averages: "off", window: "hann", quantity: "amplitude", axis: "log" };
const numeric = ["channel", "input", "length"];

export class Spectrum {
  constructor(app) {
    this.app = app;
    this.marks = []; // of the model, once it is known
    this.plot = null;
    this.latest = null; // length, rows and pause of the latest transform
    this.zoom = null; // limits of the frequency that were chosen
    this.chosen = { ...usual, ...app.settings.get("spectrum") };
    this.element = byId("spectrum-plot");
    this.visible = watchVisible([this.element]);
    const names = channels.map((channel, i) => [i, channel.name]);
    fillSelect(byId("spectrum-channel"), names);
    fillSelect(byId("spectrum-input"), names);
    fillSelect(byId("spectrum-length"), lengths.map((length) => [length, String(length)]));
    for (const name of Object.keys(usual)) {
      const select = byId(`spectrum-${name}`);
      select.value = String(this.chosen[name]);
      select.addEventListener("change", () => this.choose({ [name]: numeric.includes(name) ? Number(select.value) : select.value }));
    }
    this.#showControls();
    // A drag that chooses a range goes on in the plot in which it began.
    this.dragging = false;
    this.awaited = false; // a rebuild after it
    this.element.addEventListener("mousedown", () => { this.dragging = this.plot !== null; });
    window.addEventListener("mouseup", () => this.#dropped()); // after uPlot's own listener
  }

  #dropped() {
    this.dragging = false;
    if (!this.awaited) return;
    this.rebuild();
    this.update();
  }

  get isResponse() { return this.chosen.show === "response"; }

  #showControls() {
    this.element.dataset.show = this.chosen.show;
    byId("spectrum-input").parentElement.hidden = !this.isResponse;
    byId("spectrum-quantity").parentElement.hidden = this.isResponse;
    setText(byId("spectrum-title"), this.isResponse ? "Frequency response" : "Spectrum");
    this.element.setAttribute("aria-label", this.isResponse ? "Frequency response: magnitude, phase and coherence" : "Spectrum of the channel");
  }

  choose(change) {
    Object.assign(this.chosen, change);
    this.app.settings.set("spectrum", this.chosen);
    this.#showControls();
    this.dragging = false;
    this.rebuild();
    this.update();
  }

  setMarks(marks) {
    this.marks = marks.filter(({ hz }) => hz > 0);
    if (this.plot) this.plot.redraw();
  }

  // Rebuilds the plot after a change of theme, size, unit, axis or channel.
  rebuild() {
    this.awaited = this.dragging;
    if (this.dragging) return;
    this.plot?.destroy();
    this.plot = null;
    this.latest = null;
    this.read = "";
  }

  update() {
    if (!this.visible(this.element)) return;
    if (!this.#transform()) {
      if (this.plot === null) setText(byId("spectrum-summary"), this.missing ?? "");
      return;
    }
    if (!this.plot) this.#build();
    else this.plot.setData(this.data, this.zoom === null);
    if (this.zoom !== null) this.plot.setScale("x", this.zoom);
    this.#describe();
  }

  #prepare(length, span) {
    if (this.welch?.length !== length || this.welch.window !== this.chosen.window) this.welch = new Welch(length, this.chosen.window);
    if (this.samples?.length !== span) {
      this.samples = new Float64Array(span);
      this.inputs = new Float64Array(span);
    }
    const lines = length / 2 - 1;
    if (this.data?.length !== (this.isResponse ? 4 : 2) || this.data[0].length !== lines) {
      // uPlot takes null for no value, which typed arrays cannot hold.
      this.data = [new Float64Array(lines), ...Array.from({ length: this.isResponse ? 3 : 1 }, () => (this.isResponse ? new Array(lines) : new Float64Array(lines)))];
    }
  }

  // The newest frames, or of a pause those of the window that is seen. Returns true if there is anything new to
  // draw. Averages are taken anew after an eighth of a segment only, since they cost many transforms.
  #transform() {
    const { frames } = this.app.store;
    const rate = frames.rate_hz;
    const { from, to } = this.app.seen();
    this.end = to;
    const { segments: most, share } = averages[this.chosen.averages] ?? averages.off;
    let { length } = this.chosen;
    while (length > to - from && length > 256) length /= 2;
    this.missing = "Too few frames.";
    if (!(rate > 0) || length > to - from) return false;
    const fresh = this.latest?.length === length && this.latest.paused === this.app.paused;
    if (most > 1 && fresh && to >= this.latest.end && to - this.latest.end < length / 8 && (!this.app.paused || this.latest.from === from)) return false;
    this.#prepare(length, length);
    const segments = this.welch.fitting(to - from, most);
    this.#prepare(length, this.welch.span(segments));
    if (!this.#gather(frames)) return false;
    if (this.isResponse) this.welch.run(this.inputs, this.samples, segments, share);
    else this.welch.run(this.samples, null, segments, share);
    this.length = length;
    this.rate_hz = rate;
    this.latest = { length, end: to, from, paused: this.app.paused };
    this.#scale();
    return true;
  }

  // False if a channel was not measured.
  #gather(frames) {
    const { channel, input } = this.chosen;
    this.lost = gather(frames, channel, this.end, this.samples);
    if (this.isResponse) this.lost = Math.max(this.lost, gather(frames, input, this.end, this.inputs));
    const absent = !Number.isFinite(this.samples[0]) ? channel : this.isResponse && !Number.isFinite(this.inputs[0]) ? input : null;
    if (absent === null) return true;
    this.missing = `${channels[absent].name} is not measured.`;
    return false;
  }

  #factor(channel) { return this.app.units.factor(channels[channel].quantity); }
  #unit(channel) { return this.app.units.label(channels[channel].quantity); }

  #scale() {
    const { welch, length, rate_hz: rate } = this;
    const factor = this.#factor(this.chosen.channel);
    if (this.isResponse) {
      respond(welch, rate, factor / this.#factor(this.chosen.input), this.data);
      return;
    }
    // Amplitude: the peak value of a sine. Density: its root, one-sided.
    const scale = this.chosen.quantity === "amplitude" ? (2 * factor) / welch.coherentGain : factor * Math.sqrt(2 / (rate * welch.noiseGain));
    const [frequency, value] = this.data;
    for (let i = 1; i < length / 2; ++i) {
      frequency[i - 1] = (i * rate) / length;
      value[i - 1] = Math.max(1e-30, Math.sqrt(welch.xx[i]) * scale);
    }
  }

  // The unit of what is drawn.
  get unit() {
    const unit = this.#unit(this.chosen.channel);
    if (this.isResponse) return this.#unit(this.chosen.input) === "" ? unit : `${unit || "1"}/${this.#unit(this.chosen.input)}`;
    return this.chosen.quantity === "amplitude" ? unit : `${unit || "1"}/√Hz`;
  }

  #build() {
    if (this.isResponse) this.#buildResponse();
    else this.#buildSpectrum();
  }

  get #top() { return this.app.theme.small * 1.2 * labelRows + 2; } // for the labels of the marks

  #buildSpectrum() {
    const { theme } = this.app;
    const box = this.element.getBoundingClientRect();
    const { axis, x, xScale } = frequencyAxis(theme, this.chosen.axis === "log", () => this.zoom);
    this.plot = new uPlot({
      width: Math.floor(box.width), height: Math.floor(box.height),
      legend: { show: false },
      padding: [this.#top, null, null, null],
      cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false }, bind: { dblclick: () => () => this.setZoom(null) } },
      scales: { x: xScale, y: { distr: 3, range: (plot, low, high) => decadeRange(low, high) } },
      axes: [x, { ...axis, label: withUnit(channels[this.chosen.channel].symbol, this.unit), labelSize: theme.small * 1.7, size: theme.small * 4.6, values: decades.values }],
      series: [{}, { stroke: theme.channel[this.chosen.channel], width: theme.large ? 2 : 1.2, points: { show: false } }],
      hooks: { draw: [(plot) => this.#drawMarks(plot)], setCursor: [(plot) => this.#readOff(plot)], setSelect: [(plot) => this.#zoomTo(plot)] },
    }, this.data, this.element);
  }

  #buildResponse() {
    const { channel, input } = this.chosen;
    this.plot = new ResponsePlots(this.element, this.app.theme, this.data, {
      log: this.chosen.axis === "log", colour: this.app.theme.channel[channel], top: this.#top,
      label: withUnit(`${channels[channel].symbol}/${channels[input].symbol}`, this.unit),
      zoom: () => this.zoom, onZoom: (zoom) => this.setZoom(zoom), onSelect: (plot) => this.#zoomTo(plot),
      onCursor: (plot) => this.#readOff(plot), onDraw: (plot) => this.#drawMarks(plot),
    });
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
    this.latest = null;
    this.update();
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
    const value = idx === null || idx === undefined ? undefined : this.data[1][idx];
    const [, , phase, coherence] = this.data.map((list) => list[idx]);
    this.read = value === undefined ? ""
      : `At ${number(this.data[0][idx])} Hz: ${number(value, 3)} ${this.unit}${this.isResponse ? `, ${fixed(phase, 1)}°` : ""}${Number.isFinite(coherence) ? `, coherence ${fixed(coherence, 3)}` : ""}. `;
    this.#describe();
  }

  #describe() {
    const [frequency, value] = this.data;
    let peak = 0;
    for (let i = 1; i < value.length; ++i) if (value[i] > value[peak]) peak = i;
    const { segments } = this.welch;
    const lost = this.lost > 0 ? ` ${this.lost} missing values were filled.` : "";
    const few = this.isResponse && segments < 2 ? " Coherence needs an average." : "";
    this.peak_hz = frequency[peak];
    setText(byId("spectrum-summary"), `${this.read ?? ""}Largest at ${number(frequency[peak])} Hz. ${segments > 1 ? `${segments} × ` : ""}${this.length} frames, ` +
      `${duration(this.samples.length / this.rate_hz)}, lines ${number(this.rate_hz / this.length, 3)} Hz apart.${few}${lost}`);
  }
}
