// SPDX-License-Identifier: Apache-2.0
// A short tone. Browsers allow it only after an action of the user, who switches it on for each visit.

const apart_ms = 500; // at least

export class Beeper {
  #context = null;

  constructor(box) {
    this.beeps = 0;
    this.last_ms = -Infinity;
    box.checked = false;
    box.addEventListener("change", () => {
      if (box.checked) this.#start();
      else this.#context?.suspend();
      this.on = box.checked;
    });
  }

  #start() {
    this.#context ??= new window.AudioContext();
    this.#context.resume();
  }

  beep() {
    const now_ms = performance.now();
    if (!this.on || now_ms - this.last_ms < apart_ms) return;
    this.last_ms = now_ms;
    this.beeps += 1;
    const context = this.#context;
    const tone = context.createOscillator();
    const volume = context.createGain();
    const now_s = context.currentTime;
    tone.frequency.value = 880;
    // Without a click at either end.
    volume.gain.setValueAtTime(0, now_s);
    volume.gain.linearRampToValueAtTime(0.2, now_s + 0.01);
    volume.gain.setValueAtTime(0.2, now_s + 0.15);
    volume.gain.linearRampToValueAtTime(0, now_s + 0.18);
    tone.connect(volume).connect(context.destination);
    tone.start(now_s);
    tone.stop(now_s + 0.2);
  }
}
