// SPDX-License-Identifier: Apache-2.0
// The page of `stickslip scope` with the simulated daemon at 1 kHz: its data and drawings against the
// recording of the same seconds; restarts of the daemon and of the server.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { after, before, test as nodeTest } from "node:test";
import { drawn, held, openPage, run, Running, source, startBrowser, startScope, stickslip, stickslipd, temporaryFolder, until } from "./programs.mjs";

const folder = temporaryFolder();
let browser;
let scope;
let daemon;
let page;

const startDaemon = (...args) => new Running(stickslipd, ["--config", path.join(source, "config/simulated.toml"), ...args]);
const liveFrames = (page) => page.evaluate(() => stickslip.sizes().live.held);

// A test whose failure shows the state of the page and the output of the programs.
function test(name, body) {
  nodeTest(name, async (t) => {
    try {
      await body(t);
    } catch (error) {
      t.diagnostic(`the page: ${await page?.evaluate(() => JSON.stringify({ ...stickslip.state(), rig: document.querySelector("#state-chip").textContent })).catch(String)}`);
      for (const program of [daemon, scope]) {
        if (program) t.diagnostic(`${program.name}, status ${program.status ?? "running"}, last output:\n${program.output.slice(-2000)}`);
      }
      throw error;
    }
  });
}

before(async () => {
  scope = await startScope();
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  await daemon?.stop();
  await scope?.stop();
  fs.rmSync(folder, { recursive: true });
});

// The recording as rows by sequence number, each a map from column to number (NaN for none).
function recorded(log) {
  const table = path.join(folder, "recorded.csv");
  run(stickslip, ["log", "export", log, table]);
  const lines = fs.readFileSync(table, "utf8").split("\n").filter((line) => line !== "" && !line.startsWith("#"));
  const names = lines[0].split(",");
  const rows = new Map();
  for (const line of lines.slice(1)) {
    const cells = line.split(",");
    const row = Object.fromEntries(names.map((name, i) => [name, cells[i] === "" || cells[i] === undefined ? NaN : Number(cells[i])]));
    rows.set(row.sequence, row);
  }
  return rows;
}

