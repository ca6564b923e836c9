// SPDX-License-Identifier: Apache-2.0
// Limits of channels on the page of `stickslip scope`: a crossing marks the lane, is an event, and beeps.
import assert from "node:assert/strict";
import { test } from "node:test";
import { close, near, open, state } from "./fed_page.mjs";
import { drawn, until } from "./programs.mjs";

// Displacement [m] with two excursions above 5 mm and one below -2 mm; the second of the first is a chatter.
const excursions = () => {
  feed.value = (channel, t) => {
    if (channel === 5) return NaN;
    if (channel !== 0) return Math.sin(6 * t);
    const i = Math.round(t * 1000);
    if (i >= 2000 && i < 2100) return i % 2 ? 0.006 : 0.0049;
    if (i >= 3500 && i < 3510) return 0.0051;
    if (i === 4200) return -0.0021;
    return 0.001;
  };
};
const events = (page) => page.locator("#event-list li:visible").evaluateAll((items) => items.map((item) => [item.dataset.own ?? "", ...[...item.children].map((child) => child.textContent)]));

async function limit(page, channel, side, words) {
  const field = page.locator(`#channel-settings input[aria-label="${channel}: ${side} limit"]`);
  await field.fill(words);
  await field.press("Enter");
}

// Counts tones in place of playing them.
const silence = () => {
  window.tones = [];
  const node = () => ({ frequency: {}, gain: { setValueAtTime() {}, linearRampToValueAtTime() {} }, connect: (to) => to, start: (at) => window.tones.push(at), stop() {} });
  window.AudioContext = class { currentTime = 1; destination = {}; createOscillator = node; createGain = node; resume() {} suspend() {} };
};

for (const webgl of [0, 1]) {
  test(`a crossing marks the lane and is an event of the page's own: webgl=${webgl}`, async () => {
    const page = await open({}, `?webgl=${webgl}`);
    await page.evaluate(excursions);
    await page.evaluate(() => { feed.frames(0, 1000, { received_unix_ms: 1.7e12 + 999 }); });
    await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
    await page.locator(".channel-settings summary").focus();
    await page.keyboard.press("Space"); // which pauses elsewhere
    assert.equal((await state(page)).paused, false);
    assert.equal(await page.locator("#channel-settings tbody tr:visible").count(), 7, "five measured channels, mu and power");
    await limit(page, "Displacement", "high", "5");
    await limit(page, "Displacement", "low", "-2");
    let lane = await drawn(page, "displacement");
    assert.equal(lane.alarm, "");
    assert.deepEqual(await events(page), []);
    await page.evaluate(() => feed.frames(1000, 9000, { received_unix_ms: 1.7e12 + 9999 }));
    assert.deepEqual((await events(page)).map(([own, time, code, times, words]) => [own, time, code, times, words]), [
      ["yes", "4.200 s", "limit of this page", "", "Displacement below −2.000 mm"],
      ["yes", "3.500 s", "limit of this page", "2 times", "Displacement above 5.000 mm"],
    ], "a chatter is one crossing");
    // Limits are lines at their values, in the colour of an alarm.
    lane = await drawn(page, "displacement");
    assert.equal(lane.alarm, "high");
    assert.equal(lane.alarmTitle, "▲ above 5.000 mm");
    [-2, 5].forEach((bound, i) => near(lane.boundsAt[i], lane.top + lane.height * (1 - (bound - lane.low) / (lane.high - lane.low)), 1, `limit ${bound}`));
    const inked = await page.evaluate(async (ys) => {
      await stickslip.drawn("none");
      const context = document.querySelector("#scope-axes").getContext("2d");
      const { plot } = stickslip.state();
      return ys.map((y) => {
        const { data } = context.getImageData(plot.left + 6, Math.floor(y), plot.width - 12, 1);
        let red = 0;
        for (let k = 0; k < data.length; k += 4) if (data[k] > 150 && data[k + 1] < 90) red += 1;
        return red / (plot.width - 12);
      });
    }, lane.boundsAt);
    assert.ok(inked.every((part) => part > 0.4), `${inked} of the width in dashes`);
    assert.equal((await drawn(page, "velocity")).alarm, "");
    assert.deepEqual((await state(page)).markers.map(({ code }) => code), Array(3).fill("limit_of_this_page"));
    // An event leads to its place; the mark is of the window that is seen.
    await page.locator("#time-base").selectOption("0.1");
    assert.equal((await drawn(page, "displacement")).alarm, "", "inside, by now");
    await page.locator("#event-list button").first().click();
    assert.equal((await drawn(page, "displacement")).alarm, "low");
    near((await state(page)).left_ns + 0.05e9, 4.2e9, 1e3);
    // Of a paused page, too.
    await page.evaluate(() => { feed.value = (channel) => (channel === 0 ? 0.007 : channel === 5 ? NaN : 0.1); feed.frames(10000, 100); });
    assert.equal((await events(page))[0][3], "3 times");
    await close(page);
  });
}

