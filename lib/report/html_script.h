// The script of a report (html_report.h): a text, not code that makes one. It
// reads the JSON in #data, draws the charts as SVG, and sorts the tables.
//
// A chart has views, of which the buttons choose one. Hover: the nearest curve.
// A name in the legend hides its curve in all charts. Drag: zoom; double click:
// all again. A title of a column sorts its table.
#ifndef REPORT_HTML_SCRIPT_H_
#define REPORT_HTML_SCRIPT_H_

namespace invgrad {

constexpr char kHtmlScript[] = R"js(
'use strict';
const DATA = JSON.parse(document.getElementById('data').textContent);
// Colours that colour-blind readers can tell (Okabe and Ito), then dashes.
const HUES = ['#0072b2', '#e69f00', '#009e73', '#d55e00', '#cc79a7', '#56b4e9',
              '#000000'];
const DASHES = ['', '9 4', '2 3'];
const hue = (s) => s.method < 0 ? '#777' : HUES[s.method % HUES.length];
const dash = (s) => s.method < 0 ? '1 3' :
    DASHES[Math.floor(s.method / HUES.length) % DASHES.length];
const hidden = new Set();  // names of curves
const charts = [];

function add(parent, tag, attributes = {}, text = '') {
  const is_svg = parent.namespaceURI.endsWith('svg') || tag === 'svg';
  const node = is_svg ? document.createElementNS(
      'http://www.w3.org/2000/svg', tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, value);
  }
  if (text !== '') node.textContent = text;
  parent.appendChild(node);
  return node;
}

function format(value) {
  if (value === null || !isFinite(value)) return String(value);
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ?
      value.toExponential(2).replace(/\.?0+e/, 'e') :
      String(Number(value.toPrecision(4)));
}

// An axis: values from low to high to pixels from begin to end.
class Axis {
  constructor(is_log, low, high, begin, end, ticks) {
    const f = is_log ? Math.log10 : (v) => v;
    const back = is_log ? (u) => 10 ** u : (u) => u;
    let [a, b] = [f(low), f(high)];
    if (!(b > a)) [a, b] = [a - 0.5, a + 0.5];
    this.pixel = (v) => begin + (f(v) - a) / (b - a) * (end - begin);
    this.value = (p) => back(a + (p - begin) / (end - begin) * (b - a));
    this.shows = (v) => v !== null && isFinite(v) && (!is_log || v > 0);
    const room = Math.max(2, Math.abs(end - begin) / 55);
    this.ticks = ticks.length > 0 ? ticks.filter(
        ([v]) => f(v) >= a - 1e-9 && f(v) <= b + 1e-9) :
        (is_log ? this.decades(a, b, room) : this.steps(a, b, room)).map(
            (v) => [v, format(v)]);
  }

  steps(a, b, room) {
    const raw = (b - a) / room;
    const unit = 10 ** Math.floor(Math.log10(raw));
    const step = unit * [1, 2, 5, 10].find((m) => m * unit >= raw * 0.999);
    const found = [];
    for (let k = Math.ceil(a / step); k * step <= b + 1e-9 * step; ++k) {
      found.push(k * step);
    }
    return found;
  }

  decades(a, b, room) {
    if (b - a < 0.3) {
      return this.steps(10 ** a, 10 ** b, room).filter((v) => v > 0);
    }
    const between = b - a > 2 ? [1] : b - a > 1 ? [1, 3] : [1, 2, 3, 5];
    const stride = Math.max(1, Math.ceil((b - a) / room));
    const found = [];
    for (let k = Math.floor(a); k <= b; ++k) {
      if (((k % stride) + stride) % stride !== 0) continue;
      for (const m of between) {
        const v = Number(`${m}e${k}`);
        if (Math.log10(v) >= a - 1e-9 && Math.log10(v) <= b + 1e-9) {
          found.push(v);
        }
      }
    }
    return found;
  }
}

