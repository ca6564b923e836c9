// SPDX-License-Identifier: Apache-2.0
// The page of `stickslip scope` with a stream controlled by the test: drawings against data, all user actions,
// memory and cost.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { test } from "node:test";
import { close, ink, near, open, state, text } from "./fed_page.mjs";
import { drawn, held, lookForBarriers, run, stickslip, temporaryFolder, until } from "./programs.mjs";

// Values that are identical on every machine, bit for bit, unlike a sine.
const exact = (channel, t) => ((Math.round(t * 1000) * 7919 + channel * 104729) % 10007) / 10007 - 0.5 + channel + t / 7;
const signal = (channel, t) => Math.sin(2 * Math.PI * 2 * t) * (channel + 1);

test("traces hold the stream bit for bit and are drawn at its values", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.value = (channel, t) => (channel === 5 ? NaN : ((Math.round(t * 1000) * 7919 + channel * 104729) % 10007) / 10007 - 0.5 + channel + t / 7);
    feed.t0_ns = 4_611_686_018_427_387_904n; feed.frames(0, 12000, { per: 1000, flags: 2 }); feed.frames(12000, 500);
  });
  for (let channel = 0; channel < 5; ++channel) {
    const frames = await held(page, "frames", channel);
    assert.equal(frames.origin_ns, "4611686018427387904");
    assert.equal(frames.value.length, 12500);
    frames.value.forEach((value, i) => assert.ok(Object.is(value, exact(channel, i / 1000)), `channel ${channel}, frame ${i}`));
    frames.time_ns.forEach((time, i) => assert.equal(time, i * 1e6));
  }
  // 10 s on screen: two points for each column, at the least and the greatest of its frames.
  const names = ["displacement", "velocity", "friction_force", "normal_load", "base_displacement"];
  const factors = [1e3, 1e3, 1, 1, 1e3];
  for (const [channel, name] of names.entries()) {
    const picture = await drawn(page, name);
    assert.ok(picture.dense);
    const scale = picture.height / (picture.high - picture.low);
    let columns = 0;
    for (let i = 0; i + 1 < picture.points.length / 2;) {
      const x = picture.points[2 * i];
      if (x < -1e8) { i += 1; continue; }
      const column = Math.round((x - picture.plot.left - 0.5) + (picture.left_ns - picture.firstColumn * picture.column_ns) / picture.column_ns) + picture.firstColumn;
      const from = Math.max(0, Math.ceil((column * picture.column_ns) / 1e6 - 1e-9));
      const to = Math.min(12500, Math.ceil(((column + 1) * picture.column_ns) / 1e6 - 1e-9));
      const values = Array.from({ length: to - from }, (_, k) => exact(channel, (from + k) / 1000) * factors[channel]);
      const ys = [picture.points[2 * i + 1], picture.points[2 * i + 3]].map((y) => picture.low + (picture.top + picture.height - y) / scale);
      near(Math.min(...ys), Math.min(...values), 0.01 / scale, `${name}, column ${column}: least`);
      near(Math.max(...ys), Math.max(...values), 0.01 / scale, `${name}, column ${column}: greatest`);
      columns += 1;
      i += 2;
    }
    assert.ok(columns > 0.95 * picture.plot.width, `${columns} columns`);
  }
  assert.ok((await ink(page, "displacement")) > 1000);
  assert.deepEqual((await state(page)).visible, names); // the drive force was never measured
  await close(page);
});

test("zoomed in, every frame is a point, and lost frames are a counted gap", async () => {
  const page = await open();
  await page.evaluate(() => { feed.frames(0, 900); feed.frames(920, 100); });
  await page.locator("#time-base").selectOption("0.2");
  const picture = await drawn(page, "velocity");
  assert.ok(!picture.dense);
  const points = [];
  for (let i = 0; i < picture.points.length; i += 2) points.push([picture.points[i], picture.points[i + 1]]);
  const gaps = points.filter(([x]) => x < -1e8).length;
  assert.equal(gaps, 1);
  const scale = picture.height / (picture.high - picture.low);
  const frames = [...Array(1020).keys()].filter((i) => (i < 900 || i >= 920) && i * 1e6 >= picture.left_ns - 1.5e6);
  const solid = points.filter(([x]) => x > -1e8);
  const first = frames.length - solid.length;
  assert.ok(first >= 0 && first <= 2);
  solid.forEach(([x, y], k) => {
    const i = frames[k + first];
    near(x, picture.plot.left + ((i * 1e6 - picture.left_ns) / picture.span_ns) * picture.plot.width, 0.01, `x of frame ${i}`);
    near(picture.low + (picture.top + picture.height - y) / scale, signal(1, i / 1000) * 1e3, 0.02 / scale, `y of frame ${i}`);
  });
  await until(page, () => document.querySelector("#scope-summary").textContent.includes("20 frames were lost"));
  assert.equal((await state(page)).lost, 20);
  await close(page);
});

test("a step of the time breaks every line, is named, and leaves the rate", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.frames(0, 900);
    feed.excitation(0, 900, 2, 0.01);
    feed.t0_ns += 50_000_000n; // the sequence goes on
    feed.frames(900, 100);
    feed.excitation(900, 100, 2, 0.01);
  });
  await page.locator("#time-base").selectOption("0.2");
  const picture = await drawn(page, "velocity");
  assert.ok(!picture.dense);
  const xs = picture.points.filter((_, i) => i % 2 === 0);
  assert.equal(xs.filter((x) => x < -1e8).length, 1);
  const perMs = (picture.plot.width * 1e6) / picture.span_ns;
  xs.forEach((x, i) => {
    if (i > 0 && x > -1e8 && xs[i - 1] > -1e8) near(x - xs[i - 1], perMs, 0.01, `step to point ${i}`);
  });
  for (const portrait of ["phase", "cylinder", "friction-displacement"]) {
    const { points } = await drawn(page, portrait);
    const breaks = points.filter((x, i) => i % 2 === 0 && !Number.isFinite(x)).length;
    // The phase of the drive returns to 0 once a turn, which also ends a line.
    assert.equal(breaks, portrait === "cylinder" ? 2 : 1, portrait);
  }
  await until(page, () => document.querySelector("#scope-summary").textContent.includes("Its time steps by 50.0 ms."));
  const summary = await text(page, "#scope-summary");
  assert.match(summary, /frames on screen at 1000(\.0+)? Hz/);
  assert.equal((await state(page)).lost, 0);
  await close(page);
});

test("a slow rate is no step of the time, ten of its periods are", async () => {
  const page = await open();
  await page.evaluate(() => { feed.rate_hz = 5; feed.frames(0, 100, { per: 1 }); });
  await page.locator("#time-base").selectOption("30");
  const breaks = async () => (await drawn(page, "velocity")).points.filter((x, i) => i % 2 === 0 && x < -1e8).length;
  assert.equal(await breaks(), 0);
  await page.evaluate(() => { feed.t0_ns += 2_200_000_000n; feed.frames(100, 20, { per: 1 }); });
  assert.equal(await breaks(), 1);
  await close(page);
});

test("extremes of any range are those of its frames, also after the ring has wrapped", async () => {
  const page = await open();
  const wrong = await page.evaluate(async () => {
    const { FrameStore } = await import(new URL("store.js", document.baseURI).href);
    const { decodeFrames } = await import(new URL("stream.js", document.baseURI).href);
    let seed = 20261122;
    const random = () => { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; return seed / 2 ** 32; };
    feed.value = (channel) => (channel === 0 ? random() - 0.5 : channel === 1 && random() < 0.999 ? NaN : random());
    const frames = new FrameStore();
    const pair = new Float64Array(2);
    const wrong = [];
    for (let round = 0; round < 3; ++round) {
      for (let i = 0; i < 70000; i += 1000) frames.append(decodeFrames(feed.block(round * 70000 + i, 1000)));
      for (let k = 0; k < 200; ++k) {
        const from = frames.begin + Math.floor(random() * (frames.end - frames.begin));
        const to = Math.min(frames.end, from + Math.floor(random() * 10 ** (1 + (k % 4))));
        for (const channel of [0, 1]) {
          let [low, high] = [Infinity, -Infinity];
          for (let row = from; row < to; ++row) {
            const value = frames.values[channel][row & frames.mask];
            if (value < low) low = value;
            if (value > high) high = value;
          }
          frames.extremes(channel, from, to, pair);
          if (pair[0] !== low || pair[1] !== high) wrong.push([channel, from, to, low, high, pair[0], pair[1]]);
        }
      }
    }
    return { wrong: wrong.slice(0, 3), held: frames.end - frames.begin };
  });
  assert.deepEqual(wrong, { wrong: [], held: 131072 });
  await close(page);
});

