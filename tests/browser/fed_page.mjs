// SPDX-License-Identifier: Apache-2.0
// Pages of `stickslip scope` with a stream controlled by the test, one server and browser for all tests of a
// file.
import assert from "node:assert/strict";
import { after, before } from "node:test";
import { openPage, startBrowser, startScope } from "./programs.mjs";

let scope;
let browser;

before(async () => {
  scope = await startScope();
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  await scope?.stop();
});

export async function open(options = {}, query = "?webgl=0") {
  const page = await openPage(browser, scope.url + query, { fake: true, ...options });
  await page.evaluate(() => feed.open());
  return page;
}

// Closes a page, which must have had no errors and no requests to other servers.
export async function close(page) {
  await page.context().close();
  assert.deepEqual(page.complaints, []);
  assert.deepEqual(page.elsewhere, []);
}

export const state = (page) => page.evaluate(() => stickslip.state());
export const ink = (page, name) => page.evaluate((name) => stickslip.ink(name), name);
export const text = (page, selector) => page.locator(selector).innerText();
export const near = (a, b, tolerance, message) => assert.ok(Math.abs(a - b) <= tolerance, `${message ?? ""} ${a} is not ${b} within ${tolerance}`);
// A number as the page writes it.
export const numberOf = (words) => Number(words.replace("\u2212", "-"));