test("crossings are counted by the time of their frames, whatever the clock of the host says", async () => {
  const page = await open();
  await page.evaluate(() => {
    feed.value = (channel, t) => (channel === 0 && [2, 3.5].includes(t) ? 0.006 : 0.001);
    feed.frames(0, 1000, { received_unix_ms: 1.7e12 });
  });
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  await page.locator(".channel-settings summary").click();
  await limit(page, "Displacement", "high", "5");
  // Frames that are received faster than they were measured: both crossings have the same UTC.
  await page.evaluate(() => feed.frames(1000, 4000, { received_unix_ms: 1.7e12 }));
  assert.deepEqual((await events(page)).map((line) => line[3]), ["2 times"]);
  // A new run counts on, though its times begin anew.
  await page.evaluate(() => { feed.text({ type: "restart" }); feed.frames(0, 4000); });
  assert.deepEqual((await events(page)).map((line) => line[3]), ["4 times"]);
  await close(page);
});

test("a beep is off at first, and of live frames only", async () => {
  const page = await open();
  await page.evaluate(silence);
  await page.evaluate(excursions);
  await page.evaluate(() => feed.frames(0, 1000));
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  await page.locator(".channel-settings summary").click();
  await limit(page, "Displacement", "high", "5");
  await page.evaluate(() => feed.frames(1000, 1500));
  assert.equal((await events(page)).length, 1);
  assert.deepEqual(await page.evaluate(() => window.tones), [], "off");
  assert.equal(await page.locator("#alarm-sound").isChecked(), false);
  await page.locator("#alarm-sound").check();
  await page.evaluate(() => feed.frames(2500, 1500));
  assert.deepEqual(await page.evaluate(() => window.tones), [1]);
  assert.equal((await state(page)).beeps, 1);
  await page.locator("#alarm-sound").uncheck();
  await page.evaluate(() => { feed.value = () => 0.1; feed.frames(4000, 100); });
  assert.equal((await state(page)).beeps, 1);
  // The history of a connection is searched without a sound.
  await page.locator("#alarm-sound").check();
  await page.evaluate(() => { feed.text({ type: "restart" }); feed.frames(0, 100, { flags: 2 }); });
  assert.equal((await state(page)).beeps, 1);
  await close(page);
});

test("limits are in the units in use, kept in the browser, and refused if they exclude everything", async () => {
  const page = await open();
  await page.evaluate(excursions);
  await page.evaluate(() => feed.frames(0, 1000));
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  await page.locator(".channel-settings summary").click();
  await limit(page, "Displacement", "high", "5");
  const field = (side) => page.locator(`#channel-settings input[aria-label="Displacement: ${side} limit"]`);
  await page.locator("#units").click();
  assert.equal(await field("high").inputValue(), "0.005");
  await limit(page, "Displacement", "low", "0.006");
  assert.equal(await field("low").getAttribute("aria-invalid"), "true");
  await page.evaluate(() => feed.frames(1000, 2000));
  assert.deepEqual(await events(page), [], "neither limit holds");
  await limit(page, "Displacement", "low", "");
  assert.equal(await field("low").getAttribute("aria-invalid"), "false");
  await page.evaluate(() => feed.frames(3000, 1000));
  assert.deepEqual((await events(page)).map((line) => line[4]), ["Displacement above 0.005000 m"]);
  // Derived channels have limits too.
  await limit(page, "Power of friction", "high", "0.5");
  await page.evaluate(() => feed.frames(4000, 1000));
  assert.ok((await events(page)).some((line) => line[4] === "Power of friction above 0.5000 W"));
  await until(page, () => new URLSearchParams(window.location.search).get("limits") === "x__0.005*P__0.5");
  await page.reload();
  await until(page, () => window.stickslip !== undefined);
  await page.evaluate(excursions);
  await until(page, () => document.querySelector('#channel-settings input[aria-label="Displacement: high limit"]')?.value === "0.005");
  await page.evaluate(() => { feed.open(); feed.frames(0, 4000); });
  await until(page, () => [...document.querySelectorAll("#event-list li")].some((item) =>
    item.children[3]?.textContent === "Displacement above 0.005000 m" && item.children[2].textContent === "2 times"));
  await close(page);
});
