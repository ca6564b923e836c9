// SPDX-License-Identifier: Apache-2.0
// Table of keys, for the page and its help.

import { byId } from "./elements.js";

// [keys, label, description, action]
function table(app) {
  const { scope } = app;
  const panels = ["oscilloscope", "rig", "portraits", "spectrum", "observer", "timing", "events"];
  const go = (direction) => {
    const here = panels.findIndex((id) => byId(id).contains(document.activeElement));
    const next = byId(panels[(here + direction + panels.length) % panels.length] ?? panels[0]);
    next.focus({ preventScroll: true });
    next.scrollIntoView({ block: "start" });
  };
  return [
    [[" ", "p"], "Space, P", "pause, resume", () => app.pause(!app.paused)],
    [["+", "="], "+", "shorter time base (zoom in)", () => scope.stepSpan(-1)],
    [["-", "_"], "−", "longer time base (zoom out)", () => scope.stepSpan(1)],
    [["ArrowLeft"], "←", "back in time (pauses); with Shift by a screen", (event) => scope.pan(event.shiftKey ? -1 : -0.1)],
    [["ArrowRight"], "→", "forward in time; with Shift by a screen", (event) => scope.pan(event.shiftKey ? 1 : 0.1)],
    [["0"], "0", "reset the view: 10 s, all scales automatic", () => scope.reset()],
    [["y"], "Y", "zoom in on the trigger channel", () => scope.scaleLane(scope.trigger.channel, 0.8)],
    [["Y"], "Shift+Y", "zoom out of the trigger channel", () => scope.scaleLane(scope.trigger.channel, 1.25)],
    [["1", "2", "3", "4", "5", "6", "7", "8", "9"], "1 … 9", "show or hide a channel", (event) => scope.toggleLane(Number(event.key) - 1)],
    [["t"], "T", "trigger: none, auto, normal, single", () => scope.nextTriggerMode()],
    [["e"], "E", "trigger on the other edge", () => scope.setTrigger({ rising: !scope.trigger.rising })],
    [["n"], "N", "trigger on the next channel", () => scope.setTrigger({ channel: (scope.trigger.channel + 1) % scope.lanes.length })],
    [["."], ".", "trigger level up", () => scope.nudgeLevel(0.02)],
    [[","], ",", "trigger level down", () => scope.nudgeLevel(-0.02)],
    [["a"], "A", "rearm the trigger", () => scope.setTrigger({})],
    [[], "Ctrl and wheel", "over the traces: time base; Shift and wheel: scale of a channel", () => {}],
    [["c"], "C", "cursors on, off", () => scope.toggleCursors()],
    [["["], "[", "cursor A to the left", () => scope.nudgeCursor(0, -2)],
    [["]"], "]", "cursor A to the right", () => scope.nudgeCursor(0, 2)],
    [["{"], "{", "cursor B to the left", () => scope.nudgeCursor(1, -2)],
    [["}"], "}", "cursor B to the right", () => scope.nudgeCursor(1, 2)],
    [["<"], "<", "phase of the section −15°", () => app.portraits.setPhase(app.portraits.phase_deg - 15)],
    [[">"], ">", "phase of the section +15°", () => app.portraits.setPhase(app.portraits.phase_deg + 15)],
    [["x"], "X", "export the window, with cursor values, as CSV", () => app.export.csv()],
    [["i"], "I", "the same as a picture (PNG)", () => app.export.png()],
    [["d"], "D", "device time or UTC", () => app.toggleClock()],
    [["w"], "W", "write a note, where the server takes them", () => app.notes.focus()],
    [["u"], "U", "units: mm or m", () => app.toggleUnits()],
    [["l"], "L", "theme: system, light, dark", () => app.theme.next()],
    [["b"], "B", "large text, for a projector", () => app.theme.toggleLarge()],
    [["j"], "J", "next panel", () => go(1)],
    [["k"], "K", "previous panel", () => go(-1)],
    [["s"], "S", "announce the last values (screen reader)", () => app.say(`${app.scope.summary ?? ""}. The rig is ${app.rig.status?.state ?? "unknown"}.`)],
    [["r"], "R", "reconnect now", () => app.stream.reconnect()],
    [["?", "h"], "?", "this help", () => app.help(true)],
  ];
}

export function listenToKeys(app) {
  const rows = table(app);
  const actions = new Map(rows.flatMap(([keys, , , action]) => keys.map((key) => [key, action])));
  byId("key-table").tBodies[0].append(...rows.map(([, shown, text]) => {
    const row = document.createElement("tr");
    const head = document.createElement("th");
    head.scope = "row";
    const key = document.createElement("kbd");
    key.textContent = shown;
    head.append(key);
    row.append(head);
    row.insertCell().textContent = text;
    return row;
  }));
  const single = byId("single-keys");
  single.checked = app.settings.get("single_keys") !== false;
  single.addEventListener("change", () => app.settings.set("single_keys", single.checked));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || byId("help").open || taken(event)) return;
    if (!single.checked && event.key !== "?") return;
    const action = actions.get(event.key) ?? (/^[A-Z]$/.test(event.key) ? actions.get(event.key.toLowerCase()) : undefined);
    if (!action) return;
    event.preventDefault();
    action(event);
  });
}

// Keys that a focused control handles itself.
function taken(event) {
  const { target, key } = event;
  if (target.closest("input[type=number]")) return key !== "?";
  if (target.closest("select")) return true;
  if (target.closest("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  if (target.closest("button, summary, [role=slider], input[type=checkbox]")) return key === " " || key === "Enter";
  if (target.closest("input[type=text]")) return true;
  if (target.closest("input[type=search]")) return key !== "Escape";
  if (target.closest(".event-list")) return key.startsWith("Arrow") || key === " ";
  return false;
}
