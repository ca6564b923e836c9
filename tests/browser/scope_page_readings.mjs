// SPDX-License-Identifier: Apache-2.0
// Numbers that the page of `stickslip scope` reads off the stream, against the stream.
import assert from "node:assert/strict";
import { test } from "node:test";
import { close, near, numberOf, open, state } from "./fed_page.mjs";
import { drawn, until } from "./programs.mjs";

const signal = (channel, t) => Math.sin(2 * Math.PI * 2 * t) * (channel + 1);
// On the straight line between frames of 1 kHz.
function between(channel, t_ns) {
  const i = Math.floor(t_ns / 1e6);
  const part = t_ns / 1e6 - i;
  return signal(channel, i / 1000) * (1 - part) + signal(channel, (i + 1) / 1000) * part;
}
const readout = (page) => page.evaluate(async () => {
  await stickslip.drawn("none");
  if (document.querySelector("#hover").hidden) return null;
  const rows = [...document.querySelectorAll("#hover tbody tr:not([hidden])")].map((row) => [...row.cells].map((cell) => cell.textContent));
  return { time: document.querySelector("#hover caption").textContent, rows };
});

// The readout holds the values of the stream at the place x [px] of the window.
async function assertReadout(page, x) {
  const { time, rows } = await readout(page);
  const { left_ns: left, span_ns: span, plot } = await state(page);
  const box = await page.locator("#screen").boundingBox();
  const at_ns = left + ((x - box.x - plot.left) / plot.width) * span;
  near(numberOf(time.replace(" s", "")), at_ns / 1e9, span / 1e9 / 1e4, "time");
  assert.deepEqual(rows.map(([symbol, , unit]) => [symbol, unit]), [["x", "mm"], ["v", "mm/s"], ["F", "N"], ["N", "N"], ["b", "mm"]]);
  rows.forEach(([symbol, words], channel) => {
    const expected = between(channel, at_ns) * (symbol === "F" || symbol === "N" ? 1 : 1e3);
    const decimals = words.split(".")[1].length;
    near(numberOf(words), expected, 0.51 * 10 ** -decimals + 1e-9, `${symbol} at ${at_ns / 1e9} s`);
  });
  return rows;
}

for (const webgl of [0, 1]) {
  test(`the pointer reads time and value of every lane, running, paused and zoomed: webgl=${webgl}`, async () => {
    const page = await open({}, `?webgl=${webgl}`);
    await page.evaluate(() => feed.frames(0, 15000, { per: 1000 }));
    await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
    const box = await page.locator("#screen").boundingBox();
    assert.equal(await readout(page), null);
    for (const part of [0.3, 0.8]) {
      await page.mouse.move(box.x + box.width * part, box.y + 120);
      await assertReadout(page, box.x + box.width * part);
    }
    // The traces move under a pointer that rests.
    const before = await readout(page);
    await page.evaluate(() => feed.frames(15000, 370, { per: 370 }));
    const rows = await assertReadout(page, box.x + box.width * 0.8);
    assert.notDeepEqual(rows, before.rows);
    await page.keyboard.press("p");
    await page.locator("#screen").focus();
    for (const key of ["+", "+", "+", "+", "+", "+"]) await page.keyboard.press(key);
    assert.ok((await state(page)).span_s < 0.2);
    for (const part of [0.2, 0.61]) {
      await page.mouse.move(box.x + box.width * part, box.y + 60);
      const decimals = (await assertReadout(page, box.x + box.width * part)).map(([, words]) => words.split(".")[1].length);
      assert.ok(decimals.every((count) => count >= 1), `${decimals} decimals`);
    }
    // A hidden lane is not read; outside the traces nothing is.
    await page.keyboard.press("2");
    assert.deepEqual((await readout(page)).rows.map(([symbol]) => symbol), ["x", "F", "N", "b"]);
    await page.mouse.move(box.x + 5, box.y + 60);
    assert.equal(await readout(page), null);
    await page.mouse.move(box.x + box.width * 0.5, box.y + 60);
    assert.notEqual(await readout(page), null);
    await page.mouse.move(box.x + box.width * 0.5, box.y - 30);
    assert.equal(await readout(page), null);
    await close(page);
  });
}

test("the readout has no values where frames were lost", async () => {
  const page = await open();
  await page.evaluate(() => { feed.frames(0, 900); feed.frames(920, 100); });
  await page.locator("#time-base").selectOption("0.2");
  await drawn(page, "velocity");
  const { left_ns: left, span_ns: span, plot } = await state(page);
  const box = await page.locator("#screen").boundingBox();
  for (const [t_ns, measured] of [[890e6, true], [909e6, false], [930e6, true]]) {
    await page.mouse.move(box.x + plot.left + ((t_ns - left) / span) * plot.width, box.y + 60);
    const { rows } = await readout(page);
    assert.ok(rows.every(([, words]) => (words !== "–") === measured), `${rows} at ${t_ns / 1e6} ms`);
  }
  await close(page);
});

test("a finger reads too, and the readout stays when it is lifted", async () => {
  const page = await open({ width: 390, height: 844, isMobile: true, hasTouch: true });
  await page.evaluate(() => feed.frames(0, 15000, { per: 1000 }));
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  await page.locator("#screen").scrollIntoViewIfNeeded();
  const box = await page.locator("#screen").boundingBox();
  const x = Math.round(box.x + box.width * 0.4);
  await page.touchscreen.tap(x, Math.round(box.y + 150));
  await assertReadout(page, x);
  assert.equal((await state(page)).paused, false);
  const table = await page.locator("#hover table").boundingBox();
  assert.ok(table.x >= box.x && table.x + table.width <= box.x + box.width, "within the screen");
  await page.touchscreen.tap(Math.round(box.x + 30), Math.round(box.y - 40));
  assert.equal(await readout(page), null);
  await close(page);
});
