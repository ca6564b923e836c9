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

// Numbers that do not fit are left out; of an alarm its mark remains.
export function drawTitle(axes, lane, scope) {
  const { theme, units } = scope.app;
  const { gutter, plotWidth, titleHeight } = scope;
  const { channel, edge } = lane;
  const right = gutter + plotWidth - 4;
  let x = gutter + 7;
  const write = (words, font, colour) => {
    axes.font = font;
    const { width } = axes.measureText(words);
    if (x > gutter + 7 && x + width > right) return false;
    axes.fillStyle = colour;
    axes.fillText(words, x, edge + 3);
    x += width + theme.small;
    return true;
  };
  lane.title = `${channel.symbol}  ${withUnit(lane.name ?? channel.name.toLowerCase(), units.label(channel.quantity))}${lane.manual ? ", fixed scale" : ""}`;
  axes.textAlign = "left";
  axes.textBaseline = "top";
  axes.fillStyle = lane.alarm === "" ? theme.colours.panel : theme.colours["bad-ground"];
  axes.fillRect(gutter + 1, edge + 1, plotWidth - 2, titleHeight - 1);
  write(lane.title, theme.bold, theme.channel[lane.index]);
  if (lane.alarm !== "") {
    lane.alarmTitle = `▲ ${scope.alarms.words(lane, lane.alarm)}`;
    if (!write(lane.alarmTitle, theme.bold, theme.colours.bad)) write("▲", theme.bold, theme.colours.bad);
  }
  lane.numbers = numbersOf(lane, units).filter((words) => write(words, theme.font, theme.colours.quiet));
  axes.font = theme.font;
}
