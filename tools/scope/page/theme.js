// SPDX-License-Identifier: Apache-2.0
// Light and dark, text size, and the colours of the style sheet for canvases.

const names = ["ink", "quiet", "line", "strong-line", "panel", "accent", "band", "mark", "good", "bad", "bad-ground",
  "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"];
const order = ["auto", "light", "dark"];

export class Theme {
  constructor(settings) {
    this.settings = settings;
    this.choice = order.includes(settings.get("theme")) ? settings.get("theme") : "auto";
    this.large = settings.get("large") === true;
    this.colours = {};
    this.listeners = [];
    this.dark = window.matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.apply());
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.apply();
  }

  // True if the user prefers reduced motion.
  get calmed() { return this.calm.matches; }

  onChange(listener) { this.listeners.push(listener); }

  next() {
    this.choice = order[(order.indexOf(this.choice) + 1) % order.length];
    this.settings.set("theme", this.choice);
    this.apply();
  }

  toggleLarge() {
    this.large = !this.large;
    this.settings.set("large", this.large);
    this.apply();
  }

  apply() {
    const root = document.documentElement;
    root.dataset.theme = this.choice === "auto" ? (this.dark.matches ? "dark" : "light") : this.choice;
    root.dataset.large = this.large ? "yes" : "no";
    const style = getComputedStyle(root);
    for (const name of names) this.colours[name] = style.getPropertyValue(`--${name}`).trim();
    this.channel = names.filter((name) => /^c\d$/.test(name)).map((name) => this.colours[name]);
    const size = parseFloat(style.fontSize) || 16;
    this.rem = size;
    this.small = Math.round(size * 0.75);
    const family = style.getPropertyValue("--text").trim() || "sans-serif";
    this.font = `${this.small}px ${family}`;
    this.bold = `600 ${this.small}px ${family}`;
    for (const listener of this.listeners) listener(this);
  }
}

// Settings stored in this browser, if storage is allowed.
export class Settings {
  #values = {};

  constructor() {
    try {
      this.#values = JSON.parse(window.localStorage.getItem("stickslip-scope") ?? "{}") ?? {};
    } catch {
      this.#values = {};
    }
  }

  get(name) { return this.#values[name]; }

  set(name, value) {
    this.#values[name] = value;
    try {
      window.localStorage.setItem("stickslip-scope", JSON.stringify(this.#values));
    } catch {
      // Not available in private windows; the setting then lasts as long as the page.
    }
  }
}
