// SPDX-License-Identifier: Apache-2.0
// The recording: its file, its length, and the time that is left on its disk.

import { Facts, byId } from "./elements.js";
import { number } from "./units.js";

// Less time than this is a warning: enough to free space or to end a run in order.
const soon_s = 600;

// "12:31", "3:05:20"; days where they are many.
export function clockTime(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor((whole % 3600) / 60), whole % 60];
  if (hours >= 72) return `${Math.floor(hours / 24)} days`;
  const two = (value) => String(value).padStart(2, "0");
  return hours > 0 ? `${hours}:${two(minutes)}:${two(rest)}` : `${minutes}:${two(rest)}`;
}

// In powers of 1000, as disks are sold.
export function byteSize(bytes) {
  let value = bytes;
  for (const unit of ["B", "kB", "MB", "GB"]) {
    if (value < 1000) return `${number(value, 3)} ${unit}`;
    value /= 1000;
  }
  return `${number(value, 3)} TB`;
}

export class RecordingState {
  #facts = new Facts(byId("recording"));
  #latest = null;

  // A message of the recorder.
  take(message) {
    this.#latest = message;
    this.#facts.set("file", message.file.split("/").pop());
    this.#facts.set("length", clockTime(message.length_us / 1e6));
    this.#facts.set("size", byteSize(message.bytes));
    this.#facts.set("left on its disk", this.#left(), this.endsSoon ? "warn" : "");
    byId("recording").title = message.file;
  }

  clear() {
    this.#latest = null;
    for (const name of ["file", "length", "size", "left on its disk"]) this.#facts.set(name, "–");
  }

  // Time that the disk lasts at the pace so far [s]; NaN: unknown.
  get left_s() {
    const { free_bytes: free, bytes, length_us: length } = this.#latest ?? {};
    return free >= 0 && bytes > 0 && length > 1e6 ? (free / bytes) * (length / 1e6) : NaN;
  }

  get endsSoon() { return this.left_s < soon_s; }

  // Of the chip, behind "recording": the length, and the time that is left once it is short.
  get summary() {
    if (!this.#latest) return "";
    const length = ` ${clockTime(this.#latest.length_us / 1e6)}`;
    return this.endsSoon ? `${length}, ${clockTime(this.left_s)} left` : length;
  }

  #left() {
    if (!(this.#latest.free_bytes >= 0)) return "unknown";
    const space = byteSize(this.#latest.free_bytes);
    return Number.isFinite(this.left_s) ? `${clockTime(this.left_s)} (${space})` : space;
  }
}
