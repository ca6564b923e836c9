// SPDX-License-Identifier: Apache-2.0
// The Poincaré section: displacement and velocity whenever the drive passes a phase, in device time.

const turn = 2 * Math.PI;
const most = 4096;

function since(origin_rad, phase_rad) {
  const phase = phase_rad - origin_rad;
  return phase < 0 ? phase + turn : phase;
}

export class Section {
  constructor() {
    this.phase_rad = 0;
    this.time = new Float64Array(most);
    this.x = new Float64Array(most);
    this.v = new Float64Array(most);
    this.clear();
  }

  // Restarts with all rows of the rings.
  clear() {
    this.begin = 0;
    this.end = 0;
    this.row = 0;
  }

  setPhase(phase_rad) {
    this.phase_rad = phase_rad;
    this.clear();
  }

  // Adds new rows, as far as both frames and drive are known.
  follow(store) {
    const { excitation, frames } = store;
    const { time, mask } = excitation;
    const phase = excitation.columns.phase_rad;
    if (this.row > excitation.end) this.clear();
    let row = Math.max(this.row, excitation.begin + 1);
    for (; row < excitation.end && time[row & mask] <= frames.last_ns; ++row) {
      // Phases relative to the section, so that a frame exactly on it belongs to one passage only.
      const before = since(this.phase_rad, phase[(row - 1) & mask]);
      const now = since(this.phase_rad, phase[row & mask]);
      const advance = now + turn - before;
      // More than a third of a turn between two frames is a gap or a phase jump, not a passage.
      if (!(now < before && advance < turn / 3)) continue;
      const from = time[(row - 1) & mask];
      this.#add(from + (time[row & mask] - from) * ((turn - before) / advance), frames);
    }
    this.row = Math.max(this.row, row);
    while (this.begin < this.end && this.time[this.begin % most] < frames.first_ns) this.begin += 1;
  }

  #add(time_ns, frames) {
    const x = frames.valueAt(0, time_ns);
    const v = frames.valueAt(1, time_ns);
    if (!(x === x && v === v)) return;
    if (this.end - this.begin === most) this.begin += 1;
    const at = this.end % most;
    this.time[at] = time_ns;
    this.x[at] = x;
    this.v[at] = v;
    this.end += 1;
  }

  get count() { return this.end - this.begin; }
}
