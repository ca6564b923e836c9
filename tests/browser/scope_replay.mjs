// SPDX-License-Identifier: Apache-2.0
// `stickslip scope --replay`: a recording of the simulated daemon, with a note, in the page.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { drawn, held, lookForBarriers, openPage, run, Running, source, startBrowser, startScope, stickslip, stickslipd, temporaryFolder, until } from "./programs.mjs";

const folder = temporaryFolder();
const log = path.join(folder, "run.log");
let browser;
let scope;
let rows; // of the recording, by sequence number
let note_ns;

const state = (page) => page.evaluate(() => stickslip.state());
const open = (query = "?webgl=0&span=2") => openPage(browser, scope.url + query);
const ready = (page) => until(page, () => stickslip.state().replay?.filling === false && stickslip.sizes().frozen?.held > 0, undefined, 60000);

async function close(page) {
  await page.context().close();
  assert.deepEqual(page.complaints, []);
  assert.deepEqual(page.elsewhere, []);
}

before(async () => {
  const socket = path.join(folder, "control.sock");
  const daemon = new Running(stickslipd, ["--config", path.join(source, "config/simulated.toml"), "--no-lcm", "--record", log, "--control", socket]);
  await daemon.waitFor(/recording into/);
  const ctl = (...words) => JSON.parse(run(stickslip, ["ctl", "--socket", socket, "--json", ...words]));
  while (!(ctl("status").status.ledger.produced > 6000)) await new Promise((resolve) => setTimeout(resolve, 100));
  note_ns = ctl("note", "the weights were changed").time_ns;
  while (!(ctl("status").status.ledger.produced > 13000)) await new Promise((resolve) => setTimeout(resolve, 100));
  await daemon.stop();
  const table = path.join(folder, "run.csv");
  run(stickslip, ["log", "export", log, table]);
  const lines = fs.readFileSync(table, "utf8").split("\n").filter((line) => line !== "" && !line.startsWith("#"));
  const names = lines[0].split(",");
  rows = new Map();
  for (const line of lines.slice(1)) {
    const cells = line.split(",");
    const row = Object.fromEntries(names.map((name, i) => [name, cells[i] === "" || cells[i] === undefined ? NaN : Number(cells[i])]));
    rows.set(row.sequence, row);
  }
  scope = await startScope(0, "--replay", log);
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  await scope?.stop();
  fs.rmSync(folder, { recursive: true });
});

// The frames and estimates that the page holds are those of the recording, without a gap.
async function assertRecorded(page) {
  const names = ["displacement_m", "velocity_m_s", "friction_force_n"];
  let numbers;
  for (const [channel, name] of names.entries()) {
    const frames = await held(page, "frames", channel);
    numbers = frames.sequence;
    const origin = BigInt(frames.origin_ns);
    frames.sequence.forEach((sequence, i) => {
      const row = rows.get(sequence);
      assert.equal(origin + BigInt(frames.time_ns[i]), BigInt(row.time_ns));
      assert.ok(Object.is(frames.value[i], row[name]), `${name} of frame ${sequence}`);
    });
  }
  const byTime = new Map([...rows.values()].map((row) => [row.time_ns, row]));
  const mu = await held(page, "rows", "estimates", "mu");
  const first = Math.min(...byTime.keys());
  let compared = 0;
  mu.time_ns.forEach((time, i) => {
    const row = byTime.get(first + time);
    if (!row || Number.isNaN(row.estimate_mu)) return;
    assert.ok(Object.is(mu.value[i], row.estimate_mu));
    compared += 1;
  });
  return { from: numbers[0], to: numbers.at(-1), count: numbers.length, compared };
}

