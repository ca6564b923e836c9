// SPDX-License-Identifier: Apache-2.0
// The readout under the pointer: time and value of every lane at that place of the traces.

import { byId, setText, tableRow } from "./elements.js";

export class Hover {
  constructor(scope) {
    this.scope = scope;
    this.element = byId("hover");
    this.caption = this.element.querySelector("caption");
    this.part = NaN; // of the plot's width; NaN: the pointer is elsewhere
    this.rows = scope.lanes.map(({ index, channel }) => {
      const row = tableRow(channel.symbol, 1);
      row.insertCell();
      row.cells[0].style.setProperty("--colour", `var(--c${index})`);
      return row;
    });
    this.element.querySelector("tbody").append(...this.rows);
    this.#listen(scope.screen);
  }

  #listen(screen) {
    for (const name of ["pointermove", "pointerdown"]) screen.addEventListener(name, (event) => this.#moveTo(event));
    // A finger that was lifted leaves the readout, which it covered; one that scrolls the page removes it.
    screen.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") this.#hide(); });
    screen.addEventListener("pointercancel", () => this.#hide());
    document.addEventListener("pointerdown", (event) => { if (!screen.contains(event.target)) this.#hide(); });
  }

  #moveTo(event) {
    const part = this.scope.partOf(event);
    this.part = part >= 0 && part <= 1 ? part : NaN;
    this.scope.app.touch();
  }

  #hide() {
    this.part = NaN;
    this.scope.app.touch();
  }

  get time_ns() { return this.scope.left_ns + this.part * this.scope.span_ns; }

  // With each picture: the traces move under a pointer that rests.
  draw(frames) {
    const { element, scope } = this;
    const hidden = Number.isNaN(this.part) || frames.empty;
    if (element.hidden !== hidden) element.hidden = hidden;
    if (hidden) return;
    const x = `${scope.gutter + this.part * scope.plotWidth}px`;
    if (element.style.left !== x) element.style.left = x;
    element.dataset.side = this.part > 0.5 ? "left" : "right";
    setText(this.caption, `${scope.timeText(frames, this.time_ns)} ${scope.timeUnit(frames)}`);
    for (const lane of scope.lanes) this.#write(lane, frames);
  }

  #write(lane, frames) {
    const row = this.rows[lane.index];
    if (row.hidden === lane.visible) row.hidden = !lane.visible;
    if (!lane.visible) return;
    setText(row.cells[1], this.scope.valueText(lane, this.#valueAt(lane, frames)));
    setText(row.cells[2], this.scope.app.units.label(lane.channel.quantity));
  }

  // On the line that is drawn: none where frames were lost.
  #valueAt(lane, frames) {
    const row = frames.rowAt(this.time_ns);
    if (row > frames.begin && row < frames.end && frames.broken(row - 1, row) && frames.time[row & frames.mask] !== this.time_ns) return NaN;
    return frames.valueAt(lane.index, this.time_ns);
  }
}