test("a pause freezes the display while frames are still received", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 15000, { per: 500 }));
  await drawn(page, "displacement"); // a picture is drawn
  await page.keyboard.press("Space");
  const before = await drawn(page, "displacement");
  await page.evaluate(() => feed.frames(15000, 150000, { per: 1000 })); // more than the ring holds
  const later = await drawn(page, "displacement");
  assert.deepEqual(later.points, before.points);
  assert.equal((await held(page, "frames", 0)).value.length, 15000);
  assert.equal(await page.locator("#pause").getAttribute("aria-pressed"), "true");
  await page.locator("#pause").click();
  const after_ = await drawn(page, "displacement");
  assert.equal(after_.left_ns, 164999e6 - 10e9);
  assert.equal((await state(page)).paused, false);
  await close(page);
});

test("the trigger holds the display at the level crossing", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 2000));
  await page.locator("#time-base").selectOption("0.5");
  await drawn(page, "velocity");
  await page.locator("#trigger-mode").selectOption("normal");
  await page.locator("#trigger-channel").selectOption("1");
  await page.locator("#trigger-level").fill("1000"); // mm/s; velocity is 2 sin(2 pi 2 t) m/s
  await page.locator("#trigger-level").press("Enter");
  await until(page, () => !document.querySelector("#screen-note").hidden && document.querySelector("#screen-note").textContent.includes("waiting"));
  await page.evaluate(() => feed.frames(2000, 3000));
  await until(page, () => stickslip.state().held);
  const crossing = (seconds, phase) => { const turns = seconds * 2 - phase; return turns - Math.round(turns); };
  let now = await state(page);
  near(crossing(now.trigger.fired_ns / 1e9, 1 / 12), 0, 1e-5, "rising"); // sin = 1/2 at 1/12 of a turn
  near(now.left_ns, now.trigger.fired_ns - 0.2 * now.span_ns, 1);
  const fired = now.trigger.fired_ns;
  assert.ok(fired / 1e9 > 4.0, "the newest full screen");
  await page.locator("#screen").focus();
  await page.keyboard.press("e");
  await page.evaluate(() => feed.frames(5000, 2000));
  await until(page, (fired) => stickslip.state().trigger.fired_ns > fired, fired);
  now = await state(page);
  near(crossing(now.trigger.fired_ns / 1e9, 5 / 12), 0, 1e-5, "falling");
  // A level that is never reached: normal waits, auto rolls.
  await page.locator("#trigger-level").fill("2500");
  await page.locator("#trigger-level").press("Enter");
  await page.evaluate(() => feed.frames(7000, 1000));
  await drawn(page, "velocity");
  assert.equal((await state(page)).held, false);
  await page.locator("#trigger-mode").selectOption("auto");
  await page.evaluate(() => feed.frames(8000, 1000));
  await drawn(page, "velocity");
  now = await state(page);
  assert.equal(now.left_ns, 8999e6 - now.span_ns);
  // A single shot fires once and stops; its level can be moved by keys.
  await page.locator("#trigger-level").fill("0");
  await page.locator("#trigger-level").press("Enter");
  await page.locator("#level-handle").focus();
  await page.keyboard.press("Shift+ArrowUp");
  assert.ok((await state(page)).trigger.level > 0.1);
  await page.locator("#trigger-mode").selectOption("single");
  await page.evaluate(() => feed.frames(9000, 2500));
  await until(page, () => stickslip.state().paused);
  const shot = (await state(page)).trigger;
  assert.ok(shot.done);
  assert.ok(shot.fired_ns < 9.9e9, "the first crossing after arming");
  await page.evaluate(() => feed.frames(11500, 1000));
  assert.equal((await state(page)).trigger.fired_ns, shot.fired_ns);
  await page.locator("#trigger-arm").click();
  assert.equal((await state(page)).paused, false);
  await close(page);
});

test("zoom by wheel, keys and buttons; drag moves; reset restores the view", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 60000, { per: 1000 }));
  const box = await page.locator("#screen").boundingBox();
  const x = Math.round(box.x + box.width * 0.4);
  const y = Math.round(box.y + 40);
  await page.mouse.move(x, y);
  await page.keyboard.press("p");
  const before = await state(page);
  const pointed = (s) => s.left_ns + ((x - box.x - s.plot.left) / s.plot.width) * s.span_ns;
  await page.keyboard.down("Control");
  await page.mouse.wheel(0, -300);
  await until(page, (span) => stickslip.state().span_s < span, before.span_s);
  await page.keyboard.up("Control");
  const zoomed = await state(page);
  near(pointed(zoomed), pointed(before), before.span_ns / before.plot.width, "the time under the pointer stays");
  await page.mouse.down();
  await page.mouse.move(x + 100, y, { steps: 4 });
  await page.mouse.up();
  const moved = await state(page);
  near(moved.left_ns, zoomed.left_ns - (100 / moved.plot.width) * moved.span_ns, moved.span_ns * 0.005, "drag");
  await page.keyboard.down("Shift");
  const scale = await drawn(page, "displacement");
  await page.mouse.wheel(0, 200);
  await page.keyboard.up("Shift");
  await until(page, async (range) => { const now = await stickslip.drawn("displacement"); return now.high - now.low > 1.1 * range; }, scale.high - scale.low);
  await page.locator("#reset").click();
  assert.equal((await state(page)).span_s, 10);
  await page.keyboard.press("+");
  assert.equal((await state(page)).span_s, 5);
  await page.keyboard.press("-");
  await page.keyboard.press("-");
  assert.equal((await state(page)).span_s, 20);
  const here = (await state(page)).left_ns;
  await page.keyboard.press("ArrowLeft");
  near((await state(page)).left_ns, here - 2e9, 1e3, "arrow");
  await page.locator("#zoom-in").click();
  assert.equal((await state(page)).span_s, 10);
  await close(page);
});

test("units change the display, not the data", async () => {
  const page = await open();
  await page.evaluate(() => { feed.value = (c) => 0.0125 * (c + 1); feed.frames(0, 3000); });
  const cell = "#readings tbody tr:nth-child(1) td:nth-child(2)";
  await until(page, (cell) => document.querySelector(cell)?.textContent === "12.50", cell);
  assert.match(await text(page, "#readings tbody tr:nth-child(2)"), /Velocity \(mm\/s\)\s+25\.00/);
  const millimetres = await drawn(page, "displacement");
  await page.keyboard.press("u");
  await until(page, (cell) => document.querySelector(cell)?.textContent === "0.01250", cell);
  assert.match(await text(page, "#readings tbody tr:nth-child(3)"), /Friction force \(N\)\s+0\.03750/);
  const metres = await drawn(page, "displacement");
  near(metres.high * 1e3, millimetres.high, 0.02 * Math.abs(millimetres.high) + 1e-6);
  assert.deepEqual([...(await held(page, "frames", 0)).value.slice(-3)], [0.0125, 0.0125, 0.0125]);
  await page.reload();
  await until(page, () => window.stickslip !== undefined);
  assert.equal((await state(page)).units, "m", "the choice is remembered");
  await close(page);
});

