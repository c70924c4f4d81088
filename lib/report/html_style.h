// The style sheet of a report (html_report.h).
#ifndef REPORT_HTML_STYLE_H_
#define REPORT_HTML_STYLE_H_

namespace invgrad {

constexpr char kHtmlStyle[] = R"css(
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1240px; padding: 20px; background: #fff;
  color: #1b1b1b; font: 16px/1.5 system-ui, 'DejaVu Sans', sans-serif; }
h1 { font-size: 26px; line-height: 1.2; margin: 0 0 4px; }
h2 { font-size: 19px; margin: 34px 0 4px; border-bottom: 1px solid #ddd; }
p { margin: 6px 0; max-width: 60em; }
.question { color: #555; }
.answer { font-size: 18px; background: #eef5fa; border-left: 4px solid #0072b2;
  padding: 10px 14px; margin: 12px 0; max-width: none; }
.live, .warnings { background: #fff6e0; border-left: 4px solid #e69f00;
  padding: 8px 14px; margin: 12px 0; max-width: none; }
.warnings ul { margin: 4px 0; padding-left: 20px; overflow-wrap: anywhere; }
.caption { color: #555; font-size: 14px; }
pre { background: #f5f5f5; padding: 10px; font-size: 13px; margin: 8px 0;
  white-space: pre-wrap; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 16px;
  font-size: 14px; margin: 8px 0; }
dt { color: #555; }
dd { margin: 0; overflow-wrap: anywhere; }
summary { cursor: pointer; font-size: 14px; color: #0072b2; }
figure { margin: 8px 0; }
.bar { display: flex; flex-wrap: wrap; gap: 6px 16px; min-height: 30px;
  font-size: 14px; align-items: center; }
select, .reset { font: inherit; padding: 2px 6px; max-width: 100%; }
.box { position: relative; }
.box svg { display: block; width: 100%; touch-action: pan-y; cursor: crosshair;
  user-select: none; }
svg text { font-size: 12px; fill: #444; }
svg text.name { font-size: 14px; fill: #1b1b1b; }
.grid { stroke: #e6e6e6; }
.frame { fill: none; stroke: #555; }
.curve { fill: none; stroke-width: 2; stroke-linejoin: round; }
.band { opacity: 0.16; }
.mark { fill: #fff; stroke-width: 2.5; pointer-events: none; }
.area { fill: #0072b2; opacity: 0.12; }
.tip { position: absolute; z-index: 1; background: #1b1b1b; color: #fff;
  font-size: 13px; line-height: 1.4; padding: 5px 9px; border-radius: 4px;
  white-space: pre; pointer-events: none; }
.tip[hidden] { display: none; }
.legend { display: flex; flex-wrap: wrap; gap: 2px 6px; }
.key { display: flex; align-items: center; gap: 6px; font: inherit;
  font-size: 14px; background: none; border: 0; padding: 3px 6px;
  cursor: pointer; color: inherit; text-align: left; }
.key:hover { background: #f0f0f0; }
.key[aria-pressed=false] { opacity: 0.4; text-decoration: line-through; }
.swatch { width: 26px; height: 10px; flex: none; }
.scroll { overflow-x: auto; margin: 8px 0; }
table { border-collapse: collapse; font-size: 14px;
  font-variant-numeric: tabular-nums; }
th, td { padding: 4px 8px; border-bottom: 1px solid #e6e6e6;
  text-align: right; vertical-align: top; white-space: nowrap; }
th { border-bottom: 2px solid #999; font-weight: 600; }
.left { text-align: left; }
td.words { white-space: normal; min-width: 14em; }
.sorts td.left:first-child { min-width: 11.5em; max-width: 22em;
  overflow-wrap: anywhere; white-space: normal; }
th button { font: inherit; background: none; border: 0; padding: 0;
  cursor: pointer; color: inherit; }
th button:hover { text-decoration: underline; }
th[aria-sort=ascending] button::after { content: ' \2191'; color: #0072b2; }
th[aria-sort=descending] button::after { content: ' \2193'; color: #0072b2; }
td.best { font-weight: 700; background: #e3f4ea; }
td.best::after { content: ' \2605'; color: #00694d; }
abbr { text-decoration: none; cursor: help; }
.sorts td:first-child { position: sticky; left: 0; background: #fff; }
.maps, .pictures { display: flex; flex-wrap: wrap; gap: 18px; }
.maps table { border-collapse: separate; border-spacing: 1px; }
.maps th { border: 0; font-weight: 400; color: #555; }
.maps td { border: 0; text-align: center; }
.maps td.best { background: none; outline: 2px solid #d55e00;
  outline-offset: -2px; }
.maps td.best::after { color: inherit; }
.maps caption { font-weight: 600; text-align: left; }
.pictures figure { flex: 1 1 480px; max-width: 800px; }
.pictures img { max-width: 100%; border: 1px solid #ddd; }
@media (max-width: 600px) {
  body { padding: 12px; font-size: 15px; }
  dl { gap: 2px 8px; font-size: 13px; }
  .answer { font-size: 16px; }
  .sorts td.left:first-child { min-width: 9em; }
}
@media print {
  body { max-width: none; padding: 0; font-size: 11pt; }
  .bar, .live { display: none; }
  .scroll { overflow: visible; }
  table { font-size: 8pt; }
  th, td { padding: 2px 5px; white-space: normal; }
  figure, tr { break-inside: avoid; }
  h2 { break-after: avoid; }
  * { print-color-adjust: exact; }
}
)css";

}  // namespace invgrad

#endif  // REPORT_HTML_STYLE_H_
