// SPDX-License-Identifier: Apache-2.0
// The strip beside a frozen picture: one channel as it goes on.

import { Limits, fitCanvas } from "./axes.js";
import { byId, setText } from "./elements.js";
import { lasting, number } from "./units.js";

const span_ns = 10e9;

export class Beside {
  constructor(app) {
    this.app = app;
    this.element = byId("beside");
    this.canvas = this.element.querySelector("canvas");
    this.context = this.canvas.getContext("2d");
    this.limits = new Limits();
    this.pair = new Float64Array(2);
    this.columns = 0; // with data, in the latest drawing
    byId("beside-go").addEventListener("click", () => app.pause(false));
  }

  // The trigger's channel, or the first that is shown.
  #lane() {
    const { lanes, trigger } = this.app.scope;
    return lanes[trigger.channel].visible ? lanes[trigger.channel] : lanes.find((lane) => lane.visible);
  }

  draw(now_ms) {
    const { paused, live, replay } = this.app;
    this.element.hidden = !paused || replay.active;
    const lane = paused && !replay.active ? this.#lane() : undefined;
    if (!lane || live.frames.empty) return;
    if (lane !== this.lane) this.limits.reset();
    this.lane = lane;
    this.#drawTrace(live.frames, lane, now_ms);
    const { units } = this.app;
    const last = live.frames.values[lane.index][(live.frames.end - 1) & live.frames.mask];
    const unit = units.label(lane.channel.quantity);
    setText(byId("beside-text"), `Live: ${lane.channel.name.toLowerCase()} ${number(last * units.factor(lane.channel.quantity))} ${unit}, last 10 s; frozen for ${lasting((performance.now() - this.app.paused_ms) / 1e3)}`);
  }

  #drawTrace(frames, lane, now_ms) {
    const { canvas, context, limits, pair } = this;
    const { theme } = this.app;
    const { width, height } = canvas.getBoundingClientRect();
    fitCanvas(canvas, context, width, height, Math.min(3, window.devicePixelRatio || 1));
    context.clearRect(0, 0, width, height);
    const left_ns = frames.last_ns - span_ns;
    let row = frames.rowAt(left_ns);
    frames.extremes(lane.index, row, frames.end, pair);
    limits.follow(pair[0], pair[1], now_ms);
    this.columns = 0;
    if (!limits.known) return;
    const y = (value) => height * (1 - (value - limits.low) / (limits.high - limits.low));
    context.fillStyle = theme.channel[lane.index];
    for (let x = 0; x < width; ++x) {
      const next = frames.rowAt(left_ns + ((x + 1) * span_ns) / width, row);
      frames.extremes(lane.index, row, next, pair);
      row = next;
      if (!(pair[0] <= pair[1])) continue;
      this.columns += 1;
      context.fillRect(x, y(pair[1]), 1.3, Math.max(1.3, y(pair[0]) - y(pair[1])));
    }
  }
}