test("cursors read times, values and their differences", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 12000, { per: 1000 }));
  await drawn(page, "displacement");
  await page.keyboard.press("p");
  await page.keyboard.press("c");
  await page.locator("#cursor-a").focus();
  await page.keyboard.press("Home");
  for (let i = 0; i < 7; ++i) await page.keyboard.press("Shift+ArrowRight");
  await page.locator("#cursor-b").focus();
  await page.keyboard.press("ArrowLeft");
  const box = await page.locator("#screen").boundingBox();
  const handle = await page.locator("#cursor-b").boundingBox();
  await page.mouse.move(handle.x + handle.width / 2, handle.y + 60);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.7, handle.y + 60, { steps: 3 });
  await page.mouse.up();
  const now = await state(page);
  const [a, b] = now.cursors;
  near(a, now.left_ns + (140 / now.plot.width) * now.span_ns, 10);
  near(b, now.left_ns + ((box.width * 0.7 - now.plot.left) / now.plot.width) * now.span_ns, now.span_ns / 500);
  const rows = await page.locator("#cursor-readings tbody tr:not([hidden])").evaluateAll((list) => list.map((row) => [...row.cells].map((cell) => cell.textContent.replace("\u2212", "-"))));
  near(Number(rows[0][1]), a / 1e9, 2e-3, "time of A");
  near(Number(rows[0][3]), (b - a) / 1e9, 1e-4 * ((b - a) / 1e9), "difference");
  near(Number(rows[1][3]), 1e9 / (b - a), 1e-4 * (1e9 / (b - a)), "1/dt");
  const at = (t) => { const i = Math.floor(t / 1e6); const part = t / 1e6 - i; return 1e3 * (signal(0, i / 1000) * (1 - part) + signal(0, (i + 1) / 1000) * part); };
  near(Number(rows[2][1]), at(a), 0.06, "x at A");
  near(Number(rows[2][2]), at(b), 0.06, "x at B");
  near(Number(rows[2][3]), at(b) - at(a), 0.2, "x of B less A");
  // The cursors keep their times when a paused picture is zoomed.
  await page.keyboard.press("-");
  const after_ = await state(page);
  near(after_.cursors[0], a, 1e4);
  await close(page);
});

test("every action has a key, and the help lists them", async () => {
  const page = await open();
  await page.evaluate(() => { feed.frames(0, 3000); feed.status(); });
  await drawn(page, "displacement");
  await page.keyboard.press("?");
  assert.ok(await page.locator("#help").evaluate((dialog) => dialog.open));
  const listed = await page.locator("#key-table kbd").allInnerTexts();
  assert.ok(listed.length >= 25);
  await page.keyboard.press("Escape");
  assert.ok(!(await page.locator("#help").evaluate((dialog) => dialog.open)));
  const changes = async (key, what) => {
    const before = JSON.stringify(what(await state(page)));
    await page.keyboard.press(key);
    const now = JSON.stringify(what(await state(page)));
    assert.notEqual(now, before, `key ${key}`);
  };
  await changes("t", (s) => s.trigger.mode);
  await changes("n", (s) => s.trigger.channel);
  await changes("e", (s) => s.trigger.rising);
  await changes(".", (s) => s.trigger.level);
  await changes("c", (s) => s.cursors === null);
  await page.keyboard.press("p");
  await changes("[", (s) => s.cursors[0]);
  await changes("}", (s) => s.cursors[1]);
  await changes("u", (s) => s.units);
  await changes("l", (s) => s.themeChoice);
  await changes("l", (s) => s.theme);
  await changes("b", (s) => s.large);
  await changes("b", (s) => s.large);
  await changes(">", (s) => s.section_deg);
  await page.keyboard.press("2");
  await drawn(page, "displacement");
  assert.ok(!(await state(page)).visible.includes("velocity"));
  await page.keyboard.press("j");
  await page.keyboard.press("j");
  assert.equal(await page.evaluate(() => document.activeElement.id), "rig");
  await page.keyboard.press("s");
  assert.match(await page.locator("#spoken").textContent(), /displacement .* The rig is running/);
  // Every control is reached by Tab and shows its focus.
  const met = new Set();
  await page.keyboard.press("2");
  await drawn(page, "displacement");
  await page.locator(".skip").focus();
  for (let i = 0; i < 90; ++i) {
    await page.keyboard.press("Tab");
    const focus = await page.evaluate(() => ({ id: document.activeElement.id, outline: getComputedStyle(document.activeElement).outlineStyle, body: document.activeElement === document.body }));
    if (focus.body) break;
    assert.notEqual(focus.outline, "none", `#${focus.id} shows no focus`);
    met.add(focus.id);
  }
  for (const id of ["pause", "units", "theme", "large", "keys", "time-base", "trigger-mode", "trigger-level", "screen", "cursor-a", "cursor-b", "level-handle", "portrait-span", "section-phase", "spectrum-channel", "estimate-span", "event-list"]) {
    assert.ok(met.has(id), `Tab does not reach #${id}`);
  }
  await close(page);
});

test("portraits draw the loops of the stream, and the section at its drive phase", async () => {
  const page = await open();
  const values = (t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 0.15 * Math.cos(6 * t), 0.5 + 0.02 * Math.sin(6 * t), 0.001, NaN];
  await page.evaluate(() => {
    feed.value = (c, t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 0.15 * Math.cos(6 * t), 0.5 + 0.02 * Math.sin(6 * t), 0.001, NaN][c];
    for (let i = 0; i < 12000; i += 100) { feed.frames(i, 100, { per: 100 }); feed.excitation(i, 100, 3.2, 0.001); feed.estimate(i + 99); }
  });
  const shown = {
    "friction-velocity": (v) => [v[1] * 1e3, v[2] / v[3]],
    "friction-displacement": (v) => [v[0] * 1e3, v[2] / v[3]],
    phase: (v) => [v[0] * 1e3, v[1] * 1e3],
    "load-displacement": (v) => [v[0] * 1e3, v[3]],
  };
  const count = 10001; // the last 10 s, both ends
  for (const [name, quantities] of Object.entries(shown)) {
    const picture = await drawn(page, name);
    assert.equal(picture.points.length, 2 * count, name);
    for (let k = 0; k < count; k += 7) {
      const expected = quantities(values((12000 - count + k) / 1000));
      near(picture.points[2 * k], expected[0], 1e-11, `${name}, point ${k}: x`);
      near(picture.points[2 * k + 1], expected[1], 1e-11, `${name}, point ${k}: y`);
      const { xLow, xHigh, yLow, yHigh, width, height } = picture.limits;
      near(picture.pixels[2 * k], ((expected[0] - xLow) / (xHigh - xLow)) * width, 0.01, `${name}, x of point ${k}`);
      near(picture.pixels[2 * k + 1], ((yHigh - expected[1]) / (yHigh - yLow)) * height, 0.01, `${name}, y of point ${k}`);
    }
    assert.ok((await ink(page, name)) > 100, name);
  }
  // Each frame is at its own drive phase.
  const cylinder = await drawn(page, "cylinder");
  let frame = 12000 - count;
  for (let k = 0; k < cylinder.points.length; k += 2) {
    if (cylinder.points[k] === null) continue;
    const turns = (frame / 1000) * 3.2;
    near(cylinder.points[k], (turns - Math.floor(turns)) * 360, 1e-6, `phase of frame ${frame}`);
    near(cylinder.points[k + 1], values(frame / 1000)[0] * 1e3, 1e-11);
    frame += 1;
  }
  assert.equal(frame, 12000);
  // The section at 90 degrees: t = (k + 1/4) / 3.2 s.
  await page.locator("#section-phase").fill("90");
  const { passages } = await drawn(page, "phase");
  assert.equal(passages.length, Math.floor(11.999 * 3.2 - 0.25) + 1);
  passages.forEach(([time, x, v], k) => {
    const t = (k + 0.25) / 3.2;
    near(time / 1e9, t, 1e-8, `passage ${k}`);
    near(x, 0.01 * Math.sin(6 * t), 1e-7); // interpolated between frames
    near(v, 0.06 * Math.cos(6 * t), 1e-6);
  });
  await close(page);
});

