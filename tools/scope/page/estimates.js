// SPDX-License-Identifier: Apache-2.0
// Estimates of the observer over device time, with bands of two standard deviations, and its normalised
// innovation squared with the 95 % bounds of a consistent filter.

import { chiSquareQuantile } from "./chi_square.js";
import { byId, fillSelect, setText, watchVisible } from "./elements.js";
import { count, number } from "./units.js";
import uPlot from "./uPlot.esm.js";

// raw: the corresponding value of Eq. (1). colour: of the theme.
const plots = {
  friction_force_n: { colour: "c2", unit: "N", symbol: "f", band: true, raw: "raw_friction_force_n" },
  mu: { colour: "c2", unit: "", symbol: "μ", band: true, raw: "raw_coefficient" },
  theta: { colour: "c2", unit: "", symbol: "θ", band: true, fixed: [-1.1, 1.1] },
  gamma_per_s: { colour: "c2", unit: "1/s", symbol: "γ", band: true },
  nis: { colour: "c0", unit: "", symbol: "NIS", nis: true },
  sticking: { colour: "c3", unit: "", symbol: "P", fixed: [-0.03, 1.03] },
};
const maxPoints = 1500; // beyond it every n-th is drawn

export class Estimates {
  constructor(app) {
    this.app = app;
    this.span_s = app.settings.get("estimate_s") ?? 20;
    this.bounds = new Map();
    this.figures = [...document.querySelectorAll("[data-estimate]")].map((figure) => ({
      name: figure.dataset.estimate, figure, box: figure.querySelector(".plot"), output: figure.querySelector("output"),
      ...plots[figure.dataset.estimate], plot: null, data: null,
    }));
    this.visible = watchVisible(this.figures.map(({ figure }) => figure), () => app.touch());
    this.turn = 0;
    fillSelect(byId("estimate-span"), [2, 5, 10, 20, 30, 60].map((span) => [span, `${span} s`]), this.span_s);
    byId("estimate-span").addEventListener("change", (event) => {
      this.span_s = Number(event.target.value);
      app.settings.set("estimate_s", this.span_s);
    });
  }

  rebuild() {
    for (const one of this.figures) {
      one.plot?.destroy();
      one.plot = null;
    }
  }

  // Bounds of the 95 % interval for a number of degrees of freedom.
  nisBounds(freedom) {
    if (!(freedom >= 1)) return [NaN, NaN];
    let pair = this.bounds.get(freedom);
    if (!pair) {
      pair = [chiSquareQuantile(0.025, freedom), chiSquareQuantile(0.975, freedom)];
      this.bounds.set(freedom, pair);
    }
    return pair;
  }

  // Draws the next visible plot.
  update() {
    for (let i = 0; i < this.figures.length; ++i) {
      this.turn = (this.turn + 1) % this.figures.length;
      const one = this.figures[this.turn];
      if (!this.visible(one.figure)) continue;
      this.updateOne(one);
      return;
    }
  }

  updateOne(one) {
    const points = this.#fill(one);
    this.#describe(one);
    if (points < 2) return;
    if (!one.plot) this.#build(one);
    else one.plot.setData(one.data);
  }

