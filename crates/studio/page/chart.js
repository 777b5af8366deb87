// A chart of curves that share their samples, drawn by uPlot. Over time the abscissa is sorted, over depth it is not.
import { h, fill } from "./dom.js";

const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
const KEY_STEP_MM = { plain: 0.5, shift: 0.1 };
const charts = new Set();

// The colours of the theme; asking the style sheet in every frame would lay out the page each time.
const colours = new Map();
export function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
}
export function redrawAll() {
  colours.clear();
  for (const chart of charts) { chart.named = null; chart.paintLegend(); chart.u.redraw(false, true); }
}

const isNumber = v => v !== null && v === v;

export class Chart {
  // `x`, `y`: labels; `share`: part of the window's height.
  constructor(parent, { x, y, share = 0.34, label, sorted = true, legend = true }) {
    Object.assign(this, { sorted, share, hidden: new Set(), curves: [], bands: [], marks: [], partners: [], x: [] });
    this.legend = h("div", { class: "legend" });
    this.plot = h("div", { class: "plot", role: "group", "aria-label": label });
    this.reading = h("output", { class: "reading", "aria-live": "off" });
    parent.append(h("figure", { class: "chart" }, legend && this.legend, this.plot, this.reading));
    this.u = new uPlot(this.options(x, y), [[0, 1]], this.plot);
    new ResizeObserver(() => this.resize()).observe(this.plot);
    charts.add(this);
  }

  height() { return Math.round(Math.min(620, Math.max(150, innerHeight * this.share))); }

  resize() {
    const width = Math.max(200, this.plot.clientWidth), height = this.height();
    if (this.plot.clientWidth && (this.u.width !== width || this.u.height !== height)) this.u.setSize({ width, height });
  }