test("the spectrum is that of the frames, as amplitude and as density", async () => {
  const page = await open();
  const sample = (i) => 0.004 * Math.sin((2 * Math.PI * 125 * i) / 4096) + 0.001 * Math.cos(2 * Math.PI * 0.0731 * i) + 0.3;
  await page.evaluate(() => {
    feed.value = (c, t) => { const i = Math.round(t * 1000); return 0.004 * Math.sin((2 * Math.PI * 125 * i) / 4096) + 0.001 * Math.cos(2 * Math.PI * 0.0731 * i) + 0.3; };
    feed.frames(0, 6000, { per: 1000 });
  });
  await page.locator("#spectrum-length").selectOption("4096");
  await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
  await until(page, () => document.querySelector("#spectrum-plot canvas") !== null);
  const read = () => drawn(page, "spectrum");
  const direct = (bin, weights) => {
    const samples = Array.from({ length: 4096 }, (_, k) => sample(6000 - 4096 + k));
    const mean = samples.reduce((sum, value) => sum + value, 0) / 4096;
    let [re, im] = [0, 0];
    samples.forEach((value, k) => { re += (value - mean) * weights(k) * Math.cos((2 * Math.PI * bin * k) / 4096); im -= (value - mean) * weights(k) * Math.sin((2 * Math.PI * bin * k) / 4096); });
    return Math.hypot(re, im);
  };
  const hann = (k) => 0.5 - 0.5 * Math.cos((2 * Math.PI * k) / 4096);
  let spectrum = await read();
  assert.equal(spectrum.length, 4096);
  near(spectrum.frequency[124], 125 * 1000 / 4096, 1e-9);
  near(spectrum.value[124], 4, 0.01, "amplitude of the sine in mm");
  for (const bin of [3, 124, 125, 299, 300, 1000, 2000]) near(spectrum.value[bin - 1], (direct(bin, hann) * 2 * 1e3) / 2048, 1e-9, `bin ${bin}`);
  await page.locator("#spectrum-window").selectOption("rectangular");
  await page.locator("#spectrum-quantity").selectOption("density");
  spectrum = await read();
  for (const bin of [3, 125, 299, 1000]) near(spectrum.value[bin - 1], direct(bin, () => 1) * 1e3 * Math.sqrt(2 / (1000 * 4096)), 1e-9, `density, bin ${bin}`);
  assert.ok(await page.locator("#spectrum-plot canvas").count() === 1);
  assert.match(await text(page, "#spectrum-summary"), /4096 frames, 4\.10 s/);
  await close(page);
});

test("estimates, their bands and the bounds of the NIS are those of the messages", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.value = (channel) => channel + 1;
    feed.frames(0, 1000);
    for (let i = 0; i < 1000; i += 10) feed.estimate(i, { mu: 0.3 + i / 1e4, nis: 1 + i / 100, raw_coefficient: i === 500 ? null : 0.31 });
    feed.estimate(999, { valid: false });
  });
  const mu = (await drawn(page, "mu")).data;
  assert.equal(mu[0].length, 101);
  for (let k = 0; k < 100; ++k) {
    assert.equal(mu[0][k], (k * 10e6) / 1e9);
    assert.equal(mu[1][k], 0.3 + (10 * k) / 1e4);
    assert.equal(mu[2][k], 0.3 + (10 * k) / 1e4 - 0.02);
    assert.equal(mu[3][k], 0.3 + (10 * k) / 1e4 + 0.02);
    assert.equal(mu[4][k], k === 50 ? null : 0.31);
  }
  assert.equal(mu[1][100], null, "what is not valid is not drawn");
  const gamma = (await drawn(page, "gamma_per_s")).data;
  assert.equal(gamma[1][3], 20);
  assert.equal(gamma[2][3], null, "no deviation, no band");
  const nis = (await drawn(page, "nis")).data;
  near(nis[2][0], 0.831212, 1e-6, "lower bound, 5 degrees of freedom");
  near(nis[3][0], 12.832502, 1e-6, "upper bound");
  assert.equal(nis[1][50], 6);
  const force = (await drawn(page, "friction_force_n")).data;
  near(force[1][10], 0.2 * Math.sin(0.1), 1e-15);
  near(force[4][10], 0.21 * Math.sin(0.1), 1e-15);
  await close(page);
});

test("state, fault and its cause, ledger, verdict, timing and events are shown; text stays text", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.text({ type: "model", rig: "Beam <b>II</b>", marks: [{ name: "natural frequency", hz: 2.5 }] });
    feed.frames(0, 1000);
    feed.status();
    feed.event(1, "model_broken", "the rig does not follow its model: residuals have 4 times the power of the noise");
    feed.event(0, "started", "<img src=x onerror=alert(1)> was here", 1.69e15);
    feed.event(1, "model_broken", "the rig does not follow its model: residuals have 4 times the power of the noise"); // repeated for a new connection
    feed.text({ type: "timing", upper_edge_ns: [1000, 10000, 100000], lateness: [5, 90, 5], cycle: [0, 10, 90], read: [0, 0, 0], cycles: 100 });
  });
  await until(page, () => document.querySelector("#state-chip").textContent === "running");
  assert.equal(await text(page, "#rig-name"), "Beam <b>II</b>");
  assert.match(await text(page, "#ledger"), /on its way\s+10\s+20/);
  const recording = page.locator("#recording-chip");
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["recording", "good"]);
  const recorded = (free_bytes) => page.evaluate((free_bytes) => feed.text({ type: "recorder", utc_us: 1.7e15, file: "/data/run.001.log",
    part: 1, file_bytes: 4e6, bytes: 1e7, length_us: 3.725e9, free_bytes, failing: false }), free_bytes);
  await recorded(4e11);
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["recording 1:02:05", "good"]);
  assert.match(await text(page, "#recording"), /file\s+run\.001\.log\s+length\s+1:02:05\s+size\s+10\.0 MB\s+left on its disk\s+1724 days \(400 GB\)/);
  await recorded(1e6);
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["recording 1:02:05, 6:12 left", "warn"]);
  await recorded(4e11);
  assert.match(await text(page, "#verdict"), /✕ The rig does not follow its model: residuals have 4 times/);
  await page.evaluate(() => feed.event(1, "model_explained", "probable cause of the model mismatch: mu is 0.9", 1.705e15));
  assert.match(await text(page, "#verdict"), /✕ Probable cause of the model mismatch: mu is 0\.9\. First alarm 22:13:20 UTC: the rig does not follow its model/);
  assert.equal(await page.locator("#event-list li").count(), 3);
  assert.match(await text(page, "#event-list li:nth-child(3)"), /<img src=x/);
  assert.equal(await page.locator("#event-list img, #rig-name b").count(), 0);
  await page.locator("#timing").scrollIntoViewIfNeeded();
  await until(page, () => document.querySelector('[data-timing="lateness"] p').textContent !== "");
  assert.match(await page.locator('[data-timing="lateness"] p').textContent(), /median ≤ 10\.0 µs, 99 % ≤ 100 µs, all ≤ 100 µs; 100 counted/);
  await page.evaluate(() => {
    feed.status({ state: "faulted", interlock: "emergency_stop", cause: "the emergency stop is pressed", amplifier_on: false, record_loss: { ring_full: 7, disk: 0 } });
    feed.event(0, "model_follows", "the rig follows its model again", 1.71e15);
  });
  assert.equal(await text(page, "#state-chip"), "faulted");
  assert.equal(await text(page, "#amplifier-chip"), "amplifier off");
  assert.match(await text(page, "#fault"), /emergency stop: the emergency stop is pressed/);
  await until(page, () => document.querySelector("#banner").textContent.includes("the emergency stop is pressed"));
  assert.equal(await page.locator("#ledger td[data-state=bad]").innerText(), "7");
  assert.match(await text(page, "#verdict"), /● The rig follows its model again/);
  assert.match(await page.locator("#spoken").textContent(), /The rig is faulted/);
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["recording loses frames: 7", "bad"]);
  await page.evaluate(() => feed.status({ record_loss: { ring_full: 7, disk: 0 } }));
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["recording 1:02:05, 7 lost", "warn"]);
  await page.evaluate(() => {
    feed.event(2, "log_missing", "run.log was deleted", 1.72e15);
    feed.status({ record_loss: { ring_full: 7, disk: 0 } });
  });
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["log missing", "bad"]);
  await page.evaluate(() => {
    feed.event(2, "log_begun_anew", "run.log was deleted", 1.73e15);
    feed.status({ recording: false });
  });
  assert.deepEqual([await recording.textContent(), await recording.getAttribute("data-state")], ["not recorded", "unknown"]);
  await close(page);
});

const chips = (page) => page.evaluate(() => [...document.querySelectorAll(".chip")].map((chip) => [chip.textContent, chip.dataset.state]));