test("a recording opens paused at its beginning, with its events, and everything held is as recorded", async () => {
  const page = await open();
  await ready(page);
  const { paused, replay, left_ns: left } = await state(page);
  assert.equal(paused, true);
  assert.equal(replay.position_ns, 2e9);
  assert.ok(Math.abs(left) < 1e6);
  const { from, count, compared } = await assertRecorded(page);
  assert.equal(from, Math.min(...rows.keys()));
  assert.ok(count >= 1990 && compared > 100, `${count} frames, ${compared} estimates`);
  assert.equal(await page.locator("#rig-name").innerText(), "simulated rig");
  assert.equal(await page.locator("#replay-file").innerText(), "run.log");
  assert.equal(await page.locator("#link-chip").innerText(), "a recording");
  assert.match(await page.locator("#event-list").innerText(), /the weights were changed/);
  assert.ok(await page.locator("#note-form").isHidden());
  assert.ok(await page.locator("#beside").isHidden());
  await until(page, () => stickslip.state().replay.columns > 500 && stickslip.state().replay.marks >= 1);
  await until(page, () => document.querySelector("#state-chip").textContent !== "no status yet");
  await lookForBarriers(page, "a recording");
  await page.setViewportSize({ width: 390, height: 844 });
  await lookForBarriers(page, "a recording on a phone");
  await close(page);
});

test("an event leads to its time, where it stands on the traces", async () => {
  const page = await open();
  await ready(page);
  await page.locator("#event-list li", { hasText: "the weights were changed" }).getByRole("button").click();
  const first = Math.min(...[...rows.values()].map((row) => row.time_ns));
  await until(page, (at) => { const { left_ns: left, span_ns: span } = stickslip.state(); return Math.abs(left + span / 2 - at) < 1e6; }, note_ns - first);
  await until(page, () => stickslip.state().markers.some(({ note }) => note === "the weights were changed"));
  await until(page, (at) => stickslip.frames(0, at - 1e9, at + 0.9e9).value.length > 1800, note_ns - first);
  const { markers, plot } = await state(page);
  const marker = markers.find(({ note }) => note !== "");
  assert.ok(Math.abs(marker.x - plot.left - plot.width / 2) < 2, `${marker.x}`);
  await assertRecorded(page);
  await close(page);
});

test("the slider goes to any time, and a moved view is filled", async () => {
  const page = await open();
  await ready(page);
  const length_s = (await state(page)).replay.length_ns / 1e9;
  await page.locator("#replay-position").fill(String(Math.floor(length_s - 2)));
  await until(page, (at) => { const { replay } = stickslip.state(); return !replay.filling && Math.abs(replay.position_ns / 1e9 - at) < 0.01; }, Math.floor(length_s - 2));
  const there = await assertRecorded(page);
  assert.ok(rows.get(there.to).time_ns > 0);
  assert.ok(there.count > 5000, "with what the plots beside the traces show");
  // Forward by a screen and more.
  await page.locator("#screen").focus();
  await page.keyboard.press("Shift+ArrowRight");
  await until(page, (at) => { const { replay } = stickslip.state(); return !replay.filling && replay.position_ns / 1e9 > at; }, Math.floor(length_s - 2) + 0.5);
  await assertRecorded(page);
  await close(page);
});

test("it plays at the chosen speed to its end, with WebGL, too", async () => {
  const page = await open("?webgl=1&span=2");
  await ready(page);
  await page.locator("#replay-speed").selectOption("10");
  await page.locator("#replay-play").click();
  assert.equal((await state(page)).paused, false);
  await until(page, () => { const { replay, paused } = stickslip.state(); return paused && replay.position_ns === replay.length_ns; }, undefined, 60000);
  const { to, count } = await assertRecorded(page);
  assert.equal(to, Math.max(...rows.keys()));
  assert.equal(count, rows.size, "every frame, once");
  assert.equal((await state(page)).lost, 0);
  const { data } = await drawn(page, "mu");
  assert.ok(data[0].length > 100);
  await close(page);
});

test("the picture, for those who look", async () => {
  if (!process.env.PICTURES) return;
  for (const [name, size] of [["wide", { width: 1500, height: 1000 }], ["phone", { width: 390, height: 844 }]]) {
    const page = await openPage(browser, `${scope.url}?webgl=0&span=5`, size);
    await ready(page);
    await page.locator("#event-list li", { hasText: "the weights were changed" }).getByRole("button").click();
    await until(page, () => stickslip.state().markers.some(({ note }) => note));
    await new Promise((resolve) => setTimeout(resolve, 1000));
    await page.screenshot({ path: path.join(process.env.PICTURES, `replay-${name}.png`) });
    await close(page);
  }
});
