// SPDX-License-Identifier: Apache-2.0
// The view of the page of `stickslip scope`: channels that share a lane, and the address that keeps it.
import assert from "node:assert/strict";
import { test } from "node:test";
import { close, ink, near, open, state } from "./fed_page.mjs";
import { drawn, until } from "./programs.mjs";

const values = (t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 0.15 * Math.cos(5 * t), 0.5 + 0.02 * Math.sin(3 * t), 0.001 * t];
const feedRig = (page, from = 0, count = 12000) => page.evaluate(([from, count]) => {
  feed.value = (c, t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 0.15 * Math.cos(5 * t), 0.5 + 0.02 * Math.sin(3 * t), 0.001 * t, NaN][c];
  feed.frames(from, count, { per: 1000 });
}, [from, count]);
const choose = (page, channel, lane) => page.locator(`#channel-settings select[aria-label="${channel}: lane"]`).selectOption({ label: lane });

// The trace is drawn at the values of the frames: the least and the greatest of each column.
function assertTrace(picture, channel, factor) {
  const scale = picture.height / (picture.high - picture.low);
  let columns = 0;
  for (let i = 0; i + 1 < picture.points.length / 2; i += 2) {
    const x = picture.points[2 * i];
    assert.ok(x > -1e8);
    const column = Math.round(x - picture.plot.left - 0.5 + (picture.left_ns - picture.firstColumn * picture.column_ns) / picture.column_ns) + picture.firstColumn;
    const from = Math.max(0, Math.ceil((column * picture.column_ns) / 1e6 - 1e-9));
    const to = Math.min(12000, Math.ceil(((column + 1) * picture.column_ns) / 1e6 - 1e-9));
    if (to <= from) continue;
    const there = Array.from({ length: to - from }, (_, k) => values((from + k) / 1000)[channel] * factor);
    const ys = [picture.points[2 * i + 1], picture.points[2 * i + 3]].map((y) => picture.low + (picture.top + picture.height - y) / scale);
    near(Math.min(...ys), Math.min(...there), 0.02 / scale, `channel ${channel}, column ${column}: least`);
    near(Math.max(...ys), Math.max(...there), 0.02 / scale, `channel ${channel}, column ${column}: greatest`);
    columns += 1;
  }
  assert.ok(columns > 0.95 * picture.plot.width, `${columns} columns`);
}