  // Times in s of device time; then value, lower and upper edge of the band, raw (or: NIS and bounds).
  #fill(one) {
    const { estimates, frames } = this.app.store;
    const { mask, columns } = estimates;
    const from = estimates.rowAt(estimates.last_ns - this.span_s * 1e9);
    const stride = Math.max(1, Math.ceil((estimates.end - from) / maxPoints));
    // The same rows are omitted each time, so that curves do not flicker.
    const first = Math.ceil(from / stride) * stride;
    const points = Math.max(0, Math.floor((estimates.end - 1 - first) / stride) + 1);
    const lists = one.nis ? 4 : one.band ? (one.raw ? 5 : 4) : 2;
    one.data ??= Array.from({ length: lists }, () => []);
    for (const list of one.data) list.length = points;
    const origin_s = frames.origin_ns === null ? 0 : Number(frames.origin_ns) / 1e9;
    const values = columns[one.name];
    const deviations = columns[`${one.name}_deviation`];
    const raws = one.raw ? columns[one.raw] : null;
    const least = one.name === "mu" ? frames.leastLoad(frames.rowAt(estimates.last_ns - this.span_s * 1e9), frames.end) : NaN;
    const longest_ns = this.#longestStep(estimates, stride);
    for (let i = 0; i < points; ++i) {
      const at = (first + i * stride) & mask;
      // Lost estimates break the curve: the first one after them is omitted.
      const lost = i > 0 && estimates.time[at] - estimates.time[(first + (i - 1) * stride) & mask] > longest_ns;
      const value = lost ? null : finite(values[at]);
      one.data[0][i] = estimates.time[at] / 1e9 + origin_s;
      one.data[1][i] = value;
      if (one.nis) {
        const [low, high] = this.nisBounds(columns.nis_freedom[at]);
        one.data[2][i] = finite(low);
        one.data[3][i] = finite(high);
      } else if (one.band) {
        const reach = 2 * deviations[at];
        one.data[2][i] = value === null ? null : finite(value - reach);
        one.data[3][i] = value === null ? null : finite(value + reach);
        const unloaded = least === least && frames.valueAt(3, estimates.time[at]) < least;
        if (raws) one.data[4][i] = lost || unloaded ? null : finite(raws[at]);
      }
    }
    return points;
  }

  // Interval between consecutive estimates, from the latest two.
  #longestStep({ time, mask, begin, end }, stride) {
    return end - begin < 2 ? Infinity : 5 * stride * Math.max(time[(end - 1) & mask] - time[(end - 2) & mask], 2e7);
  }

  #describe(one) {
    const { estimates } = this.app.store;
    if (estimates.empty) { setText(one.output, "–"); return; }
    const { columns, mask } = estimates;
    const at = (estimates.end - 1) & mask;
    const value = columns[one.name][at];
    const unit = one.unit === "" ? "" : ` ${one.unit}`;
    if (one.nis) {
      const inside = this.#insideBounds();
      setText(one.output, `${number(value, 3)} of ${count(columns.nis_freedom[at])}; ${inside} inside`);
    } else if (one.band) {
      setText(one.output, `${number(value)} ± ${number(2 * columns[`${one.name}_deviation`][at], 2)}${unit}`);
    } else {
      setText(one.output, number(value, 3) + unit);
    }
    const label = `${one.figure.querySelector("h3").textContent}: ${one.output.textContent}`;
    if (one.box.getAttribute("aria-label") !== label) one.box.setAttribute("aria-label", label);
  }

  #insideBounds() {
    const { estimates } = this.app.store;
    const { columns, mask } = estimates;
    let inside = 0;
    let all = 0;
    for (let row = estimates.rowAt(estimates.last_ns - this.span_s * 1e9); row < estimates.end; ++row) {
      const nis = columns.nis[row & mask];
      const [low, high] = this.nisBounds(columns.nis_freedom[row & mask]);
      if (!(nis === nis && low === low)) continue;
      all += 1;
      if (nis >= low && nis <= high) inside += 1;
    }
    return all === 0 ? "–" : `${Math.round((100 * inside) / all)} %`;
  }

  #build(one) {
    const { theme } = this.app;
    const { colours, font, small } = theme;
    const box = one.box.getBoundingClientRect();
    const axis = { stroke: colours.quiet, font, grid: { stroke: colours.line, width: 1 }, ticks: { show: false }, gap: 3 };
    const stroke = colours[one.colour];
    const width = theme.large ? 2 : 1.3;
    const none = { points: { show: false } };
    const series = [{}, { stroke, width, ...none }];
    const bands = [];
    if (one.nis) {
      series.push({ stroke: colours.quiet, width: 1, dash: [6, 4], ...none }, { stroke: colours.quiet, width: 1, dash: [6, 4], ...none });
    } else if (one.band) {
      series.push({ stroke: "transparent", ...none }, { stroke: "transparent", ...none });
      bands.push({ series: [3, 2], fill: colours.band });
      if (one.raw) series.push({ stroke: colours.c1, width: 1, dash: [2, 2], ...none });
    }
    const y = one.nis ? { distr: 3, range: (plot, low, high) => [Math.max(1e-3, low), Math.max(20, high)] }
      : one.fixed ? { range: () => one.fixed } : { range: (plot, low, high) => this.#range(one, low, high) };
    one.plot = new uPlot({
      width: Math.floor(box.width), height: Math.floor(box.height), legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      scales: { x: { time: false, range: (plot, low, high) => [Math.min(low, high - 1e-3), high] }, y },
      axes: [
        { ...axis, size: small * 1.7, space: small * 6, values: (plot, list) => list.map((v, i) => (i === list.length - 1 ? `${v} s` : String(v))) },
        { ...axis, label: `${one.symbol} (${one.unit || "1"})`, labelFont: font, labelSize: small * 1.3, labelGap: 0, size: small * 3, space: small * 2.2, values: (plot, list) => list.map((v) => (v === null ? "" : number(v, 3).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, ""))) },
      ],
      series, bands,
    }, one.data, one.box);
  }

  // The value and its raw estimate determine the scale; a wide band may exceed it.
  #range(one) {
    let low = Infinity;
    let high = -Infinity;
    for (const list of one.raw ? [one.data[1], one.data[4]] : [one.data[1]]) {
      for (const value of list) {
        if (value === null) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return [0, 1];
    const bandLow = one.data[2].reduce((least, v) => (v !== null && v < least ? v : least), low);
    const bandHigh = one.data[3].reduce((most, v) => (v !== null && v > most ? v : most), high);
    const reach = Math.max(high - low, Math.abs(high) * 0.02, 1e-9);
    const bottom = Math.max(bandLow, low - reach);
    const top = Math.min(bandHigh, high + reach);
    const room = Math.max((top - bottom) * 0.06, 1e-9);
    return [bottom - room, top + room];
  }
}

function finite(value) {
  return Number.isFinite(value) ? value : null;
}