test("the page holds and draws what the daemon recorded, bit for bit", async (t) => {
  const log = path.join(folder, "run.log");
  daemon = startDaemon("--record", log);
  await daemon.waitFor(/recording into/);
  page = await openPage(browser, `${scope.url}?webgl=0`);
  await until(page, () => stickslip.state().rig === "running" && stickslip.sizes().live.driven > 4000, undefined, 60000);
  const pace = await page.evaluate(() => stickslip.pace());
  t.diagnostic(`lag from LCM to pixel: median ${pace.lag.median.toFixed(1)} ms, 95 % ${pace.lag.p95.toFixed(1)} ms; ` +
    `${(1000 / pace.interval.median).toFixed(0)} pictures/s, work of each ${pace.work.median.toFixed(2)} ms (without a graphics processor, on a busy machine)`);
  assert.equal(await page.locator("#rig-name").innerText(), "simulated rig");
  await page.keyboard.press("p");
  const frames = [];
  for (let channel = 0; channel < 6; ++channel) frames.push(await held(page, "frames", channel));
  const estimates = {};
  const estimated = ["theta", "mu", "gamma_per_s", "friction_force_n", "slip_velocity_m_s", "sticking", "raw_friction_force_n", "raw_coefficient", "nis", "nis_freedom"];
  for (const name of estimated) estimates[name] = await held(page, "rows", "estimates", name);
  const excited = {};
  for (const name of ["drive", "phase_rad", "amplitude"]) excited[name] = await held(page, "rows", "excitation", name);
  const loop = await drawn(page, "friction-velocity");
  const section = await drawn(page, "phase");
  await page.keyboard.press("p");
  await daemon.stop();

  const rows = recorded(log);
  const names = ["displacement_m", "velocity_m_s", "friction_force_n", "normal_load_n", "base_displacement_m"];
  const origin = BigInt(frames[0].origin_ns);
  const byTime = new Map();
  assert.ok(frames[0].sequence.length > 4000);
  for (const [channel, name] of names.entries()) {
    frames[channel].sequence.forEach((sequence, i) => {
      const row = rows.get(sequence);
      assert.ok(row, `frame ${sequence} was recorded`);
      assert.equal(origin + BigInt(frames[channel].time_ns[i]), BigInt(row.time_ns));
      assert.ok(Object.is(frames[channel].value[i], row[name]), `${name} of frame ${sequence}: ${frames[channel].value[i]} and ${row[name]}`);
      byTime.set(frames[channel].time_ns[i], row);
    });
  }
  assert.ok(frames[5].value.every(Number.isNaN), "the drive force of this rig is not measured");
  // Amplitude and phase have single precision except for the last frame of a message; log and stream may end
  // messages at different frames.
  const single = new Set(["amplitude", "phase_rad"]);
  for (const [ring, columns, prefix] of [[estimates, estimated, "estimate_"], [excited, ["drive", "phase_rad", "amplitude"], "excitation_"]]) {
    for (const name of columns) {
      const kept = single.has(name) ? Math.fround : (value) => value;
      let compared = 0;
      ring[name].time_ns.forEach((time, i) => {
        const row = byTime.get(time);
        if (!row || row.estimate_valid === 0) return;
        const recordedValue = row[prefix + name];
        assert.ok(Object.is(kept(ring[name].value[i]), kept(recordedValue)), `${name} at ${time}: ${ring[name].value[i]} and ${recordedValue}`);
        compared += 1;
      });
      assert.ok(compared > (prefix === "estimate_" ? 100 : 3000), `${compared} of ${name} compared`);
    }
  }
  // Frames lost by the network (a stalled machine loses datagrams) are missing in the page; the rest is compared.
  const lost = frames[0].sequence.filter((sequence, i, all) => i > 0 && sequence !== all[i - 1] + 1).length;
  t.diagnostic(`${lost} gaps in ${frames[0].sequence.length} frames`);
  // The friction loop, recomputed from the log.
  const points = [];
  for (let k = 0; k < loop.points.length; k += 2) {
    if (loop.points[k] !== null) points.push([loop.points[k], loop.points[k + 1]]); // null: a line ends at a gap
  }
  assert.ok(points.length > 1000, `${points.length} points of the loop`);
  const first = frames[0].sequence.indexOf(loop.first);
  points.forEach((point, k) => {
    const row = rows.get(frames[0].sequence[first + k]);
    assert.deepEqual(point, [row.velocity_m_s * 1e3 + 0, row.friction_force_n / row.normal_load_n + 0]); // JSON knows no -0
  });
  // The section: once wherever the recorded phase passes 0 (at 3.2 Hz it falls on a frame every second time).
  const driven = [...excited.drive.time_ns].filter((time) => byTime.has(time));
  const passages = section.passages.filter(([time]) => time > driven[0] && time <= driven.at(-1));
  let wraps = 0;
  for (let i = 1; i < driven.length; ++i) {
    const [earlier, later] = [byTime.get(driven[i - 1]), byTime.get(driven[i])];
    if (later.sequence !== earlier.sequence + 1) continue; // frames were lost between
    // The phase goes over LCM in single precision: 3e-8 rad are some nanoseconds.
    const here = passages.filter(([time]) => time > driven[i - 1] + 100 && time < driven[i] - 100);
    if (!(later.excitation_phase_rad < earlier.excitation_phase_rad)) {
      assert.deepEqual(here, [], `no phase wraps between ${driven[i - 1]} and ${driven[i]}`);
      continue;
    }
    wraps += 1;
    const near = passages.filter(([time]) => time > driven[i - 1] - 100 && time < driven[i] + 100);
    assert.equal(near.length, 1, `passages at ${driven[i]}, where the phase wraps`);
    const [low, high] = [earlier.displacement_m, later.displacement_m].sort((a, b) => a - b);
    assert.ok(near[0][1] >= low - 1e-7 && near[0][1] <= high + 1e-7);
  }
  assert.ok(wraps >= 10, `${wraps} passages`);
});

test("a silent source is shown; a restarted daemon starts a new picture", async () => {
  await until(page, () => document.querySelector("#banner").textContent.includes("sends no frames"));
  daemon = startDaemon();
  await until(page, () => stickslip.state().source === true && stickslip.state().rig === "running" && stickslip.sizes().live.held > 300, undefined, 60000);
  const frames = await held(page, "frames", 0, -Infinity, Infinity, true);
  assert.ok(frames.sequence.every((sequence, i) => i === 0 || sequence > frames.sequence[i - 1]));
  assert.ok(frames.sequence.length < 5000 || frames.sequence[0] < 5000, "nothing of the first daemon is left");
  await until(page, () => document.querySelector("#banner").hidden);
});

test("nothing is green over a hanging daemon, nor over a hanging server", async () => {
  const greens = () => [...document.querySelectorAll(".chip[data-state=good]")].map((chip) => chip.id);
  const isGreen = () => stickslip.state().fresh && document.querySelector("#state-chip").dataset.state === "good";
  await until(page, isGreen);
  daemon.child.kill("SIGSTOP");
  await until(page, () => !stickslip.state().fresh && stickslip.state().source === false);
  assert.deepEqual(await page.evaluate(greens), []);
  daemon.child.kill("SIGCONT");
  await until(page, isGreen);
  scope.child.kill("SIGSTOP");
  await until(page, () => document.querySelector("#link-chip").dataset.state === "bad");
  assert.deepEqual(await page.evaluate(greens), []);
  await until(page, () => stickslip.state().link !== "open", undefined, 30000); // given up
  assert.deepEqual(await page.evaluate(greens), []);
  scope.child.kill("SIGCONT");
  await until(page, isGreen, undefined, 30000);
});