test("a server that says nothing greys every state within a second or so, counting, and is given up", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.frames(0, 1000);
    feed.status();
    feed.event(0, "model_follows", "the rig follows its model");
  });
  await until(page, () => stickslip.state().fresh);
  const fresh = [["running", "good"], ["amplifier on", "good"], ["recording", "good"], ["rig follows model", "good"], ["connected", "good"]];
  assert.deepEqual(await chips(page), fresh);
  // Heartbeats alone, without frames, keep the link and, with a status each second, the states.
  await page.evaluate(() => { feed.beat = { connected: false, silent_s: 4, status_s: 0.3 }; });
  await until(page, () => document.querySelector("#link-chip").textContent === "connected, no frames");
  assert.deepEqual((await chips(page)).slice(0, 4), fresh.slice(0, 4));
  // A status from before the silence says nothing of now.
  const was = [["was: running", "unknown"], ["was: amplifier on", "unknown"], ["was: recording", "unknown"], ["was: rig follows model", "unknown"]];
  await page.evaluate(() => { feed.beat = { connected: false, silent_s: 4, status_s: 4.2 }; });
  await until(page, () => !stickslip.state().fresh);
  assert.deepEqual((await chips(page)).slice(0, 4), was);
  await page.evaluate(() => { feed.beat = { connected: true, silent_s: 0, status_s: 0 }; });
  await until(page, () => stickslip.state().fresh && document.querySelector("#banner").hidden);
  // The server hangs.
  const quiet_ms = await page.evaluate(async () => {
    feed.beat = null;
    const began = performance.now();
    while (stickslip.state().fresh) await new Promise((resolve) => setTimeout(resolve, 20));
    return performance.now() - began;
  });
  assert.ok(quiet_ms > 700, `${quiet_ms} ms`);
  assert.deepEqual(await chips(page), [...was, ["no answer", "bad"]]);
  await until(page, () => /does not answer.* Since \d\d:\d\d:\d\d UTC, for [2-9] s\./.test(document.querySelector("#banner").textContent));
  assert.equal(await page.evaluate(() => document.body.dataset.moving), "no");
  // The connection is given up, which a half-open one would never be, and another is made.
  await until(page, () => feed.sockets.length === 2, undefined, 20000);
  assert.deepEqual((await chips(page)).slice(0, 4), was);
  await page.evaluate(() => { feed.beat = { connected: true, silent_s: 0, status_s: 0 }; feed.open(); feed.status(); });
  await until(page, () => stickslip.state().fresh && document.querySelector("#banner").hidden);
  assert.deepEqual(await chips(page), fresh);
  await close(page);
});

test("a page without its server asks for it each second, however long it is away", async () => {
  const page = await open();
  const waits = [];
  for (let i = 0; i < 12; ++i) {
    await page.evaluate(() => { feed.sockets[feed.sockets.length - 1].readyState = 1; feed.drop(); });
    await until(page, () => stickslip.state().link === "waiting");
    waits.push((await state(page)).wait_s);
    await page.locator("#screen").focus();
    await page.keyboard.press("r");
    await until(page, () => stickslip.state().link === "connecting");
  }
  assert.ok(Math.max(...waits) <= 1, `waits of ${waits} s`);
  assert.ok(Math.min(...waits) > 0.1);
  await close(page);
});

test("a fault freezes what came before it, the rig goes on beside it, and a restart leaves the picture", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.frames(0, 20000, { per: 1000 });
    feed.status();
    feed.text({ type: "event", utc_us: 1.7e15, time_ns: 19.2e9, sequence: 19200, severity: 2, code: "fault", message: "amplifier off: too far" });
    feed.status({ state: "faulted", interlock: "displacement", cause: "too far" });
  });
  await until(page, () => stickslip.state().paused);
  const frozen = await drawn(page, "velocity");
  near(frozen.left_ns + 0.8 * frozen.span_ns, 19.2e9, 1e3, "the fault stands at four fifths of the screen");
  await until(page, () => /frozen at the fault of \d\d:\d\d:\d\d/.test(document.querySelector("#screen-note").textContent));
  await page.evaluate(() => feed.frames(20000, 5000, { per: 1000 }));
  assert.deepEqual((await drawn(page, "velocity")).points, frozen.points);
  await until(page, () => stickslip.state().beside > 200 && /Live: displacement/.test(document.querySelector("#beside-text").textContent));
  // The daemon is restarted: another picture begins, beside the frozen one.
  await page.evaluate(() => { feed.text({ type: "restart" }); feed.t0_ns = 100_000_000_000n; feed.frames(0, 3000, { per: 1000 }); });
  assert.deepEqual((await drawn(page, "velocity")).points, frozen.points);
  assert.equal((await held(page, "frames", 0)).sequence.length, 20000);
  assert.equal((await held(page, "frames", 0, -Infinity, Infinity, true)).sequence.length, 3000);
  await until(page, () => document.querySelector("#screen-note").textContent.includes("the daemon was restarted since"));
  await page.locator("#beside-go").click();
  assert.equal((await held(page, "frames", 0)).sequence.length, 3000);
  near((await drawn(page, "velocity")).left_ns, 102.999e9 - 10e9, 1e3);
  // Back to the fault, and on.
  await page.locator("#to-fault").click();
  assert.deepEqual((await drawn(page, "velocity")).points, frozen.points);
  await page.keyboard.press("p");
  // A fault that lasts does not freeze again; with the option off, none does.
  await page.evaluate(() => feed.status({ state: "faulted" }));
  assert.equal((await state(page)).paused, false);
  await page.locator("#freeze-on-fault").uncheck();
  await page.evaluate(() => { feed.status(); feed.status({ state: "faulted" }); });
  assert.equal((await state(page)).paused, false);
  await close(page);
});

test("several rigs are named, and one is chosen", async () => {
  const page = await open();
  const rigs = [{ id: "10.0.0.1:4000", former_ids: [], rig: "bench", connected: true }, { id: "10.0.0.2:4001", former_ids: [], rig: "<b>other</b>", connected: false }];
  await page.evaluate((rigs) => { feed.text({ type: "sources", current: rigs[0].id, sources: rigs.slice(0, 1) }); feed.frames(0, 500); }, rigs);
  assert.equal(await page.locator("#source-field").isVisible(), false, "one rig is no choice");
  await page.evaluate((sources) => feed.text({ type: "sources", current: sources[0].id, sources }), rigs);
  assert.deepEqual(await page.locator("#source option").allTextContents(), ["bench, 10.0.0.1:4000", "<b>other</b>, 10.0.0.2:4001, silent"]);
  assert.equal(await page.locator("#source").inputValue(), rigs[0].id);
  await page.locator("#source").selectOption(rigs[1].id);
  assert.match(await page.evaluate(() => feed.sockets[feed.sockets.length - 1].url), /\/stream\?source=10\.0\.0\.2%3A4001$/);
  await page.evaluate((sources) => { feed.open(); feed.text({ type: "sources", current: sources[0].id, sources }); feed.frames(7000, 10); }, rigs);
  assert.equal(await page.locator("#source").inputValue(), rigs[1].id);
  assert.equal((await held(page, "frames", 0)).sequence.length, 10, "nothing of the first rig is left");
  // Its daemon is restarted, under another id.
  await page.evaluate((sources) => feed.text({ type: "sources", current: sources[0].id, sources: [sources[0], { ...sources[1], id: "10.0.0.2:5000", former_ids: ["10.0.0.2:4001"] }] }), rigs);
  assert.equal(await page.locator("#source").inputValue(), "10.0.0.2:5000");
  assert.match(page.url(), /source=10\.0\.0\.2%3A4001/);
  await close(page);
});

test("a coefficient of friction is not drawn where the load is near zero", async () => {
  const page = await open();
  await page.evaluate(() => {
    // The load falls from 10 N to 0.1 N, which the portrait would be scaled to, and below zero.
    feed.value = (channel, t) => (channel === 3 ? (t < 1 ? 10 : t < 1.5 ? 0.1 : -0.2) : channel === 2 ? 2 : Math.sin(20 * t));
    feed.frames(0, 2000, { per: 100 });
    for (let i = 0; i < 2000; i += 10) feed.estimate(i, { raw_coefficient: i < 1000 ? 0.2 : 20 });
  });
  const loop = await drawn(page, "friction-velocity");
  const drawnMu = loop.points.filter((value, i) => i % 2 === 1 && value !== null);
  assert.equal(drawnMu.length, 1000);
  assert.ok(drawnMu.every((mu) => mu === 0.2));
  assert.ok(loop.limits.yHigh < 1);
  assert.match(await text(page, '[data-portrait="friction-velocity"] p'), /not drawn where N < 5 %/);
  const { data } = await drawn(page, "mu");
  data[0].forEach((time, k) => assert.equal(data[4][k], time < 1 ? 0.2 : null, `raw at ${time} s`));
  await close(page);
});

