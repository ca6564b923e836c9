// SPDX-License-Identifier: Apache-2.0
// The page of `stickslip scope`: connects its parts and draws once per screen frame.

import { Beside } from "./beside.js";
import { byId, fillSelect, setPressed, setState, setText } from "./elements.js";
import { Estimates } from "./estimates.js";
import { Export } from "./export.js";
import { listenToKeys } from "./keyboard.js";
import { Notes } from "./notes.js";
import { Oscilloscope } from "./oscilloscope.js";
import { Portraits } from "./portraits.js";
import { Replay } from "./replay.js";
import { RigState } from "./rig_state.js";
import { Spectrum } from "./spectrum.js";
import { Store } from "./store.js";
import { Stream } from "./stream.js";
import { expose } from "./inspection.js";
import { Pace, Turn } from "./pace.js";
import { Settings, Theme } from "./theme.js";
import { Units, clockTime, lasting } from "./units.js";
import { Watch } from "./watch.js";

const readingsEvery_ms = 250;
const watchEvery_ms = 100;
const spectrumEvery_ms = 300;

class App {
  constructor() {
    this.settings = new Settings();
    this.theme = new Theme(this.settings);
    this.units = new Units();
    this.units.system = this.settings.get("units");
    this.clock = this.settings.get("clock") === "utc" ? "utc" : "device";
    this.live = new Store();
    this.frozen = null; // made when a person first pauses
    this.paused = false;
    this.frozenAt = null; // time of the fault that the frozen picture shows
    this.restarted = false; // since the pause
    this.pace = new Pace();
    this.portraitTurn = new Turn();
    this.estimateTurn = new Turn();
    this.changed = true;
    this.link = { state: "connecting" };
    this.watch = new Watch();
    this.fresh = false; // what is shown of the rig is of now
    this.dropped = 0;
    this.driveIsForce = false;
    this.rig = new RigState(this);
    this.scope = new Oscilloscope(this);
    this.portraits = new Portraits(this);
    this.spectrum = new Spectrum(this);
    this.estimates = new Estimates(this);
    this.beside = new Beside(this);
    this.export = new Export(this);
    this.notes = new Notes(this);
    this.replay = new Replay(this);
    this.stream = new Stream({
      onFrames: (block) => {
        this.watch.heard();
        this.takeFrames(block);
      },
      onMessage: (message) => {
        this.watch.heard(message.type === "alive" ? message : null);
        this.takeMessage(message);
      },
      onLink: (link) => this.#takeLink(link),
    });
    this.#listen();
    listenToKeys(this);
    this.#showUnits();
    this.rig.events.retime();
    this.layout();
    this.theme.onChange(() => this.#restyle());
    expose(this);
  }

  // The data shown: live, or as it was when paused.
  get store() { return this.paused ? this.frozen : this.live; }

  // Rows of frames for the plots of a window: the latest `span_s`, or all; of a pause those that are seen.
  seen(span_s = Infinity) {
    const { frames } = this.store;
    const { left_ns: left, span_ns: span } = this.scope;
    const right_ns = this.paused ? Math.min(frames.last_ns, left + span) : frames.last_ns;
    const left_ns = this.paused ? left : frames.last_ns - span_s * 1e9;
    const from = frames.rowAt(left_ns);
    return { left_ns, right_ns, from, to: frames.rowAt(right_ns + 1, from) };
  }

  // Requests a redraw.
  touch() { this.changed = true; }

  say(text) { setText(byId("spoken"), text); }

  start() {
    this.stream.connect();
    setInterval(() => this.#watch(), watchEvery_ms);
    requestAnimationFrame((now) => this.#frame(now));
  }

  // --- incoming messages ---------------------------------------------------------------------------

  #takeLink(link) {
    this.link = { ...link, since_ms: performance.now() };
    if (link.state === "open") this.watch.connecting();
    this.#watch();
  }

  // Greys what is no longer known, and gives up a dead connection.
  #watch() {
    this.watch.tick(performance.now());
    const open = this.link.state === "open";
    if (open && this.watch.linkDead) this.stream.abandon("no answer");
    this.fresh = this.link.state === "open" && this.watch.statusHolds;
    this.rig.setFresh(this.fresh);
    const moving = this.link.state === "open" && !this.watch.linkQuiet && !this.watch.rigSilent;
    document.body.dataset.moving = moving ? "yes" : "no";
    this.#showLink();
  }

  takeFrames(block) {
    const restarted = this.live.addFrames(block);
    if (restarted) this.#restart();
    this.scope.alarms.follow(this.live.frames, (block.flags & 2) !== 0);
    if ((block.flags & 2) === 0 && !this.replay.active) this.pace.arrived(block.received_unix_ms);
    this.degraded = (block.flags & 1) !== 0;
    if (!this.paused) this.changed = true;
  }

  takeMessage(message) {
    switch (message.type) {
      case "alive":
        break;
      case "sources":
        this.#showSources(message);
        break;
      case "hello":
        this.hello = message;
        this.notes.allow(message.notes === true);
        if (message.recording === true) this.replay.open();
        break;
      case "note":
        this.notes.take(message);
        break;
      case "model":
        this.rig.take(message);
        this.spectrum.setMarks(Array.isArray(message.marks) ? message.marks : []);
        break;
      case "estimate":
        this.live.addEstimate(message);
        break;
      case "excitation":
        this.live.addExcitation(message);
        this.rig.take(message);
        break;
      case "source":
        this.watch.source(message.connected, message.silent_s);
        break;
      case "dropped":
        this.dropped += message.messages;
        break;
      case "restart":
        this.live.clear();
        this.#restart();
        break;
      case "status":
        this.watch.status();
        this.rig.take(message);
        break;
      default:
        this.rig.take(message);
    }
  }

  // The rigs to choose from, if they are several.
  #showSources({ current, sources }) {
    const { wanted } = this.stream;
    const shown = sources.find(({ id, former_ids: former }) => id === wanted || former.includes(wanted)) ?? sources.find(({ id }) => id === current);
    const select = byId("source");
    byId("source-field").hidden = sources.length < 2;
    fillSelect(select, sources.map(({ id, rig, connected }) => [id, `${rig || "unnamed rig"}, ${id}${connected ? "" : ", silent"}`]), shown?.id);
    this.shownSource = shown?.id ?? "";
    if (sources.length > 1 && this.sourceCount !== sources.length) this.say(`${sources.length} rigs publish here; shown is ${shown?.rig || shown?.id}.`);
    this.sourceCount = sources.length;
  }