class Chart {
  constructor(figure, views) {
    this.figure = figure;
    this.views = views;
    this.chosen = {title: views[0].title, y: views[0].y, x: views[0].x};
    this.zoom = null;
    this.number = charts.length;
    this.bar = add(figure, 'div', {class: 'bar'});
    this.box = add(figure, 'div', {class: 'box'});
    this.tip = add(this.box, 'div', {class: 'tip', hidden: ''});
    this.legend = add(figure, 'div', {class: 'legend'});
    for (const [key, word] of [['title', ''], ['y', ''], ['x', 'against']]) {
      this.addChoice(key, word);
    }
    this.reset = add(this.bar, 'button', {class: 'reset'}, 'show all');
    this.reset.onclick = () => this.setZoom(null);
    this.draw();
  }

  addChoice(key, word) {
    const names = [...new Set(this.views.map((view) => view[key]))];
    if (names.length < 2) return;
    const group = add(this.bar, 'label', {class: 'choice'}, word + ' ');
    const select = add(group, 'select');
    for (const name of names) add(select, 'option', {value: name}, name);
    select.value = this.chosen[key];
    select.onchange = () => {
      this.chosen[key] = select.value;
      this.setZoom(null);
    };
  }

  view() {
    const score = (view) => ['title', 'y', 'x'].reduce(
        (sum, key) => 2 * sum + (view[key] === this.chosen[key]), 0);
    return this.views.reduce((a, b) => score(b) > score(a) ? b : a);
  }

  setZoom(zoom) {
    this.zoom = zoom;
    this.draw();
  }

  // The ends of all values that the axis can show.
  range(view, keys, is_log) {
    if (view.has_steps && keys.includes('y')) return [0, 1.03];  // shares
    let [low, high] = [Infinity, -Infinity];
    for (const s of view.series) {
      if (hidden.has(s.name)) continue;
      for (const key of keys) {
        for (const v of s[key] || []) {
          if (v === null || (is_log && v <= 0)) continue;
          low = Math.min(low, v);
          high = Math.max(high, v);
        }
      }
    }
    if (low > high) return is_log ? [1, 10] : [0, 1];
    // One curve that diverges leaves room for the others.
    if (keys.includes('y') && view.y_max > low) high = Math.min(high, view.y_max);
    if (is_log) {
      const margin = Math.max((high / low) ** 0.03, 1.02);
      return [low / margin, high * margin];
    }
    const margin = 0.03 * (high - low) || 0.5;
    return [low - margin, high + margin];
  }

  draw() {
    const view = this.view();
    const width = Math.max(280, this.box.clientWidth || 900);
    const height = Math.round(Math.min(460, Math.max(320, 0.45 * width)));
    const frame = {l: 62, r: width - 14, t: 30, b: height - 44};
    const old = this.box.querySelector('svg');
    if (old) old.remove();
    const svg = add(this.box, 'svg', {
      viewBox: `0 0 ${width} ${height}`, role: 'img',
      'aria-label': `${view.y} against ${view.x}`});
    const xs = this.zoom ? this.zoom.x : this.range(view, ['x'], view.log_x);
    const ys = this.zoom ? this.zoom.y :
        this.range(view, ['y', 'low', 'high'], view.log_y);
    this.x = new Axis(view.log_x, ...xs, frame.l, frame.r, view.x_ticks);
    this.y = new Axis(view.log_y, ...ys, frame.b, frame.t, view.y_ticks);
    this.drawAxes(svg, view, frame);
    const id = `clip${this.number}`;
    add(add(svg, 'clipPath', {id}), 'rect', {
      x: frame.l, y: frame.t, width: frame.r - frame.l,
      height: frame.b - frame.t});
    const group = add(svg, 'g', {'clip-path': `url(#${id})`});
    const shown = view.series.filter((s) => !hidden.has(s.name));
    for (const s of shown) this.drawBand(group, s);
    for (const s of shown) this.drawCurve(group, s, view.has_steps);
    this.mark = add(svg, 'circle', {r: 5, class: 'mark', visibility: 'hidden'});
    this.addPointer(svg, frame, shown);
    this.drawLegend(view);
    this.reset.hidden = this.zoom === null;
  }