test("identical events are one line with their number; a filter; marks on the traces; either clock", async () => {
  const page = await open();
  const lines = () => page.locator("#event-list li:visible").evaluateAll((items) => items.map((item) => [...item.children].map((child) => child.textContent)));
  await page.evaluate(() => {
    feed.frames(0, 10000, { per: 1000, received_unix_ms: 1.7e12 + 9999 });
    const event = (severity, code, message, second) => feed.text({ type: "event", utc_us: 1.7e15 + second * 1e6, time_ns: second * 1e9, sequence: second * 1000, severity, code, message });
    for (const second of [3, 4, 5, 5]) event(1, "late_cycles", "a cycle was late", second); // the last is repeated for a new connection
    event(2, "fault", "amplifier off: the emergency stop is pressed", 6);
    event(0, "note", "all is well", 8);
  });
  assert.deepEqual(await lines(), [["8.000 s", "note", "", "all is well"], ["6.000 s", "fault", "", "amplifier off: the emergency stop is pressed"], ["5.000 s", "late cycles", "3 times", "a cycle was late"]]);
  // On the traces, at their times.
  const picture = await drawn(page, "displacement");
  const seconds = async () => (await state(page)).markers.map(({ x, code }) => `${code} ${((picture.left_ns + ((x - picture.plot.left) / picture.plot.width) * picture.span_ns) / 1e9).toFixed(3)}`);
  assert.deepEqual(await seconds(), ["note 8.000", "fault 6.000", "late_cycles 3.000", "late_cycles 4.000", "late_cycles 5.000"]);
  // The filter is of the list and the marks.
  await page.locator("#event-severity").selectOption("1");
  assert.equal((await lines()).length, 2);
  await page.locator("#event-words").fill("late");
  assert.deepEqual((await lines()).map(([, code]) => code), ["late cycles"]);
  await drawn(page, "displacement");
  assert.equal((await state(page)).markers.length, 3);
  await page.locator("#event-words").fill("nothing");
  assert.equal(await text(page, "#no-event"), "None that the filter leaves.");
  await page.locator("#event-words").fill("");
  await page.locator("#event-severity").selectOption("0");
  // UTC, of the events and of the axis.
  await page.locator("#clock").click();
  assert.deepEqual((await lines()).map(([time]) => time), ["22:13:28.000", "22:13:26.000", "22:13:25.000"]);
  await page.keyboard.press("c");
  await page.locator("#cursor-a").focus();
  await page.keyboard.press("Home");
  // The left edge is 10 s before the newest frame, of 9.999 s.
  await until(page, () => /^22:13:19\.999\d* UTC$/.test(document.querySelector("#cursor-a").getAttribute("aria-valuetext")));
  await page.locator("#screen").focus();
  await page.keyboard.press("d");
  assert.equal((await lines())[0][0], "8.000 s");
  // The cause of the amplifier being off stays on top, under many later events.
  assert.equal(await page.locator("#event-pinned").isVisible(), false);
  await page.evaluate(() => {
    feed.status();
    feed.status({ state: "faulted", interlock: "emergency_stop", cause: "the emergency stop is pressed", amplifier_on: false });
    for (let i = 0; i < 300; ++i) feed.text({ type: "event", utc_us: 1.7001e15 + i, time_ns: 9e9, sequence: 1, severity: 1, code: "later", message: `number ${i}` });
  });
  assert.equal(await text(page, "#event-pinned"), "Amplifier switched off, 6.000 s: the emergency stop is pressed");
  assert.equal((await lines()).length, 200);
  await page.evaluate(() => feed.status());
  assert.equal(await page.locator("#event-pinned").isVisible(), false);
  // An event leads to its place on the traces.
  await page.keyboard.press("p");
  await page.locator("#event-list button").first().click();
  near((await state(page)).left_ns + 5e9, 9e9, 1e3);
  await close(page);
});

test("a note is sent if the server takes notes, and stands on the traces and in the list", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 12000, { per: 1000 }));
  assert.ok(await page.locator("#note-form").isHidden(), "the server does not say that it takes them");
  await page.locator("#screen").focus();
  await page.keyboard.press("w");
  await page.evaluate(() => feed.text({ type: "hello", version: "test", program: "stickslip scope", history_s: 60, url: "memq://", notes: true, recording: false }));
  await page.keyboard.press("w");
  await page.keyboard.type("weights changed: 450 g; c p");
  assert.equal((await state(page)).paused, false, "letters of a note are no keys");
  const sent = () => page.evaluate(() => feed.sockets.at(-1).sent);
  await page.keyboard.press("Enter");
  await page.keyboard.press("Enter"); // before the answer
  assert.deepEqual((await sent()).map((text) => JSON.parse(text)), [{ note: "weights changed: 450 g; c p" }]);
  await page.evaluate(() => feed.text({ type: "note", taken: false, refusal: "the daemon <b>refuses</b>" }));
  assert.equal(await text(page, "#note-answer"), "Not taken: the daemon <b>refuses</b>");
  assert.equal(await page.locator("#note").inputValue(), "weights changed: 450 g; c p", "it can be sent again");
  await page.keyboard.press("Enter");
  assert.equal((await sent()).length, 2);
  await page.evaluate(() => {
    feed.text({ type: "note", taken: true, refusal: "" });
    feed.text({ type: "event", utc_us: 1.7e15, time_ns: 8e9, sequence: 8000, severity: 0, code: "note", message: "weights changed: 450 g; c p" });
  });
  assert.equal(await text(page, "#note-answer"), "Noted.");
  assert.equal(await page.locator("#note").inputValue(), "");
  assert.match(await text(page, "#event-list"), /note\s+weights changed: 450 g; c p/);
  await drawn(page, "none");
  const { markers, plot } = await state(page);
  assert.equal(markers.length, 1);
  assert.equal(markers[0].note, "weights changed: 450 g; c p");
  assert.equal(markers[0].shown, markers[0].note, "in the strip of a title");
  near(markers[0].x, plot.left + plot.width * ((8 - (11.999 - 10)) / 10), 2);
  if (process.env.PICTURES) await page.screenshot({ path: `${process.env.PICTURES}/note.png` });
  // Without a connection it is kept.
  await page.locator("#note").fill("later");
  await page.evaluate(() => feed.drop());
  await page.locator("#note").press("Enter");
  assert.match(await text(page, "#note-answer"), /^Not connected/);
  assert.equal(await page.locator("#note").inputValue(), "later");
  await close(page);
});

test("a paused spectrum and portrait are of the window that is seen, and a chosen zoom holds", async () => {
  const page = await open();
  await page.evaluate(() => {
    // 20 Hz for ten seconds, then 50 Hz.
    feed.value = (channel, t) => (channel === 5 ? NaN : Math.sin(2 * Math.PI * (t < 10 ? 20 : 50) * t) * (t < 10 ? 1 : 3));
    feed.frames(0, 20000, { per: 1000 });
  });
  await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
  await page.locator("#spectrum-length").selectOption("4096");
  const peak = async () => {
    const { frequency, value } = await drawn(page, "spectrum");
    return frequency[value.indexOf(Math.max(...value))];
  };
  await until(page, async () => { const { frequency, value } = await stickslip.drawn("spectrum"); return Math.abs(frequency[value.indexOf(Math.max(...value))] - 50) < 1; });
  assert.ok(Math.max(...(await drawn(page, "phase")).points.filter(Number.isFinite)) > 2500);
  // Back to the first ten seconds.
  await page.locator("#time-base").selectOption("5");
  await page.locator("#screen").focus();
  for (let i = 0; i < 2; ++i) await page.keyboard.press("Shift+ArrowLeft");
  await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
  await until(page, async () => { const { frequency, value } = await stickslip.drawn("spectrum"); return Math.abs(frequency[value.indexOf(Math.max(...value))] - 20) < 1; });
  assert.ok(Math.max(...(await drawn(page, "phase")).points.filter(Number.isFinite)) <= 1000);
  assert.ok((await drawn(page, "spectrum")).newest <= 10001);
  await page.keyboard.press("p");
  // The strip of a pause takes its height with it, and the plot is built anew.
  await until(page, () => document.querySelector("#beside").hidden);
  await drawn(page, "none");
  // Zoom by dragging; it holds while data comes, and until a double click.
  await page.locator("#spectrum-plot .u-over").waitFor();
  await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
  const box = await page.locator("#spectrum-plot .u-over").boundingBox();
  await page.mouse.move(box.x + box.width * 0.5, box.y + 50);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.7, box.y + 50, { steps: 3 });
  await page.mouse.up();
  const { zoom, scale } = await drawn(page, "spectrum");
  assert.ok(zoom.max > zoom.min && zoom.min > 1 && zoom.max < 400, JSON.stringify(zoom));
  assert.deepEqual(scale, zoom);
  const { newest } = await drawn(page, "spectrum");
  await page.evaluate(() => feed.frames(20000, 5000, { per: 1000 }));
  await until(page, async (newest) => (await stickslip.drawn("spectrum")).newest > newest, newest);
  assert.deepEqual((await drawn(page, "spectrum")).scale, zoom);
  await page.mouse.dblclick(box.x + box.width * 0.5, box.y + 50);
  await until(page, async () => (await stickslip.drawn("spectrum")).scale.max > 400);
  // A plot that is to be built anew during the drag, as at the end of a pause, waits for its end.
  await page.mouse.move(box.x + box.width * 0.5, box.y + 50);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.6, box.y + 50, { steps: 3 });
  await page.evaluate(() => { document.querySelector("#spectrum-plot canvas").dataset.old = "yes"; });
  await page.setViewportSize({ width: 1000, height: 700 });
  await page.evaluate(() => new Promise((resolve) => { requestAnimationFrame(() => requestAnimationFrame(resolve)); }));
  await page.mouse.move(box.x + box.width * 0.7, box.y + 50, { steps: 3 });
  await page.mouse.up();
  await until(page, () => document.querySelector("#spectrum-plot canvas")?.dataset.old === undefined);
  const again = await drawn(page, "spectrum");
  near(again.zoom.min, zoom.min, 0.1 * zoom.min);
  near(again.zoom.max, zoom.max, 0.1 * zoom.max);
  await until(page, async ({ min, max }) => { const { scale } = await stickslip.drawn("spectrum"); return scale?.min === min && scale.max === max; }, again.zoom);
  await page.locator("#spectrum-plot .u-over").dblclick();
  await until(page, async () => (await stickslip.drawn("spectrum")).scale.max > 400);
  assert.equal(await peak() > 49, true);
  await close(page);
});