  chooseSource(id) {
    if (id === this.shownSource) return;
    this.stream.wanted = id;
    const url = new URL(window.location.href);
    url.searchParams.set("source", id);
    window.history.replaceState(null, "", url);
    this.live.clear();
    this.#restart();
    this.rig.clear();
    this.stream.connect();
  }

  // The daemon was restarted: earlier data is not comparable. A frozen picture stays.
  #restart() {
    this.changed = true;
    this.restarted = this.paused;
    this.rig.events.beginRun();
    this.scope.alarms.clear();
    if (!this.paused) this.#clearPicture();
  }

  // Time of an event by the chosen clock.
  timeOf({ utc_us: utc, time_ns: time }) {
    if (this.clock === "device" && time > 0) return `${(time / 1e9).toFixed(3)} s`;
    const at = new Date(utc / 1e3);
    return Number.isFinite(at.getTime()) ? at.toISOString().slice(11, 23) + (this.clock === "device" ? " UTC" : "") : "–";
  }

  toggleClock() {
    this.clock = this.clock === "utc" ? "device" : "utc";
    this.settings.set("clock", this.clock);
    this.rig.events.retime();
    this.changed = true;
  }

  // Pauses at an event.
  goTo(event) {
    const { origin_ns: origin } = this.store.frames;
    if (origin === null || !(event.time_ns > 0)) return;
    this.pause(true);
    this.scope.moveTo(event.time_ns - Number(origin)); // where a recording is read
  }

  // A recording goes on from another time; its first frame is the origin of time.
  beginAt(first_ns) {
    this.live.clear();
    this.live.frames.origin_ns = first_ns;
    this.scope.trigger.arm();
    this.scope.alarms.clear();
    this.portraits.clear();
    this.rig.rewind();
  }

  // A recording is paused at another time.
  showPaused(left_ns) {
    this.frozen.copy(this.live);
    this.scope.left_ns = left_ns;
    this.portraits.section.clear();
  }

  #clearPicture() {
    this.restarted = false;
    this.scope.clear();
    this.portraits.clear();
    this.changed = true;
  }

  // The rig has faulted: the picture of what came before is kept, if wanted.
  faulted(status) {
    if (this.paused || this.replay.active || this.settings.get("freeze_on_fault") === false || this.live.frames.empty) return;
    const { frames } = this.live;
    const event = this.rig.events.faultOf(status);
    const at_ns = event?.time_ns > 0 ? event.time_ns - Number(frames.origin_ns) : frames.last_ns;
    this.pause(true);
    this.frozenAt = { unix_ms: (event ?? status).utc_us / 1e3, time_ns: at_ns };
    this.scope.left_ns = at_ns - 0.8 * this.scope.span_ns;
  }

  // Back to the picture of the latest fault.
  showFault() {
    if (this.paused || this.frozenAt === null) return;
    const { frozenAt } = this;
    this.pause(true, this.frozen);
    this.frozenAt = frozenAt;
    this.scope.left_ns = frozenAt.time_ns - 0.8 * this.scope.span_ns;
  }

  // --- user actions --------------------------------------------------------------------------------

  // `store`: what is shown while paused; by default, a copy of now.
  pause(paused, store = null) {
    if (paused === this.paused) return;
    if (paused) {
      this.frozen ??= new Store();
      if (store === null) this.frozen.copy(this.live);
      this.frozenAt = null; // of a fault
      this.paused_ms = performance.now();
    } else if (this.scope.trigger.done) {
      this.scope.trigger.arm(this.live.frames.end);
    }
    this.paused = paused;
    byId("to-fault").hidden = paused || this.frozenAt === null;
    this.portraits.section.clear();
    if (!paused) this.scope.setSpan(this.scope.span_s);
    if (!paused && this.restarted) this.#clearPicture();
    setPressed(byId("pause"), paused);
    setText(byId("pause"), paused ? "Go on" : "Pause");
    this.changed = true;
  }

  toggleUnits() {
    this.units.toggle();
    this.settings.set("units", this.units.system);
    this.#showUnits();
    this.scope.unitsChanged();
    this.portraits.unitsChanged();
    this.spectrum.rebuild();
    this.changed = true;
  }

  #showUnits() { setText(byId("units-now"), this.units.system); }

  help(open) {
    const dialog = byId("help");
    if (open && !dialog.open) dialog.showModal();
    else if (!open) dialog.close();
  }

  #listen() {
    byId("pause").addEventListener("click", () => this.pause(!this.paused));
    byId("to-fault").addEventListener("click", () => this.showFault());
    byId("source").addEventListener("change", (event) => this.chooseSource(event.target.value));
    const freeze = byId("freeze-on-fault");
    freeze.checked = this.settings.get("freeze_on_fault") !== false;
    freeze.addEventListener("change", () => this.settings.set("freeze_on_fault", freeze.checked));
    byId("units").addEventListener("click", () => this.toggleUnits());
    byId("theme").addEventListener("click", () => this.theme.next());
    byId("large").addEventListener("click", () => this.theme.toggleLarge());
    byId("keys").addEventListener("click", () => this.help(true));
    byId("help-close").addEventListener("click", () => this.help(false));
    new ResizeObserver(() => this.#resized()).observe(document.querySelector("main"));
    window.addEventListener("resize", () => this.#resized());
    this.#showTheme();
  }

  #resized() {
    this.layout();
    this.spectrum.rebuild();
    this.estimates.rebuild();
    this.rig.drawTiming();
  }

  layout() {
    this.scope.layout();
    this.changed = true;
  }

  #restyle() {
    this.#showTheme();
    this.#resized();
  }

  #showTheme() {
    setText(byId("theme-now"), this.theme.choice);
    setPressed(byId("large"), this.theme.large);
  }

  // --- the screen ----------------------------------------------------------------------------------

  #frame(now_ms) {
    requestAnimationFrame((next) => this.#frame(next));
    this.pace.begin(now_ms);
    this.replay.tick(now_ms);
    if (this.changed) {
      this.changed = false;
      const began_ms = performance.now();
      this.scope.draw(now_ms);
      this.scopeWork_ms = performance.now() - began_ms;
      this.#drawInTurns(now_ms);
      this.inspect?.(); // see inspection.js
      this.pace.drew();
      this.stale = 60; // what takes turns has to come round
    } else if (this.stale > 0) {
      this.stale -= 1;
      this.#drawInTurns(now_ms);
    }
    this.#fewTimesASecond(now_ms);
    this.pace.end();
  }

  // One portrait and one plot of the observer.
  #drawInTurns(now_ms) {
    this.portraitTurn.take(now_ms, () => this.portraits.draw(now_ms));
    this.estimateTurn.take(now_ms, () => this.estimates.update());
  }

  #fewTimesASecond(now_ms) {
    if (!(now_ms - this.readAt_ms < readingsEvery_ms)) {
      this.readAt_ms = now_ms;
      this.scope.updateReadings();
      this.beside.draw(now_ms);
      this.rig.update();
      this.replay.show();
      this.driveIsForce = this.scope.lanes[5].present && !this.scope.lanes[4].present;
    } else if (!(now_ms - this.spectrumAt_ms < spectrumEvery_ms)) {
      this.spectrumAt_ms = now_ms;
      this.spectrum.update();
    }
  }

  #showLink() {
    const chip = byId("link-chip");
    const quiet = this.link.state === "open" && this.watch.linkQuiet;
    if (this.link.state !== "open") {
      setText(chip, this.link.state === "waiting" ? "not connected" : "connecting");
      setState(chip, this.link.state === "waiting" ? "bad" : "unknown");
    } else if (quiet) {
      setText(chip, "no answer");
      setState(chip, "bad");
    } else if (this.replay.active) {
      setText(chip, "a recording");
      setState(chip, "unknown");
    } else {
      setText(chip, this.watch.rigSilent ? "connected, no frames" : "connected");
      setState(chip, this.watch.rigSilent || this.degraded ? "warn" : "good");
    }
    this.#showBanner(quiet);
    setText(byId("meter"), this.pace.words(this.live.frames, this.dropped));
  }

  // The problem, and since when, counting.
  #showBanner(quiet) {
    let warning = "";
    let since_unix_ms = NaN;
    if (this.link.state === "waiting" || (quiet && this.link.state === "open")) {
      const reason = this.link.reason ? ` (${this.link.reason})` : "";
      warning = quiet ? "stickslip scope does not answer, and what is shown is old." : `No connection to stickslip scope${reason}; it is tried again each second, or at once with R.`;
      since_unix_ms = this.watch.heard_unix_ms;
    } else if (this.link.state === "open" && this.watch.rigSilent) {
      warning = "The rig sends no frames. Is its daemon running, and is LCM's route set (stickslip doctor)?";
      since_unix_ms = Date.now() - this.watch.silent_s * 1e3;
    }
    const fault = this.rig.status?.state === "faulted" ? `Faulted: ${this.rig.status.cause || this.rig.status.interlock || "no cause was given"}` : "";
    const banner = byId("banner");
    banner.hidden = warning === "" && fault === "";
    setState(banner, fault === "" ? "warn" : "bad");
    setText(byId("banner-text"), [warning, fault].filter((one) => one !== "").join(" "));
    const count = warning === "" || Number.isNaN(since_unix_ms) ? "" : ` Since ${clockTime(since_unix_ms)}, for ${lasting((Date.now() - since_unix_ms) / 1e3)}.`;
    setText(byId("banner-count"), count);
  }
}

const app = new App();
app.start();
