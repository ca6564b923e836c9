// SPDX-License-Identifier: Apache-2.0
// The portraits: friction loops, phase portrait with its section, cylindrical portrait, load against
// displacement. One is drawn per frame, in turn, so that five cost no more than one.

import { Limits, eachTick, fitCanvas, roundStep } from "./axes.js";
import { byId, fillSelect, setPressed, setText, watchVisible } from "./elements.js";
import { Section } from "./section.js";
import { TraceCanvas, gap } from "./trace_gl.js";
import { count, number, tick } from "./units.js";

const maxPoints = 2 ** 17;
const maxOverlay = 8192;
const [displacement, velocity, friction, load] = [0, 1, 2, 3];
const degrees = 180 / Math.PI;

// The portraits: x and y are names of quantities below.
const portraits = {
  "friction-velocity": { x: "v", y: "ratio", overlay: "estimate" },
  "friction-displacement": { x: "x", y: "ratio" },
  phase: { x: "x", y: "v", section: true },
  cylinder: { x: "drive", y: "x" },
  "load-displacement": { x: "x", y: "load" },
};

export class Portraits {
  constructor(app) {
    this.app = app;
    this.span_s = app.settings.get("portrait_s") ?? 10;
    this.section = new Section();
    this.traces = new TraceCanvas(document.createElement("canvas"));
    this.x = new Float64Array(maxPoints);
    this.y = new Float64Array(maxPoints);
    this.points = new Float32Array(2 * maxPoints);
    this.overlay = new Float32Array(2 * maxOverlay);
    this.figures = [...document.querySelectorAll("[data-portrait]")].map((figure) => this.#figure(figure));
    this.visible = watchVisible(this.figures.map(({ figure }) => figure), () => app.touch());
    this.turn = 0;
    fillSelect(byId("portrait-span"), [2, 5, 10, 20, 30, 60].map((span) => [span, `${span} s`]), this.span_s);
    byId("portrait-span").addEventListener("change", (event) => {
      this.span_s = Number(event.target.value);
      app.settings.set("portrait_s", this.span_s);
      app.touch();
    });
    byId("section-phase").addEventListener("input", (event) => this.setPhase(Number(event.target.value)));
  }

  setPhase(phase_deg) {
    const phase = ((phase_deg % 360) + 360) % 360;
    byId("section-phase").value = String(phase);
    setText(byId("section-now"), `${phase}°`);
    this.section.setPhase(phase / degrees);
    this.app.touch();
  }

  get phase_deg() { return Math.round(this.section.phase_rad * degrees); }

  #figure(figure) {
    const name = figure.dataset.portrait;
    const canvas = figure.querySelector("canvas");
    const one = {
      name, figure, canvas, context: canvas.getContext("2d"), note: figure.querySelector("p"), ...portraits[name],
      xLimits: new Limits(), yLimits: new Limits(), count: 0, drawn: null,
    };
    const button = figure.querySelector("button");
    button.addEventListener("click", () => {
      const large = figure.classList.toggle("large");
      setPressed(button, large);
      this.app.touch();
    });
    return one;
  }

  clear() {
    this.section.clear();
    this.unitsChanged();
  }

  unitsChanged() {
    for (const { xLimits, yLimits } of this.figures) {
      xLimits.reset();
      yLimits.reset();
    }
  }

  // Draws the next visible portrait.
  draw(now_ms) {
    this.section.follow(this.app.store);
    for (let i = 0; i < this.figures.length; ++i) {
      this.turn = (this.turn + 1) % this.figures.length;
      if (this.visible(this.figures[this.turn].figure)) {
        this.drawOne(this.figures[this.turn], now_ms);
        return;
      }
    }
  }

  drawOne(one, now_ms) {
    one.width = one.canvas.clientWidth;
    one.height = one.canvas.clientHeight;
    const points = this.#fill(one);
    one.count = points;
    if (one.x === "drive") one.xLimits.set(0, 360);
    this.#follow(one, points, now_ms);
    this.#draw(one, points);
    this.#describe(one, points);
  }