test("the window is exported as CSV that the tools read, to the bit, and as a picture with the cursors", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.t0_ns = 4_611_686_018_427_387_904n;
    feed.text({ type: "model", rig: "bench 7", marks: [] });
    feed.value = (channel, t) => (channel === 5 || (channel === 3 && t > 11) ? NaN : Math.sin(7 * t + channel) / 3);
    feed.frames(0, 12000, { per: 1000 });
  });
  await page.locator("#time-base").selectOption("2");
  await drawn(page, "displacement");
  await page.keyboard.press("c");
  const saved = async (id) => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.locator(id).click()]);
    return { name: download.suggestedFilename(), file: await download.path() };
  };
  const csv = await saved("#export-csv");
  assert.match(csv.name, /^bench-7-\d{8}T\d{6}Z\.csv$/);
  const lines = fs.readFileSync(csv.file, "utf8").trimEnd().split("\n");
  assert.match(lines[0], /^# bench 7, exported by stickslip scope at /);
  assert.match(lines[1], /^# cursor A: 4611686029\.\d{9} s; x −?\d+\.\d+ mm, v −?\d+\.\d+ mm\/s, F /);
  assert.equal(lines[3], "time_s,displacement_m,velocity_m_s,friction_force_n,normal_load_n,base_displacement_m");
  const rows = lines.slice(4).map((line) => line.split(","));
  const { left_ns, span_ns } = await state(page);
  const data = await held(page, "frames", 1, left_ns, left_ns + span_ns);
  assert.equal(rows.length, data.value.length);
  rows.forEach((row, k) => {
    assert.equal(BigInt(row[0].replace(".", "")), 4_611_686_018_427_387_904n + BigInt(data.time_ns[k]));
    assert.ok(Object.is(Number(row[2]), data.value[k]));
  });
  assert.equal(rows.at(-1)[4], "", "not measured");
  const folder = temporaryFolder();
  fs.copyFileSync(csv.file, path.join(folder, "window.csv"));
  run(stickslip, ["convert", path.join(folder, "window.csv"), path.join(folder, "window.log")]);
  assert.match(run(stickslip, ["log", "info", path.join(folder, "window.log")]), new RegExp(`${rows.length}`));
  fs.rmSync(folder, { recursive: true });
  // The picture has the traces, and both cursors in the text colour.
  const png = await saved("#export-png");
  const pixels = await page.evaluate(async (base64) => {
    const picture = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))]));
    const canvas = new OffscreenCanvas(picture.width, picture.height);
    const context = canvas.getContext("2d");
    context.drawImage(picture, 0, 0);
    const { plot, cursors, left_ns: left, span_ns: span } = stickslip.state();
    const dark = cursors.map((at) => {
      const x = Math.round(plot.left + ((at - left) / span) * plot.width);
      let count = 0;
      for (let y = 0; y < plot.height; ++y) { const [r, g, b] = context.getImageData(x, y, 1, 1).data; if (r < 60 && g < 70 && b < 80) count += 1; }
      return count / plot.height;
    });
    return { width: picture.width, height: picture.height, box: document.querySelector("#screen").getBoundingClientRect().toJSON(), dark };
  }, fs.readFileSync(png.file).toString("base64"));
  near(pixels.width, pixels.box.width, 1);
  assert.ok(pixels.height > pixels.box.height + 30, "with lines of text below");
  assert.ok(pixels.dark[0] > 0.8 && pixels.dark[1] > 0.3, `cursors: ${pixels.dark}`);
  await close(page);
});

test("without a key the wheel scrolls the page; titles stand above the traces; decimals are fixed", async () => {
  const page = await open();
  await page.evaluate(() => { feed.value = (channel, t) => 0.0125 * (channel + 1) * (t < 5 ? 1 : 1e-3); feed.frames(0, 4000, { per: 1000 }); });
  const span = (await state(page)).span_s;
  const box = await page.locator("#screen").boundingBox();
  await page.mouse.move(box.x + 200, box.y + 100);
  await page.mouse.wheel(0, 200);
  await until(page, () => window.scrollY > 100);
  assert.equal((await state(page)).span_s, span);
  const lanes = [];
  for (const name of ["displacement", "velocity", "friction_force"]) lanes.push(await drawn(page, name));
  lanes.forEach((lane, i) => {
    const strip = lane.top - (i === 0 ? 0 : lanes[i - 1].top + lanes[i - 1].height);
    assert.ok(strip > 12, `${strip} px above channel ${i}`);
    const ys = lane.points.filter((_, k) => k % 2 === 1 && lane.points[k - 1] > -1e8);
    assert.ok(ys.every((y) => y >= lane.top - 0.01 && y <= lane.top + lane.height + 0.01));
  });
  const last = "#readings tbody tr:nth-child(1) td:nth-child(2)";
  await until(page, (last) => document.querySelector(last).textContent === "12.50", last);
  await page.evaluate(() => feed.frames(5000, 10, { per: 10 }));
  await until(page, (last) => document.querySelector(last).textContent === "0.01", last); // not 0.01250
  await close(page);
});

test("only frequencies that were declared are marked", async () => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 3000));
  assert.deepEqual((await drawn(page, "spectrum")).marks, [], "before a model is known");
  await page.evaluate(() => feed.text({ type: "model", rig: "a rig", marks: [{ name: "natural frequency", hz: 2.5 }] }));
  assert.deepEqual((await drawn(page, "spectrum")).marks, [{ name: "natural frequency", hz: 2.5 }]);
  await page.evaluate(() => feed.text({ type: "model", rig: "a rig", marks: [] }));
  assert.deepEqual((await drawn(page, "spectrum")).marks, [], "of a model without any");
  await close(page);
});

