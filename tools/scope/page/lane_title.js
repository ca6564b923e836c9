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

// Of a channel beside the first: how far its own scale reaches.
function rangeOf(lane, leader, unit) {
  if (lane.limits === leader.limits || !lane.limits.known) return "";
  const decimals = Math.max(0, lane.decimals - 1);
  return ` ${fixed(lane.limits.low, decimals)} … ${fixed(lane.limits.high, decimals)}${unit === "" ? "" : ` ${unit}`}`;
}

function titleOf(lane, leader, units) {
  const unit = units.label(lane.channel.quantity);
  const name = lane.name ?? lane.channel.name.toLowerCase();
  const manual = lane.limits.manual ? ", fixed scale" : "";
  return lane === leader ? `${lane.channel.symbol}  ${withUnit(name, unit)}${manual}` : `${lane.channel.symbol}  ${name}${rangeOf(lane, leader, unit)}`;
}

// Channels of one lane, the first with its numbers. What does not fit is left out; of an alarm its mark
// remains, of a channel its symbol.
export function drawTitle(axes, members, scope) {
  const { theme, units } = scope.app;
  const { gutter, plotWidth, titleHeight } = scope;
  const [leader] = members;
  const right = gutter + plotWidth - 4;
  let x = gutter + 7;
  const write = (words, font, colour) => {
    axes.font = font;
    const { width } = axes.measureText(words);
    if (x > gutter + 7 && x + width > right) return false;
    axes.fillStyle = colour;
    axes.fillText(words, x, leader.edge + 3);
    x += width + theme.small;
    return true;
  };
  axes.textAlign = "left";
  axes.textBaseline = "top";
  axes.fillStyle = theme.colours[members.some(({ alarm }) => alarm !== "") ? "bad-ground" : "panel"];
  axes.fillRect(gutter + 1, leader.edge + 1, plotWidth - 2, titleHeight - 1);
  for (const lane of members) {
    lane.title = titleOf(lane, leader, units);
    const colour = theme.channel[lane.index];
    if (!write(lane.title, theme.bold, colour)) write(lane.channel.symbol, theme.bold, colour);
    lane.alarmTitle = lane.alarm === "" ? "" : `▲ ${scope.alarms.words(lane, lane.alarm)}`;
    if (lane.alarm !== "" && !write(lane.alarmTitle, theme.bold, theme.colours.bad)) write("▲", theme.bold, theme.colours.bad);
    lane.numbers = [];
  }
  leader.numbers = numbersOf(leader, units).filter((words) => write(words, theme.font, theme.colours.quiet));
  axes.font = theme.font;
  leader.taken = [[gutter, x]]; // of the strip
}
