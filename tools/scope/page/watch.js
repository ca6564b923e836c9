// SPDX-License-Identifier: Apache-2.0
// Whether what the page shows is of now, by the page's own clock: a server that hangs and a link that is half
// open say nothing themselves.

const quiet_ms = 1000; // without frames and heartbeat: what is shown is old
const dead_ms = 5000; // and the connection is given up
const longestTick_ms = 300; // a page that was suspended itself does not blame the server

export class Watch {
  constructor() {
    this.quiet_ms = 0;
    this.heard_unix_ms = NaN; // time of the latest message
    this.alive = null; // the latest heartbeat
    this.alive_ms = 0; // its age
    this.ticked_ms = NaN;
  }

  // A message has come; `alive` if it is a heartbeat.
  heard(alive = null) {
    this.quiet_ms = 0;
    this.heard_unix_ms = Date.now();
    if (alive === null) return;
    this.alive = alive;
    this.alive_ms = 0;
  }

  // The rig sends frames again, or has ceased to.
  source(connected, silent_s) {
    if (this.alive === null) return; // a heartbeat ends the greeting
    this.alive = { ...this.alive, connected, silent_s, status_s: add(this.alive.status_s, this.alive_ms / 1e3) };
    this.alive_ms = 0;
  }

  // A status has come as it was sent.
  status() {
    if (this.alive !== null) this.alive = { ...this.alive, status_s: -this.alive_ms / 1e3 };
  }

  connecting() {
    this.quiet_ms = 0;
    this.alive = null;
  }

  // To be called several times a second.
  tick(now_ms) {
    const passed = Math.min(longestTick_ms, now_ms - this.ticked_ms || 0);
    this.ticked_ms = now_ms;
    this.quiet_ms += passed;
    this.alive_ms += passed;
  }

  get linkQuiet() { return this.quiet_ms >= quiet_ms; }
  get linkDead() { return this.quiet_ms >= dead_ms; }
  // Seconds since the rig's latest frame; NaN if unknown.
  get silent_s() { return this.alive === null ? NaN : add(this.alive.silent_s, this.alive_ms / 1e3); }
  get rigSilent() { return this.alive !== null && !this.alive.connected; }

  // The status describes the rig of now: frames come, or it is younger than the silence.
  get statusHolds() {
    if (this.alive === null || this.linkQuiet) return false;
    const age_s = add(this.alive.status_s, this.alive_ms / 1e3);
    return this.alive.connected || (age_s < 1.5 && age_s < this.silent_s - 0.5);
  }
}

function add(seconds, more) { return typeof seconds === "number" ? seconds + more : NaN; }