test("the page reconnects without duplicates; a restarted daemon starts a new picture", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.frames(0, 3000);
    feed.beat = null;
    feed.text({ type: "source", connected: false, silent_s: 3601 });
  });
  await until(page, () => /sends no frames.* Since \d\d:\d\d:\d\d UTC, for 60 min/.test(document.querySelector("#banner").textContent));
  await page.evaluate(() => { feed.beat = { connected: true, silent_s: 0, status_s: 0 }; });
  await page.evaluate(() => feed.drop("server is ending"));
  await until(page, () => document.querySelector("#banner").textContent.includes("No connection to stickslip scope (server is ending)"));
  await until(page, () => feed.sockets.length === 2);
  await page.evaluate(() => { feed.drop(); });
  await page.keyboard.press("r");
  assert.equal(await page.evaluate(() => feed.sockets.length), 3);
  await page.evaluate(() => { feed.open(); feed.text({ type: "source", connected: true, silent_s: 0 }); feed.frames(1000, 2000, { per: 1000, flags: 2 }); feed.frames(3000, 500); });
  assert.deepEqual([...(await held(page, "frames", 0)).sequence], [...Array(3500).keys()]);
  assert.equal((await state(page)).lost, 0);
  await until(page, () => document.querySelector("#banner").hidden);
  // Without a restart message: the sequence restarted while time went on; time went back.
  await page.evaluate(() => feed.bytes(feed.block(4000, 100, { shift: -4000 })));
  assert.deepEqual([...(await held(page, "frames", 0)).sequence], [...Array(100).keys()]);
  await page.evaluate(() => feed.frames(0, 50));
  assert.equal((await held(page, "frames", 0)).sequence.length, 50);
  await page.evaluate(() => { feed.text({ type: "restart" }); feed.frames(10, 20); });
  assert.equal((await held(page, "frames", 0)).sequence.length, 20);
  // Unknown messages are counted and ignored.
  await page.evaluate(() => { feed.bytes(new ArrayBuffer(24)); feed.bytes(new ArrayBuffer(0)); feed.text("{"); feed.bytes(feed.block(0, 5).slice(0, -8)); });
  assert.equal((await state(page)).refused, 4);
  assert.ok(await page.evaluate(() => feed.sockets.every((socket) => socket.sent.length === 0)), "the page sends nothing");
  await close(page);
});

test("drawn by WebGL, the traces have ink too", async () => {
  const page = await open({}, "?webgl=1");
  await page.evaluate(() => { feed.frames(0, 20000, { per: 1000 }); });
  assert.equal((await state(page)).renderer, "webgl2");
  const picture = await drawn(page, "velocity");
  const inked = await ink(page, "velocity");
  assert.ok(inked > 1000, `${inked} pixels of the oscilloscope`);
  assert.ok((await ink(page, "phase")) > 50);
  const plain = await open({}, "?webgl=0");
  await plain.evaluate(() => { feed.frames(0, 20000, { per: 1000 }); });
  assert.equal((await state(plain)).renderer, "canvas2d");
  assert.deepEqual((await drawn(plain, "velocity")).points, picture.points);
  const other = await ink(plain, "velocity");
  assert.ok(inked / other > 0.5 && inked / other < 2, `${inked} and ${other} pixels`);
  await close(page);
  await close(plain);
});

test("the cost of a minute on screen is bounded by its columns, not its frames", async (t) => {
  const page = await open();
  await page.evaluate(() => feed.frames(0, 61000, { per: 1000 }));
  const cost = {};
  for (const span of ["10", "60"]) {
    await page.locator("#time-base").selectOption(span);
    await drawn(page, "velocity");
    const picture = await drawn(page, "velocity");
    // Script time, minimum of many runs to exclude other load.
    const work_ms = await page.evaluate(async () => {
      let least = Infinity;
      for (let i = 0; i < 30; ++i) { await stickslip.drawn("none"); least = Math.min(least, stickslip.pace().scope_ms); }
      return least;
    });
    cost[span] = { touched: picture.touched, columns: picture.plot.width + 2, work_ms };
  }
  const { touched, columns } = cost["60"];
  t.diagnostic(`values looked at for one picture of 300000: ${touched}; script ${cost["60"].work_ms.toFixed(2)} ms at 60 s, ${cost["10"].work_ms.toFixed(2)} ms at 10 s`);
  // A column has at most 15 single frames at each side, and its blocks of 16 between.
  assert.ok(touched <= 5 * columns * (30 + Math.ceil(60000 / columns / 16)), `${touched} values for ${columns} columns`);
  assert.ok(touched < 6 * 50000, "fewer than there are");
  assert.ok(cost["60"].touched < 3 * cost["10"].touched, "six times as many frames are not three times as much");
  await close(page);
});

test("memory is constant over half an hour", async (t) => {
  const page = await open({ width: 1000, height: 700 });
  const session = await page.context().newCDPSession(page);
  const heap = async () => {
    await session.send("HeapProfiler.collectGarbage");
    return (await session.send("Runtime.getHeapUsage")).usedSize;
  };
  // Half an hour of all messages at full speed, with a picture every 20 s.
  const minutes = (from, to) => page.evaluate(async ([from, to]) => {
    feed.value = (channel, t) => (channel === 5 ? NaN : channel + (t % 1));
    for (let second = from * 60; second < to * 60; second += 2) {
      const i = second * 1000;
      for (let k = i; k < i + 2000; k += 500) {
        feed.bytes(feed.block(k, 500));
        feed.excitation(k, 50, 3.2, 0.01);
        for (let e = 0; e < 4; ++e) feed.estimate(k + 125 * e);
      }
      feed.status({ utc_us: 1.7e15 + second * 1e6 });
      feed.event(0, "note", `second ${second}`, 1.7e15 + second * 1e6);
      if (second % 20 === 0) await new Promise(requestAnimationFrame);
    }
  }, [from, to]);
  await minutes(0, 8);
  const before = { heap: await heap(), sizes: await page.evaluate(() => stickslip.sizes()) };
  await minutes(8, 30);
  const later = { heap: await heap(), sizes: await page.evaluate(() => stickslip.sizes()) };
  t.diagnostic(`heap after 8 min ${(before.heap / 1e6).toFixed(2)} MB, after 30 min ${(later.heap / 1e6).toFixed(2)} MB; rings ${(later.sizes.live.bytes / 1e6).toFixed(1)} MB`);
  assert.equal(later.sizes.live.bytes, before.sizes.live.bytes);
  assert.ok(later.sizes.live.held >= 60000, "a minute and more is held");
  assert.equal(later.sizes.events, 200);
  assert.equal(await page.locator("#event-list li").count(), 200);
  assert.ok(later.heap < before.heap + 1.5e6, `the heap grew from ${before.heap} to ${later.heap} bytes`);
  await close(page);
});

for (const [name, options, keys] of [["large", { width: 1500 }, ["b"]], ["phone", { width: 390, height: 844, isMobile: true }, []]]) {
  test(`each channel has a scale: ${name}`, async () => {
    const page = await open(options);
    await page.evaluate(() => feed.frames(0, 12000, { per: 1000 }));
    await page.locator("#screen").focus();
    for (const key of keys) await page.keyboard.press(key);
    for (const channel of ["displacement", "velocity", "friction_force", "normal_load", "base_displacement"]) {
      const { labels } = await drawn(page, channel);
      assert.ok(labels.length >= 2, `${channel}: ${labels}`);
    }
    await close(page);
  });
}

for (const [name, options] of [["desk", {}], ["phone", { width: 390, height: 844, isMobile: true, hasTouch: true }]]) {
  test(`accessible: ${name}`, async () => {
    const page = await open(options);
    await page.evaluate(() => {
      feed.text({ type: "hello", version: "test", program: "stickslip scope", history_s: 60, url: "memq://", notes: true, recording: false });
      feed.frames(0, 12000, { per: 1000 });
      feed.excitation(0, 12000, 3.2, 0.01);
      for (let i = 0; i < 12000; i += 100) feed.estimate(i);
      feed.text({ type: "timing", upper_edge_ns: [1000, 10000, 100000], lateness: [5, 90, 5], cycle: [0, 10, 90], read: [1, 0, 0], cycles: 100 });
      feed.status({ state: "faulted", interlock: "emergency_stop", cause: "the emergency stop is pressed" });
      feed.event(2, "emergency_stop", "pressed");
      feed.event(1, "model_broken", "friction law");
      feed.event(1, "timing_degraded", "late");
    });
    await page.locator(".channel-settings summary").click();
    await page.locator("#spectrum-show").selectOption("response");
    await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
    await until(page, () => !document.querySelector("#banner").hidden && document.querySelector("#spectrum-plot canvas") !== null);
    await lookForBarriers(page, "light");
    await page.emulateMedia({ colorScheme: "dark" });
    await lookForBarriers(page, "dark");
    if (name === "desk") {
      for (const key of ["b", "c", "t"]) await page.keyboard.press(key);
      await lookForBarriers(page, "large, with cursors and a trigger");
      await page.keyboard.press("?");
      await lookForBarriers(page, "help");
    }
    await close(page);
  });
}
