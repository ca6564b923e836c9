// SPDX-License-Identifier: Apache-2.0
// The window that is seen as a file: frames as CSV, which the tools read, or its picture.

import { byId, setText } from "./elements.js";
import { fixed, measuredCount } from "./units.js";

// In SI units. Readers of recordings leave out those that begin with derived_.
const columns = [
  "displacement_m", "velocity_m_s", "friction_force_n", "normal_load_n", "base_displacement_m", "drive_force_n",
  "derived_coefficient", "derived_power_w", "derived_expression",
];

// A time [ns] in seconds, exactly.
function seconds(time_ns) {
  const sign = time_ns < 0n ? "-" : "";
  const digits = String(time_ns < 0n ? -time_ns : time_ns).padStart(10, "0");
  return `${sign}${digits.slice(0, -9)}.${digits.slice(-9)}`;
}

function cell(value) {
  return Number.isNaN(value) ? "" : Object.is(value, -0) ? "-0" : String(value);
}

export class Export {
  constructor(app) {
    this.app = app;
    byId("export-csv").addEventListener("click", () => this.csv());
    byId("export-png").addEventListener("click", () => this.png());
  }

  // One line, for comments and the foot of the picture.
  #title() {
    return `${byId("rig-name").textContent}, exported by stickslip scope at ${new Date().toISOString()}`.replace(/\s+/g, " ");
  }

  // Both cursors with the values of the channels seen; empty without cursors.
  #cursors() {
    const { scope, store, units } = this.app;
    if (!scope.cursorsOn || store.frames.empty) return [];
    return ["A", "B"].map((name, i) => {
      const at_ns = scope.cursorTime_ns(i);
      const values = scope.shownLanes().map(({ index, channel, decimals }) =>
        `${channel.symbol} ${fixed(store.frames.valueAt(index, at_ns) * units.factor(channel.quantity), Math.min(9, decimals + 1))} ${units.label(channel.quantity)}`);
      return `cursor ${name}: ${seconds(store.frames.origin_ns + BigInt(Math.round(at_ns)))} s; ${values.join(", ")}`;
    });
  }

  csv() {
    const { scope, store: { frames } } = this.app;
    const from = frames.rowAt(scope.left_ns);
    const to = frames.rowAt(scope.left_ns + scope.span_ns + 1, from);
    if (from === to) { this.app.say("There is nothing to export."); return; }
    const shown = scope.shownLanes().map(({ index }) => index);
    const measured = columns.map((name, channel) => ({ name, channel, data: frames.values[channel] }))
      .filter(({ channel }) => channel < measuredCount || shown.includes(channel))
      .filter(({ data }) => { for (let row = from; row < to; ++row) if (!Number.isNaN(data[row & frames.mask])) return true; return false; });
    const expression = measured.some(({ name }) => name === "derived_expression") ? [`derived_expression = ${scope.expression.text}`] : [];
    const lines = [this.#title(), ...this.#cursors(), ...expression].map((line) => `# ${line}`);
    lines.push(["time_s", ...measured.map(({ name }) => name)].join(","));
    for (let row = from; row < to; ++row) {
      lines.push([seconds(frames.deviceTime(row)), ...measured.map(({ data }) => cell(data[row & frames.mask]))].join(","));
    }
    this.#save(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), "csv");
  }

  png() {
    const { scope, theme: { colours, font, small } } = this.app;
    scope.draw(performance.now()); // what WebGL has drawn can be read in this task only
    const feet = [this.#title(), ...this.#cursors()];
    const { ratio, width, height } = scope;
    const canvas = document.createElement("canvas");
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round((height + feet.length * small * 1.5 + small) * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.fillStyle = colours.panel;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(scope.axesCanvas, 0, 0, width, height);
    context.drawImage(scope.traces.canvas, 0, 0, width, height);
    context.font = font;
    context.fillStyle = context.strokeStyle = colours.ink;
    if (scope.cursorsOn) this.#drawCursors(context, scope, small);
    context.textAlign = "left";
    context.textBaseline = "top";
    feet.forEach((line, i) => context.fillText(line, small / 2, height + small / 2 + i * small * 1.5, width - small));
    canvas.toBlob((blob) => this.#save(blob, "png"), "image/png");
  }

  #drawCursors(context, scope, small) {
    scope.cursors.forEach(({ part }, i) => {
      const x = Math.round(scope.gutter + part * scope.plotWidth) + 0.5;
      context.setLineDash(i === 0 ? [] : [4, 3]);
      context.beginPath();
      context.moveTo(x, 0);
      context.lineTo(x, scope.plotHeight);
      context.stroke();
      context.fillText("AB"[i], x + 3, scope.plotHeight - small / 2);
    });
    context.setLineDash([]);
  }

  #save(blob, ending) {
    const link = document.createElement("a");
    const rig = byId("rig-name").textContent.replace(/[^A-Za-z0-9]+/g, "-").replace(/^-|-$/g, "") || "rig";
    link.download = `${rig}-${new Date().toISOString().slice(0, 19).replace(/[-:]/g, "")}Z.${ending}`;
    link.href = URL.createObjectURL(blob);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    setText(byId("spoken"), `Exported ${link.download}.`);
  }
}