  options(x, y) {
    const keep = (u, min, max) => [min, max], soft = () => colour("soft"), grid = () => colour("grid");
    const axis = (label, extra) => ({ stroke: soft, label, labelSize: 18, labelGap: 2, gap: 4, font: `12px ${FONT}`, labelFont: `12px ${FONT}`,
      grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1, size: 5 }, border: { show: true, stroke: soft, width: 1 }, ...extra });
    return {
      width: 400, height: this.height(), legend: { show: false }, padding: [8, 12, 0, 0],
      cursor: { drag: { x: true, y: false, dist: 5 }, y: false, points: { show: false },
        bind: { dblclick: () => () => { this.reset(); return null; } } },
      scales: { x: { time: false, auto: false, range: keep }, y: { auto: false, range: keep } },
      series: [{}],
      axes: [axis(x, { size: 30, space: 60 }), axis(y, { scale: "y", size: 50, space: 34 })],
      hooks: {
        drawClear: [() => this.drawBands()],
        draw: [() => this.draw()],
        setScale: [(u, key) => { if (key === "x") queueMicrotask(() => this.scaled()); }],
        setCursor: [() => this.hover()],
      },
    };
  }

  // Curves: { x, y or low and high, colour, name, width, dash }. All have one abscissa, `x`, or none of their own.
  set({ x, curves, bands = [], marks = [], keepRange = false }) {
    Object.assign(this, { x, curves, bands, marks });
    let low = Infinity, high = -Infinity;
    for (const v of x) if (isNumber(v)) { if (v < low) low = v; if (v > high) high = v; }
    for (const band of bands) { low = Math.min(low, band.from); high = Math.max(high, band.to); }
    if (!(low < high)) { low = 0; high = 1; }
    this.extent = [low, high];
    this.paintLegend();
    this.showSample(-1);
    if (!keepRange || !this.drawn) this.reset();
    this.drawn = true;
    this.fit();
    this.u.redraw(false, false);
  }

  reset() {
    const [low, high] = this.extent || [0, 1], margin = this.sorted ? 0 : 0.02 * (high - low);
    this.u.setScale("x", { min: low - margin, max: high + margin });
    if (this.onzoom && this.zoomed) this.onzoom(null);
    this.zoomed = false;
  }

  scaled() {
    this.fit();
    const { min, max } = this.u.scales.x, [low, high] = this.extent || [0, 1];
    if (this.onzoom && max - min < 0.98 * (high - low) && !this.quiet) { this.zoomed = true; this.onzoom([min, max]); }
  }

  fit() {
    const { min, max } = this.u.scales.x;
    let low = 0, high = 0, any = false;
    for (const curve of this.visible()) for (const y of [curve.y, curve.low, curve.high]) {
      if (!y) continue;
      const xs = curve.x || this.x;
      for (let i = 0; i < y.length; i++) {
        if (!isNumber(y[i]) || xs[i] < min || xs[i] > max) continue;
        if (!any) { low = high = y[i]; any = true; }
        if (y[i] < low) low = y[i];
        if (y[i] > high) high = y[i];
      }
    }
    if (!any) { low = 0; high = 1; }
    if (low === high) { low -= 0.5; high += 0.5; }
    const span = high - low, room = this.bands.length || this.marks.length ? 0.16 : 0.05;
    this.u.setScale("y", { min: low - 0.05 * span, max: high + room * span });
  }

  visible() { return this.curves.filter(curve => !this.hidden.has(curve.name)); }

  paintLegend() {
    const names = new Map();
    for (const curve of this.curves) if (!names.has(curve.name)) names.set(curve.name, curve);
    const named = JSON.stringify([this.marks.length > 0, ...[...names.keys()].map(name => [name, this.hidden.has(name)])]);
    if (named === this.named) return;
    this.named = named;
    if (names.size < 2 && !this.marks.length) { fill(this.legend); return; }
    const items = [...names.values()].map(curve => {
      const swatch = h("span", { class: `swatch ${curve.dash ? "dashed" : ""}`, "aria-hidden": "true" });
      swatch.style.borderColor = colour(curve.colour);
      return h("button", { type: "button", class: "item", "aria-pressed": String(!this.hidden.has(curve.name)), onclick: () => this.toggle(curve.name) }, swatch, curve.name);
    });
    fill(this.legend, items);
  }

  toggle(name) {
    if (!this.hidden.delete(name)) this.hidden.add(name);
    this.paintLegend();
    this.fit();
  }

  // Pixels of a value on a linear scale.
  map(key) {
    const { min, max } = this.u.scales[key], from = this.u.valToPos(min, key, true), to = this.u.valToPos(max, key, true);
    const slope = (to - from) / (max - min);
    return v => from + (v - min) * slope;
  }

  clip() {
    const { ctx, bbox } = this.u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
  }

  drawBands() {
    const { ctx, bbox } = this.u, px = this.map("x");
    this.clip();
    for (const band of this.bands) {
      ctx.globalAlpha = 0.14;
      ctx.fillStyle = colour(band.colour);
      ctx.fillRect(px(band.from), bbox.top, px(band.to) - px(band.from), bbox.height);
    }
    ctx.restore();
  }

  draw() {
    const { ctx, bbox } = this.u, ratio = uPlot.pxRatio, px = this.map("x"), py = this.map("y");
    const { min, max } = this.u.scales.x;
    this.clip();
    ctx.lineJoin = "round";
    let points = 0;
    for (const curve of this.visible()) {
      const xs = curve.x || this.x, n = xs.length;
      ctx.strokeStyle = ctx.fillStyle = colour(curve.colour);
      ctx.lineWidth = (curve.width || 1.6) * ratio;
      ctx.setLineDash((curve.dash || []).map(d => d * ratio));
      ctx.beginPath();
      if (curve.low) {
        ctx.globalAlpha = 0.2;
        let open = false;
        for (let i = 0; i < n; i++) if (isNumber(curve.low[i])) { ctx[open ? "lineTo" : "moveTo"](px(xs[i]), py(curve.low[i])); open = true; }
        for (let i = n - 1; i >= 0; i--) if (isNumber(curve.high[i])) ctx.lineTo(px(xs[i]), py(curve.high[i]));
        ctx.fill();
        ctx.globalAlpha = 1;
        continue;
      }
      let pen = false;
      for (let i = 0; i < n; i++) {
        const y = curve.y[i];
        if (!isNumber(y) || (this.sorted && (xs[i + 1] < min || xs[i - 1] > max))) { pen = false; continue; }
        if (pen) ctx.lineTo(px(xs[i]), py(y));
        else ctx.moveTo(px(xs[i]), py(y));
        pen = true;
        points++;
      }
      ctx.stroke();
    }
    this.drawMarks(px);
    this.drawBandLabels(px);
    ctx.restore();
    this.plot.dataset.points = points;
    if (this.ondraw) this.ondraw();
  }

  write(text, x, y, ink) {
    const { ctx } = this.u;
    ctx.setLineDash([]);
    ctx.lineWidth = 3 * uPlot.pxRatio;
    ctx.strokeStyle = colour("halo");
    ctx.strokeText(text, x, y);
    ctx.fillStyle = ink;
    ctx.fillText(text, x, y);
  }

  drawMarks(px) {
    const { ctx, bbox } = this.u, ratio = uPlot.pxRatio;
    ctx.font = `${11 * ratio}px ${FONT}`;
    ctx.textBaseline = "top";
    ctx.textAlign = "left";
    const taken = [];
    for (const mark of this.marks) {
      const x = Math.round(px(mark.x));
      ctx.strokeStyle = colour(mark.colour);
      ctx.lineWidth = 1.5 * ratio;
      ctx.setLineDash((mark.dash || []).map(d => d * ratio));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      const width = ctx.measureText(mark.label).width + 8 * ratio, left = x + width > bbox.left + bbox.width ? x - width : x + 4 * ratio;
      const row = [0, 1].find(r => taken.every(([a, b, taken]) => taken !== r || left + width < a || left > b));
      if (row === undefined || x < bbox.left) continue;
      taken.push([left, left + width, row]);
      this.write(mark.label, left, bbox.top + (20 + 15 * row) * ratio, colour(mark.colour));
    }
  }

  drawBandLabels(px) {
    const { ctx, bbox } = this.u, ratio = uPlot.pxRatio;
    ctx.font = `600 ${11.5 * ratio}px ${FONT}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "top";
    for (const band of this.bands) {
      const a = Math.max(px(band.from), bbox.left), b = Math.min(px(band.to), bbox.left + bbox.width);
      let text = band.label;
      while (text.length > 2 && ctx.measureText(text).width > b - a - 6 * ratio) text = text.slice(0, -2) + "…";
      if (text.length > 2) this.write(text, (a + b) / 2, bbox.top + 4 * ratio, colour("ink"));
    }
  }

  // Index of the sample under the cursor: nearest in x, over depth nearest on the picture.
  indexUnder() {
    const { left, top } = this.u.cursor;
    if (!(left >= 0) || !this.x.length) return -1;
    const x = this.u.posToVal(left, "x");
    if (this.sorted) {
      let low = 0, high = this.x.length - 1;
      while (low < high) { const mid = (low + high) >> 1; if (this.x[mid] < x) low = mid + 1; else high = mid; }
      return low > 0 && x - this.x[low - 1] < this.x[low] - x ? low - 1 : low;
    }
    const curve = this.visible().find(c => c.y);
    if (!curve) return -1;
    const px = this.map("x"), py = this.map("y"), ratio = uPlot.pxRatio, { bbox } = this.u;
    const cx = bbox.left + left * ratio, cy = bbox.top + top * ratio;
    let best = -1, least = Infinity;
    for (let i = 0; i < this.x.length; i++) {
      if (!isNumber(curve.y[i])) continue;
      const dx = px(this.x[i]) - cx, dy = py(curve.y[i]) - cy, d = dx * dx * 9 + dy * dy;
      if (d < least) { least = d; best = i; }
    }
    return best;
  }

  hover() {
    if (!this.drawn) return;
    const index = this.indexUnder();
    this.showSample(index);
    for (const partner of this.partners) partner.showSample(index);
    if (this.onhover) this.onhover(index);
  }

  showSample(index) {
    if (!this.u) return;
    if (!this.dot) this.dot = this.u.over.appendChild(h("div", { class: "dot" }));
    const curve = this.visible().find(c => c.y), known = index >= 0 && curve && isNumber(curve.y[index]);
    this.dot.hidden = !known;
    if (known) Object.assign(this.dot.style, { left: `${this.u.valToPos(this.x[index], "x")}px`, top: `${this.u.valToPos(curve.y[index], "y")}px` });
  }
}

// A line at a depth that can be dragged and moved with the arrows. `moved(depth, last)`: `last` is false while the mouse moves.
export function handle(u, name, moved, grabbed = () => {}) {
  const element = h("div", { class: "face", role: "slider", tabindex: "0", "aria-orientation": "horizontal", "aria-label": name });
  const depthAt = event => u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x");
  let at = null, place = null;
  element.place = depth => {
    const left = u.valToPos(depth, "x");
    element.hidden = !(left >= -2 && left <= u.bbox.width / uPlot.pxRatio + 2);
    if (depth === at && left === place) return;
    [at, place] = [depth, left];
    element.style.transform = `translateX(${left}px)`;
    element.setAttribute("aria-valuenow", depth);
    element.setAttribute("aria-valuetext", `${depth} mm`);
  };
  element.addEventListener("mousedown", event => event.stopPropagation());
  element.addEventListener("pointerdown", event => {
    event.preventDefault();
    event.stopPropagation();
    element.focus();
    element.setPointerCapture(event.pointerId);
    element.classList.add("dragging");
    grabbed();
  });
  element.addEventListener("pointermove", event => { if (element.hasPointerCapture(event.pointerId)) moved(depthAt(event), false); });
  element.addEventListener("pointerup", event => {
    if (!element.hasPointerCapture(event.pointerId)) return;
    element.releasePointerCapture(event.pointerId);
    element.classList.remove("dragging");
    moved(depthAt(event), true);
  });
  element.addEventListener("keydown", event => {
    const direction = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!direction) return;
    event.preventDefault();
    grabbed();
    moved(at + direction * (event.shiftKey ? KEY_STEP_MM.shift : KEY_STEP_MM.plain), true);
  });
  u.over.append(element);
  return element;
}

export function link(...linked) {
  for (const chart of linked) chart.partners = linked.filter(other => other !== chart);
}
