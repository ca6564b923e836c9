// SPDX-License-Identifier: Apache-2.0
// The strip above a lane's trace: its title, and numbers of the channel over the time on screen.

import { fixed, number, withUnit } from "./units.js";

// Those numbers, as texts.
function numbersOf(lane, units) {
  const { measured, channel, decimals } = lane;
  if (!(measured.high >= measured.low)) return [];
  const numbers = [`p-p ${fixed(measured.peakToPeak * units.factor(channel.quantity), decimals)}`];
  if (Number.isFinite(measured.frequency_hz)) numbers.push(`${number(measured.frequency_hz)} Hz`);
  return numbers;
}

// Numbers that do not fit are left out.
export function drawTitle(axes, lane, scope) {
  const { theme, units } = scope.app;
  const { gutter, plotWidth, titleHeight } = scope;
  const { channel, edge } = lane;
  lane.title = `${channel.symbol}  ${withUnit(lane.name ?? channel.name.toLowerCase(), units.label(channel.quantity))}${lane.manual ? ", fixed scale" : ""}`;
  lane.numbers = [];
  axes.textAlign = "left";
  axes.textBaseline = "top";
  axes.fillStyle = theme.colours.panel;
  axes.fillRect(gutter + 1, edge + 1, plotWidth - 2, titleHeight - 1);
  axes.font = theme.bold;
  axes.fillStyle = theme.channel[lane.index];
  axes.fillText(lane.title, gutter + 7, edge + 3);
  let x = gutter + 7 + axes.measureText(lane.title).width + theme.small;
  axes.font = theme.font;
  axes.fillStyle = theme.colours.quiet;
  for (const words of numbersOf(lane, units)) {
    const { width } = axes.measureText(words);
    if (x + width > gutter + plotWidth - 4) break;
    axes.fillText(words, x, edge + 3);
    lane.numbers.push(words);
    x += width + theme.small;
  }
}