for (const webgl of [0, 1]) {
  test(`channels share a lane, and its scale if they have one unit: webgl=${webgl}`, async () => {
    const page = await open({}, `?webgl=${webgl}`);
    await feedRig(page);
    await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
    const alone = await drawn(page, "friction_force");
    await page.locator(".channel-settings summary").click();
    await choose(page, "Normal load", "of F");
    await choose(page, "Velocity", "of x");
    const [x, v, force, load, base] = [await drawn(page, "displacement"), await drawn(page, "velocity"), await drawn(page, "friction_force"), await drawn(page, "normal_load"), await drawn(page, "base_displacement")];
    assert.deepEqual([v.top, v.height, load.top, load.height], [x.top, x.height, force.top, force.height]);
    assert.ok(force.top > x.top + x.height && base.top > force.top + force.height, "three lanes below one another");
    assert.ok(force.height > 1.5 * alone.height, "which are higher");
    // One unit, one scale, which holds both; else each its own.
    assert.deepEqual([load.low, load.high], [force.low, force.high]);
    assert.ok(force.low <= -0.15 && force.high >= 0.52);
    assert.ok(x.high < 20 && v.high >= 60 && v.high < 120);
    for (const [picture, channel, factor] of [[x, 0, 1e3], [v, 1, 1e3], [force, 2, 1], [load, 3, 1], [base, 4, 1e3]]) assertTrace(picture, channel, factor);
    assert.match(v.title, /^v {2}velocity −80\.0 … 80\.0 mm\/s$/);
    assert.equal(load.title, "N  normal load");
    assert.equal(x.title, "x  displacement (mm)");
    const both = await ink(page, "none");
    // Of a hidden host the next one leads.
    await page.locator("#screen").focus();
    await page.keyboard.press("1");
    const led = await drawn(page, "velocity");
    assert.equal(led.title, "v  velocity (mm/s)");
    near(led.top, x.top, 1e-9);
    assert.ok((await ink(page, "none")) < both - 500);
    await page.keyboard.press("1");
    // Shift and the wheel scale both; the view is reset.
    await page.evaluate(() => window.scrollTo(0, 0));
    const box = await page.locator("#screen").boundingBox();
    await page.mouse.move(box.x + 200, box.y + force.top + 20);
    await page.keyboard.down("Shift");
    await page.mouse.wheel(0, 200);
    await page.keyboard.up("Shift");
    await until(page, async (high) => { const now = await stickslip.drawn("normal_load"); return now.high > high; }, load.high);
    const [wide, wider] = [await drawn(page, "friction_force"), await drawn(page, "normal_load")];
    assert.deepEqual([wide.low, wide.high], [wider.low, wider.high]);
    await page.keyboard.press("0");
    assert.deepEqual(((now) => [now.low, now.high])(await drawn(page, "normal_load")), [load.low, load.high]);
    await choose(page, "Normal load", "its own");
    assert.notEqual((await drawn(page, "normal_load")).top, (await drawn(page, "friction_force")).top);
    await close(page);
  });

  test(`a copied address opens the same view: webgl=${webgl}`, async () => {
    const page = await open({}, `?webgl=${webgl}`);
    await feedRig(page);
    await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
    assert.equal(new URL(page.url()).search, `?webgl=${webgl}`, "no view that was not changed");
    await page.locator(".channel-settings summary").click();
    await choose(page, "Normal load", "of F");
    await page.locator("#time-base").selectOption("5");
    await page.locator("#expression").fill("F*v + 2^2");
    await page.locator("#expression").press("Enter");
    const low = page.locator('#channel-settings input[aria-label="Velocity: low limit"]');
    await low.fill("-55");
    await low.press("Enter");
    await page.locator("#screen").focus();
    for (const key of ["5", "7"]) await page.keyboard.press(key);
    const before = await drawn(page, "displacement");
    await page.evaluate(() => window.scrollTo(0, 0));
    const box = await page.locator("#screen").boundingBox();
    await page.mouse.move(box.x + 200, box.y + 30);
    await page.keyboard.down("Shift");
    await page.mouse.wheel(0, 300);
    await page.keyboard.up("Shift");
    await until(page, async (high) => (await stickslip.drawn("displacement")).high > high, before.high);
    const scaled = await drawn(page, "displacement");
    // A trigger, whose level is never reached, and cursors.
    await page.locator("#trigger-channel").selectOption({ label: "Friction force" });
    await page.locator("#trigger-mode").selectOption("auto");
    await page.locator("#trigger-level").fill("5.5");
    await page.locator("#trigger-level").press("Enter");
    await page.locator("#trigger-edge").click();
    await page.locator("#cursors").click();
    await page.locator("#cursor-b").press("End");
    await until(page, () => ["scales", "trigger", "cursors"].every((name) => new URLSearchParams(window.location.search).has(name)));
    await until(page, () => new URLSearchParams(window.location.search).get("cursors") === "0.35_1");
    const query = new URL(page.url()).searchParams;
    assert.equal(query.get("span"), "5");
    assert.equal(query.get("lanes"), "x*v*F_N*D*mu*e");
    assert.equal(query.get("limits"), "v_-0.055_");
    assert.equal(query.get("expression"), "F*v + 2^2");
    assert.equal(query.get("trigger"), "auto_F_5.5_falling");
    assert.equal(query.get("units"), "mm");
    const [id, scaleLow, scaleHigh] = query.get("scales").split("_");
    assert.equal(id, "x");
    near(Number(scaleLow) * 1e3, scaled.low, 1e-6);
    near(Number(scaleHigh) * 1e3, scaled.high, 1e-6);
    const names = ["displacement", "velocity", "friction_force", "normal_load", "coefficient", "expression"];
    // In another browser, which has other settings.
    const other = await open({}, new URL(page.url()).search);
    await feedRig(other);
    await until(other, () => document.querySelector("#readings tbody td").textContent !== "");
    assert.deepEqual((await state(other)).visible, (await state(page)).visible);
    const { trigger, cursors, left_ns: left, span_ns: span } = await state(other);
    assert.deepEqual([trigger.mode, trigger.channel, trigger.level, trigger.rising], ["auto", 2, 5.5, false]);
    assert.deepEqual(cursors.map((at) => Number(((at - left) / span).toFixed(6))), [0.35, 1]);
    assert.equal(await other.locator("#trigger-level").inputValue(), "5.5");
    assert.equal(await other.locator("#trigger-edge").innerText(), "↘");
    for (const name of names) {
      const [mine, theirs] = [await drawn(page, name), await drawn(other, name)];
      assert.equal(theirs.points.length, mine.points.length);
      theirs.points.forEach((place, i) => near(place, mine.points[i], 1e-3, `point ${i} of ${name}`)); // scales have nine digits
      for (const what of ["top", "height", "title", "alarm"]) assert.deepEqual(theirs[what], mine[what], `${what} of ${name}`);
      near(theirs.low, mine.low, 1e-6);
    }
    assert.equal(await other.locator("#expression").inputValue(), "F*v + 2^2");
    // A restart of the daemon leaves a scale that was chosen.
    await other.evaluate(() => feed.text({ type: "restart" }));
    await feedRig(other);
    near((await drawn(other, "displacement")).high, scaled.high, 1e-6);
    // Without a view in the address it is that of the browser, but for the scale.
    await page.goto(page.url().replace(/\?.*/, `?webgl=${webgl}`));
    await until(page, () => window.stickslip !== undefined);
    await page.evaluate(() => feed.open());
    await feedRig(page);
    await drawn(page, "none");
    assert.deepEqual((await state(page)).visible, names);
    assert.ok((await drawn(page, "displacement")).high < scaled.high);
    assert.equal((await state(page)).cursors, null);
    assert.equal((await state(page)).trigger.mode, "roll", "a page that is opened anew runs");
    await until(page, () => new URLSearchParams(window.location.search).get("lanes") === "x*v*F_N*D*mu*e");
    await close(page);
    await close(other);
  });
}

