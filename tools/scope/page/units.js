// SPDX-License-Identifier: Apache-2.0
// The channels of a frame in their order on the wire, then those that the page derives, and their display
// units. The `id` is that in addresses.

export const channels = [
  { key: "displacement", id: "x", name: "Displacement", symbol: "x", quantity: "length" },
  { key: "velocity", id: "v", name: "Velocity", symbol: "v", quantity: "velocity" },
  { key: "friction_force", id: "F", name: "Friction force", symbol: "F", quantity: "force" },
  { key: "normal_load", id: "N", name: "Normal load", symbol: "N", quantity: "force" },
  { key: "base_displacement", id: "b", name: "Base displacement", symbol: "b", quantity: "length" },
  { key: "drive_force", id: "D", name: "Drive force", symbol: "D", quantity: "force" },
  { key: "coefficient", id: "mu", name: "Friction coefficient", symbol: "μ", quantity: "ratio" },
  { key: "power", id: "P", name: "Power of friction", symbol: "P", quantity: "power" },
  { key: "expression", id: "e", name: "Expression", symbol: "=", quantity: "ratio" },
];
export const measuredCount = 6; // the first ones; see derived.js for the others

export const systems = {
  mm: { length: ["mm", 1e3], velocity: ["mm/s", 1e3], force: ["N", 1], power: ["mW", 1e3] },
  m: { length: ["m", 1], velocity: ["m/s", 1], force: ["N", 1], power: ["W", 1] },
};

// Shown value = value in SI units * factor(quantity).
export class Units {
  #system = "mm";

  get system() { return this.#system; }
  set system(name) { if (name in systems) this.#system = name; }
  toggle() { this.#system = this.#system === "mm" ? "m" : "mm"; }
  label(quantity) { return (systems[this.#system][quantity] ?? [quantity === "ratio" ? "" : quantity])[0]; }
  factor(quantity) { return (systems[this.#system][quantity] ?? ["", 1])[1]; }
}

// A name with its unit, if it has one.
export function withUnit(name, unit) { return unit === "" ? name : `${name} (${unit})`; }

const dash = "–";
const minus = "\u2212";

// A number with this many significant digits, at least all before the point; a dash for none.
export function number(value, digits = 4) {
  if (!Number.isFinite(value)) return dash;
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return value.toExponential(Math.max(0, digits - 2)).replace(/-/g, minus);
  const whole = size === 0 ? 1 : Math.floor(Math.log10(size)) + 1;
  return value.toFixed(Math.max(0, digits - whole)).replace("-", minus);
}

// Decimals for numbers up to this size: four digits of the largest.
export function decimalsFor(largest) {
  return largest > 0 && largest < Infinity ? Math.min(9, Math.max(0, 3 - Math.floor(Math.log10(largest)))) : 3;
}

// A number with that many decimals; a dash for none.
export function fixed(value, decimals) {
  return Number.isFinite(value) ? value.toFixed(decimals).replace(/^-(?=0\.?0*$)/, "").replace("-", minus) : dash;
}

// A number with the decimals that the step of an axis needs.
export function tick(value, step) {
  if (Math.abs(value) < step * 1e-6) return "0";
  if (step < 1e-5 || step >= 1e6) return value.toExponential(1).replace(/-/g, minus);
  return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))).replace("-", minus);
}

// Time of day, UTC.
export function clockTime(unix_ms) { return `${new Date(unix_ms).toISOString().slice(11, 19)} UTC`; }

// Time of day, UTC, of a time [s since 1970] with the decimals that a step [s] needs.
export function clockTick(unix_s, step) {
  const digits = Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9)));
  const whole = Math.floor(unix_s + 0.5 * 10 ** -digits);
  const part = Math.max(0, unix_s - whole).toFixed(digits).slice(1);
  return new Date(whole * 1e3).toISOString().slice(11, 19) + part;
}

// A duration [s] that is counted up.
export function lasting(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 120) return `${whole} s`;
  if (whole < 7200) return `${Math.floor(whole / 60)} min`;
  return `${Math.floor(whole / 3600)} h`;
}

// A whole number in groups of three.
export function count(value) {
  return Number.isFinite(value) ? String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, "\u202f").replace("-", minus) : dash;
}

// A duration [s] in the unit that fits it.
export function duration(seconds, digits = 3) {
  if (!Number.isFinite(seconds)) return dash;
  const size = Math.abs(seconds);
  if (size >= 1 || size === 0) return `${number(seconds, digits)} s`;
  if (size >= 1e-3) return `${number(seconds * 1e3, digits)} ms`;
  return `${number(seconds * 1e6, digits)} µs`;
}
