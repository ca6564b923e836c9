// SPDX-License-Identifier: Apache-2.0
// Limits of channels: a crossing marks the lane, is an event of the page's own, and beeps if that is wanted.

import { Beeper } from "./beeper.js";
import { byId, fillSelect, setText, tableRow } from "./elements.js";
import { number, withUnit } from "./units.js";

const again_ns = 0.2e9; // a crossing counts anew after so long within the limits
const none = { low: NaN, high: NaN };

export class Alarms {
  // kept: limits by channel, in SI units.
  constructor(app, lanes, kept) {
    this.app = app;
    this.lanes = lanes;
    this.beeper = new Beeper(byId("alarm-sound"));
    this.pair = new Float64Array(2);
    for (const lane of lanes) {
      const [low, high] = kept.get(lane.index) ?? [NaN, NaN];
      lane.bounds = { low, high }; // NaN: none
      this.#buildRow(lane);
    }
    this.clear();
    this.show();
  }

  #buildRow(lane) {
    lane.boundsRow = tableRow(lane.channel.name, 3);
    lane.boundsFields = ["low", "high"].map((side, i) => {
      const field = document.createElement("input");
      Object.assign(field, { type: "number", step: "any", inputMode: "decimal" });
      field.setAttribute("aria-label", `${lane.channel.name}: ${side} limit`);
      field.addEventListener("change", () => this.#read(lane));
      lane.boundsRow.cells[i + 1].append(field);
      return field;
    });
    lane.hostField = document.createElement("select");
    lane.hostField.setAttribute("aria-label", `${lane.channel.name}: lane`);
    lane.hostField.addEventListener("change", () => this.app.scope.overlay(lane, Number(lane.hostField.value)));
    lane.boundsRow.cells[3].append(lane.hostField);
    byId("channel-settings").tBodies[0].append(lane.boundsRow);
  }

  #read(lane) {
    const [low, high] = lane.boundsFields.map((field) => (field.value === "" ? NaN : Number(field.value) / this.#factor(lane)));
    for (const field of lane.boundsFields) field.setAttribute("aria-invalid", low >= high ? "true" : "false");
    this.set(lane, low >= high ? none : { low, high });
  }

  #factor(lane) { return this.app.units.factor(lane.channel.quantity); }

  set(lane, bounds) {
    lane.bounds = { ...bounds };
    lane.outside_ns = -Infinity;
    this.app.scope.keep();
    this.app.touch();
  }

  // Those that are set: index of the channel, low, high.
  list() {
    return this.lanes.filter(({ bounds: { low, high } }) => !Number.isNaN(low) || !Number.isNaN(high)).map(({ index, bounds: { low, high } }) => [index, low, high]);
  }

  // The fields, in the units in use.
  show() {
    for (const lane of this.lanes) {
      setText(lane.boundsRow.cells[0], withUnit(lane.channel.name, this.app.units.label(lane.channel.quantity)));
      fillSelect(lane.hostField, this.lanes.map((one) => [one.index, one === lane ? "its own" : `of ${one.channel.symbol}`]), lane.host);
      [lane.bounds.low, lane.bounds.high].forEach((value, i) => {
        lane.boundsFields[i].value = Number.isNaN(value) ? "" : String(Number((value * this.#factor(lane)).toPrecision(9)));
      });
    }
  }

  // The time begins anew.
  clear() {
    this.row = 0;
    for (const lane of this.lanes) lane.outside_ns = -Infinity;
  }

  // The limit that values cross, by the least and the greatest of them: "high", "low", or "" for none.
  static side({ low, high }, least, greatest) { return greatest > high ? "high" : least < low ? "low" : ""; }

  // Looks through the frames that came, those of a history without a sound.
  follow(frames, silent) {
    const from = Math.max(this.row, frames.begin);
    for (const lane of this.lanes) {
      if (Number.isNaN(lane.bounds.low) && Number.isNaN(lane.bounds.high)) continue;
      frames.extremes(lane.index, from, frames.end, this.pair);
      if (Alarms.side(lane.bounds, this.pair[0], this.pair[1]) !== "") this.#search(lane, frames, from, silent);
    }
    this.row = frames.end;
  }

  #search(lane, frames, from, silent) {
    const { mask, time } = frames;
    const data = frames.values[lane.index];
    for (let row = from; row < frames.end; ++row) {
      const value = data[row & mask];
      const side = Alarms.side(lane.bounds, value, value);
      if (side === "") continue;
      const time_ns = time[row & mask];
      if (time_ns - lane.outside_ns > again_ns || side !== lane.side) this.#sound(lane, side, frames, time_ns, silent);
      lane.outside_ns = time_ns;
      lane.side = side;
    }
  }

  #sound(lane, side, frames, time_ns, silent) {
    const unix_ms = Number.isNaN(frames.utc_ms) ? Date.now() + (time_ns - frames.last_ns) / 1e6 : frames.utc_ms + time_ns / 1e6;
    const message = `${lane.channel.name} ${this.words(lane, side)}`;
    this.app.rig.events.take({
      utc_us: Math.round(unix_ms * 1e3), time_ns: Number(frames.origin_ns) + time_ns, severity: 1, code: "limit_of_this_page", message, own: true,
    });
    if (silent) return;
    this.app.say(message);
    this.beeper.beep();
  }

  words(lane, side) {
    const unit = this.app.units.label(lane.channel.quantity);
    return `${side === "high" ? "above" : "below"} ${number(lane.bounds[side] * this.#factor(lane))}${unit === "" ? "" : ` ${unit}`}`;
  }

  // The limits as lines, and the lane as marked if what is seen of it crosses one.
  draw(axes, lane, scope) {
    const { colours } = this.app.theme;
    const { limits, top, height, bounds } = lane;
    axes.strokeStyle = colours.bad;
    axes.setLineDash([6, 4]);
    axes.beginPath();
    lane.boundsAt = [bounds.low, bounds.high].map((bound) => {
      const part = (bound * this.#factor(lane) - limits.low) / (limits.high - limits.low);
      if (!(part >= 0 && part <= 1)) return null;
      const y = Math.round(top + height * (1 - part)) + 0.5;
      axes.moveTo(scope.gutter, y);
      axes.lineTo(scope.gutter + scope.plotWidth, y);
      return y;
    });
    axes.stroke();
    axes.setLineDash([]);
    if (lane.alarm === "") return;
    axes.fillStyle = colours.bad;
    axes.fillRect(scope.gutter, lane.edge, 4, height + scope.titleHeight);
  }
}
