// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/style.h"

namespace stickslip::report {

namespace {

// Series differ in lightness and dash pattern as well as in hue; blue and orange remain distinct
// under every kind of colour blindness. The shades of maps run from the background to the largest
// value: pale to dark on paper, dark to bright on a dark screen.
constexpr std::string_view sheet = R"(
:root { color-scheme: light dark;
  --ink:#1b1f24; --soft:#4d5660; --paper:#ffffff; --rule:#d0d7de; --card:#f5f7f9; --link:#0b5cad;
  --s0:#5b6570; --s1:#b93d0c; --s2:#0b5cad; --s3:#6f3fc0; --accent:#0b5cad;
  --m0:#f2eee4; --m1:#e6dbc2; --m2:#dac49a; --m3:#cba872; --m4:#b9884c; --m5:#a06630;
  --m6:#80481f; --m7:#5d2d14; --m8:#37160b; }
@media screen and (prefers-color-scheme: dark) { :root {
  --ink:#e6edf3; --soft:#a5afba; --paper:#0d1117; --rule:#343b44; --card:#161b22; --link:#7cbcff;
  --s0:#aeb7c1; --s1:#ff9b66; --s2:#6cb6ff; --s3:#c297ff; --accent:#6cb6ff;
  --m0:#1c232c; --m1:#33302c; --m2:#4d3f2d; --m3:#6b512f; --m4:#8c6734; --m5:#b0803d;
  --m6:#d29d4f; --m7:#ecc07a; --m8:#fff0c9; } }
.consistent { --accent:#116329; } .ambiguous { --accent:#855300; } .unexplained { --accent:#a40e26; }
@media screen and (prefers-color-scheme: dark) { .consistent { --accent:#56d364; }
  .ambiguous { --accent:#e3b341; } .unexplained { --accent:#ff8f88; } }
* { box-sizing:border-box; }
html { -webkit-text-size-adjust:100%; }
body { margin:0 auto; padding:24px; max-width:1080px; background:var(--paper); color:var(--ink);
  font:16px/1.5 system-ui, sans-serif; }
h1 { font-size:28px; line-height:1.25; margin:6px 0 10px; text-wrap:balance; }
h2 { font-size:20px; margin:40px 0 8px; padding-top:10px; border-top:1px solid var(--rule); }
h3 { font-size:16px; margin:22px 0 4px; }
p { margin:6px 0; max-width:76ch; } .soft, figcaption, caption, footer { color:var(--soft); }
a { color:var(--link); }
code, pre { font:13px/1.45 ui-monospace, monospace; } code { overflow-wrap:anywhere; }
pre { background:var(--card); border:1px solid var(--rule); border-radius:6px; padding:10px;
  white-space:pre-wrap; overflow-wrap:anywhere; }
.kicker { font-weight:600; color:var(--accent); margin:0; }
.verdict { border-left:6px solid var(--accent); padding-left:18px; }
.answers { display:grid; grid-template-columns:repeat(2, 1fr); gap:12px; margin:16px 0; }
.answers div { background:var(--card); border:1px solid var(--rule); border-radius:6px;
  padding:10px 14px; }
.answers div:last-child:nth-child(odd) { grid-column:1 / -1; }
.answers dt { font-size:13px; font-weight:600; color:var(--soft); } .answers dd { margin:2px 0 0; }
.answers b { font-size:20px; font-weight:600; font-variant-numeric:tabular-nums; }
nav ul { list-style:none; padding:0; display:flex; flex-wrap:wrap; gap:4px 18px; margin:14px 0 0;
  font-size:14px; }
.scroll { overflow-x:auto; }
table { border-collapse:collapse; margin:10px 0 4px; font-size:15px; }
caption { text-align:left; padding:0 0 4px; font-size:14px; max-width:76ch; }
th, td { text-align:left; padding:4px 16px 4px 0; border-bottom:1px solid var(--rule);
  vertical-align:top; font-variant-numeric:tabular-nums; }
th { font-weight:600; } tbody th { font-weight:400; } .number { white-space:nowrap; }
.bar { width:190px; padding-right:0; }
.bar i { display:block; height:8px; margin:3px 0; min-width:2px; border-radius:2px;
  background:var(--s2); -webkit-print-color-adjust:exact; print-color-adjust:exact; }
.bar i.was { background:var(--s1); }
.plots { display:grid; grid-template-columns:repeat(2, minmax(0, 1fr)); gap:6px 18px;
  align-items:start; }
figure { margin:10px 0; } figcaption { font-size:14px; margin-top:2px; max-width:76ch; }
svg { display:block; width:100%; max-width:560px; height:auto; }
.tick { font-size:12px; fill:var(--soft); } .label { font-size:12.5px; fill:var(--soft); }
.note { font-size:11.5px; fill:var(--soft); }
.title { font-size:13.5px; font-weight:600; fill:var(--ink); }
.grid { stroke:var(--rule); stroke-width:0.7; }
.mark { stroke:var(--soft); stroke-width:0.9; stroke-dasharray:2 3; }
.level { stroke:var(--ink); stroke-width:0.9; stroke-dasharray:6 3; }
.line { fill:none; stroke-width:1.7; } .s0 { stroke:var(--s0); } .line.s0 { stroke-width:3.4; }
.s1 { stroke:var(--s1); } .line.s1 { stroke-dasharray:6 3; } .s2 { stroke:var(--s2); }
.s3 { stroke:var(--s3); } .line.s3 { stroke-dasharray:1 3; }
.area { stroke:none; opacity:0.25; } .area.s0 { fill:var(--s0); } .area.s2 { fill:var(--s2); }
.points { fill:none; stroke-width:2; stroke-linecap:round; opacity:0.5; }
.dot { stroke:none; } .dot.s2 { fill:var(--s2); } .spot { stroke:var(--soft); stroke-width:0.6; }
.m0 { fill:var(--m0); } .m1 { fill:var(--m1); } .m2 { fill:var(--m2); } .m3 { fill:var(--m3); }
.m4 { fill:var(--m4); } .m5 { fill:var(--m5); } .m6 { fill:var(--m6); } .m7 { fill:var(--m7); }
.m8 { fill:var(--m8); }
dl.glossary dt { font-weight:600; margin-top:8px; } dl.glossary dd { margin:0; max-width:76ch; }
@media screen and (max-width: 640px) {
  body { padding:14px; } h1 { font-size:23px; } .answers, .plots { grid-template-columns:1fr; }
  .verdict { padding-left:12px; } .bar { width:90px; } th, td { padding-right:10px; }
}
td code { overflow-wrap:break-word; }
@page { size:A4; margin:16mm 14mm; }
@media print {
  :root { color-scheme:light; --ink:#000; --soft:#333; --rule:#bbb; --card:#fff; --link:#000; }
  body { padding:0; max-width:none; font-size:10.5pt; } nav { display:none; }
  h1 { font-size:17pt; } h2 { font-size:13pt; margin-top:18pt; } h3 { font-size:11pt; }
  h2, h3, caption, thead { break-after:avoid; } figure, tr, .answers div { break-inside:avoid; }
  tbody tr:first-child { break-after:avoid; } tbody tr:last-child { break-before:avoid; }
  thead { display:table-header-group; } table { font-size:9.5pt; } .scroll { overflow:visible; }
  figcaption, caption { font-size:9pt; } code, pre { font-size:8pt; }
  td code { overflow-wrap:anywhere; }
  a { text-decoration:none; }
}
)";

}  // namespace

std::string_view report_style() { return sheet; }

}  // namespace stickslip::report
