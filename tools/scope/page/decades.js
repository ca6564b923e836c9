// SPDX-License-Identifier: Apache-2.0
// Axes of spectra, for uPlot: a frequency, and numbers by the decade.

import { tick } from "./units.js";
import uPlot from "./uPlot.esm.js";

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

// Every decade of a range, or of a low plot every second or third: those with a label.
function labelled(plot, value) {
  const { min, max } = plot.scales.y;
  const every = Math.max(1, Math.ceil((Math.log10(max / min) * 18 * uPlot.pxRatio) / plot.bbox.height));
  return value !== null && powerOfTen(value) !== "" && Math.round(Math.log10(value)) % every === 0;
}

// Labels and lines of an axis by the decade.
export const decades = {
  values: (plot, list) => list.map((value) => (labelled(plot, value) ? powerOfTen(value) : "")),
  filter: (plot, list) => list.map((value) => (labelled(plot, value) ? value : null)),
};

// Eight decades at most, so that an empty bin does not compress the rest.
export function decadeRange(low, high) {
  if (!(high > 0)) return [1e-6, 1];
  const top = 10 ** Math.ceil(Math.log10(high) + 0.15);
  return [Math.max(10 ** Math.floor(Math.log10(low)), top / 1e8), top];
}

// The look of every axis, the axis of frequency, logarithmic or not, and its scale. zoom(): its limits {min, max}
// if they were chosen, else null.
export function frequencyAxis(theme, log, zoom) {
  const { colours, font, small } = theme;
  const axis = { stroke: colours.quiet, font, labelFont: font, grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.line, width: 1 } };
  const round = (value) => (value === null || (log && !isRound(value)) ? "" : tick(value, value || 1));
  return {
    axis,
    x: { ...axis, label: "frequency (Hz)", labelSize: small * 1.7, size: small * 2.4, values: (plot, list) => list.map(round) },
    xScale: { time: false, distr: log ? 3 : 1, range: (plot, low, high) => (zoom() !== null ? [zoom().min, zoom().max] : log ? [Math.max(low, 0.1), high] : [low, high]) },
  };
}