test("a second daemon leaves the view of the first whole, and can be chosen", async () => {
  const config = path.join(folder, "second.toml");
  fs.writeFileSync(config, fs.readFileSync(path.join(source, "config/simulated.toml"), "utf8").replaceAll("simulated rig", "second rig"));
  fs.mkdirSync(path.join(folder, "models"), { recursive: true });
  for (const name of fs.readdirSync(path.join(source, "config/models"))) fs.copyFileSync(path.join(source, "config/models", name), path.join(folder, "models", name));
  const second = new Running(stickslipd, ["--config", config]);
  const choose = async (rig) => {
    const value = await page.evaluate((rig) => [...document.querySelectorAll("#source option")].find((option) => option.textContent.startsWith(rig)).value, rig);
    await page.locator("#source").selectOption(value);
  };
  try {
    await until(page, () => document.querySelectorAll("#source option").length === 2 && document.querySelector("#source").textContent.includes("second rig"), undefined, 30000);
    const first = await page.evaluate(() => ({ rig: document.querySelector("#rig-name").textContent, lost: stickslip.state().lost, end: stickslip.sizes().live.held }));
    assert.equal(first.rig, "simulated rig");
    await until(page, (end) => stickslip.sizes().live.held > end + 2000, first.end, 30000);
    const seen = await held(page, "frames", 0, -Infinity, Infinity, true);
    assert.ok(seen.sequence.every((sequence, i) => i === 0 || (sequence > seen.sequence[i - 1] && seen.time_ns[i] > seen.time_ns[i - 1])));
    assert.ok((await page.evaluate(() => stickslip.state().lost)) - first.lost < 1000, "what is lost is lost by the machine, not by the other daemon");
    await choose("second rig");
    await until(page, () => document.querySelector("#rig-name").textContent === "second rig" && stickslip.sizes().live.held > 500, undefined, 30000);
  } finally {
    await second.stop();
  }
  // A page that has chosen keeps to its choice until it is long gone.
  await until(page, () => stickslip.state().source === false);
  await choose("simulated rig");
  await until(page, () => document.querySelector("#rig-name").textContent === "simulated rig" && stickslip.state().source === true, undefined, 30000);
});

test("the page reconnects to a restarted server", async (t) => {
  const { port } = scope;
  const opened = await page.evaluate(() => stickslip.state().opened);
  await scope.stop();
  await until(page, () => stickslip.state().link === "waiting" && document.querySelector("#banner").textContent.includes("No connection"));
  const before = await liveFrames(page);
  scope = await startScope(port);
  const returned = Date.now();
  await until(page, (opened) => stickslip.state().link === "open" && stickslip.state().opened === opened + 1, opened);
  t.diagnostic(`connected again ${Date.now() - returned} ms after the server's return`);
  await until(page, (before) => stickslip.sizes().live.held > before + 300, before, 30000);
  page.complaints = page.complaints.filter((line) => !/ERR_CONNECTION_REFUSED|WebSocket connection|ERR_EMPTY_RESPONSE|ERR_CONNECTION_RESET/.test(line)); // the browser's own notes
});

test("a fault of the daemon freezes what came before it, and its cause stays on top", async () => {
  await daemon.stop();
  await until(page, () => stickslip.state().source === false);
  const script = path.join(folder, "stop.toml");
  fs.writeFileSync(script, fs.readFileSync(path.join(source, "config/faults/emergency_stop.toml"), "utf8").replace(/at_s = .*/, "at_s = 6.0"));
  const config = path.join(folder, "faulty.toml");
  fs.writeFileSync(config, fs.readFileSync(path.join(source, "config/simulated.toml"), "utf8").replace('kind = "simulated"', 'kind = "simulated"\nfaults = "stop.toml"'));
  daemon = new Running(stickslipd, ["--config", config]);
  await until(page, () => stickslip.state().paused && document.querySelector("#state-chip").textContent === "faulted", undefined, 60000);
  assert.equal(await page.locator("#event-pinned").isVisible(), true);
  const pinned = await page.locator("#event-pinned").innerText();
  // Without its time where a stalled machine has lost the event: the status has the cause, too.
  assert.match(pinned, /^Amplifier switched off(, 6\.0\d\d s)?: the emergency stop/, pinned);
  const { frozenAt, left_ns, span_ns } = await page.evaluate(() => stickslip.state());
  assert.ok(Math.abs((frozenAt.time_ns - left_ns) / span_ns - 0.8) < 1e-6);
  await page.keyboard.press("p");
});

test("the page had no errors and no requests to other servers", async () => {
  assert.deepEqual(page.complaints, []);
  assert.deepEqual(page.elsewhere, []);
  assert.ok(page.requests > 20);
});