  drawAxes(svg, view, frame) {
    for (const [v, label] of this.x.ticks) {
      const p = this.x.pixel(v);
      add(svg, 'line', {x1: p, x2: p, y1: frame.t, y2: frame.b, class: 'grid'});
      add(svg, 'text', {x: p, y: frame.b + 17, 'text-anchor': 'middle'}, label);
    }
    for (const [v, label] of this.y.ticks) {
      const p = this.y.pixel(v);
      add(svg, 'line', {x1: frame.l, x2: frame.r, y1: p, y2: p, class: 'grid'});
      add(svg, 'text', {x: frame.l - 7, y: p + 4, 'text-anchor': 'end'}, label);
    }
    add(svg, 'rect', {
      x: frame.l, y: frame.t, width: frame.r - frame.l,
      height: frame.b - frame.t, class: 'frame'});
    add(svg, 'text', {
      x: (frame.l + frame.r) / 2, y: frame.b + 37, 'text-anchor': 'middle',
      class: 'name'}, view.x);
    add(svg, 'text', {x: 4, y: 18, class: 'name'}, view.y);
  }

  points(s, key) {
    const found = [];
    for (let i = 0; i < s.x.length; ++i) {
      const is_there = this.x.shows(s.x[i]) && this.y.shows(s[key][i]);
      found.push(is_there ? [this.x.pixel(s.x[i]), this.y.pixel(s[key][i])] :
                            null);
    }
    return found;
  }

  drawBand(group, s) {
    if (!s.low) return;
    const low = this.points(s, 'low'), high = this.points(s, 'high');
    const both = [...low.keys()].filter((i) => low[i] && high[i]);
    const text = (ps) => ps.map((p) => `${p[0].toFixed(1)},${p[1].toFixed(1)}`);
    add(group, 'polygon', {
      points: [...text(both.map((i) => low[i])),
               ...text(both.map((i) => high[i]).reverse())].join(' '),
      fill: hue(s), class: 'band'});
  }

  drawCurve(group, s, has_steps) {
    let path = '';
    let pen = 'M';
    const points = this.points(s, 'y');
    for (const p of points) {
      const [x, y] = p ? p.map((v) => v.toFixed(1)) : [];
      if (p) path += pen === 'L' && has_steps ? `H${x}V${y}` : `${pen}${x} ${y}`;
      pen = p ? 'L' : 'M';
    }
    if (s.lines && path !== '') {
      add(group, 'path', {d: path, stroke: hue(s), 'stroke-dasharray': dash(s),
                          class: 'curve', 'data-name': s.name});
    }
    const drawn = points.filter((p) => p);
    if (!s.points && drawn.length > 1) return;
    for (const p of drawn) {
      add(group, 'circle', {cx: p[0], cy: p[1], r: 3, fill: hue(s)});
    }
  }

  drawLegend(view) {
    this.legend.textContent = '';
    for (const s of view.series) {
      const key = add(this.legend, 'button', {
        class: 'key', title: s.label, 'aria-pressed': !hidden.has(s.name)});
      const line = add(key, 'svg', {viewBox: '0 0 26 10', class: 'swatch'});
      add(line, 'line', {x1: 0, x2: 26, y1: 5, y2: 5, stroke: hue(s),
                         'stroke-width': 3, 'stroke-dasharray': dash(s)});
      add(key, 'span', {}, s.name);
      key.onclick = () => {
        if (!hidden.delete(s.name)) hidden.add(s.name);
        for (const chart of charts) chart.draw();
      };
    }
  }