  #unit(name) {
    const { units } = this.app;
    switch (name) {
      case "x": return { label: `x (${units.label("length")})`, factor: units.factor("length") };
      case "v": return { label: `v (${units.label("velocity")})`, factor: units.factor("velocity") };
      case "load": return { label: "N (N)", factor: 1 };
      case "drive": return { label: "drive phase (°)", factor: 1 };
      default: return this.hasLoad ? { label: "μ = F/N", factor: 1 } : { label: "F (N)", factor: 1 };
    }
  }

  // Writes the portrait's two quantities to this.x and this.y, in the units shown; NaN breaks a line.
  // Returns their number.
  #fill(one) {
    const { frames, excitation } = this.app.store;
    const { mask, values } = frames;
    this.hasLoad = !frames.empty && Number.isFinite(values[load][(frames.end - 1) & mask]);
    const { from, to } = this.app.seen(this.span_s);
    const stride = Math.max(1, Math.ceil((to - from) / (maxPoints - 2)));
    const xFactor = this.#unit(one.x).factor;
    const yFactor = this.#unit(one.y).factor;
    if (one.x === "drive") return this.#fillCylinder(frames, excitation, from, to, stride, yFactor);
    const xs = values[one.x === "v" ? velocity : displacement];
    const ys = values[one.y === "v" ? velocity : one.y === "load" ? load : friction];
    const loads = one.y === "ratio" && this.hasLoad ? values[load] : null;
    const least = loads ? frames.leastLoad(from, to) : 0;
    one.unloaded = 0;
    let points = 0;
    for (let row = from; row < to && points < maxPoints - 1; row += stride) {
      const at = row & mask;
      if (row > from && frames.broken(row - stride, row)) {
        this.x[points] = NaN;
        this.y[points] = NaN;
        points += 1;
      }
      this.x[points] = xs[at] * xFactor;
      const unloaded = loads !== null && !(loads[at] >= least && loads[at] > 0);
      if (unloaded) one.unloaded += 1;
      this.y[points] = unloaded ? NaN : (loads ? ys[at] / loads[at] : ys[at]) * yFactor;
      points += 1;
    }
    return points;
  }

  // The phase of the drive at the times of the frames.
  #fillCylinder(frames, excitation, from, to, stride, factor) {
    const { mask, time, values } = frames;
    const phases = excitation.columns.phase_rad;
    let drive = excitation.rowAt(time[from & mask]);
    let points = 0;
    let last = NaN;
    for (let row = from; row < to && points < maxPoints - 1; row += stride) {
      const at = row & mask;
      while (drive < excitation.end && excitation.time[drive & excitation.mask] < time[at]) drive += 1;
      if (drive >= excitation.end) break;
      if (excitation.time[drive & excitation.mask] !== time[at]) continue;
      const phase = phases[drive & excitation.mask] * degrees;
      if (phase < last || (row > from && frames.broken(row - stride, row))) {
        this.x[points] = NaN;
        this.y[points] = NaN;
        points += 1;
      }
      last = phase;
      this.x[points] = phase;
      this.y[points] = values[displacement][at] * factor;
      points += 1;
    }
    return points;
  }

  #follow(one, points, now_ms) {
    let [xLow, xHigh, yLow, yHigh] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i < points; ++i) {
      const x = this.x[i];
      const y = this.y[i];
      if (!(Number.isFinite(x) && Number.isFinite(y))) continue;
      if (x < xLow) xLow = x;
      if (x > xHigh) xHigh = x;
      if (y < yLow) yLow = y;
      if (y > yHigh) yHigh = y;
    }
    if (one.x !== "drive") one.xLimits.follow(xLow, xHigh, now_ms);
    // Noise about a constant load must not look like a loop.
    if (one.y === "load") one.yLimits.least = 0.2 * Math.abs(yLow + yHigh) / 2;
    one.yLimits.follow(yLow, yHigh, now_ms);
  }

  #draw(one, points) {
    const { context } = one;
    const { theme } = this.app;
    const ratio = Math.min(3, window.devicePixelRatio || 1);
    fitCanvas(one.canvas, context, one.width, one.height, ratio);
    context.clearRect(0, 0, one.width, one.height);
    const place = this.#place(one, theme);
    this.#drawAxes(one, place, theme);
    if (!one.xLimits.known || !one.yLimits.known) {
      context.fillStyle = theme.colours.quiet;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(one.x === "drive" ? "no drive phase in the stream" : "nothing measured yet", place.left + place.width / 2, place.top + place.height / 2);
      one.drawn = null;
      return;
    }
    const { low: xLow, high: xHigh } = one.xLimits;
    const { low: yLow, high: yHigh } = one.yLimits;
    const xScale = place.width / (xHigh - xLow);
    const yScale = place.height / (yHigh - yLow);
    for (let i = 0; i < points; ++i) {
      const x = this.x[i];
      const y = this.y[i];
      const there = Number.isFinite(x) && Number.isFinite(y);
      this.points[2 * i] = there ? (x - xLow) * xScale : gap;
      this.points[2 * i + 1] = there ? (yHigh - y) * yScale : 0;
    }
    const { traces } = this;
    traces.resize(place.width, place.height, ratio);
    traces.begin();
    const colour = one.x === "drive" || one.y === "v" ? theme.colours.c0 : one.y === "load" ? theme.colours.c3 : theme.colours.c2;
    traces.line(this.points, points, colour, theme.large ? 1.8 : 1.15, 0.25);
    if (one.overlay) this.#drawEstimate(traces, theme, xLow, yHigh, xScale, yScale);
    if (one.section) this.#drawSection(traces, theme, xLow, yHigh, xScale, yScale);
    context.drawImage(traces.canvas, place.left, place.top, traces.width, traces.height);
    if (one.x === "drive") this.#drawPhaseMark(one, place, theme);
    this.#drawLatest(one, place, points, theme);
    one.drawn = { xLow, xHigh, yLow, yHigh, width: place.width, height: place.height };
  }

  #place(one, theme) {
    const { small } = theme;
    const left = Math.round(small * 3.6);
    const bottom = Math.round(small * 2.7);
    return { left, top: 4, width: Math.max(20, Math.floor(one.width - left - 4)), height: Math.max(20, Math.floor(one.height - bottom - 4)) };
  }

  #drawAxes(one, place, theme) {
    const { context } = one;
    const { colours, small, font } = theme;
    context.font = font;
    context.lineWidth = 1;
    const { left, top, width, height } = place;
    const axis = (limits, length, most, draw) => {
      if (!limits.known) return;
      const range = limits.high - limits.low;
      const step = limits.high === 360 && limits.low === 0 ? 90 : roundStep(range, most);
      eachTick(limits.low, limits.high, step, (value) => draw(((value - limits.low) / range) * length, value, tick(value, step)));
    };
    context.fillStyle = colours.quiet;
    context.textAlign = "center";
    context.textBaseline = "top";
    const line = (value, x0, y0, x1, y1) => {
      context.strokeStyle = Math.abs(value) < 1e-12 ? colours["strong-line"] : colours.line;
      context.beginPath();
      context.moveTo(x0, y0);
      context.lineTo(x1, y1);
      context.stroke();
    };
    axis(one.xLimits, width, Math.max(2, Math.floor(width / (small * 4.5))), (at, value, label) => {
      const x = Math.round(left + at) + 0.5;
      line(value, x, top, x, top + height);
      const half = context.measureText(label).width / 2;
      context.fillText(label, Math.min(x, one.width - half), top + height + 3);
    });
    context.textAlign = "right";
    context.textBaseline = "middle";
    axis(one.yLimits, height, Math.max(2, Math.floor(height / (small * 3))), (at, value, label) => {
      const y = Math.round(top + height - at) + 0.5;
      line(value, left, y, left + width, y);
      context.fillText(label, left - 4, Math.max(y, small * 0.6));
    });
    context.strokeStyle = colours["strong-line"];
    context.strokeRect(left + 0.5, top + 0.5, width - 1, height - 1);
    context.fillStyle = colours.ink;
    context.textBaseline = "bottom";
    context.fillText(this.#unit(one.x).label, left + width, one.height);
    context.textAlign = "left";
    context.fillText(`↑ ${this.#unit(one.y).label}`, 0, one.height);
  }

  // The observer's theta mu against its slip velocity, as dots.
  #drawEstimate(traces, theme, xLow, yHigh, xScale, yScale) {
    const { estimates } = this.app.store;
    const { columns, mask } = estimates;
    const factor = this.app.units.factor("velocity");
    const { left_ns: left, right_ns: right } = this.app.seen(this.span_s);
    const from = estimates.rowAt(left);
    const to = estimates.rowAt(right + 1, from);
    const stride = Math.max(1, Math.ceil((to - from) / maxOverlay));
    let dots = 0;
    for (let row = from; row < to; row += stride) {
      const at = row & mask;
      const y = this.hasLoad ? columns.theta[at] * columns.mu[at] : columns.friction_force_n[at];
      const x = columns.slip_velocity_m_s[at] * factor;
      if (!(x === x && y === y)) continue;
      this.overlay[2 * dots] = (x - xLow) * xScale;
      this.overlay[2 * dots + 1] = (yHigh - y) * yScale;
      dots += 1;
    }
    this.estimateDots = dots;
    traces.dots(this.overlay, dots, theme.colours.c1, theme.large ? 3 : 2, 0.3);
  }

  #drawSection(traces, theme, xLow, yHigh, xScale, yScale) {
    const { section } = this;
    const xFactor = this.app.units.factor("length");
    const vFactor = this.app.units.factor("velocity");
    let dots = 0;
    for (let i = section.begin; i < section.end && dots < maxOverlay; ++i) {
      const at = i % section.time.length;
      this.overlay[2 * dots] = (section.x[at] * xFactor - xLow) * xScale;
      this.overlay[2 * dots + 1] = (yHigh - section.v[at] * vFactor) * yScale;
      dots += 1;
    }
    // A rim in the background colour separates dots from lines.
    traces.dots(this.overlay, dots, theme.colours.panel, theme.large ? 8 : 6);
    traces.dots(this.overlay, dots, theme.colours.c1, theme.large ? 6 : 4);
  }

  #drawPhaseMark(one, place, theme) {
    const { context } = one;
    const x = place.left + (this.phase_deg / 360) * place.width;
    context.strokeStyle = theme.colours.c1;
    context.setLineDash([4, 3]);
    context.beginPath();
    context.moveTo(x, place.top);
    context.lineTo(x, place.top + place.height);
    context.stroke();
    context.setLineDash([]);
  }

  // The current state of the rig.
  #drawLatest(one, place, points, theme) {
    const at = 2 * (points - 1);
    if (points === 0 || this.points[at] < -1e8) return;
    const { context } = one;
    context.fillStyle = theme.colours.ink;
    context.strokeStyle = theme.colours.panel;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(place.left + this.points[at], place.top + this.points[at + 1], theme.large ? 5 : 3.5, 0, 2 * Math.PI);
    context.stroke();
    context.fill();
  }

  #describe(one, points) {
    const { low, high } = one.yLimits;
    const range = one.yLimits.known ? `${number(low, 3)} to ${number(high, 3)}` : "–";
    let text = one.name === "friction-velocity" ? `load cell over load; dots: observer, θμ` : one.name === "phase"
      ? `${count(this.section.count)} passages of ${this.phase_deg}°` : one.name === "cylinder" ? "dashed: phase of the section"
      : one.name === "friction-displacement" ? "load cell over load" : "sum of both pads";
    if (!this.hasLoad && one.y === "ratio") text = one.overlay ? "no load measured: force; dots: observer" : "no load measured: force";
    if (one.unloaded > 0) text += `; not drawn where N < 5 % of its largest`;
    if (points === 0) text = one.x === "drive" ? "the drive's phase has not come" : "";
    setText(one.note, text);
    const label = `${one.figure.querySelector("h3").textContent}: ${this.#unit(one.y).label} from ${range}, ${this.app.paused ? "the window that is seen" : `last ${this.span_s} s`}`;
    if (one.canvas.getAttribute("aria-label") !== label) one.canvas.setAttribute("aria-label", label);
  }
}