test("an address without lanes has none, and lanes of lanes are one", async () => {
  const page = await open();
  await feedRig(page);
  await drawn(page, "none");
  await page.locator("#screen").focus();
  for (const key of ["1", "2", "3", "4", "5", "6"]) await page.keyboard.press(key);
  await until(page, () => new URLSearchParams(window.location.search).get("lanes") === "");
  const empty = await open({}, new URL(page.url()).search);
  await feedRig(empty);
  await drawn(empty, "none");
  assert.deepEqual((await state(empty)).visible, []);
  const chained = await open({}, "?webgl=0&lanes=x_v*v_F");
  await feedRig(chained);
  const tops = [];
  for (const name of ["displacement", "velocity", "friction_force"]) tops.push((await drawn(chained, name)).top);
  assert.deepEqual(tops, Array(3).fill(tops[0]));
  for (const one of [page, empty, chained]) await close(one);
});

test("an address names the units, whatever those of the browser", async () => {
  const page = await open({}, "?webgl=0&units=m");
  await feedRig(page);
  assert.equal((await drawn(page, "displacement")).title, "x  displacement (m)");
  assert.equal(await page.locator("#units-now").innerText(), "m");
  await page.locator("#screen").focus();
  await page.keyboard.press("u");
  await until(page, () => new URLSearchParams(window.location.search).get("units") === "mm");
  await close(page);
});

test("of a damaged address what is understood is used", async () => {
  const page = await open({}, "?webgl=0&span=abc&lanes=zz*v_x_qq**_*N&scales=x_1*v_2_1*N_0_1_2*F_a_b&limits=F_3_2*x_*N__0.4&expression=%29%28&trigger=normal_q_1_rising&units=toString&cursors=0.5_2");
  await feedRig(page);
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  const now = await state(page);
  assert.equal(now.span_s, 10);
  assert.deepEqual([now.trigger.mode, now.units, now.cursors], ["roll", "mm", null]);
  assert.deepEqual(now.visible, ["displacement", "velocity", "normal_load"]);
  const [x, v, load] = [await drawn(page, "displacement"), await drawn(page, "velocity"), await drawn(page, "normal_load")];
  assert.equal(x.top, v.top);
  assert.equal(v.title, "v  velocity (mm/s)");
  assert.equal(load.alarm, "high");
  assert.equal(x.alarm + v.alarm, "");
  assert.match(await page.locator("#expression-note").innerText(), /^Character 1: expected /);
  await close(page);
});
