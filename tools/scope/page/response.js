// SPDX-License-Identifier: Apache-2.0
// The frequency response between two channels: magnitude, phase and coherence, one below the other.

import { decadeRange, decades, frequencyAxis } from "./decades.js";
import uPlot from "./uPlot.esm.js";

const degrees = 180 / Math.PI;
const parts = [
  { name: "magnitude", height: 0.46 },
  { name: "phase", label: "phase (°)", height: 0.24, range: [-195, 195], splits: [-180, -90, 0, 90, 180] },
  { name: "coherence", label: "coherence", height: 0.3, range: [-0.04, 1.04], splits: [0, 0.5, 1] },
];

// From averaged spectra of an input x and an output y, in `data`: frequency [Hz], magnitude, phase [degrees]
// and coherence, which one segment says nothing of (null).
export function respond(welch, rate_hz, factor, data) {
  const { length, xx, yy, re, im, segments } = welch;
  for (let k = 1; k < length / 2; ++k) {
    const cross = Math.hypot(re[k], im[k]);
    data[0][k - 1] = (k * rate_hz) / length;
    data[1][k - 1] = xx[k] > 0 ? (factor * cross) / xx[k] : null;
    data[2][k - 1] = xx[k] > 0 ? Math.atan2(im[k], re[k]) * degrees : null;
    data[3][k - 1] = segments > 1 && xx[k] * yy[k] > 0 ? (cross * cross) / (xx[k] * yy[k]) : null;
  }
}

// Of a low plot: with few decades.
function decadeAxis(axis) {
  const { values, filter } = decades;
  return { values, filter, grid: { ...axis.grid, filter }, ticks: { ...axis.ticks, filter } };
}

export class ResponsePlots {
  // options: log, label (of the magnitude), colour, top (for marks), zoom(): limits or null; onZoom, onSelect,
  // onCursor, onDraw.
  constructor(element, theme, data, options) {
    this.sync = uPlot.sync("response");
    const box = element.getBoundingClientRect();
    this.plots = parts.map((part, i) => new uPlot(this.#options(part, i, box, theme, options), [data[0], data[i + 1]], element));
  }

  #options(part, i, box, theme, options) {
    const { axis, x, xScale } = frequencyAxis(theme, options.log, options.zoom);
    const last = i === parts.length - 1;
    const dots = part.name === "phase"; // which would jump by a turn as a line
    const magnitude = part.name === "magnitude";
    return {
      width: Math.floor(box.width), height: Math.floor(box.height * part.height),
      legend: { show: false },
      padding: [magnitude ? options.top : 6, theme.small, last ? null : 6, null],
      cursor: { sync: { key: this.sync.key }, drag: { x: true, y: false, setScale: false }, points: { show: false }, bind: { dblclick: () => () => options.onZoom(null) } },
      scales: { x: xScale, y: magnitude ? { distr: 3, range: (plot, low, high) => decadeRange(low, high) } : { range: () => part.range } },
      axes: [
        last ? x : { ...x, label: undefined, size: 0, values: (plot, list) => list.map(() => "") },
        { ...axis, label: part.label ?? options.label, labelSize: theme.small * 1.7, size: theme.small * 4.6, ...(magnitude ? decadeAxis(axis) : { splits: () => part.splits }) },
      ],
      series: [{}, { stroke: options.colour, width: theme.large ? 2 : 1.2, points: { show: dots, size: 2.5, fill: options.colour, width: 0 }, ...(dots ? { paths: () => null } : {}) }],
      hooks: {
        draw: magnitude ? [options.onDraw] : [],
        setCursor: [(plot) => options.onCursor(plot)],
        setSelect: [(plot) => options.onSelect(plot)],
      },
    };
  }

  setData(data, follow) { this.plots.forEach((plot, i) => plot.setData([data[0], data[i + 1]], follow)); }
  setScale(name, limits) { for (const plot of this.plots) plot.setScale(name, limits); }
  redraw() { for (const plot of this.plots) plot.redraw(); }
  destroy() { for (const plot of this.plots) plot.destroy(); }
  get scales() { return this.plots[0].scales; }
}