  addPointer(svg, frame, shown) {
    const at = (event) => {
      const box = svg.getBoundingClientRect();
      const scale = svg.viewBox.baseVal.width / box.width;
      const clamp = (v, a, b) => Math.min(Math.max(v, a), b);
      return [clamp((event.clientX - box.left) * scale, frame.l, frame.r),
              clamp((event.clientY - box.top) * scale, frame.t, frame.b)];
    };
    let begin = null, area = null;
    svg.onpointerdown = (event) => {
      begin = at(event);
      area = add(svg, 'rect', {class: 'area'});
    };
    svg.onpointermove = (event) => {
      const [px, py] = at(event);
      if (begin === null) return this.hover(px, py, shown);
      area.setAttribute('x', Math.min(px, begin[0]));
      area.setAttribute('y', Math.min(py, begin[1]));
      area.setAttribute('width', Math.abs(px - begin[0]));
      area.setAttribute('height', Math.abs(py - begin[1]));
    };
    svg.onpointerup = (event) => {
      if (begin === null) return;
      const sorted = (a, b) => a < b ? [a, b] : [b, a];
      const [px, py] = at(event), [bx, by] = begin;
      begin = null;
      area.remove();
      if (Math.abs(px - bx) < 8 || Math.abs(py - by) < 8) return;
      this.setZoom({x: sorted(this.x.value(bx), this.x.value(px)),
                    y: sorted(this.y.value(by), this.y.value(py))});
    };
    svg.onpointerleave = () => {
      begin = null;
      if (area) area.remove();
      this.tip.hidden = true;
      this.mark.setAttribute('visibility', 'hidden');
    };
    svg.ondblclick = () => this.setZoom(null);
  }

  hover(px, py, shown) {
    let best = null;
    for (const s of shown) {
      this.points(s, 'y').forEach((p, i) => {
        if (!p) return;
        const distance = Math.hypot(p[0] - px, p[1] - py);
        if (best === null || distance < best.distance) {
          best = {distance, s, i, p};
        }
      });
    }
    const is_near = best !== null && best.distance < 60;
    this.tip.hidden = !is_near;
    this.mark.setAttribute('visibility', is_near ? 'visible' : 'hidden');
    if (!is_near) return;
    const {s, i, p} = best, view = this.view();
    this.tip.textContent = `${s.name}\n${view.y} ${format(s.y[i])}` +
        (s.low ? ` (${format(s.low[i])} to ${format(s.high[i])})` : '') +
        `\n${view.x} ${format(s.x[i])}`;
    this.mark.setAttribute('cx', p[0]);
    this.mark.setAttribute('cy', p[1]);
    this.mark.setAttribute('stroke', hue(s));
    const room = this.box.clientWidth - this.tip.offsetWidth;
    this.tip.style.left = `${Math.max(0, Math.min(p[0] + 12, room))}px`;
    this.tip.style.top = `${p[1] + 12}px`;
  }
}

// Numbers by size, then texts; "-" and empty cells last in both directions.
function sortTable(table, column, is_up) {
  const body = table.tBodies[0];
  const key = (row) => row.cells[column].textContent.trim();
  const is_none = (text) => text === '' || text === '-' || text === 'nan';
  const rows = [...body.rows];
  rows.sort((a, b) => {
    const [s, t] = [key(a), key(b)];
    if (is_none(s) || is_none(t)) return is_none(s) - is_none(t);
    const [u, v] = [parseFloat(s), parseFloat(t)];
    const order = isNaN(u) || isNaN(v) ? s.localeCompare(t) :
        u < v ? -1 : u > v ? 1 : 0;
    return is_up ? order : -order;
  });
  for (const row of rows) body.appendChild(row);
}

for (const table of document.querySelectorAll('table.sorts')) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    head.querySelector('button').onclick = () => {
      const is_up = head.getAttribute('aria-sort') !== 'ascending';
      for (const other of table.tHead.rows[0].cells) {
        other.removeAttribute('aria-sort');
      }
      head.setAttribute('aria-sort', is_up ? 'ascending' : 'descending');
      sortTable(table, column, is_up);
    };
  });
}
for (const figure of document.querySelectorAll('figure.chart')) {
  charts.push(new Chart(figure, DATA[charts.length]));
}
window.addEventListener('resize', () => {
  for (const chart of charts) chart.draw();
});
)js";

}  // namespace invgrad

#endif  // REPORT_HTML_SCRIPT_H_
